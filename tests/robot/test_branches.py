"""The tool is led on the branch of the guess: against inverse kinematics in closed form, on every
working mode."""

import warnings

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import working_modes
from linkwork.errors import ModelWarning
from linkwork.mechanism.numbers import edited
from linkwork.robots.plane import corners, vertices

from tests.analysis.mechanisms import arm, elsewhere, rrs
from tests.catalogue import built
from tests.oracle.random_joints import random_loops

# proximal and distal length, elbows by name, and from a pose each leg's foot and what its distal
# link has to reach
LEGS = {
    "five_bar": (
        0.25,
        0.35,
        ("elbow_1", "tip"),
        lambda pose: [((0.0, 0.0), pose[:2]), ((0.3, 0.0), pose[:2])],
    ),
    "rrr3": (0.22, 0.2, ("elbow_1", "elbow_2", "elbow_3"), lambda pose: platform(pose)),
}


def platform(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    tops = pose[:2] + np.array(vertices(0.08)) @ np.array([[c, s], [-s, c]])
    return list(zip(corners(0.6), tops, strict=True))


def angles(name, pose, sides):
    """Return the motors' angles at a pose with each elbow on a side, by the law of cosines; None
    out of reach."""
    first, second, _, legs = LEGS[name]
    found = []
    for (foot, top), side in zip(legs(pose), sides, strict=True):
        reach = np.subtract(top, foot)
        length = np.hypot(*reach)
        if not abs(first - second) + 1e-3 < length < first + second - 1e-3:
            return None
        found.append(
            np.arctan2(*reach[::-1])
            - side * np.arccos((first**2 + length**2 - second**2) / (2 * first * length))
        )
    return np.array(found)


def reached(name, sides, count, seed):
    """Return random poses that both links of every leg reach, and the motors' angles there."""
    random, home = (
        np.random.default_rng(seed),
        built(name).tool_pose(built(name).home)[: 2 if name == "five_bar" else 3],
    )
    spread = np.array([0.5, 0.5, 1.0])[: home.size]
    poses = home + spread * random.uniform(-1, 1, (400, home.size))
    found = [(pose, q) for pose in poses if (q := angles(name, pose, sides)) is not None][:count]
    assert len(found) == count
    return (np.array(part) for part in zip(*found, strict=True))


def sides_of(name, state):
    """Return on which side of the line from foot to tip the elbow of each leg is."""
    robot = built(name)
    poses, legs = robot.body_poses(state), LEGS[name][3](robot.tool_pose(state))
    elbows = [poses[f"distal_{i}"][0][:2] for i in range(1, len(legs) + 1)]
    return [
        np.sign(np.linalg.det([np.subtract(elbow, foot), np.subtract(top, elbow)]))
        for elbow, (foot, top) in zip(elbows, legs, strict=True)
    ]


@pytest.mark.parametrize("name", LEGS)
def test_the_tool_is_led_on_each_working_mode(name):
    robot = built(name)
    start = robot.tool_pose(robot.home)[: 2 if name == "five_bar" else 3]
    modes = working_modes(robot, start)
    assert len(modes) == 2**robot.mobility
    motors = [robot.coordinates.index(motor) for motor in robot.actuators]
    for k in range(len(modes)):
        guess = modes.states.at(k)
        poses, expected = reached(name, sides_of(name, guess), 12, k)
        found = robot.assemble(tool=poses, guess=guess).positions[:, motors]
        np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * expected), atol=1e-8)


@pytest.mark.parametrize("tip", [(0.2236, -0.1075), (-0.0804, -0.0660)])
def test_a_pose_behind_the_edge_of_the_workspace_is_reached_on_the_mode_of_the_guess(tip):
    robot = built("five_bar")
    state = robot.assemble(tool=tip)
    expected = angles("five_bar", np.array(tip), sides_of("five_bar", robot.home))
    np.testing.assert_allclose(np.exp(1j * state.positions[:2]), np.exp(1j * expected), atol=1e-9)
    assert robot.closure_error(state) < 1e-12


def test_a_stack_of_poses_is_led_as_each_alone():
    robot, random = built("prr3"), np.random.default_rng(5)
    poses = robot.tool_pose(robot.home) + [0.05, 0.05, 0.3] * random.uniform(-1, 1, (2, 5, 3))
    stack = robot.assemble(tool=poses)
    assert stack.batch == (2, 5)
    alone = [robot.assemble(tool=pose).positions for pose in poses.reshape(-1, 3)]
    np.testing.assert_allclose(stack.positions.reshape(10, -1), alone, atol=1e-9)


def test_an_arm_in_space_comes_back_to_where_it_was_on_each_of_its_eight_modes():
    robot, random = built("puma560"), np.random.default_rng(7)
    modes = working_modes(robot)
    home = robot.tool_pose(robot.home)
    for k in range(len(modes)):
        guess = modes.states.at(k)
        away = robot.assemble(tool=home + 0.05 * random.uniform(-1, 1, 6), guess=guess)
        back = robot.assemble(tool=home, guess=away)
        np.testing.assert_allclose(back.positions, guess.positions, atol=1e-7)


@pytest.mark.parametrize("length", [1.0, 1e-3, 1e3])
def test_the_edge_of_the_workspace_belongs_to_both_modes(length):
    robot = arm(length, 0.6 * length)
    for elbow in (0.8, -0.8):
        guess = robot.state({"hinge_1": 0.2, "hinge_2": elbow})
        edge = robot.assemble(
            tool=[1.6 * length * np.cos(0.5), 1.6 * length * np.sin(0.5)], guess=guess
        )
        assert edge["hinge_1"] == pytest.approx(0.5, abs=1e-4) and edge["hinge_2"] == pytest.approx(
            0, abs=1e-4
        )


def test_a_guess_between_two_modes_leads_to_either():
    robot = arm()
    state = robot.assemble(tool=[0.9, 0.5], guess=robot.state({"hinge_1": 0.4, "hinge_2": 0.0}))
    np.testing.assert_allclose(robot.tool_pose(state)[:2], [0.9, 0.5], atol=1e-12)


# Other branches


def rocking_arm():
    """Return an arm of two links whose upper one is the rocker of a four-bar: it swings from 72 to
    133 degrees only."""
    link = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    joints = {
        "crank": lw.RevoluteJoint(
            connects=("ground", "crank"), frames=(lw.Frame.planar(-0.4), lw.Frame())
        ),
        "pin": lw.RevoluteJoint(
            connects=("crank", "coupler"), frames=(lw.Frame.planar(0.1), lw.Frame())
        ),
        "shoulder": lw.RevoluteJoint(connects=("ground", "upper")),
        "joint": lw.RevoluteJoint(
            connects=("coupler", "upper"), frames=(lw.Frame.planar(0.4), lw.Frame.planar(0.2))
        ),
        "elbow": lw.RevoluteJoint(
            connects=("upper", "lower"), frames=(lw.Frame.planar(0.5), lw.Frame())
        ),
    }
    return lw.Robot(
        lw.Mechanism(
            bodies=dict.fromkeys(("crank", "coupler", "upper", "lower"), link),
            joints=joints,
            actuators=("crank", "elbow"),
            tools={"hand": lw.Tool(body="lower", frame=lw.Frame.planar(0.4))},
            reference={"crank": 1.5, "pin": -1.3, "shoulder": 1.75, "joint": 1.5, "elbow": 1.0},
        )
    )


def test_a_pose_of_another_branch_is_refused_and_says_so():
    """The elbow bent to the other side, the shoulder would have to be at 36 degrees."""
    robot = rocking_arm()
    shoulder, elbow = np.radians([80.0, -50.0])
    hand = 0.5 * np.array([np.cos(shoulder), np.sin(shoulder)]) + 0.4 * np.array(
        [np.cos(shoulder + elbow), np.sin(shoulder + elbow)]
    )
    with pytest.raises(
        lw.UnreachableError, match="only on another branch than the guess"
    ) as refusal:
        robot.assemble(tool=hand)
    assert "\n" not in str(refusal.value)
    state = robot.assemble(tool=hand, branch="any")
    assert state["shoulder"] == pytest.approx(shoulder) and state["elbow"] == pytest.approx(elbow)


def test_a_platform_that_only_shifts_is_not_found_turned_over():
    """A leg of this Delta does not reach the pose, but of a platform that turns where the loops let
    it go, with all signs as at home."""
    robot = lw.Robot(lw.robots.delta(0.359, 0.127, 0.225, 0.611, 0.19, 0.414))
    with pytest.raises(lw.UnreachableError, match="only on another branch"):
        robot.assemble(tool=[-0.267, 0.0, -0.3])
    turned = robot.assemble(tool=[-0.267, 0.0, -0.3], branch="any")
    assert abs(turned["pose.qw"]) < 0.9


@pytest.mark.parametrize("pose", [(0.61, -0.65, 0.73), (-0.71, -0.26, -0.44), (-1.05, -0.5, -0.19)])
def test_a_pose_is_reached_wherever_the_robot_stands(pose):
    """The straight way is barred; legs of any length reach each pose."""
    here = built("rpr3")
    away = np.array([30.0, -20.0, 0.0])
    for robot in (here, elsewhere(here, away)):
        asked = robot.tool_pose(robot.home) + pose
        state = robot.assemble(tool=asked)
        np.testing.assert_allclose(robot.tool_pose(state), asked, atol=1e-9)


def rpr_legs(pose):
    """Return the legs' lengths at a pose of the 3-RPR."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    tops = pose[:2] + np.array(vertices(0.15)) @ np.array([[c, s], [-s, c]])
    return np.linalg.norm(tops - corners(1.0), axis=1)


def test_poses_thirty_lengths_away_are_reached_on_the_branch():
    """Legs of any length reach each pose; many straight ways pass near the corners, where a leg
    turns quickly."""
    robot = built("rpr3")
    aside = np.random.default_rng(0).uniform(-1, 1, (30, 3)) * (40, 40, 3)
    poses = robot.tool_pose(robot.home) + aside
    states = [robot.assemble(tool=pose) for pose in poses]
    legs = [[float(state[f"slide_{i}"]) for i in (1, 2, 3)] for state in states]
    np.testing.assert_allclose(legs, [rpr_legs(pose) for pose in poses], atol=1e-9)
    stack = robot.assemble(tool=poses)
    np.testing.assert_allclose(stack["slide_1"], np.array(legs)[:, 0], atol=1e-9)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:between the guess")
def test_legs_of_thirty_lengths_are_assembled():
    robot, random = built("rpr3"), np.random.default_rng(0)
    home = robot.tool_pose(robot.home)
    for aside in random.uniform(-1, 1, (20, 3)) * (20, 20, 3):
        legs = rpr_legs(home + aside)
        state = robot.assemble({f"slide_{i + 1}": float(leg) for i, leg in enumerate(legs)})
        np.testing.assert_allclose(rpr_legs(robot.tool_pose(state)), legs, atol=1e-9)


@pytest.mark.parametrize("far", [0.2, 3.0])
def test_slides_lead_as_far_as_they_are_asked_to(far):
    """A cart on a gantry whose own length is 5 cm, driven together and one slide alone."""
    solid = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.01))
    joints = {
        "along": lw.PrismaticJoint(connects=("ground", "gantry"), axis=(1.0, 0.0, 0.0)),
        "across": lw.PrismaticJoint(
            connects=("gantry", "cart"),
            axis=(0.0, 1.0, 0.0),
            frames=(lw.Frame.planar(0.05), lw.Frame()),
        ),
    }
    robot = lw.Robot(
        lw.Mechanism(
            bodies=dict.fromkeys(("gantry", "cart"), solid),
            joints=joints,
            actuators=tuple(joints),
            tools={"cart": lw.Tool(body="cart", task=("x", "y"))},
        )
    )
    state = robot.assemble(tool=[far, -far])
    np.testing.assert_allclose(state.positions, [far - 0.05, -far], atol=1e-9)
    np.testing.assert_allclose(robot.assemble({"across": far}).positions[1], far, atol=1e-9)


def test_a_branch_that_is_none():
    with pytest.raises(lw.LinkworkError, match="branch is 'best'; give 'guess' or 'any'"):
        built("five_bar").assemble(tool=[0.1, 0.3], branch="best")


def test_a_path_is_followed_on_the_branch_of_the_guess():
    robot = built("five_bar")
    motion = robot.follow(lw.paths.line((0.2236, -0.1075), (0.23, -0.09)), 1.0, samples=5)
    assert sides_of("five_bar", motion.state.at(4)) == sides_of("five_bar", robot.home)
    first = angles("five_bar", np.array([0.2236, -0.1075]), sides_of("five_bar", robot.home))
    np.testing.assert_allclose(
        np.exp(1j * motion.state.positions[0, :2]), np.exp(1j * first), atol=1e-9
    )


def test_a_path_whose_samples_are_too_far_apart_to_stay_on_the_branch_is_refused():
    """With a fifth of the samples an elbow of the five-bar would turn over unseen; with more the
    edge is met and told."""
    robot = built("five_bar")
    home = robot.tool_pose(robot.home)[:2]
    path = lw.paths.line(home, (0.34170256, 0.10691788))
    with pytest.raises(
        lw.LinkworkError, match="the joints are on another branch than at the start"
    ):
        robot.follow(path, 1.0, samples=5)
    fine = lw.paths.line(home, (0.3, 0.3))
    motion = robot.follow(fine, 1.0, samples=5)
    assert all(
        sides_of("five_bar", motion.state.at(k)) == sides_of("five_bar", robot.home)
        for k in range(5)
    )


def test_samples_between_which_a_motion_leaves_its_arc_are_refused():
    """Legs of the Delta share a determinant: two that turn over at the last of three samples leave
    it its sign. With more samples the motors turn by little from each to the next."""
    robot = built("delta")
    path = lw.paths.line((0.11, 0.04, -0.825), (-0.475, 0.131, -1.629))
    with pytest.raises(lw.LinkworkError, match="t = 1 s: the joints are on another branch"):
        robot.follow(path, 1.0, samples=3)
    few, many = (robot.follow(path, 1.0, samples=n) for n in (11, 101))
    np.testing.assert_allclose(few.positions, many.positions[::10], atol=1e-9)
    assert np.abs(np.diff(many.positions[:, :3], axis=0)).max() < 0.1


def par4_motors(pose):
    """Return the Par4's motor angles at (x, y, z, rz), halves unturned and elbows outward:
    |V - E| = rod is  a cos q + b sin q = c."""
    found, arm, rod, bar = [], 0.35, 0.8, 0.1
    for f, side in zip(np.array([-1, 1, 3, 5]) * np.pi / 4, (1, 1, -1, -1), strict=True):
        e = np.array([np.cos(f), np.sin(f), 0.0])
        half = pose[:3] - [0.0, 0.05, 0.0] + side * bar / 2 * np.array([*turn(pose[3]), 0.0])
        U = half + 0.1 * e - [side * bar / 2, 0.0, 0.0] - 0.25 * e
        a, b, c = U @ e, -U[2], (U @ U + arm**2 - rod**2) / (2 * arm)
        found.append(np.arctan2(b, a) - np.arccos(c / np.hypot(a, b)))
    return found


def turn(angle):
    return np.cos(angle), np.sin(angle)


def test_a_plate_that_folds_where_legs_hold_its_halves_is_led_on_as_closed_forms_say():
    """Bars and halves of the plate lie on one line at a quarter turn, where rows that are kept
    depend on each other: all of them together hold it, and no pose on the way is singular."""
    robot = built("par4")
    path = lw.paths.line((0.006, 0.05, -0.694, 0.159), (-0.326, 0.406, -0.839, 1.775))
    for samples in (3, 5):
        with pytest.raises(lw.LinkworkError, match=r"^at t = [0-9.]+ s: "):
            robot.follow(path, 1.0, samples=samples)
    motion = robot.follow(path, 1.0, samples=41)
    expected = [par4_motors(pose) for pose in motion.tool]
    np.testing.assert_allclose(motion.positions[:, :4], expected, atol=1e-9)


def test_legs_stay_as_they_are_where_a_kept_row_vanishes():
    """A leg leapt to its other elbow there: a determinant of kept rows changed its sign alone."""
    robot, state = built("par4"), built("par4").home
    first, last = robot.task_values(state), np.array([-0.6, -0.25, -0.3, 0.0])
    for part in np.linspace(0, 1, 41)[1:]:
        pose = first + part * (last - first)
        state = robot.assemble(tool=pose, guess=state)
        motors = [state[name] for name in robot.actuators]
        np.testing.assert_allclose(motors, par4_motors(pose), atol=1e-9)


@pytest.mark.parametrize("name", ["five_bar", "delta", "stewart"])
def test_samples_led_at_once_are_those_led_alone(name):
    """Positions by the inverse kinematics of each pose, rates and accelerations by differences of
    positions in time."""
    robot = built(name)
    home = robot.task_values(robot.home)
    line = lw.paths.line(home, home + 0.05 * np.random.default_rng(4).standard_normal(home.size))
    motion = robot.follow(line, 1.0, samples=801)
    each = [robot.assemble(tool=pose).positions for pose in motion.tool[::80]]
    np.testing.assert_allclose(motion.positions[::80], each, atol=1e-9)
    single = [robot.coordinates.index(label) for label in robot.rates if label in robot.coordinates]
    rates = [robot.rates.index(robot.coordinates[k]) for k in single]
    h, q = motion.time[1], motion.positions[:, single]
    slope, bend = (q[2:] - q[:-2]) / (2 * h), (q[2:] - 2 * q[1:-1] + q[:-2]) / h**2
    np.testing.assert_allclose(motion.joint_rates[1:-1][:, rates], slope, atol=2e-5)
    np.testing.assert_allclose(motion.joint_accelerations[1:-1][:, rates], bend, atol=2e-4)


def test_a_first_pose_out_of_reach_is_told_with_its_time():
    with pytest.raises(
        lw.UnreachableError, match=r"^at t = 0 s: the mechanism cannot be assembled"
    ):
        built("five_bar").follow(lw.paths.line((3.0, 0.0), (3.1, 0.0)), 1.0)


def test_a_tool_that_shifts_as_it_tilts_is_led_by_all_that_is_asked():
    """Of a 3-RRS the shifts x, y follow from the tilt: a whole pose on its motion is reached, for
    no signs are asked of it."""
    robot = rrs()
    aim = robot.assemble(
        {"hip_1": float(robot.home["hip_1"]) + 0.1, "hip_2": float(robot.home["hip_2"])}
    )
    state = robot.assemble(tool=robot.tool_pose(aim))
    np.testing.assert_allclose(robot.tool_pose(state), robot.tool_pose(aim), atol=1e-9)


def test_stacked_poses_close_the_loops_to_rounding():
    """Accelerations are as exact as the loops are closed, so the last digit counts."""
    robot = lw.Robot(lw.robots.prr3())
    poses = np.add((0.5, 0.2887, 0.8), np.random.default_rng(0).uniform(-0.02, 0.02, (50, 3)))
    assert robot.closure_error(robot.assemble(tool=poses)).max() < 1e-15


SHIFTS = [  # of the Tripteron's slides, with which a link of its second leg turns by over 90 deg
    (-0.2888, 0.2117, -0.3366),
    (-0.2565, -0.0134, -0.3482),
    (-0.2917, -0.2081, -0.3397),
]


@pytest.mark.parametrize("shift", SHIFTS)
def test_legs_keep_their_side_where_a_row_that_others_follow_from_vanishes(shift):
    """The axis of a leg's last hinge stays in its direction by two rows, -sin b and -cos b times
    the same: neither is a mode's."""
    robot = built("tripteron")
    led = [robot.home]
    for part in np.linspace(0, 1, 41)[1:]:
        joints = dict(zip(robot.independent, part * np.array(shift), strict=True))
        led.append(robot.assemble(joints, guess=led[-1]))
        assert np.abs(led[-1].positions - led[-2].positions).max() < 0.5
    assert abs(led[-1]["root_2"] + led[-1]["elbow_2"]) > np.pi / 2
    at_once = robot.assemble(joints)
    np.testing.assert_allclose(at_once.positions, led[-1].positions, atol=1e-9)
    stack = robot.assemble({name: [0.0, x] for name, x in joints.items()})
    np.testing.assert_allclose(stack.positions[1], led[-1].positions, atol=1e-9)


def test_no_row_is_kept_that_hardly_tells_what_another_one_tells():
    description = edited(lw.robots.tripteron(), {"slide_2.frames.0.position.y": -0.0596})
    robot = lw.Robot(description)
    at = {name: float(robot.home[name]) for name in robot.independent}
    near = {name: x + 0.004 for name, x in at.items()}
    state = robot.assemble(near)
    assert np.abs(state.positions - robot.home.positions).max() < 0.1
    q, rows = robot.equations.tree.q, robot.equations.rows
    Phi = np.array(ca.Function("Phi", [q], [rows.Phi])(state.q))
    kept = Phi[list(robot.equations.chart.rows)]
    every = np.linalg.svd(Phi, compute_uv=False)[len(kept) - 1]
    assert np.linalg.svd(kept, compute_uv=False)[-1] > 0.1 * every


def test_threads_keep_their_turns_where_random_configurations_lead_to_what_is_asked():
    """A whole turn of a screw moves what is on it on: it is no turn that may be taken back."""
    robot = lw.Robot(random_loops(4805, 1, effects=True), ("revolute_7", "revolute_6"))
    asked = {"revolute_7": -0.25737, "revolute_6": 0.335442}
    state = robot.assemble(asked)
    assert robot.closure_error(state) < 1e-12
    assert {name: pytest.approx(float(state[name])) for name in asked} == asked


def test_one_set_of_joints_is_led_to_as_several_are():
    """Newton's method alone refused it: these determine the pose, but are not the motors."""
    robot = built("rrr3")
    asked = {"motor_1": 1.10297, "wrist_2": 5.58028, "wrist_3": 2.75405}
    one = robot.assemble(asked)
    assert robot.closure_error(one) < 1e-12
    many = robot.assemble({name: [value, value] for name, value in asked.items()})
    np.testing.assert_allclose(many.positions, [one.positions] * 2, rtol=0, atol=1e-9)
    with pytest.raises(lw.LinkworkError, match=r"^4 joints are given, but 3 .* state"):
        robot.assemble({**{k: [v] * 2 for k, v in asked.items()}, "motor_2": [0.0, 9.0]})


def test_joints_that_lead_beyond_a_singular_pose_are_told():
    """The rod of a slider-crank swings by less than a quarter turn to either side; beyond half a
    turn the slide is on the other side. A Bennett linkage turns round."""
    crank, bennett = built("slider_crank"), built("bennett")
    with pytest.warns(ModelWarning, match=r"with wrist = 2\.85 the straight way .* singular"):
        there = crank.assemble({"wrist": 2.85})
    assert there["slide"] < 0 < crank.home["slide"]
    with pytest.warns(ModelWarning, match=r"with wrist = 2\.85 \(2 of 3 states\)"):
        crank.assemble({"wrist": [0.2, 2.85, 2.9]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        crank.assemble({"wrist": 0.2})
        round_ = bennett.assemble({"hinge_1": [3.75, 4.0]})
    assert (np.diff(round_["hinge_2"]) < 0).all()


def test_joints_to_which_only_the_straight_way_is_barred_are_not_told():
    """Where the third motor turns ahead of the others the mechanism comes to the same pose."""
    robot = built("rrr3")
    asked = {"motor_1": 1.94, "motor_2": -3.32, "motor_3": -2.19}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        at_once, state = robot.assemble(asked), robot.home
        for part in np.linspace(0, 2, 81)[1:]:
            parts = {name: max(part - 1, 0) for name in asked} | {"motor_3": min(part, 1)}
            joints = {n: float((1 - k) * robot.home[n] + k * asked[n]) for n, k in parts.items()}
            state = robot.assemble(joints, guess=state)
    np.testing.assert_allclose(at_once.positions, state.positions, atol=1e-9)
