"""Rosenbrock methods, compiled to machine code: see `rosenbrock` for the equations.

Rows of k: the slope at the start, the stages 1 .. s, the slope at the new, projected state. The
Jacobian is evaluated once a step, and W = 1 / gamma - h J is decomposed into triangular factors
once, with partial pivoting.
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS, compiled_once
from linkwork.simulation.native_loop import SIGNATURE, begin, end, following
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
def forced_rate(run, piece, rate):
    """Evaluate the Jacobian at x into the work, and add up the rate f_t = (df/du) u'(t)."""
    n, inputs, columns, work = run.room.n, run.inputs, run.inputs.columns, run.room.work
    call(run.kernels.jacobian, run.room.x, work)
    s, c = run.t - inputs.knots[piece], inputs.coefficients + 4 * columns * piece
    for m in range(n):
        rate[m] = 0.0
    for i in range(columns):
        u_rate = c[columns + i] + s * (2 * c[2 * columns + i] + s * 3 * c[3 * columns + i])
        for m in range(n):
            rate[m] += work[n * (n + i) + m] * u_rate


@njit(**INLINED)
def advance(run):
    """Try a step from y; leave the new, projected state in `new` and the stages in k."""
    room, method, h = run.room, run.method, run.step
    n, width, rows, solution = room.n, room.width, method.stages, method.solution
    y, new, k, x, e = room.y, room.new, room.k, room.x, method.e
    stages, gamma = solution - 1, e[solution]
    # W = 1 / gamma - h J at the start, decomposed once.
    copy(y, x, n)
    piece = force(run.inputs, run.t, False, run.piece, x + n)
    rate = room.work + n * (n + room.inputs)
    W = rate + n
    order = W + n * n
    forced_rate(run, piece, rate)
    for i in range(n):
        for j in range(n):
            W[i * n + j] = (1 / gamma if i == j else 0.0) - h * room.work[j * n + i]
    decompose(W, order, n)
    # The stages.
    for i in range(1, stages + 1):
        slope = k + i * width
        if i == 1:
            copy(k, slope, n)
        else:
            time = run.t + method.c[i] * h
            combine(method.a + i * rows, i, h, y, k, width, n, x)
            force(run.inputs, time, True, piece, x + n)
            if not stage(run, i, time):
                return
        combine(e + i * rows, i, 1.0, slope, k, width, n, room.sample)
        for m in range(n):
            slope[m] = room.sample[m] + h * e[i * rows + solution] * rate[m]
        solve(W, order, n, slope)
    # The new state, closed, and the slope there if the error is small.
    combine(method.a + solution * rows, solution, h, y, k, width, n, new)
    if run.kernels.closure != 0 and room.nq > 0:
        run.residual = project(run, run.course.redundant > 0, new)
        if not run.residual <= run.loose:
            run.ailment = unclosed(run, run.residual, solution)
            return
    run.error = error_norm(run, k + stages * width, h, room.nq if run.kernels.closure != 0 else 0)
    if not run.error <= 1:
        run.ailment = OK if math.isfinite(run.error) else NON_FINITE
        return
    copy(new, x, n)
    force(run.inputs, run.t + h, True, piece, x + n)
    stage(run, solution, run.t + h)


@njit(**INLINED)
def stage(run, i, time):
    """Evaluate k_i at x, and keep the smallest pivot; tell whether the equations hold."""
    run.ailment, run.last_pivot = evaluate(run, i)
    if run.last_pivot < run.lowest:
        run.lowest, run.lowest_time = run.last_pivot, time
    return run.ailment == OK


follow = following(advance)


@compiled_once("the stiff integrator", SIGNATURE)
def integrate(
    kernels, p, plan, tolerance, conditions, signal, seen, course, save_at, counted, y, facts
):  # fmt: skip
    """Integrate by a Rosenbrock method; the arguments are those of `native_loop.begin` and
    `native_loop.end`."""
    run, memory, rows = begin(
        kernels, p, plan, tolerance, conditions, signal, seen, course, save_at, counted, y
    )
    return end(run, memory, follow(run, rows), y, facts)
