"""Equations in the rates of a whole tree, evaluated in independent ones that a table names.

    Phi_u w_u = -Phi_a v                      w = L v = (v, L_d v),   L_d = -Phi_u^-1 Phi_a
    M = L' H L,   r = L' (forces - H b),      b_d = -Phi_u^-1 gamma
    M v' = r

by Gauss and Jordan's elimination in the order that the table holds, so that one machine code serves
all charts of a mechanism: slower than code of a chart's own, and there at once. The results are the
same but for rounding. The same source is compiled for one state and for states side by side
(`abreast`).

The table holds, as doubles: the sizes nq, nv, n, d (dependent rates), rows, inputs, parameters,
blocks, and of what acts the states z, which are the first of the inputs, and parameters of its own;
the addresses of kernels, of one state or of states side by side (`equations.uncharted`):
closure, and what an entry asks beside: forces of motion, moved of closure_step, bias of
tree_motion, of seen any function of (q, w, inputs, parameters); the independent rates (n); the
dependent ones and the kept rows (d each) in the order of elimination; and for each block of it how
many they are, the scale of its determinant, and whether that varies.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from numba import njit, types

from linkwork.simulation.abreast import ROWS, bounded, evaluate, matters, room, weaker, within, zero
from linkwork.simulation.compiled import OPTIONS, address_of, compiled_once
from linkwork.simulation.pointers import POINTER

HIDDEN = 1e-13  # part of a product that rounding hides
INVERSE = 9  # numbers of the largest block's inverse

ONE, WIDE = types.void(POINTER, POINTER, POINTER), types.void(ROWS, ROWS, POINTER)


class TableSizes(NamedTuple):
    """Hold the sizes at the head of a table; d: of the dependent rates; states, own: z and the
    parameters of what acts."""

    nq: int
    nv: int
    n: int
    d: int
    rows: int
    inputs: int
    parameters: int
    blocks: int
    states: int
    own: int


SIZES, ADDRESSES = len(TableSizes._fields), 4


@njit(**OPTIONS)
def sized(t):
    """Return the sizes that a table begins with."""
    return TableSizes(
        int(t[0]), int(t[1]), int(t[2]), int(t[3]), int(t[4]),
        int(t[5]), int(t[6]), int(t[7]), int(t[8]), int(t[9]),
    )  # fmt: skip


@njit(**OPTIONS)
def inverted(W, width, k, size, inverse):
    """Invert a block of up to three rows and columns by cofactors; return its determinant."""
    a = W[k * width + k]
    if size == 1:
        inverse[0] = 1.0 / a
        return a
    b, c, e = W[k * width + k + 1], W[(k + 1) * width + k], W[(k + 1) * width + k + 1]
    if size == 2:
        det = a * e - b * c
        inverse[0], inverse[1], inverse[2], inverse[3] = e / det, -b / det, -c / det, a / det
        return det
    g, h = W[k * width + k + 2], W[(k + 1) * width + k + 2]
    i, j, m = W[(k + 2) * width + k], W[(k + 2) * width + k + 1], W[(k + 2) * width + k + 2]
    inverse[0], inverse[1], inverse[2] = e * m - h * j, g * j - b * m, b * h - g * e
    inverse[3], inverse[4], inverse[5] = h * i - c * m, a * m - g * i, g * c - a * h
    inverse[6], inverse[7], inverse[8] = c * j - e * i, b * i - a * j, a * e - b * c
    det = a * inverse[0] + b * inverse[3] + g * inverse[6]
    for index in range(INVERSE):
        inverse[index] /= det
    return det


@njit(**OPTIONS)
def eliminated(t, Phi, W):
    """Fill W (d x (d + n + d)) with [1, L_d, Phi_u^-1] in the order of elimination; return the
    weakest relative pivot.

    Phi: rows x nv, by columns.
    """
    # [Phi_u, -Phi_a, 1] in the order of the table.
    sizes = sized(t)
    n, d, rows, blocks = sizes.n, sizes.d, sizes.rows, sizes.blocks
    independent = t + (SIZES + ADDRESSES)
    columns, kept, order = independent + n, independent + n + d, independent + n + 2 * d
    width = n + 2 * d
    for i in range(d):
        row = int(kept[i])
        for j in range(d):
            W[i * width + j] = Phi[int(columns[j]) * rows + row]
            W[i * width + d + n + j] = 1.0 if i == j else 0.0
        for j in range(n):
            W[i * width + d + j] = -Phi[int(independent[j]) * rows + row]
    # Block by block: its rows are solved, and taken out of all others.
    kept_alive = room(INVERSE + 4, W)
    inverse = within(kept_alive, W)
    solved, weakest, first = inverse + INVERSE, inverse + (INVERSE + 3), True
    weakest[0] = 1.0
    k = 0
    for block in range(blocks):
        size, scale = int(order[3 * block]), order[3 * block + 1]
        pivot = inverted(W, width, k, size, inverse) / scale
        if order[3 * block + 2] != 0:
            weakest[0] = pivot if first else weaker(weakest[0], pivot)
            first = False
        # The block's rows, from the left by its inverse.
        for j in range(k + size, width):
            for a in range(size):
                solved[a] = 0.0
                for b in range(size):
                    solved[a] += inverse[a * size + b] * W[(k + b) * width + j]
            for a in range(size):
                W[(k + a) * width + j] = solved[a]
        # All other rows, less their share of these.
        for i in range(d):
            if i < k or i >= k + size:
                for a in range(size):
                    factor = W[i * width + k + a]
                    if matters(factor):
                        for j in range(k + size, width):
                            W[i * width + j] -= factor * W[(k + a) * width + j]
        k += size
    found = weakest[0]
    kept_alive[0] = 0  # its memory lives to here
    return found


@njit(**OPTIONS)
def opened(t, q, p, W, work):
    """Evaluate phi, Phi and the largest gap into the work, from its number nq + parameters on, and
    eliminate; return the weakest relative pivot.
    """
    sizes = sized(t)
    nq, rows, parameters = sizes.nq, sizes.rows, sizes.parameters
    for i in range(nq):
        work[i] = q[i]
    for i in range(parameters):
        work[nq + i] = p[i]
    found = work + (nq + parameters)
    evaluate(int(t[SIZES]), work, found)
    return eliminated(t, found + rows, W)


@njit(**OPTIONS)
def whole(t, W, v, w):
    """Fill w = L v (nv)."""
    sizes = sized(t)
    n, d = sizes.n, sizes.d
    independent = t + (SIZES + ADDRESSES)
    columns, width = independent + n, n + 2 * d
    for j in range(n):
        w[int(independent[j])] = v[j]
    for i in range(d):
        total = zero(v)
        for j in range(n):
            total += W[i * width + d + j] * v[j]
        w[int(columns[i])] = total


@njit(**OPTIONS)
def decomposed(M, n):
    """Replace the diagonal and the lower triangle of a symmetric positive M (n x n) by D and L of
    M = L D L'; return how much of M is lost in rounding, below HIDDEN**-2 where it is regular."""
    lost = zero(M)
    for j in range(n):
        largest = M[j * n + j]
        for i in range(j):
            M[j * n + j] -= M[i * n + j] * M[j * n + i]
        inverse = 1.0 / M[j * n + j]
        if j > 0:
            lost += (largest * inverse) * (largest * inverse)
        for k in range(j + 1, n):
            for i in range(j):
                M[j * n + k] -= M[i * n + k] * M[j * n + i]
            M[k * n + j] = M[j * n + k] * inverse
    return lost


@njit(**OPTIONS)
def solved(M, n, b):
    """Replace b by the solution of M x = b, of which M holds D and L."""
    for j in range(n):
        for i in range(j):
            b[j] -= M[j * n + i] * b[i]
    for j in range(n):
        b[j] /= M[j * n + j]
    for j in range(n - 1, -1, -1):
        for k in range(j + 1, n):
            b[j] -= M[k * n + j] * b[k]


@njit(**OPTIONS)
def solved_positive(M, n, b):
    """Replace b by the solution of M x = b for a symmetric positive M (n x n); not finite where M
    is singular but for rounding."""
    lost = decomposed(M, n)
    solved(M, n, b)
    b[0] = bounded(lost, HIDDEN**-2, b[0])


@njit(**OPTIONS)
def in_tree(t, x, W, work):
    """Fill work with (q, w, inputs, parameters) from x = (q, v, inputs, parameters); return the
    weakest relative pivot."""
    sizes = sized(t)
    nq, nv, n, inputs, parameters = sizes.nq, sizes.nv, sizes.n, sizes.inputs, sizes.parameters
    pivot = opened(t, x, x + (nq + n + inputs), W, work)
    for i in range(nq):
        work[i] = x[i]
    whole(t, W, x + nq, work + nq)
    for i in range(inputs + parameters + sizes.own):
        work[nq + nv + i] = x[nq + n + i]
    return pivot


@njit(**OPTIONS)
def biased(t, W, gamma, b):
    """Fill b_d (d) in the order of elimination."""
    sizes = sized(t)
    n, d = sizes.n, sizes.d
    kept, width = t + (SIZES + ADDRESSES + n + d), n + 2 * d
    for i in range(d):
        b[i] = 0.0
        for j in range(d):
            b[i] -= W[i * width + d + n + j] * gamma[int(kept[j])]


@njit(**OPTIONS)
def reduced(t, W, H, HL, M):
    """Fill HL (d x n) with H_dd L_d + H_da, and the upper triangle of M (n x n) with
    H_aa + H_ad L_d + L_d' (H_dd L_d + H_da)."""
    sizes = sized(t)
    nv, n, d = sizes.nv, sizes.n, sizes.d
    independent = t + (SIZES + ADDRESSES)
    columns, width = independent + n, n + 2 * d
    for i in range(d):
        row = int(columns[i])
        for j in range(n):
            HL[i * n + j] = H[int(independent[j]) * nv + row]
        for k in range(d):
            factor = H[int(columns[k]) * nv + row]
            if matters(factor):
                for j in range(n):
                    HL[i * n + j] += factor * W[k * width + d + j]
    for i in range(n):
        row = int(independent[i])
        for j in range(n):
            M[i * n + j] = H[int(independent[j]) * nv + row]
        for k in range(d):
            factor, coupled = H[int(columns[k]) * nv + row], W[k * width + d + i]
            for j in range(i, n):
                M[i * n + j] += factor * W[k * width + d + j] + coupled * HL[k * n + j]


@njit(**OPTIONS)
def accelerated(t, W, H, forces, b, result):
    """Take H b from the forces (nv), and fill the result (n) with L' (forces - H b)."""
    sizes = sized(t)
    nv, n, d = sizes.nv, sizes.n, sizes.d
    independent = t + (SIZES + ADDRESSES)
    columns, width = independent + n, n + 2 * d
    for j in range(d):
        column = int(columns[j])
        for i in range(nv):
            forces[i] -= H[column * nv + i] * b[j]
    for i in range(n):
        result[i] = forces[int(independent[i])]
        for k in range(d):
            result[i] += W[k * width + d + i] * forces[int(columns[k])]


def motion(x, out, t):
    """Compute (q, v, z, r, p) -> q', v', z' and the weakest relative pivot; without what acts z are
    no numbers, and r are the forces u."""
    sizes = sized(t)
    nq, nv, n, d, rows = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows
    inputs, parameters, states, own = sizes.inputs, sizes.parameters, sizes.states, sizes.own
    width = n + 2 * d
    given = nq + nv + inputs + parameters + own
    found = nq + nv * nv + nv + rows + states + 1
    size = d * width + given + found + rows * (nv + 1) + 1 + 2 * d * n + n * n + 2 * d
    kept_alive = room(size, x)
    W = within(kept_alive, x)
    work = W + d * width
    # Forces on the tree's rates, z', and 1 where all of it is defined.
    pivot, terms = in_tree(t, x, W, work), work + given
    evaluate(int(t[SIZES + 1]), work, terms)
    H, forces = terms + nq, terms + (nq + nv * nv)
    gamma, b = forces + nv, terms + found
    HL, M, rates = b + d, b + (d + d * n), forces + (nv + rows)
    for i in range(nq):
        out[i] = terms[i]
    for i in range(states):
        out[nq + n + i] = rates[i]
    out[nq + n + states] = pivot * rates[states]
    # v'.
    biased(t, W, gamma, b)
    reduced(t, W, H, HL, M)
    accelerated(t, W, H, forces, b, out + nq)
    solved_positive(M, n, out + nq)
    kept_alive[0] = 0  # its memory lives to here


def closure_step(x, out, t):
    """Compute (q, p) -> q after one Newton step of the dependent coordinates, and the largest |phi|
    before it."""
    sizes = sized(t)
    nq, nv, n, d, rows = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows
    parameters = sizes.parameters
    columns, width = t + (SIZES + ADDRESSES + n), n + 2 * d
    kept = columns + d
    size = d * width + nq + parameters + rows * (nv + 1) + 1
    kept_alive = room(size + nq + nv + parameters, x)
    W = within(kept_alive, x)
    work, s = W + d * width, W + size
    opened(t, x, x + nq, W, work)
    phi = work + (nq + parameters)
    out[nq] = phi[rows * (nv + 1)]
    for i in range(nq):
        s[i] = x[i]
    for i in range(nv):
        s[nq + i] = 0.0
    for i in range(d):
        place = nq + int(columns[i])
        for j in range(d):
            s[place] -= W[i * width + d + n + j] * phi[int(kept[j])]
    for i in range(parameters):
        s[nq + nv + i] = x[nq + i]
    evaluate(int(t[SIZES + 1]), s, out)
    kept_alive[0] = 0  # its memory lives to here


def tree_rates(x, out, t):
    """Compute (q, v, p) -> w = L v and the weakest relative pivot."""
    sizes = sized(t)
    nq, nv, n, d, rows = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows
    parameters = sizes.parameters
    kept_alive = room(d * (n + 2 * d) + nq + parameters + rows * (nv + 1) + 1, x)
    W = within(kept_alive, x)
    pivot = opened(t, x, x + (nq + n), W, W + d * (n + 2 * d))
    whole(t, W, x + nq, out)
    out[nv] = pivot
    kept_alive[0] = 0  # its memory lives to here


def tree_motion(x, out, t):
    """Compute (q, v, v', p) -> w = L v and w' = L v' + b."""
    sizes = sized(t)
    nq, nv, n, d, rows = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows
    parameters = sizes.parameters
    columns, given = t + (SIZES + ADDRESSES + n), nq + nv + parameters
    kept_alive = room(d * (n + 2 * d) + given + rows * (nv + 1) + 1 + d, x)
    W = within(kept_alive, x)
    work = W + d * (n + 2 * d)
    # gamma of q and w.
    opened(t, x, x + (nq + 2 * n), W, work)
    whole(t, W, x + nq, out)
    for i in range(nv):
        work[nq + i] = out[i]
    for i in range(parameters):
        work[nq + nv + i] = x[nq + 2 * n + i]
    gamma = work + given
    evaluate(int(t[SIZES + 1]), work, gamma)
    # b is zero but for b_d.
    b = gamma + rows
    biased(t, W, gamma, b)
    whole(t, W, x + (nq + n), out + nv)
    for i in range(d):
        out[nv + int(columns[i])] += b[i]
    kept_alive[0] = 0  # its memory lives to here


def seen(x, out, t):
    """Compute (q, v, inputs, parameters) -> the table's function of (q, w, inputs, parameters)."""
    sizes = sized(t)
    nq, nv, n, d, rows = sizes.nq, sizes.nv, sizes.n, sizes.d, sizes.rows
    inputs, parameters = sizes.inputs, sizes.parameters
    given = nq + nv + inputs + parameters + sizes.own
    kept_alive = room(d * (n + 2 * d) + given + rows * (nv + 1) + 1, x)
    W = within(kept_alive, x)
    work = W + d * (n + 2 * d)
    in_tree(t, x, W, work)
    evaluate(int(t[SIZES + 1]), work, out)
    kept_alive[0] = 0  # its memory lives to here


ENTRIES = {each.__name__: each for each in (motion, closure_step, tree_rates, tree_motion, seen)}


@cache
def entry(name: str, wide: bool = False) -> int:
    """Return the address of void(const double *in, double *out, const double *table), by the name
    of one of ENTRIES, for one state or for states side by side."""
    return compiled_entry(ENTRIES[name], WIDE if wide else ONE)


def compiled_entry(function: Callable, kind: Any) -> int:
    """Return the address of a compiled function; compiled once on a machine where Numba can keep
    it."""
    compiled = compiled_once("the elimination that charts share", kind)(function)
    KEPT.append(compiled)
    return address_of(compiled)


KEPT: list[object] = []  # code lives as long as what Numba returned for it
