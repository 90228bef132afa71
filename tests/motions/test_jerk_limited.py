"""The law of the least time under limits of jerk: against closed S-curves, the law without, and the
limits themselves at times that are denser than its grid."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import LinkworkError, motions, paths

from tests.catalogue import built
from tests.motions.test_fastest import ANY, FORCE, MASS, WAY, WAYS, duration, slide

LINE = {"x": 0.0}, {"x": WAY}


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "limits",
    [
        {"jerk": 5.0},
        {"speed": 1.5, "acceleration": 2.0, "jerk": 5.0},
        {"speed": 1.0, "jerk": 3.0},
        {"acceleration": 1.2, "jerk": 9.0},
    ],
)
def test_a_straight_way_is_an_s_curve_of_up_to_seven_phases(limits):
    exact = motions.s_curve(WAY, **limits).duration
    coarse, fine = (duration(slide(), *LINE, points, **limits) for points in (51, 101))
    assert exact < fine == pytest.approx(exact, rel=1e-3)
    assert fine - exact < 0.6 * (coarse - exact)


def test_the_jerk_of_a_force_is_that_of_what_it_moves():
    exact = motions.s_curve(WAY, acceleration=FORCE / MASS, jerk=5.0).duration
    assert duration(slide(), *LINE, 101, force=FORCE, jerk=5.0) == pytest.approx(exact, rel=1e-3)


def table():
    """Return two crossed slides."""
    axes = {"x": (1, 0, 0), "y": (0, 1, 0)}
    return lw.Robot(
        lw.Mechanism(
            gravity=(0, 0, 0),
            bodies={"x": lw.Body(mass=1.0), "y": lw.Body(mass=1.0)},
            joints={
                name: lw.PrismaticJoint(connects=(base, name), axis=axes[name])
                for name, base in (("x", "ground"), ("y", "x"))
            },
            actuators=("x", "y"),
            tools={"tip": lw.Tool(body="y")},
        )
    )


def test_on_a_line_of_two_axes_the_slower_one_counts():
    robot, ends = table(), ({"x": 0.0, "y": 0.0}, {"x": 2.0, "y": 0.5})
    limits = {"speed": [1.0, 0.2], "acceleration": [3.0, 1.0], "jerk": [6.0, 4.0]}
    exact = motions.s_curve(1.0, speed=0.4, acceleration=1.5, jerk=3.0).duration
    assert duration(robot, *ends, 101, **limits) == pytest.approx(exact, rel=1e-3)


def kept(robot, path, points=201, **limits):
    """Return the law, and the parts of limits taken at 4,001 times, from what the robot does."""
    timed = motions.fastest(robot, path, motions.ActuatorLimits(**limits), points=points)
    motion = motions.follow(robot, timed, samples=4001, keep_limits=False)
    places = [robot.rates.index(name) for name in robot.actuators]
    rates, bends = motion.joint_rates[:, places], motion.joint_accelerations[:, places]
    u = robot.inverse_dynamics(motion).values
    jerks = np.diff(bends, axis=0, append=0 * bends[-1:]) / motion.time[1]
    told = {"force": u, "speed": rates, "acceleration": bends, "power": u * rates, "jerk": jerks}
    parts = {kind: np.abs(told[kind]).max(axis=1) / limit for kind, limit in limits.items()}
    assert np.abs(bends[[0, -1]]).max() < 1e-9 * np.abs(bends).max()
    assert np.abs(rates[[0, -1]]).max() < 1e-9 * np.abs(rates).max()
    return timed, parts


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "path", "limits"),
    [
        ("prr3", WAYS["circle"], {"force": 5.0, "speed": 0.4, "jerk": 200.0}),
        ("prr3", WAYS["spline"], {"force": 5.0, "power": 1.0, "jerk": 20.0}),
        (
            "delta",
            paths.line([-0.3, -0.1, -0.9], [0.3, 0.2, -0.8]),
            {"force": 40.0, "acceleration": 200.0, "jerk": 3e3},
        ),
    ],
)
def test_limits_hold_everywhere_and_one_of_them_is_reached(name, path, limits):
    _, parts = kept(built(name), path, **limits)
    assert max(part.max() for part in parts.values()) < 1 + 1e-4
    assert np.median(np.max([*parts.values()], axis=0)) > 0.98
    assert parts["jerk"].max() > 0.995


@pytest.mark.long
def test_the_law_tends_to_that_without_a_limit_of_jerk():
    robot, given = built("prr3"), {"force": 5.0, "speed": 0.4}
    least = motions.fastest(robot, WAYS["circle"], motions.ActuatorLimits(**given)).duration
    times = [
        kept(robot, WAYS["circle"], points=101, jerk=J, **given)[0].duration for J in (50, 1e5)
    ]
    assert times[0] > 1.05 * times[1]
    assert times[1] == pytest.approx(least, rel=2e-2)


@pytest.mark.long
def test_friction_is_counted():
    robot = slide(friction=lw.Friction(viscous=1.5, coulomb=0.3))
    path = motions.point_to_point(*LINE, ANY, law="quintic")
    timed, parts = kept(robot, path, force=FORCE, jerk=20.0)
    assert parts["force"].max() < 1 + 1e-4
    assert np.median(np.maximum(parts["force"], parts["jerk"])) > 0.99
    assert timed.duration > duration(robot, *LINE, force=FORCE)


@pytest.mark.long
def test_a_path_that_rests_with_jerk_or_acceleration_keeps_its_knots():
    """Splines leave their ends as s^2 (degree 3) and s^3 (degree 5), and leap in their third or
    fifth derivative inside."""
    robot = built("prr3")
    points = [[0.48, 0.3, 1.2], [0.5, 0.31, 1.3], [0.48, 0.29, 1.1]]
    for degree in (3, 5):
        path = motions.through(points, ANY, degree=degree)
        assert path.path.knots
        _, parts = kept(robot, path, speed=0.4, jerk=40.0)
        assert 0.999 < parts["jerk"].max() < 1 + 1e-4


def cornered(s):
    x, slope = np.abs(s - 0.4), np.sign(s - 0.4)
    flat = 0 * s
    return (
        np.column_stack([s * 0.1, x * 0.1]),
        np.column_stack([flat + 0.1, slope * 0.1]),
        np.column_stack([flat, flat]),
    )


SMOOTH = motions.AxisLimits(speed=0.1, acceleration=1.0, jerk=10.0)
SLOT = motions.gcode("G21 G90\nG0 X0 Y0\nG1 X50 F6000\nG3 X50 Y20 J10\nG1 X0", SMOOTH, planar=True)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: motions.ActuatorLimits(jerk=0), "the jerk limit is 0; give a positive"),
        (lambda: motions.ActuatorLimits(jerk=np.nan), "the jerk limit is nan"),
        (
            lambda: motions.fastest(table(), SLOT, motions.ActuatorLimits(jerk=[1.0, 2.0, 3.0])),
            "the jerk limits are .*one for each of x, y",
        ),
        (
            lambda: motions.fastest(table(), SLOT, motions.ActuatorLimits(jerk=50.0)),
            r"between s = 0\.37.* and 0\.38.* \(of 1\) the path changes its curvature in a leap",
        ),
        (
            lambda: motions.fastest(
                table(), paths.Path(cornered), motions.ActuatorLimits(jerk=50.0)
            ),
            r"between s = 0\.39.* and 0\.40.* \(of 1\) the path has a corner",
        ),
        (
            lambda: motions.fastest(
                built("delta"),
                paths.line([0, 0, -0.9], [0.1, 0, -0.9]),
                motions.ActuatorLimits(force=1e-3, jerk=1e3),
            ),
            r"at s = 0 of the path \(of 1\) the actuator .* needs .* to hold the robot still",
        ),
    ],
)
def test_refusals(call, said):
    with pytest.raises(LinkworkError, match=said):
        call()


@pytest.mark.parametrize("points", [51, 101])
@pytest.mark.parametrize("jerk", [None, 160.0])
def test_a_path_through_an_actuator_singular_pose_is_refused(points, jerk):
    """Where it lies between two points of the grid, at which forces are within their limits, too:
    the determinant of the forward kinematics has another sign on either side."""
    robot = built("prr3")
    given = [0.513, 0.295, 0.7], [0.5295, 0.3021, 0.6471], [0.4792, 0.3014, 0.6626]
    path = paths.through([*given, [0.4941, 0.2919, 0.5154]])
    ends = robot.follow(path, 1.0, samples=401).state
    det = [np.linalg.det(lw.analysis.input_output(robot, ends.at(k))[0]) for k in (0, 200)]
    assert det[0] * det[1] < 0
    limits = motions.ActuatorLimits(force=1e4, power=1e3, jerk=jerk)
    with pytest.raises(LinkworkError, match=r"(actuator-|is )singular"):
        motions.fastest(robot, path, limits, points=points)
    free = motions.ActuatorLimits(speed=1.0, acceleration=5.0)
    assert motions.fastest(robot, path, free, points=points).duration > 0
