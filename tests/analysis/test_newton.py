"""Newton's methods: numbers that are none are never taken for a solution."""

from types import SimpleNamespace

import numpy as np
import pytest

from linkwork.analysis import assembly_modes
from linkwork.analysis.newton import random_configurations, solver
from linkwork.analysis.square import of_joints
from linkwork.equations.reference import close
from linkwork.robots.plane import corners, vertices
from linkwork.runs.crossing import Crossing

from tests.analysis.mechanisms import postures
from tests.catalogue import built

SLIDES = [
    (0.7878962722422937, 0.2791125591030371, 0.6614706819983751),
    *np.random.default_rng(23).uniform(0.35, 0.8, (5, 3)).tolist(),
]


@pytest.mark.parametrize("slides", SLIDES)
def test_3_rpr_modes_are_as_many_as_the_circles_of_the_legs_allow(slides):
    robot = built("rpr3")
    modes = assembly_modes(robot, dict(zip(robot.actuators, slides, strict=True)), starts=20_000)
    expected = postures(corners(1.0), vertices(0.15), slides)
    found = np.sort((robot.tool_pose(modes.states)[:, 2] + np.pi) % (2 * np.pi) - np.pi)
    np.testing.assert_allclose(found, expected, atol=2 * np.pi / 20000)


def test_starts_that_lead_to_no_number_have_not_converged():
    robot = built("rpr3")
    problem = solver(of_joints(robot, robot.actuators))
    q = random_configurations(problem.square, problem.length, 64, np.random.default_rng(0))
    lost = np.arange(0, 64, 3)
    q[lost, -1] = np.nan
    found, good = problem.solve(
        q, robot.home.positions[[robot.coordinates.index(a) for a in robot.actuators]], 60
    )
    assert good.any() and not good[lost].any() and np.isfinite(found[good]).all()


def test_no_last_step_opens_the_loops_where_a_pivot_vanishes():
    """At P = (1, 1, -1) a an Orthoglide whose third rods are turned about is not singular. 930
    modes were told, nearly all open by up to 0.13 m: each had another last step from P."""
    robot, a = built("orthoglide"), 0.31 / np.sqrt(3)
    P = np.array([a, a, -a])
    slides = dict(zip(robot.actuators, 2 * P - 0.31 * np.ones(3), strict=True))
    beside = {name: q + 1e-3 for name, q in slides.items()}
    modes, others = (assembly_modes(robot, given, starts=40_000) for given in (slides, beside))
    assert len(modes) == len(others) == 6
    assert robot.closure_error(modes.states).max() < 1e-9
    assert np.abs(robot.tool_pose(modes.states)[:, :3] - P).max(axis=1).min() < 1e-9


def test_a_step_to_where_the_loops_are_no_numbers_is_shortened():
    """sqrt(q) = 0.1 from q = 0.3: the whole step ends below zero, where there is no root."""

    def system(q):
        return np.sqrt(q) - 0.1, np.array([0.5 / np.sqrt(q)]), np.eye(1)

    with np.errstate(invalid="ignore"):
        np.testing.assert_allclose(
            close(system, SimpleNamespace(quaternions=(), units=np.ones(1)), np.array([0.3])),
            0.01,
            rtol=1e-9,
        )


def test_behind_a_singular_pose_a_state_that_is_no_number_is_not_closed():
    """A Newton step whose pivot is zero leaves a residual of the other rows alone."""
    outputs = iter([[0.1, np.nan, 1e-3], [0.1, np.nan, 0.0], [0.1, np.nan, 0.0]])
    kernel = SimpleNamespace(flat=lambda *parts: np.array(next(outputs)))
    chart = SimpleNamespace(
        equations=SimpleNamespace(constrained=True), single=lambda name: kernel, p=np.empty(0)
    )
    q, closed = Crossing(chart, None, 1e-12, 1e-10, 1e-8)._closed(np.array([0.1, 0.2]))
    assert np.isfinite(q).all() and not closed
