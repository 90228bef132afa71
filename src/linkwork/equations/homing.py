"""Homing: the closed configuration nearest to the reference of a description.

Loops are closed from several starts; the first that leads to a closed configuration counts. What is
refused tells the row that stays open, or the coordinate that is at fault.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from linkwork.equations.equations import ClosureRows
from linkwork.equations.joint_map import JointMap
from linkwork.equations.nearest import nearer_branch, nearest
from linkwork.equations.reference import OPEN, OpenLoopsError, System, close
from linkwork.equations.tree import Tree
from linkwork.mechanism import MechanismError

ROUNDED = 1e-6  # gap of redundant rows, over the loop's extents, that rounded numbers explain
FLIPPED = (
    "the loops close near the reference configuration only with a joint's frames facing opposite "
    "ways; give joint coordinates nearer to the intended configuration, or turn one of the frames"
)


def jacobians(tree: Tree, rows: ClosureRows, configurations: Sequence[np.ndarray]) -> np.ndarray:
    """Return Phi (K x rows x nv) at closed configurations, in the mechanism's own units."""
    evaluated = tree.evaluated("checks", [rows.Phi])
    found = np.zeros((len(configurations), *rows.Phi.shape))
    own, columns = rows.Phi.sparsity().get_triplet()
    for Phi, q in zip(found, configurations, strict=True):
        Phi[own, columns] = evaluated(q)[0].nonzeros()
        Phi[own, columns] *= tree.rate_units[columns]
        Phi[own, columns] /= rows.units[own]
    return found


def closing(tree: Tree, rows: ClosureRows, p: np.ndarray | None = None) -> System:
    """Return the system that `close` solves, in the mechanism's own units, at p or at the
    description's numbers."""
    D_r, D_c = ca.diag(ca.DM(1 / rows.units)), ca.diag(ca.DM(tree.rate_units))
    scaled_Phi = ca.mtimes(ca.mtimes(D_r, rows.open_Phi), D_c)
    exact = tree.evaluated(
        "rows", [rows.phi / rows.units, scaled_Phi, ca.mtimes(tree.derivative_map, D_c)], p
    )

    def system(q: np.ndarray) -> tuple[np.ndarray, ca.DM, ca.DM]:
        phi, Phi, derivatives = exact(q)
        return np.array(phi).ravel(), Phi, derivatives

    return system


def home(
    joints: JointMap,
    rows: ClosureRows,
    start: np.ndarray,
    starts: Iterable[np.ndarray],
    p: np.ndarray | None = None,
) -> np.ndarray:
    """Return the closed configuration nearest to the reference, from the first start that leads to
    a closed one.

    start: q (nq) of the reference; p: values of the free parameters; the description's if left out
    """
    closed = closed_reference(joints.tree, rows, starts, p)
    found = nearest(closing(joints.tree, rows, p), joints, start, closed, p)
    return closed if found is closed else closed_reference(joints.tree, rows, [found, closed], p)


def first_home(
    joints: JointMap, rows: ClosureRows, start: np.ndarray, starts: Iterable[np.ndarray]
) -> np.ndarray:
    """Return home of a description, also where it lies on another branch of motion than the first
    closed configuration does."""
    q = home(joints, rows, start, starts)
    other = nearer_branch(closing(joints.tree, rows), joints, start, q)
    return q if other is None else closed_reference(joints.tree, rows, [other, q])


def closed_reference(
    tree: Tree, rows: ClosureRows, starts: Iterable[np.ndarray], p: np.ndarray | None = None
) -> np.ndarray:
    """Return the closed configuration that is reached from the first start that leads to one.

    p: values of the free parameters; the description's if left out
    """
    system, alignment = closing(tree, rows, p), tree.evaluated("alignment", [rows.alignment], p)
    refusal = MechanismError("there is nothing to close", ("reference",))
    for start in starts:
        try:
            reference = close(system, tree, start)
        except OpenLoopsError as error:
            gap = error.gap * rows.units[error.worst]
            refusal = too_large(tree, start) or open_near_reference(rows.names[error.worst], gap)
            continue
        if (gaping := open_unheld(tree, rows, reference, p)) is not None:
            refusal = gaping
            continue
        if float(alignment(reference)[0]) < 0:
            refusal = MechanismError(FLIPPED, ("reference",))
            continue
        return reference
    raise refusal


def open_unheld(
    tree: Tree, rows: ClosureRows, q: np.ndarray, p: np.ndarray | None
) -> MechanismError | None:
    """Return the refusal of a row that is not held and open by more than rounded numbers explain,
    if there is one."""
    if rows.unheld is None:
        return None
    gaps = np.abs(np.array(closing(tree, rows.unheld, p)(q)[0]))
    worst = int((gaps / rows.unheld.extents).argmax())
    if gaps[worst] <= ROUNDED * rows.unheld.extents[worst]:
        return None
    return open_near_reference(
        rows.unheld.names[worst], float(gaps[worst] * rows.unheld.units[worst])
    )


def too_large(tree: Tree, q: np.ndarray) -> MechanismError | None:
    """Return the refusal of a coordinate that is so large that its rounding leaves loops open, if
    there is one."""
    spacings = np.spacing(np.abs(q)) / tree.units
    if not spacings.max(initial=0.0) > OPEN:
        return None
    worst = int(np.argmax(spacings))
    return MechanismError(
        f"{tree.coordinates[worst]!r} is {q[worst]:.3g}, which a computer keeps to "
        f"{np.spacing(abs(q[worst])):.1g} only, so that no loop closes; give it without whole "
        "turns, or nearer to the mechanism",
        ("reference",),
    )


def open_near_reference(row: str, gap: float) -> MechanismError:
    joint, _, what = row.partition(": ")
    return MechanismError(
        f"the loops do not close near the reference configuration: {what} of joint {joint!r} "
        f"stays open by {gap:.3g}; check the joints' frames, or give joint coordinates nearer to "
        "a closed configuration",
        ("reference",),
    )
