"""Robots and one small comparison that the tests of the views share."""

from math import pi

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism import (
    Body,
    CylindricalJoint,
    FixedJoint,
    Frame,
    FreeJoint,
    GearJoint,
    Inertia,
    Mechanism,
    PlanarJoint,
    PointSpring,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    SphericalJoint,
    Tool,
    UniversalJoint,
)

from tests.catalogue import built


@pytest.fixture(scope="session")
def robot():
    return built("prr3")


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
                "elbow": RevoluteJoint(
                    connects=("upper", "lower"), frames=(Frame.planar(0.4), Frame())
                ),
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
                    connects=("plate", "left"),
                    frames=(Frame(position=(0, 0.3, 0.2)), Frame()),
                    **flap,
                ),
                "wing_2": RevoluteJoint(
                    connects=("plate", "right"),
                    frames=(Frame(position=(0.3, -0.3, 0.2)), Frame()),
                    **flap,
                ),
            },
            actuators=("turn", "wing_1", "wing_2"),
            tools={
                "tip": Tool(body="left", frame=Frame(position=(0, 0.2, 0), rotation=(0, 0, pi / 2)))
            },
        )
    )


@pytest.fixture(scope="session")
def zoo():
    """Return a mechanism with every joint type, a gear and a spring to ground, its joints named by
    their types."""
    body = Body(mass=1.0, inertia=Inertia(xx=0.02, yy=0.02, zz=0.02))
    chain = {
        "screw": ScrewJoint(connects=("ground", "a"), pitch=0.05),
        "cylindrical": CylindricalJoint(connects=("a", "b"), frames=at(0, 0, 0.3), axis=(1, 0, 0)),
        "universal": UniversalJoint(connects=("b", "c"), frames=at(0.3, 0, 0)),
        "spherical": SphericalJoint(connects=("c", "d"), frames=at(0, 0, 0.3)),
        "planar": PlanarJoint(connects=("d", "e"), frames=at(0.3, 0, 0)),
        "fixed": FixedJoint(connects=("e", "f"), frames=at(0, 0.3, 0)),
        "revolute": RevoluteJoint(connects=("f", "g"), frames=at(0, 0.3, 0), axis=(1, 1, 0)),
        "prismatic": PrismaticJoint(connects=("g", "h"), frames=at(0, 0, -0.2), axis=(1, 0, 0)),
        "rod": RodJoint(connects=("ground", "h"), frames=at(1.0, 0.6, 0), length=0.9),
    }
    moving = {
        "free": FreeJoint(connects=("ground", "i")),
        "gear": GearJoint(ratios={"screw": 1.0, "revolute": -2.0}),
    }
    return lw.Robot(
        Mechanism(
            name="zoo",
            bodies=dict.fromkeys("abcdefghi", body),
            joints=chain | moving,
            springs={
                "coil": PointSpring(
                    connects=("ground", "c"), points=((0.6, 0, 0), (0, 0, 0)), stiffness=10
                )
            },
            actuators=("universal.angle_1", "prismatic"),
            reference={
                "screw": 1.0,
                "cylindrical.slide": 0.1,
                "universal.angle_1": 0.3,
                "planar.x": 0.1,
                "revolute": 0.5,
                "prismatic": 0.2,
                "free.x": 0.5,
                "free.y": -0.2,
            },
        )
    )


def at(x, y, z):
    """Return the frames of a joint that stands at a point of its first body."""
    return (Frame(position=(x, y, z)), Frame())


@pytest.fixture(scope="session")
def flat():
    """Return a planar mechanism with the joints that only some planar mechanisms have."""
    body = Body(mass=1.0, inertia=Inertia(zz=0.02))
    return lw.Robot(
        Mechanism(
            name="flat",
            gravity=(0, -9.81, 0),
            bodies=dict.fromkeys("abcd", body),
            joints={
                "planar": PlanarJoint(connects=("ground", "a")),
                "revolute": RevoluteJoint(connects=("a", "b"), frames=at(0.3, 0, 0)),
                "elbow": RevoluteJoint(connects=("b", "c"), frames=at(0.3, 0, 0)),
                "fixed": FixedJoint(connects=("c", "d"), frames=at(0, 0.3, 0)),
                "rod": RodJoint(
                    connects=("ground", "d"),
                    frames=(Frame.planar(0.6, -0.2), Frame.planar(0.2)),
                    length=0.6,
                ),
                "gear": GearJoint(ratios={"revolute": 1.0, "elbow": 1.0}, offset=0.5),
            },
            springs={
                "coil": PointSpring(
                    connects=("ground", "d"), points=((0.2, 0.6, 0), (0, 0, 0)), stiffness=10
                )
            },
            actuators=("revolute",),
            reference={"revolute": 0.5, "planar.y": -0.1},
        )
    )


@pytest.fixture(scope="session")
def run(robot):
    return robot.simulate(
        robot.home, [1.0, 0.0, -1.0], duration=0.2, save_at=np.linspace(0, 0.2, 21)
    )
