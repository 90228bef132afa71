"""First steps: they are as accurate as asked, whatever the estimate of their error happens to be,
alone and in lanes.

Truth: the same motion by another method, at the tightest tolerance, in short steps.
"""

import numpy as np
import pytest

import linkwork as lw

MOST = 14  # steps tried until one is accepted
AT_CHANCE = [253, 348, 374, 380, 507, 1046, 1250, 1375, 1392]
"""Seeds of motions whose first steps were once 70 to 900 times less accurate than asked, their
estimates being small by accident."""


def begun(robot: lw.Robot, seed: int):
    rng = np.random.default_rng(seed)
    rates = rng.normal(size=robot.mobility) * 10 ** rng.uniform(-2, 1)
    return robot.state(robot.home.positions, rates), 10 ** rng.uniform(-8, -4)


def first_step(robot: lw.Robot, seed: int, method: str) -> tuple[float, float]:
    """Return the length of the first accepted step [s], and its error relative to what is
    allowed."""
    state, rtol = begun(robot, seed)
    asked = {"duration": 2.0, "rtol": rtol, "atol": rtol / 100, "method": method}
    runs = (robot.simulate(state, **asked, max_steps=tried) for tried in range(1, MOST))
    run = next(run for run in runs if len(run.time) > 1)
    return run.time[1], error(robot, state, run, 1, rtol)


def error(robot: lw.Robot, state: lw.State, run: lw.Run, row: int, rtol: float) -> float:
    h = float(run.time[row])
    tight = {"rtol": 1e-13, "atol": 1e-15, "method": "dop853", "max_step": h / 6}
    exact = robot.simulate(state, duration=h, save_at=[h], **tight)
    squares = []
    for name in ("joint_position", "joint_rate"):
        y, truth = run[name].values[row], exact[name].values[-1]
        squares.append((((y - truth) / (rtol / 100 + rtol * abs(y))) ** 2).mean())
    return float(np.sqrt(np.mean(squares)))


@pytest.mark.parametrize("seed", AT_CHANCE)
def test_no_first_step_is_taken_for_an_estimate_that_is_small_by_accident(seed):
    _, missed = first_step(lw.Robot("prr3"), seed, "sharp_smart")
    assert missed < 10


@pytest.mark.sample(2)
@pytest.mark.parametrize("method", ["dormand_prince", "sharp_smart"])
@pytest.mark.parametrize("name", ["rrr3", "five_bar"])
def test_first_steps_are_as_accurate_as_asked(name, method):
    robot = lw.Robot(name)
    assert max(first_step(robot, seed, method)[1] for seed in range(100)) < 10


def test_first_steps_of_members_are_those_of_runs_alone():
    robot = lw.Robot("prr3")
    for seed in AT_CHANCE[:3]:
        state, rtol = begun(robot, seed)
        h, _ = first_step(robot, seed, "sharp_smart")
        asked = {"duration": h, "rtol": rtol, "atol": rtol / 100, "method": "sharp_smart"}
        members = robot.ensemble(
            robot.state(np.tile(state.positions, (9, 1)), np.tile(state.rates, (9, 1))),
            **asked,
            samples=2,
        )
        alone = robot.simulate(state, **asked, samples=2)
        assert members.nfev[4] == alone.statistics.nfev
        found = members.dataset.joint_position.values[4, -1]
        np.testing.assert_allclose(found, alone["joint_position"].values[-1], rtol=0, atol=1e-12)
