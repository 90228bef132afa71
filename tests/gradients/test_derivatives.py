"""Derivatives at states: identities, other ways to the same numbers, and refusals."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import linkwork as lw
from linkwork.gradients.derivatives import derivative_kernel, require_finite
from linkwork.model.checks import SingularError
from linkwork.robots import five_bar, prr3

from tests.catalogue import WHOLE, built

RNG = np.random.default_rng(4)
STEPS = 4e-3, 2e-3, 1e-3


def moving(robot: lw.Robot, count: int = 0) -> tuple[lw.State, np.ndarray]:
    """Return a state beside home, or a stack of them, and forces."""
    shape = (count,) if count else ()
    home = np.broadcast_to(robot.home.positions, (*shape, len(robot.coordinates)))
    positions = home + 2e-3 * RNG.standard_normal(home.shape)
    rates = 0.3 * RNG.standard_normal((*shape, robot.mobility))
    state = robot.state(positions, rates, tolerance=0.5)
    return state, RNG.standard_normal((*shape, len(robot.actuators)))


def difference(value, size=1.0):
    """Return the derivative of a function at zero: central differences, extrapolated."""
    slopes = [(value(h * size) - value(-h * size)) / (2 * h * size) for h in STEPS]
    for factor in (4.0, 16.0):
        slopes = [(factor * b - a) / (factor - 1) for a, b in pairwise(slopes)]
    return slopes[0]


def near(found, expected, within=1e-9):
    size = max(np.abs(expected).max(initial=0.0), 1e-9)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max(initial=0.0) <= within * size


@pytest.mark.parametrize("name", ["prr3", "five_bar", "bricard"])
def test_forward_and_inverse_dynamics_undo_each_other(name):
    """F(q, v, v'(q, v, u)) = S' u all around: dF/dv' dv'/dq = -dF/dq + dS'/dq u, dv'/du = M^-1
    S'; and what `linearise` finds on its own."""
    robot = built(name)
    state, u = moving(robot)
    forward = robot.forward_dynamics_derivatives(state, u)
    inverse = robot.inverse_dynamics_derivatives(state, forward.accelerations)
    linear, n = robot.linearise(state, u), robot.mobility
    near(forward.accelerations, robot.forward_dynamics(state, u), 1e-12)
    near(inverse.forces, u, 1e-8)
    near(inverse.by_q, -inverse.by_accelerations @ forward.by_q, 1e-8)
    near(inverse.by_v, -inverse.by_accelerations @ forward.by_v, 1e-8)
    near(inverse.by_accelerations @ forward.by_u, np.eye(n), 1e-8)
    near(forward.by_q, linear.A[n:, :n])
    near(forward.by_v, linear.A[n:, n:])
    near(forward.by_u, linear.B[n:])
    on_rates = robot.inverse_dynamics_derivatives(state, forward.accelerations, of="rates")
    near(on_rates.by_accelerations, robot.mass_matrix(state), 1e-12)
    near(forward.by_u, np.linalg.solve(robot.mass_matrix(state), robot.actuation(state).T), 1e-9)


def test_forces_of_more_actuators_than_freedoms():
    """u of least weighted norm, as differences of inverse dynamics tell it."""
    described = five_bar()
    names = [name for name in described.joints if name not in described.actuators]
    robot = lw.Robot(described.model_copy(update={"actuators": (*described.actuators, names[0])}))
    state, _ = moving(robot)
    W, v_dot = np.array([1.0, 3.0, 0.5]), RNG.standard_normal(2)
    found = robot.inverse_dynamics_derivatives(state, v_dot, weights=W)
    assert found.rows == robot.actuators

    def forces(dq=0.0, dv=0.0, da=0.0):
        joints = dict(zip(robot.independent, own + dq, strict=True))
        moved = robot.assemble(joints, guess=state, rates=state.rates + dv)
        return robot.inverse_dynamics(moved, v_dot + da, weights=W)

    own = np.array([state[name] for name in robot.independent])
    near(found.forces, forces())
    for k, unit in enumerate(np.eye(2)):
        near(found.by_q[:, k], difference(lambda s, unit=unit: forces(dq=s * unit)))
        near(found.by_v[:, k], difference(lambda s, unit=unit: forces(dv=s * unit)))
        near(found.by_accelerations[:, k], difference(lambda s, unit=unit: forces(da=s * unit)))


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["prr3", "rrs3", *["stewart"] * WHOLE])
def test_stacks_are_their_states(name):
    robot = built(name)
    states, u = moving(robot, 5)
    forward = robot.forward_dynamics_derivatives(states, u, threads=2)
    tools = robot.tool_derivatives(states)
    for k in (0, 4):
        one = robot.forward_dynamics_derivatives(states.at(k), u[k])
        near(forward.by_q[k], one.by_q, 1e-11)
        near(forward.by_u[k], one.by_u, 1e-11)
        near(tools.twist_by_q[k], robot.tool_derivatives(states.at(k)).twist_by_q, 1e-11)
    empty = robot.forward_dynamics_derivatives(states.at(slice(0, 0)), u[:0])
    assert empty.by_q.shape == (0, robot.mobility, robot.mobility)


@pytest.mark.parametrize("name", ["prr3", "five_bar"])
def test_joints_and_tool_follow_by_their_own_maps(name):
    """d(rates)/dv = L and d(pose)/dq = d(twist)/dv = T; no free number: empty arrays."""
    robot = built(name)
    state, _ = moving(robot)
    joints, tool = robot.closure_derivatives(state), robot.tool_derivatives(state)
    near(joints.rates_by_v, robot.rate_map(state), 1e-12)
    near(tool.twist, robot.tool_twist(state), 1e-12)
    near(tool.pose_by_q, tool.twist_by_v, 1e-12)
    own = [robot.coordinates.index(name) for name in robot.rates if name in robot.coordinates]
    rates = [robot.rates.index(name) for name in robot.rates if name in robot.coordinates]
    near(joints.positions_by_q[own], joints.rates_by_v[rates], 1e-11)
    assert joints.positions_by_p.shape == (len(robot.coordinates), 0)
    assert tool.pose_by_p.shape == (6, 0)


def test_a_length_moves_joints_tool_and_accelerations():
    """Beside the robot with other values, closed anew at the same independent coordinates; rounding
    at a pose that is nearly singular leaves differences eight digits."""
    paths = ("platform.mass", "link_1.com.x", "pivot_2.frames.0.position.y")
    robot = lw.Robot(prr3()).free(*paths)
    state, u = moving(robot)
    own = {name: state[name] for name in robot.independent}

    def of(path, step):
        other = robot.with_parameters({path: robot.parameters[path] + step})
        moved = other.assemble(own, guess=other.state(state.positions, tolerance=0.5))
        moved = moved.with_rates(state.rates)
        pose, twist = other.tool_pose(moved), other.tool_twist(moved)
        rates = other.joint_rates(moved)
        return np.concatenate(
            [moved.positions, rates, pose, twist, other.forward_dynamics(moved, u)]
        )

    joints, tool = robot.closure_derivatives(state), robot.tool_derivatives(state)
    forward = robot.forward_dynamics_derivatives(state, u)
    assert forward.parameters == paths
    for k, path in enumerate(paths):
        found = [joints.positions_by_p, joints.rates_by_p, tool.pose_by_p[[3, 4, 2]]]
        found += [tool.twist_by_p, forward.by_p]
        expected = difference(lambda s, path=path: of(path, s), 0.1)

        near(np.concatenate(found)[:, k], expected, 1e-8)


def test_the_inertia_changes_along_motions():
    """dM/dt = sum_k dM/dq_k v_k, and M' - 2 C is skew: v' M' v / 2 = v' C v."""
    robot = built("prr3")
    state, _ = moving(robot)
    found = robot.mass_matrix_derivatives(state)
    near(found.M, robot.mass_matrix(state), 1e-12)
    turned = found.by_q @ state.rates
    power = state.rates @ turned @ state.rates / 2
    assert power == pytest.approx(state.rates @ robot.coriolis(state), rel=1e-9)


def test_another_chart_tells_the_same():
    """The derivatives in other rates are those in the first ones, by the map of the rates."""
    robot = built("five_bar")
    state, u = moving(robot)
    L, names = robot.rate_map(state), [robot.rates[k] for k in (2, 3)]
    other = robot.in_chart(state, names)
    turn = L[[robot.rates.index(name) for name in names]]
    first, second = robot.tool_derivatives(state), robot.tool_derivatives(other)
    assert second.independent == tuple(names)
    near(second.pose_by_q @ turn, first.pose_by_q, 1e-10)
    here, there = (robot.forward_dynamics_derivatives(each, u) for each in (state, other))
    near(there.by_u, turn @ here.by_u, 1e-9)


def test_pinocchio_has_the_same_derivatives_of_a_chain():
    pin = pytest.importorskip("pinocchio")
    robot = built("double_pendulum")
    state, u = robot.state([0.4, -0.7], [0.9, 1.3]), RNG.standard_normal(len(robot.actuators))
    live = robot.to_pinocchio()
    q, v = live.configuration(state)
    own = live.model.createData()
    by_q, by_v, by_tau = pin.computeABADerivatives(live.model, own, q, v, live.forces(u))
    found = robot.forward_dynamics_derivatives(state, u)
    near(found.by_q, by_q)
    near(found.by_v, by_v)
    near(np.linalg.inv(robot.mass_matrix(state)), by_tau)


CLOSED = {
    "forces that are not finite": (lambda r: (r.home, [np.nan, 0, 0]), "forces"),
    "too few forces": (lambda r: (r.home, [0.0]), "3 numbers"),
    "no state": (lambda r: (1.0, [0, 0, 0]), "a state is needed"),
}


@pytest.mark.parametrize(("given", "sentence"), CLOSED.values(), ids=CLOSED)
def test_what_does_not_fit_is_refused(given, sentence):
    robot = built("prr3")
    with pytest.raises(lw.LinkworkError, match=sentence):
        robot.forward_dynamics_derivatives(*given(robot))


def test_a_singular_pose_is_refused():
    """The slider of a slider-crank does not determine the motion where it turns back."""
    crank = built("slider_crank")
    slider = next(name for name in crank.rates if crank.unit(name) == "m")
    stretched = crank.assemble({crank.independent[0]: 0.0})
    robot = lw.Robot(crank.mechanism, independent=(slider,))
    singular = robot.state(dict(zip(crank.coordinates, stretched.positions, strict=True)))
    with pytest.raises(SingularError, match="singular"):
        robot.forward_dynamics_derivatives(singular, np.zeros(len(robot.actuators)))


def test_rates_that_are_not_finite_are_refused():
    robot = built("prr3")
    state = replace(robot.home, rates=np.array([0.0, np.nan, 0.0]))
    with pytest.raises(lw.LinkworkError, match="rates"):
        robot.forward_dynamics_derivatives(state, np.zeros(3))
    with pytest.raises(lw.LinkworkError, match="rates"):
        robot.tool_derivatives(state)


def test_derivatives_that_are_not_finite_are_refused():
    value, by = np.zeros(2), [np.eye(2), np.full((2, 2), np.inf), np.eye(2)]
    with pytest.raises(lw.LinkworkError, match="with respect to v are not finite here"):
        require_finite("forward_dynamics", value, by, 0)


def test_actuators_that_drive_too_little_are_refused():
    described = prr3()
    robot = lw.Robot(described.model_copy(update={"actuators": described.actuators[:2]}))
    state, _ = moving(robot)
    v_dot = np.zeros(robot.mobility)
    with pytest.raises(lw.LinkworkError, match=r"cannot drive all .* of='rates'"):
        robot.inverse_dynamics_derivatives(state, v_dot)
    found = robot.inverse_dynamics_derivatives(state, v_dot, of="rates")
    assert found.rows == robot.independent


def test_numbers_that_open_loops_are_refused():
    robot = built("four_bar")
    path = f"{robot.joints[1]}.frames.0.position.z"
    robot = robot.free(path)
    with pytest.raises(lw.LinkworkError, match=re.escape(f"{path}' opens the loops")):
        robot.closure_derivatives(robot.home)


def test_no_tool_is_refused():
    described = prr3().model_copy(update={"tools": {}})
    robot = lw.Robot(described)
    with pytest.raises(lw.LinkworkError, match="tool"):
        robot.tool_derivatives(robot.home)


def test_a_kernel_that_there_is_not_is_refused():
    robot = built("prr3")
    with pytest.raises(lw.LinkworkError, match="give 'actuators' or 'rates'"):
        robot.inverse_dynamics_derivatives(robot.home, np.zeros(3), of="joints")  # pyright: ignore
    with pytest.raises(lw.LinkworkError, match="forward_dynamics"):
        derivative_kernel(robot, "forward_dynamic")
    with pytest.raises(lw.LinkworkError, match="jacobian"):
        derivative_kernel(robot, "forward_dynamics", "hessian")  # pyright: ignore
    assert derivative_kernel(robot, "tool", "vjp", robot.home).inputs[0] == ("q", 7)
