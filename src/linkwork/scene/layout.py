"""Where the parts of a robot are in a pose: frames of bodies and spans, and by them those of all
parts at once.

A unit quaternion (w, x, y, z) is that of the rotation matrix that turns a part's axes into the
ground's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linkwork.mechanism import GROUND
from linkwork.robot import Robot, State
from linkwork.scene.fixtures import Fixture, Fixtures

SHORTEST = 1e-9  # length of a span that still has a direction [m]


@dataclass(frozen=True, eq=False)
class Placement:
    """Hold where parts are, in the ground's axes: positions (k, 3) [m], quaternions (k, 4), scales
    (k, 3)."""

    positions: np.ndarray
    turns: np.ndarray
    scales: np.ndarray


class PartLayout:
    """Place the parts of one robot; `moving`: which of them (k) move at all."""

    def __init__(self, robot: Robot, parts: Fixtures):
        self.robot, self.spans = robot, parts.spans
        names = (GROUND, *robot.bodies)
        carriers = {name: k for k, name in enumerate(names)}
        spans = range(len(names), len(names) + len(parts.spans))
        own = parts.parts
        self.carriers = np.array(
            [carriers[p.carrier] if isinstance(p.carrier, str) else spans[p.carrier] for p in own]
        )
        self.positions = np.array([part.position for part in own])
        self.turns = quaternions(np.array([part.turn for part in own]))
        self.scales = np.array([part.scale for part in own])
        self.moving = self.carriers > 0
        self._ends = [self._ends_of(carriers, k) for k in (0, 1)]

    def _ends_of(self, carriers: dict[str, int], which: int) -> tuple[np.ndarray, np.ndarray]:
        bodies = np.array([carriers[span.bodies[which]] for span in self.spans], int)
        return bodies, np.array([span.points[which] for span in self.spans]).reshape(-1, 3)

    def place(self, state: State) -> Placement:
        """Return where all parts are in one state."""
        poses = self.robot.body_poses(state).values()
        origins = np.array([np.zeros(3), *(p for p, _ in poses)])
        turns = np.array([np.eye(3), *(R for _, R in poses)])
        starts, ends = (
            origins[bodies] + (turns[bodies] @ points[:, :, None])[:, :, 0]
            for bodies, points in self._ends
        )
        lengths = np.linalg.norm(ends - starts, axis=1)
        frames = np.concatenate([quaternions(turns), quaternions_along(ends - starts, lengths)])[
            self.carriers
        ]
        stretch = np.concatenate([np.ones(len(origins)), np.maximum(lengths, SHORTEST)])[
            self.carriers
        ]
        along = np.array([0, 0, 1]) * (stretch - 1)[:, None] + 1
        return Placement(
            np.concatenate([origins, starts])[self.carriers]
            + turned_by(frames, self.positions * along),
            product(frames, self.turns),
            self.scales * along,
        )


def of_mesh(parts: Sequence[Fixture], chosen: np.ndarray) -> list[np.ndarray]:
    """Return the numbers of the chosen parts (k), in groups of one mesh."""
    groups: dict[int, list[int]] = {}
    for k in np.flatnonzero(chosen).tolist():
        groups.setdefault(id(parts[k].mesh), []).append(k)
    return [np.array(group) for group in groups.values()]


def quaternions(turns: np.ndarray) -> np.ndarray:
    """Return unit quaternions (k, 4), w >= 0, of rotation matrices (k, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(turns).as_quat(canonical=True)[:, [3, 0, 1, 2]]


def quaternions_along(way: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return unit quaternions (k, 4) of the shortest turns of z along vectors (k, 3) of these
    lengths.

    With d the direction, (w, x, y, z) is along (1 + d_z, -d_y, d_x, 0); where d = -z, half a turn
    about x.
    """
    d = way / np.maximum(lengths, SHORTEST)[:, None]
    w = 1 + d[:, 2]
    found = np.column_stack([w, -d[:, 1], d[:, 0], 0 * w])
    found[w < 1e-9] = (0, 1, 0, 0)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the quaternion products p q (k, 4)."""
    w, u = p[:, :1], p[:, 1:]
    s, v = q[:, :1], q[:, 1:]
    return np.concatenate(
        [w * s - (u * v).sum(axis=1, keepdims=True), w * v + s * u + np.cross(u, v)], axis=1
    )


def turned_by(p: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (k, 3) turned by unit quaternions (k, 4):  x + 2 w (u x x) + 2 u x (u x x)."""
    w, u = p[:, :1], p[:, 1:]
    twice = 2 * np.cross(u, points)
    return points + w * twice + np.cross(u, twice)
