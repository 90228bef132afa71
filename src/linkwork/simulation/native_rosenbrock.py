"""Rosenbrock methods, compiled to machine code: see `rosenbrock` for the equations.

Rows of k: the slope at the start, the stages 1 .. s, the slope at the new, projected state. The Jacobian is evaluated once a
step, and W = 1 / gamma - h J is decomposed into triangular factors once, with partial pivoting.
"""

import math

import numpy as np
from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_loop import Trial, integrator
from linkwork.simulation.native_parts import (
    CLOSURE_LOST,
    NON_FINITE,
    OK,
    call,
    combine,
    copy,
    error_norm,
    evaluate,
    force,
    project,
)  # fmt: skip


@njit(**OPTIONS)
def decompose(W, rows, n):
    """Replace W (n x n, row-major) by its factors L and U, with the rows interchanged as `rows` tells."""
    for j in range(n):
        best = j
        for i in range(j + 1, n):
            if abs(W[i * n + j]) > abs(W[best * n + j]):
                best = i
        rows[j] = best
        if best != j:
            for m in range(n):
                W[j * n + m], W[best * n + m] = W[best * n + m], W[j * n + m]
        for i in range(j + 1, n):
            factor = W[i * n + j] / W[j * n + j]
            W[i * n + j] = factor
            for m in range(j + 1, n):
                W[i * n + m] -= factor * W[j * n + m]


@njit(**OPTIONS)
def solve(W, rows, n, k, stage):
    """Replace the right-hand side in a row of k by the solution of W x = k_stage."""
    for i in range(n):
        k[stage, i], k[stage, rows[i]] = k[stage, rows[i]], k[stage, i]
    for i in range(n):
        for j in range(i):
            k[stage, i] -= W[i * n + j] * k[stage, j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            k[stage, i] -= W[i * n + j] * k[stage, j]
        k[stage, i] /= W[i * n + i]


@njit(**OPTIONS)
def forced_rate(jacobian, knots, coefficients, t, piece, x, n, inputs, work):
    """Evaluate the Jacobian at x into work, and add up f_t = (df/du) u'(t) behind it, at n (n + inputs)."""
    call(jacobian, x, work, 0)
    start, s = n * (n + inputs), t - knots[piece]
    for m in range(n):
        work[start + m] = 0.0
    for i in range(coefficients.shape[2]):
        c_1, c_2, c_3 = coefficients[piece, 1, i], coefficients[piece, 2, i], coefficients[piece, 3, i]
        rate = c_1 + s * (2 * c_2 + s * 3 * c_3)
        for m in range(n):
            work[start + m] += work[n * (n + i) + m] * rate


@njit(forceinline=True, **OPTIONS)
def advance(
    work, motion, closure, jacobian, knots, coefficients, a, c, e, solution, computed, tolerance, pivot_bound,
    closure_tol, nq, measured, t, h, piece, y, k, new, x, z, z_next, sample,
):  # fmt: skip
    """Try one step of size h from y at t; leave the new, projected state in `new` and the stages in k."""
    n, closed, stages = tolerance.shape[1], nq if closure != 0 else 0, solution - 1
    pivot, pivot_time, last_pivot, residual, projections = math.inf, t, math.inf, 0.0, 0
    inputs = (work.size - y.size) // n - 2 * n - 1
    copy(y, x, n)
    piece = force(knots, coefficients, t, False, piece, x, n)
    forced_rate(jacobian, knots, coefficients, t, piece, x, n, inputs, work)
    rate, W, rows = work[n * (n + inputs) :], work[n * (n + inputs + 1) :], np.empty(n, np.intp)
    for i in range(n):
        for j in range(n):
            W[i * n + j] = (1 / e[0, solution] if i == j else 0.0) - h * work[j * n + i]
    decompose(W, rows, n)
    for i in range(1, stages + 1):
        if i == 1:
            copy(k[0], k[1], n)
        else:
            time = t + c[i] * h
            combine(a, i, i, h, y, k, new)
            copy(new, x, n)
            force(knots, coefficients, time, True, piece, x, n)
            ailment, last_pivot = evaluate(motion, x, k, i, n, pivot_bound)
            if last_pivot < pivot:
                pivot, pivot_time = last_pivot, time
            if ailment != OK:
                return Trial(ailment, math.inf, pivot, pivot_time, last_pivot, residual, i - 1, projections)
        combine(e, i, i, 1.0, k[i], k, sample)
        for m in range(n):
            k[i, m] = sample[m] + h * e[i, solution] * rate[m]
        solve(W, rows, n, k, i)
    combine(a, solution, solution, h, y, k, new)
    if closed > 0:
        residual, projections = project(closure, new, z, z_next, closure_tol, measured)
        if not residual <= closure_tol:
            return Trial(CLOSURE_LOST, math.inf, pivot, pivot_time, last_pivot, residual, stages - 1, projections)
    error = error_norm(k[stages], h, z, closed, y, new, tolerance)
    if not error <= 1:
        ailment = OK if math.isfinite(error) else NON_FINITE
        return Trial(ailment, error, pivot, pivot_time, last_pivot, residual, stages - 1, projections)
    copy(new, x, n)
    force(knots, coefficients, t + h, True, piece, x, n)
    ailment, last_pivot = evaluate(motion, x, k, solution, n, pivot_bound)
    if last_pivot < pivot:
        pivot, pivot_time = last_pivot, t + h
    return Trial(ailment, error, pivot, pivot_time, last_pivot, residual, stages, projections)


integrate = integrator("the stiff integrator", advance)
