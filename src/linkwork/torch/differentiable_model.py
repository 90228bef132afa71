"""A robot's functions of tensors, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, wraps
from typing import Any

import numpy as np
import torch
from torch import Tensor

from linkwork.autodiff import ArrayFunction, ArrayModel
from linkwork.errors import LinkworkError
from linkwork.model.state import State
from linkwork.robot import Robot
from linkwork.torch import stepping
from linkwork.torch.guard import Guard
from linkwork.torch.operators import operator

DEVICES = ("cpu", "meta")  # and what knows shapes alone, when it is compiled


class TorchModel(ArrayModel):
    """Hold a robot's functions of tensors, as an `ArrayModel` does.

    Tensors are doubles on a processor: others are converted, those on another device refused.
    Gradients are of reverse mode; `torch.func` (grad, vjp, jacrev, vmap) and `torch.compile` know
    all functions.
    """

    def __init__(self, robot: Robot, chart: State | Sequence[str] | None, singular: str):
        super().__init__(robot, chart, singular)
        for name in self.functions:
            setattr(self, name, self._in_graphs(name))

    def _rolled(self, q: Tensor, v: Tensor, u: Tensor, rest: list[Tensor]) -> tuple[Tensor, Tensor]:
        along = [(q, v)]
        for forces in u:
            along.append(self._stepping(*self._together(*along[-1], forces, *rest)))
        states = [torch.stack(part) for part in zip(*along, strict=True)]
        return states[0], states[1]

    def _in_graphs(self, name: str) -> Callable[..., Any]:
        """Return a function as `torch.compile` is to see it: a node of its graph, whose inside is
        made when it is first evaluated."""
        own = getattr(type(self), name, None)

        def call(*given: Any, **named: Any) -> Any:
            return own(self, *given, **named) if own else self._door(name)(*given, **named)

        seen: Any = torch.compiler.allow_in_graph(wraps(own)(call) if own else call)
        return seen

    @staticmethod
    def _doubles(value: Any) -> Tensor | None:
        if isinstance(value, Tensor) and value.device.type not in DEVICES:
            raise LinkworkError(
                f"the robot is evaluated on processors, and a tensor is on {value.device}; give "
                "tensor.cpu()"
            )
        try:
            tensor = value if isinstance(value, Tensor) else torch.from_numpy(np.array(value))
            real = not (tensor.is_complex() or tensor.dtype is torch.bool)
            return tensor.to(torch.float64) if real else None
        except (TypeError, ValueError, RuntimeError):
            return None

    @staticmethod
    def _broadcast(arrays: Sequence[Tensor]) -> list[Tensor] | None:
        try:
            lead = torch.broadcast_shapes(*(array.shape[:-1] for array in arrays))
        except RuntimeError:
            return None
        return [array.expand(*lead, array.shape[-1]) for array in arrays]

    def _operator(self, of: ArrayFunction) -> Callable[..., Tensor]:
        return operator(of, self._guard(of.name))

    @cached_property
    def _closing(self) -> Callable[..., Tensor]:
        return stepping.closing(self._offered, self._guard("closed"))

    @cached_property
    def _stepping(self) -> Callable[..., tuple[Tensor, Tensor]]:
        return stepping.stepping(self._offered, self._guard("step"))

    def _guard(self, what: str) -> Guard:
        return Guard(f"{what} of {self.name}", self.independent, self._raises)
