"""Timely: what depends on time alone in what acts on a robot, and does more than the stages of a
step may see.

A traced function of time, a pulse say, has no knots that the integrator could step onto. In the
graph of what acts the largest expressions in time and parameters alone are found once; before a run
they are evaluated at LOOKS + 1 times, equally far apart. Those whose third differences bend more
than twice over the run are watched like sampled signals (`simulation.bends`): no step passes over
them unseen. So a pulse is found if three or four of these times fall on it: one of 10 ms in a run
of 10 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from linkwork.kernels import Kernel
from linkwork.simulation import Signal
from linkwork.simulation.signals import FREE

LOOKS = 4096
STILL, TIMELY, OTHER = range(3)  # depends on parameters at most, on time as well, on something else


@dataclass(frozen=True, eq=False)
class Timely:
    """Hold a function (t, parameters) -> expressions of time; the last `events` of them are read by
    event functions."""

    function: ca.Function
    events: int

    def scanned(
        self, kernel: Kernel, parameters: np.ndarray, span: tuple[float, float]
    ) -> tuple[Signal | None, int]:
        """Return what varies within a span [s] as a signal, None if nothing does so often, and how
        many columns events read.

        kernel: of the function.
        """
        return _scanned(kernel, self.events, tuple(parameters.tolist()), span)


def timely(t: ca.SX, parameters: ca.SX, acting: ca.SX, events: ca.SX) -> Timely | None:
    """Return the largest expressions of time alone in what acts and in event functions; None if
    there are none.

    Args:
        t, parameters: symbols.
        acting, events: what depends on them.
    """
    parts = [expressions(column, t, parameters) for column in (acting, events)]
    if not any(parts):
        return None
    values = ca.densify(ca.vertcat(*parts[0], *parts[1]))
    return Timely(ca.Function("timely", [t, parameters], [values], {"cse": True}), len(parts[1]))


def expressions(column: ca.SX, t: ca.SX, parameters: ca.SX) -> list[ca.SX]:
    """Return the largest expressions of t and parameters alone in a column, but for t itself and
    those without it."""
    # The column as a straight line of instructions in t, the parameters and all other symbols.
    known = {symbol.element_hash() for symbol in (t, *ca.vertsplit(parameters))}
    symbols = [s for s in ca.symvar(column) if s.element_hash() not in known]
    function = ca.Function(
        "column", [t, parameters, ca.vertcat(ca.SX(0, 1), *symbols)], [ca.densify(column)]
    )
    inputs = [ca.vertsplit(t), ca.vertsplit(parameters) if parameters.numel() else []]
    # Of every value: whether it is made of t, of parameters and numbers alone, or of anything else;
    # and its expression.
    kinds: dict[int, int] = {}
    values: dict[int, ca.SX] = {}
    found: dict[int, ca.SX] = {}
    for k in range(function.n_instructions()):
        operation, places = function.instruction_id(k), function.instruction_input(k)
        (target, *_), kind, value = function.instruction_output(k), OTHER, ca.SX(0)
        # Inputs and constants tell their own kind; a result is of the strongest of its operands.
        if operation == ca.OP_INPUT:
            argument, place = places
            if argument < len(inputs):
                kind, value = (TIMELY, STILL)[argument], inputs[argument][place]
        elif operation == ca.OP_CONST:
            kind, value = STILL, ca.SX(function.instruction_constant(k))
        else:
            kind = OTHER if operation == ca.OP_OUTPUT else max(kinds[place] for place in places)
            # Here an expression of t and parameters alone meets something else: it is as large as
            # it gets.
            if kind == OTHER:
                for place in places:
                    if kinds[place] == TIMELY and not values[place].is_symbolic():
                        found[values[place].element_hash()] = values[place]
            else:
                of = [values[place] for place in places]
                value = (
                    ca.SX.unary(operation, *of) if len(of) == 1 else ca.SX.binary(operation, *of)
                )
        if operation != ca.OP_OUTPUT:
            kinds[target], values[target] = kind, value
    return list(found.values())


@lru_cache(maxsize=64)
def _scanned(
    kernel: Kernel, events: int, parameters: tuple[float, ...], span: tuple[float, float]
) -> tuple[Signal | None, int]:
    times = np.linspace(*span, LOOKS + 1)
    (values,) = kernel(times[:, None], np.array(parameters))
    values[~np.isfinite(values)] = 0.0
    signal = through(times, values)
    often = np.bincount(signal.bends[:-1, 1].astype(int), minlength=values.shape[1]) > FREE
    if not often.any():
        return None, 0
    return through(times, values[:, often]), int(often[len(often) - events :].sum())


def through(times: np.ndarray, values: np.ndarray) -> Signal:
    """Return a signal through values (N, n) at times (N,) equally far apart.

    A piece has the second difference at its start, so that third differences are the changes from
    piece to piece.
    """
    d = (times[-1] - times[0]) / (len(times) - 1)
    second = np.zeros_like(values)
    second[1:-1] = (values[2:] - 2 * values[1:-1] + values[:-2]) / (2 * d**2)
    second[0], second[-1] = second[1], second[-2]
    third = np.diff(second, axis=0) / (3 * d)
    first = np.diff(values, axis=0) / d - d * (second[:-1] + d * third)
    coefficients = np.stack([values[:-1], first, second[:-1], third], axis=1)
    return Signal(times, np.ascontiguousarray(coefficients), np.empty(0))
