"""Transmissions, drives and lifts in a description: what cannot be is refused with its place; what
acts along a combination is what the same spring or motor does in one joint."""

import numpy as np
import pytest

import linkwork as lw

ARM = """linkwork: 1
bodies: {a: {mass: 1, centre_of_mass: [0.3, 0, 0], inertia: {xx: 0.01, yy: 0.02, zz: 0.03}}}
joints: {j: {type: revolute, connects: [ground, a], axis: [0, 1, 0]%s}}
actuators: [%s]
%s
"""


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ("transmissions: {x: {type: sum, ratios: {k: 1}}}", "ratios: there is no coordinate 'k'"),
        ("transmissions: {x: {type: sum, ratios: {j: 0}}}", "combines no coordinate"),
        ("transmissions: {j: {type: sum, ratios: {j: 1}}}", "'j' is the name of a joint"),
        ("transmissions: {x: {type: summ}}", "'summ' is not a type .did you mean sum"),
        ("transmissions: {x: {type: thrust, body: a}}", "pushes nowhere; give a force"),
        ("transmissions: {x: {type: thrust, body: b, force: [1, 0, 0]}}", "there is no body 'b'"),
        (
            "transmissions: {x: {type: slider_crank, pin: {body: a}, body: a, rod: 0}}",
            "x.rod: 0 is not above 0",
        ),
        (
            "transmissions: {x: {type: slider_crank, pin: {body: b}, body: a, rod: 1}}",
            "transmissions.x: there is no body 'b'",
        ),
        (
            "transmissions: {x: {type: displacement, body: a, base: ground}}",
            "x.force: pushes nowhere",
        ),
        (
            "transmissions: {x: {type: displacement, body: a, base: b, moment: [1, 0, 0]}}",
            "transmissions.x: there is no body 'b'",
        ),
        (
            "transmissions: {x: {type: slider_crank, pin: {body: a}, body: a, rod: 1}}",
            "transmissions.x: acts between 'a' and itself, where nothing moves; name two bodies",
        ),
        (
            "transmissions: {x: {type: displacement, body: a, base: a, force: [1, 0, 0]}}",
            "transmissions.x: acts between 'a' and itself",
        ),
        ("drives: {j: {gain: 3}}", "drives.j.type: is missing; give the type of a drive"),
        ("drives: {k: {type: servo}}", "there is no actuator 'k'"),
        ("drives: {j: {type: servo, gane: 3}}", "drives.j.gane: .*did you mean gain"),
        ("drives: {j: {type: servo, least_force: 3, largest_force: 1}}", "give the smaller one as"),
        ("lifts: {x: {body: b, mass: 1}}", "lifts.x.body: there is no body 'b'"),
    ],
)
def test_what_cannot_be_is_refused(more, sentence):
    with pytest.raises(lw.MechanismError, match=sentence):
        _ = lw.Robot(lw.Mechanism.parse(ARM % ("", "j", more))).drives


def test_along_one_coordinate_they_are_what_a_joint_has():
    """l = r q: stiffness r^2 k, rest l_0 / r, damping r^2 d, inertia r^2 J."""
    r, k, rest, d, J = 1.5, 40.0, 0.3, 0.7, 0.2
    own = f", spring: {{stiffness: {r**2 * k}, rest: {rest / r}, damping: {r**2 * d}}}"
    joint = ARM % (f"{own}, rotor_inertia: {r**2 * J}", "j", "")
    spring = f"spring: {{stiffness: {k}, rest: {rest}, damping: {d}}}, inertia: {J}"
    line = ARM % ("", "x", f"transmissions: {{x: {{type: sum, ratios: {{j: {r}}}, {spring}}}}}")
    one, two = (lw.Robot(lw.Mechanism.parse(text)) for text in (joint, line))
    states = [robot.state([0.4], [-0.9]) for robot in (one, two)]
    expected = one.forward_dynamics(states[0], [r * 2.0])
    np.testing.assert_allclose(two.forward_dynamics(states[1], [2.0]), expected, rtol=1e-14)


def test_a_slack_spring_has_no_force_within_its_range():
    text = ARM % (
        "",
        "j",
        "transmissions: {x: {type: sum, ratios: {j: 1}, spring: {stiffness: 10, "
        "rest: 0.1, slack: 0.2}}}",
    )
    robot = lw.Robot(lw.Mechanism.parse(text))
    forces = [float(robot.passive_forces(robot.state([q]))[0]) for q in (0.05, 0.2, 0.35)]
    np.testing.assert_allclose(forces, [0.5, 0, -0.5], atol=1e-14)


def test_steps_end_where_a_spring_with_slack_begins_to_pull():
    """A point that flies through 0.2 m of slack and swings out of it by half a period at each end;
    with the ends within steps it is 2e-6 m astray, and the balance 8e-6 J."""
    slide = ARM.replace("revolute", "prismatic") % (
        "",
        "j",
        "transmissions: {x: {type: sum, ratios: {j: 1}, spring: {stiffness: 1.0e+4, rest: 0.1, "
        "slack: 0.2}}}",
    )
    robot = lw.Robot(
        lw.Mechanism.parse(slide.replace("linkwork: 1", "linkwork: 1\ngravity: [0, 0, 0]"))
    )
    out, across = np.pi / 100.0, 0.2 / 2.0
    run = robot.simulate(robot.state([0.2], [2.0]), duration=4 * (out + across), rtol=1e-9)
    assert abs(run.final["j"] - 0.2) < 2e-8
    assert abs(run["energy_balance"].values).max() < 1e-7
    assert run.coords["event"].values[0] == "x: spring at the upper end begins"


def test_a_description_with_them_comes_back_equal():
    text = ARM % (
        "",
        "x",
        "transmissions: {x: {type: cable, path: [{type: point, body: ground}, "
        "{type: sphere, body: a, radius: 0.1}, {type: point, body: a, point: [1, 0, 0]}]}}"
        "\ndrives: {x: {type: servo, gain: 2}}\nlifts: {y: {body: a, mass: 0.2}}",
    )
    mechanism = lw.Mechanism.parse(text)
    assert lw.Mechanism.parse(mechanism.text) == mechanism


BETWEEN = """transmissions:
  piston: {type: slider_crank, pin: {body: a, point: [0.1, 0, 0.1]}, body: ground,
           frame: {position: [0.5, 0, 0.3]}, rod: %s}
  hand: {type: displacement, body: a, base: ground, force: [%s, 0, 0.4]}
  fan: {type: thrust, body: a, force: [%s, 0, 0.4]}"""


def test_what_acts_between_bodies_closes_the_energy_balance_and_has_free_numbers():
    free = ("transmissions.piston.rod", "transmissions.hand.force.0", "transmissions.fan.force.0")
    text = ARM % ("", "piston, hand, fan", BETWEEN)
    robot = lw.Robot(lw.Mechanism.parse(text % (1.2, 1, 1)), free=free)
    other = lw.Robot(lw.Mechanism.parse(text % (1.4, 2, 3)))
    moved = robot.with_parameters(dict(zip(free, (1.4, 2.0, 3.0), strict=True)))
    at, forces = ({"j": 0.4}, {"j": 0.2}), [1.3, 0.5, 0.2]
    found, expected = (each.forward_dynamics(each.state(*at), forces) for each in (moved, other))
    assert found == pytest.approx(expected, rel=1e-13)
    run = robot.simulate(robot.home, forces, duration=0.2, rtol=1e-11)
    assert np.abs(run["energy_balance"]).max() < 1e-9
