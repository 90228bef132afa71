"""Balancing: the Stewart platform keeps a ball in the middle of its disc."""

from __future__ import annotations

from functools import cache

import numpy as np

from linkwork import math
from linkwork.control.drives import Extra
from linkwork.gym.process import DecisionProcess
from linkwork.gym.rolling import RollingBall
from linkwork.robot import Robot
from linkwork.robots import stewart

STROKE = 0.05  # [m] of a leg for an action of one
BANDWIDTH = 5.0  # [rad/s] with which targets of the legs follow actions
STIFFNESS, DAMPING = 1e5, 1e4  # of a leg's servo [N/m, N s/m]
RIM = 0.9  # [m] from the middle, where the ball is lost
NEAR = 0.2  # [m] at which the reward is half
DISC = 0.05  # thickness of the platform's disc [m]
STARTS = {"ball.x": (-0.5, 0.5), "ball.y": (-0.5, 0.5)}


@cache
def balancing() -> DecisionProcess:
    """Return the process of balancing.

    Action: a of the six legs. The target s of a leg's stretch follows it with w = 5 rad/s, and a
    servo follows the target, with the force u_0 that bears the platform at home:

        s'' = w^2 (0.05 m a - s) - 2 w s'
        u = u_0 + 1e5 N/m (s - (l - l_0)) + 1e4 N s/m (s' - l')

    Observation (16): the ball's place in the platform's axes and its velocity relative to it
    [m, m/s], lengths of the legs less those at home and their rates [m, m/s]. The ball, of a radius
    of 5 cm, rolls without slipping and is light beside the platform of 1.2 t (`RollingBall`); the
    targets are slow enough that it never leaves it. With its distance d from the middle

        r = 1 / (1 + (d / 0.2 m)^2) - 0.01 |a|^2

    An episode is over where d > 0.9 m; it has 250 steps of 20 ms, each two of the integrator.
    """
    # The platform, borne at home, and the ball on its disc.
    description = stewart(platform_thickness=DISC)
    robot = Robot(description)
    bearing = robot.holding_forces(robot.home)
    home = np.array([float(robot.home[name]) for name in robot.actuators])
    (body,) = {tool.body for tool in description.tools.values()}
    x, y, z = description.gravity
    ball = RollingBall(body, height=DISC / 2, radius=0.05, gravity=(x, y, z))

    targets = [Extra(f"{name}.target", "m", 0.0) for name in robot.actuators]
    targets += [Extra(f"{name}.speed", "m/s", 0.0) for name in robot.actuators]

    # What servos follow, and what is measured of the legs.
    def stretched(state):
        return math.array([state[name] for name in robot.actuators]) - home

    def speeds(state):
        return math.array([state.rate(name) for name in robot.actuators])

    def target(state):
        parts = [f"{name}.{part}" for part in ("target", "speed") for name in robot.actuators]
        return np.split(math.array([state.extra(part) for part in parts]), 2)

    def rates(t, state, action):
        at, speed = target(state)
        faster = BANDWIDTH**2 * (STROKE * action - at) - 2 * BANDWIDTH * speed
        return [*ball.rates(state), *speed, *faster]

    def forces(t, state, action):
        at, speed = target(state)
        servo = STIFFNESS * (at - stretched(state)) + DAMPING * (speed - speeds(state))
        return bearing + servo

    # What is seen, rewarded, and the end.
    def observation(t, state):
        moving = ball.velocity(state)
        return [*ball.place(state), *moving, *stretched(state), *speeds(state)]

    def reward(t, state, action):
        x, y = ball.place(state)
        return 1 / (1 + (x**2 + y**2) / NEAR**2) - 0.01 * math.dot(action, action)

    def terminated(t, state):
        x, y = ball.place(state)
        return x**2 + y**2 > RIM**2

    return DecisionProcess(
        robot,
        dt=0.02,
        low=[-1.0] * 6,
        high=[1.0] * 6,
        forces=forces,
        observation=observation,
        reward=reward,
        terminated=terminated,
        states=(*ball.states, *targets),
        rates=rates,
        draws=STARTS,
        horizon=250,
        substeps=2,
    )
