"""Robot: the one object a user holds. It joins description, derivation, compilation and simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations, derive, functions, measures, mobility
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.mechanism import Mechanism
from linkwork.paths import Path
from linkwork.robot import actuation, checks, evaluation, limits, posing
from linkwork.robot.assembly import Assembler, AssemblyKernel
from linkwork.robot.charts import CompiledChart, shorter
from linkwork.robot.labels import Labels
from linkwork.robot.state import Motion, State

if TYPE_CHECKING:
    from linkwork.simulation import Run, Sampled, Signal


class Robot:
    """Derive, compile and evaluate the exact equations of motion of a mechanism in independent rates v.

        M(q) v' + C(q, v) v + G(q) = S' u + f,    q' = L(q) v                  (paper, Eqs. (7), (9)-(12))

    Everything is in SI units and radians. The independent rates, and so the order of M and of accelerations, are those
    named by `independent`: the actuated ones in the order of `actuators` (S = 1) where these determine the motion;
    else as many of them as are independent, and others. f are the forces of springs and friction. Joint coordinates
    are in the order of `coordinates`, their rates in that of `rates`. Methods take one state or a stack of states with
    leading dimensions, and return arrays with the same leading dimensions. Kernels are compiled when they are first
    needed and kept in the user's cache folder.

    Args:
        mechanism: the description, from `linkwork.robots`, a file (`Robot.from_file`) or code.
        independent: rates that should be the independent ones, by name, as far as they determine the motion.

    Attributes:
        mobility: number n of independent rates; gruebler: what Gruebler's formula gives for it
        redundant: closure rows that depend on the others, by joint and direction; they are left out and watched
        idle: freedoms that turn a member about its own axis and move nothing else, by name

    Raises:
        MechanismError: a description that cannot be assembled or has no motion, in one sentence.
    """

    def __init__(self, mechanism: Mechanism, independent: Sequence[str] = ()):
        if not isinstance(mechanism, Mechanism):
            raise LinkworkError(
                f"a robot is made from a Mechanism, not from {mechanism!r}; see linkwork.robots, or Robot.from_file"
            )
        self.mechanism = mechanism
        wanted = checks.names(independent, "independent")
        self.equations: Equations = derive(mechanism, wanted)
        self.p = np.array(list(self.equations.parameters.values()))
        self.chart = CompiledChart(self.equations, self.p)
        self.labels = Labels(self.equations)
        checks.known(wanted, self.equations.tree.rates, "rate of the tree")
        self.independent: tuple[str, ...] = self.equations.independent
        self.coordinates: tuple[str, ...] = mechanism.coordinates
        self.rates: tuple[str, ...] = mechanism.rates
        self.joints: tuple[str, ...] = tuple(mechanism.joints)
        self.actuators: tuple[str, ...] = mechanism.actuators
        self.bodies: tuple[str, ...] = tuple(mechanism.bodies)
        self.redundant: tuple[str, ...] = self.equations.redundant
        self.idle: tuple[str, ...] = self.equations.idle
        self.mobility: int = self.equations.mobility
        self.planar: bool = measures.is_planar(self.equations.tree)
        self.gruebler: int = mobility.gruebler(mechanism, self.planar)
        self.charts: dict[tuple[str, ...], CompiledChart] = {self.independent: self.chart}
        self.run_charts: dict[tuple[object, ...], CompiledChart] = {self.chart.key: self.chart}

    @classmethod
    def from_file(cls, path: str | FilePath) -> Robot:
        """Read a mechanism file (YAML) and derive its equations."""
        return cls(Mechanism.load(path))

    def __repr__(self) -> str:
        size = f"{len(self.bodies)} bodies, {len(self.joints)} joints"
        return f"Robot({self.mechanism.name!r}, mobility {self.mobility}, {size})"

    # States

    @cached_property
    def home(self) -> State:
        """Return the closed reference configuration, at rest."""
        return self.make_state(self.equations.reference, np.zeros(self.mobility))

    def state(
        self,
        positions: ArrayLike | Mapping[str, ArrayLike],
        rates: ArrayLike | Mapping[str, ArrayLike] | None = None,
        *,
        tolerance: float = posing.OPEN_LOOPS,
    ) -> State:
        """Make a state from the coordinates of all joints.

        Args:
            positions: q of all joints (..., m) [m, rad] in the order of `coordinates`, or by name.
            rates: v (..., n) [m/s, rad/s] in the order of `independent`, or n rates of any joints by name; zero if left
            out.
            tolerance: largest gap [m, rad] of a loop; what is open by less is closed exactly by moving the dependent
            joints.

        Raises:
            LinkworkError: wrong shapes or names, numbers that are not finite, loops that are open.
        """
        return posing.state(self, positions, rates, tolerance)

    def assemble(
        self,
        joints: Mapping[str, float] | None = None,
        *,
        tool: ArrayLike | None = None,
        rates: ArrayLike | Mapping[str, ArrayLike] | None = None,
        guess: State | None = None,
    ) -> State:
        """Close the loops at given joint coordinates (direct kinematics) or at a tool pose (inverse kinematics).

        Args:
            joints: some joint coordinates by name [m, rad].
            tool: pose of the tool (..., 2 or 3) in the plane: x, y[, angle]; (..., 3 or 6) in space: x, y, z[, rotation
                vector] [m, rad]. Leading dimensions give a stack of states, each from the same guess.
            rates: v (n) in the order of `independent`, or n rates of any joints by name; zero if left out.
            guess: a state on the wanted branch (working mode, assembly mode); `home` if left out.

        Raises:
            UnreachableError: what is asked is out of reach, or not reachable from this guess.
        """
        return posing.assemble(self, joints, tool, rates, guess)

    def follow(self, path: Path, duration: float, *, samples: int = 101, guess: State | None = None) -> Motion:
        """Lead the tool along a path: positions, rates and accelerations of all joints.

        Args:
            path: a tool path (`linkwork.paths`), of as many coordinates as the mobility.
            duration: T [s].
            samples: number of equally spaced times from 0 to T.
            guess: a state on the wanted branch, near the first pose; `home` if left out.

        Raises:
            UnreachableError: with the time and pose at which the path leaves the workspace.
        """
        return posing.follow(self, path, duration, samples, guess)

    # Charts

    def in_chart(self, state: State, independent: Sequence[str]) -> State:
        """Return the same state with other independent rates, read off the rates of all joints.

        Args:
            independent: n rates of the tree's joints by name (`equations.tree.rates`); M, accelerations and all else that
                a state gives are then in these.

        Raises:
            LinkworkError: names that are no rates of the tree; rates that do not determine the motion there.
        """
        names, tree = checks.names(independent, "independent"), self.equations.tree.rates
        checks.known(names, tree, "rate of the tree")
        w = self.chart_of(self.own(state)).tree_rates(state.q, state.rates)
        chart = self.charts.get(names)
        for q in state.q.reshape(-1, state.q.shape[-1]):
            if chart is None or not abs(chart.pivot(q)) > checks.PIVOT_BOUND:
                chart = self.chart.better(q, tuple(tree.index(name) for name in names))
            if set(chart.independent) != set(names):
                raise LinkworkError(
                    f"the rates {', '.join(names)} do not determine the motion here; {', '.join(chart.independent)} do"
                )
        if chart is None:
            raise LinkworkError("the stack of states is empty; there is no configuration to choose the rates at")
        self.charts[chart.independent] = chart
        return replace(state, rates=chart.from_tree(w), independent=chart.independent)

    def chart_of(self, state: State) -> CompiledChart:
        return self.charts[state.independent]

    # Equations of motion

    def forward_dynamics(self, state: State, forces: ArrayLike) -> np.ndarray:
        """Return the accelerations of the independent rates, v' = M^-1 (S' u + f - C v - G) (paper, Eq. (9)).

        Args:
            state: configuration and rates.
            forces: u of the actuators (..., actuators) [N, N m], in the order of `actuators`.

        Returns:
            v' (..., n) [m/s^2, rad/s^2], in the order of the state's `independent`.

        Raises:
            LinkworkError: wrong shape, numbers that are not finite, a configuration where these rates do not
                determine the motion.
        """
        u = checks.vector(forces, "forces", self.actuators)
        return evaluation.dynamics(self, "motion", state, u, "forces")

    def inverse_dynamics(
        self, motion: State | Motion, accelerations: ArrayLike | None = None, *, weights: ArrayLike | None = None
    ) -> np.ndarray | Sampled:
        """Return the actuator forces that a state and accelerations, or a whole motion, need: S' u = M v' + C v + G - f.

        With more actuators than freedoms these are the forces of least  sum weight_i u_i^2  (`internal_forces` may be
        added); with fewer they are not defined.

        Args:
            motion: a state, or a `Motion` (whose own accelerations are then taken).
            accelerations: v' (..., n) [m/s^2, rad/s^2] in the order of the state's `independent`, with a state.
            weights: of the actuators (positive); all 1 if left out.

        Returns:
            u (..., actuators) [N, N m]; for a motion a `Sampled` signal over its times, to simulate with.

        Raises:
            LinkworkError: directions that no actuator drives, by name; an actuator-singular configuration.
        """
        if isinstance(motion, Motion):
            from linkwork.simulation import Sampled

            forces = evaluation.actuator_forces(self, motion.state, motion.accelerations, weights)
            return Sampled(motion.time, forces)
        if accelerations is None:
            raise LinkworkError("give the accelerations of the independent rates with a state")
        return evaluation.actuator_forces(self, motion, accelerations, weights)

    def actuation(self, state: State) -> np.ndarray:
        """Return S (..., actuators, n): the actuated rates are S v, and forces u of the actuators act as S' u on v."""
        return evaluation.actuation_map(self, state)

    def internal_forces(self, state: State) -> np.ndarray:
        """Return an orthonormal basis (actuators, k) of the actuator forces that do not act on the motion, S' u = 0.

        There are k = actuators - n of them where the robot has more actuators than freedoms, none otherwise.
        """
        if self.own(state).batch:
            raise LinkworkError("internal forces are those of one state, not of a stack; take one by state.at(index)")
        return actuation.internal_forces(self.actuation(state))

    def mass_matrix(self, state: State) -> np.ndarray:
        """Return the generalised inertia M (..., n, n) in the independent rates (paper, Eq. (10))."""
        return evaluation.terms(self, state)[0]

    def coriolis(self, state: State) -> np.ndarray:
        """Return the Coriolis and centrifugal forces C v (..., n) [N, N m] (paper, Eq. (11))."""
        return evaluation.terms(self, state)[1]

    def gravity(self, state: State) -> np.ndarray:
        """Return the forces G (..., n) [N, N m] that hold the weight (paper, Eq. (12))."""
        return evaluation.terms(self, state)[2]

    def passive_forces(self, state: State) -> np.ndarray:
        """Return the forces f (..., n) [N, N m] of springs, dampers and friction on the independent rates."""
        return evaluation.terms(self, state)[3]

    def rate_map(self, state: State) -> np.ndarray:
        """Return L (..., m, n): rates of all joints, in the order of `rates`, from the independent ones (paper, Eq. (7))."""
        return evaluation.maps(self, state)[0]

    def twist_map(self, state: State) -> np.ndarray:
        """Return T (..., 6r, n): twists [omega; v of the mass centre] of all bodies, in the ground's axes (paper, Eq. (6))."""
        return evaluation.maps(self, state)[1]

    def energy(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the kinetic energy v' M v / 2 and the potential energy of weight and springs (...) [J]."""
        kinetic, potential, pivot = self.chart_of(self.own(state)).kernel("energy")(state.q, state.rates)
        evaluation.require_regular(state, pivot, kinetic, state.rates, "rates")
        return kinetic[..., 0], potential[..., 0]

    # Kinematics

    def joint_rates(self, state: State) -> np.ndarray:
        """Return the rates of all joints (..., m) [m/s, rad/s], in the order of `rates`."""
        return evaluation.joints_motion(self, state, 0 * self.own(state).rates)[1]

    def joint_accelerations(self, state: State, accelerations: ArrayLike) -> np.ndarray:
        """Return the accelerations of all joints (..., m) for those of the independent rates, L v' + L' v."""
        v_dot = checks.vector(accelerations, "accelerations", self.own(state).independent)
        return evaluation.joints_motion(self, state, v_dot)[2]

    def body_poses(self, state: State) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return the origin p_0B (..., 3) [m] and the matrix R_0B (..., 3, 3) of each body's frame, by name."""
        origins, orientations, *_ = self.kernel("bodies_motion")(self.own(state).q, np.zeros(self.mobility))
        p = origins.reshape(*state.batch, len(self.bodies), 3)
        R = orientations.reshape(*state.batch, len(self.bodies), 3, 3)
        return {name: (p[..., i, :], R[..., i, :, :]) for i, name in enumerate(self.bodies)}

    def twists(self, state: State) -> np.ndarray:
        """Return the twists t_i = [omega; v of the mass centre] of the bodies (..., r, 6), in the ground's axes."""
        *_, twists, pivot = self.chart_of(self.own(state)).kernel("bodies_motion")(state.q, state.rates)
        evaluation.require_regular(state, pivot, twists, state.rates, "rates")
        return twists.reshape(*state.batch, len(self.bodies), 6)

    def tool_pose(self, state: State) -> np.ndarray:
        """Return the tool's pose: x, y, angle (..., 3) in the plane; x, y, z, rotation vector (..., 6) in space [m, rad]."""
        return self.tool_poses(self.own(state).q)

    def unit(self, label: str) -> str:
        """Return the unit of a joint coordinate or rate (of a rate: per second): m, rad, or 1 for a part of a quaternion."""
        return self.labels.unit(label)

    def closure_error(self, state: State) -> np.ndarray:
        """Return the largest loop residual max |phi| (...) [m, rad], redundant rows included."""
        return self.kernel("closure_step")(self.own(state).q)[1][..., 0]

    def limits_passed(self, state: State) -> tuple[str, ...]:
        """Return one sentence for each joint coordinate that lies outside its limits in a state."""
        return limits.passed(self.mechanism, self.coordinates, self.own(state).positions)

    # Simulation

    def simulate(
        self,
        state: State,
        forces: ArrayLike | Mapping[str, float] | Sampled | Signal | None = None,
        *,
        duration: float,
        rtol: float = 1e-8,
        atol: float = 1e-10,
        save_at: ArrayLike | None = None,
        max_step: float = np.inf,
        max_steps: int = 1_000_000,
        on_singular: Literal["stop", "step_over"] = "stop",
    ) -> Run:
        """Integrate the equations of motion from a state under actuator forces (paper, algorithm of forward dynamics).

        Adaptive Dormand-Prince 5(4); after each step the loops are closed exactly by projection on phi = 0. Where the
        independent rates become a weak choice the run goes on in better ones. Where no rates determine the motion (a
        bifurcation: branches of motion meet) it stops, or steps over to the smooth continuation.

        Args:
            state: where to start.
            forces: u (n) [N, N m] constant, by name, or sampled over time (`linkwork.Sampled`); zero if left out.
            duration: T [s].
            rtol, atol: relative and absolute tolerance of the local error of coordinates and rates.
            save_at: times to save [s]; every accepted step if left out.
            max_step: largest step [s].
            max_steps: most steps to take.
            on_singular: what to do at a bifurcation.

        Returns:
            A `Run`: its `status` and `message` say how it ended; `dataset` holds what was computed until then.
        """
        from linkwork.robot.recording import simulate

        for name, value in (("the duration", duration), ("rtol", rtol), ("atol", atol), ("max_steps", max_steps)):
            checks.positive(value, name)
        if max_step != np.inf:
            checks.positive(max_step, "max_step")
        options = {"rtol": rtol, "atol": atol, "max_step": max_step, "max_steps": max_steps}
        return simulate(self, self.own(state), forces, duration, save_at, on_singular, options)

    # Kernels

    @property
    def kernel(self) -> Callable[[str], Kernel]:
        """Return a compiled kernel of the home chart by name: motion, inverse_dynamics, terms, maps, closure_step ..."""
        return self.chart.kernel

    @cached_property
    def size(self) -> float:
        """Return what rounding in the closure rows grows with: the largest length [m], at least 1 where a row is no length."""
        return self.labels.size(self.equations.reference, self.home.positions)

    @cached_property
    def run_chart(self) -> CompiledChart:
        """Return the chart that runs start in: of the home chart and that of free bodies' own rates the shorter one."""
        chart = shorter(self.chart, self.equations.reference)
        return self.charts.setdefault(chart.independent, chart)

    @cached_property
    def _assembly(self) -> AssemblyKernel:
        tool = next(iter(self.mechanism.tools.values()), None)
        return AssemblyKernel.of(functions.assembly(self.equations, tool), self.planar, self.p)

    @cached_property
    def assembler(self) -> Assembler:
        tree, rows = self.equations.tree, self.equations.rows.names
        evaluate = self._assembly.evaluate
        return Assembler(evaluate, tree, self.coordinates, self.rates, self.labels.angular, rows, self.planar)

    def tool_poses(self, q: np.ndarray) -> np.ndarray:
        """Return the tool's pose as `tool_pose` does, for the tree's coordinates (..., nq)."""
        self.require_tool()
        return self._assembly.tool_poses(q)

    # Checks

    def make_state(self, q: np.ndarray, v: np.ndarray) -> State:
        q = np.ascontiguousarray(q)
        (positions,) = self.kernel("positions")(q)
        return State(positions, np.ascontiguousarray(v), q, self.coordinates, self.independent)

    def own(self, state: State) -> State:
        if getattr(state, "coordinates", None) is not self.coordinates:
            checks.refuse_foreign(state, self.coordinates, self.charts)
            gap = float(self.kernel("closure_step")(state.q)[1].max(initial=0.0))
            if gap > posing.OPEN_LOOPS:
                raise LinkworkError(
                    f"the state belongs to another robot: its loops are open by {gap:.3g} here; make one by this robot"
                )
        return state

    def require_tool(self) -> None:
        if not self.mechanism.tools:
            raise LinkworkError("the mechanism names no tool; add one under 'tools'")
