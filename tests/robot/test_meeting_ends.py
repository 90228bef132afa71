"""A point spring without rest length where its ends meet: it pulls with nothing there, and as ever beside it."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, PointSpring, PrismaticJoint, RevoluteJoint

MASS, STIFFNESS = 2.0, 50.0
SPRING = PointSpring(connects=("ground", "mass"), points=((0, 0, 0), (0, 0, 0)), stiffness=STIFFNESS)


def on_slide(spring):
    return lw.Robot(
        Mechanism(
            gravity=(0, 0, 0),
            bodies={"mass": Body(mass=MASS)},
            joints={"x": PrismaticJoint(connects=("ground", "mass"), axis=(1, 0, 0))},
            springs={"spring": spring},
        )
    )


@pytest.mark.parametrize("x", [0.0, 1e-12, 0.3])
def test_the_acceleration_is_that_of_an_oscillator(x):
    robot = on_slide(SPRING)
    found = robot.forward_dynamics(robot.state([x]), [])
    assert np.allclose(found, -STIFFNESS / MASS * x, rtol=1e-14, atol=0)
    assert np.isclose(robot.energy(robot.state([x]))[1], STIFFNESS * x**2 / 2, rtol=1e-14)


def test_a_run_through_the_point_keeps_the_closed_form():
    robot = on_slide(SPRING)
    time = np.linspace(0, 2, 21)
    run = robot.simulate(robot.state([0.3]), duration=2, save_at=time)
    assert run.success
    expected = 0.3 * np.cos(np.sqrt(STIFFNESS / MASS) * time)
    assert np.abs(run.dataset.joint_position.values[:, 0] - expected).max() < 1e-6


def test_an_arm_whose_tip_is_where_the_spring_is_fixed_only_falls():
    """A crank whose tip is at the spring's other end at home."""
    robot = lw.Robot(
        Mechanism(
            gravity=(0, -9.81, 0),
            bodies={"arm": Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=Inertia(zz=0.1))},
            joints={"hinge": RevoluteJoint(connects=("ground", "arm"), frames=(Frame(), Frame()))},
            springs={
                "spring": SPRING.model_copy(update={"connects": ("ground", "arm"), "points": ((1, 0, 0), (1, 0, 0))})
            },
        )
    )
    assert np.allclose(robot.forward_dynamics(robot.home, []), -9.81 * 0.5 / (0.1 + 0.25), rtol=1e-13)
