"""Approach: Newton's steps that bring the tool to poses, compiled, where closure and pose determine
the motion.

    [Phi; J] w = -[phi; x - x_d],    q <- q + N w

is solved by an elimination in the order of the block triangular form (`equations.chart`), without
independent rates. The products of its pivots are the determinants whose signs tell working modes
apart (`modes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import casadi as ca
import numpy as np

from linkwork.equations import Equations, body_motion
from linkwork.equations.algebra import SX, quaternion_matrix
from linkwork.equations.chart import Chart, solve
from linkwork.kernels import Kernel
from linkwork.mechanism import Tool
from linkwork.robot.charts import CompiledChart
from linkwork.robot.modes import ModeStages

NEAR = 1e-4  # rotation vectors [rad] whose sines are told by two terms of their series
CONDITIONS = 3  # residual, length of the step, alignment; then the determinants


@dataclass(frozen=True, eq=False)
class Approach:
    """Take steps of a tool towards poses: the kernel of `step`, and the sizes of its determinants,
    with their signs."""

    kernel: Kernel
    sizes: np.ndarray

    def step(self, q: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return q (K, nq) after a step from q (K, nq), and before it the largest residual (K), the
        step's length (K), in the mechanism's own units, the alignment (K), and the determinants
        relative to their sizes (K, stages).
        """
        if len(q) == 1:  # one state takes the shortest way
            after, found = (part[None] for part in self.kernel(q[0], poses[0]))
        else:
            after, found = self.kernel(q, poses)
        return after, found[:, 0], found[:, 1], found[:, 2], found[:, CONDITIONS:] / self.sizes


def approach(chart: CompiledChart, modes: ModeStages, twist: list[int]) -> Approach | None:
    """Return compiled steps of the tool in rows `twist`, None where closure and pose do not
    determine the motion."""
    order = modes.chart
    if order is None:
        return None
    stages = [frozenset(stage.rows) for stage in modes.stages]
    key = f"approach {twist} {order.rows} {order.blocks} {stages}"
    kernel = chart.compiled(key, lambda equations: step(equations, twist, order, stages)).given(
        chart.p
    )
    own = {frozenset(stage.rows): stage for stage in order.stages}
    orders = [(stage, own[frozenset(stage.rows)]) for stage in modes.stages]
    parities = [
        parity(stage.rows, taken.rows) * parity(stage.columns, taken.columns)
        for stage, taken in orders
    ]
    return Approach(kernel, np.array([stage.size for stage in modes.stages]) * parities)


def parity(numbers: Sequence[int], other: Sequence[int]) -> float:
    """Return 1 or -1, the determinant of the permutation that brings numbers into another order."""
    places = [numbers.index(k) for k in other]
    return float(np.round(np.linalg.det(np.eye(len(places))[places])))


def step(
    equations: Equations, twist: list[int], chart: Chart, stages: list[frozenset[int]]
) -> ca.Function:
    """Return (q, pose) -> q after a step; residual and length of the step in own units, alignment,
    determinants.

    Args:
        twist: rows of [omega; v] of the tool that are led.
        chart: order of elimination of [Phi; J].
        stages: rows of those stages whose determinants are told.
    """
    tree, rows = equations.tree, equations.rows
    tool = next(iter(equations.mechanism.tools.values()))
    J, _ = body_motion.tool_twist(tree, tool, SX.zeros(equations.nv))
    pose = SX.sym("pose", len(twist))
    residual = ca.vertcat(rows.phi, error(equations, tool, pose))
    found, pivots = solve(chart, ca.vertcat(rows.Phi, J[twist, :]), -residual)
    w = ca.vertcat(*[found[k] for k in range(equations.nv)])
    q = tree.q + ca.mtimes(tree.derivative_map, w)
    for places, _ in tree.quaternions:
        q[list(places)] /= ca.norm_2(q[list(places)])
    heights = np.concatenate([rows.units, np.where(np.array(twist) < 3, 1.0, tree.length)])
    own = residual * ca.DM(1 / heights), w * ca.DM(1 / tree.rate_units)
    left, told = iter(pivots), []
    for stage in chart.stages:
        determinant = prod([next(left) for _ in stage.blocks], start=SX(1))
        told += [determinant] if frozenset(stage.rows) in stages else []
    conditions = ca.vertcat(*[ca.mmax(ca.fabs(part)) for part in own], rows.alignment, *told)
    inputs = [tree.q, pose, equations.p]
    return ca.Function("approach", inputs, [ca.densify(q), ca.densify(conditions)], {"cse": True})


def error(equations: Equations, tool: Tool, pose: ca.SX) -> ca.SX:
    """Return how far a tool is from a pose: x, y[, angle] in the plane; x, y, z[, turn] in space.

    A turn R R_0' by t about an axis is told as 2 tan(t / 2) along the axis, which is zero for t = 0
    alone.
    """
    position, orientation, angle = body_motion.tool_pose(equations.tree, tool)
    planar = body_motion.is_planar(equations.tree)
    axes = 2 if planar else 3
    aside = position[:axes] - pose[:axes]
    if pose.numel() == axes:
        return aside
    if planar:
        turn = angle - pose[2]
        return ca.vertcat(aside, turn - 2 * np.pi * ca.floor(turn / (2 * np.pi) + 0.5))
    R = ca.mtimes(ca.reshape(orientation, 3, 3).T, turn_of(pose[3:]).T)
    axis = ca.vertcat(R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    return ca.vertcat(aside, axis * 2 / (1 + ca.trace(R)))


def turn_of(vector: ca.SX) -> ca.SX:
    """Return R of a rotation vector r: the unit quaternion (cos(t / 2), sin(t / 2) r / t), t = |r|,
    by series near t = 0."""
    square = ca.sumsqr(vector)
    near = square < NEAR**2
    t = ca.sqrt(ca.if_else(near, 1.0, square))
    part = ca.if_else(near, 1 / 2 - square / 48, ca.sin(t / 2) / t)
    return quaternion_matrix(
        ca.vertcat(ca.if_else(near, 1 - square / 8, ca.cos(t / 2)), part * vector)
    )
