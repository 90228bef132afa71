"""Programs that are interpreted until compiling them pays: to the last bit what code of theirs
gives."""

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import Kernel, compile_function, kernel
from linkwork.kernels.fused import fused
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Operation, Program
from linkwork.kernels.tape import CODES

from tests.kernels.graphs import BINARY, UNARY, random_function
from tests.kernels.test_kernel import SPECIAL

X86 = Machine("x86_64-unknown-linux-gnu", "x86-64", "+avx2,+fma")


TOLD = Kernel._told


@pytest.fixture(autouse=True)
def long(compiled, monkeypatch):
    monkeypatch.setattr(kernel, "LONG", 0)
    monkeypatch.setattr(Kernel, "_told", TOLD)


def interpreted(f: ca.Function) -> Kernel:
    """Return the kernel of a function, which has a tape and no code."""
    found = compile_function(f, patient=lambda: True)
    assert found.early_address and found._tapes and not found._modules
    return found


def assert_bits(f: ca.Function, points: np.ndarray) -> None:
    """Both ways to evaluate f give the same bits at points (K, n_in), NaN where the other does."""
    early = interpreted(f)
    values = np.array([early.flat(x) for x in points])
    compiled = compile_function(f)
    expected = np.array([compiled.flat(x) for x in points])
    np.testing.assert_array_equal(np.isnan(values), np.isnan(expected))
    numbers = ~np.isnan(expected)
    np.testing.assert_array_equal(values.view(np.int64)[numbers], expected.view(np.int64)[numbers])
    assert early._tapes[0].evaluations == len(points)


def test_every_operation_is_that_of_the_code():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    values = [make(x) for make in UNARY.values()] + [make(x, y) for make in BINARY.values()]
    f = ca.Function("every", [x, y], [ca.vertcat(*values, 3.0, x)])
    special = np.array([(a, b) for a in SPECIAL for b in SPECIAL])
    random = np.random.default_rng(2).normal(scale=3, size=(50, 2))
    far = np.array([(angle, 1.0) for angle in (1e9, -2e9, 1e15, 1e300)])
    assert_bits(f, np.vstack([special, random, far]))


@pytest.mark.parametrize("seed", range(6))
def test_random_graphs_give_the_same_bits(seed: int):
    f = random_function(seed, operations=250)
    assert_bits(f, np.random.default_rng(seed).normal(size=(20, 12)))


def test_products_are_fused_with_the_only_sum_that_needs_them():
    a, b, c = (Operation("input", (), k) for k in range(3))
    product, other = Operation("mul", (0, 1)), Operation("mul", (1, 2))
    nodes = (
        *(a, b, c, product, other),
        *(Operation("add", (2, 3)), Operation("sub", (4, 5)), Operation("mul", (0, 2))),
        *(Operation("sub", (0, 7)), Operation("add", (7, 8))),
    )
    program = Program("f", (("x", 3),), (("y", 2),), nodes, (6, 9))
    found = fused(program)
    assert [node.op for node in found.nodes[3:]] == ["fma", "fms", "mul", "sub", "add"]
    assert found.nodes[3] == Operation("fma", (0, 1, 2))
    assert found.nodes[4] == Operation("fms", (1, 2, 3))
    assert found.results == (4, 7)
    assert fused(program, has_fma=False) is program


def test_code_takes_over_at_the_same_address_and_is_found_by_the_next_process():
    f = random_function(99)
    early, x = interpreted(f), np.arange(12.0)
    address, before = early.early_address, early.flat(x)
    for count in (3, 1):
        early.settle(count)
        assert bool(early._modules) == (count == 1)
    assert early.early_address == address and np.array_equal(early.flat(x), before)
    assert early._tapes[0].evaluations == 1
    again = compile_function(f, patient=lambda: True)
    assert again.early_address == again.address and again.from_cache and not again._tapes


def test_calls_from_python_are_interpreted_until_there_is_code(monkeypatch):
    monkeypatch.setattr(kernel, "WORTH", 4)
    f = random_function(96)
    asked, x = compile_function(f), np.arange(12.0).reshape(3, 4)
    bound, before = asked.given(x[2]), np.hstack(asked(*x))
    for count in range(1, 5):
        assert bool(asked._modules) == (count == 4)
        assert asked._tapes[0].evaluations == count
        np.testing.assert_array_equal(np.hstack(asked(*x)), before)
    np.testing.assert_array_equal(np.hstack(bound(*x[:2])), before)
    found = compile_function(f)
    np.testing.assert_array_equal(np.hstack(found(*x)), before)
    assert found.from_cache and not found._tapes


def test_calls_from_python_use_code_that_a_loop_had_compiled():
    f, x = compile_function(random_function(95)), np.arange(12.0).reshape(3, 4)
    before = np.hstack(f(*x))
    assert f._tapes and not f._modules
    assert f.early_address == f.address
    for _ in range(2):
        np.testing.assert_array_equal(np.hstack(f(*x)), before)
        assert f._tapes[0].evaluations == 1


def test_a_tape_is_kept_on_disk(monkeypatch):
    f, x = random_function(98), np.arange(12.0)
    before = interpreted(f).flat(x)
    monkeypatch.setattr(Kernel, "_program", property(lambda _: pytest.fail("told anew")))
    np.testing.assert_array_equal(interpreted(f).flat(x), before)


def test_only_long_functions_of_patient_callers_are_interpreted(monkeypatch):
    f = random_function(97)
    hasty = compile_function(f, patient=lambda: False)
    assert hasty.early_address == hasty.address and not hasty._tapes
    monkeypatch.setattr(kernel, "LONG", f.n_instructions() + 1)
    found = compile_function(f, patient=lambda: pytest.fail("asked"))
    assert found.early_address == found.address and not found._tapes


def test_a_tape_knows_every_operation():
    """All that a program may hold but inputs and constants."""
    assert {"fma", "fms", "fnma", "select", "if_else_zero"} <= CODES.keys()
    assert len(set(CODES.values())) == len(CODES)


def test_angles_that_are_far_change_no_bit_of_those_that_are_near():
    x = ca.SX.sym("x", 12)
    f = ca.Function("far", [x], [ca.sin(x), ca.cos(x[:7])])
    points = np.random.default_rng(4).normal(scale=2, size=(40, 12))
    points[::2, 5], points[::3, 11] = 1e9, -3e8
    assert_bits(f, points)
