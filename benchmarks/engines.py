"""The other engines at their best: forward dynamics as one bare call, and runs by the classical
Runge-Kutta method."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

import linkwork as lw
from linkwork.lab.engines.mujoco import MujocoEngine, mj
from linkwork.lab.engines.pinocchio import PinocchioEngine, pin

from benchmarks.timing import Contender

PROXIMAL = (1e-6, 1e-6, 1e-14, 1)
"""Accuracies, mu and iterations of Pinocchio's proximal solver: the quickest that is right to 1e-12
here."""

TreeEngine = PinocchioEngine | MujocoEngine
Acceleration = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def pinocchio(robot: lw.Robot) -> PinocchioEngine:
    """Return Pinocchio with the quickest settings that keep its accuracy."""
    engine = PinocchioEngine(robot.mechanism)
    engine.proximal = pin.ProximalSettings(*PROXIMAL)
    return engine


def pinocchio_evaluations(robot: lw.Robot, states: lw.State, forces: np.ndarray) -> Contender:
    """Return `constraintDynamics` in a tight loop of Python over prepared states; nothing else is
    in the loop."""
    engine = pinocchio(robot)
    calls = [
        engine.evaluation(*row)
        for row in zip(states.positions, robot.joint_rates(states), forces, strict=True)
    ]

    def call() -> None:
        for evaluate in calls:
            evaluate()

    return Contender(call, len(calls))


def pinocchio_call() -> Contender:
    """Return the same call for a model of one slider without loops: at most this much of it is
    Python's."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    data, nothing = model.createData(), np.zeros(1)
    constraints, constraint_data = (
        pin.StdVec_RigidConstraintModel(),
        pin.StdVec_RigidConstraintData(),
    )
    pin.initConstraintDynamics(model, data, constraints, constraint_data)
    settings, evaluate = pin.ProximalSettings(*PROXIMAL), pin.constraintDynamics
    return Contender(
        lambda: evaluate(
            model, data, nothing, nothing, nothing, constraints, constraint_data, settings
        )
    )


def mujoco_evaluations(robot: lw.Robot, states: lw.State, forces: np.ndarray) -> Contender:
    """Return `mj_forward` at one state, which it computes anew at every call."""
    engine = MujocoEngine(robot.mechanism)
    one = states.at(0)
    return Contender(engine.evaluation(one.positions, robot.joint_rates(one), forces[0]))


def pinocchio_acceleration(engine: PinocchioEngine) -> Acceleration:
    """Return (q, v, u) -> q'' of Pinocchio's tree, without wrapping."""
    tau = np.zeros(engine.model.nv)
    model, data, settings, drives = engine.model, engine.data, engine.proximal, engine.drives
    constraints, constraint_data, evaluate = (
        engine.constraints,
        engine.constraint_data,
        pin.constraintDynamics,
    )

    def acceleration(q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        tau[drives] = u
        return evaluate(model, data, q, v, tau, constraints, constraint_data, settings)

    return acceleration


def mujoco_acceleration(engine: MujocoEngine) -> Acceleration:
    """Return (q, v, u) -> q'' of MuJoCo's tree, without wrapping."""
    model, data, drives, evaluate = engine.model, engine.data, engine.drives, mj.mj_forward
    qpos, qvel, applied, qacc = data.qpos, data.qvel, data.qfrc_applied, data.qacc

    def acceleration(q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
        qpos[:], qvel[:], applied[drives] = q, v, u
        evaluate(model, data)
        return qacc.copy()

    return acceleration


def runge_kutta(
    f: Acceleration, q: np.ndarray, v: np.ndarray, forces: Sequence[np.ndarray], h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return q, v at the end of a run by the classical method with steps of h [s]; `forces` are u
    at 0, h/2, h, 3h/2 ..."""
    for u, middle, end in zip(forces[:-1:2], forces[1::2], forces[2::2], strict=True):
        a1 = f(q, v, u)
        v2 = v + (h / 2) * a1
        a2 = f(q + (h / 2) * v, v2, middle)
        v3 = v + (h / 2) * a2
        a3 = f(q + (h / 2) * v2, v3, middle)
        v4 = v + h * a3
        a4 = f(q + h * v3, v4, end)
        q, v = q + (h / 6) * (v + 2 * (v2 + v3) + v4), v + (h / 6) * (a1 + 2 * (a2 + a3) + a4)
    return q, v
