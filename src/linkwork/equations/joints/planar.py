"""Planar joint: F2 slides in the xy plane of F1 and turns about its z axis.

R_12 = Rot(z, q_3),  p_12 = (q_1, q_2, 0)     motion subspace  S = [0 0 z; x y 0]
closure rows:  z . p_12 = 0                      (one position)
               x . R_12 z = 0,  y . R_12 z = 0   (two directions)
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, slide, turn
from linkwork.mechanism import PlanarJoint

X, Y, Z = np.eye(3)


def motions(joint: PlanarJoint) -> tuple[ElementaryMotion, ...]:
    return (slide(X), slide(Y), turn(Z))


def rows(joint: PlanarJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    return (
        Row("position across the plane", Z),
        Row("direction of the normal, 1", X, Z),
        Row("direction of the normal, 2", Y, Z),
    )


KIND = Kind(motions, rows, in_plane=3)
