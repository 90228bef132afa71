"""Run records: the quantities of a run over time, each found when it is first asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, cast

import numpy as np

from linkwork.model.chart_transfer import reread
from linkwork.model.reactions import Reactions, transmitted
from linkwork.model.state import State
from linkwork.runs import following
from linkwork.runs.passage import Segment
from linkwork.runs.quantities import (
    QUANTITIES,
    Axis,
    Place,
    SavedQuantity,
    axes_of,
    coords_of,
    is_told,
    labels,
)
from linkwork.runs.saved_states import Over, SavedStates
from linkwork.runs.system import System
from linkwork.runs.work import Work, work
from linkwork.simulation import Variable
from linkwork.simulation.turns import whole

if TYPE_CHECKING:
    from linkwork.model.model import Model


@dataclass(frozen=True, eq=False, repr=False)
class RunRecord(Mapping[str, Variable]):
    """Tell the quantities of a run at its saved times (K,) by name.

    besides: times of calls of a sampled controller, which were saved for the work between them
    start: the state that the run went out from; every: whether every step was saved
    """

    robot: Model
    system: System
    segments: Sequence[Segment]
    besides: np.ndarray
    start: State
    every: bool
    _found: dict[str, Variable] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Variable:
        if name not in self._found:
            self._found[name] = self._measured(self._quantity(name))
        if QUANTITIES[name].unless_zero and not self._found[name].values.any():
            raise KeyError(name)
        return self._found[name]

    def __repr__(self) -> str:
        return repr(dict(self))

    def __iter__(self) -> Iterator[str]:
        return (name for name in QUANTITIES if name in self)

    def __contains__(self, name: object) -> bool:
        quantity = QUANTITIES.get(cast(str, name))
        if quantity is None or not self._tells(quantity):
            return False
        return not quantity.unless_zero or super().__contains__(name)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @cached_property
    def _axes(self) -> dict[str, Axis]:
        wrenches = self.system.acting.wrenches if self.system.acting else ()
        pushed = tuple(wrench.body for wrench in wrenches)
        return self.robot.once(axes_of, self.system.extras, pushed)

    def _tells(self, quantity: SavedQuantity) -> bool:
        """Tell whether this run may have a quantity."""
        acts = self.system.acting is not None or not quantity.acting
        return acts and is_told(quantity, Place.RUN, self._axes)

    def _quantity(self, name: str) -> SavedQuantity:
        """Return a quantity that this run may have; raise KeyError for another."""
        if not self._tells(quantity := QUANTITIES[name]):
            raise KeyError(name)
        return quantity

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of a quantity, whose values are not found for it."""
        axes, saved = self._quantity(name).axes, sum(len(rows) for _, rows in self.kept)
        return (saved, *(len(self._axes[axis].names) for axis in axes))

    def _measured(self, quantity: SavedQuantity) -> Variable:
        if quantity.whole:  # found when it is asked for
            shape = self.shape(quantity.name)
            return quantity.told(partial(quantity.of, self), self.system, "time", shape=shape)
        values = np.concatenate([quantity.values(states) for states in self.states])
        return quantity.told(
            self._turned(values) if quantity.turning else values, self.system, "time"
        )

    @cached_property
    def kept(self) -> list[tuple[Segment, np.ndarray]]:
        """The segments with the rows that are kept."""
        return trimmed(self.segments, self.besides)

    @cached_property
    def time(self) -> np.ndarray:
        """The saved times (K,) [s]."""
        return np.concatenate([segment.trajectory.t[rows] for segment, rows in self.kept])

    @cached_property
    def states(self) -> list[SavedStates]:
        """The saved states, segment by segment."""
        return [saved_states(self.robot, self.system, *one) for one in self.kept]

    def coords(self) -> dict[str, Variable]:
        """Return the labels of the variables' axes, and the events."""
        found = {"time": Variable(("time",), self.time, {"units": "s"})}
        found |= coords_of(filter(self._tells, QUANTITIES.values()), self._axes)
        if self.system.events:
            parts = [segment.trajectory.events for segment in self.segments]
            names = [self.system.events[i].name for part in parts for i in part.index]
            times = np.concatenate([part.times for part in parts])
            found["event"] = labels("event", names)
            found["event_time"] = Variable(("event",), times, {"units": "s"})
        return found

    # What follows from a run as a whole

    @cached_property
    def _work(self) -> Work:
        return work(self.kept, self.states, self.every)

    @property
    def work(self) -> np.ndarray:
        """The work done on the mechanism since the start (K,) [J]."""
        return self._work.done

    @property
    def energy_balance(self) -> np.ndarray:
        """What the run has gained or lost of the energy beside the work (K,) [J]."""
        energy = self["kinetic_energy"].values + self["potential_energy"].values
        return energy - self._work.begun - self._work.done

    @cached_property
    def windings(self) -> tuple[np.ndarray, np.ndarray]:
        """Whole turns of joints' coordinates (K, m), and the times at which they were counted (K,)
        [s]."""
        return following.windings(self.robot, self.start, self.segments, self.every)

    def _turned(self, read: np.ndarray) -> np.ndarray:
        """Return coordinates of all joints that are read off the tree's (K, m) with their whole
        turns."""
        of = self.robot.labels
        if not of.may_wind:
            return read
        times, windings = self.windings
        at = np.searchsorted(times, self.time) if of.may_jump else slice(None)
        return of.turned(read, windings[at])

    def final_windings(self) -> dict[str, object]:
        """Return the whole turns of joints' coordinates at the end that the tree's do not tell, if
        there are any."""
        last = self.windings[1][-1] if self.robot.labels.may_wind else np.zeros(0)
        return {"final_windings": last} if last.any() else {}

    def final(self) -> State:
        """Return the last state: in the home chart where this tells its motion, else in the run's
        own."""
        robot, segment = self.robot, self.segments[-1]
        chart, home, done = segment.chart, robot.chart, segment.trajectory
        q, v = whole(done.q_end, done.turns), done.v_end[: robot.mobility]
        rates, kept = reread(robot, chart, home, done.q_end, v)
        if kept:
            chart = home
        else:
            robot.charts.setdefault(chart.independent, chart)
        state = robot.make_state(q, rates if kept else v)
        if robot.labels.may_wind:
            turned = robot.labels.turned(state.positions, self.windings[1][-1])
            state = replace(state, positions=turned)
        return replace(state, independent=chart.independent)

    def reactions(self, frame: str, length: float | None) -> Reactions:
        """Return the joint reactions at the saved times."""
        samples = [(one.over.nodes if one.over else one).samples for one in self.states]
        ends = np.cumsum([len(part.q) for part in samples])
        found = transmitted(self.robot, samples, (ends[-1],), frame, length)

        def saved(values: np.ndarray) -> np.ndarray:
            parts = zip(self.states, np.split(values, ends[:-1]), strict=True)
            return np.concatenate([one.over.through(x) if one.over else x for one, x in parts])

        gears = {name: saved(values) for name, values in found.gears.items()}
        wrenches, constraint = saved(found.wrenches), saved(found.constraint)
        return replace(found, wrenches=wrenches, constraint=constraint, gears=gears)


def trimmed(
    segments: Sequence[Segment], besides: Sequence[float] | np.ndarray = ()
) -> list[tuple[Segment, np.ndarray]]:
    """Return the segments with the rows to keep: an instant saved by two of them is kept once.

    besides: times that were saved, but not asked for
    """
    kept, end = [], -np.inf
    for segment in segments:
        t = segment.trajectory.t
        rows = np.arange(t.searchsorted(end, "right"), len(t))
        kept.append((segment, rows[~np.isin(t[rows], besides)] if len(besides) else rows))
        end = t[-1] if len(t) else end
    return kept


def saved_states(robot: Model, system: System, segment: Segment, rows: np.ndarray) -> SavedStates:
    """Return some of the states that a segment saved, and the way over a singular pose on which
    they lie."""
    part, crossed = segment.trajectory, segment.crossed
    y, t = part.rows[rows, 1 : 1 + part.y_end.size], part.t[rows]
    at, over = partial(SavedStates.of_run, robot, system, segment.chart), None
    if crossed is not None:
        over = Over(at(crossed.y, crossed.u), lambda values: crossed.through(values, t))
    return replace(at(y, part.u[rows]), t=t, residual=part.residual[rows], over=over)
