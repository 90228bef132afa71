"""What acts in runs acts in C: elastic joints, stops, friction, contacts on a free body."""

import numpy as np
import pytest

import linkwork as lw

from tests.export.compiled import Library

LINK = lw.Body(mass=1.0, centre_of_mass=(0.3, 0.0, 0.0), inertia=lw.Inertia(zz=0.1))
BALL = lw.Body(mass=0.4, inertia=lw.Inertia(xx=1.6e-3, yy=1.6e-3, zz=1.6e-3))


def hinge(**effects) -> lw.Mechanism:
    """Return a link on a hinge with what acts in it."""
    joint = lw.RevoluteJoint(connects=("ground", "link"), **effects)
    return lw.Mechanism(bodies={"link": LINK}, joints={"hinge": joint}, actuators=("hinge",))


def ball() -> lw.Mechanism:
    """Return a ball that rolls and slips on the floor."""
    floor = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
        stiffness=1e4,
        dissipation=0.5,
        friction=lw.Sliding(coefficient=0.2),
    )
    free = lw.FreeJoint(connects=("ground", "ball"))
    parts = {"bodies": {"ball": BALL}, "joints": {"free": free}, "contacts": {"floor": floor}}
    return lw.Mechanism(gravity=(0.0, 0.0, -9.81), reference={"free.z": 0.0996}, **parts)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    "mechanism",
    [
        hinge(elastic={"stiffness": 100.0, "damping": 1.0, "motor_inertia": 0.1}),
        hinge(stop=lw.Stop(stiffness=1e4), limits=lw.Limits(lower=-1.0, upper=0.01)),
        hinge(friction=lw.Friction(viscous=0.1, coulomb=0.3, coulomb_rate=0.01)),
        ball(),
    ],
    ids=["elastic", "stop", "friction", "contact"],
)
def test_steps_are_those_of_runs(mechanism, tmp_path):
    robot = lw.Robot(mechanism)
    own = Library(robot, lw.export.c(robot, ["step"]), tmp_path)
    state, u = robot.state(robot.home.positions, [0.2] * robot.mobility), np.ones(1)
    status, [moving] = own("start", state.q, state.rates)
    assert status == 0
    for _ in range(50):
        assert own("step", u, 0.001, 1e-9, 1e-10, moving)[0] == 0
    given = u if robot.actuators else None
    expected = robot.simulate(state, given, duration=0.05, rtol=1e-10, atol=1e-11).final
    np.testing.assert_allclose(moving.q, expected.q, rtol=1e-7, atol=1e-8)


def test_bearings_rub_in_c_as_they_do_here(tmp_path):
    """The friction that depends on what it changes is a program without a branch, too."""
    bearing = lw.JournalBearing(friction=lw.Sliding(coefficient=0.3, rate=1e-3), radius=0.02)
    robot = lw.Robot(hinge(bearing=bearing))
    own = Library(robot, lw.export.c(robot, ["motion", "inverse_dynamics"]), tmp_path)
    state = robot.home.with_rates([3.0])
    expected = robot.forward_dynamics(state, [0.5])
    _, [_, dv, *_] = own("motion", state.q, state.rates, [0.5])
    np.testing.assert_allclose(dv, expected, rtol=1e-14)
    _, [u, *_] = own("inverse_dynamics", state.q, state.rates, expected)
    np.testing.assert_allclose(u, 0.5, rtol=1e-12)
