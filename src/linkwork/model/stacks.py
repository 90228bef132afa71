"""Stacks: states, one or many at once, where nothing about them is doubtful.

One kernel goes through the coordinates of all joints once: it reads off the tree's, tells how far
the loops are open, and by how much the coordinates contradict each other. Quaternions may have any
length and either sign. What it doubts, whole turns of angles included, is looked at step by step
(`posing`).
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
    plain = type(given) is np.ndarray and given.ndim > 0 and given.dtype == np.float64
    if not (plain and given.size and given.shape[-1] == len(robot.coordinates)):
        return None
    equations = robot.equations
    if equations.topology.added:
        return None
    q, read, gap, mismatch = robot.once(reading)(given, robot.p, threads=threads)
    closed = gap.max() <= min(CLOSED, tolerance)
    return Told(q, read) if closed and mismatch.max() <= 10 * tolerance else None


def reading(robot: Model) -> Kernel:
    """Return the kernel (coordinates of all joints, p) -> q, what is read off it, the largest |phi|
    and the largest contradiction in own units, infinite where turns are counted or it is no
    number."""

    def made(equations: Equations) -> ca.Function:
        labels = robot.labels
        given = ca.SX.sym("given", len(robot.coordinates))
        q = given[labels.of_tree.tolist()]
        for places, _ in equations.tree.quaternions:
            q[list(places)] /= ca.norm_2(q[list(places)])
        told = ca.Function(
            "told",
            [equations.tree.q, equations.p],
            [equations.joints.positions(), conditions(equations)],
        )
        read, gap = told(q, equations.p)
        # Quaternions that are read off keep the sign that is given.
        windings, mismatch = labels.comparison(given, read)
        signed = ca.DM(labels.signed.astype(float))
        read *= 1 - 2 * signed * windings
        turned = ca.mmax(ca.fabs(windings * (1 - signed))) > 0
        # The largest number does not tell of what is none, their sum does.
        sound = ca.logic_and(ca.sum1(mismatch) < ca.inf, ca.logic_not(turned))
        worst = ca.if_else(sound, ca.mmax(mismatch), ca.inf)
        outputs = [ca.densify(part) for part in (q, read, gap, worst)]
        names = ["q", "read", "gap", "mismatch"]
        return ca.Function(
            "reading", [given, equations.p], outputs, ["given", "p"], names, {"cse": True}
        )

    return robot.chart.compiled("reading", made)
