"""Linkages drawn in a line: the start is singular, so that home is bent out of it, or told to be
given."""

import itertools
import warnings

import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, MechanismError, RevoluteJoint

LINK = Body(mass=1.0, inertia=Inertia(zz=0.1))


def hinge(first, second, at_first=0.0, at_second=0.0):
    return RevoluteJoint(
        connects=(first, second),
        frames=(Frame(position=(at_first, 0, 0)), Frame(position=(at_second, 0, 0))),
    )


def linkage(lengths, base, order=None, reference=None):
    """A chain of links in the plane between two pivots at the distance `base`, its last link named
    from the far pivot."""
    bodies = [f"link_{k}" for k in range(len(lengths))]
    joints = {"h0": hinge("ground", bodies[0])}
    for k in range(len(lengths) - 2):
        joints[f"h{k + 1}"] = hinge(bodies[k], bodies[k + 1], lengths[k])
    joints["far"] = hinge("ground", bodies[-1], base)
    joints["loop"] = hinge(bodies[-2], bodies[-1], lengths[-2], lengths[-1])
    order = order or list(joints)
    return Mechanism(
        bodies=dict.fromkeys(bodies, LINK),
        joints={name: joints[name] for name in order},
        actuators=("h0",),
        reference=reference or {},
    )


FLAT = {
    "parallelogram": linkage([0.5, 1.0, 0.5], 1.0),
    "four-bar, crank and coupler in a line": linkage([0.4, 0.6, 0.3], 0.7, reference={"far": 0.0}),
    "four-bar that does not close in the line": linkage([0.4, 0.9, 0.6], 1.0),
    "six links that do not close in the line": linkage([0.4, 0.5, 0.5, 0.4, 0.5], 1.0),
}
MOBILITY = {4: 1, 6: 3}


@pytest.mark.parametrize("name", FLAT)
def test_a_linkage_drawn_in_a_line_moves_with_its_mobility_and_closes(name):
    mechanism = FLAT[name]
    robot = lw.Robot(mechanism)
    assert robot.mobility == MOBILITY[len(mechanism.joints)]
    turned = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    assert ends_apart(mechanism, turned) < 1e-11
    acceleration = robot.forward_dynamics(robot.home, [1.0])
    assert np.isfinite(acceleration).all() and np.abs(acceleration).max() < 1e3


def ends_apart(mechanism, turned):
    """The gap of the loop, from the angles alone."""
    *chain, _, loop = list(mechanism.joints.values())
    point, angle = np.zeros(2), 0.0
    for name, link in zip(mechanism.joints, [*chain, loop][1:], strict=False):
        angle += turned[name]
        point = point + link.frames[0].position[0] * np.array([np.cos(angle), np.sin(angle)])
    far, length = mechanism.joints["far"].frames[0].position[0], loop.frames[1].position[0]
    other = np.array([far, 0.0]) + length * np.array([np.cos(turned["far"]), np.sin(turned["far"])])
    return np.linalg.norm(point - other)


def test_what_was_bent_is_told():
    (note,) = lw.Robot(FLAT["parallelogram"]).notes
    assert (
        "branches of motion meet at the given reference" in note and "home is bent to h0 = " in note
    )
    assert lw.Robot(lw.robots.four_bar()).notes == ()


@pytest.mark.parametrize("order", list(itertools.permutations(["h0", "h1", "far", "loop"]))[::4])
def test_any_order_of_the_joints_will_do(order):
    robot = lw.Robot(linkage([0.5, 1.0, 0.5], 1.0, order))
    assert robot.mobility == 1
    assert np.isfinite(robot.forward_dynamics(robot.home, [1.0])).all()


def test_a_linkage_that_cannot_close_is_still_refused():
    with pytest.raises(MechanismError, match="the loops do not close near the reference"):
        lw.Robot(linkage([0.2, 0.3, 0.3], 1.0))


@pytest.mark.parametrize("turned", [1e13, 1e15])
def test_an_angle_of_which_no_digits_are_left_is_refused(turned):
    mechanism = lw.robots.four_bar()
    with pytest.raises(
        MechanismError,
        match=r"'crank_pivot' is 1e.1., which a computer keeps to .* only, so that no loop",
    ):
        lw.Robot(mechanism.with_reference({"crank_pivot": turned}))


@pytest.mark.parametrize("lengths", [[0.3, 1.0, 0.3], [0.5, 1.0, 0.5], [0.3, 0.7, 0.6]])
def test_home_does_not_end_a_millionth_beside_where_branches_meet(lengths):
    """With a crank folded back all links lie in a line, where Newton's method ends short: the
    number of rates that the loops leave there is two."""
    base = lengths[1] + lengths[2] - lengths[0]
    with pytest.warns(ModelWarning, match="branches of motion meet"):
        robot = lw.Robot(linkage(lengths, base, reference={"h0": np.pi}))
    angles = np.cumsum([robot.home["h0"], robot.home["h1"]])
    aside = abs(np.sin(angles[0] - angles[1]))
    assert robot.mobility == 1 and aside > 0.01


@pytest.mark.sample(3)
@pytest.mark.parametrize("base", [1.8, 1.8 + 1e-15, 1.8 - 1e-15, 1.75])
def test_links_just_long_enough_to_meet_are_warned_of_for_they_do_not_move(base):
    lengths = [0.3, 0.9, 0.6] if base != 1.75 else [0.25, 1.0, 0.5]
    with pytest.warns(ModelWarning, match="the loops close at one configuration alone"):
        lw.Robot(linkage(lengths, base))
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        lw.Robot(linkage(lengths, base - 1e-6))
