"""Measures: what a design is judged by, the worst value over poses or along a path.

    Isotropy     n / (|K|_F |K^-1|_F)           of q' = K x': 1 alike in all directions, 0 singular
    PeakForce    max |u|                        of the actuators along a timed path
    Frequency    min omega / 2 pi               of K phi = omega^2 M phi about poses that are held

Each is written at every pose with the configuration q as an unknown of its own, whose equations are
closed loops and the tool at its pose. `margins` are not negative where the measure is no worse than
a level t. No frequency is lower where  K - (2 pi t)^2 M = F F'  with a triangle F of unknowns with
no negative diagonal: an equation that is smooth where several frequencies are lowest together.

Source: Gosselin & Angeles, J. Mech. Design 113 (1991) 220-226, with Frobenius' norm, which is
smooth where singular values meet; Burer, Monteiro & Zhang, Mathematical Programming 93 (2002)
97-122 (F of semidefinite programmes).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import pi
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.analysis import dexterity
from linkwork.analysis._jacobians import jacobians
from linkwork.analysis.linearisation import (
    refuse_circulation,
    stiffness_matrix,
    without_rounding,
)
from linkwork.checks import amount
from linkwork.design.judged_poses import JudgedPoses, PoseEquations
from linkwork.equations.linear import derivatives
from linkwork.errors import LinkworkError
from linkwork.export import CasadiFunctions
from linkwork.export.implicit import require_leading
from linkwork.model.linear import largest, own_rates
from linkwork.model.state import Motion
from linkwork.paths import Path
from linkwork.robot import Robot, State

FEWEST, FINER = 3, 10  # samples of a path; parts of each step at which it is looked at again
WITHIN = 0.01  # square of a frequency over the lowest one, by which the search begins within bounds


@dataclass(frozen=True, eq=False)
class Measure(ABC):
    """Judge a design by its worst value over poses or along a path."""

    larger_is_better: ClassVar[bool] = True

    @abstractmethod
    def value(self, robot: Robot) -> float:
        """Return the worst value of a robot, computed by the robot itself.

        Raises:
            UnreachableError: a pose that it does not reach on the branch of its home.
        """

    @abstractmethod
    def states(self, robot: Robot) -> State:
        """Return the configurations that count (K).

        robot: which is judged.
        """

    @abstractmethod
    def points(self, robot: Robot, functions: CasadiFunctions) -> JudgedPoses:
        """Return the measure as equations and margins.

        robot: which is judged; functions: its equations of motion, with what may change free.
        """

    def unit(self, robot: Robot) -> str:
        """Return the unit of the value, empty where it has none.

        robot: which is judged.
        """
        return ""

    def finer(self) -> Measure:
        """Return the measure that looks between its own points as well, where these are samples."""
        return self

    @property
    def better(self) -> float:
        """1 where larger is better, else -1."""
        return 1.0 if self.larger_is_better else -1.0


@dataclass(frozen=True, eq=False)
class Isotropy(Measure):
    """Measure how alike the tool moves in all directions: n / (|K|_F |K^-1|_F), between lengths
    over time, at its worst of some poses; 1 where 1 / cond K is, and as a rule above it.

    Args:
        poses: of the tool (K, k), as `Robot.assemble` takes them.
    """

    poses: ArrayLike

    def states(self, robot: Robot) -> State:
        return at_poses(robot, self.poses)

    def value(self, robot: Robot) -> float:
        values = dexterity(robot, self.states(robot)).singular_values
        with np.errstate(divide="ignore"):
            spread = np.linalg.norm(values, axis=-1) * np.linalg.norm(1 / values, axis=-1)
        return float((values.shape[-1] / spread).min())

    def points(self, robot: Robot, functions: CasadiFunctions) -> JudgedPoses:
        made, equations = jacobians(robot), robot.equations
        x_scale, q_scale = (ca.DM(part) for part in made.lengths())
        of = PoseEquations.of(robot)
        q, p, t = of.q, of.p, of.t
        led = ca.mtimes(made.inverse.J, equations.elimination.L)
        J = ca.Function("led", [equations.tree.q, equations.p], [led])(q, p)
        J, S = ca.diag(x_scale) @ J, ca.diag(q_scale) @ functions["actuation"](q, p)[0]
        K, inverse = S @ ca.inv(J), J @ ca.inv(S)
        worth = robot.mobility / ca.sqrt(ca.sumsqr(K) * ca.sumsqr(inverse))
        return of.judged(self.states(robot), worth - t)


@dataclass(frozen=True, eq=False)
class PeakForce(Measure):
    """Measure the largest force or torque of any actuator along a timed path.

    Args:
        path: of the tool; duration: T [s]; samples: equally spaced times at which forces count.
    """

    larger_is_better = False
    path: Path
    duration: float
    samples: int = 41

    def __post_init__(self) -> None:
        checks.needed(self.path, Path, "linkwork.paths")
        checks.positive(self.duration, "the duration", "s")
        if checks.count(self.samples, "the number of samples") < FEWEST:
            raise LinkworkError(f"the samples are {self.samples}; give {FEWEST} or more")

    def unit(self, robot: Robot) -> str:
        return "N" if robot.unit(robot.actuators[0]) == "m" else "N m"

    def finer(self) -> PeakForce:
        return replace(self, samples=FINER * (self.samples - 1) + 1)

    def motion(self, robot: Robot) -> Motion:
        """Return the motion along the path.

        robot: which is led.
        """
        checks.needed(robot, Robot)
        if len({robot.unit(name) for name in robot.actuators}) > 1:
            raise LinkworkError(
                "some actuators turn and others slide, whose largest force is not one number; "
                "measure a robot whose actuators are alike"
            )
        return robot.follow(self.path, self.duration, samples=self.samples)

    def states(self, robot: Robot) -> State:
        return self.motion(robot).state

    def value(self, robot: Robot) -> float:
        motion = self.motion(robot)
        return float(np.abs(robot.inverse_dynamics(motion).values).max())

    def points(self, robot: Robot, functions: CasadiFunctions) -> JudgedPoses:
        of = PoseEquations.of(robot)
        q, p, t = of.q, of.p, of.t
        # Rates and accelerations are unknowns, too, held by those of the tool.
        n, motion = robot.mobility, self.motion(robot)
        v, dv = ca.SX.sym("v", n), ca.SX.sym("dv", n)
        x_rate, x_bend = ca.SX.sym("x_rate", n), ca.SX.sym("x_bend", n)
        J = functions["jacobian"](q, p)[0]
        turned = functions["jacobian_rate"](q, v, p)[0]
        u = functions["inverse_dynamics"](q, v, dv, p)[0]
        # The tool's rates and accelerations along the path, which no design changes, and the forces
        # of the robot as it is.
        count, units = len(motion.time), own_rates(robot, robot.home)
        start = motion.state.q.T, motion.rates.T, motion.accelerations.T
        read = ca.Function("rates", [q, v, dv, p], [J @ v, J @ dv + turned @ v, u])
        *known, pushed = (
            np.array(part) for part in read.map(count)(*start, np.tile(robot.p[:, None], count))
        )
        # In the mechanism's own units over the duration, and over the largest of these forces.
        T, size = self.duration, largest(pushed) or 1.0
        speeds = (J @ v - x_rate) * T, (J @ dv + turned @ v - x_bend) * T**2
        return of.judged(
            motion.state,
            ca.vertcat(t - u, t + u) / size,
            ca.vertcat(*[each / ca.DM(of.units) for each in speeds]),
            unknown=[(v, start[1], units / T), (dv, start[2], units / T**2)],
            known=[(x_rate, known[0]), (x_bend, known[1])],
        )


@dataclass(frozen=True, eq=False)
class Frequency(Measure):
    """Measure the lowest natural frequency [Hz] about poses that the actuators hold: springs,
    weight, and the stiffness of drives.

    Args:
        poses: of the tool (K, k), as `Robot.assemble` takes them.
        stiffness: of joints by name [N/m, N m/rad], beside the springs of the description: that of
            drives or of their controllers.
    """

    poses: ArrayLike
    stiffness: Mapping[str, float] = field(default_factory=dict)

    def unit(self, robot: Robot) -> str:
        return "Hz"

    def states(self, robot: Robot) -> State:
        return at_poses(robot, self.poses)

    def value(self, robot: Robot) -> float:
        from scipy.linalg import eigh

        states, lowest = self.states(robot), []
        rows, values = self._drives(robot)
        for k in range(len(states.q)):
            state = states.at(k)
            L = robot.rate_map(state)[rows]
            M, K = (
                robot.mass_matrix(state),
                stiffness_matrix(robot, state, robot.holding_forces(state)),
            )
            squares = eigh((K + K.T) / 2 + L.T @ (values[:, None] * L), M, eigvals_only=True)
            refuse_circulation(robot, state, M, K, largest(squares))
            lowest.append(without_rounding(robot, squares)[0])
        square = float(min(lowest))
        return float(np.sign(square) * np.sqrt(abs(square)) / (2 * pi))

    def points(self, robot: Robot, functions: CasadiFunctions) -> JudgedPoses:
        of = PoseEquations.of(robot)
        q, p, t = of.q, of.p, of.t
        still = ca.SX.zeros(robot.mobility)
        rows, values = self._drives(robot)
        u = functions["inverse_dynamics"](q, still, still, p)[0]
        whole = derivatives(robot.equations)
        K = whole(q, still, u, p)[whole.index_out("K")]
        L = functions["rate_map"](q, p)[0][rows, :]
        M = functions["mass_matrix"](q, p)[0]
        K = (K + K.T) / 2 + L.T @ ca.diag(ca.DM(values)) @ L
        # What is positive, in units in which M is near one, along axes of its own as the robot is:
        # the stiffest first, so that what vanishes stands last in the triangle.
        level, n = self._held(robot), robot.mobility
        units = ca.DM(2 * pi * level * np.sqrt(np.diag(robot.mass_matrix(robot.home))))
        A = ca.densify(ca.diag(1 / units) @ (K - (2 * pi * t) ** 2 * M) @ ca.diag(1 / units))
        states, own = self.states(robot), ca.Function("own", [q, p, t], [A])
        now = np.array([own(each, robot.p, level).full() for each in states.q])
        values, vectors = (part[..., ::-1] for part in np.linalg.eigh(now))
        V, F = ca.SX.sym("V", n, n), ca.SX.sym("F", ca.Sparsity.lower(n))
        begun = np.sqrt(np.maximum(values, WITHIN))[..., None] * np.eye(n)
        sides, first = in_column(F), np.hstack([in_column(ca.DM(each)).full() for each in begun])
        return of.judged(
            states,
            ca.diag(F),
            in_column(V.T @ A @ V - F @ F.T),
            unknown=[(sides, first, np.ones(len(first)))],
            known=[(ca.vec(V), vectors.swapaxes(1, 2).reshape(len(now), -1).T)],
        )

    def _held(self, robot: Robot) -> float:
        """Return the value of a robot that is held; refuse one that is loose or falls."""
        value = self.value(robot)
        if not value > 0:
            raise LinkworkError(
                f"the lowest natural frequency is {value:.3g} Hz: nothing holds the robot at some "
                "pose; give the stiffness of its drives"
            )
        return value

    def _drives(self, robot: Robot) -> tuple[list[int], np.ndarray]:
        """Return the rows of the joints that are stiff, and their stiffness."""
        if not isinstance(self.stiffness, Mapping):
            raise LinkworkError(
                f"the stiffness is {checks.shown(self.stiffness)}; give it by joint, such as "
                f"{{{robot.rates[0]!r}: 1e4}}"
            )
        checks.known(self.stiffness, robot.rates, "rate")
        values = [checks.positive(v, f"the stiffness of {k!r}") for k, v in self.stiffness.items()]
        return [robot.rates.index(name) for name in self.stiffness], np.array(values)


def at_poses(robot: Robot, poses: ArrayLike) -> State:
    """Return the configurations at poses of the tool (K, k)."""
    checks.needed(robot, Robot)
    values = np.atleast_2d(checks.finite(poses, "the poses"))
    if not values.size:
        raise LinkworkError("the poses are none; give those of the tool that count")
    return robot.assemble(tool=values.reshape(-1, values.shape[-1]))


def in_column(A: Any) -> Any:
    """Return the lower triangle of a matrix, column by column, as a column."""
    return ca.project(ca.densify(A), ca.Sparsity.lower(A.shape[0])).nz[:]


def require_measurable(robot: Robot) -> None:
    """Refuse robots whose poses do not determine the configuration, or whose actuators are more or
    fewer than their freedoms."""
    robot.require_tool()
    require_leading(robot, robot.equations)
    if len(robot.actuators) != robot.mobility:
        raise LinkworkError(
            f"the robot has {amount(len(robot.actuators), 'actuator')} and the mobility "
            f"{robot.mobility}; a design is chosen for as many actuators as freedoms"
        )
