"""Compiled functions against CasADi's own evaluation, and every way to call them."""

import ctypes
import pickle
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, KernelError, compile_function, sections
from linkwork.kernels.emit import FUNCTIONS

from tests.kernels.graphs import BINARY, UNARY, evaluate, random_function
from tests.products import first

RELATIVE = 1e-13
SPECIAL = (0.0, -0.0, 1.0, -1.0, 2.0, -2.5, 0.5, 1e-300, -1e300, np.inf, -np.inf, np.nan)


def states(kernel: Kernel, *shape: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(*shape, size)) for _, size in kernel.inputs]


def assert_close(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=RELATIVE, atol=RELATIVE)


@pytest.mark.sample(16)
@pytest.mark.parametrize("name", UNARY)
def test_every_operation_of_one_number(name: str):
    x = ca.SX.sym("x")
    f = ca.Function("f", [x], [UNARY[name](x)])
    points = np.r_[SPECIAL, np.random.default_rng(1).normal(scale=3, size=31)]
    _compare(f, points[:, None])


@pytest.mark.sample(14)
@pytest.mark.parametrize("name", BINARY)
def test_every_operation_of_two_numbers(name: str):
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    f = ca.Function("f", [x, y], [BINARY[name](x, y)])
    special = np.array([(a, b) for a in SPECIAL for b in SPECIAL])
    points = np.vstack([special, np.random.default_rng(2).normal(scale=3, size=(31, 2))])
    _compare(f, points[:, :1], points[:, 1:])


def _compare(f: ca.Function, *points: np.ndarray) -> None:
    kernel = compile_function(f)
    expected = np.array([evaluate(f, *state)[0] for state in zip(*points, strict=True)])
    np.testing.assert_allclose(kernel(*points)[0], expected, rtol=RELATIVE, atol=0)
    one_by_one = [kernel(*state)[0] for state in zip(*points, strict=True)]
    np.testing.assert_allclose(one_by_one, expected, rtol=RELATIVE, atol=0)


@pytest.mark.sample(6)
@pytest.mark.parametrize("seed", range(25))
def test_random_graphs_agree_with_casadi(seed: int):
    f = random_function(seed)
    kernel = compile_function(f)
    batch = states(kernel, kernel.lanes + 1, seed=seed)
    results = kernel(*batch)
    for i in range(kernel.lanes + 1):
        state = [array[i] for array in batch]
        for result, one, expected in zip(results, kernel(*state), evaluate(f, *state), strict=True):
            assert_close(result[i], expected)
            assert_close(one, expected)


def test_a_state_has_the_same_bits_alone_and_in_any_batch():
    for seed in range(5):
        kernel = compile_function(random_function(seed))
        batch = states(kernel, 11)
        results = kernel(*batch)
        for i in range(11):
            for result, one in zip(results, kernel(*[array[i] for array in batch]), strict=True):
                np.testing.assert_array_equal(result[i], one)


def test_names_and_sizes():
    kernel = compile_function(random_function(0))
    assert kernel.name == "random_0"
    assert kernel.inputs == (("a", 4), ("b", 4), ("c", 4))
    assert kernel.outputs == (("d", 6), ("e", 16))
    assert (kernel.n_in, kernel.n_out) == (12, 22)
    assert kernel.lanes in (2, 4, 8)
    assert repr(kernel).startswith("Kernel random_0: (a[4], b[4], c[4]) -> (d[6], e[16]), ")


@pytest.mark.parametrize("count", [0, 1, 2, 3, 7, 8, 9, 17])
def test_batches_of_any_size(count: int):
    f = random_function(3)
    kernel = compile_function(f)
    batch = states(kernel, count)
    results = kernel(*batch)
    assert [result.shape for result in results] == [(count, 6), (count, 16)]
    for i in range(count):
        for result, expected in zip(
            results, evaluate(f, *[array[i] for array in batch]), strict=True
        ):
            assert_close(result[i], expected)


def test_leading_dimensions_are_broadcast():
    x, y, z = ca.SX.sym("x", 2), ca.SX.sym("y", 1), ca.SX.sym("z", 3)
    kernel = compile_function(ca.Function("f", [x, y, z], [x * y, ca.sum1(z) + y]))
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(5, 1, 2)), rng.normal(size=(4, 1)), rng.normal(size=3)
    product, total = kernel(a, b, c)
    np.testing.assert_array_equal(product, a * b)
    np.testing.assert_allclose(total, np.broadcast_to(c.sum() + b, (5, 4, 1)), rtol=1e-15)
    np.testing.assert_array_equal(kernel(a[:, :, ::-1], b, c)[0], a[:, :, ::-1] * b)


def test_whole_numbers_and_lists_are_taken():
    x = ca.SX.sym("x", 2)
    kernel = compile_function(ca.Function("f", [x], [x / 4]))
    np.testing.assert_array_equal(kernel([1, 2])[0], [0.25, 0.5])
    np.testing.assert_array_equal(kernel(np.array([[1, 2], [3, 4]]))[0], [[0.25, 0.5], [0.75, 1.0]])


def test_results_are_the_callers_own():
    x = ca.SX.sym("x", 2)
    kernel = compile_function(ca.Function("f", [x], [2 * x]))
    first = kernel([1.0, 2.0])[0]
    kernel([3.0, 4.0])
    np.testing.assert_array_equal(first, [2, 4])


def test_outputs_that_are_inputs_constants_and_structural_zeros():
    x, s = ca.SX.sym("x", 2), ca.SX.sym("s", ca.Sparsity.upper(2))
    outputs = [
        x,
        ca.SX([3, np.nan]),
        ca.SX(ca.Sparsity.diag(2), ca.vertcat(-x)),
        s,
        ca.SX(2, 1),
        x[:0],
    ]
    kernel = compile_function(ca.Function("f", [x, s], outputs))
    for result, expected in zip(
        kernel([1, 2], [5, 6, 7, 8]),
        ([1, 2], [3, np.nan], [-1, 0, 0, -2], [5, 0, 7, 8], [0, 0], []),
        strict=True,
    ):
        np.testing.assert_array_equal(result, expected)
    assert kernel.operations == 2
    assert compile_function(ca.Function("f", [], [ca.SX(2.5)]))()[0] == 2.5
    assert compile_function(ca.Function("f", [x], [])).n_out == 0


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e15, -1e200])
def test_a_lane_out_of_the_ordinary_leaves_the_others_alone(odd: float):
    x = ca.SX.sym("x", 2)
    f = ca.Function("f", [x], [ca.sin(x[0]) * x[1], ca.cos(x[0] + x[1])])
    kernel = compile_function(f)
    batch = np.random.default_rng(0).normal(size=(3 * kernel.lanes, 2))
    usual = kernel(batch)
    changed = batch.copy()
    changed[kernel.lanes + 1, 0] = odd
    results = kernel(changed)
    for i in range(len(batch)):
        for result, before, expected in zip(results, usual, evaluate(f, changed[i]), strict=True):
            np.testing.assert_allclose(result[i], expected, rtol=RELATIVE)
            if i != kernel.lanes + 1:
                np.testing.assert_array_equal(result[i], before[i])


@pytest.mark.parametrize(
    "angles", [(1e15, 0.1), (1e200, 0.1), (0.1, 1e200), (np.nan, 1e200), (1e200, np.nan)]
)
def test_one_large_angle_of_several(angles: tuple[float, float]):
    x = ca.SX.sym("x", 2)
    f = ca.Function("f", [x], [ca.sin(x), ca.cos(x)])
    kernel = compile_function(f)
    for result, batch, expected in zip(
        kernel(angles), kernel([angles]), evaluate(f, np.array(angles)), strict=True
    ):
        np.testing.assert_allclose(result, expected, rtol=RELATIVE)
        np.testing.assert_allclose(batch[0], expected, rtol=RELATIVE)


@pytest.mark.parametrize("count", [3, 40])
@pytest.mark.parametrize("far", [None, 0, 2])
def test_angles_that_depend_on_other_angles(count: int, far: int | None):
    """Sines of cosines of sines, of few angles and of many, also where one is too large for the
    inlined sine."""
    x = ca.SX.sym("x", count)
    inner = ca.sin(x) * 2
    middle = ca.cos(inner + x[::-1] if count > 3 else inner)
    f = ca.Function("f", [x], [ca.sin(middle * 3) + ca.cos(middle), inner, ca.tan(0.1 * middle)])
    kernel = compile_function(f)
    batch = np.random.default_rng(0).normal(size=(kernel.lanes + 1, count))
    if far is not None:
        batch[far, count - 1] = 1e12
    results = kernel(batch)
    for i, state in enumerate(batch):
        for result, one, expected in zip(results, kernel(state), evaluate(f, state), strict=True):
            np.testing.assert_array_equal(result[i], one)
            assert_close(one, expected)


@pytest.mark.long
@pytest.mark.parametrize("seed", first(1, range(3)))
def test_large_functions_agree_with_casadi(seed: int, monkeypatch: pytest.MonkeyPatch):
    """Their sections are functions; the truths, constants, inputs and sines of one are used in
    others."""
    monkeypatch.setattr(sections, "LARGE", 1000)
    f = random_function(seed, 1000)
    kernel = compile_function(f)
    assert kernel.operations > 1500
    for kind in FUNCTIONS:
        assert kernel.instruction_count(kind) > kernel.operations / 2
    batch = states(kernel, kernel.lanes + 1, seed=seed)
    batch[0][1, 0] = 1e10
    results = kernel(*batch)
    for i in range(kernel.lanes + 1):
        state = [array[i] for array in batch]
        for result, one, expected in zip(results, kernel(*state), evaluate(f, *state), strict=True):
            np.testing.assert_array_equal(result[i], one)
            np.testing.assert_allclose(one, expected, rtol=1e-11, atol=1e-11)


def test_the_addresses_are_c_functions():
    f = random_function(4)
    kernel = compile_function(f)
    one = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(kernel.address)
    many = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)(
        kernel.batch_address
    )
    blocks, lanes = 3, kernel.lanes
    x, y = _aligned(blocks, kernel.n_in, lanes), _aligned(blocks, kernel.n_out, lanes)
    x[...] = np.random.default_rng(0).normal(size=x.shape)
    many(blocks, x.ctypes.data, y.ctypes.data)
    for block in range(blocks):
        for lane in range(lanes):
            state, result = np.ascontiguousarray(x[block, :, lane]), np.empty(kernel.n_out)
            one(state.ctypes.data, result.ctypes.data)
            np.testing.assert_array_equal(y[block, :, lane], result)
            assert_close(result, np.concatenate(evaluate(f, *np.split(state, [4, 8]))))


@pytest.mark.parametrize("large", [False, True])
def test_states_side_by_side(large: bool, monkeypatch: pytest.MonkeyPatch):
    """What is computed of each state is what is computed of it alone, sections that are functions
    included."""
    if large:
        monkeypatch.setattr(sections, "LARGE", 1000)
    f = random_function(8, 1000 if large else 60)
    kernel = compile_function(f)
    one = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(kernel.address)
    wide = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(kernel.wide_address)
    lanes = kernel.abreast * kernel.lanes
    x, y = _aligned(kernel.n_in, lanes), _aligned(kernel.n_out, lanes)
    x[...] = np.random.default_rng(0).normal(size=x.shape)
    x[0, 1] = 1e10
    wide(x.ctypes.data, y.ctypes.data)
    for lane in range(lanes):
        state, result = np.ascontiguousarray(x[:, lane]), np.empty(kernel.n_out)
        one(state.ctypes.data, result.ctypes.data)
        np.testing.assert_array_equal(y[:, lane], result)


def _aligned(*shape: int) -> np.ndarray:
    memory = np.zeros(np.prod(shape) + 8)
    start = -memory.ctypes.data % 64 // 8
    return memory[start : start + np.prod(shape)].reshape(shape)


def test_one_state_as_flat_vectors():
    f = random_function(5)
    kernel = compile_function(f)
    x = np.random.default_rng(0).normal(size=kernel.n_in)
    expected = np.concatenate(evaluate(f, *np.split(x, [4, 8])))
    first = kernel.flat(x)
    assert_close(first, expected)
    assert_close(kernel.flat(x[:5], x[5:]), expected)
    kernel.flat(2 * x)
    assert_close(first, expected)  # it is the caller's own
    for parts, shown in (
        ((x[1:],), r"\(11,\)"),
        ((x[:8], x[7:]), r"\(8,\) and \(5,\)"),
        ((x[None],), r"\(1, 12\)"),
    ):
        with pytest.raises(
            KernelError, match=rf"'random_5' takes 12 numbers, not parts of {shown}"
        ):
            kernel.flat(*parts)


@pytest.mark.parametrize(
    "change", ["of every second number", "of halves", "of whole numbers", "from a file"]
)
def test_vectors_of_any_kind_are_read_as_numbers(change):
    """The bytes of vectors are joined; what lies in memory otherwise is made a vector of doubles
    before."""
    kernel = compile_function(random_function(5))
    x = np.arange(1.0, 1 + kernel.n_in)
    given = {
        "of every second number": np.repeat(x, 2)[::2],
        "of halves": x.astype(np.float32),
        "of whole numbers": x.astype(int),
        "from a file": x.astype(">f8"),
    }[change]
    assert np.array_equal(kernel.flat(given[:5], x[5:]), kernel.flat(x))
    assert np.array_equal(kernel.flat(given[:5], given[5:]), kernel.flat(x))


def test_threads_do_not_disturb_each_other():
    kernel = compile_function(random_function(6))
    batch = states(kernel, 400)
    expected = kernel(*batch)

    def work(i: int) -> bool:
        one = kernel(*[array[i] for array in batch])
        part = kernel(*[array[i : i + 9] for array in batch])
        return all(
            np.array_equal(a, e[i]) and np.array_equal(p, e[i : i + 9])
            for a, p, e in zip(one, part, expected, strict=True)
        )

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(391)))


def test_a_kernel_can_be_sent_to_another_process():
    kernel = compile_function(random_function(7))
    again = pickle.loads(pickle.dumps(kernel))
    state = states(kernel)
    for a, b in zip(kernel(*state), again(*state), strict=True):
        np.testing.assert_array_equal(a, b)


def test_machine_code_can_be_read_and_counted():
    x = ca.SX.sym("x", 3)
    kernel = compile_function(ca.Function("f", [x], [x[0] * x[1] + x[2]]))
    assert kernel.operations == 2
    for kind in FUNCTIONS:
        assert "\tret" in kernel.assembly(kind)
        assert 3 <= kernel.instruction_count(kind) <= 60  # rows of eight states are turned
    assert kernel.instruction_count("batch") > kernel.instruction_count("one")


def test_numbers_of_instructions_are_counted_once(monkeypatch: pytest.MonkeyPatch):
    x = ca.SX.sym("x", 3)
    f = ca.Function("counted", [x], [x[0] * x[1] - x[2] / x[0]])
    found = {kind: compile_function(f).instruction_count(kind) for kind in FUNCTIONS}
    monkeypatch.setattr("linkwork.kernels.listing.listing", None)
    assert {kind: compile_function(f).instruction_count(kind) for kind in FUNCTIONS} == found


x, y = ca.SX.sym("x", 2), ca.SX.sym("y")


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (
            ca.Function("f", [x], [ca.erfinv(x)]),
            "Function 'f' uses the operation OP_ERFINV, which cannot be compiled.",
        ),
        (
            ca.Function("f", [x], [y], {"allow_free": True}),
            r"free variables \(y\); every symbol has to be an input.",
        ),
        (
            ca.Function("f", [ca.MX.sym("m")], [1]),
            r"'f' is a MXFunction; only functions of SX .* \(try expand\(\)\).",
        ),
        (lambda q: q, "compiled from a casadi.Function, not from function."),
    ],
)
def test_what_cannot_be_compiled_is_refused_in_a_sentence(function, sentence: str):
    with pytest.raises(KernelError, match=sentence):
        compile_function(function)


def test_refusals_are_linkwork_errors():
    kernel = compile_function(ca.Function("f", [x, y], [x + y]))
    with pytest.raises(LinkworkError):
        kernel(np.zeros((4, 2)), np.zeros((3, 1)))
    with pytest.raises(LinkworkError):
        compile_function(ca.Function("f", [x], [y], {"allow_free": True}))


def test_arrays_that_do_not_fit_are_refused_in_a_sentence():
    kernel = compile_function(ca.Function("f", [x, y], [x + y], ["x", "y"], ["z"]))
    with pytest.raises(KernelError, match=r"Kernel 'f' takes 2 arrays \(x, y\), not 1."):
        kernel([1, 2])
    with pytest.raises(
        KernelError,
        match=r"Input 'x' of kernel 'f' has the shape \(3,\); its last dimension has to be 2.",
    ):
        kernel([1, 2, 3], [1])
    with pytest.raises(
        KernelError,
        match=r"Input 'y' of kernel 'f' has the shape \(\); its last dimension has to be 1.",
    ):
        kernel([1, 2], 1)
    with pytest.raises(
        KernelError, match=r"batches of kernel 'f' do not fit each other: x \(4,\), y \(3,\)."
    ):
        kernel(np.zeros((4, 2)), np.zeros((3, 1)))
