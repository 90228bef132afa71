"""What actuators add to the joints and tendons that they move: inertia and damping, seen through
their gears.

    inertia  gear^2 armature,    damping  gear^2 d, and so its powers

Source: the MJCF reference of MuJoCo 4, "actuator/general" (armature, damping).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any, NamedTuple

from linkwork.formats.mjcf.document import ACTUATORS, Document
from linkwork.formats.mjcf.tree import ModelTree, coefficients
from linkwork.formats.notes import Notes
from linkwork.mechanism import Friction

SINGLE = ("hinge", "slide")


class Added(NamedTuple):
    """Hold what is added along a joint or a tendon: inertia and the coefficients of damping."""

    inertia: float = 0.0
    damping: tuple[float, ...] = ()

    def resisting(self, own: Friction) -> dict[str, Any]:
        """Return the viscous friction of a joint or tendon with what is added, as its fields."""
        viscous, *powers = summed(own.smooth, self.damping)
        return {"viscous": viscous, "powers": tuple(powers)}


def summed(one: Sequence[float], other: Sequence[float]) -> tuple[float, ...]:
    """Return the sums of the coefficients of two polynomials."""
    return tuple(map(sum, zip_longest(one, other, fillvalue=0.0)))


@dataclass(frozen=True)
class Reflected:
    """Hold what actuators add, by names of joints and of tendons."""

    joints: Mapping[str, Added]
    tendons: Mapping[str, Added]


def reflected(document: Document, tree: ModelTree, notes: Notes) -> Reflected:
    """Return what actuators add to joints and tendons; what they add elsewhere is left out and
    noted."""
    kinds = {piece.name: piece.kind for _, piece in tree.pieces()}
    joints, tendons = defaultdict(Added), defaultdict(Added)
    for raw in document.each("actuator", *ACTUATORS):
        element = document.resolved(raw, "actuator")
        damping, powers = coefficients(element, "damping")
        armature = element.number("armature", 0.0)
        if not (damping or powers or armature):
            continue
        attributes = element.attributes
        joint = attributes.get("joint") or attributes.get("jointinparent")
        found, name = (tendons, attributes.get("tendon")) if not joint else (joints, joint)
        if name is None or (joint and kinds.get(joint) not in SINGLE):
            remark = "has an armature or a damping, which is left out: it acts on no single rate"
            notes.on(element, remark, alters=True)
            continue
        square = element.numbers("gear", (1, 2, 3, 4, 5, 6), (1.0,))[0] ** 2
        before, seen = found[name], [square * d for d in (damping, *powers)]
        found[name] = Added(before.inertia + square * armature, summed(before.damping, seen))
    return Reflected(joints, tendons)


def with_reflected(tree: ModelTree, added: Mapping[str, Added]) -> ModelTree:
    """Return a tree whose joints have what actuators add to them."""
    if not added:
        return tree
    made = {}
    for name, node in tree.nodes.items():
        pieces = []
        for piece in node.pieces:
            own = added.get(piece.name or "", Added())
            friction = piece.friction.model_copy(update=own.resisting(piece.friction))
            pieces.append(replace(piece, rotor=piece.rotor + own.inertia, friction=friction))
        made[name] = replace(node, pieces=tuple(pieces))
    return replace(tree, nodes=made)
