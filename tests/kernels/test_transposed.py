"""Rows of states and vectors of them, moved to and fro by machines of all widths."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import compile_function, transposed
from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine, this_machine

HERE = this_machine()
SSE = Machine(HERE.triple, HERE.cpu, HERE.features.replace("+avx", "-avx"))
AVX2 = Machine(HERE.triple, HERE.cpu, HERE.features.replace("+avx512", "-avx512"))
MACHINES = {machine.lanes: machine for machine in (SSE, AVX2, HERE)}


@pytest.mark.sample(50)
@pytest.mark.parametrize("lanes", sorted(MACHINES))
@pytest.mark.parametrize("n", [*range(1, 18), 23, 40])
def test_rows_become_columns_and_rows_again(lanes, n):
    """Nothing beyond the rows is written, nor beyond the last one read."""
    machine, parts = MACHINES[lanes], []
    for name in ("gather", "scatter"):
        lines = Lines(lanes)
        getattr(transposed, name)(lines, "%a", n, "%b")
        lines.do("ret void")
        parts.append(
            function_text(f"void @{name}(ptr %a, ptr %b) {machine.attributes}", lines.text)
        )
    code = Code(object_code("\n\n".join(parts), machine), ("gather", "scatter"))
    rows = np.arange(1.0, lanes * n + 1).reshape(lanes, n)
    room = np.zeros(n * lanes + 8)
    block = room[-room.ctypes.data % 64 // 8 :][: n * lanes]
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    call(code.addresses["gather"])(rows.ctypes.data, block.ctypes.data)
    np.testing.assert_array_equal(block.reshape(n, lanes), rows.T)
    back = np.full(lanes * n + 1, -1.0)
    call(code.addresses["scatter"])(block.ctypes.data, back.ctypes.data)
    np.testing.assert_array_equal(back[:-1].reshape(lanes, n), rows)
    assert back[-1] == -1


@pytest.mark.parametrize("read", [[], [0], [3, 17], [21, 22]])
def test_what_is_not_read_is_not_moved(read):
    """Results of stacks are those of single states, bit for bit, whatever of the rows they read."""
    x, y = ca.SX.sym("x", 23), ca.SX.sym("y", 2)
    value = ca.sum1(ca.vertcat(0, *[ca.sin(x[k]) * y[1] for k in read]))
    kernel = compile_function(ca.Function("few", [x, y], [value]))
    rows, factors = np.random.default_rng(0).normal(size=(2, 11, 23))
    (found,) = kernel(rows, factors[:, :2])
    one_by_one = [kernel(row, factor)[0] for row, factor in zip(rows, factors[:, :2], strict=True)]
    np.testing.assert_array_equal(found, one_by_one)


@pytest.mark.parametrize("states", [1, HERE.lanes, 3 * HERE.lanes, 3 * HERE.lanes + 1])
@pytest.mark.parametrize("shared", [(), (1,), (0, 2), (0, 1, 2)])
def test_rows_that_all_states_share_are_those_of_each(states, shared):
    """Results of stacks are those of single states, bit for bit, whichever inputs are one row."""
    sizes = 5, 1, 2
    x, y, z = inputs = [ca.SX.sym(name, size) for name, size in zip("xyz", sizes, strict=True)]
    value = ca.vertcat(ca.sin(x[0]) * y + x[4] * z[1], x[2] - z[0])
    kernel = compile_function(ca.Function("shared", inputs, [value]))
    assert kernel.rows_address
    random = np.random.default_rng(0)
    given = [random.normal(size=(states, size)) for size in sizes]
    given = [rows[0] if k in shared else rows for k, rows in enumerate(given)]
    rows = [np.broadcast_to(part, (states, part.shape[-1])) for part in given]
    (found,) = kernel(*given)
    one_by_one = [kernel(*own)[0] for own in zip(*rows, strict=True)]
    np.testing.assert_array_equal(np.broadcast_to(found, (states, 2)), one_by_one)
