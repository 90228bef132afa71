"""Transmissions as expressions: the length x, and what a unit force along it does.

    combination    x = offset + sum ratio_i q_i       ratio_i on the rate of coordinate i
    cable          its way (`cables`)                 forces along its straight parts
    slider-crank, displacement (`displacements`)      forces between two bodies
    thrust         no length (x = 0)                  a wrench that moves with its body

The row J (1 x nv) of the rate x' = J w follows from the forces, by their power: J = sum ratio_i J_i
+ sum_k W_k' J_k, with the wrenches W_k on bodies, whose twists are J_k w. These are added up from
the tips of the tree inward, so that no J_k is ever formed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, cross, vector
from linkwork.equations.cables import Places, before_leap, before_touching, lined_up, way
from linkwork.equations.displacements import measured
from linkwork.equations.dynamics import add, carried_inward
from linkwork.equations.tree import Tree, near_offset, offset
from linkwork.mechanism import (
    GROUND,
    Cable,
    Combination,
    Displacement,
    Mechanism,
    SliderCrank,
    Thrust,
    Transmission,
)
from linkwork.mechanism.limits import at_surfaces


@dataclass(frozen=True)
class Along:
    """Hold a transmission: its length x, and what a unit force along it is.

    ratios: on joint rates, by name
    wrenches: [moment about the point; force] in the ground's axes, at a vector from the body's
        node in its axes, by body
    """

    x: ca.SX
    ratios: Mapping[str, float] = field(default_factory=dict)
    wrenches: tuple[tuple[str, ca.SX, ca.SX], ...] = ()

    def row(self, tree: Tree, rate_row: Callable[[str], ca.SX]) -> ca.SX:
        """Return J (1 x nv); rate_row: gives that of a joint's rate."""
        J = SX(1, len(tree.rates))
        for label, ratio in self.ratios.items():
            J += ratio * rate_row(label)
        return J + self._of_wrenches(tree) if self.wrenches else J

    def _of_wrenches(self, tree: Tree) -> ca.SX:
        """Return sum_k W_k' J_k (1 x nv)."""
        on_nodes: dict[int, tuple[ca.SX, ca.SX]] = {}
        for body, arm, wrench in self.wrenches:
            node = tree.node(body)
            near = ca.mtimes(node.axes.matrix.T, ca.reshape(wrench, 3, 2))
            moment, force = ca.horzsplit(near)
            add(on_nodes, node.index, moment + cross(arm, force), force)
        return ca.sparsify(carried_inward(tree, on_nodes)).T


def along(line: Transmission, tree: Tree, position: Callable[[str], ca.SX]) -> Along:
    """Return a transmission in a tree; position: gives a joint coordinate by name."""
    if isinstance(line, Combination):
        terms = (ratio * position(label) for label, ratio in line.ratios.items())
        return Along(sum(terms, SX(line.offset)), line.ratios)
    if not isinstance(line, Thrust):
        return led(line, tree)
    node = tree.node(line.body)
    R = node.R.matrix
    wrench = ca.vertcat(*(ca.mtimes(R, vector(part)) for part in (line.moment, line.force)))
    return Along(SX(0), wrenches=((line.body, near_offset(node, vector(line.point)), wrench),))


def led(line: Cable | SliderCrank | Displacement, tree: Tree) -> Along:
    """Return what is measured between bodies in a tree."""
    place = places(tree)
    found = way(line, place) if isinstance(line, Cable) else measured(line, place)
    wrenches = (
        (body, near_offset(tree.node(body), np.zeros(3)), wrench)
        for body, wrench in found.wrenches(place)
        if body != GROUND
    )
    return Along(found.length, wrenches=tuple(wrenches))


def places(tree: Tree) -> Places:
    """Return what gives the frames of bodies in a tree."""

    def place(body: str) -> tuple[ca.SX, ca.SX]:
        node = tree.node(body)
        return node.R.matrix, node.O + offset(node, np.zeros(3))

    return place


def at_surface(mechanism: Mechanism, tree: Tree, name: str) -> ca.SX:
    """Return a number that passes zero where what is named, one of `at_surfaces`, happens."""
    line, place, what = at_surfaces(mechanism)[name]
    makes = {"leaps at": before_leap, "touches": before_touching, "lines up with": lined_up}
    return makes[what](line, place, places(tree))
