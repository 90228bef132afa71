"""Elimination: solve Phi_u X = right by the order that a chart holds, traced without a branch.

Single pivots are divided by, coupled blocks solved by cofactors; the relative pivots come with it.
Source: Duff, Erisman & Reid 2017, ch. 7.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from linkwork.equations.algebra import SX
from linkwork.equations.chart import Block, Chart, Entries, Stage, entries


def solve(chart: Chart, Phi: ca.SX, right: ca.SX) -> tuple[dict[int, ca.SX], list[ca.SX]]:
    """Solve Phi_u X = right for the dependent rates by the chart's elimination.

    Args:
        chart: the order of elimination.
        Phi: constraint Jacobian (all rows x nv); only the chart's rows and dependent columns are
            read.
        right: right sides (all rows x any number).

    Returns:
        X by rate (each a row), and the relative pivots of the blocks, in order.
    """
    expressions = entries(Phi)
    X: dict[int, ca.SX] = {}
    pivots: list[ca.SX] = []
    for stage in chart.stages:
        own = set(stage.columns)
        rows = {
            r: {c: value for c, value in expressions[r].items() if c in own} for r in stage.rows
        }
        rhs = {r: right[r, :] for r in stage.rows}
        for r in stage.rows:
            for c, value in expressions[r].items():
                if c in X:
                    rhs[r] = rhs[r] - value * X[c]
        solve_stage(stage, rows, rhs, X, pivots)
    return X, pivots


def solve_stage(
    stage: Stage, rows: Entries, rhs: dict[int, ca.SX], X: dict[int, ca.SX], pivots: list[ca.SX]
) -> None:
    """Solve a stage by elimination and back substitution; add its unknowns to X and its relative
    pivots."""
    order: list[tuple[Block, Entries]] = []
    for block, scale in zip(stage.blocks, stage.scales, strict=True):
        taken = {r: rows.pop(r) for r in block.rows}
        if len(block.rows) == 1:
            (r,), (c,) = block.rows, block.columns
            pivot = taken[r].pop(c)
            inverse = 1 / pivot
            taken[r] = {k: value * inverse for k, value in taken[r].items()}
            rhs[r] = rhs[r] * inverse
        else:
            pivot = solve_block(block, taken, rhs)
            taken = {r: {} for r in block.rows}
        for i, row in rows.items():
            for r, c in zip(block.rows, block.columns, strict=True):
                if c in row:
                    factor = row.pop(c)
                    for k, value in taken[r].items():
                        row[k] = row.get(k, SX(0)) - factor * value
                    rhs[i] = rhs[i] - factor * rhs[r]
        pivots.append(pivot * (1 / scale))
        order.append((block, taken))
    for block, taken in reversed(order):
        for r, c in zip(block.rows, block.columns, strict=True):
            X[c] = rhs[r]
            for k, value in taken[r].items():
                X[c] = X[c] - value * X[k]


def weakest(pivots: Sequence[ca.SX]) -> ca.SX:
    """Return the smallest magnitude of relative pivots, negative where any of them is; 1 where all
    are constant."""
    varying = [pivot for pivot in pivots if not pivot.is_constant()]
    if not varying:
        return SX(1)
    result = varying[0]
    for pivot in varying[1:]:
        result = ca.copysign(ca.fmin(ca.fabs(result), ca.fabs(pivot)), ca.fmin(result, pivot))
    return result


def solve_block(block: Block, taken: Entries, rhs: dict[int, ca.SX]) -> ca.SX:
    """Solve a coupled block by cofactors in place of its right sides; return its determinant."""
    A = ca.vertcat(
        *[ca.horzcat(*[taken[r].get(c, SX(0)) for c in block.columns]) for r in block.rows]
    )
    B = ca.vertcat(*[rhs[r] for r in block.rows])
    adjugate = ca.densify(ca.adj(A))
    determinant = ca.mtimes(A[0, :], adjugate[:, 0])
    X = ca.mtimes(adjugate * (1 / determinant), B)
    for index, r in enumerate(block.rows):
        rhs[r] = X[index, :]
    return determinant
