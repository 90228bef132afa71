"""Derivatives of recorded quantities that are no expressions: conditioning."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

import linkwork as lw

from tests.gradients.test_runs import FIXED, derivative, moved


@pytest.mark.parametrize(
    ("name", "freed", "shift"),
    [
        ("prr3", ["wrist_1.frames.1.position.x"], (0.03, 0.02, 0.1)),
        ("delta", [], (0.02, 0.03, 0.01)),
        ("four_bar", ["crank_pin.frames.0.position.x"], ()),
    ],
)
def test_conditioning(name, freed, shift):
    """By differences of the same steps: in the plane with lengths and turns, in space, and that of
    a linkage by what its actuator sees."""
    robot = lw.Robot(name)
    robot = robot.free(*freed) if freed else robot
    start, forces = robot.home, np.zeros(len(robot.actuators))
    if shift:  # at home directions are alike
        start = robot.assemble(tool=robot.task_values(start) + np.array(shift))
    start = start.with_rates([0.5, -0.3, 0.4][: robot.mobility])
    options, quantity = {"duration": 0.05, **FIXED}, ["conditioning"]
    run = robot.simulate(start, forces, **options)
    told = run.sensitivity(quantity).conditioning
    size = np.abs(told.values[-1]).max()
    for number in told["number"].values.tolist():
        own = partial(moved, robot, start, forces, options, quantity, number)
        exact = derivative(own, 2e-4)
        found = told.sel(number=number).values[-1]
        assert found == pytest.approx(exact[0], rel=1e-8, abs=1e-9 * size), number
    weights = np.random.default_rng(0).normal(size=len(run.time))
    back = run.gradient({"conditioning": weights})
    assert [*back.values()] == pytest.approx(weights @ told.values, rel=1e-11, abs=1e-13 * size)


def test_conditioning_where_all_directions_are_alike():
    robot = lw.Robot("prr3")
    run = robot.simulate(robot.home, [1.0, 0.5, -0.3], duration=0.01)
    with pytest.raises(lw.LinkworkError, match="derivative of conditioning is not defined"):
        run.sensitivity("conditioning")
    assert "conditioning" not in run.sensitivity(to="rates")
