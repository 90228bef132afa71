"""What a run gives by name, its last state, and the same run at other times."""

import numpy as np
import pytest

import linkwork as lw


@pytest.fixture(scope="module")
def robot():
    return lw.Robot("prr3")


@pytest.fixture(scope="module")
def run(robot):
    """A run that changes its chart, and ends in another one than it began in."""
    return robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0)


def test_one_quantity_is_given_without_measuring_another(robot, monkeypatch):
    from linkwork.runs import run_record

    measured = []

    def counted(self, quantity):
        measured.append(quantity.name)
        return before(self, quantity)

    before = run_record.RunRecord._measured
    monkeypatch.setattr(run_record.RunRecord, "_measured", counted)
    run = robot.simulate(robot.home, duration=0.1)
    assert len(run.time) == run.steps + 1 and run.time[-1] == 0.1
    assert run.final["slide_1"] == run.final.positions[0]
    assert not measured
    found = run["joint_position"]
    assert measured == ["joint_position"]
    assert found.identical(run["joint_position"])
    assert found.sel(coordinate="slide_2").attrs["units"] == "m, rad"


@pytest.mark.parametrize("name", ["joint_positions", "Joint_Position", 5, None])
def test_a_quantity_that_is_not_there_is_refused_with_the_nearest(run, name):
    near = r" \(did you mean joint_position\?\)" if isinstance(name, str) else ""
    with pytest.raises(lw.LinkworkError, match=f"the run holds no {name!r}{near}; it holds joint_"):
        run[name]


def test_the_last_state_starts_the_run_that_resuming_goes_on_with(robot, run):
    """In the robot's own rates, though the run ended in others."""
    assert (
        run.attrs["final_rates"] != ", ".join(robot.independent) == ", ".join(run.final.independent)
    )
    assert np.array_equal(run.final.positions, run["joint_position"].values[-1])
    on = robot.simulate(run.final, [5.0, 0.0, 0.0], duration=0.1, rtol=1e-11, atol=1e-12)
    resumed = robot.resume(run, [5.0, 0.0, 0.0], duration=0.1, rtol=1e-11, atol=1e-12)
    assert np.allclose(on.final.positions, resumed.final.positions, rtol=0, atol=1e-10)


def test_the_last_state_is_in_the_runs_rates_where_the_robots_own_do_not_tell_it():
    """A crank at its dead centre: the slide's rate, which drives, tells nothing of the motion."""
    slide = lw.Robot("slider_crank", independent=("slide",))
    dead = slide.assemble({"crank": 0.0})
    run = slide.simulate(slide.in_chart(dead, ("crank",)).with_rates([2.0]), duration=1e-9)
    assert run.final.independent == ("crank",)
    assert run.final.rates[0] == pytest.approx(2.0, rel=1e-6)
    assert np.isfinite(slide.forward_dynamics(run.final, np.zeros(len(slide.actuators)))).all()


def test_whole_turns_stay_with_the_last_state():
    robot = lw.Robot("four_bar")
    run = robot.simulate(robot.home.with_rates([20.0]), duration=2.0, samples=5)
    assert np.allclose(run.final.positions, run["joint_position"].values[-1], rtol=0, atol=1e-12)
    assert np.abs(run.final.positions).max() > 10


def test_the_file_of_a_run_holds_its_last_state(robot, run, tmp_path):
    run.save(tmp_path / "run.nc")
    loaded = lw.Run.load(tmp_path / "run.nc")
    assert str(loaded.final) == str(run.final) and np.array_equal(loaded.final.q, run.final.q)
    assert np.array_equal(
        robot.forward_dynamics(loaded.final, [0.0, 0.0, 1.0]),
        robot.forward_dynamics(run.final, [0.0, 0.0, 1.0]),
    )
    again = lw.Run.load(loaded.save(tmp_path / "again.nc"))
    assert np.array_equal(again.final.rates, run.final.rates)
    assert not [name for name in loaded.attrs if name.startswith("final_state")]


def test_a_file_without_a_last_state_says_so(run, tmp_path):
    run.dataset.drop_vars("drive_state", errors="ignore").to_netcdf(
        tmp_path / "old.nc", engine="scipy"
    )
    with pytest.raises(lw.LinkworkError, match=r"does not hold its last state; robot\.resume"):
        _ = lw.Run.load(tmp_path / "old.nc").final


def test_samples_are_equally_spaced_times(robot, run):
    sampled = robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0, samples=11)
    assert np.array_equal(sampled.time, np.linspace(0, 1, 11)) and sampled.steps == run.steps
    on = robot.resume(sampled, [5.0, 0.0, 0.0], duration=0.5, samples=6)
    assert np.array_equal(on.time, np.linspace(1, 1.5, 6))
    members = robot.ensemble(robot.home, [5.0, 0.0, 0.0], duration=1.0, samples=11)
    assert np.array_equal(members.dataset["time"], sampled.time)
    assert np.allclose(
        members.dataset["joint_position"][0], sampled["joint_position"], rtol=0, atol=1e-12
    )


def test_a_run_is_resampled_in_its_own_steps(robot, run):
    """At its own times nothing changes; between them the samples lie on its dense output."""
    same, dense = run.resampled(run.time), run.resampled(101)
    assert np.array_equal(same["joint_position"], run["joint_position"])
    assert np.array_equal(dense.time, np.linspace(0, 1, 101))
    asked = robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0, samples=101)
    assert np.array_equal(dense["joint_position"], asked["joint_position"])
    assert np.array_equal(dense.final.q, run.final.q) and dense.statistics.steps == run.steps
    tight = robot.simulate(
        robot.home, [5.0, 0.0, 0.0], duration=1.0, samples=101, rtol=1e-12, atol=1e-13
    )
    assert np.abs(dense["joint_position"] - tight["joint_position"]).max() < 1e-5


def test_pictures_of_a_run_are_smooth_where_every_step_was_saved(robot, run):
    assert len(run.smooth.time) >= 501 and {*run.time} <= {*run.smooth.time}
    asked = robot.simulate(robot.home, duration=0.1, samples=5)
    assert asked.smooth is asked
    (lines,) = run.plot(["tool_pose"]).axes[:1]
    assert len(lines.lines[0].get_xdata()) == len(run.smooth.time)


def test_a_run_that_an_event_ended_is_resampled_to_its_end():
    robot = lw.Robot("pendulum")
    stop = lw.control.Event(lambda t, state: state["hinge_1"] + 1.0, terminal=True)
    run = robot.simulate(robot.state([0.0]), duration=2.0, events=[stop])
    assert run.status is lw.Status.EVENT and run.resampled(7).time[-1] == run.time[-1]
    assert run.resampled(7)["joint_position"].values[-1] == pytest.approx(-1.0, abs=1e-9)


def test_what_cannot_be_run_again_says_so(robot, tmp_path):
    law = lw.control.Sampler(lambda t, state: [0.0, 0.0, 0.0], rate=100)
    called = robot.simulate(robot.home, law, duration=0.1)
    for one in (called, lw.Run.load(called.save(tmp_path / "run.nc"))):
        with pytest.raises(lw.LinkworkError, match="cannot be run again at other times"):
            one.resampled(11)
        assert one.smooth is one


@pytest.mark.parametrize(
    "samples", [1, 0, 2.5, "many", [0.0, np.nan], [0.5, 0.1], [[0.1], [0.2, 0.3]]]
)
def test_samples_that_are_none_are_refused(run, samples):
    with pytest.raises(lw.LinkworkError, match=r"samples|times|save_at"):
        run.resampled(samples)


@pytest.mark.parametrize("rate", [-52.85136808001807, 61.7, 140.0])
def test_what_is_saved_of_a_run_does_not_change_it(rate):
    """Long steps, whose projection ends with a Newton step that is no better than it has to be."""
    robot = lw.Robot("four_bar")
    start, asked = robot.home.with_rates([rate]), {"duration": 0.05, "method": "dop853"}
    every = robot.simulate(start, **asked)
    ends = [robot.simulate(start, **asked, save_at=times) for times in ([0.05], every.time)]
    for other in (*ends, robot.ensemble(start, **asked)):
        final = other.final.q if isinstance(other, lw.Run) else other.final.q[0]
        assert np.array_equal(final, every.final.q)
    assert np.abs(every["closure_error"].values).max() < 1e-12
