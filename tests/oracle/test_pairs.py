"""The joint types' residuals, coordinates and rows against their own motions."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracle import pairs
from tests.oracle.random_joints import TYPES, random_coordinates, random_form, random_pose

CLOSING = sorted(set(TYPES) - {"rod"})


def close(actual, expected, tolerance: float) -> None:
    actual, expected = np.asarray(actual, dtype=float), np.asarray(expected, dtype=float)
    assert actual.shape == expected.shape
    assert np.max(abs(actual - expected), initial=0) <= tolerance * (
        1 + np.max(abs(expected), initial=0)
    )


@pytest.mark.parametrize("kind", CLOSING)
def test_residuals_vanish_on_the_joints_own_motion_alone(kind):
    rng = np.random.default_rng(11)
    for _ in range(10):
        joint = TYPES[kind](connects=("ground", "b"), **random_form(rng, False, kind))
        q = random_coordinates(rng, joint) * (1 if "turn" in joint.freedoms else 6)
        R, p = pairs.motion(joint, q)
        near = [float(value) + 0.5 for value in q]
        close(pairs.coordinates(joint, R, p, near), q, 1e-13)
        assert np.max(abs(pairs.residual(joint, R, p)), initial=0) < 1e-13
        off, away = random_pose(rng, False, 0.1, 0.1)[::-1]
        residual = pairs.residual(joint, R @ off, p + away)
        assert np.all(abs(residual) > 1e-9) and np.max(abs(residual), initial=0) < 1


@pytest.mark.parametrize("kind", CLOSING)
def test_rows_split_the_twist_into_rates_and_constraints(kind):
    """Of the joint's own motion q(t): F s = w, A s = 0; together the rows take all six
    components."""
    rng, h = np.random.default_rng(12), 1e-5
    for _ in range(5):
        joint = TYPES[kind](connects=("ground", "b"), **random_form(rng, False, kind))
        q = random_coordinates(rng, joint)
        w = rng.normal(size=len(joint.rates("j")))
        (R_a, p_a), (R_b, p_b) = (
            pairs.motion(joint, stepped(joint, q, step * w)) for step in (-h, h)
        )
        s = np.concatenate([pairs.logarithm(R_b @ R_a.T), p_b - p_a]) / (2 * h)
        F, A = pairs.rows(joint, *pairs.motion(joint, q))
        close(F @ s, w, 1e-9)
        close(A @ s, np.zeros(6 - len(w)), 1e-9)
        assert np.linalg.cond(np.vstack([F, A])) < 2


def stepped(joint, q, step):
    """Return the coordinates that follow q after `step`, whose turn is a rotation vector in F1's
    axes."""
    if "turn" not in joint.freedoms:
        return q + step
    R = pairs.exponential(step[-3:]) @ pairs.from_quaternion(q[-4:])
    return np.concatenate([q[:-4] + step[:-3], pairs.quaternion(R)])
