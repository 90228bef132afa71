"""Joint kinds: one file each, with the motion subspace and the closure rows on top.

A kind says two things about a joint with frames F1 (first body) and F2 (second body):

- `motions`: the elementary motions that lead from F1 to F2, in order; each a turn about, a slide
  along, or a screw motion on a constant axis, or a free turn;
- `rows`: what stays zero, most often a position row  e . (p_2 - p_1) = 0  or a direction row  e . f
  = 0 with e fixed in F1 and f in F2. All vectors are components in the joint's frames.

The recursions of the tree, the closure of loops and the reading of coordinates are built from these
two alone. Gears connect coordinates, not frames: they are rows of their own (`gears`).
"""

from linkwork.equations.joints import (
    cylindrical,
    fixed,
    free,
    planar,
    prismatic,
    revolute,
    rod,
    screw,
    spherical,
    universal,
)
from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, transversals

KINDS: dict[str, Kind] = {
    "fixed": fixed.KIND,
    "revolute": revolute.KIND,
    "prismatic": prismatic.KIND,
    "screw": screw.KIND,
    "cylindrical": cylindrical.KIND,
    "universal": universal.KIND,
    "spherical": spherical.KIND,
    "planar": planar.KIND,
    "free": free.KIND,
    "rod": rod.KIND,
}

__all__ = ["KINDS", "ElementaryMotion", "Kind", "Row", "transversals"]
