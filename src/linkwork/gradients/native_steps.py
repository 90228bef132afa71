"""Steps made again, to be differentiated: compiled parts of the loops of `native_sweeps`.

An explicit step from y(t), its stages and its new state, closed by Newton steps G on phi(q) = 0:

    x_i = y + h sum_(j<i) a_ij k_j,  k_i = f(x_i, u(t + c_i h), p),   new = G(... G(x_s))

Where a method steps q in its own way, weights a of q are others (`weighed`).
Names are those of `linkwork.simulation.native_parts`; kernels are called by their addresses:

    motion   in = (y, u, p)             out = (y', pivot)
    along    in = (y, u, p, d)          out = the derivative of y' along d of (y, u, p)
    against  in = (y, u, p, l)          out = (y', l)-bar: the derivative of l . (y', cost) with
                                              respect to (y, u, p)
    cost     in = (y, u, p)             out = a number that is integrated over the run
    closure  in = (q, p)                out = (G(q), largest |phi(q)|); likewise along and against
"""

from typing import Any, NamedTuple

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_parts import NEWTON_CALLS, RESERVE, copy, force, padded
from linkwork.simulation.pointers import call, combine


class DerivativeKernels(NamedTuple):
    """Addresses of the kernels, 0 where there is none."""

    motion: int
    along: int
    against: int
    cost: int
    closure: int
    closure_along: int
    closure_against: int


class StiffKernels(NamedTuple):
    """Addresses of the kernels that Rosenbrock steps need beside the others; lanes: how many stages
    `bend_against` evaluates side by side."""

    jacobian: int
    bend: int
    bend_against: int
    lanes: int


class StateSizes(NamedTuple):
    """Say how many numbers there are.

    n: of y; nq: of q; signals: of u over time; held: of u by a sampled controller; parameters: p;
    own: those of p that the closure takes, the first ones; tolerance: of the closure's residual
    apart: those of y that have other weights, the first ones: nq, or 0 where all have the same
    redundant: whether rows of phi ask that the end of every step is measured, 1 or 0
    """

    n: int
    nq: int
    signals: int
    held: int
    parameters: int
    own: int
    tolerance: float
    apart: int
    redundant: int


class StepsTaken(NamedTuple):
    """Steps of a run that sweeps go over.

    p (np,): parameters; plan, plan_apart: the method's `StepPlan.table`, and that of the numbers
    that stand apart; signal: `Signal.table`; t (K,), y (K, n): times and states at which steps end;
    held (nh,): inputs
    places, times (S,): of samples, in order: the number of the step that each is in, from 0 on, and
        its time
    """

    p: Any
    plan: Any
    plan_apart: Any
    signal: Any
    t: Any
    y: Any
    held: Any
    places: Any
    times: Any


class StepBench(NamedTuple):
    """Where a step is made again.

    x: what kernels take at each row, `x_width` apart, y, u, p and then a seed; k: the slopes,
    `width` apart; y: the state at the start, padded; times, pieces: of the rows, the pieces being
    those of the signals; held: inputs; z, z_sample: the Newton steps of the new state and of a
    sample, `z_width` apart, each q, p and a seed; z_next: what the closure gives; powers, weights,
    sample: of the dense output; zeros: as many as a state or weights have; others, other_weights: a
    and dense output of the first numbers of a state, so many as stand apart
    """

    x: Any
    k: Any
    y: Any
    times: Any
    pieces: Any
    held: Any
    z: Any
    z_sample: Any
    z_next: Any
    powers: Any
    weights: Any
    sample: Any
    zeros: Any
    others: Any
    other_weights: Any
    x_width: int
    width: int
    z_width: int
    apart: int


@njit(**OPTIONS)
def bench_size(sizes, method):
    """Return how many numbers a `StepBench` needs."""
    given = sizes.n + sizes.signals + sizes.held + sizes.parameters
    x_width, width = padded(2 * given + 1), padded(sizes.n + 1)
    z_width = padded(2 * (sizes.nq + sizes.own) + 1)
    stages = method.stages
    rows = (stages + 1) * (x_width + width) + 2 * (NEWTON_CALLS + 1) * z_width
    lists = 4 * (stages + 4) + method.degree + sizes.held
    return rows + lists + z_width + 3 * max(width, padded(stages)) + 4 * 16


@njit(**OPTIONS)
def bench_at(memory, sizes, method, other):
    """Return a `StepBench` in zeros at a pointer; other: the method as it steps what stands
    apart."""
    given = sizes.n + sizes.signals + sizes.held + sizes.parameters
    x_width, width = padded(2 * given + 1), padded(sizes.n + 1)
    z_width = padded(2 * (sizes.nq + sizes.own) + 1)
    stages = method.stages
    x = memory
    k = x + (stages + 1) * x_width
    y = k + (stages + 1) * width
    z = y + width
    z_sample = z + (NEWTON_CALLS + 1) * z_width
    z_next = z_sample + (NEWTON_CALLS + 1) * z_width
    sample = z_next + z_width
    zeros = sample + width
    weights = zeros + max(width, padded(stages))
    other_weights = weights + padded(stages)
    times = other_weights + padded(stages)
    pieces = times + padded(stages)
    powers = pieces + padded(stages)
    held = powers + padded(method.degree)
    return StepBench(
        x, k, y, times, pieces, held, z, z_sample, z_next, powers, weights, sample, zeros,
        other, other_weights, x_width, width, z_width, sizes.apart,
    )  # fmt: skip


@njit(**OPTIONS)
def furnish_bench(bench, sizes, method, p):
    """Write the parameters behind all that kernels take."""
    inputs = sizes.n + sizes.signals + sizes.held
    for i in range(method.stages + 1):
        copy(p, bench.x + i * bench.x_width + inputs, sizes.parameters)
    for i in range(NEWTON_CALLS + 1):
        copy(p, bench.z + i * bench.z_width + sizes.nq, sizes.own)
        copy(p, bench.z_sample + i * bench.z_width + sizes.nq, sizes.own)


@njit(**OPTIONS)
def weighed(bench, weights, others, count, h, y, k, width, n, out):
    """Compute out = y + h sum_(j < count) weights_j k_j, by others of what stands apart."""
    combine(weights, count, h, y, k, width, n, out)
    if bench.apart > 0:
        combine(others, count, h, y, k, width, bench.apart, out)


@njit(**OPTIONS)
def slope_unclosed(method):
    """Tell whether the slope at the new state is evaluated for the dense output alone, and then
    before the loops are closed there."""
    return method.computed <= method.solution


@njit(**OPTIONS)
def remake(bench, kernels, sizes, method, inputs, t, h, first, last):
    """Evaluate the rows from first to last, of the step from bench.y at t."""
    n, stages, width = sizes.n, method.stages, bench.width
    piece = int(bench.pieces[first - 1]) if first > 0 else int(bench.pieces[0])
    for i in range(first, last):
        x, k = bench.x + i * bench.x_width, bench.k + i * width
        if i != method.solution or slope_unclosed(method):
            own = i * stages
            weighed(
                bench, method.a + own, bench.others.a + own, i, h, bench.y, bench.k, width, n, x
            )
        bench.times[i] = t + method.c[i] * h
        piece = force(inputs, bench.times[i], method.c[i] > 0, piece, x + n)
        bench.pieces[i] = piece
        copy(bench.held, x + n + sizes.signals, sizes.held)
        call(kernels.motion, x, k)
        k[n] = 0.0


@njit(**OPTIONS)
def close(bench, kernels, sizes, measured, z, state):
    """Close q, the head of a state, as runs do, which measure the residual of samples, and where
    rows are redundant that of every step; leave the Newton steps in z, and return how many there
    are."""
    if kernels.closure == 0:
        return 0
    nq, width, z_next = sizes.nq, bench.z_width, bench.z_next
    copy(state, z, nq)
    steps = 0
    while steps < NEWTON_CALLS:
        own = z + steps * width
        call(kernels.closure, own, z_next)
        longest = z_next[nq]
        if longest <= sizes.tolerance:
            break
        for m in range(nq):
            longest = max(longest, abs(z_next[m] - own[m]))
        steps += 1
        copy(z_next, z + steps * width, nq)
        if not measured and RESERVE * longest * longest <= sizes.tolerance:
            break
    copy(z + steps * width, state, nq)
    return steps


@njit(**OPTIONS)
def new_state(bench, kernels, sizes, method, h):
    """Leave the new state, closed, in the row of the solution; return its Newton steps."""
    row, own = method.solution, method.solution * method.stages
    x = bench.x + row * bench.x_width
    weighed(
        bench, method.a + own, bench.others.a + own, row, h, bench.y, bench.k, bench.width,
        sizes.n, x,
    )  # fmt: skip
    return close(bench, kernels, sizes, sizes.redundant > 0, bench.z, x)


@njit(**OPTIONS)
def within(bench, kernels, sizes, method, h, theta):
    """Leave the weights of the dense output at theta, and the Newton steps of the state there;
    return how many there are."""
    stages, power = method.stages, 1.0
    for m in range(method.degree):
        power *= theta
        bench.powers[m] = power
    combine(
        bench.powers, method.degree, 1.0, bench.zeros, method.dense, padded(stages), stages,
        bench.weights,
    )  # fmt: skip
    if bench.apart > 0:
        combine(
            bench.powers, method.degree, 1.0, bench.zeros, bench.others.dense, padded(stages),
            stages, bench.other_weights,
        )  # fmt: skip
    weighed(
        bench, bench.weights, bench.other_weights, stages, h, bench.y, bench.k, bench.width,
        sizes.n, bench.sample,
    )  # fmt: skip
    return close(bench, kernels, sizes, True, bench.z_sample, bench.sample)


@njit(**OPTIONS)
def closed_along(bench, kernels, sizes, z, steps, d, dp):
    """Replace d, the change of a state before it is closed, by that of the closed one."""
    nq, own = sizes.nq, sizes.own
    for i in range(steps):
        given = z + i * bench.z_width
        copy(d, given + nq + own, nq)
        copy(dp, given + 2 * nq + own, own)
        call(kernels.closure_along, given, d)


@njit(**OPTIONS)
def closed_against(bench, kernels, sizes, z, steps, bar, p_bar):
    """Replace the derivative with respect to a closed state by that with respect to the state
    before; add what p contributes."""
    nq, own = sizes.nq, sizes.own
    for i in range(steps - 1, -1, -1):
        given = z + i * bench.z_width
        copy(bar, given + nq + own, nq)
        call(kernels.closure_against, given, bench.z_next)
        copy(bench.z_next, bar, nq)
        for m in range(own):
            p_bar[m] += bench.z_next[nq + m]
