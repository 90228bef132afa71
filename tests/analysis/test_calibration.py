"""Calibration: the truth is found to rounding without noise and within the stated deviations with
it; what cannot be seen is named; the chosen poses are the best ones."""

from __future__ import annotations

import contextlib
import warnings
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import linkwork as lw
from linkwork import analysis
from linkwork.analysis._observability import echelon, volume
from linkwork.analysis.measured_poses import PoseModel, model_of, readings_of, turning
from linkwork.errors import ModelWarning

from tests.analysis import mechanisms
from tests.catalogue import WHOLE
from tests.equations.evaluation import close


def puma() -> tuple[lw.Robot, lw.State]:
    """The arm with all errors of its first frames, and poses all over its joints' range."""
    mechanism = lw.robots.puma560()
    paths = [
        f"joint_{i}.frames.0.{part}.{c}"
        for i in range(1, 7)
        for part in ("turn", "position")
        for c in "xyz"
    ]
    robot = lw.Robot(mechanism).free(*paths)
    return robot, robot.state(np.random.default_rng(0).uniform(-2, 2, (30, 6)))


@pytest.fixture(scope="module")
def arm() -> tuple[lw.Robot, lw.State]:
    return puma()


@pytest.fixture(scope="module")
def rpr() -> tuple[lw.Robot, lw.State]:
    """The 3-RPR with its pivots, zeros of its pistons and wrists free; poses of its workspace."""
    robot = lw.Robot("rpr3").free(
        *(f"pivot_{i}.frames.0.position.{c}" for i in (1, 2, 3) for c in "xy"),
        *(f"slide_{i}.frames.0.position.x" for i in (1, 2, 3)),
        *(f"wrist_{i}.frames.1.position.{c}" for i in (1, 2, 3) for c in "xy"),
    )
    random = np.random.default_rng(3)
    goals = robot.tool_pose(robot.home) + random.uniform(-1, 1, (25, 3)) * (0.1, 0.1, 0.4)
    states = [robot.assemble(tool=goal) for goal in goals]
    return robot, robot.state(np.array([state.positions for state in states]))


def errors(robot: lw.Robot, size: float, seed: int) -> dict[str, float]:
    step = size * np.random.default_rng(seed).standard_normal(robot.p.size)
    return dict(zip(robot.parameters, map(float, robot.p + step), strict=True))


def measured(robot: lw.Robot, near: lw.State, truth: dict[str, float]) -> tuple[lw.State, lw.State]:
    """Return where the description stands at the readings of a robot with other values, and where
    that robot stands, its tool at the poses of given states."""
    real = robot.with_parameters(truth)
    there = [real.assemble(tool=pose) for pose in robot.tool_pose(near)]
    told = [
        robot.assemble({name: float(state[name]) for name in robot.actuators}, guess=guess)
        for state, guess in zip(there, near, strict=True)
    ]
    states = robot.state(np.array([state.positions for state in told]))
    return states, real.state(np.array([state.positions for state in there]))


def test_the_rotation_vector_falls_as_its_derivative_says():
    """r' = -B omega, by differences, near zero and far from it."""
    random = np.random.default_rng(1)
    for size in (1e-9, 1e-4, 0.3, 2.5):
        r = size * random.standard_normal(3)
        for k in range(3):
            step = 1e-6 * np.eye(3)[k]
            ends = [
                (Rotation.from_rotvec(r) * Rotation.from_rotvec(s * step).inv()).as_rotvec()
                for s in (1, -1)
            ]
            close(-turning(r[None])[0, :, k], (ends[0] - ends[1]) / 2e-6, 1e-8)


@pytest.mark.parametrize("name", ["arm", "rpr"])
def test_derivatives_are_those_of_differences(name, request):
    """Of the tool and of a further joint, with the loops closed again."""
    robot, states = request.getfixturevalue(name)
    joints = () if name == "arm" else ("pivot_1",)
    model = model_of(robot, (2, 3, 4) if robot.planar else tuple(range(6)), joints)
    q, readings = readings_of(robot, states)
    slopes = model.slopes(model.closed(q, readings, robot.p), robot.p)
    tool = np.zeros((len(q), 6))
    for k in range(0, robot.p.size, 5):
        ends = []
        for sign in (1, -1):
            p = robot.p + sign * 1e-6 * np.eye(robot.p.size)[k]
            there = model.closed(q, readings, p)
            ends.append(model.remains(there, p, tool, np.zeros((len(q), len(joints)))))
        difference = (ends[1] - ends[0]) / 2e-6
        rows = [place for place, row in enumerate(model.rows) if row > 2]
        rows += list(range(len(model.rows), difference.shape[1]))
        close(slopes[:, rows, k], difference[:, rows], 1e-8)


def test_an_arm_is_found_to_rounding_and_saved(arm, tmp_path):
    robot, states = arm
    truth = errors(robot, 2e-3, 1)
    poses = robot.with_parameters(truth)
    pose = poses.tool_pose(poses.state(states.positions))
    found = analysis.calibrate(robot, analysis.MeasuredPoses(states, pose))
    assert found.chi_square < 1e-24
    others = np.random.default_rng(9).uniform(-2, 2, (20, 6))
    close(
        found.robot.tool_pose(found.robot.state(others)),
        poses.tool_pose(poses.state(others)),
        1e-12,
    )
    found.mechanism.save(tmp_path / "arm.yaml")
    again = lw.Robot(lw.Mechanism.load(tmp_path / "arm.yaml"))
    close(again.tool_pose(again.state(others)), poses.tool_pose(poses.state(others)), 1e-12)


@pytest.mark.long
def test_directions_of_axes_in_closed_loops_are_found():
    """All errors of the six hinges of a 3-RRS, tilts among them, from measured poses: of 36 numbers
    27 are seen, and other poses are then met to rounding."""
    plain = lw.Robot("rrs3")
    hinges = [f"{part}_{i}" for part in ("motor", "knee") for i in (1, 2, 3)]
    robot = plain.free(
        *(
            f"{n}.frames.0.{field}.{c}"
            for n in hinges
            for field in ("turn", "position")
            for c in "xyz"
        )
    )
    random, truth = np.random.default_rng(0), errors(robot, 5e-4, 3)
    real = robot.with_parameters(truth)
    home = np.array([robot.home[name] for name in robot.actuators])
    samples = []
    for led in home + random.uniform(-0.15, 0.15, (40, 3)):
        asked = dict(zip(robot.actuators, map(float, led), strict=True))
        samples.append((robot.assemble(asked), real.assemble(asked)))
    samples = [
        (state, there)
        for state, there in samples
        if np.abs(state.positions - there.positions).max() < 0.1
    ]
    states = robot.state(np.array([state.positions for state, _ in samples]))
    pose = np.array([real.tool_pose(there) for _, there in samples])
    found = analysis.calibrate(
        robot, analysis.MeasuredPoses(robot.state(states.positions[:30]), pose[:30])
    )
    assert found.chi_square < 1e-20 and found.observability.rank == 27 and len(samples) > 32
    asked = [
        dict(zip(robot.actuators, map(float, (s[n] for n in robot.actuators)), strict=True))
        for s, _ in samples[30:]
    ]
    for led, expected in zip(asked, pose[30:], strict=True):
        close(found.robot.tool_pose(found.robot.assemble(led)), expected, 1e-9)


def test_what_is_not_seen_of_an_arm_is_named(arm):
    """Six hinges take 4 numbers each, and the tool none more: 26 of 36 are seen, for a hinge's zero
    and its place along its axis are also those of the hinge before, where the axes are parallel."""
    robot, states = arm
    found = analysis.observability(robot, states)
    assert found.rank == 26 and len(found.unseen) == 10 and len(found.sufficient) == 26
    for combination in found.unseen:
        step = {path: robot.parameters[path] + 1e-5 * x for path, x in combination.items()}
        moved = robot.with_parameters(step)
        apart = moved.tool_pose(moved.state(states.positions)) - robot.tool_pose(states)
        assert np.abs(apart).max() < 1e-9, combination
    fewer = lw.Robot(robot.mechanism).free(*found.sufficient)
    assert analysis.observability(fewer, fewer.state(states.positions)).seen.all()


def test_turns_about_an_axis_are_not_seen_where_it_is_turned_onto_itself():
    """The tool's turn about the last hinge's axis is that hinge's own zero, and a tool that is a
    point on it does not see it at all."""
    paths = ("joint_6.frames.0.turn.z", "joint_6.frames.1.turn.z")
    robot = lw.Robot("puma560").free(*paths)
    states = robot.state(np.random.default_rng(0).uniform(-2, 2, (10, 6)))
    both = analysis.observability(robot, states)
    assert both.rank == 1 and {*both.unseen[0]} == {*paths}
    assert abs(both.unseen[0][paths[1]]) == pytest.approx(1.0)
    assert analysis.observability(robot, states, measure="position").rank == 0
    assert "not seen: joint_6.frames.0.turn.z" in repr(both)


def test_redundant_encoders_find_lengths_without_a_tool(rpr):
    """The angles of the three pivots beside the pistons: where the robot stands, and where a
    platform that nobody sees has its frame, is not told; the pistons' lengths give the scale."""
    robot, near = rpr
    truth = errors(robot, 1e-3, 2)
    states, real = measured(robot, near, truth)
    joints = {name: real[name] for name in ("pivot_1", "pivot_2", "pivot_3")}
    joints["pivot_2"] = joints["pivot_2"] + 2 * np.pi  # counted from elsewhere
    found = analysis.calibrate(robot, analysis.MeasuredPoses(states, joints=joints))
    assert found.chi_square < 1e-22 and found.observability.rank == 15 - 2 - 3
    for path, seen in zip(found.values, found.observability.seen, strict=True):
        assert seen == path.startswith("slide")
        assert not seen or found.values[path] == pytest.approx(truth[path], abs=1e-11)

    def apart(values: dict[str, float], one: int, two: int, at: str) -> float:
        place = [[values[f"{at.format(i)}.position.{c}"] for c in "xy"] for i in (one, two)]
        return float(np.linalg.norm(np.subtract(place[0], place[1])))

    for at in ("pivot_{}.frames.0", "wrist_{}.frames.1"):
        for one, two in ((1, 2), (2, 3), (3, 1)):
            assert apart(found.values, one, two, at) == pytest.approx(
                apart(truth, one, two, at), abs=1e-11
            )


@pytest.mark.long
def test_estimates_scatter_as_their_deviations_say(rpr):
    """Chi-square of the errors of all seen numbers, over seeds, lies within its central 99.8 %."""
    robot, near = rpr
    truth = errors(robot, 1e-3, 4)
    states, real = measured(robot, near, truth)
    pose, position, rotation = robot.with_parameters(truth).tool_pose(real), 2e-5, 1e-4
    errors_, remains, seeds = [], [], 20 if WHOLE else 8
    for seed in range(seeds):
        random = np.random.default_rng(seed)
        noise = random.standard_normal(pose.shape) * (position, position, rotation)
        data = analysis.MeasuredPoses(states, pose + noise, position=position, rotation=rotation)
        found = analysis.calibrate(robot, data)
        seen = found.observability.directions[:, : found.observability.rank]
        apart = (np.array([*found.values.values()]) - [*truth.values()]) / found.observability.sizes
        errors_.append(
            np.sum((found.observability.singular[: seen.shape[1]] * (seen.T @ apart)) ** 2)
        )
        remains.append(found.chi_square)
        assert found.freedoms == pose.size - seen.shape[1]
    for values, freedoms in ((errors_, seen.shape[1]), (remains, found.freedoms)):
        low, high = chi2.ppf([0.001, 0.999], seeds * freedoms)
        assert low < np.sum(values) < high


def test_lengths_of_belts_are_readings():
    """Two belts over a bridge and the head on it, the drives' sum and difference of x and y."""
    body = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
    across = (lw.Frame.planar(0.1, 0.0), lw.Frame())
    described = lw.Mechanism(
        bodies={"bridge": body, "head": body},
        joints={
            "x": lw.PrismaticJoint(connects=("ground", "bridge"), axis=(1, 0, 0)),
            "y": lw.PrismaticJoint(connects=("bridge", "head"), axis=(0, 1, 0), frames=across),
        },
        transmissions={
            f"belt_{sign}": lw.Combination(ratios={"x": 1.0, "y": sign}) for sign in (1, -1)
        },
        actuators=("belt_1", "belt_-1"),
        tools={"tool": lw.Tool(body="head", task=("x", "y"))},
        gravity=(0, 0, 0),
    )
    robot = lw.Robot(described).free("belt_1.ratios.x")
    states = robot.state(np.random.default_rng(0).uniform(-0.3, 0.3, (9, 2)))
    x, y = (np.array(states[name]) for name in "xy")
    # The first belt really counts x 1.02 times.
    moved = (2 * x) / 2.02
    seen = np.stack([moved + 0.1, moved - x + y, 0 * x], axis=1)
    found = analysis.calibrate(robot, analysis.MeasuredPoses(states, seen))
    assert found.values["belt_1.ratios.x"] == pytest.approx(1.02, abs=1e-12)


@pytest.mark.long
def test_noise_of_some_is_not_all_noise(rpr):
    """What is left out, an encoder of those by name or a plate's rotation beside its position, is
    of the size of what is stated; it counted as one of 1 rad, which nobody had stated."""
    robot, near = rpr
    states, real = measured(robot, near, errors(robot, 1e-3, 2))
    joints, length = ("pivot_1", "pivot_2", "pivot_3"), robot.equations.tree.length
    for noise, weighed in ((dict.fromkeys(joints, 1e-4), True), ({"pivot_1": 1e-4}, False)):
        told = analysis.observability(
            robot, states, measure="nothing", joints=joints, encoders=noise
        )
        assert told.weighed == weighed and told.index > 0
        np.testing.assert_allclose(model_of(robot, (), joints, encoders=noise).scales, 1e-4)
    pose = robot.with_parameters(errors(robot, 1e-3, 2)).tool_pose(real)
    data = (
        {"position": 1e-4 * length},
        {"rotation": 1e-4},
        {"position": 1e-4 * length, "rotation": 1e-4},
    )
    found = [
        analysis.calibrate(robot, analysis.MeasuredPoses(states, pose, **each)) for each in data
    ]
    assert [each.weighed for each in found] == [False, False, True]
    np.testing.assert_allclose([each.sizes for each in found], np.tile(found[2].sizes, (3, 1)))


def test_noise_that_is_not_stated_is_estimated(rpr):
    robot, near = rpr
    truth = errors(robot, 1e-3, 4)
    states, real = measured(robot, near, truth)
    pose = robot.with_parameters(truth).tool_pose(real)
    noise = 1e-5 * np.random.default_rng(1).standard_normal(pose.shape)
    noise[:, :2] *= robot.equations.tree.length
    found = analysis.calibrate(robot, analysis.MeasuredPoses(states, pose + noise))
    assert not found.weighed and found.scale == pytest.approx(1e-5, rel=0.3)


@pytest.mark.long
def test_deviations_hold_where_noise_that_is_not_stated_is_of_two_sizes(rpr):
    """Those of the least squares with the noise that really is, where rotations are ten times as
    uncertain, by the robot's own length, as positions, and the other way round: by the noise of all
    rows together they were twice too large, and half of what they should be."""
    robot, near = rpr
    truth = errors(robot, 1e-3, 4)
    states, real = measured(robot, near, truth)
    other = robot.with_parameters(truth)
    pose, length, model = (
        other.tool_pose(real),
        robot.equations.tree.length,
        model_of(other, (2, 3, 4)),
    )
    J = model.slopes(real.q, other.p).reshape(-1, robot.p.size)
    for position, rotation in ((1e-5, 1e-6), (1e-6, 1e-5)):
        told = []
        for seed in range(6):
            noise = np.random.default_rng(seed).standard_normal(pose.shape)
            noise *= (position * length, position * length, rotation)
            found = analysis.calibrate(robot, analysis.MeasuredPoses(states, pose + noise))
            told.append(np.diagonal(found.covariance))
        of_rows = np.tile([rotation, position, position], len(pose))
        exact = np.linalg.norm(np.linalg.pinv(J) * of_rows, axis=1)
        share = np.sqrt(np.mean(told, axis=0)) / exact
        assert share.min() > 0.8 and share.max() < 1.25
        sizes = position * length, rotation
        assert [found.noise[f"tool.{k}"] for k in ("position", "rotation")] == pytest.approx(
            sizes, rel=0.5
        )


def test_the_best_poses_are_those_of_all_choices(rpr):
    """Of 9 candidates and choices of 5, against the determinants of all 126."""
    robot, states = rpr
    few = robot.state(states.positions[:9])
    chosen = analysis.best_poses(robot, few, 5, starts=8)
    model = model_of(robot, (2, 3, 4))
    q, readings = readings_of(robot, few)
    J = model.slopes(model.closed(q, readings, robot.p), robot.p)
    whole = analysis.observability(robot, few)
    V = whole.directions[:, : whole.rank] * whole.sizes[:, None]
    blocks = np.swapaxes(J @ V, 1, 2) @ (J @ V)
    sizes: dict[tuple[int, ...], float] = {
        each: float(volume(blocks[list(each)].sum(axis=0))) for each in combinations(range(9), 5)
    }
    assert sizes[chosen] == pytest.approx(max(sizes.values()), abs=1e-9)


def test_reduced_combinations_span_what_was_given():
    random = np.random.default_rng(2)
    rows = random.standard_normal((3, 4)) @ random.standard_normal((4, 7))
    found, places = echelon(rows)
    close(found[:, places], np.eye(3), 1e-12)
    assert np.linalg.matrix_rank(np.vstack([rows, found]), 1e-9) == 3


def test_what_moves_the_tool_by_rounding_alone_is_not_seen():
    """A tool on a driven arm tells nothing of the links behind it."""
    described, name = lw.robots.five_bar(), "elbow_1"
    arm = next(body for body in described.joints["motor_1"].connects if body != "ground")
    tools = {"arm": lw.mechanism.Tool(body=arm)}
    numbers = (f"{name}.frames.0.position.x", f"{name}.frames.1.position.y")
    robot = lw.Robot(described.model_copy(update={"tools": tools})).free(*numbers)
    turns = np.random.default_rng(1).uniform(-0.1, 0.1, (2, 6))
    states = robot.assemble(
        {of: robot.home[of] + own for of, own in zip(robot.actuators, turns, strict=True)}
    )
    found = analysis.observability(robot, states)
    assert (found.rank, found.index, found.sufficient) == (0, 0.0, ())
    with pytest.raises(lw.LinkworkError, match="tells nothing of the free numbers"):
        analysis.calibrate(robot, analysis.MeasuredPoses(states, robot.tool_pose(states)))
    with pytest.raises(lw.LinkworkError, match="tell nothing of the free numbers"):
        analysis.best_poses(robot, states, 3)


REFUSALS = {
    "what nothing tells of": (
        lambda r, s: (
            lw.Robot("rpr3").free("gravity.y"),
            analysis.MeasuredPoses(s, np.zeros((25, 3))),
        ),
        "tells nothing of the free numbers; free others",
    ),
    "nothing free": (
        lambda r, s: (lw.Robot("rpr3"), analysis.MeasuredPoses(s, np.zeros((25, 3)))),
        "no number of this robot is free",
    ),
    "nothing measured": (lambda r, s: (r, analysis.MeasuredPoses(s)), "nothing was measured"),
    "no measurement": (lambda r, s: (r, np.zeros(3)), "give MeasuredPoses"),
    "no robot": (
        lambda r, s: (3, analysis.MeasuredPoses(s)),
        "the robot is 3; give a linkwork.Robot",
    ),
    "the wrong shape": (
        lambda r, s: (r, analysis.MeasuredPoses(s, np.zeros((3, 3)))),
        r"have the shape \(3, 3\); give \(25, 3\)",
    ),
    "columns in another order": (
        lambda r, s: (
            r,
            analysis.MeasuredPoses(s, pd.DataFrame(r.tool_pose(s), columns=["y", "x", "angle"])),
        ),
        "the measured poses come labelled y, x, angle; give x, y, angle, in this order",
    ),
    "no number": (
        lambda r, s: (r, analysis.MeasuredPoses(s, np.full((25, 3), np.nan))),
        "the measured poses",
    ),
    "an actuator": (
        lambda r, s: (r, analysis.MeasuredPoses(s, joints={"slide_1": np.zeros(25)})),
        "'slide_1' is an actuator",
    ),
    "an unknown joint": (
        lambda r, s: (r, analysis.MeasuredPoses(s, joints={"pivot_9": np.zeros(25)})),
        "there is no joint 'pivot_9'",
    ),
    "no deviation": (
        lambda r, s: (r, analysis.MeasuredPoses(s, np.zeros((25, 3)), position=-1.0)),
        "the deviation of position",
    ),
    "one state": (lambda r, s: (r, analysis.MeasuredPoses(r.home, np.zeros((1, 3)))), "no stack"),
    "no states": (
        lambda r, s: (r, analysis.MeasuredPoses(r.state(s.positions[:0]), np.zeros((0, 3)))),
        "no stack",
    ),
    "too few poses": (
        lambda r, s: (r, analysis.MeasuredPoses(r.state(s.positions[:1]), np.zeros((1, 3)))),
        None,
    ),
}


@pytest.mark.parametrize("name", [name for name, (_, sentence) in REFUSALS.items() if sentence])
def test_refusals(rpr, name):
    make, sentence = REFUSALS[name]
    with pytest.raises(lw.LinkworkError, match=sentence):
        analysis.calibrate(*make(*rpr))


def test_choices_that_tell_too_little_are_refused(rpr):
    robot, states = rpr
    with pytest.raises(lw.LinkworkError, match="measure 5 poses or more"):
        analysis.best_poses(robot, states, 2)
    with pytest.raises(lw.LinkworkError, match="give a number from 1 to 25"):
        analysis.best_poses(robot, states, 26)
    with pytest.raises(lw.LinkworkError, match="measure is 'all'; choose from 'pose'"):
        analysis.observability(robot, states, measure="all")  # pyright: ignore


@pytest.mark.long
def test_a_search_that_ends_beside_the_best_fit_says_so():
    """The rods of a Delta are off by as much as a tenth: on the way to them its loops cease to
    close, where steps become tiny; much was left, and nothing said so."""
    robot, random = lw.Robot("delta").free("rod_*.length"), np.random.default_rng(0)
    off = {path: value + 0.1 * random.normal() for path, value in robot.parameters.items()}
    real, reached = robot.with_parameters(off), []
    home = np.array([robot.home[name] for name in robot.actuators])
    while len(reached) < 12:
        given = dict(zip(robot.actuators, home + 0.2 * random.uniform(-1, 1, 3), strict=True))
        with contextlib.suppress(lw.LinkworkError), warnings.catch_warnings(action="ignore"):
            reached.append((real.assemble(given), robot.assemble(given)))
    states = robot.state(np.array([near.positions for _, near in reached]))
    seen = np.array([real.tool_pose(state)[:3] for state, _ in reached])
    with pytest.warns(ModelWarning, match="the numbers that fit best are not found"):
        analysis.calibrate(robot, analysis.MeasuredPoses(states, seen))


def test_poses_that_do_not_tell_what_all_see_are_no_choice():
    """An arm's base, elbow and tip are 6 numbers, of which a pose tells two: its angle is another
    one. Two poses have as many numbers as that, and tell four."""
    described = mechanisms.arm(1.0, 0.6)
    hip, elbow = described.actuators
    tip = next(iter(described.mechanism.tools))
    places = f"{hip}.frames.0", f"{elbow}.frames.0", f"{tip}.frame"
    robot = described.free(*(f"{place}.position.{axis}" for place in places for axis in "xy"))
    states = robot.state(np.random.default_rng(1).uniform(-1, 1, (6, 2)))
    assert len(analysis.best_poses(robot, states, 3)) == 3
    with pytest.raises(lw.LinkworkError, match="of 2 poses tells 4 of the 6 combinations"):
        analysis.best_poses(robot, states, 2)


def test_numbers_that_open_a_loop_of_redundant_rows_are_refused():
    robot = lw.Robot("bennett")
    name = next(name for name in robot.mechanism.joints if name not in robot.actuators)
    free = robot.free(f"{name}.frames.0.turn.x")
    state = free.state(free.home.positions[None])
    with pytest.raises(lw.LinkworkError, match="more constraints than it needs"):
        analysis.observability(free, state, measure="nothing", joints=[name])


def test_as_many_rows_as_numbers_tell_no_deviation(rpr):
    """All three of one pose's readings go into three numbers; nothing tells the noise."""
    robot, states = rpr
    some = lw.Robot(robot.mechanism).free(*(f"slide_{i}.frames.0.position.x" for i in (1, 2, 3)))
    one = some.state(states.positions[:1])
    pose = some.tool_pose(one) + 1e-5
    found = analysis.calibrate(some, analysis.MeasuredPoses(one, pose))
    assert found.freedoms == 0 and np.isinf(found.deviations).all()
    assert np.isinf(found.covariance).all()
    noise = {"position": 1e-5, "rotation": 1e-5}
    stated = analysis.calibrate(some, analysis.MeasuredPoses(one, pose, **noise))
    assert np.isfinite(stated.deviations).all()


def test_deviations_where_nothing_remains_are_zero_or_infinite(rpr):
    """Of what is not seen by itself no product of nothing and infinity is told."""
    robot, states = rpr
    found = analysis.calibrate(
        robot, analysis.MeasuredPoses(states, joints={"pivot_1": states["pivot_1"]})
    )
    assert found.chi_square == 0 and np.isinf(found.deviations).any()
    assert not np.isnan(found.deviations).any()


@pytest.mark.long
def test_what_looks_like_other_units_is_warned_of(rpr):
    robot, states = rpr
    pose = robot.tool_pose(states)
    for scale, sentence in (((1e3, 1e3, 1.0), "in millimetres"), ((1.0, 1.0, 1e3), "in degrees")):
        with pytest.warns(ModelWarning, match=sentence), contextlib.suppress(lw.LinkworkError):
            analysis.calibrate(robot, analysis.MeasuredPoses(states, pose * scale))


@pytest.mark.long
def test_a_wrong_sample_and_more_than_the_stated_noise_are_warned_of(rpr):
    """Right measurements, in whatever noise, are taken without a word; one pose off by a
    centimetre is named, and so is a noise of which a tenth is stated."""
    robot, near = rpr
    truth = errors(robot, 1e-3, 4)
    states, real = measured(robot, near, truth)
    right, length = robot.with_parameters(truth).tool_pose(real), robot.equations.tree.length
    size = 1e-5 * np.array([length, length, 1.0])
    stated = {"position": 1e-5 * length, "rotation": 1e-5}
    for seed in range(3):
        pose = right + size * np.random.default_rng(seed).standard_normal(right.shape)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for noise in ({}, stated):
                analysis.calibrate(robot, analysis.MeasuredPoses(states, pose, **noise))
        with pytest.warns(ModelWarning, match="times the stated noise"):
            tenth = {name: value / 10 for name, value in stated.items()}
            analysis.calibrate(robot, analysis.MeasuredPoses(states, pose, **tenth))
        pose[7, 0] += 0.01 * length
        for noise in ({}, stated):
            with pytest.warns(ModelWarning, match="sample 7 "):
                analysis.calibrate(robot, analysis.MeasuredPoses(states, pose, **noise))


def test_functions_are_compiled_once_for_a_robot_and_its_copies(rpr, monkeypatch):
    robot, states = rpr
    analysis.calibrate(robot, analysis.MeasuredPoses(states, robot.tool_pose(states)))
    monkeypatch.setattr(PoseModel, "_function", None)
    other = robot.with_parameters({"pivot_1.frames.0.position.x": 1e-12})
    found = analysis.calibrate(other, analysis.MeasuredPoses(states, robot.tool_pose(states)))
    np.testing.assert_allclose(found.remains, 0, atol=1e-9)
