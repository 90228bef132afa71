"""Goals in task coordinates: what a controller leads a tool to: a pose, a motion, or sampled
coordinates.

Columns are either as a user tells them, one for each coordinate, rx, ry, rz of a whole orientation
as a rotation vector; or, of states and motions, as they are smooth over time: the held coordinates
(`equations.task.held_task`) without those of a whole orientation, angles unwrapped, and behind them
the orientation's quaternion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from linkwork import checks
from linkwork.control.goals import DesiredMotion, warn_of_few
from linkwork.control.plant import NamedCoordinates, TaskPlant, TimedStates
from linkwork.equations.task import held_task, whole_rotation
from linkwork.errors import LinkworkError
from linkwork.mechanism.task import ROTATION, TaskCoordinate, is_angle, label, labels
from linkwork.simulation import Sampled, Signal, as_signal

Task = tuple[TaskCoordinate, ...]
TaskGoal: TypeAlias = NamedCoordinates | TimedStates | Mapping[str, float] | Sampled | Signal


@dataclass(frozen=True, eq=False)
class TaskCourse:
    """Hold the columns of a goal over time; told: whether they are as a user tells them."""

    columns: DesiredMotion
    told: bool


def task_course(goal: TaskGoal, model: TaskPlant, task: Task) -> TaskCourse:
    """Return what a goal asks of the tool.

    Args:
        goal: a `State` or a `Motion` of the model's joints, the task's coordinates by name [m,
            rad], or a signal of them in their order.
        model: tells the tool's coordinates of states; task: those that lead it.

    Raises:
        LinkworkError: missing or unknown coordinates, signals of another width, poses at which the
            model is singular.
    """
    names = labels(task)
    if isinstance(goal, Sampled | Signal):
        signal = as_signal(goal)
        width = signal.coefficients.shape[2]
        if width != len(names):
            raise LinkworkError(
                f"the goal has {width} columns; give {len(names)}: {', '.join(names)}"
            )
        checks.in_order(goal, names, "the coordinates of the goal")
        return TaskCourse(DesiredMotion(signal), True)
    if isinstance(goal, Mapping):
        checks.known(goal, names, "coordinate of the task")
        if lacking := [name for name in names if name not in goal]:
            raise LinkworkError(
                f"the goal lacks {', '.join(lacking)}; give all of {', '.join(names)}"
            )
        values = [checks.number(goal[name], f"{name} of the goal") for name in names]
        return TaskCourse(DesiredMotion(as_signal(values)), True)
    return TaskCourse(DesiredMotion(smooth(goal, model, task)), False)


def smooth(goal: Any, model: TaskPlant, task: Task) -> Signal:
    """Return the smooth columns of a state or of a motion."""
    moving = hasattr(goal, "time") and hasattr(goal, "state")
    states = goal.state if moving else goal
    if not hasattr(states, "positions"):
        raise LinkworkError(
            f"the goal is {goal!r}; give a state, a motion, coordinates by name, or a signal of "
            f"{', '.join(labels(task))}"
        )
    if moving:
        warn_of_few(goal)
    require_regular_goal(model, task, states, goal.time if moving else np.zeros(1))
    held = held_task(task)
    values = np.atleast_2d(model.task_values(states, labels(held)))
    turned = [label(item) in ROTATION and whole_rotation(held) for item in held]
    columns = [
        np.unwrap(column) if is_angle(item) else column
        for item, column, apart in zip(held, values.T, turned, strict=True)
        if not apart
    ]
    if any(turned):
        columns += [*quaternions(values[:, [labels(held).index(name) for name in ROTATION]]).T]
    found = np.stack(columns, axis=-1)
    return as_signal(Sampled(goal.time, found) if moving else found[0])


def quaternions(vectors: np.ndarray) -> np.ndarray:
    """Return the quaternions (K, 4), w first, of rotation vectors (K, 3), each with the sign that
    is next to the one before."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    found = np.hstack([np.cos(angle / 2), vectors * np.sinc(angle / (2 * np.pi)) / 2])
    signs = np.sign(np.sum(found[1:] * found[:-1], axis=1))
    found[1:] *= np.cumprod(np.where(signs < 0, -1.0, 1.0))[:, None]
    return found


def require_regular_goal(model: TaskPlant, task: Task, states: Any, times: np.ndarray) -> None:
    """Refuse states at which the actuators do not lead the tool along its task."""
    lost = np.flatnonzero(np.atleast_1d(model.conditioning(states)) == 0)
    if lost.size:
        when = f" at {float(times[lost[0]]):.6g} s" if len(times) > 1 else ""
        raise LinkworkError(
            f"the goal is singular{when}: there the actuators do not lead the tool in "
            f"{', '.join(labels(task))}; give another goal, or lead the joints"
        )
