"""A driven way: what the rates, accelerations and forces of a robot's actuators are along a path,
per s'', s'^2 and at rest, as rows for the laws that run through it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.mechanism.limits import undriven_speeds
from linkwork.model.passing import singularities_passed
from linkwork.model.state import Motion
from linkwork.motions.reachability import Constraints
from linkwork.robot import Robot

BETWEEN = 4  # parts of an interval of the grid at whose ends limits are verified
STEP = 1e-4  # of the difference by which friction's slope is found, over s'
LEAP, SEEN = 10.0, 1e-3
"""How much more a value changes between two samples than beside them where it leaps; part of
their size from which on that is seen."""
CORNER = "the path has a corner"
RESTING = 1e-9
"""Rate of all joints at an end of a path, over its largest, below which the path rests there by
itself."""


@dataclass(frozen=True, eq=False)
class DrivenWay:
    """Hold a robot along a path, as a motion with s for the time, at the points of a grid and at
    those between."""

    robot: Robot
    motion: Motion

    @cached_property
    def rates(self) -> np.ndarray:
        """Rates of the actuators at s' = 1 (points, actuators)."""
        S = self.robot.actuation(self.motion.state)
        return (S @ self.motion.rates[..., None])[..., 0]

    @cached_property
    def passive(self) -> np.ndarray:
        """Squared rates over their limits, at s' = 1, of what is no actuator and has a limit of
        speed in the description (points, limits)."""
        robot, rates = self.robot, self.motion.joint_rates
        found = [
            (rates[:, [robot.rates.index(label) for label in labels]] ** 2).sum(axis=1) / speed**2
            for labels, speed in undriven_speeds(robot.mechanism)
        ]
        return np.array(found).reshape(len(found), len(rates)).T

    @cached_property
    def bends(self) -> np.ndarray:
        """Accelerations of the actuators at s' = 1, s'' = 0 (points, actuators)."""
        if set(self.robot.actuators) <= set(self.robot.rates):
            places = [self.robot.rates.index(name) for name in self.robot.actuators]
            return self.motion.joint_accelerations[:, places]
        raise LinkworkError(
            "an actuator has no coordinate of its own whose acceleration or jerk could be limited; "
            "limit its force"
        )

    @cached_property
    def rests(self) -> tuple[bool, bool]:
        """Whether the path rests by itself at its begin and at its end."""
        speed = np.abs(self.motion.joint_rates).max(axis=1)
        return bool(speed[0] < RESTING * speed.max()), bool(speed[-1] < RESTING * speed.max())

    def forces(self, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Return u (points, actuators) for s' and s'' (points,)."""
        motion = self.motion
        v = motion.rates * rate[:, None]
        v_dot = motion.rates * acceleration[:, None] + motion.accelerations * rate[:, None] ** 2
        return self.robot.inverse_dynamics(motion.state.with_rates(v), v_dot)

    @staticmethod
    def forced(limits: Mapping[str, np.ndarray]) -> bool:
        """Whether forces, or powers, have limits."""
        return any(bool(np.isfinite(limits[kind]).any()) for kind in ("force", "power"))

    @cached_property
    def holding(self) -> np.ndarray:
        """u at rest."""
        return self.forces(0 * self.motion.time, 0 * self.motion.time)

    def unheld(self, most: np.ndarray, point: int) -> str:
        """Say which actuator cannot hold the robot at a point of the path, nothing if all can."""
        held = self.holding[point]
        if not (beyond := np.abs(held) >= most).any():
            return ""
        k = int(np.argmax(beyond))
        return (
            f"the actuator {self.robot.actuators[k]!r} needs {held[k]:.6g} to hold the robot "
            f"still, and its limit is {most[k]:.6g}; give more force, or another path"
        )

    @cached_property
    def per_acceleration(self) -> np.ndarray:
        """alpha, u per s''."""
        return self.forces(0 * self.motion.time, 1 + 0 * self.motion.time) - self.holding

    @cached_property
    def smooth(self) -> bool:
        """Whether no force but the bodies' inertia depends on rates."""
        state = self.motion.state
        moving, resting = (
            self.robot.passive_forces(each) for each in (state, state.with_rates(0 * state.rates))
        )
        return bool((moving == resting).all())

    def at_speed(self, x: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Return beta and gamma (points, actuators) of the tangent at x (points,), u = alpha s'' +
        beta x + gamma; of the secant to x = 1 where there is none."""
        zero = 0 * self.motion.time
        if self.smooth or x is None:
            return self.forces(zero + 1, zero) - self.holding, self.holding
        rate = np.sqrt(x)
        moving = rate > 0
        high, low = (self.forces(rate * (1 + h), zero) for h in (STEP, -STEP))
        slope = (high - low) / np.where(moving, 4 * STEP * x, 1.0)[:, None]
        slope[~moving] = 0
        return slope, self.forces(rate, zero) - slope * x[:, None]

    def constraints(self, limits: Mapping[str, np.ndarray], x: np.ndarray | None) -> Constraints:
        """Return all limits as linear rows, each over its limit; x: at which what is curved is
        replaced by its tangent."""
        alpha, (beta, gamma), r = self.per_acceleration, self.at_speed(x), self.rates
        zero, one = 0 * r, 1 + 0 * r
        blocks = []
        if np.isfinite(limits["speed"]).any():
            blocks.append((zero, (r / limits["speed"]) ** 2, one))
        if self.passive.size:
            blocks.append((0 * self.passive, self.passive, 1 + 0 * self.passive))
        if np.isfinite(limits["acceleration"]).any():
            A = limits["acceleration"]
            blocks += [(sign * r / A, sign * self.bends / A, one) for sign in (1, -1)]
        if np.isfinite(limits["force"]).any():
            U = limits["force"]
            blocks += [
                (sign * alpha / U, sign * beta / U, 1 - sign * gamma / U) for sign in (1, -1)
            ]
        if x is not None and np.isfinite(limits["power"]).any():
            # Over P / |r s'|, whose tangent is 3/2 - x / (2 x_k).
            over = np.abs(r) * np.sqrt(x)[:, None] / limits["power"]
            bend = np.divide(0.5, x, out=np.zeros_like(x), where=x > 0)[:, None] + zero
            blocks += [
                (sign * alpha * over, sign * beta * over + bend, 1.5 - sign * gamma * over)
                for sign in (1, -1)
            ]
        a, b, c = (np.hstack(parts) for parts in zip(*blocks, strict=True))
        return Constraints(self.motion.time, a, b, c)


def refuse_leap(values: np.ndarray, s: np.ndarray, size: float, what: str) -> None:
    """Refuse a path along which values (samples, actuators) leap, by more than a part of a size.

    s: of the path at the samples; what: it does there
    """
    change = np.abs(np.diff(values, axis=0)).max(axis=1, initial=0.0)
    before, after = np.append(change[1], change[:-1]), np.append(change[1:], change[-2])
    leaps = (change > LEAP * np.maximum(before, after)) & (change > SEEN * size)
    for k in np.flatnonzero(leaps)[:1].tolist():
        raise LinkworkError(
            f"between s = {s[k]:.4g} and {s[k + 1]:.4g} (of 1) {what}; give its smooth parts one "
            "by one, or a path without"
        )


def refuse_passing(way: DrivenWay, limits: Mapping[str, np.ndarray], s: np.ndarray) -> None:
    """Refuse a path that passes, between two points of the grid, where the actuators do not hold
    the robot, if they have limits of force or power; s: of the path at the points."""
    if not np.isfinite([limits["force"], limits["power"]]).any():
        return
    for times in singularities_passed(way.robot, way.motion)[:1]:
        first, last = np.interp(times, way.motion.time, s)
        raise LinkworkError(
            f"between s = {first:.4g} and {last:.4g} of the path (of 1) it passes where the "
            "actuators do not hold the robot (actuator-singular), for which no force is enough; "
            "give another path, or another branch"
        )
