"""Spins and idle freedoms: found where they are, and nowhere else."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import assembly_modes, working_modes
from linkwork.equations.spins import motions

BAR = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(xx=0.01, yy=0.1, zz=0.1))
ROD = "rod: spin about the line through pin and wrist"


def robot(bodies, joints, *actuators, **more):
    return lw.Robot(
        lw.Mechanism(bodies=dict.fromkeys(bodies, BAR), joints=joints, actuators=actuators, **more)
    )


def crank_and_rod(*actuators, springs=None, **pin):
    """Return a slider-crank in space whose rod has a ball joint at both ends; its reference is at
    dead centre."""
    on_crank, at_end = lw.Frame.planar(0.2), lw.Frame.planar(0.5)
    joints = {
        "pivot": lw.RevoluteJoint(connects=("ground", "crank")),
        "pin": lw.SphericalJoint(connects=("crank", "rod"), frames=(on_crank, lw.Frame()), **pin),
        "wrist": lw.SphericalJoint(connects=("rod", "slider"), frames=(at_end, lw.Frame())),
        "slide": lw.PrismaticJoint(connects=("ground", "slider"), axis=(1, 0, 0)),
    }
    actuators = actuators or ("pivot",)
    return robot(
        ("crank", "rod", "slider"),
        joints,
        *actuators,
        reference={"slide": 0.7},
        springs=springs or {},
    )


def test_a_rod_between_balls_spins_at_dead_centre_as_elsewhere():
    found = crank_and_rod()
    assert found.mobility == 2 and found.spins == found.idle == (ROD,)
    assert len(assembly_modes(found)) == 2


def test_linkages_that_nothing_ties_are_looked_at_side_by_side():
    """Two motions of each, in two columns: the rates of all in one are as long as what is tied."""
    one, joints = crank_and_rod().mechanism, {}
    for k in range(3):
        for name, joint in one.pairs.items():
            ends = tuple(body if body == "ground" else f"{body}_{k}" for body in joint.connects)
            joints[f"{name}_{k}"] = joint.model_copy(update={"connects": ends})
    bodies = [f"{body}_{k}" for k in range(3) for body in one.bodies]
    found = robot(bodies, joints, reference={f"slide_{k}": 0.7 for k in range(3)})
    named = {f"rod_{k}: spin about the line through pin_{k} and wrist_{k}" for k in range(3)}
    assert {*found.spins} == {*found.idle} == named and found.mobility == 6
    rows = found.equations.rows
    Phi = np.array(found.equations.tree.evaluated("Phi", [rows.Phi])(found.home.q)[0])
    free = motions(found.equations.tree, Phi, bodies)
    assert free.rates.shape == (len(found.equations.tree.rates), 2)
    assert free.counts[free.counts > 0].tolist() == [2, 2, 2] and np.allclose(Phi @ free.rates, 0)


@pytest.mark.parametrize(
    "effect",
    [
        {"friction": {"turn": lw.Friction(viscous=0.1)}},
        {"spring": {"turn": lw.Spring(stiffness=2.0)}},
        {"rotor_inertia": {"turn": 0.1}},
        {"limits": {"turn": lw.Limits(upper=1.0)}},
    ],
    ids=lambda effect: next(iter(effect)),
)
def test_what_friction_springs_rotors_and_limits_act_on_is_not_idle(effect):
    """Kinematics leaves such a spin open all the same; inverse dynamics says that nothing drives
    it."""
    found = crank_and_rod(**effect)
    assert found.spins == (ROD,) and found.idle == ()
    assert len(assembly_modes(found)) == 2
    with pytest.raises(lw.LinkworkError, match="the actuators do not drive"):
        found.inverse_dynamics(found.home, np.zeros(2))


@pytest.mark.parametrize(("aside", "idle"), [(0.1, ()), (0.0, (ROD,))])
def test_a_spring_between_points_holds_a_spin_where_it_pulls_aside_of_the_line(aside, idle):
    spring = lw.PointSpring(
        connects=("ground", "rod"), points=((0.1, 0.2, 0.3), (0.25, aside, 0.0)), stiffness=5.0
    )
    assert crank_and_rod(springs={"coil": spring}).idle == idle


def test_what_an_actuator_drives_is_no_spin():
    """A piston that a motor turns in its cylinder, between balls: the piston's own spin is driven,
    that of both is not."""
    joints = {
        "foot": lw.SphericalJoint(connects=("ground", "tube")),
        "tube": lw.CylindricalJoint(connects=("tube", "piston"), axis=(1, 0, 0)),
        "head": lw.SphericalJoint(
            connects=("piston", "slider"), frames=(lw.Frame.planar(0.5), lw.Frame())
        ),
        "guide": lw.PrismaticJoint(
            connects=("ground", "slider"), frames=(lw.Frame.planar(0.8), lw.Frame())
        ),
    }
    reference = {"tube.slide": 0.4, "guide": 0.4}
    bodies = ("tube", "piston", "slider")
    assert len(robot(bodies, joints, "tube.slide", reference=reference).spins) == 2
    driven = robot(bodies, joints, "tube.slide", "tube.angle", reference=reference)
    assert driven.mobility == 3 and driven.spins == driven.idle == (
        "tube and piston: spin about the line through foot and head",
    )


# False ones


def test_an_arm_whose_wrist_is_in_line_at_home_has_none():
    described = lw.robots.puma560()
    found = lw.Robot(described.model_copy(update={"reference": {}}))
    assert found.mobility == 6 and found.spins == found.idle == ()
    assert len(assembly_modes(found)) == 1
    bent = found.tool_pose(found.assemble({"joint_2": 0.3, "joint_3": 0.4, "joint_5": 0.5}))
    assert len(working_modes(found, bent)) == 8


@pytest.mark.parametrize("actuators", [(), ("low",)])
def test_a_door_on_two_hinges_is_not_idle(actuators):
    high = lw.Frame(position=(0, 0, 2))
    joints = {
        "low": lw.RevoluteJoint(connects=("ground", "door")),
        "high": lw.RevoluteJoint(connects=("ground", "door"), frames=(high, high)),
    }
    found = robot(("door",), joints, *actuators)
    assert found.mobility == 1 and found.spins == found.idle == ()
    modes = assembly_modes(found, {"low": 0.3})
    assert len(modes) == 1 and modes.states.at(0)["high"] == pytest.approx(0.3)


def test_a_folded_slider_crank_is_not_idle():
    """Crank and rod are equally long: folded, they turn as one and the slider stands still."""
    joints = {
        "pivot": lw.RevoluteJoint(connects=("ground", "crank")),
        "pin": lw.RevoluteJoint(
            connects=("crank", "rod"), frames=(lw.Frame.planar(0.3), lw.Frame())
        ),
        "wrist": lw.RevoluteJoint(
            connects=("rod", "slider"), frames=(lw.Frame.planar(0.3), lw.Frame())
        ),
        "slide": lw.PrismaticJoint(connects=("ground", "slider"), axis=(1, 0, 0)),
    }
    found = robot(
        ("crank", "rod", "slider"), joints, "pivot", reference={"pivot": 1.0, "pin": np.pi}
    )
    assert found.idle == ()
    modes = assembly_modes(found, {"pivot": 1.0})
    slides = np.sort(modes.states.positions[:, found.coordinates.index("slide")])
    np.testing.assert_allclose(slides, [0, 2 * 0.3 * np.cos(1.0)], atol=1e-6)


def test_a_driven_wheel_with_a_rod_to_its_own_axis_is_not_idle():
    joints = {
        "hinge": lw.RevoluteJoint(connects=("ground", "wheel")),
        "rod": lw.RodJoint(
            connects=("wheel", "arm"), length=1.0, frames=(lw.Frame(), lw.Frame.planar(0, 1))
        ),
        "pivot": lw.RevoluteJoint(connects=("ground", "arm")),
    }
    found = robot(("wheel", "arm"), joints, "hinge", "pivot", tools={"tip": lw.Tool(body="arm")})
    assert found.mobility == 2 and found.spins == found.idle == ()
    assert len(assembly_modes(found)) == 1


def test_a_mechanism_that_can_do_nothing_else_does_not_idle():
    joints = {
        "hinge": lw.RevoluteJoint(connects=("ground", "wheel")),
        "rod": lw.RodJoint(connects=("wheel", "slider"), length=1.0),
        "slide": lw.PrismaticJoint(connects=("ground", "slider"), axis=(1, 0, 0)),
    }
    found = robot(("wheel", "slider"), joints, reference={"slide": 1.0})
    assert found.mobility == 1 and found.idle == ()


# Elastic joints


def elastic(*actuators):
    """Return an arm that a motor with a rotor drives through a torsion spring, all about one axis,
    without weight."""
    joints = {
        "motor": lw.RevoluteJoint(connects=("ground", "rotor"), rotor_inertia=0.2),
        "spring": lw.RevoluteJoint(connects=("rotor", "arm"), spring=lw.Spring(stiffness=8.0)),
        "bearing": lw.RevoluteJoint(connects=("ground", "arm"), friction=lw.Friction(viscous=0.5)),
    }
    return robot(("rotor", "arm"), joints, *actuators, gravity=(0.0, 0.0, 0.0))


def test_a_rotor_that_a_spring_holds_is_not_idle():
    assert elastic("motor").mobility == 2
    assert elastic("motor").idle == elastic("bearing").idle == elastic().idle == ()


@pytest.mark.parametrize(
    ("actuator", "undriven"), [("motor", "bearing|spring"), ("bearing", "motor|spring")]
)
def test_inverse_dynamics_of_an_elastic_joint_names_what_nothing_drives(actuator, undriven):
    found = elastic(actuator)
    state = found.assemble({"motor": 0.5, "bearing": 0.2})
    with pytest.raises(
        lw.LinkworkError, match=f"the actuators do not drive ({undriven}); add actuators"
    ):
        found.inverse_dynamics(state, [1.0, 1.0])


def test_inverse_dynamics_of_an_elastic_joint_in_series_is_refused_and_with_a_second_motor_right():
    """Statics by hand: the spring's moment k q acts on the arm forwards and on the rotor
    backwards."""
    joints = {
        "motor": lw.RevoluteJoint(connects=("ground", "rotor"), rotor_inertia=0.2),
        "spring": lw.RevoluteJoint(connects=("rotor", "arm"), spring=lw.Spring(stiffness=8.0)),
    }
    one, both = (
        robot(("rotor", "arm"), joints, *names, gravity=(0.0, 0.0, 0.0))
        for names in (("motor",), ("motor", "spring"))
    )
    assert one.idle == both.idle == ()
    with pytest.raises(lw.LinkworkError, match="the actuators do not drive spring; add actuators"):
        one.inverse_dynamics(one.state({"motor": 0.4, "spring": 0.1}), [2.0, 2.0])
    at_rest = both.state({"motor": 0.4, "spring": 0.1})
    np.testing.assert_allclose(
        both.inverse_dynamics(at_rest, [0.0, 0.0]), [0.0, 8.0 * 0.1], atol=1e-12
    )


def test_forces_of_an_elastic_joint_with_both_sides_driven():
    """Statics and Newton's law by hand: motor (J_r + J) a_m + k (q_m - q_a), arm I a_a + d w_a - k
    (q_m - q_a)."""
    found = elastic("motor", "bearing")
    state = found.assemble({"motor": 0.5, "bearing": 0.2}, rates={"motor": 0.0, "bearing": 0.3})
    inertia = 0.1 + 1.0 * 0.5**2
    expected = [(inertia + 0.2) * 2.0 + 8.0 * 0.3, inertia * 3.0 + 0.5 * 0.3 - 8.0 * 0.3]
    np.testing.assert_allclose(
        found.inverse_dynamics(state, {"motor": 2.0, "bearing": 3.0}), expected, atol=1e-12
    )
