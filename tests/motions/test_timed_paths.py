"""Joints and tools from point to point, through points and around corners, within their limits."""

from itertools import pairwise

import numpy as np
import pytest

import linkwork as lw
from linkwork import LinkworkError, control, motions, paths
from linkwork.motions.spline_times import spline_through

from tests.catalogue import built

LIMITS = motions.AxisLimits(speed=0.5, acceleration=3.0, jerk=40.0)
BOUNDS = np.array([[0.5], [3.0], [40.0]])
POSES = np.array([[0.48, 0.30, 1.2], [0.50, 0.31, 1.3], [0.51, 0.28, 1.2], [0.48, 0.29, 1.1]])
ENDS = {"slide_1": 0.16, "slide_2": 0.16, "slide_3": 0.16}, {"slide_1": 0.2, "slide_2": 0.18}


@pytest.fixture(scope="module")
def robot():
    return built("prr3")


def kept(timed, bounds=BOUNDS):
    """Return how near to its limits a timed path comes, by dense samples and in closed form."""
    t = np.linspace(0, timed.duration, 5001)
    dense = np.array([np.abs(timed.profile(t, order)).max(axis=0) for order in (1, 2, 3)])
    assert (dense <= timed.extremes() * (1 + 1e-12)).all()
    return (timed.extremes() / bounds).max()


@pytest.mark.parametrize("law", motions.LAWS)
@pytest.mark.parametrize("synchronised", [True, False])
def test_point_to_point_keeps_all_limits_and_reaches_one(law, synchronised):
    limits = motions.AxisLimits([0.5, 0.2, 1.0], 3.0, None if law == "trapezoidal" else 40.0)
    timed = motions.point_to_point(
        POSES[0], POSES[3] + 1, limits, law=law, synchronised=synchronised
    )
    bounds = np.array([[0.5, 0.2, 1.0], [3.0] * 3, [np.inf if law == "trapezoidal" else 40.0] * 3])
    assert kept(timed, bounds) == pytest.approx(1, abs=1e-12)
    x, v, _ = timed.sample([0, timed.duration])
    assert x == pytest.approx(POSES[[0, 3]] + [[0], [1]], abs=1e-14)
    assert np.abs(v).max() < 1e-13


def test_synchronised_axes_move_in_proportion_and_others_by_themselves():
    together = motions.point_to_point({"a": 0.0, "b": 1.0}, {"a": 0.4, "b": 0.9}, LIMITS)
    apart = motions.point_to_point(
        {"a": 0.0, "b": 1.0}, {"a": 0.4, "b": 0.9}, LIMITS, synchronised=False
    )
    x = together.sample(np.linspace(0, together.duration, 7))[0]
    assert x[:, 0] / 0.4 == pytest.approx((1 - x[:, 1]) / 0.1, abs=1e-14)
    assert together.duration == pytest.approx(apart.duration, rel=1e-14)
    alone = motions.s_curve(0.1, speed=0.5, acceleration=3.0, jerk=40.0)
    assert apart.sample([alone.duration])[0][0, 1] == pytest.approx(0.9, abs=1e-15)
    assert together.sample([alone.duration])[0][0, 1] > 0.91


@pytest.mark.parametrize("degree", [3, 5])
def test_a_spline_passes_its_points_at_rest_at_the_ends_and_reaches_a_limit(degree):
    timed = motions.through(POSES, LIMITS, degree=degree)
    x, v, a = timed.sample(np.array(timed.passed))
    assert x == pytest.approx(POSES, abs=1e-14)
    assert np.abs(v[[0, -1]]).max() < 1e-13
    assert degree == 3 or np.abs(a[[0, -1]]).max() < 1e-12
    assert kept(timed) == pytest.approx(1, abs=1e-12)
    inner = timed.profile.knots[1:-1]
    for order in range(degree):  # continuous up to the order of the degree less one
        jump = timed.profile(inner, order) - timed.profile(inner * (1 - 1e-13), order)
        assert np.abs(jump).max() < 1e-9


@pytest.mark.parametrize("law", motions.LAWS)
def test_blended_corners_are_cut_within_limits(law):
    limits = motions.AxisLimits(0.5, 3.0, None if law == "trapezoidal" else 40.0)
    corner = [[0.0, 0.0], [0.0, 0.1], [0.3, 0.1], [0.3, 0.0]]
    stopping = motions.blended(corner, limits, blend=0, law=law)
    timed = motions.blended(corner, limits, blend=0.3, law=law)
    bounds = BOUNDS if law != "trapezoidal" else np.array([[0.5], [3.0], [np.inf]])
    assert kept(timed, bounds) <= 1 + 1e-12
    assert timed.duration < 0.9 * stopping.duration
    legs = [motions.point_to_point(a, b, limits, law=law) for a, b in pairwise(corner)]
    assert stopping.duration == pytest.approx(sum(leg.duration for leg in legs), rel=1e-13)
    x = timed.sample(np.linspace(0, timed.duration, 2001))[0]
    assert x[[0, -1]] == pytest.approx(np.array(corner)[[0, -1]], abs=1e-14)
    # Alike at both corners, and inside their triangles.
    assert x == pytest.approx((x * [-1, 1] + [0.3, 0])[::-1], abs=1e-12)
    cut = x[(x[:, 0] > 1e-9) & (x[:, 1] < 0.1 - 1e-9) & (x[:, 0] < 0.15)]
    assert len(cut) > 10 and (cut[:, 1] > 0.05).all() and (cut[:, 0] < 0.05).all()


def test_legs_that_go_on_in_one_direction_are_slowed_to_keep_the_limits():
    timed = motions.blended([[0.0], [0.2], [0.4]], LIMITS, blend=0.5)
    assert kept(timed) <= 1 + 1e-12


def test_pick_and_place_lifts_goes_across_and_sets_down():
    timed = motions.pick_and_place([0.0, 0.0, 0.0], [0.3, 0.1, 0.0], [0, 0, 0.1], LIMITS)
    x = timed.sample(np.linspace(0, timed.duration, 501))[0]
    assert x[0] == pytest.approx([0, 0, 0], abs=1e-15)
    assert x[-1] == pytest.approx([0.3, 0.1, 0], abs=1e-14)
    assert 0.09 < x[:, 2].max() <= 0.1 + 1e-14
    named = motions.pick_and_place({"a": 0, "b": 1}, {"a": 2, "b": 1}, {"b": 0.5}, LIMITS)
    assert named.names == ("a", "b")


def test_joints_lead_the_robot_as_the_tool_does(robot):
    """The same motion by the tool's coordinates: rates and accelerations by another formulation."""
    led = motions.point_to_point(robot.home, ENDS[1], LIMITS, law="septic")
    motion = motions.follow(robot, led, samples=401)
    assert led.names == robot.independent
    assert motion.state["slide_1"] == pytest.approx(led.sample(motion.time)[0][:, 0], abs=1e-12)
    assert motion.rates == pytest.approx(led.sample(motion.time)[1], abs=1e-10)
    # All joints: derivatives of their positions over time.
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(motion.time, motion.positions)
    inside = slice(20, -20)
    assert spline(motion.time, 1)[inside] == pytest.approx(motion.joint_rates[inside], abs=1e-6)
    assert spline(motion.time, 2)[inside] == pytest.approx(
        motion.joint_accelerations[inside], abs=3e-3
    )
    assert robot.closure_error(motion.state).max() < 1e-12


def test_any_joints_that_determine_the_motion_may_be_led():
    robot = built("five_bar")
    ahead = robot.assemble(
        {"motor_1": robot.home["motor_1"] + 0.2, "motor_2": robot.home["motor_2"]}
    )
    start, end = (
        {name: float(state[name]) for name in ("elbow_1", "motor_2")}
        for state in (robot.home, ahead)
    )
    motion = motions.follow(robot, motions.point_to_point(start, end, LIMITS), samples=31)
    assert motion.positions[-1] == pytest.approx(ahead.positions, abs=1e-10)
    # Forces found by inverse dynamics lead there too.
    forces = robot.inverse_dynamics(
        motions.follow(robot, motions.point_to_point(start, end, LIMITS, law="septic"), samples=401)
    )
    run = robot.simulate(robot.home, forces, duration=forces.times[-1], rtol=1e-9)
    assert run["joint_position"].values[-1] == pytest.approx(ahead.positions, abs=1e-6)


@pytest.mark.sample(4)
@pytest.mark.parametrize("law", ["quintic", "septic", "cycloidal"])
@pytest.mark.parametrize(("count", "samples"), [(2, 2), (100, 1001)])
def test_signals_are_the_path_however_many_points_it_has(law, count, samples):
    points = [{"a": x} for x in np.random.default_rng(0).uniform(-1, 1, count)]
    timed = motions.blended(points, motions.AxisLimits(speed=1.0, acceleration=10.0), law=law)
    times = np.linspace(0, timed.duration, 20_011)
    place, rate, _ = timed.sample(times)
    signal = timed.signal(samples=samples)
    np.testing.assert_allclose(signal(times), place, atol=3e-6)
    np.testing.assert_allclose(signal.derivative()(times), rate, atol=3e-3)


def test_computed_torque_follows_the_exact_signal(robot):
    timed = motions.point_to_point(robot.home, ENDS[1], LIMITS)
    goal = timed.signal(robot.actuators)
    t = np.linspace(0, timed.duration, 41)
    assert goal(t) == pytest.approx(timed.sample(t)[0], abs=1e-15)
    law = control.ComputedTorque(goal, model=robot, kp=400.0, kd=40.0)
    run = robot.simulate(robot.home, law, duration=timed.duration, rtol=1e-10, save_at=t)
    found = run["joint_position"].sel(coordinate=[*robot.actuators]).values
    assert found == pytest.approx(timed.sample(t)[0], abs=1e-7)


def test_tools_follow_what_robot_follow_follows(robot):
    timed = motions.through(POSES, LIMITS)
    motion = motions.follow(robot, timed, samples=51)
    assert robot.tool_pose(motion.state) == pytest.approx(timed.sample(motion.time)[0], abs=1e-9)
    again = robot.follow(timed.path, timed.duration, samples=51)
    assert (again.positions == motion.positions).all()


def test_orientations_take_the_short_way():
    near = [[0, 0, 0, 0, 0, 3.1], [0, 0, 0, 0, 0, -3.1], [0, 0, 0, 0.01, 0, -3.0]]
    x = motions.through(np.array(near) + 0.0, LIMITS).sample(np.linspace(0, 0.1, 3))[0]
    passed = motions.through(near, LIMITS)
    x = passed.sample(np.array(passed.passed))[0]
    assert np.abs(np.diff(x[:, 5])).max() < 0.3
    for row, given in zip(x, near, strict=True):
        angle, wanted = np.linalg.norm(row[3:]), np.linalg.norm(given[3:])
        assert np.cos(angle) == pytest.approx(np.cos(wanted), abs=1e-12)


def test_the_least_duration_of_three_points_is_that_of_a_search_over_their_middle_time():
    """Of two times only their ratio is free."""
    points = np.array([[0.0, 0.0], [0.9, -0.2], [0.7, 0.5]])
    bounds = motions.AxisLimits(speed=1.0, acceleration=2.0)

    def duration(part: float) -> float:
        profile = spline_through(np.array([part, 1 - part]), points, 3)
        speed, acceleration, _ = (profile.extremes(order).max() for order in (1, 2, 3))
        return max(speed, np.sqrt(acceleration / 2.0))

    near = min(np.linspace(0.05, 0.95, 181), key=duration)
    shortest = min(map(duration, np.linspace(near - 0.005, near + 0.005, 21)))
    straight = motions.through(points, bounds).duration
    least = motions.through(points, bounds, timing="least")
    assert least.duration == pytest.approx(shortest, rel=1e-3)
    assert least.duration < 0.97 * straight


@pytest.mark.parametrize("degree", [3, 5])
def test_the_least_duration_keeps_all_limits_and_passes_the_points(degree):
    timed = motions.through(POSES, LIMITS, degree=degree, timing="least")
    assert kept(timed) == pytest.approx(1.0, abs=1e-9)
    assert timed.sample(np.array(timed.passed))[0] == pytest.approx(POSES, abs=1e-12)
    assert timed.duration <= motions.through(POSES, LIMITS, degree=degree).duration * (1 + 1e-12)


def test_coordinates_of_the_tool_are_led_by_name(robot):
    timed = motions.point_to_point([1.2, 0.48, 0.30], [1.25, 0.5, 0.29], LIMITS)
    motion = motions.follow(robot, timed, what=("angle", "x", "y"), samples=21)
    same = motions.point_to_point([0.48, 0.30, 1.2], [0.5, 0.29, 1.25], LIMITS)
    expected = motions.follow(robot, same, samples=21)
    assert motion.tool[:, [1, 2, 0]] == pytest.approx(expected.tool, abs=1e-12)
    assert motion.positions == pytest.approx(expected.positions, abs=1e-12)


def test_a_circle_is_run_through_at_limits_along_it():
    circle = paths.circle([0.48, 0.3], 0.04)
    timed = motions.along(circle, motions.AxisLimits(speed=0.2, acceleration=2.0, jerk=30.0))
    _, v, a = timed.sample(np.linspace(0, timed.duration, 2001))
    speed = np.linalg.norm(v, axis=1)
    assert speed.max() == pytest.approx(0.2, rel=1e-12)
    tangential = np.abs(np.gradient(speed, timed.duration / 2000))
    assert tangential.max() == pytest.approx(2.0, rel=1e-2) or tangential.max() < 2.0
    assert timed.duration == pytest.approx(
        motions.s_curve(2 * np.pi * 0.04, speed=0.2, acceleration=2.0, jerk=30.0).duration
    )
    assert np.abs(np.einsum("kd,kd->k", v, a) / np.maximum(speed, 1e-9)).max() < 2.0 + 1e-9


def test_joints_leave_their_range_only_where_that_is_allowed(robot):
    data = robot.mechanism.model_dump()
    data["joints"]["slide_1"]["limits"] = {"upper": 0.19}
    bounded = lw.Robot(lw.Mechanism.model_validate(data))
    timed = motions.point_to_point(bounded.home, ENDS[1], LIMITS)
    with pytest.raises(LinkworkError, match=r"slide_1 is above its upper limit 0.19 from t = "):
        motions.follow(bounded, timed)
    assert motions.follow(bounded, timed, keep_limits=False).state["slide_1"][-1] == pytest.approx(
        0.2
    )


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: motions.point_to_point(POSES[0], POSES[0], LIMITS), "the end is the start"),
        (lambda: motions.point_to_point(POSES[0], [1, 2], LIMITS), "point 1 is .*; give 3 numbers"),
        (
            lambda: motions.point_to_point({"a": 1}, {"b": 1}, LIMITS),
            "no coordinate 'b' of point 0",
        ),
        (lambda: motions.point_to_point({"a": 1}, [1.0], LIMITS), "point 1 is .*by name"),
        (lambda: motions.point_to_point({"a": np.nan}, {"a": 1}, LIMITS), "a of point 0 is nan"),
        (lambda: motions.point_to_point({"a": 0}, {"a": 1}, 3.0), "the limits are 3.0; give"),
        (lambda: motions.point_to_point({"a": 0}, {"a": 1}, LIMITS, law="sine"), "no motion law"),
        (
            lambda: motions.point_to_point({"a": 0}, {"a": 1}, motions.AxisLimits({"b": 1})),
            "no coordinate 'b' with a speed limit",
        ),
        (
            lambda: motions.point_to_point(POSES[0], POSES[1], motions.AxisLimits([1, 2])),
            "give one",
        ),
        (
            lambda: motions.point_to_point({"a": 0}, {"a": 1}, LIMITS, law=lambda d, **limits: 3),
            "the law returns 3; give a function that returns a Profile",
        ),
        (
            lambda: motions.through(
                [{"a": 0, "b": 0}, {"a": 1, "b": 0}, {"a": 1, "b": 2}],
                motions.AxisLimits({"b": 1}),
            ),
            "nothing limits the way from point 0",
        ),
        (lambda: motions.through(POSES[:2], LIMITS), "2 points are given; give at least 3"),
        (lambda: motions.through([*POSES[:2], POSES[1]], LIMITS), "point 2 is point 1"),
        (lambda: motions.through(POSES, LIMITS, degree=4), "give 3 or 5"),
        (lambda: motions.through(POSES, LIMITS, timing="best"), "give 'straight' or 'least'"),
        (lambda: motions.blended(POSES, LIMITS, blend=0.7), "the blend is 0.7"),
        (lambda: motions.pick_and_place(POSES[0], POSES[1], [1], LIMITS), "give 3 numbers"),
        (lambda: motions.along(paths.swing(0, 1), LIMITS), "does not move at one rate"),
        (lambda: motions.along(3, LIMITS), "the path is 3"),
    ],
)
def test_refusals(call, said):
    with pytest.raises(LinkworkError, match=said):
        call()


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda r: motions.through([*POSES[:3], [3.0, 0, 0]], LIMITS), r"point 3 \(t = .* s\): "),
        (lambda r: motions.point_to_point({"slide_1": 0}, {"slide_1": 1}, LIMITS), "3 determine"),
        (lambda r: motions.point_to_point({"s": 0}, {"s": 1}, LIMITS), "there is no joint 's'"),
        (lambda r: 3, "what is followed is 3"),
    ],
)
def test_what_cannot_be_followed_is_refused(made, said, robot):
    with pytest.raises(LinkworkError, match=said):
        motions.follow(robot, made(robot))


@pytest.mark.parametrize(
    ("ends", "what", "said"),
    [
        (ENDS, ("x", "y"), "the path leads the joints slide_1, slide_2, slide_3; leave what="),
        ((POSES[0], POSES[1]), ("x", "y"), "names 2 coordinates, but the path leads 3"),
        ((POSES[0], POSES[1]), "x", "give a list of names"),
        (
            ({"y": 0, "x": 0}, {"y": 1}),
            ["x", "y"],
            r"leads y, x, in this order; give what=.'y', 'x'",
        ),
    ],
)
def test_names_that_do_not_fit_the_path_are_refused(ends, what, said, robot):
    with pytest.raises(LinkworkError, match=said):
        motions.follow(robot, motions.point_to_point(*ends, LIMITS), what=what)


def test_points_led_on_as_rotation_vectors_lead_no_other_angles():
    """Roll, pitch and yaw (0, -1.05, 3.04) are not those of (0, 1, -2.9), as the vectors are."""
    described = lw.robots.puma560().model_dump()
    (tool,) = described["tools"].values()
    tool["task"] = ("x", "y", "z", "roll", "pitch", "yaw")
    arm = lw.Robot(lw.Mechanism(**described))
    ends = [0.4, 0.1, 0.2, 0, 0, 3.0], [0.4, 0.1, 0.2, 0, 1.0, -2.9]
    around = motions.point_to_point(*ends, LIMITS)
    lifted = motions.pick_and_place(*ends, [0, 0, 0.1, 0, 0, 0], LIMITS)
    limits = motions.ActuatorLimits(force=100.0)
    for call in (
        lambda: motions.follow(arm, around),
        lambda: motions.follow(arm, lifted),
        lambda: motions.fastest(arm, around, limits),
    ):
        with pytest.raises(LinkworkError, match="was taken for a rotation vector and led on by"):
            call()


@pytest.mark.sample(1)
@pytest.mark.parametrize("samples", [2, 201])
def test_joints_led_beyond_a_fold_do_not_leap_to_another_assembly_mode(samples):
    """The motors of a 3-RRS go on beyond where they determine its platform: led in small steps it
    falls by a fifth of a metre in one of them."""
    robot = built("rrs3")
    ends = [[0.86745736] * 3, [0.27198472, 0.18059837, 1.64544324]]
    around = [dict(zip(robot.actuators, values, strict=True)) for values in ends]
    timed = motions.point_to_point(*around, motions.AxisLimits(speed=1.0), law="quintic")
    times, state, heights = np.arange(0.5, 0.65, 1e-3), robot.home, []
    for values in timed.sample(times)[0]:
        state = robot.assemble(dict(zip(robot.actuators, values, strict=True)), guess=state)
        heights.append(robot.tool_pose(state)[2])
    k = int(np.argmax(np.abs(np.diff(heights))))
    assert heights[k] - heights[k + 1] > 0.17 > 20 * np.abs(np.diff(heights[:k])).max()
    with pytest.raises(LinkworkError, match="would leap to another assembly mode") as told:
        motions.follow(robot, timed, samples=samples)
    assert times[k] < float(str(told.value).split()[3].rstrip("s")) < times[k + 1] + 1e-4


def test_other_joints_take_their_turns_between_samples_far_apart():
    crank = lw.Robot("four_bar")
    start = float(crank.home["crank_pivot"])
    around = {"crank_pivot": start}, {"crank_pivot": start + 20.0}
    timed = motions.point_to_point(*around, motions.AxisLimits(speed=9.0), law="quintic")
    coarse, fine = (motions.follow(crank, timed, samples=count) for count in (3, 101))
    assert coarse.positions == pytest.approx(fine.positions[::50], abs=1e-9)
    assert np.abs(np.diff(fine.positions[[0, -1]], axis=0)).max(axis=0)[1] > 12


@pytest.mark.parametrize("count", [1, 10**9, 2.5, "x"])
def test_numbers_of_samples_that_make_no_motion_are_refused(count, robot):
    timed = motions.point_to_point(robot.home, ENDS[1], LIMITS)
    with pytest.raises(LinkworkError, match="the number of samples"):
        motions.follow(robot, timed, samples=count)


@pytest.mark.parametrize("way", [1, -1])
def test_a_tool_that_turns_on_and_on_is_not_turned_back(way):
    """Three turns in quarters, each told as a rotation vector of at most half a turn."""
    axis, quarters = way * np.array([2.0, -1.0, 2.0]) / 3, np.arange(13) * np.pi / 2
    told = (quarters + np.pi / 2) % (2 * np.pi) - np.pi / 2
    told[told > np.pi] -= 2 * np.pi
    poses = np.column_stack([0.1 * quarters, np.zeros((13, 2)), told[:, None] * axis])
    timed = motions.through(poses, motions.AxisLimits(speed=1.0))
    x = timed.sample(np.array(timed.passed))[0]
    assert x[:, 3:] == pytest.approx(quarters[:, None] * axis, abs=1e-9)
