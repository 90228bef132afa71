"""What makes a tree without loops move as the closed robot does, called by MuJoCo from Python.

The callback is that of passive forces, where MuJoCo has its inertia and its transmissions and does
not use them yet. `mujoco_plugin` says the same in C.
"""

from __future__ import annotations

import warnings
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from linkwork.analysis.mujoco_places import Places, loaded, places_in
from linkwork.analysis.tree_map import CLOSED, SHORTEST, STEPS, TreeMap
from linkwork.checks import shown
from linkwork.errors import LinkworkError
from linkwork.kernels import compile_function
from linkwork.model.checks import PIVOT_BOUND
from linkwork.model.closing import settled_alone


class Last(NamedTuple):
    """Hold where one of the engine's data was: its x, and q with closed loops."""

    x: np.ndarray
    q: np.ndarray


class EngineCallback:
    """Add to a model of MuJoCo what the links that are cut away do, at each call with its data.

    Loops are closed from where the same data were last, or from home; where that does not lead to
    the joints' coordinates on the same branch, forces are NaN, which MuJoCo tells as a bad
    acceleration.
    """

    def __init__(self, of: TreeMap, model: Any):
        self._engine, self._map = loaded(), of
        if not isinstance(model, self._engine.MjModel):
            raise LinkworkError(f"the model is {shown(model)}; give a mujoco.MjModel")
        self._placed, self._closing, self._added = map(compile_function, of.functions)
        self._start = Last(np.array(of.x_home), of.tree.about.q)
        self._last: dict[int, Last] = {}
        self._left: dict[int, np.ndarray] = {}
        self._known: dict[int, tuple[Any, Places | None]] = {
            model._address: (model, places_in(model, of))
        }
        n, m = len(of.tree.names), len(of.motors)
        ends = [0, *accumulate((n * n, n, m * n, m, m))]
        self._parts = [slice(*pair) for pair in pairwise(ends)]

    def __call__(self, model: Any, data: Any) -> None:
        """Add what is to be added; models that do not have the tree are left alone."""
        places = self._places(model)
        if places is None:
            return
        q = self._closed(data, data.qpos[places.coordinates])
        if q is None:
            warnings.warn(
                "the loops cannot be closed at these joints; forces are NaN", stacklevel=2
            )
            data.qfrc_passive[places.dofs] = np.nan
            return
        y = self._added.flat(q, data.qvel[places.dofs])
        M, h, A, lengths, rates = (y[part] for part in self._parts)
        self._add_inertia(model, data, places.inertia, M[places.pairs])
        data.qfrc_passive[places.dofs] -= h
        # The motors' tendons, and what stands on these.
        data.ten_J[places.slots] = A[places.own]
        data.ten_length[places.tendons], data.ten_velocity[places.tendons] = lengths, rates
        self._engine.mj_transmission(model, data)
        for output, tendon, gear in places.outputs:
            data.actuator_velocity[output] = gear * data.ten_velocity[tendon]

    def _places(self, model: Any) -> Places | None:
        """Return where a model has the tree; models are kept, so that no other takes their
        place."""
        known = self._known.get(model._address)
        if known is None:
            try:
                known = model, places_in(model, self._map)
            except LinkworkError:
                known = model, None
            self._known[model._address] = known
        return known[1]

    def _add_inertia(self, model: Any, data: Any, places: np.ndarray, added: np.ndarray) -> None:
        """Add to the engine's inertia, unless it still has what was added last: then its stage of
        positions was left out."""
        left = self._left.get(data._address)
        if left is not None and np.array_equal(data.M[places], left):
            return
        data.M[places] += added
        self._engine.mj_factorM(model, data)
        if self._engine.mj_isDual(model):
            self._engine.mj_projectConstraint(model, data)
        self._left[data._address] = data.M[places].copy()

    def _closed(self, data: Any, x: np.ndarray) -> np.ndarray | None:
        """Return q with closed loops at the engine's coordinates; None where none is found."""
        for start in (self._last.get(data._address, self._start), self._start):
            q = self._led(start, x)
            if q is not None:
                self._last[data._address] = Last(x, q)
                return q
        return None

    def _led(self, start: Last, x: np.ndarray) -> np.ndarray | None:
        """Return q at x, led there from a start, in parts of the way where one is too much."""
        q, way, step = start.q, 0.0, 1.0
        while way < 1:
            there = start.x + (way + step) * (x - start.x) if way + step < 1 else x
            found = self._settled(self._placed.flat(q, there))
            if found is not None:
                q, way = found, way + step
                step = min(2 * step, 1 - way)
            elif (step := step / 2) < SHORTEST:
                return None
        return q

    def _settled(self, q: np.ndarray) -> np.ndarray | None:
        """Return q closed by Newton's steps at the same joints; None where they do not close it, or
        on another branch."""

        def read(q: np.ndarray) -> tuple[float, np.ndarray]:
            y = self._closing.flat(q)
            return float(y[-2]), y

        q, gap, y = settled_alone(read, lambda _, y: y[:-2], q, CLOSED, STEPS)
        return q if gap <= CLOSED and y[-1] > PIVOT_BOUND else None
