"""Identification: the number of base parameters, known values recovered from noisy runs, better
motions for it."""

import re

import numpy as np
import pandas as pd
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.analysis import base_parameters, exciting_trajectory, identify, periodic
from linkwork.analysis._base_parameters import independent, random_motions
from linkwork.analysis.identification import tracked
from linkwork.errors import ModelWarning

from tests.analysis.mechanisms import arm, cart
from tests.catalogue import built
from tests.equations.evaluation import close

FRICTION = (
    "hinge_1.friction.viscous",
    "hinge_1.friction.coulomb",
    "hinge_2.friction.viscous",
    "hinge_2.friction.coulomb",
)


def rubbing(**damping):
    """Return the arm with friction in its hinges and bodies of size."""
    described = lw.robots.pendulum((0.5, 0.4), (3.0, 2.0))
    friction = {
        "hinge_1": lw.Friction(viscous=0.8, coulomb=1.5),
        "hinge_2": lw.Friction(viscous=0.4, coulomb=0.6),
    }
    joints = {
        name: joint.model_copy(update={"friction": friction[name]})
        for name, joint in described.joints.items()
    }
    bodies = {
        "rod_1": lw.Body(mass=3.0, centre_of_mass=(0.2, 0.01, 0), inertia=lw.Inertia(zz=0.07)),
        "rod_2": lw.Body(mass=2.0, centre_of_mass=(0.15, -0.02, 0), inertia=lw.Inertia(zz=0.03)),
    }
    changes = {"joints": joints, "bodies": bodies, "reference": {"hinge_1": 0.2, "hinge_2": 0.5}}
    return lw.Robot(described.model_copy(update=changes))


def test_a_planar_arm_under_gravity_has_six_base_parameters():
    """Khalil & Dombre: I_1 + m_2 l^2, m_1 c_1x + m_2 l, m_1 c_1y; I_2, m_2 c_2x, m_2 c_2y."""
    base = base_parameters(arm(1.0, 0.6))
    assert len(base) == 6
    names, row = base.regressor.names, dict(zip(base.names, base.combination, strict=True))
    assert "rod_1.first_moment.x + rod_2.mass" in row
    inertia = row["rod_1.inertia_at_origin.zz + rod_2.mass"]
    assert inertia[names.index("rod_2.mass")] == pytest.approx(1.0)
    assert {
        "rod_1.first_moment.y",
        "rod_2.first_moment.x",
        "rod_2.first_moment.y",
        "rod_2.inertia_at_origin.zz",
    } <= set(row)


def test_six_joints_with_a_spherical_wrist_have_thirty_six():
    """Khalil & Dombre 2002, sec. 9.4: 40 of the Staubli RX-90, of the same build, four of them
    rotors."""
    assert len(base_parameters(built("puma560"))) == 36


@pytest.mark.parametrize("seed", [3, 19])
def test_a_platform_that_only_translates_has_its_mass_alone(seed):
    """Seeds with motions near poses where the loops let it turn."""
    base = base_parameters(built("linear_delta"), seed=seed)
    assert base.names == (*(f"carriage_{k}.mass" for k in (1, 2, 3)), "platform.mass")


def energies(robot, states):
    """Return the energies (N, 10 bodies) that each mass, first moment and moment of inertia of 1
    has, from twists and poses of the bodies."""
    poses, twists, columns = robot.body_poses(states), robot.twists(states), []
    g = np.array(robot.mechanism.gravity)
    for k, (name, body) in enumerate(robot.mechanism.bodies.items()):
        p, R = poses[name]
        omega = twists[:, k, :3]
        v = twists[:, k, 3:] - np.cross(omega, R @ np.array(body.centre_of_mass))
        own = np.einsum("nji,nj->ni", R, omega)
        columns.append(np.sum(v * v, axis=1) / 2 - p @ g)
        columns += [np.sum(v * np.cross(omega, e), axis=1) - e @ g for e in R.transpose(2, 0, 1)]
        columns += [own[:, i] * own[:, j] for i in range(3) for j in range(i, 3)]
    return np.stack(columns, axis=1)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "spread"), [("stewart", 0.05), ("hexaglide", 0.03)])
def test_loops_that_close_near_home_only_have_all_their_base_parameters(name, spread):
    """As many as the energies of motions tell apart: rank of what varies of them (Gautier 1991)."""
    robot = built(name)
    random = np.random.default_rng(4)
    poses = robot.tool_pose(robot.home) + spread * random.uniform(-1, 1, (600, 6))
    states = robot.assemble(tool=poses).with_rates(random.standard_normal((600, robot.mobility)))
    told = energies(robot, states)
    told = told - told.mean(axis=0)
    sizes = np.linalg.norm(told, axis=0)
    told = told[:, sizes > 1e-9 * sizes.max()]
    values = np.linalg.svd(told / np.linalg.norm(told, axis=0), compute_uv=False)
    count = int(np.sum(values > 1e-9 * values[0]))
    assert values[count - 1] > 1e3 * values[count:].max(initial=0.0)
    assert len(base_parameters(robot)) == count


def test_samples_too_few_to_tell_base_parameters_are_refused():
    with pytest.raises(lw.LinkworkError, match="samples is 1: these motions give 2 equations"):
        base_parameters(arm(), samples=1)


def test_base_parameters_have_the_unit_of_the_first_in_each():
    expected = {"mass": "kg", "first_moment": "kg m", "inertia_at_origin": "kg m^2"}
    expected |= {"viscous": "N m s/rad", "coulomb": "N m", "rotor_inertia": "kg m^2"}
    base = base_parameters(built("puma560"), ("joint_2.friction.viscous",))
    for name, unit in zip(base.names, base.units, strict=True):
        first = re.split(r" [+-] ", name)[0].split()[-1]
        (kind,) = [part for part in first.split(".") if part in expected]
        assert unit == expected[kind]
    slides = base_parameters(built("prr3"), ("slide_1.friction.viscous",))
    assert slides.units[slides.names.index("slide_1.friction.viscous")] == "N s/m"


def test_the_link_s_length_is_in_the_combinations():
    names = base_parameters(arm(0.5, 0.6)).names
    assert "rod_1.first_moment.x + 0.5 rod_2.mass" in names
    assert "rod_1.inertia_at_origin.zz + 0.25 rod_2.mass" in names


@pytest.mark.parametrize("name", ["prr3", "five_bar", "four_bar"])
def test_base_parameters_give_the_forces_of_all_motions(name):
    robot, random = built(name), np.random.default_rng(11)
    base = base_parameters(robot)
    state = robot.home.with_rates(random.standard_normal(robot.mobility))
    dv = random.standard_normal(robot.mobility)
    Y, known = base.regressor.with_known(state, dv)
    forces = (
        robot.mass_matrix(state) @ dv
        + robot.coriolis(state)
        + robot.gravity(state)
        - robot.passive_forces(state)
    )
    np.testing.assert_allclose(
        Y[:, base.columns] @ base.described + known,
        forces,
        atol=1e-9 * max(1, np.abs(forces).max()),
    )
    assert len(base) < np.linalg.matrix_rank(base.regressor.described[None]) + len(
        base.regressor.names
    )


def test_masses_and_friction_are_recovered_exactly_from_an_exact_run():
    robot = rubbing()
    time = np.linspace(0, 2, 400)
    push = lw.Sampled(time, np.stack([12 * np.sin(5 * time) + 8, 5 * np.cos(7 * time)], axis=1))
    run = robot.simulate(robot.home, push, duration=2.0, save_at=np.linspace(0.01, 1.99, 150))
    found = identify(robot, run, FRICTION)
    np.testing.assert_allclose(found.values, found.described, rtol=1e-6, atol=1e-7)
    assert found.residual.max() < 1e-7
    assert dict(zip(found.names, found.values, strict=True))[
        "hinge_1.friction.coulomb"
    ] == pytest.approx(1.5)


def test_a_wrong_description_does_not_matter():
    """What is identified is what was measured, not what was described."""
    truth, robot = rubbing(), arm(0.5, 0.4)
    time = np.linspace(0, 2, 400)
    push = lw.Sampled(time, np.stack([12 * np.sin(5 * time) + 8, 5 * np.cos(7 * time)], axis=1))
    run = truth.simulate(truth.home, push, duration=2.0, save_at=np.linspace(0.01, 1.99, 150))
    found, right = identify(robot, run, FRICTION), identify(truth, run, FRICTION)
    np.testing.assert_allclose(found.values, right.described, rtol=1e-6, atol=1e-7)


@pytest.fixture(scope="module")
def excited():
    """Return the 3-PRR with rubbing slides, and an exciting motion of it."""
    described = lw.robots.prr3(gravity=(0.0, -9.81, 0.0))
    friction = lw.Friction(viscous=2.0, coulomb=1.0)
    joints = {
        name: joint.model_copy(update={"friction": friction}) if name.startswith("slide") else joint
        for name, joint in described.joints.items()
    }
    robot = lw.Robot(described.model_copy(update={"joints": joints}))
    ranges = {name: (robot.home[name] - 0.08, robot.home[name] + 0.08) for name in robot.actuators}
    options = {
        "period": 2.0,
        "ranges": ranges,
        "rates": 1.0,
        "accelerations": 10.0,
        "effects": effects(robot),
    }
    return robot, options, exciting_trajectory(robot, trials=60, **options)


def effects(robot):
    return [
        f"{name}.friction.{kind}" for name in robot.actuators for kind in ("viscous", "coulomb")
    ]


@pytest.mark.long
def test_known_parameters_are_recovered_from_noisy_measurements_within_their_deviations(excited):
    """Of nine trials with other noise each, errors over deviations have the mean square 1."""
    robot, _, motion = excited
    random, time = np.random.default_rng(4), np.arange(1000) * 4e-3
    q, v, dv = motion.sample(time)
    exact = periodic(robot, time, q, np.zeros_like(q), period=2.0, harmonics=3)
    forces = robot.inverse_dynamics(exact.states, dv)
    np.testing.assert_allclose(exact.accelerations, dv, atol=1e-8)
    np.testing.assert_allclose(exact.states.rates, v, atol=1e-9)
    squares = []
    for _ in range(9):
        noise = [size * random.standard_normal(q.shape) for size in (1e-6, 0.1)]
        noisy = periodic(robot, time, q + noise[0], forces + noise[1], period=2.0, harmonics=3)
        found = identify(robot, noisy, effects(robot))
        squares.append(np.mean(((found.values - found.described) / found.deviations) ** 2))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.35)
    np.testing.assert_allclose(found.residual, 0.1, rtol=0.1)
    named = dict(zip(found.names, found.values, strict=True))
    assert named["slide_1.friction.viscous"] == pytest.approx(2.0, rel=0.2)
    foretold = found.forces(exact.states, exact.accelerations)
    assert np.abs(foretold - forces).max() < 0.2


def test_excitation_keeps_its_bounds_and_beats_chance(excited):
    robot, options, motion = excited
    q, v, dv = motion.sample(np.linspace(0, 2, 2001))
    lower, upper = np.array([options["ranges"][name] for name in robot.actuators]).T
    assert (q >= lower - 2e-3).all() and (q <= upper + 2e-3).all()
    assert np.abs(v).max() <= 1.02 and np.abs(dv).max() <= 10.4
    assert (
        motion.condition < 0.8 * exciting_trajectory(robot, trials=6, seed=3, **options).condition
    )
    whole = motion.motion(robot, samples=11)
    np.testing.assert_allclose(whole.positions[:, :3], motion.sample(whole.time)[0], atol=1e-9)
    assert np.max(robot.closure_error(whole.state)) < 1e-12


def test_exciting_motions_keep_their_bounds_between_samples():
    """Eight samples in a period of the highest harmonic missed 4 % of them."""
    robot = built("five_bar")
    middle = np.array([robot.home[name] for name in robot.actuators])
    ranges = {name: (at - 0.3, at + 0.3) for name, at in zip(robot.actuators, middle, strict=True)}
    for seed, harmonics in ((0, 1), (0, 3), (1, 5), (5, 2)):
        bounds = {"rates": 1.0, "accelerations": 6.0, "harmonics": harmonics}
        motion = exciting_trajectory(
            robot, period=2.0, ranges=ranges, trials=8, seed=seed, **bounds
        )
        q, v, dv = motion.sample(np.linspace(0, 2, 2001))
        least = np.maximum(np.abs(v), np.abs(dv) / 6).max(axis=0)
        most = np.maximum(np.abs(q - middle).max(axis=0) / 0.3, least)
        assert (most <= 1).all()
        assert (np.maximum(most, np.abs(motion.coefficients[0] - middle) / 0.3) > 0.5).all()


def test_a_motion_that_tells_the_parameters_hardly_apart_is_warned_of():
    """Within 1e-5 rad the arm's weight and its moments about the hinges all press alike."""
    ranges = {"hinge_1": (-1e-5, 1e-5), "hinge_2": (0.49999, 0.50001)}
    bounds = {"rates": 100.0, "accelerations": 1000.0, "harmonics": 1, "trials": 5}
    with pytest.warns(
        lw.errors.ModelWarning, match="hardly tells the base parameters apart"
    ) as told:
        exciting_trajectory(arm(), period=1.0, ranges=ranges, **bounds)
    assert told[0].filename == __file__


def test_rates_of_sampled_motions_are_derivatives():
    motion = lw.analysis.Excitation(("a",), 2.0, np.array([[0.1], [0.2], [0.3], [0.4], [0.5]]), 1.0)
    t, h = np.array([0.3, 0.9]), 1e-5
    for order in (0, 1):
        slope = (motion.sample(t + h)[order] - motion.sample(t - h)[order]) / (2 * h)
        np.testing.assert_allclose(motion.sample(t)[order + 1], slope, rtol=1e-6, atol=1e-8)


def named(count, order=1):
    """Return a table of zeros with a column for each hinge of the arm, in some order."""
    return pd.DataFrame(np.zeros((count, 2)), columns=["hinge_1", "hinge_2"][::order])


def measured_as(accelerations, forces):
    """Return nine samples of the arm at rest."""
    states = arm().state(np.zeros((9, 2)))
    return lw.analysis.Measured(states, accelerations, forces)


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: base_parameters(arm(), ["hinge_1.friction.sticky"]), "there is no effect"),
        (lambda: base_parameters(arm(), "hinge_1"), "a list of names"),
        (lambda: identify(rubbing(), resting(rubbing(), 2)), "measure more samples"),
        (lambda: identify(rubbing(), resting(rubbing(), 50)), "a richer one"),
        (
            lambda: periodic(arm(), [0, 1], [[0, 0]], [[0, 0]], period=1.0, harmonics=1),
            "have the shapes",
        ),
        (
            lambda: periodic(
                arm(), np.arange(3), np.zeros((3, 2)), np.zeros((3, 2)), period=1.0, harmonics=2
            ),
            "harmonics is 2",
        ),
        (
            lambda: periodic(arm(), np.arange(9), named(9, -1), named(9), period=9.0, harmonics=2),
            "the positions come labelled hinge_2, hinge_1; give hinge_1, hinge_2, in this order",
        ),
        (
            lambda: periodic(arm(), np.arange(9), named(9), named(9, -1), period=9.0, harmonics=2),
            "the forces come labelled hinge_2, hinge_1; give",
        ),
        (
            lambda: periodic(
                arm(), np.arange(20) / 4, named(20), named(20), period=1.0, harmonics=2
            ),
            "do not tell 2 harmonics apart; measure at other times",
        ),
        (
            lambda: base_parameters(arm(), 2 * ["hinge_1.friction.coulomb"]),
            "effects names 'hinge_1.friction.coulomb' twice; give it once",
        ),
        (
            lambda: identify(arm(), measured_as(named(9, -1), named(9))),
            "the measured accelerations come labelled hinge_2, hinge_1; give",
        ),
        (
            lambda: identify(arm(), measured_as(named(9), named(9, -1))),
            "the measured forces come labelled hinge_2, hinge_1; give",
        ),
        (lambda: excite({"slide": (0, 1), "x": (0, 1)}), "there is no actuator 'x'"),
        (lambda: excite({}), "lack slide"),
        (lambda: excite({"slide": (1, 0)}), "lower < upper"),
        (lambda: excite({"slide": (0, 1)}, harmonics=0), "whole numbers above zero"),
        (lambda: excite({"slide": (0, 1)}, rates=-1.0), "one positive number per actuator"),
        (lambda: far(), "stays in the workspace"),
    ],
)
def test_refusals(ask, told):
    with pytest.raises(lw.LinkworkError, match=told) as refusal:
        ask()
    assert "\n" not in str(refusal.value)


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "count"), [("delta", 10), ("linear_delta", 4), ("orthoglide", 4)])
def test_a_platform_that_only_shifts_has_no_moments_to_tell(name, count):
    """Each arm has m c_x, m c_y and I about its motor, a slide its mass, and the platform its own.
    Motions on other assembly modes, where the platform turns, had told its moments, too: of a run
    these were rounding over rounding, up to 1e16 kg m^2."""
    robot = built(name)
    assert len(base_parameters(robot)) == count
    held = robot.holding_forces(robot.home)
    run = robot.simulate(robot.home.with_rates([0.3, -0.2, 0.1]), held, duration=0.4, samples=60)
    found = identify(robot, run)
    size = np.abs(found.described).max()
    np.testing.assert_allclose(found.values, found.described, atol=1e-6 * size)


def test_what_is_measured_in_other_rates_or_pushed_from_outside_is_refused():
    """It was taken for the rates of home, and for a motion by the actuators alone."""
    robot = built("five_bar")
    states, dv = random_motions(robot, 20, 4)
    forces = robot.inverse_dynamics(states, dv)
    other = tuple(name for name in robot.rates if name not in robot.actuators)[:2]
    moved = robot.in_chart(states, other)
    places = [robot.rates.index(name) for name in other]
    measured = analysis.Measured(moved, robot.joint_accelerations(states, dv)[:, places], forces)
    push = lw.control.Wrench(robot.bodies[0], force=lambda t, s: (1.0, 0.0, 0.0))
    run = robot.simulate(robot.home, forces[0], duration=0.1, wrenches=[push], samples=20)
    for ask in (identify, analysis.payload):
        with pytest.raises(lw.LinkworkError, match=f"hold the rates of {', '.join(other)}; bring"):
            ask(robot, measured)
        with pytest.raises(lw.LinkworkError, match="wrenches from outside act in the run"):
            ask(robot, run)


def resting(robot, count):
    states = robot.state({"hinge_1": np.full(count, 0.2), "hinge_2": np.full(count, 0.5)})
    return lw.analysis.Measured(states, np.zeros((count, 2)), np.zeros((count, 2)))


def excite(ranges, rates=1.0, **options):
    return exciting_trajectory(
        cart(), period=1.0, ranges=ranges, rates=rates, accelerations=1.0, **options
    )


def far():
    robot = built("five_bar")
    ranges = {"motor_1": (-3.0, 3.0), "motor_2": (3.0, 9.0)}
    return exciting_trajectory(
        robot, period=1.0, ranges=ranges, rates=1e3, accelerations=1e4, trials=5
    )


def test_measured_positions_are_tracked_where_a_kept_row_vanishes():
    """The tool of a Tripteron moves as its slides; a leg's links turn by more than a right angle
    together on the way."""
    robot = built("tripteron")
    slides = np.linspace(0, 1, 15)[:, None] * np.array([-0.16, 0.25, -0.34])
    state = robot.make_state(tracked(robot, slides, robot.home.q), np.zeros((15, 3)))
    assert robot.closure_error(state).max() < 1e-11
    np.testing.assert_allclose(robot.tool_pose(state)[:, :3], slides, atol=1e-10)
    elbows = state.positions[:, [robot.coordinates.index(f"elbow_{k}") for k in (1, 2, 3)]]
    assert (np.cos(elbows) > 0).all()
    assert state.at(-1)["root_2"] + state.at(-1)["elbow_2"] > np.pi / 2


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "count"), [("andrews", 10), ("bricard", 19)])
def test_the_number_of_base_parameters_hangs_on_no_seed_and_no_order(name, count):
    """Of mechanisms of one freedom the last ones are small near the reference: 8 or 9, and 17 to
    19, were told by the seed."""
    described = built(name).mechanism
    bodies = {key: described.bodies[key] for key in reversed(described.bodies)}
    turned = lw.Robot(described.model_copy(update={"bodies": bodies}))
    found = [
        len(base_parameters(each, seed=seed)) for each in (built(name), turned) for seed in (0, 1)
    ]
    assert found == 4 * [count]


def test_small_base_parameters_are_told_and_identified():
    """Andrews' squeezer: K4's mass centre may lie anywhere, which was no base parameter, so that a
    run's forces told masses a hundred of their deviations off."""
    robot = built("andrews")
    run = robot.simulate(robot.home, [0.033], duration=0.03, rtol=1e-10, samples=200)
    found = identify(robot, run)
    assert {"K4.first_moment.x", "K6.first_moment.y"} <= {*found.names}
    assert any(name.startswith("K4.mass - 2500 K4.inertia_at_origin.zz") for name in found.names)
    np.testing.assert_allclose(found.values, found.described, rtol=1e-7, atol=1e-12)


def test_numbers_of_base_parameters_near_rounding_are_told():
    """Singular values that fall to rounding evenly, by the root of ten."""
    random = np.random.default_rng(0)
    U, V = (np.linalg.qr(random.standard_normal((size, 33)))[0] for size in (200, 33))
    columns = U * np.logspace(0, -16, 33) @ V.T
    with pytest.warns(lw.errors.ModelWarning, match="base parameters there are is near rounding"):
        independent(columns / np.linalg.norm(columns, axis=0))


@pytest.mark.parametrize("of", [identify, analysis.payload])
def test_a_wrong_sample_is_told_by_its_number(of):
    """One torque of 100 that is off by 40 times the noise; without it nothing is warned of."""
    robot, random = built("puma560"), np.random.default_rng(3)
    loaded = lw.Robot(robot.mechanism.with_payload(2.0, (0, 0, 0.08)))
    q, v, dv = random.uniform(-2, 2, (3, 100, 6))
    forces = loaded.inverse_dynamics(loaded.state(q, v), 4 * dv)
    forces = forces + 0.1 * random.standard_normal(forces.shape)
    of(robot, analysis.Measured(robot.state(q, v), 4 * dv, forces))
    forces[57, 4] += 4.0
    with pytest.warns(ModelWarning, match=r"sample 57 \(from 0\) does not fit") as told:
        of(robot, analysis.Measured(robot.state(q, v), 4 * dv, forces))
    assert [warned.filename for warned in told] == [__file__]


def test_a_run_is_identified_by_the_lengths_it_had_and_by_none_of_its_masses():
    """The arm's second link begins elsewhere in the run, and is heavier."""
    length, mass = "hinge_2.frames.0.position.0", "rod_2.mass"
    described = lw.Robot("double_pendulum")
    robot, t = described.free(length, mass), np.linspace(0, 3, 301)
    forces = lw.Sampled(t, np.stack([20 * np.sin(3 * t), 7 * np.cos(4 * t)], axis=1))
    given = {length: 0.8, mass: 1.5}
    run = robot.simulate(robot.home, forces, duration=3.0, parameters=given, save_at=t)
    found = identify(robot, run)
    # Both rods' mass centres are 1 m out, where all of the mass is.
    assert found.base.names[0] == "rod_1.first_moment.x + 0.8 rod_2.mass"
    close(found.values, [1 + 0.8 * 1.5, 0, 1 + 0.64 * 1.5, 1.5, 0, 1.5], 1e-9)
    with pytest.raises(lw.LinkworkError, match=r"had hinge_2.*0 = 0.8, which is 1"):
        identify(described, run)
    heavier = robot.simulate(robot.home, forces, duration=3.0, parameters={mass: 1.5}, save_at=t)
    close(identify(described, heavier).values, [2.5, 0, 2.5, 1.5, 0, 1.5], 1e-9)


def test_friction_of_a_run_is_taken_unless_it_is_asked_for():
    friction = "hinge_1.friction.viscous"
    robot, t = lw.Robot("double_pendulum").free(friction), np.linspace(0, 3, 301)
    forces = lw.Sampled(t, np.stack([20 * np.sin(3 * t), 7 * np.cos(4 * t)], axis=1))
    run = robot.simulate(robot.home, forces, duration=3.0, parameters={friction: 0.7}, save_at=t)
    masses = [2, 0, 2, 1, 0, 1]
    close(identify(robot, run).values, masses, 1e-9)
    both = identify(lw.Robot("double_pendulum"), run, [friction])
    assert both.base.names[-1] == friction
    close(both.values, [*masses, 0.7], 1e-9)
