"""Problems of the IFToMM benchmark library, run and held against their solutions reduced by hand
and as published."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import bricard, flyball_governor, n_four_bar, pendulum, spatial_slider_crank

from tests.oracle import governor, one_freedom
from tests.oracle.maximal import MaximalOracle
from tests.oracle.published import BRICARD_CORNERS, BRICARD_TURNS, N_FOUR_BAR, SLIDER_CRANK


def positions(run):
    return run.variables["joint_position"].values


def energies(run):
    return run.variables["kinetic_energy"].values + run.variables["potential_energy"].values


def test_A01_pendulum_for_ten_seconds():
    robot = lw.Robot(pendulum())
    times = np.linspace(0, 10, 101)
    run = robot.simulate(robot.home, duration=10.0, rtol=1e-11, atol=1e-12, save_at=times)
    assert run.status is lw.Status.FINISHED
    assert np.allclose(positions(run)[:, 0], one_freedom.pendulum(times), rtol=0, atol=2e-9)


def test_A02_two_four_bars_through_their_singular_poses():
    robot = lw.Robot(n_four_bar(2))
    times = [0.0, *N_FOUR_BAR]
    start = robot.home.with_rates([-1.0])
    options = {"duration": 10.0, "rtol": 1e-10, "atol": 1e-12, "max_steps": 20_000}
    stopped = robot.simulate(start, **options)
    assert stopped.status is lw.Status.SINGULAR
    run = robot.simulate(start, on_singular="step_over", save_at=times, **options)
    assert run.status is lw.Status.FINISHED, run.message
    cranks = positions(run)[:, [robot.coordinates.index(f"pivot_{i}") for i in range(3)]]
    assert np.allclose(cranks, cranks[:, :1], atol=1e-8)
    tips = np.transpose([np.cos(cranks[1:, 0]), np.sin(cranks[1:, 0])])
    assert np.allclose(tips, list(N_FOUR_BAR.values()), rtol=0, atol=1e-6)


@pytest.mark.long
def test_A02_forty_four_bars_through_their_singular_poses():
    robot = lw.Robot(n_four_bar(40))
    times = np.linspace(0, 10, 21)
    run = robot.simulate(
        robot.home.with_rates([-1.0]),
        duration=10.0,
        on_singular="step_over",
        save_at=times,
        max_steps=20_000,
    )
    assert run.status is lw.Status.FINISHED, run.message
    theta, _ = one_freedom.n_four_bar(40).motion(times, np.pi / 2, -1.0)
    cranks = positions(run)[:, [robot.coordinates.index(f"pivot_{i}") for i in range(41)]]
    assert np.allclose(cranks, theta[:, None], rtol=0, atol=1e-4)
    assert np.ptp(energies(run)) < 1e-5 * abs(energies(run)).max()


@pytest.fixture(scope="module")
def bricard_linkage():
    return lw.Robot(bricard())


def bricard_angles(psi):
    """Return the six joint coordinates (times, 6): the angles between neighbouring rods, from right
    angles on."""
    theta, phi = one_freedom.bricard_turns(psi)
    return np.transpose([theta, phi] * 3) - np.pi / 2


def test_A04_bricard_moves_although_gruebler_counts_no_freedom(bricard_linkage):
    assert (bricard_linkage.mobility, bricard_linkage.gruebler, len(bricard_linkage.redundant)) == (
        1,
        0,
        1,
    )


def test_A04_bricard_hangs_where_the_published_models_have_it(bricard_linkage):
    joints = bricard_linkage.mechanism.joints.values()
    assert [joint.frames[0].position for joint in joints] == [
        tuple(map(float, corner)) for corner in BRICARD_CORNERS
    ]
    origins = one_freedom.bricard_rods(one_freedom.RIGHT_ANGLES)[2]
    assert np.allclose(origins, BRICARD_CORNERS, atol=1e-15)


def test_A04_bricard_swings_as_published(bricard_linkage):
    run = bricard_linkage.simulate(bricard_linkage.home, duration=5.0, save_at=list(BRICARD_TURNS))
    origins, orientations = bricard_linkage.body_poses(bricard_linkage.state(positions(run)))[
        "rod_2"
    ]
    corners = origins + orientations @ BRICARD_CORNERS[2]
    assert np.allclose(corners, list(BRICARD_TURNS.values()), rtol=0, atol=0.01)


def test_A04_bricard_for_ten_seconds(bricard_linkage):
    times = np.linspace(0, 10, 51)
    run = bricard_linkage.simulate(
        bricard_linkage.home, duration=10.0, rtol=1e-11, atol=1e-13, save_at=times
    )
    assert run.status is lw.Status.FINISHED, run.message
    psi, _ = one_freedom.bricard().motion(times, one_freedom.RIGHT_ANGLES, 0.0, tolerance=1e-11)
    gap = positions(run) - bricard_angles(psi)
    assert np.allclose(np.sin(gap / 2), 0, atol=1e-7)
    assert np.ptp(energies(run)) < 1e-7
    assert run.closure_error < 1e-12


def test_A05_governor_accelerations():
    robot = lw.Robot(flyball_governor())
    assert (robot.mobility, robot.gruebler, len(robot.redundant)) == (4, 4, 0)
    random = np.random.default_rng(1)
    for _ in range(5):
        q = governor.START + random.uniform(-1, 1, 4) * (1.0, 0.01, 0.1, 0.1)
        rates, torque = random.normal(size=4), random.normal()
        names = ("spindle", "slide", "hinge_1", "hinge_2")
        state = robot.assemble(dict(zip(names, q, strict=True))).with_rates(
            dict(zip(names, rates, strict=True))
        )
        found = robot.joint_accelerations(state, robot.forward_dynamics(state, [torque]))
        found = [found[robot.rates.index(name)] for name in names]
        assert np.allclose(found, governor.accelerations(q, rates, torque), rtol=1e-11, atol=1e-8)


def test_A05_governor_at_its_start():
    """The springs are without tension in the reference, and both stand symmetrically."""
    mechanism = flyball_governor()
    assert [mechanism.reference[name] for name in ("slide", "hinge_1", "hinge_2")] == pytest.approx(
        governor.START[1:]
    )
    assert sum(body.mass for body in mechanism.bodies.values()) == pytest.approx(
        0.3 + 2 * 5.3 + 3.0
    )
    oracle = MaximalOracle(mechanism)
    poses = oracle.reference_poses()
    for spring in mechanism.springs.values():
        places = zip(spring.connects, spring.points, strict=True)
        ends = [poses[body][0] + poses[body][1] @ point for body, point in places]
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.5, abs=1e-15)


def test_A05_governor_over_its_first_moments():
    """Explicit steps have to follow the springs' fast decay, so only 0.02 s."""
    robot = lw.Robot(flyball_governor())
    start = robot.home.with_rates(
        {"spindle": 2 * np.pi, "slide": 0.0, "hinge_1": 0.0, "hinge_2": 0.0}
    )
    times = np.array([0.0, 0.005, 0.02])
    run = robot.simulate(start, duration=0.02, rtol=1e-10, atol=1e-12, save_at=times)
    expected = governor.motion(times)
    order = [robot.coordinates.index(name) for name in ("spindle", "slide", "hinge_1", "hinge_2")]
    assert np.allclose(positions(run)[:, order], expected[:4].T, rtol=0, atol=1e-10)


@pytest.fixture(scope="module")
def slider_crank_3d():
    return lw.Robot(spatial_slider_crank())


def test_spatial_slider_crank_closes_at_the_reference():
    q = spatial_slider_crank().reference
    c1, c2 = q["cross.angle_1"], q["cross.angle_2"]
    rod = 0.3 * np.array([np.cos(c2), np.sin(c1) * np.sin(c2), -np.cos(c1) * np.sin(c2)])
    assert np.allclose([q["slide"], 0, 0], np.array([0, 0.1, 0.12 + 0.08]) + rod, atol=1e-16)
    assert q["slide"] == pytest.approx(0.2, abs=1e-15)
    assert np.hypot.reduce([q[f"ball.q{part}"] for part in "wxyz"]) == pytest.approx(1, abs=1e-15)


def test_spatial_slider_crank_in_closed_form(slider_crank_3d):
    robot, reduced = slider_crank_3d, one_freedom.spatial_slider_crank()
    assert (robot.mobility, robot.gruebler, len(robot.redundant), len(robot.idle)) == (1, 1, 0, 0)
    for t, rate, torque in np.random.default_rng(2).normal(scale=2, size=(10, 3)):
        state = robot.assemble({"crank": t}).with_rates([rate])
        assert state["slide"] == pytest.approx(one_freedom.slide(t), abs=1e-12)
        found = robot.forward_dynamics(state, [torque])
        assert np.allclose(found, reduced.acceleration(t, rate, torque), rtol=1e-10, atol=1e-9)


def test_spatial_slider_crank_for_five_seconds(slider_crank_3d):
    times = np.array([0.0, *SLIDER_CRANK])
    start = slider_crank_3d.home.with_rates([6.0])
    run = slider_crank_3d.simulate(start, duration=5.0, rtol=1e-10, atol=1e-12, save_at=times)
    theta, _ = one_freedom.spatial_slider_crank().motion(times, 0.0, 6.0)
    places = positions(run)[:, slider_crank_3d.coordinates.index("slide")]
    assert np.allclose(positions(run)[:, 0], theta, rtol=0, atol=1e-6)
    assert np.allclose(places, one_freedom.slide(theta), rtol=0, atol=1e-7)
    assert np.allclose(places[1:], list(SLIDER_CRANK.values()), rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("describe", "sentence"),
    [
        (
            lambda: flyball_governor(rest_length=0.4),
            "springs of 0.4 m do not reach the slider; rest_length must exceed 0.433",
        ),
        (lambda: flyball_governor(section=0.0), "section: is 0.0; give a size above zero"),
        (lambda: flyball_governor(ball_mass=-5.0), "ball_mass: is -5.0; give zero or more"),
        (
            lambda: spatial_slider_crank(rod=0.2),
            "the rod of 0.2 m does not reach the slider's axis; rod must exceed 0.223",
        ),
        (lambda: spatial_slider_crank(crank=float("inf")), "crank: is inf; give a size above zero"),
    ],
)
def test_what_cannot_be_built_is_refused_in_one_sentence(describe, sentence):
    with pytest.raises(lw.MechanismError, match=sentence) as refusal:
        describe()
    assert "\n" not in str(refusal.value)
