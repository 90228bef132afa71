"""Steps that are too long for what is stiff: told where steppers begin, and right."""

import warnings
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork import control
from linkwork.errors import ModelWarning
from linkwork.gym import DecisionProcess, Environments

BLOCK = lw.Body(mass=0.5)


def slide(**effects) -> lw.Robot:
    """Return a block on a rail with what acts there."""
    rail = lw.PrismaticJoint(connects=("ground", "block"), axis=(1, 0, 0), **effects)
    parts = {"bodies": {"block": BLOCK}, "joints": {"x": rail}}
    return lw.Robot(lw.Mechanism(actuators=("x",), gravity=(0, 0, 0), **parts))


def bristled() -> lw.Robot:
    bristle = lw.Bristle(stiffness=1e6, damping=1e3)
    return slide(friction=lw.Friction(coulomb=2.0, bristle=bristle))


@pytest.mark.parametrize("method", ["rk4", "symplectic_euler"])
@pytest.mark.parametrize(("k", "d"), [(5e5, 0), (5e5, 250), (5e5, 500), (5e5, 1000), (0, 500)])
def test_the_longest_step_is_where_motions_begin_to_grow(method, k, d):
    robot = slide(spring=lw.Spring(stiffness=k, damping=d))
    start = robot.state([1e-3]).with_rates([1.0])
    told = robot.stepper(start, 1e-6, method=method).longest_step
    assert told.name == "x"

    def largest(dt: float) -> float:
        stepper = lw.stepping.Stepper(robot, start, dt, method=method)
        try:
            stepper.step(steps=2000)
        except lw.stepping.StepError:
            return np.inf
        return float(np.abs(stepper.y).max())

    assert largest(0.9 * told.step) < 10 and largest(1.12 * told.step) > 100


def test_bristles_bound_steps_by_how_fast_they_slide():
    robot = bristled()
    for w in (0.1, 1.0):
        told = robot.stepper(robot.home.with_rates([w]), 1e-7).longest_step
        assert told.name == "x.bristle"
        assert told.step == pytest.approx(2.785 * 2.0 / (1e6 * w), rel=0.05)
    assert robot.stepper(robot.home, 1e-3, method="rodas").longest_step.step == np.inf


def test_what_acts_counts_and_is_named():
    robot = slide()
    acting: dict[str, dict[str, Any]] = {
        "x.force": {"drives": {"x": control.Lag(1e-5)}},
        "x": {"forces": lambda t, state: {"x": -1e7 * state["x"]}},
    }
    for name, options in acting.items():
        with pytest.warns(ModelWarning, match=rf"0\.001 s are too long .*: {name} answers"):
            told = robot.stepper(robot.home, 1e-3, **options).longest_step
        assert told.name == name and told.step < 1e-3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot.stepper(robot.home, 1e-3, drives={"x": control.Lag(1e-2)})
        held = control.Sampler(lambda t, state: {"x": -1e7 * state["x"]}, rate=1e3)
        assert robot.stepper(robot.home, 1e-3, held).longest_step.step == np.inf


def test_many_robots_and_environments_are_told_too():
    robot = bristled()
    states = robot.state(np.zeros((5, 1))).with_rates(np.linspace(0, 1, 5)[:, None])
    said = r"steps of 0\.001 s are too long where this begins: x\.bristle answers by 5e\+05 1/s"
    with pytest.warns(ModelWarning, match=said):
        many = robot.stepper(states, 1e-3)
    assert many.longest_step.step == min(many.alone(i).longest_step.step for i in range(5))
    process = DecisionProcess(
        robot=slide(spring=lw.Spring(stiffness=1e8)),
        dt=1e-2,
        low=-1.0,
        high=1.0,
        observation=lambda t, state: [state["x"]],
        reward=lambda t, state, action: 0.0,
    )
    with pytest.warns(ModelWarning, match="too long where this begins: x answers"):
        Environments(process, 2)
