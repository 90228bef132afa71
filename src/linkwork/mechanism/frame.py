"""Frames fixed in a body: a position and an orientation.

The orientation is a rotation vector (unit axis times angle, rad): three numbers, no normalisation
to keep, and a planar frame is simply (0, 0, angle). R = exp([rotation x]) exp([turn x]) turns
components in this frame into components in the body's frame. `turn` is a further turn, in the
frame's own axes, for what machining, mounting or calibration leaves: about a joint's axis it is the
offset of the joint's zero, across it the two tilts of the axis.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt

from pydantic import Field

from linkwork.checks import finite
from linkwork.mechanism.record import MechanismError, Record, Vector3, followed


class Frame(Record):
    """Place a frame F in the frame B of a body: p_BF and R_BF = exp([rotation x]) exp([turn x])."""

    position: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="p_BF, origin of the frame in the body's frame [m]"
    )
    rotation: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="rotation vector of R_BF, axis times angle [rad]"
    )
    turn: Vector3 = Field(
        default=(0.0, 0.0, 0.0),
        description="rotation vector of a further turn, in the frame's own axes [rad]",
    )

    @property
    def orientation(self) -> Vector3:
        """Return the rotation vector of R_BF with the further turn in it [rad]."""
        if not any(self.turn):
            return self.rotation
        w1, x1, y1, z1 = quaternion_of(self.rotation)
        w2, x2, y2, z2 = quaternion_of(self.turn)
        together = (
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        )
        return Frame.from_quaternion(self.position, together).rotation

    @classmethod
    def planar(cls, x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> Frame:
        """Place a frame in the plane z = 0: (x, y) [m], angle about z [rad]."""
        return cls(position=(x, y, 0.0), rotation=(0.0, 0.0, angle))

    @classmethod
    def from_quaternion(
        cls, position: Vector3, quaternion: tuple[float, float, float, float]
    ) -> Frame:
        """Place a frame by position [m] and quaternion (w, x, y, z), which is normalised; zero
        length is refused."""
        w, x, y, z = numbers(quaternion, 4, "the quaternion", "w, x, y, z")
        norm = sqrt(w * w + x * x + y * y + z * z)
        if norm < 1e-12:
            raise MechanismError(
                f"quaternion {quaternion} has no length; give (w, x, y, z) of length 1"
            )
        if w < 0:
            w, x, y, z = -w, -x, -y, -z
        vector = hypot(x, y, z)
        scale = 2 * atan2(vector, w) / vector if vector > 0 else 0.0
        return cls(
            position=position,
            rotation=(followed(scale * x), followed(scale * y), followed(scale * z)),
        )

    @classmethod
    def from_rpy(cls, position: Vector3, roll: float, pitch: float, yaw: float) -> Frame:
        """Place a frame by position [m] and fixed-axis angles [rad]: R = Rz(yaw) Ry(pitch)
        Rx(roll), as in URDF."""
        roll, pitch, yaw = numbers((roll, pitch, yaw), 3, "the angles", "roll, pitch, yaw")
        cr, sr, cp, sp = cos(roll / 2), sin(roll / 2), cos(pitch / 2), sin(pitch / 2)
        cy, sy = cos(yaw / 2), sin(yaw / 2)
        w = cr * cp * cy + sr * sp * sy
        x = sr * cp * cy - cr * sp * sy
        y = cr * sp * cy + sr * cp * sy
        z = cr * cp * sy - sr * sp * cy
        return cls.from_quaternion(position, (w, x, y, z))


def quaternion_of(vector: Vector3) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w, x, y, z) of a rotation vector [rad]."""
    angle = hypot(*vector)
    scale = sin(angle / 2) / angle if angle > 0 else 0.5
    x, y, z = vector
    return cos(angle / 2), scale * x, scale * y, scale * z


def numbers(values: object, count: int, what: str, names: str) -> list[float]:
    """Return some finite numbers; refuse another number of them, and what is none."""
    array = finite(values, what)  # pyright: ignore[reportArgumentType]
    if array.shape != (count,):
        raise MechanismError(f"{what} is {values!r}; give {count} numbers: {names}")
    return array.tolist()
