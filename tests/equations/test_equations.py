"""The derived equations against an independent formulation (Lagrange multipliers) on random mechanisms, and identities."""

import numpy as np
import pytest

from linkwork.equations import derive, functions
from linkwork.robots import prr3

from tests.oracle.lagrange import LagrangeOracle
from tests.oracle.random_mechanisms import open_tree, planar_loops, random_state, spatial_loops

CASES = {
    "3-PRR": prr3(),
    "3-PRR in a vertical plane": prr3(gravity=(0.0, -9.81, 0.0)),
    **{f"tree {seed}": open_tree(seed) for seed in range(3)},
    "planar tree": open_tree(5, planar=True),
    **{f"planar loops {seed}": planar_loops(seed, loops=1 + seed % 3, freedoms=1 + seed % 2) for seed in range(5)},
    **{f"spatial loops {seed}": spatial_loops(seed, loops=1 + seed % 2, freedoms=1 + seed % 2) for seed in range(4)},
}


@pytest.fixture(params=CASES, scope="module")
def case(request):
    mechanism = CASES[request.param]
    return mechanism, derive(mechanism), LagrangeOracle(mechanism)


def closed_state(mechanism, equations):
    """Return a random closed state: all joint coordinates, the tree's, independent rates."""
    q_all, v = random_state(mechanism, np.random.default_rng(7))
    names = [name for name, joint in mechanism.joints.items() if joint.type != "fixed"]
    return q_all, np.array([q_all[names.index(name)] for name in equations.tree.coordinates]), v


def call(function, *arguments):
    return [
        np.array(value).squeeze(-1) if value.shape[1] == 1 else np.array(value) for value in function.call(arguments)
    ]


def close_to(found, expected, tolerance=1e-10):
    scale = max(1.0, float(np.abs(expected).max(initial=0)))
    assert np.abs(found - expected).max(initial=0) < tolerance * scale


def test_forward_and_inverse_dynamics(case):
    mechanism, equations, oracle = case
    q_all, q, v = closed_state(mechanism, equations)
    u = np.random.default_rng(1).normal(size=v.size)
    rates, v_dot, _ = call(functions.motion(equations), q, v, u)
    close_to(v_dot, oracle.forward_dynamics(q_all, v, u))
    forces, _ = call(functions.inverse_dynamics(equations), q, v, v_dot)
    close_to(forces, u)
    close_to(forces, oracle.inverse_dynamics(q_all, v, v_dot))
    assert rates.size == q.size


def test_terms(case):
    mechanism, equations, oracle = case
    q_all, q, v = closed_state(mechanism, equations)
    M, Cv, G, _ = call(functions.terms(equations), q, v)
    close_to(M, oracle.mass_matrix(q_all))
    close_to(Cv, oracle.coriolis(q_all, v))
    close_to(G, oracle.gravity(q_all))
    assert (M == M.T).all()
    assert np.linalg.eigvalsh(M).min() > 0


def test_all_joints(case):
    mechanism, equations, oracle = case
    q_all, q, v = closed_state(mechanism, equations)
    v_dot = np.random.default_rng(2).normal(size=v.size)
    positions, rates, accelerations = call(functions.joints_motion(equations), q, v, v_dot)
    turns = (positions - q_all) / (2 * np.pi)
    close_to(turns - np.round(turns), 0 * turns)
    close_to(rates, oracle.all_rates(q_all, v))
    close_to(accelerations, oracle.all_accelerations(q_all, v, v_dot), 1e-9)


def test_twists_and_energy(case):
    mechanism, equations, oracle = case
    q_all, q, v = closed_state(mechanism, equations)
    _, T, _ = functions.maps(equations)(q)
    twists = np.array(T) @ v
    by_body = oracle.twists(q_all, v)
    expected = np.concatenate([by_body[name] for name in mechanism.bodies])
    close_to(twists, expected)
    M = call(functions.terms(equations), q, v)[0]
    kinetic, _ = functions.energy(equations)(q, v)
    close_to(float(kinetic), 0.5 * v @ M @ v)


def test_power_balance(case):
    """Along a motion the energy changes by the actuators' power: d(T + V)/dt = u . v (central differences)."""
    mechanism, equations, _ = case
    _, q, v = closed_state(mechanism, equations)
    u = np.random.default_rng(3).normal(size=v.size)
    motion, energy = functions.motion(equations), functions.energy(equations)
    rates, v_dot, _ = call(motion, q, v, u)
    h = 1e-6

    def total(t):
        return sum(float(part) for part in energy(q + t * rates, v + t * v_dot))

    slope = (total(h) - total(-h)) / (2 * h)
    assert abs(slope - u @ v) < 1e-6 * max(1.0, abs(u @ v), abs(total(0)))


def test_closure_step_closes_the_loops_quadratically(case):
    mechanism, equations, _ = case
    _, q, _ = closed_state(mechanism, equations)
    dependent = list(equations.chart.dependent)
    q[dependent] += 1e-3 * np.random.default_rng(4).normal(size=len(dependent))
    gaps = []
    for _ in range(5):
        q, gap = call(functions.closure_step(equations), q)
        gaps.append(float(gap[0]))
    assert gaps[-1] < 1e-13
    assert gaps[2] < 1e-6


def test_jacobian_is_the_derivative_of_the_rows(case):
    """Phi is built from geometry; on closed configurations it must equal the derivative of phi."""
    mechanism, equations, _ = case
    _, q, v = closed_state(mechanism, equations)
    out = functions.assembly(equations, None)
    values = dict(zip(out.name_out(), out(q, 0 * q), strict=True))
    import casadi as ca

    Phi = np.array(ca.Function("Phi", [equations.tree.q], [equations.rows.Phi])(q))
    close_to(Phi, np.array(values["Phi"]))
    L = np.array(functions.maps(equations)(q)[0])
    assert L.shape == (len([j for j in mechanism.joints.values() if j.type != "fixed"]), v.size)


def test_mobility_counts_freedoms():
    assert derive(prr3()).mobility == 3
    assert derive(planar_loops(3, loops=1, freedoms=2)).mobility == 3
