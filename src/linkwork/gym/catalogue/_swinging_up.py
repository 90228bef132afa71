"""Swinging up: a hanging five-bar swings its tip up with motors too weak to lift it."""

from __future__ import annotations

from functools import cache

import numpy as np

from linkwork import math
from linkwork.gym.process import DecisionProcess
from linkwork.robot import Robot, State
from linkwork.robots import five_bar

BASE, DISTAL = 0.3, 0.35  # [m]
TORQUE = 0.6  # [N m] for an action of one
SPREAD = 0.2  # [rad] of the cranks about hanging down where episodes begin
BEGINNINGS = 64


def hanging(robot: Robot) -> State:
    """Return the state at rest with both cranks down and the tip below: the distal links lean
    towards each other at the angle a, cos a = BASE / (2 DISTAL)."""
    a = np.arccos(BASE / (2 * DISTAL))
    joints = {
        "motor_1": -np.pi / 2,
        "motor_2": -np.pi / 2,
        "elbow_1": np.pi / 2 - a,
        "elbow_2": a - np.pi / 2,
        "tip": 2 * a - np.pi,
    }
    return robot.state([joints[name] for name in robot.coordinates])


@cache
def swinging_up() -> DecisionProcess:
    """Return the process of swinging up.

    The five-bar stands upright, with gravity along -y. Action: torques of both motors over 0.6 N m,
    half of what it takes to hold the cranks level. Observation (10): sines and cosines of both
    cranks, their rates, the tip's place and velocity [rad/s, m, m/s]. With the tip's height y
    and the height y_up of the tip above both upright cranks

        r = (1 + y / y_up) / 2 - 0.001 (w_1^2 + w_2^2) - 0.01 |a|^2

    Episodes begin at rest with the cranks within 0.2 rad of hanging down; one has 250 steps of
    20 ms, each four of the integrator. The mechanism passes actuator-singular poses on its way; an
    episode that comes to where branches of motion meet is truncated.
    """
    robot = Robot(five_bar(BASE, distal=DISTAL, gravity=(0.0, -9.81, 0.0)))
    names = robot.actuators
    down = hanging(robot)
    top = -float(robot.tool_pose(down)[1])
    turns = np.random.default_rng(0).uniform(-SPREAD, SPREAD, (BEGINNINGS, len(names)))
    given = {name: turns[:, i] - np.pi / 2 for i, name in enumerate(names)}
    starts = robot.assemble(given, guess=down)

    def rates(state):
        return math.array([state.rate(name) for name in names])

    def observation(t, state):
        angles = math.array([state[name] for name in names])
        place, velocity = state.tool_pose[:2], state.tool_velocity[:2]
        return [*math.sin(angles), *math.cos(angles), *rates(state), *place, *velocity]

    def reward(t, state, action):
        w = rates(state)
        height = (1 + state.tool_pose[1] / top) / 2
        return height - 0.001 * math.dot(w, w) - 0.01 * math.dot(action, action)

    return DecisionProcess(
        robot,
        dt=0.02,
        low=[-1.0] * 2,
        high=[1.0] * 2,
        forces=lambda t, state, action: TORQUE * action,
        observation=observation,
        reward=reward,
        starts=starts,
        horizon=250,
        substeps=4,
    )
