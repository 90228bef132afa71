"""Spherical joint: F2 turns freely about the common origin.

R_12 = R(p), p a unit quaternion,  p_12 = 0   motion subspace  S = [1; 0]
closure rows:  x . p_12 = 0,  y . p_12 = 0,  z . p_12 = 0    (three positions, in the frame's axes)

The rates are the angular velocity in F1's axes.
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, coincident
from linkwork.mechanism import SphericalJoint


def motions(joint: SphericalJoint) -> tuple[ElementaryMotion, ...]:
    return (ElementaryMotion(ball=True),)


def rows(joint: SphericalJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    return coincident(preferred)


KIND = Kind(motions, rows)
