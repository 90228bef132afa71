"""Runs that start in motion at or near a pose where the actuated rates say little of it: nothing is
lost, or it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork.runs import resuming

from tests.catalogue import built
from tests.robot.one_by_one import require_equal

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def energy(run: lw.Run) -> np.ndarray:
    return run["kinetic_energy"].values + run["potential_energy"].values


@pytest.fixture(scope="module")
def five():
    return lw.Robot(lw.robots.five_bar(gravity=(0, -9.81, 0)))


@pytest.fixture(scope="module")
def stopped(five):
    """A run that ends in motion where the coupler links lie in line: there the motors' rates do not
    determine it."""
    run = five.simulate(five.home.with_rates([3.0, -2.0]), duration=3.0, events="singular", **TIGHT)
    assert run.status is lw.Status.EVENT
    return run


def at_the_end(robot: lw.Robot, run: lw.Run, names: tuple[str, ...]) -> lw.State:
    """Return the last state of a run in rates of the given names."""
    rates = dict(zip(robot.rates, run["joint_rate"].values[-1], strict=True))
    still = robot.state(run["joint_position"].values[-1])
    return robot.in_chart(still, names).with_rates([rates[name] for name in names])


@pytest.mark.parametrize("how", ["in memory", "from a file", "by a new robot"])
def test_a_run_that_ended_at_an_actuator_singular_pose_is_resumed_as_if_it_had_not_ended(
    five, stopped, how, tmp_path
):
    whole = five.simulate(
        five.home.with_rates([3.0, -2.0]), duration=stopped.attrs["final_time"] + 0.3, **TIGHT
    )
    run = stopped if how == "in memory" else lw.Run.load(stopped.save(tmp_path / "run.nc"))
    robot = lw.Robot(five.mechanism) if how == "by a new robot" else five
    rest = robot.resume(run, duration=0.3, **TIGHT)
    assert rest.status is lw.Status.FINISHED
    assert np.allclose(energy(rest), energy(stopped)[0], rtol=1e-7)
    ends = [part["joint_position"].values[-1] for part in (rest, whole)]
    assert np.allclose(*ends, atol=1e-6)


@pytest.mark.parametrize("beside", [0.0, 1e-8, 1e-5])
def test_a_state_in_a_good_chart_keeps_its_energy_at_a_pose_that_is_singular_for_the_actuators(
    five, stopped, beside
):
    """E = T + V of the stopped run; forwards and, with all rates turned about, backwards."""
    run = five.resume(stopped, duration=beside, **TIGHT) if beside else stopped
    state = at_the_end(five, run, ("motor_1", "elbow_2"))
    for start in (state, state.with_rates(-state.rates)):
        alone = five.simulate(start, duration=0.2, **TIGHT)
        assert alone.status is lw.Status.FINISHED
        assert np.allclose(energy(alone), energy(stopped)[0], rtol=1e-7)
        assert alone.attrs["charts"].startswith("from 0 s: motor_1, elbow_2")
        together = five.ensemble(start, duration=0.2, **TIGHT)
        assert np.array_equal(together.final.q[0], alone.attrs["final_q"])
        assert together.nfev[0] == alone.nfev


def test_an_ensemble_that_ends_at_singular_poses_tells_states_to_go_on_from(five):
    """The last states are told in rates that determine their motion: with their energy, and so that
    runs go on from them."""
    rates = np.outer([1.0, 0.9, 1.1], [3.0, -2.0])
    starts = five.state(np.stack([five.home.positions] * 3), rates)
    first = five.ensemble(starts, duration=3.0, events="singular", **TIGHT)
    assert (first.status == lw.Status.EVENT).all()
    before, after = (sum(five.energy(states)) for states in (starts, first.final))
    assert np.allclose(after, before, rtol=1e-8)
    second = five.ensemble(first.final, duration=0.3, **TIGHT)
    assert (second.status == lw.Status.FINISHED).all()
    assert np.allclose(sum(five.energy(second.final)), before, rtol=1e-7)


def test_a_motion_given_in_rates_that_do_not_determine_it_is_not_run(five, stopped):
    """The motors' rates do not tell the motion at the singular pose, at rest they need not; the
    others tell it all."""
    state = at_the_end(five, stopped, ("motor_1", "elbow_2"))
    told = lw.State(
        state.positions, np.array([1.0, 1.0]), state.q, state.coordinates, five.independent
    )
    run = five.simulate(told, duration=0.1)
    assert run.status is lw.Status.SINGULAR
    assert (
        "given in the rates motor_1, motor_2, which do not determine it there; others do"
        in run.message
    )
    assert five.ensemble(told, duration=0.1).message(0) == run.message
    with pytest.raises(
        lw.LinkworkError, match="the motion cannot be told in the rates motor_1, elbow_2"
    ):
        five.in_chart(told, ("motor_1", "elbow_2"))
    with pytest.raises(lw.LinkworkError, match="motor_1, motor_2 do not determine the motion here"):
        five.in_chart(state, five.independent)
    still = five.simulate(told.with_rates([0.0, 0.0]), duration=0.2, **TIGHT)
    assert still.status is lw.Status.FINISHED
    assert np.allclose(energy(still), energy(still)[0], atol=1e-8)


def test_rates_that_determine_the_motion_weakly_are_a_chart_all_the_same(five):
    """Leg 2 is bent by 0.1 rad only: the rates of leg 1 say what it does, ten times enlarged."""
    bent = five.assemble({"elbow_2": 0.1, "motor_2": 1.9}).with_rates([0.3, 0.2])
    other = five.in_chart(bent, ("motor_1", "elbow_1"))
    assert np.allclose(five.joint_rates(other), five.joint_rates(bent), atol=1e-12)


def test_a_resumed_run_whose_rates_are_none_of_the_robot_s_is_refused(five, stopped):
    attrs = dict(stopped.attrs) | {"final_rates": "motor_1, tip"}
    foreign = lw.Run(
        stopped.variables,
        stopped.coords,
        attrs,
        stopped.status,
        stopped.message,
        stopped.statistics,
    )
    with pytest.raises(lw.LinkworkError, match="there is no rate of the tree 'tip'"):
        five.resume(foreign, duration=0.1)


@pytest.mark.long
def test_a_member_whose_rates_do_not_tell_its_motion_does_not_disturb_the_others():
    """A Gough-Stewart platform turned by a quarter about its axis: the legs' rates do not determine
    its motion (Fichter)."""
    robot = built("stewart")
    assert robot.run_chart is not robot.chart
    turned = robot.home
    for angle in np.linspace(0, np.pi / 2, 12)[1:]:
        turned = robot.assemble(
            tool=robot.tool_pose(robot.home) + angle * np.eye(6)[5], guess=turned
        )
    states = robot.state(np.stack([robot.home.positions, turned.positions]), np.full((2, 6), 0.1))
    options = {"duration": 0.1, "save_at": [0.0, 0.1]}
    members = robot.ensemble(states, **options)
    require_equal(members, [robot.simulate(states.at(i), **options) for i in range(2)])
    assert members.status.tolist() == [lw.Status.FINISHED, lw.Status.SINGULAR]
    assert "do not determine it there; others do" in members.message(1)


def test_a_run_is_resumed_in_the_chart_that_it_tells_of(five):
    """In a robot that has not met its rates, no other one is chosen beside it."""
    names = ("motor_1", "elbow_1")
    run = five.simulate(five.in_chart(five.home, names).with_rates([0.4, 0.2]), duration=0.05)
    fresh = lw.Robot(five.mechanism)
    fresh.resume(run, duration=0.01)
    last = resuming.chart_told(fresh, str(run.attrs["final_chart"]), names)
    assert fresh.charts[names].key == last


def test_the_closure_error_of_no_number_is_none():
    """The largest of many residuals was that of those which are numbers."""
    robot = built("delta")
    count = robot.home.q.size
    states = robot.state(np.tile(robot.home.positions, (count, 1)))
    q = np.where(np.eye(count, dtype=bool), np.nan, states.q)
    assert np.isnan(robot.closure_error(replace(states, q=q))).all()
