"""Parts that a program repeats: found, called with the right arguments, and no other results."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import compile_function, sections
from linkwork.kernels.program import trace
from linkwork.kernels.repeats import SHORTEST, repeats
from linkwork.kernels.sections import planned
from linkwork.kernels.simplify import simplify

from tests.kernels.test_kernel import _aligned
from tests.kernels.test_sections import carried_out
from tests.kernels.test_simplify import evaluate

COPIES, ODD = 80, 17


def chain(copies: int = COPIES, odd: int | None = ODD) -> ca.Function:
    """Return a chain of steps that differ by inputs, numbers and what they carry, but for an odd
    one of other operations.

    The first one has equal operands where the others have not.
    """
    x, w = ca.SX.sym("x", copies), ca.SX.sym("w", copies)
    carried, more, results = ca.SX(0.5), w[0], []
    for i in range(copies):
        s, c, number, other = ca.sin(x[i]), ca.cos(x[i]), 1 + 0.1 * i, w[(7 * i) % copies]
        a = s * carried + number * c - w[i] * other
        for k in range(5):
            b = a * more + (k + 2) * c - carried * s
            a = ca.if_else(a < b, a * 0.5, b * other) / (1 + a * a + b * b)
            b = a * s + ca.sqrt(1 + b * b) - number * w[i]
            more = a * b - more / (2 + ca.fabs(b))
        carried = (ca.fabs(a - s) if i == odd else a / (1 + a * a)) + 0.1 * carried
        results.append(carried if i % 3 else more)
    return ca.Function("chain", [x, w], [ca.vertcat(*results, x[copies - 1], s)])


def inputs(copies: int = COPIES) -> np.ndarray:
    return np.random.default_rng(4).normal(size=2 * copies)


@pytest.mark.long
def test_equal_steps_are_one_part():
    program = simplify(trace(chain()))
    plan = planned(program, 4)
    called = sum(len(part.calls) * len(part.calls[0]) for part in plan.parts)
    once = sum(len(part.calls[0]) for part in plan.parts)
    assert called - once > program.operations / 2
    assert all(len(part.calls) > 1 and len(part.calls[0]) >= SHORTEST for part in plan.parts)
    every = [k for section in plan.sections for k in section.nodes]
    assert len(every) == len({*every})
    assert sum(program.nodes[k].op not in sections.FETCHED for k in every) == sum(
        node.op not in sections.FETCHED for node in program.nodes
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize("odd", [None, 0, ODD])
def test_sections_of_a_repeating_program_give_its_results(odd):
    program = simplify(trace(chain(odd=odd)))
    for angles_in_vector in (1, 4):
        given = carried_out(program, inputs(), angles_in_vector)
        np.testing.assert_array_equal(given, evaluate(program, inputs()))


def test_calls_hold_the_arguments_of_each():
    program = simplify(trace(chain()))
    for part in planned(program, 4).parts:
        for call, positions in enumerate(part.calls):
            for i, (op, args, _) in enumerate(part.nodes[-len(positions) :]):
                node = program.nodes[positions[i]]
                assert node.op == op
                for a, k in zip(args, node.args, strict=True):
                    kind, _, value = part.nodes[a]
                    if kind == "input":
                        assert program.nodes[k] == ("input", (), part.inputs[call][int(value)])
                    elif kind == "number":
                        assert program.nodes[k].value == part.numbers[call][int(value)]
                    elif kind == "const":
                        assert program.nodes[k] == ("const", (), value)
                    elif kind == "kept":
                        assert part.values[call][int(value)] == k
                    else:
                        assert part.place(call, a) == k


@pytest.mark.long
def test_kernels_with_parts_give_the_results_of_every_step():
    f = chain()
    kernel = compile_function(f)
    lanes = kernel.abreast * kernel.lanes
    states = np.random.default_rng(0).normal(size=(lanes, 2 * COPIES))
    expected = np.array([np.array(f(*np.split(x, 2))).ravel() for x in states])
    (batch,) = kernel(*np.split(states, 2, axis=1))
    np.testing.assert_allclose(batch, expected, rtol=1e-12, atol=1e-13)
    x, y = _aligned(kernel.n_in, lanes), _aligned(kernel.n_out, lanes)
    x[...] = states.T
    wide = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(kernel.wide_address)
    wide(x.ctypes.data, y.ctypes.data)
    for i, state in enumerate(states):
        (one,) = kernel(*np.split(state, 2))
        np.testing.assert_array_equal(one, batch[i])
        np.testing.assert_array_equal(one, y[:, i])


def test_few_equal_stretches_are_no_parts():
    """Where little would be saved a program is compiled as it stands."""
    program = simplify(trace(chain(copies=2, odd=None)))
    computed = [k for k, node in enumerate(program.nodes) if node.op not in sections.FETCHED]
    assert [part for _, part in repeats(program.nodes, computed, {})] == [None]
