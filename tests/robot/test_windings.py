"""Whole turns of joints that close loops: what was read off the tree's coordinates is as many turns
off as the state says."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Event, Sampler

from tests.equations.evaluation import close

TURN = 2 * np.pi


@pytest.fixture(scope="module")
def bennett():
    """Its opposite angles turn by as much, one of them against the other; hinge_3 is read by the
    arc tangent."""
    return lw.Robot(lw.robots.bennett())


@pytest.fixture(scope="module")
def stewart():
    return lw.Robot(lw.robots.stewart())


def angles(run: lw.Run) -> np.ndarray:
    return run["joint_position"].values


@pytest.mark.parametrize(
    "make", [lw.robots.bennett, lw.robots.four_bar, lw.robots.slider_crank, lw.robots.prr3]
)
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
    again = robot.assemble(
        {robot.coordinates[0]: float(state[robot.coordinates[0]]) + 0.01}, guess=state
    )
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
    """Opposite hinges of Bennett's linkage turn by as much, however few of the times of a run are
    saved."""
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
    """In one piece, and in two of which the first is saved to a file: the same angles, whole turns
    included."""
    state = bennett.state(bennett.home.positions + TURN * np.array([0, 0, 5, 0]), [20.0])
    whole = bennett.simulate(state, duration=3.0, save_at=[3.0])
    first = bennett.simulate(state, duration=1.1, save_at=[0.2])
    loaded = lw.Run.load(first.save(tmp_path / "first.nc"))
    for part in (first, loaded):
        close(angles(bennett.resume(part, duration=1.9, save_at=[3.0])), angles(whole), 1e-5)
    foreign = replace(first, attrs={**first.attrs, "final_windings": np.ones(3)})
    with pytest.raises(lw.LinkworkError, match="belongs to another robot and cannot be resumed"):
        bennett.resume(foreign, duration=1.0)


def test_members_that_save_nothing_have_no_turns_to_find(bennett):
    """Their table holds how they ended, and takes no run again."""
    states = bennett.state(np.tile(bennett.home.positions, (3, 1)), [[20.0], [-15.0], [5.0]])
    many = bennett.ensemble(states, duration=0.5)
    object.__setattr__(many, "_again", None)
    assert many.dataset["joint_position"].shape == (3, 0, 4)
    assert (many.dataset["status"].values == "FINISHED").all()


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
    close(
        few.dataset.joint_position.values[:, 0],
        many.dataset["joint_position"].values[:, 65],
        1e-5,
    )
    close(pickle.loads(pickle.dumps(few.final)).positions, many.final.positions, 1e-5)
    close(few.final.with_rates([0.0]).positions, many.final.positions, 1e-5)


def test_where_turns_act_another_turn_is_another_configuration():
    """A spring in every joint of a four-bar: the cut one is wound up by as much as the others make
    it."""
    described = lw.robots.four_bar()
    joints = {
        name: joint.model_copy(update={"spring": lw.Spring(stiffness=2.0)})
        for name, joint in described.joints.items()
    }
    robot = lw.Robot(described.model_copy(update={"joints": joints}))
    name = robot.equations.cuts[0].joint
    place = robot.coordinates.index(name)
    given = robot.home.positions.copy()
    given[place] += TURN
    with pytest.raises(
        lw.LinkworkError, match=f"{name}.*its spring, gear or thread counts whole turns"
    ):
        robot.state(given)
    asked = robot.assemble({name: float(given[place])})
    assert asked[name] == pytest.approx(given[place], abs=1e-9)
    close(
        robot.energy(asked)[1] - robot.energy(robot.home)[1],
        np.sum(asked.positions**2 - robot.home.positions**2),
        1e-6,
    )


def test_half_a_turn_between_samples_is_told_by_the_rates(bennett):
    """An angle that turns by more than half a turn from one sample to the next: q = w t, and w t +
    a t^2 / 2."""
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
    """From -3 rad at 0 rad/s to 3 rad at 20 rad/s in 1 s: it turned, or went back by 0.28 rad,
    which is taken."""
    place = bennett.coordinates.index("hinge_3")
    q, rates = np.zeros((2, 4)), np.zeros((2, 4))
    q[:, place] = [-3.0, 3.0]
    for ends, expected in (
        ([0.0, 20.0], 3.0 - TURN),
        ([3.0, 11.0], 3.0 - TURN),
        ([5.0, 9.0], 3.0),
        ([4.0, 10.0], 3.0),
    ):
        rates[:, place] = ends
        assert bennett.labels.unwrapped(np.arange(2.0), q, rates)[1, place] == pytest.approx(
            expected
        )


def levels(robot: lw.Robot, name: str, step: float, count: int) -> list[Event]:
    """Return events at the values of a coordinate that it passes `step` after `step` from home
    on."""
    values = [float(robot.home[name]) + step * (k + 0.5) for k in range(count)]
    return [
        Event(lambda t, state, value=value: state[name] - value, name=f"{value:.6g}")
        for value in values
    ]


def test_events_follow_an_angle_through_its_turns(bennett):
    """The hinge opposite to the crank passes each half turn when the crank does; resumed, too, and
    in an ensemble."""
    start, ahead = bennett.home.with_rates([20.0]), levels(bennett, "hinge_1", np.pi, 13)
    back = levels(bennett, "hinge_3", -np.pi, 13)
    run = bennett.simulate(start, duration=3.0, save_at=[3.0], events=[*ahead, *back])
    found = run.coords["event_time"].values
    assert len(found) == 26
    close(found[::2], found[1::2], 1e-6)
    plain = bennett.simulate(start, duration=3.0, save_at=[3.0])
    close(angles(run), angles(plain), 1e-10)
    assert run.steps == plain.steps
    first = bennett.simulate(start, duration=1.3, events=back)
    rest = bennett.resume(first, duration=1.7, events=back)
    parts = np.concatenate([part.coords["event_time"].values for part in (first, rest)])
    close(parts, found[1::2], 1e-5)
    members = bennett.ensemble(start.with_rates([20.0]), duration=3.0, events=back)
    close([time for _, time in members.events(0)], found[1::2], 1e-5)
    turned = bennett.state(bennett.home.positions - TURN * np.array([0, 0, 3, 0]), [20.0])
    later = bennett.simulate(turned, duration=3.0, events=back)
    assert [str(name) for name in later.coords["event"].values] == [
        event.name for event in back[6:]
    ]


def test_events_on_a_joint_that_begins_whole_turns_away():
    """A pin that is read without a jump, too: it passes where its own coordinate passes."""
    robot = lw.Robot(lw.robots.four_bar())
    state = robot.state(robot.home.positions + TURN * np.array([1, -2, 3, 2]), [1.0])
    level = float(state["rocker_pin"]) + 0.05
    run = robot.simulate(state, events=[lambda t, state: state["rocker_pin"] - level], duration=0.5)
    (time,) = run.coords["event_time"].values
    there = robot.simulate(state, duration=0.5, save_at=[time])
    assert there["joint_position"].values[0, 3] == pytest.approx(level, abs=1e-7)


@pytest.mark.parametrize("part", ["qw", "qx", "qy", "qz"])
def test_events_follow_a_quaternion_through_its_signs(part):
    robot = lw.Robot(lw.robots.spatial_slider_crank())
    start, name = robot.home.with_rates([40.0]), f"ball.{part}"
    fine = robot.simulate(start, duration=0.5, save_at=np.linspace(0, 0.5, 2001))
    t, p = fine.time, angles(fine)[:, robot.coordinates.index(name)]
    level = float(np.quantile(p, 0.3702))
    run = robot.simulate(start, duration=0.5, events=[lambda t, state: state[name] - level])
    passed = np.flatnonzero((p[1:] - level) * (p[:-1] - level) < 0)
    assert len(passed) > 2
    close(run.coords["event_time"].values, (t[passed] + t[passed + 1]) / 2, 2e-4)


@pytest.mark.sample(1)
@pytest.mark.parametrize("method", ["sharp_smart", "rodas", "rk4"])
def test_a_law_may_read_either_of_two_angles_that_turn_by_as_much(bennett, method):
    """hinge_3 turns by as much as hinge_1, the other way: a spring on it, as a law, pulls as one on
    hinge_1 does."""
    options = {"method": method, "duration": 1.0, "save_at": np.linspace(0, 1, 5)}
    options |= {"step": 2e-4} if method == "rk4" else {"rtol": 1e-8}
    start, home = bennett.home.with_rates([20.0]), bennett.home

    def on_first(t, state):
        return [-0.1 * (state["hinge_1"] - home["hinge_1"])]

    def on_third(t, state):
        return [0.1 * (state["hinge_3"] - home["hinge_3"])]

    expected, run = (bennett.simulate(start, law, **options) for law in (on_first, on_third))
    assert np.abs(angles(expected)[:, 2]).max() > 1.5 * np.pi
    close(angles(run), angles(expected), 1e-4)
    assert "drive_state" not in run.dataset and run.attrs["final_v"].size == 1
    if method == "sharp_smart":
        many = bennett.ensemble(start, on_third, **options)
        close(many.dataset["joint_position"].values[0], angles(run), 1e-8)
        assert many.extras.shape == (1, 0)
        resumed = bennett.resume(
            bennett.simulate(start, on_third, duration=0.4), on_third, duration=0.6, save_at=[1.0]
        )
        close(angles(resumed)[-1], angles(expected)[-1], 1e-4)


def test_a_sampled_function_sees_the_turns(bennett):
    state, seen = bennett.state(bennett.home.positions + TURN * np.array([0, 0, 5, 0]), [20.0]), []

    def watch(t, state):
        seen.append([float(state["hinge_1"]), float(state["hinge_3"])])
        return [0.0]

    bennett.simulate(state, Sampler(watch, 20.0), duration=2.0)
    turned = np.array(seen) - state.positions[[0, 2]]
    assert len(seen) > 30 and turned[-1, 0] > 4 * TURN
    close(turned[:, 1], -turned[:, 0], 1e-5)


def test_states_of_a_stack_are_those_made_alone(stewart):
    """Quaternions of any length and sign, angles whole turns away, states at rest and moving: the
    same to rounding, for large stacks are read at one go."""
    labels, home = stewart.labels, stewart.home.positions
    given = np.repeat(home[None], 11, axis=0)
    places = list(labels.all_quaternions.values())
    for row in range(len(given)):
        given[row, places[row % len(places)]] *= (-1) ** row * (1 + row)
    given[:, labels.free] += TURN * np.arange(11)[:, None]
    rates = np.random.default_rng(4).normal(size=(11, stewart.mobility))
    stack = stewart.state(given, rates)
    for row in range(len(given)):
        alone = stewart.state(given[row], rates[row])
        np.testing.assert_allclose(stack.at(row).positions, alone.positions, atol=1e-15, rtol=4e-16)
        np.testing.assert_allclose(stack.at(row).q, alone.q, atol=1e-15, rtol=4e-16)


def test_what_contradicts_in_a_stack_is_named(stewart):
    for name, places in stewart.labels.all_quaternions.items():
        given = np.repeat(stewart.home.positions[None], 11, axis=0)
        given[7, places] = 0.0
        with pytest.raises(lw.LinkworkError, match=f"quaternion of joint '{name}' is zero"):
            stewart.state(given)
    place = stewart.labels.quaternions[0][1]
    given = np.repeat(stewart.home.positions[None], 11, axis=0)
    given[9, place] += 0.1
    with pytest.raises(
        lw.LinkworkError, match=r"joint 'ball_1.q[wxyz]' is given as (\S+), .* make it (?!\1)"
    ):
        stewart.state(given)
