"""Runs as they are shown: closed at every instant, true to the motion, refused where they are
another robot's."""

import numpy as np
import pytest

from linkwork import LinkworkError, Robot, Run, robots
from linkwork.scene.fixtures import fixtures_of
from linkwork.viewer.pursuit import Pursuit
from linkwork.viewer.replay import replay_of
from linkwork.viewer.traces import quantities, traces

TIMES = np.linspace(0, 0.5, 11)
BETWEEN = np.linspace(0.01, 0.49, 13)


def simulated(name: str, save_at=TIMES) -> tuple[Pursuit, Run]:
    robot = Robot(getattr(robots, name)())
    pursuit = Pursuit(robot, fixtures_of(robot).size)
    return pursuit, robot.simulate(robot.home, duration=0.5, save_at=save_at)


@pytest.mark.parametrize("name", ["prr3", "five_bar", "stewart"])
def test_between_samples_it_is_closed_and_near_the_motion(name):
    pursuit, run = simulated(name)
    replay, robot = replay_of(pursuit, run), pursuit.robot
    fine = (
        robot.simulate(robot.home, duration=0.5, save_at=BETWEEN).variables["joint_position"].values
    )
    reach = np.ptp(run.variables["joint_position"].values, axis=0).max()
    for t, expected in zip(BETWEEN, fine, strict=True):
        state = replay.state(t)
        assert robot.closure_error(state) < 1e-9
        assert state.positions == pytest.approx(expected, abs=0.02 * reach)


def test_samples_are_shown_as_they_are():
    pursuit, run = simulated("prr3")
    replay = replay_of(pursuit, run)
    for k in (0, 4, 10):
        state = replay.state(TIMES[k])
        assert state.positions == pytest.approx(
            run.variables["joint_position"].values[k], abs=1e-12
        )
        assert pursuit.robot.joint_rates(state) == pytest.approx(
            run.variables["joint_rate"].values[k], abs=1e-9
        )
    assert replay.state(99.0).positions == pytest.approx(replay.state(0.5).positions)


def test_a_run_read_from_a_file_is_shown_alike(tmp_path):
    pursuit, run = simulated("prr3")
    loaded = replay_of(pursuit, Run.load(run.save(tmp_path / "run.nc")))
    assert loaded.state(0.33).positions == pytest.approx(
        replay_of(pursuit, run).state(0.33).positions
    )


def test_runs_of_other_robots_are_refused_in_a_sentence():
    _, run = simulated("prr3")
    pursuit, _ = simulated("five_bar")
    with pytest.raises(LinkworkError, match=r"not one of the robot .*: it has the joint 'slide_1'"):
        replay_of(pursuit, run)


def test_a_run_of_a_robot_with_other_lengths_is_refused():
    _, run = simulated("five_bar")
    other = Robot(robots.five_bar())
    plain = other.mechanism
    joint = plain.joints["elbow_1"]
    frames = [joint.frames[0].model_copy(update={"position": (0.4, 0.0, 0.0)}), joint.frames[1]]
    joint = joint.model_copy(update={"frames": tuple(frames)})
    robot = Robot(plain.model_copy(update={"joints": {**plain.joints, "elbow_1": joint}}))
    with pytest.raises(LinkworkError, match="not one of the robot"):
        replay_of(Pursuit(robot, 1.0), run)


@pytest.mark.parametrize("count", [0, 1])
def test_runs_of_no_and_of_one_sample(count):
    pursuit, run = simulated("prr3", save_at=TIMES[:count])
    replay = replay_of(pursuit, run)
    assert replay.empty == (count == 0)
    if count:
        assert replay.state(0.3).positions == pytest.approx(pursuit.robot.home.positions)
    assert traces(run, "joint_position").values.shape[1] == count


def test_curves_and_their_mark():
    _, run = simulated("prr3", save_at=np.linspace(0, 0.5, 2001))
    assert "joint_position" in quantities(run) and "kinetic_energy" in quantities(run)
    found = traces(run, "joint_position")
    assert len(found.time) <= 400 and found.time[[0, -1]] == pytest.approx([0, 0.5])
    time, *curves, mark = found.at(0.123)
    assert (np.diff(time) >= 0).all() and len({len(x) for x in (time, *curves, mark)}) == 1
    assert time[int(np.argmax(mark))] == 0.123
    assert found.at(0.9)[0][-1] == 0.5  # the run that is laid over goes on longer
    assert np.interp(0.123, found.time, found.values[0]) == pytest.approx(
        curves[0][int(np.argmax(mark))]
    )
    chosen = traces(run, "joint_position", ("slide_2", "slide_3"))
    assert chosen.labels == ("slide_2", "slide_3") and chosen.unit == "m"
    single = traces(run, "kinetic_energy")
    assert single.labels == ("kinetic_energy",) and single.unit == "J"
