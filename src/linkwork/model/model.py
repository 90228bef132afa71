"""Model: what a robot is made of (description, equations, charts, kernels), and the checks at its
doors."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache, partial
from os import PathLike
from typing import Any

import numpy as np

from linkwork.checks import amount
from linkwork.control.observation import Names
from linkwork.equations import Equations, body_motion, mobility
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.formats.named import mechanism_of
from linkwork.kernels import Kernel
from linkwork.mechanism import Mechanism
from linkwork.mechanism.bearing import bearings
from linkwork.model import checks
from linkwork.model.asked import Asked, JointsAsked, ToolAsked, values_kernel
from linkwork.model.assembly import Assembler, evaluate
from linkwork.model.charts import Charts, CompiledChart, shorter
from linkwork.model.closing import Least, approach
from linkwork.model.derivations import derived, kept
from linkwork.model.directly import DirectCalls
from linkwork.model.known_charts import KnownCharts
from linkwork.model.labels import POSES
from linkwork.model.leading import Leader
from linkwork.model.modes import ModeStages, modes_of
from linkwork.model.state import State
from linkwork.model.turning import own_turning, turnable
from linkwork.model.walking import Walker
from linkwork.model.whole_turns import TurnedLabels
from linkwork.readonly import FreeNumbers, SetOnce
from linkwork.simulation import Turning


class Model(SetOnce):
    """Hold a mechanism, its equations in one or more charts, and their kernels, which are compiled
    when first needed.

    `Robot` is made of it, and the modules of this package work on it.
    """

    def __init__(
        self,
        mechanism: Mechanism | str | PathLike[str],
        independent: Sequence[str] = (),
        free: Sequence[str] = (),
    ):
        # What is asked for, then the derivation, which takes nearly all of the time.
        self.mechanism = mechanism = mechanism_of(mechanism, stacklevel=3)
        wanted = checks.names(independent, "independent")
        self.asked = mechanism, wanted, checks.names(free, "free")
        self.equations: Equations = derived(*self.asked)
        for caveat in self.equations.caveats:
            warnings.warn(caveat, ModelWarning, stacklevel=2)
        self.parameters: dict[str, float] = FreeNumbers(self.equations.parameters)
        self.p = np.array(list(self.parameters.values()))
        self.p.flags.writeable = False
        self.chart = CompiledChart(self.equations, self.p)
        self.labels = TurnedLabels(self.chart)
        checks.known(wanted, self.equations.tree.rates, "rate of the tree")
        # What derivation found, and names in their order.
        self.independent: tuple[str, ...] = self.equations.independent
        self.coordinates: tuple[str, ...] = mechanism.coordinates
        self.rates: tuple[str, ...] = mechanism.rates
        self.joints: tuple[str, ...] = tuple(mechanism.joints)
        self.actuators: tuple[str, ...] = mechanism.actuators
        self.bodies: tuple[str, ...] = tuple(mechanism.bodies)
        self.redundant: tuple[str, ...] = self.equations.redundant
        self.spins: tuple[str, ...] = tuple(self.equations.spins)
        self.idle: tuple[str, ...] = self.equations.idle
        self.notes: tuple[str, ...] = self.equations.notes
        self.mobility: int = self.equations.mobility
        tool = mechanism.first_tool if mechanism.tools else None
        self.planar: bool = body_motion.is_planar(self.equations.tree, tool)
        in_plane = self.planar or body_motion.is_planar(self.equations.tree)
        self.gruebler: int = mobility.gruebler(mechanism, in_plane)
        # Charts by what asks for them: independent rates by name, elimination of runs.
        self.charts = Charts(self.p, {self.independent: self.chart})
        self.run_charts = Charts(self.p, {self.chart.key: self.chart})
        self.origin: Model | None = None

    def __repr__(self) -> str:
        size = f"{amount(len(self.bodies), 'body')}, {amount(len(self.joints), 'joint')}"
        return f"Robot({self.mechanism.name!r}, mobility {self.mobility}, {size})"

    @cached_property
    def names(self) -> Names:
        """Return the names by which controllers read."""
        return Names.of(self.mechanism, self.planar)

    @cached_property
    def rubs(self) -> bool:
        """Whether bearings rub by what they carry."""
        return bool(bearings(self.mechanism.joints))

    @cached_property
    def home(self) -> State:
        """Return the closed reference configuration, at rest."""
        return self.make_state(self.equations.reference, np.zeros(self.mobility))

    def unit(self, label: str) -> str:
        """Return the unit of a joint coordinate or rate (of a rate: per second): m, rad, or 1 for a
        part of a quaternion.

        label: of the coordinate, or of the rate.
        """
        return self.labels.unit(label)

    def chart_of(self, state: State) -> CompiledChart:
        """Return the chart whose rates a state, or a stack of them, holds."""
        return self.charts[state.independent]

    @cached_property
    def once(self) -> Callable[..., Any]:
        """Call a function of this robot and of what tells its results apart; results are kept for
        some calls to come."""
        return lru_cache(maxsize=1024)(lambda function, *given: function(self, *given))

    @cached_property
    def directly(self) -> Callable[..., DirectCalls]:
        """Return the shortest calls of a kernel at one state, by its name."""
        return lru_cache(maxsize=None)(partial(DirectCalls.of, self.coordinates, self.charts))

    @property
    def kernel(self) -> Callable[[str], Kernel]:
        """Return a compiled kernel of the home chart by name: motion, inverse_dynamics, terms,
        maps, closure_step ..."""
        return self.chart.kernel

    @cached_property
    def size(self) -> float:
        """Return what rounding in the closure rows grows with: lengths over the mechanism's own,
        and angles; of the description's own numbers, whatever values its free ones have, so that
        loops are closed as far alone as among many with other numbers."""
        of = self.origin or self
        return of.labels.size(of.mechanism, of.equations.reference, of.home.positions)

    @cached_property
    def turning(self) -> Turning:
        """Return how large coordinates may grow in a run, and which angles may be wrapped where
        only forces over time act."""
        return own_turning(self.chart, self.size * self.equations.tree.length)

    @cached_property
    def run_chart(self) -> CompiledChart:
        """Return the chart that runs start in: of the home chart and that of free bodies' own rates
        the shorter one."""
        if self.origin is not None:
            return self.origin.run_chart.with_parameters(self.p)
        home, equations = self.chart, self.equations
        found = kept(lambda: shorter(home, equations.reference).key, "run chart", equations.key)
        chart = home if found == home.key else replace(home.in_chart(found), home=None)
        return self.charts.setdefault(chart.independent, chart)

    @cached_property
    def known_charts(self) -> KnownCharts:
        """Return what chooses charts for runs, and knows those that were chosen."""
        if self.origin is not None:
            return self.origin.known_charts
        return KnownCharts(self.equations, [*self.equations.chart.independent])

    @cached_property
    def assembler(self) -> Assembler:
        tree, rows = self.equations.tree, self.equations.rows
        unheld = rows.unheld.names if rows.unheld else ()
        outputs = partial(evaluate, self.kernel("assembly"))
        return Assembler(outputs, tree, rows.names, unheld, rows.units, self.planar)

    def leader_of_tool(self, asked: ToolAsked, kept: bool) -> Leader:
        """Return what leads the tool in task coordinates; kept: whether on the working mode of
        where it begins.

        asked: values of task coordinates.
        """
        return self._leader(asked, kept, True)

    def leader_of_joints(self, asked: JointsAsked) -> Leader:
        """Return what leads joint coordinates, on the branch as far as they determine it.

        asked: values of joint coordinates.
        """
        determined = len(asked.what) == self.mobility and not self.spins
        return self._leader(asked, determined, False)

    def _leader(self, asked: Asked, kept: bool, strict: bool) -> Leader:
        if (key := (asked.names, kept)) not in self._leaders:
            modes = modes_of(self.equations, self.p, asked) if kept else ModeStages()
            compiled = approach(self.chart, modes, asked)
            walker = Walker(compiled, modes, self.chart, asked) if compiled else None
            steps = self.least(asked, modes), compiled, walker
            given = self.assembler, modes, strict, self.mechanism, self.home.q, self.chart
            self._leaders[key] = Leader(*steps, *given)
        return self._leaders[key]

    def least(self, asked: Asked, modes: ModeStages | None = None) -> Least:
        """Return the steps of least squares towards what is asked.

        asked: of the tool or of joints; modes: which working mode is kept, if any.
        """
        tree, rows = self.equations.tree, self.equations.rows
        return Least(self.kernel("assembly"), tree, rows.units, asked, modes or ModeStages())

    @cached_property
    def joints_asked(self) -> Callable[[tuple[str, ...]], JointsAsked]:
        """Return what values of some joint coordinates ask for."""
        return lru_cache(maxsize=64)(self._joints_asked)

    def _joints_asked(self, names: tuple[str, ...]) -> JointsAsked:
        for name in names:
            if name not in self.rates:
                raise LinkworkError(
                    f"{name!r} is part of a quaternion and cannot be asked for alone; give "
                    "angles and slides, or the tool's pose"
                )
        places = [self.coordinates.index(name) for name in names]
        rates = [self.rates.index(name) for name in names]
        angular = self.labels.angular[places]
        wraps = angular.copy()
        wraps[angular] = turnable(self.chart, np.array(places, int)[angular].tolist())
        return JointsAsked(names, places, rates, angular, wraps, self.labels.sizes[places])

    @cached_property
    def _leaders(self) -> dict[tuple[tuple[str, ...], bool], Leader]:
        return {}

    def tool_poses(self, q: np.ndarray, p: np.ndarray | None = None) -> np.ndarray:
        """Return the tool's poses (x, y, angle) (..., 3) in the plane, or with rotation vectors
        (..., 6), for the tree's coordinates (..., nq), and other free numbers where given.

        q: the tree's coordinates [m, rad]; p: values of the free numbers; the robot's if left out.
        """
        self.require_tool()
        kernel = values_kernel(self.chart, POSES[self.planar])
        return kernel(q, self.p if p is None else p)[0]

    def make_state(self, q: np.ndarray, v: np.ndarray) -> State:
        """Return the state of tree coordinates q (..., nq) and rates v (..., n) of this chart."""
        q = np.ascontiguousarray(q)
        (positions,) = self.kernel("positions")(q)
        return State.known(
            positions, np.ascontiguousarray(v), q, self.coordinates, self.independent
        )

    def windings(self, state: State) -> np.ndarray:
        """Return the whole turns of joints' coordinates (..., m) that a state holds beside its
        q."""
        (read,) = self.kernel("positions")(state.q)
        if (state.positions == read).all():
            return 0 * read
        return self.labels.windings(state.positions, read)

    def own(self, state: State, alike: bool = True) -> State:
        """Return a state for this robot; refuse the state of another one; alike: one of its own
        numbers, by which its loops are closed."""
        if not (isinstance(state, State) and state.coordinates is self.coordinates):
            checks.refuse_foreign(state, self.coordinates, self.charts, self.equations.nq)
            if alike:
                gap = self.kernel("closure_step")(state.q)[1]
                (read,) = self.kernel("positions")(state.q)
                told = self.labels.nearest(read, state.positions)
                checks.refuse_apart(state, gap, told, self.labels.sizes)
        return state

    def require_tool(self) -> None:
        _ = self.mechanism.first_tool
