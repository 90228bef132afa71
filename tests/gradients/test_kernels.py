"""Derivatives of the equations beside complex steps, in every form."""

from __future__ import annotations

from functools import cache, partial

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import Equations, charts_at, derive, functions
from linkwork.equations.algebra import dense
from linkwork.equations.linear import derivatives
from linkwork.gradients.compilation import expressed

from tests.catalogue import SAMPLE, WHOLE
from tests.gradients.complex_step import ComplexSteps, in_complex_numbers
from tests.gradients.drift import drift
from tests.oracle.random_joints import curved, random_loops, random_tree
from tests.robot.test_bearings import journal, slide
from tests.robot.test_parameters import can_be_free

MANY = 6  # numbers that are free
CASES = {name: getattr(lw.robots, name) for name in lw.robots.__all__} | {
    "tree": partial(random_tree, 1, 7, effects=True, gears=1, actuation=-2),
    "long chain": partial(random_tree, 4, 11, kinds=("revolute", "spherical")),
    "loops with everything": partial(
        random_loops, 5, 2, effects=True, rods=1, gears=1, freedoms=2, actuation=1
    ),
    "loop of a screw": partial(
        random_loops, 7, 1, kinds=("screw", "universal", "revolute", "spherical"), effects=True
    ),
    "loop closed by a free joint": partial(random_loops, 8, 1, effects=True, platform="free"),
    "planar loops": lambda: curved(random_loops(5, 2, planar=True, effects=True, rods=1, gears=1)),
}
# Rods, gears and what acts are in planar loops, in trees and in the other loops in space, too.
LARGE = ("loops with everything",)
RANDOM = [name for name in CASES if name not in lw.robots.__all__ and (WHOLE or name not in LARGE)]
FEW = "four_bar", "prr3", "bennett", *["loop closed by a free joint"] * WHOLE


@cache
def made(name: str) -> tuple[Equations, tuple[np.ndarray, ...]]:
    """Return the equations of a case with some free numbers, and a closed state: q, v, p."""
    mechanism, rng = CASES[name](), np.random.default_rng(sum(map(ord, name)))
    able = can_be_free(mechanism, lw.Robot(mechanism).planar)
    paths = [str(path) for path in rng.permutation(able)[:MANY]]
    equations = derive(mechanism, free=paths)
    n, p = equations.mobility, np.array(list(equations.parameters.values()))
    units = equations.tree.rate_units[list(equations.chart.independent)]
    away = 3e-3 * (units * rng.standard_normal(n))[:, None]
    q = ComplexSteps(equations).moved(equations.reference[:, None], away, p[:, None])
    assert numbers(functions.closure_step(equations), q.real, p)[1].item() < 1e-14
    return equations, (q.real.ravel(), rng.standard_normal(n), p)


def numbers(function: ca.Function, *given: np.ndarray) -> list[np.ndarray]:
    """Return the values of a function as arrays."""
    return [dense(ca.DM(value)) for value in function.call([ca.DM(part) for part in given])]


def near(
    found: np.ndarray, expected: np.ndarray, within: float = 1e-9, least: float = 1e-12
) -> bool:
    """Tell whether numbers agree, relative to the largest; least: what counts as large."""
    size = max(np.abs(expected).max(initial=0.0), least)
    return bool(np.abs(found - expected).max(initial=0.0) <= within * size)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", [*(name for name in SAMPLE if name != "n_four_bar"), *RANDOM])
def test_dynamics_beside_complex_steps(name):
    equations, (q, v, p) = made(name)
    rng, n = np.random.default_rng(2), equations.mobility
    motion = in_complex_numbers(functions.motion(equations))
    inverse = in_complex_numbers(functions.inverse_dynamics(equations))
    places = slice(equations.nq, equations.nq + n)
    u = rng.standard_normal(len(equations.mechanism.actuators))
    cases = {
        "forward_dynamics": (u, lambda *x: motion(*x)[places]),
        "inverse_dynamics": (rng.standard_normal(n), lambda *x: inverse(*x)[:n]),
    }
    for what, (given, value) in cases.items():
        _, *by, _ = numbers(expressed(equations, what, "jacobian"), q, v, given, p)
        expected = ComplexSteps(equations).derivatives(value, q, v, given, p)
        for ours, theirs in zip(by, filter(np.size, expected), strict=True):
            assert near(ours, theirs), what


@pytest.mark.parametrize("name", FEW)
@pytest.mark.parametrize("what", ["forward_dynamics", "inverse_dynamics", "mass_matrix", "joints"])
def test_steps_and_gradients_are_those_of_the_jacobian(name, what):
    equations, (q, v, p) = made(name)
    rng = np.random.default_rng(3)
    jacobian = expressed(equations, what, "jacobian")
    given = [rng.standard_normal(jacobian.numel_in(k)) for k in range(2, jacobian.n_in() - 1)]
    value, *by, pivot = numbers(jacobian, q, v, *given, p)
    steps = [rng.standard_normal(part.shape[1]) for part in by]
    moved = numbers(expressed(equations, what, "jvp"), q, v, *given, *steps, p)
    weights = rng.standard_normal(by[0].shape[0])
    gradient = numbers(expressed(equations, what, "vjp"), q, v, *given, weights, p)
    for found in (moved, gradient):
        assert np.array_equal(found[0], value) and np.array_equal(found[-1], pivot)
    along = sum(part @ step for part, step in zip(by, steps, strict=True))
    assert near(moved[1].ravel(), along, 1e-10)
    for ours, part in zip(gradient[1:-1], by, strict=True):
        assert near(ours.ravel(), part.T @ weights, 1e-10)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["five_bar", "loop closed by a free joint", *["stewart"] * WHOLE])
def test_every_chart_beside_complex_steps(name):
    """Dynamics and drift in the chart that has as many other rates as it can."""
    equations, (q, v, p) = made(name)
    Phi = numbers(functions.constraints(equations), q, p)[1]
    others = tuple(k for k in range(equations.nv) if k not in equations.chart.independent)
    [(_, chart), *_] = charts_at(equations, Phi[None], others)
    assert set(chart.independent) != set(equations.chart.independent)
    equations, rng = equations.in_chart(chart), np.random.default_rng(5)
    u, places = rng.standard_normal(len(equations.mechanism.actuators)), slice(equations.nq, -1)
    motion = in_complex_numbers(functions.motion(equations))
    _, *by, _ = numbers(expressed(equations, "forward_dynamics", "jacobian"), q, v, u, p)
    steps = ComplexSteps(equations)
    expected = steps.derivatives(lambda *x: motion(*x)[places], q, v, u, p)
    for ours, theirs in zip(by, filter(np.size, expected), strict=True):
        assert near(ours, theirs)
    Gamma, _, _ = numbers(drift(equations), q, v, p)
    known = derivatives(equations)(q, v, u, p)[derivatives(equations).name_out().index("Gamma")]
    assert near(Gamma, dense(ca.DM(known)), least=1.0)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["prr3", "stewart", "rrs3"])
def test_tool_and_joints_beside_complex_steps(name):
    """Poses turn by dR R' = [omega x]."""
    equations, (q, v, p) = made(name)
    motion = in_complex_numbers(functions.tool_motion(equations))
    joints = in_complex_numbers(functions.joints_motion(equations))
    still, steps = np.zeros((equations.mobility, 1)), ComplexSteps(equations)

    def of_tool(q: np.ndarray, v: np.ndarray, _: np.ndarray, p: np.ndarray) -> np.ndarray:
        return motion(q, v, np.repeat(still, q.shape[1], axis=1), p)[:-7]

    def of_joints(q: np.ndarray, v: np.ndarray, _: np.ndarray, p: np.ndarray) -> np.ndarray:
        return joints(q, v, np.repeat(still, q.shape[1], axis=1), p)

    value, *by, _ = numbers(expressed(equations, "tool", "jacobian"), q, v, p)
    R = value.ravel()[3:12].reshape(3, 3)
    for ours, theirs in zip(
        by, filter(np.size, steps.derivatives(of_tool, q, v, v[:0], p)), strict=True
    ):
        turn = theirs[3:12].reshape(3, 3, -1).transpose(2, 0, 1) @ R.T
        omega = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]])
        assert near(ours, np.concatenate([omega, theirs[:3], theirs[-6:]]), least=1.0)
    value, *by, _ = numbers(expressed(equations, "joints", "jacobian"), q, v, p)
    for ours, theirs in zip(
        by, filter(np.size, steps.derivatives(of_joints, q, v, v[:0], p)), strict=True
    ):
        assert near(ours, theirs[: len(ours)], least=1.0)


def test_friction_of_what_bearings_carry_beside_complex_steps():
    """Found by Newton's method with the accelerations, and differentiated as it stands."""
    described = lw.robots.slider_crank()
    joints = {
        "pin": described.joints["pin"].model_copy(update={"bearing": journal(0.3, 0.01)}),
        "slide": described.joints["slide"].model_copy(update={"bearing": slide(0.1)}),
    }
    mechanism = described.model_copy(update={"joints": {**described.joints, **joints}})
    equations = derive(mechanism, free=["joints.pin.bearing.friction.coefficient"])
    rng, p = np.random.default_rng(6), np.array(list(equations.parameters.values()))
    steps = ComplexSteps(equations)
    q = steps.moved(equations.reference[:, None], np.array([[0.4]]), p[:, None]).real.ravel()
    v, u = np.array([0.7]), rng.standard_normal(len(mechanism.actuators))
    motion = in_complex_numbers(functions.motion(equations))
    places = slice(equations.nq, -1)
    expected = steps.derivatives(lambda *x: motion(*x)[places], q, v, u, p)
    _, *by, _ = numbers(expressed(equations, "forward_dynamics", "jacobian"), q, v, u, p)
    for ours, theirs in zip(by, expected, strict=True):
        assert near(ours, theirs)
    robot = lw.Robot(mechanism)
    with pytest.raises(lw.LinkworkError, match="bearings rub by what they carry"):
        robot.inverse_dynamics_derivatives(robot.home, np.zeros(1))
