"""Ctrl-C in a long run: it ends where it is, nothing computed is lost, and the robot runs again."""

import signal

import numpy as np
import pytest

import linkwork as lw
from linkwork import patience
from linkwork.runs import passage

from tests.cli.calls import call

TIMES = np.linspace(0.0, 20.0, 81)


@pytest.fixture(scope="module")
def robot():
    return lw.Robot("double_pendulum")


@pytest.fixture
def short_portions(monkeypatch):
    monkeypatch.setattr(passage, "portion", lambda nq: 100)


@pytest.fixture
def interrupted_late(monkeypatch, short_portions):
    """Press Ctrl-C while the third portion is integrated."""
    own, calls = passage.advanced, []

    def advanced(*given, **options):
        done = own(*given, **options)
        calls.append(done)
        if len(calls) == 3:
            signal.raise_signal(signal.SIGINT)
        return done

    monkeypatch.setattr(passage, "advanced", advanced)


def test_an_interrupted_run_keeps_what_was_computed_and_can_be_resumed(
    robot, interrupted_late, tmp_path
):
    run = robot.simulate(robot.home, duration=20.0, rtol=1e-10, save_at=TIMES)
    assert run.status is lw.Status.CANCELLED and isinstance(run.error, KeyboardInterrupt)
    assert run.steps + run.rejected == 300 and 0 < run.time[-1] < 20
    assert "cancelled" in run.message and np.isnan(run.error_estimate)
    assert lw.Run.load(run.save(tmp_path / "run.nc")).status is lw.Status.CANCELLED

    rest = robot.resume(run, duration=20.0 - run.attrs["final_time"], rtol=1e-10)
    whole = robot.simulate(robot.home, duration=20.0, rtol=1e-10, save_at=TIMES)
    assert rest.success and whole.success
    assert np.array_equal(rest.final.q, whole.final.q)

    again = run.resampled(11)
    assert again.status is lw.Status.CANCELLED
    assert np.array_equal(again.final.q, run.final.q) and again.steps == run.steps


@pytest.mark.parametrize("place", ["advanced", "chosen"])
def test_a_run_through_many_charts_that_has_taken_long_is_kept_too(place, monkeypatch):
    """None of its segments is a portion long; Ctrl-C comes while one is integrated, or while the
    next chart is chosen."""
    robot, times = lw.Robot("prr3"), np.linspace(0.0, 6.0, 61)
    how = {"duration": 6.0, "save_at": times}
    whole = robot.simulate(robot.home, [0.5, 0.0, 0.0], **how)
    assert whole.success and whole.attrs["charts"].count("from") > 7
    own, calls = getattr(passage, place), []

    def pressed(*given, **options):
        calls.append(given)
        if len(calls) == 5:
            signal.raise_signal(signal.SIGINT)
        return own(*given, **options)

    with monkeypatch.context() as patched:
        patched.setattr(patience, "WORTH", -1.0)
        patched.setattr(passage, place, pressed)
        run = robot.simulate(robot.home, [0.5, 0.0, 0.0], **how)
    assert run.status is lw.Status.CANCELLED and len(calls) == 5 and 0 < run.time[-1] < 6
    assert np.array_equal(run["joint_position"], whole["joint_position"][: len(run.time)])
    assert run.resampled(11).steps == run.steps
    rest = robot.resume(run, [0.5, 0.0, 0.0], duration=6.0 - run.attrs["final_time"])
    assert np.allclose(rest.final.positions, whole.final.positions, atol=1e-5)


def test_portions_resumed_runs_and_members_find_a_run_stiff_at_the_same_step(monkeypatch):
    """A rod that a stiff damper leads to rest carries another that swings: by then the damper alone
    bounds the steps, and after a thousand of them the stiff method takes over."""
    rod = lw.Body(mass=1.0, inertia=lw.Inertia(zz=1.0))
    damper, spring = lw.Spring(stiffness=1.0, damping=2000.0), lw.Spring(stiffness=20.0)
    joints = {
        "led": lw.RevoluteJoint(connects=("ground", "a"), spring=damper),
        "free": lw.RevoluteJoint(connects=("a", "b"), spring=spring),
    }
    robot = lw.Robot(lw.Mechanism(bodies={"a": rod, "b": rod}, joints=joints))
    start, how = robot.home.with_rates([0.0, 1.0]), {"rtol": 1e-6, "samples": 3}
    whole = robot.simulate(start, duration=4.0, **how)
    monkeypatch.setattr(passage, "portion", lambda nq: 100)
    parts = robot.simulate(start, duration=4.0, **how)
    assert "Rodas5P" in whole.attrs["method"] and parts.attrs["method"] == whole.attrs["method"]
    assert np.array_equal(parts.final.rates, whole.final.rates)

    left = robot.simulate(start, duration=4.0, max_steps=500, **how)
    assert left.status is lw.Status.TOO_MANY_STEPS
    rest = robot.resume(left, duration=4.0 - left.attrs["final_time"], **how)
    assert np.array_equal(rest.final.rates, whole.final.rates)
    both = robot.ensemble(robot.state(np.zeros((2, 2)), [start.rates] * 2), duration=4.0, **how)
    assert (both.final.rates == whole.final.rates).all()


@pytest.mark.parametrize(
    "how",
    [
        {"rtol": 1e-10, "save_at": TIMES},
        {"rtol": 1e-9},
        {"method": "rk4", "step": 0.01, "samples": 11},
        {"method": "rodas", "rtol": 1e-5, "samples": 11},
        {"method": "dop853", "rtol": 1e-11, "events": ["singular"]},
    ],
    ids=["samples", "every step", "rk4", "rodas", "dop853"],
)
def test_portions_change_no_bit(robot, how, monkeypatch):
    whole = robot.simulate(robot.home, duration=20.0, **how)
    monkeypatch.setattr(passage, "portion", lambda nq: 100)
    parts = robot.simulate(robot.home, duration=20.0, **how)
    assert whole.steps == parts.steps > 200 and whole.rejected == parts.rejected
    assert np.array_equal(whole.time, parts.time)
    assert np.array_equal(whole["joint_position"], parts["joint_position"])
    assert np.array_equal(whole.final.rates, parts.final.rates)


def test_the_largest_number_of_steps_still_ends_a_run(robot, short_portions):
    run = robot.simulate(robot.home, duration=20.0, max_steps=250)
    assert run.status is lw.Status.TOO_MANY_STEPS and run.steps + run.rejected == 250


def test_the_command_line_writes_what_was_computed_and_exits_with_130(interrupted_late, tmp_path):
    words = ["simulate", "double_pendulum", "--duration", "20", "--rtol", "1e-10"]
    result = call(*words, "--out", str(tmp_path / "run.nc"))
    assert result.exit_code == 130 and "cancelled" in result.stdout
    assert lw.Run.load(tmp_path / "run.nc").status is lw.Status.CANCELLED


def test_a_run_is_told_and_written_though_finding_its_error_is_interrupted(monkeypatch, tmp_path):
    own, calls = passage.Passage.segments, []

    def segments(self, begun):
        if self.watching:
            return own(self, begun)
        calls.append(self)
        raise KeyboardInterrupt

    words = ["simulate", "double_pendulum", "--duration", "0.2"]
    monkeypatch.setattr(passage.Passage, "segments", segments)
    result = call(*words, "--out", str(tmp_path / "run.nc"))
    assert result.exit_code == 130 and len(calls) == 1
    run = lw.Run.load(tmp_path / "run.nc")
    assert run.success and run.time[-1] == 0.2 and np.isnan(run.error_estimate)
    assert "How far off it is, is not known" in run.message
