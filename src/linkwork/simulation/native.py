"""Explicit methods, compiled to machine code: embedded Runge-Kutta pairs, and methods of a fixed step.

A pair evaluates its stages, the one named `solution` at the new, projected state (first same as last), and compares:

    k_i = f(t + c_i h, y + h sum_j a_ij k_j),    defect = h sum_i e_i k_i,    error = |defect|, or, with a second row of e,
    |defect|^2 / sqrt(|defect|^2 + |defect_2|^2 / 100)   (Hairer, Norsett & Wanner, Solving ODE I, sec. II.10, DOP853).

A fixed step (e without rows) ends at the new state; the slope there is evaluated at the start of the next step, under the
inputs that act then. The symplectic Euler method replaces q' in k_1 before that:

    v_1 = v_0 + h v'(q_0, v_0),    q_1 = q_0 + h L(q_0) v_1,    where L(q_0) v_1 = q' is what the kernel says at (q_0, v_1).
"""

import math

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_loop import Trial, integrator
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    combine,
    copy,
    error_norm,
    evaluate,
    force,
    project,
)  # fmt: skip


@njit(forceinline=True, **OPTIONS)
def advance(
    work, motion, closure, jacobian, knots, coefficients, a, c, e, solution, computed, tolerance, pivot_bound,
    closure_tol, nq, measured, t, h, piece, y, k, new, x, z, z_next, sample,
):  # fmt: skip
    """Try one step of size h from y at t; leave the new, projected state in `new` and the slopes in k."""
    n, closed, fixed = tolerance.shape[1], nq if closure != 0 else 0, e.shape[0] == 0
    pivot, pivot_time, last_pivot, residual, evaluations, projections = math.inf, t, math.inf, 0.0, 0, 0
    if fixed and computed > solution:
        combine(a, solution, 1, h, y, k, new)
        copy(y, x, nq)
        for m in range(nq, n):
            x[m] = new[m]
        ailment, last_pivot = evaluate(motion, x, k, 1, n, pivot_bound)
        if ailment != OK:
            return Trial(ailment, math.inf, last_pivot, t, last_pivot, residual, 1, 0)
        for m in range(nq):
            k[0, m] = k[1, m]
        evaluations = 1
    for i in range(1, solution + 1):
        combine(a, i, i, h, y, k, new)
        if i == solution:
            if closed > 0:
                residual, projections = project(closure, new, z, z_next, closure_tol, measured)
                if not residual <= closure_tol:
                    return Trial(
                        CLOSURE_LOST, math.inf, pivot, pivot_time, last_pivot, residual, evaluations, projections
                    )
            if fixed:
                break
        time = t + c[i] * h
        copy(new, x, n)
        piece = force(knots, coefficients, time, True, piece, x, n)
        ailment, last_pivot = evaluate(motion, x, k, i, n, pivot_bound)
        evaluations += 1
        if last_pivot < pivot:
            pivot, pivot_time = last_pivot, time
        if ailment != OK:
            return Trial(ailment, math.inf, pivot, pivot_time, last_pivot, residual, evaluations, projections)
    error = 0.0
    if fixed:
        for m in range(n):
            error += 0.0 * new[m]
    else:
        combine(e, 0, solution + 1, 1.0, work, k, sample)
        error = error_norm(sample, h, z, closed, y, new, tolerance)
        if e.shape[0] > 1 and error > 0:
            combine(e, 1, solution + 1, 1.0, work, k, sample)
            error *= error / math.hypot(error, 0.1 * error_norm(sample, h, z, 0, y, new, tolerance))
    ailment = OK if math.isfinite(error) else NON_FINITE  # one number of k that is not finite spoils it: 0 * nan is nan
    return Trial(ailment, error, pivot, pivot_time, last_pivot, residual, evaluations, projections)


integrate = integrator("the explicit integrators", advance)
