"""Jacobians for one state, row by row in the lanes of vectors, beside those of CasADi."""

from __future__ import annotations

import ctypes
import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import compile_function, emit, sections
from linkwork.kernels.compile import Code, assembly, object_code
from linkwork.kernels.machine import this_machine
from linkwork.kernels.program import trace
from linkwork.kernels.sections import planned
from linkwork.kernels.simplify import simplify

ONE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


def functions(rows: int, turns: int = 1) -> tuple[ca.Function, ca.Function]:
    """Return the Jacobian of a value (rows) in (x, y), and the gradient of weights times it."""
    x, y, w = ca.SX.sym("x", 3), ca.SX.sym("y", 2), ca.SX.sym("w", rows)
    found = x
    for k in range(turns):
        found = ca.vertcat(
            ca.sin(found[1]) * y[0] + k, ca.sqrt(1 + found[2] ** 2), ca.atan2(found[0], 2 + y[1])
        )
    value = ca.vertcat(
        *(ca.cos(found[i % 3] * (1 + i)) * y[1] if i != 1 else 2 * x[0] for i in range(rows))
    )
    given, plain = [x, y], {"value": value, "pivot": x[0] * y[1]}
    by = [ca.jacobian(value, part) for part in given]
    back = [ca.jtimes(value, part, w, True) for part in given]
    names = ["value", "by_x", "by_y", "pivot"]
    jacobian = ca.Function(
        "jacobian", given, [plain["value"], *by, plain["pivot"]], ["x", "y"], names
    )
    gradient = ca.Function(
        "gradient", [x, w, y], [plain["value"], *back, plain["pivot"]], ["x", "weights", "y"], names
    )
    return jacobian, gradient


@pytest.mark.sample(4)
@pytest.mark.parametrize("rows, turns", [(1, 1), (2, 1), (3, 2), (4, 1), (5, 1), (9, 3), (17, 1)])
def test_rows_are_those_of_the_jacobian(rows, turns):
    jacobian, gradient = functions(rows, turns)
    kernel, plain = compile_function(jacobian, lambda: gradient), compile_function(jacobian)
    x = np.random.default_rng(rows).normal(size=(20, 5))
    parts = x[:, :3], x[:, 3:]
    for found, expected in zip(kernel(*parts), plain(*parts), strict=True):
        assert np.array_equal(found, expected)  # many states take the Jacobian itself
    for own in x:
        found, expected = (each.flat(own[:3], own[3:]) for each in (kernel, plain))
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)
    again = pickle.loads(pickle.dumps(kernel))
    assert np.array_equal(again.flat(*x[0][:3][None], x[0][3:]), kernel.flat(x[0][:3], x[0][3:]))


def test_large_programs_are_cut(monkeypatch):
    jacobian, gradient = functions(3, turns=37)
    monkeypatch.setattr(sections, "LARGE", 100)
    assert planned(simplify(trace(gradient)), 1, recurring=False).apart
    kernel, plain = compile_function(jacobian, lambda: gradient), compile_function(jacobian)
    x = np.random.default_rng(1).normal(size=5)
    found, expected = (each.flat(x[:3], x[3:]) for each in (kernel, plain))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("widest", [2, 4, 8])
def test_vectors_of_any_length_are_written(widest):
    jacobian, gradient = functions(5)
    machine = replace(this_machine(), widest=widest)
    text = emit.module_text(simplify(trace(gradient)), machine, "by_rows")
    assert assembly(text, machine)
    if widest > this_machine().lanes:
        return
    code, found = Code(object_code(text, machine), ("by_rows",)), np.empty(31)
    x = np.random.default_rng(2).normal(size=5)
    ONE(code.addresses["by_rows"])(x.ctypes.data, found.ctypes.data)
    expected = compile_function(jacobian).flat(x)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


def test_the_code_that_runs_is_what_can_be_read():
    jacobian, gradient = functions(5)
    kernel, plain = compile_function(jacobian, lambda: gradient), compile_function(jacobian)
    listed = kernel.assembly("one")
    assert all(f"{name}:" in listed for name in ("single", "batch", "by_rows"))
    assert kernel.instruction_count("one") != plain.instruction_count("one")
    assert kernel.assembly("batch") == plain.assembly("batch")
