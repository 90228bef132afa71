"""Working modes: on which side of its leg-singular poses a configuration is.

    [Phi; J] w = [0; x']        J: rows of the tool's coordinates

is block triangular. The determinant of each stage vanishes where the joints can move with the tool
at rest, and nowhere else: as long as no sign changes, a motion stays on its working mode.
Source: Chablat & Wenger, ICRA 1998 (working modes by the signs of the inverse problem's
determinant).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import Equations
from linkwork.equations.chart import Chart, chart_of, choose_orders, constancy, triangular
from linkwork.equations.independence import independent_rows
from linkwork.model.asked import Asked

# Configurations around the reference at which rows are looked at, and how far they are from it, in
# own units.
SAMPLES, SPREAD = 4, 0.02
FLAT = 1e-5  # determinant, relative to its size around the reference, whose sign is not told


class ModeStage(NamedTuple):
    """Hold a stage of [Phi; J]: places of its rows and columns, and the size of its determinant
    around the reference."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]
    size: float


class AllRowsStage(NamedTuple):
    """Hold a stage of all rows of [Phi; J], more than columns where some follow from others."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class ModeStages:
    """Hold the stages of [Phi; J] whose determinants change; none where it does not determine w, or
    does more.

    chart: an order of elimination of [Phi; J], where it determines w
    by_all_rows: the stages of all rows where some are left out that could stand for others
    """

    stages: tuple[ModeStage, ...] = ()
    chart: Chart | None = None
    by_all_rows: tuple[AllRowsStage, ...] = ()

    def signs(self, A: np.ndarray) -> np.ndarray:
        """Return the signs of the determinants (..., stages), 0 near singular poses, for A =
        [Phi; J] (..., rows, nv)."""
        return self.told(self.parts(A))

    def parts(self, A: np.ndarray) -> np.ndarray:
        """Return the determinants (..., stages) relative to their sizes."""
        found = [determinant(A, stage.rows, stage.columns) / stage.size for stage in self.stages]
        return np.stack(found, axis=-1) if found else np.zeros((*A.shape[:-2], 0))

    def alike(self, A: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Tell by all rows which configurations are on the mode of others (K), for [Phi; J] of both
        in own units."""
        return np.asarray((self.turned(A, other) >= 0).all(axis=1))

    def turned(self, A: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return by all rows the signs of the determinants (K, stages) relative to those of near
        configurations, for [Phi; J] of both in own units.

        Rows that depend on others may vanish where no pose is singular, and with them a determinant
        of kept ones. By all rows of a stage

            det(A' B) = sum det(A_s) det(B_s)       s: every choice of as many rows as columns

        which changes its sign where all choices do at a time.
        Source: Horn & Johnson 2013, sec. 0.8.7 (Cauchy-Binet).
        """
        found = np.ones((len(other), len(self.by_all_rows)))
        for k, stage in enumerate(self.by_all_rows):
            at = np.ix_(stage.rows, stage.columns)
            found[:, k] = np.sign(np.linalg.det(A[:, *at].swapaxes(1, 2) @ other[:, *at]))
        return found

    def sizes(self, A: np.ndarray) -> np.ndarray:
        """Return by all rows the sizes of the determinants (K, stages), for [Phi; J] in own
        units."""
        found = np.ones((len(A), len(self.by_all_rows)))
        for k, stage in enumerate(self.by_all_rows):
            part = A[:, *np.ix_(stage.rows, stage.columns)]
            found[:, k] = np.linalg.svd(part, compute_uv=False).prod(axis=1)
        return found

    @property
    def spared(self) -> bool:
        """Whether rows are left out that could stand for others."""
        return bool(self.by_all_rows)

    def told(self, parts: np.ndarray) -> np.ndarray:
        """Return the signs of determinants relative to their sizes, 0 near singular poses."""
        return np.where(np.abs(parts) > FLAT, np.sign(parts), 0.0)


def determinant(A: np.ndarray, rows: Sequence[int], columns: Sequence[int]) -> np.ndarray:
    """Return the determinants (...) of parts of matrices (..., rows, columns)."""
    part = A[..., rows, :][..., columns]
    return part[..., 0, 0] if len(rows) == 1 else np.linalg.det(part)


def same(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Tell whether no sign (..., stages) is against another (...)."""
    return np.asarray((one * other >= 0).all(axis=-1))


def modes_of(equations: Equations, p: np.ndarray, asked: Asked) -> ModeStages:
    """Return the modes of a mechanism that is led in what is asked.

    Args:
        p: values of the free parameters.
    """
    tree, Phi = equations.tree, equations.rows.Phi
    A = ca.vertcat(Phi, asked.expressed(equations).J)
    read = ca.Function("A", [tree.q, equations.p], [ca.densify(A)])
    random = np.random.default_rng(1998)
    around = SPREAD * tree.units * random.standard_normal((SAMPLES, equations.nq))
    samples = [np.array(read(equations.reference + aside, p)) for aside in (0 * around[0], *around)]
    # Where angles have no rates at the reference (a roll upright), what is around it tells.
    samples = [sample for sample in samples if np.isfinite(sample).all()]
    order = [*equations.chart.rows, *range(Phi.shape[0], A.shape[0])]
    units = np.concatenate([equations.rows.units, asked.units])
    in_own_units = np.reshape(samples, (-1, *A.shape)) * (tree.rate_units / units[:, None])
    kept = [order[k] for k in independent_rows([*in_own_units[:, order]])]
    if not len(kept) == len(order) == equations.nv:
        return ModeStages()
    pattern, read_off, stages = constancy(A), np.array(samples), []
    parts = triangular({r: tuple(pattern[r]) for r in kept})
    for rows_of, columns_of in parts:
        columns = tuple(sorted(columns_of))
        if not all(pattern[r].get(c, True) for r in rows_of for c in columns):
            size = float(np.abs(determinant(read_off, rows_of, columns)).max())
            stages.append(ModeStage(rows_of, columns, max(size, 1e-300)))
    ((_, blocks, _),) = choose_orders(pattern, in_own_units[None], kept, ())
    ones = [1.0 for stage in blocks for _ in stage]
    every = stages_by_all_rows(parts, stages, {row: {*pattern[row]} for row in pattern}, kept)
    return ModeStages(tuple(stages), chart_of(blocks, ones, kept, (), equations.nv), every)


def stages_by_all_rows(
    parts: Sequence[tuple[tuple[int, ...], Collection[int]]],
    changing: Sequence[ModeStage],
    touched: Mapping[int, set[int]],
    kept: Sequence[int],
) -> tuple[AllRowsStage, ...]:
    """Return the stages of all rows; none where none is left out.

    A row that is left out may determine any rate that it touches, and by the rows that would have
    done this those that these touch: their stages are one.
    Source: Dulmage & Mendelsohn, Canadian J. Mathematics 10 (1958) 517-534 (the overdetermined
    part).

    Args:
        parts: rows and columns of the stages of kept rows; changing: those that are not constant.
        touched: columns of each row.
    """
    joined: list[tuple[set[int], set[int]]] = []
    for row in sorted({*touched} - {*kept}):
        rows, columns, reached = {row}, set(touched[row]), set[int]()
        while columns != reached:
            reached = set(columns)
            for rows_of, columns_of in parts:
                if reached.intersection(columns_of):
                    rows.update(rows_of)
                    columns.update(columns_of, *(touched[r] for r in rows_of))
        for other in [group for group in joined if group[1] & columns]:
            joined.remove(other)
            rows, columns = rows | other[0], columns | other[1]
        joined += [(rows, columns)] if columns else []
    if not joined:
        return ()
    every = set[int]().union(*(columns for _, columns in joined))
    alone = [(s.rows, s.columns) for s in changing if not every.intersection(s.columns)]
    return tuple(AllRowsStage((*sorted(r),), (*sorted(c),)) for r, c in [*alone, *joined])
