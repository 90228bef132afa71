"""Derive: from a mechanism to its equations, stage by stage.

Mechanism -> Topology -> Tree -> closure rows -> reference configuration -> kept rows -> Chart -> Equations
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations import closure, measures
from linkwork.equations.algebra import SX, zero
from linkwork.equations.chart import choose_chart, independent_rows
from linkwork.equations.equations import Equations, Rows
from linkwork.equations.reference import OpenLoopsError, close, neighbours
from linkwork.equations.topology import span
from linkwork.equations.tree import Tree, grow
from linkwork.mechanism import Mechanism, MechanismError

STAYS_OPEN = 1e-9
TURNS_OUT = 1e-9


def derive(mechanism: Mechanism) -> Equations:
    """Derive the equations of motion of a mechanism in the rates of its actuated joints.

    Raises:
        MechanismError: loops that do not close at the reference configuration, actuators that do not
            match the mobility or are dependent there, bodies whose inertia is given for planar motion but that leave
            their plane.
    """
    topology = span(mechanism)
    tree = grow(mechanism, topology)
    cuts = tuple(closure.cut(mechanism, tree, name) for name in topology.cuts)
    rows = closure_rows(tree, cuts)
    configurations, samples = closed_samples(mechanism, tree, rows)
    reference = configurations[0]
    kept = independent_rows(samples)
    redundant = tuple(name for index, name in enumerate(rows.names) if index not in kept)
    independent = actuated(mechanism, tree, topology.cuts, len(tree.coordinates) - len(kept))
    refuse_out_of_plane(mechanism, tree, configurations, samples)
    refuse_dependent(mechanism, samples[0][list(kept)], independent)
    chart = choose_chart(rows.Phi, samples, kept, independent)
    return Equations(mechanism, topology, tree, cuts, rows, reference, redundant, chart)


def closure_rows(tree: Tree, cuts: tuple[closure.Cut, ...]) -> Rows:
    """Gather the rows of all cut joints; those that vanish symbolically (out of a planar mechanism's plane) are left out."""
    rates = SX.sym("rates", len(tree.coordinates))
    names, phi, Phi, gamma = [], [], [], []
    for cut in cuts:
        J = closure.jacobian(tree, cut)
        values = zip(cut.rows, closure.residuals(cut), ca.vertsplit(J), closure.biases(tree, cut, rates), strict=True)
        for row, residual, Phi_row, bias in values:
            name = f"{cut.joint}: {row.name}"
            if ca.SX(ca.sparsify(Phi_row)).nnz() == 0 and residual.is_constant():
                refuse_open(name, float(residual))
                continue
            names.append(name)
            phi.append(residual)
            Phi.append(Phi_row)
            gamma.append(bias)
    alignment = ca.mmin(ca.vertcat(SX(1), *[closure.alignment(cut) for cut in cuts]))
    n = len(tree.coordinates)
    stacked = ca.vertcat(*Phi) if Phi else SX.zeros(0, n)
    return Rows(tuple(names), column(phi), stacked, rates, column(gamma), alignment)


def column(values: list[ca.SX]) -> ca.SX:
    return ca.vertcat(*values) if values else SX.zeros(0, 1)


def refuse_open(row: str, residual: float) -> None:
    if abs(residual) > STAYS_OPEN:
        joint, _, what = row.partition(": ")
        raise MechanismError(
            f"the loop cannot close: {what} stays open by {residual:.3g} in every configuration; "
            "place the joint's two frames so that they can meet",
            ("joints", joint),
        )


def closed_samples(mechanism: Mechanism, tree: Tree, rows: Rows) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the closed reference configuration and closed ones near it, and Phi at each."""
    guess = np.array([mechanism.reference.get(name, 0.0) for name in tree.coordinates])
    exact = ca.Function("rows", [tree.q], [rows.phi, ca.jacobian(rows.phi, tree.q)])
    geometric = ca.Function("checks", [tree.q], [rows.Phi, rows.alignment])

    def system(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        phi, Phi = exact(q)
        return np.array(phi).ravel(), np.array(Phi)

    try:
        reference = close(system, guess)
    except OpenLoopsError as error:
        joint, _, what = rows.names[error.worst].partition(": ")
        raise MechanismError(
            f"the loops do not close near the reference configuration: {what} of joint {joint!r} stays open by "
            f"{error.gap:.3g}; check the joints' frames, or give joint coordinates nearer to a closed configuration",
            ("reference",),
        ) from None
    if float(geometric(reference)[1]) < 0:
        raise MechanismError(
            "the loops close near the reference configuration only with a joint's frames facing opposite ways; give joint "
            "coordinates nearer to the intended configuration, or turn one of the frames",
            ("reference",),
        )
    configurations = [reference, *neighbours(system, reference)]
    return configurations, [np.array(geometric(q)[0]) for q in configurations]


def actuated(mechanism: Mechanism, tree: Tree, cuts: tuple[str, ...], mobility: int) -> tuple[int, ...]:
    """Return the coordinates of the actuated joints, as many as the mobility."""
    if mobility == 0:
        raise MechanismError(
            f"the mechanism has mobility 0: the loops closed by {', '.join(cuts) or 'its joints'} leave it no motion; add a "
            "joint or free one",
            ("joints",),
        )
    count = len(mechanism.actuators)
    if count != mobility:
        few = "fewer" if count < mobility else "more"
        raise MechanismError(
            f"{count} actuated joints are {few} than the mobility {mobility}; name exactly {mobility} actuated joints",
            ("actuators",),
        )
    for name in mechanism.actuators:
        if name not in tree.coordinates:
            raise MechanismError(
                f"{name!r} closes a loop of actuated joints, whose rates cannot all be independent; actuate another joint",
                ("actuators",),
            )
    return tuple(tree.coordinates.index(name) for name in mechanism.actuators)


def refuse_dependent(mechanism: Mechanism, Phi: np.ndarray, independent: tuple[int, ...]) -> None:
    """Refuse actuators whose rates do not determine all others at the reference configuration."""
    dependent = [j for j in range(Phi.shape[1]) if j not in independent]
    if not dependent:
        return
    values = np.linalg.svd(Phi[:, dependent], compute_uv=False)
    if values[-1] < 1e-9 * values[0]:
        raise MechanismError(
            f"with {', '.join(mechanism.actuators)} locked the mechanism can still move at the reference configuration "
            "(actuator-singular); choose other actuators or another reference",
            ("actuators",),
        )


def refuse_out_of_plane(
    mechanism: Mechanism, tree: Tree, configurations: list[np.ndarray], samples: list[np.ndarray]
) -> None:
    """Refuse a body that gives its inertia `zz` alone and can turn about another axis than its own z."""
    motions = [free_motions(Phi) for Phi in samples]
    for name, body in mechanism.bodies.items():
        if not body.inertia.planar:
            continue
        node = tree.node(name)
        local = ca.mtimes(node.R.matrix.T, measures.jacobian(tree, node, zero())[:3, :])
        turning = ca.Function("turning", [tree.q], [local])
        for q, motion in zip(configurations, motions, strict=True):
            omega = np.array(turning(q)) @ motion
            if np.abs(omega[:2]).max(initial=0.0) > TURNS_OUT:
                raise MechanismError(
                    "gives only zz, but the mechanism can turn the body about other axes than its z; give xx, yy and zz",
                    ("bodies", name, "inertia"),
                )


def free_motions(Phi: np.ndarray) -> np.ndarray:
    """Return a basis (nq x n) of the rates that Phi allows."""
    _, values, rows = np.linalg.svd(np.vstack([Phi, np.zeros((1, Phi.shape[1]))]))
    rank = int((values > 1e-9 * max(values[0], 1.0)).sum())
    return rows[rank:].T
