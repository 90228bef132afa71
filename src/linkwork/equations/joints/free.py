"""Free joint: F2 moves freely; its coordinates say where.

R_12 = R(p), p a unit quaternion,  p_12 = (q_1, q_2, q_3)      motion subspace  S = 1, in F1's axes
closure rows:                                                  none
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, slide
from linkwork.mechanism import FreeJoint


def motions(joint: FreeJoint) -> tuple[ElementaryMotion, ...]:
    return (*map(slide, np.eye(3)), ElementaryMotion(ball=True))


def rows(joint: FreeJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    return ()


KIND = Kind(motions, rows, in_plane=3)
