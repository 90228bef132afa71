"""Assembly and working modes: published counts, counts by an independent formulation, how sure they
are."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.analysis import assembly_modes, jacobians, working_modes
from linkwork.analysis._assembly_modes import by_bodies, search, tool_kernel
from linkwork.analysis.square import of_tool
from linkwork.model.spread import extent

from tests.analysis.mechanisms import (
    LIGHT,
    arm,
    dietmaier,
    elsewhere,
    geared_five_bar,
    postures,
    rpr,
    spindle_arm,
)
from tests.catalogue import built
from tests.oracle.published import DIETMAIER_BASE, DIETMAIER_PLATFORM, DIETMAIER_SQUARES

# Innocenti & Parenti-Castelli, J. Mech. Design 114 (1992) 73-79: a 3-RPR with six assembly modes.
CORNERS = ((0.0, 0.0), (15.91, 0.0), (0.0, 10.0))
SIDES, TURN = (17.04, 20.84), 0.8822604
VERTICES = ((0.0, 0.0), (SIDES[0], 0.0), (SIDES[1] * np.cos(TURN), SIDES[1] * np.sin(TURN)))
LENGTHS = (14.98, 15.38, 12.0)


@pytest.mark.parametrize("driven", ["turn", "belt"])
def test_an_arm_under_a_lift_has_its_elbow_on_either_side(driven):
    """z = lift, x = cos turn, by a motor on the hinge or by a belt over it."""
    arm = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    described = lw.Mechanism(
        bodies={"car": arm, "arm": arm},
        joints={
            "lift": lw.PrismaticJoint(connects=("ground", "car")),
            "turn": lw.RevoluteJoint(connects=("car", "arm")),
        },
        transmissions={"belt": lw.Combination(ratios={"turn": 0.1})} if driven == "belt" else {},
        actuators=("lift", driven),
        tools={"tip": lw.Tool(body="arm", frame=lw.Frame(position=(1, 0, 0)), task=("x", "z"))},
        reference={"turn": 0.7},
    )
    modes = working_modes(lw.Robot(described), [0.6, 0.2])
    np.testing.assert_allclose(np.cos(modes.states["turn"]), [0.6, 0.6])
    assert abs(np.sin(modes.states["turn"]).sum()) < 1e-9


def test_whole_turns_of_a_thread_are_part_of_a_mode():
    """z = 0.05 turn [rad]: 8 rad lift a nut by 0.4 m, and no whole turn less."""
    described = lw.Mechanism(
        bodies={"nut": lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))},
        joints={"thread": lw.ScrewJoint(connects=("ground", "nut"), pitch=0.05)},
        actuators=("thread",),
        tools={"top": lw.Tool(body="nut", task=("z",))},
    )
    modes = working_modes(lw.Robot(described), [0.4])
    np.testing.assert_allclose(modes.states["thread"], [8.0])


@pytest.mark.parametrize("ratio", [100.0, 3.5, -0.7])
def test_turns_of_a_gear_s_motor_are_no_further_modes(ratio):
    """An arm of two links has its elbow on either side, whatever wheel turns its shoulder."""
    described = arm().mechanism
    wheel = lw.RevoluteJoint(connects=("ground", "wheel"))
    gear = lw.mechanism.GearJoint(ratios={"motor": 1.0, "hinge_1": -ratio})
    update = {
        "bodies": {**described.bodies, "wheel": LIGHT},
        "joints": {**described.joints, "motor": wheel, "gear": gear},
        "actuators": ("motor", "hinge_2"),
        "tools": {"tip": described.first_tool.model_copy(update={"task": ("x", "y")})},
        "reference": {**described.reference, "motor": 0.3 * ratio},
    }
    robot = lw.Robot(described.model_copy(update=update))
    modes = working_modes(robot, [0.9, 0.5])
    reach = 0.9**2 + 0.5**2
    elbow = np.arccos((reach - 1.0 - 0.6**2) / (2 * 0.6))
    assert modes.sure and len(modes) == 2
    np.testing.assert_allclose(np.sort(modes.states["hinge_2"]), [-elbow, elbow], atol=1e-9)
    np.testing.assert_allclose(modes.states["motor"], ratio * modes.states["hinge_1"], atol=1e-9)
    assert np.abs(modes.states["hinge_1"]).max() < np.pi


@pytest.mark.long
@pytest.mark.parametrize(("ratio", "known"), [(1.5, True), (2**0.5, False)])
def test_cranks_in_mesh_are_back_after_some_turns(ratio, known):
    """Of two cranks that turn 2 to 3 the modes of two turns are told, by a dense scan of these; of
    a ratio that is no fraction there is no end of them."""
    robot, tip = geared_five_bar(ratio)
    modes = working_modes(robot, [0.3], what=("x",))
    assert modes.sure == known
    if known:
        scanned = np.array([tip(turn) for turn in np.linspace(0.0, 4 * np.pi, 20001)])
        passed = np.diff(np.sign(scanned - 0.3), axis=0)
        assert len(modes) == np.sum(np.abs(passed) == 2) > 2


@pytest.mark.long
@pytest.mark.parametrize("length", [0.3, 0.5, 0.9])
def test_a_spindle_that_lifts_an_arm_has_two_modes(length):
    """|0.5 e(hinge) - A| = length, of a thread of 2 mm a turn; asked of the arm, the nut may be on
    either side of the spindle's pivot."""
    robot, pivot, pitch = spindle_arm()
    modes = assembly_modes(robot, {"spindle": -length / pitch})
    away = np.hypot(*pivot)
    bent = np.arccos((away**2 + 0.25 - length**2) / away)
    expected = np.sort(np.arctan2(*pivot[::-1]) + np.array([-bent, bent]))
    assert modes.sure
    np.testing.assert_allclose(np.sort(modes.states["hinge"]), expected, atol=1e-9)
    working = working_modes(robot, [expected[0]])
    assert working.sure
    np.testing.assert_allclose(
        np.sort(working.states["spindle"]) * pitch, [-length, length], atol=1e-9
    )


@pytest.mark.long
def test_dietmaier_s_platform_has_forty_assembly_modes():
    robot = dietmaier()
    modes = assembly_modes(
        robot, {f"leg_{i}": square**0.5 for i, square in enumerate(DIETMAIER_SQUARES, start=1)}
    )
    assert len(modes) == 40
    assert modes.sure and modes.missing == 0
    poses = robot.tool_pose(modes.states)
    R = Rotation.from_rotvec(poses[:, 3:]).as_matrix()
    tips = poses[:, None, :3] + np.einsum("nij,kj->nki", R, DIETMAIER_PLATFORM)
    np.testing.assert_allclose(
        np.sum((tips - DIETMAIER_BASE) ** 2, axis=2),
        np.tile(DIETMAIER_SQUARES, (40, 1)),
        atol=1e-12,
    )
    apart = [np.linalg.norm(tips - tip, axis=(1, 2)) for tip in tips]
    assert np.sort(apart, axis=1)[:, 1].min() > 0.1
    assert np.max(robot.closure_error(modes.states)) < 1e-12


def test_the_3_rpr_of_innocenti_and_parenti_castelli_has_six():
    robot = rpr(CORNERS, VERTICES, (-2.0, -14.0, 1.0))
    modes = assembly_modes(
        robot, {f"slide_{i}": length for i, length in enumerate(LENGTHS, start=1)}
    )
    angles = np.sort((robot.tool_pose(modes.states)[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    expected = postures(CORNERS, VERTICES, LENGTHS)
    assert len(expected) == 6
    np.testing.assert_allclose(angles, expected, atol=2 * np.pi / 20000)


@pytest.mark.sample(2)
@pytest.mark.parametrize("slides", [(0.3, 0.3, 0.3), (0.2, 0.45, 0.5), (0.6, 0.1, 0.5)])
def test_3_prr_modes_are_as_many_as_the_circles_of_the_links_allow(slides):
    modes = assembly_modes(built("prr3"), {f"slide_{i}": s for i, s in enumerate(slides, start=1)})
    corners, turns = np.array([(0, 0), (1, 0), (0.5, np.sqrt(3) / 2)]), np.arange(3) * 2 * np.pi / 3
    directions = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    expected = postures(
        corners + np.array(slides)[:, None] * directions, -0.15 * directions, (0.3, 0.3, 0.3)
    )
    assert len(modes) == len(expected)
    found = np.sort((built("prr3").tool_pose(modes.states)[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    np.testing.assert_allclose(found, expected, atol=2 * np.pi / 20000)


@pytest.mark.long
def test_a_delta_also_stands_where_its_three_spheres_meet_above_the_elbows():
    """Level platforms: two, as far above the elbows as below. None of its poses hangs on the order
    of joints in the description."""
    robot = built("delta")
    modes = assembly_modes(robot)
    poses = robot.tool_pose(modes.states)
    level = poses[np.linalg.norm(poses[:, 3:], axis=1) < 1e-9]
    elbow = -0.524 * np.sin(robot.home["motor_1"])
    np.testing.assert_allclose(np.sort(level[:, 2]), [-0.9, 2 * elbow + 0.9], atol=1e-9)
    joints = dict(reversed(robot.mechanism.joints.items()))
    other = lw.Robot(robot.mechanism.model_copy(update={"joints": joints}))
    assert len(modes) == len(assembly_modes(other)) == 16


def test_where_a_robot_stands_changes_no_modes():
    """A Delta 37 m from the ground's origin has all the working modes of the one at home."""
    moved = elsewhere(built("delta"), (30.0, -20.0, 10.0))
    here, there = (working_modes(robot, starts=20_000) for robot in (built("delta"), moved))
    assert here.sure and there.sure and len(here) == len(there) == 40
    sizes = [extent(r.mechanism, r.chart, r.home.q) for r in (built("delta"), moved)]
    assert sizes[0] == pytest.approx(sizes[1])


@pytest.mark.parametrize(("robot", "count"), [("five_bar", 2), ("four_bar", 2), ("agile_wrist", 8)])
def test_known_counts_of_assembly_modes(robot, count):
    assert len(assembly_modes(built(robot))) == count


@pytest.mark.parametrize(
    ("robot", "count"), [("prr3", 8), ("five_bar", 4), ("rrr3", 8), ("agile_wrist", 8)]
)
def test_each_leg_doubles_the_working_modes(robot, count):
    modes = working_modes(built(robot))
    assert len(modes) == count
    assert len({tuple(signs) for signs in modes.signs.tolist()}) == count
    np.testing.assert_allclose(
        built(robot).tool_pose(modes.states)[..., :2],
        np.tile(built(robot).tool_pose(built(robot).home)[:2], (count, 1)),
        atol=1e-9,
    )


def test_signs_tell_legs_apart_where_rows_depend_on_each_other():
    """A Tripteron's leg is stretched or folded where its elbow is a right angle off home's; its
    slides are the same on all eight modes."""
    robot, pose = built("tripteron"), np.array([0.1, -0.25, 0.05])
    modes = search(of_tool(robot), pose, by_bodies, 20000, 0)
    elbows = np.array([[state[f"elbow_{k}"] for k in (1, 2, 3)] for state in modes])
    expected = np.sign(np.cos(elbows))
    assert len(modes) == len({tuple(signs) for signs in expected}) == 8
    # Columns in another order, each the sign of one leg.
    columns = {tuple(column) for column in modes.signs.T.tolist()}
    assert columns == {tuple(column) for column in expected.T.tolist()}
    _, _, det_B, det_A = jacobians(robot)(modes.states.q)
    np.testing.assert_allclose(det_B, np.cos(elbows).prod(axis=1), rtol=0.3)
    np.testing.assert_allclose(det_A, det_B, rtol=1e-9)


def test_without_a_tool_there_is_no_mode_out_of_reach():
    five_bar = built("five_bar").mechanism.model_copy(update={"tools": {}})
    modes = assembly_modes(lw.Robot(five_bar), dict(motor_1=3.0, motor_2=0.1), starts=100)
    assert len(modes) == 0 and "0 found" in repr(modes)


def test_an_arm_of_six_joints_with_a_spherical_wrist_has_eight():
    modes = working_modes(built("puma560"))
    assert len(modes) == 8
    poses = built("puma560").tool_pose(modes.states)
    np.testing.assert_allclose(
        poses, np.tile(built("puma560").tool_pose(built("puma560").home), (8, 1)), atol=1e-8
    )


@pytest.mark.long
def test_the_first_mode_is_the_reference_s():
    modes = assembly_modes(built("stewart"))
    np.testing.assert_allclose(
        built("stewart").tool_pose(modes.states.at(0)),
        built("stewart").tool_pose(built("stewart").home),
        atol=1e-9,
    )


@pytest.mark.long
def test_idle_spins_make_no_modes():
    """The hexaglide with rods that may spin about themselves has the assembly modes of the one
    whose rods may not."""
    with_spins = lw.Robot(lw.robots.hexaglide(idle_spins=True))
    assert len(with_spins.idle) == 6
    found, expected = (
        tool_kernel(robot)(assembly_modes(robot).states.q)[0]
        for robot in (with_spins, built("hexaglide"))
    )
    assert len(found) == len(expected)
    apart = np.linalg.norm(found[:, None] - expected, axis=2)
    np.testing.assert_allclose(apart.min(axis=1), 0, atol=1e-8)


def test_how_sure_a_count_is():
    modes = assembly_modes(
        dietmaier(),
        {f"leg_{i}": s**0.5 for i, s in enumerate(DIETMAIER_SQUARES, start=1)},
        starts=200,
    )
    after, known = modes.found
    assert len(modes) == known[-1] < 40
    assert (np.diff(after) > 0).all() and after[-1] <= modes.starts == 200
    assert not modes.sure and modes.missing > 1
    assert modes.hits.sum() == modes.converged < 200
    again = assembly_modes(
        dietmaier(),
        {f"leg_{i}": s**0.5 for i, s in enumerate(DIETMAIER_SQUARES, start=1)},
        starts=200,
    )
    np.testing.assert_array_equal(again.states.q, modes.states.q)


def test_joint_limits_are_told():
    described = lw.robots.five_bar()
    limited = described.joints["elbow_1"].model_copy(
        update={"limits": lw.Limits(lower=-3.0, upper=0.0)}
    )
    robot = lw.Robot(
        described.model_copy(update={"joints": {**described.joints, "elbow_1": limited}})
    )
    inside = working_modes(robot).within_limits
    assert inside[0] and 0 < inside.sum() < 4


@pytest.mark.long
def test_out_of_reach_there_is_no_mode():
    modes = working_modes(built("five_bar"), [5.0, 0.0])
    assert len(modes) == 0 and not modes.sure
    assert "0 found" in repr(modes)


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (
            lambda: assembly_modes(built("prr3"), {"slide_1": 0.1}),
            "slide_1: 1 coordinate is given, but the mobility is 3",
        ),
        (lambda: assembly_modes(built("prr3"), {"slid_1": 0.1}), "there is no joint 'slid_1'"),
        (lambda: assembly_modes(built("prr3"), [0.1]), "give coordinates by name"),
        (
            lambda: assembly_modes(built("prr3"), {f"slide_{i}": np.nan for i in (1, 2, 3)}),
            "finite",
        ),
        (lambda: assembly_modes(built("prr3"), starts=0), "starts is 0"),
        (lambda: working_modes(built("prr3"), [0.5, 0.3]), "3 numbers"),
        (lambda: working_modes(built("bricard")), "names no tool"),
        (lambda: working_modes(built("four_bar")), "name the coordinates"),
        (
            lambda: working_modes(built("stewart"), what=("x", "y", "z", "rx")),
            "4 coordinates are given, but the mobility is 6",
        ),
        (
            lambda: working_modes(built("four_bar"), what=("w",)),
            "there is no coordinate of the tool 'w'",
        ),
    ],
)
def test_refusals(ask, told):
    with pytest.raises(lw.LinkworkError, match=told) as refusal:
        ask()
    assert "\n" not in str(refusal.value)


def test_angles_are_told_within_a_turn_and_within_their_limits():
    """The 3-RRS' legs bend at 0.867 and 2.669 rad (law of cosines); with limits beyond a half turn,
    at these and a turn less."""
    robot, task = built("rrs3"), {"z": 0.25, "rx": 0.0, "ry": 0.0}
    base, platform, first, second = 0.2, 0.15, 0.15, 0.2
    away, reach = np.arctan2(0.25, platform - base), np.hypot(0.25, platform - base)
    bend = np.arccos((reach**2 + first**2 - second**2) / (2 * reach * first))
    motors = [robot.coordinates.index(name) for name in robot.actuators]
    for limits, turn in ((None, 0), (lw.Limits(lower=-6.0, upper=-3.0), -2 * np.pi)):
        joints = dict(robot.mechanism.joints)
        for name in robot.actuators:
            joints[name] = joints[name].model_copy(update={"limits": limits or lw.Limits()})
        asked = lw.Robot(robot.mechanism.model_copy(update={"joints": joints}))
        modes = working_modes(asked, list(task.values()), what=tuple(task))
        assert len(modes) == 8 and modes.within_limits.all()
        found = modes.states.positions[:, motors] - away - turn
        np.testing.assert_allclose(np.abs(found), bend, atol=1e-9)
        assert np.max(asked.closure_error(modes.states)) < 1e-12
