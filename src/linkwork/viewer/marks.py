"""Names and frames of bodies and joints where they are in a pose."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import chain

import numpy as np

from linkwork.equations.algebra import rotation_matrix
from linkwork.mechanism import GROUND
from linkwork.robot import Robot

NAMES = ("names of bodies", "names of joints")
FRAMES = ("frames of bodies", "frames of joints")
CLOSE = 0.02  # distance below which names stand together, relative to the mechanism

Pose = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Marks:
    """Hold named frames (k) in the ground's axes: positions (k, 3) [m], turns (k, 3, 3)."""

    names: tuple[str, ...]
    positions: np.ndarray
    turns: np.ndarray


@dataclass(frozen=True, eq=False)
class BodyMarks:
    """Hold named frames by their bodies, positions (k, 3) [m] and turns (k, 3, 3) in these bodies'
    axes."""

    names: tuple[str, ...]
    bodies: tuple[str, ...]
    positions: np.ndarray
    turns: np.ndarray

    @classmethod
    def of(cls, rows: Iterable[tuple[str, str, Iterable[float], np.ndarray]]) -> BodyMarks:
        names, bodies, positions, turns = zip(*rows, strict=True)
        return cls(names, bodies, np.array(positions, float), np.array(turns, float))

    def at(self, poses: Mapping[str, Pose]) -> Marks:
        """Return where they are while the bodies, and the ground, have these poses."""
        origins = np.array([poses[body][0] for body in self.bodies])
        R = np.array([poses[body][1] for body in self.bodies])
        return Marks(
            self.names,
            origins + (R @ self.positions[:, :, None])[:, :, 0],
            R @ self.turns,
        )


def marks_of(robot: Robot) -> dict[str, BodyMarks]:
    """Return the names and frames of a robot, by kind.

    A body's name stands at its mass centre, a joint's at the joint's frame on the second body. Of a
    joint both frames are told: its coordinates lead from the first to the second.
    """
    mechanism = robot.mechanism
    centres = [
        (name, name, body.centre_of_mass, np.eye(3)) for name, body in mechanism.bodies.items()
    ]
    origins = [(name, name, (0.0, 0.0, 0.0), np.eye(3)) for name in (GROUND, *mechanism.bodies)]
    ends = [
        [
            (name, joint.connects[k], frame.position, rotation_matrix(frame.orientation))
            for k, frame in enumerate(joint.frames)
        ]
        for name, joint in mechanism.pairs.items()
    ]
    return {
        "names of bodies": BodyMarks.of(centres),
        "names of joints": BodyMarks.of(pair[1] for pair in ends),
        "frames of bodies": BodyMarks.of(origins),
        "frames of joints": BodyMarks.of(chain.from_iterable(ends)),
    }


def written(marks: Marks, size: float) -> tuple[str, ...]:
    """Return the text (k) at each mark: names that stand at one place are told at the first one,
    one below the other, and the others are empty."""
    lines: list[list[str]] = []
    for k, (name, place) in enumerate(zip(marks.names, marks.positions, strict=True)):
        near = np.linalg.norm(marks.positions[:k] - place, axis=1) < CLOSE * size
        first = next((i for i in np.flatnonzero(near) if lines[i]), k)
        lines.append([])
        lines[first].append(name)
    return tuple("\n".join(names) for names in lines)
