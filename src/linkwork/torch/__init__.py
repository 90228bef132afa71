"""A robot's equations of motion as functions of PyTorch: custom operators with `autograd`, `vmap`
and `torch.compile`, on processors.

    import linkwork.torch

    model = linkwork.torch.model(robot)
    dv = model.forward_dynamics(q, v, u)

PyTorch is imported by `model` alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from linkwork.checks import imported
from linkwork.model.state import State
from linkwork.robot import Robot

if TYPE_CHECKING:
    from linkwork.torch.differentiable_model import TorchModel

__all__ = ["model"]


def model(
    robot: Robot,
    chart: State | Sequence[str] | None = None,
    *,
    singular: Literal["raise", "nan"] = "raise",
) -> TorchModel:
    """Return a robot's functions for PyTorch, in one choice of independent rates.

    Args:
        robot: the robot.
        chart: names of the independent rates, which have to determine the motion at home; or a
            state, whose independent rates are taken, in an order of elimination that is good
            there; those of the robot at home if left out.
        singular: what happens at a state where these rates do not determine the motion, where loops
            do not close, and where numbers are not finite: a `LinkworkError` that names it, or NaN
            in its results alone.

    Returns:
        A `TorchModel`: forward_dynamics, inverse_dynamics, closed, step, rollout, tool_pose,
            energy, mass_matrix ...

    Raises:
        LinkworkError: PyTorch is not installed; what is no robot; rates that do not determine the
            motion; a mechanism whose derivatives take too long to compile.
    """
    imported("torch", "PyTorch is not installed; pip install 'linkwork[torch]'")
    from linkwork.torch.differentiable_model import TorchModel

    return TorchModel(robot, chart, singular)
