"""Designs: distributions against SciPy's, sequences against SciPy's, members that do not depend on
how they are chunked."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats
from scipy.stats import qmc

from linkwork.mechanism import MechanismError
from linkwork.sweeps.designs import (
    Grid,
    Levels,
    LogNormal,
    LogUniform,
    Normal,
    Random,
    Sobol,
    Triangular,
    Uniform,
    Values,
)

DISTRIBUTIONS = {
    "uniform": (Uniform(low=-1, high=3), stats.uniform(-1, 4)),
    "log_uniform": (LogUniform(low=0.1, high=10), stats.loguniform(0.1, 10)),
    "normal": (Normal(mean=2, deviation=0.5), stats.norm(2, 0.5)),
    "cut": (Normal(mean=2, deviation=0.5, low=2.1), stats.truncnorm(0.2, np.inf, 2, 0.5)),
    "cut below": (Normal(mean=2, deviation=0.5, high=1.0), stats.truncnorm(-np.inf, -2, 2, 0.5)),
    "cut twice": (Normal(mean=2, deviation=0.5, low=1, high=4), stats.truncnorm(-2, 4, 2, 0.5)),
    "a tail": (Normal(mean=0, deviation=1, low=9, high=20), stats.truncnorm(9, 20)),
    "log_normal": (LogNormal(median=3, deviation=0.4), stats.lognorm(0.4, scale=3)),
    "triangular": (Triangular(low=-1, mode=2, high=3), stats.triang(0.75, -1, 4)),
    "values": (Values(values=(1, 2, 2.5)), None),
}
ALL = [variation for variation, _ in DISTRIBUTIONS.values()]


@pytest.mark.parametrize("name", [name for name, (_, known) in DISTRIBUTIONS.items() if known])
def test_quantiles(name):
    variation, known = DISTRIBUTIONS[name]
    u = np.concatenate([[1e-12, 1e-6], np.linspace(0.001, 0.999, 101)])
    np.testing.assert_allclose(variation.at(u), known.ppf(u), rtol=1e-12, atol=1e-12)
    sample = Random(members=4000, seed=11).points([variation], 0, 4000)[:, 0]
    assert stats.kstest(sample, known.cdf).pvalue > 1e-3
    low, high = variation.bounds
    assert low <= sample.min() and sample.max() <= high


def test_the_ends_of_a_normal_distribution_are_its_first_and_last_values():
    for low, high in ((1.0, 4.0), (3.0, 4.0), (-5.0, 1.0), (1.0, 1.0 + 1e-9)):
        found = Normal(mean=2, deviation=0.5, low=low, high=high).at(np.array([0.0, 1.0]))
        np.testing.assert_allclose(found, [low, high], rtol=1e-12)


@pytest.mark.parametrize("design", [Random(members=999, seed=4), Sobol(members=999, seed=4)])
def test_members_do_not_depend_on_chunks(design):
    whole = design.points(ALL, 0, 999)
    edges = [0, 1, 8, 300, 999]
    parts = [design.points(ALL, first, last) for first, last in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    other = type(design)(members=999, seed=5).points(ALL, 0, 999)
    assert (other[:, 0] != whole[:, 0]).all()
    assert len(np.unique(whole[:, 0])) == 999


def test_random_numbers_are_independent():
    cube = Random(members=5000, seed=1).cube(7, 0, 5000)
    assert stats.kstest(cube.ravel(), "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(cube.T) - np.eye(7)).max() < 0.06
    assert np.abs(np.corrcoef(cube[:-1, 0], cube[1:, 0])[0, 1]) < 0.06


def test_a_sobol_sequence_is_scipys_and_even():
    cube = Sobol(members=1024, seed=9).cube(3, 0, 1024)
    np.testing.assert_array_equal(cube, qmc.Sobol(3, rng=9).random(1024))
    assert (
        qmc.discrepancy(cube) < qmc.discrepancy(Random(members=1024, seed=9).cube(3, 0, 1024)) / 10
    )


def test_a_grid_is_every_combination_and_the_last_name_varies_fastest():
    axes = [
        Levels(low=1, high=100, count=3, spacing="geometric"),
        Values(values=(5, 4)),
        Levels(low=0, high=-1, count=2),
    ]
    assert Grid().count(axes) == 12
    table = np.concatenate([Grid().points(axes, 0, 5), Grid().points(axes, 5, 12)])
    wanted = [(a, b, c) for a in (1, 10, 100) for b in (5, 4) for c in (0, -1)]
    np.testing.assert_allclose(table, wanted, rtol=1e-15)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Uniform(low=1, high=1), "low = 1 is not below high = 1"),
        (lambda: LogUniform(low=0, high=1), "low = 0 has no logarithm"),
        (lambda: Triangular(low=0, mode=2, high=1), "mode = 2 lies outside 0 to 1"),
        (
            lambda: Normal(mean=0, deviation=1, low=50),
            "has no values between low and high, 50 and inf deviations",
        ),
        (lambda: Normal(mean=0, deviation=1, low=1, high=0), "has no values"),
        (
            lambda: Levels(low=-1, high=1, count=3, spacing="geometric"),
            "geometric levels need ends of one sign",
        ),
        (lambda: Levels(low=1, high=1, count=3), "give two different ends"),
        (lambda: Values(values=()), "values"),
        (lambda: Random(members=0), "members: 0 is below 1"),
        (lambda: Sobol(members=2**31), "2147483648"),
    ],
)
def test_what_is_impossible(make, sentence):
    with pytest.raises(MechanismError, match=sentence):
        make()
