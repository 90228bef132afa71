"""A run as it is shown: the robot's configuration, rates and forces at any time between the run's
samples.

Between two samples the tree's coordinates are taken on the straight line and the loops closed from
there, so that what is shown is a closed configuration at every instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.scene.seen_runs import require_lengths
from linkwork.simulation import Run
from linkwork.simulation.run import Variable
from linkwork.viewer.pursuit import Pursuit


@dataclass(frozen=True, eq=False)
class Replay:
    """Hold a run's samples for one robot.

    time (K,) [s]; q (K, nq): the tree's coordinates; v (K, n): independent rates, zero where the
    run does not tell them; forces (K, actuators) [N, N m]
    """

    pursuit: Pursuit
    run: Run
    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    forces: np.ndarray

    @property
    def robot(self) -> Robot:
        return self.pursuit.robot

    @property
    def empty(self) -> bool:
        """Tell whether the run holds no sample."""
        return not len(self.time)

    @property
    def told(self) -> str:
        """Return a sentence on what is unusual about the run, or nothing."""
        if not self.run.success:
            return f"the run ended early: {self.run.message}"
        return "the run holds one sample: it stands still" if len(self.time) == 1 else ""

    def state(self, t: float) -> State:
        """Return the state at a time [s]; before the first sample the first, after the last one the
        last."""
        k, part = self.place(t)
        if part == 0:
            return self.robot.make_state(self.q[k], self.v[k])
        a, b = self.q[k], self.q[k + 1]
        q = self.pursuit.close(a + part * (b - a))
        if q is None:
            q = a if part < 0.5 else b
        return self.robot.make_state(q, self.v[k] + part * (self.v[k + 1] - self.v[k]))

    def forces_at(self, t: float) -> np.ndarray:
        """Return the actuators' forces (actuators) [N, N m] at a time [s]."""
        k, part = self.place(t)
        return (
            self.forces[k]
            if part == 0
            else self.forces[k] + part * (self.forces[k + 1] - self.forces[k])
        )

    def place(self, t: float) -> tuple[int, float]:
        """Return the sample before a time, and what part of the way to the next one has passed."""
        k = int(np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 1))
        if k == len(self.time) - 1:
            return k, 0.0
        return k, float(np.clip((t - self.time[k]) / (self.time[k + 1] - self.time[k]), 0, 1))


def replay_of(pursuit: Pursuit, run: Run) -> Replay:
    """Read a run of this robot.

    Raises:
        LinkworkError: the run is of another robot (other joints, or loops that do not close), or
            lacks joint positions.
    """
    robot = pursuit.robot
    foreign = foreign_run(robot, run)
    if foreign:
        raise LinkworkError(f"the run is not one of the robot {robot.mechanism.name!r}: {foreign}")
    require_lengths(robot, run)
    time = np.asarray(run.coords["time"].values, float)
    positions = values(run, "joint_position", (len(time), len(robot.coordinates)))
    forces = values(run, "actuator_force", (len(time), len(robot.actuators)))
    if not len(time):
        nq, n = robot.home.q.size, robot.mobility
        return Replay(pursuit, run, time, np.empty((0, nq)), np.empty((0, n)), forces)
    try:
        states = robot.state(positions, rates_of(robot, run, len(time)))
    except LinkworkError as error:
        raise LinkworkError(
            f"the run is not one of the robot {robot.mechanism.name!r}: {error}"
        ) from None
    return Replay(pursuit, run, time, unflipped(robot, states.q), states.rates, forces)


def foreign_run(robot: Robot, run: Run) -> str:
    """Say why a run cannot be one of a robot; nothing where its joints have the same names."""
    found = labels(run.coords.get("coordinate"))
    if found != robot.coordinates:
        other = [name for name in found if name not in robot.coordinates]
        lacking = [name for name in robot.coordinates if name not in found]
        return (
            f"it has the joint {other[0]!r}"
            if other
            else f"it has no joint {lacking[0] if lacking else ''!r}"
        )
    return ""


def labels(variable: Variable | None) -> tuple[str, ...]:
    return () if variable is None else tuple(map(str, variable.values))


def values(run: Run, name: str, shape: tuple[int, ...]) -> np.ndarray:
    """Return a quantity of a run; zeros of a shape where it has none."""
    return (
        np.asarray(run.variables[name].values, float) if name in run.variables else np.zeros(shape)
    )


def unflipped(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return q (K, nq) with those of its quaternions at the other sign that would jump to it from
    one sample to the next."""
    q = q.copy()
    for places, _ in robot.equations.tree.quaternions:
        p = q[:, list(places)]
        flips = np.einsum("ki,ki->k", p[1:], p[:-1]) < 0
        q[1:, list(places)] *= np.cumprod(np.where(flips, -1.0, 1.0))[:, None]
    return q


def rates_of(robot: Robot, run: Run, samples: int) -> dict[str, np.ndarray] | None:
    """Return the independent rates of a run by name, each (K,) [m/s, rad/s]; None where it does not
    tell all of them."""
    names = labels(run.coords.get("rate"))
    if "joint_rate" not in run.variables or not set(robot.independent) <= set(names):
        return None
    rates = values(run, "joint_rate", (samples, len(names)))
    return {name: rates[:, names.index(name)] for name in robot.independent}
