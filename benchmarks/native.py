"""A kernel in native loops: in batches as the vector code takes them, and state by state as an
integrator does.

Nothing of Python is inside the loops; the buffers are aligned and small enough to stay in a core's
cache.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import casadi as ca
import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

from linkwork.kernels import Kernel, compile_function

from benchmarks.timing import Contender, empty_cache

STATES = 1024
REPEATS = 16
ALIGNMENT = 64


def _call_one(typing_context, address, x, skip_x, out, skip_out):
    """Call the C function void(const double *x, double *out) at an address, from x[skip_x] to
    out[skip_out]."""

    def generate(context, builder, signature, arguments):
        x, out = (
            context.make_array(signature.args[i])(context, builder, value=arguments[i]).data
            for i in (1, 3)
        )
        function = ir.FunctionType(ir.VoidType(), [x.type, out.type])
        places = [builder.gep(x, [arguments[2]]), builder.gep(out, [arguments[4]])]
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), places)
        return context.get_dummy_value()

    return types.void(address, x, skip_x, out, skip_out), generate


def _call_batch(typing_context, address, blocks, x, out):
    """Call the C function void(int64 blocks, const double *x, double *out) at an address."""

    def generate(context, builder, signature, arguments):
        x, out = (
            context.make_array(signature.args[i])(context, builder, value=arguments[i]).data
            for i in (2, 3)
        )
        function = ir.FunctionType(ir.VoidType(), [ir.IntType(64), x.type, out.type])
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), [arguments[1], x, out])
        return context.get_dummy_value()

    return types.void(address, blocks, x, out), generate


call_one: Callable[..., None] = intrinsic(_call_one)
call_batch: Callable[..., None] = intrinsic(_call_batch)


@njit
def evaluate_blocks(
    address: int, repeats: int, blocks: int, x: np.ndarray, out: np.ndarray
) -> None:
    """Evaluate all blocks of x into out, so many times."""
    for _ in range(repeats):
        call_batch(address, blocks, x, out)


@njit
def evaluate_independent(address: int, x: np.ndarray, out: np.ndarray) -> None:
    """Evaluate every state (count, n_in) into out (count, n_out); one may begin before the last is
    done."""
    for i in range(x.shape[0]):
        call_one(address, x, i * x.shape[1], out, i * out.shape[1])


@njit
def evaluate_chained(
    address: int, x: np.ndarray, rates: int, nothing: float, y: np.ndarray, out: np.ndarray
) -> None:
    """Evaluate states of which each needs the derivatives of the one before, as an integrator's
    stages do.

    y = (q, v, u) and out = (q', v', ...):  (q, v) <- (q, v)_i + nothing (q', v'), that is the first
    `rates` numbers; `nothing` = 0, which the compiler does not know.
    """
    for i in range(x.shape[0]):
        for j in range(rates):
            y[j] = x[i, j] + nothing * out[j]
        for j in range(rates, y.size):
            y[j] = x[i, j]
        call_one(address, y, 0, out, 0)


def in_batches(kernel: Kernel, x: np.ndarray) -> Contender:
    """Return the kernel's vector code over states x (count, n_in) on one core; count is a multiple
    of the lanes."""
    blocks = len(x) // kernel.lanes
    packed = aligned(x.reshape(blocks, kernel.lanes, -1).transpose(0, 2, 1))
    out = aligned(np.zeros((blocks, kernel.n_out, kernel.lanes)))
    return Contender(
        lambda: evaluate_blocks(kernel.batch_address, REPEATS, blocks, packed, out),
        REPEATS * len(x),
    )


def one_by_one(kernel: Kernel, x: np.ndarray) -> Contender:
    """Return the kernel's one-lane code over states that are known in advance."""
    out = np.zeros((len(x), kernel.n_out))
    return Contender(lambda: evaluate_independent(kernel.address, x, out), len(x))


def one_after_another(kernel: Kernel, x: np.ndarray, rates: int) -> Contender:
    """Return the kernel's one-lane code over states of which each waits for the one before."""
    y, out = np.zeros(kernel.n_in), np.zeros(kernel.n_out)
    return Contender(lambda: evaluate_chained(kernel.address, x, rates, 0.0, y, out), len(x))


def compiled_anew(function: ca.Function) -> tuple[Kernel, dict[str, float]]:
    """Return a function's kernel, compiled with an empty cache, and the seconds that took for its
    two codes."""
    with empty_cache():
        kernel, times = compile_function(function), [perf_counter()]
        for code in ("address", "batch_address"):
            getattr(kernel, code)
            times.append(perf_counter())
    return kernel, {"one state": times[1] - times[0], "batches": times[2] - times[1]}


def evaluations(kernel: Kernel, q: np.ndarray, states: int) -> dict[str, Contender]:
    """Return the kernel (q, v, u, no p) -> (q', v', ...) in both loops, at one configuration with
    random rates and forces."""
    nq, nv, nu, _ = (size for _, size in kernel.inputs)
    random = np.random.default_rng(3)
    x = np.hstack([np.tile(q, (states, 1)), random.normal(size=(states, nv + nu))])
    return {"batches": in_batches(kernel, x), "one by one": one_after_another(kernel, x, nq + nv)}


def aligned(values: np.ndarray) -> np.ndarray:
    """Return a flat copy that begins at a multiple of 64 bytes."""
    buffer = np.empty(values.size + ALIGNMENT // 8)
    first = -buffer.ctypes.data % ALIGNMENT // 8
    flat = buffer[first : first + values.size]
    flat[:] = values.ravel()
    return flat
