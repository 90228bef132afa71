"""Reaching: the planar 3-PRR moves its platform to a pose that is drawn for each episode."""

from __future__ import annotations

from functools import cache

from linkwork import math
from linkwork.gym.process import DecisionProcess
from linkwork.robot import Robot
from linkwork.robots import prr3

FORCE = 4.0  # [N] for an action of one
NEAR = 0.02  # error at which the reward is half [m]
ARM = 0.1  # [m] that an angle counts by
GOAL = {"goal_x": (-0.03, 0.03), "goal_y": (-0.03, 0.03), "goal_angle": (-0.15, 0.04)}
ASTRAY, TURNED = 0.09, (-0.25, 0.1)  # where an episode is over [m, rad]


@cache
def reaching() -> DecisionProcess:
    """Return the process of reaching.

    Action: forces of the three sliders over 4 N. Observation (12): the goal less the platform's
    pose (x, y, angle) [m, rad], the platform's velocity [m/s, rad/s], its pose less that at home,
    and how far the sliders are from home [m]. With the error e = sqrt(dx^2 + dy^2 +
    (0.1 m dangle)^2)

        r = 1 / (1 + (e / 0.02 m)^2) - 0.01 |a|^2

    An episode begins at home, and has 100 steps of 20 ms. It is over where the platform is more
    than 9 cm away from home along x or y, or turned by less than -0.25 or more than 0.1 rad:
    beyond lie actuator-singular poses.
    """
    # Poses are counted from home.
    robot = Robot(prr3())
    home = {name: float(robot.home[name]) for name in robot.actuators}
    centre = robot.tool_pose(robot.home)

    def moved(state):
        return state.tool_pose - centre

    def error(state):
        goal = [state.parameter(name, 0.0) for name in GOAL]
        return math.array(goal) - moved(state)

    # What is seen, rewarded, and the end.
    def observation(t, state):
        slid = [state[name] - at for name, at in home.items()]
        return [*error(state), *state.tool_velocity, *moved(state), *slid]

    def reward(t, state, action):
        dx, dy, turn = error(state)
        squared = dx**2 + dy**2 + (ARM * turn) ** 2
        return 1 / (1 + squared / NEAR**2) - 0.01 * math.dot(action, action)

    def terminated(t, state):
        x, y, angle = moved(state)
        low, high = TURNED
        aside = math.maximum(math.abs(x), math.abs(y)) / ASTRAY
        turned = math.maximum(angle / high, angle / low)
        return math.maximum(aside, turned) > 1

    return DecisionProcess(
        robot,
        dt=0.02,
        low=[-1.0] * 3,
        high=[1.0] * 3,
        forces=lambda t, state, action: FORCE * action,
        observation=observation,
        reward=reward,
        terminated=terminated,
        draws=GOAL,
        horizon=100,
    )
