"""Closed configurations and steps as functions of PyTorch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from linkwork.autodiff import Offered
from linkwork.autodiff.runge_kutta import LOOSE, composed, require_steps
from linkwork.autodiff.turns import require_whole_turns
from linkwork.export.implicit import STEPS
from linkwork.kernels import Kernel
from linkwork.runs.passage import CLOSURE
from linkwork.torch.guard import Guard
from linkwork.torch.operators import made, operator


def closing(offered: Offered, guard: Guard) -> Callable[..., Tensor]:
    """Return q[, p] -> q with its loops closed and quaternions of length 1.

    Of q* = closed(q), where N is a Newton step,  dq* = dN/dq(q*) dq + dN/dp(q*) dp:  q* depends on
    the independent coordinates of q alone.
    """
    equations, enough = offered.equations, CLOSURE * offered.robot.size
    if not equations.constrained:
        return passing(equations.nq, guard)
    require_whole_turns(offered)
    newton, kernel = operator(offered.newton, guard), offered["closure_step"].value

    def evaluate(q: Tensor, *p: Tensor) -> Tensor:
        given = [each.detach().numpy() for each in p]
        found, gap = settled(kernel, q.detach().numpy().copy(), given, enough)
        return torch.from_numpy(guard.closed(guard.sound(found), gap, enough))

    def backward(ctx: Any, dq: Tensor) -> tuple[Tensor | None, ...]:
        q, *p = ctx.saved_tensors
        pulled = torch.func.vjp(newton, loops(q, *p), *p)[1]
        return pulled(dq)

    names = [name for name, _ in offered.newton.inputs]
    loops = made("closed", names, equations.nq, evaluate, backward)

    def closed(q: Tensor, *p: Tensor) -> Tensor:
        for places, _ in equations.tree.quaternions:
            own = torch.zeros(equations.nq, dtype=torch.bool)
            own[list(places)] = True
            length = torch.where(own, q, 0.0).square().sum(-1, keepdim=True).sqrt()
            q = torch.where(own, q / length, q)
        return loops(q, *p)

    return closed


def passing(nq: int, guard: Guard) -> Callable[..., Tensor]:
    """Return q[, p] -> q of a robot without loops, of which nothing but finite numbers is asked."""

    def evaluate(q: Tensor) -> Tensor:
        return torch.from_numpy(guard.sound(q.detach().numpy()).copy())

    # What is refused, NaN, has no derivative either.
    def backward(ctx: Any, dq: Tensor) -> tuple[Tensor]:
        (q,) = ctx.saved_tensors
        return (dq * (1.0 + 0.0 * same(q).detach()),)

    same = made("closed", ["q"], nq, evaluate, backward)
    return lambda q, *p: same(q)


def settled(
    kernel: Kernel, q: np.ndarray, given: Sequence[np.ndarray], enough: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return q (..., nq) after Newton's steps, each state as many as it needs, and the residuals
    that are left (...)."""
    nq = q.shape[-1]
    for _ in range(STEPS):
        y = kernel(q, *given)[0]
        open_still = ~(y[..., nq] <= enough)
        if not open_still.any():
            break
        q = np.where(open_still[..., None], y[..., :nq], q)
    return q, kernel(q, *given)[0][..., nq]


def stepping(offered: Offered, guard: Guard) -> Callable[..., tuple[Tensor, Tensor]]:
    """Return q, v, u, h[, p] -> q, v after a step of length h (..., 1).

    Its gradients are those of the evaluations and Newton steps that it is made of.
    """
    require_steps(offered)
    equations = offered.equations
    nq, n = equations.nq, equations.mobility
    rates = operator(offered["coordinate_rates"], guard)
    accelerations = operator(offered["forward_dynamics"], guard, weighed=True)
    newton = operator(offered.newton, guard) if equations.constrained else None
    watched = watching(offered, guard)

    def step(q: Tensor, v: Tensor, u: Tensor, h: Tensor, *p: Tensor) -> tuple[Tensor, Tensor]:
        pivots = []

        def motion(q: Tensor, v: Tensor, u: Tensor, *p: Tensor) -> tuple[Tensor, Tensor]:
            dv, pivot = accelerations(q, v, u, *p).split([n, 1], dim=-1)
            pivots.append(pivot)
            return rates(q, v, *p), dv

        after = composed(motion, newton)(q, v, u, h, *p)
        after_q, after_v = watched(torch.cat(after, -1), torch.cat(pivots, -1), *p).split(
            [nq, n], -1
        )
        return after_q, after_v

    return step


def watching(offered: Offered, guard: Guard) -> Callable[..., Tensor]:
    """Return (q, v), pivots (..., 4)[, p] -> (q, v), refused where loops are open or a pivot has
    changed its sign on the way."""
    equations, loose = offered.equations, LOOSE * CLOSURE * offered.robot.size
    nq = equations.nq
    closure = offered["closure_step"].value if equations.constrained else None

    def evaluate(y: Tensor, pivots: Tensor, *p: Tensor) -> Tensor:
        after, weights = y.detach().numpy().copy(), pivots.detach().numpy()
        wrong = np.asarray((weights[..., 1:] * weights[..., :1] < 0).any(axis=-1))
        if closure:
            given = [each.detach().numpy() for each in p]
            gap = closure(np.ascontiguousarray(after[..., :nq]), *given)[0][..., nq]
            wrong |= gap > loose
        return torch.from_numpy(guard.stepped(after, wrong))

    def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        if not guard.raises:
            refused = torch.isnan(watched(*ctx.saved_tensors))
            dy = torch.where(refused, torch.nan, dy)
        return (dy, *[None] * (len(ctx.saved_tensors) - 1))

    names = ["y", "pivots", *(["p"] if offered.robot.p.size else [])]
    watched = made("watched", names, nq + equations.mobility, evaluate, backward)
    return watched
