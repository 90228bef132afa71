"""Directly: a kernel at one state of a robot, asked for from Python, in one call.

Most of what such a question takes is Python: what is given is looked at, copied, handed on, and
what comes back is looked at again. For one state that is the robot's own, with numbers that are
plain, all of that is done by the call itself (`kernels.from_python`); what it does not take is
None, and goes the way on which refusals are told.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from operator import methodcaller
from typing import Any, Literal

import numpy as np

from linkwork.kernels import Kernel
from linkwork.kernels.from_python import (
    SHORT,
    Arrays,
    AskedOutputs,
    Columns,
    Direct,
    Shape,
    direct,
    left_to_others,
)
from linkwork.model import checks
from linkwork.model.charts import CompiledChart
from linkwork.model.state import State
from linkwork.threads import ONE, number_of

Form = Literal["number", "vector", "matrix", "symmetric"]
FORMS: dict[str, tuple[Form, ...]] = {
    "actuation": ("matrix",),
    "terms": ("symmetric", "vector", "vector", "vector"),
    "energy": ("number", "number"),
    "maps": ("matrix", "matrix"),
    "joints_motion": ("vector", "vector", "vector"),
    "bodies_motion": ("vector", "vector", "vector"),
    "tool_motion": ("vector", "matrix", "vector", "vector"),
}
"""What the outputs of a kernel are, but the pivot: matrices have a column for each independent
rate. Of other kernels one vector is asked for, the last."""
LOOKED_AT = {"maps": 0, "terms": 1, "energy": 0}
"""Which outputs tell whether what is given was sound, if not the last one."""


class DirectCalls(dict[tuple[str, ...], Direct]):
    """Hold the calls of a kernel (q[, v][, given], p) -> (..., results, ..., pivot) by independent
    rates, from when there is code of it on.

    coordinates: of the robot's own states; charts: by independent rates; kernel: of a chart; asked:
    where the outputs of a kernel of n rates begin that are asked for, and their shapes
    """

    def __init__(
        self,
        coordinates: tuple[str, ...],
        charts: Mapping[Any, CompiledChart],
        kernel: Callable[[CompiledChart], Kernel],
        asked: Callable[[Kernel, int], tuple[int, Arrays]],
    ):
        super().__init__()
        self._coordinates, self._charts = coordinates, charts
        self._kernel, self._asked = kernel, asked

    @classmethod
    def of(
        cls, coordinates: tuple[str, ...], charts: Mapping[Any, CompiledChart], name: str
    ) -> DirectCalls:
        """Return the calls of a chart's kernel by its name, whose results FORMS tells."""
        return cls(coordinates, charts, methodcaller("kernel", name), partial(asked_by_name, name))

    def at(self, state: State, given: object = None, threads: object = ONE) -> Any:
        """Return the results at one state, an array or a tuple of arrays, if all is plain and they
        are sound; else None.

        given: what the kernel takes beside q and v, if anything; threads: that are asked for, which
        one state does not need
        """
        if threads is not ONE:
            number_of(threads)
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
        first, shape = self._asked(kernel, len(independent))
        sizes = [size for _, size in kernel.inputs[:-1]]
        call = direct(kernel, sizes, chart.p, AskedOutputs(first, shape, checks.sure(chart.key)))
        self[independent] = call if len(sizes) > 1 else partial(at_rest, call)
        return self[independent]


def asked_by_name(name: str, kernel: Kernel, n: int) -> tuple[int, Arrays]:
    """Return where the outputs of a chart's kernel begin that are asked for, and their shapes."""
    if name not in FORMS:
        return kernel.n_out - 1 - kernel.outputs[-2][1], (kernel.outputs[-2][1],)
    outputs = zip(kernel.outputs, FORMS[name], strict=False)
    return 0, tuple(shape_of(form, size, n) for (_, size), form in outputs)


def shape_of(form: Form, size: int, n: int) -> Shape:
    """Return the shape of an output of so many numbers, of n independent rates."""
    match form:
        case "number":
            return ()
        case "vector":
            return (size,)
        case "matrix":
            return Columns((size // n, n))
        case "symmetric":
            return n, n


def shaped(name: str, outputs: list[np.ndarray], n: int) -> tuple[np.ndarray, ...]:
    """Return outputs (..., size) of a chart's kernel at states, formed as those of a direct
    call."""
    found = []
    for part, form in zip(outputs, FORMS[name], strict=True):
        shape = shape_of(form, part.shape[-1], n)
        if isinstance(shape, Columns):
            part = part.reshape((*part.shape[:-1], *reversed(shape)))
            found.append(np.swapaxes(part, -1, -2))
        else:
            found.append(part.reshape((*part.shape[:-1], *shape)))
    return tuple(found)


def at_rest(call: Direct, q: np.ndarray, *_: object) -> Any:
    """Return what a kernel tells that takes no rates."""
    return call(q)
