"""Joint kinds: one file each, with the motion subspace and the closure rows on top.

A kind says three things about a joint with frames F1 (first body) and F2 (second body):

- `motions`: the elementary motions that lead from F1 to F2, in order; each a turn about, a slide
  along, or a screw motion on a constant axis, or a free turn;
- `rows`: what stays zero, most often a position row  e . (p_2 - p_1) = 0  or a direction row  e . f
  = 0 with e fixed in F1 and f in F2. All vectors are components in the joint's frames;
- `in_plane`: the freedoms that are left of it in a planar mechanism.

The recursions of the tree, the closure of loops and the reading of coordinates are built from the
first two alone, and so are the joint's symbol in pictures (`scene`) and what it is in a model file
(`formats`). A file here is called as the type in descriptions. Gears connect coordinates, not
frames: they are rows of their own (`gears`).
"""

from importlib import import_module

import numpy as np

from linkwork.equations.algebra import Number
from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, transversals
from linkwork.mechanism.joints import TYPES, PairJoint

KINDS: dict[str, Kind] = {
    name: import_module(f"{__name__}.{name}").KIND
    for name, kind in TYPES.items()
    if issubclass(kind, PairJoint)
}
X = np.array([1.0, 0.0, 0.0])


def motions_of(joint: PairJoint) -> tuple[ElementaryMotion, ...]:
    """Return the motions that lead from a joint's first frame to its second, in order."""
    return KINDS[joint.type].motions(joint)


def rows_of(joint: PairJoint, preferred: np.ndarray = X) -> tuple[Row, ...]:
    """Return what a joint holds, along directions of which the first is preferred."""
    return KINDS[joint.type].rows(joint, preferred)


def pattern(joint: PairJoint) -> tuple[str, ...]:
    """Return what a joint's motions are, in order: turn, slide, screw, ball."""
    return tuple(motion.what for motion in motions_of(joint))


def complete(joint: PairJoint) -> bool:
    """Tell whether a joint's motions are all that its rows allow, so that it may be part of a
    tree."""
    return sum(motion.rates for motion in motions_of(joint)) + len(rows_of(joint)) == 6


def held_length(joint: PairJoint) -> Number | None:
    """Return the distance at which a joint holds the origins of its frames, if it is all that it
    holds, as a rod."""
    rows = () if joint.freedoms else rows_of(joint)
    return next((row.length for row in rows if row.length is not None), None)


__all__ = [
    "KINDS",
    "ElementaryMotion",
    "Kind",
    "Row",
    "complete",
    "held_length",
    "motions_of",
    "pattern",
    "rows_of",
    "transversals",
]
