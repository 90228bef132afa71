"""Sampled calls: Python functions that control a run at a period, called from machine code."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from linkwork.control.acting import Acting
from linkwork.control.drives import Extra
from linkwork.control.sampler import Sampler
from linkwork.control.tracing import CONTROLLER, ordered
from linkwork.model.charts import CompiledChart
from linkwork.model.observing import observation
from linkwork.model.whole_turns import TurnedLabels
from linkwork.runs.settings import Settings
from linkwork.simulation.signals import require_increasing

KERNEL = ctypes.CFUNCTYPE(None, ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_double))


@dataclass(frozen=True, eq=False)
class Callback:
    """Call a sampled Python function from machine code: (y, u, p) -> held inputs, oldest command
    first.

    What the function raises is kept, and numbers that are undefined end the run.

    states: z, of which the first `extras` are those of drives and controllers; signals: how many
        inputs are given over time
    parameters: values of those of what acts; faults: what the function raised
    """

    chart: CompiledChart
    acting: Acting
    states: tuple[Extra, ...]
    extras: int
    signals: int
    parameters: np.ndarray
    faults: list[BaseException]

    @cached_property
    def labels(self) -> TurnedLabels:
        return TurnedLabels(self.chart)

    @cached_property
    def _function(self) -> Any:
        return KERNEL(self._call)

    @cached_property
    def _ends(self) -> list[int]:
        """Where q, v, z, the signals and the held inputs end in a kernel's input."""
        equations, z = self.chart.equations, len(self.states)
        sizes = equations.nq, equations.mobility, z, self.signals, self.acting.held
        return np.cumsum(sizes).tolist()

    @property
    def address(self) -> int:
        """Address of void(const double *in, double *out)."""
        return ctypes.cast(self._function, ctypes.c_void_p).value or 0

    def _turned(self, z: np.ndarray, read: np.ndarray) -> np.ndarray:
        """Return the coordinates of all joints with the turns of those that are followed."""
        goal, names = read.copy(), self.states[self.extras :]
        goal[[self.labels.equations.mechanism.coordinates.index(state.name) for state in names]] = (
            z[len(z) - len(names) :]
        )
        return self.labels.nearest(read, goal)

    def _call(self, x: Any, out: Any) -> None:
        try:
            acting, ends = self.acting, self._ends
            actuators = acting.names.actuators
            q, v, z, references, held = np.split(
                np.ctypeslib.as_array(x, (ends[-1],)).copy(), ends[:-1]
            )
            result, later = np.ctypeslib.as_array(out, (held.size,)), held[len(actuators) :]
            result[:] = [*later, *np.full(len(actuators), np.nan)]
            if self.faults:
                return
            parameters = dict(zip(acting.parameters, self.parameters, strict=True))
            state = observation(
                self.chart, acting.names, q, v, z, parameters, partial(self._turned, z)
            )
            forces = acting.sampler.law(float(references[0]), state)  # pyright: ignore
            result[later.size :] = ordered(forces, actuators, CONTROLLER)
        except BaseException as error:
            self.faults.append(error)


def called_besides(
    sampler: Sampler, settings: Settings, start: float, end: float
) -> tuple[Settings, np.ndarray]:
    """Return settings that save when a sampled controller is called, too, and those times [s]."""
    require_increasing("the times in save_at", settings.save_at)
    besides = np.setdiff1d(calls(sampler, start, end, settings.max_steps), settings.save_at)
    return settings.but(save_at=np.union1d(settings.save_at, besides)), besides


def calls(sampler: Sampler, start: float, end: float, most: int) -> np.ndarray:
    """Return the start of a run and when a sampled controller is called after it, the first `most`
    times [s]."""
    first = int(start / sampler.period)
    times = np.arange(first, min(int(end / sampler.period), first + most) + 2) * sampler.period
    return np.append(start, times[(times > start) & (times < end)])
