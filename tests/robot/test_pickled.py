"""Robots and runs that are sent to other processes: what they compute there is the same, bit for
bit."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import linkwork as lw

from tests.processes import PATIENCE


def end(robot: lw.Robot, state: lw.State) -> lw.Run:
    """Run a robot: in whichever process this is called."""
    return robot.simulate(state, [0.3, -0.2], duration=0.3)


def alike(one: lw.Run, other: lw.Run) -> bool:
    """Tell whether two runs hold the same, bit for bit."""
    pairs = [(one[name].values, other[name].values) for name in one.variables]
    ends = [
        (getattr(run.final, name) for name in ("positions", "rates", "q")) for run in (one, other)
    ]
    return (
        list(one.variables) == list(other.variables)
        and all(np.array_equal(a, b, equal_nan=True) for a, b in [*pairs, *zip(*ends, strict=True)])
        and one.message == other.message
        and one.statistics == other.statistics
    )


def five_bars() -> list[lw.Robot]:
    robot = lw.Robot("five_bar")
    free = robot.free("distal_1.mass", "motor_1.friction.viscous")
    return [
        robot,
        lw.Robot("five_bar", independent=("elbow_1", "elbow_2")),
        free.with_parameters({"distal_1.mass": 0.7}).with_parameters(
            {"motor_1.friction.viscous": 0.1}
        ),
    ]


@pytest.mark.long
def test_a_robot_runs_in_another_process_as_it_runs_here():
    robots = five_bars()
    states = [robot.in_chart(robot.home, ("elbow_1", "motor_2")) for robot in robots]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        runs = list(pool.map(end, robots, states, timeout=PATIENCE))
    assert all(alike(end(*given), run) for *given, run in zip(robots, states, runs, strict=True))


@pytest.mark.parametrize("robot", five_bars(), ids=["plain", "asked", "free"])
def test_a_robot_that_is_read_again_is_the_same_robot(robot):
    for other in (pickle.loads(pickle.dumps(robot)), copy.copy(robot)):
        assert other.mechanism == robot.mechanism and other.parameters == robot.parameters
        assert other.independent == robot.independent and list(other.charts) == list(robot.charts)
        assert np.array_equal(other.home.q, robot.home.q)
        assert np.array_equal(other.mass_matrix(robot.home), robot.mass_matrix(robot.home))


def test_the_reference_of_other_lengths_is_kept():
    """Also where values were given one after the other."""
    crank, coupler = "crank_pin.frames.0.position.x", "rocker_pin.frames.0.position.x"
    robot = lw.Robot("four_bar").free(crank, coupler)
    lengths = {path: 1.02 * value for path, value in robot.parameters.items()}
    moved = robot.with_parameters({crank: lengths[crank]}).with_parameters(lengths)
    other = pickle.loads(pickle.dumps(moved))
    assert np.array_equal(other.home.q, moved.home.q)
    assert not np.array_equal(other.home.q, robot.home.q)
    assert float(other.closure_error(moved.home)) < 1e-12


def test_a_run_comes_back_from_another_process_with_all_that_a_file_holds(tmp_path):
    robot = lw.Robot("five_bar")
    run = end(robot, robot.home)
    other = pickle.loads(pickle.dumps(run))
    assert alike(run, other) and other.error_estimate == run.error_estimate
    run.save(tmp_path / "run.nc")
    from_file = lw.Run.load(tmp_path / "run.nc")
    assert from_file.description == other.description == run.description
    assert {*from_file.attrs} - {"description"} == {*other.attrs} - {"description"}
    again = [robot.resume(one, duration=0.1) for one in (run, other)]
    assert alike(*again)
    for gone in (other.reactions, other.resampled, lambda: other.global_errors):
        with pytest.raises(lw.LinkworkError, match=r"a run from a file|run again"):
            gone()


def test_a_run_that_a_callback_ended_keeps_what_was_raised():
    robot = lw.Robot("pendulum")

    def law(t, state):
        if t > 0.05:
            raise ValueError("too late")
        return [0.0]

    run = robot.simulate(robot.home, lw.control.Sampler(law, rate=100), duration=0.2)
    other = pickle.loads(pickle.dumps(run))
    assert isinstance(other.error, ValueError) and other.status is lw.Status.CALLBACK_FAILED
    assert alike(run, other)


def test_ensembles_say_what_to_send_in_their_place():
    robot = lw.Robot("pendulum")
    many = robot.ensemble(robot.state({"hinge_1": [0.1, 0.2]}), duration=0.1)
    none = robot.ensemble(robot.state({"hinge_1": np.zeros(0)}), duration=0.1)
    assert repr(many) == "Ensemble(2 members; FINISHED: 2)"
    assert repr(none) == "Ensemble(0 members)"
    for ask in (pickle.dumps, copy.copy):
        with pytest.raises(lw.LinkworkError, match=r"send ensemble\.dataset, ensemble\.final or"):
            ask(many)
