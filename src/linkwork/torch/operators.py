"""Functions of PyTorch whose values, and derivatives of first and second order, are custom
operators that call compiled kernels.

    y = f(x),    dL/dx = J(x)' dL/dy,    dL/dx = (dJ/dx . e_1 ... dJ/dx . e_k)' dL/dJ

J is an operator as well, and what it is multiplied with is plain PyTorch. Its own derivative is
evaluated for all unit directions side by side, as so many states. Inputs that nobody asks gradients
of are left out of J.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import count
from typing import Any

import numpy as np
import torch
from torch import Tensor

from linkwork.autodiff import ArrayFunction
from linkwork.autodiff.array_function import Wrt
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.torch.guard import Guard

Backward = Callable[..., tuple[Tensor | None, ...]]
_numbers = count()


def operator(of: ArrayFunction, guard: Guard, weighed: bool = False) -> Callable[..., Tensor]:
    """Return f as a function of tensors (..., size) with equal leading dimensions -> (..., m).

    guard: says what becomes of states for which f is not defined
    weighed: whether the weakest relative pivot follows y, as a number without a gradient
    """
    names = [name for name, _ in of.inputs]

    @cache
    def slope(wrt: Wrt) -> Callable[..., Tensor]:
        """Return J = dy/dx (..., k m), column by column, for some inputs."""

        def backward(context: Any, dJ: Tensor) -> tuple[Tensor | None, ...]:
            x, along = context.saved_tensors, needed(context)
            d = torch.eye(of.width(along), dtype=torch.float64)
            lead = x[0].shape[:-1]
            each = [a[..., None, :].expand(*lead, len(d), -1) for a in x]
            bends = bend(wrt, along)(*each, d.expand(*lead, *d.shape))
            return dealt((bends * dJ[..., None, :]).sum(-1), of, along)

        size = of.width(wrt) * of.size
        return made(f"{of.name}_slope", names, size, evaluation(of.slope(wrt), guard), backward)

    @cache
    def bend(wrt: Wrt, along: Wrt) -> Callable[..., Tensor]:
        """Return the derivative of J along directions (..., k m)."""

        def backward(context: Any, change: Tensor) -> tuple[Tensor | None, ...]:
            raise LinkworkError(
                f"{of.name} has derivatives of first and second order; a third one was asked for"
            )

        size, kernel = of.width(wrt) * of.size, of.bend(wrt, along)
        name = f"{of.name}_bend"
        return made(name, [*names, "d"], size, evaluation(kernel, guard), backward)

    def backward(context: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        wrt = needed(context)
        J = slope(wrt)(*context.saved_tensors)
        J = J.reshape(*J.shape[:-1], of.width(wrt), of.size)
        return dealt((J * dy[..., None, : of.size]).sum(-1), of, wrt)

    size = of.size + weighed
    return made(of.name, names, size, evaluation(of.value, guard, weighed), backward)


def made(
    name: str,
    inputs: Sequence[str],
    size: int,
    evaluate: Callable[..., Tensor],
    backward: Backward,
) -> Callable[..., Tensor]:
    """Return a function of tensors (..., sizes) with equal leading dimensions -> (..., size), whose
    value is a custom operator.

    It is batched by `vmap`, and known to `torch.compile` by its shape.
    """
    given = ", ".join(f"Tensor {each}" for each in inputs)
    op = torch.library.custom_op(
        f"linkwork::{name}_{next(_numbers)}",
        evaluate,
        mutates_args=(),
        device_types="cpu",
        schema=f"({given}) -> Tensor",
    )

    @op.register_fake
    def _(*x: Tensor) -> Tensor:
        return x[0].new_empty((*x[0].shape[:-1], size))

    @op.register_vmap
    def _(info: Any, places: tuple[int | None, ...], *x: Tensor) -> tuple[Tensor, int]:
        batched = [
            each.expand(info.batch_size, *each.shape) if place is None else each.movedim(place, 0)
            for each, place in zip(x, places, strict=True)
        ]
        return op(*batched), 0

    return differentiated(op, backward)


def differentiated(op: Callable[..., Tensor], back: Backward) -> Callable[..., Tensor]:
    """Return an operator with its gradient: (context, dL/dy) -> dL/dx of each input."""

    class WithGradient(torch.autograd.Function):
        generate_vmap_rule = True

        @staticmethod
        def forward(*x: Tensor) -> Tensor:
            return op(*x)

        @staticmethod
        def setup_context(ctx: Any, inputs: tuple[Tensor, ...], output: Tensor) -> None:
            ctx.save_for_backward(*inputs)

        @staticmethod
        def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
            return back(ctx, dy)

    return WithGradient.apply


def evaluation(kernel: Kernel, guard: Guard, weighed: bool = False) -> Callable[..., Tensor]:
    """Return what evaluates a kernel with an output y and, where there is one, a pivot; weighed: as
    of `operator`."""

    def evaluate(*x: Tensor) -> Tensor:
        y, *pivot = kernel(*[each.detach().numpy() for each in x])
        y = guard.sound(y, *pivot)
        return torch.from_numpy(np.concatenate([y, *pivot], axis=-1) if weighed else y)

    return evaluate


def needed(context: Any) -> Wrt:
    """Return the inputs that gradients are asked of."""
    asked = zip(context.needs_input_grad, context.saved_tensors, strict=True)
    return tuple(i for i, (wanted, x) in enumerate(asked) if wanted and x.shape[-1])


def dealt(gradient: Tensor, of: ArrayFunction, wrt: Wrt) -> tuple[Tensor | None, ...]:
    """Return a gradient by some inputs, one after the other (..., k), as one of each input."""
    parts = iter(gradient.split([of.inputs[i][1] for i in wrt], dim=-1))
    return tuple(next(parts) if i in wrt else None for i in range(len(of.inputs)))
