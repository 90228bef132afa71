"""Parts of the integrators' loop, compiled to machine code; kernels are called by their addresses.

The state y = (q, v, z) has n components, of which the first nq are q. The kernels are C functions
void(const double *in, double *out):

    motion     in = (y, u, p)       out = (y', pivot)
    closure    in = (q, p)          out = (q after one Newton step on phi(q) = 0, largest |phi(q)| before it)
    jacobian   in = (y, u, p)       out = (df/dy by columns, n n;  df/du by columns, n nu)
    events     in = (y, u, p)       out = g, one number for each event
    control    in = (y, u, p)       out = the held inputs, the last columns of u

Names: `knots`, `coefficients`, `breaks` as in `signals`; `x` = (y, u, p), the input of most kernels; `z` = (q, p), the
closure kernel's; `k`, a row y' for each stage. The rows of `k` and all states but the caller's are padded with zeros to
whole vectors of LANES numbers. Arrays are passed one by one and whole, for Numba would count references to tuples of
them and to slices at every step.
"""

import math
from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.status import Status

OK = FINISHED = int(Status.FINISHED)
SINGULAR = int(Status.SINGULAR)
CLOSURE_LOST = int(Status.CLOSURE_LOST)
NON_FINITE = int(Status.NON_FINITE)

LANES = 4
NEWTON_CALLS = 8
RESERVE = 100.0  # a Newton step d leaves a residual of about d^2; below tolerance / RESERVE it need not be measured


def _call(typing_context, address, x, out, offset):
    """Call the C function void(const double *x, double *out) at an address, its output from out[offset] on."""

    def generate(context, builder, signature, arguments):
        x, out = (_data(context, builder, signature, arguments, i) for i in (1, 2))
        kernel = ir.FunctionType(ir.VoidType(), [x.type, out.type])
        target = builder.gep(out, [arguments[3]])
        builder.call(builder.inttoptr(arguments[0], kernel.as_pointer()), [x, target])
        return context.get_dummy_value()

    return types.void(address, x, out, offset), generate


def _combine(typing_context, weights, i, count, h, y, k, out):
    """Compute out = y + h sum_(j < count) weights_ij k_j by vectors of LANES numbers; y, k and out are padded."""

    def generate(context, builder, signature, arguments):
        w, y, k, out = (_data(context, builder, signature, arguments, a) for a in (0, 4, 5, 6))
        row = _columns(context, builder, signature, arguments, 0)
        width = _columns(context, builder, signature, arguments, 5)
        _, i, count, h, *_ = arguments
        vector, zero = ir.VectorType(y.type.pointee, LANES), ir.Constant(count.type, 0)
        weight = builder.gep(w, [builder.mul(i, row)])

        def place(pointer, index):
            return builder.bitcast(builder.gep(pointer, [index]), vector.as_pointer())

        def spread(number):
            single = builder.insert_element(ir.Constant(vector, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
            return builder.shuffle_vector(
                single, single, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
            )

        total = cgutils.alloca_once(builder, vector)
        all_h = spread(h)
        with cgutils.for_range_slice(builder, zero, width, ir.Constant(count.type, LANES)) as (m, _):
            builder.store(ir.Constant(vector, [0.0] * LANES), total)
            with cgutils.for_range(builder, count) as loop:
                slopes = builder.load(place(k, builder.add(builder.mul(loop.index, width), m)), align=8)
                product = builder.fmul(
                    spread(builder.load(builder.gep(weight, [loop.index]))), slopes, flags=["contract"]
                )
                builder.store(builder.fadd(builder.load(total), product, flags=["contract"]), total)
            change = builder.fmul(all_h, builder.load(total), flags=["contract"])
            state = builder.fadd(builder.load(place(y, m), align=8), change, flags=["contract"])
            builder.store(state, place(out, m), align=8)
        return context.get_dummy_value()

    return types.void(weights, i, count, h, y, k, out), generate


def _data(context, builder, signature, arguments, i):
    return context.make_array(signature.args[i])(context, builder, value=arguments[i]).data


def _columns(context, builder, signature, arguments, i):
    array = context.make_array(signature.args[i])(context, builder, value=arguments[i])
    return cgutils.unpack_tuple(builder, array.shape)[-1]


call: Callable[..., None] = intrinsic(_call)
combine: Callable[..., None] = intrinsic(_combine)


@njit(forceinline=True, **OPTIONS)
def padded(count):
    """Return the length of rows that hold `count` numbers in whole vectors."""
    return (count + LANES - 1) // LANES * LANES


@njit(forceinline=True, **OPTIONS)
def copy(source, target, count):
    """Copy the first `count` numbers."""
    for m in range(count):
        target[m] = source[m]


@njit(forceinline=True, **OPTIONS)
def force(knots, c, t, from_left, piece, out, offset):
    """Evaluate the signal at t into out[offset:], and return its piece; `piece` is where to start looking."""
    last = c.shape[0] - 1
    while piece < last and (t > knots[piece + 1] or (t == knots[piece + 1] and not from_left)):
        piece += 1
    while piece > 0 and (t < knots[piece] or (t == knots[piece] and from_left)):
        piece -= 1
    s = t - knots[piece]
    for i in range(c.shape[2]):
        out[offset + i] = c[piece, 0, i] + s * (c[piece, 1, i] + s * (c[piece, 2, i] + s * c[piece, 3, i]))
    return piece


@njit(forceinline=True, **OPTIONS)
def evaluate(motion, x, k, i, n, pivot_bound):
    """Evaluate k_i = y' at x; return what the pivot tells, OK, SINGULAR or NON_FINITE, and the pivot."""
    call(motion, x, k, i * k.shape[1])
    pivot = k[i, n]
    k[i, n] = 0.0
    ailment = OK if pivot >= pivot_bound else NON_FINITE if math.isnan(pivot) else SINGULAR
    return ailment, pivot


@njit(forceinline=True, **OPTIONS)
def first_fault(k, rows, n):
    """Return the first component of y' that is not finite in the first rows of k, or n, the pivot's place."""
    for i in range(rows):
        for m in range(n):
            if not math.isfinite(k[i, m]):
                return m
    return n


@njit(**OPTIONS)
def project(closure, state, z, z_next, tolerance, measured):
    """Project q, the head of the state, onto phi(q) = 0 by Newton's method in z; return the residual and the calls made.

    The state is written only when |phi(q)| <= tolerance is reached; z is left with what was added to q. Where the residual
    need not be `measured`, a step d with RESERVE d^2 <= tolerance is the last, and its residual is returned as 0 (if the
    residual before it is as small as it: a step that leads nowhere is none).
    """
    nq = z_next.size - 1
    residual = math.inf
    copy(state, z, nq)
    for count in range(1, NEWTON_CALLS + 1):
        call(closure, z, z_next, 0)
        residual = z_next[nq]
        if residual <= tolerance:
            for m in range(nq):
                state[m], z[m] = z[m], z[m] - state[m]
            return residual, count
        longest = residual
        for m in range(nq):
            longest = max(longest, abs(z_next[m] - z[m]))
        copy(z_next, z, nq)
        if not measured and RESERVE * longest * longest <= tolerance:
            for m in range(nq):
                state[m], z[m] = z[m], z[m] - state[m]
            return 0.0, count
    return residual, NEWTON_CALLS


@njit(forceinline=True, **OPTIONS)
def error_norm(defect, h, moved, closed, y, new, tolerance):
    """Return the root mean square of (|h defect| + |moved|) / (atol + rtol |y|), with |moved| that of the projection."""
    total, n = 0.0, tolerance.shape[1]
    for m in range(n):
        error = abs(h * defect[m]) + (abs(moved[m]) if m < closed else 0.0)
        total += (error / (tolerance[1, m] + tolerance[0, m] * max(abs(y[m]), abs(new[m])))) ** 2
    return math.sqrt(total / n)


@njit(**OPTIONS)
def scaled(values, i, y, tolerance):
    """Return the root mean square of values_i / (atol + rtol |y|)."""
    total, n = 0.0, tolerance.shape[1]
    for m in range(n):
        total += (values[i, m] / (tolerance[1, m] + tolerance[0, m] * abs(y[m]))) ** 2
    return math.sqrt(total / n)


@njit(**OPTIONS)
def blend(dense, theta, weights):
    """weights_i = b_i(theta) = sum_m P_im theta^(m+1), by Horner's rule."""
    for i in range(dense.shape[0]):
        weight = 0.0
        for m in range(dense.shape[1] - 1, -1, -1):
            weight = theta * (weight + dense[i, m])
        weights[0, i] = weight


@njit(**OPTIONS)
def resized(rows, size):
    """Return the rows in a table of another length."""
    table = np.empty((size, rows.shape[1]))
    for i in range(min(size, rows.shape[0])):
        for m in range(rows.shape[1]):
            table[i, m] = rows[i, m]
    return table
