"""The mechanism's own length, in which thresholds are told: none depends on the unit that a
description is written in.

It is the largest extent of what a body holds, its joints and its mass centre, or a rod's length.
Where these vanish it is the radius of gyration, then the largest slide of the reference; a
mechanism without any length has 1 m. They vanish where they are rounding beside that radius, unless
it is one that no body has: inertias far too great do not make a point of a robot.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from linkwork.equations.algebra import present
from linkwork.equations.joints import held_length
from linkwork.mechanism import Combination, Displacement, Mechanism, Thrust
from linkwork.mechanism.joints import SLIDES, PairJoint

ROUNDING = 1e-9
"""Part of the largest coordinate, and of the radius of gyration, below which an extent is none."""
WIDEST = 1e6
"""Radius of gyration [m] above which it is a wrong inertia's, and tells nothing of extents."""


def own_length(mechanism: Mechanism) -> float:
    """Return the length [m] that is characteristic of a mechanism, all of whose numbers are
    given."""
    points = held_points(mechanism).values()
    extents = [float(np.linalg.norm(np.ptp(own, axis=0))) for own in points]
    extents += held_lengths(mechanism.pairs.values())
    farthest = max((float(np.abs(own).max()) for own in points), default=0.0)
    gyration = radius_of_gyration(mechanism)
    size = gyration if gyration < WIDEST else 0.0
    if max(extents, default=0.0) > ROUNDING * max(farthest, size):
        return max(extents)
    lengths = {label for label, unit in slides(mechanism).items() if unit}
    slid = [abs(value) for label, value in mechanism.reference.items() if label in lengths]
    return gyration or max(slid, default=0.0) or 1.0


def loop_length(mechanism: Mechanism, loop: Collection[str]) -> float:
    """Return the way [m] along the bodies of a loop of joints from one joint's frame to the next,
    rods included."""
    joints = [joint for name in loop if isinstance(joint := mechanism.joints.get(name), PairJoint)]
    ways = [float(np.linalg.norm(np.ptp(own, axis=0))) for own in joint_points(joints).values()]
    return sum(held_lengths(joints)) + sum(ways)


def held_points(mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Return the origins of the joints' frames on each body that joints hold, and its mass centre,
    in its own frame."""
    points = joint_points(mechanism.pairs.values())
    for name, body in mechanism.bodies.items():
        points.setdefault(name, []).extend([body.centre_of_mass] if body.mass > 0 else [])
    return {name: np.array(own, float) for name, own in points.items() if own}


def joint_points(joints: Iterable[PairJoint]) -> dict[str, list[tuple[float, float, float]]]:
    """Return the origins of joints' frames on each body that they hold, in its own frame."""
    points: dict[str, list[tuple[float, float, float]]] = {}
    for joint in joints:
        for body, frame in zip(joint.connects, joint.frames, strict=True):
            points.setdefault(body, []).append(frame.position)
    return points


def held_lengths(joints: Iterable[PairJoint]) -> list[float]:
    """Return the lengths [m] of the rods among some joints."""
    lengths = map(held_length, joints)
    return [length for length in lengths if length is not None]  # pyright: ignore


def radius_of_gyration(mechanism: Mechanism) -> float:
    """Return that of all bodies together, each about its mass centre; 0 where nothing has mass."""
    mass = sum(body.mass for body in mechanism.bodies.values())
    inertia = sum(float(np.abs(body.inertia.tensor()).max()) for body in mechanism.bodies.values())
    return float(np.sqrt(inertia / mass)) if mass > 0 else 0.0


def slides(mechanism: Mechanism) -> dict[str, bool]:
    """Tell of every joint coordinate, rate and transmission, by name, whether it is a length; else
    it is an angle or a quaternion's."""
    found = {
        label: part.name in SLIDES
        for name, joint in mechanism.pairs.items()
        for part in joint.parts(name)
        for label in (*part.coordinates, *part.rates)
    }
    for name, line in mechanism.transmissions.items():
        if isinstance(line, Combination):
            found[name] = any(found[of] for of, ratio in line.ratios.items() if present(ratio))
        else:
            found[name] = not isinstance(line, Thrust | Displacement) or any(
                map(present, line.force)
            )
    return found
