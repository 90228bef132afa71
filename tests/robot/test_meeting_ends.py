"""A point spring whose ends meet: without rest length it pulls with nothing there, else its force
has no direction."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.mechanism import (
    Body,
    Frame,
    Inertia,
    Mechanism,
    PointSpring,
    PrismaticJoint,
    RevoluteJoint,
)

MASS, STIFFNESS = 2.0, 50.0
SPRING = PointSpring(
    connects=("ground", "mass"), points=((0, 0, 0), (0, 0, 0)), stiffness=STIFFNESS
)


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
    assert np.abs(run["joint_position"].values[:, 0] - expected).max() < 1e-6


def test_an_arm_whose_tip_is_where_the_spring_is_fixed_only_falls():
    """A crank whose tip is at the spring's other end at home."""
    robot = lw.Robot(
        Mechanism(
            gravity=(0, -9.81, 0),
            bodies={"arm": Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=Inertia(zz=0.1))},
            joints={"hinge": RevoluteJoint(connects=("ground", "arm"), frames=(Frame(), Frame()))},
            springs={
                "spring": SPRING.model_copy(
                    update={"connects": ("ground", "arm"), "points": ((1, 0, 0), (1, 0, 0))}
                )
            },
        )
    )
    assert np.allclose(
        robot.forward_dynamics(robot.home, []), -9.81 * 0.5 / (0.1 + 0.25), rtol=1e-13
    )


DIRECTED = {"rest length": {"rest_length": 0.1}, "damping": {"damping": 2.0}}


@pytest.mark.parametrize("of", DIRECTED)
def test_a_spring_that_has_no_direction_there_is_named(of):
    robot = on_slide(SPRING.model_copy(update=DIRECTED[of]))
    still = robot.state([0.0], [0.3])
    asked = [
        lambda: robot.forward_dynamics(still, []),
        lambda: robot.inverse_dynamics(still, [0.0]),
        lambda: robot.forward_dynamics(robot.state([[0.2], [0.0]]), []),
        lambda: analysis.linearise(robot, still),
    ]
    for ask in asked:
        with pytest.raises(lw.LinkworkError, match="the ends of the spring 'spring' meet here"):
            ask()
    rest_length = robot.mechanism.springs["spring"].rest_length
    assert np.isclose(sum(robot.energy(still)), MASS * 0.3**2 / 2 + STIFFNESS * rest_length**2 / 2)
    run = robot.simulate(still, duration=0.1)
    assert (
        "the force of the spring 'spring', whose ends meet, is infinite or undefined from here on"
        in run.message
    )


@pytest.mark.parametrize("x", [-1e-9, 1e-9, 0.3])
def test_beside_it_the_spring_pulls_and_damps_along_its_ends(x):
    robot = on_slide(SPRING.model_copy(update={"rest_length": 0.1, "damping": 2.0}))
    found = robot.forward_dynamics(robot.state([x], [0.7]), [])
    assert np.allclose(
        found, -(STIFFNESS * (abs(x) - 0.1) * np.sign(x) + 2.0 * 0.7) / MASS, rtol=1e-13
    )


def test_a_mass_that_is_drawn_through_the_other_end_keeps_its_energy():
    """V = k (|x| - l_0)^2 / 2 has a kink at 0, where the speed is that of the energy."""
    robot = on_slide(SPRING.model_copy(update={"rest_length": 0.1}))
    run = robot.simulate(robot.state([0.3]), duration=2, save_at=np.linspace(0, 2, 41))
    x, v = run["joint_position"].values[:, 0], run["joint_rate"].values[:, 0]
    assert run.success and x.min() < -0.29
    energy = MASS * v**2 / 2 + STIFFNESS * (abs(x) - 0.1) ** 2 / 2
    assert np.abs(energy - STIFFNESS * 0.2**2 / 2).max() < 1e-5


def test_numbers_that_leave_the_range_are_not_put_down_to_the_inertia():
    robot = lw.Robot(lw.robots.four_bar())
    with pytest.raises(lw.LinkworkError, match="leave the range of doubles"):
        robot.inverse_dynamics(robot.home.with_rates([1e200]), [0.0])
