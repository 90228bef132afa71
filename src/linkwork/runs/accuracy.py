"""Accuracy: how far a run is from the exact motion, found by a companion, the same run at a tenth
of the tolerance.

Where steps are chosen by their errors a run goes astray by about e in proportion to the tolerance,
so that it differs from its companion by d = e - e_c = (1 - 1/10) e; with a fixed step h and a
method of order p by d = (1 - 2^-p) e from one at h / 2. What makes errors grow, a chaotic motion
say, makes them grow in the difference, too.

The message of a run tells of an error that is large beside the tolerance; with a fixed step, which
no tolerance bounds, of one that is large beside the coordinate itself. So a step tells that is too
long for a stiff spring or bristle, with which a run may come to its end all the same.

The companion is run when it is first asked for. It covers what MOST steps cover. Where it is
interrupted the error is not known, and asked for once more the message says that.
Source: Shampine, Numerical Solution of Ordinary Differential Equations (1994), on global errors by
reintegration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from linkwork.runs.passage import Departure, Passage, Segment
from linkwork.runs.settings import Settings
from linkwork.runs.system import System
from linkwork.simulation import FixedStep, Method
from linkwork.simulation.turns import SPAN

if TYPE_CHECKING:
    from linkwork.model.model import Model

TIGHTER, FINER = 0.1, 0.5  # tolerance, and step, of the companion, relative to the run's
LEAST = 1e-15  # relative tolerance of a companion that rounding leaves a meaning
MOST = 100_000  # steps of a companion
WORTH_TELLING = 1000.0  # times the tolerance
ROUGH = 0.01  # of the size, from which on errors of fixed steps are told


class Estimate(NamedTuple):
    """Tell the largest error of a run: relative to atol + rtol |y|, its value, of what, its unit,
    and when [s];
    until: the time that the companion came to [s].
    """

    ratio: float
    value: float
    name: str
    unit: str
    time: float
    until: float

    def __str__(self) -> str:
        where = f"{self.name} at t = {self.time:.6g} s"
        return f"Its error is about {self.value:.2g} {self.unit} ({where})"


@dataclass(frozen=True, eq=False)
class Compared:
    """Run a run again at a tighter tolerance: what led it, where it started, and what became of
    it."""

    robot: Model
    passage: Passage
    start: Departure
    segments: Sequence[Segment]
    given_up = False  # whether finding the error was interrupted

    @property
    def known(self) -> bool:
        """Whether there is a companion."""
        interrupted = bool(self.passage.system.faults)
        return not interrupted and repeatable(self.passage.system, self.passage.settings)

    @cached_property
    def _reached(self) -> tuple[np.ndarray, np.ndarray]:
        return reached(self.segments)

    @cached_property
    def companion(self) -> list[Segment]:
        """The run once more at a tenth of the tolerance, or half of the step, to the time that it
        came to."""
        times, _ = self._reached
        if not times[-1] > self.passage.start:
            return list(self.segments)
        settings = tightened(self.passage.settings).but(save_at=times)
        other = replace(
            self.passage,
            end=float(times[-1]),
            settings=settings,
            pace=None,
            watching=False,
            interruptible=False,
        )
        try:
            return list(other.segments(self.start))
        except KeyboardInterrupt:
            vars(self)["estimate"], vars(self)["given_up"] = None, True
            raise

    @cached_property
    def estimate(self) -> Estimate | None:
        """The largest error of the tree's coordinates and rates and of extra states; None where it
        is not known."""
        start, settings = self.passage.start, self.passage.settings
        t, y = self._reached
        if not self.known or not t[-1] > start:
            return None
        t_c, y_c = reached(self.companion)
        common, own, other = np.intersect1d(t, t_c, return_indices=True)
        if not (common > start).any():
            return None
        names, units = self.named
        y, y_c = y[:, : len(names)], y_c[:, : len(names)]
        size = np.abs(y).max(axis=0)
        size = np.where([unit == "rad" for unit in units], np.minimum(size, SPAN), size)
        allowed = settings.atol * self.own_units + settings.rtol * size
        error = compared(y[own], y_c[other], allowed, units, settings.integrator)
        k, m = np.unravel_index(np.argmax(error), error.shape)
        value = error[k, m] * allowed[m]
        return Estimate(
            float(error[k, m]),
            float(value),
            names[m],
            units[m],
            float(common[k]),
            float(common[-1]),
        )

    @property
    def caveat(self) -> str:
        """What is told of a large error, and what would lessen it; nothing where it is small."""
        found, settings = self.estimate, self.passage.settings
        if self.given_up:
            return " How far off it is, is not known: finding that was interrupted."
        step = settings.integrator.step
        most = WORTH_TELLING if step is None else ROUGH / settings.rtol
        if not (found and found.ratio > most):
            return ""
        if step is None:
            return (
                f" {found}, {found.ratio:.2g} times what rtol and atol allow a step; tighten them."
            )
        return (
            f" {found}, for which a step of {step:g} s is too long; take a shorter one, or "
            "leave method and step out."
        )

    @property
    def own_units(self) -> np.ndarray:
        """Units in which atol counts, of the tree's coordinates and rates, and of extra states, as
        in the run."""
        tree = self.robot.equations.tree
        return np.concatenate(
            [tree.units, tree.rate_units, np.ones(len(self.passage.system.extras))]
        )

    @property
    def named(self) -> tuple[list[str], list[str]]:
        """Names and units of the tree's coordinates and rates, and of extra states."""
        robot, extras = self.robot, self.passage.system.extras
        tree = robot.equations.tree
        names = [
            *tree.coordinates,
            *(f"the rate of {name}" for name in tree.rates),
            *(extra.name for extra in extras),
        ]
        units = [
            *map(robot.unit, tree.coordinates),
            *(f"{robot.unit(name)}/s" for name in tree.rates),
        ]
        return names, [*units, *(extra.unit for extra in extras)]


def repeatable(system: System, settings: Settings) -> bool:
    """Tell whether a run has a companion: not where a Python function is called, which may have a
    memory of its own, nor where rounding is all that a tighter tolerance would show.
    """
    tight = settings.integrator.step is None and TIGHTER * settings.rtol < LEAST
    return not tight and called_alike(system)


def called_alike(system: System) -> bool:
    """Tell whether a run can be run again: no Python function is called that may have a memory."""
    return system.sampler is None or system.sampler.compiled


def tightened(settings: Settings) -> Settings:
    """Return the settings of a companion."""
    method = settings.integrator
    if isinstance(method, FixedStep):
        return settings.but(max_steps=MOST, integrator=replace(method, step=FINER * method.step))
    return settings.but(max_steps=MOST, rtol=TIGHTER * settings.rtol, atol=TIGHTER * settings.atol)


def compared(
    y: np.ndarray, companion: np.ndarray, allowed: np.ndarray, units: Sequence[str], method: Method
) -> np.ndarray:
    """Return the errors of states (K, n) relative to what is allowed, atol + rtol |y|."""
    share = 1 - TIGHTER if method.step is None else 1 - FINER**method.order
    return np.abs(without_turns(y - companion, units)) / share / allowed


def without_turns(d: np.ndarray, units: Sequence[str]) -> np.ndarray:
    """Return differences (K, n), those of angles without whole turns."""
    angles, found = np.array([unit == "rad" for unit in units], bool), d.copy()
    found[:, angles] -= 2 * np.pi * np.rint(d[:, angles] / (2 * np.pi))
    return found


def reached(segments: Sequence[Segment]) -> tuple[np.ndarray, np.ndarray]:
    """Return the saved times of a run and its end, and (q, w, z) there: the tree's coordinates and
    rates, extra states."""
    t, y = [], []
    for segment in segments:
        part, known, equations = segment.trajectory, segment.crossed, segment.chart.equations
        n, chart = equations.mobility, segment.chart
        if known:  # rates do not follow from states near the pose
            q, v, _ = np.split(known.y, [equations.nq, equations.nq + n], axis=1)
            w, _ = chart.weighed(q, v, chart.p)
            t.append(part.t)
            y.append(np.column_stack([part.q, known.through(w, part.t), part.v[:, n:]]))
            continue
        q, v = np.vstack([part.q, part.q_end]), np.vstack([part.v, part.v_end])
        t.append(np.append(part.t, part.end_time))
        w, _ = chart.weighed(q, v[:, :n], chart.p)
        y.append(np.column_stack([q, w, v[:, n:]]))
    times, first = np.unique(np.concatenate(t), return_index=True)
    return times, np.concatenate(y)[first]
