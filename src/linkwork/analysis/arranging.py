"""Equations arranged in the rates of some joints, apart from the motors that drive them."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.model.charts import CompiledChart
from linkwork.robot import Robot

APART = 1e-9
"""Motor rate by a joint that is not named, over the largest by one that is, in own units."""
TIED = 1e-4
"""Part of a rate's row that the rates before leave, from which on it is independent of them."""


def arranged(
    robot: Robot, joints: tuple[str, ...], motors: tuple[str, ...], q: np.ndarray
) -> CompiledChart:
    """Return the equations in the rates of the joints and of others that are no motors."""
    tree = robot.equations.tree.rates
    for name in joints:
        if name not in tree:
            raise LinkworkError(
                f"the joint {name!r} closes a loop; name joints of the spanning tree: "
                f"{', '.join(tree)}"
            )
    others = [name for name in (*robot.independent, *tree) if name not in (*joints, *motors)]
    chosen = independent(robot, q, [*joints, *dict.fromkeys((*others, *motors))])
    tied = [name for name in joints if name not in chosen]
    if tied:
        raise LinkworkError(
            f"the joint {tied[0]!r} does not move independently of the other joints in this pose; "
            "leave it out, or give a guess at which it does"
        )
    chart = robot.chart.anew(q, tuple(map(tree.index, chosen)))
    if chart is None:
        raise LinkworkError(
            f"the rates {', '.join(chosen)} hardly determine the motion in this pose; give a guess "
            "farther from where they do not"
        )
    return chart


def independent(robot: Robot, q: np.ndarray, wanted: Sequence[str]) -> list[str]:
    """Return n independent rates of the tree, the first ones of those wanted that are: by their
    rows of the null space of Phi in own units, each by what the ones before leave of it."""
    equations, n = robot.equations, robot.mobility
    Phi = equations.natural(robot.chart.constraint_jacobian(q))
    free = np.linalg.svd(np.vstack([Phi, np.zeros((1, equations.nv))]))[2][-n:].T
    chosen: list[str] = []
    basis = np.zeros((0, n))
    for name in wanted:
        row = (
            free[equations.tree.rates.index(name)] if name in equations.tree.rates else 0 * free[0]
        )
        left = row - basis.T @ (basis @ row)
        if len(chosen) < n and np.linalg.norm(left) > TIED * max(np.linalg.norm(row), TIED):
            basis = np.vstack([basis, left / np.linalg.norm(left)])
            chosen.append(name)
    return chosen


def require_apart(
    chart: CompiledChart, joints: tuple[str, ...], motors: tuple[str, ...], q: np.ndarray
) -> None:
    """Refuse motors that move with independent joints that are not named."""
    equations = chart.equations
    others = {*equations.independent} - {*joints}
    if not others:
        return
    rows = ca.mtimes(equations.joints.rate_rows(motors), equations.elimination.L)
    given = functions.function("motor_rows", equations, {"rows": rows})(q, chart.p)
    found = np.abs(np.array(given)) * chart.units[equations.nq :]
    named = [equations.independent.index(name) for name in joints]
    for k, name in enumerate(equations.independent):
        part = found[:, k]
        if name in others and part.max() > APART * found[:, named].max():
            motor = motors[int(np.argmax(part))]
            if name in motors:
                raise LinkworkError(
                    f"the motor {name!r} moves independently of {', '.join(joints)}; leave "
                    "it out, or name the joint that it moves"
                )
            raise LinkworkError(
                f"the motor {motor!r} moves with {name!r}, too; name it among the joints, with one "
                "more motor"
            )
