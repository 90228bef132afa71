"""The oracle of all joint types on random mechanisms: finite differences, energy, momentum, balance
of forces."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from linkwork.mechanism import FreeJoint, GearJoint, PointSpring, RevoluteJoint

from tests.oracle import OracleError, pairs
from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import (
    built,
    random_loops,
    random_motion,
    random_pose,
    random_tree,
    tilted,
)
from tests.oracle.test_pairs import CLOSING, close

RANDOM = {
    "tree": partial(random_tree, 0, 9),
    "tree, effects, gear": partial(random_tree, 1, 9, effects=True, gears=1),
    "planar tree": partial(random_tree, 2, planar=True, effects=True, gears=1),
    "loop": partial(random_loops, 0, 1),
    "loops, effects": partial(random_loops, 1, 2, effects=True),
    "loops, all": partial(random_loops, 2, 2, effects=True, rods=1, gears=1, freedoms=2),
    "platform": partial(random_loops, 3, 1, effects=True, platform="free"),
    "bare platform": partial(random_loops, 4, 1, platform="bare"),
    "planar loops": partial(random_loops, 5, 2, planar=True, effects=True, rods=1, gears=1),
    "spinning rod": partial(
        random_loops, 6, 1, kinds=("spherical", "spherical", "universal"), effects=True
    ),
}


@cache
def moving(name: str):
    """Return a random mechanism's oracle, poses and twists near the reference, and actuator
    forces."""
    mechanism, rng = RANDOM[name](), np.random.default_rng(20)
    oracle = MaximalOracle(mechanism)
    return oracle, *random_motion(oracle, rng), rng.normal(size=len(mechanism.actuators))


@pytest.fixture(params=RANDOM)
def case(request):
    return moving(request.param)


def along(oracle, poses, twists, rates, h):
    """Return poses and twists after h, to second order, with the bodies' accelerations `rates`."""
    t, t_dot = (
        np.concatenate([part for b in oracle.mechanism.bodies for part in s[b]])
        for s in (twists, rates)
    )
    return oracle.moved(poses, h * t + h**2 / 2 * t_dot), oracle.by_body(t + h * t_dot)


def central(function, oracle, poses, twists, rates, h=1e-4):
    """Return the derivative of function(poses, twists) along the motion, with an error of order
    h^4."""
    values = {
        k: np.asarray(function(*along(oracle, poses, twists, rates, k * h))) for k in (-2, -1, 1, 2)
    }
    return (8 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12 * h)


@pytest.mark.sample(5)
def test_rates_and_rows_are_derivatives_on_any_motion(case):
    """b and a, which the motion's own formulas give, are what finite differences of F t and A t
    leave over."""
    oracle, poses, _, _ = case
    rng, size = np.random.default_rng(21), 6 * len(oracle.mechanism.bodies)
    twists, rates = (oracle.by_body(rng.normal(size=size)) for _ in range(2))
    rows = oracle.rows(poses, twists)
    stacked = np.concatenate([part for pair in rates.values() for part in pair])
    # poses are only followed to second order, and their twists to first: exact for the first
    # derivative at 0
    found = central(oracle.rates, oracle, poses, twists, rates)
    close(oracle.joint_accelerations(poses, twists, rates), found, 1e-9)
    found = central(
        lambda p, t: oracle.rows(p, t).A @ np.concatenate([*sum(t.values(), ())]),
        oracle,
        poses,
        twists,
        rates,
    )
    close(rows.A @ stacked + rows.a, found, 1e-9)


def test_coordinates_and_residuals_change_as_the_rows_say(case):
    """On any motion from a closed pose: q' = F t (quaternions: (0, w) q / 2) and residual' = A
    t."""
    oracle, poses, _, _ = case
    mechanism = oracle.mechanism
    twists = oracle.by_body(np.random.default_rng(22).normal(size=6 * len(mechanism.bodies)))
    rest = oracle.by_body(np.zeros(6 * len(mechanism.bodies)))
    w = dict(zip(mechanism.rates, oracle.rates(poses, twists), strict=True))
    q = dict(zip(mechanism.coordinates, oracle.coordinates(poses), strict=True))
    expected = []
    for name, joint in mechanism.pairs.items():
        expected += [w[label] for label in joint.coordinates(name) if label in w]
        if "turn" in joint.freedoms:
            s, *v = (q[f"{name}.{part}"] for part in ("qw", "qx", "qy", "qz"))
            omega = np.array([w[f"{name}.{part}"] for part in ("wx", "wy", "wz")])
            expected += [-(omega @ v) / 2, *(s * omega + np.cross(omega, v)) / 2]
    close(central(lambda p, _: oracle.coordinates(p), oracle, poses, twists, rest), expected, 1e-9)
    rows, t = (
        oracle.rows(poses, twists),
        np.concatenate([part for pair in twists.values() for part in pair]),
    )
    found = central(
        lambda p, _: np.concatenate([*oracle.residuals(p).values()]), oracle, poses, twists, rest
    )
    order = np.concatenate([np.flatnonzero(rows.owner == name) for name in mechanism.joints])
    close(found, (rows.A @ t)[order], 1e-9)


def test_energy_changes_by_power(case):
    oracle, poses, twists, forces = case
    rates = oracle.accelerations(poses, twists, forces)
    found = central(lambda p, t: sum(oracle.energy(p, t)), oracle, poses, twists, rates)
    close(found, oracle.power(poses, twists, forces), 1e-9)


def test_forces_come_back_from_accelerations(case):
    oracle, poses, twists, forces = case
    wanted = oracle.accelerations(poses, twists, forces)
    close(oracle.inverse_dynamics(poses, twists, wanted), forces, 1e-9)
    rates = dict(
        zip(oracle.mechanism.rates, oracle.joint_accelerations(poses, twists, wanted), strict=True)
    )
    again = oracle.accelerations_of(
        poses, twists, {name: rates[name] for name in oracle.mechanism.actuators}
    )
    for name, pair in wanted.items():
        close(np.concatenate(again[name]), np.concatenate(pair), 1e-9)


def test_reactions_balance_every_body():
    """m a and I alpha + omega x I omega are the weight, the drives and the reactions, each about
    the mass centre."""
    mechanism = random_loops(8, 2, rods=1, freedoms=2)
    mechanism = mechanism.model_copy(
        update={"actuators": tuple(name for name in mechanism.rates if name.startswith("revolute"))}
    )
    oracle, rng = MaximalOracle(mechanism), np.random.default_rng(8)
    poses, twists = random_motion(oracle, rng)
    forces = rng.normal(size=len(mechanism.actuators))
    found, reactions = (
        oracle.accelerations(poses, twists, forces),
        oracle.reactions(poses, twists, forces),
    )
    ground = (np.zeros(3), np.eye(3))
    for name, data in mechanism.bodies.items():
        (p, R), (omega, _), (alpha, a) = poses[name], twists[name], found[name]
        c, I = p + R @ data.centre_of_mass, R @ data.inertia.tensor() @ R.T  # noqa: E741
        moment, force = np.zeros(3), data.mass * np.array(mechanism.gravity)
        for joint_name, joint in mechanism.pairs.items():
            if name in joint.connects:
                p_1, R_1 = poses.get(joint.connects[0], ground)
                sign, o = (
                    1 if joint.connects[1] == name else -1,
                    p_1 + R_1 @ joint.frames[0].position,
                )
                M, f = reactions[joint_name][:3].copy(), reactions[joint_name][3:]
                if isinstance(joint, RevoluteJoint):
                    M += forces[mechanism.actuators.index(joint_name)] * (
                        R_1 @ pairs.exponential(joint.frames[0].rotation) @ joint.axis
                    )
                moment, force = moment + sign * (M + np.cross(o - c, f)), force + sign * f
        close(force, data.mass * a, 1e-11)
        close(moment, I @ alpha + np.cross(omega, I @ omega), 1e-11)


def test_floating_mechanism_keeps_its_momentum():
    """Nothing inside - drives, springs, friction, rotors, gears - changes the momenta of a
    mechanism without support."""
    kinds = ["free", *(kind for kind in CLOSING if kind != "free")]
    names = ["ground", *(f"body_{i}" for i in range(1, len(kinds) + 1))]
    mechanism = built(
        "floating",
        zip(names, names[1:], kinds, strict=False),
        np.random.default_rng(31),
        False,
        True,
        0,
        0,
    )
    root = next(name for name, joint in mechanism.joints.items() if isinstance(joint, FreeJoint))
    quiet = FreeJoint(
        **{field: getattr(mechanism.joints[root], field) for field in ("connects", "frames")}
    )
    angles = [
        name
        for name in mechanism.coordinates
        if name.startswith(("revolute", "screw", "universal"))
    ]
    gear = GearJoint(ratios=dict(zip(angles, (1.0, -0.5, 2.0), strict=False)))
    spring = PointSpring(
        connects=("body_2", "body_6"), points=((0, 1, 0), (1, 0, 0)), stiffness=20, damping=3
    )
    mechanism = mechanism.model_copy(
        update={
            "gravity": (0, 0, 0),
            "joints": {**mechanism.joints, root: quiet, "gear": gear},
            "springs": {"spring": spring},
            "actuators": tuple(name for name in mechanism.actuators if not name.startswith(root)),
        }
    )
    oracle, rng = MaximalOracle(mechanism), np.random.default_rng(32)
    poses, twists = random_motion(oracle, rng, start=oracle.reference_poses())
    found = oracle.accelerations(poses, twists, 10 * rng.normal(size=len(mechanism.actuators)))
    linear, angular, largest = np.zeros(3), np.zeros(3), 0.0
    for name, data in mechanism.bodies.items():
        (p, R), (omega, _), (alpha, a) = poses[name], twists[name], found[name]
        I = R @ data.inertia.tensor() @ R.T  # noqa: E741
        linear += data.mass * a
        angular += (
            np.cross(p + R @ data.centre_of_mass, data.mass * a)
            + I @ alpha
            + np.cross(omega, I @ omega)
        )
        largest = max(largest, np.linalg.norm(data.mass * a))
    assert (
        largest > 1 and max(abs(linear)) < 1e-11 * largest and max(abs(angular)) < 1e-11 * largest
    )


@pytest.mark.parametrize("planar", [True, False])
def test_moving_everything_changes_nothing(planar):
    mechanism = random_loops(9, 2, planar=planar, effects=True)
    moved, (p_0, R_0) = tilted(mechanism, 3), random_pose(np.random.default_rng(3), False)
    oracle, rng = MaximalOracle(mechanism), np.random.default_rng(9)
    poses, twists = random_motion(oracle, rng)
    forces = rng.normal(size=len(mechanism.actuators))
    wanted = oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, forces))
    oracle = MaximalOracle(moved)
    poses = {name: (p_0 + R_0 @ p, R_0 @ R) for name, (p, R) in poses.items()}
    twists = {name: (R_0 @ omega, R_0 @ v) for name, (omega, v) in twists.items()}
    close(
        oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, forces)),
        wanted,
        1e-9,
    )


@pytest.mark.parametrize("actuation", [-1, 1])
def test_other_numbers_of_actuators(actuation):
    """Least forces of too many actuators do the same; too few cannot do everything."""
    mechanism = random_loops(10, 1, freedoms=2, effects=True, actuation=actuation)
    oracle, rng = MaximalOracle(mechanism), np.random.default_rng(10)
    poses, twists = random_motion(oracle, rng)
    assert len(mechanism.actuators) == oracle.mobility(poses) + actuation
    forces = rng.normal(size=len(mechanism.actuators))
    wanted = oracle.accelerations(poses, twists, forces)
    least = oracle.inverse_dynamics(poses, twists, wanted)
    if actuation > 0:
        assert np.linalg.norm(least) < np.linalg.norm(forces) - 1e-3
    else:
        close(least, forces, 1e-10)
        still = oracle.accelerations_of(
            poses, twists, dict.fromkeys(oracle.independent_rates(poses), 0.0)
        )
        with pytest.raises(OracleError, match="cannot bring this about"):
            oracle.inverse_dynamics(poses, twists, still)
    again = oracle.accelerations(poses, twists, least)
    for name, pair in wanted.items():
        close(np.concatenate(again[name]), np.concatenate(pair), 1e-10)
