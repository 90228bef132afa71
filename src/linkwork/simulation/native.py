"""Explicit methods, compiled to machine code: embedded Runge-Kutta pairs, and methods of a fixed
step.

A pair evaluates its stages, the one named `solution` at the new, projected state (first same as
last), and compares:

    k_i = f(t + c_i h, y + h sum_j a_ij k_j),    defect = h sum_i e_i k_i,    error = |defect|, or, with a second row of e,
    |defect|^2 / sqrt(|defect|^2 + |defect_2|^2 / 100)   (Hairer, Norsett & Wanner, Solving ODE I, sec. II.10, DOP853).

A fixed step (e without rows) ends at the new state; the slope there is evaluated at the start of
the next step, under the inputs that act then. The symplectic Euler method replaces q' in k_1 before
that:

    v_1 = v_0 + h v'(q_0, v_0),  q_1 = q_0 + h L(q_0) v_1,  where L(q_0) v_1 = q' is what the kernel
    says at (q_0, v_1).
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
from linkwork.simulation.pointers import combine


@njit(forceinline=True, **OPTIONS)
def advance(kernels, inputs, method, limits, room, measured, t, h, piece):
    """Try one step of size h from y at t; leave the new, projected state in `new` and the slopes in
    k."""
    n, nq, width, stages, solution = room.n, room.nq, room.width, method.stages, method.solution
    y, new, k, x, sample = room.y, room.new, room.k, room.x, room.sample
    closed, fixed = nq if kernels.closure != 0 else 0, method.estimates == 0
    pivot, pivot_time, last_pivot, residual, evaluations, projections = (
        math.inf,
        t,
        math.inf,
        0.0,
        0,
        0,
    )
    if fixed and method.computed > solution:
        combine(method.a + solution * stages, 1, h, y, k, width, n, new)
        copy(y, x, nq)
        for m in range(nq, n):
            x[m] = new[m]
        ailment, last_pivot = evaluate(kernels.motion, room, 1, limits.pivot_bound)
        if ailment != OK:
            return Trial(ailment, math.inf, last_pivot, t, last_pivot, residual, 1, 0)
        copy(k + width, k, nq)
        evaluations = 1
    for i in range(1, solution + 1):
        combine(method.a + i * stages, i, h, y, k, width, n, new if i == solution else x)
        if i == solution:
            if closed > 0:
                residual, projections = project(
                    kernels.closure, limits.closure_tol, measured, new, room
                )
                if not residual <= limits.closure_tol:
                    lost = unclosed(residual, room, solution)
                    return Trial(
                        lost,
                        math.inf,
                        pivot,
                        pivot_time,
                        last_pivot,
                        residual,
                        evaluations,
                        projections,
                    )
            if fixed:
                break
            copy(new, x, n)
        time = t + method.c[i] * h
        piece = force(inputs, time, True, piece, x + n)
        ailment, last_pivot = evaluate(kernels.motion, room, i, limits.pivot_bound)
        evaluations += 1
        if last_pivot < pivot:
            pivot, pivot_time = last_pivot, time
        if ailment != OK:
            return Trial(
                ailment, math.inf, pivot, pivot_time, last_pivot, residual, evaluations, projections
            )
    error = 0.0
    if fixed:
        for m in range(n):
            error += 0.0 * new[m]
    else:
        combine(method.e, solution + 1, 1.0, room.zeros, k, width, n, sample)
        error = error_norm(sample, h, closed, limits, room)
        if method.estimates > 1 and error > 0:
            combine(method.e + stages, solution + 1, 1.0, room.zeros, k, width, n, sample)
            second = 0.1 * error_norm(sample, h, 0, limits, room)
            error *= error / math.sqrt(error * error + second * second)
    ailment = (
        OK if math.isfinite(error) else NON_FINITE
    )  # one number of k that is not finite spoils it: 0 * nan is nan
    return Trial(ailment, error, pivot, pivot_time, last_pivot, residual, evaluations, projections)


integrate = integrator("the explicit integrators", advance)
