"""Prismatic joint: F2 slides along the axis a, which has the same components in F1 and F2.

R_12 = 1,  p_12 = q a              motion subspace  S = [0; a]
closure rows, with e_1 x e_2 = a:  e_1 . p_12 = 0,    e_2 . p_12 = 0    (two positions)
                                   e_1 . R_12 a = 0,  e_2 . R_12 a = 0,
                                   e_1 . R_12 e_2 = 0                   (no turn)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, slide, transversals
from linkwork.mechanism import PrismaticJoint


def motions(joint: PrismaticJoint) -> tuple[ElementaryMotion, ...]:
    return (slide(joint.axis),)


def rows(joint: PrismaticJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    a = np.array(joint.axis)
    e1, e2 = transversals(a, preferred)
    return (
        Row("position across the axis, 1", e1),
        Row("position across the axis, 2", e2),
        Row("direction of the axis, 1", e1, a),
        Row("direction of the axis, 2", e2, a),
        Row("turn about the axis", e1, e2),
    )


KIND = Kind(motions, rows)
