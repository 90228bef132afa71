"""What was made stays as it is: nobody writes into its arrays, numbers or attributes."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import linkwork as lw


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return lw.Robot("prr3").free("platform.mass")


MADE: dict[str, Callable[[lw.Robot, lw.State], Any]] = {
    "home": lambda robot, start: robot.home,
    "state": lambda robot, start: robot.state(start.positions, np.ones(3)),
    "one of a stack": lambda robot, start: robot.assemble(tool=np.array([[0.5, 0.29, 1.2]] * 2))[
        "slide_1"
    ],
    "rates": lambda robot, start: start.with_rates([1.0, 0.0, 0.0]),
    "sent": lambda robot, start: pickle.loads(pickle.dumps(start)),
    "copied": lambda robot, start: copy.deepcopy(start),
    "motion": lambda robot, start: robot.follow(
        lw.paths.line([0.5, 0.29, 1.2], [0.52, 0.29, 1.2]), 1.0, samples=5
    ),
    "sampled": lambda robot, start: lw.Sampled([0.0, 1.0], np.zeros((2, 3))),
    "signal": lambda robot, start: lw.Sampled([0.0, 1.0], np.zeros((2, 3)), "linear").signal,
    "run": lambda robot, start: robot.simulate(start, [0, 0, 0], duration=0.01),
    "ensemble": lambda robot, start: robot.ensemble(
        start, [0, 0, 0], {"platform.mass": [1.0, 2.0]}, duration=0.01
    ),
    "robot": lambda robot, start: robot,
}


def arrays(made: Any) -> list[np.ndarray]:
    """Return the arrays that an object shows its users."""
    if isinstance(made, np.ndarray):
        return [made]
    if isinstance(made, lw.Run):
        names = (*made.variables, "time")
        found = [made[name].values for name in made.variables]
        found += [made.dataset[name].values for name in names]
        return [*found, made.time, made.final.q]
    if isinstance(made, lw.Motion | lw.State):
        found = arrays(made.state) if isinstance(made, lw.Motion) else [made.positions]
        return found + [each for each in vars(made).values() if isinstance(each, np.ndarray)]
    return [each for each in vars(made).values() if isinstance(each, np.ndarray)]


@pytest.mark.parametrize("what", MADE)
def test_arrays_of_what_was_made_are_not_written_into(robot, what):
    found = arrays(MADE[what](robot, robot.assemble(tool=[0.5, 0.29, 1.2])))
    assert found
    for each in found:
        with pytest.raises(ValueError, match="read-only"):
            each[...] = 0.0


def test_what_was_given_stays_its_owners(robot):
    """Arrays that were given may go on to be written into, and nothing follows."""
    start = robot.assemble(tool=[0.5, 0.29, 1.2])
    positions, rates, times = start.positions.copy(), np.ones(3), np.linspace(0.0, 0.01, 3)
    values = np.zeros((3, 3))
    state, sampled = robot.state(positions, rates), lw.Sampled(times, values)
    run = robot.simulate(state, sampled, duration=0.01, save_at=times)
    for given in (positions, rates, times, values):
        given[...] = 0.5
    assert state.positions == pytest.approx(start.positions) and (state.rates == 1.0).all()
    assert run.time == pytest.approx([0.0, 0.005, 0.01]) and not sampled.values.any()


def test_numbers_of_a_robot_are_changed_by_another_robot(robot):
    path = "platform.mass"
    mass = robot.parameters[path]
    for change in (
        lambda: robot.parameters.update({path: 9.0}),
        lambda: robot.parameters.__setitem__(path, 9.0),
        lambda: robot.parameters.pop(path),
    ):
        with pytest.raises(lw.LinkworkError, match=r"robot\.with_parameters\({path: value}\)"):
            change()
    for name in ("parameters", "mechanism", "home", "independent", "simulate"):
        with pytest.raises(lw.LinkworkError, match=f"{name} of Robot.* is not set; make another"):
            setattr(robot, name, None)
    other = robot.with_parameters({path: 9.0})
    assert (robot.parameters[path], other.parameters[path]) == (mass, 9.0)
    assert pickle.loads(pickle.dumps(other)).parameters == other.parameters
