"""Topology: a spanning tree of the mechanism's graph and the joints that close its loops.

The tree grows from ground by the cheapest joint at its rim (Prim): actuated joints first, so that their rates are tree
rates; then joints of few freedoms, so that the cut joints have many and bring few rows; then those near ground, so that
chains are short; then in the order of the description. The result is the same on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkwork.mechanism import GROUND, Mechanism

FREEDOMS = {"fixed": 0, "revolute": 1, "prismatic": 1}


@dataclass(frozen=True)
class Branch:
    """Hold a joint of the tree, directed away from ground; `reversed` where the description's second body is the parent."""

    joint: str
    parent: str
    body: str
    reversed: bool


@dataclass(frozen=True)
class Topology:
    """Split the joints into the tree's branches, parents before children, and the cut joints."""

    branches: tuple[Branch, ...]
    cuts: tuple[str, ...]

    @property
    def loops(self) -> int:
        return len(self.cuts)

    def chain(self, body: str) -> tuple[Branch, ...]:
        """Return the branches from ground to a body, in this order."""
        by_body = {branch.body: branch for branch in self.branches}
        chain = []
        while body != GROUND:
            chain.append(by_body[body])
            body = by_body[body].parent
        return tuple(reversed(chain))


def span(mechanism: Mechanism) -> Topology:
    """Choose the spanning tree of a mechanism."""
    depth = {GROUND: 0}
    branches: list[Branch] = []
    waiting = dict(mechanism.joints)
    order = {name: index for index, name in enumerate(mechanism.joints)}

    def cost(name: str) -> tuple[int, int, int, int]:
        joint = mechanism.joints[name]
        rim = min(depth[body] for body in joint.connects if body in depth)
        return (name not in mechanism.actuators, FREEDOMS[joint.type], rim, order[name])

    while len(depth) <= len(mechanism.bodies):
        rim = [name for name, joint in waiting.items() if sum(body in depth for body in joint.connects) == 1]
        name = min(rim, key=cost)
        first, second = waiting.pop(name).connects
        backwards = second in depth
        parent, body = (second, first) if backwards else (first, second)
        branches.append(Branch(name, parent, body, backwards))
        depth[body] = depth[parent] + 1
    return Topology(tuple(branches), tuple(waiting))
