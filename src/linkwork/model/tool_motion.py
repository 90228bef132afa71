"""Tool motion: twist and acceleration of the tool at states, and the same in its task coordinates.

    x' = E t = J v,    J = E T,    x'' = E t' + E' t        t = [omega; v] = T v

Of a whole rotation vector x' and x'' are the angular velocity and acceleration (`equations.task`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.equations.task import task_map
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.kernels.from_python import Arrays, Columns
from linkwork.mechanism.task import label
from linkwork.model import checks
from linkwork.model.charts import CompiledChart
from linkwork.model.directly import DirectCalls
from linkwork.model.evaluation import of_motion, require_regular
from linkwork.model.reordering import evaluated
from linkwork.model.state import State
from linkwork.model.task import Task

if TYPE_CHECKING:
    from linkwork.model.model import Model


STEEP = 1e8  # rate of a coordinate per that of the tool, from which it has none


def led(
    robot: Model,
    state: State,
    task: Task,
    accelerations: ArrayLike | Mapping[str, ArrayLike] | None = None,
) -> tuple[np.ndarray, ...]:
    """Return J (..., k, n), x' (..., k) and, for accelerations v' (..., n), x'' (..., k) of task
    coordinates, then how steep each is."""
    kind = task, accelerations is not None
    if (found := robot.once(led_directly, *kind).at(state, accelerations)) is not None:
        return found
    # Stacks, weak orders of elimination, and what is to be refused.
    chart = robot.chart_of(robot.own(state))
    given, what = of_motion(state, accelerations)
    J, *found, steep, pivot = evaluated(
        robot, chart, lambda other: led_kernel(other, *kind), state.q, *given
    )
    if checks.weakest(pivot) > checks.PIVOT_BOUND and not np.isfinite(steep).all():
        wrong = ~np.isfinite(steep.reshape(-1, len(task))).all(axis=0)
        raise LinkworkError(
            f"the tool's {label(task[int(np.argmax(wrong))])} has no rate at this pose; choose "
            "another coordinate there"
        )
    require_regular(robot, state, pivot, found[-1], given[-1], what)
    J = J.reshape(*J.shape[:-1], len(state.independent), len(task))
    return np.swapaxes(J, -1, -2), *found, steep


def led_directly(robot: Model, task: Task, accelerating: bool) -> DirectCalls:
    """Return the shortest calls of the same at one state."""
    robot.require_tool()
    kernel = partial(led_kernel, task=task, accelerating=accelerating)
    return DirectCalls(robot.coordinates, robot.charts, kernel, jacobian_and_vectors)


def jacobian_and_vectors(kernel: Kernel, n: int) -> tuple[int, Arrays]:
    """Return where the outputs of `led_kernel` begin, and their shapes."""
    (_, size), *vectors, _ = kernel.outputs
    return 0, (Columns((size // n, n)), *((size,) for _, size in vectors))


@lru_cache(maxsize=256)
def led_kernel(chart: CompiledChart, task: Task, accelerating: bool) -> Kernel:
    """Return the kernel of (q, v[, v']) -> J, x'[, x''], how steep coordinates are (k), infinite
    where they have no rate, and the weakest relative pivot."""

    def made(equations: Equations) -> ca.Function:
        q, v, p = equations.tree.q, equations.v, equations.p
        dv = SX.sym("dv", equations.mobility) if accelerating else SX.zeros(equations.mobility)
        motion = functions.tool_motion(equations)
        pose, T, twist, acceleration, pivot = motion.call([q, v, dv, p], True, False)
        _, E, bias = task_map(task).call([pose, twist], True, False)
        steep = ca.sum2(ca.fabs(E))
        outputs = {"J": E @ T, "rates": E @ twist}
        if accelerating:
            outputs["accelerations"] = E @ acceleration + bias
        outputs["steep"] = ca.if_else(steep < STEEP, steep, np.inf)
        given = {"dv": dv} if accelerating else {}
        return functions.function("led", equations, outputs | {"pivot": pivot}, v=v, **given)

    return chart.compiled(f"led in {task}, {accelerating}", made).given(chart.p)
