"""Stacks: many states at once, where nothing about them is doubtful.

One kernel goes through the coordinates of all joints once: it reads off the tree's, tells how far
the loops are open, and by how much the coordinates contradict each other. What it doubts, whole
turns included, is looked at step by step (`posing`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import Equations
from linkwork.equations.equations import conditions
from linkwork.equations.reference import CLOSED
from linkwork.kernels import Kernel

if TYPE_CHECKING:
    from linkwork.model.model import Model


class Told(NamedTuple):
    """Hold configurations q (..., nq), and the coordinates of all joints (..., m) read off them."""

    q: np.ndarray
    read: np.ndarray


def undoubted(robot: Model, given: Any, tolerance: float, threads: int) -> Told | None:
    """Return what coordinates of all joints (..., m) tell, if they close all loops, agree with each
    other within the tolerance, and hold no turns of their own; else None."""
    plain = isinstance(given, np.ndarray) and given.ndim > 1 and given.dtype == np.float64
    if not (plain and given.size and given.shape[-1] == len(robot.coordinates)):
        return None
    equations = robot.equations
    if equations.topology.added or equations.tree.quaternions:
        return None
    q, read, gap, mismatch = reading(robot)(given, robot.p, threads=threads)
    closed = gap.max() <= min(CLOSED, tolerance)
    return Told(q, read) if closed and mismatch.max() <= 10 * tolerance else None


def reading(robot: Model) -> Kernel:
    """Return the kernel (coordinates of all joints, p) -> q, what is read off it, the largest |phi|
    and the largest contradiction in own units, infinite where turns are counted."""

    def made(equations: Equations) -> ca.Function:
        given = ca.SX.sym("given", len(robot.coordinates))
        q = given[robot.labels.of_tree.tolist()]
        told = ca.Function(
            "told",
            [equations.tree.q, equations.p],
            [equations.joints.positions(), conditions(equations)],
        )
        read, gap = told(q, equations.p)
        windings, mismatch = robot.labels.comparison(given, read)
        turned = ca.mmax(ca.fabs(windings)) > 0
        worst = ca.if_else(turned, ca.inf, ca.mmax(mismatch))
        outputs = [ca.densify(part) for part in (q, read, gap, worst)]
        names = ["q", "read", "gap", "mismatch"]
        return ca.Function(
            "reading", [given, equations.p], outputs, ["given", "p"], names, {"cse": True}
        )

    return robot.chart.compiled("reading", made)
