"""Chart: which rates are independent, which rows are kept, and the elimination that gives L.

    Phi q' = 0,  q' = (v, q_u'):      Phi_u q_u' = -Phi_a v          q' = L v
    Phi q'' + gamma = 0:              Phi_u q_u'' = -Phi_a v' - gamma    q'' = L v' + b

The order of elimination is chosen once, on numbers, and then traced without a branch. Pivots that are constants
(lengths) are taken first: they cannot become weak. What remains falls into coupled blocks; a block of up to three
unknowns is solved by cofactors, which fail only where the block itself is singular, not where some pivot order is; of
a larger block the strongest pivots are eliminated until three unknowns are left. The smallest relative pivot, a pivot
or determinant over its value at the reference configuration, is an output: it goes to zero at an actuator-singular
pose.
Source: the paper, Eqs. (2), (7); Duff, Erisman & Reid 2017, ch. 7 (Markowitz cost, threshold pivoting).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import networkx as nx
import numpy as np

from linkwork.equations.algebra import SX

DEPENDENT_ROW = 1e-6
WEAK_PIVOT = 0.1
COFACTOR_SIZE = 3


def independent_rows(samples: Sequence[np.ndarray]) -> tuple[int, ...]:
    """Return the rows of Phi to keep: those of the first sample at which the rank is largest.

    Args:
        samples: Phi (rows x nq) at closed configurations, the reference configuration first.
    """
    return max((rows_of_full_rank(Phi) for Phi in samples), key=len)


def rows_of_full_rank(Phi: np.ndarray) -> tuple[int, ...]:
    """Return the rows, in order, that are no combination of the rows before them (Gram-Schmidt, twice)."""
    largest = np.linalg.norm(Phi, axis=1).max(initial=0)
    basis = np.zeros((0, Phi.shape[1]))
    kept = []
    for index, row in enumerate(Phi):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)
        if np.linalg.norm(rest) > DEPENDENT_ROW * largest:
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
            kept.append(index)
    return tuple(kept)


@dataclass(frozen=True)
class Block:
    """Solve the unknowns `columns` from the rows `rows` together; one row and column is an ordinary pivot."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Chart:
    """Hold the independent and dependent coordinates, the kept rows of Phi and the order of elimination."""

    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    rows: tuple[int, ...]
    blocks: tuple[Block, ...]
    scales: tuple[float, ...]

    @property
    def description(self) -> str:
        sizes = [len(block.rows) for block in self.blocks]
        return f"{sizes.count(1)} single pivots, blocks of {[s for s in sizes if s > 1] or 'none'}"


def choose_chart(
    Phi: ca.SX, samples: Sequence[np.ndarray], rows: tuple[int, ...], independent: tuple[int, ...]
) -> Chart:
    """Choose the order of elimination for given independent coordinates.

    Args:
        Phi: constraint Jacobian as an expression (all rows x nq).
        samples: its values at closed configurations, the reference configuration first.
        rows: the kept rows, as many as there are dependent coordinates.
        independent: indices of the independent coordinates.
    """
    dependent = tuple(j for j in range(Phi.shape[1]) if j not in independent)
    values = {r: {c: np.array([s[r, c] for s in samples]) for c in dependent if not Phi[r, c].is_zero()} for r in rows}
    constant = {(r, c) for r in rows for c in values[r] if Phi[r, c].is_constant()}
    blocks: list[Block] = []
    scales: list[float] = []
    while values:
        block = next_block(values, constant)
        matrix = np.array([[values[r].get(c, np.zeros(len(samples))) for c in block.columns] for r in block.rows])
        scales.append(max(abs(float(np.linalg.det(matrix[:, :, 0]))), 1e-300))
        eliminate_values(values, constant, block)
        blocks.append(block)
    return Chart(tuple(independent), dependent, rows, tuple(blocks), tuple(scales))


Values = dict[int, dict[int, np.ndarray]]


def next_block(values: Values, constant: set[tuple[int, int]]) -> Block:
    """Pick the next pivot: a constant one of least Markowitz cost, else a small coupled block, else a strong entry."""
    uses = {c: sum(c in row for row in values.values()) for row in values.values() for c in row}
    entries = [(r, c) for r, row in values.items() for c in row]

    def fill(entry: tuple[int, int]) -> tuple[int, int, int]:
        r, c = entry
        return (len(values[r]) - 1) * (uses[c] - 1), *entry

    solid = [(r, c) for r, c in entries if (r, c) in constant and strength(values, r, c) > WEAK_PIVOT]
    if solid:
        r, c = min(solid, key=fill)
        return Block((r,), (c,))
    graph = nx.Graph((("row", r), ("column", c)) for r, c in entries)
    for part in nx.connected_components(graph):
        rows = tuple(sorted(index for kind, index in part if kind == "row"))
        columns = tuple(sorted(index for kind, index in part if kind == "column"))
        if len(rows) == len(columns) <= COFACTOR_SIZE:
            return Block(rows, columns)
    strong = [entry for entry in entries if strength(values, *entry) > WEAK_PIVOT]
    r, c = min(strong or [max(entries, key=lambda entry: strength(values, *entry))], key=fill)
    return Block((r,), (c,))


def strength(values: Values, r: int, c: int) -> float:
    """Return the smallest ratio, over the samples, of an entry to the largest entry of its row."""
    largest = np.max([np.abs(value) for value in values[r].values()], axis=0)
    return float(np.min(np.abs(values[r][c]) / np.maximum(largest, 1e-300)))


def eliminate_values(values: Values, constant: set[tuple[int, int]], block: Block) -> None:
    """Eliminate a block from the numbers, as `solve` does from the expressions."""
    pivots = {r: values.pop(r) for r in block.rows}
    if len(block.rows) > 1:
        return  # a block is closed: no other row holds its columns
    (c,), (pivot_row,) = block.columns, pivots.values()
    for i, row in values.items():
        if c not in row:
            continue
        factor = row.pop(c) / pivot_row[c]
        for k, value in pivot_row.items():
            if k != c:
                row[k] = row.get(k, 0.0) - factor * value
                constant.discard((i, k))


def solve(chart: Chart, Phi: ca.SX, right: ca.SX) -> tuple[dict[int, ca.SX], ca.SX]:
    """Solve Phi_u X = right for the dependent coordinates by the chart's elimination.

    Args:
        chart: the order of elimination.
        Phi: constraint Jacobian (all rows x nq); only the chart's rows and dependent columns are read.
        right: right sides (all rows x any number).

    Returns:
        X by coordinate (each a row), and the smallest relative pivot (1 where every pivot is a constant).
    """
    rows = {r: {c: Phi[r, c] for c in chart.dependent if not Phi[r, c].is_zero()} for r in chart.rows}
    rhs = {r: right[r, :] for r in chart.rows}
    order: list[tuple[Block, dict[int, dict[int, ca.SX]]]] = []
    smallest = SX(1)
    for block, scale in zip(chart.blocks, chart.scales, strict=True):
        taken = {r: rows.pop(r) for r in block.rows}
        if len(block.rows) == 1:
            (r,), (c,) = block.rows, block.columns
            pivot = taken[r].pop(c)
            inverse = 1 / pivot
            taken[r] = {k: value * inverse for k, value in taken[r].items()}
            rhs[r] = rhs[r] * inverse
            for i, row in rows.items():
                if c in row:
                    factor = row.pop(c)
                    for k, value in taken[r].items():
                        row[k] = row.get(k, SX(0)) - factor * value
                    rhs[i] = rhs[i] - factor * rhs[r]
        else:
            pivot = solve_block(block, taken, rhs)
            taken = {r: {} for r in block.rows}
        if not pivot.is_constant():
            smallest = ca.fmin(smallest, ca.fabs(pivot) * (1 / scale))
        order.append((block, taken))
    X: dict[int, ca.SX] = {}
    for block, taken in reversed(order):
        for r, c in zip(block.rows, block.columns, strict=True):
            X[c] = rhs[r]
            for k, value in taken[r].items():
                X[c] = X[c] - value * X[k]
    return X, smallest


def solve_block(block: Block, taken: dict[int, dict[int, ca.SX]], rhs: dict[int, ca.SX]) -> ca.SX:
    """Solve a coupled block by cofactors in place of its right sides; return its determinant."""
    A = ca.vertcat(*[ca.horzcat(*[taken[r].get(c, SX(0)) for c in block.columns]) for r in block.rows])
    B = ca.vertcat(*[rhs[r] for r in block.rows])
    adjugate = ca.densify(ca.adj(A))
    determinant = ca.mtimes(A[0, :], adjugate[:, 0])
    X = ca.mtimes(adjugate * (1 / determinant), B)
    for index, r in enumerate(block.rows):
        rhs[r] = X[index, :]
    return determinant
