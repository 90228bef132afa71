"""Arrows of forces, moments and velocities in a configuration.

A force or velocity is an arrow of a length in proportion to the largest of its kind. A moment is an
arc about its axis, by the right-hand rule; the largest is three quarters of a turn.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from linkwork.equations.algebra import rotation_matrix
from linkwork.equations.joints import motions_of
from linkwork.mechanism import PairJoint
from linkwork.robot import Robot, State
from linkwork.scene.curves import across
from linkwork.scene.skeleton import after_turns, poses_of

LONGEST = 0.28  # arrow, relative to the mechanism
# Of arcs: radius relative to the mechanism, angle, pieces.
RADIUS, FULL_ARC, STEPS = 0.06, 1.5 * np.pi, 24
LEAST = 0.02  # part of the largest below which nothing is drawn


@dataclass(frozen=True, eq=False)
class Arrows:
    """Hold vectors (k, 3) in the ground's axes at places (k, 3) [m], and which of them are moments
    or turn (k)."""

    places: np.ndarray
    values: np.ndarray
    turning: np.ndarray

    @classmethod
    def of(cls, rows: Iterable[tuple[np.ndarray, np.ndarray, bool]]) -> Arrows:
        found = list(rows)
        places, values = (np.array([row[k] for row in found], float).reshape(-1, 3) for k in (0, 1))
        return cls(places, values, np.array([row[2] for row in found], bool))

    def largest(self) -> tuple[float, float]:
        """Return the largest magnitude of what is straight and of what turns."""
        sizes = np.linalg.norm(self.values, axis=1)
        return float(sizes[~self.turning].max(initial=0.0)), float(
            sizes[self.turning].max(initial=0.0)
        )


NOTHING = Arrows.of(())


@dataclass(frozen=True, eq=False)
class ArrowLines:
    """Hold what is drawn: arrows (k, 2, 3) from start to tip, and segments of arcs (k, 2, 3)
    [m]."""

    arrows: np.ndarray
    arcs: np.ndarray


def drawn(vectors: Arrows, largest: tuple[float, float], size: float) -> ArrowLines:
    """Return the arrows and arcs of vectors; `largest` are the magnitudes that are drawn in
    full."""
    arrows, arcs = [], []
    for place, value, turning in zip(vectors.places, vectors.values, vectors.turning, strict=True):
        part = float(np.linalg.norm(value)) / max(largest[int(turning)], 1e-300)
        if not part > LEAST:
            continue
        direction = value / np.linalg.norm(value)
        if turning:
            points = arc_about(place, direction, RADIUS * size, min(part, 1.0) * FULL_ARC)
            arcs += pairwise(points[:-1])
            arrows.append(
                (points[-2], points[-2] + 0.6 * RADIUS * size * unit(points[-1] - points[-2]))
            )
        else:
            arrows.append((place, place + min(part, 1.0) * LONGEST * size * direction))
    return ArrowLines(np.array(arrows).reshape(-1, 2, 3), np.array(arcs).reshape(-1, 2, 3))


def arc_about(place: np.ndarray, axis: np.ndarray, radius: float, angle: float) -> np.ndarray:
    """Return an arc (k, 3) about an axis, counter-clockwise seen against it."""
    e, f = across(axis)
    t = np.linspace(0, angle, STEPS)[:, None]
    return place + radius * (np.cos(t) * e + np.sin(t) * f)


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-300)


@dataclass(frozen=True, eq=False)
class Actuator:
    """Place a rate of a joint: the body in which the axis (3) is fixed, the body and point (3)
    where it acts, its kind."""

    axis_body: str
    axis: np.ndarray
    body: str
    point: np.ndarray
    turning: bool


def actuators_of(robot: Robot) -> tuple[Actuator | None, ...]:
    """Return the places and axes of a robot's actuated rates, in the order of `actuators`; None for
    transmissions."""
    owners = {
        label: (name, joint)
        for name, joint in robot.mechanism.pairs.items()
        for label in joint.rates(name)
    }
    return tuple(
        actuator(label, *owners[label]) if label in owners else None for label in robot.actuators
    )


def actuator(label: str, name: str, joint: PairJoint) -> Actuator:
    """Place a rate by the motion that it belongs to; those of a free turn are about the axes of the
    first frame."""
    motions = after_turns(motions_of(joint))
    rates = [(motion, turned, k) for motion, turned in motions for k in range(motion.rates)]
    motion, turned, k = rates[joint.rates(name).index(label)]
    own = np.eye(3)[k] if motion.ball else motion.turn if motion.turns else motion.slide
    inner, outer = joint.frames
    axis = rotation_matrix((inner, outer)[turned].orientation) @ own
    return Actuator(
        joint.connects[turned], axis, joint.connects[1], np.array(outer.position), motion.turns
    )


@dataclass(frozen=True, eq=False)
class ArrowField:
    """Give the vectors of one robot in its states; `size`: largest extent of the mechanism [m]."""

    robot: Robot
    size: float
    actuators: tuple[Actuator | None, ...] = field(default=())

    @classmethod
    def of(cls, robot: Robot, size: float) -> ArrowField:
        return cls(robot, size, actuators_of(robot))

    def forces(self, state: State, u: np.ndarray) -> Arrows:
        """Return the forces and moments u (actuators) [N, N m] of actuators of joints on the outer
        bodies."""
        poses = poses_of(self.robot, state)

        def rows():
            for acting, value in zip(self.actuators, u, strict=True):
                if acting is None:
                    continue
                origin, R = poses[acting.body]
                yield (
                    origin + R @ acting.point,
                    value * (poses[acting.axis_body][1] @ acting.axis),
                    acting.turning,
                )

        return Arrows.of(rows())

    def reactions(self, state: State, u: np.ndarray) -> Arrows:
        """Return the forces [N] that joints exert on their second bodies under actuator forces
        u."""
        poses, found = poses_of(self.robot, state), self.robot.reactions(state, u)
        pairs = self.robot.mechanism.pairs

        def rows():
            for name in found.joints:
                joint = pairs[name]
                origin, R = poses[joint.connects[0]]
                yield origin + R @ np.array(joint.frames[0].position), found[name][3:], False

        return Arrows.of(rows())

    def velocities(self, state: State) -> Arrows:
        """Return the velocities [m/s] of the bodies' mass centres and of the tool."""
        poses, robot = self.robot.body_poses(state), self.robot

        def rows():
            twists = robot.twists(state)
            for k, (name, body) in enumerate(robot.mechanism.bodies.items()):
                origin, R = poses[name]
                centre = origin + R @ np.array(body.centre_of_mass)
                if body.mass > 0:
                    yield centre, twists[k, 3:], False
            for tool in robot.mechanism.tools.values():
                k = robot.bodies.index(tool.body)
                origin, R = poses[tool.body]
                place = origin + R @ np.array(tool.frame.position)
                centre = origin + R @ np.array(robot.mechanism.bodies[tool.body].centre_of_mass)
                yield place, twists[k, 3:] + np.cross(twists[k, :3], place - centre), False

        return Arrows.of(rows())
