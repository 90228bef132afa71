"""Charts of a robot: its equations in different independent rates, each with kernels compiled when
first needed.

The home chart has the actuated rates where these determine the motion. A run may start in a shorter
one, and changes to a better one where its pivots weaken. q is the same in all of them; the rates of
one follow from those of another by

    w = L v  (all rates of the tree),    v_other = w at the other's independent rates.

Kernels take the values of the free parameters p; a chart knows those of its robot and hands them to
its kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from threading import RLock
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from linkwork.checks import known
from linkwork.equations import Equations, chart_in, charts_at, functions
from linkwork.equations.chart import Chart, faced
from linkwork.equations.chart_choice import DETERMINED, relative_pivots, strengths
from linkwork.equations.uncharted import uncharted
from linkwork.errors import LinkworkError
from linkwork.kernels import PAYS, Kernel
from linkwork.kernels.bound import BoundFunction
from linkwork.mechanism.bearing import bearings
from linkwork.model.chart_tables import jacobian, tabled
from linkwork.model.derivations import kept

KERNELS = (
    "motion",
    "constraints",
    "inverse_dynamics",
    "inverse_dynamics_borne",
    "actuation",
    "terms",
    "closure_step",
    "unheld_gap",
    "pivots",
    "tree_rates",
    "motion_energy",
    "maps",
    "positions",
    "joints_motion",
    "bodies_motion",
    "tool_motion",
    "energy",
    "assembly",
    "regressor",
)
Found = TypeVar("Found")
LARGE = 5000  # instructions of a motion that takes longer to compile than a run should wait for
OWN = 100_000  # evaluations of a chart by its table that take as long as compiling it does
BUILDING = RLock()  # expressions are built by one thread at a time


@dataclass(frozen=True, eq=False)
class CompiledChart:
    """Hold the equations in one chart, the values p (np) of their free parameters, and their
    kernels by name.

    home: the chart that keeps what all charts share; None of a chart that runs start in
    """

    equations: Equations
    p: np.ndarray
    _kernels: dict[str, Kernel] = field(default_factory=dict, repr=False)
    _kept: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    _free_kernels: dict[str, Kernel] = field(default_factory=dict, repr=False)
    home: CompiledChart | None = field(default=None, repr=False)
    _counted: list[int] = field(default_factory=lambda: [0], repr=False)
    _of: CompiledChart | None = field(default=None, repr=False)

    def with_parameters(self, p: np.ndarray) -> CompiledChart:
        """Return the chart with other values of the free parameters; both share their kernels."""
        return self if p is self.p else replace(self, p=p)

    @cached_property
    def kernel(self) -> Callable[[str], Kernel]:
        """Return a compiled kernel by name: motion, inverse_dynamics, terms, maps, closure_step,
        joints_motion ...

        It takes p as its last input; left out, that is the chart's.
        """
        return lru_cache(maxsize=None)(self._kernel)

    def _kernel(self, name: str) -> Kernel:
        known([name], KERNELS, "kernel")
        return self.compiled(name, lambda _: self._function(name)).given(self.p)

    def _function(self, name: str) -> ca.Function:
        """Return one of `functions`, derived once for its kernel and for what asks its size."""
        return self._stored(name, lambda: getattr(functions, name)(self.equations))

    def compiled(self, key: str, make: Callable[[Equations], ca.Function | Kernel]) -> Kernel:
        """Return the kernel of a function of these equations, kept under a key for all charts that
        share kernels."""
        with BUILDING:
            if key not in self._kernels:
                made = make(self.equations)
                if not isinstance(made, Kernel):
                    made = Kernel(made, patient=lambda: (self._of or self.shared).large)
                self._kernels[key] = made
            return self._kernels[key]

    def single(self, name: str) -> Kernel | BoundFunction:
        """Return what evaluates one state of a run: motion, closure_step or tree_rates.

        That is the kernel; but in charts that a run of a large mechanism came upon a table is told
        to code that is there already (`tabled`), until the chart has been used for so long that
        code of its own pays.
        """
        return self.by_table(name) if self.told() else self.kernel(name)

    def closing_side_by_side(self, states: int) -> int:
        """Return the address of closure_step for states side by side, when so many are
        evaluated."""
        if self.told(states):
            return self.by_table("closure_step", None, True).address
        return self.kernel("closure_step").wide_address

    def told(self, states: int = 1) -> bool:
        """Whether a table tells the chart when so many states are evaluated."""
        return self.home is not None and self.home.large and self._counted[0] + states <= OWN

    def count(self, evaluations: int) -> None:
        """Count how often the chart was evaluated, and compile what pays now."""
        self._counted[0] += evaluations
        self.settle()

    def settle(self, evaluations: int = PAYS) -> None:
        """Compile what an interpreter has evaluated so often in place of code."""
        found = [self._kernels, self.shared._free_kernels]
        if self.home is not None:
            found.append(self.home._kernels)
        for kernels in found:
            for kernel in kernels.values():
                kernel.settle(evaluations)

    @cached_property
    def by_table(self) -> Callable[..., BoundFunction]:
        """Return `tabled` functions of this chart, by name, what acts, and for how many states."""
        return lru_cache(maxsize=None)(partial(tabled, self.shared.compiled, self.equations))

    @cached_property
    def slopes_by_table(self) -> Callable[[Kernel, Kernel], BoundFunction]:
        """Return `tabled.jacobian` of this chart, by the two kernels of what acts."""
        return lru_cache(maxsize=None)(partial(jacobian, self.shared.compiled, self.equations))

    @property
    def sloped(self) -> bool:
        """Whether the Jacobian of runs is told by a table: that of a large mechanism, at home only
        where no quaternions make the code that all charts share longer than the chart's own."""
        unmet = self.home is None and bool(self.equations.tree.quaternions)
        return self.shared.large and not unmet

    @property
    def shared(self) -> CompiledChart:
        """The chart that keeps what all charts share."""
        return self.home or self

    @cached_property
    def free(self) -> CompiledChart:
        """The equations of all charts in the rates w of the whole tree: their kernels take w for v,
        and what they tell of accelerations is not constrained."""
        if self.home is not None:
            return self.home.free
        return CompiledChart(uncharted(self.equations), self.p, self._free_kernels, _of=self)

    def in_tree(
        self, q: np.ndarray, v: np.ndarray, p: np.ndarray, v_dot: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return w = L v and w' = L v' + b (K, nv) of states (K, ...), one by one.

        p: (np) or (K, np); v_dot: zero if left out
        """
        v_dot = np.zeros(v.shape) if v_dot is None else v_dot
        found = self.by_table("tree_motion").rows(q, v, v_dot, p)
        w, w_dot = np.hsplit(found, 2)
        return np.ascontiguousarray(w), np.ascontiguousarray(w_dot)

    @cached_property
    def large(self) -> bool:
        """Whether compiling the motion takes longer than a run should wait for."""

        def instructions() -> np.ndarray:
            return np.array(self._function("motion").n_instructions())

        if bearings(self.equations.mechanism.joints):
            return False  # their friction is found with the accelerations, of each chart its own
        return self.kept("instructions", instructions).item() > LARGE

    def kept(self, key: str, find: Callable[[], np.ndarray]) -> np.ndarray:
        """Return what was found of these equations under a key, found once for all charts that
        share kernels."""
        with BUILDING:
            if key not in self._kept:
                self._kept[key] = self._stored(key, find)
            return self._kept[key]

    def _stored(self, name: str, find: Callable[[], Found]) -> Found:
        """Return what follows from equations whose key is known, found once on this machine."""
        key = self.equations.key
        return kept(find, name, key, repr(self.key)) if key else find()

    @property
    def independent(self) -> tuple[str, ...]:
        return self.equations.independent

    @property
    def key(self) -> Chart:
        """Return what tells charts apart."""
        return self.equations.chart

    @cached_property
    def order(self) -> tuple[object, ...]:
        """Return what charts have in common that differ in the scales of their pivots only."""
        chart = self.equations.chart
        return chart.independent, chart.rows, tuple(chart.blocks)

    @cached_property
    def units(self) -> np.ndarray:
        """Units of (q, v) but for the time: the mechanism's own length of slides, 1 of turns and
        quaternions."""
        tree = self.equations.tree
        return np.concatenate([tree.units, tree.rate_units[list(self.equations.chart.independent)]])

    @cached_property
    def tolerances(self) -> Callable[[float, float, int], np.ndarray]:
        """Return rtol and atol (2, size) of each number of a state (q, v, z) of some size: atol in
        its own unit."""

        def found(rtol: float, atol: float, size: int) -> np.ndarray:
            each = atol * np.concatenate([self.units, np.ones(size - self.units.size)])
            return np.array([np.full(size, rtol), each])

        return lru_cache(maxsize=8)(found)

    def facing(self, q: np.ndarray) -> CompiledChart:
        """Return this chart with its pivots counted positive at q, where it is regular."""
        if self.told():
            pivots = self.relative_pivots(q[None])[0].tolist()
        else:
            pivots = self.kernel("pivots").flat(q, self.p).tolist()
        if min(pivots, default=1.0) > 0:
            return self
        return self.with_signs(tuple([-1.0 if pivot < 0 else 1.0 for pivot in pivots]))

    @cached_property
    def with_signs(self) -> Callable[[tuple[float, ...]], CompiledChart]:
        """Return this chart with the scales of its pivots multiplied by signs; itself where these
        are all positive."""
        chart = self.equations.chart

        def multiplied(signs: tuple[float, ...]) -> CompiledChart:
            if min(signs, default=1.0) > 0:
                return self
            return self.in_chart(faced(chart, signs))

        return lru_cache(maxsize=None)(multiplied)

    def relative_pivots(self, q: np.ndarray) -> np.ndarray:
        """Return the relative pivots of all blocks (K, blocks) at configurations (K, nq)."""
        if self.told(len(q)):
            return relative_pivots(self.equations, self.key, self.constraint_jacobian(q))
        return self.kernel("pivots")(q)[0]

    def pivot(self, q: np.ndarray) -> float:
        """Return the weakest relative pivot at one configuration."""
        return self.single("tree_rates").flat(q, np.zeros(len(self.independent)), self.p).item(-1)

    def tree_rates(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return w = L v (..., nv), the rates of the whole tree."""
        return self.kernel("tree_rates")(q, v)[0]

    def weighed(self, q: np.ndarray, v: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return w = L v (..., nv) and the weakest relative pivot (...); one state takes the
        shortest way."""
        if q.ndim == v.ndim == p.ndim == 1:
            w = self.single("tree_rates").flat(q, v, p)
            return w[:-1], w[-1]
        if q.ndim == 2 and self.told(len(q)):
            found = self.by_table("tree_rates").rows(q, v, p)
            return np.ascontiguousarray(found[:, :-1]), found[:, -1]
        w, pivot = self.kernel("tree_rates")(q, v, p)
        return w, pivot[..., 0]

    def joints_moving(
        self, q: np.ndarray, v: np.ndarray, v_dot: np.ndarray, p: np.ndarray, told: bool
    ) -> tuple[np.ndarray, ...]:
        """Return positions, as they are read off the tree's, rates and accelerations (K, m) of all
        joints; told: by a table, and a kernel that all charts share."""
        if not told:
            return self.kernel("joints_motion")(q, v, v_dot, p)[:3]
        return self.free.kernel("joints_motion")(q, *self.in_tree(q, v, p, v_dot), p)[:3]

    def from_tree(self, w: np.ndarray) -> np.ndarray:
        """Return v (..., n) from the rates of the whole tree."""
        return w[..., list(self.equations.chart.independent)]

    def constraint_jacobian(self, q: np.ndarray, p: np.ndarray | None = None) -> np.ndarray:
        """Return Phi (..., rows x nv) at configurations; p: of each, the chart's if left out."""
        rows, width = len(self.equations.rows.names), self.equations.nv
        if not rows:
            return np.zeros((*q.shape[:-1], 0, width))
        p, kernel = self.p if p is None else p, self.shared.kernel("constraints")
        if q.ndim == p.ndim == 1:
            return kernel.flat(q, p)[rows:].reshape(width, rows).T
        found = kernel(q, p)[1]
        return np.swapaxes(found.reshape(*q.shape[:-1], width, rows), -1, -2)

    def residuals(self, q: np.ndarray) -> np.ndarray:
        """Return phi (rows) at one configuration."""
        return self.shared.kernel("constraints")(q, self.p)[0]

    def unheld_gap(self, q: np.ndarray, p: np.ndarray | None = None) -> np.ndarray:
        """Return the largest gap (...) of rows that are redundant and not held, at configurations;
        p: of each."""
        if self.equations.rows.unheld is None:
            return np.zeros(q.shape[:-1])
        return self.shared.kernel("unheld_gap")(q, self.p if p is None else p)[0][..., 0]

    def better(self, q: np.ndarray, preferred: tuple[int, ...]) -> CompiledChart:
        """Return a chart chosen at q (nq): independent rates, rows and elimination are those that
        are good there."""
        for _, chart in charts_at(self.equations, self.constraint_jacobian(q[None]), preferred):
            return self.in_chart(chart)
        raise LinkworkError(
            "no choice of independent rates determines the motion here: branches of motion "
            "meet, or it ends"
        )

    def strengths(self, Phi: np.ndarray) -> np.ndarray:
        """Return the weakest pivot, free of units, at configurations (G); Phi: (G x rows x nv)."""
        return strengths(self.equations, self.equations.chart, Phi)

    def anew(
        self,
        q: np.ndarray,
        independent: tuple[int, ...],
        least: float = DETERMINED,
        p: np.ndarray | None = None,
    ) -> CompiledChart | None:
        """Return a chart in given independent rates that is good at q (nq); None where they do not
        determine the motion."""
        chart = chart_in(self.equations, self.constraint_jacobian(q, p), independent, least)
        return chart and self.in_chart(chart)

    def in_chart(self, chart: Chart) -> CompiledChart:
        """Return the same equations in another chart."""
        return CompiledChart(self.equations.in_chart(chart), self.p, home=self.home or self)


@dataclass(frozen=True, eq=False)
class Charts(MutableMapping[Any, CompiledChart]):
    """Hold charts by key for robots that differ in the values of their free parameters: each sees
    them with its own p."""

    p: np.ndarray
    _shared: dict[Any, CompiledChart] = field(default_factory=dict)
    _own: dict[Any, CompiledChart] = field(default_factory=dict)

    def with_parameters(self, p: np.ndarray) -> Charts:
        """Return the same charts, those still to come included, with other values of the free
        parameters."""
        return Charts(p, self._shared)

    def of(self, key: Chart, like: CompiledChart) -> CompiledChart:
        """Return the chart of a key, of the same equations as another one where it is new."""
        return self.get(key) or self.setdefault(key, like.in_chart(key))

    def __getitem__(self, key: Any) -> CompiledChart:
        chart = self._own.get(key)
        if chart is None:
            chart = self._own[key] = self._shared[key].with_parameters(self.p)
        return chart

    def __setitem__(self, key: Any, chart: CompiledChart) -> None:
        self._own[key] = self._shared[key] = chart

    def __delitem__(self, key: Any) -> None:
        del self._shared[key]
        self._own.pop(key, None)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._shared)

    def __len__(self) -> int:
        return len(self._shared)


def shorter(home: CompiledChart, q: np.ndarray) -> CompiledChart:
    """Return the chart for runs: of the home chart and that of free bodies' own rates the one with
    fewer instructions."""
    equations = home.equations
    labels = [
        label
        for name, joint in equations.topology.joints.items()
        if joint.type == "free"
        for label in joint.rates(name)
    ]
    if equations.recursive or not labels or set(labels) == set(home.independent):
        return home
    candidate = home.better(q, tuple(sorted(equations.tree.rates.index(label) for label in labels)))
    counts = [chart._function("motion").n_instructions() for chart in (home, candidate)]
    return candidate if counts[1] < counts[0] else home
