"""Derive: from a mechanism to its equations, stage by stage.

Mechanism -> Topology -> Tree -> closure rows -> reference configuration -> kept rows -> Chart -> Equations
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from linkwork.equations import closure, gears, measures, mobility, readings
from linkwork.equations.algebra import SX, zero
from linkwork.equations.chart import Chart, choose_chart, choose_independent, independent_rows
from linkwork.equations.equations import Equations, Rows, scaled, sizes, smallest_singular
from linkwork.equations.joint_map import JointMap, counted, derivative
from linkwork.equations.reference import OpenLoopsError, close, described, guess, neighbours, starts
from linkwork.equations.topology import Topology, counting, ended, span
from linkwork.equations.tree import Tree, grow
from linkwork.mechanism import Mechanism, MechanismError

STAYS_OPEN = 1e-9
TURNS_OUT = 1e-9
FLIPPED = (
    "the loops close near the reference configuration only with a joint's frames facing opposite ways; give joint "
    "coordinates nearer to the intended configuration, or turn one of the frames"
)
WELL = 0.3  # least share of a preferred rate's motion that the rates before it leave, for a good chart


def derive(mechanism: Mechanism, independent: Sequence[str] = ()) -> Equations:
    """Derive the equations of motion of a mechanism.

    Args:
        independent: names of the rates that should be the independent ones, as far as they can; then the actuated ones.

    Raises:
        MechanismError: loops that do not close at the reference configuration, a mechanism without motion, bodies whose
            inertia is given for planar motion but that leave their plane.
    """
    topology = span(mechanism)
    tree, cuts = grown(mechanism, topology)
    uncounted = [cut.joint for cut in cuts if cut.joint in counting(mechanism) and readings.jump(cut)]
    if uncounted:
        topology = ended(mechanism, topology, uncounted)
        tree, cuts = grown(mechanism, topology)
    start = guess(mechanism, topology, tree)
    joints = counted(JointMap(mechanism, tree, cuts), start, described(mechanism))
    rows = closure_rows(mechanism, tree, cuts, joints)
    configurations, samples = closed_samples(tree, rows, starts(mechanism, topology, tree, start))
    kept = independent_rows(samples)
    redundant = tuple(name for index, name in enumerate(rows.names) if index not in kept)
    mobility.refuse_locked(topology, tree, rows.names, samples[0])
    refuse_out_of_plane(mechanism, tree, configurations, samples)
    preferred = [tree.rates.index(label) for label in (*independent, *mechanism.actuators) if label in tree.rates]
    chosen = choose_independent(samples[0][list(kept)], preferred)
    chart = choose_chart(rows.Phi, samples, kept, chosen)
    idle = idle_freedoms(mechanism, tree, configurations[0], samples[0])
    lengths = sizes(samples[0])
    smallest = smallest_singular(scaled(samples[0], lengths), len(kept))
    return Equations(
        mechanism, topology, tree, cuts, joints, rows, configurations[0], lengths, smallest, redundant, idle, chart
    )


def grown(mechanism: Mechanism, topology: Topology) -> tuple[Tree, tuple[closure.Cut, ...]]:
    """Return the tree of a topology and the cut joints in it."""
    tree = grow(mechanism, topology)
    return tree, tuple(closure.cut(tree, name, joint) for name, joint in topology.closing.items())


def chart_at(equations: Equations, Phi: np.ndarray, preferred: Sequence[int] = ()) -> Chart:
    """Return a chart that is good at a configuration: rows, independent rates and elimination chosen there.

    Args:
        Phi: the constraint Jacobian there (all rows x nv).
        preferred: rates that should be independent, as far as the configuration allows it well.
    """
    units = equations.scaled(Phi)
    kept = independent_rows([units], len(equations.chart.rows))
    return choose_chart(equations.rows.Phi, [Phi], kept, choose_independent(units[list(kept)], preferred, WELL))


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
    exact = ca.Function("rows", [tree.q], [rows.phi, rows.open_Phi, tree.derivative_map])
    geometric = ca.Function("checks", [tree.q], [rows.Phi, rows.alignment])

    def system(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        phi, Phi, derivatives = exact(q)
        return np.array(phi).ravel(), np.array(Phi), np.array(derivatives)

    refusal = MechanismError("there is nothing to close", ("reference",))
    for start in starts:
        try:
            reference = close(system, tree, start)
        except OpenLoopsError as error:
            refusal = open_near_reference(rows.names[error.worst], error.gap)
            continue
        if float(geometric(reference)[1]) < 0:
            refusal = MechanismError(FLIPPED, ("reference",))
            continue
        configurations = [reference, *neighbours(system, tree, reference)]
        return configurations, [np.array(geometric(q)[0]) for q in configurations]
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
    for name, body in mechanism.bodies.items():
        if not body.inertia.planar:
            continue
        node = tree.node(name)
        local = ca.sparsify(ca.mtimes(node.R.matrix.T, measures.jacobian(tree, node, zero())[:3, :]))[:2, :]
        if not local.nnz():
            continue
        turning = ca.Function("turning", [tree.q], [local])
        for q, Phi in zip(configurations, samples, strict=True):
            if np.abs(np.array(turning(q)) @ mobility.free_motions(Phi)).max(initial=0.0) > TURNS_OUT:
                raise MechanismError(
                    "gives only zz, but the mechanism can turn the body about other axes than its z; give xx, yy and zz",
                    ("bodies", name, "inertia"),
                )


def idle_freedoms(mechanism: Mechanism, tree: Tree, q: np.ndarray, Phi: np.ndarray) -> tuple[str, ...]:
    """Name the idle freedoms at a configuration (`mobility`)."""
    if not mobility.members(mechanism):
        return ()
    centres = [tree.point(tree.node(name), np.array(body.centre_of_mass)) for name, body in mechanism.bodies.items()]
    read = ca.Function("twists", [tree.q], [measures.body_jacobians(mechanism, tree), ca.horzcat(*centres).T])
    K, c = (np.array(value) for value in read(q))
    return mobility.idle_freedoms(mechanism, K, c.reshape(len(mechanism.bodies), 3), mobility.free_motions(Phi))
