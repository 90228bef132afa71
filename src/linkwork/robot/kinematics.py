"""Kinematics of a robot at a state: rates and accelerations, poses and twists, the tool in its
task's coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.gradients import derivatives
from linkwork.mechanism.task import TaskCoordinate, labels
from linkwork.model import dexterity, evaluation, limits, task
from linkwork.model.labels import POSES
from linkwork.model.model import Model
from linkwork.model.state import State
from linkwork.model.tool_motion import led
from linkwork.runs.endings import passed_limits
from linkwork.simulation import Run

if TYPE_CHECKING:
    from linkwork.gradients.records import ClosureDerivatives, ToolDerivatives


class Kinematics(Model):
    """How joints, bodies and tool move in a state (paper, Eqs. (6), (7))."""

    def rate_map(self, state: State) -> np.ndarray:
        """Return L (..., m, n): rates of all joints, in the order of `rates`, from the independent
        ones (paper, Eq. (7))."""
        return evaluation.told(self, "maps", state)[0]

    def twist_map(self, state: State) -> np.ndarray:
        """Return T (..., 6r, n): twists [omega; v of the mass centre] of all bodies, in the
        ground's axes (paper, Eq. (6))."""
        return evaluation.told(self, "maps", state)[1]

    def joint_rates(self, state: State) -> np.ndarray:
        """Return the rates of all joints (..., m) [m/s, rad/s], in the order of `rates`."""
        return self._steady("joints_motion", state)[1]

    def joint_accelerations(self, state: State, accelerations: ArrayLike) -> np.ndarray:
        """Return the accelerations of all joints (..., m) for those of the independent rates, L v'
        + L' v."""
        return evaluation.told(self, "joints_motion", state, accelerations)[2]

    def body_poses(self, state: State) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return the origin p_0B (..., 3) [m] and the matrix R_0B (..., 3, 3) of each body's frame,
        by name."""
        found = self.directly("bodies_motion").at(state)
        if found is None:
            found = self.kernel("bodies_motion")(self.own(state).q, np.zeros(self.mobility))
        origins, orientations, *_ = found
        p = origins.reshape(*state.batch, len(self.bodies), 3)
        R = orientations.reshape(*state.batch, len(self.bodies), 3, 3)
        return {name: (p[..., i, :], R[..., i, :, :]) for i, name in enumerate(self.bodies)}

    def twists(self, state: State) -> np.ndarray:
        """Return the twists t_i = [omega; v of the mass centre] of the bodies (..., r, 6), in the
        ground's axes."""
        twists = evaluation.told(self, "bodies_motion", state)[2]
        return twists.reshape(*state.batch, len(self.bodies), 6)

    def tool_pose(self, state: State) -> np.ndarray:
        """Return the tool's pose: x, y, angle (..., 3) in the plane; x, y, z, rotation vector
        (..., 6) in space [m, rad]."""
        self.require_tool()
        found = self.once(task.values_directly, POSES[self.planar]).at(state)
        return self.tool_poses(self.own(state).q) if found is None else found

    @property
    def task(self) -> tuple[str, ...]:
        """Names of the coordinates in which the tool is led: those of its description, or those
        that are plain at home (all, the position, the orientation, or what alone moves there); none
        where neither is.
        """
        return labels(task.task_if_any(self) or ()) if self.mechanism.tools else ()

    def task_coordinates(self) -> tuple[TaskCoordinate, ...]:
        """Return the coordinates of the `task` as a description states them.

        Raises:
            LinkworkError: no tool; a stated task that is not one of this robot, or depends on
                itself; none stated and none plain.
        """
        self.require_tool()
        return task.task_of(self)

    def conditioning(self, state: State) -> np.ndarray:
        """Return how well the actuators move the tool (...): 1 alike in all directions, 0
        singular (`linkwork.analysis.dexterity`). Without a task, or of a single freedom, it is the
        part of the worst motion of the tree's joints that they see: another number where another
        joint of a loop is cut."""
        q = self.own(state).q
        return dexterity.conditioning(self, q.reshape(-1, q.shape[-1])).reshape(state.batch)

    def task_values(self, state: State, what: Sequence[str] | None = None) -> np.ndarray:
        """Return the tool's task coordinates (..., k) [m, rad].

        Args:
            state: one or a stack.
            what: names of coordinates, of the task or of any pose, such as "torsion" or "rx": how
                these move along (parasitic motion); those of the `task` if left out.

        Returns:
            The values; NaN of those that a pose does not determine: azimuth, torsion and tilts at a
            tilt of half a turn, roll and yaw at a pitch of a quarter turn, an azimuth without its
            tilt where the tool is upright.
        """
        asked = self._task(what)
        found = self.once(task.values_directly, asked).at(state)
        return task.values(self, self.own(state).q, asked) if found is None else found

    def jacobian(self, state: State, what: Sequence[str] | None = None) -> np.ndarray:
        """Return the task Jacobian J (..., k, n) of the tool: x' = J v.

        Of all of rx, ry, rz together the rows are those of the angular velocity.

        Args:
            state: one or a stack; v in the order of its `independent`.
            what: as in `task_values`.

        Raises:
            LinkworkError: coordinates without rates at the pose, such as an azimuth where the tool
                is upright; a configuration where the rates do not determine the motion.
        """
        return self._led(state, what)[0]

    def task_rates(self, state: State, what: Sequence[str] | None = None) -> np.ndarray:
        """Return x' = J v (..., k) [m/s, rad/s] of the tool's task coordinates; as `jacobian`.

        state: one or a stack (...); what: names of task coordinates; those of the tool's task if
        left out.
        """
        return self._led(state, what)[1]

    def task_accelerations(
        self,
        state: State,
        accelerations: ArrayLike | Mapping[str, ArrayLike],
        what: Sequence[str] | None = None,
    ) -> np.ndarray:
        """Return x'' = J v' + J' v (..., k) [m/s^2, rad/s^2] of the tool's task coordinates, for
        accelerations v' (..., n) of the state's `independent` rates; as `jacobian`.

        state: one or a stack (...); what: names of task coordinates; those of the tool's task if
        left out.
        """
        return self._led(state, what, accelerations)[2]

    def tool_twist(self, state: State) -> np.ndarray:
        """Return the tool's twist [omega; v of its origin] (..., 6) [rad/s, m/s], in the axes of
        the ground, or of the body that it is relative to."""
        return self._tool_motion(state, None)[2]

    def tool_acceleration(
        self, state: State, accelerations: ArrayLike | Mapping[str, ArrayLike]
    ) -> np.ndarray:
        """Return [alpha; a of its origin] (..., 6) [rad/s^2, m/s^2] of the tool, the derivative of
        its twist, for accelerations v' (..., n) of the state's `independent` rates."""
        return self._tool_motion(state, accelerations)[3]

    def closure_derivatives(self, state: State, *, threads: int | None = 1) -> ClosureDerivatives:
        """Return how the coordinates and rates of all joints follow the independent ones and the
        free numbers: their exact derivatives with respect to q, v and p, loops closed.

        Args:
            state: one or a stack; threads: over which large stacks are dealt; None: all processors.

        Returns:
            A record in the tangent coordinates of the state's `independent` rates
            (`linkwork.gradients.records`).

        Raises:
            LinkworkError: a configuration where the rates do not determine the motion; derivatives
                that are not finite; free numbers that open loops.
        """
        return derivatives.closure_derivatives(self, state, threads)

    def tool_derivatives(self, state: State, *, threads: int | None = 1) -> ToolDerivatives:
        """Return how the tool's pose and twist change with q, v and p, exact and loops closed, as
        `closure_derivatives`.

        state: one or a stack (...); threads: over which a large stack is dealt, all processors if
        None.

        Raises:
            LinkworkError: as there; no tool.
        """
        return derivatives.tool_derivatives(self, state, threads)

    def _steady(self, name: str, state: State) -> tuple[np.ndarray, ...]:
        """Return what a kernel tells of rates that do not change."""
        found = self.directly(name).at(state, np.zeros(self.mobility))
        return found or evaluation.told(self, name, state, 0 * self.own(state).rates)

    def _tool_motion(self, state: State, accelerations: Any) -> tuple[np.ndarray, ...]:
        self.require_tool()
        if accelerations is None:
            return self._steady("tool_motion", state)
        return evaluation.told(self, "tool_motion", state, accelerations)

    def _led(
        self, state: State, what: Sequence[str] | None, accelerations: Any = None
    ) -> tuple[np.ndarray, ...]:
        return led(self, state, self._task(what), accelerations)

    def _task(self, what: Sequence[str] | None) -> task.Task:
        return task.named(self, what)

    def closure_error(self, state: State) -> np.ndarray:
        """Return the largest loop residual max |phi| (...), redundant rows included: gaps over the
        own length, and rad; nan where a coordinate is."""
        q = self.own(state).q
        gap = np.maximum(self.kernel("closure_step")(q)[1][..., 0], self.chart.unheld_gap(q))
        return gap + 0 * q.sum(axis=-1)

    def limits_passed(self, state: State | Run) -> tuple[str, ...]:
        """Return one sentence for each joint coordinate that lies outside its limits in a state or
        at a run's saved times, and for each rate that is above its own."""
        if isinstance(state, Run):
            return passed_limits(self, state)
        own, fast = self.own(state), self.once(limits.speeds_of)
        return limits.passed(self, own.positions, self.joint_rates(own) if fast else None)
