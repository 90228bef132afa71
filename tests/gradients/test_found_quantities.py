"""Derivatives of recorded quantities that are no expressions: conditioning, work."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork import math
from linkwork.control import Event, Sampler, Wrench
from linkwork.gradients.conditioning import Conditioning

from tests.gradients.test_runs import CART, FIXED, GAINS, TIGHT, derivative, led, moved
from tests.robot.mixed_freedoms import three_legs


@pytest.mark.long
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


def test_what_points_is_conditioned_by_what_it_is_held_by():
    """s_k / s_1 of K is what the robot tells, by tilt (cos azimuth, sin azimuth)."""
    robot = lw.Robot(three_legs("RRS", task=("z", "azimuth", "tilt")))
    state = robot.assemble(tool=[0.5, 0.3, 0.2])
    equations = robot.equations
    K = Conditioning(robot)(SimpleNamespace(equations=equations))  # pyright: ignore
    values = ca.Function("K", [equations.tree.q, equations.p], [K])(state.q, robot.p)
    s = np.linalg.svd(np.array(values).reshape(3, 3), compute_uv=False)
    assert s[-1] / s[0] == pytest.approx(float(robot.conditioning(state)), rel=1e-9)


def test_conditioning_where_all_directions_are_alike():
    robot = lw.Robot("prr3")
    run = robot.simulate(robot.home, [1.0, 0.5, -0.3], duration=0.01)
    with pytest.raises(lw.LinkworkError, match="derivative of conditioning is not defined"):
        run.sensitivity("conditioning")
    assert "conditioning" not in run.sensitivity(to="rates")


@pytest.mark.long
def test_work_of_controllers_and_friction():
    """By differences of the same steps, at samples within them; the adjoint beside the tangents."""
    robot = lw.Robot("prr3").free("platform.mass")
    wrench = Wrench("platform", force=lambda t, state: [math.sin(9 * t), 0.4, 0])
    for samples in (None, 4):
        options = {"duration": 0.1, "parameters": GAINS, "samples": samples, **FIXED}
        options["wrenches"] = [wrench]
        start, quantity = robot.home.with_rates([0.5, -0.3, 0.4]), ["work"]
        run = robot.simulate(start, led, **options)
        told = run.sensitivity(quantity).work
        size = np.abs(told.values[-1]).max()
        for number in told["number"].values.tolist():
            own = partial(moved, robot, start, led, options, quantity, number)
            found = told.sel(number=number).values[-1]
            assert found == pytest.approx(derivative(own)[0], rel=1e-9, abs=1e-10 * size), number
        weights = np.random.default_rng(0).normal(size=len(run.time))
        back = run.gradient({"work": weights})
        assert [*back.values()] == pytest.approx(weights @ told.values, rel=1e-11, abs=1e-13 * size)


def test_samples_within_steps_are_closed_as_runs_close_them():
    robot, options = lw.Robot("prr3"), {"duration": 0.04, "save_at": [0.0237], **FIXED}
    start, forces, quantity = (
        robot.home.with_rates([0.5, -0.3, 0.4]),
        [1.0, 0.5, -0.3],
        "joint_rate",
    )
    told = robot.simulate(start, forces, **options).sensitivity(quantity).joint_rate
    own = partial(moved, robot, start, forces, options, [quantity], "positions.slide_1")
    exact, found = derivative(own), told.sel(number="positions.slide_1").values[-1]
    assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()


def test_work_up_to_an_event_and_under_a_sampled_controller():
    """u (a - x0) of a constant force u up to a; of held forces by differences."""
    robot, a, u = lw.Robot(CART), 0.5, 3.0
    end = Event(lambda t, state: state["rail"] - state.parameter("a", a), terminal=True)
    run = robot.simulate(robot.home.with_rates([0.4]), [u], duration=5, events=[end], **TIGHT)
    told = run.sensitivity("work").work
    exact = {"positions.rail": -u, "rates.rail": 0.0, "forces.rail": a, "a": u}
    weights = np.eye(len(run.time))[-1]
    back = run.gradient({"work": weights})
    for name, value in exact.items():
        assert told.sel(number=name).values[-1] == pytest.approx(value, rel=1e-10, abs=1e-11)
        assert back[name] == pytest.approx(value, rel=1e-10, abs=1e-11)

    def law(t, state):
        return [state.parameter("k", 4.0) * (0.3 - state["rail"])]

    options = {"duration": 0.23, "parameters": {"k": 4.0}, **FIXED}
    sampler, start = Sampler(law, rate=20, compiled=True), robot.home.with_rates([0.4])
    run = robot.simulate(start, sampler, **options)
    told = run.sensitivity("work").work
    for name in ("k", "rates.rail"):
        own = partial(moved, robot, start, sampler, options, ["work"], name)
        found = told.sel(number=name).values[-1]
        assert found == pytest.approx(derivative(own)[0], rel=1e-9)


def test_work_over_an_event_at_which_forces_jump_is_refused():
    robot = lw.Robot(CART)

    def law(t, state):
        return [math.where(state["rail"] < 0.3, 3.0, -1.0)]

    switch = Event(lambda t, state: state["rail"] - 0.3, cuts=True)
    run = robot.simulate(robot.home, law, duration=1.0, events=[switch], **TIGHT)
    with pytest.raises(lw.LinkworkError, match="work is not differentiated over an event"):
        run.sensitivity("work")
