"""Fixed joint: F1 and F2 coincide.

R_12 = 1,  p_12 = 0     no motion
closure rows:  x . p_12 = 0,    y . p_12 = 0,    z . p_12 = 0     (in the frame's axes)
               x . R_12 z = 0,  y . R_12 z = 0,  x . R_12 y = 0
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row
from linkwork.mechanism import FixedJoint

X, Y, Z = np.eye(3)


def motions(joint: FixedJoint) -> tuple[ElementaryMotion, ...]:
    return ()


def rows(joint: FixedJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    return (
        Row("position along x", X),
        Row("position along y", Y),
        Row("position along z", Z),
        Row("turn about y", X, Z),
        Row("turn about x", Y, Z),
        Row("turn about z", X, Y),
    )


KIND = Kind(motions, rows, in_plane=0)
