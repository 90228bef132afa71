"""Saved states: what was saved of one run, or of many, in one chart, and all that follows from it.

All is evaluated by compiled kernels, for all states at once, when it is first asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import casadi as ca
import numpy as np

from linkwork.equations import Equations
from linkwork.equations.powers import contacts, powers
from linkwork.model import dexterity, task
from linkwork.model.charts import CompiledChart
from linkwork.model.reactions import Samples, transmitted
from linkwork.runs.system import System

if TYPE_CHECKING:
    from linkwork.model.model import Model


class Aim(Protocol):
    """Tell where a controller leads to."""

    def joints(self, t: np.ndarray) -> np.ndarray:
        """Return the wanted coordinates (K, actuators) of the actuated joints at times [s]."""
        ...

    def tool_error(self, places: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return the distances (K, pose) of tool poses from those wanted at the saved times."""
        ...


class Acted(NamedTuple):
    """Hold commands and forces of the actuators (K, actuators), and external wrenches (moment,
    force) in the ground's axes (K, wrenches, 6).
    """

    command: np.ndarray
    force: np.ndarray
    wrenches: np.ndarray


class Powers(NamedTuple):
    """Hold powers [W] of actuators (K, actuators), of friction in the joint rates (K, m), of the
    dampers of springs between points (K, springs), of what dissipates in contacts (K, touches), of
    a fluid (K, drags), and of external wrenches (K, wrenches).
    """

    actuators: np.ndarray
    friction: np.ndarray
    dampers: np.ndarray
    contacts: np.ndarray
    drags: np.ndarray
    wrenches: np.ndarray


class Over(NamedTuple):
    """Hold the states at the nodes of the way over singular poses, and what leads from values there
    to those at the saved times.
    """

    nodes: SavedStates
    through: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class SavedStates:
    """Hold K states y = (q, v, z) (K, n) of a system in one chart.

    inputs: gives the integrator's inputs (K, nu); p: parameters of the system (np), or of each
        state (K, np)
    t: times (K,) [s]; places: theirs among all times that were asked for
    residual: the largest gap of each state's loops (K,), where it was recorded
    aim: where a controller leads to; over: the way over singular poses on which they lie
    """

    robot: Model
    system: System
    chart: CompiledChart
    y: np.ndarray
    inputs: Callable[[], np.ndarray]
    p: np.ndarray
    t: np.ndarray | None = None
    places: np.ndarray | None = None
    residual: np.ndarray | None = None
    aim: Aim | None = None
    over: Over | None = None

    @classmethod
    def of_run(
        cls, robot: Model, system: System, chart: CompiledChart, y: np.ndarray, u: np.ndarray
    ) -> SavedStates:
        """Return states of one run, under the inputs u (K, nu)."""
        return cls(robot, system, chart, y, lambda: u, system.p(chart))

    @cached_property
    def q(self) -> np.ndarray:
        return np.ascontiguousarray(self.y[:, : self.chart.equations.nq])

    @cached_property
    def v(self) -> np.ndarray:
        nq, n = self.chart.equations.nq, self.chart.equations.mobility
        return np.ascontiguousarray(self.y[:, nq : nq + n])

    @property
    def z(self) -> np.ndarray:
        """Extra states of drives and controllers, then those that tell turns."""
        return self.y[:, self.chart.equations.nq + self.chart.equations.mobility :]

    @property
    def strains(self) -> np.ndarray | None:
        """The forces of bristles (K, ns), the last ones of the extra states; None without any."""
        count = sum(len(strain.names) for strain in self.robot.names.strains)
        extras = len(self.system.extras)
        return np.ascontiguousarray(self.z[:, extras - count : extras]) if count else None

    @cached_property
    def u(self) -> np.ndarray:
        return self.inputs()

    @cached_property
    def p_robot(self) -> np.ndarray:
        """The robot's own parameters (np), or those of each state (K, np)."""
        return np.ascontiguousarray(self.p[..., : self.robot.p.size])

    @cached_property
    def _told(self) -> bool:
        """Whether a table tells the chart: then what all charts share is measured in the rates w of
        the whole tree."""
        return self.system.told(self.chart, len(self.y))

    @cached_property
    def _rated(self) -> tuple[CompiledChart, np.ndarray]:
        """The chart that joints, bodies and energies are measured in, and its rates (K, ...)."""
        if not self._told:
            return self.chart, self.v
        return self.chart.free, self.chart.in_tree(self.q, self.v, self.p_robot)[0]

    @cached_property
    def _recorded(self) -> tuple[np.ndarray, ...]:
        """v', command, force and wrenches; the first by a table where one tells the chart."""
        given = self.z, self.u, self.p
        if not self._told:
            return self.system.kernel(self.chart, "recorded")(self.q, self.v, *given)
        chart, w = self._rated
        return self.v_dot, *self.system.kernel(chart, "acted")(self.q, w, *given)

    @cached_property
    def v_dot(self) -> np.ndarray:
        """Accelerations of the independent rates (K, n)."""
        if self._told:
            motion = self.system.by_table(self.chart, "motion")
            rows = motion.rows(self.q, self.v, self.z, self.u, self.p)
            return rows[:, self.q.shape[1] :][:, : self.v.shape[1]]
        if self.system.acting is not None:
            return self._recorded[0]
        return self.chart.kernel("motion")(self.q, self.v, self.u, self.p_robot)[1]

    @property
    def acted(self) -> Acted:
        """What acts; forces over time are the inputs themselves."""
        if self.system.acting is None:
            return Acted(self.u, self.u, np.empty((len(self.y), 0, 6)))
        _, command, force, wrenches = self._recorded
        return Acted(command, force, wrenches.reshape(len(self.y), wrenches.shape[1] // 6, 6))

    def moving(self, v_dot: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return positions, as they are read off the tree's, rates and accelerations (K, m) of all
        joints.
        """
        return self.chart.joints_moving(self.q, self.v, v_dot, self.p_robot, self._told)

    @cached_property
    def joints(self) -> tuple[np.ndarray, ...]:
        """Positions and rates of all joints (K, m)."""
        return self.moving(np.zeros(self.v.shape[1]))[:2]

    @cached_property
    def tool(self) -> np.ndarray:
        """Poses of the first tool: (x, y, angle) (K, 3), or with rotation vectors (K, 6)."""
        return self.robot.tool_poses(self.q, self.p_robot)

    @property
    def task(self) -> np.ndarray:
        """Coordinates of the task that the first tool states (K, k)."""
        stated = task.stated(self.robot)
        return task.values(self.robot, self.q, stated, self.p_robot)

    @property
    def conditioning(self) -> np.ndarray:
        """How well the actuators move the tool (K,): 1 alike in all directions, 0 singular."""
        return dexterity.conditioning(self.robot, self.q, self.p_robot)

    @cached_property
    def energies(self) -> np.ndarray:
        """Kinetic and potential energy (2, K) [J]."""
        chart, v = self._rated
        found = chart.kernel("energy")(self.q, v, self.p_robot)
        return np.array([found[0][:, 0], found[1][:, 0]])

    @property
    def energy(self) -> np.ndarray:
        """Kinetic and potential energy together (K,) [J]."""
        return self.energies.sum(axis=0)

    @cached_property
    def powers(self) -> Powers:
        """What goes into the mechanism, and out of it."""
        actuated, friction, dampers, touching, drags, _ = self._strained("powers", powers)
        own = [
            np.sum(wrench * self._bodies[2][:, 6 * body : 6 * body + 6], axis=1)
            for body, wrench in self.about_centres()
        ]
        wrenches = np.column_stack([np.empty((len(self.y), 0)), *own])
        return Powers(self.acted.force * actuated, friction, dampers, touching, drags, wrenches)

    @property
    def power(self) -> np.ndarray:
        """All powers together (K,) [W]."""
        return sum((part @ np.ones(part.shape[1]) for part in self.powers), np.zeros(len(self.y)))

    @cached_property
    def contacts(self) -> tuple[np.ndarray, ...]:
        """Forces on the second bodies (K, touches, 3) [N] in the ground's axes, and gaps (K,
        touches) [m], where bodies may touch."""
        forces, gaps = self._strained("contacts", contacts)
        return forces.reshape(len(self.y), gaps.shape[1], 3), gaps

    def _strained(self, name: str, make: Callable[[Equations], ca.Function]) -> tuple[Any, ...]:
        """Return what a function of q and v gives; with the states of bristles and the friction of
        bearings where there are any."""
        chart, v = self._rated
        if self.robot.names.strains or self.robot.rubs:
            return self.system.kernel(chart, name)(self.q, v, self.z, self.u, self.p)
        return chart.compiled(name, make)(self.q, v, self.p_robot)

    @cached_property
    def _bodies(self) -> tuple[np.ndarray, ...]:
        chart, v = self._rated
        return chart.kernel("bodies_motion")(self.q, v, self.p_robot)

    def about_centres(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield the body's number and (moment about its mass centre, force) (K, 6) of each external
        wrench, in the ground's axes.
        """
        robot, acting = self.robot, self.system.acting
        for k, wrench in enumerate(acting.wrenches if acting else ()):
            moment, force = np.split(self.acted.wrenches[:, k], 2, axis=1)
            body = robot.bodies.index(wrench.body)
            axes = self._bodies[1][:, 9 * body : 9 * body + 9].reshape(-1, 3, 3)
            centre = robot.mechanism.bodies[wrench.body].centre_of_mass
            arm = axes @ (np.array(wrench.point) - np.array(centre))
            yield body, np.concatenate([moment + np.cross(arm, force), force], axis=1)

    @property
    def samples(self) -> Samples:
        """What the joint reactions follow from."""
        chart = self.chart.with_parameters(self.p_robot)
        applied = np.zeros((len(self.y), len(self.robot.bodies), 6))
        for body, wrench in self.about_centres():
            applied[:, body] += wrench
        u, strains = self.acted.force, self.strains
        return Samples(chart, self.q, self.v, self.v_dot, u, applied, strains)

    @cached_property
    def reactions(self) -> np.ndarray:
        """How large the moments [N m], about the origins of F1, and the forces [N] are that joints
        transmit (2, K, joints).
        """
        found = transmitted(self.robot, [self.samples], (len(self.y),)).wrenches
        return np.linalg.norm(np.split(found, 2, axis=-1), axis=-1)
