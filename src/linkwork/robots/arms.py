"""Driven arms of Delta robots: each turns in the vertical plane of its motor, level at zero, and
hangs a platform by rods.

    elbow i  E_i = (base_radius + arm cos q_i) e_i - arm sin q_i z,  e_i = (cos f_i, sin f_i, 0)
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, hypot

import numpy as np

from linkwork.mechanism import Frame, MechanismError, RevoluteJoint
from linkwork.robots.points import compass
from linkwork.robots.poses import QuaternionPose, product, turn
from linkwork.robots.rods import End, Parts
from linkwork.robots.uniform import ALONG_X, ALONG_Y, rod, vector


@dataclass(frozen=True)
class Arms:
    """Build arms of one kind.

    Args:
        base_radius: distance of the motors' axes from the centre [m].
        length, radius, mass: of the arms, round rods [m, m, kg].
        motor_inertia: of each motor and its gear, seen at the arm [kg m^2].
    """

    base_radius: float
    length: float
    radius: float
    mass: float
    motor_inertia: float

    def at(self, label: str, azimuth: float, angle: float) -> tuple[Parts, End]:
        """Return motor_<label> and arm_<label> at an azimuth, the arm turned down by an angle
        [rad], and its elbow."""
        motor, body = f"motor_{label}", f"arm_{label}"
        e, _ = compass(azimuth)
        shaft = Frame(position=vector(self.base_radius * e), rotation=(0.0, 0.0, azimuth))
        drive = RevoluteJoint(
            connects=("ground", body),
            frames=(shaft, Frame()),
            axis=ALONG_Y,
            rotor_inertia=self.motor_inertia,
        )
        parts = Parts(
            {body: rod(self.mass, self.length, self.radius, 0.0, ALONG_X)},
            {motor: drive},
            {motor: angle},
        )
        at = QuaternionPose.of(shaft)
        turned = product(at.quaternion, turn(ALONG_Y, angle))
        return parts, End(
            body, self.length * np.array(ALONG_X), QuaternionPose(at.position, turned)
        )


def arm_angle(x: float, z: float, arm: float, rod: float) -> float:
    """Return the angle q [rad] of an arm whose rods end x outside and z above the motor's axis [m].

    |(x - arm cos q, z + arm sin q)| = rod, so x cos q - z sin q = (x^2 + z^2 + arm^2 - rod^2) /
    (2 arm): of the two solutions the one with the elbow outside.
    """
    reach = hypot(x, z)
    projection = (x * x + z * z + arm**2 - rod**2) / (2 * arm)
    if not abs(projection) < reach:
        raise MechanismError(
            f"arms of {arm} m and rods of {rod} m do not reach a platform {abs(z)} m below the "
            f"base; arm + rod must exceed {reach:.6g} m and |arm - rod| must be less"
        )
    return atan2(-z, x) - acos(projection / reach)
