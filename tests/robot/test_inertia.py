"""Motions that move so little mass that rounding hides it: refused, while light bodies whose motion
is told are not."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.mechanism.refusal import MechanismError

ROD = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=1 / 12))


def chain(*hinges):
    """Return a robot of bodies hinged one to the next, each at x on the one before."""
    bodies, joints, last = {}, {}, "ground"
    for k, (x, body) in enumerate(hinges):
        frames = (lw.Frame.planar(x), lw.Frame())
        bodies[f"body_{k}"] = body
        joints[f"hinge_{k}"] = lw.RevoluteJoint(connects=(last, f"body_{k}"), frames=frames)
        last = f"body_{k}"
    return lw.Robot(
        lw.Mechanism(bodies=bodies, joints=joints, actuators=("hinge_0",), gravity=(0, -9.81, 0))
    )


def massless(*apart):
    """Return a rod on bodies without mass, whose hinges lie a little apart."""
    none = lw.Body(mass=0.0)
    return chain((0.0, none), *((x, none) for x in apart[:-1]), (apart[-1], ROD))


@pytest.mark.parametrize(
    "apart", [(0.0,), (1e-17,), (1e-15,), (1e-9,), (1e-9, 1e-9), (1e-9, 1e-9, 1e-9, 1e-9)]
)
def test_massless_bodies_on_nearly_one_axis_are_refused(apart):
    robot = massless(*apart)
    still = robot.state(np.linspace(0.1, 0.9, robot.mobility))
    with pytest.raises(lw.LinkworkError, match="generalised inertia is singular"):
        robot.forward_dynamics(still, [0.0])
    with pytest.raises(lw.LinkworkError, match="generalised inertia is singular"):
        analysis.linearise(robot, still)
    run = robot.simulate(still, [0.0], duration=0.1)
    named = (
        "the acceleration, for the generalised inertia is singular (some motion moves no mass), "
        "is infinite or undefined"
    )
    assert not run.success and named in run.message and run.coords["time"].values[-1] == 0


def test_a_light_body_under_a_heavy_one_on_one_axis_is_refused_and_a_heavier_one_is_not():
    """Rods on one axis: with the absolute angle a + b of the upper one, I_1 a'' = -G_1 + G_2 - G_2
    = u - G_1."""
    rods = {
        m: lw.Body(mass=m, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=m / 12))
        for m in (1e-20, 1e-9)
    }
    heavier = chain((0.0, rods[1e-9]), (0.0, ROD))
    found = heavier.forward_dynamics(heavier.state([0.3, 0.5]), [0.0])
    alone = [-1.5 * 9.81 * np.cos(angle) for angle in (0.3, 0.8)]
    assert np.allclose(found, [alone[0], alone[1] - alone[0]], rtol=1e-5)
    lighter = chain((0.0, rods[1e-20]), (0.0, ROD))
    with pytest.raises(lw.LinkworkError, match="generalised inertia is singular"):
        lighter.forward_dynamics(lighter.state([0.3, 0.5]), [0.0])


@pytest.mark.parametrize("count", [1, 4])
def test_a_body_of_no_account_at_the_end_of_a_chain_moves_as_the_chain_leads_it(count):
    """A point of mass m -> 0 at r on the last rod's tip: its absolute angle c obeys r c'' = n .
    (g - a of the tip)."""
    point = lw.Body(mass=1e-20, centre_of_mass=(0.5, 0, 0))
    robot, bare = (
        chain(*((float(k > 0), ROD) for k in range(count)), *end) for end in ([(1.0, point)], [])
    )
    angles = np.linspace(0.3, 0.7, count + 1)
    found = robot.forward_dynamics(robot.state(angles), [0.0])
    expected = bare.forward_dynamics(bare.state(angles[:count]), [0.0])
    assert np.allclose(found[:count], expected, rtol=1e-9)
    absolute, c = np.cumsum(angles[:count]), angles.sum()
    turns = np.cumsum(expected)
    tip = np.sum(turns * [-np.sin(absolute), np.cos(absolute)], axis=1)
    relative = np.array([0, -9.81]) - tip
    assert np.cumsum(found)[-1] == pytest.approx(relative @ [-np.sin(c), np.cos(c)] / 0.5, rel=1e-9)


@pytest.mark.parametrize(
    "make",
    [
        lambda: lw.Body(mass=1e-320),
        lambda: lw.Body(mass=1.0, centre_of_mass=(0, -1e-310, 0)),
        lambda: lw.Inertia(zz=1e-315),
        lambda: lw.Spring(stiffness=5e-324),
    ],
)
def test_numbers_without_all_their_digits_are_refused(make):
    with pytest.raises(
        MechanismError, match="nearer to zero than any number that a computer holds in full"
    ):
        make()
    assert lw.Body(mass=2.3e-308).mass == 2.3e-308
