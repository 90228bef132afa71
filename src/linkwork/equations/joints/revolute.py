"""Revolute joint: F2 turns about the axis a, which has the same components in F1 and F2.

R_12 = Rot(a, q),  p_12 = 0               motion subspace  S = [a; 0]
closure rows, e_1, e_2 transversal to a:  e_1 . p_12 = 0,  e_2 . p_12 = 0,
                                          a . p_12 = 0                         (three positions)
                                          e_1 . R_12 a = 0,  e_2 . R_12 a = 0  (two directions)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, coaxial, turn
from linkwork.mechanism import RevoluteJoint


def motions(joint: RevoluteJoint) -> tuple[ElementaryMotion, ...]:
    return (turn(joint.axis),)


def rows(joint: RevoluteJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    a = np.array(joint.axis)
    positions, directions = coaxial(a, preferred)
    return (*positions, Row("position along the axis", a), *directions)


KIND = Kind(motions, rows)
