"""Mechanisms with closed-form motion, and states of robots to test controllers on."""

from __future__ import annotations

import numpy as np

import linkwork as lw

ALONG_X = (1.0, 0.0, 0.0)


def cart(mass: float = 2.0) -> lw.Robot:
    """Return a mass on a horizontal slide: m x'' = u."""
    body = lw.Body(mass=mass, inertia=lw.Inertia(zz=1.0))
    slide = lw.PrismaticJoint(connects=("ground", "cart"), axis=ALONG_X)
    return lw.Robot(
        lw.Mechanism(
            name="cart",
            bodies={"cart": body},
            joints={"slide": slide},
            actuators=("slide",),
            tools={"hook": lw.Tool(body="cart", frame=lw.Frame(position=(0.1, 0.0, 0.0)))},
        )
    )


def pendulum(mass: float = 1.5, length: float = 0.7) -> lw.Robot:
    """Return a point mass on a massless rod, from the x axis: m l^2 q'' = u - m g l cos q."""
    return lw.Robot(lw.robots.pendulum((length,), (mass,)))


def circle_motion(robot: lw.Robot, radius: float = 0.05) -> lw.Motion:
    """Return a motion of the 3-PRR robot around its middle in one second."""
    return robot.follow(lw.paths.circle((0.5, np.sqrt(3) / 6), radius, np.pi / 6), 1.0)
