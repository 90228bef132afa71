"""Sampled control: a function called at a fixed rate, its result held in between (zero-order hold).

    u(t) = f(t_k, what is measured at t_k)  for  t_k + delay <= t < t_(k+1) + delay,  t_k = k / rate

What is measured may be quantised: a coordinate is read in whole steps, and its rate in whole steps
per period, as a counter gives it over one; it is the present rate that is rounded, no difference of
readings is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from linkwork import checks, math
from linkwork.control.observation import Names, Observation, Quantity, Readings
from linkwork.control.records import ActingPart, number
from linkwork.control.tracing import Law
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import Amount, PathName, Positive

ALL = ""  # the name under which a step of all coordinates stands


@dataclass(frozen=True, eq=False)
class Sampler(ActingPart):
    """Call a function of (t, state) at a fixed rate, as a real controller is called.

    function: (t, state) -> forces or commands, by name or in the order of the actuators; any Python
    code, it may branch and keep memory
    compiled: trace the function and run it as machine code; it may then neither branch nor keep
    memory

    The present rates of quantised coordinates are rounded to whole steps per period.
    """

    function: Law
    rate: float = number("calls per second", "Hz", Positive, 1000.0)
    delay: float = number("until a result acts {unit}, a whole number of periods", "s", Amount, 0.0)
    quantise: float | Mapping[str, float] | None = number(
        "step in which joint coordinates are read {unit}, or one by name",
        "m, rad",
        Positive | Mapping[PathName, Positive] | None,
        None,
    )
    compiled: bool = False

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise LinkworkError(f"a sampler calls a function of (t, state), not {self.function!r}")
        checks.switch(self.compiled, "compiled")
        checks.positive(self.rate, "the rate of a sampler", "Hz")
        periods = checks.number(self.delay, "the delay of a sampler") * self.rate
        if not (0 <= periods < 1000 and abs(periods - round(periods)) < 1e-6):
            raise LinkworkError(
                f"the delay of a sampler is {self.delay} s, {periods:g} periods; give a whole "
                "number of periods, or a higher rate"
            )
        for step in self._steps.values():
            checks.positive(step, "the step of a quantised coordinate", "m, rad")

    @property
    def period(self) -> float:
        """Time from one call to the next [s]."""
        return 1 / self.rate

    @property
    def late(self) -> int:
        """The delay in periods."""
        return round(self.delay * self.rate)

    def seen(self, state: Observation) -> Observation:
        """Return what is measured of a state."""
        if self.quantise is None:
            return state

        def quantity(key: Quantity) -> np.ndarray:
            value = state.source.quantity(key)
            step = (
                self._steps.get(key.name, self._steps.get(ALL))
                if key.kind in ("position", "rate")
                else None
            )
            if step is None:
                return value
            step = step if key.kind == "position" else step * self.rate
            return step * math.floor(value / step + 0.5)

        return Observation(
            state.names, Readings(quantity, state.source.parameter, state.source.extra)
        )

    def law(self, t: Any, state: Observation) -> Any:
        """Return what the function gives for what is measured."""
        return self.function(t, self.seen(state))

    def require(self, names: Names) -> None:
        """Refuse steps of what is no coordinate or rate of a robot with these names."""
        allowed = tuple(dict.fromkeys(names.coordinates + names.rates))
        named = (name for name in self._steps if name != ALL)
        checks.known(named, allowed, "coordinate to quantise")

    @property
    def _steps(self) -> Mapping[str, float]:
        if isinstance(self.quantise, Mapping):
            return self.quantise
        return {} if self.quantise is None else {ALL: self.quantise}
