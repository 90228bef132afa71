"""Settings: how runs are computed, checked once and shared by all that computes them.

`Robot.simulate`, `resume` and `ensemble`, studies and the command line make them from the same
keyword arguments.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from linkwork.checks import MOST, count, finite, fraction, positive, shown
from linkwork.errors import LinkworkError
from linkwork.simulation import DORMAND_PRINCE, SHARP_SMART, Method, integrator

ON_SINGULAR = ("stop", "step_over")
FINEST = 2.3e-14  # relative tolerance: a hundred times the rounding of doubles
MOST_STEPS = 2**62  # what the loops count up to
TIGHT = 1e-6  # relative tolerance from which on the method of order 7 pays


def settings_of(**values: Any) -> Settings:
    """Return settings: those that were made before, where the same was asked for lately."""
    times = values.get("save_at") if values.get("samples") is None else None
    try:
        found = _kept(**values if times is None else values | {"save_at": None})
    except TypeError:  # a list or an array among them
        return Settings(**values)
    return found if times is None else found.but(save_at=asked_times(times))


def asked_times(times: Any) -> np.ndarray:
    """Return the times to save; refuse what is not finite."""
    return np.atleast_1d(finite(times, "save_at"))


@dataclass(frozen=True, eq=False, kw_only=True)
class Settings:
    """Say how runs are computed: the arguments of `Robot.simulate` and `Robot.ensemble` but for
    what acts, and where it starts.

    duration: T [s]; method: by name, None where it follows from the inputs (`suited`); step: of a
        fixed one [s]
    events: to watch for, as they are given
    rtol, atol: of the local error; save_at: times (K,) [s], or None; samples: how many equally
        spaced times instead (`saved_from`)
    max_step: [s]; max_steps: accepted and rejected ones together; threads: None for all processors
    integrator: the method itself; that for smooth inputs where none is asked for

    Raises:
        LinkworkError: what makes no run, in one sentence.
    """

    duration: float
    method: str | None = None
    step: float | None = None
    events: Any = ()
    rtol: float = 1e-8
    atol: float = 1e-10
    save_at: Any = None
    samples: int | None = None
    max_step: float = np.inf
    max_steps: int = 1_000_000
    on_singular: str = "stop"
    threads: int | None = None
    integrator: Method = field(init=False)

    def __post_init__(self) -> None:
        duration = positive(self.duration, "the duration")
        rtol, atol = fraction(self.rtol, "rtol"), positive(self.atol, "atol")
        if rtol < FINEST:
            raise LinkworkError(
                f"rtol is {rtol:g}, less than what doubles can hold; give at least {FINEST:g}"
            )
        if not (isinstance(self.max_step, float | int) and self.max_step == np.inf):
            positive(self.max_step, "max_step")
        most = min(count(self.max_steps, "max_steps"), MOST_STEPS)
        usual = SHARP_SMART if rtol <= TIGHT else DORMAND_PRINCE
        method = integrator(self.method, self.step) or usual
        if not isinstance(self.on_singular, str) or self.on_singular not in ON_SINGULAR:
            ways = " or ".join(map(repr, ON_SINGULAR))
            raise LinkworkError(f"on_singular is {shown(self.on_singular)}; give {ways}")
        own = vars(self)
        own["duration"], own["rtol"], own["atol"] = duration, rtol, atol
        own["max_step"], own["max_steps"] = float(self.max_step), most
        own["integrator"] = method
        if self.save_at is not None:
            own["save_at"] = asked_times(self.save_at)
        if self.samples is not None:
            if self.save_at is not None:
                raise LinkworkError("save_at and samples are both given; keep one of them")
            if count(self.samples, "samples", MOST) < 2:
                raise LinkworkError("samples is 1; give at least 2, the first and the last")
            own["samples"] = int(self.samples)
        if self.threads is not None:
            own["threads"] = count(self.threads, "threads")

    @property
    def step_over(self) -> bool:
        """Whether runs step over singular poses."""
        return self.on_singular == "step_over"

    @cached_property
    def leave_stiff(self) -> bool:
        """Whether runs go on by another method where they are stiff."""
        return self.method is None

    def suited(self, smooth: bool) -> Settings:
        """Return the same with the method for such inputs where none is asked for: order 7 or 5.

        A method of higher order pays at tight tolerances. It takes longer steps, in which the kinks
        of sampled inputs cost more of its accuracy.
        """
        return self if smooth or self.method is not None else self.but(integrator=DORMAND_PRINCE)

    def saved_from(self, start: float) -> Settings:
        """Return the same with its samples as times to save of runs that begin at a time [s]."""
        if self.samples is None:
            return self
        times = np.linspace(start, start + self.duration, self.samples)
        return self.but(save_at=times, samples=None)

    def but(self, **values: Any) -> Settings:
        """Return the same with some other values, which are not checked: companions are finer than
        users may ask for."""
        other = object.__new__(Settings)
        vars(other).update(vars(self), **values)
        return other

    @property
    def told(self) -> dict[str, float]:
        """What a run is held to, as it tells of it: tolerances, or the step of a fixed one."""
        if self.integrator.step is not None:
            return {"step": self.integrator.step}
        return {"rtol": self.rtol, "atol": self.atol}


_kept = lru_cache(maxsize=64, typed=True)(Settings)
