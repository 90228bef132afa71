"""True and False are no numbers: where they are given for some, they are mistakes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import linkwork as lw


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    return lw.Robot("prr3").free("platform.mass")


Door = Callable[[lw.Robot, Any], Any]
DOORS: dict[str, Door] = {
    "duration": lambda robot, yes: robot.simulate(robot.home, [0, 0, 0], duration=yes),
    "samples": lambda robot, yes: robot.simulate(robot.home, duration=0.1, samples=yes),
    "forces": lambda robot, yes: robot.simulate(robot.home, [yes, 0, 0], duration=0.1),
    "forces by name": lambda robot, yes: robot.forward_dynamics(robot.home, {"slide_1": yes}),
    "array": lambda robot, yes: robot.forward_dynamics(robot.home, np.array([yes, yes, yes])),
    "objects": lambda robot, yes: robot.home.with_rates(np.array([yes, 0.0, 0.0], object)),
    "rates": lambda robot, yes: robot.home.with_rates({"slide_1": yes}),
    "sampled": lambda robot, yes: lw.Sampled([0.0, 1.0], [[0.0], [yes]]),
    "parameters": lambda robot, yes: robot.with_parameters({"platform.mass": yes}),
    "members": lambda robot, yes: robot.ensemble(
        robot.home, [0, 0, 0], {"platform.mass": [1.0, yes]}, duration=0.1
    ),
    "stepper": lambda robot, yes: robot.stepper(robot.home, dt=yes),
    "step of many": lambda robot, yes: robot.stepper(
        robot.assemble(tool=[[0.5, 0.29, 1.2]] * 2), dt=1e-3
    ).step([[yes, 0.0, 0.0]] * 2),
    "path": lambda robot, yes: lw.paths.line([0.5, 0.29], [0.5, yes]),
    "gain": lambda robot, yes: robot.simulate(
        robot.home, lw.control.PD(robot.home, kp=yes, kd=1.0), duration=0.1
    ),
    "mass": lambda robot, yes: lw.Body(mass=yes),
    "axis": lambda robot, yes: lw.Body(mass=1.0, centre_of_mass=(0.0, yes, 0.0)),
}


def test_switches_are_truth_values():
    assert lw.control.Saturated(1.0, smooth=True).smooth
    with pytest.raises(lw.LinkworkError, match=r"smooth of Saturated is 0\.5; give True or False"):
        lw.control.Saturated(1.0, smooth=0.5)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("yes", [True, np.True_], ids=["bool", "numpy"])
def test_truth_values_are_refused(robot, door, yes):
    with pytest.raises(lw.LinkworkError, match="True"):
        DOORS[door](robot, yes)
