"""Rods of constant length between a carrier and the platform, massless or as bodies.

    u = R_1' (p_2 - p_1) / l       direction from the first end to the second, in the carrier's axes
    u = Rot(e1, a) Rot(e2, b) e3   a = atan2(-u.e2, u.e3),  b = asin(u.e1)

A rod as a body lies along e3, its z axis or the opposite, whichever is nearer to u; of x and y, e1
is the axis farther from u, and e2 = e3 x e1, so that a universal joint with the axes e1 and e2
stays far from its singular pose b = pi/2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import asin, atan2
from typing import NamedTuple

import numpy as np

from linkwork.mechanism import Body, Frame, Joint, RodJoint, SphericalJoint, UniversalJoint
from linkwork.robots.poses import QuaternionPose, ball_coordinates, inverse, product, rotated, turn
from linkwork.robots.uniform import rod, vector


@dataclass(frozen=True)
class Parts:
    """Collect bodies, joints and reference coordinates of a part of a mechanism."""

    bodies: dict[str, Body] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    reference: dict[str, float] = field(default_factory=dict)

    def __or__(self, other: Parts) -> Parts:
        return Parts(
            self.bodies | other.bodies, self.joints | other.joints, self.reference | other.reference
        )


class End(NamedTuple):
    """Say where a rod ends: on which body, at which of its points [m, body axes], the body's
    reference pose."""

    body: str
    point: np.ndarray
    pose: QuaternionPose

    @property
    def position(self) -> np.ndarray:
        return self.pose.point(self.point)

    @property
    def frame(self) -> Frame:
        return Frame(position=vector(self.point))


class Pointing(NamedTuple):
    """Turn the axis e3 into a direction: by a universal joint's axes and angles, or by the
    quaternion of both turns."""

    axes: tuple[tuple[float, float, float], tuple[float, float, float]]
    axis: tuple[float, float, float]
    angles: tuple[float, float]
    quaternion: np.ndarray


def pointing(direction: np.ndarray) -> Pointing:
    """Return how a universal joint points a leg along a unit direction: e1, e2, e3, a, b as in the
    module's formulas."""
    e3 = np.array([0.0, 0.0, 1.0 if direction[2] >= 0 else -1.0])
    e1 = np.array([1.0, 0.0, 0.0] if abs(direction[0]) <= abs(direction[1]) else [0.0, 1.0, 0.0])
    e2 = np.cross(e3, e1)
    a, b = atan2(-direction @ e2, direction @ e3), asin(direction @ e1)
    return Pointing((vector(e1), vector(e2)), vector(e3), (a, b), product(turn(e1, a), turn(e2, b)))


def direction(first: End, second: End) -> tuple[np.ndarray, float]:
    """Return the unit direction from the first to the second end, in the first body's axes, and the
    distance [m]."""
    gap = second.position - first.position
    length = float(np.linalg.norm(gap))
    return rotated(inverse(first.pose.quaternion), gap / length), length


@dataclass(frozen=True)
class Rods:
    """Build rods of one kind.

    Args:
        length: between the two joints' centres [m].
        mass: of a rod [kg]; a rod of mass zero is a joint of type `rod`, any other is a body with
            two joints.
        radius: of the round rod, for its inertia [m].
        spinning: whether both ends are spherical joints, so that the rod may spin idly about
            itself; if not, the first end is a universal joint.
    """

    length: float
    mass: float
    radius: float
    spinning: bool

    def between(self, label: str, first: End, second: End) -> Parts:
        """Return rod_<label>, or the body of that name with its joints knuckle_<label> and
        ball_<label>."""
        # Without mass a rod is a distance and no body.
        name = f"rod_{label}"
        if self.mass == 0:
            joint = RodJoint(
                connects=(first.body, second.body),
                frames=(first.frame, second.frame),
                length=self.length,
            )
            return Parts(joints={name: joint})
        # With mass it points from end to end.
        aim = pointing(direction(first, second)[0])
        tip = End(
            name,
            self.length * np.array(aim.axis),
            QuaternionPose(first.position, product(first.pose.quaternion, aim.quaternion)),
        )
        # Two balls let it spin about itself, a universal joint does not.
        knuckle, ball = f"knuckle_{label}", f"ball_{label}"
        connects, frames = (first.body, name), (first.frame, Frame())
        if self.spinning:
            base = SphericalJoint(connects=connects, frames=frames)
            coordinates = ball_coordinates(knuckle, first.pose.quaternion, tip.pose.quaternion)
        else:
            base = UniversalJoint(connects=connects, frames=frames, axes=aim.axes)
            coordinates = {f"{knuckle}.angle_1": aim.angles[0], f"{knuckle}.angle_2": aim.angles[1]}
        return Parts(
            bodies={name: rod(self.mass, self.length, self.radius, 0.0, aim.axis)},
            joints={
                knuckle: base,
                ball: SphericalJoint(
                    connects=(name, second.body), frames=(tip.frame, second.frame)
                ),
            },
            reference=coordinates
            | ball_coordinates(ball, tip.pose.quaternion, second.pose.quaternion),
        )

    def pair(
        self, label: str, first: End, second: End, halves: tuple[np.ndarray, np.ndarray]
    ) -> Parts:
        """Return two rods, left and right: both ends of the one before, both ends of the other
        after the given points.

        `halves` [m] lead from the points to the right rod's ends, each in its body's axes; where
        they are the same vector of space the rods are the sides of a parallelogram.
        """
        left, right = (
            self.between(
                f"{label}_{side}",
                *(
                    moved(end, sign * half)
                    for end, half in zip((first, second), halves, strict=True)
                ),
            )
            for side, sign in (("left", -1), ("right", 1))
        )
        return left | right


def moved(end: End, offset: np.ndarray) -> End:
    return end._replace(point=end.point + offset)
