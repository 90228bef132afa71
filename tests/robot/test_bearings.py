"""Friction that grows with what joints carry: closed cases, Newton and Euler by hand, reactions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import linkwork as lw

from tests.equations.evaluation import close
from tests.products import first

G = 9.81
SHARP = 1e-7  # rate of smoothing, far below the rates here


def rubs(coefficient: float, rate: float = SHARP, **more: Any) -> lw.Sliding:
    return lw.Sliding(coefficient=coefficient, rate=rate, **more)


def slide(mu: float, **more: Any) -> lw.mechanism.SlidingBearing:
    return lw.SlidingBearing(friction=rubs(mu), **more)


def journal(mu: float, radius: float, **more: Any) -> lw.mechanism.JournalBearing:
    return lw.JournalBearing(friction=rubs(mu), radius=radius, **more)


def on_incline(
    angle: float, bearing: lw.mechanism.SlidingBearing, mass: float = 2.0, height: float = 0.0
) -> lw.Robot:
    """Return a block on a slide that rises along x under an angle, its mass at a height above."""
    body = lw.Body(mass=mass, centre_of_mass=(0, height, 0), inertia=lw.Inertia(zz=0.01))
    frames = lw.Frame(rotation=(0, 0, angle)), lw.Frame()
    joint = lw.PrismaticJoint(
        connects=("ground", "block"), axis=(1, 0, 0), frames=frames, bearing=bearing
    )
    return lw.Robot(
        lw.Mechanism(
            bodies={"block": body}, joints={"x": joint}, gravity=(0, -G, 0), actuators=("x",)
        )
    )


@pytest.mark.parametrize("way", [1, -1])
def test_a_block_slides_on_an_incline_as_coulomb_says(way):
    robot = on_incline(0.4, slide(0.3))
    state = robot.home.with_rates([way * 1.0])
    expected = -G * (np.sin(0.4) + way * 0.3 * np.cos(0.4))
    close(robot.forward_dynamics(state, [0.0]), [expected], 1e-12)
    close(robot.inverse_dynamics(state, [expected]), [0.0], 1e-12)


def test_a_block_on_an_incline_holds_by_itself_below_the_angle_of_friction_and_slides_above():
    bristle = lw.Bristle(stiffness=1e5, damping=300.0)
    law = lw.SlidingBearing(friction=rubs(0.3, bristle=bristle))
    for angle, moves in ((0.25, False), (0.35, True)):
        robot = on_incline(angle, law)
        run = robot.simulate(robot.home, duration=1.0, method="rodas", rtol=1e-9, atol=1e-11)
        x = run["joint_position"].values[-1, 0]
        fall = G * (np.sin(angle) - 0.3 * np.cos(angle)) / 2
        assert abs(x + fall) < 0.01 * fall if moves else abs(x) < 1e-5
        close(run["energy_balance"].values, 0 * run.time, 1e-8)
        assert run["drive_state"].sizes["extra"] == 1


def wedge(alpha: float, mu: float) -> lw.Robot:
    """Return a wedge that slides along x and lifts a follower along y by its slope."""
    light = lw.Body(mass=0.5, inertia=lw.Inertia(zz=1e-3))
    slope = lw.Frame(rotation=(0, 0, np.pi - alpha))
    bearing = slide(mu)
    return lw.Robot(
        lw.Mechanism(
            bodies={"wedge": light, "follower": light},
            joints={
                "in": lw.PrismaticJoint(connects=("ground", "wedge"), axis=(1, 0, 0)),
                "slope": lw.PrismaticJoint(
                    connects=("wedge", "follower"),
                    axis=(1, 0, 0),
                    frames=(slope, slope),
                    bearing=bearing,
                ),
                "out": lw.PrismaticJoint(connects=("ground", "follower"), axis=(0, 1, 0)),
            },
            actuators=("in",),
            gravity=(0, -G, 0),
        )
    )


@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_a_wedge_takes_the_force_of_its_angle_and_that_of_friction_and_locks_itself(mu):
    """P = W tan(alpha +- arctan mu); lowered, the wedge has to be pulled where it locks."""
    alpha, weight = 0.3, 0.5 * G
    robot = wedge(alpha, mu)
    for way in (1, -1):
        state = robot.home.with_rates([way * 0.2])
        (force,) = robot.inverse_dynamics(state, [0.0])
        assert abs(force - weight * np.tan(alpha + way * np.arctan(mu))) < 1e-9
        assert abs(robot.forward_dynamics(state, [force])[0]) < 1e-10
    assert (force < 0) == (np.arctan(mu) > alpha)


def wheel(centre: float, rate: float = SHARP, mu: float = 0.2) -> lw.Robot:
    """Return a disc on a journal, its mass a little or far aside."""
    body = lw.Body(mass=3.0, centre_of_mass=(centre, 0, 0), inertia=lw.Inertia(zz=0.05))
    bearing = lw.JournalBearing(friction=rubs(mu, rate), radius=0.02)
    return lw.Robot(
        lw.Mechanism(
            bodies={"disc": body},
            joints={"hinge": lw.RevoluteJoint(connects=("ground", "disc"), bearing=bearing)},
            gravity=(0, -G, 0),
        )
    )


def test_a_balanced_wheel_on_a_journal_runs_down_in_a_line():
    robot = wheel(0.0)
    run = robot.simulate(robot.home.with_rates([4.0]), duration=1.5, rtol=1e-10, atol=1e-12)
    slowing = 0.2 * 0.02 * 3.0 * G / 0.05
    close(run["joint_rate"].values[:, 0], 4.0 - slowing * run.time, 1e-9)
    close(run["energy_balance"].values, 0 * run.time, 1e-8)


def test_a_pendulum_on_a_journal_swings_down_as_its_own_equation_says():
    """J a = -m g l cos q - mu r N s(w), N the force on the journal, which a is part of."""
    m, arm, J, mu, r, rate = 3.0, 0.3, 0.05 + 3.0 * 0.3**2, 0.2, 0.02, 1e-3

    def acceleration(q: float, w: float) -> float:
        sign = r * w / np.hypot(r * w, rate)

        def gap(a: float) -> float:
            x = -m * arm * (a * np.sin(q) + w * w * np.cos(q))
            y = m * arm * (a * np.cos(q) - w * w * np.sin(q)) + m * G
            return J * a + m * G * arm * np.cos(q) + mu * r * sign * np.hypot(x, y)

        return brentq(gap, -1e3, 1e3, xtol=1e-14, rtol=1e-15)

    robot = wheel(arm, rate, mu)
    run = robot.simulate(
        robot.home, duration=3.0, save_at=np.linspace(0, 3, 7), rtol=1e-10, atol=1e-12
    )
    expected = solve_ivp(
        lambda _, y: [y[1], acceleration(*y)],
        (0, 3),
        [0.0, 0.0],
        "DOP853",
        run.time,
        rtol=1e-11,
        atol=1e-12,
    )
    close(run["joint_position"].values[:, 0], expected.y[0], 1e-8)
    close(run["energy_balance"].values, 0 * run.time, 1e-8)


CRANK, ROD = 0.1, 0.35
MASS = {"crank": 0.8, "rod": 1.1, "piston": 0.6}
TURN = {"crank": 2e-3, "rod": 6e-3}
MU, RADIUS, GUIDE = 0.25, 0.015, 0.2


def slider_crank(rate: float = SHARP) -> lw.Robot:
    """Return a slider-crank with friction by load in every joint."""

    def body(name: str, at: float) -> lw.Body:
        inertia = lw.Inertia(zz=TURN.get(name, 1e-3))
        return lw.Body(mass=MASS[name], centre_of_mass=(at, 0, 0), inertia=inertia)

    pin = lw.JournalBearing(friction=rubs(MU, rate), radius=RADIUS)
    guide = lw.SlidingBearing(friction=rubs(GUIDE, rate))
    tip = {"crank": lw.Frame(position=(CRANK, 0, 0)), "rod": lw.Frame(position=(ROD, 0, 0))}
    return lw.Robot(
        lw.Mechanism(
            bodies={
                "crank": body("crank", 0.04),
                "rod": body("rod", 0.15),
                "piston": body("piston", 0.0),
            },
            joints={
                "main": lw.RevoluteJoint(connects=("ground", "crank"), bearing=pin),
                "pin": lw.RevoluteJoint(
                    connects=("crank", "rod"), frames=(tip["crank"], lw.Frame()), bearing=pin
                ),
                "wrist": lw.RevoluteJoint(
                    connects=("rod", "piston"), frames=(tip["rod"], lw.Frame()), bearing=pin
                ),
                "guide": lw.PrismaticJoint(
                    connects=("ground", "piston"), axis=(1, 0, 0), bearing=guide
                ),
            },
            actuators=("main",),
            gravity=(0, -G, 0),
            reference={"main": 0.7, "guide": 0.4},
        )
    )


def newton_euler(q: float, w: float, torque: float) -> float:
    """Return the crank's acceleration of nine equations for three bodies, solved with the forces
    in the joints and their friction all at once."""
    b = -np.arcsin(CRANK * np.sin(q) / ROD)
    wb = -CRANK * np.cos(q) * w / (ROD * np.cos(b))
    sliding = -CRANK * np.sin(q) * w - ROD * np.sin(b) * wb
    e, n = np.array([np.cos(q), np.sin(q)]), np.array([-np.sin(q), np.cos(q)])
    f, p = np.array([np.cos(b), np.sin(b)]), np.array([-np.sin(b), np.cos(b)])

    def moment(x: np.ndarray, F: np.ndarray) -> float:
        return x[0] * F[1] - x[1] * F[0]

    def gap(unknown: np.ndarray) -> np.ndarray:
        a, ab, x, N = unknown[[0, 1, 2, 9]]
        A, B, C = unknown[3:5], unknown[5:7], unknown[7:9]  # on crank, on rod, on piston
        m1, m2, m3 = (
            -MU * RADIUS * np.hypot(*F) * np.sign(rate)
            for F, rate in ((A, w), (B, wb - w), (C, -wb))
        )
        weight = np.array([0, -G])
        pin = CRANK * (a * n - w * w * e)
        tip = pin + ROD * (ab * p - wb * wb * f)
        own = 0.04 * (a * n - w * w * e), pin + 0.15 * (ab * p - wb * wb * f)
        rubbed = np.array([-GUIDE * abs(N) * np.sign(sliding), N])
        return np.concatenate(
            [
                A - B + MASS["crank"] * (weight - own[0]),
                B - C + MASS["rod"] * (weight - own[1]),
                C + rubbed + MASS["piston"] * (weight - [x, 0]),
                tip - [x, 0],
                [
                    torque
                    + m1
                    - m2
                    - moment(0.04 * e, A)
                    - moment((CRANK - 0.04) * e, B)
                    - TURN["crank"] * a,
                    m2 - m3 - moment(0.15 * f, B) - moment((ROD - 0.15) * f, C) - TURN["rod"] * ab,
                ],
            ]
        )

    found, _, flag, _ = fsolve(gap, np.zeros(10), full_output=True, xtol=1e-14)
    assert flag == 1 or np.abs(gap(found)).max() < 1e-10
    return float(found[0])


def test_a_slider_crank_moves_as_newton_and_euler_say_by_hand():
    robot = slider_crank()
    for q, w, torque in ((0.7, 5.0, 2.0), (2.0, -8.0, 0.5), (4.0, 3.0, -6.0)):
        state = robot.assemble({"main": q}).with_rates([w])
        (found,) = robot.forward_dynamics(state, [torque])
        assert abs(found - newton_euler(q, w, torque)) < 1e-7 * abs(found)
        assert abs(robot.inverse_dynamics(state, [found])[0] - torque) < 1e-9


@pytest.mark.long
def test_runs_keep_their_energy_and_members_run_as_they_do_alone():
    robot = slider_crank(rate=0.1)
    state = robot.home.with_rates([20.0])
    run = robot.simulate(state, duration=0.3, forces=[0.3], rtol=1e-12, atol=1e-13)
    close(run["energy_balance"].values, 0 * run.time, 1e-8)
    assert run["friction_power"].values.min() < -1.0
    starts = robot.assemble({"main": [0.7, 0.8, 0.9]}).with_rates([[20.0], [15.0], [-9.0]])
    asked: Any = {"duration": 0.3, "forces": [0.3], "rtol": 1e-9, "atol": 1e-11}
    asked["save_at"] = [0.1, 0.3]
    together = robot.ensemble(starts, **asked)
    alone = [robot.simulate(starts.at(k), **asked) for k in range(3)]
    ends = [one["joint_rate"].values[-1] for one in alone]
    close(together.dataset["joint_rate"].values[:, -1], ends, 1e-12)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "name", first(3, ["spatial_slider_crank", "rrr3", "puma560", "linear_delta", "andrews"])
)
def test_what_bearings_carry_is_what_the_reactions_say(name):
    """M v' + C v + G - f - S' u = L' phi with phi of the wrenches that all joints balance bodies
    by, in loops in space."""
    described = getattr(lw.robots, name)()
    joints = dict(described.joints)
    for label, joint in joints.items():
        if isinstance(joint, lw.RevoluteJoint):
            bearing = journal(0.3, 0.01)
        elif isinstance(joint, lw.PrismaticJoint):
            bearing = slide(0.1)
        else:
            continue
        joints[label] = joint.model_copy(update={"bearing": bearing})
    robot = lw.Robot(described.model_copy(update={"joints": joints}))
    numbers = np.random.default_rng(0)
    state = robot.home.with_rates(numbers.normal(size=robot.mobility))
    u = 3 * numbers.normal(size=len(robot.actuators))
    v_dot = robot.forward_dynamics(state, u)
    reactions, w = robot.reactions(state, u, frame="second"), robot.rate_map(state) @ state.rates
    phi = np.zeros(len(robot.rates))
    for label, joint in robot.mechanism.joints.items():
        if isinstance(joint, lw.RevoluteJoint | lw.PrismaticJoint) and joint.bearing:
            force, axis = reactions[label][3:], np.array(joint.axis)
            lever = getattr(joint.bearing, "radius", 1.0)
            carried = np.linalg.norm(force - axis * (axis @ force))
            k = robot.rates.index(label)
            phi[k] = -joint.bearing.friction.coefficient * lever * carried * np.sign(w[k])
    needed = robot.mass_matrix(state) @ v_dot + robot.coriolis(state) + robot.gravity(state)
    needed -= robot.passive_forces(state) + robot.actuation(state).T @ u
    friction = robot.rate_map(state).T @ phi
    close(needed, friction, 1e-8 * np.abs(friction).max())


def test_two_bearings_carry_a_moment_as_a_pair_of_forces():
    """Mass at the height h over a slide of the span l: each end has W cos / 2 and the pair of what
    tilts."""
    mu, h, span, m, angle = 0.2, 0.3, 0.5, 2.0, 0.6
    robot = on_incline(angle, slide(mu, span=span), m, h)
    state = robot.home.with_rates([-1.0])
    across = m * G * np.cos(angle)

    def gap(a: float) -> float:
        tilt = h * (m * a + m * G * np.sin(angle))
        ends = abs(across / 2 + tilt / span) + abs(across / 2 - tilt / span)
        return m * a + m * G * np.sin(angle) - mu * ends

    expected = brentq(gap, -50, 50, xtol=1e-14)
    close(robot.forward_dynamics(state, [0.0]), [expected], 1e-9)


def test_friction_that_may_leave_no_motion_is_refused_by_name():
    """2 mu h / l from 1 on: what friction brings to the ends presses them by more friction."""
    held = on_incline(0.3, slide(0.8, span=0.5), 2.0, 0.3)
    assert np.isfinite(held.forward_dynamics(held.home.with_rates([1.0]), [0.0])).all()
    jams = on_incline(0.3, slide(0.9, span=0.5), 2.0, 0.3)
    with pytest.raises(lw.LinkworkError, match=r"bearings of x .* no motion or several"):
        jams.forward_dynamics(jams.home.with_rates([1.0]), [0.0])
    run = jams.simulate(jams.home.with_rates([1.0]), duration=0.1)
    assert run.status is lw.Status.NON_FINITE and "bearings of x" in run.message


def test_a_linear_model_has_the_friction_of_bearings():
    robot = slider_crank()
    state, h = robot.home.with_rates([5.0]), 1e-5
    model = robot.linearise(state, [0.5])
    rise = [robot.forward_dynamics(state.with_rates([5.0 + s * h]), [0.5])[0] for s in (1, -1)]
    assert abs(model.A[1, 1] - (rise[0] - rise[1]) / (2 * h)) < 1e-6 * abs(model.A[1, 1])
    push = [robot.forward_dynamics(state, [0.5 + s * h])[0] for s in (1, -1)]
    assert abs(model.B[1, 0] - (push[0] - push[1]) / (2 * h)) < 1e-6 * abs(model.B[1, 0])


def test_actuators_that_bearings_feel_are_found_with_the_friction_that_they_cause():
    """The wrist is driven and the crank gives the rates: u presses the pins that rub against it."""
    described = slider_crank().mechanism
    robot = lw.Robot(described.model_copy(update={"actuators": ("wrist",)}))
    state = robot.in_chart(robot.home, ("main",)).with_rates([4.0])
    u = robot.inverse_dynamics(state, [3.0])
    close(robot.forward_dynamics(state, u), [3.0], 1e-9)


def test_wrenches_from_outside_press_bearings():
    """A push across a slide adds to what it carries."""
    robot = on_incline(0.0, slide(0.3))
    down = lw.control.Wrench("block", force=(0.0, -40.0, 0.0))
    run = robot.simulate(robot.home.with_rates([3.0]), duration=0.2, wrenches=[down])
    slowing = 0.3 * (G + 20.0)
    close(run["joint_rate"].values[:, 0], 3.0 - slowing * run.time, 1e-6)
    close(run["energy_balance"].values, 0 * run.time, 1e-8)
    found = run.reactions(frame="first")
    along = found.sel(joint="x", component="force_x").values
    close(along, 0 * run.time - 0.3 * (2 * G + 40.0), 1e-6)


def test_a_controller_cancels_what_bearings_take():
    robot = on_incline(0.4, slide(0.3))
    law = lw.control.ComputedTorque({"x": 1.0}, 4.0, 4.0, robot)
    run = robot.simulate(robot.home, duration=0.5, forces=law)
    expected = 1 - (1 + 2 * run.time) * np.exp(-2 * run.time)
    close(run["joint_position"].values[:, 0], expected, 1e-8)


def horizontal() -> lw.Mechanism:
    described = slider_crank().mechanism
    return described.model_copy(update={"gravity": (0.0, 0.0, -G)})


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -G), (0.0, -G, 0.0)])
def test_thrust_that_loops_share_is_refused_in_each_of_their_joints(gravity):
    """Also in that which closes them, which was taken to carry none; upright there is none."""
    described = lw.robots.four_bar()
    for name in described.joints:
        faced = {"bearing": journal(0.2, 0.02, thrust_radius=0.05)}
        joints = described.joints | {name: described.joints[name].model_copy(update=faced)}
        made = described.model_copy(update={"gravity": gravity, "joints": joints})
        if gravity[2]:
            with pytest.raises(lw.LinkworkError, match="leave open what this bearing carries"):
                lw.Robot(made)
        else:
            robot = lw.Robot(made)
            thrust = robot.reactions(robot.home, [0.0], frame="second")[name][5]
            assert abs(thrust) < 1e-9


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: lw.Robot(horizontal()), "leave open what this bearing carries"),
        (lambda: lw.export.c(slider_crank(), ["step"]), "main, pin, wrist"),
        (lambda: lw.export.latex(slider_crank()), "closed forms leave out"),
        (
            lambda: lw.motions.fastest(
                slider_crank(), lw.paths.circle([0, 0], 1), lw.motions.ActuatorLimits(force=1.0)
            ),
            "the law of the least time",
        ),
        (lambda: lw.analysis.base_parameters(slider_crank()), "bearings, which depends on what"),
        (
            lambda: lw.analysis.actuation(slider_crank(), ["main"]).bias(slider_crank().home),
            "a bias without accelerations",
        ),
    ],
)
def test_what_does_not_know_bearings_says_so(call, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        call()


def test_files_keep_bearings_and_mjcf_tells_that_it_leaves_them_out(tmp_path):
    described = slider_crank().mechanism
    described.save(tmp_path / "crank.yml")
    assert lw.Mechanism.load(tmp_path / "crank.yml") == described
    notes = lw.formats.save(described, tmp_path / "crank.xml")
    assert any("main, pin, wrist, guide: the friction of bearings" in note for note in notes)


@pytest.mark.long
def test_runs_through_other_charts_and_free_numbers_have_the_same_friction():
    """Driven at the guide, a run passes the dead points in other charts; the coefficient may be
    free."""
    crank = slider_crank(rate=0.05)
    path = "joints.main.bearing.friction.coefficient"
    at_guide = crank.mechanism.model_copy(update={"actuators": ("guide",)})
    for robot in (lw.Robot(at_guide), crank.free(path)):
        start = robot.in_chart(robot.assemble({"main": 0.7}), ("main",)).with_rates([25.0])
        run = robot.simulate(start, duration=0.5, save_at=[0.5], rtol=1e-10, atol=1e-12)
        other = crank.simulate(start, duration=0.5, save_at=[0.5], rtol=1e-10, atol=1e-12)
        found, expected = (one["joint_position"].values[-1] for one in (run, other))
        assert expected[0] > 2 * np.pi
        close(found, expected, 1e-7)
    freed = crank.free(path)
    state = freed.home.with_rates([5.0])
    smoother = freed.with_parameters({path: 0.0}).forward_dynamics(state, [0.1])[0]
    assert smoother > freed.forward_dynamics(state, [0.1])[0] + 1


@pytest.mark.sample(1)
@pytest.mark.filterwarnings("ignore:redundant rows stay open")
@pytest.mark.parametrize("noise", first(2, [1e-14, 1e-8, 1e-12, 1e-9]))
def test_axes_that_are_parallel_but_for_rounding_leave_nothing_open_that_counts(noise):
    """A linkage whose frames lean and lie aside by rounded numbers is the planar one."""
    described = slider_crank(rate=0.05).mechanism
    numbers, joints = np.random.default_rng(3), {}
    for name, joint in described.joints.items():
        frames = [
            lw.Frame(
                position=np.array(frame.position) + CRANK * noise * numbers.normal(size=3),
                rotation=noise * numbers.normal(size=3),
            )
            for frame in joint.frames
        ]
        joints[name] = joint.model_copy(update={"frames": tuple(frames)})
    solid = {
        name: body.model_copy(update={"inertia": lw.Inertia(xx=0.01, yy=0.01, zz=body.inertia.zz)})
        for name, body in described.bodies.items()
    }
    leaning, plane = (
        lw.Robot(described.model_copy(update={"joints": each, "bodies": solid}))
        for each in (joints, described.joints)
    )
    found, expected = (
        robot.forward_dynamics(robot.home.with_rates([5.0]), [0.3]) for robot in (leaning, plane)
    )
    close(found, expected, 1e3 * noise * abs(expected[0]) + 1e-10)
    with pytest.raises(lw.LinkworkError, match="leave open what this bearing carries"):
        lw.Robot(
            described.model_copy(
                update={"joints": joints, "bodies": solid, "gravity": (0.0, 0.0, -G)}
            )
        )


def arm_of(base: Any = lw.FreeJoint) -> lw.Robot:
    """Return a hinge and a slide on a base, which floats."""
    inertia = lw.Inertia(xx=0.02, yy=0.03, zz=0.04)
    pin = lw.JournalBearing(friction=rubs(0.2, 1e-3), radius=0.03)
    bodies = {
        name: lw.Body(mass=mass, inertia=inertia, centre_of_mass=(aside, 0.0, 0.0))
        for name, mass, aside in (("base", 2.0, 0.02), ("upper", 1.0, 0.2), ("lower", 0.7, 0.3))
    }
    frames = lw.Frame(position=(0.3, 0.1, 0.0)), lw.Frame()
    hip = lw.RevoluteJoint(connects=("base", "upper"), frames=frames, bearing=pin)
    slides = lw.PrismaticJoint(
        connects=("upper", "lower"),
        axis=(1, 0, 0),
        frames=frames,
        bearing=lw.SlidingBearing(friction=rubs(0.2, 1e-3)),
        spring=lw.Spring(stiffness=50.0),
    )
    joints = {"base": base(connects=("ground", "base")), "hip": hip, "slide": slides}
    return lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, gravity=(0.0, -G, 0.0)))


@pytest.mark.long
def test_steps_end_where_what_a_slide_carries_across_its_axis_turns_round():
    """With these kinks within steps the balance is 6e-6 J off."""
    robot = arm_of()
    start = dict.fromkeys(robot.rates, 0.0) | {"base.x": 0.5, "hip": 2.0, "slide": -3.0}
    run = robot.simulate(robot.home.with_rates(start), duration=1.0, rtol=1e-9, atol=1e-11)
    close(run["energy_balance"].values, 0 * run.time, 5e-8)
    told = [*run.coords["event"].values]
    turn = "slide: load across 1 turns round"
    assert told.count(turn) > 2
    assert "slide: load across 2 turns round" not in told  # out of the plane
    at = run.coords["event_time"].values[told.index(turn)]
    ended = robot.simulate(robot.home.with_rates(start), duration=at, rtol=1e-9, atol=1e-11)
    assert abs(robot.reactions(ended.final, [], frame="first")["slide"][4]) < 1e-6


@pytest.mark.long
def test_derivatives_of_runs_over_kinks_of_friction_are_those_of_the_own_side():
    """Steps of the stiff method, which begin at the kink, would be 2 % off, others 1e-6."""
    robot = lw.Robot(arm_of(lw.FixedJoint).mechanism, free=("lower.mass",))
    asked: Any = {"duration": 0.4, "samples": 2}
    state = robot.home.with_rates({"hip": 2.0, "slide": -3.0})
    ends = [
        robot.with_parameters({"lower.mass": 0.7 + h})
        .simulate(state, rtol=1e-12, atol=1e-14, **asked)["joint_position"]
        .values[-1]
        for h in (1e-5, -1e-5)
    ]
    for method in ("sharp_smart", "rodas"):
        run = robot.simulate(state, method=method, rtol=1e-10, atol=1e-12, **asked)
        assert "slide: load across 1 turns round" in run.coords["event"].values
        found = run.sensitivity("joint_position", "parameters")["joint_position"].values[..., 0]
        close(found[-1], (ends[0] - ends[1]) / 2e-5, 1e-8)
        back = run.gradient({"joint_position": np.ones((2, 2))}, "parameters")
        close(np.array([*back.values()]), found.sum(keepdims=True).ravel(), 1e-12)


@pytest.mark.long
def test_derivatives_where_a_bearing_carries_nothing_but_for_friction():
    """The thrust of the hip is that of the knee's friction alone: its size has no slope at the
    first of Newton's steps."""
    law = {"thrust_radius": 0.02}
    bodies = {
        "upper": lw.Body(
            mass=1, centre_of_mass=(0.3, 0, 0.05), inertia=lw.Inertia(xx=0.01, yy=0.03, zz=0.03)
        ),
        "lower": lw.Body(
            mass=0.7, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(xx=0.01, yy=0.02, zz=0.02)
        ),
    }
    joints = {
        "hip": lw.RevoluteJoint(
            connects=("ground", "upper"), axis=(0, 1, 0), bearing=journal(0.2, 0.03, **law)
        ),
        "knee": lw.RevoluteJoint(
            connects=("upper", "lower"),
            frames=(lw.Frame(position=(0.6, 0, 0)), lw.Frame()),
            bearing=journal(0.2, 0.03, **law),
        ),
    }
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints, gravity=(0, 0, -G)))
    state, h = robot.state({"hip": 0.0, "knee": 0.0}, {"hip": 2.0, "knee": -3.0}), 1e-5
    found = robot.forward_dynamics_derivatives(state, []).by_q
    for k, step in enumerate(np.eye(2) * h):
        ahead, behind = (
            robot.forward_dynamics(robot.state(q, state.rates), []) for q in (step, -step)
        )
        close(found[:, k], (ahead - behind) / (2 * h), 1e-6)
    assert robot.simulate(state, duration=0.01, method="rodas").success
