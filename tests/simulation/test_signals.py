"""Forces over time against NumPy, SciPy and closed forms."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from linkwork.errors import LinkworkError
from linkwork.simulation import Sampled, as_signal, clock, stack

TIMES = np.array([0.0, 0.1, 0.35, 0.6, 1.0])
VALUES = np.array([[0.0, 1.0], [2.0, -1.0], [1.0, 0.5], [-1.0, 0.0], [3.0, 2.0]])
T = np.linspace(0, 1, 101)


def test_numbers_are_a_constant():
    signal = as_signal([1.5, -2.0])
    np.testing.assert_array_equal(signal([0.0, 7.0]), [[1.5, -2.0], [1.5, -2.0]])
    assert signal.breaks.size == 0


def test_no_inputs_at_all():
    assert as_signal([])(0.5).shape == (0,)


def test_spline_is_the_not_a_knot_cubic():
    signal = as_signal(Sampled(TIMES, VALUES))
    np.testing.assert_allclose(signal(T), CubicSpline(TIMES, VALUES)(T), atol=1e-14)
    assert signal.breaks.size == 0


def test_linear_interpolates_and_breaks_at_its_kinks():
    signal = as_signal(Sampled(TIMES, VALUES[:, 1], "linear"))
    np.testing.assert_allclose(signal(T)[:, 0], np.interp(T, TIMES, VALUES[:, 1]), atol=1e-14)
    np.testing.assert_array_equal(signal.breaks, TIMES)


def test_hold_keeps_each_value_from_its_own_time_on():
    signal = as_signal(Sampled(TIMES, VALUES, "hold"))
    np.testing.assert_array_equal(signal([0.0, 0.0999, 0.1, 0.34, 0.99]), VALUES[[0, 0, 1, 1, 3]])
    np.testing.assert_array_equal(signal.breaks, TIMES)


def test_stack_joins_different_signals():
    parts = (
        as_signal(Sampled(TIMES, VALUES)),
        as_signal([4.0]),
        clock(),
        as_signal(Sampled([0, 0.5, 1], [1, 2, 3], "hold")),
    )
    joined = stack(*parts)
    np.testing.assert_allclose(
        joined(T), np.concatenate([part(T) for part in parts], axis=1), atol=1e-13
    )
    np.testing.assert_array_equal(joined.breaks, [0, 0.5, 1])


def test_stack_refuses_signals_that_share_no_time():
    with pytest.raises(
        LinkworkError, match="share no time: one starts at 2 s, another ends at 1 s"
    ):
        stack(as_signal(Sampled([0, 1], [0, 0])), as_signal(Sampled([2, 3], [0, 0])))


@pytest.mark.parametrize(
    ("times", "values", "kind", "sentence"),
    [
        (
            [0, 1, 1, 2],
            [0, 0, 0, 0],
            "spline",
            r"sample times must increase: number 2 is 1 s after 1 s \(counted from 0\)",
        ),
        ([0, 1], [0, 0, 0], "spline", "one row for each of the 2 sample times"),
        ([0], [0], "hold", "at least two times"),
        ([0, np.nan], [0, 0], "linear", "sample times must be finite: number 1 is nan"),
        (
            [0, 1],
            [[0, 1], [np.inf, 2]],
            "linear",
            "sample values must be finite: number 1, 0 is inf",
        ),
        ([0, 1], ["a", "b"], "linear", "sample values must be numbers"),
        ([0, 1], [0, 1], "cubic", "'cubic' is none of spline, linear, hold"),
    ],
)
def test_bad_samples_are_refused(times, values, kind, sentence):
    with pytest.raises(LinkworkError, match=sentence):
        Sampled(times, values, kind)


@pytest.mark.parametrize(
    ("forces", "sentence"), [(3.0, r"shape \(\)"), ([1, np.nan], "number 1 is nan")]
)
def test_bad_constants_are_refused(forces, sentence):
    with pytest.raises(LinkworkError, match=sentence):
        as_signal(forces)
