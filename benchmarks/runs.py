"""The task of `tasks.py` in Linkwork's hands, at three depths: the compiled loop, `integrate`, `robot.simulate`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from inspect import signature
from unittest.mock import patch

import numpy as np

import linkwork as lw
from linkwork.robot.charts import CompiledChart
from linkwork.simulation import Run, Trajectory, integrate, native

from benchmarks.tasks import Task

ATOL = 1e-2  # absolute tolerances, relative to the relative ones


@cache
def chart(robot: lw.Robot, task: Task) -> CompiledChart:
    """Return the home chart with its pivots counted positive where the task starts, as runs need it."""
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
    """Return the run, its end saved: everything that follows from the state is measured and named."""
    return robot.simulate(
        task.start,
        task.signal,
        duration=task.duration,
        rtol=tolerance,
        atol=ATOL * tolerance,
        save_at=[task.duration],
    )


def compiled_loop(robot: lw.Robot, task: Task, tolerance: float) -> Callable[[], np.ndarray]:
    """Return the compiled loop alone as a call that returns the tree's coordinates at the end.

    Its arguments are those with which `integrate` calls it; the state, which it overwrites, is set anew.
    """
    with patch.object(native, "integrate", wraps=native.integrate) as spy:
        integrated(robot, task, tolerance)
    arguments, loop = spy.call_args.args, native.integrate
    start = np.concatenate([task.start.q, task.start.rates])
    state = arguments[list(signature(loop.py_func).parameters).index("y")]

    def call() -> np.ndarray:
        state[:] = start
        loop(*arguments)
        return state[: robot.equations.nq]

    return call
