"""Long programs, a section after the other for two blocks: the bits of code in one piece, for any
number of blocks."""

from __future__ import annotations

import ctypes

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import by_sections
from linkwork.kernels.compile import Code, object_code
from linkwork.kernels.dense import source_text
from linkwork.kernels.emit import ABREAST, FUNCTIONS, Kind
from linkwork.kernels.machine import Machine, this_machine
from linkwork.kernels.program import Program, trace
from linkwork.kernels.simplify import simplify

from tests.kernels.graphs import random_function
from tests.kernels.test_dense import DENSE
from tests.kernels.test_kernel import _aligned

BLOCKS = 5
X86 = Machine("x86_64-unknown-linux-gnu", "znver3", "+avx2,+fma")
ARM = Machine("aarch64-unknown-linux-gnu", "generic", "")


@pytest.fixture
def long(monkeypatch: pytest.MonkeyPatch):
    """Every program is long."""
    monkeypatch.setattr(by_sections, "LONG", 0)
    monkeypatch.setattr(by_sections, "SHORT", 20)


def results(program: Program) -> dict[tuple[str, int], np.ndarray]:
    """Return what code of every kind gives for states, by kind and by how many blocks it is called
    with; nothing is written behind the last one."""
    machine = this_machine()
    lanes, found = machine.lanes, {}
    states = np.random.default_rng(1).normal(size=(BLOCKS * lanes, program.n_in))
    states[1] *= 1e9  # angles that are too large for the polynomials

    def code(kind: Kind) -> Code:
        return Code(object_code(source_text(program, machine, kind), machine), FUNCTIONS[kind])

    one, batch, wide, dense = map(code, FUNCTIONS)
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(one.addresses["one"])
    y = np.full((len(states) + 1, program.n_out), 7.0)
    for own, result in zip(states, y[:-1], strict=True):
        call(own.ctypes.data, result.ctypes.data)
    found["one", 1] = y
    blocks = _aligned(BLOCKS, program.n_in, lanes)
    blocks[...] = states.reshape(BLOCKS, lanes, -1).transpose(0, 2, 1)
    of_blocks = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)
    for count in range(BLOCKS):
        y = _aligned(BLOCKS, program.n_out, lanes)
        y[...] = 7.0
        of_blocks(batch.addresses["batch"])(count, blocks.ctypes.data, y.ctypes.data)
        found["batch", count] = y
    x = _aligned(program.n_in, ABREAST * lanes)
    x[...] = states[: ABREAST * lanes].T
    y = _aligned(program.n_out, ABREAST * lanes)
    call = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(wide.addresses["wide"])
    call(x.ctypes.data, y.ctypes.data)
    found["wide", 1] = y
    ends = np.cumsum([size for _, size in program.inputs])[:-1]
    given = [np.ascontiguousarray(part) for part in np.split(states, ends, axis=1)]
    rows = [np.full((len(states) + 1, size), 7.0) for _, size in program.outputs]
    tables = [(ctypes.c_void_p * len(own))(*[a.ctypes.data for a in own]) for own in (given, rows)]
    DENSE(dense.addresses["dense"])(BLOCKS, *tables)
    found["dense", BLOCKS] = np.hstack(rows)
    return found


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", range(2))
def test_sections_of_two_blocks_give_the_bits_of_one_piece(
    seed: int, request: pytest.FixtureRequest
):
    program = simplify(trace(random_function(seed, 90)))
    plain = results(program)
    request.getfixturevalue("long")
    assert len(by_sections.cut(program, X86, 1)[1].sections) > 3
    for key, found in results(program).items():
        np.testing.assert_array_equal(found, plain[key], err_msg=str(key))


def test_results_that_later_sections_read_are_written_once(long):
    x = ca.SX.sym("x", 8)
    first = ca.cumsum(x * x)
    rest = first
    for _ in range(12):
        rest = ca.vertcat(rest[1:], rest[0]) * first + x
    program = simplify(trace(ca.Function("f", [x], [first, rest])))
    cut, plan = by_sections.cut(program, X86, 1)
    home = {k: s for s, section in enumerate(plan.sections) for k in section.nodes}
    needed = {
        a for k, s in home.items() for a in cut.nodes[k].args if home.get(a, s) != s
    }  # by another section than its own
    assert needed & {*plan.places}
    assert {*plan.kept} == needed - {*plan.places}


def test_long_programs_are_cut_where_instructions_take_many_bytes():
    program = simplify(trace(random_function(0, 2500)))
    short = simplify(trace(random_function(0, 300)))
    assert by_sections.cut(program, X86, 1)[1].apart
    assert not by_sections.cut(short, X86, 1)[1].apart
    assert not by_sections.cut(program, ARM, 1)[1].apart
