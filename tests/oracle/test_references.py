"""The references for published mechanisms, held against the published numbers themselves and
against identities."""

import numpy as np
import pytest

from tests.oracle import andrews, governor, one_freedom
from tests.oracle.published import ANDREWS_END, ANDREWS_START, N_FOUR_BAR, SLIDER_CRANK


def test_andrews_equations_at_the_published_start_and_end():
    """The end's printed accelerations and multipliers are good to 1e-6, its rates and angles to
    3e-8 and 3e-10."""
    q, v, a, multipliers = ANDREWS_START
    assert np.allclose(andrews.closures(q), 0, atol=1e-16)
    found = andrews.accelerations(q, v)
    assert np.allclose(found[0], a, rtol=1e-13, atol=1e-9)
    assert np.allclose(found[1], multipliers, rtol=1e-13, atol=1e-12)
    q, v, a, multipliers = ANDREWS_END
    assert np.allclose(andrews.closures(q), 0, atol=1e-16)
    found = andrews.accelerations(q, v)
    assert np.allclose(found[0], a, rtol=2e-6)
    assert np.allclose(found[1], multipliers, rtol=2e-6)


def test_andrews_derivatives_are_derivatives():
    random = np.random.default_rng(1)
    q, v, h = andrews.START + 0.1 * random.normal(size=7), random.normal(size=7), 1e-5
    slopes = [
        (andrews.closures(q + h * step) - andrews.closures(q - h * step)) / (2 * h)
        for step in np.eye(7)
    ]
    assert np.allclose(andrews.jacobian(q), np.transpose(slopes), atol=1e-11)
    bend = (andrews.jacobian(q + h * v) - andrews.jacobian(q - h * v)) / (2 * h)
    assert np.allclose(andrews.curvature(q, v), bend @ v, atol=1e-11)


def test_andrews_motion_meets_the_published_end_and_keeps_its_energy():
    q, v = andrews.motion([0.0, 0.015, 0.03])
    assert np.allclose(q[-1], ANDREWS_END[0], rtol=4e-10)
    assert np.allclose(v[-1], ANDREWS_END[1], rtol=1e-7)
    energy = [andrews.energy(*state) for state in zip(q, v, strict=True)]
    assert np.ptp(energy) < 1e-13
    assert np.allclose([andrews.closures(angles) for angles in q], 0, atol=1e-15)


@pytest.mark.long
def test_andrews_motion_is_converged():
    tight, loose = (andrews.motion([0.03], tolerance=tolerance)[0] for tolerance in (3e-14, 1e-12))
    assert np.max(abs(tight - loose)) < 1e-11


def test_pendulum_in_closed_form_solves_its_equation():
    length, t, h = 0.7, np.linspace(0.1, 3, 30), 1e-4
    q = [one_freedom.pendulum(t + shift, length) for shift in (-h, 0, h)]
    assert np.allclose(
        (q[0] - 2 * q[1] + q[2]) / h**2, -one_freedom.g / length * np.cos(q[1]), atol=1e-5
    )
    assert one_freedom.pendulum([0.0]) == pytest.approx(0, abs=1e-15)


def test_n_four_bar_of_two_loops_as_published():
    times = list(N_FOUR_BAR)
    theta, rate = one_freedom.n_four_bar(2).motion(times, np.pi / 2, -1.0)
    assert np.allclose(
        np.transpose([np.cos(theta), np.sin(theta)]), list(N_FOUR_BAR.values()), atol=2e-12
    )
    velocity = rate[-1] * np.array([-np.sin(theta[-1]), np.cos(theta[-1])])
    assert np.allclose(velocity, [1.423051470189, -0.494868845467], atol=1e-11)


@pytest.mark.parametrize("psi", [one_freedom.RIGHT_ANGLES, 0.0, 1.3, 2.9, 4.4])
def test_bricard_closes_in_closed_form(psi):
    e, _, o = one_freedom.bricard_rods(psi)
    assert np.allclose(o[5] + e[5], 0, atol=1e-14)
    assert np.allclose(e[5], [0, 0, -1], atol=1e-14)


def test_bricard_starts_along_the_edges_of_a_cube_and_keeps_its_energy():
    e, _, o = one_freedom.bricard_rods(one_freedom.RIGHT_ANGLES)
    assert np.allclose(np.cross(e[0], e[1]) @ e[2], -1)
    assert np.allclose(
        o[1:6], [[1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]], atol=1e-14
    )
    linkage = one_freedom.bricard()
    states = linkage.motion([1.0, 2.0, 3.0], one_freedom.RIGHT_ANGLES, 0.0)
    start = linkage.energy(one_freedom.RIGHT_ANGLES, 0.0)
    assert np.allclose([linkage.energy(*state) for state in states.T], start, rtol=1e-12)


@pytest.mark.parametrize("linkage", [one_freedom.bricard(), one_freedom.spatial_slider_crank()])
def test_inertia_and_potential_have_the_slopes_that_are_used(linkage):
    s, h = 0.7, 1e-5
    J, V = np.real([linkage.terms(complex(s + shift)) for shift in (-h, 0, h)]).T
    expected = (0.4 - (J[2] - J[0]) / (2 * h) * 1.5**2 / 2 - (V[2] - V[0]) / (2 * h)) / J[1]
    assert np.isclose(linkage.acceleration(s, 1.5, 0.4), expected, rtol=1e-8)


def test_slider_crank_as_published():
    """F. Gonzalez's solution in the IFToMM library, to about what its own time steps allow."""
    theta, _ = one_freedom.spatial_slider_crank().motion(
        list(SLIDER_CRANK), 0.0, 6.0, tolerance=1e-11
    )
    assert np.allclose(one_freedom.slide(theta), list(SLIDER_CRANK.values()), rtol=0, atol=1e-4)


def test_governor_keeps_its_angular_momentum_and_comes_down_when_it_stands():
    y = governor.motion([0.1, 0.3], tolerance=1e-9)
    a = y[2]
    J = governor.K * np.sin(a) ** 2 + governor.E_m * np.cos(a) ** 2
    J += governor.rod * (governor.c + governor.b * np.cos(a)) ** 2
    J += governor.ball * (governor.c + governor.length * np.cos(a)) ** 2
    momentum = (governor.J_0 + 2 * J) * y[4]
    assert np.isclose(momentum[0], momentum[1], rtol=1e-8)
    assert np.allclose(y[2], y[3], atol=1e-12)
    still = governor.accelerations(governor.START, np.zeros(4))
    assert still[0] == 0
    assert still[2] > 0


def test_governor_springs_hold_the_rods_at_rest_by_the_lever_rule():
    """Shorter springs that balance a rod's moment W cos a = F l_a and the slider's weight: no
    acceleration."""
    a = 0.6
    sin, cos = np.sin(a), np.cos(a)
    s = governor.h - governor.b * sin - np.sqrt(governor.rest**2 - (governor.b * cos) ** 2)
    stretch = 1e-5
    state = np.array([0.0, s - stretch, a, a])
    rise = governor.h - governor.b * sin - state[1]
    span = np.hypot(governor.b * cos, rise)
    tension = governor.k * (span - governor.rest)
    found = governor.accelerations(state, np.zeros(4))
    # forces on the slider along z, moments about a hinge: the spring pulls from the rod's middle
    # towards the slider
    assert np.isclose(
        found[1], 2 * tension * rise / span / governor.slider - governor.g, rtol=1e-12
    )
    middle, pull = (
        governor.b * np.array([cos, -sin]),
        tension / span * np.array([-governor.b * cos, -rise]),
    )
    moment = middle[1] * pull[0] - middle[0] * pull[1] + governor.W * cos
    assert np.isclose(found[2], moment / governor.E, rtol=1e-12)
