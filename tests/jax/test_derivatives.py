"""Derivatives by JAX along closed loops, through loops of programs, and where there are none."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
import linkwork.jax
from linkwork.jax.differentiable_model import JaxModel

from tests.jax.test_model import LOOPS, REFUSED, double, model_of, robot_of, states

jax = pytest.importorskip("jax")
jnp = jax.numpy

__all__ = ["double"]


@pytest.fixture
def bars(double) -> JaxModel:
    """The four-bar linkage, whose crank does not go round."""
    return model_of("four_bar")


@pytest.mark.long
@pytest.mark.parametrize("name", LOOPS)
def test_along_coordinate_rates_they_are_the_robot_s(name):
    """By small steps of what is independent, of rotations as well, loops closed."""
    robot, model = robot_of(name), model_of(name)
    state, u = states(name)
    told = robot.forward_dynamics_derivatives(state, u)

    def along(q, v, u, d):
        moved = model.coordinate_rates(q, d)
        return jax.jvp(lambda q: model.forward_dynamics(q, v, u), (q,), (moved,))[1]

    steps = jax.jit(jax.vmap(jax.vmap(along, (None, None, None, 0), 1), (0, 0, 0, None)))
    found = steps(state.q, state.rates, u, np.eye(robot.mobility))
    np.testing.assert_allclose(found, told.by_q, rtol=1e-9, atol=1e-9)
    slopes = jax.jit(jax.vmap(jax.jacrev(model.forward_dynamics, (1, 2))))(state.q, state.rates, u)
    np.testing.assert_allclose(slopes[0], told.by_v, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(slopes[1], told.by_u, rtol=1e-9, atol=1e-9)


def test_closed_is_differentiated_by_free_lengths():
    """By differences of robots of other lengths."""
    where = "slide_1.frames.1.position.0"
    robot = lw.Robot("prr3").free(where)
    model = linkwork.jax.model(robot)
    slope = jax.jacfwd(lambda p: model.closed(model.q, p))(model.p)[:, 0]
    size = robot.parameters[where]
    ahead, back = (
        robot.with_parameters({where: size + d}).assemble(
            {name: robot.home[name] for name in robot.independent}
        ).q
        for d in (1e-6, -1e-6)
    )  # fmt: skip
    np.testing.assert_allclose(slope, (ahead - back) / 2e-6, rtol=1e-6, atol=1e-7)


@pytest.mark.long
def test_gradients_of_rollouts_and_scans_are_differentiable(bars):
    """By differences of gradients."""
    forces = jnp.array([[0.5], [-1.0], [2.0]])

    def rolled(u):
        q, v = bars.rollout(bars.q, 0.5 + bars.v, 10 * u, 2e-2)
        return jnp.sum(jnp.sin(q[-1])) + v[-1, 0] ** 2

    def scanned(u):
        def onward(v, u):
            v = v + 2e-2 * bars.forward_dynamics(bars.q, v, 10 * u)
            return v, v

        return jnp.sum(jax.lax.scan(onward, bars.v, u)[1] ** 3)

    units = 1e-5 * np.eye(3)[:, :, None]
    for f, outer in ((rolled, jax.jacfwd), (scanned, jax.jacfwd), (scanned, jax.jacrev)):
        slope = jax.jit(jax.grad(f))
        told = [(slope(forces + d) - slope(forces - d)) / 2e-5 for d in units]
        found = jax.jit(outer(jax.jacrev(f)))(forces)
        np.testing.assert_allclose(found.reshape(3, 3, 1), told, rtol=1e-5, atol=1e-7)


@pytest.mark.long
@pytest.mark.parametrize(
    ("derivative", "rate", "h"),
    [(jax.grad, 100.0, 0.05), (jax.jacfwd, 20.0, 0.2), (jax.hessian, 20.0, 0.2)],
)
def test_a_step_that_is_not_defined_has_no_derivatives(bars, derivative, rate, h):
    """Its stages are all regular, and it jumps over a singular pose or leaves the loops open: the
    value that tells is not asked for."""
    loss = lambda model: lambda v: model.step(model.q, v, jnp.zeros(1), h)[0].sum()  # noqa: E731
    with pytest.raises(REFUSED, match="step of four-bar: on the way the rates crank_pivot cease"):
        jax.block_until_ready(jax.jit(derivative(loss(bars)))(jnp.array([rate])))
    quiet = linkwork.jax.model(lw.Robot("four_bar"), singular="nan")
    rates = jnp.array([[1.0], [rate], [2.0]])
    found = np.asarray(jax.jit(jax.vmap(derivative(loss(quiet))))(rates)).ravel()
    assert np.isnan(found).tolist() == [False, True, False]


def test_what_is_not_closed_for_want_of_numbers_has_no_derivatives_without_loops_either():
    model = linkwork.jax.model(lw.Robot("double_pendulum"), singular="nan")
    q = jnp.array([[0.1, 0.2], [np.nan, 0.3], [np.inf, 1.0]])
    found = jax.jit(jax.grad(lambda q: jnp.sum(model.closed(q) * jnp.array([2.0, 3.0]))))(q)
    np.testing.assert_array_equal(found, [[2.0, 3.0], [np.nan] * 2, [np.nan] * 2])


def test_undefined_numbers_of_a_step_are_no_singular_pose(bars):
    for q, v, u, h in (
        (bars.q, bars.v, [0.0], np.nan),
        (bars.q, [np.nan], [0.0], 1e-3),
        (bars.q * np.nan, bars.v, [0.0], 1e-3),
    ):
        with pytest.raises(REFUSED, match="the state after it is not finite"):
            jax.block_until_ready(bars.step(q, v, u, h))


def test_no_states_have_derivatives_of_no_numbers(bars):
    nothing = jnp.zeros((0, 3)), jnp.zeros((0, 1))
    slope = jax.jit(jax.jacrev(lambda u: bars.forward_dynamics(*nothing, u)))
    assert slope(jnp.zeros(1)).shape == (0, 1, 1)


def test_single_precision_after_the_model_was_made_is_told(bars):
    q, v = np.asarray(bars.q), np.asarray(bars.v)
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(lw.LinkworkError, match="jax_enable_x64"):
        bars.forward_dynamics(q, v, [0.0])
