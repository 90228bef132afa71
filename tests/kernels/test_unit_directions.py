"""A Jacobian by the derivative along unit vectors is the one that is written out."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import KernelError, compile_function
from linkwork.kernels.machine import this_machine

ENTRY = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


def along(columns: int, *others: int) -> tuple[ca.Function, ca.Function]:
    """Return the Jacobian of three numbers in x, and their derivative along d, of other inputs."""
    x, d = ca.SX.sym("x", columns), ca.SX.sym("d", columns)
    more = [ca.SX.sym(f"p{k}", size) for k, size in enumerate(others)]
    every = ca.vertcat(x, *more)
    f = ca.vertcat(ca.sumsqr(every), ca.sin(x[0]) * ca.sum1(ca.exp(every)), x[-1] / (2 + x[0]))
    inputs = [x, *more]
    return (
        ca.Function("jacobian", inputs, [ca.densify(ca.jacobian(f, x))]),
        ca.Function("along", [*inputs, d], [ca.densify(ca.jtimes(f, x, d))]),
    )


@pytest.mark.sample(12)
@pytest.mark.parametrize("columns", [1, 2, 7, 8, 9, 40])
@pytest.mark.parametrize("others", [(), (3,), (1, 0, 2)])
def test_columns_are_those_of_the_jacobian(columns: int, others: tuple[int, ...]):
    jacobian, tangent = along(columns, *others)
    kernel = compile_function(tangent)
    values = np.random.default_rng(columns).normal(size=columns + sum(others))
    out = np.full(3 * columns + 1, np.nan)
    ENTRY(kernel.columns_address)(values.ctypes.data, out.ctypes.data)
    parts = np.split(values, np.cumsum([columns, *others])[:-1])
    expected = np.array(jacobian(*parts)).ravel(order="F")
    np.testing.assert_allclose(out[:-1], expected, rtol=1e-13, atol=1e-14)
    assert np.isnan(out[-1])  # nothing is written beyond the last column


def test_each_vector_takes_as_many_directions_as_it_has_lanes():
    """A program is evaluated for all directions without one for single states."""
    kernel = compile_function(along(3 * this_machine().lanes)[1])
    assert kernel.columns_address and list(kernel._modules) == ["columns"]


def test_what_is_no_derivative_is_refused():
    x = ca.SX.sym("x", 2)
    for f in (
        ca.Function("two", [x], [x[0], x[1]]),
        ca.Function("empty", [x, ca.SX(0, 1)], [x]),
    ):
        with pytest.raises(KernelError, match="need one output and a last input"):
            _ = compile_function(f).columns_address
