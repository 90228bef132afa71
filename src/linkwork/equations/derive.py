"""Derive: from a mechanism to its equations, stage by stage.

Mechanism -> Topology -> Tree -> closure rows -> reference configuration -> kept rows -> Chart -> Equations
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import casadi as ca
import numpy as np

from linkwork.equations import closure, gears, mobility, readings, spins
from linkwork.equations.algebra import SX, dense, symbol
from linkwork.equations.chart import choose_chart, choose_independent, independent_rows
from linkwork.equations.equations import Equations, Rows, scaled, sizes, smallest_singular
from linkwork.equations.joint_map import JointMap, counted, derivative
from linkwork.equations.reference import OpenLoopsError, System, close, described, guess, neighbours, starts
from linkwork.equations.topology import Topology, counting, ended, span
from linkwork.equations.tree import Tree, grow
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.numbers import free_numbers, replaced

STAYS_OPEN = 1e-9
TURNS_OUT = 1e-9
FLIPPED = (
    "the loops close near the reference configuration only with a joint's frames facing opposite ways; give joint "
    "coordinates nearer to the intended configuration, or turn one of the frames"
)


def derive(mechanism: Mechanism, independent: Sequence[str] = (), free: Sequence[str] = ()) -> Equations:
    """Derive the equations of motion of a mechanism.

    Every choice that needs numbers is made at the description's; a free number never counts as zero.

    Args:
        independent: names of the rates that should be the independent ones, as far as they can; then the actuated ones.
        free: paths of the numbers of the description that stay symbols (`mechanism.numbers`).

    Raises:
        MechanismError: loops that do not close at the reference configuration, a mechanism without motion, bodies whose
            inertia is given for planar motion but that leave their plane, paths that lead to no number that can be free.
    """
    parameters = free_numbers(mechanism, free)
    freed = replaced(mechanism, {path: symbol(path) for path in parameters})
    topology = span(freed)
    tree, cuts = grown(freed, topology, parameters)
    counts = counting(freed)
    uncounted = [cut.joint for cut in cuts if cut.joint in counts and readings.jump(cut)]
    if uncounted:
        topology = ended(freed, topology, uncounted)
        tree, cuts = grown(freed, topology, parameters)
    start = guess(mechanism, topology, tree)
    joints = counted(JointMap(freed, tree, cuts), start, described(mechanism))
    rows = closure_rows(freed, tree, cuts, joints)
    configurations, samples = closed_samples(tree, rows, starts(mechanism, topology, tree, start))
    kept = independent_rows(samples)
    redundant = tuple(name for index, name in enumerate(rows.names) if index not in kept)
    mobility.refuse_locked(topology, tree, rows.names, samples[0])
    refuse_out_of_plane(mechanism, tree, configurations, samples)
    preferred = [tree.rates.index(label) for label in (*independent, *mechanism.actuators) if label in tree.rates]
    chosen = choose_independent(samples[0][list(kept)], preferred)
    chart = choose_chart(rows.Phi, samples, kept, chosen)
    turning, idle = spins.spins(joints, configurations, samples)
    lengths = sizes(samples[0])
    smallest = float(smallest_singular(scaled(samples[0], lengths), len(kept)))
    return Equations(
        freed, topology, tree, cuts, joints, rows, configurations[0], lengths, smallest, redundant, turning, idle, chart
    )


def grown(
    mechanism: Mechanism, topology: Topology, parameters: Mapping[str, float]
) -> tuple[Tree, tuple[closure.Cut, ...]]:
    """Return the tree of a topology and the cut joints in it."""
    tree = grow(mechanism, topology, parameters)
    return tree, tuple(closure.cut(tree, name, joint) for name, joint in topology.closing.items())


def closure_rows(mechanism: Mechanism, tree: Tree, cuts: tuple[closure.Cut, ...], joints: JointMap) -> Rows:
    """Gather the rows of all cut joints and gears; those that vanish symbolically (out of a plane) are left out."""
    rates = SX.sym("rates", len(tree.rates))
    names, phi, Phi, open_Phi, gamma = [], [], [], [], []

    def gather(name: str, residual: ca.SX, row: ca.SX, open_row: ca.SX, bias: ca.SX) -> None:
        if ca.SX(ca.sparsify(row)).nnz() == 0 and residual.is_constant():
            refuse_open(name, float(residual))
            return
        names.append(name)
        phi.append(residual)
        Phi.append(row)
        open_Phi.append(open_row)
        gamma.append(bias)

    for cut in cuts:
        if not cut.rows:
            continue
        jacobians = (ca.vertsplit(of(tree, cut)) for of in (closure.jacobian, closure.open_jacobian))
        parts = zip(closure.residuals(cut), *jacobians, closure.biases(tree, cut, rates), strict=True)
        for row, part in zip(cut.rows, parts, strict=True):
            gather(f"{cut.joint}: {row.name}", *part)
    for name, gear in mechanism.gears.items():
        residual, Phi_row = gears.row(gear, joints)
        bias = ca.mtimes(derivative(Phi_row, tree, rates), rates)
        gather(f"{name}: ratio", residual, Phi_row, Phi_row, bias)
    alignment = ca.mmin(ca.vertcat(SX(1), *[closure.alignment(cut) for cut in cuts]))
    stacked, open_stacked = (ca.sparsify(ca.vertcat(SX(0, len(tree.rates)), *part)) for part in (Phi, open_Phi))
    return Rows(tuple(names), column(phi), stacked, open_stacked, rates, column(gamma), alignment)


def column(values: list[ca.SX]) -> ca.SX:
    return ca.vertcat(SX.zeros(0, 1), *values)


def refuse_open(row: str, residual: float) -> None:
    if abs(residual) > STAYS_OPEN:
        joint, _, what = row.partition(": ")
        raise MechanismError(
            f"the loop cannot close: {what} stays open by {abs(residual):.3g} in every configuration; "
            "place the joint's two frames so that they can meet",
            ("joints", joint),
        )


def closed_samples(tree: Tree, rows: Rows, starts: Iterable[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the closed reference configuration and closed ones near it, and Phi at each."""
    system, geometric = closing(tree, rows), tree.evaluated("checks", [rows.Phi])
    reference = closed_reference(tree, rows, starts)
    configurations = [reference, *neighbours(system, tree, reference)]
    return configurations, [dense(geometric(q)[0]) for q in configurations]


def closing(tree: Tree, rows: Rows, p: np.ndarray | None = None) -> System:
    """Return the system that `close` solves, at p or at the description's numbers."""
    exact = tree.evaluated("rows", [rows.phi, rows.open_Phi, tree.derivative_map], p)

    def system(q: np.ndarray) -> tuple[np.ndarray, ca.DM, ca.DM]:
        phi, Phi, derivatives = exact(q)
        return np.array(phi).ravel(), Phi, derivatives

    return system


def closed_reference(tree: Tree, rows: Rows, starts: Iterable[np.ndarray], p: np.ndarray | None = None) -> np.ndarray:
    """Return the closed configuration that is reached from the first start that leads to one.

    p: values of the free parameters; the description's if left out
    """
    system, alignment = closing(tree, rows, p), tree.evaluated("alignment", [rows.alignment], p)
    refusal = MechanismError("there is nothing to close", ("reference",))
    for start in starts:
        try:
            reference = close(system, tree, start)
        except OpenLoopsError as error:
            refusal = open_near_reference(rows.names[error.worst], error.gap)
            continue
        if float(alignment(reference)[0]) < 0:
            refusal = MechanismError(FLIPPED, ("reference",))
            continue
        return reference
    raise refusal


def open_near_reference(row: str, gap: float) -> MechanismError:
    joint, _, what = row.partition(": ")
    return MechanismError(
        f"the loops do not close near the reference configuration: {what} of joint {joint!r} stays open by "
        f"{gap:.3g}; check the joints' frames, or give joint coordinates nearer to a closed configuration",
        ("reference",),
    )


def refuse_out_of_plane(
    mechanism: Mechanism, tree: Tree, configurations: list[np.ndarray], samples: list[np.ndarray]
) -> None:
    """Refuse a body that gives its inertia `zz` alone and can turn about another axis than its own z."""
    rates = SX.sym("rates", len(tree.rates))
    omega = tree.angular_velocities(rates)
    for name, body in mechanism.bodies.items():
        if not body.inertia.planar:
            continue
        node = tree.node(name)
        local = ca.sparsify(ca.mtimes(node.R.near.T, omega[node.index])[:2])
        if not local.nnz():
            continue
        turning = tree.evaluated("turning", [local], inputs=[rates])
        for q, Phi in zip(configurations, samples, strict=True):
            if np.abs(np.array(turning(q, mobility.free_motions(Phi))[0])).max(initial=0.0) > TURNS_OUT:
                raise MechanismError(
                    "gives only zz, but the mechanism can turn the body about other axes than its z; give xx, yy and zz",
                    ("bodies", name, "inertia"),
                )
