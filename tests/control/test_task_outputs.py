"""Controllers see the tool in the coordinates of its task: against the robot's own numbers, and
led there by forces along the task."""

import numpy as np
import pytest

import linkwork as lw

from tests.robot.mixed_freedoms import scara, three_legs


def stated(mechanism, task):
    (name, tool), *_ = mechanism.tools.items()
    return mechanism.model_copy(
        update={"tools": {name: tool.model_copy(update={"task": tuple(task)})}}
    )


LED = {
    "scara": (scara, ("x", "y", "z", "rz")),
    "three legs": (lambda: three_legs("RRS"), ("z", "tilt_x", "tilt_y")),
}


@pytest.mark.parametrize("name", LED)
def test_a_controller_reads_the_task(name):
    made, task = LED[name]
    robot = lw.Robot(stated(made(), task))
    aside = np.linspace(0.02, -0.03, len(task))
    state = robot.assemble(tool=robot.task_values(robot.home) + aside)
    state = state.with_rates(np.linspace(0.3, -0.2, robot.mobility))
    seen = robot.observe(state)
    np.testing.assert_allclose(seen.task, robot.task_values(state), atol=1e-13)
    np.testing.assert_allclose(seen.task_rates, robot.task_rates(state), atol=1e-13)
    driven = [float(seen.rate(label)) for label in robot.actuators]
    np.testing.assert_allclose(seen.task_jacobian @ driven, seen.task_rates, atol=1e-12)


@pytest.mark.parametrize("name", LED)
def test_forces_along_the_task_lead_the_tool_to_a_pose_in_it(name):
    """u = J' (kp e - kd x') + g, the weight at the goal: there it comes to rest."""
    made, task = LED[name]
    robot = lw.Robot(stated(made(), task))
    goal = robot.task_values(robot.home) + np.linspace(0.03, -0.02, len(task))

    def law(t, state):
        force = 400 * (goal - state.task) - 60 * state.task_rates
        return state.task_jacobian.T @ force + weight

    end = robot.assemble(tool=goal)
    weight = robot.holding_forces(end)
    run = robot.simulate(robot.home, law, duration=4.0)
    np.testing.assert_allclose(robot.task_values(run.final), goal, atol=2e-3)


def test_what_is_not_told_is_refused():
    robot = lw.Robot(scara())
    with pytest.raises(lw.LinkworkError, match="the tool states no task; state one in its"):
        _ = robot.observe(robot.home).task
    idle = stated(scara(), ("x", "y", "z", "rz")).model_copy(update={"actuators": ("lift",)})
    robot = lw.Robot(idle)
    with pytest.raises(
        lw.LinkworkError, match="1 actuator and a mobility of 4: the actuated rates"
    ):
        _ = robot.observe(robot.home).task_jacobian
