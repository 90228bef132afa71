"""Determinants by all rows, where rows of the loops depend on each other.

Of rows that depend on others some are kept (`square`). A kept row may vanish where no pose is
singular, and with it the determinant of the kept ones. By all rows of A = [Phi; J], in the
mechanism's own units,

    D = sqrt(det A' A)              the root of the sum of all choices' squares: 0 where w is open

Its sign is told from one configuration to a near one: that of det A_1' A_2 (`modes.alike`).
Source: Horn & Johnson 2013, sec. 0.8.7 (Cauchy-Binet).
"""

from __future__ import annotations

import numpy as np

from linkwork.analysis._jacobians import Jacobians
from linkwork.analysis.grid_branches import Ways, branch_rates
from linkwork.analysis.square import Square
from linkwork.equations.reference import unit
from linkwork.model import task
from linkwork.model.leading import Leader

SHORT = 1e-5  # part of unit rates by which differences are taken
EQUAL = 1e-12  # difference of two determinants over their sum that rounding may have made


def leader_of(J: Jacobians, square: Square) -> Leader:
    """Return what leads the tool, or the actuators, in what a square system asks for."""
    if square.asked is not None:
        return J.robot.leader_of_tool(square.asked, kept=True)
    return J.robot.leader_of_joints(J.robot.joints_asked(square.what))


def spared(J: Jacobians) -> bool:
    """Tell whether rows are left out that could stand for others."""
    return any(leader_of(J, square).modes.spared for square in (J.inverse, J.direct))


def sizes(J: Jacobians, square: Square, q: np.ndarray) -> np.ndarray:
    """Return D of configurations (..., nq) over its value where the system was chosen (...)."""
    at = np.concatenate([square.base[None], q.reshape(-1, q.shape[-1])])
    D = np.linalg.svd(leader_of(J, square).in_own_units(at), compute_uv=False).prod(axis=1)
    return (D[1:] / D[0]).reshape(q.shape[:-1])


def determinants(
    J: Jacobians, q: np.ndarray, det_B: np.ndarray, det_A: np.ndarray, sign: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return det B and det A by all rows of configurations (N, nq).

    Args:
        det_B, det_A: those of kept rows (N), which change their signs together where one vanishes.
        sign: of det B (N).
    """
    together = np.sign(det_B) * np.sign(det_A)
    return sign * sizes(J, J.inverse, q), sign * together * sizes(J, J.direct, q)


def led(
    J: Jacobians, q: np.ndarray, begin: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (N, nq) to which straight ways (N, n) lead from others on a working
    mode by all rows, as `Robot.assemble` leads the tool, and which of them to their ends (N)."""
    leader, asked = leader_of(J, J.inverse), J.inverse.asked
    assert asked is not None
    way = Ways.between(asked, begin, end).at
    return leader.walked(q, way, np.arange(len(q)), leader.signs(q), leader.step)


def sign_at(J: Jacobians, q: np.ndarray) -> float:
    """Return the sign of det B at a configuration (nq): led from where the system was chosen to the
    same pose, or as far towards it as the way goes."""
    base = J.inverse.base[None]
    begin, end = (task.values(J.robot, one, J.task)[None] for one in (base[0], q))
    near, _ = led(J, base, begin, end)
    A = leader_of(J, J.inverse).in_own_units(np.stack([near[0], q]))
    return float(np.sign(np.linalg.det(A[0].T @ A[1])))


def signs_along(J: Jacobians, q: np.ndarray) -> np.ndarray:
    """Return the signs of det B along a motion (N, nq)."""
    A = leader_of(J, J.inverse).in_own_units(q)
    turned = np.linalg.det(A[:-1].swapaxes(1, 2) @ A[1:])
    first = [sign_at(J, one) for one in q[:1]]
    return np.cumprod(np.sign(np.concatenate([first, turned])))


def slopes(J: Jacobians, vanishing: Square, moved: Square, q: np.ndarray) -> np.ndarray:
    """Return the derivatives of D of one system along what another one asks for (N, n), by central
    differences."""
    tree, rates = J.robot.equations.tree, J.robot.once(branch_rates, moved)
    found = []
    for axis in np.eye(len(moved.what)):
        aside = SHORT * rates(q, np.broadcast_to(axis, (len(q), axis.size)))[0]
        ahead, behind = (sizes(J, vanishing, unit(tree, q + way)) for way in (aside, -aside))
        level = np.abs(ahead - behind) <= EQUAL * (ahead + behind)
        found.append(np.where(level, 0.0, (ahead - behind) / (2 * SHORT)))
    return np.stack(found, axis=-1)
