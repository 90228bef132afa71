"""Stacks of few states, for which no code is compiled: one state after the other."""

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import compile_function, kernel
from linkwork.kernels.kernel import Kernel


@pytest.fixture(autouse=True)
def few(compiled: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "SCATTERED", 100)


def pendulum() -> Kernel:
    q, v, p = ca.SX.sym("q", 2), ca.SX.sym("v", 3), ca.SX.sym("p")
    outputs = [ca.sin(q) * v[:2] + p, ca.vertcat(ca.dot(v, v), q[0] / v[1], p)]
    return compile_function(ca.Function("pendulum", [q, v, p], outputs))


def inputs(count: int) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    return [rng.normal(size=(count, 2)), rng.normal(size=(count, 3)), np.array([0.3])]


def test_few_states_are_evaluated_by_the_code_for_one_until_there_were_many():
    f, alone = pendulum(), pendulum()
    for asked, kinds in [(60, ["one"]), (40, ["one"]), (1, ["one", "batch"])]:
        given = inputs(asked)
        results = f(*given)
        assert list(f._modules) == kinds
        for k in range(asked):
            for many, one in zip(results, alone(given[0][k], given[1][k], given[2]), strict=True):
                np.testing.assert_array_equal(many[k], one)
    large = pendulum()
    large(*inputs(101))
    assert list(large._modules) == ["batch"]


def test_results_are_of_the_stack_s_shape_and_hold_memory_of_their_own():
    f = pendulum()
    q, v, p = inputs(12)
    first, second = f(q.reshape(3, 4, 2), v.reshape(3, 4, 3), p)
    assert (first.shape, second.shape) == ((3, 4, 2), (3, 4, 3))
    assert first.flags.c_contiguous and second.flags.c_contiguous
    first, second = f(q[:4], v[0], np.broadcast_to(p, (3, 1, 1)))
    assert (first.shape, second.shape) == ((3, 4, 2), (3, 4, 3))
    np.testing.assert_array_equal(first[1, 2], f(q[2], v[0], p)[0])
    first, _ = f(q[:0], v[0], p)
    assert first.shape == (0, 2)
