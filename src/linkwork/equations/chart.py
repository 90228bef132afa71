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

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX
from linkwork.equations.reflections import DEPENDENT_ROW, reflect

WEAK_PIVOT = 0.1
COFACTOR_SIZE = 3
TIED = 1 - 1e-9  # lengths are equal from this ratio on: rounding decides nothing
FAINT = 1e-5  # of what rows leave of one, over the longest: rounding may tell where it points


def independent_rows(samples: Sequence[np.ndarray], count: int | None = None) -> tuple[int, ...]:
    """Return the rows of Phi to keep.

    Args:
        samples: Phi (rows x nv) at closed configurations, the reference configuration first.
        count: number of rows, if known: those that are least dependent at the first sample are
            taken; if not, those of the first sample at which the rank is largest.
    """
    if count is not None:
        every = count == len(samples[0])
        return tuple(range(count)) if every else tuple(sorted(largest_rows(samples[0], count)))
    kept: tuple[int, ...] = ()
    for Phi in samples:
        kept = max(kept, reflect(Phi).rows, key=len)
        if len(kept) == len(Phi):
            break
    return kept


def largest_rows(A: np.ndarray, count: int) -> list[int]:
    """Return `count` rows of A, each the longest of what the ones before it leave of the rows."""
    return orthogonal_rows(A[None], count)[0][0].tolist()


def orthogonal_rows(A: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `count` rows of matrices, and orthonormal bases of these.

    Each row is the longest of what the ones before it leave of the rows (QR with pivoting).

    Args:
        A: matrices (G x rows x columns).

    Returns:
        The rows in the order in which they are taken (G x count), and the bases (count x columns x
        G).
    """
    rest, every = np.moveaxis(A, 0, -1).copy(), np.arange(len(A))
    rows, bases = np.empty((len(A), count), int), np.empty((count, *rest.shape[1:]))
    lengths = np.empty((count, len(A)))
    taken = np.zeros((len(rest), len(A)), bool)
    for i in range(count):
        squares = np.where(taken, -1.0, (rest**2).sum(axis=1))
        row = np.argmax(squares >= TIED * squares.max(axis=0), axis=0)
        lengths[i] = np.sqrt(np.maximum(squares[row, every], 1e-300))
        bases[i] = rest[row, :, every].T / lengths[i]
        rest -= (rest * bases[i]).sum(axis=1, keepdims=True) * bases[i]
        rows[:, i], taken[row, every] = row, True
    shortest = lengths.min(axis=0, initial=np.inf)
    weak = np.flatnonzero(~(shortest > FAINT * lengths.max(axis=0, initial=0.0)))
    if weak.size:
        own = np.linalg.svd(np.take_along_axis(A[weak], rows[weak][:, :, None], axis=1))[2]
        bases[:, :, weak] = np.moveaxis(own[:, :count], 0, -1)
    return rows, bases


def choose_independent(
    Phi: np.ndarray, preferred: Sequence[int], share: float = DEPENDENT_ROW
) -> tuple[int, ...]:
    """Return n = nv - rank rates that determine the others: the preferred ones first, as far as
    they are independent.

    Args:
        Phi: kept rows of the constraint Jacobian (rows x nv), of full rank.
        preferred: rates in the order of preference.
        share: least part of a preferred rate's motion that is no motion of the rates taken before
            it.
    """
    held = reflect(Phi).row_space.T[:, :, None]
    return tuple(choose_independents(held, preferred, share)[0].tolist())


def choose_independents(
    held: np.ndarray, preferred: Sequence[int], share: float = DEPENDENT_ROW
) -> np.ndarray:
    """Return the n rates that `choose_independent` takes at each of G configurations (G x n).

    What the constraints and the rates taken before leave of the motion of rate k is the k-th unit
    vector without its parts along orthonormal directions d, |e_k|^2 - sum d_k^2 of it.

    Args:
        held: orthonormal bases of what the constraints hold (rank x nv x G).
        preferred, share: as for `choose_independent`.
    """
    rank, width, groups = held.shape
    directions, every, n = [*held], np.arange(groups), width - rank
    left = np.maximum(1 - (held**2).sum(axis=0), 0.0)
    least = (share * np.maximum(np.sqrt(left), share)) ** 2
    chosen, count = np.full((groups, n), -1), np.zeros(groups, int)
    free = np.ones((width, groups), bool)

    def take(rates: np.ndarray | int, able: np.ndarray) -> None:
        at = (rates, slice(None)) if isinstance(rates, int) else (rates, every)
        direction = np.zeros((width, groups))
        direction[at] = 1.0
        for other in directions:
            direction -= other[at] * other
        direction *= able / np.sqrt(np.maximum(left[at], 1e-300))
        directions.append(direction)
        np.maximum(left - direction**2, 0.0, out=left)
        free[at] &= ~able
        chosen[every[able], count[able]] = np.broadcast_to(rates, groups)[able]
        count[able] += 1

    for k in dict.fromkeys(preferred):
        able = (count < n) & (left[k] > least[k])
        if able.any():
            take(k, able)
    while (count < n).any():
        lengths = np.where(free, np.sqrt(left), -1.0)
        take(np.argmax(lengths >= TIED * lengths.max(axis=0), axis=0), count < n)
    return chosen


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
    samples: Sequence[np.ndarray],
    rows: tuple[int, ...],
    independent: tuple[int, ...],
    units: tuple[np.ndarray, np.ndarray] | None = None,
) -> Chart:
    """Choose the order of elimination for given independent rates.

    Args:
        Phi: constraint Jacobian as an expression (all rows x nv).
        samples: its values at closed configurations, the reference configuration first, in the
            mechanism's own units.
        rows: the kept rows, as many as there are dependent rates.
        independent: indices of the independent rates.
        units: those of the rows and of the rates; 1 if left out.
    """
    ((_, stages, determinants),) = choose_orders(
        constancy(Phi), np.array(samples)[None], rows, independent
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
    dependent = tuple(j for j in range(width) if j not in independent)
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


def choose_orders(
    pattern: Mapping[int, Mapping[int, bool]],
    Phi: np.ndarray,
    rows: Sequence[int],
    independent: Sequence[int],
) -> list[Order]:
    """Choose the order of elimination for each of G groups of configurations.

    Args:
        pattern: the elements of the constraint Jacobian that are not zero, and whether they are
            constant.
        Phi: its values in the mechanism's own units (G x samples x rows x nv); the order is good at
            all samples of a group.
        rows, independent: the kept rows and the independent rates.

    Returns:
        (groups, stages, determinants) for each order: the groups that have it, its blocks stage by
            stage, and their
        determinants at the groups' first samples (groups x blocks).
    """
    columns_of = {r: tuple(c for c in pattern[r] if c not in independent) for r in rows}
    orders: list[Order] = [(np.arange(len(Phi)), [], np.empty((len(Phi), 0)))]
    for stage_rows, columns in triangular(columns_of):
        constant = {(r, c) for r in stage_rows for c in columns_of[r] if pattern[r][c]}
        longer: list[Order] = []
        for groups, stages, determinants in orders:
            values = {
                r: {c: Phi[groups, :, r, c] for c in columns_of[r] if c in columns}
                for r in stage_rows
            }
            for own, blocks, found in stage_orders(values, constant, len(groups)):
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
    values: Values, constant: set[tuple[int, int]], groups: int
) -> list[tuple[np.ndarray, tuple[Block, ...], np.ndarray]]:
    """Choose the order of elimination within a stage, on the numbers of its rows and columns, group
    by group."""
    if len(values) == 1 or (len(values) <= COFACTOR_SIZE and not constant):
        block = Block(tuple(values), tuple(sorted({c for row in values.values() for c in row})))
        determinant = nonzero(block_determinants(values, block, groups))
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
        for block, own in next_blocks(values, constant, len(members)):
            rest, steady = (
                {r: {c: value[own] for c, value in row.items()} for r, row in values.items()},
                set(constant),
            )
            determinant = nonzero(block_determinants(rest, block, own.size))
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
    graph.add_nodes_from(
        sorted(pattern)
    )  # a column c is the node -1 - c: numbers keep one order on every machine
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
    values: Values, constant: set[tuple[int, int]], groups: int
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
