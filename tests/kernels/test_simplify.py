"""Fewer operations, the same values: programs before and after, evaluated by NumPy."""

from collections import Counter

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels.program import Operation, Program, trace
from linkwork.kernels.simplify import simplify

NUMPY = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "fabs": np.abs,
    "lt": lambda a, b: np.float64(a < b),
    "not": lambda a: np.float64(a == 0),
    "if_else_zero": lambda c, a: a if c != 0 else np.float64(0),
    "select": lambda c, a, b: a if c != 0 else b,
}
NUMBERS = (0.0, -0.0, 1.0, -1.0, 2.0, -0.5, 3.0, 0.1)
OPERATIONS = (
    "add",
    "sub",
    "mul",
    "div",
    "neg",
    "sqrt",
    "sin",
    "cos",
    "tan",
    "fabs",
    "lt",
    "if_else_zero",
)

x, y, z, d = (ca.SX.sym(name) for name in "xyzd")


def operations(*results: ca.SX) -> Counter:
    """Return the operations left of a function of x, y, z, d."""
    program = simplify(trace(ca.Function("f", [x, y, z, d], list(results))))
    return Counter(node.op for node in program.nodes if node.op not in ("input", "const"))


def evaluate(program: Program, inputs: np.ndarray) -> np.ndarray:
    values: list[np.float64] = []
    with np.errstate(all="ignore"):
        for node in program.nodes:
            if node.op == "input":
                values.append(inputs[int(node.value)])
            elif node.op == "const":
                values.append(np.float64(node.value))
            else:
                values.append(NUMPY[node.op](*(values[a] for a in node.args)))
    return np.array([values[k] for k in program.results])


@pytest.mark.parametrize(
    ("results", "expected"),
    [
        ([-(x * y) + z], {"mul": 1, "sub": 1}),
        ([-x * -y], {"mul": 1}),
        ([-x - y, x + y], {"add": 1, "neg": 1}),
        ([-(x - y)], {"sub": 1}),
        ([-x * 3], {"mul": 1}),
        ([(x - y) * z, (y - x) * d], {"sub": 1, "mul": 2, "neg": 1}),
        ([ca.sin(-x) + ca.cos(-x)], {"sin": 1, "cos": 1, "sub": 1}),
        ([ca.sin(x - y) * z, ca.sin(y - x) + z], {"sub": 2, "sin": 1, "mul": 1}),
        ([x * y + z, y * x - z], {"mul": 1, "add": 1, "sub": 1}),
        ([2 * (3 * x), x / 4], {"mul": 2}),
        ([x / 3], {"div": 1}),
        ([x / d, y / d, -z / d], {"div": 1, "mul": 3, "neg": 1}),
        ([x / d], {"div": 1}),
        ([ca.tan(x), ca.sin(x)], {"sin": 1, "cos": 1, "div": 1}),
        ([ca.if_else(x < y, x, z)], {"lt": 1, "select": 1}),
        ([ca.SX(3), x], {}),
    ],
)
def test_what_is_left(results: list[ca.SX], expected: dict[str, int]):
    assert dict(operations(*results)) == expected


def test_nothing_is_folded_that_may_not_be_finite():
    nodes = (
        Operation("input"),
        Operation("const", (), 0.0),
        Operation("mul", (0, 1)),
        Operation("sub", (0, 0)),
        Operation("div", (1, 1)),
    )
    program = simplify(Program("f", (("x", 1),), (("y", 3),), nodes, (2, 3, 4)))
    assert np.isnan(evaluate(program, np.array([np.inf]))).all()


def test_constants_are_folded_as_ieee_arithmetic_does():
    a, b, root = ca.SX(0.1), ca.SX(3), ca.sqrt(ca.SX(2))
    program = simplify(trace(ca.Function("f", [], [a + 0.2, b * 0.1, a / b, root])))
    assert program.operations == 0
    np.testing.assert_array_equal(
        evaluate(program, np.zeros(0)), [0.1 + 0.2, 3 * 0.1, 0.1 / 3, 2**0.5]
    )


def test_a_small_product_of_constants_is_not_folded():
    nodes = (
        Operation("input"),
        Operation("const", (), 1e-200),
        Operation("mul", (0, 1)),
        Operation("mul", (1, 2)),
    )
    program = simplify(Program("f", (("x", 1),), (("y", 1),), nodes, (3,)))
    assert evaluate(program, np.array([1e200]))[0] == 1e-200


def random_program(seed: int) -> Program:
    rng = np.random.default_rng(seed)
    nodes = [Operation("input", (), k) for k in range(4)] + [
        Operation("const", (), value) for value in NUMBERS
    ]
    while len(nodes) < 80:
        op = OPERATIONS[rng.integers(len(OPERATIONS))]
        arity = 1 if op in ("neg", "sqrt", "sin", "cos", "tan", "fabs") else 2
        nodes.append(
            Operation(
                op, tuple(int(k) for k in rng.integers(max(0, len(nodes) - 25), len(nodes), arity))
            )
        )
        if op == "if_else_zero":
            condition = nodes[-1].args[0]
            nodes += [
                Operation("not", (condition,)),
                Operation("if_else_zero", (len(nodes), int(rng.integers(12)))),
            ]
            nodes.append(Operation("add", (len(nodes) - 3, len(nodes) - 1)))
    results = tuple(range(len(nodes) - 30, len(nodes)))
    return Program("f", (("x", 4),), (("y", 30),), tuple(nodes), results)


@pytest.mark.parametrize("seed", range(40))
def test_random_programs_keep_their_values(seed: int):
    program = random_program(seed)
    simple = simplify(program)
    for inputs in np.random.default_rng(seed).normal(size=(5, 4)):
        before, after = evaluate(program, inputs), evaluate(simple, inputs)
        usual = np.abs(before) < 1e6  # where rounding has not been blown up
        np.testing.assert_allclose(after[usual], before[usual], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_operands_come_first_and_each_value_once(seed: int):
    simple = simplify(random_program(seed))
    assert all(a < k for k, node in enumerate(simple.nodes) for a in node.args)
    assert len({(node.op, node.args, str(node.value)) for node in simple.nodes}) == len(
        simple.nodes
    )
    used = set(simple.results).union(*(node.args for node in simple.nodes))
    assert used == set(range(len(simple.nodes)))
    assert simplify(simple).operations <= simple.operations
