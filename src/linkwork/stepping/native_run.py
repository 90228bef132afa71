"""The run behind a stepper: its memory, which compiled code steps on in, read by names."""

from __future__ import annotations

import numpy as np

from linkwork.simulation import Control, Status, Trajectory
from linkwork.simulation.integration import Problem, TimeSpan, entry
from linkwork.simulation.native_loop import LoopOutcome
from linkwork.simulation.native_memory import INTEGRATION
from linkwork.simulation.native_parts import Room
from linkwork.simulation.turns import whole
from linkwork.stepping.native_stepping import STEPPING, prepare

PLACES = {
    name: INTEGRATION.place(name)
    for name in (
        *("t", "rhythm", "status", "evaluations", "accepted", "rejected", "projections", "fault"),
        *("next_sample", "since", "votes", "pivot", "pivot_time", "closure_error"),
        *("rejected_pivot", "rejected_residual", "room", "saved"),
    )
}
CELL = {name: STEPPING.place(name) for name in STEPPING.fields}
INPUTS, COUNTED, STATE = 5, 9, 10  # places among the arguments of a run
RHYTHM = "step", "growth", "longest", "ideal"


class NativeRun:
    """Hold a run that stands between two steps, in one chart.

    problem, y, span: as `simulation.integration.entry` takes them
    table: the inputs over time, `Signal.table`, to which forces may be written
    """

    def __init__(self, problem: Problem, y: np.ndarray, span: TimeSpan, table: np.ndarray):
        self.given = list(entry(problem, y, span))
        self.given[INPUTS] = table
        self.problem, self.nq, self.n = problem, span.nq, y.size
        self.bound, self.control = span.pivot_bound, span.control
        self.memory, self.rows, status = prepare(*self.given)
        self.status = Status(status)
        self.counts = self.memory.view(np.int64)
        self.address: int = self.memory.ctypes.data
        # The state, of which angles lack their whole turns, and the inputs that acted last.
        begin, x = self._room("y"), self._room("x") + self.n
        count = self.counts.item(PLACES["room"] + Room._fields.index("inputs"))
        self.y, self.inputs = self.memory[begin : begin + self.n], self.memory[x : x + count]

    @property
    def time(self) -> float:
        """When it is [s]."""
        return self.memory.item(PLACES["t"])

    def outcome(self) -> LoopOutcome:
        """Return the loop's account of the steps so far."""
        found = {}
        for name in LoopOutcome._fields:
            if name in RHYTHM:
                found[name] = self.memory.item(PLACES["rhythm"] + RHYTHM.index(name))
            else:
                numbers = self.counts if LoopOutcome.__annotations__[name] is int else self.memory
                found[name] = numbers.item(PLACES["t" if name == "time" else name])
        return LoopOutcome(**found)

    @property
    def turns(self) -> np.ndarray:
        """Whole turns of angles that are not in y (nq)."""
        return self.given[COUNTED][2]

    @property
    def seen(self) -> np.ndarray:
        """The state with the whole turns of its angles."""
        return np.concatenate([whole(self.y[: self.nq], self.turns), self.y[self.nq :]])

    def trajectory(self, status: Status) -> Trajectory:
        """Return what was done as that of a run that saved its end alone."""
        outcome, control = self.outcome(), self.control
        if control is not None:
            held = self.given[STATE][self.n :].copy()
            control = Control(control.address, control.period, held, int(outcome.next_sample))
        ends = [outcome.time], self.seen, self.inputs, [outcome.closure_error, -1.0]
        row = np.concatenate(ends)[None]
        saved = self.counts.item(PLACES["saved"]) if status is Status.EVENT else 0
        found = self.rows[:saved].copy()
        bounds: dict[str, float | str] = {
            "pivot_bound": self.bound,
            "closure_tol": self.problem.closure_tol,
            "max_steps": self.problem.max_steps,
            "event": -1,
        }
        return Trajectory(
            row, found, self.y.copy(), self.turns.copy(), self.nq, outcome, control, bounds,
            status,
        )  # fmt: skip

    def _room(self, part: str) -> int:
        """Return where a part of the `Room` begins in the memory."""
        address = self.counts.item(PLACES["room"] + Room._fields.index(part))
        return (address - self.address) // 8
