"""Rods as links between ball joints, for engines that have no constraint of a distance, or whose
own leaves out how the distance's rows turn with the motion:

    J v' + J' v = 0,   |r| = l,   J = r'/l,   J' v = |r' x r|^2 / l^3         (r: along the rod)

A link has a share LIGHT of the mechanism's mass, and lies along the rod with no turn about it:
omega = r x r' / l^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from linkwork.export.model_joints import Moved
from linkwork.formats import poses
from linkwork.formats.mjcf.model_plan import Home
from linkwork.mechanism import (
    GROUND,
    Body,
    Frame,
    Inertia,
    Joint,
    Mechanism,
    RodJoint,
    SphericalJoint,
)

LIGHT = 1e-9
"""Mass of a link over that of all bodies: accelerations change by about as much."""


@dataclass(frozen=True)
class RodLink:
    """Hold a rod as a link: its name among the bodies, and those of its two ball joints."""

    rod: RodJoint
    name: str
    balls: tuple[str, str]

    def body(self, mass: float) -> Body:
        """Return the link, its ends at 0 and at its length along x."""
        length = self.rod.length
        turning = mass * length**2 / 12
        inertia = Inertia(xx=turning, yy=turning, zz=turning)
        return Body(mass=mass, centre_of_mass=(length / 2, 0.0, 0.0), inertia=inertia)

    @property
    def joints(self) -> dict[str, SphericalJoint]:
        """The ball joints at its ends."""
        (first, second), (F1, F2) = self.rod.connects, self.rod.frames
        tip = Frame(position=(self.rod.length, 0.0, 0.0))
        near = SphericalJoint(connects=(first, self.name), frames=(F1, Frame()))
        far = SphericalJoint(connects=(self.name, second), frames=(tip, F2))
        return dict(zip(self.balls, (near, far), strict=True))

    def ends(self, placed: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the rod in ground."""
        near, far = (
            (placed[body] @ poses.of_frame(frame))[:3, 3]
            for body, frame in zip(self.rod.connects, self.rod.frames, strict=True)
        )
        return near, far

    def pose(self, placed: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the link's pose in ground: its x axis along the rod."""
        near, far = self.ends(placed)
        x = (far - near) / np.linalg.norm(far - near)
        y = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
        y /= np.linalg.norm(y)
        return poses.pose(near, np.column_stack([x, y, np.cross(x, y)]))

    def twist(self, mechanism: Mechanism, moved: Moved) -> np.ndarray:
        """Return the link's angular velocity and the velocity of its mass centre."""
        ends, going = self.ends(moved.poses), []
        for body, end in zip(self.rod.connects, ends, strict=True):
            spin, velocity = moved.twists[body][:3], moved.twists[body][3:]
            own = np.zeros(3) if body == GROUND else mechanism.bodies[body].centre_of_mass
            centre = poses.point(moved.poses[body], np.asarray(own, float))
            going.append(velocity + np.cross(spin, end - centre))
        r = ends[1] - ends[0]
        omega = np.cross(r, going[1] - going[0]) / (r @ r)
        return np.concatenate([omega, (going[0] + going[1]) / 2])


def with_links(mechanism: Mechanism) -> tuple[Mechanism, tuple[RodLink, ...]]:
    """Return a mechanism with links for its rods, and the links."""
    taken = {*mechanism.bodies, *mechanism.joints}

    def free(name: str) -> str:
        while name in taken:
            name += "_"
        taken.add(name)
        return name

    mass = LIGHT * (sum(body.mass for body in mechanism.bodies.values()) or 1.0)
    bodies, joints = dict(mechanism.bodies), dict[str, Joint]()
    links: list[RodLink] = []
    for name, joint in mechanism.joints.items():
        if not isinstance(joint, RodJoint):
            joints[name] = joint
            continue
        balls = free(f"{name} near"), free(f"{name} far")
        links.append(RodLink(joint, free(f"{name} link"), balls))
        bodies[links[-1].name] = links[-1].body(mass)
        joints |= links[-1].joints
    changed = mechanism.model_copy(update={"bodies": bodies, "joints": joints})
    return (changed if links else mechanism), tuple(links)


def home_with_links(home: Home, links: tuple[RodLink, ...]) -> Home:
    """Return a home with the poses of links and the turns of their balls."""
    placed = dict(home.poses) | {link.name: link.pose(home.poses) for link in links}
    whole, turns = Home(placed, home.coordinates), dict(home.coordinates)
    for link in links:
        for name, joint in link.joints.items():
            near, far = whole.frames(joint)
            turn = poses.to_quaternion(near[:3, :3].T @ far[:3, :3])
            turns |= zip(joint.coordinates(name), map(float, turn), strict=True)
    return Home(placed, turns)


def moved_with_links(mechanism: Mechanism, moved: Moved, links: tuple[RodLink, ...]) -> Moved:
    """Return how bodies move, with the links; mechanism: with its rods."""
    return replace(
        moved,
        poses=dict(moved.poses) | {link.name: link.pose(moved.poses) for link in links},
        twists=dict(moved.twists) | {link.name: link.twist(mechanism, moved) for link in links},
    )
