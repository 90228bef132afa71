"""Switches: where what acts on a run branches, contacts included, and whether it jumps there.

What is traced branches by comparisons, and by what rounds numbers: `linkwork.math.where`, `sign`,
`floor`. Their values are the modes of what acts. Where the modes change within a step, the change
is found by halving the straight way between two places of it; if what acts jumps there, the
derivative of the steps lacks that. Where steps end at events, they are looked at on their own side.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.control.acting import Acting
from linkwork.control.joined import Joined
from linkwork.equations.algebra import SX
from linkwork.errors import LinkworkError
from linkwork.gradients.instants import at_instants
from linkwork.kernels import Kernel
from linkwork.mechanism import Mechanism, Plane
from linkwork.model.charts import CompiledChart
from linkwork.runs.system import System

STEPPING = {
    getattr(ca, f"OP_{name}")
    for name in ("LT", "LE", "EQ", "NE", "FLOOR", "CEIL", "SIGN", "FMOD", "COPYSIGN")
}
"""Operations that step."""
JUMP, NOISE = 1e-6, 1e-12
"""Change of a number of what acts that is a jump, relative to its size near by and the largest."""
BESIDE, LEAP = 2.0**-20, 1e-4
"""Of contacts, whose corners are rounded off within rounding: how far from a switch both sides are
looked at, relative to the step, and the change that is a jump."""
NEAR = 2.0**-40  # width of the way in which a change is found, relative to the step
MOST = 16  # changes within a step that are looked at


class Switching(NamedTuple):
    """Give (q, v, z, r, p) -> the modes, and what acts continuously: forces, rates, wrenches.

    what: as a refusal names it; beside: how far from a switch both sides are looked at, relative to
    the step; share: change that is a jump, relative to the size
    """

    modes: int
    kernel: Kernel
    what: str = "what acts"
    beside: float = 0.0
    share: float = JUMP


def switching(system: System, chart: CompiledChart, cost: int | None) -> Switching | None:
    """Return how what acts branches in a chart, and the cost, the event function of a number; None
    where they do not."""
    assert system.acting is not None
    if not branches(system.acting):
        return None
    joined, key = system.joined(chart), system.acting.key
    kernel = chart.compiled(f"{key} switches {cost}", lambda _: function(joined, cost))
    return Switching(kernel.outputs[0][1], kernel)


def touching(system: System, chart: CompiledChart) -> Switching | None:
    """Return how the forces of contacts branch in a chart; None where no normal leaps: it does over
    the edge of a field, the rim of a box, between capsules that turn past each other."""
    if system.acting is None or not edged(chart.equations.mechanism):
        return None
    key = f"{system.acting.key} touching"
    kernel = chart.compiled(key, lambda _: pressing(system.joined(chart)))
    return Switching(kernel.outputs[0][1], kernel, "the force of a contact", BESIDE, LEAP)


def edged(mechanism: Mechanism) -> bool:
    """Tell whether surfaces meet of which none is a plane."""
    contacts = mechanism.contacts.values()
    return any(not any(isinstance(of, Plane) for of in each.surfaces) for each in contacts)


def pressing(joined: Joined) -> ca.Function:
    """Return (q, v, z, r, p) -> modes, and the forces of contacts; beside them a force that counts,
    of the weight and of an acceleration of the own length per s^2: where parts begin to press, the
    forces of two neighbouring states are as different as rounding makes them."""
    told, equations, given = joined.contacts(), joined.equations, [*joined.inputs.values()]
    mass = sum((SX(body.mass) for body in equations.mechanism.bodies.values()), SX(0))
    size = mass * (ca.norm_2(equations.gravity) + equations.tree.length)
    found = ca.densify(ca.vertcat(SX(0, 1), *modes(told, given, SX(0, 1))))
    acts = ca.vertcat(told(*given)[0], size)
    return ca.Function("touching", given, [found, acts], [*joined.inputs], ["modes", "acts"])


@lru_cache(maxsize=256)
def branches(acting: Acting) -> bool:
    """Tell whether what acts has modes."""
    of = acting.function
    return any(of.instruction_id(k) in STEPPING for k in range(of.n_instructions()))


def function(joined: Joined, cost: int | None) -> ca.Function:
    """Return (q, v, z, r, p) -> modes, and what acts continuously."""
    acts = [joined.outputs[name] for name in ("force", "extra_rates", "wrenches")]
    paid = [] if cost is None else [joined.outputs["events"][cost]]
    plain, costs = (
        ca.Function("acts", [*joined.inputs.values()], [ca.densify(ca.vertcat(*parts))])
        for parts in (acts, paid)
    )
    # The motion is led over jumps at stated times; what is paid is summed up, step by step.
    given = plain.sx_in()
    of_time, at_no_time = given[3][: int(joined.acting.timed)], ca.SX(0, 1)
    found = [*modes(plain, given, of_time), *modes(costs, given, at_no_time)]
    together = ca.densify(ca.vertcat(at_no_time, *found)), ca.vertcat(plain(*given), costs(*given))
    return ca.Function("switches", given, together, [*joined.inputs], ["modes", "acts"])


def modes(of: ca.Function, given: list[ca.SX], of_time: ca.SX) -> list[ca.SX]:
    """Return the values of the operations of a function that step, as expressions; but for those of
    the `of_time` alone, which step at the same times whatever changes."""
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
    own: Switching, p: np.ndarray, t: np.ndarray, x: np.ndarray, fixed: bool
) -> None:
    """Refuse steps within which what branches jumps.

    Args:
        p: parameters; t, x: times (K, M) and (y, r) at M places of each step (K, M, n + nr), from
            its beginning to its end.
        fixed: whether their lengths are given, so that none ends at an event.
    """
    modes = at_instants(own.kernel, x, p)[0]
    change = (np.diff(modes, axis=1) != 0).any(axis=2)
    for i, k in np.argwhere(change):
        at = jump(own, x[i, k], x[i, k + 1], p)
        if at is not None:
            cure = "take a method that chooses its steps, and " if fixed else ""
            raise LinkworkError(
                f"{own.what} jumps at t = {t[i, k] + at * (t[i, k + 1] - t[i, k]):.6g} s, where no "
                f"step ends, so that derivatives would lack the jump; {cure}watch for the switch "
                "by an event that ends steps, Event(function, cuts=True)"
            )


def jump(own: Switching, start: np.ndarray, end: np.ndarray, p: np.ndarray) -> float | None:
    """Return where on the straight way from one state to another what acts jumps, from 0 to 1, or
    has changed more often than is looked at; None where it does not."""
    modes, kernel = own.modes, own.kernel

    def at(place: float) -> np.ndarray:
        return kernel.flat(start + place * (end - start), p)

    place, here, last = 0.0, at(0.0), at(1.0)
    sizes = np.maximum(np.abs(here[modes:]), np.abs(last[modes:]))
    for _ in range(MOST):
        if (here[:modes] == last[:modes]).all():
            return None
        low, high = place, 1.0
        while high - low > NEAR:
            middle = (low + high) / 2
            same = (at(middle)[:modes] == here[:modes]).all()
            low, high = (middle, high) if same else (low, middle)
        before, behind = (
            at(max(low - own.beside, 0.0))[modes:],
            at(min(high + own.beside, 1.0))[modes:],
        )
        sizes = np.maximum.reduce([sizes, np.abs(before), np.abs(behind)])
        if jumping(before, behind, sizes, own.share, NOISE).any():
            return high
        place, here = high, at(high)
    return place


def jumping(
    before: np.ndarray, behind: np.ndarray, sizes: np.ndarray, share: float, noise: float
) -> np.ndarray:
    """Tell which numbers jump: by more than a share of their sizes, and of the largest size than
    noise."""
    bounds = np.maximum(share * sizes, noise * sizes.max(initial=0.0))
    return np.abs(behind - before) > bounds
