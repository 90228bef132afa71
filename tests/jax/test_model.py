"""JAX's functions beside the robot's own, and beside differences."""

from __future__ import annotations

import pickle
import sys
from functools import cache

import numpy as np
import pytest

import linkwork as lw
import linkwork.jax
from linkwork.jax.differentiable_model import JaxModel
from linkwork.model.charts import CompiledChart

from tests.catalogue import WHOLE, open_chain, with_a_hand
from tests.robot.test_sticking import slide

jax = pytest.importorskip("jax")
jnp = jax.numpy
from jax.test_util import check_grads  # noqa: E402

REFUSED = (ValueError, RuntimeError)
"""What XLA's errors are, at once and where a result is waited for."""


@pytest.fixture(autouse=True)
def double():
    """Compute in double precision here, and as before elsewhere."""
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


@cache
def robot_of(name: str) -> lw.Robot:
    return lw.Robot(name)


@cache
def model_of(name: str) -> JaxModel:
    return linkwork.jax.model(robot_of(name))


@cache
def states(name: str, count: int = 4) -> tuple[lw.State, np.ndarray]:
    """Return closed states near home, in motion, and forces."""
    robot, random = robot_of(name), np.random.default_rng(7)
    n = robot.mobility
    here = np.array([robot.home[each] for each in robot.independent])
    moved = here + random.uniform(0.01, 0.03, size=(count, n))
    found = robot.assemble(dict(zip(robot.independent, moved.T, strict=True)))
    found = found.with_rates(0.3 * random.normal(size=(count, n)))
    return found, random.normal(size=(count, len(robot.actuators)))


LOOPS = ["five_bar", "rrs3", *["prr3"] * WHOLE]


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", LOOPS)
def test_forward_and_inverse_dynamics_are_the_robot_s(name):
    robot, model = robot_of(name), model_of(name)
    state, u = states(name)
    told = robot.forward_dynamics(state, u)
    batched = jax.jit(jax.vmap(model.forward_dynamics))
    for found in (
        batched(state.q, state.rates, u),
        model.forward_dynamics(state.q, state.rates, u),
    ):
        np.testing.assert_allclose(found, told, rtol=1e-12, atol=1e-12)
    forces = jax.vmap(model.inverse_dynamics)(state.q, state.rates, told)
    np.testing.assert_allclose(forces, u, rtol=1e-9, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("name", ["five_bar", "spatial_slider_crank", *["rrs3"] * WHOLE])
def test_derivatives_to_second_order_are_those_of_differences(name):
    model = model_of(name)
    state, u = states(name)
    given = state.q[0], state.rates[0], u[0]
    check_grads(jax.jit(model.forward_dynamics), given, 2, rtol=1e-4, atol=1e-4)


@pytest.mark.long
def test_inverse_dynamics_and_the_tool_are_differentiable_twice():
    model = model_of("five_bar")
    state, u = states("five_bar")
    given = state.q[1], state.rates[1], u[1]
    check_grads(jax.jit(model.inverse_dynamics), given, 2, rtol=1e-4, atol=1e-4)
    check_grads(jax.jit(model.tool_pose), given[:1], 2, rtol=1e-4, atol=1e-4)


@pytest.mark.long
def test_forward_reverse_and_hessian_agree():
    """Both modes, each way of making a Hessian, and one state or many."""
    model = model_of("prr3")
    state, u = states("prr3")
    one = state.q[0], state.rates[0], u[0]
    forward, reverse = (
        jax.jit(jac(model.forward_dynamics, (0, 1, 2)))(*one) for jac in (jax.jacfwd, jax.jacrev)
    )
    for a, b in zip(forward, reverse, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)
    loss = lambda q: jnp.sum(model.forward_dynamics(q, *one[1:]) ** 2)  # noqa: E731
    H = jax.jit(jax.vmap(jax.hessian(loss)))(state.q)
    backward = jax.jit(jax.jacrev(jax.grad(loss)))(one[0])
    np.testing.assert_allclose(backward, H[0], rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(H, np.swapaxes(H, 1, 2), rtol=1e-9, atol=1e-6)


def test_the_derivative_by_forces_is_the_inverse_of_the_inertia():
    robot, model = robot_of("prr3"), model_of("prr3")
    state, u = states("prr3")
    slope = jax.vmap(jax.jacrev(model.forward_dynamics, 2))(state.q, state.rates, u)
    M = robot.mass_matrix(state)
    np.testing.assert_allclose(slope @ M, np.broadcast_to(np.eye(3), M.shape), atol=1e-12)
    np.testing.assert_allclose(jax.vmap(model.mass_matrix)(state.q), M, rtol=1e-12)


@pytest.mark.long
def test_gradients_by_independent_coordinates_go_through_closed():
    """By differences of poses that the robot assembles itself."""
    robot, model = robot_of("prr3"), model_of("prr3")
    state, u = states("prr3")
    places = [robot.equations.tree.coordinates.index(name) for name in robot.independent]
    start = state.at(0)

    def of_independent(a):
        q = model.closed(jnp.asarray(start.q).at[jnp.array(places)].set(a))
        return model.forward_dynamics(q, start.rates, u[0])

    here, h = start.q[places], 1e-6
    slope = jax.jacfwd(of_independent)(here)
    for k in range(3):
        pair = []
        for sign in (1, -1):
            a = here + sign * h * np.eye(3)[k]
            there = robot.assemble(dict(zip(robot.independent, a, strict=True)), guess=start)
            pair.append(robot.forward_dynamics(there.with_rates(start.rates), u[0]))
        np.testing.assert_allclose(slope[:, k], (pair[0] - pair[1]) / (2 * h), rtol=1e-6, atol=1e-5)
    first = jax.jit(jax.jacfwd(model.closed))
    units = h * np.eye(start.q.size)
    ahead = [(first(start.q + d) - first(start.q - d)) / (2 * h) for d in units]
    second = jax.jit(jax.jacfwd(jax.jacrev(model.closed)))(start.q)
    np.testing.assert_allclose(np.moveaxis(second, -1, 0), ahead, rtol=1e-5, atol=1e-5)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", [*LOOPS, "stewart"])
def test_closed_gives_closed_loops(name):
    robot, model = robot_of(name), model_of(name)
    ajar = robot.home.q + 1e-3 * np.random.default_rng(3).normal(size=robot.home.q.size)
    q = model.closed(ajar)
    assert model.closure_step(q).residual < 1e-12
    P = jax.jit(jax.jacfwd(model.closed))(q)
    np.testing.assert_allclose(P @ P, P, atol=1e-8)


@pytest.mark.long
@pytest.mark.parametrize(("name", "off"), [("prr3", 1e-11), ("rrs3", 1e-7)])
def test_a_rollout_is_a_run_of_simulate(name, off):
    """Runs of the 3-RRS are in the rates of its platform: there the method's error is another."""
    robot, model = robot_of(name), model_of(name)
    state, u = states(name)
    run = robot.simulate(state.at(0), u[0], duration=0.05, method="rk4", step=1e-3)
    forces = jnp.broadcast_to(u[0], (50, u.shape[-1]))
    q, v = jax.jit(model.rollout)(state.q[0], state.rates[0], forces, 1e-3)
    assert q.shape == (51, state.q.shape[-1]) and v.shape == (51, robot.mobility)
    told = robot.in_chart(run.final, robot.independent).rates
    np.testing.assert_allclose(q[-1], run.final.q, rtol=0, atol=off)
    np.testing.assert_allclose(v[-1], told, rtol=0, atol=off)
    each = jax.vmap(lambda *x: model.rollout(*x, 1e-3), (0, 0, None))(state.q, state.rates, forces)
    np.testing.assert_allclose(each[0][0], q, rtol=0, atol=1e-12)


@pytest.mark.long
def test_a_step_is_differentiable_twice():
    """By the state, the forces and the length of the step, together."""
    model = model_of("five_bar")
    state, u = states("five_bar")
    x = jnp.concatenate([state.q[0], state.rates[0], u[0], jnp.array([1e-2])])
    weights = jnp.array(np.random.default_rng(5).normal(size=6))

    def loss(x):
        return weights @ jnp.concatenate(model.step(x[:4], x[4:6], x[6:8], x[8]))

    slope, bend = jax.jit(jax.grad(loss)), jax.jit(jax.hessian(loss))
    h, units = 1e-5, np.eye(9)
    first = [(loss(x + h * e) - loss(x - h * e)) / (2 * h) for e in units]
    np.testing.assert_allclose(slope(x), first, rtol=1e-6, atol=1e-8)
    second = np.array([(slope(x + h * e) - slope(x - h * e)) / (2 * h) for e in units])
    np.testing.assert_allclose(bend(x), second, rtol=1e-5, atol=1e-6)


@pytest.mark.long
def test_the_gradient_of_a_rollout_is_that_of_simulate():
    robot, model = robot_of("prr3"), model_of("prr3")
    state, u = states("prr3")

    def end(u):
        q, _ = model.rollout(state.q[0], state.rates[0], jnp.broadcast_to(u, (20, 3)), 2e-3)
        return q[-1, 0]

    def simulated(u):
        run = robot.simulate(state.at(0), u, duration=0.04, method="rk4", step=2e-3)
        return run.final.q[0]

    slope = jax.jit(jax.grad(end))(jnp.asarray(u[0]))
    ahead = [(simulated(u[0] + d) - simulated(u[0] - d)) / 2e-2 for d in 1e-2 * np.eye(3)]
    np.testing.assert_allclose(slope, ahead, rtol=1e-6)


@pytest.mark.long
def test_free_numbers_are_arguments():
    """The derivative by a mass and a length, which moves the loops."""
    robot = lw.Robot("prr3").free("platform.mass")
    model = linkwork.jax.model(robot)
    state, u = states("prr3")
    given = state.q[0], state.rates[0], u[0]
    assert model.p.shape == (1,)
    np.testing.assert_allclose(
        model.forward_dynamics(*given), robot.forward_dynamics(state.at(0), u[0]), rtol=1e-12
    )
    check_grads(jax.jit(model.forward_dynamics), (*given, model.p), 1, rtol=1e-4, atol=1e-4)
    with pytest.raises(lw.LinkworkError, match="no number of 3-PRR is free"):
        model_of("prr3").step(*given, 1e-3, p=1.0)


def test_another_chart_tells_the_same_motion():
    robot = robot_of("five_bar")
    names = [each for each in robot.equations.tree.rates if each not in robot.independent][:2]
    model = linkwork.jax.model(robot, names)
    assert model.independent == tuple(names)
    state, u = states("five_bar")
    other = robot.in_chart(state, names)
    np.testing.assert_allclose(
        model.forward_dynamics(other.q, other.rates, u), robot.forward_dynamics(other, u), rtol=1e-9
    )


def test_what_is_not_defined_is_an_error_that_names_the_state_or_nan():
    model = model_of("prr3")
    state, u = states("prr3")
    q = np.array(state.q)
    q[2] = np.nan
    f = jax.jit(jax.vmap(model.forward_dynamics))
    with pytest.raises(REFUSED, match=r"forward_dynamics of 3-PRR.*not finite.*from 0: 2"):
        jax.block_until_ready(f(q, state.rates, u))
    with pytest.raises(REFUSED, match=r"step of 3-PRR.*from 0: 2"):
        jax.block_until_ready(jax.vmap(lambda *x: model.step(*x, 1e-3))(q, state.rates, u))
    quiet = linkwork.jax.model(robot_of("prr3"), singular="nan")
    found = jax.vmap(quiet.forward_dynamics)(q, state.rates, u)
    assert np.isnan(found).all(axis=1).tolist() == [False, False, True, False]
    np.testing.assert_allclose(found[3], f(state.q, state.rates, u)[3], rtol=1e-13)


def test_singular_poses_and_open_loops_are_told():
    robot = lw.Robot("four_bar")
    model = linkwork.jax.model(robot)
    with pytest.raises(REFUSED, match=r"closed of .*do not close near q"):
        jax.block_until_ready(model.closed(robot.home.q + 50.0 * np.sin(np.arange(3.0) + 1)))
    with pytest.raises(REFUSED, match="cease to determine the motion, or the loops"):
        found = model.rollout(robot.home.q, [200.0], np.zeros((50, 1)), 0.02)
        jax.block_until_ready(found)


@pytest.mark.sample(1)
@pytest.mark.parametrize("make", [with_a_hand, open_chain])
def test_closed_refuses_numbers_that_are_in_no_loop(make):
    robot = make()
    model, quiet = (linkwork.jax.model(robot, singular=how) for how in ("raise", "nan"))
    q = np.tile(model.q, (3, 1))
    q[1, robot.equations.tree.coordinates.index("pin")] = np.nan
    with pytest.raises(REFUSED, match=r"closed of .*not finite.*from 0: 1"):
        jax.block_until_ready(model.closed(q))
    found = np.asarray(quiet.closed(q))
    assert np.isnan(found).all(axis=1).tolist() == [False, True, False]
    assert np.linalg.matrix_rank(jax.jacfwd(model.closed)(model.q), tol=1e-9) == robot.mobility


@pytest.mark.long
def test_bad_arguments_get_a_sentence():
    model = model_of("prr3")
    state, u = states("prr3")
    q, v = state.q[0], state.rates[0]
    for call, sentence in (
        (lambda: model.forward_dynamics(q[:3], v, u[0]), r"q of forward_dynamics has the shape"),
        (lambda: model.forward_dynamics(q, "fast", u[0]), "give an array of real numbers"),
        (lambda: model.forward_dynamics(q, v * 1j, u[0]), "give an array of real numbers"),
        (lambda: model.forward_dynamics(state.q, np.zeros((3, 3)), u[0]), "do not fit together"),
        (lambda: model.mass_matrix(q > 0), "give an array of real numbers"),
        (lambda: model.mass_matrix(q, v, u[0]), "mass_matrix was given 3 arrays; give 1: q"),
        (lambda: model.mass_matrix(q, q=q), "mass_matrix was given q twice"),
        (lambda: model.mass_matrix(v=q), "there is no array 'v' of mass_matrix; there are q"),
        (lambda: model.mass_matrix(), "mass_matrix was given 0 arrays; give 1: q"),
        (lambda: model.rollout(q, v, u[0], 1e-3), "give a row of forces for each step"),
        (lambda: linkwork.jax.model("prr3"), "give a linkwork.Robot"),
        (lambda: linkwork.jax.model(robot_of("prr3"), singular="no"), '"raise" or "nan"'),
    ):
        with pytest.raises(lw.LinkworkError, match=sentence):
            call()
    with pytest.raises(AttributeError, match="found by Newton's method"):
        _ = model.tool_to_joints
    loss = lambda q: jnp.sum(model.tool_pose(q=q))  # noqa: E731
    with pytest.raises(lw.LinkworkError, match="a third one was asked for"):
        jax.jacfwd(jax.jacfwd(jax.jacfwd(loss)))(q)


def test_single_precision_and_a_missing_jax_are_told(monkeypatch):
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(lw.LinkworkError, match="jax_enable_x64"):
        linkwork.jax.model(robot_of("prr3"))
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(lw.LinkworkError, match=r"pip install 'linkwork\[jax\]'"):
        linkwork.jax.model(robot_of("prr3"))


@pytest.mark.parametrize("shared", [False, True])
def test_many_states_are_those_of_the_robot_and_each_is_looked_at(shared):
    """More than a chunk, not a multiple of it; with rows of their own, and with one q for all."""
    robot, model = robot_of("prr3"), model_of("prr3")
    state, _ = states("prr3")
    random, count = np.random.default_rng(11), 700
    v, u = random.normal(size=(2, count, 3))
    q = state.q[0] if shared else np.tile(state.q, (count // 4, 1))
    chosen = state.at(np.zeros(count, int) if shared else np.arange(count) % 4).with_rates(v)
    f = jax.jit(jax.vmap(model.forward_dynamics, (None if shared else 0, 0, 0)))
    np.testing.assert_allclose(f(q, v, u), robot.forward_dynamics(chosen, u), rtol=1e-11)
    for lost in (3, 300, 650, 699):
        bad = v.copy()
        bad[lost] = np.inf
        with pytest.raises(REFUSED, match=f"not finite.*from 0: {lost}"):
            jax.block_until_ready(f(q, bad, u))
    quiet = linkwork.jax.model(robot, singular="nan")
    found = jax.vmap(quiet.forward_dynamics, (None if shared else 0, 0, 0))(q, bad, u)
    assert np.flatnonzero(np.isnan(found).any(axis=1)).tolist() == [lost]


def test_robots_that_cannot_are_refused_by_name(monkeypatch):
    """Friction with states of its own, turns that are independent in part, and large ones."""
    sticking = linkwork.jax.model(
        slide(coulomb=0.5, bristle=lw.Bristle(stiffness=1e4, damping=20.0))
    )
    given = sticking.q, sticking.v, np.zeros(len(sticking.arrays.get("u", ())))
    with pytest.raises(lw.LinkworkError, match="sticks by bristles"):
        sticking.step(*given, 1e-3)
    robot = robot_of("rrs3")
    (_, turn), *_ = robot.equations.tree.quaternions
    rates = robot.equations.tree.rates
    mixed = [rates[turn[0]], *(each for each in rates if each in robot.independent)][:3]
    with pytest.raises(lw.LinkworkError, match="the rates of one free turn, and not the others"):
        linkwork.jax.model(robot, mixed).closed(robot.home.q)
    monkeypatch.setattr(CompiledChart, "large", True)
    with pytest.raises(lw.LinkworkError, match=r"of \d+ bodies, have more than 5,000"):
        linkwork.jax.model(lw.Robot("prr3"))


def test_a_model_is_pickled_as_what_it_was_made_of():
    model = linkwork.jax.model(lw.Robot("prr3"))
    again = pickle.loads(pickle.dumps(model))
    u = np.ones(3)
    expected = model.forward_dynamics(model.q, model.v, u)
    assert (again.forward_dynamics(model.q, model.v, u) == expected).all()
