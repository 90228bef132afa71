"""Directly: a kernel at one state of a robot, asked for from Python, in one call.

Most of what such a question takes is Python: what is given is looked at, copied, handed on, and
what comes back is looked at again. For one state that is the robot's own, with numbers that are
plain, all of that is done by the call itself (`kernels.from_python`); what it does not take is
None, and goes the way on which refusals are told.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import methodcaller
from typing import Any

import numpy as np

from linkwork.kernels import Kernel
from linkwork.kernels.from_python import AskedOutputs, Direct, direct, left_to_others
from linkwork.model import checks
from linkwork.model.charts import CompiledChart
from linkwork.model.state import State

SHORT = 20_000  # operations, some 10 us, for which no other thread need be let in


class DirectCalls(dict[tuple[str, ...], Direct]):
    """Hold the calls of a kernel (q, v, given, p) -> (..., results, pivot) by independent rates,
    from when there is code of it on.

    coordinates: of the robot's own states; charts: by independent rates; kernel: its name, or what
    returns it of a chart; whole: whether all outputs before the pivot are asked for, one after the
    other, or the last of them
    """

    def __init__(
        self,
        coordinates: tuple[str, ...],
        charts: Mapping[Any, CompiledChart],
        kernel: str | Callable[[CompiledChart], Kernel],
        whole: bool = False,
    ):
        super().__init__()
        self._coordinates, self._charts, self._whole = coordinates, charts, whole
        self._kernel = methodcaller("kernel", kernel) if isinstance(kernel, str) else kernel

    def at(self, state: State, given: object = None) -> np.ndarray | None:
        """Return the results (n) at one state, if all is plain and they are sound; else None.

        given: what the kernel takes beside q and v, if anything
        """
        try:
            own, independent = state.coordinates is self._coordinates, state.independent
            q, v = state.q, state.rates
        except AttributeError:  # no state
            return None
        if not own:
            return None
        return self[independent](q, v) if given is None else self[independent](q, v, given)

    def __missing__(self, independent: tuple[str, ...]) -> Direct:
        chart = self._charts.get(independent)
        if chart is None or not (kernel := self._kernel(chart)).has_code:
            return left_to_others
        if kernel.operations > SHORT:
            return self.setdefault(independent, left_to_others)
        count = kernel.n_out - 1 if self._whole else kernel.outputs[-2][1]
        asked = AskedOutputs(kernel.n_out - 1 - count, (count,), checks.PIVOT_BOUND)
        sizes = [size for _, size in kernel.inputs[:-1]]
        call = self[independent] = direct(kernel, sizes, chart.p, asked)
        return call
