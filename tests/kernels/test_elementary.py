"""The inlined sine and cosine against 200-bit arithmetic, in units in the last place (ulp)."""

import ctypes

import casadi as ca
import mpmath
import numpy as np
import pytest

from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.emit import module_text
from linkwork.kernels.machine import Machine, this_machine
from linkwork.kernels.program import trace

HERE = this_machine()
MACHINES = [pytest.param(HERE, 2.0, id="this machine")]
if HERE.triple.startswith("x86_64"):
    MACHINES.append(pytest.param(Machine(HERE.triple, "x86-64", ""), 2.5, id="without FMA"))

RNG = np.random.default_rng(0)


def nearest_doubles(multiples: np.ndarray) -> np.ndarray:
    """Return the doubles nearest to whole multiples of pi/2, and their neighbours."""
    with mpmath.workprec(200):
        middle = np.array([float(mpmath.mpf(int(k)) * mpmath.pi / 2) for k in multiples])
    return np.concatenate([middle, np.nextafter(middle, 0), np.nextafter(middle, np.inf)])


POINTS = {
    "first octants": RNG.uniform(-1, 1, 3000),
    "a few turns": RNG.uniform(-30, 30, 3000),
    "up to 1e6": RNG.uniform(-1e6, 1e6, 2000),
    "every magnitude": np.exp(RNG.uniform(np.log(1e-300), np.log(1e12), 1000)),
    "near multiples of pi/2": nearest_doubles(np.r_[1:300, RNG.integers(1, 640_000, 500)]),
    "far multiples of pi/2": nearest_doubles(RNG.integers(640_000, 2**30, 300)),
}


def sine_and_cosine(machine: Machine, x: np.ndarray) -> np.ndarray:
    """Return sin x and cos x by the code for blocks on that machine, shape (2, n)."""
    angle = ca.SX.sym("x")
    program = trace(ca.Function("f", [angle], [ca.sin(angle), ca.cos(angle)]))
    code = Code(object_code(module_text(program, machine, "batch"), machine), ("batch",))
    batch = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(
        code.addresses["batch"]
    )
    blocks = -(-len(x) // machine.lanes)
    memory = np.zeros(3 * blocks * machine.lanes + 16)
    memory = memory[-memory.ctypes.data % 64 // 8 :]
    inputs, outputs = (
        memory[: blocks * machine.lanes],
        memory[-(-blocks * machine.lanes // 8) * 8 :],
    )
    inputs[: len(x)] = x
    batch(blocks, inputs.ctypes.data, outputs.ctypes.data)
    return (
        outputs[: 2 * inputs.size]
        .reshape(blocks, 2, -1)
        .transpose(1, 0, 2)
        .reshape(2, -1)[:, : len(x)]
    )


@pytest.mark.sample(3)
@pytest.mark.parametrize(("machine", "bound"), MACHINES)
@pytest.mark.parametrize("points", POINTS)
def test_errors_in_units_in_the_last_place(machine: Machine, bound: float, points: str):
    x = POINTS[points]
    found = sine_and_cosine(machine, x)
    with mpmath.workprec(200):
        for function, values in zip((mpmath.sin, mpmath.cos), found, strict=True):
            exact = [function(mpmath.mpf(float(angle))) for angle in x]
            ulp = np.spacing(np.abs(np.array(exact, dtype=float)))
            errors = np.array(
                [float(mpmath.mpf(float(v)) - e) for v, e in zip(values, exact, strict=True)]
            )
            assert np.max(np.abs(errors) / ulp) <= bound


@pytest.mark.parametrize(("machine", "bound"), MACHINES)
def test_zero_and_what_is_not_finite(machine: Machine, bound: float):
    sine, cosine = sine_and_cosine(machine, np.array([0.0, -0.0, np.inf, -np.inf, np.nan]))
    np.testing.assert_array_equal(sine, [0, 0, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(cosine, [1, 1, np.nan, np.nan, np.nan])
