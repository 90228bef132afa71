"""Calls straight from Python: the bits of the kernel, and what they do not take."""

from __future__ import annotations

import gc
import pickle
import re
import sys
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from linkwork.kernels import Kernel, KernelError, compile_function, from_python
from linkwork.kernels.from_python import AskedOutputs, Columns, Direct, direct

A, B = np.array([0.3, -1.2, 2.5]), np.array([0.7, -0.4])
CONSTANT = np.array([1.5])
RESULTS = AskedOutputs(1, (2, 2), 1e-3)


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    """(a, b, c) -> a number nobody asks for, four that are asked for, one that watches."""
    a, b, c = (ca.SX.sym(name, size) for name, size in (("a", 3), ("b", 2), ("c", 1)))
    asked = ca.vertcat(a[0] * b[0] + c, a[1] / b[1], ca.exp(100 * a[2]), ca.sin(c * a[0]))
    outputs = [a[1], asked, b[0] - 0.2]
    return compile_function(ca.Function("asked", [a, b, c], outputs, ["a", "b", "c"], list("xyz")))


@pytest.fixture(params=["own convention", "ctypes"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "ctypes":
        monkeypatch.setattr(from_python, "_interface", lambda: None)
    return request.param


@pytest.fixture
def call(kernel: Kernel, way: str) -> Direct:
    return direct(kernel, (3, 2), CONSTANT, RESULTS)


def test_this_python_is_one_that_it_is_written_for():
    assert from_python._interface() is not None


def test_results_have_the_bits_of_the_kernel(kernel, call):
    wanted = kernel(A, B, CONSTANT)[1].reshape(2, 2)
    found = call(A, B)
    assert found.tobytes() == wanted.tobytes() and found.shape == (2, 2)
    assert found.flags.owndata and found.flags.writeable and type(found) is np.ndarray
    kept = found.copy()
    call(2 * A, B)  # another result is another array
    assert (found == kept).all()
    frozen = A.copy()
    frozen.flags.writeable = False
    for same in (frozen, pickle.loads(pickle.dumps(A)), np.array(A, "<f8")):
        assert call(same, B).tobytes() == wanted.tobytes()


SHAPES = ((), Columns((3, 1)), (0,), Columns((2, 0)), (1,), ())


def test_results_come_in_a_tuple_of_arrays(kernel, way):
    """Each has its own memory, and the order of its matrix; results that do not hold are None."""
    wanted = np.concatenate(kernel(A, B, CONSTANT))
    for shapes in (SHAPES, (Columns((2, 3)),), ((2, 3),), (Columns((3, 2)),)):
        call = direct(kernel, (3, 2), CONSTANT, AskedOutputs(0, shapes, 1e-3))
        found = call(A, B)
        assert type(found) is tuple and len(found) == len(shapes)
        end = 0
        for array, shape in zip(found, shapes, strict=True):
            part = wanted[end : (end := end + array.size)]
            order = "F" if isinstance(shape, Columns) else "C"
            assert array.shape == shape and array.flags.owndata and array.flags.writeable
            assert array.tobytes(order) == part.tobytes() and array.flags[f"{order}_CONTIGUOUS"]
        assert call(A, np.array([0.2, 1.0])) is None
        assert call(A, np.array([1.0, 0.0])) is None


def test_what_python_collects_may_call_the_same(kernel):
    """Python looks for garbage as it makes a tuple, and tells others so, who may call what makes
    it."""
    call = direct(kernel, (3, 2), CONSTANT, AskedOutputs(0, SHAPES, 1e-3))
    wanted = [part.tobytes() for part in call(A, B)]
    told: list[int] = []

    def meddle(phase: str, _: object) -> None:
        told.append(len(call(2 * A, B)) if phase == "start" and len(told) < 1000 else 0)

    limits = gc.get_threshold()
    gc.callbacks.append(meddle)
    gc.set_threshold(1)
    try:
        found = [call(A, B) for _ in range(100)]  # as many tuples, none of which is let go
    finally:
        gc.set_threshold(*limits)
        gc.callbacks.remove(meddle)
    assert max(told) == len(SHAPES)
    assert all([part.tobytes() for part in parts] == wanted for parts in found)


def test_calls_of_a_kernel_go_straight_into_its_code(monkeypatch):
    """Where there is code, plain vectors take the shortest way; all others give the same bits and
    sentences as where the code is not asked for yet."""
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 2)
    f = ca.Function("straight", [a, b], [ca.exp(a) * b[0], ca.sqrt(b)], ["a", "b"], ["y", "z"])
    new, used = compile_function(f), compile_function(f)
    assert used.address and used.flat(A, A[:2]).size == 5
    given, positive = used.given([0.7, 0.4]), np.array([0.7, 0.4])
    given(A)
    with monkeypatch.context() as only_straight:
        only_straight.setattr(Kernel, "_one", property(lambda _: pytest.fail("a longer way")))
        for y, z in (used(A, positive), given(A), given(A.tolist()), given(A, positive)):
            np.testing.assert_allclose(y, np.exp(A) * 0.7, rtol=1e-14)
            np.testing.assert_allclose(z, np.sqrt(positive), rtol=1e-14)
        flat = used.flat(A, positive)
        assert flat.flags.owndata and flat.tolist() == [*y, *z]
    # A result that is no number, other types, a list, a vector with gaps, a stack.
    for x, y in ((A, B), (A.astype("f4"), B), (A, [0.7, 0.4]), (A[::-1], B), (A[None], B)):
        for one, other in zip(new(x, y), used(x, y), strict=True):
            np.testing.assert_array_equal(one, other)
    for wrong in ((A, A), (A,), (A, B, B), (A, 3.0)):
        told = []
        for each in (new, used):
            with pytest.raises(KernelError) as error:
                each(*wrong)
            told.append(str(error.value))
        assert told[0] == told[1]


def test_lists_and_tuples_of_numbers_are_taken(kernel):
    call = direct(kernel, (3, 2), CONSTANT, RESULTS)
    wanted = call(A, np.array([3.0, -1.0]))
    for given in ([3.0, -1.0], (3.0, -1.0), [3, -1], (3, -1.0)):
        assert call(A, given).tobytes() == wanted.tobytes()
    assert call([2**60 + 1, 1, 0], B)[0, 0] == call(np.array([2**60 + 1, 1, 0.0]), B)[0, 0]


class Listed(list):
    """A list that may be anything."""


SPREAD = np.ones(4)
OTHERS = (
    None,
    3.0,
    "ab",
    b"12345678",
    object(),
    {},
    {0: 1.0, 1: 2.0},
    [1.0],
    [1.0, 2.0, 3.0, 4.0],
    [1.0, None],
    [1.0, "2"],
    [True, 1.0],
    [1.0, np.nan],
    [np.inf, 1.0],
    [1, 10**400],
    [1.0, np.float32(2.0)],
    [1j, 1.0],
    Listed([1.0, 2.0]),
    iter([1.0, 2.0]),
    np.array(1.0),
    np.ones((1, 2)),
    np.ones((2, 1)),
    np.ones(1),
    np.ones(4),
    np.ones(2, np.float32),
    np.ones(2, int),
    np.ones(2, bool),
    np.ones(2, complex),
    np.ones(2, ">f8"),
    np.array([1.0, 2.0], object),
    SPREAD[::2],
    np.frombuffer(bytes(17), np.uint8)[1:].view(np.float64),
    np.ones(2).view(np.recarray),
    np.ma.ones(2),
    memoryview(np.ones(2)),
    np.float64,
)


@pytest.mark.parametrize(
    "other", OTHERS, ids=lambda other: re.sub(" at 0x.*", "", repr(other)[:30])
)
def test_what_is_not_plain_is_left_to_others(call, other):
    held = sys.getrefcount(other)
    for _ in range(100):
        assert call(A, other) is None
        assert call(other, B) is None
    assert abs(sys.getrefcount(other) - held) < 50
    assert call(A, B) is not None


def test_so_many_arguments_and_no_others(kernel, call):
    for given in ((), (A,), (A, B, B), (A, B, CONSTANT)):
        assert call(*given) is None
    with pytest.raises(TypeError):
        call(A, B, out=B)


def test_results_that_do_not_hold_are_left_to_others(call):
    assert call(A, np.array([0.2, 1.0])) is None  # what watches is zero
    assert call(A, np.array([0.2 + 9e-4, 1.0])) is None
    assert call(A, np.array([np.nan, 1.0])) is None
    assert call(A, np.array([1.0, 0.0])) is None  # a result is infinite
    assert call(np.array([0.0, 0.0, np.inf]), B) is None
    assert call(np.array([0.0, np.nan, 1.0]), B) is None
    assert call(np.array([np.nan, 1.0, 1.0]), B) is None


def test_nothing_is_left_behind(kernel):
    call, given = direct(kernel, (3, 2), CONSTANT, RESULTS), [1e10, -3e20]
    several = direct(kernel, (3, 2), CONSTANT, RESULTS._replace(first=0, shape=SHAPES))
    a, item = A.copy(), given[0]
    gc.collect()  # what other tests left holds types, too
    held = [sys.getrefcount(each) for each in (a, given, item, call, np.ndarray, a.dtype)]

    def many() -> None:
        for _ in range(3000):
            call(a, B)
            call(a, given)
            several(a, B)
            call(a, [1.0, None])
            call(a, [10**400, 1.0])

    many()
    gc.collect()
    tracemalloc.start()
    many()
    before = tracemalloc.get_traced_memory()[0]
    many()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 10_000
    after = [sys.getrefcount(each) for each in (a, given, item, call, np.ndarray, a.dtype)]
    assert np.abs(np.subtract(after, held)).max() < 1000


def test_the_kernel_lives_as_long_as_the_call():
    x = ca.SX.sym("x", 2)
    made = compile_function(ca.Function("brief", [x], [2 * x, ca.SX(1)], ["x"], ["y", "one"]))
    call = direct(made, (2,), np.empty(0), AskedOutputs(0, (2,), 0.0))
    del made
    gc.collect()
    assert call(B).tolist() == [1.4, -0.8]


def test_threads_do_not_meet(kernel):
    call = direct(kernel, (3, 2), CONSTANT, RESULTS)
    given = [A * (1 + k / 64) for k in range(64)]
    wanted = [call(a, B).tobytes() for a in given]
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            for found in pool.map(lambda _: [call(a, B).tobytes() for a in given], range(100)):
                assert found == wanted
    finally:
        sys.setswitchinterval(interval)


def test_other_layouts_are_noticed(monkeypatch):
    for seen in (
        np.zeros((3, 4))[:, 1:],
        np.array(2.0)[None],
        np.zeros(3, ">f8"),
        np.zeros(2, "f4"),
    ):
        assert from_python._reads(seen)
    monkeypatch.setattr(from_python, "ABI", 3)
    assert from_python._numpy_new() is None
