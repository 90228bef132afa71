"""Derivatives of Rosenbrock steps: the same steps in forty digits, differences, closed
solutions."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import mpmath
import numpy as np
import pytest

import linkwork as lw
from linkwork import math
from linkwork.control import Event, Sampler
from linkwork.simulation.rosenbrock import RODAS

from tests.gradients.test_runs import (
    CART,
    GAINS,
    TIGHT,
    derivative,
    led,
    moved,
    require_derivatives,
)

STIFF = {"method": "rodas"}
EXACT = {"k": 3.0, "c": 40.0, "w": 5.0, "length": 0.8, "mass": 1.3, "angle": 0.0, "rate": 0.7}


def pushed(t, state):
    """Drive the pendulum over time, against a damper that makes it stiff."""
    k, c, w = (state.parameter(name, EXACT[name]) for name in ("k", "c", "w"))
    return [k * math.sin(w * t) - c * state.rate("hinge_1")]


def stepped(times, given):
    """Return angle and rate of the pendulum, and the integral of the square of its rate, after
    steps of Rodas5P."""
    k, c, w, length, mass, angle, rate = (given[name] for name in EXACT)
    inertia, size = mass * length**2, len(RODAS.c)
    numbers = [[mpmath.mpf(x) for x in row] for row in (*RODAS.a, *RODAS.C, RODAS.c, RODAS.d)]
    a, C, [at, d] = numbers[:size], numbers[size : 2 * size], numbers[2 * size :]
    m, gamma = [mpmath.mpf(x) for x in RODAS.m], mpmath.mpf(RODAS.gamma)
    y = [angle, rate, mpmath.mpf(0)]
    for t, end in pairwise(times):
        h, ks = end - t, []
        J10 = mpmath.mpf("9.81") / length * mpmath.sin(y[0])
        J11, J21 = -c / inertia, 2 * y[1]
        forced = k * w * mpmath.cos(w * t) / inertia
        for i in range(size):
            x = [y[n] + h * sum(a[i][j] * ks[j][n] for j in range(i)) for n in range(3)]
            torque = k * mpmath.sin(w * (t + at[i] * h)) - c * x[1]
            f = [
                x[1],
                -mpmath.mpf("9.81") / length * mpmath.cos(x[0]) + torque / inertia,
                x[1] ** 2,
            ]
            b = [f[n] + sum(C[i][j] * ks[j][n] for j in range(i)) for n in range(3)]
            b[1] += h * d[i] * forced
            # [1/g, -h, 0; -h J10, 1/g - h J11, 0; 0, -h J21, 1/g] k = b
            one, other = 1 / gamma, 1 / gamma - h * J11
            k1 = (one * b[1] + h * J10 * b[0]) / (one * other - h * h * J10)
            ks.append([gamma * (b[0] + h * k1), k1, gamma * (b[2] + h * J21 * k1)])
        y = [y[n] + h * sum(m[i] * ks[i][n] for i in range(size)) for n in range(3)]
    return y


@pytest.fixture(scope="module")
def pendulum():
    return lw.Robot(lw.robots.pendulum((0.8,), (1.3,))).free("rod_1.mass")


def test_tangents_adjoints_and_integrals_are_those_of_the_same_steps_in_forty_digits(pendulum):
    start, options = pendulum.home.with_rates([0.7]), {"duration": 0.3, "rtol": 1e-4, **STIFF}
    run = pendulum.simulate(start, pushed, **options)
    told = run.sensitivity(["joint_position", "joint_rate"])
    found = pendulum.gradient(
        None, start, pushed, running=lambda t, state: state.rate("hinge_1") ** 2, **options
    )
    assert len(run.time) > 5
    names = {"positions.hinge_1": "angle", "rates.hinge_1": "rate", "rod_1.mass": "mass"}
    names |= {name: name for name in ("k", "c", "w")}
    with mpmath.workdps(40):
        times, tiny = [mpmath.mpf(t) for t in run.time], mpmath.mpf(10) ** -15
        given = {name: mpmath.mpf(value) for name, value in EXACT.items()}
        assert found.value == pytest.approx(float(stepped(times, given)[2]), rel=1e-13)
        for name, key in names.items():
            up, down = (stepped(times, given | {key: given[key] + d}) for d in (tiny, -tiny))
            exact = [float((b - a) / (2 * tiny)) for a, b in zip(down, up, strict=True)]
            own = [told[q].sel(number=name).values[-1, 0] for q in ("joint_position", "joint_rate")]
            assert [*own, found[name]] == pytest.approx(exact, rel=1e-11, abs=1e-13), name


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "samples"), [(led, None), (Sampler(led, rate=100, compiled=True, delay=0.02), 5)]
)
def test_stiff_steps_through_loops(law, samples):
    """Newton's steps on the loops, samples within steps, a controller's gains, calls, a mass."""
    robot = lw.Robot("prr3").free("platform.mass")
    options = {"duration": 0.02, "parameters": GAINS, "samples": samples, **STIFF, **TIGHT}
    require_derivatives(robot, robot.home, law, 1e-8, ("joint_rate", "tool_pose"), **options)


def test_a_run_that_goes_on_with_stiff_steps_by_itself():
    """Dry friction brings a cart to rest; what is left of its start is where it stands."""
    rail = lw.PrismaticJoint(
        connects=("ground", "cart"),
        axis=(1, 0, 0),
        friction=lw.Friction(coulomb=2.0, coulomb_rate=1e-6),
    )
    robot = lw.Robot(CART.model_copy(update={"joints": {"rail": rail}}))
    run = robot.simulate(robot.home.with_rates([0.5]), [0.3], duration=0.8, rtol=1e-9, atol=1e-11)
    assert "Rodas5P" in run.attrs["method"]
    told = run.sensitivity(["joint_position", "joint_rate"], ["rates", "forces"])
    options = {"duration": 0.8, "rtol": 1e-11, "atol": 1e-13}
    quantities = ["joint_position", "joint_rate"]
    for name in told["number"].values.tolist():
        given = robot, robot.home.with_rates([0.5]), [0.3], options, quantities, name
        exact = derivative(partial(moved, *given))
        own = [told[q].sel(number=name).values[-1, 0] for q in quantities]
        assert own == pytest.approx(exact, rel=1e-5, abs=1e-8), name


def test_stiff_steps_up_to_an_event():
    """x'' = -c x' / m from v0 on reaches a where v0 - c a / m is left of the rate."""
    robot, c, m, v0 = lw.Robot(CART).free("cart.mass"), 30.0, 2.0, 9.0

    def law(t, state):
        return [-state.parameter("c", c) * state.rate("rail")]

    end = Event(lambda t, state: state["rail"] - state.parameter("a", 0.5), terminal=True)
    run = robot.simulate(
        robot.home.with_rates([v0]), law, duration=5, events=[end], rtol=1e-10, atol=1e-10, **STIFF
    )
    told = run.sensitivity("joint_rate").joint_rate
    exact = {"rates.rail": 1.0, "c": -0.5 / m, "cart.mass": c * 0.5 / m**2, "a": -c / m}
    for name, value in exact.items():
        assert told.sel(number=name).values[-1, 0] == pytest.approx(value, rel=1e-8)


# Forces given by samples


@pytest.mark.sample(2)
@pytest.mark.parametrize("kind", ["spline", "linear", "hold"])
@pytest.mark.parametrize("method", [{"method": "rk4", "step": 0.005}, STIFF | TIGHT])
def test_values_of_sampled_forces(kind, method):
    robot, rng = lw.Robot("prr3"), np.random.default_rng(3)
    times, values = np.linspace(0, 0.02, 4), rng.normal(size=(4, 3))
    options, goal = {"duration": 0.02, **method}, rng.normal(size=3)

    def final(values):
        run = robot.simulate(robot.home, lw.Sampled(times, values, kind), **options)
        return run["joint_rate"].values[-1]

    run = robot.simulate(robot.home, lw.Sampled(times, values, kind), **options)
    told = run.sensitivity("joint_rate", ["samples", "rates"]).joint_rate
    assert told.sizes["number"] == 15
    for k, column in ((0, 1), (2, 0)):
        name, unit = f"samples.{SLIDES[column]}.{k}", np.zeros((4, 3))
        unit[k, column] = 1
        own = told.sel(number=name).values[-1]
        exact = derivative(lambda d, unit=unit: final(values + d * unit))
        assert own == pytest.approx(exact, rel=1e-8, abs=1e-9 * np.abs(told.values[-1]).max())
    weights = np.zeros(told.shape[:2])
    weights[-1, : len(goal)] = goal
    back = run.gradient({"joint_rate": weights}, "samples")
    sums = np.einsum("tr,trn->n", weights, told.sel(number=[*back]).values)
    assert [*back.values()] == pytest.approx(sums, rel=1e-11, abs=1e-14)
    assert not [name for name in run.gradient({"joint_rate": weights}) if "samples" in name]


SLIDES = "slide_1", "slide_2", "slide_3"


def test_samples_are_asked_for_where_there_are_any(pendulum):
    run = pendulum.simulate(pendulum.home, [1.0], duration=0.1)
    with pytest.raises(lw.LinkworkError, match="no number to differentiate by 'samples'"):
        run.sensitivity("joint_rate", "samples")
