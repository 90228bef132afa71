"""Sources of stiffness: name the spring, stop, damper or dry friction that bounds the steps of an
explicit method.

A freedom with the rates w = J v, in which a force grows by k with the displacement and by d with
the rate, answers by about

    sqrt(k a)  and  d a  per second,    a = J M^-1 J'

for a force is worth the accelerations a there.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX
from linkwork.equations.effects import Freedom, polynomial, size_of
from linkwork.equations.equations import Equations
from linkwork.runs.passage import Segment
from linkwork.runs.system import System

STIFF = 0.5  # rate times step from which on it is what bounds the step


def stiff_source(system: System, segment: Segment) -> str:
    """Return what is stiff where a run ended, with its joint or transmission; nothing if no such
    force bounds the steps."""
    last, equations = segment.trajectory, segment.chart.equations
    freedoms = equations.freedoms
    if not freedoms:
        return ""
    v = last.v_end[: equations.mobility]
    p = system.p(segment.chart)[: equations.p.numel()]
    M, *found = (np.array(part) for part in answers(equations)(last.q_end, v, p))
    rates = [
        (largest(J @ np.linalg.solve(M, J.T) @ slope) ** power, what, freedom.rates[0])
        for freedom, (J, *slopes) in zip(
            freedoms, zip(*[iter(found)] * 5, strict=True), strict=True
        )
        for slope, (what, power) in zip(slopes, PARTS, strict=True)
    ]
    rate, what, name = max(rates)
    if not rate * last.next_step > STIFF:
        return ""
    return f'take method="rodas", for {what} of {name} is stiff there (about {rate:.2g} 1/s)'


PARTS = (("the spring", 0.5), ("the stop", 0.5), ("the damper", 1.0), ("the dry friction", 1.0))


def answers(equations: Equations) -> ca.Function:
    """Return (q, v, p) -> M, and of every freedom J and how its spring, stop, damper and dry
    friction grow."""
    outputs = [equations.inertia[0]]
    for freedom in equations.freedoms:
        J = ca.mtimes(freedom.J, equations.elimination.L)
        outputs += [J, *slopes(freedom, ca.mtimes(J, equations.v))]
    dense = [ca.densify(SX(part)) for part in outputs]
    return ca.Function("answers", [equations.tree.q, equations.v, equations.p], dense)


def slopes(freedom: Freedom, w: ca.SX) -> Iterator[ca.SX]:
    """Yield how spring and stop grow with the displacement, damper and dry friction with the
    rates."""
    one, friction, spring = SX.eye(w.numel()), freedom.friction, freedom.spring
    yield one * polynomial([k * n for n, k in enumerate(spring.pulls, start=1)], freedom.reach)
    stop = SX(0)
    for end in freedom.ends:
        law, depth = end.pressing.law, ca.fmax(end.pressing.depth, 0)
        stop += law.stiffness * law.exponent * ca.constpow(depth, law.exponent - 1) * (depth > 0)
    yield one * stop
    damper = polynomial([c * n for n, c in enumerate(friction.smooth, start=1)], size_of(w))
    yield one * (damper + spring.damping)
    bristled = freedom.strain is not None and friction.bristle is not None
    dry = freedom.sliding(w) / freedom.softened(w) if freedom.dry and not bristled else SX(0)
    yield one * dry


def largest(A: np.ndarray) -> float:
    """Return the largest size of an eigenvalue, 0 where a number is not finite."""
    return float(np.abs(np.linalg.eigvals(A)).max()) if np.isfinite(A).all() else 0.0
