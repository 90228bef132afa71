"""On the way over singular poses: what is saved, what happens and what is told there, in closed
form.

A parallelogram without weight keeps the rate of its cranks, and its coupler does not turn: the
angles are a - w t, whatever the masses. It folds flat, a bifurcation, where they are multiples of
pi.
"""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Event
from linkwork.robots import four_bar, n_four_bar
from linkwork.sweeps import Study
from linkwork.sweeps import chunk as chunks

from tests.robot.one_by_one import require_equal

START, RATE = 1.2, -3.0
POSES = (START + np.pi * np.arange(5)) / -RATE  # when it is flat within 5 s
OVER = {"on_singular": "step_over"}


def parallelogram(gravity=(0, 0, 0)) -> lw.Mechanism:
    reference = {
        "crank_pivot": START,
        "crank_pin": -START,
        "rocker_pivot": START,
        "rocker_pin": START,
    }
    mechanism = four_bar(ground=1.0, crank=0.5, coupler=1.0, rocker=0.5, gravity=gravity)
    return mechanism.model_copy(update={"reference": reference})


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(parallelogram())


def angles(t: np.ndarray) -> np.ndarray:
    return np.outer(START + RATE * t, [1, -1, 1, 1])


@pytest.mark.parametrize("method", ["sharp_smart", "dop853", "rk4"])
def test_every_requested_time_gets_its_own_values(robot, method):
    """Also at the flat poses themselves, where no choice of rates determines the others, and close
    to them."""
    times = np.unique(np.concatenate([np.linspace(0, 5, 301), POSES, POSES - 1e-9, POSES + 1e-5]))
    step = {"step": 1e-3} if method == "rk4" else {}
    run = robot.simulate(
        robot.home.with_rates([RATE]), duration=5.0, save_at=times, method=method, **OVER, **step
    )
    assert run.status is lw.Status.FINISHED
    ds = run.dataset
    assert np.array_equal(ds.time.values, times)
    assert np.allclose(ds.joint_position.values, angles(times), atol=1e-8)
    assert np.allclose(ds.joint_rate.values, RATE * np.array([1, -1, 1, 1]), atol=1e-8)
    assert np.allclose(ds.joint_acceleration.values, 0, atol=1e-6)
    assert np.allclose(ds.kinetic_energy.values, ds.kinetic_energy.values[0], rtol=1e-8)
    assert np.abs(ds.energy_balance.values).max() < 1e-8
    assert np.abs(ds.closure_error.values).max() < 1e-10
    assert np.abs(run.reactions().values).max() < 10


def test_the_run_tells_which_singular_poses_were_passed(robot, tmp_path):
    run = robot.simulate(robot.home.with_rates([RATE]), duration=5.0, **OVER)
    assert np.allclose(run.singular_times, POSES, atol=1e-8)
    assert f"It stepped over 5 singular poses, at t = {POSES[0]:.9g}, " in run.message
    assert np.allclose(lw.Run.load(run.save(tmp_path / "run.nc")).singular_times, POSES, atol=1e-8)
    once = robot.simulate(robot.home.with_rates([RATE]), duration=1.0, **OVER)
    assert lw.Run.load(once.save(tmp_path / "once.nc")).singular_times == pytest.approx(
        POSES[:1], abs=1e-8
    )
    none = robot.simulate(robot.home.with_rates([RATE]), duration=0.2, **OVER)
    assert not none.singular_times.size and "stepped over" not in none.message


@pytest.mark.parametrize("end", [POSES[1] - 1e-3, POSES[1], POSES[1] + 1e-3])
def test_a_run_may_end_on_the_way_over_a_singular_pose(robot, end):
    times = np.array([0.0, end - 2e-3, end])
    run = robot.simulate(robot.home.with_rates([RATE]), duration=end, save_at=times, **OVER)
    assert run.status is lw.Status.FINISHED
    assert run.attrs["final_time"] == end
    assert np.array_equal(run.time, times)
    assert np.allclose(run["joint_position"].values, angles(times), atol=1e-8)
    assert np.allclose(run["joint_rate"].values, RATE * np.array([1, -1, 1, 1]), atol=1e-8)
    assert len(run.singular_times) == (2 if end > POSES[1] else 1) or end == POSES[1]
    rest = robot.resume(run, duration=0.5, **OVER)
    if end == POSES[1] and rest.status is lw.Status.SINGULAR:
        return  # from the pose itself all branches go out, and rounding decides where the run ended
    assert rest.status is lw.Status.FINISHED
    assert np.allclose(
        rest["joint_position"].values[-1], angles(np.array([end + 0.5]))[0], atol=1e-7
    )


@pytest.mark.parametrize("at", [2e-3, 0.0, -5e-3])
@pytest.mark.parametrize("direction", [0, 1, -1])
def test_what_happens_on_the_way_over_a_singular_pose_is_found(robot, at, direction):
    """The crank passes an angle near the flat pose, falling: an event watches, another ends the
    run."""
    time = (START - at) / -RATE
    watch = Event(lambda t, state: state["crank_pivot"] - at, direction=direction, name="there")
    ends = Event(lambda t, state: state["crank_pivot"] - at + 1e-3, terminal=True, name="beyond")
    start = robot.home.with_rates([RATE])
    run = robot.simulate(
        start, duration=2.0, events=[watch, ends], save_at=np.linspace(0, 2, 2001), **OVER
    )
    assert run.status is lw.Status.EVENT
    assert "ended by the event 'beyond'" in run.message
    expected = [time, time + 1e-3 / 3] if direction <= 0 else [time + 1e-3 / 3]
    assert np.allclose(run.coords["event_time"].values, expected, atol=1e-8)
    assert run.attrs["final_time"] == pytest.approx(expected[-1], abs=1e-8)
    assert np.allclose(run["joint_position"].values[:, 0], START + RATE * run.time, atol=1e-8)
    assert run.time[-1] == pytest.approx(expected[-1], abs=1e-3)
    assert np.allclose(np.diff(run.time), 1e-3)


def test_members_get_every_requested_time_as_alone(robot):
    """Each at its own rate, in closed form; also in a member's own message and list of singular
    poses."""
    rates, times = np.array([-3.0, -2.5, 0.3, -1.0]), np.linspace(0, 2, 41)
    starts = robot.state(np.stack([robot.home.positions] * 4), rates[:, None])
    members = robot.ensemble(starts, duration=2.0, save_at=times, **OVER)
    assert (members.status == lw.Status.FINISHED).all()
    expected = START + rates[:, None] * times
    assert np.allclose(members.dataset.joint_position.values[:, :, 0], expected, atol=1e-7)
    assert np.allclose(members.dataset.joint_rate.values[:, :, 2], rates[:, None], atol=1e-7)
    require_equal(
        members,
        [robot.simulate(starts.at(i), duration=2.0, save_at=times, **OVER) for i in range(4)],
    )
    assert np.allclose(members.singular_times(0), POSES[:2], atol=1e-8)
    assert members.dataset.singular_member.values.tolist() == [0, 0, 1, 1, 3]
    assert not members.singular_times(2).size


def test_a_study_gets_every_requested_time():
    given = Study(
        robot=parallelogram(),
        duration=2.0,
        samples=41,
        start={"joints": {"crank_pivot": START}, "rates": {"crank_pivot": RATE}},
        vary={"coupler.mass": {"type": "uniform", "low": 1, "high": 3}},
        design={"type": "random", "members": 3, "seed": 1},
        outputs={"rocker": "peak joint_rate.rocker_pivot", "force": "peak reaction_force"},
        trajectories=(
            "joint_position",
            "joint_rate",
            "joint_acceleration",
            "kinetic_energy",
            "tool_pose",
        ),
        on_singular="step_over",
    )
    found, times = chunks.compute(given, 0), np.linspace(0, 2, 41)
    assert np.allclose(found["joint_position"], angles(times), atol=1e-7)
    assert np.allclose(found["joint_rate"], RATE * np.array([1, -1, 1, 1]), atol=1e-7)
    assert np.allclose(found["joint_acceleration"], 0, atol=1e-5)
    assert np.allclose(found["kinetic_energy"], found["kinetic_energy"][:, :1], rtol=1e-7)
    assert np.allclose(found["rocker"], -RATE, atol=1e-7)
    assert np.isfinite(found["force"]).all() and found["force"].max() < 50


def test_samples_of_a_ladder_under_its_weight_keep_its_energy_and_close_its_loops():
    """Ten poses are passed in 10 s, 41 times asked for: simulate, ensemble; each tip is where the
    first one's angle says."""
    ladder, times = lw.Robot(n_four_bar(2)), np.linspace(0, 10, 41)
    start = ladder.home.with_rates([-1.0])
    run = ladder.simulate(start, duration=10.0, save_at=times, rtol=1e-10, atol=1e-12, **OVER)
    many = ladder.ensemble(start, duration=10.0, save_at=times, rtol=1e-10, atol=1e-12, **OVER)
    require_equal(many, [run])
    assert np.array_equal(run.time, times)
    assert len(run.singular_times) == len(many.singular_times(0)) == 10
    energy = (run["kinetic_energy"] + run["potential_energy"]).values
    assert np.ptp(energy) < 1e-7 * np.abs(energy).max()
    cranks = run["joint_position"].values[
        :, [ladder.coordinates.index(f"pivot_{i}") for i in range(3)]
    ]
    assert np.allclose(cranks, cranks[:, :1], atol=1e-8)
