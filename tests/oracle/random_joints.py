"""Random mechanisms of all joint types with fixed seeds, assembled by construction: trees, loops,
rods, gears, effects.

Bodies get random poses first; each joint is then put at a random place between two bodies, in
either order, and its second frame where the joint's motion at a random coordinate takes it, so that
every loop is closed at the reference. A joint with k constraint rows leaves a loop 6 - k freedoms
(planar: 3 - k); a chain closes a loop when its joints' freedoms reach 6 (3), and what they have
more is mobility. Rods and gears take one freedom each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from linkwork.mechanism import (
    GROUND,
    CylindricalJoint,
    FixedJoint,
    Frame,
    FreeJoint,
    Friction,
    GearJoint,
    Mechanism,
    PairJoint,
    PlanarJoint,
    PointSpring,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    SphericalJoint,
    Spring,
    UniversalJoint,
)

from tests.oracle import pairs
from tests.oracle.maximal import MaximalOracle, Poses, Twists
from tests.oracle.random_mechanisms import GRAVITY, random_body

Edge = tuple[str, str, str]  # first body, second body, type of joint

TYPES = {
    "fixed": FixedJoint,
    "revolute": RevoluteJoint,
    "prismatic": PrismaticJoint,
    "screw": ScrewJoint,
    "cylindrical": CylindricalJoint,
    "universal": UniversalJoint,
    "spherical": SphericalJoint,
    "planar": PlanarJoint,
    "free": FreeJoint,
    "rod": RodJoint,
}
FREEDOMS = {
    False: {"fixed": 0, "revolute": 1, "prismatic": 1, "screw": 1, "cylindrical": 2, "universal": 2}
    | {"spherical": 3, "planar": 3, "rod": 5, "free": 6},
    True: {"fixed": 0, "revolute": 1, "prismatic": 1, "rod": 2, "planar": 3},
}
SLIDES = {"prismatic": 1, "cylindrical": 1, "planar": 2}
CHAIN = {  # what loops are made of, and how often
    False: {
        "revolute": 6,
        "prismatic": 2,
        "screw": 2,
        "cylindrical": 2,
        "universal": 4,
        "spherical": 3,
        "planar": 1,
    },
    True: {"revolute": 5, "prismatic": 2},
}
TREE = {  # what trees are made of
    False: (
        "revolute",
        "prismatic",
        "screw",
        "cylindrical",
        "universal",
        "spherical",
        "planar",
        "free",
        "fixed",
    ),
    True: ("revolute", "prismatic", "planar", "fixed"),
}


def random_tree(
    seed: int,
    bodies: int = 6,
    *,
    planar: bool = False,
    kinds: Sequence[str] = (),
    effects: bool = False,
    gears: int = 0,
    actuation: int = 0,
) -> Mechanism:
    """Build an open tree; its joint types are `kinds` over and over, or shuffled from all
    (planar: all planar ones).

    `effects` adds friction, springs, dampers, rotors and two point springs. There are as many
    actuators as freedoms plus `actuation`, where the rates are enough.
    """
    rng = np.random.default_rng(seed)
    names = [f"body_{i}" for i in range(1, bodies + 1)]
    chosen = [str(kind) for kind in kinds or rng.permutation(TREE[planar])]
    edges = [
        (str(rng.choice([GROUND, *names[:i]])), name, chosen[i % len(chosen)])
        for i, name in enumerate(names)
    ]
    return built(f"tree {seed}", edges, rng, planar, effects, gears, actuation)


def random_loops(
    seed: int,
    loops: int = 2,
    *,
    freedoms: int = 1,
    planar: bool = False,
    kinds: Sequence[str] = (),
    effects: bool = False,
    gears: int = 0,
    rods: int = 0,
    platform: Literal["", "bare", "free"] = "",
    actuation: int = 0,
) -> Mechanism:
    """Build closed loops of mixed types with so many `freedoms`, and a branch on a revolute joint
    that adds one.

    `kinds` prescribes the first loop's chain. `rods` and `gears` are added, and the first chain
    made longer for them. A "bare" platform hangs on six rods alone; a "free" one has a free joint
    to ground as well. For the others, see `random_tree`.
    """
    rng = np.random.default_rng(seed)
    bodies, edges = [GROUND], []
    for loop in range(loops):
        start, end = (
            (GROUND, GROUND)
            if loop == 0
            else (str(name) for name in rng.choice(bodies, 2, replace=False))
        )
        extra = freedoms + gears + rods if loop == 0 else 0
        chain = list(kinds) if kinds and loop == 0 else random_chain(rng, planar, extra)
        between = [f"body_{len(bodies) + k}" for k in range(len(chain) - 1)]
        edges += zip([start, *between], [*between, end], chain, strict=True)
        bodies += between
    branch = f"body_{len(bodies)}"
    edges.append((bodies[-1], branch, "revolute"))
    bodies.append(branch)
    edges += [(*rng.choice(bodies, 2, replace=False).tolist(), "rod") for _ in range(rods)]
    if platform:
        top = f"body_{len(bodies)}"
        edges += [(str(rng.choice(bodies)), top, "rod") for _ in range(6)]
        edges += [(GROUND, top, "free")] * (platform == "free")
    return built(f"loops {seed}", edges, rng, planar, effects, gears, actuation)


def tilted(mechanism: Mechanism, seed: int = 0) -> Mechanism:
    """Move a mechanism and its gravity as a whole: the same mechanism, but not in a coordinate
    plane."""
    p_0, R_0 = random_pose(np.random.default_rng(seed), planar=False)

    def moved(body: str, frame: Frame) -> Frame:
        p, R = np.array(frame.position), pairs.exponential(frame.rotation)
        return framed(p_0 + R_0 @ p, R_0 @ R) if body == GROUND else frame

    joints = {
        name: joint.model_copy(update={"frames": tuple(map(moved, joint.connects, joint.frames))})
        for name, joint in mechanism.pairs.items()
    }
    springs = {
        name: spring.model_copy(
            update={
                "points": tuple(
                    moved(body, Frame(position=point)).position
                    for body, point in zip(spring.connects, spring.points, strict=True)
                )
            }
        )
        for name, spring in mechanism.springs.items()
    }
    gravity = tuple(R_0 @ mechanism.gravity)
    joints = {name: joints.get(name, joint) for name, joint in mechanism.joints.items()}
    return mechanism.model_copy(update={"gravity": gravity, "joints": joints, "springs": springs})


def random_motion(
    oracle: MaximalOracle, rng: np.random.Generator, spread: float = 0.2, start: Poses | None = None
) -> tuple[Poses, Twists]:
    """Return the poses of an assembled configuration near the reference (or `start`), and twists
    that fit it."""
    start = oracle.reference_poses() if start is None else start
    size = 6 * len(oracle.mechanism.bodies)
    N = oracle.motions(start)
    poses = oracle.assemble(oracle.moved(start, spread * N @ (N.T @ rng.normal(size=size))))
    N = oracle.motions(poses)
    return poses, oracle.by_body(N @ (N.T @ rng.normal(size=size)))


def random_chain(rng: np.random.Generator, planar: bool, extra: int = 0) -> list[str]:
    """Return the types of a chain whose freedoms close a loop and leave `extra`.

    Few slides, and one spherical joint, keep random loops clear of dependent rows and idle spins.
    """
    freedoms, chain = FREEDOMS[planar], []
    while (left := (3 if planar else 6) + extra - sum(freedoms[kind] for kind in chain)) > 0:
        slides = 2 - sum(SLIDES.get(kind, 0) for kind in chain)
        fitting = {
            kind: often
            for kind, often in CHAIN[planar].items()
            if freedoms[kind] <= left
            and SLIDES.get(kind, 0) <= slides
            and not (kind == "spherical" and kind in chain)
        }
        chances = np.array([*fitting.values()])
        chain.append(str(rng.choice([*fitting], p=chances / chances.sum())))
    if rng.random() < 0.3:
        chain.append("fixed")
    return [str(kind) for kind in rng.permutation(chain)]


def built(
    name: str,
    edges: Iterable[Edge],
    rng: np.random.Generator,
    planar: bool,
    effects: bool,
    gears: int,
    actuation: int,
) -> Mechanism:
    """Place the bodies at random, put a joint for every edge between its bodies, add the rest,
    choose the actuators."""
    edges = [(b, a, kind) if rng.random() < 0.5 else (a, b, kind) for a, b, kind in edges]
    bodies = sorted(
        {body for edge in edges for body in edge[:2]} - {GROUND}, key=lambda body: int(body[5:])
    )
    poses = {GROUND: (np.zeros(3), np.eye(3))} | {body: random_pose(rng, planar) for body in bodies}
    poses |= {body: random_pose(rng, planar, 0.1, 0.1) for body in only_rods(edges)}
    joints: dict[str, Any] = {}
    reference: dict[str, float] = {}
    for i, (first, second, kind) in enumerate(edges, start=1):
        joint, q = random_joint(rng, planar, (first, second), kind, poses)
        joints[f"{kind}_{i}"] = (
            joint.model_copy(update=random_effects(rng, joint)) if effects else joint
        )
        reference |= zip(joint.coordinates(f"{kind}_{i}"), q, strict=True)
    joints |= {f"gear_{i + 1}": random_gear(rng, reference) for i in range(gears)}
    names = [GROUND, *bodies]
    mechanism = Mechanism(
        name=name,
        gravity=GRAVITY[planar],
        bodies={body: random_body(rng, planar) for body in bodies},
        joints=joints,
        springs={f"spring_{i + 1}": random_spring(rng, planar, names) for i in range(2 * effects)},
        reference=reference,
    )
    return actuated(mechanism, poses, actuation)


def actuated(mechanism: Mechanism, poses: Poses, actuation: int = 0) -> Mechanism:
    """Actuate the rates that determine the motion best, `actuation` more (in the rates' order) or
    fewer."""
    best = MaximalOracle(mechanism).independent_rates(poses)
    others = [rate for rate in mechanism.rates if rate not in best]
    chosen = [*best[: len(best) + min(actuation, 0)], *others[: max(actuation, 0)]]
    return mechanism.model_copy(update={"actuators": tuple(chosen)})


def random_joint(
    rng: np.random.Generator, planar: bool, connects: tuple[str, str], kind: str, poses: Poses
) -> tuple[PairJoint, np.ndarray]:
    """Return a joint between two placed bodies and the coordinates at which its frames fit."""
    (p_1, R_1), (p_2, R_2) = (poses[body] for body in connects)
    p_F, R_F = random_pose(rng, planar, 0.3)
    p_F = p_F + (p_1 + p_2) / 2
    form = random_form(rng, planar, kind)
    q = random_coordinates(rng, TYPES[kind](connects=connects, **form))
    if kind == "rod":
        R, p = random_pose(rng, planar, 0.5)[::-1]
        form["length"] = float(np.linalg.norm(p))
    else:
        R, p = pairs.motion(TYPES[kind](connects=connects, **form), q)
    frames = (
        framed(R_1.T @ (p_F - p_1), R_1.T @ R_F),
        framed(R_2.T @ (p_F + R_F @ p - p_2), R_2.T @ R_F @ R),
    )
    return TYPES[kind](connects=connects, frames=frames, **form), q


def random_form(rng: np.random.Generator, planar: bool, kind: str) -> dict[str, Any]:
    """Return the axes and sizes of a joint of this type."""
    across = (1, 1, 0) if kind == "prismatic" else (0, 0, 1)
    axis = unit(rng.normal(size=3) * (across if planar else 1))
    match kind:
        case "revolute" | "prismatic" | "cylindrical":
            return {"axis": axis}
        case "screw":
            return {"axis": axis, "pitch": float(rng.choice([-1, 1]) * rng.uniform(0.05, 0.3))}
        case "universal":
            return {"axes": (axis, unit(np.cross(axis, rng.normal(size=3))))}
        case "rod":
            return {"length": 1.0}
    return {}


def random_coordinates(rng: np.random.Generator, joint: PairJoint) -> np.ndarray:
    """Return coordinates within +-1; a quaternion is a unit one with w > 0."""
    q = rng.uniform(-1, 1, len(joint.coordinates("q")))
    if "turn" in joint.freedoms:
        q[-4:] = pairs.quaternion(pairs.exponential(rng.uniform(-1, 1, 3)))
    return q


def random_effects(
    rng: np.random.Generator, joint: PairJoint, coulomb: bool = True
) -> dict[str, Any]:
    """Return friction, springs with dampers and rotors for a joint's freedoms, some left out."""

    def some(freedom: str) -> dict[str, Any]:
        viscous, dry, stiffness, damping, rotor = rng.uniform(0.1, 1, 5) * rng.integers(0, 2, 5)
        rest = 0.0 if freedom == "turn" else float(rng.uniform(-1, 1))
        return {
            "friction": Friction(
                viscous=viscous, coulomb=dry * coulomb, coulomb_rate=float(rng.uniform(0.05, 0.2))
            ),
            "spring": Spring(stiffness=10 * stiffness, rest=rest, damping=damping),
            "rotor_inertia": float(rotor),
        }

    parts = {freedom: some(freedom) for freedom in joint.freedoms}
    if "axis" in type(joint).model_fields and len(parts) == 1:
        return next(iter(parts.values()))
    fields = ("friction", "spring", "rotor_inertia") if parts else ()
    return {field: {freedom: part[field] for freedom, part in parts.items()} for field in fields}


def random_gear(rng: np.random.Generator, reference: dict[str, float]) -> GearJoint:
    """Return a gear between two or three angles or slides, that fits the reference."""
    scalars = [
        label for label in reference if label.rpartition(".")[2] not in ("qw", "qx", "qy", "qz")
    ]
    geared = rng.choice(scalars, min(int(rng.integers(2, 4)), len(scalars)), replace=False)
    ratios = {str(label): float(rng.choice([-1, 1]) * rng.uniform(0.3, 2)) for label in geared}
    return GearJoint(
        ratios=ratios,
        offset=float(sum(ratio * reference[label] for label, ratio in ratios.items())),
    )


def curved(mechanism: Mechanism) -> Mechanism:
    """Return a mechanism whose gears add up squares, cubes and fourth powers too, which fit the
    reference."""
    rng, joints = np.random.default_rng(4), dict(mechanism.joints)
    for name, gear in mechanism.gears.items():
        powers = {label: tuple(rng.uniform(-0.4, 0.4, 3)) for label in [*gear.ratios][1:]}
        more = sum(
            c * mechanism.reference[label] ** power
            for label, own in powers.items()
            for power, c in enumerate(own, start=2)
        )
        joints[name] = GearJoint(ratios=gear.ratios, powers=powers, offset=gear.offset + more)
    return mechanism.model_copy(update={"joints": joints})


def grown(mechanism: Mechanism) -> Mechanism:
    """Return a mechanism whose springs grow stiffer with the displacement, and viscous friction
    with the rate."""
    rng, joints = np.random.default_rng(5), dict(mechanism.joints)

    def with_powers(own: Friction | Spring) -> Friction | Spring:
        return own.model_copy(update={"powers": tuple(rng.uniform(-0.4, 0.9, 2))})

    for name, joint in mechanism.pairs.items():
        fields = {key: getattr(joint, key, {}) for key in ("friction", "spring")}
        joints[name] = joint.model_copy(
            update={
                key: {freedom: with_powers(part) for freedom, part in own.items()}
                if isinstance(own, Mapping)
                else with_powers(own)
                for key, own in fields.items()
                if own
            }
        )
    return mechanism.model_copy(update={"joints": joints})


def random_spring(rng: np.random.Generator, planar: bool, bodies: Sequence[str]) -> PointSpring:
    """Return a spring and damper between random points of two bodies."""
    first, second = (str(body) for body in rng.choice(bodies, 2, replace=False))
    points = [tuple(random_pose(rng, planar, 0.5)[0]) for _ in range(2)]
    stiffness, rest_length, damping = rng.uniform((5, 0.1, 0.1), (50, 0.5, 1))
    return PointSpring(
        connects=(first, second),
        points=(points[0], points[1]),
        stiffness=stiffness,
        rest_length=rest_length,
        damping=damping,
    )


def random_pose(
    rng: np.random.Generator, planar: bool, spread: float = 1.0, turn: float = 2.0
) -> pairs.Pose:
    """Return (p, R): position within +-spread [m], rotation vector within +-turn; planar: in and
    about z alone."""
    keep_turn, keep_shift = ((0, 0, 1), (1, 1, 0)) if planar else (1, 1)
    return rng.uniform(-spread, spread, 3) * keep_shift, pairs.exponential(
        rng.uniform(-turn, turn, 3) * keep_turn
    )


def only_rods(edges: Sequence[Edge]) -> list[str]:
    """Return the bodies that nothing but rods connects."""
    held = {GROUND} | {body for *bodies, kind in edges if kind != "rod" for body in bodies}
    return list(dict.fromkeys(body for edge in edges for body in edge[:2] if body not in held))


def unit(vector: np.ndarray) -> tuple[float, ...]:
    """Normalise a vector."""
    return tuple(vector / np.linalg.norm(vector))


def framed(p: np.ndarray, R: np.ndarray) -> Frame:
    """Return the frame at (p, R)."""
    return Frame(position=tuple(p), rotation=tuple(pairs.logarithm(R)))
