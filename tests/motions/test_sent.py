"""Paths that are sent to other processes are the same there."""

import pickle

import numpy as np
import pytest

from linkwork import motions, paths

from tests.catalogue import built

AXES = motions.AxisLimits(speed=1.0, acceleration=3.0, jerk=20.0)
POINTS = [{"a": 0.0}, {"a": 1.0}, {"a": 0.5}, {"a": 2.0}]
PATHS = {
    "line": paths.line([0, 0], [1, 1], law=paths.uniform),
    "circle": paths.circle([0, 0], 0.1, 0.2),
    "helix": paths.helix([0, 0, 0], 0.1, 0.2),
    "arc": paths.arc([0, 0], [1, 1], [2, 0]),
    "spline": paths.through([[0, 0], [1, 1], [2, 0], [3, 1], [4, 0]]),
    "together": paths.together(paths.circle([0, 0], 0.1), paths.swing(1, 0.2)),
    **{
        law: motions.point_to_point(POINTS[0], POINTS[1], AXES, law=law)
        for law in ("s_curve", "quintic", "septic", "cycloidal")
    },
    "through": motions.through(POINTS, AXES),
    "along": motions.along(paths.line([0, 0], [1, 1]), AXES),
    "blended": motions.blended([[0, 0, 0], [1, 0, 0], [1, 1, 0]], AXES),
    "gcode": motions.gcode("G0 X0 Y0\nG1 X90 F6000\nG2 X190 Y100 I0 J100\n", AXES, planar=True),
}


def sent(path):
    return pickle.loads(pickle.dumps(path))


@pytest.mark.parametrize("name", PATHS)
def test_paths_that_are_sent_are_the_same(name):
    path, times = PATHS[name], np.linspace(0, 1, 7)
    duration = getattr(path, "duration", 1.0)
    given = (1.0,) if isinstance(path, paths.Path) else ()
    found, again = (each.sample(duration * times, *given) for each in (path, sent(path)))
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("limits", [{"force": 4.0}, {"force": 4.0, "jerk": 2e4}])
def test_fastest_laws_that_are_sent_are_the_same(limits):
    way, limit = paths.circle([0.15, 0.4], 0.06), motions.ActuatorLimits(**limits)
    timed = motions.fastest(built("five_bar"), way, limit, points=51)
    times = np.linspace(0, timed.duration, 7)
    for one, other in zip(timed.sample(times), sent(timed).sample(times), strict=True):
        np.testing.assert_array_equal(one, other)
