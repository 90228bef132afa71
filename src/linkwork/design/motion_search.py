"""The search for an optimal motion: from a timed path to local optima on a mesh."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from time import thread_time

import numpy as np

from linkwork.design.collocation import MotionGuess, MotionMesh, MotionProgramme
from linkwork.design.motion_points import MotionPoints
from linkwork.export.implicit import require_coordinates
from linkwork.ipopt import LocalOptimum, NoOptimumError
from linkwork.model.state import State
from linkwork.motions import ActuatorLimits, TimedPath, follow
from linkwork.robot import Robot

STEPS = 1000
STRETCHED = (1.0, 2.0, 4.0)  # by which the guess is slowed where nothing is found from it

Found = tuple[LocalOptimum, MotionGuess]


@dataclass(frozen=True, eq=False)
class MotionSearch:
    """Look for motions between two states (start, end), near a timed path, for some seconds of this
    thread's clock; apart: of singular poses, as `optimal_motion` says."""

    robot: Robot
    ends: tuple[State, State]
    limits: ActuatorLimits
    path: TimedPath
    intervals: int
    apart: float
    seconds: float

    def quickest(self) -> Found:
        """Return the motion of the least time, from the path or else from slower ones."""
        *others, last = [factor * self.path.duration for factor in STRETCHED]
        for T in others:
            try:
                return self.solved(self.guess.lasting(T), True)
            except NoOptimumError:
                if thread_time() > self.until:
                    raise
        return self.solved(self.guess.lasting(last), True)

    def gentlest(self, duration: float) -> Found:
        """Return the motion of the least effort: from the path if that is quick enough, or else
        from the motion of the least time."""
        if duration >= self.path.duration:
            with suppress(NoOptimumError):
                return self.solved(self.guess.lasting(duration), False)
        _, least = self.quickest()
        if duration < least.T:
            raise NoOptimumError(
                f"no motion within all limits is found in {duration:.6g} s: the least time that is "
                f"found is {least.T:.6g} s; give a longer duration"
            )
        return self.solved(least.lasting(duration), False)

    def solved(self, guess: MotionGuess, quick: bool) -> Found:
        """Return the local optimum near a guess, of the time or else of the effort in it."""
        _ = self.points.functions  # derived before the clock starts
        programme = MotionProgramme(self.mesh, self.points, guess, self.states, self.sizes, quick)
        seconds = max(self.until - thread_time(), 0.0)
        found = programme.programme().solve("motion within all limits", STEPS, seconds)
        return found, programme.motion(found.x)

    @cached_property
    def until(self) -> float:
        """When the search ends; it begins when this is first asked for."""
        return thread_time() + self.seconds

    @cached_property
    def mesh(self) -> MotionMesh:
        return MotionMesh(self.intervals)

    @cached_property
    def given(self) -> list[int]:
        """Places of the independent coordinates in q."""
        return require_coordinates(self.robot, self.robot.equations)

    @property
    def states(self) -> tuple[np.ndarray, np.ndarray]:
        """The ends (a, v)."""
        first, last = (np.concatenate([s.q[self.given], s.rates]) for s in self.ends)
        return first, last

    @cached_property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Sizes of the independent coordinates along the path, equal parts of their own units, and
        of the forces of actuators: their limits, or what inertia takes."""
        units = self.robot.equations.tree.units[self.given]
        ways = np.ptp(self.guess.y[: len(units)], axis=1) / units
        way = ways.max() * units
        most = self.limits.of(self.robot.actuators)["force"]
        taken = np.abs(self.robot.actuation(self.ends[0])) @ self.inertial(way)
        return way, np.where(np.isfinite(most), most, taken)

    def inertial(self, way: np.ndarray) -> np.ndarray:
        """Return the forces (n) that inertia takes where ways are gone in the path's duration."""
        return np.abs(self.robot.mass_matrix(self.ends[0])) @ way / self.path.duration**2

    @cached_property
    def points(self) -> MotionPoints:
        forces = self.inertial(self.sizes[0])
        return MotionPoints(self.robot, self.limits, self.ends[0], self.apart, forces)

    @cached_property
    def guess(self) -> MotionGuess:
        """The motion along the path, with forces within their limits."""
        robot, mesh, T = self.robot, self.mesh, self.path.duration
        samples = 20 * mesh.intervals + 1
        own = follow(robot, self.path, samples=samples, guess=self.ends[0], keep_limits=False)

        def at(times: np.ndarray, columns: np.ndarray) -> np.ndarray:
            return np.array([np.interp(times * T, own.time, each) for each in columns.T])

        q, v = at(mesh.nodes, own.state.q), at(mesh.nodes, own.state.rates)
        u = np.zeros((len(robot.actuators), mesh.intervals))
        if robot.actuators == robot.independent:
            most = self.limits.of(robot.actuators)["force"][:, None]
            middles = (np.arange(mesh.intervals) + 0.5) / mesh.intervals
            u = np.clip(at(middles, np.array(robot.inverse_dynamics(own))), -most, most)
        y = np.vstack([q[self.given], v])
        return MotionGuess(T, q, y, at(mesh.times, own.accelerations), u)
