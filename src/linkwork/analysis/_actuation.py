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
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.analysis import loop_map as maps
from linkwork.analysis.arranging import arranged, require_apart
from linkwork.analysis.compiled_map import CompiledMap
from linkwork.analysis.loop_map import LoopMap
from linkwork.analysis.plugged_tree import PluggedTree, plugged_tree
from linkwork.analysis.transferred import (
    TransferredGains,
    TransferredLimits,
    across,
    applied,
    congruent,
    transposed,
)
from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.export.as_casadi import as_casadi
from linkwork.model.charts import CompiledChart
from linkwork.model.checks import names
from linkwork.model.posing import start_of
from linkwork.model.state import State
from linkwork.robot import Robot

Side = Literal["joints", "motors"]


@dataclass(frozen=True, eq=False)
class ActuationModel:
    """Map coordinates, rates, torques, inertia, limits and gains between joints and motors.

    All methods take one state or a stack of states of the robot, and return arrays with the same
    leading dimensions. `side` says whether "joints" or "motors" are asked for.

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

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes it again in another process: expressions do not travel."""
        return again, (self.robot, self.joints, self.motors, self.about)

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
        checks.needed(state, State)
        return np.stack([state[name] for name in self._named(side)], axis=-1)

    # Rates and torques

    def jacobian(self, state: State) -> np.ndarray:
        """Return J (..., k, k): motor rates from joint rates.

        Raises:
            SingularError: where the joints do not determine the motors.
        """
        found = self._quick["jacobian"](state)
        return self._matrix("jacobian", state) if found is None else found

    def jacobian_rate(self, state: State, rates: ArrayLike | None = None) -> np.ndarray:
        """Return J' (..., k, k) for rates w (..., k) of the joints; those of the state if left out.

        J does not depend on what moves no motor.
        """
        if rates is None:
            found = self._of_state["jacobian_rate"](state)
            if found is not None:
                return found
            w = self.compiled.rates(state).take(self.compiled.places, axis=-1)
        else:
            found = self._quick["jacobian_rate"](state, rates)
            if found is not None:
                return found
            w = self._given(rates, "rates", "joints")
        return self._matrix("jacobian_rate", state, w)

    def motor_rates(self, state: State, rates: ArrayLike) -> np.ndarray:
        """Return the rates (..., k) of the motors for rates of the joints, J w."""
        found = self._quick["motor_rates"](state, rates)
        return self._mapped("motor_rates", state, rates, "joints") if found is None else found

    def joint_rates(self, state: State, rates: ArrayLike) -> np.ndarray:
        """Return the rates (..., k) of the joints for rates of the motors, J^-1 w_m."""
        found = self._quick["joint_rates"](state, rates)
        return self._mapped("joint_rates", state, rates, "motors") if found is None else found

    def joint_torques(self, state: State, torques: ArrayLike) -> np.ndarray:
        """Return the torques (..., k) that those of the motors make in the joints, J^T u."""
        found = self._quick["joint_torques"](state, torques)
        return self._mapped("joint_torques", state, torques, "motors") if found is None else found

    def motor_torques(self, state: State, torques: ArrayLike) -> np.ndarray:
        """Return the torques (..., k) of the motors that make those in the joints, J^-T u_j.

        Raises:
            SingularError: where the motors do not hold the joints.
        """
        found = self._quick["motor_torques"](state, torques)
        return self._mapped("motor_torques", state, torques, "joints") if found is None else found

    # Dynamics

    def inertia(self, state: State, side: Side = "joints") -> np.ndarray:
        """Return the apparent inertia (..., k, k) at the joints, or at the motors: that of the
        whole mechanism, the other independent rates held."""
        name = "joint_inertia" if self._of_joints(side) else "motor_inertia"
        found = self._quick[name](state)
        return self._matrix(name, state) if found is None else found

    def bias(self, state: State, side: Side = "joints") -> np.ndarray:
        """Return h (..., k), C v + G - f: the torques at the joints, or at the motors, without
        accelerations of these."""
        name = "joint_bias" if self._of_joints(side) else "motor_bias"
        found = self._of_state[name](state)
        if found is None:
            return self.compiled.found(name, state, self.compiled.rates(state))
        return found

    # Limits and gains

    def speed_limits(self, state: State, limits: ArrayLike) -> TransferredLimits:
        """Return the speeds of the joints that limits V (k) of the motors' speeds leave.

        alone_i = min_m V_m / |J_mi|,    most_i = sum_m |J^-1_im| V_m
        """
        V = self._positive(limits, "speed limits")
        return across(V, self.jacobian(state), self._inverse(state))

    def torque_limits(self, state: State, limits: ArrayLike) -> TransferredLimits:
        """Return the torques in the joints that limits U (k) of the motors' torques leave.

        alone_i = min_m U_m / |J^-1_im|,    most_i = sum_m |J_mi| U_m
        """
        U = self._positive(limits, "torque limits")
        return across(U, transposed(self._inverse(state)), transposed(self.jacobian(state)))

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
        K, D, inverse = self._gain(kp, "kp"), self._gain(kd, "kd"), self._inverse(state)
        held = K + self._bent(state, torques)
        return TransferredGains(congruent(held, inverse), congruent(D, inverse))

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
        K, D, J = self._gain(kp, "kp"), self._gain(kd, "kd"), self.jacobian(state)
        return TransferredGains(congruent(K, J) - self._bent(state, torques), congruent(D, J))

    # Export

    def tree(self) -> PluggedTree:
        """Return the tree without loops that the joints and the other independent rates span, with
        what makes it move as the closed robot does in MuJoCo.

        Raises:
            LinkworkError: independent joints behind dependent ones; joints that an engine's tree
                does not hold as they are; links that are cut away between two branches.
        """
        return plugged_tree(self.robot, self.chart, self.motors, self.about)

    def functions(self) -> tuple[ca.Function, ...]:
        """Return the maps as CasADi functions of the tree's coordinates q and the rates v of joints
        and others, in the order of `chart.equations`.

        closure_step: q -> q after a Newton step that closes the loops at the same joints, and the
        gap before it; jacobian: q -> J row by row; jacobian_rate: (q, w of the joints) -> J' row by
        row; inverse: q -> J^-1 row by row; motor_rates, joint_rates: (q, rates of the other side);
        joint_torques, motor_torques: (q, torques of the other side); joint_inertia, motor_inertia:
        q -> M at the joints, or at the motors; joint_bias, motor_bias: (q, v) -> h there. After
        these outputs each gives the weakest relative pivot.
        """
        made = (maps.function(self.map, name) for name in maps.OUTPUTS)
        return (functions.closure_step(self.chart.equations), *made)

    def write_c(self, path: str | Path) -> Path:
        """Write the functions of `functions` as one C file without dependencies, and its header,
        in CasADi's calling convention (`casadi.external` takes them); matrices are column by
        column.

        path: of the C file, which is returned; the header of its name stands beside it.

        Raises:
            LinkworkError: another suffix than .c, a folder that is not there.
        """
        target = checks.file_path(path, "the path")
        if target.suffix != ".c" or not target.parent.is_dir():
            raise LinkworkError(
                f"C is written to a file .c in a folder that is there, not to '{target}'"
            )
        source, header = as_casadi(self.functions(), target.stem)
        target.write_text(source, encoding="utf-8")
        target.with_suffix(".h").write_text(header, encoding="utf-8")
        return target

    @cached_property
    def compiled(self) -> CompiledMap:
        """The same as machine code."""
        return CompiledMap(self.robot, self.joints, self.motors, self.chart, self.about)

    @cached_property
    def map(self) -> LoopMap:
        """The same as expressions."""
        return self.compiled.expressions

    @cached_property
    def _quick(self):
        return self.compiled.quick

    @cached_property
    def _of_state(self):
        return self.compiled.of_state

    def _named(self, side: str) -> tuple[str, ...]:
        return self.joints if self._of_joints(side) else self.motors

    def _of_joints(self, side: str) -> bool:
        if not (isinstance(side, str) and side in ("joints", "motors")):
            raise LinkworkError(f"side is {checks.shown(side)}; give 'joints' or 'motors'")
        return side == "joints"

    def _matrix(self, name: str, state: State, *given: np.ndarray) -> np.ndarray:
        """Return a matrix (..., k, k) at states."""
        k, found = len(self.joints), self.compiled.found(name, state, *given)
        return found.reshape(*found.shape[:-1], k, k)

    def _mapped(self, name: str, state: State, values: ArrayLike, side: Side) -> np.ndarray:
        """Return rates or torques (..., k) of the other side at states."""
        given = self._given(values, "torques" if name.endswith("torques") else "rates", side)
        found = self._quick[name](state, given)
        return self.compiled.found(name, state, given) if found is None else found

    def _inverse(self, state: State) -> np.ndarray:
        """Return J^-1 (..., k, k), refused where the motors do not hold the joints."""
        found = self._quick["inverse"](state)
        return self._matrix("inverse", state) if found is None else found

    def _bent(self, state: State, torques: ArrayLike | None) -> np.ndarray:
        """Return G (..., k, k), the derivative of J^T u along each joint: J' is linear in the
        rates."""
        k = len(self.joints)
        if torques is None:
            return np.zeros((*state.batch, k, k))
        u = self._given(torques, "torques", "motors")
        along = (transposed(self.jacobian_rate(state, unit)) for unit in np.eye(k))
        return np.stack([applied(turned, u) for turned in along], axis=-1)

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

    def _gain(self, gain: ArrayLike, what: str) -> np.ndarray:
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
    checks.needed(robot, Robot)
    wanted = names(joints, "joints")
    driven = robot.actuators if motors is None else names(motors, "motors")
    checks.known((*wanted, *driven), robot.rates, "joint rate")
    if len(wanted) != len(driven) or not wanted or len({*wanted}) < len(wanted):
        raise LinkworkError(
            f"{len(wanted)} joints and {len(driven)} motors are given; give as many of one as of "
            "the other, each once"
        )
    about = start_of(robot, guess)
    chart = arranged(robot, wanted, driven, about.q)
    others = tuple(name for name in chart.independent if name not in wanted)
    require_apart(chart, wanted, driven, about.q)
    return ActuationModel(robot, wanted, driven, others, chart, about)


def again(
    robot: Robot, joints: Sequence[str], motors: Sequence[str], about: State
) -> ActuationModel:
    """Return a model that was pickled."""
    return actuation(robot, joints, motors, guess=about)
