"""Derive: from a mechanism to its equations, stage by stage.

Mechanism -> Topology -> Tree -> closure rows -> reference configuration -> kept rows -> Chart ->
Equations
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import bearings, closure, cut_coordinates, gears, mobility, spins
from linkwork.equations.algebra import SX, dense, symbol
from linkwork.equations.chart import choose_chart
from linkwork.equations.equations import ClosureRows, Equations, scaled, sizes, smallest_singular
from linkwork.equations.growing import grow
from linkwork.equations.homing import ROUNDED, closed_reference, closing, home, jacobians
from linkwork.equations.independence import choose_independent, independent_rows, largest_rows
from linkwork.equations.joint_map import JointMap, counted, derivative
from linkwork.equations.lengths import loop_length, own_length
from linkwork.equations.nearest import moved
from linkwork.equations.reference import (
    OPEN,
    ROUNDED_DAMPING,
    OpenLoopsError,
    bends,
    close,
    described,
    guess,
    neighbours,
    starts,
    unit,
)
from linkwork.equations.reflections import reflect
from linkwork.equations.topology import Topology, counting, driven_rates, ended, span
from linkwork.equations.tree import Tree
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.numbers import free_numbers, replaced

STAYS_OPEN = 1e-9
TURNS_OUT = 1e-9
SHOWN = 6  # coordinates in a note
REGULAR = 1e-3  # least singular value at a bent reference, in own units
ROUNDED_RANK = 1e-5
"""Singular value over the largest, and what is left of a row over the longest, that rounded numbers
make."""
NEAR = 12  # bends beside a reference that is closed, but singular
BENT = (
    "branches of motion meet at the given reference, as where a linkage lies in a line; home is "
    "bent to {}; give a reference on the branch that is meant"
)
ASIDE = (
    "the loops do not close at the coordinates of the reference; home is near them, with its "
    "actuated ones where these can be met, and has moved {}"
)
UNHELD = (
    "redundant rows stay open by up to {:.2g} near home (lengths over the mechanism's own, and "
    "rad), as rounded numbers leave them: {}; the other rows are closed exactly, these are not held"
)


def derive(
    mechanism: Mechanism, independent: Sequence[str] = (), free: Sequence[str] = ()
) -> Equations:
    """Derive the equations of motion of a mechanism.

    Every choice that needs numbers is made at the description's; a free number never counts as
    zero.

    Args:
        independent: names of the rates that should be the independent ones, as far as they can;
            then the actuated ones.
        free: paths of the numbers of the description that stay symbols (`mechanism.numbers`).

    Raises:
        MechanismError: loops that do not close at the reference configuration, a mechanism without
            motion, bodies whose inertia is given for planar motion but that leave their plane,
            paths that lead to no number that can be free.
    """
    # Free numbers become symbols; nothing below may divide by one that is zero.
    refuse_unmade(mechanism)
    parameters, length = free_numbers(mechanism, free), own_length(mechanism)
    freed = replaced(mechanism, {path: symbol(path) for path in parameters})
    # The tree, and joints that close its loops. Where whole turns count and cannot be read, a joint
    # goes into the tree.
    topology = span(freed)
    tree, cuts = grown(freed, topology, parameters, length)
    counts = counting(freed)
    uncounted = [cut.joint for cut in cuts if cut.joint in counts and cut_coordinates.jump(cut)]
    if uncounted:
        topology = ended(freed, topology, uncounted)
        tree, cuts = grown(freed, topology, parameters, length)
    # phi, Phi, gamma; the closed reference, and configurations about it at which choices are made.
    start = guess(mechanism, topology, tree)
    joints = counted(JointMap(freed, tree, cuts), start, described(mechanism))
    loops = {cut.joint: mobility.loop_of(topology, cut.joint) for cut in cuts}
    extents = {
        name: (loop_length(mechanism, loop) / length, len(loop)) for name, loop in loops.items()
    }
    rows = closure_rows(freed, tree, cuts, joints, gears.units(mechanism, length), extents)
    every, begin = rows.names, partial(starts, mechanism, topology, tree, start)
    rows, configurations, samples, notes = closed_samples(joints, rows, start, begin)
    stacked = np.array(samples)
    samples = [*stacked]
    # Rows that depend on others are left out; what has no motion, or leaves its plane, is refused.
    kept = independent_rows(samples)
    held_names = {rows.names[index] for index in kept}
    redundant = tuple(name for name in every if name not in held_names)
    mobility.refuse_locked(topology, tree, rows.names, samples[0])
    refuse_out_of_plane(mechanism, tree, configurations, samples)
    # Independent rates and an elimination for L.
    preferred = [
        tree.rates.index(label)
        for label in (*independent, *driven_rates(mechanism))
        if label in tree.rates
    ]
    chosen = choose_independent(samples[0][list(kept)], preferred)
    chart = choose_chart(rows.Phi, stacked, kept, chosen, (rows.units, tree.rate_units))
    # Sizes about the reference, which say what is small.
    turning, idle = spins.spins(joints, configurations, samples)
    columns, heights = sizes(samples)
    smallest = float(smallest_singular(scaled(samples[0], (columns, heights)), len(kept)))
    found = Equations(
        freed,
        topology,
        tree,
        cuts,
        joints,
        rows,
        configurations[0],
        (columns / tree.rate_units, heights * rows.units),
        smallest,
        redundant,
        turning,
        idle,
        chart,
        notes,
    )
    bearings.refuse_open(found)
    return found


def refuse_unmade(mechanism: Mechanism) -> None:
    """Refuse an elastic joint that was put into a mechanism past its own making."""
    for name, joint in mechanism.pairs.items():
        if getattr(joint, "elastic", None) is not None:
            raise MechanismError(
                "is elastic, but its motor is not made; make the mechanism anew, Mechanism(...)",
                ("joints", name),
            )


def grown(
    mechanism: Mechanism, topology: Topology, parameters: Mapping[str, float], length: float
) -> tuple[Tree, tuple[closure.Cut, ...]]:
    """Return the tree of a topology and the cut joints in it."""
    tree = grow(mechanism, topology, parameters, length)
    return tree, tuple(closure.cut(tree, name, joint) for name, joint in topology.closing.items())


def closure_rows(
    mechanism: Mechanism,
    tree: Tree,
    cuts: tuple[closure.Cut, ...],
    joints: JointMap,
    of_gears: Mapping[str, float],
    of_loops: Mapping[str, tuple[float, float]],
) -> ClosureRows:
    """Gather the rows of all cut joints and gears; those that vanish symbolically (out of a plane)
    are left out.

    of_gears: units of the gears' residuals, by name; of_loops: length over the own one and number
    of joints, by cut joint
    """
    # Rows of the joints that close loops, and what the gears hold.
    rates, found = SX.sym("rates", len(tree.rates)), []
    for cut in cuts:
        along, turns = of_loops[cut.joint]
        sizes = [
            (tree.length, max(along, 1.0)) if row.f is None else (1.0, turns) for row in cut.rows
        ]
        columns = [
            [f"{cut.joint}: {row.name}" for row in cut.rows],
            closure.residuals(cut),
            ca.vertsplit(closure.jacobian(tree, cut)),
            ca.vertsplit(closure.open_jacobian(tree, cut)),
            closure.biases(tree, cut, rates),
            *zip(*sizes, strict=True),
        ]
        found += map(ClosureRow, *columns) if cut.rows else ()
    for name, gear in mechanism.gears.items():
        residual, Phi = gears.row(gear, joints)
        bias = ca.mtimes(derivative(Phi, tree, rates), rates)
        found.append(ClosureRow(f"{name}: ratio", residual, Phi, Phi, bias, of_gears[name], 1.0))
    # Those that something moves, one below the other.
    kept = [row for row in found if not row.vanishes]
    names, phi, Phi, open_Phi, gamma, *sizes = zip(*kept, strict=True) if kept else [()] * 7
    alignment = ca.mmin(ca.vertcat(SX(1), *[closure.alignment(cut) for cut in cuts]))
    stacked, open_stacked = (
        ca.sparsify(ca.vertcat(SX(0, len(tree.rates)), *part)) for part in (Phi, open_Phi)
    )
    phi, gamma = (ca.vertcat(SX.zeros(0, 1), *part) for part in (phi, gamma))
    return ClosureRows(
        names, phi, stacked, open_stacked, rates, gamma, alignment, *np.array(sizes, float)
    )


class ClosureRow(NamedTuple):
    """Hold one row of `ClosureRows`: its name, phi, Phi (1 x nv) where closed and where open,
    gamma, unit and extent."""

    name: str
    phi: ca.SX
    Phi: ca.SX
    open_Phi: ca.SX
    gamma: ca.SX
    unit: float
    extent: float

    @property
    def vanishes(self) -> bool:
        """Whether nothing moves the row (out of a plane); one that stays open is refused."""
        still = ca.SX(ca.sparsify(self.Phi)).nnz() == 0 and self.phi.is_constant()
        if still:
            refuse_open(self.name, float(self.phi), self.unit)
        return still


def refuse_open(row: str, residual: float, unit: float) -> None:
    if abs(residual) > STAYS_OPEN * unit:
        joint, _, what = row.partition(": ")
        raise MechanismError(
            f"the loop cannot close: {what} stays open by {abs(residual):.3g} in every "
            "configuration; place the joint's two frames so that they can meet",
            ("joints", joint),
        )


class ClosedSamples(NamedTuple):
    """Hold the rows, the closed reference and closed configurations near it, Phi there in own
    units, and notes."""

    rows: ClosureRows
    configurations: list[np.ndarray]
    Phi: list[np.ndarray]
    notes: tuple[str, ...]


def closed_samples(
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
        reference = home(joints, rows, start, starts())
    except MechanismError:
        if (fewer := held(tree, rows, starts())) is not None:
            return closed_samples(joints, fewer, start, starts)
        if not singular_start(tree, rows, start):
            raise
        reference = home(joints, rows, start, chain([start], bends(tree, start)))
    # Rows that hardly depend on each other may only seem to be independent.
    samples = about(tree, rows, reference)
    rounded = unheld_notes(tree, rows, samples[0])
    doubtful = nearly_dependent(samples[1][0]) or len(samples[0]) == 1
    if doubtful and (fewer := held(tree, rows, starts())) is not None:
        return closed_samples(joints, fewer, start, starts)
    # A reference that has the rank of its neighbours will do; else one is looked for beside it.
    rank = len(independent_rows(samples[1]))
    if len(independent_rows(samples[1][:1])) == rank:
        return ClosedSamples(rows, *samples, (*moved_notes(joints, reference), *rounded))
    beside = bent(tree, rows, reference, rank)
    if beside is None:
        return ClosedSamples(rows, samples[0][:1], samples[1][:1], rounded)
    where = ", ".join(
        f"{label} = {x:.3g}"
        for label, x in list(zip(tree.coordinates, beside, strict=True))[:SHOWN]
    )
    samples = about(tree, rows, beside)
    notes = BENT.format(where), *unheld_notes(tree, rows, samples[0])
    return ClosedSamples(rows, *samples, notes)


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
            samples = np.array(jacobians(tree, rows, [q, *near]))
            values = np.linalg.svd(samples, compute_uv=False)
            rank = int((values > ROUNDED_RANK * values[:, :1]).sum(axis=1).max())
            opens = np.abs(system(q)[0]).max(initial=0.0) > OPEN or (
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
    return len(reflect(Phi, STAYS_OPEN).rows) > len(reflect(Phi, ROUNDED_RANK).rows)


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
) -> tuple[list[np.ndarray], list[np.ndarray]]:
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


def refuse_out_of_plane(
    mechanism: Mechanism, tree: Tree, configurations: list[np.ndarray], samples: list[np.ndarray]
) -> None:
    """Refuse a body that gives its inertia `zz` alone and can turn about another axis than its own
    z."""
    rates = SX.sym("rates", len(tree.rates))
    omega = tree.angular_velocities(rates)
    for name, body in mechanism.bodies.items():
        if not body.inertia.planar:
            continue
        node = tree.node(name)
        local = ca.sparsify(ca.mtimes(node.R.near.T, omega[node.index])[:2])
        if not local.nnz():
            continue
        if ca.depends_on(local, tree.p):
            raise MechanismError(
                "gives only zz, but free turns of frames may turn the body about other axes than "
                "its z; give xx, yy and zz",
                ("bodies", name, "inertia"),
            )
        turning = tree.evaluated("turning", [local], inputs=[rates])
        for q, Phi in zip(configurations, samples, strict=True):
            motions = tree.rate_units[:, None] * mobility.free_motions(Phi)
            if np.abs(np.array(turning(q, motions)[0])).max(initial=0.0) > TURNS_OUT:
                raise MechanismError(
                    "gives only zz, but the mechanism can turn the body about other axes than "
                    "its z; give xx, yy and zz",
                    ("bodies", name, "inertia"),
                )
