"""Around home: the reference at which a mechanism is closed, and closed configurations about it, at
which choices are made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, islice
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations.algebra import dense
from linkwork.equations.equations import ClosureRows, smallest_singular
from linkwork.equations.homing import ROUNDED, closed_reference, closing, first_home, jacobians
from linkwork.equations.independence import independent_rows, largest_rows
from linkwork.equations.joint_map import JointMap
from linkwork.equations.mobility import held_still
from linkwork.equations.nearest import moved
from linkwork.equations.reference import (
    OPEN,
    ROUNDED_DAMPING,
    OpenLoopsError,
    bends,
    close,
    led,
    neighbours,
    unit,
)
from linkwork.equations.reflections import reflect
from linkwork.equations.tree import Tree
from linkwork.mechanism import MechanismError

SHOWN = 6  # coordinates in a note
REGULAR = 1e-3  # least singular value at a bent reference, in own units
DEPENDENT = 1e-9  # what is left of a row, over the longest, that depends on the others
ROUNDED_RANK = 1e-5
"""Singular value over the largest, and what is left of a row over the longest, that rounded numbers
make."""
ALONE = 1e-5  # to which configurations are one, in own units
NEAR = 12  # bends beside a reference that is closed, but singular
BENT = (
    "branches of motion meet at the given reference, as where a linkage lies in a line; home is "
    "bent to {}; give a reference on the branch that is meant"
)
SHAKY = (
    "the loops close at one configuration alone, where they shake but do not move, as those of a "
    "linkage whose links are just long enough to meet; give lengths with some room"
)
ASIDE = (
    "the loops do not close at the coordinates of the reference; home is near them, with its "
    "actuated ones where these can be met, and has moved {}"
)
UNHELD = (
    "redundant rows stay open by up to {:.2g} near home (lengths over the mechanism's own, and "
    "rad), as rounded numbers leave them: {}; the other rows are closed exactly, these are not held"
)
STILL = (
    "loops and gears hold still what {} drives: its forces move nothing at home or beside it; "
    "where it should move, look for axes that are not quite parallel or do not quite meet, as "
    "rounded or measured numbers leave them"
)


class ClosedSamples(NamedTuple):
    """Hold the rows, the closed reference and closed configurations near it, Phi there in own
    units, notes, and those that are warned of."""

    rows: ClosureRows
    configurations: list[np.ndarray]
    Phi: np.ndarray
    notes: tuple[str, ...]
    caveats: tuple[str, ...]


def closed_samples(
    joints: JointMap,
    rows: ClosureRows,
    start: np.ndarray,
    starts: Callable[[], Iterable[np.ndarray]],
) -> ClosedSamples:
    """Close the loops at the reference and near it, and warn of actuators that loops hold there."""
    found = _closed(joints, rows, start, starts)
    still = held_still(joints.mechanism, joints.tree, found.Phi)
    return found._replace(caveats=(*found.caveats, *((STILL.format(still),) if still else ())))


def _closed(
    joints: JointMap,
    rows: ClosureRows,
    start: np.ndarray,
    starts: Callable[[], Iterable[np.ndarray]],
) -> ClosedSamples:
    """Close the loops at the reference and near it.

    Where rounded numbers leave redundant rows open, these are not held; where the rows lose rank at
    the reference, or at a start that leads to none, another one is looked for beside it.
    """
    # The reference, with fewer rows held where rounded numbers leave some open.
    tree = joints.tree
    try:
        reference = first_home(joints, rows, start, starts())
    except MechanismError:
        if (fewer := held(tree, rows, starts())) is not None:
            return _closed(joints, fewer, start, starts)
        if not singular_start(tree, rows, start):
            raise
        reference = first_home(joints, rows, start, chain([start], bends(tree, start)))
    # Rows that hardly depend on each other may only seem to be independent.
    samples = about(tree, rows, reference)
    rounded = unheld_notes(tree, rows, samples[0])
    nearly = nearly_dependent(samples[1][0])
    if (nearly or len(samples[0]) == 1) and (fewer := held(tree, rows, starts())) is not None:
        return _closed(joints, fewer, start, starts)
    # A reference that has the rank of its neighbours will do; else one is looked for beside it.
    own = len(independent_rows([samples[1][0]]))
    rank = own if own == len(rows.names) else len(independent_rows([*samples[1]]))
    if own < samples[1].shape[2] and one_pose(tree, samples[0]):
        rounded += (SHAKY,)
    if own == rank and not (nearly and beside_singular(samples[1])):
        return ClosedSamples(rows, *samples, moved_notes(joints, reference), rounded)
    beside = bent(tree, rows, reference, rank)
    if beside is None:
        return ClosedSamples(rows, samples[0][:1], samples[1][:1], (), rounded)
    where = ", ".join(
        f"{label} = {x:.3g}"
        for label, x in list(zip(tree.coordinates, beside, strict=True))[:SHOWN]
    )
    samples = about(tree, rows, beside)
    caveats = BENT.format(where), *unheld_notes(tree, rows, samples[0])
    return ClosedSamples(rows, *samples, (), caveats)


def beside_singular(Phi: np.ndarray) -> bool:
    """Tell whether the first of closed configurations lies where branches of motion meet, but for
    what Newton's method leaves of the way to such a pose. Phi: at each (K x rows x nv)."""
    own, *beside = (len(reflect(each, ROUNDED_RANK).rows) for each in Phi)
    return own < max(beside, default=own)


def one_pose(tree: Tree, configurations: Sequence[np.ndarray]) -> bool:
    """Tell whether closed configurations, the first of which others were sought beside, are one."""
    home, *others = configurations
    far = (np.abs((q - home) / tree.units).max(initial=0.0) for q in others)
    return max(far, default=np.inf) < ALONE


def moved_notes(joints: JointMap, q: np.ndarray) -> tuple[str, ...]:
    """Return a note on the coordinates that home cannot have as the reference gives them, if there
    are any."""
    given = joints.mechanism.reference
    found = [f"{x} from {given[x]:.3g} to {value:.3g}" for x, value in moved(joints, q).items()]
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return (ASIDE.format(", ".join(found[:SHOWN]) + more),) if found else ()


def held(tree: Tree, rows: ClosureRows, starts: Iterable[np.ndarray]) -> ClosureRows | None:
    """Return the rows without redundant ones that rounded numbers leave open; None where that is
    not what does.

    They may close where the numbers were rounded, as at zero angles, and open where the mechanism
    moves.
    """
    system = closing(tree, replace(rows, units=rows.units * rows.extents))
    for start in starts if rows.unheld is None else ():
        with suppress(OpenLoopsError):
            q = close(system, tree, start, gap=ROUNDED, damping=ROUNDED_DAMPING)
            near = neighbours(system, tree, q, ROUNDED, ROUNDED_DAMPING)
            samples = jacobians(tree, rows, [q, *near])
            values = np.linalg.svd(samples, compute_uv=False)
            rank = int((values > ROUNDED_RANK * values[:, :1]).sum(axis=1).max())
            # Rows that hardly depend on each other close where they hold still what they should
            # leave free; nearby, where the others close, they are open.
            ways = (led(system, tree, each, damping=ROUNDED_DAMPING) for each in (q, *near))
            opens = max(np.abs(phi).max(initial=0.0) for _, phi in ways) > OPEN or (
                near and not neighbours(system, tree, q)
            )
            if opens and rank < len(rows.names):
                kept = sorted(largest_rows(samples[np.argmax(values[:, rank - 1])], rank))
                left = [index for index in range(len(rows.names)) if index not in kept]
                return replace(rows.part(kept), unheld=rows.part(left))
    return None


def nearly_dependent(Phi: np.ndarray) -> bool:
    """Tell whether some rows depend on others but for rounded numbers: where such rows close, it is
    far off by chance."""
    plain = len(reflect(Phi, ROUNDED_RANK).rows)
    return plain < len(Phi) and len(reflect(Phi, DEPENDENT).rows) > plain


def unheld_notes(
    tree: Tree, rows: ClosureRows, configurations: Sequence[np.ndarray]
) -> tuple[str, ...]:
    """Return a note on the rows that are not held, if there are any, with their gap at
    configurations near home."""
    if rows.unheld is None:
        return ()
    gaps = tree.evaluated("unheld", [rows.unheld_gap])
    gap = max(float(gaps(q)[0]) for q in configurations)
    return (UNHELD.format(gap, ", ".join(rows.unheld.names)),)


def about(
    tree: Tree, rows: ClosureRows, reference: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return a closed configuration and closed ones near it, and Phi at each in the mechanism's own
    units."""
    configurations = [reference, *neighbours(closing(tree, rows), tree, reference)]
    return configurations, jacobians(tree, rows, configurations)


def singular_start(tree: Tree, rows: ClosureRows, start: np.ndarray) -> bool:
    """Tell whether the rows lose rank at an open start, compared with what is beside it."""
    system = closing(tree, rows)
    ranks = [
        len(reflect(dense(ca.DM(system(unit(tree, q))[1]))).rows)
        for q in (start, *islice(bends(tree, start), 4))
    ]
    return ranks[0] < max(ranks)


def bent(tree: Tree, rows: ClosureRows, reference: np.ndarray, rank: int) -> np.ndarray | None:
    """Return the closed configuration beside a singular one at which the rows are farthest from
    losing rank, if any is."""
    found = []
    for start in islice(bends(tree, reference), NEAR):
        with suppress(MechanismError):
            found.append(closed_reference(tree, rows, [start]))
    values = [float(smallest_singular(Phi, rank)) for Phi in jacobians(tree, rows, found)]
    return found[int(np.argmax(values))] if max(values, default=0.0) > REGULAR else None
