"""Cylindrical joint: F2 turns about and slides along the axis a, which has the same components in
F1 and F2.

R_12 = Rot(a, q_1),  p_12 = q_2 a         motion subspace  S = [a 0; 0 a]
closure rows, e_1, e_2 transversal to a:  e_1 . p_12 = 0,    e_2 . p_12 = 0    (two positions)
                                          e_1 . R_12 a = 0,  e_2 . R_12 a = 0  (two directions)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, coaxial, slide, turn
from linkwork.mechanism import CylindricalJoint


def motions(joint: CylindricalJoint) -> tuple[ElementaryMotion, ...]:
    return (turn(joint.axis), slide(joint.axis))


def rows(joint: CylindricalJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    positions, directions = coaxial(np.array(joint.axis), preferred)
    return (*positions, *directions)


KIND = Kind(motions, rows)
