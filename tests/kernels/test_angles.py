"""The three ways to the sine and the cosine of an angle, against the C library's and against each
other, bit by bit."""

import ctypes
import math
from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import elementary
from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.emit import ABREAST, Kind, module_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import trace

from tests.kernels.test_elementary import MACHINES

STATES = 16


@cache
def compiled(machine: Machine, n: int, kind: Kind) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function of angles (states, n) to their sines and cosines (states, 2 n), by a
    program for n angles."""
    x = ca.SX.sym("x", n)
    program = trace(ca.Function("f", [x], [ca.sin(x), ca.cos(x)]))
    code = Code(object_code(module_text(program, machine, kind), machine), (kind,))
    lanes = {"one": 1, "batch": machine.lanes, "wide": ABREAST * machine.lanes}[kind]
    counted = [ctypes.c_int64] if kind == "batch" else []
    function = ctypes.CFUNCTYPE(None, *counted, ctypes.c_void_p, ctypes.c_void_p)(
        code.addresses[kind]
    )

    def sines_and_cosines(angles: np.ndarray) -> np.ndarray:
        states = len(angles)
        memory = np.zeros(3 * states * n + 8)
        memory = memory[-memory.ctypes.data % 64 // 8 :][: 3 * states * n]
        inputs, outputs = memory[: states * n], memory[states * n :]
        inputs[:] = angles.reshape(-1, lanes, n).transpose(0, 2, 1).ravel()
        if kind == "batch":
            function(states // lanes, inputs.ctypes.data, outputs.ctypes.data)
        else:
            for k in range(0, states, lanes):
                function(inputs.ctypes.data + 8 * k * n, outputs.ctypes.data + 16 * k * n)
        assert code.addresses
        return outputs.reshape(-1, 2 * n, lanes).transpose(0, 2, 1).reshape(states, 2 * n)

    return sines_and_cosines


@pytest.mark.parametrize(("machine", "bound"), MACHINES)
@pytest.mark.parametrize("n", [1, 3, 5, 40])
def test_one_state_and_many_in_place_and_by_call_give_the_same_bits(
    machine: Machine, bound: float, n: int
):
    limit = elementary.LARGEST_ANGLE if machine.has_fma else elementary.LARGEST_ANGLE_WITHOUT_FMA
    odd = [
        0.0,
        -0.0,
        limit,
        -limit,
        np.nextafter(limit, np.inf),
        1e15,
        -1e300,
        np.inf,
        -np.inf,
        np.nan,
    ]
    for k, value in enumerate([1.0, *odd]):
        angles = np.random.default_rng(k).normal(scale=10, size=(STATES, n))
        angles[5, n // 2] = value
        one, batch, wide = (compiled(machine, n, kind)(angles) for kind in ("one", "batch", "wide"))
        alone = compiled(machine, 1, "batch")(angles[:, n // 2, None])
        np.testing.assert_array_equal(one, batch)
        np.testing.assert_array_equal(one, wide)
        np.testing.assert_array_equal(one[:, [n // 2, n + n // 2]], alone)
        exact = np.hstack(
            [np.vectorize(_or_nan(math.sin))(angles), np.vectorize(_or_nan(math.cos))(angles)]
        )
        np.testing.assert_array_equal(np.isnan(one), np.isnan(exact))
        assert np.nanmax(np.abs(one - exact) / np.spacing(np.abs(exact))) <= bound + 0.6


def _or_nan(function):
    return lambda x: function(x) if math.isfinite(x) else math.nan
