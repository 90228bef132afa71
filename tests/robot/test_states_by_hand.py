"""States that are made by hand: what belongs together is answered as of the robot's own states,
what does not is refused by each call."""

from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw

CALLS = {
    "forward dynamics": lambda robot, state: robot.forward_dynamics(state, [1.0, 2.0, 3.0]),
    "mass matrix": lambda robot, state: robot.mass_matrix(state),
    "tool": lambda robot, state: robot.tool_pose(state),
    "reactions": lambda robot, state: robot.reactions(state, [1.0, 2.0, 3.0]).wrenches,
    "run": lambda robot, state: robot.simulate(state, duration=0.01)["joint_position"].values,
}


@pytest.fixture(scope="module")
def robot():
    return lw.Robot("prr3")


@pytest.fixture(scope="module")
def state(robot):
    return robot.home.with_rates([0.1, 0.2, 0.3])


def spoilt(values, by):
    values = np.array(values)
    values[-1] += by
    return values


WRONG = {
    "short positions": (lambda s: {"positions": s.positions[1:]}, "the state's positions have"),
    "short rates": (lambda s: {"rates": s.rates[1:]}, r"the state's rates have the shape \(2,\)"),
    "short q": (lambda s: {"q": s.q[1:]}, r"the state's q have the shape \(6,\), not \(7,\)"),
    "a stack of rates": (lambda s: {"rates": np.stack([s.rates] * 2)}, "the state's rates have"),
    "open": (lambda s: {"q": spoilt(s.q, 0.3)}, "its loops are open by"),
    "of other positions": (
        lambda s: {"positions": spoilt(s.positions, 0.3)},
        "the state's positions are not those of its q: wrist_3 is",
    ),
    "without a number": (lambda s: {"q": spoilt(s.q, np.nan)}, r"the state's q\[6\] is nan"),
    "without a place": (
        lambda s: {"positions": spoilt(s.positions, np.nan)},
        "positions are not those of its q: wrist_3 is nan",
    ),
    "other names": (lambda s: {"independent": ("x", "y", "z")}, "its rates are those of x, y, z"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_does_not_belong_together_is_refused(robot, state, wrong):
    parts, words = WRONG[wrong]
    made = replace(state, **parts(state))
    assert repr(made)
    for call in CALLS.values():
        with pytest.raises(lw.LinkworkError, match=words):
            call(robot, made)


@pytest.mark.parametrize("call", CALLS)
def test_lists_and_whole_turns_are_taken(robot, state, call):
    turned = np.array(state.positions)
    turned[-1] += 2 * np.pi  # of a joint that closes a loop
    for more in ({"q": list(state.q)}, {"rates": tuple(state.rates)}, {"positions": turned}):
        made = replace(state, **more)
        found, wanted = CALLS[call](robot, made), CALLS[call](robot, state)
        if call == "run" and "positions" in more:
            found = found - (turned - state.positions)
        np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_what_is_no_array_is_refused_where_it_is_made(state):
    for wrong in (None, "abc", 0.1, state.rates * 1j):
        with pytest.raises(lw.LinkworkError, match=r"the state's rates are .*; give arrays"):
            replace(state, rates=wrong)


def test_an_empty_stack_has_no_reactions():
    robot = lw.Robot("delta")
    none = {name: getattr(robot.home, name)[None][:0] for name in ("positions", "rates", "q")}
    assert robot.reactions(replace(robot.home, **none), np.zeros(3)).wrenches.shape[0] == 0
