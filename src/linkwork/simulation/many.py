"""Integrate many members: check what is asked, deal chunks of them to threads, and keep what is
done.

Each thread runs the compiled loop of `lanes` on a chunk at a time, without Python's lock. A chunk
is long enough that its ends, where registers run empty, cost little, and short enough that all
threads end together. All that is as long as there are members is written by the threads, chunk by
chunk: to fill memory that no one has touched yet takes its time, too.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import LinkworkError
from linkwork.simulation import lane_tables as rows
from linkwork.simulation.admission import require_cover, require_run, times_within, tolerances
from linkwork.simulation.events import Events
from linkwork.simulation.integration import search_for_events, stability
from linkwork.simulation.signals import Sampled, Signal, as_signal
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import DORMAND_PRINCE, Tableau
from linkwork.simulation.turns import Turning
from linkwork.threads import dealt, usable_processors

if TYPE_CHECKING:
    from linkwork.simulation.lane_events import Occasions
    from linkwork.simulation.lane_inputs import Signals
    from linkwork.simulation.lane_watch import LaneSignals

LARGEST_CHUNK = 2048
CHUNKS_PER_THREAD = 4
NO_BENDS = np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Hold what N integrations computed, a row for each member.

    `status` (N,), numbers of `Status`; `end_time` (N,) in s and `y_end` (N, n), the last states
    reached; `samples` (N, K, n), the states at the saved times, of which a member has the first
    `saved` (N,), the others are nan; `nfev`, `steps`, `rejected` (N,): evaluations of the motion
    kernel, accepted and rejected steps; `pivot` (N,), the smallest pivot met; `closure_error` (N,),
    the largest residual of the samples and of the first and last state; `next_step` (N,), in s;
    `rejected_pivot`, `rejected_residual` (N,): why a step was last refused; `turns` (N, nq), the
    whole turns of angles that are not in `y_end`; `events`, rows (t, y, u, residual, event,
    member).
    """

    status: np.ndarray
    end_time: np.ndarray
    y_end: np.ndarray
    samples: np.ndarray
    saved: np.ndarray
    nfev: np.ndarray
    steps: np.ndarray
    rejected: np.ndarray
    pivot: np.ndarray
    closure_error: np.ndarray
    next_step: np.ndarray
    rejected_pivot: np.ndarray
    rejected_residual: np.ndarray
    turns: np.ndarray
    events: np.ndarray


@dataclass(frozen=True, eq=False)
class MemberInputs:
    """Hold the inputs of members: their signals one after the other, or one signal that all share.

    `starts` (P,) in s and `coefficients` (P, powers, nu) of all pieces; `pieces` (S + 1,): signal i
    has those from pieces[i] to pieces[i + 1]; `breaks`, and `breaking` (S + 1,) likewise; `varies`:
    whether any signal is not constant over the run; `bends` (T, 3) of all signals (`bends`), and
    `bending` (S + 1,).
    """

    starts: np.ndarray
    coefficients: np.ndarray
    pieces: np.ndarray
    breaks: np.ndarray
    breaking: np.ndarray
    varies: bool
    bends: np.ndarray
    bending: np.ndarray

    @property
    def cubic(self) -> "MemberInputs":
        """The same with all four powers, as single runs take them."""
        lacking = 4 - self.coefficients.shape[1]
        table = np.pad(self.coefficients, [(0, 0), (0, lacking), (0, 0)])
        return replace(self, coefficients=table) if lacking else self

    @property
    def signals(self) -> "Signals":
        """The signals as the compiled loop follows them."""
        from linkwork.simulation.lane_inputs import Signals

        return Signals(
            self.starts, self.coefficients, self.pieces, self.breaks, self.breaking, self.varies
        )

    @property
    def watched(self) -> "LaneSignals":
        """The signals as the compiled loop watches them."""
        from linkwork.simulation.lane_watch import LaneSignals

        return LaneSignals(self.starts, self.coefficients, self.pieces, self.bends, self.bending)


@dataclass(frozen=True, eq=False)
class Occasion:
    """Watch for events in many members: the kernels of one state (motion, closure), of the event
    functions for one state and for states side by side, by their addresses, and the `Events`."""

    motion: int
    closure: int
    wide: int
    events: Events

    @property
    def asked(self) -> "Occasions":
        """What the compiled loop takes."""
        from linkwork.simulation.lane_events import Occasions
        from linkwork.simulation.lane_happenings import ADDRESS

        # Numba's loop takes a plain tuple of addresses here.
        alone: Any = self.motion, self.closure, 0, self.events.address, 0, search_for_events()
        return Occasions(alone, self.wide, self.events.table, ADDRESS)


def none_watched() -> "Occasions":
    """Return what the compiled loop takes where nothing is watched for."""
    from linkwork.simulation.lane_events import Occasions

    alone: Any = (0,) * 6
    return Occasions(alone, 0, np.empty((0, 2)), 0)


@dataclass(frozen=True, eq=False)
class Starts:
    """Say where M members set out, and how far each is to go, by columns (M,).

    numbers: when it starts and stops [s], and the relative pivot at which it stops
    counts: its row of the tables of inputs and parameters; the steps that it may take; of the times
        to save at, the first one's number and the one before which it ends
    turns (M, nq): whole turns of angles that are not in their states
    first_steps: of their steps (M,) [s]; 0 where it is guessed
    """

    numbers: tuple[np.ndarray, np.ndarray, np.ndarray]
    counts: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    turns: np.ndarray
    first_steps: np.ndarray | float = 0.0

    @classmethod
    def alike(
        cls, members: int, numbers: tuple[float, float, float], most: int, times: int, nq: int
    ) -> "Starts":
        """Return those of members that all have the same numbers, steps and times to save at."""
        start, stop, bound = (np.broadcast_to(number, members) for number in numbers)
        steps, first, last = (np.broadcast_to(count, members) for count in (most, 0, times))
        turns = np.broadcast_to(0.0, (members, nq))
        return cls((start, stop, bound), (np.arange(members), steps, first, last), turns)

    def tables(self, chunk: slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers (M, 4) and counts (M, 4) of some members."""
        first_steps = np.broadcast_to(self.first_steps, self.numbers[0].shape)
        numbers, counts = (
            np.column_stack([column[chunk] for column in columns])
            for columns in ((*self.numbers, first_steps), self.counts)
        )
        return numbers, counts


def as_inputs(
    inputs: MemberInputs | Signal | Sampled | Sequence[Signal] | ArrayLike, members: int
) -> MemberInputs:
    """Return the inputs of all members: a signal or numbers (nu,) for all, numbers (N, nu) or N
    signals for each.

    Numbers that are not finite are let through: they end their own member's run, and no other.
    """
    if isinstance(inputs, MemberInputs):
        return inputs
    if isinstance(inputs, Signal | Sampled):
        return _joined([as_signal(inputs)])
    if (
        isinstance(inputs, Sequence)
        and inputs
        and all(isinstance(signal, Signal) for signal in inputs)
    ):
        if len(inputs) != members:
            raise LinkworkError(
                f"there are {len(inputs)} signals for {members} members: give one, or one for each"
            )
        return _joined(inputs)  # pyright: ignore[reportArgumentType]
    table = _rows("the inputs", inputs, members)  # pyright: ignore[reportArgumentType]
    count = np.arange(len(table) + 1)
    none = np.zeros(len(table) + 1, dtype=np.intp)
    coefficients = np.require(table, requirements="W")[:, None]
    return MemberInputs(
        np.zeros(len(table)), coefficients, count, np.empty(0), none, False, NO_BENDS, none
    )


def _joined(signals: Sequence[Signal]) -> MemberInputs:
    widths = {signal.coefficients.shape[2] for signal in signals}
    if len(widths) > 1:
        raise LinkworkError(
            f"the members' signals have {' and '.join(map(str, sorted(widths)))} inputs: give "
            "equally many"
        )
    return MemberInputs(
        np.concatenate([signal.knots[:-1] for signal in signals]),
        np.concatenate([signal.coefficients for signal in signals]),
        _ends(signal.coefficients for signal in signals),
        np.concatenate([signal.breaks for signal in signals]),
        _ends(signal.breaks for signal in signals),
        any(
            len(signal.coefficients) > 1 or bool(signal.coefficients[:, 1:].any())
            for signal in signals
        ),
        np.concatenate([signal.bends for signal in signals]),
        _ends(signal.bends for signal in signals),
    )


def _ends(tables: Iterable[np.ndarray]) -> np.ndarray:
    """Return where tables begin, one after the other, and the last one ends."""
    return np.array([0, *accumulate(map(len, tables))], dtype=np.intp)


def integrate_many(
    motion: int,
    closure: int | None,
    y: ArrayLike,
    inputs: MemberInputs | Signal | Sampled | Sequence[Signal] | ArrayLike,
    parameters: ArrayLike = (),
    *,
    nq: int,
    duration: float,
    start: float = 0.0,
    rtol: ArrayLike = 1e-8,
    atol: ArrayLike = 1e-10,
    save_at: ArrayLike = (),
    max_step: float = math.inf,
    max_steps: int = 1_000_000,
    pivot_bound: float = 1e-4,
    closure_tol: float = 1e-13,
    method: Tableau = DORMAND_PRINCE,
    leave_stiff: bool = False,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    turning: Turning | None = None,
    redundant: bool = False,
    watch: MemberInputs | Signal | Sequence[Signal] | None = None,
    starts: Starts | None = None,
    occasion: Occasion | None = None,
) -> Outcomes:
    """Integrate N members as `integrate` does each of them, many at a time.

    Arguments, where they differ from those of `integrate`:
        motion, closure: addresses of the kernels for states side by side, void(const double *,
        double *). y: states y = (q, v, z) at the start (N, n), of which the first nq are q.
        inputs: u for all members: numbers (nu,), `Sampled` or a `Signal`; or of each: numbers
        (N, nu), or N signals. parameters: p (np,) for all members, or (N, np).
        save_at: increasing times (K,), s, common to all members, at which to save; none: only the
        last states are kept. method: an explicit embedded pair.
        threads: of the processor to use; None: all.
        watch: signals of which no step passes over what its stages have not seen, one or N; None:
            the inputs.
        progress: called with the numbers of members that have ended and of all members, now and
            then.
        starts: where each member sets out and how far it goes, where that is not the same for all;
            its rows are those of the inputs, of the parameters and of what is watched.
        occasion: events to watch for.

    Returns the `Outcomes`. A member that fails has its status, and the others go on; so has every
    member that was not ended when KeyboardInterrupt came, CANCELLED, wherever it was; it is raised
    where all had ended.

    Raises `LinkworkError` as `integrate` does.
    """
    # What is asked for is possible.
    require_run(duration, max_steps)
    stop = start + duration
    given = np.asarray(y, dtype=float)
    if given.ndim != 2 or not given.shape[1]:
        raise LinkworkError(f"the states have the shape {given.shape}: give a row for each member")
    members, n = given.shape
    require_covers(inputs, start, stop)
    times = times_within(np.atleast_1d(save_at), start, stop)
    tolerance, turning = tolerances(rtol, atol, n), turning or Turning.none(nq)
    # Where each member starts, its parameters and its inputs.
    if starts is None:
        own = start, stop, pivot_bound
        starts = Starts.alike(members, own, max_steps, times.size, nq)
        p = _rows("the parameters", parameters, members)
    else:
        p = np.atleast_2d(np.asarray(parameters, dtype=float, order="C"))
    forces = as_inputs(inputs, members)
    watched = forces if watch is None else as_inputs(watch, members)
    forces = forces if occasion is None else forces.cubic

    from linkwork.simulation import lanes

    # As the compiled loop takes it.
    asked = (
        lanes.Kernels(motion, closure or 0, 0, 0, 0, 0),
        method.plan.table,
        lanes.Demands(
            float(closure_tol), stability(method, leave_stiff), float(max_step), redundant
        ),
        lanes.Sizes(tolerance, turning.table[:2].copy()),
        p,
        forces.signals,
        watched.watched,
        none_watched() if occasion is None else occasion.asked,
    )
    return _outcomes(asked, given, starts, times, threads or usable_processors(), progress)


def _outcomes(
    asked: tuple[object, ...],
    given: np.ndarray,
    starts: Starts,
    times: np.ndarray,
    threads: int,
    progress: Callable[[int, int], None] | None,
) -> Outcomes:
    """Return what comes of members: the compiled loop's first arguments, their states, starts and
    the times to save at."""
    from linkwork.simulation import lanes

    # What is as long as there are members is filled by the threads, chunk by chunk.
    members, n = given.shape
    states, samples = np.empty((members, n)), np.empty((members, times.size, n))
    numbers = np.empty((members, rows.NUMBERS))
    counts = np.empty((members, rows.COUNTS), dtype=np.intp)
    turns = np.empty(starts.turns.shape)
    cancel = np.zeros(1, dtype=np.intp)
    size = min(LARGEST_CHUNK, max(lanes.LANES, -(-members // (CHUNKS_PER_THREAD * threads))))
    chunks = [slice(first, min(first + size, members)) for first in range(0, members, size)]
    ended = np.zeros((len(chunks), 1), dtype=np.intp)
    found: dict[int, np.ndarray] = {}

    # One chunk: integrated, or marked as cancelled; times that were not reached are not there.
    def run(i: int) -> bool:
        chunk = chunks[i]
        states[chunk], turns[chunk] = given[chunk], starts.turns[chunk]
        if cancel[0]:
            counts[chunk], numbers[chunk] = 0, np.nan
            counts[chunk, rows.STATUS] = Status.CANCELLED
            counts[chunk, rows.SAVED] = starts.counts[2][chunk]
            numbers[chunk, rows.TIME] = starts.numbers[0][chunk]
        else:
            roster = lanes.Roster(states[chunk], turns[chunk], *starts.tables(chunk))
            results = lanes.Results(samples[chunk], numbers[chunk], counts[chunk], ended[i])
            found[i] = lanes.integrate(*asked, roster, times, results, cancel)
            found[i][:, -1] += chunk.start
        kept = np.arange(times.size)
        saved = (kept >= starts.counts[2][chunk, None]) & (kept < counts[chunk, rows.SAVED, None])
        samples[chunk][~saved] = np.nan
        return not (counts[chunk, rows.STATUS] == Status.CANCELLED).any()

    def report() -> None:
        if progress is not None:
            progress(int(ended.sum()), members)

    # Chunk by chunk over the threads.
    dealt(run, len(chunks), threads, report, partial(cancel.fill, 1))
    return Outcomes(
        status=counts[:, rows.STATUS].copy(),
        end_time=numbers[:, rows.TIME],
        y_end=states,
        samples=samples,
        saved=counts[:, rows.SAVED],
        nfev=counts[:, rows.EVALUATIONS],
        steps=counts[:, rows.ACCEPTED],
        rejected=counts[:, rows.REJECTED],
        pivot=numbers[:, rows.PIVOT],
        closure_error=numbers[:, rows.CLOSURE_ERROR],
        next_step=numbers[:, rows.STEP_SIZE],
        rejected_pivot=numbers[:, rows.REJECTED_PIVOT],
        rejected_residual=numbers[:, rows.REJECTED_RESIDUAL],
        turns=turns,
        events=np.concatenate([found[i] for i in sorted(found)] or [np.empty((0, n + 4))]),
    )


def _rows(what: str, values: ArrayLike, members: int) -> np.ndarray:
    """Return a table with one row, or one for each member."""
    table = np.atleast_2d(np.asarray(values, dtype=float, order="C"))
    if table.ndim != 2 or len(table) not in (1, members):
        raise LinkworkError(
            f"{what} have the shape {table.shape}: give a row for each of the {members} members, "
            "or one"
        )
    return table


def require_covers(inputs: object, start: float, stop: float) -> None:
    """Refuse signals that do not cover the run."""
    if isinstance(inputs, Sampled | Signal):
        require_cover("the forces are sampled", as_signal(inputs), start, stop)
    for i, signal in enumerate(inputs if isinstance(inputs, Sequence) else ()):
        if isinstance(signal, Sampled | Signal):
            require_cover(f"the forces of member {i} are sampled", as_signal(signal), start, stop)
