"""Prismatic joint: F2 slides along the axis a, which has the same components in F1 and F2.

R_12 = 1,  p_12 = q a              motion subspace  S = [0; a]
closure rows, with e_1 x e_2 = a:  e_1 . p_12 = 0,    e_2 . p_12 = 0    (two positions)
                                   e_1 . R_12 a = 0,  e_2 . R_12 a = 0,
                                   e_1 . R_12 e_2 = 0                   (no turn)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, coaxial, slide
from linkwork.mechanism import PrismaticJoint


def motions(joint: PrismaticJoint) -> tuple[ElementaryMotion, ...]:
    return (slide(joint.axis),)


def rows(joint: PrismaticJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    positions, directions = coaxial(np.array(joint.axis), preferred)
    e1, e2 = (row.e for row in positions)
    return (*positions, *directions, Row("turn about the axis", e1, e2))


KIND = Kind(motions, rows)
