"""Environments do what Gymnasium says of environments, and many do what one does."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import linkwork as lw
from linkwork import math
from linkwork.gym import DecisionProcess, Environment, Environments, register
from linkwork.gym.catalogue import balancing, reaching, swinging_up
from linkwork.robots import prr3

from tests.processes import finished
from tests.products import sampled

READY = {
    "Linkwork/Reach-v0": reaching,
    "Linkwork/Balance-v0": balancing,
    "Linkwork/SwingUp-v0": swinging_up,
}
UNBOUNDED = "ignore:.*A Box observation space:UserWarning"
pytestmark = [
    pytest.mark.filterwarnings(UNBOUNDED),
    pytest.mark.filterwarnings("ignore:.*WARN:UserWarning"),
]


def actions(envs, steps: int, seed: int = 0) -> np.ndarray:
    """Random actions (steps, N, numbers), some beyond their bounds."""
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (steps, *envs.action_space.shape))


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", READY)
def test_a_registered_environment_passes_the_check(name):
    check_env(gymnasium.make(name).unwrapped)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "mode"), sampled(tuple(READY), tuple(AutoresetMode)))
def test_many_do_what_gymnasium_makes_of_single_ones(name, mode):
    """Gymnasium's own vector of single environments is the standard, for each way to begin
    anew."""
    count, horizon, steps = 2, 12, 40
    one = [lambda: gymnasium.make(name, max_episode_steps=horizon)] * count
    singles = SyncVectorEnv(one, autoreset_mode=mode)
    many = gymnasium.make_vec(name, num_envs=count, max_episode_steps=horizon, autoreset_mode=mode)
    assert many.metadata["autoreset_mode"] is mode
    assert many.single_action_space == singles.single_action_space
    assert many.observation_space == singles.observation_space
    np.testing.assert_array_equal(many.reset(seed=5)[0], singles.reset(seed=5)[0])
    ended = 0
    for action in actions(many, steps):
        given, told = singles.step(action), many.step(action)
        for expected, found in zip(given[:4], told[:4], strict=True):
            np.testing.assert_array_equal(found, expected)
            assert found.dtype == expected.dtype
        over = given[2] | given[3]
        ended += over.sum()
        assert ("final_obs" in told[4]) == ("final_obs" in given[4])
        if "final_obs" in given[4]:
            np.testing.assert_array_equal(told[4]["_final_obs"], given[4]["_final_obs"])
            for i in np.flatnonzero(over):
                np.testing.assert_array_equal(told[4]["final_obs"][i], given[4]["final_obs"][i])
        if mode is AutoresetMode.DISABLED and over.any():
            begun = [envs.reset(options={"reset_mask": over})[0] for envs in (many, singles)]
            np.testing.assert_array_equal(*begun)
    assert ended >= 3 * count


def test_seeds_give_the_same_episodes_whoever_runs_beside():
    process = reaching()
    drawn = np.random.default_rng(1).uniform(-1, 1, (150, 7, 3))

    def told(envs, acts, seed):
        parts = [envs.reset(seed=seed)[0]]
        return np.array([*parts, *(envs.step(act)[0] for act in acts)])

    seven = told(Environments(process, 7), drawn, 11)
    np.testing.assert_array_equal(told(Environments(process, 7, threads=2), drawn, 11), seven)
    alone = told(Environments(process, 1), drawn[:, 3:4], 14)
    np.testing.assert_array_equal(alone[:, 0], seven[:, 3])
    listed = told(Environments(process, 2), drawn[:, [0, 6]], [11, 17])
    np.testing.assert_array_equal(listed, seven[:, [0, 6]])
    assert (told(Environments(process, 7), drawn, 12)[0] != seven[0]).any()
    again = Environments(process, 7)
    assert (again.reset()[0] != again.reset()[0]).any()


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "mode"), sampled(tuple(READY), tuple(AutoresetMode)[:2]))
def test_blocks_of_lanes_do_what_one_does(name, mode):
    """Where as many robots as lanes stand side by side, as where a single one fills them up."""
    count, seed, own = 40, 7, (0, 17, 39)
    options = {"max_episode_steps": 15, "autoreset_mode": mode}
    many = Environments(READY[name](), count, threads=1, **options)
    alone = [Environments(READY[name](), 1, **options) for _ in own]
    begun = many.reset(seed=seed)[0]
    for i, one in zip(own, alone, strict=True):
        np.testing.assert_array_equal(one.reset(seed=seed + i)[0][0], begun[i])
    for action in actions(many, 40):
        told = many.step(action)
        for i, one in zip(own, alone, strict=True):
            for expected, found in zip(one.step(action[[i]])[:4], told[:4], strict=True):
                np.testing.assert_array_equal(found[i], expected[0])


def test_what_is_drawn_is_the_stream_of_each_environments_generator():
    """Over more episodes than are drawn for at a time."""
    process, count, episodes = reaching(), 3, 150
    envs = Environments(process, count, max_episode_steps=1, autoreset_mode="SameStep")
    goals = [envs.reset(seed=4)[0][:, :3].copy()]
    still = np.zeros((count, 3))
    goals += [envs.step(still)[0][:, :3].copy() for _ in range(episodes - 1)]
    low, high = np.array([*process.draws.values()]).T
    for i in range(count):
        stream = np_random(4 + i)[0].random((episodes, 4))[:, :3]
        np.testing.assert_allclose(np.array(goals)[:, i], low + stream * (high - low), 0, 1e-12)


def test_what_is_returned_stays_as_it_is():
    """A later step writes to no array that was returned before."""
    envs = Environments(reaching(), 20, max_episode_steps=3, autoreset_mode="SameStep")
    kept = [envs.reset(seed=0)[0]]
    before = [kept[0].copy()]
    for action in actions(envs, 7):
        *arrays, infos = envs.step(action)
        kept += [*arrays, *(row for row in infos.get("final_obs", ()) if row is not None)]
        before += [each.copy() for each in kept[len(before) :]]
    for array, copied in zip(kept, before, strict=True):
        np.testing.assert_array_equal(array, copied)


def test_episodes_without_seeds_differ():
    first, second = (Environments(reaching(), 3).reset()[0] for _ in range(2))
    assert (first != second).any()


def test_rewards_and_ends_are_those_of_the_formulas():
    process = reaching()
    robot, home = process.robot, process.robot.tool_pose(process.robot.home)
    envs = Environments(process, 50, autoreset_mode="Disabled")
    seen, _ = envs.reset(seed=2)
    goal = seen[:, :3]
    assert (np.abs(goal) <= [0.03, 0.03, 0.15]).all() and (goal[:, 2] <= 0.04).all()
    ended = 0
    for act in actions(envs, 60):
        seen, rewards, over, cut, _ = envs.step(act)
        moved = robot.tool_pose(envs.states) - home
        error = goal - moved
        e = error @ np.diag([1, 1, 0.1])
        taken = np.clip(act, -1, 1)
        expected = 1 / (1 + (e**2).sum(1) / 0.02**2) - 0.01 * (taken**2).sum(1)
        np.testing.assert_allclose(rewards, expected, 1e-11, 1e-11)
        np.testing.assert_allclose(seen[:, :3], error, 1e-11, 1e-11)
        velocity = robot.observe(envs.states.at(7)).tool_velocity
        np.testing.assert_allclose(seen[7, 3:6], velocity, 1e-10, 1e-11)
        x, y, turn = moved.T
        left = (abs(x) > 0.09) | (abs(y) > 0.09) | (turn > 0.1) | (turn < -0.25)
        np.testing.assert_array_equal(over, left)
        begun = over | cut
        if begun.any():
            seen, _ = envs.reset(options={"reset_mask": begun})
            goal[begun] = seen[begun, :3]
            ended += begun.sum()
    assert ended > 20


def test_steps_are_those_of_a_run():
    process, law = reaching(), [0.3, -0.2, 0.1]
    envs = Environments(process, 2)
    envs.reset(seed=0)
    for _ in range(10):
        envs.step(np.tile(law, (2, 1)))
    run = process.robot.simulate(process.robot.home, 4 * np.array(law), duration=0.2, rtol=1e-11)
    np.testing.assert_allclose(envs.states.q[1], run.final.q, 1e-5, 5e-6)


def test_masses_may_be_drawn():
    """Each episode's motion is that of a robot of this mass."""
    robot = lw.Robot(prr3()).free("platform.mass")
    process = DecisionProcess(
        robot,
        dt=0.01,
        low=[-5.0] * 3,
        high=[5.0] * 3,
        observation=lambda t, state: [*state.tool_pose, t],
        reward=lambda t, state, action: t,
        draws={"platform.mass": (0.5, 4.0)},
    )
    envs = Environments(process, 6)
    given = np.array([0.6, 1.0, 2.0, 3.0, 3.5, 4.0])
    envs.reset(seed=0, options={"draws": {"platform.mass": given}})
    for _ in range(20):
        seen, rewards, *_ = envs.step(np.tile([3.0, -2.0, 1.0], (6, 1)))
    np.testing.assert_allclose(rewards, 0.2, 1e-12)
    with pytest.raises(lw.LinkworkError, match=r"'platform.mass' is -1, which the robot's descr"):
        envs.reset(options={"draws": {"platform.mass": [-1.0, *given[1:]]}})
    for i, mass in enumerate(given):
        own = robot.with_parameters({"platform.mass": mass})
        run = own.simulate(own.home, [3.0, -2.0, 1.0], duration=0.2, method="rk4", step=0.01)
        pose = own.tool_pose(run.final)
        np.testing.assert_allclose(seen[i, :3], pose, 1e-10)


def test_starts_are_drawn_from_all_that_are_given():
    process = swinging_up()
    envs = Environments(process, 400)
    envs.reset(seed=1)
    begun = {tuple(row) for row in envs.states.q.round(9).tolist()}
    assert begun <= {tuple(row) for row in process.starts.q.round(9).tolist()}
    assert len(begun) > 50


def test_a_robot_that_cannot_be_stepped_on_is_truncated_with_its_reason():
    envs = Environments(reaching(), 4)
    before, _ = envs.reset(seed=3)
    envs._robots.v[2] = np.nan
    seen, rewards, over, cut, infos = envs.step(np.zeros((4, 3)))
    np.testing.assert_array_equal(cut, [False, False, True, False])
    assert not over.any() and np.isfinite(rewards).all()
    assert "infinite or undefined" in infos["reason"][2] and infos["reason"][0] is None
    np.testing.assert_array_equal(infos["_reason"], cut)
    np.testing.assert_array_equal(seen[2], before[2])
    seen, rewards, over, cut, infos = envs.step(np.zeros((4, 3)))
    assert not cut.any() and rewards[2] == 0.0 and "reason" not in infos
    one = Environment(reaching())
    one.reset(seed=0)
    one._one._robots.v[0] = np.nan
    *_, info = one.step(np.zeros(3))
    assert "infinite or undefined" in info["reason"]


def test_the_reason_is_in_the_final_info_of_the_same_step():
    envs = Environments(reaching(), 4, autoreset_mode="SameStep")
    envs.reset(seed=3)
    envs._robots.v[2] = np.nan
    *_, cut, infos = envs.step(np.zeros((4, 3)))
    assert cut[2] and "reason" not in infos
    assert "infinite or undefined" in infos["final_info"]["reason"][2]


REFUSED = [
    (lambda envs: envs.step(np.full((2, 3), np.nan)), r"action of environment 0 is \[nan"),
    (lambda envs: envs.step(np.zeros((3, 3))), r"actions are of shape \(3, 3\); give numbers"),
    (lambda envs: envs.step("left"), r"actions are 'left'"),
    (lambda envs: envs.reset(options={"mask": 1}), "there is no option of reset 'mask'"),
    (lambda envs: envs.reset(options={"reset_mask": [1, 2]}), "give 2 truth values"),
    (lambda envs: envs.reset(options={"draws": {"goal": 1.0}}), "no number that is drawn 'goal'"),
    (lambda envs: envs.reset(options={"draws": {"goal_x": np.ones(3)}}), "one number, or 2"),
    (lambda envs: envs.step(1j * np.ones((2, 3))), "give numbers"),
    (lambda envs: envs.reset(seed=[1, 2, 3]), "there are 3 seeds"),
    (lambda envs: envs.reset(seed=1.5), "a seed is 1.5; give a whole number"),
    (lambda envs: envs.reset(seed=-1), "a seed is -1; give a whole number that is not negative"),
    (lambda envs: envs.reset(seed=[0.5, 2]), "a seed is 0.5"),
    (lambda envs: Environment(envs.process).reset(seed="a"), "a seed is 'a'"),
    (lambda envs: envs.reset(seed=True), "a seed is True; give a whole number"),
    (
        lambda envs: Environment(envs.process).reset(seed=[3]),
        r"a seed is \[3\]; give a whole number",
    ),
    (lambda envs: envs.step(np.ma.masked_equal(np.zeros((2, 3)), 0)), "actions are masked_array"),
    (lambda envs: envs.step(np.zeros((2, 3), bool)), r"actions are array\(\[\[False"),
    (lambda envs: Environment(envs.process).step(0.5), r"the action is of shape \(\); give 3 num"),
    (
        lambda envs: Environment(envs.process).step(["a"] * 3),
        r"the action is \['a', 'a', 'a'\]; giv",
    ),
    (copy.copy, "environments cannot be copied or pickled"),
    (lambda envs: envs.extra("ball"), "there is no further state 'ball'"),
]


@pytest.mark.sample(8)
@pytest.mark.parametrize(("call", "sentence"), REFUSED)
def test_what_does_not_fit_is_refused_before_anything_happens(call, sentence):
    envs = Environments(reaching(), 2)
    envs.reset(seed=0)
    before = envs.states.q.copy()
    with pytest.raises(lw.LinkworkError, match=sentence):
        call(envs)
    np.testing.assert_array_equal(envs.states.q, before)


def test_steps_without_a_reset_are_refused():
    envs = Environments(reaching(), 2, autoreset_mode="Disabled", max_episode_steps=1)
    with pytest.raises(lw.LinkworkError, match="environment 0 has not begun, or is over"):
        envs.step(np.zeros((2, 3)))
    with pytest.raises(lw.LinkworkError, match="reset all environments first"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.reset(seed=0)
    envs.step(np.zeros((2, 3)))
    with pytest.raises(lw.LinkworkError, match="is over; reset it"):
        envs.step(np.zeros((2, 3)))


def of_prr3(**options) -> DecisionProcess:
    given = {
        "observation": lambda t, state: state.tool_pose,
        "reward": lambda t, state, action: state["slide_1"],
        "dt": 0.01,
        "low": [-1.0] * 3,
        "high": [1.0] * 3,
    }
    robot = options.pop("robot", reaching().robot)
    return DecisionProcess(robot, **given | options)


WRONG = [
    ({"low": [0.0]}, "bounds of the action"),
    ({"low": [0.0], "high": [1.0]}, "an action has 1 number, and the robot 3 actuators"),
    ({"dt": 0.0}, "dt is 0.0; give a positive number"),
    ({"horizon": 0}, "horizon is 0"),
    ({"reward": 1.0}, "reward is 1.0; give a function"),
    ({"rates": lambda t, state, action: 0.0}, "give both"),
    ({"draws": {"x": (1.0, 0.0)}}, "the least and the largest"),
    ({"draws": {"x": (0.0, 1.0)}}, "draws name 'x', which is no further state"),
    (
        {"observation": lambda t, state: [1] if state["slide_1"] > 0 else [2]},
        "branches on the value",
    ),
    ({"reward": lambda t, state, action: [1.0, 2.0]}, "the reward returns 2 values"),
    ({"terminated": lambda t, state: None}, "the termination returns None"),
    ({"forces": lambda t, state, action: action[:2]}, "the controller returns 2 values"),
    ({"robot": "prr3"}, r"the robot of a process is 'prr3'; give a linkwork.Robot, such as"),
    ({"drives": 3}, r"drives are 3; give them by name, such as \{'slide_1'"),
    ({"drives": {"slide_1": 3}}, "the drive of 'slide_1' is 3; give one of linkwork.control"),
    ({"drives": {"slide": 3}}, "there is no actuator 'slide' for a drive"),
    ({"observation": lambda t, state: "seen"}, "the observation returns 'seen'; give numbers"),
    ({"observation": lambda t, state: ["x"]}, "the observation returns a list of str; give num"),
    ({"observation": lambda t, state: []}, "the observation returns a list; give numbers, at l"),
    ({"observation": lambda t, state: None}, "the observation returns None; give numbers"),
    ({"states": [3], "rates": lambda t, state, action: 0.0}, "a further state is 3; give its name"),
    ({"states": ["x"], "rates": lambda t, state, action: 0.0}, "a further state is 'x'; give its"),
    ({"states": np.array([1, 2])}, r"a further state is np.int64\(1\); give its name"),
    ({"starts": 0}, "a state is needed, not int"),
    ({"starts": np.zeros(3)}, "a state is needed, not ndarray"),
    ({"horizon": 2**70}, "horizon is 1180591620717411303424; give at most"),
    ({"states": [("x", "m", "a")], "rates": lambda t, s, a: 0.0}, "the start of 'x' is 'a'"),
]


@pytest.mark.parametrize(("options", "sentence"), WRONG)
def test_processes_that_do_not_fit_are_refused(options, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        Environments(of_prr3(**options), 2)


def test_numbers_of_environments_and_what_is_left_out_are_taken_as_they_are_meant():
    none: Any = None
    envs = Environments(of_prr3(draws=none, drives=none), np.float64(3.0))  # pyright: ignore
    assert envs.reset(seed=0)[0].shape == (3, 3) and envs.action_space.shape == (3, 3)


def test_lengths_and_impossible_masses_may_not_be_drawn():
    robot = lw.Robot(prr3()).free("slide_1.frames.1.position.0", "platform.mass")
    for name, sentence in (
        ("slide_1.frames.1.position.0", "the loops close otherwise"),
        ("platform.mass", "numbers that the robot's description may not"),
    ):
        with pytest.raises(lw.LinkworkError, match=sentence):
            Environments(of_prr3(robot=robot, draws={name: (-0.1, 0.1)}), 2)


def test_a_reward_that_is_undefined_is_refused_by_its_name():
    undefined = of_prr3(reward=lambda t, state, action: math.log(0.005 - t))
    envs = Environments(undefined, 3)
    envs.reset(seed=0)
    with pytest.raises(lw.LinkworkError, match=r"the reward of environment 0 is nan at t = 0.01 s"):
        envs.step(np.zeros((3, 3)))


def test_modes_and_names_that_there_are_not():
    with pytest.raises(lw.LinkworkError, match="there are 'NextStep', 'SameStep', 'Disabled'"):
        Environments(reaching(), 2, autoreset_mode="now")
    with pytest.raises(lw.LinkworkError, match="there is no render_mode 'human'; there is 'rgb_ar"):
        Environment(reaching(), render_mode="human")
    with pytest.raises(lw.LinkworkError, match=r"there is no render_mode array\("):
        Environments(reaching(), 2, render_mode=np.array(["human", "ansi"]))  # pyright: ignore
    with pytest.raises(lw.LinkworkError, match="made without pictures; make them with render_mode"):
        Environments(reaching(), 2).render()
    with pytest.raises(lw.LinkworkError, match="no episode has begun; reset the environments bef"):
        Environments(reaching(), 2, render_mode="rgb_array").render()
    with pytest.raises(lw.LinkworkError, match=r"is no linkwork.gym.DecisionProcess"):
        Environments("Reach", 2)  # pyright: ignore[reportArgumentType]


def test_what_cannot_be_registered_is_refused():
    with pytest.raises(lw.LinkworkError, match="the process of 'Mine/A-v0' is 3; give a function"):
        register("Mine/A-v0", 3, 10)  # pyright: ignore[reportArgumentType]
    with pytest.raises(lw.LinkworkError, match="horizon is -1; give a whole number, at least 1"):
        register("Mine/A-v0", reaching, -1)
    assert "Mine/A-v0" not in gymnasium.registry


def test_pictures_show_the_states_of_their_robots():
    """What is drawn differs where the robot does, and the same state gives the same picture."""
    many = gymnasium.make_vec("Linkwork/Reach-v0", num_envs=2, render_mode="rgb_array")
    many.reset(seed=0)
    before = many.render()
    for _ in range(4):
        many.step(many.action_space.high * [[0.0], [1.0]])
    after = many.render()
    assert [each.shape for each in (*before, *after)] == [(500, 500, 3)] * 4
    assert after[0].dtype == np.uint8
    moved = [(one != other).any(axis=2).mean() for one, other in zip(before, after, strict=True)]
    assert moved[0] == 0 < 0.01 < moved[1] < 0.2
    one = gymnasium.make("Linkwork/Reach-v0", render_mode="rgb_array")
    one.reset(seed=0)
    np.testing.assert_array_equal(one.render(), before[0])
    for number in (2, -1, "a"):
        with pytest.raises(lw.LinkworkError, match=f"no environment {number!r}; there are 2, from"):
            many.unwrapped.picture(number)
    assert one.metadata["render_fps"] == round(1 / reaching().dt)


def test_without_gymnasium_one_sentence_says_what_to_install():
    hidden = "import sys; sys.modules['gymnasium'] = None; import linkwork.gym"
    told = finished("-c", hidden).stderr.splitlines()[-1]
    assert told.endswith('linkwork.gym needs Gymnasium: pip install "linkwork[gym]"')


def test_starts_of_which_a_later_one_has_turned_are_seen_and_pulled_so():
    """The tip of a five-bar that was wound up by a turn, which observation and forces read."""
    robot = lw.Robot("five_bar")
    at_tip = np.array([name == "tip" for name in robot.coordinates])
    places = robot.home.positions + 2 * np.pi * np.array([[0], [1]]) * at_tip
    process = DecisionProcess(
        robot,
        dt=0.01,
        low=[-1.0, -1.0],
        high=[1.0, 1.0],
        observation=lambda t, state: [state["tip"], state["motor_1"]],
        reward=lambda t, state, action: state["tip"],
        forces=lambda t, state, action: [action[0] + 0.02 * state["tip"], action[1]],
        starts=robot.state(places),
    )
    envs = Environments(process, num_envs=6, threads=1)
    seen, _ = envs.reset(seed=1)
    wound = envs.states["tip"] > 3.0
    assert wound.any() and not wound.all()
    np.testing.assert_allclose(seen[:, 0], places[wound.astype(int)][:, at_tip][:, 0])
    for _ in range(5):
        seen, reward, *_ = envs.step(np.zeros((6, 2)))
    np.testing.assert_array_equal(reward, seen[:, 0])
    for place, which in zip(places, (~wound, wound), strict=True):
        law = lambda t, state: [0.02 * state["tip"], 0.0]  # noqa: E731
        run = robot.simulate(robot.state(place), law, duration=0.05, method="rk4", step=0.01)
        np.testing.assert_allclose(
            seen[which] - [run.final["tip"], run.final["motor_1"]], 0, atol=1e-12
        )
