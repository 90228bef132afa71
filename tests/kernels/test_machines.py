"""Code for machines of other vector widths: what is spilled lies aligned, constants are read as the
machine can, bits agree."""

import ctypes
import re

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels.compile import Code, assembly, object_code
from linkwork.kernels.emit import FUNCTIONS, Kind, module_text
from linkwork.kernels.machine import Machine, this_machine
from linkwork.kernels.program import Program, trace
from linkwork.kernels.simplify import simplify

from tests.kernels.graphs import random_function
from tests.products import sampled

HERE = this_machine()
AVX2 = Machine(HERE.triple, "haswell", "+avx,+avx2,+fma")
AVX512 = Machine(
    HERE.triple,
    "skylake-avx512",
    f"{AVX2.features},+avx512f,+avx512bw,+avx512cd,+avx512dq,+avx512vl",
)
MACHINES = {"AVX2": AVX2, "AVX-512": AVX512}
BATCH = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)

pytestmark = pytest.mark.skipif(
    not HERE.triple.startswith("x86"), reason="code for x86 is not made here"
)


@pytest.fixture(scope="module")
def large() -> Program:
    return simplify(trace(random_function(0, 5000)))


def evaluated(program: Program, machine: Machine, states: np.ndarray) -> np.ndarray:
    """Return the results of blocks of states, for as many states as any machine's lanes divide."""
    code = Code(object_code(module_text(program, machine, "batch"), machine), ("batch",))
    blocks = len(states) // machine.lanes
    x, y = (aligned(blocks, size, machine.lanes) for size in (program.n_in, len(program.results)))
    x[:] = states.reshape(blocks, machine.lanes, -1).swapaxes(1, 2)
    BATCH(code.addresses["batch"])(blocks, x.ctypes.data, y.ctypes.data)
    return y.swapaxes(1, 2).reshape(len(states), -1)


def aligned(*shape: int) -> np.ndarray:
    memory = np.empty(int(np.prod(shape)) + 8)
    start = -memory.ctypes.data % 64 // 8
    return memory[start : start + int(np.prod(shape))].reshape(shape)


@pytest.mark.long
@pytest.mark.parametrize(("name", "kind"), sampled(tuple(MACHINES), tuple(FUNCTIONS)))
def test_vectors_are_spilled_to_an_aligned_stack(large: Program, name: str, kind: Kind):
    """Whatever a machine is, the same attribute of all functions says so."""
    machine = MACHINES[name]
    listing = assembly(module_text(large, machine, kind), machine)
    register = "zmm" if machine.lanes == 8 and kind != "one" else "ymm"
    of_stack = rf"\tvmov([au])p[sd]\t(?=.*%{register}).*\(%r[sb]p[,)]"
    found = re.findall(of_stack, listing)
    assert found.count("u") == 0
    assert kind == "one" or found.count("a") > 100


@pytest.mark.parametrize("angles", [1, 4, 5, 20, 60])
def test_code_for_one_state_has_no_vectors_of_8_which_slow_down_single_numbers(angles: int):
    x = ca.SX.sym("x", angles)
    program = simplify(trace(ca.Function("f", [x], [ca.sin(x), ca.cos(x)])))
    one, batch = (assembly(module_text(program, AVX512, kind), AVX512) for kind in ("one", "batch"))
    assert "zmm" in batch
    assert "ymm" in one and "zmm" not in one


@pytest.mark.long
def test_a_constant_is_kept_once_for_all_lanes_where_instructions_broadcast_it(large: Program):
    broadcasts, sizes = [], []
    for machine in (AVX2, AVX512):
        text = module_text(large, machine, "batch")
        sizes.append(sum(map(len, re.findall(r"^@constants.*$", text, re.MULTILINE))))
        broadcasts.append(assembly(text, machine).count("{1to8}"))
    assert broadcasts[0] == 0 and broadcasts[1] > 100
    assert sizes[1] < sizes[0]


@pytest.mark.long
@pytest.mark.skipif(HERE.lanes < 4, reason="this machine cannot run code for AVX2")
def test_narrower_vectors_give_the_same_bits(large: Program):
    states = np.random.default_rng(3).normal(size=(16, large.n_in))
    results = evaluated(large, AVX2, states)
    assert np.isfinite(results).all()
    np.testing.assert_array_equal(evaluated(large, HERE, states), results)
