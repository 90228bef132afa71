"""Sections carried out one after the other on the slots they share: nothing is read before it is
there, nothing is lost."""

import ctypes

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import compile_function, sections
from linkwork.kernels.dense import source_text
from linkwork.kernels.emit import FUNCTIONS
from linkwork.kernels.fixed_results import FEWEST
from linkwork.kernels.machine import this_machine
from linkwork.kernels.program import Program, trace
from linkwork.kernels.sections import planned
from linkwork.kernels.simplify import STRETCH, simplify

from tests.kernels.graphs import random_function
from tests.kernels.test_kernel import _aligned
from tests.kernels.test_simplify import NUMPY, evaluate, random_program


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch):
    """Every program is large, and a stretch is short."""
    monkeypatch.setattr(sections, "STRETCH", 10)
    monkeypatch.setattr(sections, "LARGE", 0)


def carried_out(program: Program, inputs: np.ndarray, angles_in_vector: int) -> np.ndarray:
    """Return the results of a program's sections, each of which knows only the inputs, the
    constants and the slots."""
    plan = planned(program, angles_in_vector)
    slots, out = np.full(plan.slots, np.nan, dtype=object), np.full(len(program.results), np.nan)
    out[list(plan.fixed)] = list(plan.fixed.values())
    own: dict[int, np.float64] = {}
    read: set[int] = set()

    def value(k: int) -> np.float64:
        op, args, number = program.nodes[k]
        if op == "input":
            return inputs[int(number)]
        if op == "const":
            return np.float64(number)
        if k in own:
            return own[k]
        turned = {"sin": plan.sines, "cos": plan.cosines}
        slot = turned[op][args[0]] if op in turned else plan.kept[k]
        label, result = slots[slot]
        assert label == ((op, args[0]) if op in turned else k)
        read.add(slot)
        return result

    for section in plan.sections:
        own.clear()
        read.clear()
        written = {}
        for k in section.nodes:
            if program.nodes[k].op not in sections.FETCHED:
                own[k] = NUMPY[program.nodes[k].op](*map(value, program.nodes[k].args))
            if k in plan.kept:
                written[plan.kept[k]] = k, value(k)
            out[plan.places.get(k, [])] = value(k)
        size = section.vectors * angles_in_vector
        assert 0 <= size - len(section.angles) < angles_in_vector or not section.angles
        for place, k in enumerate(section.angles, section.first * angles_in_vector):
            written[place] = k, value(k)
            written[place + size] = ("sin", k), np.sin(value(k))
            written[place + 2 * size] = ("cos", k), np.cos(value(k))
        assert not read & written.keys()
        for slot, content in written.items():
            slots[slot] = content
    return out


def test_a_large_program_of_one_section_is_compiled(short):
    """It leaves no value to another one, and needs no memory between them."""
    x = ca.SX.sym("x", 2)
    kernel = compile_function(ca.Function("one_section", [x], [x[0] + 2 * x[1]]))
    assert kernel([3.0, 4.0])[0] == 11.0


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("angles_in_vector", [1, 4])
def test_sections_in_turn_give_the_programs_results(short, seed: int, angles_in_vector: int):
    program = simplify(random_program(seed))
    plan = planned(program, angles_in_vector)
    assert plan.apart and len(plan.sections) > 3
    assert max(len(section.nodes) for section in plan.sections) <= 10 + len(program.results)
    inputs = np.random.default_rng(seed).normal(size=4)
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(
            carried_out(program, inputs, angles_in_vector), evaluate(program, inputs)
        )


@pytest.mark.long
def test_a_large_program_is_compiled_in_pieces_and_a_small_one_is_not():
    machine = this_machine()
    for operations, pieces in ((60, 0), (5000, 10)):
        program = simplify(trace(random_function(0, operations)))
        for kind in FUNCTIONS:
            functions = source_text(program, machine, kind).split("\ndefine ")[1:]
            parts = [text for text in functions if text.startswith(f"internal void @{kind}.")]
            assert len(parts) >= pieces and bool(parts) == bool(pieces)
            lines = [text.count(" = f") + text.count(" = call contract") for text in functions]
            assert pieces == 0 or max(lines) <= 1.5 * STRETCH


@pytest.mark.parametrize("size", [8, 40])
def test_results_that_are_constants_are_in_their_places(size: int):
    """A matrix with few entries that vary, for one state, for many, and side by side."""
    x = ca.SX.sym("x", size)
    matrix = ca.SX(np.random.default_rng(0).integers(-2, 3, (size, size)) / 4)
    for k in range(size):
        matrix[k, (3 * k) % size] = x[k] * x[k - 1]
    f = ca.Function("mostly_fixed", [x], [matrix, ca.sin(x), ca.SX([np.inf, 0.5])])
    assert bool(planned(simplify(trace(f)), 1).fixed) == (size * size > FEWEST)
    kernel = compile_function(f)
    lanes = kernel.abreast * kernel.lanes
    states = np.random.default_rng(1).normal(size=(lanes, size))
    expected = np.array([np.concatenate([y.full().ravel("F") for y in f(s)]) for s in states])
    np.testing.assert_allclose(np.hstack(kernel(states[0])), expected[0], rtol=1e-15)
    np.testing.assert_allclose(np.hstack(kernel(states)), expected, rtol=1e-15)
    given, out = _aligned(kernel.n_in, lanes), _aligned(kernel.n_out, lanes)
    given[...], out[...] = states.T, np.nan
    wide = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(kernel.wide_address)
    wide(given.ctypes.data, out.ctypes.data)
    np.testing.assert_allclose(out.T, expected, rtol=1e-15)
