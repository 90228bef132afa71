"""Random mechanisms with fixed seeds, assembled by construction: open trees and closed loops,
planar and spatial.

Bodies get random poses first; each joint is then put at a random place between its two bodies, so
that every loop is closed at the reference, whatever the joint's random reference coordinate is. A
loop of j one-freedom joints adds j - 6 freedoms (planar: j - 3); the actuated joints are those that
determine the motion best.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.mechanism import (
    GROUND,
    Body,
    FixedJoint,
    Frame,
    Inertia,
    Joint,
    Mechanism,
    PrismaticJoint,
    RevoluteJoint,
)

from tests.oracle.lagrange import LagrangeOracle, OracleError

Edge = tuple[str, str, str]  # first body, second body, type of joint
GRAVITY = {True: (1.3, -9.2, 0.0), False: (1.3, -2.1, -9.2)}


def open_tree(seed: int, bodies: int = 5, planar: bool = False) -> Mechanism:
    """Build a tree of bodies with revolute, prismatic and some fixed joints; all its joints that
    move are actuated."""
    rng = np.random.default_rng(seed)
    edges: list[Edge] = []
    for i in range(1, bodies + 1):
        before = (
            GROUND if i == 1 else str(rng.choice([GROUND, *(f"body_{k}" for k in range(1, i))]))
        )
        edges.append(
            (
                before,
                f"body_{i}",
                str(rng.choice(["revolute", "prismatic", "fixed"], p=[0.6, 0.3, 0.1])),
            )
        )
    return assembled(f"tree {seed}", edges, rng, planar)


def planar_loops(seed: int, loops: int = 2, freedoms: int = 1) -> Mechanism:
    """Build a planar mechanism; its first loop brings `freedoms`, each further one none or one
    more."""
    rng = np.random.default_rng(seed)
    return assembled(f"planar loops {seed}", looped(rng, loops, 3, freedoms), rng, planar=True)


def spatial_loops(seed: int, loops: int = 1, freedoms: int = 1) -> Mechanism:
    """Build a spatial mechanism; its first loop brings `freedoms`, each further one none or one
    more."""
    rng = np.random.default_rng(seed)
    return assembled(f"spatial loops {seed}", looped(rng, loops, 6, freedoms), rng, planar=False)


def random_state(
    mechanism: Mechanism, rng: np.random.Generator, spread: float = 0.2
) -> tuple[np.ndarray, np.ndarray]:
    """Return joint coordinates (m,) of an assembled configuration near the reference, and actuated
    rates (n,)."""
    oracle = LagrangeOracle(mechanism)
    reference, n = oracle.reference, len(mechanism.actuators)
    actuated = [oracle.moving.index(name) for name in mechanism.actuators]
    while True:
        try:
            q = oracle.assemble(reference, reference[actuated] + rng.uniform(-spread, spread, n))
        except OracleError:
            spread /= 2
            continue
        if np.max(abs(q - reference)) < 10 * spread:
            return q, rng.normal(size=n)
        spread /= 2


def looped(rng: np.random.Generator, loops: int, closure: int, freedoms: int) -> list[Edge]:
    """Connect chains at both ends to what is there, weld one body into the first and hang a branch
    on the last."""
    edges: list[Edge] = []
    bodies = [GROUND]
    for loop in range(loops):
        count = closure + (freedoms if loop == 0 else int(rng.integers(0, 2)))
        start, end = (
            (GROUND, GROUND)
            if loop == 0
            else (str(name) for name in rng.choice(bodies, 2, replace=False))
        )
        types = ["revolute"] * count
        types[int(rng.integers(count))] = "prismatic"
        if loop == 0:
            types.insert(int(rng.integers(1, count)), "fixed")
        chain = [f"body_{len(bodies) + k}" for k in range(len(types) - 1)]
        edges += zip([start, *chain], [*chain, end], types, strict=True)
        bodies += chain
    branch = f"body_{len(bodies)}"
    return [*edges, (bodies[-1], branch, "revolute")]


def assembled(
    name: str, edges: Iterable[Edge], rng: np.random.Generator, planar: bool
) -> Mechanism:
    """Place the bodies at random, put a joint for every edge between its bodies, and choose the
    actuators."""
    edges = [(b, a, kind) if rng.random() < 0.5 else (a, b, kind) for a, b, kind in edges]
    bodies = sorted(
        {body for edge in edges for body in edge[:2]} - {GROUND}, key=lambda body: int(body[5:])
    )
    poses = {GROUND: np.eye(4)} | {body: random_pose(rng, planar) for body in bodies}
    joints, reference = {}, {}
    for i, (first, second, kind) in enumerate(edges, start=1):
        joints[f"joint_{i}"], coordinate = random_joint(rng, planar, (first, second), kind, poses)
        if kind != "fixed":
            reference[f"joint_{i}"] = coordinate
    passive = Mechanism(
        name=name,
        gravity=GRAVITY[planar],
        bodies={body: random_body(rng, planar) for body in bodies},
        joints=joints,
        reference=reference,
    )
    actuators = LagrangeOracle(passive).independent_joints(np.array(list(reference.values())))
    return passive.model_copy(update={"actuators": actuators})


def random_pose(rng: np.random.Generator, planar: bool, spread: float = 1.0) -> np.ndarray:
    """Return a random pose X: position within +-spread [m], any orientation (planar: about z)."""
    X = np.eye(4)
    turn, position = rng.uniform(-2, 2, 3), rng.uniform(-spread, spread, 3)
    if planar:
        turn[:2] = position[2] = 0
    X[:3, :3], X[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), position
    return X


def random_joint(
    rng: np.random.Generator,
    planar: bool,
    connects: tuple[str, str],
    kind: str,
    poses: dict[str, np.ndarray],
) -> tuple[Joint, float]:
    """Return a joint between two placed bodies and the coordinate at which its frames fit."""
    X_1, X_2 = (poses[body] for body in connects)
    X_F = random_pose(rng, planar, 0.3)
    X_F[:3, 3] += (X_1[:3, 3] + X_2[:3, 3]) / 2
    axis, coordinate, motion = rng.normal(size=3), float(rng.uniform(-1, 1)), np.eye(4)
    if planar:
        axis *= (0, 0, 1) if kind == "revolute" else (1, 1, 0)
    axis /= np.linalg.norm(axis)
    if kind == "revolute":
        motion[:3, :3] = Rotation.from_rotvec(coordinate * axis).as_matrix()
    elif kind == "prismatic":
        motion[:3, 3] = coordinate * axis
    frames = (frame(np.linalg.inv(X_1) @ X_F), frame(np.linalg.inv(X_2) @ X_F @ motion))
    match kind:
        case "revolute":
            return RevoluteJoint(connects=connects, frames=frames, axis=tuple(axis)), coordinate
        case "prismatic":
            return PrismaticJoint(connects=connects, frames=frames, axis=tuple(axis)), coordinate
        case _:
            return FixedJoint(
                connects=connects, frames=(frames[0], frame(np.linalg.inv(X_2) @ X_F))
            ), 0.0


def random_body(rng: np.random.Generator, planar: bool) -> Body:
    """Return a body of 0.5 to 2 kg; its inertia is that of a random cloud of mass, so it is
    physical."""
    mass, centre = float(rng.uniform(0.5, 2)), rng.uniform(-0.3, 0.3, 3)
    spread = rng.normal(scale=0.2, size=(3, 3))
    second_moment = mass * spread @ spread.T
    I = np.trace(second_moment) * np.eye(3) - second_moment  # noqa: E741
    if planar:
        return Body(
            mass=mass, centre_of_mass=(centre[0], centre[1], 0.0), inertia=Inertia(zz=I[2, 2])
        )
    inertia = Inertia(xx=I[0, 0], yy=I[1, 1], zz=I[2, 2], xy=I[0, 1], xz=I[0, 2], yz=I[1, 2])
    return Body(mass=mass, centre_of_mass=tuple(centre), inertia=inertia)


def frame(X: np.ndarray) -> Frame:
    """Return the frame of pose X."""
    return Frame(
        position=tuple(X[:3, 3]), rotation=tuple(Rotation.from_matrix(X[:3, :3]).as_rotvec())
    )
