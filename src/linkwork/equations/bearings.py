"""The friction of bearings, which the accelerations that it depends on depend on.

What bearings carry (`bearing_loads`) is affine in the accelerations v' and in their friction phi:

    M v' = applied + L' J' phi - (C v + G - f),      phi_k = -m_k sum_g r_g |A_g + B_g phi|

with m of `rubbing` and the vectors g that a bearing carries at the radii r (1 of a slide). Where
the matrix  1 - |m_k| sum_g r_g |B_g,l|  has positive pivots (it is an M-matrix then), the right
side contracts in a weighted norm: there is one phi, and Newton's method finds it. Elsewhere there
may be none or several (Painleve), and the accelerations are not defined.

Rows that are left out because others hold the same carry nothing. Where that is a choice, for rigid
bodies leave open what a bearing carries, it is refused; but what is across it counts as nothing.
Source: Painleve 1895; Berman & Plemmons 1994, ch. 6 (M-matrices).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from linkwork.equations import gears
from linkwork.equations.algebra import SX, Number, dense
from linkwork.equations.bearing_loads import BearingLoads, Wrench, rows_of
from linkwork.equations.closure import jacobian
from linkwork.equations.equations import Equations
from linkwork.equations.meeting import TINY
from linkwork.equations.needed_wrenches import frames
from linkwork.equations.reflections import DEPENDENT_ROW
from linkwork.equations.rubbing import Rubbing, rubbing
from linkwork.equations.symmetric import solve_symmetric, unless
from linkwork.mechanism import MechanismError

NEWTON = 8
"""Steps after which phi is found to rounding wherever it is the only one, but for the last few
thousandths before that bound."""
ROUNDING = 1e-13  # part of all forces below which a load along a line is none
OPEN = 1e-6  # part of what a bearing carries that rigid bodies may leave open


def accelerations(
    equations: Equations, applied: ca.SX, u: ca.SX, outside: tuple[Wrench, ...] = ()
) -> ca.SX:
    """Return v' (n) under forces `applied` (n) on the rates, which are those of actuators u and of
    wrenches from outside: with the friction of bearings where there are any."""
    found = equations.accelerations(applied)
    phi = friction_in_motion(equations, applied, u, outside)
    return found if phi is None else found + ca.mtimes(answers(equations), phi)


def on_rates(equations: Equations, phi: ca.SX) -> ca.SX:
    """Return L' J' phi (n), what the friction of bearings does on the independent rates."""
    rows = rows_of(rubbing(equations.joints), equations)
    return ca.mtimes(equations.elimination.L.T, ca.mtimes(rows.T, phi))


def friction_in_motion(
    equations: Equations, applied: ca.SX, u: ca.SX, outside: tuple[Wrench, ...] = ()
) -> ca.SX | None:
    """Return phi (K) of the bearings in a motion that is free; None where there are none."""
    loads = at_symbols(equations, u, outside)
    return loads and solved(loads, equations.accelerations(applied), answers(equations))


def line_loads(
    equations: Equations, applied: ca.SX, u: ca.SX, outside: tuple[Wrench, ...] = ()
) -> tuple[dict[str, ca.SX], ca.SX]:
    """Return what acts along lines in bearings, by the names of `line_names`, in a motion that is
    free; and below which size it is rounding."""
    phi = friction_in_motion(equations, applied, u, outside)
    assert phi is not None
    dv = equations.accelerations(applied) + ca.mtimes(answers(equations), phi)
    loads = BearingLoads(equations, dv, phi, u, outside)
    forces = ca.vertcat(equations.tree_forces(loads.accelerations, equations.gravity), u)
    found = {name: load for own in loads.rubbing for name, load in loads.lines(own).items()}
    return found, ROUNDING * ca.norm_1(forces)


def friction(
    equations: Equations, dv: ca.SX, u: ca.SX, outside: tuple[Wrench, ...] = ()
) -> ca.SX | None:
    """Return phi (K) of the bearings for given accelerations v' (n); None where there are none."""
    loads = at_symbols(equations, u, outside)
    return loads and solved(loads, dv, SX.zeros(dv.numel(), loads.phi.numel()))


def at_symbols(equations: Equations, u: ca.SX, outside: tuple[Wrench, ...]) -> BearingLoads | None:
    """Return what bearings carry at symbols for accelerations and friction, if there are any."""
    count = len(rubbing(equations.joints))
    if not count:
        return None
    dv, phi = SX.sym("dv", equations.mobility), SX.sym("phi", count)
    return BearingLoads(equations, dv, phi, u, outside)


def answers(equations: Equations) -> ca.SX:
    """Return M^-1 L' J' (n x K): the accelerations that a unit of friction brings."""
    rows = rows_of(rubbing(equations.joints), equations)
    right = ca.densify(ca.mtimes(equations.elimination.L.T, rows.T))
    M = equations.inertia[0]
    return ca.horzcat(*(solve_symmetric(M, column) for column in ca.horzsplit(right)))


def solved(loads: BearingLoads, free: ca.SX, answers: ca.SX) -> ca.SX:
    """Return phi where accelerations are free + answers phi; not finite where it may not be the
    only one."""
    parts = [own.part(loads.equations.rates) for own in loads.rubbing]
    vectors = affine(loads, free, answers)
    phi = newton(parts, vectors)
    return phi + unless(contraction(parts, vectors) > 0)


Vectors = list[list[tuple[Number, ca.SX, ca.SX]]]
"""Of each bearing radii and vectors A + B phi that it carries there."""


def affine(loads: BearingLoads, free: ca.SX, answers: ca.SX) -> Vectors:
    """Return what bearings carry where accelerations are free + answers phi."""
    found, given, still = [], [loads.dv, loads.phi], SX.zeros(loads.phi.numel())
    for carried in loads.vectors:
        found.append([])
        for radius, x in carried:
            B = ca.mtimes(ca.jacobian(x, loads.dv), answers) + ca.jacobian(x, loads.phi)
            found[-1].append((radius, *ca.substitute([x, B], given, [free, still])))
    return found


def newton(parts: Sequence[ca.SX], vectors: Vectors) -> ca.SX:
    """Return phi of phi + m sum r |A + B phi| = 0; sizes are rounded off below what is rounding of
    all loads, for derivatives of the steps would have no bound at a load that is zero in one."""
    phi = SX.zeros(len(parts))
    loads = sum((ca.sumsqr(A) for carried in vectors for _, A, _ in carried), SX(0))
    least = ROUNDING**2 * loads + TINY
    for _ in range(NEWTON):
        residual, slope = SX(phi), SX.eye(len(parts))
        for k, (m, carried) in enumerate(zip(parts, vectors, strict=True)):
            for radius, A, B in carried:
                x = A + ca.mtimes(B, phi)
                size = ca.sqrt(ca.sumsqr(x) + least)
                residual[k] += m * radius * size
                slope[k, :] += m * radius * ca.mtimes(x.T, B) / size
        phi -= eliminated(ca.densify(slope), residual)[0]
    return phi


def contraction(parts: Sequence[ca.SX], vectors: Vectors) -> ca.SX:
    """Return the least pivot of 1 - |m| sum r |B|, positive where there is one phi."""
    bound = SX.eye(len(parts))
    for k, (m, carried) in enumerate(zip(parts, vectors, strict=True)):
        for radius, _, B in carried:
            sizes = [ca.sqrt(ca.sumsqr(b) + TINY) for b in ca.horzsplit(ca.densify(B))]
            bound[k, :] -= ca.fabs(m) * radius * ca.horzcat(*sizes)
    pivots = eliminated(ca.densify(bound), SX.zeros(len(parts)))[1]
    return ca.mmin(ca.vertcat(*pivots))


def jamming(equations: Equations, q: np.ndarray, p: np.ndarray) -> tuple[str, ...]:
    """Return the bearings whose friction may leave no motion or several at q (nq), where all
    slide."""
    u = SX.zeros(len(equations.mechanism.actuators))
    loads = at_symbols(equations, u, ())
    if loads is None:
        return ()
    free = SX.zeros(equations.mobility)
    laws = [own.bearing.friction for own in loads.rubbing]
    parts = [SX(law.coefficient if law.static is None else law.static) for law in laws]
    vectors = affine(loads, free, answers(equations))
    evaluated = equations.tree.evaluated("jamming", [contraction(parts, vectors)], p, [equations.v])
    least = float(evaluated(q, np.zeros(equations.mobility))[0])
    return () if least > 0 else tuple(own.joint for own in loads.rubbing)


def eliminated(A: ca.SX, b: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
    """Return x of A x = b and the pivots, taken down the diagonal."""
    n = A.shape[0]
    A, x, pivots = SX(A), SX(b), []
    for i in range(n):
        pivots.append(A[i, i])
        for k in range(i + 1, n):
            factor = A[k, i] / A[i, i]
            A[k, i + 1 :] -= factor * A[i, i + 1 :]
            x[k] -= factor * x[i]
    for i in reversed(range(n)):
        x[i] = (x[i] - sum((A[i, k] * x[k] for k in range(i + 1, n)), SX(0))) / A[i, i]
    return x, pivots


def refuse_open(equations: Equations) -> None:
    """Refuse bearings of which rigid bodies leave open what they carry: some multipliers change it
    and no motion feels them.

    Where what they change is always across what is carried, as out of the plane of a linkage, that
    is the least that the bearing may carry, and taken; but not where all joints together carry
    least with a share of it, which the joints that close loops are taken to leave to the others.
    """
    loads = at_symbols(equations, SX.sym("u", len(equations.mechanism.actuators)), ())
    if loads is None or not (equations.cuts or equations.mechanism.gears):
        return
    # What each bearing carries, in some motion, and of every row of closing joints, held or not.
    names = [f"{cut.joint}: {row.name}" for cut in equations.cuts for row in cut.rows]
    names += [f"{name}: ratio" for name in equations.mechanism.gears]
    m = SX.sym("m", len(names))
    every = replace(loads, given=dict(zip(names, ca.vertsplit(m), strict=True)))
    outputs = []
    for of, by in zip(loads.vectors, every.vectors, strict=True):
        outputs += [x for _, x in of] + [ca.jacobian(x, m) for _, x in by]
    outputs += [carried_by_all(loads), ca.jacobian(carried_by_all(every), m)]
    # The multipliers that no rate of the tree feels, but for what rounded numbers leave.
    blocks = [jacobian(equations.tree, cut) for cut in equations.cuts]
    blocks += [gears.row(gear, equations.joints)[1] for gear in equations.mechanism.gears.values()]
    Phi = ca.vertcat(SX(0, equations.nv), *blocks)
    symbols = [equations.v, loads.dv, loads.phi, loads.u]
    evaluated = equations.tree.evaluated("open", [Phi, *outputs], inputs=symbols)
    # All of it in numbers, at the reference and at some rates, loads and forces.
    numbers = np.random.default_rng(1)
    some = [numbers.standard_normal(symbol.numel()) for symbol in symbols]
    J, *found = (dense(ca.DM(value)) for value in evaluated(equations.reference, *some))
    J, length = J * equations.tree.rate_units, equations.tree.length
    sizes = [length if row.f is None else 1.0 for cut in equations.cuts for row in cut.rows]
    sizes = np.array([*sizes, *np.linalg.norm(J[len(sizes) :], axis=1)])
    left, values, _ = np.linalg.svd(J / sizes[:, None])
    unfelt = left[:, int((values > DEPENDENT_ROW * values.max(initial=0.0)).sum()) :]
    # How much of them all joints would carry least with.
    *found, whole, whole_change = found
    least = -np.linalg.lstsq(whole_change / sizes @ unfelt, whole.ravel(), rcond=OPEN)[0]
    # What bearings rub by must not change with them.
    for own, of in zip(loads.rubbing, loads.vectors, strict=True):
        carried = found[: len(of)]
        changes = found[len(of) : 2 * len(of)]
        found = found[2 * len(of) :]
        for x, change in zip(carried, changes, strict=True):
            every_change = np.abs(change / sizes).max(initial=0.0)
            along = np.abs(x.T @ (change / sizes @ unfelt)).max(initial=0.0)
            share = np.abs(change / sizes @ unfelt @ least).max(initial=0.0)
            if (
                along > OPEN * np.linalg.norm(x) * every_change
                or share > OPEN * np.abs(whole).max()
            ):
                raise MechanismError(
                    "the loops hold more than they need, so that rigid bodies leave open what "
                    + left_open(own),
                    ("joints", own.joint, "teeth" if own.teeth else "bearing"),
                )


def carried_by_all(loads: BearingLoads) -> ca.SX:
    """Return what all joints between bodies carry, [moment about the origin of F2 over the
    mechanism's length; force], one after the other."""
    equations, found = loads.equations, [SX(0, 1)]
    for name, joint in equations.mechanism.pairs.items():
        moment, force = loads.carried(name, frames(equations, joint)[1].P)
        found += [moment / equations.tree.length, force]
    return ca.vertcat(*found)


def left_open(own: Rubbing) -> str:
    """Return what a bearing, or teeth, may carry more or less of, and what may be done."""
    if own.teeth:
        return "this gear transmits; leave out a gear beside it, or these teeth"
    return (
        "this bearing carries; free a joint of the loop, by a spherical one for example, or leave "
        "the bearing's span or thrust_radius out"
    )
