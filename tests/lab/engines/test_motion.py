"""The kinematics that all engines share: poses, twists, what is held, against the oracle's and
against differences."""

from __future__ import annotations

import numpy as np
import pytest

from linkwork.lab.engines.joints import MOTIONS, edge, gaps, held_rows, rate_rows
from linkwork.lab.engines.motion import BodyMotion, along_tree, applied, read_joints
from linkwork.lab.engines.tree import EngineTree, spanning_tree
from linkwork.mechanism import GROUND, Body, Mechanism

from tests.oracle import pairs
from tests.oracle.random_joints import random_coordinates, random_joint, random_pose, random_tree

NAMES = (GROUND, "body")


def lone(
    kind: str, rng: np.random.Generator
) -> tuple[Mechanism, EngineTree, np.ndarray, np.ndarray, np.ndarray]:
    """Return a body on one joint, coordinates, rates and their derivatives; quaternions are of
    length one."""
    poses = {name: random_pose(rng, False) for name in NAMES}
    connects = (NAMES[0], NAMES[1]) if rng.random() < 0.5 else (NAMES[1], NAMES[0])
    joint, _ = random_joint(rng, False, connects, kind, poses)
    mechanism = Mechanism.model_construct(
        name=kind, bodies={"body": Body(mass=1.0)}, joints={"joint": joint}
    )
    rates = rng.normal(size=(2, len(mechanism.rates)))
    return mechanism, spanning_tree(mechanism), random_coordinates(rng, joint), rates[0], rates[1]


def nearby(
    mechanism: Mechanism, q: np.ndarray, w: np.ndarray, dw: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates and rates at the time h, to second order."""
    joint = mechanism.pairs["joint"]
    turn = w * h + dw * h**2 / 2
    if "turn" not in joint.freedoms:
        return q + turn, w + dw * h
    spun = pairs.exponential(turn[-3:]) @ pairs.from_quaternion(q[-4:])
    return np.concatenate([q[:-4] + turn[:-3], pairs.quaternion(spun)]), w + dw * h


@pytest.mark.parametrize("kind", [kind for kind in MOTIONS if kind not in ("fixed", "rod")])
def test_bodies_move_as_the_joints_say(kind):
    """The pose is the oracle's; twists and their derivatives are those of differences; all is read
    back."""
    rng = np.random.default_rng(len(kind))
    for _ in range(4):
        mechanism, tree, q, w, dw = lone(kind, rng)
        h = 1e-4
        states = [nearby(mechanism, q, w, dw, s * h) for s in (-1, 0, 1)]
        positions, rates = map(np.stack, zip(*states, strict=True))
        motion = along_tree(mechanism, tree, positions, rates, np.stack([dw] * 3))
        joint = mechanism.pairs["joint"]
        R, p = pairs.motion(joint, q)
        item = edge("joint", joint)
        turned = np.linalg.inv(item.frames[0]) @ frame_of(joint.frames[0])
        expected = turned @ np.block([[R, p[:, None]], [np.zeros(3), 1.0]]) @ np.linalg.inv(turned)
        np.testing.assert_allclose(motion.across(item)[0][1], expected, atol=1e-12)
        origin = motion.poses[:, 0, :3, 3]
        np.testing.assert_allclose(
            (origin[2] - origin[0]) / (2 * h), motion.twists[1, 0, 3:], atol=1e-6
        )
        np.testing.assert_allclose(
            np.gradient(motion.twists[:, 0], h, axis=0)[1], motion.accelerations[1, 0], atol=1e-6
        )
        spin = pairs.logarithm(motion.poses[2, 0, :3, :3] @ motion.poses[0, 0, :3, :3].T) / (2 * h)
        np.testing.assert_allclose(spin, motion.twists[1, 0, :3], atol=1e-6)
        read = read_joints(mechanism, motion, states[0][0])
        np.testing.assert_allclose(read.positions[1], q, atol=1e-12)
        np.testing.assert_allclose(read.rates[1], w, atol=1e-12)
        np.testing.assert_allclose(read.accelerations[1], dw, atol=1e-11)
        assert max(read.closure_error, read.alignment_error) < 1e-12


def frame_of(frame) -> np.ndarray:
    return np.block(
        [[pairs.exponential(frame.rotation), np.array(frame.position)[:, None]], [np.zeros(3), 1.0]]
    )


@pytest.mark.parametrize("kind", MOTIONS)
def test_gaps_open_by_the_rows(kind):
    """For a small pull in any direction from a closed pose, gaps = H t to first order, and rates =
    F t see none of it."""
    rng = np.random.default_rng(7)
    for _ in range(4):
        placed = {name: random_pose(rng, False) for name in ("first", "second")}
        joint, _ = random_joint(rng, False, ("first", "second"), kind, placed)
        item = edge("joint", joint)
        poses = np.stack(
            [np.block([[R, p[:, None]], [np.zeros(3), 1.0]]) for p, R in placed.values()]
        )
        pose = BodyMotion(tuple(placed), poses, np.zeros((2, 6)), np.zeros((2, 6))).across(item)[0]
        np.testing.assert_allclose(np.concatenate(gaps(item, pose), axis=-1), 0.0, atol=1e-12)
        h, pull = 1e-6, rng.normal(size=6)
        moved = pose.copy()
        moved[:3, :3] = pairs.exponential(h * pull[:3]) @ pose[:3, :3]
        moved[:3, 3] += h * pull[3:]
        opened = np.concatenate(gaps(item, moved), axis=-1) / h
        np.testing.assert_allclose(opened, applied(held_rows(item, pose), pull), atol=1e-5)
        rows = np.concatenate([held_rows(item, pose), rate_rows(item, pose)])
        assert np.linalg.matrix_rank(rows) == len(rows) == (1 if kind == "rod" else 6)


def test_relative_motion_across_joints_differentiates():
    """Along a motion of a tree, between two bodies that no joint connects: no component of it
    vanishes."""
    mechanism = random_tree(3, 8, kinds=("revolute", "universal", "prismatic", "screw"))
    tree, rng = spanning_tree(mechanism), np.random.default_rng(4)
    start, rates, bend = rng.normal(size=(3, len(mechanism.rates)))
    h = 1e-4
    time = h * np.arange(-2, 3)[:, None]
    motion = along_tree(
        mechanism,
        tree,
        start + rates * time + bend * time**2 / 2,
        rates + bend * time,
        bend + 0 * time,
    )
    ends = "body_3", "body_8"
    joint, _ = random_joint(
        rng, False, ends, "free", {name: random_pose(rng, False) for name in ends}
    )
    pose, twist, change = motion.across(edge("joint", joint))
    np.testing.assert_allclose(np.gradient(pose[:, :3, 3], h, axis=0)[2], twist[2, 3:], atol=1e-5)
    np.testing.assert_allclose(np.gradient(twist, h, axis=0)[2], change[2], atol=1e-4)
    assert np.all(abs(change[2]) > 1e-2)
