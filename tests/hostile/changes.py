"""Changes of a mechanism after which its motion is known: other units, noise and rounding of its
numbers, a free base."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from linkwork.mechanism import (
    GROUND,
    Body,
    Frame,
    FreeJoint,
    Friction,
    GearJoint,
    Inertia,
    Joint,
    Mechanism,
    PairJoint,
    RodJoint,
    ScrewJoint,
    Spring,
    Tool,
)

SLIDES = ("slide", "x", "y", "z")


def slides(mechanism: Mechanism) -> frozenset[str]:
    """Return the coordinates, and so the rates, that are lengths; the others are angles and
    quaternions."""
    found = set()
    for name, joint in mechanism.pairs.items():
        labels = joint.coordinates(name)
        found |= {
            name if labels == (name,) else f"{name}.{freedom}"
            for freedom in joint.freedoms
            if freedom in SLIDES
        }
    return frozenset(found)


def units(mechanism: Mechanism, labels: tuple[str, ...], length: float) -> np.ndarray:
    """Return the unit of each coordinate or rate where lengths are counted in units of `length`."""
    own = slides(mechanism)
    return np.array([length if label in own else 1.0 for label in labels])


def force_units(mechanism: Mechanism, length: float, mass: float) -> np.ndarray:
    """Return the unit of each actuator's force (mass length / s^2) or moment (mass length^2 /
    s^2)."""
    own = slides(mechanism)
    return np.array(
        [mass * length * (1.0 if label in own else length) for label in mechanism.actuators]
    )


# Other units


def scaled(mechanism: Mechanism, length: float = 1.0, mass: float = 1.0) -> Mechanism:
    """Return the mechanism with all lengths and masses multiplied; time stays, so that it moves
    alike.

    Forces become mass length, moments mass length^2 times what they were.
    """
    own = slides(mechanism)

    def effects(linear: bool, friction: Friction, spring: Spring, rotor: float) -> dict[str, Any]:
        size, unit = (mass, length) if linear else (mass * length**2, 1.0)
        return {
            "friction": Friction(
                viscous=friction.viscous * size,
                coulomb=friction.coulomb * size * unit,
                coulomb_rate=friction.coulomb_rate * unit,
            ),
            "spring": Spring(
                stiffness=spring.stiffness * size,
                rest=spring.rest * unit,
                damping=spring.damping * size,
            ),
            "rotor_inertia": rotor * size,
        }

    def joint(one: Joint) -> Joint:
        if isinstance(one, GearJoint):
            ratios = {
                label: ratio / (length if label in own else 1.0)
                for label, ratio in one.ratios.items()
            }
            return one.model_copy(update={"ratios": ratios})
        update: dict[str, Any] = {"frames": tuple(placed(frame, length) for frame in one.frames)}
        if isinstance(one, ScrewJoint):
            update["pitch"] = one.pitch * length
        if isinstance(one, RodJoint):
            update["length"] = one.length * length
        parts = {
            f: effects(f in SLIDES, own.friction, own.spring, own.rotor)
            for f, own in one.effects().items()
        }
        if one.freedoms and hasattr(one, "rotor_inertia"):
            if isinstance(one.rotor_inertia, float):
                update |= parts[one.freedoms[0]]
            else:
                update |= {
                    field: {f: part[field] for f, part in parts.items()}
                    for field in next(iter(parts.values()))
                }
        return one.model_copy(update=update)

    springs = {
        name: spring.model_copy(
            update={
                "points": tuple(stretched(point, length) for point in spring.points),
                "rest_length": spring.rest_length * length,
                "stiffness": spring.stiffness * mass,
                "damping": spring.damping * mass,
            }
        )
        for name, spring in mechanism.springs.items()
    }
    return mechanism.model_copy(
        update={
            "name": f"{mechanism.name} x{length:g} m x{mass:g} kg",
            "gravity": stretched(mechanism.gravity, length),
            "bodies": {
                name: heavier(body, length, mass) for name, body in mechanism.bodies.items()
            },
            "joints": {name: joint(one) for name, one in mechanism.joints.items()},
            "springs": springs,
            "tools": {
                name: Tool(body=tool.body, frame=placed(tool.frame, length))
                for name, tool in mechanism.tools.items()
            },
            "reference": {
                label: value * (length if label in own else 1.0)
                for label, value in mechanism.reference.items()
            },
        }
    )


def heavier(body: Body, length: float, mass: float) -> Body:
    """Return a body of other size and mass."""
    moments = body.inertia.model_dump(
        exclude_none=True, include={"xx", "yy", "zz", "xy", "xz", "yz"}
    )
    inertia = Inertia(**{name: value * mass * length**2 for name, value in moments.items()})
    return Body(
        mass=body.mass * mass,
        centre_of_mass=stretched(body.centre_of_mass, length),
        inertia=inertia,
    )


def placed(frame: Frame, length: float) -> Frame:
    """Return a frame at another distance."""
    return Frame(position=stretched(frame.position, length), rotation=frame.rotation)


def stretched(vector: tuple[float, ...], factor: float) -> Any:
    return tuple(factor * x for x in vector)


# Numbers as computer-aided design writes them


def noisy(mechanism: Mechanism, seed: int, size: float = 1e-15) -> Mechanism:
    """Return the mechanism with noise in every number of its frames and axes; planar bodies get all
    their moments."""
    rng = np.random.default_rng(seed)
    return renumbered(
        spatial(mechanism),
        lambda x: x * (1 + size * rng.uniform(-1, 1)) + size * rng.uniform(-1, 1),
    )


def rounded(mechanism: Mechanism, digits: int = 6) -> Mechanism:
    """Return the mechanism with the numbers of its frames and axes rounded to so many decimals."""
    return renumbered(spatial(mechanism), lambda x: round(x, digits))


def renumbered(mechanism: Mechanism, number: Callable[[float], float]) -> Mechanism:
    """Return the mechanism with other numbers in its frames and axes."""

    def vector(values: tuple[float, ...]) -> Any:
        return tuple(float(number(x)) for x in values)

    def unit(values: tuple[float, ...]) -> Any:
        changed = np.array(vector(values))
        return tuple((changed / np.linalg.norm(changed)).tolist())

    def joint(one: Joint) -> Joint:
        if not isinstance(one, PairJoint):
            return one
        frames = tuple(
            Frame(position=vector(f.position), rotation=vector(f.rotation)) for f in one.frames
        )
        update: dict[str, Any] = {"frames": frames}
        if "axis" in type(one).model_fields:
            update["axis"] = unit(one.axis)  # pyright: ignore
        return one.model_copy(update=update)

    return mechanism.model_copy(
        update={"joints": {name: joint(one) for name, one in mechanism.joints.items()}}
    )


def spatial(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with all moments of inertia, where a body gives that about z alone."""

    def whole(body: Body) -> Body:
        zz = body.inertia.zz
        return (
            body.model_copy(update={"inertia": Inertia(xx=zz, yy=zz, zz=zz)})
            if body.inertia.planar
            else body
        )

    return mechanism.model_copy(
        update={"bodies": {name: whole(body) for name, body in mechanism.bodies.items()}}
    )


# Other grounds


def floating(mechanism: Mechanism, mass: float = 3.0) -> Mechanism:
    """Return the mechanism with its ground a free body, `base`, in a world without other
    contact."""

    def moved(one: Joint) -> Joint:
        if not isinstance(one, PairJoint):
            return one
        return one.model_copy(
            update={"connects": tuple("base" if b == GROUND else b for b in one.connects)}
        )

    base = Body(
        mass=mass, centre_of_mass=(0.1, -0.05, 0.02), inertia=Inertia(xx=0.2, yy=0.3, zz=0.25)
    )
    whole = spatial(mechanism)
    return whole.model_copy(
        update={
            "name": f"floating {mechanism.name}",
            "bodies": {"base": base, **whole.bodies},
            "joints": {"float": FreeJoint(connects=(GROUND, "base"))}
            | {n: moved(j) for n, j in whole.joints.items()},
            "springs": {
                name: spring.model_copy(
                    update={
                        "connects": tuple("base" if b == GROUND else b for b in spring.connects)
                    }
                )
                for name, spring in whole.springs.items()
            },
        }
    )
