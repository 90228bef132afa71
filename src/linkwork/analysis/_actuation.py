"""Actuation through loops: between the joints of a leg, or of any serial chain, and the motors that
drive them by rods and cranks.

With the rates w of the joints, further independent rates at rest, and J = J(q),

    motor rates = J w,    motor accelerations = J w' + J' w,    joint torques = J^T motor torques
    joint torques = M w' + h(q, w)

M and h are those of the whole mechanism with its loops closed: links, rods, cranks and rotors
count. In the motors' coordinates they are  J^-T M J^-1  and  J^-T (h - M J^-1 J' w).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.equations import Equations, functions
from linkwork.equations.joint_map import derivative
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.model.charts import CompiledChart
from linkwork.model.checks import PIVOT_BOUND, SingularError, names
from linkwork.model.state import State
from linkwork.robot import Robot

Side = Literal["joints", "motors"]
APART = 1e-9
"""Motor rate by a joint that is not named, over the largest by one that is, in own units."""
SIDEWAYS = 1e-7
"""Smallest singular value of J from which it is inverted, over its largest there or where the
equations are arranged, in own units."""


class TransferredLimits(NamedTuple):
    """Hold what limits of the motors leave to each joint (..., k).

    alone: with nothing in the other joints; most: in some motion, or with some torques, of all
    """

    alone: np.ndarray
    most: np.ndarray


class TransferredGains(NamedTuple):
    """Hold stiffness and damping matrices (..., k, k) [N/m, N m/rad; N s/m, N m s/rad]."""

    kp: np.ndarray
    kd: np.ndarray


@dataclass(frozen=True, eq=False)
class ActuationModel:
    """Map coordinates, rates, torques, inertia, limits and gains between joints and motors.

    All methods take one state or a stack of states of the robot, and return arrays with the same
    leading dimensions.

    robot: with its loops; joints, motors: k names each; others: further independent rates, at rest
    chart: the equations in the rates of joints and others
    about: the state that they are arranged at
    """

    robot: Robot
    joints: tuple[str, ...]
    motors: tuple[str, ...]
    others: tuple[str, ...]
    chart: CompiledChart
    about: State

    # Coordinates

    def at(
        self,
        joints: ArrayLike | None = None,
        *,
        motors: ArrayLike | None = None,
        guess: State | None = None,
    ) -> State:
        """Return the state at coordinates (..., k) of the joints, or of the motors; what is not
        named stays as in the guess.

        Args:
            joints, motors: [m, rad], one of the two.
            guess: one state near by; `home` if left out.

        Raises:
            UnreachableError: as `Robot.assemble`.
        """
        if (joints is None) == (motors is None):
            raise LinkworkError("give the coordinates of the joints, or those of the motors")
        given, values = (self.joints, joints) if motors is None else (self.motors, motors)
        array = checks.finite(values, "the coordinates")  # pyright: ignore[reportArgumentType]
        if array.shape[-1:] != (len(given),):
            raise LinkworkError(
                f"the coordinates have the shape {array.shape}; give {', '.join(given)} in the "
                "last dimension"
            )
        still = self.robot.home if guess is None else guess
        asked = {name: array[..., k] for k, name in enumerate(given)}
        asked |= {name: float(still[name]) for name in self.others if name in still.coordinates}
        return self.robot.assemble(asked, guess=guess)

    def coordinates(self, state: State, side: Side = "motors") -> np.ndarray:
        """Return the coordinates (..., k) of the motors, or of the joints [m, rad]."""
        return np.stack([state[name] for name in self._named(side)], axis=-1)

    # Rates and torques

    def jacobian(self, state: State) -> np.ndarray:
        """Return J (..., k, k): motor rates from joint rates.

        Raises:
            SingularError: where the joints do not determine the motors.
        """
        q, k = self.robot.own(state).q, len(self.joints)
        if q.ndim == 1:
            y = self._jacobian.flat(q, self.robot.p)
            if not abs(y.item(-1)) > PIVOT_BOUND:
                raise self._singular()
            return y[:-1].reshape(k, k)
        J, pivot = self._jacobian(q, self.robot.p)
        if not np.abs(pivot).min(initial=np.inf) > PIVOT_BOUND:
            raise self._singular()
        return J.reshape(*q.shape[:-1], k, k)

    def jacobian_rate(self, state: State) -> np.ndarray:
        """Return J' (..., k, k) for the rates of the state."""
        q, k = self.robot.own(state).q, len(self.joints)
        found = self._jacobian_rate(q, self._rates(state), self.robot.p)[0]
        return found.reshape(*q.shape[:-1], k, k)

    def motor_rates(self, state: State, rates: ArrayLike) -> np.ndarray:
        """Return the rates (..., k) of the motors for rates of the joints, J w."""
        return applied(self.jacobian(state), self._given(rates, "rates", "joints"))

    def joint_rates(self, state: State, rates: ArrayLike) -> np.ndarray:
        """Return the rates (..., k) of the joints for rates of the motors, J^-1 w_m."""
        return applied(self._inverse(state), self._given(rates, "rates", "motors"))

    def joint_torques(self, state: State, torques: ArrayLike) -> np.ndarray:
        """Return the torques (..., k) that those of the motors make in the joints, J^T u."""
        J = np.swapaxes(self.jacobian(state), -1, -2)
        return applied(J, self._given(torques, "torques", "motors"))

    def motor_torques(self, state: State, torques: ArrayLike) -> np.ndarray:
        """Return the torques (..., k) of the motors that make those in the joints, J^-T u_j."""
        J = np.swapaxes(self._inverse(state), -1, -2)
        return applied(J, self._given(torques, "torques", "joints"))

    # Dynamics

    def inertia(self, state: State, side: Side = "joints") -> np.ndarray:
        """Return the apparent inertia (..., k, k) at the joints, or at the motors: that of the
        whole mechanism, the other independent rates held."""
        M = self._terms(state)[0]
        if self._named(side) is self.joints:
            return M
        inverse = self._inverse(state)
        return np.swapaxes(inverse, -1, -2) @ M @ inverse

    def bias(self, state: State, side: Side = "joints") -> np.ndarray:
        """Return h (..., k), C v + G - f: the torques at the joints, or at the motors, without
        accelerations of these."""
        M, h, rates = self._terms(state)
        if self._named(side) is self.joints:
            return h
        inverse = self._inverse(state)
        turning = applied(self.jacobian_rate(state), rates)
        return applied(np.swapaxes(inverse, -1, -2), h - applied(M @ inverse, turning))

    # Limits and gains

    def speed_limits(self, state: State, limits: ArrayLike) -> TransferredLimits:
        """Return the speeds of the joints that limits V (k) of the motors' speeds leave.

        alone_i = min_m V_m / |J_mi|,    most_i = sum_m |J^-1_im| V_m
        """
        V = self._positive(limits, "speed limits")
        return TransferredLimits(
            least(V, self.jacobian(state)), applied(np.abs(self._inverse(state)), V)
        )

    def torque_limits(self, state: State, limits: ArrayLike) -> TransferredLimits:
        """Return the torques in the joints that limits U (k) of the motors' torques leave.

        alone_i = min_m U_m / |J^-1_im|,    most_i = sum_m |J_mi| U_m
        """
        U, J = self._positive(limits, "torque limits"), self.jacobian(state)
        across = np.swapaxes(self._inverse(state), -1, -2)
        return TransferredLimits(least(U, across), applied(np.abs(np.swapaxes(J, -1, -2)), U))

    def motor_gains(
        self, state: State, kp: ArrayLike, kd: ArrayLike = 0.0, *, torques: ArrayLike | None = None
    ) -> TransferredGains:
        """Return the gains at the motors that act in the joints as a PD controller there does.

            K_m = J^-T (K_j + G) J^-1,    D_m = J^-T D_j J^-1,    G_ij = dJ^T/dq_j u |_i

        Args:
            state: about which they act alike, to first order.
            kp, kd: at the joints: one number, k numbers, or (k, k).
            torques: u (k) of the motors there; none if left out.
        """
        K, D = self._matrix(kp, "kp"), self._matrix(kd, "kd")
        inverse = self._inverse(state)
        across = np.swapaxes(inverse, -1, -2)
        held = K + self._bent(state, torques)
        return TransferredGains(across @ held @ inverse, across @ D @ inverse)

    def joint_gains(
        self, state: State, kp: ArrayLike, kd: ArrayLike = 0.0, *, torques: ArrayLike | None = None
    ) -> TransferredGains:
        """Return the gains in the joints that a PD controller at the motors has there.

            K_j = J^T K_m J - G,    D_j = J^T D_m J,    G as for `motor_gains`

        Args:
            state: about which they act alike, to first order.
            kp, kd: at the motors: one number, k numbers, or (k, k).
            torques: u (k) of the motors there; none if left out.
        """
        K, D, J = self._matrix(kp, "kp"), self._matrix(kd, "kd"), self.jacobian(state)
        across = np.swapaxes(J, -1, -2)
        return TransferredGains(across @ K @ J - self._bent(state, torques), across @ D @ J)

    # Export

    def functions(self) -> tuple[ca.Function, ...]:
        """Return the maps as CasADi functions of the tree's coordinates q and the rates v of joints
        and others, in the order of `chart.equations`.

        closure_step: q -> q after a Newton step that closes the loops at the same joints, and the
        gap before it; jacobian: q -> J, and the weakest pivot; jacobian_rate: (q, v) -> J';
        dynamics: (q, v) -> M, C v + G - f of all independent rates.
        """
        equations = self.chart.equations
        M, h = equations.inertia[0], equations.bias_forces(equations.gravity)
        return (
            functions.closure_step(equations),
            jacobian_function(equations, self.joints, self.motors),
            rate_function(equations, self.joints, self.motors),
            functions.function("dynamics", equations, {"M": M, "h": h}, v=equations.v),
        )

    def write_c(self, path: str | Path) -> Path:
        """Write the functions of `functions` as one C file without dependencies; matrices are
        column by column.

        Raises:
            LinkworkError: another suffix than .c, a folder that is not there.
        """
        target = checks.file_path(path, "the path")
        if target.suffix != ".c" or not target.parent.is_dir():
            raise LinkworkError(
                f"C is written to a file .c in a folder that is there, not to '{target}'"
            )
        code = ca.CodeGenerator(target.name, {"with_header": True})
        for function in self.functions():
            code.add(function)
        code.generate(f"{target.parent}/")
        return target

    def _named(self, side: str) -> tuple[str, ...]:
        if side not in ("joints", "motors"):
            raise LinkworkError(f"side is {checks.shown(side)}; give 'joints' or 'motors'")
        return self.joints if side == "joints" else self.motors

    @cached_property
    def _jacobian(self) -> Kernel:
        return self.chart.compiled(
            f"jacobian of {self.motors} by {self.joints}",
            lambda equations: jacobian_function(equations, self.joints, self.motors),
        )

    @cached_property
    def _jacobian_rate(self) -> Kernel:
        return self.chart.compiled(
            f"jacobian rate of {self.motors} by {self.joints}",
            lambda equations: rate_function(equations, self.joints, self.motors),
        )

    @cached_property
    def _places(self) -> list[int]:
        """Where the joints' rates are among the chart's."""
        return [self.chart.independent.index(name) for name in self.joints]

    def _rates(self, state: State) -> np.ndarray:
        """Return the rates of a state in the model's chart, those of others as they are."""
        given = self.robot.chart_of(self.robot.own(state))
        return self.chart.from_tree(given.tree_rates(state.q, state.rates))

    def _terms(self, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return M (..., k, k), h and w (..., k)."""
        v, n, at = self._rates(state), self.robot.mobility, self._places
        M, Cv, G, f, pivot = self.chart.kernel("terms")(state.q, v, self.robot.p)
        if not np.abs(pivot).min(initial=np.inf) > PIVOT_BOUND:
            raise self._singular()
        M = M.reshape(*state.batch, n, n)[..., at, :][..., at]
        return M, (Cv + G - f)[..., at], v[..., at]

    @cached_property
    def _units(self) -> tuple[np.ndarray, np.ndarray]:
        """Own units of motors' and joints' rates."""
        length = self.robot.equations.tree.length
        kinds = (
            np.array([length if self.robot.unit(name) == "m" else 1.0 for name in part])
            for part in (self.motors, self.joints)
        )
        return next(kinds), next(kinds)

    def _singular_values(self, J: np.ndarray) -> np.ndarray:
        """Return the singular values (..., k) of J in own units."""
        motors, joints = self._units
        return np.linalg.svd(J * joints / motors[:, None], compute_uv=False)

    @cached_property
    def _usual(self) -> float:
        """The largest singular value of J where the equations are arranged."""
        return float(self._singular_values(self.jacobian(self.about))[0])

    def _inverse(self, state: State) -> np.ndarray:
        """Return J^-1; refuse poses where the motors do not hold the joints."""
        J = self.jacobian(state)
        values = self._singular_values(J)
        weak = np.atleast_1d(values[..., -1] <= SIDEWAYS * np.maximum(values[..., 0], self._usual))
        if weak.any():
            which = f" of state {int(np.argmax(weak.ravel()))}" if state.batch else ""
            raise SingularError(
                f"the motors {', '.join(self.motors)} do not hold {', '.join(self.joints)} in this "
                f"pose{which}: their Jacobian is singular; take another pose"
            )
        return np.linalg.inv(J)

    def _bent(self, state: State, torques: ArrayLike | None) -> np.ndarray:
        """Return G (..., k, k), the derivative of J^T u along each joint: J' is linear in the
        rates."""
        k, n, q = len(self.joints), self.robot.mobility, self.robot.own(state).q
        if torques is None:
            return np.zeros((*state.batch, k, k))
        u, columns = self._given(torques, "torques", "motors"), []
        for place in self._places:
            dJ = self._jacobian_rate(q, np.eye(n)[place], self.robot.p)[0]
            columns.append(applied(np.swapaxes(dJ.reshape(*state.batch, k, k), -1, -2), u))
        return np.stack(columns, axis=-1)

    def _given(self, values: ArrayLike, what: str, side: Side) -> np.ndarray:
        array = checks.finite(values, what)
        if array.shape[-1:] != (len(self.joints),):
            raise LinkworkError(
                f"{what} have the shape {array.shape}; give {', '.join(self._named(side))} in the "
                "last dimension"
            )
        return array

    def _positive(self, limits: ArrayLike, what: str) -> np.ndarray:
        array = checks.finite(limits, what)
        if array.ndim == 0:
            array = np.full(len(self.motors), float(array))
        if not (self._given(array, what, "motors") > 0).all():
            raise LinkworkError(f"{what} are {checks.shown(limits)}; give positive numbers")
        return array

    def _matrix(self, gain: ArrayLike, what: str) -> np.ndarray:
        k, array = len(self.joints), checks.finite(gain, what)
        if array.shape not in ((), (k,), (k, k)):
            raise LinkworkError(
                f"{what} has the shape {array.shape}; give one number, {k}, or {k} x {k}"
            )
        return array if array.ndim == 2 else np.diag(np.broadcast_to(array, (k,)))

    def _singular(self) -> SingularError:
        return SingularError(
            f"the joints {', '.join(self.joints)} do not determine the motors "
            f"{', '.join(self.motors)} here: the loops are singular; take another pose"
        )

    def __repr__(self) -> str:
        return f"ActuationModel({', '.join(self.joints)} <- {', '.join(self.motors)})"


def actuation(
    robot: Robot,
    joints: Sequence[str],
    motors: Sequence[str] | None = None,
    *,
    guess: State | None = None,
) -> ActuationModel:
    """Relate joints, such as those of a leg, to the motors that move them through loops.

    Args:
        robot: the mechanism with its loops.
        joints: k coordinates of joints of the spanning tree, in the order that is wanted.
        motors: k coordinates of driven joints, any; the robot's actuators if left out.
        guess: a state about which the equations are arranged; `home` if left out.

    Returns:
        An `ActuationModel`: maps of coordinates, rates and torques both ways, J and J', apparent
            inertia and bias, limits and gains, C.

    Raises:
        LinkworkError: another number of motors than of joints; joints that do not move
            independently; motors that move with other joints, too.
    """
    if not isinstance(robot, Robot):
        raise LinkworkError(f"the robot is {checks.shown(robot)}; give a linkwork.Robot")
    wanted = names(joints, "joints")
    driven = robot.actuators if motors is None else names(motors, "motors")
    checks.known((*wanted, *driven), robot.rates, "joint rate")
    if len(wanted) != len(driven) or not wanted or len({*wanted}) < len(wanted):
        raise LinkworkError(
            f"{len(wanted)} joints and {len(driven)} motors are given; give as many of one as of "
            "the other, each once"
        )
    about = robot.home if guess is None else robot.own(guess)
    if about.batch:
        raise LinkworkError("the guess is a stack of states; give one of them")
    chart = arranged(robot, wanted, driven, about.q)
    others = tuple(name for name in chart.independent if name not in wanted)
    model = ActuationModel(robot, wanted, driven, others, chart, about)
    require_apart(model, about.q)
    return model


def arranged(
    robot: Robot, joints: tuple[str, ...], motors: tuple[str, ...], q: np.ndarray
) -> CompiledChart:
    """Return the equations in the rates of the joints and of others that are no motors."""
    tree = robot.equations.tree.rates
    for name in joints:
        if name not in tree:
            raise LinkworkError(
                f"the joint {name!r} closes a loop; name joints of the spanning tree: "
                f"{', '.join(tree)}"
            )
    others = [name for name in (*robot.independent, *tree) if name not in (*joints, *motors)]
    preferred = [*joints, *dict.fromkeys(others)]
    chart = robot.chart.better(q, tuple(map(tree.index, preferred)))
    tied = [name for name in joints if name not in chart.independent]
    if tied:
        raise LinkworkError(
            f"the joint {tied[0]!r} does not move independently of {', '.join(joints)}; leave it "
            "out"
        )
    return chart


def require_apart(model: ActuationModel, q: np.ndarray) -> None:
    """Refuse motors that move with independent joints that are not named."""
    if not model.others:
        return
    equations = model.chart.equations
    rows = ca.mtimes(equations.joints.rate_rows(model.motors), equations.elimination.L)
    given = functions.function("motor_rows", equations, {"rows": rows})(q, model.robot.p)
    found = np.abs(np.array(given)) * model.chart.units[equations.nq :]
    named = [equations.independent.index(name) for name in model.joints]
    for k, name in enumerate(equations.independent):
        part = found[:, k]
        if name in model.others and part.max() > APART * found[:, named].max():
            motor = model.motors[int(np.argmax(part))]
            raise LinkworkError(
                f"the motor {motor!r} moves with {name!r}, too; name it among the joints, with one "
                "more motor"
            )


def jacobian_of(equations: Equations, joints: tuple[str, ...], motors: tuple[str, ...]) -> ca.SX:
    """Return J as an expression."""
    rows = ca.mtimes(equations.joints.rate_rows(motors), equations.elimination.L)
    return rows[:, [equations.independent.index(name) for name in joints]]


def jacobian_function(
    equations: Equations, joints: tuple[str, ...], motors: tuple[str, ...]
) -> ca.Function:
    """Return q -> J row by row and the weakest relative pivot."""
    J = jacobian_of(equations, joints, motors)
    outputs = {"J": J.T, "pivot": equations.elimination.pivot}
    return functions.function("jacobian", equations, outputs)


def rate_function(
    equations: Equations, joints: tuple[str, ...], motors: tuple[str, ...]
) -> ca.Function:
    """Return (q, v) -> J' row by row."""
    J = jacobian_of(equations, joints, motors)
    rate = derivative(J, equations.tree, equations.rates)
    return functions.function("jacobian_rate", equations, {"dJ": rate.T}, v=equations.v)


def applied(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return matrices (..., k, k) times vectors (..., k)."""
    return (matrix @ vector[..., None])[..., 0]


def least(limits: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return min_m limits_m / |matrix_mi| (..., i)."""
    with np.errstate(divide="ignore"):
        return (limits[:, None] / np.abs(matrix)).min(axis=-2)
