"""Robot: the one object a user holds. It joins description, derivation, compilation and simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from math import isfinite
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations, derive, functions, measures
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function
from linkwork.mechanism import Mechanism
from linkwork.paths import Path
from linkwork.robot import checks
from linkwork.robot.assembly import Assembler
from linkwork.robot.state import Motion, State

if TYPE_CHECKING:
    from linkwork.simulation import Run, Sampled, Signal

OPEN_LOOPS = 1e-6
CLOSED = 1e-12
MATRICES = ("Phi", "J_coordinates", "J_tool")


class Robot:
    """Derive, compile and evaluate the exact equations of motion of a mechanism in the rates of its actuated joints.

        M(q) v' + C(q, v) v + G(q) = u,    q' = L(q) v                         (paper, Eqs. (7), (9)-(12))

    Everything is in SI units and radians. Independent coordinates, and so the order of M, accelerations and forces,
    are the actuated joints in the order of `actuators`; joint coordinates are in the order of `joints`. Methods take
    one state or a stack of states with leading dimensions, and return arrays with the same leading dimensions. Kernels
    are compiled when they are first needed and kept in the user's cache folder.

    Args:
        mechanism: the description, from `linkwork.robots`, a file (`Robot.from_file`) or code.

    Raises:
        MechanismError: a description that cannot be assembled or actuated, in one sentence.
    """

    def __init__(self, mechanism: Mechanism):
        self.mechanism = mechanism
        self.equations: Equations = derive(mechanism)
        self.joints: tuple[str, ...] = measures.joint_names(mechanism)
        self.actuators: tuple[str, ...] = mechanism.actuators
        self.bodies: tuple[str, ...] = tuple(mechanism.bodies)
        self.redundant: tuple[str, ...] = self.equations.redundant
        self.mobility: int = self.equations.mobility
        self.planar: bool = measures.is_planar(self.equations.tree)

    @classmethod
    def from_file(cls, path: str | FilePath) -> Robot:
        """Read a mechanism file (YAML) and derive its equations."""
        return cls(Mechanism.load(path))

    def __repr__(self) -> str:
        return f"Robot({self.mechanism.name!r}, mobility {self.mobility}, {len(self.bodies)} bodies, {len(self.joints)} joints)"

    # States

    @cached_property
    def home(self) -> State:
        """Return the closed reference configuration, at rest."""
        return self._state(self.equations.reference, np.zeros(self.mobility))

    def state(
        self,
        positions: ArrayLike | Mapping[str, ArrayLike],
        rates: ArrayLike | Mapping[str, ArrayLike] | None = None,
        *,
        tolerance: float = OPEN_LOOPS,
    ) -> State:
        """Make a state from the coordinates of all joints.

        Args:
            positions: q of all joints (..., m) [m, rad] in the order of `joints`, or by name.
            rates: v of the actuated joints (..., n) [m/s, rad/s] in the order of `actuators`, or by name; zero if left
            out.
            tolerance: largest gap [m, rad] of a loop; what is open by less is closed exactly by moving the dependent
            joints.

        Raises:
            LinkworkError: wrong shapes or names, numbers that are not finite, loops that are open.
        """
        q_all = checks.values_by_name(positions, self.joints, "positions")
        v = np.zeros(self.mobility) if rates is None else checks.values_by_name(rates, self.actuators, "rates")
        batch = np.broadcast_shapes(q_all.shape[:-1], v.shape[:-1])
        q_all = np.broadcast_to(q_all, (*batch, q_all.shape[-1]))
        q = q_all[..., self._tree_in_joints]
        next_q, gap = self.kernel("closure_step")(q)
        checks.require_closed(gap[..., 0], tolerance, lambda index: self._open_row(q[index]))
        for _ in range(3):
            if not gap.max(initial=0.0) > CLOSED or not np.isfinite(next_q).all():
                break
            q, (next_q, gap) = next_q, self.kernel("closure_step")(next_q)
        checks.require_closed(gap[..., 0], OPEN_LOOPS, lambda index: self._open_row(q[index]))
        state = self._state(q, np.broadcast_to(v, (*batch, self.mobility)))
        checks.require_consistent(state.positions, q_all, self.joints, self._angular, tolerance)
        return state

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
            joints: coordinates of some joints by name [m, rad].
            tool: pose of the tool (..., 2 or 3) in the plane: x, y[, angle]; (..., 3 or 6) in space: x, y, z[, rotation
                vector] [m, rad]. Leading dimensions give a stack of states, each from the same guess.
            rates: v of the actuated joints (n); zero if left out.
            guess: a state on the wanted branch (working mode, assembly mode); `home` if left out.

        Raises:
            UnreachableError: what is asked is out of reach, or not reachable from this guess.
        """
        start = (self.home if guess is None else self._own(guess)).coordinates
        if start.ndim != 1:
            raise LinkworkError("the guess is a stack of states; give one of them")
        if joints is not None and tool is None:
            targets = {name: float(checks.finite(value, f"joint {name!r}")) for name, value in joints.items()}
            checks.known(targets, self.joints, "joint")
            q = self._assembler.at_joints(targets, start)
        elif tool is not None and joints is None:
            self._require_tool()
            poses = np.atleast_1d(checks.finite(tool, "tool"))
            flat = [self._assembler.at_pose(pose, start) for pose in poses.reshape(-1, poses.shape[-1])]
            q = np.array(flat).reshape(*poses.shape[:-1], -1)
        else:
            raise LinkworkError("say where to assemble: joint coordinates by name, or tool=pose")
        v = np.zeros(self.mobility) if rates is None else checks.values_by_name(rates, self.actuators, "rates")
        return self._state(q, np.broadcast_to(v, (*q.shape[:-1], self.mobility)))

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
        checks.positive(duration, "the duration")
        if samples < 2:
            raise LinkworkError(f"a motion needs at least 2 samples, not {samples}")
        time = np.linspace(0, duration, samples)
        self._require_tool()
        poses, velocities, accelerations = (checks.finite(part, "the path") for part in path.sample(time, duration))
        self._require_full_pose(poses.shape[1])
        q = (self.home if guess is None else self._own(guess)).coordinates
        dq = np.zeros_like(q)
        tree = np.empty((3, samples, q.size))
        for k in range(samples):
            with checks.at(f"at t = {time[k]:.6g} s: "):
                q = self._assembler.at_pose(poses[k], q + dq * (duration / (samples - 1)))
                dq, ddq = self._assembler.rates(q, poses[k], velocities[k], accelerations[k])
            tree[:, k] = q, dq, ddq
        independent = list(self.equations.chart.independent)
        state = self._state(tree[0], tree[1][:, independent])
        v_dot = tree[2][:, independent]
        positions, joint_rates, joint_accelerations = self.kernel("joints_motion")(
            state.coordinates, state.rates, v_dot
        )
        state = replace(state, positions=self.unwrapped(positions))
        return Motion(time, state, v_dot, joint_rates, joint_accelerations, poses)

    # Equations of motion

    def forward_dynamics(self, state: State, forces: ArrayLike) -> np.ndarray:
        """Return the accelerations of the actuated joints, v' = M^-1 (u - C v - G) (paper, Eq. (9)).

        Args:
            state: configuration and rates.
            forces: u of the actuators (..., n) [N, N m], in the order of `actuators`.

        Returns:
            v' (..., n) [m/s^2, rad/s^2].

        Raises:
            LinkworkError: wrong shape, numbers that are not finite, an actuator-singular configuration.
        """
        return self._dynamics("motion", state, forces, "forces")

    def inverse_dynamics(self, motion: State | Motion, accelerations: ArrayLike | None = None) -> np.ndarray | Sampled:
        """Return the actuator forces that a state and accelerations, or a whole motion, need: u = M v' + C v + G.

        Args:
            motion: a state, or a `Motion` (whose own accelerations are then taken).
            accelerations: v' of the actuated joints (..., n) [m/s^2, rad/s^2], with a state.

        Returns:
            u (..., n) [N, N m]; for a motion a `Sampled` signal over its times, to simulate with.
        """
        if isinstance(motion, Motion):
            from linkwork.simulation import Sampled

            return Sampled(
                motion.time, self._dynamics("inverse_dynamics", motion.state, motion.accelerations, "accelerations")
            )
        if accelerations is None:
            raise LinkworkError("give the accelerations of the actuated joints with a state")
        return self._dynamics("inverse_dynamics", motion, accelerations, "accelerations")

    def _dynamics(self, name: str, state: State, given: ArrayLike, what: str) -> np.ndarray:
        """Evaluate a kernel (q, v, given) -> (..., n results, pivot); one state takes the shortest way."""
        values, kernel, q = self._vector(given, what, self.actuators), self.kernel(name), self._own(state).coordinates
        if values.ndim == 1 and q.ndim == 1:
            y = np.empty(kernel.n_out)
            kernel.evaluate_into(np.concatenate((q, state.rates, values)), y)
            numbers = y.tolist()
            if numbers[-1] > checks.PIVOT_BOUND and isfinite(sum(numbers)):
                return y[-1 - self.mobility : -1]
            result, pivot = y[-1 - self.mobility : -1], y[-1:]
        else:
            *_, result, pivot = kernel(q, state.rates, values)
        self._require_regular(state, pivot, result, values, what)
        return result

    def mass_matrix(self, state: State) -> np.ndarray:
        """Return the generalised inertia M (..., n, n) in the actuated coordinates (paper, Eq. (10))."""
        return self._terms(state)[0]

    def coriolis(self, state: State) -> np.ndarray:
        """Return the Coriolis and centrifugal forces C v (..., n) [N, N m] (paper, Eq. (11))."""
        return self._terms(state)[1]

    def gravity(self, state: State) -> np.ndarray:
        """Return the forces G (..., n) [N, N m] that hold the weight (paper, Eq. (12))."""
        return self._terms(state)[2]

    def _terms(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        M, Cv, G, pivot = self.kernel("terms")(self._own(state).coordinates, state.rates)
        self._require_regular(state, pivot, Cv, state.rates, "rates")
        return M.reshape(*state.batch, self.mobility, self.mobility), Cv, G

    def rate_map(self, state: State) -> np.ndarray:
        """Return L (..., m, n): rates of all joints from those of the actuated ones, q' = L v (paper, Eq. (7))."""
        return self._maps(state)[0]

    def twist_map(self, state: State) -> np.ndarray:
        """Return T (..., 6r, n): twists [omega; v of the mass centre] of all bodies, in the ground's axes (paper, Eq. (6))."""
        return self._maps(state)[1]

    def _maps(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        L, T, pivot = self.kernel("maps")(self._own(state).coordinates)
        self._require_regular(state, pivot, L, state.rates, "rates")
        n = self.mobility
        return tuple(np.swapaxes(X.reshape(*state.batch, n, -1), -1, -2) for X in (L, T))  # pyright: ignore

    def energy(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the kinetic energy v' M v / 2 and the potential energy -sum m g . c of the weight (...) [J]."""
        kinetic, potential = self.kernel("energy")(self._own(state).coordinates, state.rates)
        return kinetic[..., 0], potential[..., 0]

    # Kinematics

    def joint_rates(self, state: State) -> np.ndarray:
        """Return the rates of all joints (..., m) [m/s, rad/s]."""
        return self.kernel("joints_motion")(self._own(state).coordinates, state.rates, 0 * state.rates)[1]

    def joint_accelerations(self, state: State, accelerations: ArrayLike) -> np.ndarray:
        """Return the accelerations of all joints (..., m) for those of the actuated ones, q'' = L v' + L' v."""
        v_dot = self._vector(accelerations, "accelerations", self.actuators)
        return self.kernel("joints_motion")(self._own(state).coordinates, state.rates, v_dot)[2]

    def body_poses(self, state: State) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return the origin p_0B (..., 3) [m] and the matrix R_0B (..., 3, 3) of each body's frame, by name."""
        origins, orientations, _ = self.kernel("bodies_motion")(self._own(state).coordinates, state.rates)
        p = origins.reshape(*state.batch, len(self.bodies), 3)
        R = orientations.reshape(*state.batch, len(self.bodies), 3, 3)
        return {name: (p[..., i, :], R[..., i, :, :]) for i, name in enumerate(self.bodies)}

    def twists(self, state: State) -> np.ndarray:
        """Return the twists t_i = [omega; v of the mass centre] of the bodies (..., r, 6), in the ground's axes."""
        twists = self.kernel("bodies_motion")(self._own(state).coordinates, state.rates)[2]
        return twists.reshape(*state.batch, len(self.bodies), 6)

    def tool_pose(self, state: State) -> np.ndarray:
        """Return the tool's pose: x, y, angle (..., 3) in the plane; x, y, z, rotation vector (..., 6) in space [m, rad]."""
        return self.tool_poses(self._own(state).coordinates)

    def unit(self, joint: str) -> str:
        """Return the unit of a joint's coordinate: m or rad."""
        return "rad" if self.mechanism.joints[joint].type == "revolute" else "m"

    def unwrapped(self, positions: np.ndarray) -> np.ndarray:
        """Return coordinates of all joints over time (K, m) without the jumps of 2 pi that cut joints' angles may have."""
        cut = [name in self.equations.topology.cuts for name in self.joints]
        return np.where(self._angular & cut, np.unwrap(positions, axis=0), positions)

    def closure_error(self, state: State) -> np.ndarray:
        """Return the largest loop residual max |phi| (...) [m, rad], redundant rows included."""
        return self.kernel("closure_step")(self._own(state).coordinates)[1][..., 0]

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
    ) -> Run:
        """Integrate the equations of motion from a state under actuator forces (paper, algorithm of forward dynamics).

        Adaptive Dormand-Prince 5(4); after each step the loops are closed exactly by projection on phi = 0.

        Args:
            state: where to start.
            forces: u (n) [N, N m] constant, by name, or sampled over time (`linkwork.Sampled`); zero if left out.
            duration: T [s].
            rtol, atol: relative and absolute tolerance of the local error of coordinates and rates.
            save_at: times to save [s]; every accepted step if left out.
            max_step: largest step [s].
            max_steps: most steps to take.

        Returns:
            A `Run`: its `status` and `message` say how it ended; `dataset` holds what was computed until then.
        """
        from linkwork.robot.recording import simulate

        return simulate(self, self._own(state), forces, duration, rtol, atol, save_at, max_step, max_steps)

    # Kernels

    @cached_property
    def kernel(self) -> Callable[[str], Kernel]:
        """Return a compiled kernel by name: motion, inverse_dynamics, terms, maps, closure_step, joints_motion ..."""
        return lru_cache(maxsize=None)(lambda name: compile_function(getattr(functions, name)(self.equations)))

    @cached_property
    def _assembly_function(self):
        tool = next(iter(self.mechanism.tools.values()), None)
        return functions.assembly(self.equations, tool)

    @cached_property
    def _assembly_kernel(self) -> Kernel:
        return compile_function(self._assembly_function)

    @cached_property
    def _assembler(self) -> Assembler:
        shapes = {name: self._assembly_function.size_out(name) for name in self._assembly_function.name_out()}

        def evaluate(q: np.ndarray, rates: np.ndarray) -> dict[str, np.ndarray]:
            values = self._assembly_kernel(q, rates)
            named = zip(shapes.items(), values, strict=True)
            return {
                name: value.reshape(rows, columns, order="F") if name in MATRICES else value
                for (name, (rows, columns)), value in named
            }

        return Assembler(evaluate, self.joints, self._angular, self.equations.rows.names, self.planar)

    def tool_poses(self, q: np.ndarray) -> np.ndarray:
        """Return the tool's pose as `tool_pose` does, for the tree's coordinates (..., nq)."""
        self._require_tool()
        out = dict(zip(self._assembly_function.name_out(), self._assembly_kernel(q, 0 * q), strict=True))
        if self.planar:
            return np.concatenate([out["position"][..., :2], out["angle"]], axis=-1)
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_matrix(out["orientation"].reshape(-1, 3, 3)).as_rotvec()
        return np.concatenate([out["position"], turns.reshape(out["position"].shape)], axis=-1)

    # Checks

    def _state(self, q: np.ndarray, v: np.ndarray) -> State:
        q = np.ascontiguousarray(q)
        positions = self.kernel("joints_motion")(q, v, 0 * v)[0]
        return State(positions, np.ascontiguousarray(v), q, self.joints, self.actuators)

    def _own(self, state: State) -> State:
        if getattr(state, "joints", None) is not self.joints:
            checks.refuse_foreign(state, self.joints, self.actuators)
            gap = float(self.kernel("closure_step")(state.coordinates)[1].max(initial=0.0))
            if gap > OPEN_LOOPS:
                raise LinkworkError(
                    f"the state belongs to another robot: its loops are open by {gap:.3g} here; make one by this robot"
                )
        return state

    def _vector(self, values: ArrayLike, what: str, names: Sequence[str]) -> np.ndarray:
        array = np.asarray(values, float)
        if array.ndim == 0 or array.shape[-1] != len(names):
            checks.refuse_shape(array, what, names)
        return array

    def _require_regular(
        self, state: State, pivot: np.ndarray, result: np.ndarray, given: np.ndarray, what: str
    ) -> None:
        if pivot.min(initial=np.inf) > checks.PIVOT_BOUND and np.isfinite(result).all():
            return
        checks.finite(given, what)
        checks.finite(state.rates, "the state's rates")
        if pivot.min(initial=np.inf) > checks.PIVOT_BOUND:
            raise LinkworkError(
                "the generalised inertia is singular: some motion moves no mass; give the moving bodies mass or inertia"
            )
        raise checks.singular(self, pivot)

    def _require_tool(self) -> None:
        if not self.mechanism.tools:
            raise LinkworkError("the mechanism names no tool; add one under 'tools'")

    def _require_full_pose(self, size: int) -> None:
        self._assembler.pose_names(size)
        if size != self.mobility:
            raise LinkworkError(
                f"the path prescribes {size} coordinates of the tool, but the mobility is {self.mobility}; "
                f"prescribe {self.mobility}"
            )

    @cached_property
    def size(self) -> float:
        """Return the largest length in the description [m], at least 1: rounding in the closure rows grows with it."""
        frames = [frame for joint in self.mechanism.joints.values() for frame in joint.frames]
        return max(1.0, *(abs(x) for frame in frames for x in frame.position), *np.abs(self.home.coordinates).tolist())

    @cached_property
    def _tree_in_joints(self) -> np.ndarray:
        return np.array([self.joints.index(name) for name in self.equations.tree.coordinates], int)

    @cached_property
    def _angular(self) -> np.ndarray:
        return np.array([self.unit(name) == "rad" for name in self.joints])

    def _open_row(self, q: np.ndarray) -> str:
        out = self._assembler.evaluate(q, 0 * q)
        return self.equations.rows.names[int(np.argmax(np.abs(out["phi"])))]
