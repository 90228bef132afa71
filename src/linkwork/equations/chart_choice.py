"""Choosing: charts that are good where a mechanism is, at many configurations at a time.

At each configuration alone: the rows that depend least on each other, the preferred rates as far as
they determine the motion well, an order of elimination, and the scale of each pivot: the usual
size, that of its rows and columns at the reference, or where the pivot is small a power of FALL
less. So what is chosen is a matter of the configuration, not of what was chosen before, and
configurations that are not far from each other share a chart.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from linkwork.equations.chart import (
    Block,
    Chart,
    Values,
    block_determinants,
    block_values,
    chart_of,
    choose_orders,
    eliminate_values,
    unit_of,
)
from linkwork.equations.equations import Equations, smallest_singular
from linkwork.equations.independence import choose_independents, orthogonal_rows

WELL = (
    0.3  # least share of a preferred rate's motion that the rates before it leave, for a good chart
)
DETERMINED = 1e-4
"""Least singular value of what rates are to solve for, over the smallest one at the reference."""
NOISE = 1e-11
"""Determinants that are rounding errors, over the product of the sizes of their rows and
columns."""
# Relative pivot at least; factor by which scales fall until it is reached.
LEAST, FALL = 0.125, 16.0


def charts_at(
    equations: Equations, Phi: np.ndarray, preferred: Sequence[int] = ()
) -> list[tuple[np.ndarray, Chart]]:
    """Return charts that are good at configurations: rows, independent rates and elimination chosen
    at each.

    Args:
        equations: of the tree whose rates are chosen from.
        Phi: the constraint Jacobian there (G x all rows x nv).
        preferred: rates that should be independent, as far as the configuration allows it well.

    Returns:
        The charts, each with the numbers of the configurations at which it is chosen; none where
        every choice would divide by a rounding error.
    """
    units, count = equations.scaled(Phi), len(equations.chart.rows)
    kept, held = orthogonal_rows(units, count)
    found = []
    for rows, members in alike(np.sort(kept)):
        for independent, places in alike(choose_independents(held[:, :, members], preferred, WELL)):
            found += sound_charts(equations, Phi, members[places], rows, independent)
    return found


def sound_charts(
    equations: Equations,
    Phi: np.ndarray,
    at: np.ndarray,
    rows: Sequence[int],
    independent: Sequence[int],
) -> Iterator[tuple[np.ndarray, Chart]]:
    """Yield the charts of rows and independent rates at some configurations, with the numbers of
    these; none where they would divide by a rounding error."""
    for order in orders(equations, Phi[at], rows, independent):
        sound = np.flatnonzero(order.sound.all(axis=1))
        for scales, same in alike(scales_of(order.determinants[sound], order.usual)):
            chart = chart_of(order.stages, scales, rows, independent, Phi.shape[2])
            yield at[order.which[sound[same]]], chart


def strengths(equations: Equations, chart: Chart, Phi: np.ndarray) -> np.ndarray:
    """Return the weakest pivot that a chart's elimination comes upon, free of units, at
    configurations (G).

    Of a block it is the least singular value, so that charts compare whose blocks differ in size.

    Phi: the constraint Jacobian there (G x all rows x nv).
    """
    weakest = np.full(len(Phi), np.inf)
    for values, block in eliminated(equations, chart, equations.scaled(Phi)):
        found = block_values(values, block, len(Phi))
        weakest = np.minimum(
            weakest, smallest_singular(np.where(np.isfinite(found), found, 0.0), len(block.rows))
        )
    return weakest


def relative_pivots(equations: Equations, chart: Chart, Phi: np.ndarray) -> np.ndarray:
    """Return the relative pivots of a chart's elimination (G x blocks), in order.

    Phi: the constraint Jacobian at configurations (G x all rows x nv).
    """
    found = [
        block_determinants(values, block, len(Phi))
        for values, block in eliminated(equations, chart, Phi)
    ]
    scales = [scale for stage in chart.stages for scale in stage.scales]
    return np.array(found).reshape(len(scales), len(Phi)).T / scales


def eliminated(
    equations: Equations, chart: Chart, Phi: np.ndarray
) -> Iterator[tuple[Values, Block]]:
    """Yield the numbers of a stage's rows and columns, and the block that is eliminated next, block
    by block; Phi: (G x all rows x nv), in any units."""
    for stage in chart.stages:
        own = set(stage.columns)
        values = {
            r: {c: Phi[:, r, c, None] for c in equations.rows.pattern[r] if c in own}
            for r in stage.rows
        }
        for block in stage.blocks:
            yield values, block
            with np.errstate(all="ignore"):
                eliminate_values(values, set(), block)


def chart_in(
    equations: Equations, Phi: np.ndarray, independent: Sequence[int], least: float = DETERMINED
) -> Chart | None:
    """Return the chart in given independent rates that is good at one configuration; None where
    there is none.

    Args:
        equations, independent, least: as for `charts_in`.
        Phi: the constraint Jacobian there (all rows x nv).
    """
    found = charts_in(equations, Phi[None], independent, least)
    return found[0][1] if found else None


def charts_in(
    equations: Equations, Phi: np.ndarray, independent: Sequence[int], least: float = DETERMINED
) -> list[tuple[np.ndarray, Chart]]:
    """Return the charts in given independent rates that are good at configurations, each with the
    numbers of those at which it is chosen; none where these rates determine no motion.

    Args:
        equations: of the tree whose rates are chosen from.
        Phi: the constraint Jacobian there (G x all rows x nv).
        independent: n different rates.
        least: singular value from which on they determine the motion, over the smallest one at the
            reference.
    """
    units, count = equations.scaled(Phi), len(equations.chart.rows)
    others = [j for j in range(Phi.shape[2]) if j not in independent]
    if len(others) != count:
        return []
    every = np.arange(count)[None].repeat(len(Phi), axis=0)
    kept = every if count == Phi.shape[1] else np.sort(orthogonal_rows(units, count)[0])
    found = []
    for rows, members in alike(kept):
        solved = units[np.ix_(members, np.array(rows, int), np.array(others, int))]
        at = members[smallest_singular(solved, count) > least * equations.smallest]
        if at.size:
            found += sound_charts(equations, Phi, at, rows, independent)
    return found


class EliminationOrder(NamedTuple):
    """Hold an order of elimination: for which configurations (G), its blocks by stages, their
    determinants there (G x blocks), and the usual sizes of these (blocks)."""

    which: np.ndarray
    stages: list[tuple[Block, ...]]
    determinants: np.ndarray
    usual: np.ndarray

    @property
    def sound(self) -> np.ndarray:
        """Which determinants are no rounding errors (G x blocks)."""
        return np.abs(self.determinants) > NOISE * self.usual


def orders(
    equations: Equations, Phi: np.ndarray, rows: Sequence[int], independent: Sequence[int]
) -> Iterator[EliminationOrder]:
    """Yield the orders of elimination for configurations (G)."""
    units = equations.rows.units, equations.tree.rate_units
    for groups, stages, found in choose_orders(
        equations.rows.pattern, equations.natural(Phi)[:, None], rows, independent
    ):
        blocks = [block for stage in stages for block in stage]
        determinants = found * [unit_of(block, units) for block in blocks]
        usual = np.array([size(equations, block) for block in blocks])
        yield EliminationOrder(groups, stages, determinants, usual)


def size(equations: Equations, block: Block) -> float:
    """Return the product of the sizes of a block's rows and columns."""
    columns, rows = equations.sizes
    return prod([columns.item(c) for c in block.columns]) * prod([rows.item(r) for r in block.rows])


def scales_of(determinants: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Return scales of determinants (G x blocks), by which these are at least LEAST."""
    falls = np.ceil(np.log(LEAST * usual / np.abs(determinants)) / np.log(FALL))
    return np.copysign(usual / FALL ** np.maximum(falls, 0.0), determinants)


def alike(table: np.ndarray) -> list[tuple[tuple, np.ndarray]]:
    """Return the different rows of a table, each with the numbers of those that are equal to it."""
    if len(table) == 1:
        return [(tuple(table[0].tolist()), np.arange(1))]
    left, groups = np.arange(len(table)), []
    while left.size:
        same = (table[left] == table[left[0]]).all(axis=1)
        groups.append((tuple(table[left[0]].tolist()), left[same]))
        left = left[~same]
    return groups
