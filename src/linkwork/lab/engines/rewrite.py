"""The same mechanism in other words, where an engine lacks a joint or an effect: rods as links,
joints as chains.

A rod without mass cannot be a link of a tree: the tree's mass matrix would be singular. But mass
points may be moved freely between bodies that hold the same point: a link of length l with a point
of mass m at either end, taken away from the bodies there, has the same energy, hence the same
motion. Its spin about itself stays at rest. As much as half the mass that a body can spare at these
points is taken: m < 1 / lambda, lambda the greatest eigenvalue of P' J^-1 P, where J = sum of m
[x; 1][x; 1]' over the body's mass and P = [x; 1] of the points.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import networkx as nx
import numpy as np

from linkwork.lab.engines.interface import EngineError
from linkwork.lab.engines.joints import MOTIONS, rods_of, turned
from linkwork.mechanism import (
    GROUND,
    Body,
    Frame,
    FreeJoint,
    Friction,
    Inertia,
    Joint,
    Mechanism,
    PairJoint,
    PrismaticJoint,
    RevoluteJoint,
    SphericalJoint,
    Spring,
)
from linkwork.mechanism.effects import Effects
from linkwork.mechanism.joints import EFFECTS, TURN, ManyFreedoms
from linkwork.mechanism.record import swapped

Vector3 = tuple[float, float, float]
Change = Callable[[str, Effects], Effects]


MASSLESS = Body(mass=0.0)
SPARE = 0.5  # part of the mass that a body can spare which its rods take


def inertia_tensor(body: Body) -> np.ndarray:
    """Return the inertia tensor about the mass centre in the body's axes, shape (3, 3) [kg m^2].

    A planar body gives zz alone; its xx and yy play no part in the motion, and xx = yy = zz make a
    valid rigid body.
    """
    return body.inertia.zz * np.eye(3) if body.inertia.planar else body.inertia.tensor()


def with_free_joints(mechanism: Mechanism) -> tuple[Mechanism, tuple[str, ...]]:
    """Hang the bodies that only rods reach on free joints to ground, and return them too.

    Of bodies that other joints connect to each other, the first one hangs. The free joints are the
    last joints.
    """
    graph = mechanism.graph()
    for name, rod in rods_of(mechanism).items():
        graph.remove_edge(*rod.connects, key=name)
    groups = [group for group in nx.connected_components(graph) if GROUND not in group]
    hung = tuple(next(body for body in mechanism.bodies if body in group) for group in groups)
    free = {f"{body}.free": FreeJoint.model_construct(connects=(GROUND, body)) for body in hung}
    return (swapped(mechanism, joints={**mechanism.joints, **free}) if hung else mechanism), hung


# Rods as links


def with_links(mechanism: Mechanism) -> Mechanism:
    """Replace every rod by a link between two spherical joints; joint coordinates of its own come
    last.

    Raises:
        EngineError: a body has no mass that its rods could borrow.
    """
    # Where rods hold which bodies.
    rods = rods_of(mechanism)
    if not rods:
        return mechanism
    held: dict[str, list[np.ndarray]] = {}
    for rod in rods.values():
        for body, frame in zip(rod.connects, rod.frames, strict=True):
            held.setdefault(body, []).append(np.array(frame.position))
    # A link's mass is borrowed from the bodies at its ends, which together move as before.
    spare = {
        body: spare_mass(mechanism, body, np.array(points))
        for body, points in held.items()
        if body != GROUND
    }
    bodies = {
        name: lightened(body, spare[name], np.array(held[name])) if name in spare else body
        for name, body in mechanism.bodies.items()
    }
    # A rod is a link between two balls.
    joints: dict[str, Joint] = {
        name: joint for name, joint in mechanism.joints.items() if name not in rods
    }
    for name, rod in rods.items():
        (first, second), link = rod.connects, f"{name}.link"
        ends = spare.get(first, spare.get(second, 0.0)), spare.get(second, spare.get(first, 0.0))
        bodies[link] = dumbbell(rod.length, *ends)
        far = Frame(position=(0.0, 0.0, rod.length))
        joints[f"{name}.near"] = SphericalJoint.model_construct(
            connects=(first, link), frames=(rod.frames[0], Frame())
        )
        joints[f"{name}.far"] = SphericalJoint.model_construct(
            connects=(link, second), frames=(far, rod.frames[1])
        )
    return swapped(mechanism, bodies=bodies, joints=joints)


def spare_mass(mechanism: Mechanism, name: str, points: np.ndarray) -> float:
    """Return the mass that a body gives to each rod that holds one of these points (n, 3) [kg]."""
    body = mechanism.bodies[name]
    J, P = moments(body), homogeneous(points)
    # Lengths and the unit of mass differ in size.
    scale = np.sqrt(np.where(np.diag(J) > 0, np.diag(J), 1.0))
    J, P = J / np.outer(scale, scale), P / scale[:, None]
    inverse = np.linalg.pinv(J, rcond=1e-10, hermitian=True)
    greatest = float(np.linalg.eigvalsh(P.T @ inverse @ P)[-1])
    if not body.mass or np.max(abs(P - J @ inverse @ P)) > 1e-6 * np.max(abs(P)):
        raise EngineError(
            f"bodies.{name}: has no mass around the rods' ends to share with them; give it mass "
            "and inertia"
        )
    return SPARE / greatest


def moments(body: Body) -> np.ndarray:
    """Return J, the integral of [x; 1][x; 1]' over the body's mass, shape (4, 4), x in the body's
    frame."""
    c = homogeneous(np.array([body.centre_of_mass]))
    tensor = inertia_tensor(body)
    J = body.mass * (c @ c.T)
    J[:3, :3] += np.trace(tensor) / 2 * np.eye(3) - tensor
    return J


def homogeneous(points: np.ndarray) -> np.ndarray:
    """Return [x; 1] of points (n, 3) as columns (4, n)."""
    return np.vstack([points.T, np.ones(len(points))])


def lightened(body: Body, mass: float, points: np.ndarray) -> Body:
    """Return a body without mass points of this mass at these points (n, 3)."""
    P = homogeneous(points)
    J = moments(body) - mass * P @ P.T
    centre = J[:3, 3] / J[3, 3]
    second = J[:3, :3] - J[3, 3] * np.outer(centre, centre)
    I = np.trace(second) * np.eye(3) - second  # noqa: E741
    inertia = Inertia(
        xx=I[0, 0],
        yy=I[1, 1],
        zz=I[2, 2],
        xy=I[0, 1],
        xz=I[0, 2],
        yz=I[1, 2],
        moments=body.inertia.moments,
    )
    return Body(mass=J[3, 3], centre_of_mass=vector(centre), inertia=inertia)


def dumbbell(length: float, near: float, far: float) -> Body:
    """Return a link along z with mass points at its ends; zz, which its spin at rest does not feel,
    is half of xx."""
    mass = near + far
    across = near * far / mass * length**2
    return Body(
        mass=mass,
        centre_of_mass=(0.0, 0.0, far / mass * length),
        inertia=Inertia(xx=across, yy=across, zz=across / 2),
    )


# Joints of many freedoms as chains


def in_steps(mechanism: Mechanism, names: set[str]) -> Mechanism:
    """Replace these joints by chains of joints of one freedom (and a spherical one) with massless
    bodies in between.

    The joints of a chain are called so that all coordinates and rates keep their names and their
    order.
    """
    joints: dict[str, Joint] = {}
    links: list[str] = []
    for name, joint in mechanism.joints.items():
        if name not in names or not isinstance(joint, PairJoint) or len(joint.freedoms) < 2:
            joints[name] = joint
            continue
        first, last = joint.connects
        between = [f"{name}.{freedom}.link" for freedom in joint.freedoms[:-1]]
        bodies = [first, *between, last]
        for freedom, axis, *connects in zip(
            joint.freedoms, axes(joint), bodies, bodies[1:], strict=False
        ):
            frames = (
                joint.frames[0] if connects[0] == first else Frame(),
                joint.frames[1] if connects[1] == last else Frame(),
            )
            own = {"connects": tuple(connects), "frames": frames}
            acting = effects_by_field(joint, freedom)
            if axis is None:
                turning = {field: {freedom: value} for field, value in acting.items()}
                joints[name] = SphericalJoint.model_construct(None, **own, **turning)
            else:
                kind = RevoluteJoint if freedom.startswith("angle") else PrismaticJoint
                joints[f"{name}.{freedom}"] = kind.model_construct(None, **own, axis=axis, **acting)
        links += between
    added = dict.fromkeys(links, MASSLESS)
    return swapped(mechanism, bodies={**mechanism.bodies, **added}, joints=joints)


def axes(joint: PairJoint) -> list[Vector3 | None]:
    """Return the axis of each freedom in its own frames; a ball has none."""
    own = turned(joint)[:3, :3]
    return [
        None if motion == "ball" else vector(own @ axis) for motion, axis in MOTIONS[joint.type]
    ]


def effects_by_field(joint: PairJoint, freedom: str) -> dict[str, Any]:
    """Return one freedom's effects by the name of their field."""
    return dict(zip(EFFECTS, joint.effects()[freedom], strict=True))


def vector(values: np.ndarray) -> Vector3:
    """Return three numbers as a tuple."""
    x, y, z = map(float, values)
    return x, y, z


# Effects apart, where a model file holds some of them otherwise


def effects_apart(mechanism: Mechanism) -> tuple[Mechanism, Mechanism]:
    """Return a mechanism with the effects that MuJoCo has as they are, and one with the others;
    limits are left out.

    MuJoCo's dry friction holds still at rest, and it measures the turn of a ball from home.
    """

    def with_all(change: Change) -> Mechanism:
        joints = {name: with_effects(joint, change) for name, joint in mechanism.joints.items()}
        return swapped(mechanism, joints=joints)

    return with_all(in_mujoco), with_all(beside_mujoco)


def in_mujoco(freedom: str, own: Effects) -> Effects:
    """Return viscous friction, dampers, the springs of hinges and slides, and rotors."""
    pull = Spring(damping=own.spring.damping) if freedom == TURN else own.spring
    return Effects(Friction(viscous=own.friction.viscous), pull, rotor=own.rotor)


def beside_mujoco(freedom: str, own: Effects) -> Effects:
    """Return Coulomb friction and the springs of balls."""
    pull = Spring(stiffness=own.spring.stiffness) if freedom == TURN else Spring()
    return Effects(own.friction.model_copy(update={"viscous": 0.0}), pull)


def with_effects(joint: Joint, change: Change) -> Joint:
    """Return a joint with the effects of all its freedoms changed."""
    found = {freedom: change(freedom, effects) for freedom, effects in joint.effects().items()}
    columns = zip(EFFECTS, zip(*found.values(), strict=True), strict=False)
    many = isinstance(joint, ManyFreedoms)
    fields = {
        field: dict(zip(found, own, strict=True)) if many else own[0] for field, own in columns
    }
    return swapped(joint, **fields)
