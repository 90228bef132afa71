"""Fixed joint: F1 and F2 coincide.

R_12 = 1,  p_12 = 0                            no motion
closure rows with the frame's axes x, y, z:    three positions;  x . R_12 z = 0,  y . R_12 z = 0,  x . R_12 y = 0
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import Kind, Motion, Row
from linkwork.mechanism import FixedJoint


def motions(joint: FixedJoint) -> tuple[Motion, ...]:
    return ()


def rows(joint: FixedJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    x, y, z = np.eye(3)
    return (
        Row("position along x", x),
        Row("position along y", y),
        Row("position along z", z),
        Row("turn about y", x, z),
        Row("turn about x", y, z),
        Row("turn about z", x, y),
    )


KIND = Kind(motions, rows)
