"""Numbers: what a run is differentiated with respect to, by name, and how it begins with them.

    dq = T d + q_p dp,    dv,    dz,    du,    dp

d are steps of the independent coordinates along their rates (of a free turn: its rotation vector),
with the loops closed; p are the free numbers of the mechanism, with the independent coordinates and
rates held, and the parameters of controllers and drives; du is added to the actuators' forces, or
to the commands of their drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate, chain

import numpy as np

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.gradients import run_kernels
from linkwork.gradients.chain import rates_jacobian
from linkwork.gradients.links import Changes, LossSlopes
from linkwork.gradients.retraced import Retraced
from linkwork.model.charts import CompiledChart
from linkwork.model.state import State
from linkwork.simulation import Sampled, stack

SAMPLES = "samples"  # the group of the values of forces that are given by samples
OPENED = 1e-6  # opening of a loop by a parameter, in own units, that is none
GROUPS = ("positions", "rates", "states", "forces", "parameters")


@dataclass(frozen=True, eq=False)
class Numbers:
    """The numbers that determine a run.

    of: the run
    """

    of: Retraced

    @cached_property
    def chart(self):
        """The chart of the state that the run went out from."""
        return self.of.robot.chart_of(self.of.record.start)

    @cached_property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """The names of all numbers, by group."""
        system, robot = self.of.system, self.of.robot
        return grouped(
            self.chart.independent,
            tuple(extra.name for extra in system.extras),
            robot.actuators if self.commands else (),
            (*robot.parameters, *self.of.acting.parameters),
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of all numbers, in their order."""
        names = tuple(chain.from_iterable(self.groups.values()))
        for name in self.of.acting.parameters:
            if name in (*GROUPS, SAMPLES) or names.count(name) > 1:
                raise LinkworkError(
                    f"the parameter {name!r} of what acts has the name of a group of numbers, or "
                    "of another number; give it another name to differentiate the run"
                )
        return names

    @cached_property
    def commands(self) -> range:
        """The columns of the integrator's inputs that are forces or commands over time; none where
        a controller gives these."""
        acting = self.of.acting
        read = sum(of.signal.coefficients.shape[2] for of in acting.references)
        columns = self.of.system.inputs.coefficients.shape[2] - read
        return range(int(acting.timed), columns)

    @cached_property
    def samples(self) -> tuple[str, ...]:
        """The names of the values of sampled forces or commands, row by row."""
        given = self.of.system.samples
        if given is None:
            return ()
        actuators = self.of.robot.actuators
        return tuple(f"{SAMPLES}.{name}.{k}" for k in range(len(given.times)) for name in actuators)

    @cached_property
    def shares(self) -> np.ndarray:
        """What each row of sampled values adds to the coefficients (4 pieces, N) of the inputs."""
        given = self.of.system.samples
        assert given is not None
        count = len(given.times)
        one_each = Sampled(given.times, np.eye(count), given.kind).signal
        return stack(one_each, self.of.system.inputs).coefficients[:, :, :count].reshape(-1, count)

    def by_samples(self, slopes: LossSlopes) -> np.ndarray:
        """Return derivatives (N, actuators) of a loss by the values of sampled forces."""
        return self.shares.T @ slopes.signal[:, list(self.commands)]

    def chosen(self, to: Sequence[str] | str | None) -> tuple[str, ...]:
        """Return the names asked for: of numbers, or of groups of them; all where none are, but for
        the values of samples."""
        names = self.names
        if to is not None:
            asked = [to] if isinstance(to, str) else list(checks.names(to, "to"))
            groups = self.groups | ({SAMPLES: self.samples} if self.samples else {})
            checks.known(asked, (*groups, *names, *self.samples), "number to differentiate by")
            found = [own for name in asked for own in groups.get(name, (name,))]
            names = tuple(dict.fromkeys(found))
        if own := self.of.robot.parameters:
            self.require_closed([name for name in names if name in own])
        return names

    @cached_property
    def begun(self) -> np.ndarray:
        """The Jacobian of the first (q, v, z) in all numbers (n, numbers)."""
        chart, robot, system = self.chart, self.of.robot, self.of.system
        state, first = self.of.record.start, self.of.segments[0]
        counts = tuple(map(len, self.groups.values()))
        found = begun_closed(state, chart, first.chart, counts, len(system.states))
        # States that tell turns are coordinates as they are read, or their opposites.
        followed = [name for names in self.of.acting.followed for name in names]
        if followed:
            q, own, found = state.q, chart.p.size, found.copy()
            kernel = chart.compiled("positions jacobian", run_kernels.positions_jacobian)
            read = robot.kernel("positions")(q)[0]
            rows = kernel.flat(q, chart.p).reshape(read.size, -1)
            places = [robot.coordinates.index(name) for name in followed]
            z = first.start[2][-len(followed) :]
            quaternion = np.array([robot.unit(name) == "1" for name in followed])
            signs = np.where(quaternion & (z * read[places] < 0), -1.0, 1.0)
            change, parameters = rows[:, : q.size] @ found[: q.size], sum(counts[:4])
            change[:, parameters : parameters + own] += rows[:, q.size :]
            found[-len(followed) :] = signs[:, None] * change[places]
        return found

    def require_closed(self, names: Sequence[str]) -> None:
        """Refuse free numbers that would open loops which redundant rows keep closed."""
        chart, q, known = self.chart, self.of.record.start.q, [*self.of.robot.parameters]
        if not names or not chart.equations.rows.names:
            return
        rows = chart.compiled("opened", run_kernels.opened).flat(q, chart.p)
        gaps = np.abs(rows.reshape(len(known), -1)).max(axis=1)
        for name in names:
            if gaps[known.index(name)] > OPENED:
                raise LinkworkError(
                    f"the loops would open with {name}, for the mechanism moves only while other "
                    "numbers fit it: there is no derivative by it"
                )

    def changes(self, names: Sequence[str]) -> Changes:
        """Return the changes of a run at its start along some numbers."""
        begun = np.hstack([self.begun, np.zeros((len(self.begun), len(self.samples)))])
        known = (*self.names, *self.samples)
        places = [known.index(name) for name in names]
        system, count, read = self.of.system, len(names), len(self.of.samples.t)
        p = system.p(self.of.segments[0].chart)
        pieces, _, columns = system.inputs.coefficients.shape
        dp, signal = np.zeros((count, p.size)), np.zeros((count, 4 * pieces, columns))
        parameters, forces = self.groups["parameters"], self.groups["forces"]
        for row, name in enumerate(names):
            if name in parameters:
                dp[row, parameters.index(name)] = 1
            elif name in forces:
                signal[row, ::4, self.commands[forces.index(name)]] = 1
            elif name in self.samples:
                sample, column = divmod(self.samples.index(name), len(self.commands))
                signal[row, :, self.commands[column]] = self.shares[:, sample]
        held = np.zeros((count, self.of.held))
        dy = np.ascontiguousarray(begun[:, places].T)
        samples = (np.zeros((read, *part.shape)) for part in (dy, held, dy[:, 0]))
        return Changes(dy, held, dp, signal, *samples)

    def slopes(self) -> LossSlopes:
        """Return derivatives of a loss of nothing, at the end of a run."""
        system, read = self.of.system, self.of.samples.y
        pieces, _, columns = system.inputs.coefficients.shape
        p = np.zeros(system.p(self.of.segments[0].chart).size)
        n, held, count = read.shape[1], self.of.held, len(read)
        return LossSlopes(
            np.zeros(n),
            np.zeros(held),
            p,
            np.zeros((4 * pieces, columns)),
            np.zeros((count, n)),
            np.zeros((count, held)),
            np.zeros(count),
        )

    def gathered(self, slopes: LossSlopes) -> np.ndarray:
        """Return the derivative of a loss with respect to all numbers."""
        found = slopes.y @ self.begun
        groups = self.groups
        ends = [*accumulate(map(len, groups.values()))]
        found[ends[3] :] += slopes.p
        sums = slopes.signal[::4].sum(axis=0)
        found[ends[2] : ends[3]] += sums[list(self.commands)[: len(groups["forces"])]]
        return found


@lru_cache(maxsize=64)
def begun_closed(
    state: State, chart: CompiledChart, first: CompiledChart, counts: tuple[int, ...], others: int
) -> np.ndarray:
    """Return the Jacobian of the first (q, v, z) in all numbers, without the states that tell
    turns; it is kept, for runs that go out from the same state.

    Args:
        state, chart: where the run goes out from, and the chart of its rates.
        first: the chart that the run starts in.
        counts: how many numbers each of `GROUPS` has; others: how many states z there are.
    """
    q, v, own = state.q, state.rates, chart.p.size
    n = v.size
    kernel = chart.compiled("starts along", run_kernels.starts_along)
    dq = kernel.flat(q, chart.p).reshape(n + own, q.size).T
    # Rates in the chart that the run starts in.
    w = rates_jacobian(chart, q, v)[list(first.equations.chart.independent)]
    dv_q, dv_v, dv_p = w[:, : q.size], w[:, q.size : q.size + n], w[:, q.size + n :]
    # Columns: positions, rates, extra states, forces, own parameters, others.
    ends = [*accumulate(counts)]
    positions, rates = slice(n), slice(ends[0], ends[0] + n)
    parameters = slice(ends[3], ends[3] + own)
    found = np.zeros((q.size + n + others, ends[-1]))
    of_q, of_v, of_z = found[: q.size], found[q.size : q.size + n], found[q.size + n :]
    of_q[:, positions], of_q[:, parameters] = dq[:, :n], dq[:, n:]
    of_v[:, positions], of_v[:, rates] = dv_q @ dq[:, :n], dv_v
    of_v[:, parameters] = dv_p + dv_q @ dq[:, n:]
    np.fill_diagonal(of_z[:, ends[1] : ends[2]], 1.0)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=256)
def grouped(
    independent: tuple[str, ...],
    extras: tuple[str, ...],
    actuators: tuple[str, ...],
    parameters: tuple[str, ...],
) -> dict[str, tuple[str, ...]]:
    """Return the names of numbers, by group."""
    return {
        "positions": tuple(f"positions.{name}" for name in independent),
        "rates": tuple(f"rates.{name}" for name in independent),
        "states": tuple(f"states.{name}" for name in extras),
        "forces": tuple(f"forces.{name}" for name in actuators),
        "parameters": parameters,
    }
