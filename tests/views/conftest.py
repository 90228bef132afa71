"""Robots and one small comparison that the tests of the views share."""

from math import pi

import numpy as np
import pytest

import linkwork as lw
from linkwork import engines
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint, Tool
from linkwork.views import reproduction
from linkwork.views.comparison import compare


@pytest.fixture(scope="session")
def robot():
    return lw.Robot(lw.robots.prr3())


@pytest.fixture(scope="session")
def comparison(robot):
    """Return the paper's study with 501 samples of force and engine steps of 1 ms, by all engines that are installed."""
    asked = [name for name in reproduction.ORDER if name in engines.available()]
    return compare(robot, reproduction.prescribed_motion(robot, samples=1001), asked, step=1e-3)


@pytest.fixture(scope="session")
def arm():
    """Return two links in a vertical plane: no loops, driven by torques."""
    link = Body(mass=1.5, centre_of_mass=(0.2, 0, 0), inertia=Inertia(zz=0.02))
    return lw.Robot(
        Mechanism(
            name="arm <2R>",
            gravity=(0, -9.81, 0),
            bodies={"upper": link, "lower": link},
            joints={
                "shoulder": RevoluteJoint(connects=("ground", "upper")),
                "elbow": RevoluteJoint(connects=("upper", "lower"), frames=(Frame.planar(0.4), Frame())),
            },
            actuators=("shoulder", "elbow"),
            tools={"hand": Tool(body="lower", frame=Frame.planar(0.4))},
            reference={"shoulder": 0.3, "elbow": 1.2},
        )
    )


@pytest.fixture(scope="session")
def spatial():
    """Return a chain of three bodies in space, with a plate that carries three joints."""
    solid = Body(mass=1.0, inertia=Inertia(xx=0.02, yy=0.02, zz=0.02))
    flap = {"axis": (1, 0, 0)}
    return lw.Robot(
        Mechanism(
            bodies={"plate": solid, "left": solid, "right": solid},
            joints={
                "turn": RevoluteJoint(connects=("ground", "plate")),
                "wing_1": RevoluteJoint(
                    connects=("plate", "left"), frames=(Frame(position=(0, 0.3, 0.2)), Frame()), **flap
                ),
                "wing_2": RevoluteJoint(
                    connects=("plate", "right"), frames=(Frame(position=(0.3, -0.3, 0.2)), Frame()), **flap
                ),
            },
            actuators=("turn", "wing_1", "wing_2"),
            tools={"tip": Tool(body="left", frame=Frame(position=(0, 0.2, 0), rotation=(0, 0, pi / 2)))},
        )
    )


@pytest.fixture(scope="session")
def run(robot):
    return robot.simulate(robot.home, [1.0, 0.0, -1.0], duration=0.2, save_at=np.linspace(0, 0.2, 21))
