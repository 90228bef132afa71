"""Ready controllers in the tool's task coordinates, with the errors e of `task_errors`.

    PD with gravity  u = J_e' (kp e + kd e') + g(q),    J_e:  e' = ... - J_e q_a'
    computed torque  u = M a + C v + G - f,    J_e a = r + kd e' + kp e

The model tells where the tool is by the joint coordinates that are measured, as its forward
kinematics does in a robot's own controller.
Source: Khatib 1987; Siciliano, Sciavicco, Villani & Oriolo, Robotics, sec. 8.6 (operational space).
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np

from linkwork import math
from linkwork.checks import amount
from linkwork.control.controllers import Controller, Form, Gain, gain
from linkwork.control.inverse_dynamics import InverseDynamics, measured, numeric
from linkwork.control.observation import Observation
from linkwork.control.plant import TaskPlant
from linkwork.control.records import number
from linkwork.control.task_errors import TaskError, task_error
from linkwork.control.task_goals import Task, TaskCourse, TaskGoal, task_course
from linkwork.equations.symmetric import solve_symmetric
from linkwork.equations.task import held_task
from linkwork.errors import LinkworkError
from linkwork.mechanism.task import is_length, labels

EACH = "coordinate of the task"
DEPENDENT = 1e-6  # sine between a column of the task's Jacobian and the others that is none
INFINITE = float("inf")


@dataclass(frozen=True, eq=False)
class TaskFollower(Controller):
    """Lead the tool, in the coordinates of its task, to a goal: a state or a motion
    (`robot.follow`) of the model's joints, the task's coordinates by name, or a signal of them."""

    goal: TaskGoal

    kp: ClassVar[Any]
    kd: ClassVar[Any]
    model: ClassVar[Any]

    @classmethod
    def led(cls, goal: TaskGoal, **given: Any) -> Self:
        return cls(goal, **given)

    @abstractmethod
    def asked(self, own: TaskError, kp: ca.SX, kd: ca.SX) -> ca.SX:
        """Return what is asked of the actuators; own: with the columns of the `leading` rates.

        kp, kd: gains of the errors and of their rates, one for each coordinate of the task.
        """

    def evaluated(self, t: Any, state: Observation) -> np.ndarray:
        """Return the same (na) at a time, a number or the symbol.

        t: the time [s] or its symbol; state: what is measured.
        """
        self.dynamics.require_same_actuators(state)
        equations = self.model.equations
        names = labels(held_task(self.task))
        read = [
            measured(equations, state),
            [state.rate(label) for label in equations.independent],
            *self.course.columns.at(t),
            *(gain(state, name, getattr(self, name), names) for name in ("kp", "kd")),
            [state.parameter(f"model.{n}", value) for n, value in self.model.parameters.items()],
        ]
        found = self.function(*(ca.vertcat(ca.SX(0, 1), *part) for part in read))
        return numeric(math.vector(found))

    @cached_property
    def function(self) -> ca.Function:
        """(q, v, goal, goal', goal'', kp, kd, p) -> what is asked of the actuators."""
        equations, k = self.model.equations, len(self.task)
        width = self.course.columns.positions.coefficients.shape[2]
        columns = [ca.SX.sym("goal", width) for _ in range(3)]
        kp, kd = ca.SX.sym("kp", k), ca.SX.sym("kd", k)
        found = task_error(equations, self.task, columns, self.course.told)
        led = [equations.independent.index(name) for name in self.leading]
        own = TaskError(found.error, found.rates, found.A[:, led], found.rest)
        inputs = [equations.tree.q, equations.v, *columns, kp, kd, equations.p]
        return ca.Function("task", inputs, [ca.densify(self.asked(own, kp, kd))], {"cse": True})

    @cached_property
    def task(self) -> Task:
        """The coordinates that lead the tool: as many as the model has freedoms, all driven."""
        found, freedoms = self.model.task_coordinates(), self.model.mobility - len(self.model.spins)
        names, actuators = ", ".join(labels(found)), len(self.model.actuators)
        if len(found) != freedoms:
            cure = "fewer" if len(found) > freedoms else "more"
            raise LinkworkError(
                f"the task {names} has {len(found)} coordinates and the model {freedoms} freedoms, "
                f"which a controller in task coordinates leads by as many; state {cure} as the "
                "tool's task"
            )
        if actuators < freedoms:
            raise LinkworkError(
                f"{amount(actuators, 'actuator')} cannot lead {freedoms} freedoms in {names}; lead "
                "the joints"
            )
        return found

    @property
    def course(self) -> TaskCourse:
        """What the goal asks for over time."""
        return self.renewed((), self.goal, lambda: task_course(self.goal, self.model, self.task))

    @cached_property
    def dynamics(self) -> InverseDynamics:
        """The model's."""
        return InverseDynamics(self.model)

    @cached_property
    def leading(self) -> tuple[str, ...]:
        """The rates that lead the tool: those of the actuators, the independent ones where there
        are more actuators."""
        actuators, independent = self.model.actuators, self.model.equations.independent
        return actuators if {*actuators} <= {*independent} else independent


@dataclass(frozen=True, eq=False)
class TaskPDWithGravity(TaskFollower):
    """Pull the tool to its goal along each coordinate of its task, and hold the model's weight and
    springs: u = J' (kp e + kd e') + g(q), e in task coordinates.

    model: a robot with the same joints, whose tool has as many task coordinates as it has freedoms
    """

    kp: Gain = number("", "N/m, N m/rad", by=EACH)
    kd: Gain = number("", "N s/m, N m s/rad", by=EACH)
    model: TaskPlant  # pyright: ignore[reportGeneralTypeIssues]

    forms: ClassVar = (
        Form(
            "task_pd_with_gravity",
            "u = J' (kp e + kd e') + g(q), e in task coordinates, with the model's weight and "
            "springs",
            "TaskPDWithGravity",
            ("model", "kp", "kd"),
        ),
    )

    def __call__(self, t, state):
        forces = self.evaluated(t, state)
        still = np.zeros(len(state.names.actuators))
        return forces + self.dynamics.forces(state, still, still=True)

    def asked(self, own, kp, kd):
        forces = ca.mtimes(own.A.T, kp * own.error + kd * own.rates)
        if self.leading == self.model.actuators:
            return forces
        S = self.model.equations.actuation
        return ca.mtimes(S, solve_symmetric(ca.mtimes(S.T, S), forces))


@dataclass(frozen=True, eq=False)
class TaskComputedTorque(TaskFollower):
    """Linearise the tool's motion by a model's inverse dynamics: with an exact model e'' + kd e' +
    kp e = 0, e in task coordinates.

    model: a robot with the same joints, which may be wrong, whose tool has as many task coordinates
        as it has freedoms
    """

    kp: Gain = number("", "1/s^2", by=EACH)
    kd: Gain = number("", "1/s", by=EACH)
    model: TaskPlant  # pyright: ignore[reportGeneralTypeIssues]

    forms: ClassVar = (
        Form(
            "task_computed_torque",
            "e'' + kd e' + kp e = 0 in task coordinates, by the inverse dynamics of a model",
            "TaskComputedTorque",
            ("model", "kp", "kd"),
        ),
    )

    def __call__(self, t, state):
        return self.dynamics.forces(state, self.evaluated(t, state))

    def asked(self, own, kp, kd):
        units = own_units(held_task(self.task), self.model.equations.tree.length)
        wanted = own.rest + kd * own.rates + kp * own.error
        a = regular_solution(own.A / ca.repmat(units, 1, own.A.shape[1]), wanted / units)
        actuators = self.model.actuators
        return ca.vertcat(
            *[a[self.leading.index(u)] if u in self.leading else 0 for u in actuators]
        )


def own_units(task: Task, length: float) -> ca.DM:
    """Return the mechanism's own units of task coordinates: its length, 1 of angles."""
    return ca.DM([length if is_length(item) else 1.0 for item in task])


def regular_solution(A: ca.SX, b: ca.SX) -> ca.SX:
    """Return x of A x = b, infinite where a column of A lies in the span of those before it: where
    the pose is singular, runs then end and name the controller."""
    Q, R = ca.qr(A)
    sines = [ca.fabs(R[k, k]) / ca.norm_2(A[:, k]) for k in range(A.shape[1])]
    regular = ca.mmin(ca.vertcat(*sines)) > DEPENDENT
    return ca.if_else(regular, ca.solve(R, ca.mtimes(Q.T, b)), INFINITE)
