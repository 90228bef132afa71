"""Joint kinds: one file each, with the motion subspace and the closure rows on top.

A kind says two things about a joint with frames F1 (first body) and F2 (second body):

- `motions`: the elementary motions that lead from F1 to F2, in order; each a turn about or a slide along a
  constant axis;
- `rows`: what stays zero, each row either a position row  e . (p_2 - p_1) = 0  or a direction row  e . f = 0
  with e fixed in F1 and f in F2. All vectors are components in the joint's frames.

The recursions of the tree and the closure of loops are built from these two alone.
"""

from linkwork.equations.joints import fixed, prismatic, revolute
from linkwork.equations.joints.kind import Kind, Motion, Row, transversals

KINDS: dict[str, Kind] = {"fixed": fixed.KIND, "revolute": revolute.KIND, "prismatic": prismatic.KIND}

__all__ = ["KINDS", "Kind", "Motion", "Row", "transversals"]
