"""Mechanisms of one-freedom joints against Lagrange's equations with multipliers in joint
coordinates, and identities."""

import casadi as ca
import numpy as np
import pytest

from linkwork.equations import derive, functions
from linkwork.robots import prr3

from tests.equations.evaluation import close, values
from tests.oracle.closed_forms import DoublePendulum, SliderCrank
from tests.oracle.lagrange import LagrangeOracle
from tests.oracle.random_mechanisms import open_tree, planar_loops, random_state, spatial_loops

CASES = {
    "3-PRR in a vertical plane": prr3(gravity=(0.0, -9.81, 0.0)),
    "tree": open_tree(1),
    "planar tree": open_tree(5, planar=True),
    "planar loop": planar_loops(1, loops=1, freedoms=2),
    "planar loops": planar_loops(2, loops=3),
    "spatial loop": spatial_loops(2),
    "spatial loops": spatial_loops(3, loops=2, freedoms=2),
}


@pytest.fixture(params=CASES, scope="module")
def case(request):
    """Return a mechanism, its equations, the oracle, and a closed state: all coordinates, the
    tree's, independent rates."""
    mechanism = CASES[request.param]
    equations = derive(mechanism)
    q_all, v = random_state(mechanism, np.random.default_rng(7))
    q = np.array(
        [q_all[mechanism.coordinates.index(label)] for label in equations.tree.coordinates]
    )
    return equations, LagrangeOracle(mechanism), q_all, q, v


@pytest.mark.sample(6)
def test_forward_and_inverse_dynamics(case):
    equations, oracle, q_all, q, v = case
    u = np.random.default_rng(1).normal(size=v.size)
    v_dot = values(functions.motion(equations), q, v, u)["accelerations"]
    close(v_dot, oracle.forward_dynamics(q_all, v, u), 1e-10)
    forces = values(functions.inverse_dynamics(equations), q, v, v_dot)["forces"]
    close(forces, u, 1e-10)
    close(forces, oracle.inverse_dynamics(q_all, v, v_dot), 1e-10)


def test_terms(case):
    equations, oracle, q_all, q, v = case
    terms = values(functions.terms(equations), q, v)
    M = terms["M"].reshape(v.size, v.size)
    close(M, oracle.mass_matrix(q_all), 1e-10)
    close(terms["Cv"], oracle.coriolis(q_all, v), 1e-10)
    close(terms["G"], oracle.gravity(q_all), 1e-10)
    assert not terms["f"].any()
    assert (M == M.T).all()
    assert np.linalg.eigvalsh(M).min() > 0


def test_all_joints(case):
    equations, oracle, q_all, q, v = case
    v_dot = np.random.default_rng(2).normal(size=v.size)
    motion = values(functions.joints_motion(equations), q, v, v_dot)
    turns = (motion["positions"] - q_all) / (2 * np.pi)
    close(turns - np.round(turns), 0 * turns, 1e-12)
    close(motion["rates"], oracle.all_rates(q_all, v), 1e-10)
    close(motion["accelerations"], oracle.all_accelerations(q_all, v, v_dot), 1e-9)


def test_closure_step_closes_the_loops_quadratically(case):
    equations, _, _, q, _ = case
    q, dependent = q.copy(), list(equations.chart.dependent)
    q[dependent] += 1e-3 * np.random.default_rng(4).normal(size=len(dependent))
    gaps = []
    for _ in range(5):
        step = values(functions.closure_step(equations), q)
        q, gaps = step["q_next"], [*gaps, float(step["residual"][0])]
    assert gaps[-1] < 1e-13
    assert gaps[2] < 1e-6


def test_jacobian_is_the_derivative_of_the_rows(case):
    """Phi is built from geometry; on closed configurations it must equal the derivative of phi."""
    equations, _, _, q, _ = case
    exact = ca.Function(
        "exact", [equations.tree.q], [ca.jacobian(equations.rows.phi, equations.tree.q)]
    )
    close(
        values(functions.constraints(equations), q)["Phi"].reshape(-1, q.size),
        np.array(exact(q)),
        1e-10,
    )


@pytest.mark.parametrize(
    "form", [DoublePendulum(), SliderCrank()], ids=["double pendulum", "slider-crank"]
)
def test_closed_forms(form):
    mechanism = form.mechanism()
    equations = derive(mechanism)
    inverse, random = functions.inverse_dynamics(equations), np.random.default_rng(1)
    for _ in range(5):
        v, a = random.normal(size=(2, equations.mobility))
        if equations.mobility == 1:
            theta = random.uniform(-1, 1)
            q_all = dict(zip(mechanism.coordinates, form.coordinates(theta), strict=True))
            q, expected = (
                [q_all[label] for label in equations.tree.coordinates],
                [form.force(theta, v[0], a[0])],
            )
        else:
            q = random.normal(size=2)
            expected = form.force(q, v, a)
        close(values(inverse, q, v, a)["forces"], expected, 1e-11)
