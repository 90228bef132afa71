"""Where all bodies are and how they move when the coordinates and rates of the described joints are
given.

Bodies that only rods reach hang on free joints (`with_free_joints`), whose coordinates x and rates
w nobody gave: Newton's method closes all joints by them,  H_x dx = -gaps,  H_x w = -H_q q',  where
H are the rows that the cut joints hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.lab.engines.interface import EngineError
from linkwork.lab.engines.joints import gaps, held_rows, rods_of, upright
from linkwork.lab.engines.motion import BodyMotion, along_tree, applied
from linkwork.lab.engines.tree import EngineTree
from linkwork.mechanism import Mechanism

CLOSED = 1e-12
STEPS = 50

Guess = Mapping[str, np.ndarray]


def bodies_at(
    mechanism: Mechanism,
    tree: EngineTree,
    positions: np.ndarray,
    rates: np.ndarray,
    hung: Sequence[str],
    guess: Guess,
) -> BodyMotion:
    """Return the bodies' poses and twists at a state.

    Args:
        mechanism, tree: with the free joints of `hung` as its last joints.
        positions, rates: of all joints but these, shapes (nq,) and (nv,).
        hung: the bodies that hang on free joints because only rods reach them.
        guess: approximate poses (4, 4) of such bodies; the ground's frame where left out.

    Raises:
        EngineError: the rods do not reach their ends from the guess.
    """
    x = np.concatenate([positions, *(coordinates_of(guess.get(body, np.eye(4))) for body in hung)])
    w = np.concatenate([rates, np.zeros(6 * len(hung))])
    if not hung:
        return along_tree(mechanism, tree, x, w)
    free = np.arange(len(rates), len(w))
    for _ in range(STEPS):
        gap, rows = closure(mechanism, tree, x)
        if np.max(abs(gap)) < CLOSED * max(1.0, np.max(abs(x))):
            break
        step = -np.linalg.lstsq(rows[:, free], gap, rcond=1e-9)[0]
        x = moved(x, len(positions), step * min(1.0, 0.5 / max(np.max(abs(step)), 0.5)))
    else:
        raise EngineError(
            f"{mechanism.name}: the rods of {', '.join(hung)} miss their ends by "
            f"{np.max(abs(gap)):.3g} m from the guess of its pose; give a nearer one"
        )
    w[free] = -np.linalg.lstsq(rows[:, free], rows[:, : len(rates)] @ rates, rcond=1e-9)[0]
    return along_tree(mechanism, tree, x, w)


def closure(
    mechanism: Mechanism, tree: EngineTree, positions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gaps (h,) of the cut joints and the rows (h, nv) by which all joint rates open
    them."""
    rates = np.eye(len(mechanism.rates))
    motion = along_tree(
        mechanism, tree, np.broadcast_to(positions, (len(rates), len(positions))), rates
    )
    found, rows = [np.zeros(0)], [np.zeros((0, len(rates)))]
    for cut in tree.cuts:
        pose, twists, _ = motion.across(cut)
        found += [part[0] for part in gaps(cut, pose)]
        rows.append(applied(held_rows(cut, pose), twists).T)
    return np.concatenate(found), np.concatenate(rows)


def coordinates_of(pose: np.ndarray) -> np.ndarray:
    """Return the coordinates (7,) of a free joint at a pose."""
    return np.concatenate(
        [pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)]
    )


def moved(x: np.ndarray, first: int, step: np.ndarray) -> np.ndarray:
    """Move the free joints, whose coordinates begin at `first`, by a step (6 each) along their
    rates."""
    x = x.copy()
    for own, part in zip(x[first:].reshape(-1, 7), step.reshape(-1, 6), strict=True):
        own[:3] += part[:3]
        turn = Rotation.from_rotvec(part[3:]) * Rotation.from_quat(own[3:], scalar_first=True)
        own[3:] = turn.as_quat(scalar_first=True)
    return x


def with_link_motion(described: Mechanism, linked: Mechanism, motion: BodyMotion) -> BodyMotion:
    """Add the links that stand for rods: along z from end to end, d = p_2 - p_1, omega = d x d' /
    d^2 (no spin)."""
    poses, twists = list(np.moveaxis(motion.poses, -3, 0)), list(np.moveaxis(motion.twists, -2, 0))
    for rod in rods_of(described).values():
        (start, going, _), (end, coming, _) = (
            motion.frame(body, at(frame.position))
            for body, frame in zip(rod.connects, rod.frames, strict=True)
        )
        d, speed = end[..., :3, 3] - start[..., :3, 3], coming[..., 3:] - going[..., 3:]
        pose = np.array(start)
        pose[..., :3, :3] = upright(d / np.linalg.norm(d, axis=-1, keepdims=True))
        omega = np.cross(d, speed) / np.sum(d * d, axis=-1, keepdims=True)
        poses.append(pose)
        twists.append(np.concatenate([omega, going[..., 3:]], axis=-1))
    stacked = np.stack(poses, axis=-3), np.stack(twists, axis=-2)
    return BodyMotion(tuple(linked.bodies), *stacked, np.zeros_like(stacked[1]))


def at(position: tuple[float, float, float]) -> np.ndarray:
    """Return the pose of a point, without a turn."""
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose
