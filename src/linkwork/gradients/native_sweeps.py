"""Sweeps over the steps of a run, forwards with tangents and backwards with adjoints, compiled.

The step sizes are those of the run and stand still; all else of a step is differentiated: with
weights of the dense output w_i(theta) at samples within it,

    dx_i = dy + h sum_(j<i) a_ij dk_j,    dk_i = f_y dx_i + f_u du + f_p dp,
    dnew = G'(dx_s, dp),                  dsample = G'(dy + h sum_i w_i dk_i, dp)

and the adjoint is the transpose of that, row by row backwards.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit, types

from linkwork.gradients.native_steps import (
    DerivativeKernels,
    StateSizes,
    StepsTaken,
    bench_at,
    bench_size,
    closed_against,
    closed_along,
    furnish_bench,
    new_state,
    remake,
    slope_unclosed,
    weighed,
    within,
)
from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.native_loop import flat
from linkwork.simulation.native_parts import copy, inputs_of, method_of, padded
from linkwork.simulation.pointers import call, combine, pointer

_list, _table, _cube = (
    types.Array(types.float64, dimensions, "C", readonly=True) for dimensions in (1, 2, 3)
)
_open_list, _open_table, _open_cube = (
    types.Array(types.float64, dimensions, "C") for dimensions in (1, 2, 3)
)
_taken = types.BaseTuple.from_types(
    [_table if name == "y" else _list for name in StepsTaken._fields]
)
_steps = flat(DerivativeKernels), flat(StateSizes), _taken
FORWARDS = *_steps, _table, _cube, _table, _open_table, _open_cube, _open_cube
BACKWARDS = *_steps, _table, _table, types.float64, _open_list, _open_list, _open_list, _open_list


class OfInputs(NamedTuple):
    """Where the changes of what acts all along are, or the derivatives by it: of the coefficients
    of the signals (pieces 4 signals), of held inputs and of p."""

    signals: Any
    held: Any
    p: Any


class StepBars(NamedTuple):
    """Where derivatives of a loss by the parts of a step are.

    rows: what each row contributes, `width` apart; slopes: what samples tell of the slopes, as far
    apart as those are; before: by the state at the start; a, others: the weights of stages,
    transposed; cost: of a row
    """

    rows: Any
    width: int
    slopes: Any
    before: Any
    a: Any
    others: Any
    cost: Any


@njit(**OPTIONS)
def made_again(bench, kernels, sizes, method, inputs, t, h, dense):
    """Make a step again from bench.y; return the Newton steps of its new state."""
    remake(bench, kernels, sizes, method, inputs, t, h, 0, method.solution)
    steps = new_state(bench, kernels, sizes, method, h)
    if dense:
        remake(bench, kernels, sizes, method, inputs, t, h, method.solution, method.stages)
    return steps


# Forwards


@njit(**OPTIONS)
def row_along(bench, kernels, sizes, inputs, i, change, dk):
    """Evaluate dk_i, where the seed of row i holds dx_i."""
    x = bench.x + i * bench.x_width
    given = sizes.n + sizes.signals + sizes.held + sizes.parameters
    seed, piece = x + given, int(bench.pieces[i])
    s, columns = bench.times[i] - inputs.knots[piece], sizes.signals
    for c in range(columns):
        own = change.signals + 4 * columns * piece + c
        seed[sizes.n + c] = own[0] + s * (
            own[columns] + s * (own[2 * columns] + s * own[3 * columns])
        )
    copy(change.held, seed + sizes.n + columns, sizes.held)
    copy(change.p, seed + sizes.n + columns + sizes.held, sizes.parameters)
    call(kernels.along, x, dk + i * bench.width)


@njit(**OPTIONS)
def step_along(bench, kernels, sizes, method, inputs, h, steps, dense, change, dy, dk):
    """Replace dy at the start of a step by that at its end; leave all dk."""
    n, stages, width, solution = sizes.n, method.stages, bench.width, method.solution
    given = n + sizes.signals + sizes.held + sizes.parameters
    new = dk + stages * width
    for i in range(solution):
        seed = bench.x + i * bench.x_width + given
        own = i * stages
        weighed(bench, method.a + own, bench.others.a + own, i, h, dy, dk, width, n, seed)
        row_along(bench, kernels, sizes, inputs, i, change, dk)
    own = solution * stages
    weighed(bench, method.a + own, bench.others.a + own, solution, h, dy, dk, width, n, new)
    closed_along(bench, kernels, sizes, bench.z, steps, new, change.p)
    if dense:
        for i in range(solution, stages):
            seed = bench.x + i * bench.x_width + given
            if i == solution and not slope_unclosed(method):
                copy(new, seed, n)
            else:
                combine(method.a + i * stages, i, h, dy, dk, width, n, seed)
            row_along(bench, kernels, sizes, inputs, i, change, dk)


@njit(**OPTIONS)
def direction_of(sizes, d, d_signal, d_held, d_p):
    """Return where direction d says how what acts all along changes."""
    return OfInputs(
        pointer(d_signal) + d * d_signal.shape[1] * d_signal.shape[2],
        pointer(d_held) + d * sizes.held,
        pointer(d_p) + d * sizes.parameters,
    )


@njit(**OPTIONS)
def sample_along(
    bench, kernels, sizes, method, h, theta, directions, dys, slopes, inner, d_p, found
):  # fmt: skip
    """Leave the changes (D, n) of a sample by the dense output, at a share theta of a step, from
    those of the start and of all slopes."""
    n, width, rows = sizes.n, bench.width, method.stages
    newton = within(bench, kernels, sizes, method, h, theta)
    for d in range(directions):
        dy, dk = dys + d * width, slopes + d * (rows + 1) * width
        weighed(bench, bench.weights, bench.other_weights, rows, h, dy, dk, width, n, inner)
        dp = d_p + d * sizes.parameters
        closed_along(bench, kernels, sizes, bench.z_sample, newton, inner, dp)
        copy(inner, found + d * n, n)


@compiled_once("the tangents of runs", FORWARDS)
def tangent(kernels, sizes, taken, d_p, d_signal, d_held, dy, rows, samples):
    """Lead D tangents along the K - 1 steps between K states.

    Args:
        kernels, sizes, taken: as of `DerivativeKernels`, `StateSizes`, `StepsTaken`.
        d_p, d_signal, d_held: directions (D, np), (D, pieces 4, signals), (D, nh).
        dy: of the first state (D, n); of the last one in the end.
        rows, samples: left with dy of all states (K, D, n) and of the samples (S, D, n).
    """
    kernels, sizes, taken = DerivativeKernels(*kernels), StateSizes(*sizes), StepsTaken(*taken)
    t, places, times = taken.t, taken.places, taken.times
    method, (inputs, _) = method_of(pointer(taken.plan)), inputs_of(pointer(taken.signal))
    n, width, directions = sizes.n, padded(sizes.n + 1), dy.shape[0]
    each, own_size = (method.stages + 1) * width, bench_size(sizes, method)
    memory = np.zeros(own_size + directions * (each + width) + width)
    bench = bench_at(pointer(memory), sizes, method, method_of(pointer(taken.plan_apart)))
    furnish_bench(bench, sizes, method, pointer(taken.p))
    copy(pointer(taken.held), bench.held, sizes.held)
    # Of each direction dy at the start of a step, padded, and its dk; a change within the step.
    start = pointer(memory) + own_size
    slopes, inner = start + directions * width, start + directions * (each + width)
    place, count = 0, places.size
    for d in range(directions):
        copy(pointer(dy) + d * n, start + d * width, n)
        copy(pointer(dy) + d * n, pointer(rows) + d * n, n)
    for i in range(t.size - 1):
        copy(pointer(taken.y) + i * n, bench.y, n)
        h, dense = t[i + 1] - t[i], place < count and int(places[place]) == i
        steps = made_again(bench, kernels, sizes, method, inputs, t[i], h, dense)
        for d in range(directions):
            own, dk = start + d * width, slopes + d * each
            change = direction_of(sizes, d, d_signal, d_held, d_p)
            step_along(bench, kernels, sizes, method, inputs, h, steps, dense, change, own, dk)
        # Samples by the dense output, from the changes of the start and of all slopes.
        while place < count and int(places[place]) == i:
            sample_along(
                bench, kernels, sizes, method, h, (times[place] - t[i]) / h, directions, start,
                slopes, inner, pointer(d_p), pointer(samples) + place * directions * n,
            )  # fmt: skip
            place += 1
        for d in range(directions):
            new = slopes + d * each + method.stages * width
            copy(new, start + d * width, n)
            copy(new, pointer(rows) + ((i + 1) * directions + d) * n, n)
    for d in range(directions):
        copy(start + d * width, pointer(dy) + d * n, n)
    memory[0] = 0.0  # the memory lives to the end


# Backwards


@njit(**OPTIONS)
def row_against(bench, kernels, sizes, inputs, i, bars, b_width, told):
    """Evaluate what row i contributes, of which the seed holds the bars of k_i and of the cost."""
    bar = bars + i * b_width
    call(kernels.against, bench.x + i * bench.x_width, bar)
    inputs_against(bench, sizes, inputs, i, bar + sizes.n, told)


@njit(**OPTIONS)
def inputs_against(bench, sizes, inputs, i, bar, told):
    """Add what the bars of the inputs at row i, held ones and parameters included, tell of what
    acts all along."""
    columns, piece = sizes.signals, int(bench.pieces[i])
    power, s = 1.0, bench.times[i] - inputs.knots[piece]
    for m in range(4):
        own = told.signals + columns * (4 * piece + m)
        for c in range(columns):
            own[c] += power * bar[c]
        power *= s
    for c in range(sizes.held):
        told.held[c] += bar[columns + c]
    for c in range(sizes.parameters):
        told.p[c] += bar[columns + sizes.held + c]


@njit(**OPTIONS)
def bars_size(sizes, method):
    """Return how many numbers `StepBars` need."""
    b_width = padded(sizes.n + sizes.signals + sizes.held + sizes.parameters + 1)
    width, square = padded(sizes.n + 1), padded(method.stages * (method.stages + 1))
    return (method.stages + 2) * (b_width + width) + width + 2 * square + 1


@njit(**OPTIONS)
def bars_at(memory, bench, sizes, method):
    """Return `StepBars` in zeros at a pointer."""
    b_width = padded(sizes.n + sizes.signals + sizes.held + sizes.parameters + 1)
    width, stages = padded(sizes.n + 1), method.stages
    slopes = memory + (stages + 2) * b_width
    before = slopes + (stages + 2) * width
    a = before + width
    others = a + padded(stages * (stages + 1))
    for i in range(stages):
        for j in range(stages):
            a[j * stages + i] = method.a[i * stages + j]
            others[j * stages + i] = bench.others.a[i * stages + j]
    cost = others + padded(stages * (stages + 1))
    return StepBars(memory, b_width, slopes, before, a, others, cost)


@njit(**OPTIONS)
def sample_against(bench, kernels, sizes, method, h, theta, bar, bars, p_bar):
    """Add what the bar of a sample (n), by the dense output, at a share theta of a step, tells of
    its start and of all slopes."""
    n, steps = sizes.n, within(bench, kernels, sizes, method, h, theta)
    copy(bar, bench.sample, n)
    closed_against(bench, kernels, sizes, bench.z_sample, steps, bench.sample, p_bar)
    for m in range(n):
        bars.before[m] += bench.sample[m]
    for j in range(method.stages):
        for m in range(n):
            weights = bench.other_weights if m < sizes.apart else bench.weights
            bars.slopes[j * bench.width + m] += h * weights[j] * bench.sample[m]


@njit(**OPTIONS)
def seed_against(bench, sizes, method, j, last, h, bars):
    """Leave the bar of k_j in the seed of its row: from samples, and from the rows behind it up to
    the last one. Return the seed."""
    given = sizes.n + sizes.signals + sizes.held + sizes.parameters
    seed, later = bench.x + j * bench.x_width + given, j * method.stages + j + 1
    weighed(
        bench, bars.a + later, bars.others + later, last - j, h, bars.slopes + j * bench.width,
        bars.rows + (j + 1) * bars.width, bars.width, sizes.n, seed,
    )  # fmt: skip
    return seed


@njit(**OPTIONS)
def dense_rows_against(bench, kernels, sizes, method, inputs, h, bars, own, told):
    """Add what the rows that samples alone need tell of the start, and of the new state's own bar
    where its slope is among them."""
    n, solution = sizes.n, method.solution
    for j in range(method.stages - 1, solution - 1, -1):
        seed_against(bench, sizes, method, j, method.stages - 1, h, bars)[n] = 0.0
        row_against(bench, kernels, sizes, inputs, j, bars.rows, bars.width, told)
        for m in range(n):
            if j > solution:
                bars.before[m] += bars.rows[j * bars.width + m]
            elif not slope_unclosed(method):
                own[m] += bars.rows[j * bars.width + m]


@njit(**OPTIONS)
def rows_against(bench, kernels, sizes, method, inputs, h, last, weight, bars, told):
    """Add what the rows that the new state is made of tell of the start, and of what acts all
    along; return the integral of the cost over the step."""
    n, own, integral = sizes.n, method.a + method.solution * method.stages, 0.0
    for j in range(method.solution - 1, -1, -1):
        seed = seed_against(bench, sizes, method, j, last, h, bars)
        if kernels.cost != 0:
            share = h * own[j]
            seed[n] = weight * share
            call(kernels.cost, bench.x + j * bench.x_width, bars.cost)
            integral += share * bars.cost[0]
        row_against(bench, kernels, sizes, inputs, j, bars.rows, bars.width, told)
        for m in range(n):
            bars.before[m] += bars.rows[j * bars.width + m]
    return integral


@compiled_once("the adjoints of runs", BACKWARDS)
def adjoint(
    kernels, sizes, taken, row_bars, sample_bars, weight, bar, p_bar, signal_bar, held_bar
):  # fmt: skip
    """Lead an adjoint back along the K - 1 steps between K states; return the integral of the cost.

    Args:
        kernels, sizes, taken: as of `tangent`.
        row_bars, sample_bars: derivatives of a loss with respect to the states (K, n) and to the
            samples (S, n).
        weight: of the integral of the cost in the loss.
        bar: derivative with respect to the last state from what follows (n,); to the first one in
            the end, own share of `row_bars` included.
        p_bar, signal_bar, held_bar: to which the derivatives with respect to p (np,), to the
            coefficients of the signals (pieces 4 signals,) and to the held inputs (nh,) are added.
    """
    kernels, sizes, taken = DerivativeKernels(*kernels), StateSizes(*sizes), StepsTaken(*taken)
    t, places, times = taken.t, taken.places, taken.times
    method, (inputs, _) = method_of(pointer(taken.plan)), inputs_of(pointer(taken.signal))
    n, stages, solution, integral = sizes.n, method.stages, method.solution, 0.0
    own_size = bench_size(sizes, method)
    memory = np.zeros(own_size + bars_size(sizes, method))
    bench = bench_at(pointer(memory), sizes, method, method_of(pointer(taken.plan_apart)))
    furnish_bench(bench, sizes, method, pointer(taken.p))
    copy(pointer(taken.held), bench.held, sizes.held)
    bars = bars_at(pointer(memory) + own_size, bench, sizes, method)
    told = OfInputs(pointer(signal_bar), pointer(held_bar), pointer(p_bar))
    own, place = pointer(bar), places.size - 1
    for m in range(n):
        own[m] += row_bars[t.size - 1, m]
    for step in range(t.size - 2, -1, -1):
        copy(pointer(taken.y) + step * n, bench.y, n)
        h, dense = t[step + 1] - t[step], place >= 0 and int(places[place]) == step
        newton = made_again(bench, kernels, sizes, method, inputs, t[step], h, dense)
        for m in range(n):
            bars.before[m] = row_bars[step, m]
        # Samples, and the rows that they alone need.
        if dense:
            while place >= 0 and int(places[place]) == step:
                theta, own_bar = (times[place] - t[step]) / h, pointer(sample_bars) + place * n
                sample_against(bench, kernels, sizes, method, h, theta, own_bar, bars, told.p)
                place -= 1
            dense_rows_against(bench, kernels, sizes, method, inputs, h, bars, own, told)
        # The new state, and the rows that it is made of.
        new = bars.rows + solution * bars.width
        closed_against(bench, kernels, sizes, bench.z, newton, own, told.p)
        if dense and slope_unclosed(method):
            for m in range(n):
                own[m] += new[m]
        copy(own, new, n)
        for m in range(n):
            bars.before[m] += own[m]
        last = stages - 1 if dense else solution
        integral += rows_against(
            bench, kernels, sizes, method, inputs, h, last, weight, bars, told
        )  # fmt: skip
        copy(bars.before, own, n)
        if dense:
            for m in range(stages * bench.width):
                bars.slopes[m] = 0.0
    memory[0] = 0.0  # the memory lives to the end
    return integral
