"""Whole turns of joints that close loops: what was read off the tree's coordinates is as many turns off as the state says."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw

from tests.equations.evaluation import close

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def bennett():
    """Its opposite angles turn by as much, one of them against the other; hinge_3 is read by the arc tangent."""
    return lw.Robot(lw.robots.bennett())


@pytest.fixture(scope="module")
def stewart():
    return lw.Robot(lw.robots.stewart())


def angles(run: lw.Run) -> np.ndarray:
    return run.dataset["joint_position"].values


@pytest.mark.parametrize("make", [lw.robots.bennett, lw.robots.four_bar, lw.robots.slider_crank, lw.robots.prr3])
def test_a_state_keeps_the_turns_of_every_angle(make):
    """Angles whole turns away are the same configuration: nothing but them is different."""
    robot = lw.Robot(make())
    angles = np.array([robot.unit(name) == "rad" for name in robot.coordinates])
    given = robot.home.positions + TURN * np.arange(1, len(angles) + 1) * angles
    state = robot.state(given, np.full(robot.mobility, 0.7))
    close(state.positions, given, 1e-12)
    close(state.with_rates(2 * state.rates).positions, given, 1e-12)
    for name in robot.coordinates:
        assert float(robot.observe(state)[name]) == state[name]
    plain = robot.state(robot.home.positions, state.rates)
    force = np.ones(len(robot.actuators))
    close(robot.forward_dynamics(state, force), robot.forward_dynamics(plain, force), 1e-9)
    again = robot.assemble({robot.coordinates[0]: float(state[robot.coordinates[0]]) + 0.01}, guess=state)
    close(again.positions, given, 0.5)


def test_other_rates_leave_the_turns(bennett):
    given = bennett.home.positions + TURN * np.array([1, 2, 3, 4])
    state = bennett.in_chart(bennett.state(given, [1.0]), ("hinge_2",))
    close(state.positions, given, 1e-12)
    close(bennett.in_chart(state, ("hinge_1",)).positions, given, 1e-12)


def test_what_is_asked_of_a_cut_joint_is_kept(bennett):
    asked = float(bennett.home["hinge_3"]) - 3 * TURN
    assert bennett.assemble({"hinge_3": asked})["hinge_3"] == pytest.approx(asked, abs=1e-12)


def test_a_quaternion_keeps_the_sign_that_is_given(stewart):
    for places in stewart.labels.quaternions:
        given = stewart.home.positions.copy()
        given[places] *= -1
        state = stewart.state(given)
        close(state.positions, given, 1e-12)
        run = stewart.simulate(state, duration=0.01, save_at=[0.0, 0.01])
        close(angles(run)[0], given, 1e-12)
        close(angles(stewart.resume(run, duration=0.01))[0], angles(run)[-1], 1e-9)


@pytest.mark.parametrize("turns", [0, 2])
def test_turns_are_counted_from_step_to_step(bennett, turns):
    """Opposite hinges of Bennett's linkage turn by as much, however few of the times of a run are saved."""
    given = bennett.home.positions + TURN * turns * np.array([0, 1, -1, 0])
    state = bennett.state(given, [20.0])
    runs = [
        bennett.simulate(state, duration=3.0, save_at=times)
        for times in ([0.0, 1.7, 3.0], [3.0], np.linspace(0, 3, 1001), None)
    ]
    runs.append(bennett.simulate(state, duration=3.0, save_at=[0.4, 3.0], method="rk4", step=1e-3))
    for run in runs:
        turned = angles(run) - given
        close(turned[:, 2], -turned[:, 0], 1e-5)
        close(turned[:, 3], -turned[:, 1], 1e-5)
        assert turned[-1, 0] > 6 * TURN


def test_a_run_goes_on_with_its_turns(bennett, tmp_path):
    """In one piece, and in two of which the first is saved to a file: the same angles, whole turns included."""
    state = bennett.state(bennett.home.positions + TURN * np.array([0, 0, 5, 0]), [20.0])
    whole = bennett.simulate(state, duration=3.0, save_at=[3.0])
    first = bennett.simulate(state, duration=1.1, save_at=[0.2])
    loaded = lw.Run.load(first.save(tmp_path / "first.nc"))
    for part in (first, loaded):
        close(angles(bennett.resume(part, duration=1.9, save_at=[3.0])), angles(whole), 1e-5)
    foreign = replace(first, attrs={**first.attrs, "final_windings": np.ones(3)})
    with pytest.raises(lw.LinkworkError, match="belongs to another robot and cannot be resumed"):
        bennett.resume(foreign, duration=1.0)


def test_members_have_turns_of_their_own(bennett):
    """A member's angles are those of its run alone."""
    given = bennett.home.positions + TURN * np.outer([0, 1, -2], [0, 1, 3, 0])
    states, times = bennett.state(given, [[20.0], [-15.0], [5.0]]), np.linspace(0, 2, 101)
    many = bennett.ensemble(states, duration=2.0, save_at=times)
    for i in range(3):
        alone = bennett.simulate(states.at(i), duration=2.0, save_at=times)
        close(many.dataset["joint_position"].values[i], angles(alone), 1e-9)
        close(many.final.positions[i], angles(alone)[-1], 1e-9)
    few = bennett.ensemble(states, duration=2.0, save_at=[1.3])
    close(few.dataset["joint_position"].values[:, 0], many.dataset["joint_position"].values[:, 65], 1e-5)
    close(pickle.loads(pickle.dumps(few.final)).positions, many.final.positions, 1e-5)
    close(few.final.with_rates([0.0]).positions, many.final.positions, 1e-5)


def test_where_turns_act_another_turn_is_another_configuration():
    """A spring in every joint of a four-bar: the cut one is wound up by as much as the others make it."""
    described = lw.robots.four_bar()
    joints = {
        name: joint.model_copy(update={"spring": lw.Spring(stiffness=2.0)}) for name, joint in described.joints.items()
    }
    robot = lw.Robot(described.model_copy(update={"joints": joints}))
    name = robot.equations.cuts[0].joint
    place = robot.coordinates.index(name)
    given = robot.home.positions.copy()
    given[place] += TURN
    with pytest.raises(lw.LinkworkError, match=f"{name}.*its spring, gear or thread counts whole turns"):
        robot.state(given)
    asked = robot.assemble({name: float(given[place])})
    assert asked[name] == pytest.approx(given[place], abs=1e-9)
    close(
        robot.energy(asked)[1] - robot.energy(robot.home)[1], np.sum(asked.positions**2 - robot.home.positions**2), 1e-6
    )


def test_half_a_turn_between_samples_is_told_by_the_rates(bennett):
    """An angle that turns by more than half a turn from one sample to the next: q = w t, and w t + a t^2 / 2."""
    labels, place = bennett.labels, bennett.coordinates.index("hinge_3")
    rates = np.zeros((5, 4))
    for rate, bend in ((4.0, 0.0), (-5.5, 0.0), (9.0, 0.5), (1.0, 4.0)):
        time = np.linspace(0, 4, 5)
        q = np.zeros((5, 4))
        q[:, place] = rate * time + bend * time**2 / 2
        rates[:, place] = rate + bend * time
        found = labels.unwrapped(time, np.arctan2(np.sin(q), np.cos(q)), rates)
        close(found, q, 1e-12)


def test_where_rates_tell_nothing_an_angle_takes_the_short_way(bennett):
    """From -3 rad at 0 rad/s to 3 rad at 20 rad/s in 1 s: it turned, or went back by 0.28 rad, which is taken."""
    place = bennett.coordinates.index("hinge_3")
    q, rates = np.zeros((2, 4)), np.zeros((2, 4))
    q[:, place], rates[:, place] = [-3.0, 3.0], [0.0, 20.0]
    assert bennett.labels.unwrapped(np.arange(2.0), q, rates)[1, place] == pytest.approx(3.0 - TURN)
    rates[:, place] = [5.0, 9.0]
    assert bennett.labels.unwrapped(np.arange(2.0), q, rates)[1, place] == pytest.approx(3.0)
