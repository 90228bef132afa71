"""Random mechanisms of all joint types close, move as ordered and come out the same every time."""

from __future__ import annotations

import pytest

from linkwork.mechanism import Mechanism

from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import TREE, random_loops, random_tree
from tests.oracle.test_maximal_identities import RANDOM
from tests.oracle.test_pairs import close


@pytest.mark.parametrize("name", RANDOM)
def test_random_mechanisms_are_closed_and_repeatable(name):
    mechanism = RANDOM[name]()
    oracle = MaximalOracle(mechanism)
    poses = oracle.reference_poses()
    assert Mechanism(**mechanism.model_dump()) == mechanism == RANDOM[name]()
    if name != "bare platform":  # its pose is no coordinate
        close(
            oracle.coordinates(poses),
            [mechanism.reference[label] for label in mechanism.coordinates],
            1e-12,
        )
    assert len(mechanism.actuators) == oracle.mobility(poses)
    assert any(joint.connects[0] > joint.connects[1] for joint in mechanism.pairs.values())


@pytest.mark.sample(20)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("options", "mobility"),
    [
        ({}, 2),
        ({"loops": 1, "freedoms": 3}, 4),
        ({"rods": 2, "gears": 1}, 2),
        ({"platform": "free"}, 2),
        ({"planar": True, "loops": 3, "freedoms": 2}, 3),
        ({"planar": True, "rods": 1, "gears": 1}, 2),
    ],
)
def test_mobility_is_what_was_ordered(seed, options, mobility):
    mechanism = random_loops(seed, **options)
    oracle = MaximalOracle(mechanism)
    assert oracle.mobility(oracle.reference_poses()) == mobility == len(mechanism.actuators)


def test_trees_have_every_type_and_every_freedom():
    mechanism = random_tree(0, len(TREE[False]))
    assert {joint.type for joint in mechanism.joints.values()} == set(TREE[False])
    assert sorted(mechanism.actuators) == sorted(mechanism.rates)
    assert random_tree(0, 3, kinds=("screw",)).rates == ("screw_1", "screw_2", "screw_3")
