"""SciPy's integrators on the compiled right-hand side and Jacobian, which they call from Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

import linkwork as lw
from linkwork.kernels import Kernel
from linkwork.model.charts import CompiledChart
from linkwork.runs.system import system

from benchmarks.native import call_one

METHODS = ("RK45", "DOP853", "Radau", "LSODA")
IMPLICIT = ("Radau", "LSODA")


@dataclass(frozen=True)
class Solved:
    """Hold all joint coordinates at the asked instants (K, m), the largest |phi| there, and how
    many evaluations it took."""

    positions: np.ndarray
    closure_error: float
    nfev: int


def solved(
    robot: lw.Robot,
    start: lw.State,
    forces: Callable[[float], np.ndarray],
    times: np.ndarray,
    rtol: float,
    atol: float,
    method: str,
) -> Solved:
    """Solve (q', v') = f(q, v, u(t)) in the chart that runs start in; nothing projects q.

    Args:
        start: the state at t = 0; forces: u(t) [N, N m]; times: when to save, the last is the end
            [s].
    """
    chart = robot.run_chart.facing(start.q)
    there = robot.in_chart(start, chart.independent)
    y = np.concatenate([there.q, there.rates])
    exact = {"jac": jacobian(robot, chart, forces)} if method in IMPLICIT else {}
    done = solve_ivp(
        derivative(chart, forces), (0.0, times[-1]), y, method=method, t_eval=times,
        rtol=rtol, atol=atol, **exact,  # pyright: ignore
    )  # fmt: skip
    assert done.success, done.message
    q, v = np.split(np.ascontiguousarray(done.y.T), [chart.equations.nq], axis=1)
    positions, rates, *_ = chart.kernel("joints_motion")(q, v, np.zeros_like(v))
    gap = chart.kernel("closure_step")(q)[1].max() if chart.equations.constrained else 0.0
    return Solved(robot.labels.unwrapped(times, positions, rates), float(gap), done.nfev)


def derivative(
    chart: CompiledChart, forces: Callable[[float], np.ndarray]
) -> Callable[[float, np.ndarray], np.ndarray]:
    """Return (t, y) -> y' on the compiled kernel with nothing around it that could be left out."""
    kernel, n = chart.kernel("motion"), chart.equations.nq + chart.equations.mobility
    x, out, address = np.zeros(kernel.n_in), np.zeros(kernel.n_out), kernel.address
    x[kernel.n_in - chart.p.size :] = chart.p
    inputs = slice(n, kernel.n_in - chart.p.size)

    def f(t: float, y: np.ndarray) -> np.ndarray:
        x[:n], x[inputs] = y, forces(t)
        evaluate(address, x, out)
        return out[:n].copy()

    return f


def jacobian(
    robot: lw.Robot, chart: CompiledChart, forces: Callable[[float], np.ndarray]
) -> Callable[[float, np.ndarray], np.ndarray]:
    """Return (t, y) -> df/dy (n, n), the compiled Jacobian that Linkwork's stiff method uses."""
    kernel, n, nq = (
        jacobian_kernel(robot, chart),
        chart.equations.nq + chart.equations.mobility,
        chart.equations.nq,
    )

    def df_dy(t: float, y: np.ndarray) -> np.ndarray:
        columns, *_ = kernel(y[:nq], y[nq:], np.empty(0), forces(t), chart.p)
        return columns.reshape(n, n).T

    return df_dy


@cache
def jacobian_kernel(robot: lw.Robot, chart: CompiledChart) -> Kernel:
    """Return the kernel (q, v, z, u, p) -> df/dy, df/du, column by column, of a robot under plain
    forces."""
    return system(robot, None, None, (), (), {}, (0.0, 1.0), joined=True).kernel(chart, "jacobian")


@njit
def evaluate(address: int, x: np.ndarray, out: np.ndarray) -> None:
    """Evaluate the C function void(const double *, double *) at an address."""
    call_one(address, x, 0, out, 0)
