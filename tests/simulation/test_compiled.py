"""The integrator is compiled once per machine, says so, and is not even loaded before it is
needed."""

import ast
import ctypes
import importlib
import importlib.util
import sys
from pathlib import Path
from struct import unpack_from
from typing import NamedTuple

import numpy as np
import pytest
from numba import types
from numba.core.registry import cpu_target
from simulation_problems import SmallKernel, pendulum, van_der_pol, van_der_pol_jacobian

from linkwork import simulation
from linkwork.simulation import (
    DORMAND_PRINCE,
    RK4,
    RODAS,
    Condition,
    Events,
    Sampled,
    bends,
    compiled,
    integrate,
    lanes,
    native,
    native_rosenbrock,
)
from linkwork.simulation.compiled import compiled_once, fingerprint
from linkwork.simulation.structures import Structure, at

from tests.processes import finished

MODULE = """
from numba import types
from linkwork.simulation.compiled import compiled_once

@compiled_once("the doubling", (types.float64,))
def double(x):
    return 2 * x
"""


def load(path):
    spec = importlib.util.spec_from_file_location("doubling", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_compilation_is_announced_once_and_cached(tmp_path, capfd):
    path = tmp_path / "doubling.py"
    path.write_text(MODULE)
    assert load(path).double(4.0) == 8.0
    announced = capfd.readouterr().err
    assert announced.startswith("linkwork: compiling the doubling for this machine, once ...")
    assert announced.endswith(" s\n") and announced.count("\n") == 1
    assert load(path).double(5.0) == 10.0
    assert capfd.readouterr().err == ""


def test_arrays_that_may_be_written_are_no_second_signature(tmp_path):
    path = tmp_path / "doubling.py"
    path.write_text(
        MODULE.replace("(types.float64,)", '(types.Array(types.float64, 1, "C", readonly=True),)')
    )
    double = load(path).double
    assert double(np.ones(3)).tolist() == [2.0, 2.0, 2.0]
    assert len(double.signatures) == 1


def test_kinds_of_machines_that_share_a_cache_folder_never_touch_each_other_s_files(
    tmp_path, monkeypatch, capfd
):
    path = tmp_path / "doubling.py"
    path.write_text(MODULE)
    load(path)
    own = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*.nb?")}
    of = type(cpu_target.target_context.codegen())
    with monkeypatch.context() as patch:
        patch.setattr(
            of,
            "magic_tuple",
            lambda self: (self._llvm_module.triple, "another processor", "+fewer"),
        )
        assert load(path).double(4.0) == 8.0
    assert capfd.readouterr().err.count("compiling the doubling") == 2
    assert own and own == {file: file.stat().st_mtime_ns for file in own}
    assert len(list(tmp_path.rglob("*.nb?"))) == 2 * len(own)
    assert load(path).double(4.0) == 8.0
    assert capfd.readouterr().err == ""


def test_works_with_a_warning_where_nothing_can_be_cached():
    names = {"compiled_once": compiled_once, "types": types}
    with pytest.warns(UserWarning, match="the doubling is compiled again by every process"):
        exec(
            MODULE.replace("from", "# from"), names
        )  # a function without a file has no cache folder
    assert names["double"](4.0) == 8.0


def test_works_with_a_warning_where_the_cache_folder_fails(tmp_path, monkeypatch):
    path = tmp_path / "doubling.py"
    path.write_text(MODULE)

    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", fail)
    with pytest.warns(UserWarning, match="NUMBA_CACHE_DIR"):
        assert load(path).double(4.0) == 8.0


def test_importing_the_package_loads_nothing_heavy():
    script = (
        "import sys, linkwork.simulation; print([m for m in ('numba', 'scipy', 'xarray') if m "
        "in sys.modules])"
    )
    assert finished("-c", script).stdout == "[]\n"


def test_modules_may_be_imported_in_any_order(monkeypatch):
    from linkwork.simulation.lanes import integrate as loop

    found = []
    for sign in (1, -1):
        modules = sorted({each.__module__ for each in compiled.TAUGHT})[::sign]
        taught = [each for name in modules for each in compiled.TAUGHT if each.__module__ == name]
        monkeypatch.setattr(compiled, "TAUGHT", taught)
        found.append(([each.__module__ for each in taught], fingerprint(loop.py_func)))
    assert found[0][0] != found[1][0] and found[0][1] == found[1][1]


def test_code_is_compiled_anew_where_a_structure_that_it_reads_has_other_fields():
    """A run's memory of another release: code that took its old places would read beside it."""

    class Course(NamedTuple):
        first: int
        second: int

    class Turned(NamedTuple):
        second: int
        first: int

    class Memory:
        count: int
        course: Course

    class Grown:
        more: float
        count: int
        course: Course

    class Exchanged:
        count: int
        course: Turned

    found = []
    for layout in (Memory, Memory, Grown, Exchanged):
        layout.__name__ = "Memory"
        memory = at(Structure(layout))
        found.append(fingerprint(reader(memory)))
    assert found[0] == found[1] and len({*found}) == 3


def reader(memory):
    """Return a function that reads a structure."""

    def read(place):
        return memory(place).count

    return read


def test_runs_without_events_do_not_load_the_search_for_them(monkeypatch):
    def fail():
        raise AssertionError("there are none")

    monkeypatch.setattr("linkwork.simulation.integration.search_for_events", fail)
    given = pendulum.address, None, [1.0], [0.0], []
    assert integrate(*given, duration=0.1).success
    with pytest.raises(AssertionError, match="there are none"):
        integrate(*given, duration=0.1, events=Events(pendulum.address, (Condition(),)))


HELPER = """
from numba import njit

FACTOR = {factor}

@njit
def times(x):
    return FACTOR * x
"""
USER = """
from numba import types
from helping import times
from linkwork.simulation.compiled import compiled_once

@compiled_once("the product", (types.float64,))
def product(x):
    return times(x)
"""


OPERATOR = """
import operator
from llvmlite import ir
from numba import types
from linkwork.simulation.compiled import taught

FACTOR = {factor}

@taught(operator.matmul, types.float64, types.float64, types.float64)
def generate(context, builder, signature, values):
    return builder.fmul(ir.Constant(ir.DoubleType(), FACTOR), builder.fmul(*values))

def one():
    return 1.0
"""
OPERATOR_USER = """
from numba import njit, types
import helping
from linkwork.simulation.compiled import compiled_once

one = njit(helping.one)

@compiled_once("the product", (types.float64,))
def product(x):
    return x @ one()
"""


@pytest.mark.long
def test_the_cache_is_renewed_when_another_file_changes(tmp_path):
    """An operator counts if its module's functions are used: nobody names operators."""
    pairs = {"constant": (USER, HELPER), "operator": (OPERATOR_USER, OPERATOR)}
    for name, (user, _) in pairs.items():
        (tmp_path / f"using_{name}.py").write_text(user.replace("helping", f"helping_{name}"))
    script = "import using_constant, using_operator as other; "
    script += "print(using_constant.product(1.0), other.product(1.0))"
    for factor in 2.0, 3.0, 3.0:
        for name, (_, helper) in pairs.items():
            (tmp_path / f"helping_{name}.py").write_text(helper.format(factor=factor))
        done = finished("-B", "-c", script, cwd=tmp_path)
        assert done.stdout == f"{factor:.1f} {factor:.1f}\n", done.stderr
    assert done.stderr == ""


PART = """
from numba import njit
from linkwork.simulation.compiled import OPTIONS

@njit(**OPTIONS)
def times(x):
    return 3.0 * x
"""


@SmallKernel
def position(x, out):
    """The event of passing q = 0."""
    out[0] = x[0]


def test_parts_of_compiled_code_are_no_functions_of_their_own(tmp_path, monkeypatch):
    (tmp_path / "tripling.py").write_text(PART)
    path = tmp_path / "product.py"
    path.write_text(USER.replace("helping", "tripling"))
    monkeypatch.syspath_prepend(tmp_path)
    assert load(path).product(2.0) == 6.0
    with pytest.raises(KeyError, match="times is called by compiled code alone"):
        importlib.import_module("tripling").times(2.0)


def undefined(code: bytes) -> set[str]:
    """Return the names that an object file (ELF, 64 bits) takes from elsewhere."""
    (first,), (size, count) = unpack_from("<Q", code, 40), unpack_from("<HH", code, 58)
    heads = [unpack_from("<IIQQQQIIQQ", code, first + k * size) for k in range(count)]
    found = set()
    for _, kind, _, _, start, length, link, *_ in heads:
        for at_symbol in range(start, start + length, 24) if kind == 2 else ():
            name, _, _, section = unpack_from("<IBBH", code, at_symbol)
            if section == 0 and name:
                begin = heads[link][4] + name
                found.add(code[begin : code.index(b"\0", begin)].decode())
    return found


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads object files of Linux")
def test_loops_that_are_loaded_need_only_what_is_there_without_numba_s_compiler():
    library = ctypes.CDLL(None)
    for loop in (native.integrate, native_rosenbrock.integrate, lanes.integrate, bends.bends):
        cache = loop._cache._cache_file
        (name,) = cache._load_index().values()
        kept = Path(cache._data_path(name)).read_bytes()
        names = undefined(kept[kept.index(b"\x7fELF") :])
        assert "PyArg_UnpackTuple" in names
        others = {name for name in names if not name.startswith(("NRT_", "Py", "_Py", "numba_"))}
        assert {name for name in others if not hasattr(library, name)} == set()


@pytest.mark.parametrize("method", [DORMAND_PRINCE, RK4(0.1), RODAS], ids=lambda way: way.name)
def test_a_loop_has_one_signature_whatever_it_is_given(method):
    assert van_der_pol.address and van_der_pol_jacobian.address and position.address
    watched = Events(position.address, (Condition(),))
    for forces in (np.zeros(0), Sampled(np.array([0.0, 1.0]), np.zeros((2, 0)))):
        for times, events in ((None, None), ([0.5], None), (None, watched)):
            run = integrate(
                van_der_pol.address, None, [2.0], [0.0], forces, [1.0], duration=1, save_at=times,
                method=method, jacobian=van_der_pol_jacobian.address, events=events,
            )  # fmt: skip
            assert run.success
    assert len((native_rosenbrock if method.stiff else native).integrate.signatures) == 1


def let_go(tree: ast.Module) -> list[str]:
    """Return the arrays that a function makes and points to, but names last in doing so: Numba
    frees memory behind its last name."""
    found = []
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        made, named, pointed = set(), {}, {}
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and ast.unparse(node.value).startswith(MADE):
                made |= {ast.unparse(target) for target in node.targets}
            if isinstance(node, ast.Name):
                named[node.id] = max(named.get(node.id, 0), node.lineno)
            if isinstance(node, ast.Call) and ast.unparse(node.func) in POINTING:
                for name in (own.id for own in ast.walk(node) if isinstance(own, ast.Name)):
                    pointed[name] = max(pointed.get(name, 0), node.lineno)
        found += [
            f"{function.name}: {name}" for name in made & pointed.keys()
            if named[name] <= pointed[name]
        ]  # fmt: skip
    return found


MADE, POINTING = ("np.empty(", "np.zeros(", "room("), ("pointer", "as_table")


def test_memory_that_is_pointed_to_lives_to_the_end_of_its_function():
    """Freed memory is written over by others: runs by tables were wrong now and then, and ended
    the process."""
    modules = Path(simulation.__file__).parent.glob("*.py")
    loose = {path.name: let_go(ast.parse(path.read_text())) for path in modules}
    assert {name: found for name, found in loose.items() if found} == {}
    forgotten = "def f(n):\n    room = np.empty(n)\n    p = pointer(room)\n    return p[0]"
    assert let_go(ast.parse(forgotten)) == ["f: room"]
