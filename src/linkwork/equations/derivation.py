"""Derive: from a mechanism to its equations, stage by stage.

Mechanism -> Topology -> Tree -> closure rows -> reference configuration -> kept rows -> Chart ->
Equations
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import bearings, closure, cut_coordinates, gears, mobility, spins
from linkwork.equations.algebra import SX, symbol
from linkwork.equations.around_home import closed_samples
from linkwork.equations.chart import choose_chart
from linkwork.equations.equations import ClosureRows, Equations, scaled, sizes, smallest_singular
from linkwork.equations.growing import grow
from linkwork.equations.independence import choose_independent, independent_rows
from linkwork.equations.joint_map import JointMap, counted, derivative
from linkwork.equations.lengths import loop_length, own_length
from linkwork.equations.reference import described, guess, starts
from linkwork.equations.topology import Topology, counting, driven_rates, ended, span
from linkwork.equations.tree import Tree
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.numbers import free_numbers, replaced

STAYS_OPEN = 1e-9


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
    rows, configurations, stacked, notes, caveats = closed_samples(joints, rows, start, begin)
    samples = [*stacked]
    # Rows that depend on others are left out; what has no motion, or leaves its plane, is refused.
    kept = independent_rows(samples)
    held_names = {rows.names[index] for index in kept}
    redundant = tuple(name for name in every if name not in held_names)
    mobility.refuse_locked(topology, tree, rows.names, samples[0])
    mobility.refuse_out_of_plane(mechanism, tree, configurations, samples)
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
        (*notes, *caveats),
        caveats,
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
