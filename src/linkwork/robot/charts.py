"""Charts of a robot: its equations in different independent rates, each with kernels compiled when first needed.

The home chart has the actuated rates where these determine the motion. A run may start in a shorter one, and changes
to a better one where its pivots weaken. q is the same in all of them; the rates of one follow from those of another by

    w = L v  (all rates of the tree),    v_other = w at the other's independent rates.

Kernels take the values of the free parameters p; a chart knows those of its robot and hands them to its kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from linkwork.equations import Equations, chart_at, functions
from linkwork.equations.algebra import dense
from linkwork.equations.chart import faced
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function

KERNELS = (
    "motion",
    "inverse_dynamics",
    "actuation",
    "terms",
    "closure_step",
    "pivots",
    "tree_rates",
    "maps",
    "positions",
    "joints_motion",
    "bodies_motion",
    "energy",
    "assembly",
    "regressor",
)


@dataclass(frozen=True, eq=False)
class CompiledChart:
    """Hold the equations in one chart, the values p (np) of their free parameters, and their kernels by name."""

    equations: Equations
    p: np.ndarray
    _kernels: dict[str, Kernel] = field(default_factory=dict, repr=False)

    def with_parameters(self, p: np.ndarray) -> CompiledChart:
        """Return the chart with other values of the free parameters; both share their kernels."""
        return replace(self, p=p)

    @cached_property
    def kernel(self) -> Callable[[str], Kernel]:
        """Return a compiled kernel by name: motion, inverse_dynamics, terms, maps, closure_step, joints_motion ...

        It takes p as its last input; left out, that is the chart's.
        """
        return lru_cache(maxsize=None)(self._kernel)

    def _kernel(self, name: str) -> Kernel:
        if name not in KERNELS:
            raise LinkworkError(f"there is no kernel {name!r}; there are {', '.join(KERNELS)}")
        return self.compiled(name, getattr(functions, name)).given(self.p)

    def compiled(self, key: str, make: Callable[[Equations], ca.Function]) -> Kernel:
        """Return the kernel of a function of these equations, kept under a key for all charts that share kernels."""
        if key not in self._kernels:
            self._kernels[key] = compile_function(make(self.equations))
        return self._kernels[key]

    @property
    def independent(self) -> tuple[str, ...]:
        return self.equations.independent

    @cached_property
    def key(self) -> tuple[object, ...]:
        """Return what tells charts apart: independent rates, rows, order of elimination and signs of the pivots."""
        chart = self.equations.chart
        signs = tuple(scale > 0 for stage in chart.stages for scale in stage.scales)
        return chart.independent, chart.rows, tuple(chart.blocks), signs

    def facing(self, q: np.ndarray) -> CompiledChart:
        """Return this chart with its pivots counted positive at q, where it is regular."""
        (pivots,) = self.kernel("pivots")(q)
        return self._facing(tuple(np.where(pivots < 0, -1.0, 1.0).tolist()))

    @cached_property
    def _facing(self) -> Callable[[tuple[float, ...]], CompiledChart]:
        chart = self.equations.chart
        return lru_cache(maxsize=None)(
            lambda signs: CompiledChart(self.equations.in_chart(faced(chart, signs)), self.p)
        )

    def pivot(self, q: np.ndarray) -> float:
        """Return the weakest relative pivot at one configuration."""
        return float(self.kernel("tree_rates")(q, np.zeros(len(self.independent)))[1][0])

    def tree_rates(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return w = L v (..., nv), the rates of the whole tree."""
        return self.kernel("tree_rates")(q, v)[0]

    def from_tree(self, w: np.ndarray) -> np.ndarray:
        """Return v (..., n) from the rates of the whole tree."""
        return w[..., list(self.equations.chart.independent)]

    def constraint_jacobian(self, q: np.ndarray) -> np.ndarray:
        """Return Phi (rows x nv) at one configuration."""
        return dense(self._constraints(q, self.p)[1])

    def residuals(self, q: np.ndarray) -> np.ndarray:
        """Return phi (rows) at one configuration."""
        return np.array(self._constraints(q, self.p)[0]).ravel()

    @cached_property
    def _constraints(self) -> ca.Function:
        return functions.constraints(self.equations)

    def conditioning(self, Phi: np.ndarray) -> float:
        """Return the smallest over the largest singular value of what the elimination solves; 1 if it solves nothing."""
        chart = self.equations.chart
        solved = self.equations.scaled(Phi)[np.ix_(chart.rows, chart.dependent)]
        if not solved.size:
            return 1.0
        values = np.linalg.svd(solved, compute_uv=False)
        return float(values[-1] / max(values[0], 1e-300))

    def better(self, q: np.ndarray, preferred: tuple[int, ...]) -> CompiledChart:
        """Return a chart chosen at q: independent rates, rows and elimination are those that are good there."""
        Phi = self.constraint_jacobian(q)
        return CompiledChart(self.equations.in_chart(chart_at(self.equations, Phi, preferred)), self.p)


@dataclass(frozen=True, eq=False)
class Charts(MutableMapping[tuple[object, ...], CompiledChart]):
    """Hold charts by key for robots that differ in the values of their free parameters: each sees them with its own p."""

    p: np.ndarray
    _shared: dict[tuple[object, ...], CompiledChart] = field(default_factory=dict)
    _own: dict[tuple[object, ...], CompiledChart] = field(default_factory=dict)

    def with_parameters(self, p: np.ndarray) -> Charts:
        """Return the same charts, those still to come included, with other values of the free parameters."""
        return Charts(p, self._shared)

    def __getitem__(self, key: tuple[object, ...]) -> CompiledChart:
        chart = self._own.get(key)
        if chart is None:
            chart = self._own[key] = self._shared[key].with_parameters(self.p)
        return chart

    def __setitem__(self, key: tuple[object, ...], chart: CompiledChart) -> None:
        self._own[key] = self._shared[key] = chart

    def __delitem__(self, key: tuple[object, ...]) -> None:
        del self._shared[key]
        self._own.pop(key, None)

    def __iter__(self) -> Iterator[tuple[object, ...]]:
        return iter(self._shared)

    def __len__(self) -> int:
        return len(self._shared)


def shorter(home: CompiledChart, q: np.ndarray) -> CompiledChart:
    """Return the chart for runs: of the home chart and that of free bodies' own rates the one with fewer instructions."""
    equations = home.equations
    joints = equations.topology.joints
    labels = [label for name, joint in joints.items() if joint.type == "free" for label in joint.rates(name)]
    if not labels or set(labels) == set(home.independent):
        return home
    candidate = home.better(q, tuple(sorted(equations.tree.rates.index(label) for label in labels)))
    counts = [functions.motion(chart.equations).n_instructions() for chart in (home, candidate)]
    return candidate if counts[1] < counts[0] else home
