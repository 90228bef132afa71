"""Mechanisms in micrometres, in nanograms, a million times larger or slower: what is derived
follows the scaling laws."""

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import derive, functions

from tests.catalogue import SAMPLE
from tests.oracle import random_mechanisms
from tests.oracle.scaling import Scale
from tests.products import sampled

SCALES = [(1e-6, 1.0, 1.0), (1e-9, 1e-9, 1e-6), (1e9, 1e9, 1e3)]
RANDOM = {
    "tree": random_mechanisms.open_tree(3),
    "planar": random_mechanisms.planar_loops(5),
    "spatial": random_mechanisms.spatial_loops(2),
}
CASES = [*SAMPLE, *RANDOM]


def described(name):
    return RANDOM[name] if name in RANDOM else getattr(lw.robots, name)()


@pytest.mark.sample(7)
@pytest.mark.parametrize(("factors", "name"), sampled(SCALES, CASES))
def test_what_is_derived_does_not_depend_on_the_units(factors, name):
    mechanism = described(name)
    plain = derive(mechanism)
    random = np.random.default_rng(7)
    v, u = random.normal(size=plain.mobility), random.normal(size=len(mechanism.actuators))
    q_dot, accelerations, pivot, kinetic, potential = evaluated(plain, plain.reference, v, u)
    scale = Scale(mechanism, *factors)
    scaled = derive(scale.mechanism)
    assert scaled.chart.independent == plain.chart.independent
    assert (scaled.redundant, scaled.idle, scaled.chart.blocks) == (
        plain.redundant,
        plain.idle,
        plain.chart.blocks,
    )
    of_q = np.where(scaled.tree.units == 1, 1.0, scale.L)
    assert np.allclose(scaled.reference / of_q, plain.reference, rtol=0, atol=1e-9)
    rates = scale.rates(plain.independent)
    found = evaluated(
        scaled, plain.reference * of_q, v * rates, u * scale.forces(mechanism.actuators)
    )
    assert same(found[0], q_dot, of_q / scale.T, 1e-12)
    assert same(found[1], accelerations, rates / scale.T, 1e-9)
    assert np.allclose(found[2], pivot, rtol=1e-6)
    assert np.allclose(found[3], kinetic * scale.energy, rtol=1e-9, atol=0)
    assert np.allclose(found[4], potential * scale.energy, rtol=1e-9, atol=1e-12 * scale.energy)


def evaluated(equations, q, v, u):
    """q', v', pivot and the energies, interpreted by CasADi."""
    motion = functions.motion(equations)(q=q, v=v, u=u, p=ca.DM(0, 1))
    energy = functions.energy(equations)(q=q, v=v, p=ca.DM(0, 1))
    values = (
        *(motion[key] for key in ("derivatives", "accelerations", "pivot")),
        energy["kinetic"],
        energy["potential"],
    )
    return [np.array(value).ravel() for value in values]


def same(found, expected, factors, tolerance):
    """Tell whether numbers are the expected ones times their factors, to a part of the largest of
    them."""
    return np.allclose(
        found / factors,
        expected,
        rtol=tolerance,
        atol=tolerance * np.abs(expected).max(initial=0.0),
    )
