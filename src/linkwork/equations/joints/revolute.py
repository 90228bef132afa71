"""Revolute joint: F2 turns about the axis a, which has the same components in F1 and F2.

R_12 = Rot(a, q),  p_12 = 0               motion subspace  S = [a; 0]
closure rows, e_1, e_2 transversal to a:  e_1 . p_12 = 0,  e_2 . p_12 = 0,
                                          a . p_12 = 0                         (three positions)
                                          e_1 . R_12 a = 0,  e_2 . R_12 a = 0  (two directions)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, transversals, turn
from linkwork.mechanism import RevoluteJoint


def motions(joint: RevoluteJoint) -> tuple[ElementaryMotion, ...]:
    return (turn(joint.axis),)


def rows(joint: RevoluteJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    a = np.array(joint.axis)
    e1, e2 = transversals(a, preferred)
    return (
        Row("position across the axis, 1", e1),
        Row("position across the axis, 2", e2),
        Row("position along the axis", a),
        Row("direction of the axis, 1", e1, a),
        Row("direction of the axis, 2", e2, a),
    )


KIND = Kind(motions, rows)
