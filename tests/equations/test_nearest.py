"""A rough reference is closed at the nearest configuration, whatever joints the spanning tree
holds."""

import numpy as np
import pytest
from scipy.optimize import minimize

import linkwork as lw
from linkwork import robots
from linkwork.equations import Equations, derive
from linkwork.mechanism import Mechanism, Spring
from linkwork.mechanism.numbers import edited

FIVE = ("motor_1", "motor_2", "elbow_1", "elbow_2", "tip")


def home(equations: Equations) -> np.ndarray:
    """Coordinates of all joints at the reference."""
    return np.array(
        equations.tree.evaluated("x", [equations.joints.positions()])(equations.reference)[0]
    ).ravel()


def nearest_five_bar(mechanism: Mechanism, base: float = 0.3, proximal: float = 0.25) -> np.ndarray:
    """The closed angles of a five-bar nearest to those of its reference, with its motors where they
    are given, by sequential quadratic programming."""
    named = np.array([label in mechanism.reference for label in FIVE])
    given = np.array([mechanism.reference.get(label, 0.0) for label in FIVE])

    def tip(pivot, motor, elbow):
        directions = np.array([motor, motor + elbow])
        return pivot + np.array([proximal, 0.35]) @ np.exp(1j * directions)

    def gaps(x):
        apart = tip(0.0, x[0], x[2]) - tip(base, x[1], x[3])
        held = (x - given)[:2][named[:2]]
        return np.append([apart.real, apart.imag, x[1] + x[3] - x[0] - x[2] - x[4]], held)

    start = given + np.array([0, 0, 0, 0, 0.2])
    found = minimize(
        lambda x: np.sum((x - given)[named] ** 2) / 2,
        start,
        jac=lambda x: np.where(named, x - given, 0.0),
        constraints=[{"type": "eq", "fun": gaps}],
        method="SLSQP",
        options={"ftol": 1e-18, "maxiter": 300},
    )
    assert np.abs(gaps(found.x)).max() < 1e-9
    return found.x


def test_home_is_the_closed_pose_nearest_to_the_angles_of_the_reference():
    mechanism = robots.five_bar()
    np.testing.assert_allclose(home(derive(mechanism)), nearest_five_bar(mechanism), atol=1e-7)


def test_angles_that_the_reference_names_are_kept_where_the_others_can_follow():
    mechanism = robots.five_bar().model_copy(
        update={"reference": {"motor_1": 2.2, "motor_2": 0.94, "elbow_1": -1.4}}
    )
    found = home(derive(mechanism))
    expected = nearest_five_bar(mechanism)
    np.testing.assert_allclose(found[:3], expected[:3], atol=1e-7)
    np.testing.assert_allclose(found[:2], [2.2, 0.94], atol=1e-12)
    whole = mechanism.model_copy(update={"reference": {"motor_1": 2.2, "motor_2": 0.94}})
    np.testing.assert_allclose(home(derive(whole))[:2], [2.2, 0.94], atol=1e-12)


def rough(mechanism: Mechanism, seed: int = 3) -> Mechanism:
    """The mechanism with every coordinate of its reference off by some 0.05 rad or m."""
    random = np.random.default_rng(seed)
    off = {
        label: value + 0.05 * random.standard_normal()
        for label, value in mechanism.reference.items()
    }
    return mechanism.model_copy(update={"reference": off})


def sprung(mechanism: Mechanism, name: str) -> Mechanism:
    """The mechanism with a spring in a joint, which is then no longer the one to cut."""
    joint = mechanism.joints[name]
    spring = Spring(stiffness=3.0)
    own = {"spring": spring if len(joint.rates(name)) == 1 else {joint.freedoms[0]: spring}}
    return mechanism.model_copy(
        update={"joints": {**mechanism.joints, name: joint.model_copy(update=own)}}
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("name", "joint"),
    [
        ("five_bar", "tip"),
        ("prr3", "wrist_2"),
        ("bennett", "hinge_3"),
        ("spatial_slider_crank", "ball"),
        ("stewart", "ball_2"),
    ],
)
def test_a_spring_that_moves_the_cut_and_another_order_of_the_joints_leave_home_where_it_is(
    name, joint
):
    mechanism = rough(getattr(robots, name)())
    equations, other = derive(mechanism), derive(sprung(mechanism, joint))
    assert {cut.joint for cut in equations.cuts} != {cut.joint for cut in other.cuts}
    reordered = mechanism.model_copy(
        update={"joints": dict(reversed(list(mechanism.joints.items())))}
    )
    turned = dict(zip(reordered.coordinates, home(derive(reordered)), strict=True))
    expected = home(equations)
    np.testing.assert_allclose(home(other), expected, atol=1e-9)
    np.testing.assert_allclose(
        [turned[label] for label in mechanism.coordinates], expected, atol=1e-9
    )
    moved = [
        x - mechanism.reference.get(label, x)
        for label, x in zip(mechanism.coordinates, expected, strict=True)
    ]
    assert 0.01 < np.abs(moved).max() < 0.4


@pytest.mark.parametrize("name", ["bennett", "prr3", "andrews"])
def test_a_closed_reference_is_kept(name):
    mechanism = getattr(robots, name)()
    given = [mechanism.reference.get(label, 0.0) for label in mechanism.coordinates]
    np.testing.assert_allclose(home(derive(mechanism)), given, atol=2e-15, rtol=1e-15)


def test_coordinates_out_of_reach_end_at_the_turning_point():
    mechanism = robots.four_bar(ground=1.0, crank=0.8, coupler=0.7, rocker=0.6)
    mechanism = mechanism.model_copy(update={"reference": {"crank_pivot": 2.9}})
    reach = np.arccos((1.0 + 0.8**2 - 1.3**2) / (2 * 0.8))  # coupler and rocker in one line
    assert abs(home(derive(mechanism))[0] - reach) < 1e-6


def test_other_parameters_have_the_home_of_the_edited_description():
    robot = lw.Robot(robots.five_bar()).free(
        "elbow_1.frames.0.position.x", "elbow_2.frames.0.position.x"
    )
    values = dict.fromkeys(robot.parameters, 0.26)
    changed = robot.with_parameters(values)
    expected = nearest_five_bar(edited(robot.mechanism, values), proximal=0.26)
    np.testing.assert_allclose(changed.home.positions, expected, atol=1e-7)


def test_other_parameters_keep_the_crank_of_a_reference_that_is_rough():
    """Where another angle of the reference is off, home of other lengths has the crank where it is
    asked for, too, on the same branch."""
    mechanism = robots.four_bar().model_copy(
        update={"reference": {"crank_pivot": 1.0, "rocker_pivot": 4.45}}
    )
    robot = lw.Robot(mechanism).free("crank_pin.frames.0.position.x")
    assert "rocker_pivot from 4.45" in robot.notes[0]
    for length in (0.45, 0.52):
        values = dict.fromkeys(robot.parameters, length)
        found = robot.with_parameters(values).home.positions
        np.testing.assert_allclose(found, home(derive(edited(mechanism, values))), atol=1e-9)
        assert found[0] == pytest.approx(1.0, abs=1e-12)
        assert abs(found[2] - robot.home["rocker_pivot"]) < 0.1


def test_actuated_coordinates_are_held_and_what_moves_is_told():
    """One motor is changed in a reference that was closed: it stays where it is put."""
    for name, actuator, value in (("rrr3", "motor_1", 0.9), ("slider_crank", "crank", 0.6)):
        mechanism = getattr(robots, name)()
        robot = lw.Robot(mechanism.with_reference({actuator: value}))
        given = {**mechanism.reference, actuator: value}
        for label in robot.actuators:
            assert robot.home[label] == pytest.approx(given[label], abs=1e-12)
        (note,) = robot.notes
        assert "has moved" in note and f"{actuator} from" not in note
    assert "pin from -1.02 to" in note


def test_actuated_coordinates_out_of_reach_give_way_and_this_is_told():
    mechanism = robots.five_bar().with_reference({"motor_1": 2.6, "motor_2": 0.6})
    robot = lw.Robot(mechanism)
    assert "motor_1 from 2.6 to 2." in robot.notes[0] and "motor_2 from 0.6" in robot.notes[0]
    assert robot.closure_error(robot.home) < 1e-12


@pytest.mark.parametrize("aside", [0.0, 1e-9, -1e-9, -1e-6])
def test_motors_in_a_singular_pose_are_moved_to_the_regular_side(aside):
    """The distal links lie in one line: the tip could move with the motors locked."""
    turn = np.arccos(0.8) + aside
    values = {"motor_1": np.pi - turn, "motor_2": turn}
    robot = lw.Robot(robots.five_bar().with_reference(values))
    assert lw.analysis.singularity(robot, robot.home).actuator > 0.1
    assert "motor_1 from 2.5 to 2.1" in robot.notes[0]


def test_a_reference_closed_but_for_rounding_moves_nothing_worth_telling():
    mechanism = robots.five_bar()
    rounded = {label: round(value, 2) for label, value in mechanism.reference.items()}
    assert lw.Robot(mechanism.with_reference(rounded)).notes == ()


PEAUCELLIER = """
linkwork: 1
bodies: {crank: &bar {mass: 1}, long_1: *bar, long_2: *bar, a: *bar, b: *bar, c: *bar, d: *bar}
joints:
  O: {type: revolute, connects: [ground, long_1]}
  O2: {type: revolute, connects: [ground, long_2]}
  C: {type: revolute, connects: [ground, crank], frames: [{position: [0.1, 0, 0]}, {}]}
  P: {type: revolute, connects: [crank, a], frames: [{position: [0.1, 0, 0]}, {}]}
  P2: {type: revolute, connects: [crank, b], frames: [{position: [0.1, 0, 0]}, {}]}
  K1:
    type: revolute
    connects: [long_1, a]
    frames: [&long {position: [0.3, 0, 0]}, &short {position: [0.12, 0, 0]}]
  K2: {type: revolute, connects: [long_2, b], frames: [*long, *short]}
  L1: {type: revolute, connects: [long_1, c], frames: [{position: [0.3, 0, 0]}, {}]}
  L2: {type: revolute, connects: [long_2, d], frames: [{position: [0.3, 0, 0]}, {}]}
  Q: {type: revolute, connects: [c, d], frames: [*short, *short]}
actuators: [C]
reference: {C: 0.2, O: 0.4, O2: -0.2}
"""


def test_a_linkage_is_not_closed_folded_together_where_its_reference_has_it_open():
    equations = derive(Mechanism.parse(PEAUCELLIER))
    # The inversor closes with both long bars on top of each other, too, and has two freedoms there.
    near = 0.2 * np.cos(0.1)
    half = np.arccos((0.3**2 + near**2 - 0.12**2) / (2 * 0.3 * near))
    assert len(equations.chart.independent) == 1
    np.testing.assert_allclose(home(equations)[:3], [0.1 + half, 0.1 - half, 0.2], atol=1e-9)


@pytest.mark.parametrize("crank", [1.0, 2.5])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("named", ["crank_pin", "rocker_pivot", "rocker_pin"])
def test_one_angle_beside_the_crank_tells_on_which_branch_a_four_bar_is(crank, side, named):
    pin = 0.5 * np.exp(1j * crank)
    across = pin - 1.1
    wide = np.arccos((0.75**2 + abs(across) ** 2 - 1.2**2) / (2 * 0.75 * abs(across)))
    rocker = np.angle(across) + side * wide
    coupler = np.angle(1.1 + 0.75 * np.exp(1j * rocker) - pin)
    closed = {
        "crank_pin": coupler - crank,
        "rocker_pivot": rocker,
        "rocker_pin": rocker - coupler,
    }
    mechanism = robots.four_bar().model_copy(
        update={"reference": {"crank_pivot": crank, named: closed[named]}}
    )
    found = home(derive(mechanism))
    np.testing.assert_allclose(
        np.exp(1j * found), np.exp(1j * np.array([crank, *closed.values()])), atol=1e-9
    )
