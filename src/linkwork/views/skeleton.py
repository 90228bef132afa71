"""The points of a mechanism in a pose that are worth drawing: joint origins and axes, seen from the ground.

A body is the set of points where its joints and tools sit; their convex hull is drawn. How many dimensions the hull has
(point, line, polygon, polyhedron) is found from the singular values of the points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linkwork.equations.algebra import rotation_matrix
from linkwork.mechanism import GROUND, Frame
from linkwork.robot import Robot, State

FLAT = 1e-6  # extent of points in a direction, relative to the largest, below which they have none


@dataclass(frozen=True)
class JointPlace:
    """Place a joint: its type, its frame's origins on the first and the second body, and its axis, each (..., 3) [m].

    grounded: one of its two bodies is the ground.
    """

    name: str
    type: str
    near: np.ndarray
    far: np.ndarray
    axis: np.ndarray
    grounded: bool


@dataclass(frozen=True)
class Skeleton:
    """Hold what is drawn of a mechanism in one pose or a stack of poses, in the ground's axes [m].

    bodies: points (..., k, 3) of each body that has any; joints; tools: origin (..., 3) and axes (..., 3, 3), in columns
    """

    bodies: dict[str, np.ndarray]
    joints: tuple[JointPlace, ...]
    tools: dict[str, tuple[np.ndarray, np.ndarray]]

    @property
    def points(self) -> np.ndarray:
        """Return all points (N, 3)."""
        clouds = [*self.bodies.values(), *(p for joint in self.joints for p in (joint.near, joint.far))]
        return np.concatenate([cloud.reshape(-1, 3) for cloud in clouds])


def skeleton(robot: Robot, state: State) -> Skeleton:
    """Return the joint origins, axes and tools of a robot in a state (or a stack of states)."""
    mechanism, batch = robot.mechanism, state.batch
    poses = {**robot.body_poses(state), GROUND: (np.zeros((*batch, 3)), np.broadcast_to(np.eye(3), (*batch, 3, 3)))}

    def place(body: str, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        p, R = poses[body]
        return p + R @ np.array(frame.position), R @ rotation_matrix(frame.rotation)

    joints, points = [], {body: [] for body in mechanism.bodies}
    for name, joint in mechanism.joints.items():
        (near, R), (far, _) = (place(body, frame) for body, frame in zip(joint.connects, joint.frames, strict=True))
        axis = R @ np.array(getattr(joint, "axis", (0.0, 0.0, 1.0)))
        joints.append(JointPlace(name, joint.type, near, far, axis, GROUND in joint.connects))
        for body, point in zip(joint.connects, (near, far), strict=True):
            if body != GROUND:
                points[body].append(point)
    tools = {name: place(tool.body, tool.frame) for name, tool in mechanism.tools.items()}
    for name, tool in mechanism.tools.items():
        points[tool.body].append(tools[name][0])
    return Skeleton({body: np.stack(found, axis=-2) for body, found in points.items()}, tuple(joints), tools)


def hull(points: np.ndarray) -> list[np.ndarray]:
    """Return the faces of the convex hull of points (k, 3): a point (1, 3), a line (2, 3), a polygon or triangles (., 3)."""
    centred = points - points.mean(axis=0)
    _, extents, directions = np.linalg.svd(centred, full_matrices=False)
    dimensions = int((extents > FLAT * max(extents[0], FLAT)).sum()) if len(points) > 1 else 0
    if dimensions == 0:
        return [points[:1]]
    flat = centred @ directions[:dimensions].T
    if dimensions == 1:
        return [points[[int(flat[:, 0].argmin()), int(flat[:, 0].argmax())]]]
    from scipy.spatial import ConvexHull

    found = ConvexHull(flat)
    return [points[found.vertices]] if dimensions == 2 else [points[face] for face in found.simplices]
