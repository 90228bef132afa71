"""Other branches of a pose: all configurations with the actuated joints, or the tool, where they
are."""

from __future__ import annotations

import numpy as np

from linkwork.robot import Robot, State

STARTS = 20_000


def branches(robot: Robot, state: State, same: str) -> tuple[list[State], int]:
    """Find the configurations with the same "actuators" (assembly modes) or the same "tool"
    (working modes).

    Returns:
        The configurations, among them the present one, and its index.

    Raises:
        LinkworkError: the actuators, or the tool, do not determine the configuration.
    """
    from linkwork.analysis._assembly_modes import actuated, assembly_modes, working_modes

    if same == "actuators":
        modes = assembly_modes(
            robot, {name: float(state[name]) for name in actuated(robot)}, starts=STARTS
        )
    else:
        modes = working_modes(robot, robot.task_values(state), what=robot.task, starts=STARTS)
    found = [modes.states.at(k) for k in range(len(modes))]
    distances = [float(np.abs(other.q - state.q).max()) for other in found]
    if not found:
        return [state], 0
    nearest = int(np.argmin(distances))
    found[nearest] = state
    return found, nearest
