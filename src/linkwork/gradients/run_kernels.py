"""Kernels of the derivatives of runs: of all that a run computes, in any of its charts.

x = (q, v, z, r, p) is what kernels of a run take (`linkwork.control.joined`). Where a step is made
of many evaluations there are products, f_x d and f_x' l; where one decides there are Jacobians.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import casadi as ca
import numpy as np

from linkwork.control.acting import Acting
from linkwork.control.joined import Joined
from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.gradients.native_steps import DerivativeKernels, StiffKernels
from linkwork.kernels import Kernel
from linkwork.model.charts import CompiledChart
from linkwork.runs.system import System
from linkwork.simulation import as_signal

Expressions = Callable[[Joined], ca.SX]


def given(joined: Joined) -> ca.SX:
    """Return x as one column."""
    return ca.vertcat(*joined.inputs.values())


def along(joined: Joined) -> ca.Function:
    """Return (q, v, z, r, p, d) -> f_x d, the derivative of y' along a direction of x."""
    x = given(joined)
    d = SX.sym("d", x.numel())
    found = ca.densify(ca.jtimes(ca.densify(joined.derivatives), x, d))
    return function("along", joined, found, d=d)


def against(joined: Joined, cost: int | None) -> ca.Function:
    """Return (q, v, z, r, p, l) -> (y', cost)_x' l; cost: the number of an event function."""
    f = judged(joined, cost)
    lead = SX.sym("l", f.numel())
    found = ca.jtimes(ca.densify(f), given(joined), lead, True)
    return function("against", joined, ca.densify(found), l=lead)


def bend(joined: Joined) -> ca.Function:
    """Return (q, v, z, r, p, e, d) -> the derivative of f_x e along a direction d of x; e: a
    direction of (q, v, z, r)."""
    x = given(joined)
    e, d = SX.sym("e", x.numel() - joined.inputs["p"].numel()), SX.sym("d", x.numel())
    found = ca.densify(ca.jtimes(directed(joined, joined.derivatives, e), x, d))
    return function("bend", joined, found, e=e, d=d)


def bend_against(joined: Joined, cost: int | None) -> ca.Function:
    """Return (q, v, z, r, p, e, l) -> the derivative of l . (y', cost)_x e by x; e, cost: as of
    `bend` and `against`."""
    f, x = judged(joined, cost), given(joined)
    e, lead = SX.sym("e", x.numel() - joined.inputs["p"].numel()), SX.sym("l", f.numel())
    found = ca.densify(ca.jtimes(directed(joined, f, e), x, lead, True))
    return function("bend_against", joined, found, e=e, l=lead)


def directed(joined: Joined, f: ca.SX, e: ca.SX) -> ca.SX:
    """Return the derivative of expressions along a direction of (q, v, z, r)."""
    *states, _ = joined.inputs.values()
    return ca.densify(ca.jtimes(ca.densify(f), ca.vertcat(*states), e))


def judged(joined: Joined, cost: int | None) -> ca.SX:
    """Return y', and a cost if there is one: the number of an event function."""
    f = joined.derivatives
    return f if cost is None else ca.vertcat(f, joined.outputs["events"][cost])


def jacobian(joined: Joined, of: ca.SX) -> ca.Function:
    """Return ((q, v, z, r), p) -> the Jacobian of expressions in x, row by row."""
    found = ca.jacobian(ca.densify(of), given(joined))
    return read_off("jacobian", joined, ca.vec(ca.densify(found).T))


def pulled(joined: Joined, of: ca.SX) -> ca.Function:
    """Return ((q, v, z, r), l, p) -> the derivative of l . expressions in x."""
    of, lead = ca.densify(of), SX.sym("l", of.numel())
    return read_off("pulled", joined, ca.densify(ca.jtimes(of, given(joined), lead, True)), lead)


def read_off(name: str, joined: Joined, found: ca.SX, *more: ca.SX) -> ca.Function:
    """Return a function of (q, v, z, r) as one column, of more, and of p."""
    *states, p = joined.inputs.values()
    return ca.Function(name, [ca.vertcat(*states), *more, p], [found], {"cse": True})


def function(name: str, joined: Joined, found: ca.SX, **more: ca.SX) -> ca.Function:
    """Return a function of x and more."""
    named = joined.inputs | more
    return ca.Function(name, [*named.values()], [found], [*named], ["found"], {"cse": True})


def closure_along(equations: Equations) -> ca.Function:
    """Return (q, p, d) -> the derivative of a Newton step on phi(q) = 0 along d of (q, p)."""
    step, x = closing(equations)
    d = SX.sym("d", x.numel())
    found = ca.densify(ca.jtimes(step, x, d))
    return ca.Function("closure_along", [*parts(equations), d], [found], {"cse": True})


def closure_against(equations: Equations) -> ca.Function:
    """Return (q, p, l) -> the derivative of l . G(q, p) with respect to (q, p)."""
    step, x = closing(equations)
    lead = SX.sym("l", step.numel())
    found = ca.densify(ca.jtimes(step, x, lead, True))
    return ca.Function("closure_against", [*parts(equations), lead], [found], {"cse": True})


def closing(equations: Equations) -> tuple[ca.SX, ca.SX]:
    """Return G(q, p), a Newton step on phi(q) = 0, and (q, p)."""
    q, p = parts(equations)
    return ca.densify(functions.closure_step(equations)(q, p)[0]), ca.vertcat(q, p)


def parts(equations: Equations) -> tuple[ca.SX, ca.SX]:
    """Return q and p."""
    return equations.tree.q, equations.p


def rates_jacobian(equations: Equations) -> ca.Function:
    """Return (q, v, p) -> the Jacobian of w = L v in (q, v, p), row by row."""
    (q, p), v = parts(equations), equations.v
    found = ca.jacobian(equations.rates, ca.vertcat(q, v, p))
    return ca.Function("rates_jacobian", [q, v, p], [ca.vec(ca.densify(found).T)], {"cse": True})


def starts_along(equations: Equations) -> ca.Function:
    """Return (q, p) -> dq along each independent rate with the loops closed, and dq along each
    parameter with the independent coordinates held, column by column."""
    (q, p), n = parts(equations), equations.mobility
    step, x = closing(equations)
    chosen = SX(equations.nv, n)
    for column, row in enumerate(equations.chart.independent):
        chosen[row, column] = 1
    closed = ca.jacobian(step, x)
    along_rates = ca.mtimes([closed[:, : q.numel()], equations.tree.derivative_map, chosen])
    found = ca.horzcat(along_rates, closed[:, q.numel() :])
    return ca.Function("starts_along", [q, p], [ca.vec(ca.densify(found))], {"cse": True})


def opened(equations: Equations) -> ca.Function:
    """Return (q, p) -> the derivative of all closure rows by each parameter with the loops closed
    and the independent coordinates held, over their units, column by column."""
    (q, p), rows, n = parts(equations), equations.rows, equations.mobility
    dq = ca.reshape(ca.vec(starts_along(equations)(q, p)), q.numel(), n + p.numel())[:, n:]
    phi = rows.phi if rows.unheld is None else ca.vertcat(rows.phi, rows.unheld.phi)
    units = rows.units if rows.unheld is None else np.append(rows.units, rows.unheld.units)
    found = (ca.mtimes(ca.jacobian(phi, q), dq) + ca.jacobian(phi, p)) / units
    return ca.Function("opened", [q, p], [ca.vec(ca.densify(found))], {"cse": True})


def positions_jacobian(equations: Equations) -> ca.Function:
    """Return (q, p) -> the Jacobian of the coordinates of all joints in (q, p), row by row."""
    q, p = parts(equations)
    found = ca.jacobian(equations.joints.positions(), ca.vertcat(q, p))
    return ca.Function("positions_jacobian", [q, p], [ca.vec(ca.densify(found).T)], {"cse": True})


def costs(joined: Joined, cost: int) -> ca.Function:
    """Return (q, v, z, r, p) -> the cost."""
    return function("cost", joined, ca.densify(joined.outputs["events"][cost]))


@lru_cache(maxsize=256)
def addresses(acting: Acting, chart: CompiledChart, cost: int | None) -> DerivativeKernels:
    """Return the addresses of what steps are made again and differentiated with."""
    system, closing = joined_with(acting), chart.equations.constrained
    of_run = partial(of_system, system, chart)

    def of_loops(name: str, make: Callable[[Equations], ca.Function]) -> int:
        return chart.compiled(name, make).address if closing else 0

    return DerivativeKernels(
        motion=system.kernel(chart, "motion").address,
        along=of_run("along", along),
        against=of_run(f"against {cost}", lambda own: against(own, cost)),
        cost=0 if cost is None else of_run(f"cost {cost}", lambda own: costs(own, cost)),
        closure=chart.kernel("closure_step").address if closing else 0,
        closure_along=of_loops("closure_along", closure_along),
        closure_against=of_loops("closure_against", closure_against),
    )


@lru_cache(maxsize=256)
def stiff_addresses(acting: Acting, chart: CompiledChart, cost: int | None) -> StiffKernels:
    """Return the addresses of what Rosenbrock steps need beside `addresses`."""
    system = joined_with(acting)
    of_run = partial(of_system, system, chart)
    kernel = kernel_of(system, chart, f"bend_against {cost}", lambda own: bend_against(own, cost))
    return StiffKernels(
        jacobian=system.jacobian(chart),
        bend=of_run("bend", bend),
        bend_against=kernel.wide_address,
        lanes=kernel.abreast * kernel.lanes,
    )


def joined_with(acting: Acting) -> System:
    """Return a system whose kernels are those of runs in which something acts."""
    return System(as_signal(np.zeros(0)), acting)


def of_system(
    system: System, chart: CompiledChart, name: str, make: Callable[[Joined], ca.Function]
) -> int:
    """Return the address of a kernel of what runs compute in a chart."""
    return kernel_of(system, chart, name, make).address


def kernel_of(
    system: System, chart: CompiledChart, name: str, make: Callable[[Joined], ca.Function]
) -> Kernel:
    """Return a kernel of what runs compute in a chart."""
    assert system.acting is not None
    return chart.compiled(f"{system.acting.key} {name}", lambda _: make(system.joined(chart)))
