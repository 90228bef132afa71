"""What an integration watches for and what acts at sample times: addresses of kernels and how to
use them."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.simulation.signals import Signal

ENDS, CUTS, BORNE, MEETS = 1.0, 2.0, 3.0, 4.0
"""What an event does: it ends the run, or a step; or, of bearings or of parts that meet."""


@dataclass(frozen=True)
class Condition:
    """Say which zeros of an event function count: `terminal`, the run ends there; `direction`, 1
    for zeros passed upwards only, -1 for downwards, 0 for both; `cuts`, a step ends there, and the
    next one begins, as where a force sets in (steps of a fixed length do not); `borne`, of those,
    it tells of what bearings carry, which is undefined wherever accelerations are; `meets`: of
    parts that begin or cease to press, whose force grows from zero there.
    """

    terminal: bool = False
    direction: int = 0
    cuts: bool = False
    borne: bool = False
    meets: bool = False

    def __post_init__(self):
        if self.direction not in (-1, 0, 1):
            raise LinkworkError(f"the direction of an event is {self.direction!r}; give -1, 0 or 1")


@dataclass(frozen=True)
class Events:
    """Watch for zeros of functions g(y, u, p).

    address: of the kernel (y, u, p) -> g (k,), a C function void(const double *, double *);
    conditions: one for each g_i.

    Zeros are looked for along the dense output, between its ends and where g_i comes nearest to
    zero (`native_events`): two within a step are found, too. A function that is 0 at the start of a
    run has to leave 0 first.
    """

    address: int
    conditions: tuple[Condition, ...]

    @cached_property
    def table(self) -> np.ndarray:
        """The conditions as the compiled loops take them: a row for each, its direction and what it
        does, `ENDS`, `CUTS`, `BORNE` or 0."""
        rows = [
            (
                c.direction,
                ENDS if c.terminal else BORNE if c.borne else MEETS if c.meets else CUTS * c.cuts,
            )
            for c in self.conditions
        ]
        return np.array(rows, float).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class Watch:
    """Watch signals over time that are not all inputs: what depends on time alone in equations and
    event functions.

    signal: of all of them; strict: how many of its columns, the last ones, event functions read: no
    step passes more than two bends of them (`bends`), for a zero that is passed leaves no trace in
    the motion.
    """

    signal: Signal
    strict: int = 0


@dataclass(frozen=True, eq=False)
class Occurrences:
    """Hold the E events of a run in the order of their times.

    times (E,) in s; index (E,): which function passed zero; states (E, nq + nv): y there.
    """

    times: np.ndarray
    index: np.ndarray
    states: np.ndarray

    def __len__(self) -> int:
        return len(self.times)


@dataclass(frozen=True, eq=False)
class Control:
    """Let a sampled controller act: at t = k period it computes inputs that are held until the next
    sample.

    address: of the kernel (y, u, p) -> held inputs (nh,), a C function void(const double *, double
    *); u holds the signals, then the inputs held so far. period: s. held (nh,): the inputs before
    the first sample. next_sample: the k of the first sample; None is the first one from the start
    of the run on.

    Raises `LinkworkError` for a period that is not positive and finite.
    """

    address: int
    period: float
    held: np.ndarray
    next_sample: int | None = None

    def __post_init__(self):
        if not 0 < self.period < math.inf:
            raise LinkworkError(
                "the period of a sampled controller must be positive and finite, not "
                f"{self.period} s"
            )


@dataclass(frozen=True)
class Pace:
    """Go on with a step size: `step`, in s, and `growth`, the largest factor by which the one after
    it may be longer.

    `longest`, the longest step lately, and `ideal`, the one that the last step's error allowed,
    both in s, tell how steps fall; `since` counts the steps since it was last due to look for
    stiffness, and `votes` are those for it.
    """

    step: float
    growth: float
    longest: float = 0.0
    ideal: float = 0.0
    since: int = 0
    votes: int = 0
