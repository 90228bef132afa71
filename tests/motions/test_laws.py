"""Motion laws keep their limits and take no longer than they must: against closed solutions, a
linear programme and the exact derivatives."""

import numpy as np
import pytest
from scipy.optimize import linprog

from linkwork import LinkworkError, motions

RANDOM = np.random.default_rng(12)
DRAWN = [10 ** RANDOM.uniform(-2, 2, 4) for _ in range(60)]
LIMITS = {"speed": 0.8, "acceleration": 3.0, "jerk": 20.0}
WAY = motions.s_curve(0.4, **LIMITS)


def peaks(profile):
    return np.array([profile.extremes(order)[0] for order in (1, 2, 3)])


def ends(profile):
    """Return coordinate, speed and acceleration at both ends."""
    return np.array([profile(np.array([0, profile.duration]), order)[:, 0] for order in range(3)])


@pytest.mark.parametrize("jerk", [1e13, 1e16, 1e30])
def test_a_jerk_so_large_that_its_phases_vanish_leaves_a_trapezoid(jerk):
    profile = motions.s_curve(1.5, speed=1.0, acceleration=1.0, jerk=jerk)
    t = np.linspace(0, 2.5, 26)
    trapezoid = motions.trapezoidal(1.5, speed=1.0, acceleration=1.0)
    assert profile.duration == pytest.approx(2.5)
    assert profile(t) == pytest.approx(trapezoid(t), abs=1e-12)


@pytest.mark.parametrize("law", motions.LAWS)
@pytest.mark.parametrize("distance", [1e-3, 0.3, 40.0])
def test_a_law_goes_its_distance_from_rest_to_rest_within_its_limits(law, distance):
    limits = {kind: LIMITS[kind] for kind in LIMITS if (law, kind) != ("trapezoidal", "jerk")}
    profile = motions.LAWS[law](distance, **limits)
    x, v = ends(profile)[:2]
    assert x == pytest.approx([0, distance], abs=1e-13 * distance)
    assert np.abs(v).max() < 1e-13 * peaks(profile)[0]
    for kind, peak in zip(LIMITS, peaks(profile), strict=True):
        if kind in limits:
            assert peak <= limits[kind] * (1 + 1e-13)
    # One of the limits is reached: no time is lost.
    reached = [peaks(profile)[k] / limits[kind] for k, kind in enumerate(LIMITS) if kind in limits]
    assert max(reached) == pytest.approx(1, abs=1e-12)
    # The extremes are those of the curve itself.
    t = np.linspace(0, profile.duration, 20001)
    for order in (1, 2, 3):
        dense = np.abs(profile(t, order)).max()
        assert dense <= profile.extremes(order)[0] * (1 + 1e-12)
        assert dense == pytest.approx(profile.extremes(order)[0], rel=1e-3)


@pytest.mark.parametrize("drawn", DRAWN[:30])
def test_s_curves_keep_all_limits_whatever_these_are(drawn):
    distance, *limits = drawn
    profile = motions.s_curve(distance, **dict(zip(LIMITS, limits, strict=True)))
    rounding = 4e-16 * profile.duration * np.array([limits[1], limits[2], 0])
    assert (peaks(profile) <= np.array(limits) * (1 + 1e-14) + rounding).all()
    assert ends(profile)[0, 1] == pytest.approx(distance, rel=1e-13)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    "limits", [(9, 2, 3), (0.4, 2, 30), (0.4, 9, 3), (9, 9, 3)], ids=["A", "V and A", "V", "J"]
)
def test_an_s_curve_is_the_fastest_motion_under_its_limits(limits):
    """A linear programme in the jerk on a fine grid: no shorter time goes as far."""
    V, A, J = limits
    profile = motions.s_curve(1.0, speed=V, acceleration=A, jerk=J)

    def farthest(T, N=240):
        h = T / N
        to_a = h * np.tril(np.ones((N, N)))
        to_v = h * (np.tril(np.ones((N, N)), -1) @ to_a) + h / 2 * to_a
        way = T - h * (np.arange(N) + 0.5)  # d x(T) / d jerk, with one h
        bounds = np.vstack([to_a, -to_a, to_v, -to_v])
        most = np.concatenate([np.full(2 * N, A), np.full(2 * N, V)])
        ends = np.vstack([to_a[-1], to_v[-1]])
        solved = linprog(
            -h * (way**2 / 2 + h**2 / 24),
            A_ub=bounds,
            b_ub=most,
            A_eq=ends,
            b_eq=[0, 0],
            bounds=(-J, J),
        )
        return -solved.fun

    assert farthest(profile.duration) == pytest.approx(1, abs=2e-3)
    assert farthest(0.98 * profile.duration) < 1 - 5e-3


@pytest.mark.parametrize(
    ("law", "factors"),
    [
        ("quintic", (15 / 8, 10 / np.sqrt(3), 60)),
        ("septic", (35 / 16, 84 * np.sqrt(5) / 25, 105 / 2)),
        ("cycloidal", (2, 2 * np.pi, 4 * np.pi**2)),
    ],
)
def test_shapes_have_the_peaks_of_the_literature(law, factors):
    for kind, factor, order in zip(LIMITS, factors, (1, 2, 3), strict=True):
        profile = motions.LAWS[law](2.0, **{kind: 0.7})
        assert profile.duration == pytest.approx((factor * 2.0 / 0.7) ** (1 / order), rel=1e-13)


def test_the_closed_durations_of_trapezoid_and_triangle():
    assert motions.trapezoidal(3.0, speed=1.0, acceleration=2.0).duration == pytest.approx(3.5)
    assert motions.trapezoidal(0.5, speed=9.0, acceleration=2.0).duration == pytest.approx(1.0)
    slow = motions.s_curve(2.0, jerk=4.0)  # jerk alone: T = (32 D / J)^(1/3)
    assert slow.duration == pytest.approx((32 * 2.0 / 4.0) ** (1 / 3), rel=1e-14)


def test_the_cycloid_is_exact():
    profile, t = motions.cycloidal(1.0, speed=2.0), np.linspace(0, 1, 777)
    assert profile(t)[:, 0] == pytest.approx(t - np.sin(2 * np.pi * t) / (2 * np.pi), abs=1e-15)
    assert profile(t, 2)[:, 0] == pytest.approx(2 * np.pi * np.sin(2 * np.pi * t), abs=1e-13)


def test_derivatives_beyond_the_degree_vanish():
    assert WAY(0.1, 3) != 0 and WAY.extremes(3) == pytest.approx(LIMITS["jerk"])
    for order in (4, 5, 50):
        assert WAY(0.1, order) == 0 == WAY.extremes(order)


def test_a_profile_gives_the_law_of_a_path():
    profile = motions.s_curve(0.4, **LIMITS)
    tau = np.linspace(0, 1, 11)
    s, ds, dds = profile.law(tau)
    t = tau * profile.duration
    assert s * 0.4 == pytest.approx(profile(t)[:, 0], abs=1e-15)
    assert ds * 0.4 / profile.duration == pytest.approx(profile(t, 1)[:, 0], abs=1e-13)
    assert dds * 0.4 / profile.duration**2 == pytest.approx(profile(t, 2)[:, 0], abs=1e-12)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: motions.s_curve(0.0, jerk=1), "the distance is 0.0; give a positive number"),
        (lambda: motions.s_curve(1.0, speed=0, jerk=1), "the speed limit is 0; give a positive"),
        (lambda: motions.s_curve(1.0, jerk=np.nan), "the jerk limit is nan; give finite"),
        (lambda: motions.s_curve(1.0, speed=1), "has to have a limit of its jerk"),
        (lambda: motions.trapezoidal(1.0, speed=1), "has to have a limit of its acceleration"),
        (lambda: motions.trapezoidal(1.0, acceleration=1, jerk=1), "keeps no limit of the jerk"),
        (lambda: motions.polynomial(1.0, speed=1, degree=4), "the degree is 4; give 3, 5, 7"),
        (lambda: motions.cycloidal(1.0), "has to have a limit of its speed"),
        (lambda: WAY(0.1, -1), "the order is -1; give a whole number, 0 of the coordinates"),
        (lambda: WAY("soon"), "the times are 'soon'; give numbers"),
        (lambda: WAY.extremes(1.5), "the order is 1.5; give a whole number"),
        (lambda: WAY.along([0.0, np.nan], [1.0, 1.0]), r"start\[1\] is nan; give finite numbers"),
        (lambda: WAY.along([0.0], [1.0, 1.0]), r"the shapes \(1,\) and \(2,\); give as many"),
        (
            lambda: WAY.along([0.0] * 2, [1.0] * 2).along([0.0] * 3, [1.0] * 3),
            "the profile is of 2 coordinates; lead 3 coordinates along a profile of one",
        ),
        (lambda: motions.AxisLimits(), "no limit is given"),
        (lambda: motions.AxisLimits(speed=-1), "the speed limit is -1.0; give a positive"),
        (lambda: motions.AxisLimits(jerk=[1, 0]), "the jerk limit of coordinate 1 is 0"),
        (lambda: motions.AxisLimits(jerk={"a": np.inf}), "the jerk limit of 'a' is inf"),
    ],
)
def test_refusals(call, said):
    with pytest.raises(LinkworkError, match=said):
        call()
