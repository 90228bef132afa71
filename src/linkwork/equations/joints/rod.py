"""Rod: the origins of F1 and F2 keep the distance l, as between two ball joints of a massless rod.

R_12 free,  |p_12| = l   it always closes a loop: as part of a tree its own directions
                         would be coordinates
closure row:             (|p_12|^2 - l^2) / (2 l) = 0
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row
from linkwork.mechanism import RodJoint


def motions(joint: RodJoint) -> tuple[ElementaryMotion, ...]:
    return ()


def rows(joint: RodJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    return (Row("length", np.zeros(3), length=joint.length),)


KIND = Kind(motions, rows, in_plane=2)
