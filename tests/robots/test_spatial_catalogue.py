"""The spatial robots as described: closed references, mobility, and dynamics against the multiplier
formulation."""

from functools import lru_cache

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import (
    agile_wrist,
    bennett,
    delta,
    hexaglide,
    linear_delta,
    orthoglide,
    par4,
    rrs3,
    stewart,
    tripteron,
)

from tests.oracle.maximal import MaximalOracle

BUILD = {
    "delta": delta,
    "delta, heavy rods": lambda: delta(rod_mass=0.2),
    "delta, idle rods": lambda: delta(rod_mass=0.2, idle_spins=True),
    "linear delta": linear_delta,
    "linear delta, heavy rods": lambda: linear_delta(rod_mass=0.1),
    "orthoglide": orthoglide,
    "orthoglide, heavy rods": lambda: orthoglide(rod_mass=0.1),
    "stewart": stewart,
    "hexaglide": hexaglide,
    "hexaglide, massless rods": lambda: hexaglide(rod_mass=0.0),
    "hexaglide, idle rods": lambda: hexaglide(idle_spins=True),
    "agile wrist": agile_wrist,
    "tripteron": tripteron,
    "3-rrs": rrs3,
    "par4": par4,
    "par4, heavy rods": lambda: par4(rod_mass=0.1),
    "bennett": bennett,
}
# mobility, Gruebler's formula, redundant rows. The Agile Wrist's frames all lie in its centre, so
# that its six redundant rows are identically zero and none is left to be found.
COUNTS = {
    "delta": (3, 3, 0),
    "delta, heavy rods": (3, 3, 0),
    "delta, idle rods": (9, 9, 0),
    "linear delta": (3, 3, 0),
    "linear delta, heavy rods": (3, 3, 0),
    "orthoglide": (3, 3, 0),
    "orthoglide, heavy rods": (3, 3, 0),
    "stewart": (6, 6, 0),
    "hexaglide": (6, 6, 0),
    "hexaglide, massless rods": (6, 6, 0),
    "hexaglide, idle rods": (12, 12, 0),
    "agile wrist": (3, -3, 0),
    "tripteron": (3, 0, 3),
    "3-rrs": (3, 3, 0),
    "par4": (4, 0, 4),
    "par4, heavy rods": (4, 0, 4),
    "bennett": (1, -2, 3),
}
# Described by the same functions as others here, whose dynamics are compared.
SAME_KIND = (
    "delta, heavy rods",
    "linear delta, heavy rods",
    "orthoglide, heavy rods",
    "hexaglide, idle rods",
    "par4, heavy rods",
)
every = pytest.mark.parametrize("name", BUILD)


@lru_cache
def robot_of(name: str) -> lw.Robot:
    return lw.Robot(BUILD[name]())


@every
def test_reference_closes_all_loops_as_written(name):
    """Bodies placed by the reference's numbers: no joint is open, and every joint shows the
    coordinate that it names."""
    mechanism = BUILD[name]()
    oracle = MaximalOracle(mechanism)
    poses = oracle.poses(mechanism.reference)
    for joint, gap in oracle.residuals(poses).items():
        assert np.max(abs(gap), initial=0) < 1e-14, joint
    shown = dict(zip(mechanism.coordinates, oracle.coordinates(poses), strict=True))
    for label, value in mechanism.reference.items():
        assert shown[label] == pytest.approx(value, abs=1e-14), label


@pytest.mark.sample(10)
@every
def test_mobility_rows_and_idle_freedoms(name):
    robot = robot_of(name)
    assert (robot.mobility, robot.gruebler, len(robot.redundant)) == COUNTS[name]
    oracle = MaximalOracle(robot.mechanism)
    assert oracle.mobility(oracle.reference_poses()) == robot.mobility
    idle = [body for body in robot.bodies if body.startswith("rod_")] if "idle" in name else []
    assert [text.partition(":")[0] for text in robot.idle] == idle


@pytest.mark.sample(6)
@pytest.mark.parametrize("name", [name for name in BUILD if name not in SAME_KIND])
def test_accelerations_of_random_motions(name):
    """Newton's and Euler's equations of all bodies with multipliers, at a random pose near the
    reference."""
    robot, random = robot_of(name), np.random.default_rng(7)
    start = {label: robot.home[label] for label in robot.actuators}
    size = 0.02 * max(1.0, *start.values())
    state = robot.assemble(
        {label: value + size * random.uniform(-1, 1) for label, value in start.items()}
    )
    state = state.with_rates(random.uniform(-1, 1, robot.mobility))
    forces = 10 * random.uniform(-1, 1, len(robot.actuators))
    found = robot.forward_dynamics(state, forces)
    oracle = MaximalOracle(robot.mechanism)
    poses = robot.body_poses(state)
    by_body = robot.twists(state).reshape(-1, 6)
    twists = {body: (t[:3], t[3:]) for body, t in zip(robot.bodies, by_body, strict=True)}
    expected = oracle.joint_accelerations(
        poses, twists, oracle.accelerations(poses, twists, forces)
    )
    scale = max(1.0, abs(expected).max())
    assert abs(robot.joint_accelerations(state, found) - expected).max() < 1e-9 * scale


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: delta(arm=0.0), "arm: is 0.0; give a size above zero"),
        (lambda: delta(height=0.0), "height: is 0.0"),
        (lambda: delta(rod=0.3), r"arms of 0.524 m and rods of 0.3 m do not reach"),
        (lambda: delta(rod_mass=-1.0), "rod_mass: is -1.0; give zero or more"),
        (lambda: linear_delta(platform_radius=0.3), "differ by 0 m"),
        (lambda: linear_delta(rod=0.2), "differ by 0.25 m"),
        (lambda: orthoglide(spread=float("nan")), "spread: is nan"),
        (lambda: stewart(base_points=((0.0, 0.0, 0.0),) * 5), "base_points: give six points"),
        (lambda: stewart(platform_points="legs"), "platform_points: give six points"),
        (
            lambda: stewart(tube_radii=(0.05, 0.03)),
            "tube_radii: the inner radius 0.05 m is not below",
        ),
        (
            lambda: stewart(((0, 0, 0),) * 6, ((0, 0, 0),) * 6, lw.Frame()),
            "leg 1 has no length at home",
        ),
        (lambda: hexaglide(rod=0.4), "rod 1 of 0.4 m does not reach its rail at home"),
        (lambda: hexaglide(sides=(1, 1, -1, 1, 1, 0)), "sides: .* is not made of 1"),
        (lambda: hexaglide(rails=(0.5, 0.1)), "rails: give six values, not 2"),
        (lambda: agile_wrist(distal_radius=-0.1), "distal_radius: is -0.1"),
        (lambda: tripteron(proximal=0.0), "proximal: is 0.0"),
        (lambda: rrs3(proximal=-0.1), "proximal: is -0.1; give a size above zero"),
        (lambda: rrs3(height=0.4), r"legs of 0.15 m and 0.2 m do not reach a platform 0.4 m above"),
        (lambda: rrs3(motor_inertia=-1.0), "motor_inertia: is -1.0; give zero or more"),
        (lambda: par4(bar=0.0), "bar: is 0.0; give a size above zero"),
        (lambda: par4(rod=0.2), r"arms of 0.35 m and rods of 0.2 m do not reach"),
        (lambda: par4(half_mass=-1.0), "half_mass: is -1.0; give zero or more"),
        (lambda: bennett(length_2=0.7), "length_2 must not exceed 0.6 m"),
        (lambda: bennett(length_2=0.3), "only fold"),
        (lambda: bennett(twist_1=4.0), "twist_1: is 4.0; give an angle between 0 and pi"),
        (lambda: bennett(crank=float("inf")), "crank: is inf"),
    ],
)
def test_refusals(build, sentence):
    with pytest.raises(lw.MechanismError, match=sentence):
        build()
