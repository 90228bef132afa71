"""The same mechanism in other words: mass is kept, names are kept, poses of bodies on rods are
found."""

from __future__ import annotations

import numpy as np
import pytest

from linkwork.lab.engines import EngineError
from linkwork.lab.engines.motion import along_tree
from linkwork.lab.engines.rewrite import (
    dumbbell,
    in_steps,
    lightened,
    moments,
    spare_mass,
    with_free_joints,
    with_links,
)
from linkwork.lab.engines.start import bodies_at, with_link_motion
from linkwork.lab.engines.tree import spanning_tree
from linkwork.mechanism import Body, Inertia, Mechanism, RevoluteJoint, RodJoint
from linkwork.robots import delta

from tests.lab.engines.test_all_joints import case
from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import random_loops, random_tree
from tests.oracle.random_mechanisms import random_body


def test_a_lightened_body_and_its_mass_points_are_the_body():
    rng = np.random.default_rng(1)
    body, points = random_body(rng, planar=False), rng.normal(size=(3, 3))
    mechanism = Mechanism(
        bodies={"body": body}, joints={"hinge": RevoluteJoint(connects=("ground", "body"))}
    )
    mass = spare_mass(mechanism, "body", points)
    rest = lightened(body, mass, points)
    whole = moments(rest) + sum(
        mass * np.outer(x, x) for x in np.column_stack([points, np.ones(3)])
    )
    np.testing.assert_allclose(whole, moments(body), atol=1e-14)
    assert mass > 0 and np.linalg.eigvalsh(moments(rest))[0] > 0
    with pytest.raises(ValueError, match=r"triangle inequality|greater than"):
        lightened(body, 2.1 * mass, points)


def test_a_link_has_its_mass_at_its_ends():
    link = dumbbell(0.7, 0.2, 0.5)
    about_start = link.inertia.tensor()[0, 0] + link.mass * link.centre_of_mass[2] ** 2
    assert link.mass == pytest.approx(0.7)
    assert link.mass * link.centre_of_mass[2] == pytest.approx(0.5 * 0.7)
    assert about_start == pytest.approx(0.5 * 0.7**2)


def test_links_keep_the_energy():
    """The Delta robot with links moves with the energy of the one with rods, whatever its
    motion."""
    mechanism = delta()
    linked = with_links(mechanism)
    assert len(linked.bodies) == len(mechanism.bodies) + 6
    oracle, other = MaximalOracle(mechanism), MaximalOracle(linked)
    poses = oracle.reference_poses()
    twists = oracle.twists(poses, {"motor_1": 1.0, "motor_2": -0.4, "motor_3": 0.3})
    positions, rates = oracle.coordinates(poses), oracle.rates(poses, twists)
    start = along_tree(mechanism, spanning_tree(mechanism), positions, rates)
    motion = with_link_motion(mechanism, linked, start)
    placed = {
        name: (X[:3, 3], X[:3, :3]) for name, X in zip(motion.names, motion.poses, strict=True)
    }
    moving = {
        name: (t[:3], t[3:] + np.cross(t[:3], X[:3, :3] @ linked.bodies[name].centre_of_mass))
        for name, t, X in zip(motion.names, motion.twists, motion.poses, strict=True)
    }
    assert other.constraint_velocity_error(placed, moving) < 1e-12
    assert sum(other.energy(placed, moving)) == pytest.approx(
        sum(oracle.energy(poses, twists)), rel=1e-12
    )


def test_a_body_without_mass_cannot_hold_links():
    hinge, rod = (
        RevoluteJoint(connects=("ground", "bar")),
        RodJoint(connects=("bar", "ground"), length=1.0),
    )
    flat = Body(mass=1.0, inertia=Inertia(xx=0.0, yy=0.0, zz=0.0))
    mechanism = Mechanism(bodies={"bar": flat}, joints={"hinge": hinge, "rod": rod})
    assert with_links(mechanism).bodies["bar"].mass == pytest.approx(
        0.5
    )  # the rod holds the point mass itself
    far = rod.model_copy(
        update={
            "frames": (rod.frames[0].model_copy(update={"position": (0.3, 0, 0)}), rod.frames[1])
        }
    )
    with pytest.raises(EngineError, match=r"bodies\.bar: has no mass around the rods' ends"):
        with_links(mechanism.model_copy(update={"joints": {"hinge": hinge, "rod": far}}))


def test_chains_keep_names_and_order():
    mechanism = random_tree(0, 9, effects=True)
    stepped = in_steps(mechanism, set(mechanism.joints))
    assert stepped.coordinates == mechanism.coordinates and stepped.rates == mechanism.rates
    assert all(len(joint.freedoms) <= 1 for joint in stepped.pairs.values())
    oracle, other = MaximalOracle(mechanism), MaximalOracle(stepped)
    q = dict(zip(mechanism.coordinates, oracle.coordinates(oracle.reference_poses()), strict=True))
    for name in mechanism.bodies:
        np.testing.assert_allclose(other.poses(q)[name][1], oracle.poses(q)[name][1], atol=1e-12)
        np.testing.assert_allclose(other.poses(q)[name][0], oracle.poses(q)[name][0], atol=1e-12)


def platform() -> Mechanism:
    return random_loops(0, 1, platform="bare")


def test_bodies_on_rods_are_found():
    it = case(platform)
    hanging, hung = with_free_joints(it.mechanism)
    assert len(hung) == 1
    name, tree = hung[0], spanning_tree(hanging)
    near = it.poses[name].copy()
    near[:3, 3] += 0.02
    motion = bodies_at(hanging, tree, it.positions, it.rates, hung, {name: near})
    for body, pose in zip(motion.names, motion.poses, strict=True):
        np.testing.assert_allclose(pose, it.poses[body], atol=1e-9)
    with pytest.raises(EngineError, match="miss their ends by"):
        bodies_at(hanging, tree, it.positions + 5.0, it.rates, hung, {name: near})
