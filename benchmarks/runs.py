"""The task of `tasks.py` in Linkwork's hands, at three depths: the compiled loop, `integrate`,
`robot.simulate`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from types import ModuleType
from unittest.mock import patch

import numpy as np

import linkwork as lw
from linkwork.model.charts import CompiledChart
from linkwork.simulation import Run, Trajectory, integrate, native

from benchmarks.tasks import Task

ATOL = 1e-2  # absolute tolerances, relative to the relative ones


@cache
def chart(robot: lw.Robot, task: Task) -> CompiledChart:
    """Return the home chart with its pivots counted positive where the task starts, as runs need
    it."""
    return robot.chart.facing(task.start.q)


def integrated(robot: lw.Robot, task: Task, tolerance: float) -> Trajectory:
    """Return the trajectory, its end saved: the compiled loop with the checks around it."""
    kernel = chart(robot, task).kernel
    trajectory = integrate(
        kernel("motion").address, kernel("closure_step").address,
        task.start.q, task.start.rates, task.signal,
        duration=task.duration, rtol=tolerance, atol=ATOL * tolerance, save_at=[task.duration],
    )  # fmt: skip
    assert trajectory.status is lw.Status.FINISHED, trajectory.message
    return trajectory


def recorded(robot: lw.Robot, task: Task, tolerance: float) -> Run:
    """Return the run, its end saved: everything that follows from the state is measured and
    named."""
    return robot.simulate(
        task.start,
        task.signal,
        duration=task.duration,
        rtol=tolerance,
        atol=ATOL * tolerance,
        save_at=[task.duration],
    )


def joints_at_end(robot: lw.Robot, run: Run) -> np.ndarray:
    """Return all joint coordinates at the end of a run, without measuring anything else."""
    return robot.kernel("positions")(run.attrs["final_q"])[0]


def compiled_loop(robot: lw.Robot, task: Task, tolerance: float) -> Callable[[], np.ndarray]:
    """Return the compiled loop alone as a call that returns the tree's coordinates at the end."""
    call = loop_of(lambda: integrated(robot, task, tolerance))
    return lambda: call()[: robot.equations.nq]


def loop_of(run: Callable[[], object], module: ModuleType = native) -> Callable[[], np.ndarray]:
    """Return the compiled loop that a run calls, alone, as a call that returns the state y at its
    end, and behind it what a sampled controller holds.

    Its arguments are those with which the run called it, once in each chart; y, which it
    overwrites, is set anew.

    module: where the loop is: `native`, or `native_rosenbrock` for the stiff method
    """
    loop = module.integrate
    place = list(signature(loop.py_func).parameters).index("y")
    found: list[tuple[tuple, np.ndarray]] = []

    def spy(*arguments: object) -> object:
        found.append((arguments, np.copy(arguments[place])))  # pyright: ignore
        return loop(*arguments)

    with patch.object(module, "integrate", spy):
        run()
    calls = [(arguments, arguments[place], start) for arguments, start in found]

    def call() -> np.ndarray:
        for arguments, state, start in calls:
            state[:] = start
            loop(*arguments)
        return calls[-1][1]

    return call
