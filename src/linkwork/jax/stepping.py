"""Closed configurations and steps as functions of JAX: values by one call each, derivatives by
those of what they are made of."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax.numpy as jnp

import jax
from linkwork.autodiff import Offered
from linkwork.errors import LinkworkError
from linkwork.export.implicit import STEPS
from linkwork.jax.calls import WHERE, Calls
from linkwork.jax.handler import Sentences
from linkwork.jax.operators import operator, perturbed
from linkwork.jax.steps import CLOSURES, STAGES, closing_text, step_text
from linkwork.kernels.machine import this_machine
from linkwork.mechanism.sticking import strains
from linkwork.model.checks import PIVOT_BOUND
from linkwork.runs.passage import CLOSURE

Array = Any
LOOSE = 1e3  # residual that is left after a step, over that of runs, from which on loops are open


def closing(offered: Offered, calls: Calls) -> Callable[..., Array]:
    """Return q[, p] -> q with its loops closed and quaternions of length 1.

    Of q* = closed(q), where N is a Newton step,  dq* = dN/dq(q*) dq + dN/dp(q*) dp:  q* depends on
    the independent coordinates of q alone.
    """
    equations = offered.equations
    if not equations.constrained:
        return lambda q, *p: q
    require_whole_turns(offered)
    newton, kernel = operator(offered.newton, calls), offered["closure_step"].value
    text = closing_text(kernel, STEPS, CLOSURE * offered.robot.size, this_machine())
    sizes = [size for _, size in kernel.inputs]
    call = calls.made("closed", text, sizes, [equations.nq], not_closing(calls), kernel)

    @jax.custom_jvp
    def loops(*x: Array) -> Array:
        return call(*x)[0]

    @partial(loops.defjvp, symbolic_zeros=True)
    def _(x: tuple[Array, ...], dx: tuple[Array, ...]) -> tuple[Array, Array]:
        q = loops(*x)
        return q, jvp(newton, (q, *x[1:]), dx)[1]

    def closed(q: Array, *p: Array) -> Array:
        for places, _ in equations.tree.quaternions:
            own = q[..., places.start : places.stop]
            unit = own / jnp.sqrt(jnp.sum(own * own, axis=-1, keepdims=True))
            q = q.at[..., places.start : places.stop].set(unit)
        return loops(q, *p)

    return closed


def stepping(offered: Offered, calls: Calls) -> Callable[..., tuple[Array, Array]]:
    """Return q, v, u, h[, p] -> q, v after a step of length h (..., 1); its derivatives are those
    of the evaluations and Newton steps that it is made of."""
    robot, equations = offered.robot, offered.equations
    sticking = ", ".join(each.of for each in strains(robot.mechanism))
    if sticking:
        raise LinkworkError(
            f"step is not defined: the friction of {sticking} sticks by bristles, which have "
            "states of their own; robot.simulate and robot.stepper take steps with them"
        )
    # The value: one call.
    nq, n, machine = equations.nq, equations.mobility, this_machine()
    motion = offered.motion.value
    closure = offered["closure_step"].value if equations.constrained else None
    loose = LOOSE * CLOSURE * robot.size
    text = step_text(motion, closure, PIVOT_BOUND, loose, machine)
    sizes = [size for _, size in motion.inputs]
    given = [*sizes[:3], 1, *sizes[3:]]
    call = calls.made("step", text, given, [nq, n], not_stepping(calls), motion, closure)
    # The derivatives: those of its parts.
    derivatives, accelerations, newton = (
        operator(each, calls)
        for each in (offered["coordinate_rates"], offered["forward_dynamics"], offered.newton)
    )

    def composed(q: Array, v: Array, u: Array, h: Array, *p: Array) -> tuple[Array, Array]:
        after_q, after_v, at_q, at_v = q, v, q, v
        for along, weight in STAGES:
            dq, dv = derivatives(at_q, at_v, *p), accelerations(at_q, at_v, u, *p)
            after_q, after_v = after_q + h / 6 * weight * dq, after_v + h / 6 * weight * dv
            at_q, at_v = q + h * along * dq, v + h * along * dv
        for _ in range(CLOSURES if equations.constrained else 0):
            after_q = newton(after_q, *p)
        return after_q, after_v

    @jax.custom_jvp
    def step(*x: Array) -> tuple[Array, Array]:
        return tuple(call(*x))

    @partial(step.defjvp, symbolic_zeros=True)
    def _(x: tuple[Array, ...], dx: tuple[Array, ...]) -> Any:
        return jvp(composed, x, dx)

    return step


def jvp(f: Callable[..., Any], x: tuple[Array, ...], dx: tuple[Array, ...]) -> tuple[Any, Any]:
    """Return f(x) and its derivative along dx, where some of these may be symbolic zeros."""
    wrt = perturbed(dx)

    def of_some(*some: Array) -> Any:
        given = dict(zip(wrt, some, strict=True))
        return f(*[given.get(i, each) for i, each in enumerate(x)])

    return jax.jvp(of_some, [x[i] for i in wrt], [dx[i] for i in wrt])


def require_whole_turns(offered: Offered) -> None:
    """Refuse charts in which a free turn is independent in part: what is held of it is no
    coordinate."""
    equations = offered.equations
    independent, rates = {*equations.chart.independent}, equations.tree.rates
    for _, turn in equations.tree.quaternions:
        if 0 < len(independent & {*turn}) < len(turn):
            names = ", ".join(rates[k] for k in turn)
            raise LinkworkError(
                f"closed is not defined in the rates {', '.join(equations.independent)}, which "
                f"hold some of {names}, the rates of one free turn, and not the others; choose a "
                "chart with all or none of them"
            )


def not_closing(calls: Calls) -> Sentences:
    begin = f"closed of {calls.robot}"
    return Sentences(
        f"{begin} was called with arrays of other sizes than it was made for",
        f"{begin}: the loops do not close near q; give one nearer to a closed configuration; "
        f"{WHERE}",
        f"{begin}: q holds numbers that are not finite, or is singular; {WHERE}",
    )


def not_stepping(calls: Calls) -> Sentences:
    begin, rates = f"step of {calls.robot}", ", ".join(calls.independent)
    return Sentences(
        f"{begin} was called with arrays of other sizes than it was made for",
        f"{begin}: on the way the rates {rates} cease to determine the motion, or the loops are "
        "left open; take shorter steps, other independent rates by linkwork.jax.model(robot, "
        f"chart), or singular='nan'; {WHERE}",
        f"{begin}: the state after it is not finite, for numbers given are not or the step is too "
        f"long; {WHERE}",
    )
