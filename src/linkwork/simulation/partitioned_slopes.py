"""The Jacobian of equations that a table tells in a chart (`partitioned`), for stiff methods.

In a direction of (q, v, inputs), by the derivatives d of what depends on no chart, at the
accelerations a = L v' + b and the multipliers l of the rows that the chart keeps,

    Phi_u dw_u = -d(Phi w)                                  at dw = L dv otherwise,
    Phi_u da_u = -d(Phi a + gamma)                          at da = L dv' otherwise,
    M dv' = -L' (d(H a + h - f - S' u - Phi' l) + H da).

Directions are evaluated side by side (`abreast`); the elimination and M are those of one state.
"""

from __future__ import annotations

from functools import cache

from numba import njit

from linkwork.simulation.abreast import beside, evaluate, room, within
from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.partitioned import (
    ADDRESSES,
    ONE,
    SIZES,
    accelerated,
    biased,
    compiled_entry,
    decomposed,
    in_tree,
    reduced,
    sized,
    solved,
    whole,
)
from linkwork.simulation.vectors import LANES

TURNING, SLOPES = SIZES + 2, SIZES + 3  # places of two addresses more in the table


@njit(**OPTIONS)
def directed(t, W, turned, X, first):
    """Set the directions in the lanes of the rows X (nq + nv + inputs): unit vectors of
    (q, v, inputs) from the number `first` on, with the rates dw of the tree that belong to them.

    turned: d(Phi w)/dq (rows x nq), by columns
    """
    sizes = sized(t)
    nq, nv, n, d, rows, inputs = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows, sizes.inputs
    independent = t + (SIZES + ADDRESSES)
    columns, kept, width = independent + n, independent + (n + d), n + 2 * d
    for i in range((nq + nv + inputs) * LANES):
        X[i] = 0.0
    for lane in range(min(LANES, nq + n + inputs - first)):
        k = first + lane
        if k >= nq + n:
            X[(k + nv - n) * LANES + lane] = 1.0
        elif k >= nq:
            j = k - nq
            X[(nq + int(independent[j])) * LANES + lane] = 1.0
            for i in range(d):
                X[(nq + int(columns[i])) * LANES + lane] = W[i * width + d + j]
        else:
            X[k * LANES + lane] = 1.0
            for i in range(d):
                total = 0.0
                for j in range(d):
                    total -= W[i * width + d + n + j] * turned[k * rows + int(kept[j])]
                X[(nq + int(columns[i])) * LANES + lane] = total


@njit(**OPTIONS)
def answered(t, W, H, M, E, b, r):
    """Fill the rows r (n) with dv' for each lane.

    H, M: as `reduced` and `decomposed` leave them; E: the derivatives of q' (nq), of the forces
        (nv), of z' and of Phi a + gamma (rows); b: room for da_u (d)
    """
    sizes = sized(t)
    nq, nv, n, d = sizes.nq, sizes.nv, sizes.n, sizes.d
    independent = t + (SIZES + ADDRESSES)
    columns, width = independent + n, n + 2 * d
    forces = E + nq
    biased(t, W, forces + (nv + sizes.states), b)
    for k in range(d):
        column = int(columns[k])
        for i in range(nv):
            if H[column * nv + i] != 0:
                forces[i] += H[column * nv + i] * b[k]
    for i in range(n):
        r[i] = -forces[int(independent[i])]
        for k in range(d):
            r[i] -= W[k * width + d + i] * forces[int(columns[k])]
    solved(M, n, r)


def jacobian(x, out, t):
    """Compute (q, v, z, r, p) -> df/dy and df/dr of y' = (q', v', z'), column by column."""
    sizes = sized(t)
    nq, nv, n, d, rows = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows
    inputs, parameters, states, own = sizes.inputs, sizes.parameters, sizes.states, sizes.own
    independent = t + (SIZES + ADDRESSES)
    columns, kept, width = independent + n, independent + (n + d), n + 2 * d
    given, found = nq + nv + inputs + parameters + own, nq + nv * nv + nv + rows + states + 1
    size = d * width + given + found + max(rows * (nv + 1) + 1, rows * nq)
    alive = room(size + d + d * n + n * n + n + 3 * nv + rows + nq + parameters, x)
    W = within(alive, x)
    work = W + d * width
    # H, what is in it of this chart, and the accelerations v'.
    in_tree(t, x, W, work)
    terms = work + given
    evaluate(int(t[SIZES + 1]), work, terms)
    H, forces = terms + nq, terms + (nq + nv * nv)
    gamma, b = forces + nv, W + size
    HL, M = b + d, b + (d + d * n)
    result, a = M + n * n, M + (n * n + n)
    residual, multipliers = a + nv, a + 2 * nv
    # M v' = L' (forces - H b), solved.
    for i in range(nv):
        residual[i] = -forces[i]
    biased(t, W, gamma, b)
    reduced(t, W, H, HL, M)
    accelerated(t, W, H, forces, b, result)
    decomposed(M, n)
    solved(M, n, result)
    # The accelerations a of the whole tree, and the multipliers of the kept rows.
    whole(t, W, result, a)
    for i in range(d):
        a[int(columns[i])] += b[i]
    for j in range(nv):
        for i in range(nv):
            residual[i] += H[j * nv + i] * a[j]
    for i in range(rows):
        multipliers[i] = 0.0
    for j in range(d):
        for i in range(d):
            multipliers[int(kept[j])] += W[i * width + d + n + j] * residual[int(columns[i])]
    # d(Phi w)/dq of (q, w, p), and what of the input is the same in all directions.
    turned, asked = terms + found, multipliers + rows
    for i in range(nq + nv):
        asked[i] = work[i]
    for i in range(parameters):
        asked[nq + nv + i] = work[nq + nv + inputs + i]
    evaluate(int(t[TURNING]), asked, turned)
    moving, lines = nq + nv + inputs, nq + nv + states + rows
    # The input of the slopes, each number in all lanes.
    side = room((given + nv + rows + moving + lines + d + n) * LANES, x)
    flat = within(side, x)
    X = beside(flat)
    for i in range(given):
        X[i] = work[i]
    for i in range(nv):
        X[given + i] = a[i]
    for i in range(rows):
        X[given + nv + i] = multipliers[i]
    # Direction by direction, LANES at a time.
    first_direction = given + nv + rows
    E = X + (first_direction + moving)
    answers = E + (lines + d)
    slopes, rates = flat + (first_direction + moving) * LANES, nq + nv
    height, first = nq + n + states, 0
    while first < nq + n + inputs:
        directed(t, W, turned, flat + first_direction * LANES, first)
        evaluate(int(t[SLOPES]), X, E)
        answered(t, W, H, M, E, E + lines, answers)
        # A column of the answer for each lane.
        for lane in range(min(LANES, nq + n + inputs - first)):
            column = out + (first + lane) * height
            for i in range(nq):
                column[i] = slopes[i * LANES + lane]
            for i in range(n):
                column[nq + i] = slopes[(lines + d + i) * LANES + lane]
            for i in range(states):
                column[nq + n + i] = slopes[(rates + i) * LANES + lane]
        first += LANES
    alive[0] = side[0] = 0  # their memory lives to here


@cache
def entry() -> int:
    """Return the address of `jacobian` (in, out, table), compiled once on a machine."""
    return compiled_entry(jacobian, ONE)
