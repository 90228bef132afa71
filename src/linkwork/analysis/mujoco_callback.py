"""What makes a tree without loops move as the closed robot does, called by MuJoCo from Python.

The callback is that of passive forces, where MuJoCo has its inertia and its transmissions and does
not use them yet. `mujoco_plugin` says the same in C.
"""

from __future__ import annotations

import warnings
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from linkwork.analysis.tree_map import CLOSED, SHORTEST, STEPS, TreeMap
from linkwork.errors import LinkworkError
from linkwork.kernels import compile_function
from linkwork.model.checks import PIVOT_BOUND


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
        try:
            import mujoco
        except ImportError:
            raise LinkworkError(
                "the callback needs MuJoCo; install it with 'pip install mujoco'"
            ) from None
        self._engine, self.model = mujoco, model
        self._placed, self._closing, self._added = map(compile_function, of.functions)
        self._start = Last(np.array(of.x_home), of.tree.about.q)
        self._last: dict[int, Last] = {}
        self._left: dict[int, np.ndarray] = {}
        self._find_places(of)
        n, m = len(self._dofs), len(self._tendons)
        ends = [0, *accumulate((n * n, n, m * n, m, m))]
        self._parts = [slice(*pair) for pair in pairwise(ends)]

    def __call__(self, model: Any, data: Any) -> None:
        if model is not self.model:
            return
        q = self._closed(data)
        if q is None:
            warnings.warn(
                "the loops cannot be closed at these joints; forces are NaN", stacklevel=2
            )
            data.qfrc_passive[self._dofs] = np.nan
            return
        y = self._added.flat(q, data.qvel[self._dofs])
        M, h, A, lengths, rates = (y[part] for part in self._parts)
        self._add_inertia(data, M)
        data.qfrc_passive[self._dofs] -= h
        # The motors' tendons, and what stands on these.
        data.ten_J[self._slots] = A[self._own]
        data.ten_length[self._tendons], data.ten_velocity[self._tendons] = lengths, rates
        self._engine.mj_transmission(model, data)
        for output, tendon, gear in self._outputs:
            data.actuator_velocity[output] = gear * data.ten_velocity[tendon]

    def _add_inertia(self, data: Any, M: np.ndarray) -> None:
        """Add to the engine's inertia, unless it still has what was added last: then its stage of
        positions was left out."""
        places, left = self._inertia, self._left.get(data._address)
        if left is not None and np.array_equal(data.M[places], left):
            return
        data.M[places] += M[self._pairs]
        self._engine.mj_factorM(self.model, data)
        if self._engine.mj_isDual(self.model):
            self._engine.mj_projectConstraint(self.model, data)
        self._left[data._address] = data.M[places].copy()

    def _closed(self, data: Any) -> np.ndarray | None:
        """Return q with closed loops at the joints' coordinates; None where none is found."""
        x = data.qpos[self._coordinates]
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
            found = self._newton(self._placed.flat(q, there))
            if found is not None:
                q, way = found, way + step
                step = min(2 * step, 1 - way)
            elif (step := step / 2) < SHORTEST:
                return None
        return q

    def _newton(self, q: np.ndarray) -> np.ndarray | None:
        for _ in range(STEPS):
            y = self._closing.flat(q)
            if y[-2] < CLOSED:
                return q if y[-1] > PIVOT_BOUND else None
            q = y[:-2]
        return None

    def _find_places(self, of: TreeMap) -> None:
        """Find where the model has the tree's joints, tendons, actuators and inertia."""
        model, joint, tendon = self.model, "joint", "tendon"
        ids = [self._id(joint, move.name) for move in of.tree.moves]
        sizes = [(7, 6) if move.kind == "free" else (1, 1) for move in of.tree.moves]
        q_at, v_at = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
        self._coordinates = joined(q_at, [size for size, _ in sizes])
        self._dofs = joined(v_at, [size for _, size in sizes])
        # Inertia: each row of the engine's has its own rate's and those inward of it.
        place = {dof: k for k, dof in enumerate(self._dofs.tolist())}
        places, pairs = [], []
        for i, dof in enumerate(self._dofs.tolist()):
            for at in range(row := model.M_rowadr[dof], row + model.M_rownnz[dof]):
                if model.M_colind[at] in place:
                    places.append(at)
                    pairs.append(place[model.M_colind[at]] * len(place) + i)
        self._inertia, self._pairs = np.array(places, int), np.array(pairs, int)
        held = {*self._pairs.tolist()}
        for i, j in zip(*of.terms[0].sparsity().get_triplet(), strict=True):
            if not {i * len(place) + j, j * len(place) + i} & held:
                raise LinkworkError(
                    "the model keeps joints apart that the tree couples; write it anew by "
                    "write_mjcf"
                )
        # Tendons, and the actuators on them.
        self._tendons = np.array([self._id(tendon, name) for name in of.motors], int)
        slots, own = [], []
        for k, tendon_id in enumerate(self._tendons.tolist()):
            for at in range(
                row := model.ten_J_rowadr[tendon_id], row + model.ten_J_rownnz[tendon_id]
            ):
                slots.append(at)
                own.append(place[model.ten_J_colind[at]] * len(of.motors) + k)
        self._slots, self._own = np.array(slots, int), np.array(own, int)
        of_tendons = int(self._engine.mjtTrn.mjTRN_TENDON)
        self._outputs = [
            (
                out := int(model.actuator_outadr[k]),
                int(model.actuator_trnid[k, 0]),
                float(model.actuator_gear[out, 0]),
            )
            for k in range(model.nactuator)
            if model.actuator_trntype[k] == of_tendons
            and model.actuator_trnid[k, 0] in self._tendons
        ]

    def _id(self, kind: str, name: str) -> int:
        found = self._engine.mj_name2id(
            self.model, getattr(self._engine.mjtObj, f"mjOBJ_{kind.upper()}"), name
        )
        if found < 0:
            raise LinkworkError(
                f"the model has no {kind} {name!r}; give a model of the file of write_mjcf"
            )
        return found


def joined(starts: np.ndarray, sizes: list[int]) -> np.ndarray:
    """Return the places from each start on, as many as its size."""
    ranges = [np.arange(start, start + size) for start, size in zip(starts, sizes, strict=True)]
    return np.concatenate(ranges).astype(int) if ranges else np.zeros(0, int)
