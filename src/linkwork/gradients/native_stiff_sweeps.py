"""Sweeps over the Rosenbrock steps of a run, forwards with tangents and backwards with adjoints,
compiled: see `native_stiff_steps` for the equations, and `native_sweeps` for explicit steps.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from linkwork.gradients.native_steps import (
    DerivativeKernels,
    StateSizes,
    StepsTaken,
    StiffKernels,
    bench_at,
    bench_size,
    closed_against,
    closed_along,
    furnish_bench,
    new_state,
    weighed,
)
from linkwork.gradients.native_stiff_steps import (
    bent_together,
    directed,
    forced,
    given_size,
    rates_of,
    solve_transposed,
    stages_made_again,
    stiff_at,
    stiff_size,
    wide_size,
)
from linkwork.gradients.native_sweeps import (
    BACKWARDS,
    FORWARDS,
    OfInputs,
    direction_of,
    inputs_against,
    row_against,
    row_along,
    sample_against,
    sample_along,
)
from linkwork.simulation.abreast import within as aligned
from linkwork.simulation.compiled import OPTIONS, compiled_once
from linkwork.simulation.native_loop import flat
from linkwork.simulation.native_parts import copy, inputs_of, method_of, padded
from linkwork.simulation.native_rosenbrock import solve
from linkwork.simulation.pointers import call, combine, pointer

# Forwards


@njit(**OPTIONS)
def stages_along(bench, stiff, kernels, second, sizes, method, inputs, h, change, dy, dk, room):
    """Leave all dk of a step, for dy at its start."""
    n, width, rows, columns = sizes.n, bench.width, method.stages, sizes.signals
    given, e = given_size(sizes), method.e
    # f_u du'(t), and dx_0 as the kernel of second derivatives takes it.
    piece = int(bench.pieces[1])
    s, forcing = bench.times[1] - inputs.knots[piece], room + columns
    rates_of(change.signals + 4 * columns * piece, columns, s, room)
    forced(stiff, n, columns, room, forcing)
    for i in range(1, method.solution):
        seed, slope, own = bench.x + i * bench.x_width + given, dk + i * width, i * rows
        weighed(bench, method.a + own, bench.others.a + own, i, h, dy, dk, width, n, seed)
        row_along(bench, kernels, sizes, inputs, i, change, dk)
        if i == 1:
            copy(seed, stiff.seed, given)
        directed(bench, stiff, sizes, method, i, h)
        call(second.bend, stiff.bent, stiff.bends)
        slope[n] = 0.0
        combine(e + own, i, 1.0, slope, dk, width, n, stiff.column)
        share = h * e[own + method.solution]
        for m in range(n):
            slope[m] = stiff.column[m] + stiff.bends[m] + share * forcing[m]
        solve(stiff.W, stiff.order, n, slope)


@compiled_once("the tangents of stiff runs", (flat(StiffKernels), *FORWARDS))
def tangent(second, kernels, sizes, taken, d_p, d_signal, d_held, dy, rows, samples):
    """Lead D tangents along the K - 1 steps between K states.

    second: as of `StiffKernels`; all others as of `native_sweeps.tangent`.
    """
    kernels, sizes, taken = DerivativeKernels(*kernels), StateSizes(*sizes), StepsTaken(*taken)
    second, t, places, times = StiffKernels(*second), taken.t, taken.places, taken.times
    method, (inputs, _) = method_of(pointer(taken.plan)), inputs_of(pointer(taken.signal))
    n, width, directions = sizes.n, padded(sizes.n + 1), dy.shape[0]
    each, own_size = (method.stages + 1) * width, bench_size(sizes, method)
    stiff_numbers, more = stiff_size(sizes), width + sizes.signals + n
    memory = np.zeros(own_size + directions * (each + width) + stiff_numbers + more)
    bench = bench_at(pointer(memory), sizes, method, method_of(pointer(taken.plan_apart)))
    furnish_bench(bench, sizes, method, pointer(taken.p))
    copy(pointer(taken.held), bench.held, sizes.held)
    # Of each direction dy at the start of a step, padded, and its dk; a change within the step.
    start = pointer(memory) + own_size
    slopes, inner = start + directions * width, start + directions * (each + width)
    room = inner + width
    stiff = stiff_at(room + sizes.signals + n, sizes)
    place, count, own = 0, places.size, method.solution * method.stages
    for d in range(directions):
        copy(pointer(dy) + d * n, start + d * width, n)
        copy(pointer(dy) + d * n, pointer(rows) + d * n, n)
    for i in range(t.size - 1):
        copy(pointer(taken.y) + i * n, bench.y, n)
        h = t[i + 1] - t[i]
        stages_made_again(bench, stiff, kernels, second, sizes, method, inputs, t[i], h)
        steps = new_state(bench, kernels, sizes, method, h)
        for d in range(directions):
            before, dk = start + d * width, slopes + d * each
            change = direction_of(sizes, d, d_signal, d_held, d_p)
            stages_along(
                bench, stiff, kernels, second, sizes, method, inputs, h, change, before, dk, room
            )  # fmt: skip
            new = dk + method.stages * width
            weighed(
                bench, method.a + own, bench.others.a + own, method.solution, h, before, dk, width,
                n, new,
            )  # fmt: skip
            closed_along(bench, kernels, sizes, bench.z, steps, new, change.p)
        # Samples by the dense output, from the changes of the start and of all stages.
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
def cost_of(bench, stiff, kernels, sizes, method, h, slopes, stages):
    """Fill the derivative (n, inputs ...) of the cost at the start, and its stages q_i; return its
    integral over a step."""
    n, given, rows, e = sizes.n, given_size(sizes), method.stages, method.e
    gamma, x, own = e[method.solution], bench.x + bench.x_width, method.solution * rows
    for m in range(n):
        x[given + m] = 0.0
    x[given + n] = 1.0
    call(kernels.against, x, slopes)
    forcing, integral = 0.0, 0.0
    for c in range(sizes.signals):
        forcing += slopes[n + c] * stiff.input_rates[c]
    for i in range(1, method.solution):
        call(kernels.cost, bench.x + i * bench.x_width, stages + i)
        for j in range(1, i):
            stages[i] += e[i * rows + j] * stages[j]
        along, k = e[i * rows + method.solution] * forcing, bench.k + i * bench.width
        for m in range(n):
            along += slopes[m] * k[m]
        stages[i] = gamma * (stages[i] + h * along)
        integral += h * method.a[own + i] * stages[i]
    return integral


@njit(**OPTIONS)
def rates_against(bench, stiff, kernels, sizes, method, inputs, i, h, slopes, told):
    """Add what the rates of the inputs at the start tell of their coefficients."""
    n, columns, piece = sizes.n, sizes.signals, int(bench.pieces[1])
    share, s = h * method.e[i * method.stages + method.solution], bench.times[1]
    s -= inputs.knots[piece]
    for c in range(columns):
        bar = 0.0
        for m in range(n):
            bar += stiff.jacobian[n * (n + c) + m] * stiff.seed[m]
        if kernels.cost != 0:
            bar += slopes[n + c] * stiff.seed[n]
        own = told.signals + 4 * columns * piece + c
        own[columns] += share * bar
        own[2 * columns] += share * bar * 2 * s
        own[3 * columns] += share * bar * 3 * s * s


class StiffBars(NamedTuple):
    """Where derivatives of a loss by the parts of a stiff step are.

    rows: what each row contributes, `width` apart; slopes: by the stages, as far apart as those
    are; before: by the state at the start; of_cost, stages, leads: the derivative of the cost at
    the start, its stages q_i, and their bars
    """

    rows: Any
    width: int
    slopes: Any
    before: Any
    of_cost: Any
    stages: Any
    leads: Any


@njit(**OPTIONS)
def stiff_bars_size(sizes, method):
    """Return how many numbers `StiffBars` need."""
    b_width, width, rows = padded(given_size(sizes) + 1), padded(sizes.n + 1), method.stages
    return (rows + 1) * (b_width + width) + width + b_width + 2 * rows


@njit(**OPTIONS)
def stiff_bars_at(memory, sizes, method):
    """Return `StiffBars` in zeros at a pointer."""
    b_width, width, rows = padded(given_size(sizes) + 1), padded(sizes.n + 1), method.stages
    slopes = memory + (rows + 1) * b_width
    before = slopes + (rows + 1) * width
    of_cost = before + width
    stages = of_cost + b_width
    return StiffBars(memory, b_width, slopes, before, of_cost, stages, stages + rows)


@njit(**OPTIONS)
def new_state_against(bench, kernels, sizes, method, newton, h, bars, own, told):
    """Add what the bar of the new state tells of the start and of the stages."""
    n, weights = sizes.n, method.a + method.solution * method.stages
    closed_against(bench, kernels, sizes, bench.z, newton, own, told.p)
    for m in range(n):
        bars.before[m] += own[m]
    for j in range(1, method.solution):
        for m in range(n):
            bars.slopes[j * bench.width + m] += h * weights[j] * own[m]


@njit(**OPTIONS)
def stage_against(bench, stiff, kernels, sizes, method, inputs, j, h, weight, bars, told):
    """Add what the bar of stage j, to which all later ones have added, tells of those before, of
    the start, and of what acts all along."""
    n, rows, e, solution = sizes.n, method.stages, method.e, method.solution
    lead, seed = bars.slopes + j * bench.width, bench.x + j * bench.x_width + given_size(sizes)
    own = bars.rows + j * bars.width
    # The stage of the cost adds to that of the state.
    bars.leads[j] = 0.0
    if kernels.cost != 0:
        bars.leads[j] = h * weight * method.a[solution * rows + j]
        for i in range(j + 1, solution):
            bars.leads[j] += e[i * rows + j] * bars.leads[i]
        bars.leads[j] *= e[solution]
        for m in range(n):
            lead[m] += h * bars.of_cost[m] * bars.leads[j]
    # W' l = bar, and what l tells by the slope of its row, of y, u and p.
    solve_transposed(stiff.W, stiff.order, n, lead)
    lead[n] = bars.leads[j]
    copy(lead, seed, n + 1)
    copy(lead, stiff.seed, n + 1)
    row_against(bench, kernels, sizes, inputs, j, bars.rows, bars.width, told)
    for m in range(n):
        bars.before[m] += own[m]
    for i in range(1, j):
        a, C = h * method.a[j * rows + i], e[j * rows + i]
        for m in range(n):
            bars.slopes[i * bench.width + m] += a * own[m] + C * lead[m]
    rates_against(bench, stiff, kernels, sizes, method, inputs, j, h, bars.of_cost, told)


@compiled_once("the adjoints of stiff runs", (flat(StiffKernels), *BACKWARDS))
def adjoint(
    second, kernels, sizes, taken, row_bars, sample_bars, weight, bar, p_bar, signal_bar, held_bar
):  # fmt: skip
    """Lead an adjoint back along the K - 1 steps between K states; return the integral of the cost.

    second: as of `StiffKernels`; all others as of `native_sweeps.adjoint`.
    """
    kernels, sizes, taken = DerivativeKernels(*kernels), StateSizes(*sizes), StepsTaken(*taken)
    second, t, places, times = StiffKernels(*second), taken.t, taken.places, taken.times
    method, (inputs, _) = method_of(pointer(taken.plan)), inputs_of(pointer(taken.signal))
    n, width, integral = sizes.n, padded(sizes.n + 1), 0.0
    own_size, stiff_numbers = bench_size(sizes, method), stiff_size(sizes)
    memory = np.zeros(own_size + stiff_numbers + stiff_bars_size(sizes, method))
    bench = bench_at(pointer(memory), sizes, method, method_of(pointer(taken.plan_apart)))
    furnish_bench(bench, sizes, method, pointer(taken.p))
    copy(pointer(taken.held), bench.held, sizes.held)
    stiff = stiff_at(pointer(memory) + own_size, sizes)
    bars = stiff_bars_at(pointer(memory) + own_size + stiff_numbers, sizes, method)
    side_by_side = np.zeros(wide_size(sizes, second.lanes))
    wide = aligned(side_by_side, bars.rows)
    told = OfInputs(pointer(signal_bar), pointer(held_bar), pointer(p_bar))
    own, place = pointer(bar), places.size - 1
    for m in range(n):
        own[m] += row_bars[t.size - 1, m]
    for step in range(t.size - 2, -1, -1):
        copy(pointer(taken.y) + step * n, bench.y, n)
        h = t[step + 1] - t[step]
        stages_made_again(bench, stiff, kernels, second, sizes, method, inputs, t[step], h)
        newton = new_state(bench, kernels, sizes, method, h)
        if kernels.cost != 0:
            integral += cost_of(
                bench, stiff, kernels, sizes, method, h, bars.of_cost, bars.stages
            )  # fmt: skip
        for m in range(n):
            bars.before[m] = row_bars[step, m]
        for m in range((method.stages + 1) * width):
            bars.slopes[m] = 0.0
        # Samples, and the new state, tell of the start and of the stages.
        while place >= 0 and int(places[place]) == step:
            theta, own_bar = (times[place] - t[step]) / h, pointer(sample_bars) + place * n
            sample_against(bench, kernels, sizes, method, h, theta, own_bar, bars, told.p)
            place -= 1
        new_state_against(bench, kernels, sizes, method, newton, h, bars, own, told)
        # The stages, the last one first: what they tell of those before, of y, u and p.
        for j in range(method.solution - 1, 0, -1):
            stage_against(bench, stiff, kernels, sizes, method, inputs, j, h, weight, bars, told)
        # What their matrix tells of the start.
        bent_together(bench, stiff, second, sizes, method, h, bars.slopes, width, wide)
        for m in range(n):
            bars.before[m] += stiff.bends[m]
        inputs_against(bench, sizes, inputs, 1, stiff.bends + n, told)
        copy(bars.before, own, n)
    memory[0] = side_by_side[0] = 0.0  # the memory lives to the end
    return integral
