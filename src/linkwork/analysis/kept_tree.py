"""The tree that is left of a mechanism when its loops are cut away: the bodies that chains of
independent joints lead to.

    M = M_tree + M_app,    h = h_tree + h_app

M and h are those of the whole mechanism in the independent rates; the tree has the bodies that are
kept and nothing that acts on them. What is left, M_app and h_app, is that of the links that are cut
away, and of all springs, friction and rotors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from linkwork.equations import Equations
from linkwork.equations.growing import regroup
from linkwork.equations.moments import Moments
from linkwork.errors import LinkworkError
from linkwork.formats import poses
from linkwork.formats.mjcf.model_plan import Home, ModelPlan, Move, plan
from linkwork.mechanism import GROUND, Body, Inertia, Mechanism, PairJoint
from linkwork.mechanism.joints import EFFECTS
from linkwork.model.state import State
from linkwork.robot import Robot

FLAT = 1e-9  # least moment of a body of the tree, over its greatest
SMALL = 1e-9  # mass of a body that has none, over the mechanism's
POINT = 1e-2  # least radius of gyration, over the mechanism's own length


@dataclass(frozen=True, eq=False)
class KeptTree:
    """Hold the tree that independent rates of a robot span.

    robot: with its loops; equations: in the chart of these rates
    names: of the tree's rates, in the order in which an engine holds them
    spins: the other independent rates, by which links that are cut away turn about themselves
    mechanism: the tree's bodies and joints, and the actuators of these
    home: where they are at the state `about`; plan: how MJCF holds it
    """

    robot: Robot
    equations: Equations
    names: tuple[str, ...]
    spins: tuple[str, ...]
    mechanism: Mechanism
    home: Home
    plan: ModelPlan
    about: State

    @property
    def moves(self) -> list[Move]:
        """The engine's joints, in its order."""
        return [move for seat in self.plan.seats.values() for move in seat.moves]

    @cached_property
    def order(self) -> list[int]:
        """Where the tree's rates are among the independent ones."""
        return [self.equations.independent.index(name) for name in self.names]

    @cached_property
    def chains(self) -> np.ndarray:
        """Which pairs of the engine's rates (n x n) are of one chain: those that a tree couples."""
        seats = [
            seat
            for seat in self.plan.seats.values()
            for move in seat.moves
            for _ in range(6 if move.kind == "free" else 1)
        ]
        below = [{*self.plan.chain(seat.name)} for seat in seats]
        one = [
            [a.name in theirs or b.name in ours for b, theirs in zip(seats, below, strict=True)]
            for a, ours in zip(seats, below, strict=True)
        ]
        return np.array(one).reshape(len(seats), len(seats))

    @cached_property
    def rest(self) -> Equations:
        """The equations of what is not in the tree: with the inertia of the links that are cut
        away, and all that acts."""
        tree, own = self.equations.tree, self.equations.mechanism.bodies
        nodes = []
        for node in tree.nodes:
            moments = Moments.none()
            if node.body is not None:
                moments = Moments.of_body(own[node.body], node.frame_origin)
                if node.body in self.mechanism.bodies:
                    kept = Moments.of_body(self.mechanism.bodies[node.body], node.frame_origin)
                    moments = Moments(moments.m - kept.m, moments.h - kept.h, moments.I - kept.I)
            nodes.append(replace(node, moments=moments))
        rest = replace(self.equations, tree=replace(tree, nodes=regroup(tuple(nodes))))
        for name in ("v", "elimination"):  # the same symbols
            vars(rest)[name] = getattr(self.equations, name)
        return rest


def kept_tree(robot: Robot, equations: Equations, motors: Sequence[str], about: State) -> KeptTree:
    """Return the tree that the independent rates of equations span, as it stands in a state.

    Raises:
        LinkworkError: independent rates that no chain of joints from the ground has; joints that an
            engine's tree does not hold as they are.
    """
    joints = reached(robot.mechanism, equations.independent)
    bodies = dict.fromkeys(body for name in joints for body in robot.mechanism.pairs[name].connects)
    bodies.pop(GROUND, None)
    spanned = {rate for name in joints for rate in robot.mechanism.pairs[name].rates(name)}
    spins = tuple(name for name in equations.independent if name not in spanned)
    if len(spins) > len(equations.spins):
        raise LinkworkError(unspanned(equations, spins))
    driven = [name for name in dict.fromkeys((*robot.actuators, *motors)) if name in spanned]
    mechanism = bare(robot.mechanism, [*bodies], joints, driven, equations.tree.length)
    home = home_of(robot, [*bodies], about)
    held = plan(mechanism, home)
    names = rates_of(held)
    own = {*equations.independent} - {*spins}
    if held.ties or {*names} != own:
        raise LinkworkError(
            f"{', '.join(sorted({*names} ^ own))}: an engine's tree does not "
            "hold such joints as they are; give hinges, slides, universal joints and free bases"
        )
    return KeptTree(robot, equations, names, spins, mechanism, home, held, about)


def unspanned(equations: Equations, rates: Sequence[str]) -> str:
    """Return why no tree of independent joints has all of some rates."""
    joints, tree, own = equations.mechanism.joints, equations.tree, {*equations.independent}
    for rate in rates:
        joint = rate if rate in joints else rate.rpartition(".")[0]
        node = next(node for node in tree.nodes if node.joint == joint)
        path = dict.fromkeys(inner.joint for inner in tree.path(node))
        before = [name for name in path if not {*joints[name].rates(name)} <= own]
        if before != [joint]:
            return (
                f"{rate!r} moves behind {before[0]!r}, which depends on the joints; a tree without "
                "loops has no place for it, unless the joints that are named have it in place of "
                "another"
            )
    return (
        f"{rates[0]!r} is a freedom of a joint whose others depend on it; name joints whose "
        "freedoms are all independent"
    )


def reached(mechanism: Mechanism, independent: Sequence[str]) -> dict[str, PairJoint]:
    """Return the joints by which chains of independent or fixed joints lead on from ground."""
    whole = {
        name: joint
        for name, joint in mechanism.pairs.items()
        if {*joint.rates(name)} <= {*independent} and (joint.freedoms or joint.type == "fixed")
    }
    found: dict[str, PairJoint] = {}
    there = {GROUND}
    while True:
        name = next(
            (n for n, j in whole.items() if len({*j.connects} & there) == 1),
            None,
        )
        if name is None:
            return found
        found[name] = whole[name]
        there |= {*whole[name].connects}


def bare(
    mechanism: Mechanism,
    bodies: list[str],
    joints: dict[str, PairJoint],
    driven: Sequence[str],
    length: float,
) -> Mechanism:
    """Return bodies and joints of a mechanism without what acts on them, but for limits that are
    no stops, and the actuators of these joints; length: the mechanism's own."""
    total = sum(float(body.mass) for body in mechanism.bodies.values())
    stripped = {}
    for name, joint in joints.items():
        fields = type(joint).model_fields
        held = [effects.stop for effects in joint.effects().values()]
        gone = [field for field in EFFECTS if field in fields and (any(held) or field != "limits")]
        stripped[name] = joint.model_copy(
            update={field: fields[field].get_default(call_default_factory=True) for field in gone}
        )
    return Mechanism(
        name=mechanism.name,
        gravity=mechanism.gravity,
        bodies={name: sound(mechanism.bodies[name], total, length) for name in bodies},
        joints=stripped,
        drives={name: law for name, law in mechanism.drives.items() if name in driven},
        actuators=tuple(driven),
        tools={
            name: tool
            for name, tool in mechanism.tools.items()
            if {tool.body, tool.relative_to} <= {*bodies, GROUND}
        },
    )


def sound(body: Body, total: float, length: float) -> Body:
    """Return a body that an engine takes as it is: with mass, rigid, and not flat; what is added
    here `KeptTree.rest` takes off again."""
    mass = float(body.mass) or SMALL * (total or 1.0)
    I = body.inertia.tensor()  # noqa: E741
    if body.inertia.planar:
        I = float(body.inertia.zz) * np.eye(3)  # noqa: E741
    a, b, c = np.linalg.eigvalsh(I)
    lacking = max(FLAT * c, mass * (POINT * length) ** 2) - a, c - a - b + FLAT * c
    if body.mass and max(lacking) <= 0:
        return body
    I = I + max(lacking) * np.eye(3)  # noqa: E741
    inertia = Inertia(xx=I[0, 0], yy=I[1, 1], zz=I[2, 2], xy=I[0, 1], xz=I[0, 2], yz=I[1, 2])
    return body.model_copy(update={"mass": mass, "inertia": inertia})


def home_of(robot: Robot, bodies: list[str], state: State) -> Home:
    """Return where bodies and joints are in a state."""
    placed = robot.body_poses(state)
    at = {name: poses.pose(*placed[name]) for name in bodies}
    coordinates = dict(zip(robot.coordinates, state.positions.tolist(), strict=True))
    return Home({GROUND: np.eye(4), **at}, coordinates)


def rates_of(held: ModelPlan) -> tuple[str, ...]:
    """Return the names of the rates that an engine's joints have here, in its order; a ball has
    none of them."""
    names: list[str] = []
    for seat in held.seats.values():
        for move in seat.moves:
            free = [f"{move.name}.{part}" for part in ("x", "y", "z", "wx", "wy", "wz")]
            names += free if move.kind == "free" else [move.name] if move.kind != "ball" else []
    return tuple(names)
