"""Closed configurations and steps as functions of JAX: values by one call each, derivatives by
those of what they are made of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.interpreters import ad

from linkwork.autodiff import Offered
from linkwork.autodiff.runge_kutta import LOOSE, composed, require_steps
from linkwork.autodiff.turns import require_whole_turns
from linkwork.export.implicit import STEPS
from linkwork.jax.calls import WHERE, Calls
from linkwork.jax.handler import Sentences
from linkwork.jax.jax_function import JaxFunction
from linkwork.jax.operators import made, operator, perturbed
from linkwork.jax.steps import closing_text, passing_text, step_text
from linkwork.kernels.machine import this_machine
from linkwork.model.checks import PIVOT_BOUND
from linkwork.runs.passage import CLOSURE

Array = Any


def closing(offered: Offered, calls: Calls) -> Callable[..., Array]:
    """Return q[, p] -> q with its loops closed and quaternions of length 1.

    Of q* = closed(q), where N is a Newton step,  dq* = dN/dq(q*) dq + dN/dp(q*) dp:  q* depends on
    the independent coordinates of q alone.
    """
    equations = offered.equations
    if not equations.constrained:
        return passing(equations.nq, calls)
    require_whole_turns(offered)
    newton, kernel = operator(offered.newton, calls), offered["closure_step"].value
    text = closing_text(kernel, STEPS, CLOSURE * offered.robot.size, this_machine())
    sizes = [size for _, size in kernel.inputs]
    call = calls.made("closed", text, sizes, [equations.nq], not_closing(calls), kernel)

    def moved(x: Sequence[Array], dx: Sequence[Array]) -> tuple[tuple[Array], tuple[Array]]:
        q = loops(*x)
        return (q,), (jvp(newton, (q, *x[1:]), dx)[1],)

    loops = made(lambda *x: call(*x)[0], moved)

    def closed(q: Array, *p: Array) -> Array:
        for places, _ in equations.tree.quaternions:
            own = q[..., places.start : places.stop]
            unit = own / jnp.sqrt(jnp.sum(own * own, axis=-1, keepdims=True))
            q = q.at[..., places.start : places.stop].set(unit)
        return loops(q, *p)

    return closed


def passing(nq: int, calls: Calls) -> Callable[..., Array]:
    """Return q[, p] -> q of a robot without loops, of which nothing but finite numbers is asked."""
    text = passing_text(nq, this_machine())
    call = calls.made("closed", text, [nq], [nq], not_closing(calls))

    # What is refused, NaN, has no derivative either.
    def moved(q: Sequence[Array], dq: Sequence[Array]) -> tuple[tuple[Array], tuple[Array]]:
        found = same(*q)
        own = 1.0 + 0.0 * jax.lax.stop_gradient(found)
        return (found,), (own * ad.instantiate_zeros(dq[0]),)

    same = made(lambda q: call(q)[0], moved)
    return lambda q, *p: same(q)


def stepping(offered: Offered, calls: Calls) -> Callable[..., tuple[Array, Array]]:
    """Return q, v, u, h[, p] -> q, v after a step of length h (..., 1); its derivatives are those
    of the evaluations and Newton steps that it is made of."""
    robot, equations = offered.robot, offered.equations
    require_steps(offered)
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
    rates, accelerations, newton = (
        operator(each, calls)
        for each in (offered["coordinate_rates"], offered["forward_dynamics"], offered.newton)
    )

    def motion_of(q: Array, v: Array, u: Array, *p: Array) -> tuple[Array, Array]:
        return rates(q, v, *p), accelerations(q, v, u, *p)

    parts = composed(motion_of, newton if equations.constrained else None)

    # They are taken at a q that is NaN where the step itself is not defined, and that XLA cannot
    # have without the step: parts alone would go through a singular pose unseen.
    def moved(x: Sequence[Array], dx: Sequence[Array]) -> Any:
        after, _ = step(*map(jax.lax.stop_gradient, x))
        defined = jnp.isfinite(after).all(axis=-1, keepdims=True)
        return jvp(parts, (jnp.where(defined, x[0], jnp.nan), *x[1:]), dx)

    step = JaxFunction(lambda *x: tuple(call(*x)), moved)
    return step


def jvp(f: Callable[..., Any], x: Sequence[Array], dx: Sequence[Array]) -> tuple[Any, Any]:
    """Return f(x) and its derivative along dx, where some of these may be symbolic zeros."""
    wrt = perturbed(dx)

    def of_some(*some: Array) -> Any:
        given = dict(zip(wrt, some, strict=True))
        return f(*[given.get(i, each) for i, each in enumerate(x)])

    return jax.jvp(of_some, [x[i] for i in wrt], [dx[i] for i in wrt])


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
