"""The spanning tree that the engines set up: which joints carry the bodies, and what closes the
loops.

Every body hangs on ground by a chain of joints; the joints left over are cut. Where a point of one
body stays at a point of another, a cut joint becomes a tie between the two points. A joint of
another kind, and one with an actuator, a gear, a spring, friction or a rotor, is carried instead:
it stays, leads to one part of its body, and the parts are welded.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np

from linkwork.lab.engines.interface import EngineError
from linkwork.lab.engines.joints import MOTIONS, Edge, edge
from linkwork.mechanism import GROUND, Mechanism, PairJoint

ARM = 0.2  # distance of the two points tied on the axis of a cut revolute joint [m]
TIED = (("turn",), ("ball",))  # motions of the joints that hold points together
COST = {(): 0, ("turn",): 4, ("ball",): 5, ("slide", "slide", "slide", "ball"): 6}
"""By motions; what has any other costs 3 and cannot be tied."""


@dataclass(frozen=True)
class EngineTree:
    """Split the joints that connect bodies.

    Attributes:
        edges: the joints that reach every body from ground, depth first, parent before child.
        cuts: the joints that close loops; they lead to a body, never to ground.
        carried: the names of the cut joints that stay in the model and lead to a part of their
            body.
    """

    edges: tuple[Edge, ...]
    cuts: tuple[Edge, ...]
    carried: frozenset[str]


def coupled(mechanism: Mechanism) -> set[str]:
    """Return the joints whose coordinates something is tied to: a gear, a rotor, the advance of a
    screw."""
    owner = {
        label: name for name, joint in mechanism.joints.items() for label in joint.coordinates(name)
    }
    geared = (label for gear in mechanism.gears.values() for label in gear.ratios)
    return {owner[label] for label in geared if label in owner} | {
        name
        for name, joint in mechanism.pairs.items()
        if any(motion == "screw" for motion, _ in MOTIONS[joint.type])
        or any(effects.rotor for effects in joint.effects().values())
    }


def loaded(mechanism: Mechanism) -> set[str]:
    """Return the joints whose rates an actuator, friction, a spring or a damper acts on."""
    owner = {label: name for name, joint in mechanism.joints.items() for label in joint.rates(name)}
    return {owner[label] for label in mechanism.actuators} | {
        name for name, joint in mechanism.pairs.items() if has_forces(joint)
    }


def has_forces(joint: PairJoint) -> bool:
    """Tell whether friction, a spring or a damper acts in a joint."""
    return any(any(effects.loads[:-1]) for effects in joint.effects().values())


def spanning_tree(mechanism: Mechanism) -> EngineTree:
    """Choose a minimum spanning tree from ground by Prim's rule; rods never enter.

    Fixed joints enter first, then geared joints, screws and those with rotors, then those with
    actuators, springs or friction, then the kinds that cannot be tied; revolute, spherical and free
    joints enter last, in this order. Among equals the chain nearest to ground grows.

    Raises:
        EngineError: nothing but rods reaches a body; transmissions, which engines are not given.
    """
    for what in ("transmission", "lift"):
        if own := getattr(mechanism, f"{what}s"):
            raise EngineError(
                f"{mechanism.name} has the {what} {next(iter(own))!r}, which the engines are not "
                "given; compare without it, or write the mechanism as MJCF"
            )
    # What should enter soon, lest it has to be tied.
    edges = {name: edge(name, joint) for name, joint in mechanism.pairs.items()}
    first, second = coupled(mechanism), loaded(mechanism)
    depth = {GROUND: 0}
    chosen: dict[str, Edge] = {}

    def cost(item: Edge) -> tuple[int, int]:
        rank = (
            1 if item.joint in first else 2 if item.joint in second else COST.get(item.motions, 3)
        )
        return rank if item.steps else 0, depth[item.bodies[0]]

    # Prim's rule, over joints both ways round.
    both = [e for item in edges.values() if not item.rod for e in (item, item.reversed())]
    while len(depth) <= len(mechanism.bodies):
        rim = [e for e in both if e.bodies[0] in depth and e.bodies[1] not in depth]
        if not rim:
            body = next(name for name in mechanism.bodies if name not in depth)
            raise EngineError(
                f"bodies.{body}: nothing but rods reaches it; add a free joint to ground"
            )
        best = min(rim, key=cost)
        depth[best.bodies[1]] = depth[best.bodies[0]] + bool(best.steps)
        chosen[best.joint] = best

    # Edges in the order of the tree, and cuts that lead away from ground.
    def below(body: str) -> list[Edge]:
        return [
            e
            for item in chosen.values()
            if item.bodies[0] == body
            for e in (item, *below(item.bodies[1]))
        ]

    cuts = [item for name, item in edges.items() if name not in chosen]
    return EngineTree(
        edges=tuple(below(GROUND)),
        cuts=tuple(cut if cut.bodies[1] != GROUND else cut.reversed() for cut in cuts),
        carried=frozenset(
            cut.joint
            for cut in cuts
            if cut.steps and (cut.joint in first | second or cut.motions not in COST)
        ),
    )


def planar_loop(tree: EngineTree, cut: Edge) -> bool:
    """Tell whether a revolute cut joint closes a planar loop: turns about parallel axes, slides
    across them.

    Turning about parallel axes leaves their directions alone, so that they may be compared with all
    coordinates zero.
    """
    up = {item.bodies[1]: item for item in tree.edges}

    def seen_from_ground(body: str) -> tuple[list[Edge], np.ndarray]:
        if body == GROUND:
            return [], np.eye(4)
        path, pose = seen_from_ground(up[body].bodies[0])
        return [*path, up[body]], pose @ up[body].frames[0] @ np.linalg.inv(up[body].frames[1])

    (left, pose), (right, other) = map(seen_from_ground, cut.bodies)
    loop = {e.joint: e for e in (*left, *right) if not (e in left and e in right)}.values()
    normal, far = (pose @ cut.frames[0])[:3, 2], (other @ cut.frames[1])[:3, 2]
    straight = {"turn": 1.0, "slide": 0.0}
    tilts = [abs(far @ normal) - 1.0]
    for item in loop:
        rotation = (seen_from_ground(item.bodies[0])[1] @ item.frames[0])[:3, :3]
        tilts += [
            abs(rotation @ step.axis @ normal) - straight.get(step.motion, np.inf)
            for step in item.steps
        ]
    return all(abs(tilt) < 1e-9 for tilt in tilts)


@dataclass(frozen=True)
class CarriedPart:
    """Carry one part of a body on a joint: the part's name and its share of the body's mass and
    inertia."""

    edge: Edge
    part: str
    share: float


@dataclass(frozen=True)
class EngineTie:
    """Close a loop between two parts of bodies: hold two points together, or two frames
    (a weld)."""

    kind: Literal["point", "weld"]
    parts: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray]


def branches(tree: EngineTree) -> tuple[CarriedPart, ...]:
    """Return the joints of the tree and the carried ones, depth first, each with the part that it
    leads to.

    The parts of a body share its mass equally; the one in the tree bears the body's own name.
    """
    carried = [cut for cut in tree.cuts if cut.joint in tree.carried]
    parts = Counter((*(item.bodies[1] for item in tree.edges), *(cut.bodies[1] for cut in carried)))

    def carried_by(body: str) -> list[CarriedPart]:
        return [
            CarriedPart(cut, part_of(cut), 1 / parts[cut.bodies[1]])
            for cut in carried
            if cut.bodies[0] == body
        ]

    grown = carried_by(GROUND)
    for item in tree.edges:
        body = item.bodies[1]
        grown += [CarriedPart(item, body, 1 / parts[body]), *carried_by(body)]
    return tuple(grown)


def ties(tree: EngineTree) -> tuple[EngineTie, ...]:
    """Return what closes the loops, apart from rods.

    A spherical joint ties one point, a revolute one one (planar loop) or two on its axis; the parts
    of bodies are welded. A free joint that is cut holds nothing, nor does a fixed one, which only a
    loop of fixed joints has left.
    """
    closed = []
    for cut in tree.cuts:
        if cut.joint in tree.carried:
            closed.append(EngineTie("weld", (cut.bodies[1], part_of(cut)), (np.eye(4), np.eye(4))))
        elif cut.motions in TIED:
            single = cut.motions == ("ball",) or planar_loop(tree, cut)
            for arm in (0.0,) if single else (-ARM / 2, ARM / 2):
                near, far = (frame @ along_z(arm) for frame in cut.frames)
                closed.append(EngineTie("point", cut.bodies, (near, far)))
    return tuple(closed)


def along_z(length: float) -> np.ndarray:
    """Return Trans(z, length)."""
    pose = np.eye(4)
    pose[2, 3] = length
    return pose


def part_of(cut: Edge) -> str:
    """Name the part to which a carried joint leads; no body's name holds a dot."""
    return f"{cut.bodies[1]}.{cut.joint}"
