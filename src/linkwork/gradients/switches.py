"""Switches: where what acts on a run branches, and whether it jumps there.

What is traced branches by comparisons, and by what rounds numbers: `linkwork.math.where`, `sign`,
`floor`. Their values are the modes of what acts. Where the modes change within a step, the change
is found by halving the straight way between both ends; if what acts jumps there, the derivative of
the steps lacks that, unless the step ended at an event.
"""

from __future__ import annotations

from collections.abc import Set
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.control.acting import Acting
from linkwork.control.joined import Joined
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.model.charts import CompiledChart
from linkwork.runs.system import System

STEPPING = {
    getattr(ca, f"OP_{name}")
    for name in ("LT", "LE", "EQ", "NE", "FLOOR", "CEIL", "SIGN", "FMOD", "COPYSIGN")
}
"""Operations that step."""
JUMP = 1e-6  # change of what acts, relative to its size, that is a jump
NEAR = 2.0**-40  # width of the way in which a change is found, relative to the step
MOST = 16  # changes within a step that are looked at


class Switching(NamedTuple):
    """Give (q, v, z, r, p) -> the modes, and what acts continuously: forces, rates, wrenches."""

    modes: int
    kernel: Kernel


def switching(system: System, chart: CompiledChart, cost: int | None) -> Switching | None:
    """Return how what acts branches in a chart, and the cost, the event function of a number; None
    where they do not."""
    assert system.acting is not None
    if not branches(system.acting):
        return None
    joined, key = system.joined(chart), system.acting.key
    kernel = chart.compiled(f"{key} switches {cost}", lambda _: function(joined, cost))
    return Switching(kernel.outputs[0][1], kernel)


@lru_cache(maxsize=256)
def branches(acting: Acting) -> bool:
    """Tell whether what acts has modes."""
    of = acting.function
    return any(of.instruction_id(k) in STEPPING for k in range(of.n_instructions()))


def function(joined: Joined, cost: int | None) -> ca.Function:
    """Return (q, v, z, r, p) -> modes, and what acts continuously."""
    acts = [joined.outputs[name] for name in ("force", "extra_rates", "wrenches")]
    acts += [] if cost is None else [joined.outputs["events"][cost]]
    plain = ca.Function("acts", [*joined.inputs.values()], [ca.densify(ca.vertcat(*acts))])
    given = plain.sx_in()
    of_time = given[3][: int(joined.acting.timed)]
    found = [ca.densify(ca.vertcat(ca.SX(0, 1), *modes(plain, given, of_time))), plain(*given)]
    return ca.Function("switches", given, found, [*joined.inputs], ["modes", "acts"])


def modes(of: ca.Function, given: list[ca.SX], of_time: ca.SX) -> list[ca.SX]:
    """Return the values of the operations of a function that step, as expressions; but for those of
    the time alone, which step at the same times whatever changes."""
    work: dict[int, ca.SX] = {}
    found, fixed = [], {x.element_hash() for x in ca.symvar(of_time)}
    flat = [ca.vertsplit(ca.vec(x)) for x in given]
    for k in range(of.n_instructions()):
        op = of.instruction_id(k)
        inputs = of.instruction_input(k)
        outputs = of.instruction_output(k)
        if op == ca.OP_INPUT:
            work[outputs[0]] = flat[inputs[0]][inputs[1]]
        elif op == ca.OP_CONST:
            work[outputs[0]] = ca.SX(of.instruction_constant(k))
        elif op != ca.OP_OUTPUT:
            args = [work[i] for i in inputs]
            value = ca.SX.unary(op, *args) if len(args) == 1 else ca.SX.binary(op, *args)
            work[outputs[0]] = value
            if op in STEPPING and {x.element_hash() for x in ca.symvar(value)} - fixed:
                found.append(value)
    return found


def require_no_jumps(
    own: Switching, p: np.ndarray, t: np.ndarray, x: np.ndarray, ended: Set[int]
) -> None:
    """Refuse a run on which what acts jumps where no step ended.

    Args:
        p: parameters; t, x: times (K) and (y, r) at the ends of steps (K, n + nr), inputs as they
            are behind them.
        ended: rows at which a step ended at an event.
    """
    ends = np.cumsum([size for _, size in own.kernel.inputs])[:-2]
    rows = own.kernel(*np.split(x, ends, axis=1), p)[0]
    for i in np.flatnonzero((np.diff(rows, axis=0) != 0).any(axis=1)):
        if ended & {i, i + 1}:
            continue
        at = jump(own, x[i], x[i + 1], p)
        if at is not None:
            raise LinkworkError(
                f"what acts jumps at t = {t[i] + at * (t[i + 1] - t[i]):.6g} s, where no step ends,"
                " so that derivatives would lack the jump; watch for the switch by an event that "
                "ends steps, Event(function, cuts=True)"
            )


def jump(own: Switching, start: np.ndarray, end: np.ndarray, p: np.ndarray) -> float | None:
    """Return where on the straight way from one state to another what acts jumps, from 0 to 1;
    None where it does not."""
    modes, kernel = own.modes, own.kernel

    def at(place: float) -> np.ndarray:
        return kernel.flat(start + place * (end - start), p)

    place, here, last = 0.0, at(0.0), at(1.0)
    for _ in range(MOST):
        if (here[:modes] == last[:modes]).all():
            return None
        low, high = place, 1.0
        while high - low > NEAR:
            middle = (low + high) / 2
            same = (at(middle)[:modes] == here[:modes]).all()
            low, high = (middle, high) if same else (low, middle)
        before, behind = at(low)[modes:], at(high)[modes:]
        size = np.maximum(np.abs(before), np.abs(behind)).max(initial=0.0)
        if np.abs(behind - before).max(initial=0.0) > JUMP * size:
            return high
        place, here = high, at(high)
    return None
