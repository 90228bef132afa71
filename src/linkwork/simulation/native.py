"""Explicit methods, compiled to machine code: embedded Runge-Kutta pairs, and methods of a fixed
step.

A pair evaluates its stages, the one named `solution` at the new, projected state (first same as
last), and compares:

    k_i = f(t + c_i h, y + h sum_j a_ij k_j),  defect = h sum_i e_i k_i,  error = |defect|

or, with a second row of e, error = |defect|^2 / sqrt(|defect|^2 + |defect_2|^2 / 100) (Hairer,
Norsett & Wanner, Solving ODE I, sec. II.10, DOP853).

A fixed step (e without rows) ends at the new state; the slope there is evaluated at the start of
the next step, under the inputs that act then. The symplectic Euler method replaces q' in k_1 before
that:

    v_1 = v_0 + h v'(q_0, v_0),  q_1 = q_0 + h L(q_0) v_1,  where L(q_0) v_1 = q' is what the kernel
    says at (q_0, v_1).
"""

import math

from numba import njit

from linkwork.simulation.compiled import INLINED, compiled_once
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
from linkwork.simulation.pointers import combine


@njit(**INLINED)
def advance(run):
    """Try a step from y; leave the new, projected state in `new` and the slopes in k."""
    room, method, h = run.room, run.method, run.step
    n, nq, width, stages, solution = room.n, room.nq, room.width, method.stages, method.solution
    y, new, k, x = room.y, room.new, room.k, room.x
    fixed, piece = method.estimates == 0, run.piece
    # Symplectic: q' at the new v replaces that of k_1.
    if fixed and method.computed > solution:
        combine(method.a + solution * stages, 1, h, y, k, width, n, new)
        copy(y, x, nq)
        for m in range(nq, n):
            x[m] = new[m]
        run.ailment, run.last_pivot = evaluate(run, 1)
        if run.ailment != OK:
            run.lowest = run.last_pivot
            return
        copy(k + width, k, nq)
    # The stages in their order.
    for i in range(1, solution + 1):
        combine(method.a + i * stages, i, h, y, k, width, n, new if i == solution else x)
        # The last stage is the new state itself, closed.
        if i == solution:
            if run.kernels.closure != 0 and nq > 0:
                run.residual = project(run, run.course.redundant > 0, new)
                if not run.residual <= run.loose:
                    run.ailment = unclosed(run, run.residual, solution)
                    return
            if fixed:
                break
            copy(new, x, n)
        # The slope there, under the inputs of its time.
        time = run.t + method.c[i] * h
        piece = force(run.inputs, time, True, piece, x + n)
        run.ailment, run.last_pivot = evaluate(run, i)
        if run.last_pivot < run.lowest:
            run.lowest, run.lowest_time = run.last_pivot, time
        if run.ailment != OK:
            return
    run.error = error_of(run, fixed)
    if not math.isfinite(run.error):  # one number of k that is not finite spoils it: 0 * nan is nan
        run.ailment = NON_FINITE


@njit(**INLINED)
def error_of(run, fixed):
    """Return the scaled error of a step; of a fixed one 0, if its end is finite."""
    room, method, h, error = run.room, run.method, run.step, 0.0
    n, width, k, sample, zeros, count = (
        room.n, room.width, room.k, room.sample, room.zeros, method.solution + 1
    )  # fmt: skip
    if fixed:
        for m in range(n):
            error += 0.0 * room.new[m]
        return error
    combine(method.e, count, 1.0, zeros, k, width, n, sample)
    error = error_norm(run, sample, h, room.nq if run.kernels.closure != 0 else 0)
    if method.estimates > 1 and error > 0:
        combine(method.e + method.stages, count, 1.0, zeros, k, width, n, sample)
        second = 0.1 * error_norm(run, sample, h, 0)
        error *= error / math.sqrt(error * error + second * second)
    return error


follow = following(advance)


@compiled_once("the explicit integrators", SIGNATURE)
def integrate(
    kernels, p, plan, tolerance, conditions, signal, seen, course, save_at, counted, y, facts
):  # fmt: skip
    """Integrate by an explicit method; the arguments are those of `native_loop.begin` and
    `native_loop.end`."""
    run, memory, rows = begin(
        kernels, p, plan, tolerance, conditions, signal, seen, course, save_at, counted, y
    )
    return end(run, memory, follow(run, rows), y, facts)
