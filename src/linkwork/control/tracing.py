"""Tracing: call functions of (t, state) once with symbols, and check the result against calling
them with numbers.

A `Tracer` hands out one symbol for every quantity, parameter and reference that the functions read.
What they return is then an expression in these symbols, in whatever chart of a robot it is
evaluated later. A reference over time (`Sampled`, `Signal`) that is called with the symbolic t
becomes an input of the system; the integrator evaluates it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from linkwork import checks, math
from linkwork.control.observation import Names, Observation, Quantity, Readings, numbers
from linkwork.errors import LinkworkError
from linkwork.simulation import Signal

Law = Callable[[Any, Observation], Any]
TRIALS = 4
AGREE = 1e-9
CONTROLLER = "the controller"


class Reference(NamedTuple):
    """Name a signal over time that is read, its symbols, and what reads it."""

    signal: Signal
    symbols: ca.SX
    what: str


@dataclass(frozen=True)
class Traced:
    """Hold a traced function: how to read a column from what it returns, the column of symbols, and
    how to name it."""

    function: Law
    read: Callable[[Any], ca.SX]
    column: ca.SX
    what: str


class Time(ca.SX):
    """The symbol of time [s], which signals know how to read themselves with."""

    reference: Callable[[Signal], np.ndarray]


@dataclass(frozen=True)
class Tracer:
    """Collect what traced functions read.

    names: by which they read; quantities, references, parameters: symbols so far, with the signals
        and default values
    traced: the functions so far
    """

    names: Names
    t: Time = field(default_factory=lambda: Time(ca.SX.sym("t")))
    quantities: dict[Quantity, ca.SX] = field(default_factory=dict)
    extras: dict[str, ca.SX] = field(default_factory=dict)
    references: list[Reference] = field(default_factory=list)
    parameters: dict[str, tuple[float, ca.SX]] = field(default_factory=dict)
    traced: list[Traced] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.extras.update({name: ca.SX.sym(name) for name in self.names.extras})

    @property
    def state(self) -> Observation:
        """The observation that holds the symbols."""
        return Observation(
            self.names, Readings(self.quantity, self.parameter, self.extras.__getitem__)
        )

    def quantity(self, key: Quantity) -> np.ndarray:
        """Return the symbols of a quantity."""
        if key not in self.quantities:
            self.quantities[key] = ca.SX.sym(".".join(filter(None, key)), self.names.size(key))
        return math.vector(self.quantities[key])

    def parameter(self, name: str, default: float) -> ca.SX:
        """Return the symbol of a parameter; one name has one value."""
        default = checks.number(default, f"the parameter {name!r}")
        value, symbol = self.parameters.setdefault(name, (default, ca.SX.sym(name)))
        if value != default:
            raise LinkworkError(
                f"the parameter {name!r} is given twice, as {value:g} and as {default:g}; give "
                "two names"
            )
        return symbol

    def reference(self, signal: Signal, what: str) -> np.ndarray:
        """Return the symbols of a signal's values at t (nu); what: what reads it."""
        for reference in self.references:
            if reference.signal is signal:
                return math.vector(reference.symbols)
        symbols = ca.SX.sym("reference", signal.coefficients.shape[2])
        self.references.append(Reference(signal, symbols, what))
        return math.vector(symbols)

    def trace(self, function: Law, read: Callable[[Any], ca.SX], what: str) -> ca.SX:
        """Return the column of what a function gives for the symbols.

        Args:
            function: of (t, state).
            read: makes a column of what the function returns.
            what: how to name it.

        Raises:
            LinkworkError: a function that cannot be called with symbols, in one sentence.
        """
        with warnings.catch_warnings():
            # NumPy's functions are welcome on symbols.
            warnings.simplefilter("ignore", FutureWarning)
            self.t.reference = partial(self.reference, what=what)
            try:
                result = function(self.t, self.state)
            except LinkworkError:
                raise
            except Exception as error:
                raise LinkworkError(
                    f"{what} cannot be traced with symbols ({reason(error)}); {cure(what)}"
                ) from error
        traced = Traced(function, read, read(result), what)
        self.traced.append(traced)
        return traced.column

    def check(self, span: tuple[float, float]) -> None:
        """Compare all traced functions with their own values at random states and times within a
        span [s].

        Raises:
            LinkworkError: values that differ: a function that branches on values or keeps memory.
        """
        symbols = [self.t, *self.quantities.values(), *self.extras.values()]
        symbols += [reference.symbols for reference in self.references]
        symbols += [symbol for _, symbol in self.parameters.values()]
        evaluate = ca.Function(
            "traced", symbols, [ca.densify(traced.column) for traced in self.traced]
        )
        parameters = {name: default for name, (default, _) in self.parameters.items()}
        random = np.random.default_rng(0)
        for _ in range(TRIALS):
            t = float(random.uniform(*span))
            values = {key: random.uniform(-1, 1, self.names.size(key)) for key in self.quantities}
            extras = random.uniform(-1, 1, len(self.extras))
            given = [
                t,
                *values.values(),
                *extras,
                *(of.signal(t) for of in self.references),
                *parameters.values(),
            ]
            state = numbers(self.names, values, extras, parameters)
            for traced, found in zip(
                self.traced, evaluate.call([ca.DM(value) for value in given]), strict=True
            ):
                require_same(traced, np.array(found, float).ravel(), t, state)


def require_same(traced: Traced, found: np.ndarray, t: float, state: Observation) -> None:
    """Refuse a traced function whose values with numbers are not those `found` with its symbols."""
    with np.errstate(all="ignore"):
        try:
            result = traced.read(traced.function(t, state))
        except Exception as error:
            raise LinkworkError(
                f"{traced.what} does other things with numbers than with symbols "
                f"({reason(error)}); {cure(traced.what)}"
            ) from error
    expected = np.array(ca.DM(ca.densify(result)), float).ravel()
    if found.shape != expected.shape or not agree(found, expected):
        raise LinkworkError(
            f"{traced.what} returns other values with numbers than it did with symbols: it "
            f"branches on values, or keeps memory from call to call; {cure(traced.what)}"
        )


def agree(found: np.ndarray, expected: np.ndarray) -> bool:
    """Tell whether values agree where both are finite, and neither alone is undefined somewhere:
    what is undefined is inf or nan as the order of the operations has it."""
    finite = np.isfinite(found), np.isfinite(expected)
    both = finite[0] & finite[1]
    alike = finite[0].all() == finite[1].all()
    return bool(alike and np.allclose(found[both], expected[both], AGREE, AGREE))


def ordered(values: Any, names: Sequence[str], what: str) -> np.ndarray:
    """Return numbers or symbols in the order of the names, from a sequence of all of them, or a
    mapping of some.

    Raises:
        LinkworkError: another number of values, or names that are not among them.
    """
    if isinstance(values, Mapping):
        unknown = [name for name in values if name not in names]
        if unknown:
            raise LinkworkError(
                f"{what} returns a value for {unknown[0]!r}; there are {', '.join(names) or 'none'}"
            )
        values = [values.get(name, 0.0) for name in names]
    missing = any(
        value is None for value in (values if isinstance(values, list | tuple) else [values])
    )
    try:
        array = None if missing else math.array(values)
    except (TypeError, ValueError):
        array = None
    if array is None:
        count = checks.amount(len(names), "number")
        raise LinkworkError(f"{what} returns {shown(values)}; give {count}: {', '.join(names)}")
    if array.size != len(names) or array.ndim > 2 or (not array.ndim and len(names) != 1):
        raise LinkworkError(
            f"{what} returns {checks.amount(array.size, 'value')}; give {len(names)}: "
            f"{', '.join(names) or 'none'}, in this order or by name"
        )
    return array.ravel()


def column(values: Any, names: Sequence[str], what: str) -> ca.SX:
    """Return what `ordered` does as a column."""
    return ca.vertcat(ca.SX(0, 1), *[ca.SX(value) for value in ordered(values, names, what)])


def shown(values: Any) -> str:
    """Show what a function returned in a sentence: text and numbers as such, all else by its
    kind."""
    if values is None or isinstance(values, str | int | float):
        return repr(values)
    kinds = (
        f" of {', '.join(type(value).__name__ for value in values)}"
        if isinstance(values, tuple | list) and values
        else ""
    )
    return f"a {type(values).__name__}{kinds}"


def cure(what: str) -> str:
    """Return what to do about a function that cannot be traced; a controller alone may be sampled
    instead."""
    sampled = ", or wrap it in a linkwork.control.Sampler" if what == CONTROLLER else ""
    return (
        "write it with linkwork.math (where, minimum ...) as a function of its arguments "
        f"alone{sampled}"
    )


def reason(error: BaseException) -> str:
    """Return an exception in a line: its kind, and the first line of its text that says something,
    if there is one."""
    if "truth value of a CasADi" in str(error):
        return "it branches on the value of a symbol"
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0][-120:]}" if lines else type(error).__name__
