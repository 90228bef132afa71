"""Friction that sticks, by bristles, against Coulomb's closed forms and those of bristles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw

from tests.equations.evaluation import close
from tests.robot.test_contacts import BALL, I, at, g, m, on_floor

MASS, k, F = 0.5, 40.0, 2.0
BODY = lw.Body(mass=MASS, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))
TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def slide(spring: float = 0.0, actuators=(), **friction) -> lw.Robot:
    joint = lw.PrismaticJoint(
        connects=("ground", "body"),
        axis=(1, 0, 0),
        spring=lw.Spring(stiffness=spring),
        friction=lw.Friction(**friction),
    )
    return lw.Robot(lw.Mechanism(bodies={"body": BODY}, joints={"x": joint}, actuators=actuators))


def hard(stiffness: float) -> lw.Bristle:
    """Return a bristle with critical damping."""
    return lw.Bristle(stiffness=stiffness, damping=2 * np.sqrt(stiffness * MASS))


def ran(robot: lw.Robot, state: lw.State, forces=None, **options) -> lw.Run:
    run = robot.simulate(state, forces, **TIGHT | options)
    assert run.status is lw.Status.FINISHED, run.message
    close(run["energy_balance"].values, np.zeros(len(run.time)), 1e-8)
    return run


def half_by_half(start: float, t: float) -> float:
    """Return x of m x'' = -k x - F sign(x'): every half oscillation takes 2 F / k, until it
    sticks."""
    w, c, begun = np.sqrt(k / MASS), F / k, 0.0
    while abs(start) > c:
        side = np.sign(start) * c
        if t - begun < np.pi / w:
            return side + (start - side) * np.cos(w * (t - begun))
        start, begun = 2 * side - start, begun + np.pi / w
    return start


def test_a_mass_on_a_spring_sticks_where_coulomb_s_law_says():
    robot, times = slide(k, coulomb=F, bristle=hard(1e12)), np.array([0.1, 0.3, 0.5, 0.7, 1.5, 4.0])
    run = ran(robot, robot.state([0.33]), duration=4.0, save_at=times, method="rodas")
    expected = [half_by_half(0.33, t) for t in times]
    close(run["joint_position"].values[:, 0], expected, 2e-6)
    close(run["joint_rate"].values[-2:], np.zeros((2, 1)), 1e-12)
    assert abs(run["drive_state"].sel(extra="x.bristle").values[-1]) < F


def pulled(static: float, V: float, t: float) -> float:
    """Return x of a mass that sticks and slips, pulled by a spring whose end goes steadily.

    From where it breaks loose the stretch y goes by m y'' = F - k y to where the mass rests again,
    and then rises steadily to where it breaks loose.
    """
    w, A = np.sqrt(k / MASS), (static - F) / k
    slips = (2 * np.pi - 2 * np.arctan(A * w / V)) / w
    since = (t - static / (k * V)) % (slips + 2 * A / V)
    if since > slips:
        return V * t - (F / k - A + V * (since - slips))
    return V * t - (F / k + A * np.cos(w * since) + V / w * np.sin(w * since))


def test_a_stick_slip_oscillator_tends_to_coulomb_s():
    """As the rise of friction at rest gets narrow, but is wide for stiff bristles."""
    static, V, errors, times = 3.0, 0.1, [], np.array([0.8, 1.4, 2.4, 3.0])
    for narrow in (1e-4, 1e-5):
        robot = slide(
            actuators=("x",), coulomb=F, static=static, stribeck_rate=narrow, bristle=hard(1e12)
        )
        run = ran(
            robot,
            robot.state([0.0]),
            lambda t, state: [k * (V * t - state["x"])],
            duration=3.0,
            save_at=times,
            method="rodas",
        )
        expected = [pulled(static, V, t) for t in times]
        errors.append(np.abs(run["joint_position"].values[:, 0] - expected).max())
    assert errors[0] < 4e-3 and errors[1] < errors[0] / 4


def test_a_stick_slip_oscillator_goes_as_its_own_equations_say():
    """Of the model itself, bristles and the rise of friction included, by another integrator."""
    static, V, narrow, stiffness = 3.0, 0.3, 0.03, 1e5
    bristle, times = hard(stiffness), np.linspace(0, 0.9, 10)
    friction = {"coulomb": F, "static": static, "stribeck_rate": narrow, "bristle": bristle}
    robot = slide(actuators=("x",), **friction)
    run = robot.simulate(
        robot.state([0.0]),
        lambda t, state: [k * (V * t - state["x"])],
        duration=0.9,
        save_at=times,
        method="rodas",
        rtol=1e-9,
        atol=1e-12,
    )

    def slope(t, y):
        x, w, b = y
        bend = w - abs(w) * b / (F + (static - F) * np.exp(-((w / narrow) ** 2)))
        return [w, (k * (V * t - x) - b - bristle.damping * bend) / MASS, stiffness * bend]

    exact = solve_ivp(slope, (0, 0.9), np.zeros(3), "Radau", times, rtol=1e-8, atol=1e-11)
    close(run["joint_position"].values[:, 0], exact.y[0], 1e-6)
    close(run["joint_rate"].values[:, 0], exact.y[1], 1e-6)
    assert run["joint_rate"].values.max() > V


def test_a_bristle_bends_as_the_rate_goes_steadily():
    """Of a heavy body, s = D (1 - exp(-stiffness w t / D))."""
    D, stiffness, w = 0.7, 300.0, 0.02
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"body": BODY.model_copy(update={"mass": 1e12})},
            joints={
                "x": lw.PrismaticJoint(
                    connects=("ground", "body"),
                    axis=(1, 0, 0),
                    friction=lw.Friction(coulomb=D, bristle=lw.Bristle(stiffness=stiffness)),
                )
            },
            gravity=(0.0, 0.0, 0.0),
        )
    )
    times = np.linspace(0.01, 0.5, 6)
    run = robot.simulate(robot.home.with_rates([w]), duration=0.5, save_at=times, **TIGHT)
    expected = D * (1 - np.exp(-stiffness * w * times / D))
    close(run["drive_state"].values[:, 0], expected, 1e-8)


def test_a_single_state_has_the_friction_of_steady_sliding():
    """With Stribeck's rise, smoothed, bristle or not."""
    law = {"coulomb": F, "static": 3.0, "stribeck_rate": 0.1, "coulomb_rate": 0.02}
    for more in ({}, {"bristle": hard(1e6)}):
        robot = slide(**law, **more)
        for w in (-1.0, 0.05, 0.0):
            D = F + (3 - F) * np.exp(-((w / 0.1) ** 2))
            found = robot.passive_forces(robot.home.with_rates([w]))
            close(found, [-D * w / np.hypot(w, 0.02)], 1e-13)


def test_a_ball_joint_sticks():
    """Under a moment below its friction it bends and stays; above it turns."""
    friction = lw.Friction(coulomb=0.5, bristle=lw.Bristle(stiffness=1e4, damping=20.0))
    joint = lw.SphericalJoint(connects=("ground", "body"), friction={"turn": friction})
    robot = lw.Robot(
        lw.Mechanism(bodies={"body": BODY}, joints={"b": joint}, gravity=(0.0, 0.0, 0.0))
    )
    axis = np.array([2.0, -1.0, 2.0]) / 3
    for moment, sticks in ((0.45, True), (0.55, False)):
        push = lw.control.Wrench("body", moment=tuple(moment * axis))
        run = ran(robot, robot.home, duration=0.5, wrenches=[push])
        rate = run["joint_rate"].values[-1]
        close(rate, 0 * axis if sticks else (axis @ rate) * axis, 1e-8)
        assert sticks or axis @ rate > 1.0
        if sticks:
            close(run["drive_state"].values[-1], moment * axis, 1e-6)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("slope", "sticks"), [(0.29, True), (0.31, False)])
def test_a_block_on_a_slope_stays_or_slides(slope, sticks):
    """Where tan(slope) is above the friction it goes by g (sin - m cos); else it stays put."""
    mu = 0.3
    down = g * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    depth = (m * g * np.cos(slope) / (4e7)) ** (1 / 1.5)
    points = tuple((x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.1, 0.1))
    friction = lw.Sliding(coefficient=mu, bristle=lw.Bristle(stiffness=1e5, damping=2e2))
    contact = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Points(points=points)),
        stiffness=1e7,
        dissipation=1.0,
        friction=friction,
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"ball": BALL},
            joints={"f": lw.FreeJoint(connects=("ground", "ball"))},
            contacts={"foot": contact},
            gravity=tuple(down),
        )
    )
    run = ran(robot, at(robot, (0, 0, -depth)), duration=1.0, method="rodas")
    name = "joint_rate" if sticks else "joint_acceleration"
    expected = 0.0 if sticks else g * (np.sin(slope) - mu * np.cos(slope))
    close(run[name].values[-1], [expected, 0, 0, 0, 0, 0], 1e-8)


@pytest.mark.long
def test_a_block_goes_round_with_a_turntable():
    """What holds it turns with the table: seen from there it stays put, but for the bend."""
    bristle, rate = lw.Bristle(stiffness=1e5, damping=2e2), 3.0
    points = tuple((x, y, 0.0) for x in (-0.02, 0.02) for y in (-0.02, 0.02))
    contact = lw.Contact(
        connects=("table", "ball"),
        surfaces=(lw.Plane(), lw.Points(points=points)),
        stiffness=1e7,
        dissipation=1.0,
        friction=lw.Sliding(coefficient=0.4, bristle=bristle),
    )
    table = lw.Body(mass=1.0, inertia=lw.Inertia(xx=1e6, yy=1e6, zz=1e6))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"table": table, "ball": BALL},
            joints={
                "turn": lw.RevoluteJoint(connects=("ground", "table")),
                "f": lw.FreeJoint(connects=("ground", "ball")),
            },
            contacts={"foot": contact},
        )
    )
    depth, radius = (m * g / 4e7) ** (1 / 1.5), 0.2
    start = robot.state([0, radius, 0, -depth, 1, 0, 0, 0])
    start = start.with_rates([rate, 0, rate * radius, 0, 0, 0, rate])
    run = robot.simulate(start, **TIGHT, duration=1.0, save_at=np.array([0.5, 1.0]), method="rodas")
    q = run["joint_position"].values
    seen = (q[:, 1] + 1j * q[:, 2]) * np.exp(-1j * q[:, 0])
    bend = rate**2 * radius / g / bristle.stiffness
    close(seen.real, np.full(2, radius + bend), 1e-6)
    close(seen.real[1] - seen.real[0], 0.0, 2e-8)
    close(seen.imag, np.zeros(2), 2e-8)


def test_a_ball_rolls_on_without_creeping():
    """v_0 / (1 + m h^2 / I) less to rolling, with no slip left."""
    friction = lw.Sliding(coefficient=0.2, bristle=lw.Bristle(stiffness=1e6, damping=1e3))
    robot = on_floor(stiffness=1e6, dissipation=1.0, friction=friction)
    depth = (m * g / 1e6) ** (1 / 1.5)
    h = 0.1 - depth / 2
    run = ran(robot, at(robot, (0, 0, 0.1 - depth), (2.0, 0, 0)), duration=0.6, method="rodas")
    rates = run["joint_rate"].values[-1]
    close(rates[[0, 4]], np.array([h, 1]) * 2.0 / h / (1 + I / (m * h**2)), 1e-6)
    assert len(robot.names.strains) == 1


def test_a_resumed_run_goes_on_with_its_bristles():
    robot = slide(k, coulomb=F, bristle=lw.Bristle(stiffness=1e4, damping=50.0))
    start, options = robot.state([0.2]), {"rtol": 1e-9, "atol": 1e-11}
    whole = robot.simulate(start, duration=0.4, **options)
    half = robot.simulate(start, duration=0.2, **options)
    rest = robot.resume(half, duration=0.2, **options)
    for name in ("joint_position", "drive_state"):
        close(rest[name].values[-1], whole[name].values[-1], 1e-8)


def test_members_in_lanes_stick_as_they_do_alone():
    robot = slide(k, coulomb=F, bristle=lw.Bristle(stiffness=1e4, damping=50.0))
    states, times = robot.state(np.array([[0.1], [0.2], [0.3]])), np.array([0.1, 0.3])
    together = robot.ensemble(states, duration=0.3, save_at=times)
    for member in range(3):
        alone = robot.simulate(states.at(member), duration=0.3, save_at=times)
        for name in ("joint_position", "drive_state"):
            found = together.dataset[name].values[member]
            close(found, alone[name].values, 1e-7)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: lw.Friction(coulomb=2.0, static=1.0), "static friction 1 is below that of slid"),
        (lambda: lw.Friction(bristle={"stiffness": 1.0}), "of which there is none; give coulomb"),
        (lambda: lw.Sliding(bristle={"stiffness": 1.0}), "there is none; give coefficient"),
        (lambda: lw.Bristle(stiffness=0.0), "stiffness: 0.0 is not above 0"),
    ],
)
def test_friction_that_is_none(made, said):
    with pytest.raises(lw.MechanismError, match=said):
        made()


def test_reactions_of_a_slide_that_sticks():
    """Newton: a rail's whole force along itself is m x'', and at rest what the bristle holds."""
    robot = slide(k, coulomb=F, bristle=hard(1e4))
    run = ran(robot, robot.state([0.33]), duration=3.0, save_at=np.linspace(0, 3, 31))
    found, accelerations = run.reactions(frame="second").values[:, 0], run.dataset
    close(found[:, 3], MASS * accelerations["joint_acceleration"].values[:, 0], 1e-9)
    close(found[-1, [0, 1, 2, 4, 5]], [0, 0, 0, 0, MASS * 9.81], 1e-9)
    held = run["drive_state"].values[-1, 0]
    close(held, -k * run["joint_position"].values[-1, 0], 1e-9)
    assert 0.1 < abs(held) < F and abs(found[-1, 3]) < 1e-9


def test_reactions_beside_a_contact_that_sticks():
    """A ball on a rail over a floor: the rail bears what the floor does not, and nothing along
    itself."""
    rail = lw.PrismaticJoint(connects=("ground", "ball"), axis=(1, 0, 0))
    floor = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1, frame=lw.Frame(position=(0, 0, 0.0995)))),
        stiffness=1e5,
        exponent=1.0,
        friction=lw.Sliding(coefficient=0.4, bristle=lw.Bristle(stiffness=1e4, damping=20.0)),
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"ball": BALL}, joints={"x": rail}, contacts={"floor": floor}, gravity=(0, 0, -g)
        )
    )
    start = robot.home.with_rates([0.3])
    run = robot.simulate(start, duration=0.2, save_at=np.linspace(0, 0.2, 11), **TIGHT)
    found = run.reactions().values[:, 0]
    close(found[:, 3], np.zeros(11), 1e-9)
    close(found[:, 5], np.full(11, m * g - 1e5 * 0.0005), 1e-9)
    assert abs(run["joint_rate"].values[-1, 0]) < 1e-6


@pytest.mark.parametrize(
    ("loads", "what"),
    [
        ({"friction": lw.Friction(coulomb=1.0, coulomb_rate=1e-6)}, "the dry friction of x"),
        ({"spring": lw.Spring(stiffness=1e9)}, "the spring of x"),
        ({"spring": lw.Spring(stiffness=1.0, damping=1e6)}, "the damper of x"),
    ],
)
def test_explicit_methods_name_what_bounds_their_steps(loads, what):
    joint = lw.PrismaticJoint(connects=("ground", "body"), axis=(1, 0, 0), **loads)
    robot = lw.Robot(lw.Mechanism(bodies={"body": BODY}, joints={"x": joint}))
    still = "spring" in what  # else its oscillation would have to be followed
    start = robot.state([1e-15 if still else 1e-3]).with_rates([0.0 if still else 1e-6])
    run = robot.simulate(start, duration=10.0, method="dormand_prince", max_steps=3000)
    assert run.status is lw.Status.TOO_MANY_STEPS
    assert f'take method="rodas", for {what} is stiff there (about ' in run.message
    rate = float(run.message.partition("(about ")[2].partition(" 1/s")[0])
    expected = {"dry": 1.0 / 1e-6 / MASS, "spr": np.sqrt(1e9 / MASS), "dam": 1e6 / MASS}[what[4:7]]
    assert abs(rate / expected - 1) < 0.5


def test_explicit_methods_that_nothing_stiff_stops_say_so_as_before():
    robot = slide(k)
    run = robot.simulate(robot.state([0.3]), duration=10.0, method="dormand_prince", max_steps=5)
    assert "stiff there" not in run.message and "allow more, loosen rtol" in run.message


def landed(speed, stiffness, damping, duration):
    """Return (x', z', w) of a ball of 0.4 kg that falls by 0.2 m while it moves on with a speed, by
    SciPy: free flight, and then the law of its contact with a bristle."""
    m, moment, R, k, c, mu = 0.4, 1.6e-3, 0.1, 1e6, 0.5, 0.2

    def slopes(t, y):
        z, vx, vz, w, b = y
        d = max(R - z, 0.0)
        arm, N = R - d / 2, k * d**1.5 * max(1 - c * vz, 0.0)
        u = vx - arm * w
        bending = u - abs(u) * b / mu
        f = -N * (b + damping * bending)
        rate = stiffness * bending if z <= R else -stiffness / damping * b
        return [vz, f / m, N / m - 9.81, -arm * f / moment, rate]

    fall = np.sqrt(0.4 / 9.81)
    start = [R, speed, -9.81 * fall, 0.0, 0.0]
    found = solve_ivp(slopes, (fall, duration), start, "Radau", rtol=1e-9, atol=1e-11)
    return found.y[1:4, -1]


def test_bristles_of_parts_that_meet_fast_bend_from_then_on():
    """Runs stopped at the impact with "the motion breaks off here": no step into it was short
    enough for the rate at which bristles bend."""
    friction = lw.Sliding(coefficient=0.2, bristle=lw.Bristle(stiffness=1e6, damping=100.0))
    floor = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Sphere(radius=0.1)),
        stiffness=1e6,
        dissipation=0.5,
        friction=friction,
    )
    ball = lw.Body(mass=0.4, inertia=lw.Inertia(xx=1.6e-3, yy=1.6e-3, zz=1.6e-3))
    free = lw.FreeJoint(connects=("ground", "ball"))
    robot = lw.Robot(
        lw.Mechanism(bodies={"ball": ball}, joints={"free": free}, contacts={"floor": floor})
    )
    rates = np.zeros((2, 6))
    rates[:, 0] = 2.0, 10.56
    starts = robot.state(np.tile([0, 0, 0.3, 1.0, 0, 0, 0], (2, 1))).with_rates(rates)
    members = robot.ensemble(starts, duration=0.22)
    for i, speed in enumerate(rates[:, 0]):
        run, stiff = (
            robot.simulate(starts.at(i), duration=0.22, method=method) for method in (None, "rodas")
        )
        assert run.success and stiff.success
        np.testing.assert_array_equal(members.final.rates[i], run.final.rates)
        for found in (run, stiff):
            ends = landed(speed, 1e6, 100.0, 0.22)
            np.testing.assert_allclose(found.final.rates[[0, 2, 4]], ends, rtol=2e-6)
