"""Topology: a spanning tree of the mechanism's graph and the joints that close its loops.

The tree grows from ground by the cheapest joint at its rim (Prim): actuated joints first, so that
their rates are tree rates; then joints whose coordinates something else needs (a gear, a spring, a
thread); then joints of few freedoms, so that the cut joints have many and bring few rows; then
those near ground, so that chains are short; then in the order of the description. The result is the
same on every machine.

A body may also hang on ground by a free joint that the description need not have, and all its
joints are then cut: a body that only rods reach, and a platform on three or more ball joints, whose
legs then meet in it without being coupled to each other. The free joint brings six rates and no
condition, so the mechanism stays what it is.

A joint that closes a loop is read off the poses of its two bodies, and its angle in space then
forgets whole turns. Where these count it goes into the tree, to a massless end of its own, and a
fixed joint closes the loop (`ended`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from typing import Any

from linkwork.equations.algebra import present
from linkwork.equations.joints import complete, pattern, rows_of
from linkwork.mechanism import (
    GROUND,
    Combination,
    FixedJoint,
    Frame,
    FreeJoint,
    Mechanism,
    PairJoint,
)
from linkwork.mechanism.record import swapped


@dataclass(frozen=True)
class Branch:
    """Hold a joint of the tree, directed away from ground; `reversed` where the description's
    second body is the parent."""

    joint: str
    parent: str
    body: str
    reversed: bool


@dataclass(frozen=True)
class Topology:
    """Split the joints into the tree's branches, parents before children, and the joints that close
    loops.

    joints: those of the branches by name, in the order of the description; closing: those that
        close loops, by name
    added: names of the branches' free joints that are not in the description
    """

    branches: tuple[Branch, ...]
    joints: Mapping[str, PairJoint]
    closing: Mapping[str, PairJoint]
    added: tuple[str, ...]

    @property
    def cuts(self) -> tuple[str, ...]:
        return tuple(self.closing)

    @property
    def loops(self) -> int:
        return len(self.closing) - len(self.added)

    @cached_property
    def by_body(self) -> dict[str, Branch]:
        """The branches by their body."""
        return {branch.body: branch for branch in self.branches}


def span(mechanism: Mechanism) -> Topology:
    """Choose the spanning tree of a mechanism."""
    # What makes a joint enter soon: a drive, effects or gears, few freedoms, a place near to
    # ground.
    depth = {GROUND: 0}
    branches: list[Branch] = []
    added: dict[str, PairJoint] = {}
    waiting: dict[str, PairJoint] = dict(mechanism.pairs)
    order = {name: index for index, name in enumerate(waiting)}
    driven = {label.partition(".")[0] for label in driven_rates(mechanism)}
    needed = counting(mechanism) | {name for name, joint in waiting.items() if has_effects(joint)}

    def cost(name: str, near: int) -> tuple[bool, bool, int, int, int]:
        rates = len(waiting[name].rates(name))
        return (name not in driven, name not in needed, rates, near, order[name])

    # What no joint carries floats from ground.
    def hang(body: str) -> None:
        described = next((name for name, joint in waiting.items() if joins(joint, body)), None)
        name = described or (body if body not in mechanism.joints else f"{body} in ground")
        if described:
            joint = waiting.pop(name)
        else:
            joint = added[name] = FreeJoint(connects=(GROUND, body))
        branches.append(Branch(name, GROUND, body, joint.connects[0] == body))
        depth[body] = 1

    # Platforms float; then the best joint on the rim, or a float where there is none.
    for body in platforms(mechanism):
        hang(body)
    rim = Rim({name: joint for name, joint in waiting.items() if complete(joint)}, depth, cost)
    while len(depth) <= len(mechanism.bodies):
        branch = rim.entering()
        if branch is None:
            hang(next(body for body in mechanism.bodies if body not in depth))
            rim.widen(branches[-1].body)
        else:
            waiting.pop(branch.joint)
            branches.append(branch)
    # The joints that are left close the loops.
    in_tree = {branch.joint for branch in branches}
    joints = {name: joint for name, joint in (mechanism.pairs | added).items() if name in in_tree}
    return Topology(tuple(branches), joints, waiting, tuple(added))


class Rim:
    """Hold the joints between a body of the tree and another one, the cheapest first (Prim).

    joints: that may enter; depth: of the bodies in the tree, to which those that enter are added
    cost: of a joint, by its name and the depth of the body that it would hang on; no two are equal
    """

    def __init__(
        self,
        joints: Mapping[str, PairJoint],
        depth: dict[str, int],
        cost: Callable[[str, int], tuple[Any, ...]],
    ):
        self.joints, self.depth, self.cost = joints, depth, cost
        self.of_bodies: dict[str, list[str]] = {}
        for name, joint in joints.items():
            for body in joint.connects:
                self.of_bodies.setdefault(body, []).append(name)
        self.heap: list[tuple[tuple[Any, ...], str]] = []
        for body in depth:
            self.widen(body)

    def widen(self, body: str) -> None:
        """Take up the joints that lead outward from a body of the tree."""
        for name in self.of_bodies.get(body, ()):
            if not all(end in self.depth for end in self.joints[name].connects):
                heappush(self.heap, (self.cost(name, self.depth[body]), name))

    def entering(self) -> Branch | None:
        """Let the cheapest joint enter, if there is one, and the body that it leads to."""
        while self.heap:
            _, name = heappop(self.heap)
            first, second = self.joints[name].connects
            if first in self.depth and second in self.depth:
                continue
            backwards = second in self.depth
            parent, body = (second, first) if backwards else (first, second)
            self.depth[body] = self.depth[parent] + 1
            self.widen(body)
            return Branch(name, parent, body, backwards)
        return None


def counting(mechanism: Mechanism) -> set[str]:
    """Return the joints whose whole turns count: those of gears and combinations, of threads, and
    those with springs or stops."""
    combined = [line for line in mechanism.transmissions.values() if isinstance(line, Combination)]
    geared = {
        label.partition(".")[0]
        for line in (*mechanism.gears.values(), *combined)
        for label in line.ratios
    }
    sprung = {
        name
        for name, joint in mechanism.pairs.items()
        if "screw" in pattern(joint)
        or any(own.stop or any(map(present, own.spring.pulls)) for own in joint.effects().values())
    }
    return geared | sprung


def driven_rates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the joint rates that actuators act on, those of combined joints behind the others."""
    lines = mechanism.transmissions
    combined = (lines[name] for name in mechanism.actuators if name in lines)
    own = [name for name in mechanism.actuators if name not in lines]
    of_lines = [label for line in combined for label in getattr(line, "ratios", ())]
    return tuple(dict.fromkeys([*own, *of_lines]))


def ended(mechanism: Mechanism, topology: Topology, names: Sequence[str]) -> Topology:
    """Return the topology with some of the loop-closing joints in the tree, each ending in a
    massless body of its own.

    That body is then fixed to the one that the joint leads to: the joint's coordinates are the
    tree's, and count turns.
    """
    branches = list(topology.branches)
    joints = dict(topology.joints)
    closing = dict(topology.closing)
    for name in names:
        joint, end = closing[name], f"end of {name}"
        first, second = joint.connects
        branches.append(Branch(name, first, end, False))
        joints[name] = swapped(joint, connects=(first, end), frames=(joint.frames[0], Frame()))
        closing[name] = FixedJoint(connects=(end, second), frames=(Frame(), joint.frames[1]))
    order = list(mechanism.pairs)
    ordered = {
        name: joints[name]
        for name in sorted(
            joints, key=lambda name: (name not in order, order.index(name) if name in order else 0)
        )
    }
    return Topology(tuple(branches), ordered, closing, topology.added)


def joins(joint: PairJoint, body: str) -> bool:
    """Tell whether a joint is a free joint between ground and a body."""
    return set(joint.connects) == {GROUND, body} and not rows_of(joint)


def platforms(mechanism: Mechanism) -> list[str]:
    """Return the bodies that three or more ball joints hold, and no joint of another type but rods
    and free joints."""
    held: dict[str, list[PairJoint]] = {body: [] for body in mechanism.bodies}
    for joint in mechanism.pairs.values():
        for body in set(joint.connects) - {GROUND}:
            held[body].append(joint)
    return [body for body, joints in held.items() if hung(joints)]


def hung(joints: Sequence[PairJoint]) -> bool:
    """Tell whether there are three or more ball joints, and none of another type but rods and free
    joints."""
    others = [joint for joint in joints if pattern(joint) != ("ball",)]
    held = any(complete(joint) and rows_of(joint) for joint in others)
    return len(joints) - len(others) >= 3 and not held


def has_effects(joint: PairJoint) -> bool:
    """Tell whether friction, a spring, a stop or a rotor acts in a joint."""
    return any(present(load) for effects in joint.effects().values() for load in effects.loads)
