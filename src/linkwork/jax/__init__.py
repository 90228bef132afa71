"""A robot's equations of motion as functions of JAX: under `jit`, batched by `vmap`, with exact
derivatives of first and second order.

    import jax
    import linkwork.jax

    jax.config.update("jax_enable_x64", True)
    model = linkwork.jax.model(robot)
    dv = model.forward_dynamics(q, v, u)

XLA calls machine code that Linkwork makes; no compiler is needed. JAX is imported by `model` alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from linkwork.checks import imported
from linkwork.model.state import State
from linkwork.robot import Robot

if TYPE_CHECKING:
    from linkwork.jax.differentiable_model import JaxModel

__all__ = ["model"]


def model(
    robot: Robot,
    chart: State | Sequence[str] | None = None,
    *,
    singular: Literal["raise", "nan"] = "raise",
) -> JaxModel:
    """Return a robot's functions for JAX, in one choice of independent rates.

    Args:
        robot: the robot.
        chart: names of the independent rates, which have to determine the motion at home; or a
            state, whose independent rates are taken, in an order of elimination that is good
            there; those of the robot at home if left out.
        singular: what happens at a state where these rates do not determine the motion, and where
            numbers are not finite: an error of XLA that names it, or NaN in its results alone.

    Returns:
        A `JaxModel`: forward_dynamics, inverse_dynamics, closed, step, rollout, tool_pose, energy,
            mass_matrix ...

    Raises:
        LinkworkError: JAX is not installed, or does not compute in double precision; what is no
            robot; rates that do not determine the motion; a mechanism whose derivatives take too
            long to compile.
    """
    imported("jax", "JAX is not installed; pip install 'linkwork[jax]'")
    from linkwork.jax.differentiable_model import JaxModel
    from linkwork.jax.precision import require_doubles

    require_doubles()
    return JaxModel(robot, chart, singular)
