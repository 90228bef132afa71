"""Chart: which rates are independent, which rows are kept, and the elimination that gives L.

    Phi w = 0,  w = (v, w_u):      Phi_u w_u = -Phi_a v               w = L v
    Phi w' + gamma = 0:            Phi_u w_u' = -Phi_a v' - gamma     w' = L v' + b

The order of elimination is chosen once, on numbers, and then traced without a branch. Pivots that
are constants (lengths) are taken first: they cannot become weak. What remains falls into coupled
blocks; a block of up to three unknowns is solved by cofactors, which fail only where the block
itself is singular, not where some pivot order is; of a larger block the strongest pivots are
eliminated until three unknowns are left. The smallest relative pivot, a pivot or determinant over
its value where the chart was chosen, is an output; its sign changes where one of them passes zero.
It goes to zero where the independent rates do not determine the others any more.
Source: the paper, Eqs. (2), (7); Duff, Erisman & Reid 2017, ch. 7 (Markowitz cost, threshold
pivoting).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import prod
from typing import NamedTuple

import casadi as ca
import numpy as np

WEAK_PIVOT = 0.1
COFACTOR_SIZE = 3


@dataclass(frozen=True)
class Block:
    """Solve the unknowns `columns` from the rows `rows` together; one row and column is an ordinary
    pivot."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Stage:
    """Hold the blocks of one stage of the block triangular form, in the order of elimination, and
    their scales.

    scales: value of each block's pivot (or determinant) where the chart was chosen
    """

    blocks: tuple[Block, ...]
    scales: tuple[float, ...]

    @property
    def rows(self) -> list[int]:
        return [r for block in self.blocks for r in block.rows]

    @property
    def columns(self) -> list[int]:
        return [c for block in self.blocks for c in block.columns]


@dataclass(frozen=True)
class Chart:
    """Hold the independent and dependent rates, the kept rows of Phi and the stages of the
    elimination."""

    independent: tuple[int, ...]
    dependent: tuple[int, ...]
    rows: tuple[int, ...]
    stages: tuple[Stage, ...]

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((self.independent, self.dependent, self.rows, self.stages))

    @property
    def blocks(self) -> list[Block]:
        return [block for stage in self.stages for block in stage.blocks]

    @property
    def description(self) -> str:
        sizes = [len(block.rows) for block in self.blocks]
        return f"{sizes.count(1)} single pivots, blocks of {[s for s in sizes if s > 1] or 'none'}"


Values = dict[int, dict[int, np.ndarray]]  # numbers by row and column, each (groups x samples)
Entries = dict[int, dict[int, ca.SX]]


def entries(Phi: ca.SX) -> Entries:
    """Return the elements of a matrix that are not zero, by row and column."""
    found: Entries = {r: {} for r in range(Phi.shape[0])}
    for r, c in zip(*Phi.sparsity().get_triplet(), strict=True):
        value = Phi[r, c]
        if not value.is_zero():
            found[r][c] = value
    return found


def choose_chart(
    Phi: ca.SX,
    samples: Sequence[np.ndarray] | np.ndarray,
    rows: tuple[int, ...],
    independent: tuple[int, ...],
    units: tuple[np.ndarray, np.ndarray] | None = None,
) -> Chart:
    """Choose the order of elimination for given independent rates.

    Args:
        Phi: constraint Jacobian as an expression (all rows x nv).
        samples: its values at closed configurations (samples x all rows x nv), the reference
            configuration first, in the mechanism's own units.
        rows: the kept rows, as many as there are dependent rates.
        independent: indices of the independent rates.
        units: those of the rows and of the rates; 1 if left out.
    """
    ((_, stages, determinants),) = choose_orders(
        constancy(Phi), np.asarray(samples)[None], rows, independent
    )
    units = (np.ones(Phi.shape[0]), np.ones(Phi.shape[1])) if units is None else units
    scales = determinants[0] * [unit_of(block, units) for stage in stages for block in stage]
    return chart_of(stages, scales.tolist(), rows, independent, Phi.shape[1])


def unit_of(block: Block, units: tuple[np.ndarray, np.ndarray]) -> float:
    """Return the unit of a block's determinant for those of the rows and of the rates."""
    of_rows, of_rates = units
    return prod([of_rows.item(r) for r in block.rows]) / prod(
        [of_rates.item(c) for c in block.columns]
    )


def chart_of(
    stages: Sequence[Sequence[Block]],
    scales: Sequence[float],
    rows: Sequence[int],
    independent: Sequence[int],
    width: int,
) -> Chart:
    """Return the chart with an order of elimination and the scale of each block."""
    dependent = tuple(sorted({*range(width)} - {*independent}))
    left = iter(scales)
    filled = tuple(Stage(tuple(blocks), tuple(next(left) for _ in blocks)) for blocks in stages)
    return Chart(tuple(independent), dependent, tuple(rows), filled)


def constancy(Phi: ca.SX) -> dict[int, dict[int, bool]]:
    """Return which elements of a matrix are not zero, by row and column, and whether they are
    constant."""
    return {
        r: {c: value.is_constant() for c, value in row.items()} for r, row in entries(Phi).items()
    }


Order = tuple[np.ndarray, list[tuple[Block, ...]], np.ndarray]


class StageBegun(NamedTuple):
    """Tell that a stage's rows and columns are solved from here on."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


class Tested(NamedTuple):
    """Tell whether an entry was strong enough in its row for a pivot."""

    row: int
    column: int
    strong: bool


Asked = StageBegun | Tested | Block | None  # what decides on an order; None: the strongest entry


def choose_orders(
    pattern: Mapping[int, Mapping[int, bool]],
    Phi: np.ndarray,
    rows: Sequence[int],
    independent: Sequence[int],
    asked: list[Asked] | None = None,
) -> list[Order]:
    """Choose the order of elimination for each of G groups of configurations.

    Args:
        pattern: the elements of the constraint Jacobian that are not zero, and whether they are
            constant.
        Phi: its values in the mechanism's own units (G x samples x rows x nv); the order is good at
            all samples of a group.
        rows, independent: the kept rows and the independent rates.
        asked: if given, of one group alone: filled with what decided on the order, step by step:
            the stages, the entries that were tested, and the blocks.

    Returns:
        (groups, stages, determinants) for each order: the groups that have it, its blocks stage by
            stage, and their determinants at the groups' first samples (groups x blocks).
    """
    asked = [] if asked is None else asked
    columns_of = {r: tuple(c for c in pattern[r] if c not in independent) for r in rows}
    orders: list[Order] = [(np.arange(len(Phi)), [], np.empty((len(Phi), 0)))]
    for stage_rows, columns in triangular(columns_of):
        constant = {(r, c) for r in stage_rows for c in columns_of[r] if pattern[r][c]}
        asked.append(StageBegun(stage_rows, tuple(sorted(columns))))
        longer: list[Order] = []
        for groups, stages, determinants in orders:
            values = {
                r: {c: Phi[groups, :, r, c] for c in columns_of[r] if c in columns}
                for r in stage_rows
            }
            for own, blocks, found in stage_orders(values, constant, len(groups), asked):
                longer.append(
                    (
                        groups[own],
                        [*stages, blocks],
                        np.concatenate([determinants[own], found], axis=1),
                    )
                )
        orders = longer
    return orders


def stage_orders(
    values: Values, constant: set[tuple[int, int]], groups: int, asked: list[Asked]
) -> list[tuple[np.ndarray, tuple[Block, ...], np.ndarray]]:
    """Choose the order of elimination within a stage, on the numbers of its rows and columns, group
    by group."""
    if len(values) == 1 or (len(values) <= COFACTOR_SIZE and not constant):
        block = Block(tuple(values), tuple(sorted({c for row in values.values() for c in row})))
        determinant = nonzero(block_determinants(values, block, groups))
        asked.append(block)
        return [(np.arange(groups), (block,), determinant[:, None])]
    found: list[tuple[np.ndarray, tuple[Block, ...], np.ndarray]] = []
    ways: list[tuple[np.ndarray, Values, set[tuple[int, int]], tuple[Block, ...], np.ndarray]] = [
        (np.arange(groups), values, constant, (), np.empty((groups, 0)))
    ]
    while ways:
        members, values, constant, blocks, determinants = ways.pop()
        if not values:
            found.append((members, blocks, determinants))
            continue
        for block, own in next_blocks(values, constant, len(members), asked):
            rest = {r: {c: value[own] for c, value in row.items()} for r, row in values.items()}
            steady = set(constant)
            determinant = nonzero(block_determinants(rest, block, own.size))
            asked.append(block)
            eliminate_values(rest, steady, block)
            longer = np.concatenate([determinants[own], determinant[:, None]], axis=1)
            ways.append((members[own], rest, steady, (*blocks, block), longer))
    return found


def nonzero(determinants: np.ndarray) -> np.ndarray:
    """Return determinants that can be divided by."""
    return np.where(np.abs(determinants) > 1e-300, determinants, 1e-300)


def block_determinants(values: Values, block: Block, groups: int) -> np.ndarray:
    """Return the determinants of a block at the groups' first samples."""
    if len(block.rows) == 1:
        return values[block.rows[0]][block.columns[0]][:, 0]
    return np.linalg.det(block_values(values, block, groups))


def block_values(values: Values, block: Block, groups: int) -> np.ndarray:
    """Return the numbers of a block at the groups' first samples (groups x rows x columns)."""
    zero = np.zeros((groups, 1))
    rows = [
        np.stack([values[r].get(c, zero)[:, 0] for c in block.columns], axis=1) for r in block.rows
    ]
    return np.stack(rows, axis=1)


def triangular(
    pattern: Mapping[int, Iterable[int]],
) -> tuple[tuple[tuple[int, ...], frozenset[int]], ...]:
    """Return the stages (rows, columns) of the block triangular form: each holds columns of its own
    and of stages before.

    Rows are matched with columns; a row leads to the rows matched with its columns; what leads back
    is one stage.

    Args:
        pattern: the columns that each row holds.
    """
    return _triangular(tuple((r, tuple(pattern[r])) for r in sorted(pattern)))


@lru_cache(maxsize=4096)
def _triangular(
    rows: tuple[tuple[int, tuple[int, ...]], ...],
) -> tuple[tuple[tuple[int, ...], frozenset[int]], ...]:
    import networkx as nx

    graph, pattern = nx.Graph(), dict(rows)
    # A column c is the node -1 - c: numbers keep one order on every machine.
    graph.add_nodes_from(sorted(pattern))
    graph.add_edges_from((r, -1 - c) for r in sorted(pattern) for c in pattern[r])
    matching = nx.bipartite.hopcroft_karp_matching(graph, sorted(pattern))
    leads = nx.DiGraph()
    leads.add_nodes_from(sorted(pattern))
    leads.add_edges_from((matching[-1 - c], r) for r in pattern for c in pattern[r])
    order = nx.condensation(leads)
    stages = [
        sorted(order.nodes[part]["members"]) for part in nx.lexicographical_topological_sort(order)
    ]
    return tuple((tuple(stage), frozenset(-1 - matching[r] for r in stage)) for stage in stages)


def next_blocks(
    values: Values, constant: set[tuple[int, int]], groups: int, asked: list[Asked]
) -> Iterator[tuple[Block, np.ndarray]]:
    """Pick the next pivot: a constant one of least Markowitz cost, else a small coupled block, else
    a strong entry.

    Yields the blocks that any of the groups take, and these groups.
    """
    # Cost of a pivot by Markowitz: the fill-in that it may cause.
    uses = Counter(c for row in values.values() for c in row)
    held = [(r, c) for r, row in values.items() for c in row]
    left = np.arange(groups)

    def fill(entry: tuple[int, int]) -> tuple[int, int, int]:
        r, c = entry
        return (len(values[r]) - 1) * (uses[c] - 1), *entry

    def strong(candidates: Iterable[tuple[int, int]]) -> Iterator[tuple[Block, np.ndarray]]:
        nonlocal left
        for r, c in sorted(candidates, key=fill):
            takes = strength(values, r, c)[left] > WEAK_PIVOT
            asked.append(Tested(r, c, bool(takes.any())))
            if takes.any():
                yield Block((r,), (c,)), left[takes]
                left = left[~takes]
            if not left.size:
                return

    # Constants first, the cheapest of them that is strong enough.
    yield from strong(entry for entry in held if entry in constant)
    if not left.size:
        return
    # Else the smallest part that stands by itself, whole where a determinant by cofactors is cheap.
    rows, columns = triangular({r: list(row) for r, row in values.items()})[0]
    if len(rows) <= COFACTOR_SIZE:
        yield Block(rows, tuple(sorted(columns))), left
        return
    # Else its cheapest strong entry, and where none is strong the strongest.
    held = [(r, c) for r in rows for c in values[r]]
    yield from strong(held)
    if left.size:
        asked.append(None)
        strongest = np.argmax([strength(values, *entry)[left] for entry in held], axis=0)
        for i in np.unique(strongest):
            r, c = held[i]
            yield Block((r,), (c,)), left[strongest == i]


def strength(values: Values, r: int, c: int) -> np.ndarray:
    """Return the smallest ratio, over the samples, of an entry to the largest entry of its row
    (groups)."""
    largest = np.max([np.abs(value) for value in values[r].values()], axis=0)
    return np.min(np.abs(values[r][c]) / np.maximum(largest, 1e-300), axis=1)


def eliminate_values(values: Values, constant: set[tuple[int, int]], block: Block) -> None:
    """Eliminate a block from the numbers, as `solve` does from the expressions."""
    pivots = {r: values.pop(r) for r in block.rows}
    if len(block.rows) > 1:
        for row in values.values():
            for c in block.columns:
                row.pop(c, None)
        return
    (c,), (pivot_row,) = block.columns, pivots.values()
    for i, row in values.items():
        if c not in row:
            continue
        factor = row.pop(c) / pivot_row[c]
        for k, value in pivot_row.items():
            if k != c:
                row[k] = row.get(k, 0.0) - factor * value
                constant.discard((i, k))


def faced(chart: Chart, signs: Sequence[float]) -> Chart:
    """Return the chart with the scales of its blocks multiplied by signs, in order."""
    left = iter(signs)
    stages = (
        replace(stage, scales=tuple(scale * next(left) for scale in stage.scales))
        for stage in chart.stages
    )
    return replace(chart, stages=tuple(stages))
