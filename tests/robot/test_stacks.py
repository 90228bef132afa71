"""Large stacks: states, forward and inverse dynamics as of each alone, over threads or not."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.model.stacks import undoubted

from tests.catalogue import built

pytestmark = pytest.mark.usefixtures("code_at_once")

N = 5000


def moved(robot: lw.Robot, count: int = N) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates of all joints along a run, and rates, count of each."""
    start = robot.home.with_rates(0.4 * np.ones(robot.mobility))
    run = robot.simulate(start, duration=0.1, samples=50)
    rates = np.random.default_rng(5).normal(size=(count, robot.mobility))
    return np.tile(run["joint_position"].values, (count // 50, 1)), rates


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ("name", "count"), [("prr3", N), ("bricard", N), ("stewart", N), ("rrs3", 100)]
)
def test_a_stack_is_made_of_states_of_their_own(name, count):
    """The first three at one go; where joints were added to the tree, step by step."""
    robot = built(name)
    positions, rates = moved(robot, count)
    states = robot.state(positions, rates)
    assert (undoubted(robot, positions, 1e-6, 1) is None) == (name == "rrs3")
    assert states.batch == (count,)
    for i in (0, 7, count - 1):
        alone = robot.state(positions[i], rates[i])
        for part in ("q", "positions", "rates"):
            np.testing.assert_allclose(
                getattr(states, part)[i], getattr(alone, part), rtol=1e-14, atol=1e-14
            )
    assert not np.shares_memory(states.rates, rates)
    assert not np.shares_memory(states.positions, positions)
    dealt = robot.state(positions, rates, threads=2)
    np.testing.assert_array_equal(dealt.q, states.q)
    np.testing.assert_array_equal(dealt.positions, states.positions)


def test_quaternions_may_have_any_length_and_sign():
    """At one go, too; those of joints that close loops keep the sign that is given."""
    robot, draw = built("stewart"), np.random.default_rng(8)
    positions, _ = moved(robot)
    positions = positions[:50].copy()
    given, every = positions.copy(), robot.labels.all_quaternions.values()
    assert len(every) > len(robot.labels.quaternions) > 0
    signs = draw.choice([-1.0, 1.0], size=(50, len(every)))
    for places, sign in zip(every, signs.T, strict=True):
        given[:, places] *= (sign * draw.uniform(0.5, 2.0, 50))[:, None]
    assert undoubted(robot, given, 1e-6, 1) is not None
    states, plain = robot.state(given), robot.state(positions)
    assert robot.closure_error(states).max() < 1e-12
    for places in every:
        p, told = given[:, places], states.positions[:, places]
        p = p / np.linalg.norm(p, axis=1, keepdims=True)
        np.testing.assert_allclose(told, p, atol=1e-12)
    for i in range(0, 50, 7):
        alone = robot.state(given[i])
        np.testing.assert_allclose(states.positions[i], alone.positions, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(states.q[i], alone.q, rtol=1e-14, atol=1e-14)
    others = [k for k in range(given.shape[1]) if not any(k in places for places in every)]
    np.testing.assert_allclose(states.positions[:, others], plain.positions[:, others], atol=1e-12)
    given[3, next(iter(every))] = 0.0
    with pytest.raises(lw.LinkworkError, match="is zero; give one of any other length"):
        robot.state(given)


def test_what_is_doubted_goes_the_longer_way():
    """Whole turns, small gaps, contradictions and what is no number."""
    robot = built("four_bar")
    positions, rates = moved(robot)
    assert undoubted(robot, positions, 1e-6, 1) is not None
    turned, gaping, wrong, unknown = (positions.copy() for _ in range(4))
    rocker = robot.coordinates.index("rocker_pivot")
    turned[3, rocker] += 2 * np.pi
    gaping[2, 0] += 1e-8
    wrong[4, rocker] += 0.3
    unknown[5, 1] = np.nan
    for given in (turned, gaping, wrong, unknown):
        assert undoubted(robot, given, 1e-6, 1) is None
    np.testing.assert_allclose(robot.state(turned).positions, turned, atol=1e-12)
    assert robot.closure_error(robot.state(gaping)).max() < 1e-12
    with pytest.raises(lw.LinkworkError, match=r"the loops of state 4 are open|'rocker_pivot'"):
        robot.state(wrong)
    with pytest.raises(lw.LinkworkError, match=r"positions\[5, 1\] is nan"):
        robot.state(unknown)
    with pytest.raises(lw.LinkworkError, match="stacks of the shapes"):
        robot.state(positions, rates[:7])


@pytest.mark.parametrize("threads", [2, 3, None])
def test_threads_change_nothing(threads):
    robot = built("prr3")
    positions, rates = moved(robot)
    states, u = robot.state(positions, rates), rates[::-1].copy()
    v_dot = robot.forward_dynamics(states, u)
    np.testing.assert_array_equal(robot.forward_dynamics(states, u, threads=threads), v_dot)
    np.testing.assert_array_equal(
        robot.forward_dynamics(states, [1.0, 0.0, 2.0], threads=threads),
        robot.forward_dynamics(states, [1.0, 0.0, 2.0]),
    )
    found = robot.inverse_dynamics(states, v_dot, threads=threads)
    np.testing.assert_array_equal(found, robot.inverse_dynamics(states, v_dot))
    np.testing.assert_allclose(found, u, atol=1e-10)


def test_what_is_no_number_of_threads():
    robot = built("prr3")
    positions, rates = moved(robot)
    states = robot.state(positions)
    for call in (
        lambda: robot.state(positions, threads=0),
        lambda: robot.forward_dynamics(states, rates, threads=0),
        lambda: robot.inverse_dynamics(states, rates, threads=0),
    ):
        with pytest.raises(lw.LinkworkError, match="threads is 0; give a whole number, at least 1"):
            call()
