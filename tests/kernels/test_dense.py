"""States stored one a row, evaluated in the registers: the bits of blocks in memory."""

from __future__ import annotations

import ctypes

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import Kernel, compile_function

DENSE = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)


def dense(kernel: Kernel, arrays: list[np.ndarray]) -> list[np.ndarray]:
    """Return the outputs of whole blocks of rows, behind which nothing is written."""
    count = len(arrays[0])
    found = [np.full((count + 1, size), 7.0) for _, size in kernel.outputs]
    tables = [
        (ctypes.c_void_p * len(own))(*[x.ctypes.data for x in own]) for own in (arrays, found)
    ]
    DENSE(kernel.dense_address)(count // kernel.lanes, *tables)
    assert all((each[-1] == 7).all() for each in found)
    return [each[:-1] for each in found]


def mixed(sizes: tuple[int, ...], widths: tuple[int, ...]) -> ca.Function:
    """Return a function whose results mix inputs, turns, a call of the C library, and constants."""
    x = [ca.SX.sym(f"x{i}", size) for i, size in enumerate(sizes)]
    flat = ca.vertcat(*x)
    total, outputs = ca.sum1(flat), []
    for width in widths:
        parts = [
            ca.sin(flat[k % flat.numel()]) * total + ca.atan2(flat[-1], k + 1) for k in range(width)
        ]
        parts[0] = flat[0] if width > 1 else parts[0]
        outputs.append(ca.vertcat(*parts[:-1], ca.SX(2.5) if width > 3 else parts[-1]))
    return ca.Function("mixed", x, outputs)


@pytest.mark.parametrize(
    ("sizes", "widths"),
    [
        ((1,), (1,)),
        ((3, 2), (3, 1)),
        ((7, 3, 3), (3, 1)),
        ((9, 5), (6, 2)),
        ((4, 8, 1), (5,)),
        ((70,), (12, 9)),
    ],
)
def test_rows_in_registers_have_the_bits_of_blocks_in_memory(sizes, widths):
    """The last is cut into functions, for its many angles."""
    f = mixed(sizes, widths)
    if sizes == (70,):
        x = ca.SX.sym("x", 70)
        f = ca.Function(
            "many", [x], [ca.sin(x[:12]) + ca.mmax(x), ca.sin(x)[12:21] * ca.sum1(ca.cos(x))]
        )
    kernel = compile_function(f)
    count = 5 * kernel.lanes
    rng = np.random.default_rng(sum(sizes))
    arrays = [np.ascontiguousarray(rng.normal(size=(count, size))) for size in sizes]
    arrays[0][1, 0] = 1e9  # an angle for the C library
    for found, expected in zip(dense(kernel, arrays), kernel(*arrays), strict=True):
        assert np.array_equal(found, expected)
    assert kernel.instruction_count("dense") > 0
