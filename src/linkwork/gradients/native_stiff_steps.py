"""Rosenbrock steps made again, to be differentiated: compiled parts of the loops of
`native_stiff_sweeps`.

A step from y(t), as `linkwork.simulation.rosenbrock` has it, with W = 1 / gamma - h f_y and f_t =
f_u u'(t) at its start x_0 = (y, u, p):

    W k_i = f_i + sum_(j<i) C_ij k_j + h d_i f_t,     f_i = f(y + h sum_(j<i) a_ij k_j, u_i, p)

The matrix depends on what is differentiated by, so that second derivatives of f are needed, along
directions e_i alone:

    (1 / gamma) k_i = f_i + sum_(j<i) C_ij k_j + g(x_0, e_i),
    g(x_0, e) = f_y e_y + f_u e_u,      e_i = (h k_i, h d_i u'(t))

    W dk_i = df_i + sum_(j<i) C_ij dk_j + g_x(x_0, e_i) dx_0 + h d_i f_u du'(t)

The integral of a cost is a number z more of the state, z' = cost(y, u, p): its stages are q_i.

Names are those of `native_steps`; kernels are called by their addresses:

    jacobian      in = (y, u, p)         out = f_y, f_u column by column
    bend          in = (y, u, p, e, d)   out = g_x d
    bend_against  in = (y, u, p, e, l)   out = the derivative of l . (g, that of the cost) by
                                               (y, u, p), of several stages side by side
"""

from typing import Any, NamedTuple

from numba import njit

from linkwork.gradients.native_steps import weighed
from linkwork.simulation.abreast import ALIGNED
from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_parts import copy, force, padded
from linkwork.simulation.native_rosenbrock import decompose, solve
from linkwork.simulation.pointers import call, combine


class StiffBench(NamedTuple):
    """Where the matrix of a step is made again.

    jacobian: f_y (n n), then f_u (n inputs), column by column; W, order: its factors; rate: f_t;
    input_rates: u'(t) of the signals; bent: what the kernels of second derivatives take, and
    `bends` what they give; direction: where e begins in it, seed: where d or l does; column: n
    numbers
    """

    jacobian: Any
    W: Any
    order: Any
    rate: Any
    input_rates: Any
    bent: Any
    direction: Any
    seed: Any
    bends: Any
    column: Any


@njit(**OPTIONS)
def given_size(sizes):
    """Return how many numbers (y, u, p) has."""
    return sizes.n + sizes.signals + sizes.held + sizes.parameters


@njit(**OPTIONS)
def stiff_size(sizes):
    """Return how many numbers a `StiffBench` needs."""
    n, inputs, given = sizes.n, sizes.signals + sizes.held, given_size(sizes)
    return n * (2 * n + inputs + 3) + inputs + 4 * given + 2 * padded(n + 1) + 16


@njit(**OPTIONS)
def stiff_at(memory, sizes):
    """Return a `StiffBench` in zeros at a pointer."""
    n, inputs, given = sizes.n, sizes.signals + sizes.held, given_size(sizes)
    W = memory + n * (n + inputs)
    order = W + n * n
    rate = order + n
    input_rates = rate + n
    bent = input_rates + inputs
    direction = bent + given
    seed = direction + n + inputs
    bends = seed + given + 1
    return StiffBench(
        memory, W, order, rate, input_rates, bent, direction, seed, bends, bends + given + 1
    )


@njit(**OPTIONS)
def rates_of(coefficients, columns, s, out):
    """Compute the rates (columns) of inputs at a time s since their knot, by the coefficients of
    the piece."""
    for c in range(columns):
        own = coefficients + c
        out[c] = own[columns] + s * (2 * own[2 * columns] + s * 3 * own[3 * columns])


@njit(**OPTIONS)
def matrix_made_again(bench, stiff, second, sizes, method, inputs, t, h):
    """Leave the inputs, their rates, and the factors of W at the start of a step; row 1 of the
    bench is the start."""
    n, columns, x = sizes.n, sizes.signals, bench.x + bench.x_width
    copy(bench.y, x, n)
    piece = force(inputs, t, False, int(bench.pieces[1]), x + n)
    bench.times[1], bench.pieces[1] = t, piece
    copy(bench.held, x + n + columns, sizes.held)
    call(second.jacobian, x, stiff.jacobian)
    copy(x, stiff.bent, given_size(sizes))
    own = inputs.coefficients + 4 * columns * piece
    rates_of(own, columns, t - inputs.knots[piece], stiff.input_rates)
    forced(stiff, n, columns, stiff.input_rates, stiff.rate)
    gamma = method.e[method.solution]
    for i in range(n):
        for j in range(n):
            own_share = 1 / gamma if i == j else 0.0
            stiff.W[i * n + j] = own_share - h * stiff.jacobian[j * n + i]
    decompose(stiff.W, stiff.order, n)


@njit(**OPTIONS)
def forced(stiff, n, columns, rates, out):
    """Compute f_u (n) along rates of the signals."""
    for m in range(n):
        out[m] = 0.0
    for c in range(columns):
        for m in range(n):
            out[m] += stiff.jacobian[n * (n + c) + m] * rates[c]


@njit(**OPTIONS)
def stages_made_again(bench, stiff, kernels, second, sizes, method, inputs, t, h):
    """Leave the stages k_1 .. k_s of the step from bench.y at t in their rows, and what they were
    evaluated at."""
    n, rows, width, e = sizes.n, method.stages, bench.width, method.e
    matrix_made_again(bench, stiff, second, sizes, method, inputs, t, h)
    piece = int(bench.pieces[1])
    for i in range(1, method.solution):
        x, k, own = bench.x + i * bench.x_width, bench.k + i * width, i * rows
        if i > 1:
            weighed(
                bench, method.a + own, bench.others.a + own, i, h, bench.y, bench.k, width, n, x
            )
            bench.times[i] = t + method.c[i] * h
            piece = force(inputs, bench.times[i], True, piece, x + n)
            bench.pieces[i] = piece
            copy(bench.held, x + n + sizes.signals, sizes.held)
        call(kernels.motion, x, k)
        k[n] = 0.0
        combine(e + own, i, 1.0, k, bench.k, width, n, stiff.column)
        for m in range(n):
            k[m] = stiff.column[m] + h * e[own + method.solution] * stiff.rate[m]
        solve(stiff.W, stiff.order, n, k)


@njit(**OPTIONS)
def directed(bench, stiff, sizes, method, i, h):
    """Set the direction e_i of second derivatives."""
    n, k = sizes.n, bench.k + i * bench.width
    share = h * method.e[i * method.stages + method.solution]
    for m in range(n):
        stiff.direction[m] = h * k[m]
    for c in range(sizes.signals):
        stiff.direction[n + c] = share * stiff.input_rates[c]


@njit(**OPTIONS)
def wide_size(sizes, lanes):
    """Return how many numbers `bend_against` takes and gives, with room to be aligned."""
    inputs, given = sizes.signals + sizes.held, given_size(sizes)
    return lanes * (2 * given + 2 * sizes.n + inputs + 2) + ALIGNED // 8


@njit(**OPTIONS)
def bent_together(bench, stiff, second, sizes, method, h, leads, width, wide):
    """Leave in `bends` what the matrix of a step tells of (y, u, p), by the bars (n + 1) of all
    stages, which are `width` apart."""
    n, given, lanes = sizes.n, given_size(sizes), second.lanes
    along = n + sizes.signals + sizes.held
    taken = given + along + n + 1
    out = wide + lanes * (taken + taken % 2)  # aligned, with four lanes, too
    for m in range(given):
        stiff.bends[m] = 0.0
        for lane in range(lanes):
            wide[m * lanes + lane] = stiff.bent[m]
    for first in range(1, method.solution, lanes):
        for lane in range(lanes):
            i, e = first + lane, wide + given * lanes + lane
            bars, live = e + along * lanes, i < method.solution
            if live:
                directed(bench, stiff, sizes, method, i, h)
            for m in range(along):
                e[m * lanes] = stiff.direction[m] if live else 0.0
            for m in range(n + 1):
                bars[m * lanes] = leads[i * width + m] if live else 0.0
        call(second.bend_against, wide, out)
        for m in range(given):
            for lane in range(lanes):
                stiff.bends[m] += out[m * lanes + lane]


@njit(**OPTIONS)
def solve_transposed(W, order, n, b):
    """Replace b by the solution of W' x = b."""
    for i in range(n):
        for j in range(i):
            b[i] -= W[j * n + i] * b[j]
        b[i] /= W[i * n + i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] -= W[j * n + i] * b[j]
    for i in range(n - 1, -1, -1):
        row = int(order[i])
        b[i], b[row] = b[row], b[i]
