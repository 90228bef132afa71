"""The same motion by several ways: prescribed, computed by Linkwork from the forces, and by
independent engines.

    motion --inverse dynamics--> forces u(t) --forward dynamics--> motion again

Inverse dynamics gives the forces at the motion's samples; a spline through every second of them
drives all forward simulations, and the samples in between measure how well the spline holds the
forces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from linkwork.equations.algebra import rotation_matrix, wrapped
from linkwork.errors import LinkworkError
from linkwork.lab import engines
from linkwork.model.labels import POSES
from linkwork.robot import Motion, Robot
from linkwork.simulation import Run, Sampled, Signal, as_signal

if TYPE_CHECKING:
    import xarray

PRESCRIBED, NOC = "prescribed", "noc"
REPEATS = 5
RTOL, ATOL = 1e-11, 1e-13
TITLES = {"exudyn": "Exudyn", "pinocchio": "Pinocchio", "mujoco": "MuJoCo"}


@dataclass(frozen=True)
class Curve:
    """Hold one source's motion at the common times (K).

    Attributes:
        source, title: its name in data and in pictures.
        positions: coordinates of all joints (K, m) [m, rad; 1 of quaternions].
        accelerations: of the actuated joints (K, n) [m/s^2, rad/s^2].
        tool: pose of the tool (K, 3 planar or 6 spatial) [m, rad].
        closure_error: largest gap of a loop over the run [m]; none for the prescribed motion.
        steps: number of steps taken; seconds: wall time of the run [s]; none for the prescribed
            motion.
    """

    source: str
    title: str
    positions: np.ndarray
    accelerations: np.ndarray
    tool: np.ndarray
    closure_error: float | None = None
    steps: int | None = None
    seconds: float | None = None


@dataclass(frozen=True)
class Comparison:
    """Hold a motion by all sources, and the forces that drove them.

    Attributes:
        robot: a robot with a tool; time: the common times (K,) [s]; forces: of the actuators (K, n)
            [N, N m].
        curves: the prescribed motion first, then Linkwork's, then the engines'.
        spline_error: largest error of the forces' spline between its knots, per actuator (n,)
            [N, N m].
        failures: why an engine that was asked gave no motion, by its name.
    """

    robot: Robot
    time: np.ndarray
    forces: np.ndarray
    curves: tuple[Curve, ...]
    spline_error: np.ndarray
    failures: dict[str, str]

    def __getitem__(self, source: str) -> Curve:
        return next(curve for curve in self.curves if curve.source == source)

    @property
    def engines(self) -> tuple[Curve, ...]:
        """Return the engines' curves."""
        return self.curves[2:]

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """Return all curves as an `xarray.Dataset` over source, time, coordinate, actuator and
        pose."""
        return as_dataset(self)


def compare(robot: Robot, motion: Motion, asked: Sequence[str], step: float = 5e-4) -> Comparison:
    """Compute a motion again from its forces, by Linkwork and by independent engines.

    Args:
        robot: the robot.
        motion: the prescribed motion with an odd number of samples, 2 K - 1; the common times are
            every second of them.
        asked: names of engines (`linkwork.lab.engines.available`).
        step: of the engines, all of which take fixed steps [s]; the common times are made of whole
            steps.

    Raises:
        LinkworkError: an even number of samples, steps that do not fit, or a run of Linkwork that
            ended early.
    """
    if len(motion.time) % 2 == 0:
        raise LinkworkError(f"the motion has {len(motion.time)} samples; give an odd number")
    forces = np.asarray(robot.inverse_dynamics(motion.state, motion.accelerations))
    time, start = motion.time[::2], motion.state.at(0)
    signal = as_signal(Sampled(time, forces[::2]))
    spline_error = np.abs(signal(motion.time[1::2]) - forces[1::2]).max(axis=0)
    positions, tool = motion.positions, robot.tool_pose(motion.state)
    accelerations = motion.joint_accelerations[::2, actuated(robot)]
    prescribed = Curve(PRESCRIBED, "Prescribed", positions[::2], accelerations, tool[::2])
    curves, failures = [prescribed, by_noc(robot, motion, signal, time)], {}
    for name in asked:
        try:
            curves.append(
                by_engine(
                    robot, name, start.positions, robot.joint_rates(start), signal, time, step
                )
            )
        except engines.EngineError as error:
            failures[name] = str(error)
    return Comparison(robot, time, forces[::2], tuple(curves), spline_error, failures)


def by_noc(robot: Robot, motion: Motion, signal: Signal, time: np.ndarray) -> Curve:
    """Simulate by Linkwork; the time is the shortest of a few calls."""

    def simulate() -> tuple[float, Run]:
        start = perf_counter()
        run = robot.simulate(
            motion.state.at(0), signal, duration=float(time[-1]), rtol=RTOL, atol=ATOL, save_at=time
        )
        # What follows from coordinates and rates is measured when it is asked for.
        dict(run.variables)
        return perf_counter() - start, run

    runs = [simulate() for _ in range(REPEATS)]
    run = runs[0][1]
    if not run.success:
        raise LinkworkError(f"the motion cannot be computed again from its forces: {run.message}")
    variables = {name: variable.values for name, variable in run.variables.items()}
    return Curve(
        NOC,
        "Linkwork (NOC)",
        variables["joint_position"],
        variables["joint_acceleration"][:, actuated(robot)],
        variables["tool_pose"],
        run.closure_error * robot.equations.tree.length,
        run.steps,
        min(seconds for seconds, _ in runs),
    )


def actuated(robot: Robot) -> list[int]:
    """Return where the actuated rates stand among all rates."""
    return [robot.rates.index(name) for name in robot.actuators]


def by_engine(
    robot: Robot,
    name: str,
    positions: np.ndarray,
    rates: np.ndarray,
    signal: Signal,
    time: np.ndarray,
    step: float,
) -> Curve:
    """Simulate by an engine from positions and rates of all joints."""
    engine = engines.build(name, robot.mechanism)
    duration = float(time[-1])
    stride = round((time[1] - time[0]) / step)
    if stride < 1 or abs(stride * step * (len(time) - 1) - duration) > 1e-9 * duration:
        raise LinkworkError(
            f"steps of {step:g} s do not divide the {time[1] - time[0]:g} s between two samples"
        )
    run = engine.simulate(positions, rates, signal, duration, step)
    return Curve(
        name,
        f"{TITLES.get(name, name)} {engine.version}",
        run.positions[::stride],
        run.accelerations[::stride],
        tool_poses(robot, run.body_poses[::stride]),
        run.closure_error,
        len(run.time) - 1,
        run.seconds,
    )


def tool_poses(robot: Robot, poses: np.ndarray) -> np.ndarray:
    """Return the tool's pose (K, 3 planar or 6 spatial) [m, rad] from the poses (K, r, 4, 4) of the
    bodies."""
    from scipy.spatial.transform import Rotation

    tool = robot.mechanism.first_tool
    X = poses[:, robot.bodies.index(tool.body)]
    p = X[:, :3, :3] @ np.array(tool.frame.position) + X[:, :3, 3]
    R = X[:, :3, :3] @ rotation_matrix(tool.frame.orientation)
    if robot.planar:
        return np.column_stack([p[:, :2], np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))])
    return np.hstack([p, Rotation.from_matrix(R).as_rotvec()])


# Differences


def tool_differences(robot: Robot, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance (K,) [m] and the angle (K,) [rad] between two series of tool poses."""
    if robot.planar:
        turn = wrapped(a[:, 2] - b[:, 2])
        return np.linalg.norm(a[:, :2] - b[:, :2], axis=1), np.abs(turn)
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_rotvec(a[:, 3:]) * Rotation.from_rotvec(b[:, 3:]).inv()
    return np.linalg.norm(a[:, :3] - b[:, :3], axis=1), turn.magnitude()


def largest_differences(robot: Robot, a: Curve, b: Curve) -> dict[tuple[str, str], float]:
    """Return the largest differences between two curves over time, by quantity and unit.

    Quantities: joint position (of all joints, lengths and angles apart), acceleration
    (of the actuated joints), tool.
    """
    found: dict[tuple[str, str], float] = {}
    units = {"m": "m/s²", "rad": "rad/s²"}
    accelerations = np.abs(a.accelerations - b.accelerations).T
    series = [
        ("joint position", unit, values)
        for unit, values in position_differences(robot, a.positions, b.positions)
    ]
    series += [
        ("acceleration", units[robot.unit(name)], values)
        for name, values in zip(robot.actuators, accelerations, strict=True)
    ]
    for quantity, unit, values in series:
        found[quantity, unit] = max(found.get((quantity, unit), 0.0), float(values.max()))
    distance, angle = tool_differences(robot, a.tool, b.tool)
    return found | {("tool", "m"): float(distance.max()), ("tool", "rad"): float(angle.max())}


def position_differences(
    robot: Robot, a: np.ndarray, b: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield unit and difference (K,) of each joint coordinate, of a quaternion the angle between
    the two turns.

    Unit quaternions p, q of turns that differ by the angle t:  |p -+ q| = 2 sin(t / 4).
    """
    parts = [index for index, name in enumerate(robot.coordinates) if robot.unit(name) == "1"]
    for index, name in enumerate(robot.coordinates):
        if index not in parts:
            yield robot.unit(name), np.abs(a[:, index] - b[:, index])
    for first in parts[::4]:
        p, q = a[:, first : first + 4], b[:, first : first + 4]
        chord = np.minimum(np.linalg.norm(p - q, axis=1), np.linalg.norm(p + q, axis=1))
        yield "rad", 4 * np.arcsin(chord / 2)


def as_dataset(comparison: Comparison) -> xarray.Dataset:
    import xarray

    # One row for each source.
    robot, curves = comparison.robot, comparison.curves

    def stacked(field: str) -> np.ndarray:
        return np.stack([getattr(curve, field) for curve in curves])

    def numbers(field: str) -> np.ndarray:
        return np.array(
            [np.nan if (value := getattr(curve, field)) is None else value for curve in curves],
            float,
        )

    # What the columns are.
    coordinates = {"unit_of_each": ", ".join(robot.unit(name) for name in robot.coordinates)}
    pose = list(POSES[robot.planar])
    seconds = "s, wall time of the run (Linkwork: the shortest of a few)"
    return xarray.Dataset(
        {
            "joint_position": (
                ("source", "time", "coordinate"),
                stacked("positions"),
                {"units": "m, rad"},
            ),
            "actuator_acceleration": (
                ("source", "time", "actuator"),
                stacked("accelerations"),
                {"units": "m/s^2, rad/s^2"},
            ),
            "tool_pose": (("source", "time", "pose"), stacked("tool"), {"units": "m, rad"}),
            "actuator_force": (("time", "actuator"), comparison.forces, {"units": "N, N m"}),
            "spline_error": ("actuator", comparison.spline_error, {"units": "N, N m"}),
            "closure_error": ("source", numbers("closure_error"), {"units": "m"}),
            "steps": ("source", numbers("steps"), {"units": "1"}),
            "wall_time": ("source", numbers("seconds"), {"units": "s", "long_name": seconds}),
        },
        {
            "source": ("source", [curve.source for curve in curves]),
            "title": ("source", [curve.title for curve in curves]),
            "time": ("time", comparison.time, {"units": "s"}),
            "coordinate": ("coordinate", list(robot.coordinates), coordinates),
            "actuator": ("actuator", list(robot.actuators)),
            "pose": ("pose", pose),
        },
        {"mechanism": robot.mechanism.name},
    )
