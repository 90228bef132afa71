"""Universal joint: F2 turns about the axis a of F1 and about the axis b of F2, perpendicular to
each other.

R_12 = Rot(a, q_1) Rot(b, q_2),  p_12 = 0     motion subspace  S = [a  Rot(a, q_1) b; 0 0]
closure rows:  x . p_12 = 0,  y . p_12 = 0,  z . p_12 = 0    (three positions, in the frame's axes)
               a . R_12 b = 0                                (one direction)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, coincident, turn
from linkwork.mechanism import UniversalJoint


def motions(joint: UniversalJoint) -> tuple[ElementaryMotion, ...]:
    return tuple(turn(axis) for axis in joint.axes)


def rows(joint: UniversalJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    a, b = (np.array(axis) for axis in joint.axes)
    return (*coincident(preferred), Row("angle between the axes", a, b, crossing=True))


KIND = Kind(motions, rows)
