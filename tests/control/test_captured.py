"""What a Python function reads: nothing that changed is ever taken from before, and what may change
unseen is read anew each time."""

import cmath
import math as plain
from functools import partial, wraps

import numpy as np
import pytest

import linkwork as lw
from linkwork import math
from linkwork.control import PD
from linkwork.control.captured import Open, told

gain = 2.0
weights = np.array([1.0, 2.0])
library = plain


def scaled(x):
    return gain * x


def law(t, state):
    return [scaled(state["slide"]) + weights[0] * math.cos(t) + np.pi]


def key(function):
    return hash(told(function))


def test_functions_made_again_are_the_same():
    def made(by):
        return lambda t, state, offset=1.0: [by * state["slide"] + offset]

    assert told(made(2.0)) == told(made(2.0))
    differing = [made(by) for by in (2.0, 2, True, 0.0, -0.0, "2", (2.0,), [2.0], np.float64(2))]
    assert len({key(each) for each in differing}) == len(differing)
    other = made(2.0)
    other.__defaults__ = (1.5,)
    assert told(other) != told(made(2.0))
    assert key(partial(law, t=1.0)) != key(partial(law, t=2.0))


@pytest.mark.parametrize("name, value", [("gain", 3.0), ("weights", np.array([1.0, 2.1]))])
def test_globals_count_also_in_the_functions_that_are_called(monkeypatch, name, value):
    before = key(law)
    monkeypatch.setitem(globals(), name, value)
    assert key(law) != before
    monkeypatch.undo()
    assert key(law) == before


def test_arrays_that_change_in_place_count():
    own = np.zeros(3)

    def read(t, state):
        return own

    before = key(read)
    own[1] = 1e-300
    assert key(read) != before and told(own.reshape(1, 3)) != told(own)
    table = np.arange(6.0).reshape(2, 3)
    assert told(table) != told(np.asfortranarray(table))  # sums go by what lies side by side


def test_attributes_of_modules_count(monkeypatch):
    def read(t, state):
        return [library.tau * state["slide"]]

    before = key(read)
    monkeypatch.setattr(plain, "tau", 6.0)
    assert key(read) != before
    monkeypatch.undo()
    monkeypatch.setitem(globals(), "library", cmath)
    assert key(read) == before  # it is the number that is read


def test_functions_made_in_a_loop_read_what_the_loop_left():
    late = [lambda t, state: [by] for by in range(3)]  # noqa: B023
    early = [lambda t, state, by=by: [by] for by in range(3)]
    assert len({key(each) for each in late}) == 1
    assert len({key(each) for each in early}) == 3


def test_inner_functions_and_comprehensions_count(monkeypatch):
    def read(t, state):
        def each(name):
            return gain * state[name]

        return [each(name) + sum(gain for _ in range(2)) for name in ("slide",)]

    before = key(read)
    monkeypatch.setitem(globals(), "gain", 3.0)
    assert key(read) != before


def test_functions_that_call_themselves_are_told():
    def power(x, n):
        return x * power(x, n - 1) if n else 1.0

    assert key(power) == key(power)


def test_parts_of_the_package_count_by_their_numbers():
    gains = {"slide": 1.0}
    pd = PD({"slide": 0.0}, gains, 1.0)
    before = key(lambda t, state: pd(t, state))
    gains["slide"] = 2.0
    assert key(lambda t, state: pd(t, state)) != before


class Counter:
    gain = 1.0

    def law(self, t, state):
        return [self.gain]

    def __call__(self, t, state):
        return [self.gain]


def importing(t, state):
    from random import random

    return [random()]


def writing(t, state):
    global gain
    gain = 5.0
    return [1.0]


def counting():
    count = 0

    def counted(t, state):
        nonlocal count
        count = 5
        return [1.0]

    return counted


class Scope(dict):
    """Globals that hold more than is seen."""

    def __missing__(self, name):
        return gain


def guised():
    number = type("float64", (np.float64,), {"__module__": "numpy", "gain": 1.0})(1.0)
    return lambda t, state: [number.gain]


endless: list = []
endless.append(endless)
robot_of = lw.Robot


class Tuned(lw.Sampled):
    """A signal of the user's own."""


@pytest.mark.parametrize(
    "function",
    [
        Counter(),
        Counter().law,
        guised(),
        eval("lambda t, state: [gain]", Scope()),
        lambda t, state: [float(scaled.__doc__)],
        lambda t, state: np.array([1.0], object),
        counting(),
        Tuned([0.0, 1.0], [1.0, 2.0]),
        lambda t, state: endless,
        lambda t, state: [np.geterr()["over"] == "warn"],
        lambda t, state: [float(np.datetime64("now").astype(int))],
        importing,
        writing,
        lambda t, state: [Counter.gain],
        lambda t, state: [np.random.normal()],  # noqa: NPY002
        lambda t, state: [np.load("gains.npy")[0]],
        lambda t, state: [float(open("gains").read())],  # noqa: SIM115
        lambda t, state: print(t) or [1.0],
        lambda t, state: [globals()["gain"]],
        lambda t, state: [getattr(np, "pi")],  # noqa: B009
        lambda t, state: [robot_of("prr3").mobility],
        np.vectorize(scaled),
        np.frompyfunc(scaled, 1, 1),
    ],
)
def test_what_may_change_unseen_is_open(function):
    with pytest.raises(Open):
        told(function)


def test_large_and_odd_arrays_are_open():
    several = [np.zeros(2**14) for _ in range(9)]
    masked, objects = np.ma.array([1.0]), np.array([object()])
    for array in (np.zeros(2**18), several, [0.0] * 2**15, objects, masked):
        with pytest.raises(Open):
            told(array)


def test_a_function_in_the_guise_of_a_librarys_is_read(monkeypatch):
    for own in (plain.sin, math.sin):

        @wraps(own)
        def scaled_too(x):
            return gain * x

        monkeypatch.undo()
        before = key(lambda t, state, of=scaled_too: [of(t)])
        monkeypatch.setitem(globals(), "gain", 3.0)
        assert key(lambda t, state, of=scaled_too: [of(t)]) != before
        monkeypatch.setattr(np.linalg, "norm", wraps(np.linalg.norm)(scaled_too))
        with pytest.raises(Open):
            told(lambda t, state: [np.linalg.norm(t)])


def test_names_of_fields_count():
    own = np.array([(1.0, 2.0)], dtype=[("first", "f8"), ("second", "f8")])
    before = key(lambda t, state: own["first"])
    own.dtype.names = "second", "first"
    assert key(lambda t, state: own["first"]) != before


def test_attributes_of_functions_count():
    for own in (partial(scaled, 1.0), lambda x: x):
        keys = set()
        for own.factor in (1.0, 2.0):
            keys.add(key(lambda t, state, own=own: [own.factor]))
        assert len(keys) == 2


def test_attributes_of_a_librarys_functions_are_no_part_of_it(monkeypatch):
    told(lambda t, state: [math.sqrt(t)])
    monkeypatch.setattr(math.sqrt, "gain", 1.0, raising=False)
    with pytest.raises(Open):
        told(lambda t, state: [math.sqrt.gain])


def test_what_builtins_a_function_was_made_with_counts():
    built = {"__builtins__": {"abs": lambda x: gain * x}}
    exec("def law(t, state): return [abs(t)]", built)
    before = key(built["law"])
    built["__builtins__"]["abs"] = scaled
    assert key(built["law"]) != before


def test_numbers_of_signals_count():
    keys = set()
    for number in (1.0, 3.0):
        signal = lw.Sampled(np.array([0.0, 1.0]), np.array([number, 2.0]))
        keys.add(key(lambda t, state, signal=signal: signal.values[0]))
    assert len(keys) == 2


def test_slices_count_by_what_they_hold():
    ends = np.zeros(2000)
    own = slice(ends)
    before = key(lambda t, state: own)
    ends[1000] = 1.0
    assert key(lambda t, state: own) != before


def test_numbers_of_any_length_are_read():
    assert key(lambda t, state, x=10**5000: [x]) != key(lambda t, state, x=10**5000 + 1: [x])


def test_functions_that_share_others_are_read_in_no_time():
    made = {"f0": scaled, "f1": scaled}
    for k in range(2, 60):
        exec(f"def f{k}(x): return f{k - 1}(x) + f{k - 2}(x)", made)
    assert told(made["f59"]) == told(made["f59"])
    before = key(made["f59"])
    made["f1"] = abs
    assert key(made["f59"]) != before


def test_the_order_of_functions_counts():
    def first(x):
        return x

    def second(x):
        return 2 * x

    several = {first, second}
    a, b = (partial(law, several, each) for each in (first, second))
    assert key(a) != key(b)
