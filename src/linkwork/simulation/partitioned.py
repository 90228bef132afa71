"""Equations in the rates of a whole tree, evaluated in independent ones that a table names.

    Phi_u w_u = -Phi_a v                      w = L v = (v, L_d v),   L_d = -Phi_u^-1 Phi_a
    M = L' H L,   r = L' (forces - H b),      b_d = -Phi_u^-1 gamma
    M v' = r

by Gauss and Jordan's elimination in the order that the table holds, so that one machine code serves
all charts of a mechanism: slower than code of a chart's own, and there at once. The results are the
same but for rounding.

The table holds, as doubles: the sizes nq, nv, n, d (dependent rates), rows, inputs, parameters,
blocks, and of what acts the states z, which are the first of the inputs, and parameters of its own;
the addresses of two kernels (`equations.uncharted`): closure, and what an entry asks beside: forces
of motion, moved of closure_step, bias of tree_motion, of seen any function of (q, w, inputs,
parameters); the independent rates (n); the dependent ones and the kept rows (d each) in the order
of elimination; and for each block of it how many they are, the scale of its determinant, and
whether that varies.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numba import cfunc, njit, types

from linkwork.simulation.pointers import POINTER, call, pointer

HIDDEN = 1e-13  # part of a product that rounding hides
SIZES, ADDRESSES = 10, 2
INVERSE = 9  # numbers of the largest block's inverse

OPTIONS = {"error_model": "numpy", "nogil": True}
ENTRY = types.void(POINTER, POINTER, POINTER)


@njit(**OPTIONS)
def sized(t):
    """Return nq, nv, n, d, rows, inputs, parameters, blocks; `acts` has the others."""
    return (
        int(t[0]),
        int(t[1]),
        int(t[2]),
        int(t[3]),
        int(t[4]),
        int(t[5]),
        int(t[6]),
        int(t[7]),
    )


@njit(**OPTIONS)
def inverted(W, width, k, size, inverse):
    """Invert a block of up to three rows and columns by cofactors; return its determinant."""
    a = W[k * width + k]
    if size == 1:
        inverse[0] = 1 / a
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
    _, _, n, d, rows, _, _, blocks = sized(t)
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
    room = np.empty(INVERSE + 3)
    inverse = pointer(room)
    solved = inverse + INVERSE
    weakest, first = 0.0, True
    k = 0
    for block in range(blocks):
        size, scale = int(order[3 * block]), order[3 * block + 1]
        pivot = inverted(W, width, k, size, inverse) / scale
        if order[3 * block + 2] != 0:
            if first:
                weakest, first = pivot, False
            else:
                least = min(abs(weakest), abs(pivot))
                weakest = math.copysign(least, min(weakest, pivot))
        for j in range(k + size, width):
            for a in range(size):
                solved[a] = 0.0
                for b in range(size):
                    solved[a] += inverse[a * size + b] * W[(k + b) * width + j]
            for a in range(size):
                W[(k + a) * width + j] = solved[a]
        for i in range(d):
            if i < k or i >= k + size:
                for a in range(size):
                    factor = W[i * width + k + a]
                    if factor != 0:
                        for j in range(k + size, width):
                            W[i * width + j] -= factor * W[(k + a) * width + j]
        k += size
    room[0] = 0  # its memory lives to here
    return 1.0 if first else weakest


@njit(**OPTIONS)
def opened(t, q, p, W, work):
    """Evaluate phi, Phi and the largest gap into the work, from its number nq + parameters on, and
    eliminate; return the weakest relative pivot.
    """
    nq, _, _, _, rows, _, parameters, _ = sized(t)
    for i in range(nq):
        work[i] = q[i]
    for i in range(parameters):
        work[nq + i] = p[i]
    found = work + (nq + parameters)
    call(int(t[SIZES]), work, found)
    return eliminated(t, found + rows, W)


@njit(**OPTIONS)
def whole(t, W, v, w):
    """Fill w = L v (nv)."""
    _, _, n, d, _, _, _, _ = sized(t)
    independent = t + (SIZES + ADDRESSES)
    columns, width = independent + n, n + 2 * d
    for j in range(n):
        w[int(independent[j])] = v[j]
    for i in range(d):
        total = 0.0
        for j in range(n):
            total += W[i * width + d + j] * v[j]
        w[int(columns[i])] = total


@njit(**OPTIONS)
def solved_positive(M, n, b):
    """Replace b by the solution of M x = b for a symmetric positive M (n x n), by M = L D L'; not
    finite where M is singular but for rounding."""
    lost = 0.0
    for j in range(n):
        largest = M[j * n + j]
        for i in range(j):
            M[j * n + j] -= M[i * n + j] * M[j * n + i]
        inverse = 1 / M[j * n + j]
        if j > 0:
            lost += (largest * inverse) ** 2
        for k in range(j + 1, n):
            for i in range(j):
                M[j * n + k] -= M[i * n + k] * M[j * n + i]
            M[k * n + j] = M[j * n + k] * inverse
    for j in range(n):
        for i in range(j):
            b[j] -= M[j * n + i] * b[i]
    for j in range(n):
        b[j] /= M[j * n + j]
    for j in range(n - 1, -1, -1):
        for k in range(j + 1, n):
            b[j] -= M[k * n + j] * b[k]
    if not lost < HIDDEN**-2:
        b[0] = math.inf


@njit(**OPTIONS)
def acts(t):
    """Return numbers of the states z and the parameters of what acts."""
    return int(t[8]), int(t[9])


@njit(**OPTIONS)
def in_tree(t, x, W, work):
    """Fill work with (q, w, inputs, parameters) from x = (q, v, inputs, parameters); return the
    weakest relative pivot."""
    nq, nv, n, _, _, inputs, parameters, _ = sized(t)
    pivot = opened(t, x, x + (nq + n + inputs), W, work)
    for i in range(nq):
        work[i] = x[i]
    whole(t, W, x + nq, work + nq)
    for i in range(inputs + parameters + acts(t)[1]):
        work[nq + nv + i] = x[nq + n + i]
    return pivot


@njit(**OPTIONS)
def biased(t, W, gamma, b):
    """Fill b_d (d) in the order of elimination."""
    _, _, n, d, _, _, _, _ = sized(t)
    kept, width = t + (SIZES + ADDRESSES + n + d), n + 2 * d
    for i in range(d):
        b[i] = 0.0
        for j in range(d):
            b[i] -= W[i * width + d + n + j] * gamma[int(kept[j])]


def motion(x, out, t):
    """Compute (q, v, z, r, p) -> q', v', z' and the weakest relative pivot; without what acts z are
    no numbers, and r are the forces u."""
    nq, nv, n, d, rows, inputs, parameters, _ = sized(t)
    states, own = acts(t)
    independent = t + (SIZES + ADDRESSES)
    columns, width = independent + n, n + 2 * d
    given = nq + nv + inputs + parameters + own
    found = nq + nv * nv + nv + rows + states + 1
    room = np.empty(d * width + given + found + rows * (nv + 1) + 1 + 2 * d * n + n * n + 2 * d)
    W = pointer(room)
    work = W + d * width
    # Forces on the tree's rates, z', and 1 where all of it is defined.
    pivot, terms = in_tree(t, x, W, work), work + given
    call(int(t[SIZES + 1]), work, terms)
    H, forces = terms + nq, terms + (nq + nv * nv)
    gamma, b = forces + nv, terms + found
    HL, M, rates = b + d, b + (d + d * n), forces + (nv + rows)
    for i in range(states):
        out[nq + n + i] = rates[i]
    out[nq + n + states] = pivot * rates[states]
    # Forces less H b.
    biased(t, W, gamma, b)
    for j in range(d):
        column = int(columns[j])
        for i in range(nv):
            forces[i] -= H[column * nv + i] * b[j]
    # H_dd L_d + H_da, and M = H_aa + H_ad L_d + L_d' (H_dd L_d + H_da).
    for i in range(d):
        row = int(columns[i])
        for j in range(n):
            HL[i * n + j] = H[int(independent[j]) * nv + row]
        for k in range(d):
            factor = H[int(columns[k]) * nv + row]
            if factor != 0:
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
    # v'.
    result = out + nq
    for i in range(nq):
        out[i] = terms[i]
    for i in range(n):
        result[i] = forces[int(independent[i])]
        for k in range(d):
            result[i] += W[k * width + d + i] * forces[int(columns[k])]
    solved_positive(M, n, result)
    room[0] = 0  # its memory lives to here


def closure_step(x, out, t):
    """Compute (q, p) -> q after one Newton step of the dependent coordinates, and the largest |phi|
    before it."""
    nq, nv, n, d, rows, _, parameters, _ = sized(t)
    columns, width = t + (SIZES + ADDRESSES + n), n + 2 * d
    kept = columns + d
    room = np.zeros(d * width + nq + nv + parameters + rows * (nv + 1) + 1)
    W = pointer(room)
    work = W + d * width
    opened(t, x, x + nq, W, work)
    phi = work + (nq + parameters)
    out[nq] = phi[rows * (nv + 1)]
    step = np.zeros(nq + nv + parameters)
    s = pointer(step)
    for i in range(nq):
        s[i] = x[i]
    for i in range(d):
        place = nq + int(columns[i])
        for j in range(d):
            s[place] -= W[i * width + d + n + j] * phi[int(kept[j])]
    for i in range(parameters):
        s[nq + nv + i] = x[nq + i]
    call(int(t[SIZES + 1]), s, out)
    step[0] = room[0] = 0  # their memory lives to here


def tree_rates(x, out, t):
    """Compute (q, v, p) -> w = L v and the weakest relative pivot."""
    nq, nv, n, d, rows, _, parameters, _ = sized(t)
    room = np.empty(d * (n + 2 * d) + nq + parameters + rows * (nv + 1) + 1)
    W = pointer(room)
    pivot = opened(t, x, x + (nq + n), W, W + d * (n + 2 * d))
    whole(t, W, x + nq, out)
    out[nv] = pivot
    room[0] = 0  # its memory lives to here


def tree_motion(x, out, t):
    """Compute (q, v, v', p) -> w = L v and w' = L v' + b."""
    nq, nv, n, d, rows, _, parameters, _ = sized(t)
    columns, given = t + (SIZES + ADDRESSES + n), nq + nv + parameters
    room = np.empty(d * (n + 2 * d) + given + rows * (nv + 1) + 1 + d)
    W = pointer(room)
    work = W + d * (n + 2 * d)
    # gamma of q and w.
    opened(t, x, x + (nq + 2 * n), W, work)
    whole(t, W, x + nq, out)
    for i in range(nv):
        work[nq + i] = out[i]
    for i in range(parameters):
        work[nq + nv + i] = x[nq + 2 * n + i]
    gamma = work + given
    call(int(t[SIZES + 1]), work, gamma)
    # b is zero but for b_d.
    b = gamma + rows
    biased(t, W, gamma, b)
    whole(t, W, x + (nq + n), out + nv)
    for i in range(d):
        out[nv + int(columns[i])] += b[i]
    room[0] = 0  # its memory lives to here


def seen(x, out, t):
    """Compute (q, v, inputs, parameters) -> the table's function of (q, w, inputs, parameters)."""
    nq, nv, n, d, rows, inputs, parameters, _ = sized(t)
    given = nq + nv + inputs + parameters + acts(t)[1]
    room = np.empty(d * (n + 2 * d) + given + rows * (nv + 1) + 1)
    W = pointer(room)
    work = W + d * (n + 2 * d)
    in_tree(t, x, W, work)
    call(int(t[SIZES + 1]), work, out)
    room[0] = 0  # its memory lives to here


ENTRIES = {each.__name__: each for each in (motion, closure_step, tree_rates, tree_motion, seen)}


@cache
def entry(name: str) -> int:
    """Return the address of void(const double *in, double *out, const double *table), by the name
    of one of ENTRIES; compiled once on a machine where Numba can keep it."""
    function = ENTRIES[name]
    try:
        compiled = cfunc(ENTRY, cache=True, **OPTIONS)(function)
    except RuntimeError:  # Numba found no folder that it may write to
        compiled = cfunc(ENTRY, **OPTIONS)(function)
    KEPT.append(compiled)
    assert compiled.address is not None
    return compiled.address


KEPT: list[object] = []  # code lives as long as what Numba returned for it
