"""Actuation through loops: between the joints of a leg, or of any serial chain, and the motors that
drive them by rods and cranks.

With the rates w of the joints, further independent rates at rest, and J = J(q),

    motor rates = J w,    motor accelerations = J w' + J' w,    joint torques = J^T motor torques
    joint torques = M w' + h(q, w)

M and h are those of the whole mechanism with its loops closed: links, rods, cranks and rotors
count. In the motors' coordinates they are  J^-T M J^-1  and  J^-T (h - M J^-1 J' w).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.analysis import loop_map as maps
from linkwork.analysis.loop_map import LoopMap
from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.model.charts import CompiledChart
from linkwork.model.checks import PIVOT_BOUND, SingularError, names
from linkwork.model.state import State
from linkwork.robot import Robot

Side = Literal["joints", "motors"]
APART = 1e-9
"""Motor rate by a joint that is not named, over the largest by one that is, in own units."""
TIED = 1e-4
"""Part of a rate's row that the rates before leave, from which on it is independent of them."""
SIDEWAYS = 1e-7
"""Least determinant of a block of J from which it is inverted, over that where the equations are
arranged."""


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
        held = {name: float(still[name]) for name in self.others if name in still.coordinates}
        if len(held) == len(self.others):
            asked = {name: array[..., k] for k, name in enumerate(given)}
            return self.robot.assemble(asked | held, guess=guess)
        # A free turn is held by none of its coordinates: one after the other.
        made = [
            self.robot.assemble(dict(zip(given, row, strict=True)) | held, guess=guess)
            for row in array.reshape(-1, len(given)).tolist()
        ]
        if array.ndim == 1:
            return made[0]
        return self.robot.state(
            np.array([state.positions for state in made]).reshape(*array.shape[:-1], -1)
        )

    def coordinates(self, state: State, side: Side = "motors") -> np.ndarray:
        """Return the coordinates (..., k) of the motors, or of the joints [m, rad]."""
        return np.stack([state[name] for name in self._named(side)], axis=-1)

    # Rates and torques

    def jacobian(self, state: State) -> np.ndarray:
        """Return J (..., k, k): motor rates from joint rates.

        Raises:
            SingularError: where the joints do not determine the motors.
        """
        return self._square(self._found("jacobian", state))

    def jacobian_rate(self, state: State, rates: ArrayLike | None = None) -> np.ndarray:
        """Return J' (..., k, k) for rates w (..., k) of the joints; those of the state if left out.

        J does not depend on what moves no motor.
        """
        if rates is None:
            w = self._rates(state).take(self._places, axis=-1)
        else:
            w = self._given(rates, "rates", "joints")
        return self._square(self._found("jacobian_rate", state, w))

    def motor_rates(self, state: State, rates: ArrayLike) -> np.ndarray:
        """Return the rates (..., k) of the motors for rates of the joints, J w."""
        return self._found("motor_rates", state, self._given(rates, "rates", "joints"))

    def joint_rates(self, state: State, rates: ArrayLike) -> np.ndarray:
        """Return the rates (..., k) of the joints for rates of the motors, J^-1 w_m."""
        return self._found("joint_rates", state, self._given(rates, "rates", "motors"))

    def joint_torques(self, state: State, torques: ArrayLike) -> np.ndarray:
        """Return the torques (..., k) that those of the motors make in the joints, J^T u."""
        return self._found("joint_torques", state, self._given(torques, "torques", "motors"))

    def motor_torques(self, state: State, torques: ArrayLike) -> np.ndarray:
        """Return the torques (..., k) of the motors that make those in the joints, J^-T u_j.

        Raises:
            SingularError: where the motors do not hold the joints.
        """
        return self._found("motor_torques", state, self._given(torques, "torques", "joints"))

    # Dynamics

    def inertia(self, state: State, side: Side = "joints") -> np.ndarray:
        """Return the apparent inertia (..., k, k) at the joints, or at the motors: that of the
        whole mechanism, the other independent rates held."""
        M = self._square(self._found("joint_inertia", state))
        if self._named(side) is self.joints:
            return M
        inverse = self._inverse(state)
        return np.swapaxes(inverse, -1, -2) @ M @ inverse

    def bias(self, state: State, side: Side = "joints") -> np.ndarray:
        """Return h (..., k), C v + G - f: the torques at the joints, or at the motors, without
        accelerations of these."""
        v = self._rates(state)
        h = self._found("joint_bias", state, v)
        if self._named(side) is self.joints:
            return h
        inverse, M = self._inverse(state), self.inertia(state)
        w = v.take(self._places, axis=-1)
        turning = applied(self.jacobian_rate(state, w), w)
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
        gap before it; jacobian: q -> J row by row; jacobian_rate: (q, w of the joints) -> J' row by
        row; inverse: q -> J^-1 row by row; motor_rates, joint_rates: (q, rates of the other side);
        joint_torques, motor_torques: (q, torques of the other side); joint_inertia: q -> M;
        joint_bias: (q, v) -> h. After these outputs each gives the weakest relative pivot.
        """
        made = (maps.function(self.map, name) for name in maps.OUTPUTS)
        return (functions.closure_step(self.chart.equations), *made)

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
    def map(self) -> LoopMap:
        """The same as expressions."""
        return LoopMap(self.chart.equations, self.joints, self.motors)

    @cached_property
    def _kernels(self) -> Mapping[str, Kernel]:
        """What was asked of the map, compiled: by name and by what it is of."""
        return {
            name: self.chart.compiled(
                f"{name} of {self.motors} by {self.joints}",
                lambda _, name=name: maps.function(self.map, name),
            )
            for name in maps.OUTPUTS
        }

    def _found(self, name: str, state: State, *given: np.ndarray) -> np.ndarray:
        """Return what a kernel gives (..., size) at states, refused where it is not defined; one
        state takes the shortest way."""
        kernel, q = self._kernels[name], self.robot.own(state).q
        least = SIDEWAYS * self._usual if name in maps.INVERTED else 0.0
        if q.ndim == 1 and (not given or given[0].ndim == 1):
            y = kernel.flat(q, *given, self.robot.p)
            *_, pivot, side = numbers = y.tolist()
            if isfinite(sum(numbers)) and abs(pivot) > PIVOT_BOUND and abs(side) > least:
                return y[:-2]
        found, pivots, sides = kernel(q, *given, self.robot.p)
        for part in given:
            checks.finite(part, "what is given")
        if not np.abs(pivots).min(initial=np.inf) > PIVOT_BOUND:
            raise SingularError(
                f"the joints {', '.join(self.joints)} do not determine the motors "
                f"{', '.join(self.motors)} here: the loops are singular; take another pose"
            )
        if not np.abs(sides).min(initial=np.inf) > least:
            raise SingularError(
                f"the motors {', '.join(self.motors)} do not hold {', '.join(self.joints)} in this "
                "pose: their Jacobian is singular; take another pose"
            )
        return found

    def _square(self, found: np.ndarray) -> np.ndarray:
        k = len(self.joints)
        return found.reshape(*found.shape[:-1], k, k)

    @cached_property
    def _usual(self) -> float:
        """The least determinant of a block of J, in own units, where the equations are arranged."""
        y = self._kernels["joint_rates"].flat(
            self.about.q, np.zeros(len(self.joints)), self.robot.p
        )
        return abs(y.item(-1))

    @cached_property
    def _places(self) -> list[int]:
        """Where the joints' rates are among the chart's."""
        return [self.chart.independent.index(name) for name in self.joints]

    def _rates(self, state: State) -> np.ndarray:
        """Return the rates of a state in the model's chart, those of others as they are."""
        given = self.robot.chart_of(self.robot.own(state))
        if given.independent == self.chart.independent:
            return state.rates
        w = given.weighed(state.q, state.rates, self.robot.p)[0]
        return w.take(self.chart.equations.chart.independent, axis=-1)

    def _inverse(self, state: State) -> np.ndarray:
        """Return J^-1 (..., k, k), refused where the motors do not hold the joints."""
        return self._square(self._found("inverse", state))

    def _bent(self, state: State, torques: ArrayLike | None) -> np.ndarray:
        """Return G (..., k, k), the derivative of J^T u along each joint: J' is linear in the
        rates."""
        k = len(self.joints)
        if torques is None:
            return np.zeros((*state.batch, k, k))
        u, columns = self._given(torques, "torques", "motors"), []
        for unit in np.eye(k):
            dJ = self.jacobian_rate(state, unit)
            columns.append(applied(np.swapaxes(dJ, -1, -2), u))
        return np.stack(columns, axis=-1)

    def _given(self, values: ArrayLike, what: str, side: Side) -> np.ndarray:
        if not isinstance(values, np.ndarray) or values.dtype.kind != "f":
            values = checks.finite(values, what)
        array = values
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
    chosen = independent(robot, q, [*joints, *dict.fromkeys((*others, *motors))])
    tied = [name for name in joints if name not in chosen]
    if tied:
        raise LinkworkError(
            f"the joint {tied[0]!r} does not move independently of the other joints in this pose; "
            "leave it out, or give a guess at which it does"
        )
    chart = robot.chart.anew(q, tuple(map(tree.index, chosen)))
    if chart is None:
        raise LinkworkError(
            f"the rates {', '.join(chosen)} hardly determine the motion in this pose; give a guess "
            "farther from where they do not"
        )
    return chart


def independent(robot: Robot, q: np.ndarray, wanted: Sequence[str]) -> list[str]:
    """Return n independent rates of the tree, the first ones of those wanted that are: by their
    rows of the null space of Phi in own units, each by what the ones before leave of it."""
    equations, n = robot.equations, robot.mobility
    Phi = equations.natural(robot.chart.constraint_jacobian(q))
    free = np.linalg.svd(np.vstack([Phi, np.zeros((1, equations.nv))]))[2][-n:].T
    chosen: list[str] = []
    basis = np.zeros((0, n))
    for name in wanted:
        row = (
            free[equations.tree.rates.index(name)] if name in equations.tree.rates else 0 * free[0]
        )
        left = row - basis.T @ (basis @ row)
        if len(chosen) < n and np.linalg.norm(left) > TIED * max(np.linalg.norm(row), TIED):
            basis = np.vstack([basis, left / np.linalg.norm(left)])
            chosen.append(name)
    return chosen


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
            if name in model.motors:
                raise LinkworkError(
                    f"the motor {name!r} moves independently of {', '.join(model.joints)}; leave "
                    "it out, or name the joint that it moves"
                )
            raise LinkworkError(
                f"the motor {motor!r} moves with {name!r}, too; name it among the joints, with one "
                "more motor"
            )


def applied(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return matrices (..., k, k) times vectors (..., k)."""
    return (matrix @ vector[..., None])[..., 0]


def least(limits: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return min_m limits_m / |matrix_mi| (..., i)."""
    with np.errstate(divide="ignore"):
        return (limits[:, None] / np.abs(matrix)).min(axis=-2)
