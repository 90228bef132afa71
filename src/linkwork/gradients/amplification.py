"""Amplification: whether the steps of a run tell of motions beside it.

A step of size h of an explicit method takes a small change along an eigenvector of df/dy, of the
value l, to R(h l) times itself, where the motion takes it to exp(h l) times:

    R(z) = 1 + z b' (1 - z A)^-1 1 = 1 + sum_k z^k b' A^(k-1) 1

Steps are chosen by the motion that a run makes. One beside it may swing or die out faster than they
are short: a robot at rest makes steps of any length, a hinge across the plane of a swing may have a
stiff spring, bristles stand across the way of what slides. Derivatives of the steps are then off by
|R - exp|, and where |R| > 1 they grow from one step to the next and mean nothing.
Source: Hairer & Wanner, Solving Ordinary Differential Equations II, 2nd ed. (1996), sec. IV.2.
"""

from __future__ import annotations

import warnings
from functools import cache, lru_cache

import numpy as np
from numpy.polynomial.polynomial import polyval

from linkwork.control.acting import Acting
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.gradients.instants import sampled
from linkwork.gradients.retraced import Retraced
from linkwork.gradients.run_kernels import joined_with
from linkwork.gradients.segment_rows import plans_of
from linkwork.model.charts import CompiledChart
from linkwork.simulation.fixed_steps import SymplecticEuler
from linkwork.simulation.rosenbrock import RODAS

LARGE, FEW = 1000.0, 16
"""Growth of derivatives from which on steps may have made it, and so few steps that they are looked
at in any case."""
MEANT = 10.0  # times by which steps may make changes larger that the motion does not
ASTRAY = 0.05  # part by which changes may be off
ACCURATE = 1.0  # |h l| up to which explicit steps follow a motion closely
POWER = 16  # of a matrix: the root of that power's norm is hardly more than its largest value
TINY = float(np.finfo(float).tiny)


def require_meant(of: Retraced, grown: float, stacklevel: int, few: float = FEW) -> None:
    """Refuse derivatives that the steps of explicit methods have made large by themselves, and warn
    of those that are off; where they have grown much, or the steps are few.

    grown: how many times larger they have become along the run
    """
    if not grown > LARGE and sum(part.trajectory.t.size for part in of.segments) > few:
        return
    parts = [judged(of, number) for number in range(len(of.segments))]
    excess, off, longest = (np.concatenate(part) for part in zip(*parts, strict=True))
    if not excess.size:
        return
    # The most that any sequence of steps adds to a change, beyond the motion.
    sums = np.append(0.0, np.cumsum(np.log10(excess)))
    most = float((sums - np.minimum.accumulate(sums)).max())
    shorter = f"run it with max_step={longest.min():.1g}"
    if grown > LARGE and most > np.log10(MEANT):
        raise LinkworkError(
            "the derivatives of this run mean nothing: its steps are too long for motions beside "
            f"it, which they let grow by 1e{most:.0f} where these swing or die out; {shorter}, or "
            "with method='rodas' if these die out"
        )
    if off.sum() > ASTRAY:
        warnings.warn(
            f"derivatives of this run may be off by {min(off.sum(), 1.0):.0%}: its steps are long "
            f"for motions beside it, which it does not make; {shorter}",
            ModelWarning,
            stacklevel=stacklevel,
        )


def judged(of: Retraced, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return by how much more than the motion each long step of a segment makes some change larger,
    by which part of it changes that last are off, and how long it may be; nothing of implicit
    methods and of systems whose Jacobian is too large to be written out."""
    segment = of.segments[number]
    part, weights = segment.trajectory, stability(segment.method)
    h = np.diff(part.t)
    if weights is None or not h.size or not written_out(of.acting, segment.chart):
        return np.empty(0), np.empty(0), np.empty(0)
    states = sampled(of.system, number, part, part.rows[:-1])
    slopes = of.partials(segment.chart, "derivatives", lambda joined: joined.derivatives, states)
    # Most steps are short for all motions by a norm alone.
    with np.errstate(over="ignore", invalid="ignore"):
        powers = np.linalg.matrix_power(h[:, None, None] * slopes.y, POWER)
        unsure = ~(np.linalg.norm(powers, axis=(1, 2)) ** (1 / POWER) < ACCURATE / 2)
    h, values = h[unsure], np.linalg.eigvals(slopes.y[unsure])
    z = h[:, None] * values
    told, true = polyval(z, weights), np.exp(z)
    size = np.maximum(np.abs(true), 1.0)
    excess, off = np.abs(told) / size, np.where(z.real > -1.0, np.abs(told - true) / size, 0.0)
    fastest = np.abs(values).max(axis=1, initial=TINY)
    return excess.max(axis=1, initial=TINY), off.max(axis=1, initial=0.0), ACCURATE / fastest


@lru_cache(maxsize=256)
def written_out(acting: Acting, chart: CompiledChart) -> bool:
    """Tell whether the Jacobian of runs is small enough to be written out."""
    return not joined_with(acting).joined(chart).large


@cache
def stability(method: str) -> np.ndarray | None:
    """Return the coefficients of R by powers, of an explicit method of this name; None of others,
    whose steps do not make changes larger."""
    if method in (RODAS.name, SymplecticEuler.name):
        return None
    plan, _ = plans_of(method)
    A, b = plan.a[: plan.solution, : plan.solution], plan.a[plan.solution, : plan.solution]
    powers = [np.ones(plan.solution)]
    while len(powers) < plan.solution:
        powers.append(A @ powers[-1])
    return np.array([1.0, *(b @ power for power in powers)])
