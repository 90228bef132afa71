"""Rosenbrock methods, compiled to machine code: see `rosenbrock` for the equations.

Rows of k: the slope at the start, the stages 1 .. s, the slope at the new, projected state. The
Jacobian is evaluated once a step, and W = 1 / gamma - h J is decomposed into triangular factors
once, with partial pivoting.
"""

import math

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_loop import Trial, integrator
from linkwork.simulation.native_parts import (
    NON_FINITE,
    OK,
    copy,
    error_norm,
    evaluate,
    force,
    project,
    unclosed,
)  # fmt: skip
from linkwork.simulation.pointers import call, combine


@njit(**OPTIONS)
def decompose(W, rows, n):
    """Replace W (n x n, row-major) by its factors L and U, with the rows interchanged as `rows`
    tells."""
    for j in range(n):
        best = j
        for i in range(j + 1, n):
            if abs(W[i * n + j]) > abs(W[best * n + j]):
                best = i
        rows[j] = float(best)
        if best != j:
            for m in range(n):
                W[j * n + m], W[best * n + m] = W[best * n + m], W[j * n + m]
        for i in range(j + 1, n):
            factor = W[i * n + j] / W[j * n + j]
            W[i * n + j] = factor
            for m in range(j + 1, n):
                W[i * n + m] -= factor * W[j * n + m]


@njit(**OPTIONS)
def solve(W, rows, n, b):
    """Replace b by the solution of W x = b."""
    for i in range(n):
        row = int(rows[i])
        b[i], b[row] = b[row], b[i]
    for i in range(n):
        for j in range(i):
            b[i] -= W[i * n + j] * b[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= W[i * n + j] * b[j]
        b[i] /= W[i * n + i]


@njit(**OPTIONS)
def forced_rate(jacobian, inputs, t, piece, room, rate):
    """Evaluate the Jacobian at x into the work, and add up the rate f_t = (df/du) u'(t)."""
    n, columns, work = room.n, inputs.columns, room.work
    call(jacobian, room.x, work)
    s, c = t - inputs.knots[piece], inputs.coefficients + 4 * columns * piece
    for m in range(n):
        rate[m] = 0.0
    for i in range(columns):
        u_rate = c[columns + i] + s * (2 * c[2 * columns + i] + s * 3 * c[3 * columns + i])
        for m in range(n):
            rate[m] += work[n * (n + i) + m] * u_rate


@njit(forceinline=True, **OPTIONS)
def advance(kernels, inputs, method, limits, room, measured, t, h, piece):
    """Try one step of size h from y at t; leave the new, projected state in `new` and the stages in
    k."""
    n, width, rows, solution = room.n, room.width, method.stages, method.solution
    y, new, k, x, e = room.y, room.new, room.k, room.x, method.e
    closed, stages, gamma = room.nq if kernels.closure != 0 else 0, solution - 1, e[solution]
    pivot, pivot_time, last_pivot, residual, projections = math.inf, t, math.inf, 0.0, 0
    copy(y, x, n)
    piece = force(inputs, t, False, piece, x + n)
    rate = room.work + n * (n + room.inputs)
    W = rate + n
    order = W + n * n
    forced_rate(kernels.jacobian, inputs, t, piece, room, rate)
    for i in range(n):
        for j in range(n):
            W[i * n + j] = (1 / gamma if i == j else 0.0) - h * room.work[j * n + i]
    decompose(W, order, n)
    for i in range(1, stages + 1):
        slope = k + i * width
        if i == 1:
            copy(k, slope, n)
        else:
            time = t + method.c[i] * h
            combine(method.a + i * rows, i, h, y, k, width, n, x)
            force(inputs, time, True, piece, x + n)
            ailment, last_pivot = evaluate(kernels.motion, room, i, limits.pivot_bound)
            if last_pivot < pivot:
                pivot, pivot_time = last_pivot, time
            if ailment != OK:
                return Trial(
                    ailment, math.inf, pivot, pivot_time, last_pivot, residual, i - 1, projections
                )
        combine(e + i * rows, i, 1.0, slope, k, width, n, room.sample)
        for m in range(n):
            slope[m] = room.sample[m] + h * e[i * rows + solution] * rate[m]
        solve(W, order, n, slope)
    combine(method.a + solution * rows, solution, h, y, k, width, n, new)
    if closed > 0:
        residual, projections = project(kernels.closure, limits.closure_tol, measured, new, room)
        if not residual <= limits.closure_tol:
            lost = unclosed(residual, room, solution)
            return Trial(
                lost, math.inf, pivot, pivot_time, last_pivot, residual, stages - 1, projections
            )
    error = error_norm(k + stages * width, h, closed, limits, room)
    if not error <= 1:
        ailment = OK if math.isfinite(error) else NON_FINITE
        return Trial(
            ailment, error, pivot, pivot_time, last_pivot, residual, stages - 1, projections
        )
    copy(new, x, n)
    force(inputs, t + h, True, piece, x + n)
    ailment, last_pivot = evaluate(kernels.motion, room, solution, limits.pivot_bound)
    if last_pivot < pivot:
        pivot, pivot_time = last_pivot, t + h
    return Trial(ailment, error, pivot, pivot_time, last_pivot, residual, stages, projections)


integrate = integrator("the stiff integrator", advance)
