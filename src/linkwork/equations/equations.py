"""The equations of motion of a mechanism, as expressions.

    M v' + C v + G = S' u + f,    M = L' H L,    C v + G - f = L' (h(q, w) + H b)
    w = L v,    w' = L v' + b

in independent rates v; H and h are the tree's (`dynamics`), L and b the chart's (`chart`), f the
forces of springs and friction (`effects`). S gives the actuated rates, S v; it is the unit matrix
where these are the independent ones. The accelerations of large open trees are found without M
(`articulated`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import prod
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import articulated, contact, dynamics, effects, rubbing
from linkwork.equations.algebra import SX, present, vector
from linkwork.equations.chart import Chart, constancy
from linkwork.equations.closure import Cut
from linkwork.equations.elimination import solve, weakest
from linkwork.equations.joint_map import JointMap
from linkwork.equations.reflections import least_singular
from linkwork.equations.symmetric import HIDDEN, solve_symmetric, unless
from linkwork.equations.topology import Topology
from linkwork.equations.tree import Tree
from linkwork.mechanism import Mechanism
from linkwork.mechanism.bearing import bearing_name
from linkwork.mechanism.limits import meeting_name
from linkwork.mechanism.sticking import strains

# Smallest singular value, over that at the reference, from which a configuration is not near a
# singular one (`Equations.regularity`); and of one.
REGULAR, LOST = 0.2, 0.01
VANISHING = 1e-6  # length at the reference that counts as zero, over that nearby
ROUNDING = 1e-11  # length that is a rounding error, over the largest one
GAPING = 1e-4
"""Gap of a row that is not held, in own units, that rounded numbers do not explain anywhere."""
DOUBTFUL = 1e-5  # pivot that may be a rounding error, over the largest number at the outset
FEW = 8  # matrices whose singular values are found as quickly as the signs of their pivots
LARGE = 300  # rank from which on singular values by reflections of sparse rows are found sooner
PAIR, MORE = 45, 250
"""Operations that M takes for each pair of rates one of which carries the other, and those that
articulated inertias take more for each rate: counted on chains and trees of 6 to 60 hinges."""


@dataclass(frozen=True)
class ClosureRows:
    """Hold the closure rows that do not vanish symbolically.

    names: joint and what the row holds; phi: residuals (1); Phi: their Jacobian (2), rows x nv;
        gamma: bias for the rates w
    open_Phi: the derivative of phi along the rates where the loops are open, too
    alignment: positive where the frames of every cut joint agree, negative where a direction is
        flipped
    units: of phi (rows): the own length of positions, 1 of directions, the largest term's of gears
    extents: what errors of the description's numbers add up to in phi, over units (rows): the
        loop's length over the own one of positions, its number of joints of directions
    unheld: redundant rows that rounded numbers leave open, if there are any: no row of these, but
        watched
    """

    names: tuple[str, ...]
    phi: ca.SX
    Phi: ca.SX
    open_Phi: ca.SX
    rates: ca.SX
    gamma: ca.SX
    alignment: ca.SX
    units: np.ndarray
    extents: np.ndarray
    unheld: ClosureRows | None = None

    def part(self, indices: Sequence[int]) -> ClosureRows:
        """Return some of the rows."""
        own = list(indices)
        names = tuple(self.names[index] for index in own)
        phi, Phi, open_Phi, gamma = (
            part[own, :] for part in (self.phi, self.Phi, self.open_Phi, self.gamma)
        )
        sizes = self.units[own], self.extents[own]
        return ClosureRows(names, phi, Phi, open_Phi, self.rates, gamma, self.alignment, *sizes)

    @property
    def unheld_gap(self) -> ca.SX:
        """The largest |phi| of the rows that are not held, in own units."""
        return ca.mmax(ca.fabs(self.unheld.phi / self.unheld.units)) if self.unheld else SX(0)

    @property
    def excess(self) -> ca.SX:
        """How far rows that are not held are open beyond what rounded numbers explain; empty where
        all are held."""
        return ca.fmax(self.unheld_gap - GAPING, 0) if self.unheld else SX(0, 1)

    @cached_property
    def pattern(self) -> dict[int, dict[int, bool]]:
        """Tell which elements of Phi are not zero, by row and column, and whether they are
        constant."""
        return constancy(self.Phi)


class Elimination(NamedTuple):
    """Hold L (nv x n) and b (nv) of w = L v, w' = L v' + b, and the weakest relative pivot."""

    L: ca.SX
    b: ca.SX
    pivot: ca.SX


@dataclass(frozen=True)
class Equations:
    """Hold the derivation of a mechanism: its tree, closure rows and chart, and the expressions
    that follow from them.

    reference: closed reference configuration of the tree's coordinates (nq)
    sizes: lengths of Phi's columns there (nv), then of its rows over these (rows), or near it where
        they vanish there
    smallest: smallest singular value of Phi there over its sizes
    redundant: names of the rows that depend on the others; they are left out of the elimination and
        watched
    spins: freedoms that turn a member about the line through its two joints and move nothing else:
        its bodies, by name
    idle: names of those of them that nothing acts on
    notes: sentences on what was decided about the reference that the description does not say
    caveats: those that are warned of: branches meet there, or rows are not held
    key: tells equations of different descriptions apart where it is known; the same in all charts
    strains: the forces of bristles, by what they are of; without them friction is that of steady
        sliding, smoothed
    """

    mechanism: Mechanism
    topology: Topology
    tree: Tree
    cuts: tuple[Cut, ...]
    joints: JointMap
    rows: ClosureRows
    reference: np.ndarray
    sizes: tuple[np.ndarray, np.ndarray]
    smallest: float
    redundant: tuple[str, ...]
    spins: Mapping[str, tuple[str, ...]]
    idle: tuple[str, ...]
    chart: Chart
    notes: tuple[str, ...]
    caveats: tuple[str, ...]
    key: str = ""
    strains: Mapping[str, ca.SX] = field(default_factory=dict)

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values in the description of its np free numbers, by path."""
        return self.tree.parameters

    @property
    def p(self) -> ca.SX:
        """Symbols of the free parameters (np), in the order of `parameters`."""
        return self.tree.p

    @cached_property
    def nq(self) -> int:
        """Number of the tree's coordinates."""
        return len(self.tree.coordinates)

    @property
    def nv(self) -> int:
        """Number of the tree's rates."""
        return len(self.tree.rates)

    @cached_property
    def mobility(self) -> int:
        """Number n of independent rates."""
        return len(self.chart.independent)

    @cached_property
    def independent(self) -> tuple[str, ...]:
        """Names of the independent rates."""
        return tuple(self.tree.rates[k] for k in self.chart.independent)

    @cached_property
    def constrained(self) -> bool:
        """Tell whether the coordinates have conditions to keep to: closed loops or unit
        quaternions."""
        return bool(self.rows.names or self.tree.quaternions)

    def natural(self, Phi: np.ndarray) -> np.ndarray:
        """Return Phi (..., rows x nv) in the mechanism's own units: lengths over its own length."""
        return Phi * self.tree.rate_units / self.rows.units[:, None]

    def scaled(self, Phi: np.ndarray) -> np.ndarray:
        """Return Phi (..., rows x nv) over the sizes of its columns and rows at the reference: free
        of units."""
        return scaled(Phi, self.sizes)

    def regular(self, Phi: np.ndarray) -> np.ndarray:
        """Tell whether configurations (...) are far from losing rank, compared with the
        reference."""
        return above(self.scaled(Phi), len(self.chart.rows), self.regularity)

    @property
    def regularity(self) -> float:
        """Return the smallest singular value of the scaled Phi from which on it is regular."""
        return REGULAR * self.smallest

    def lost(self, Phi: np.ndarray) -> np.ndarray:
        """Tell where rank is lost (...), or all but lost: there branches of motion meet, or it
        ends."""
        return smallest_singular(self.scaled(Phi), len(self.chart.rows)) <= LOST * self.smallest

    @property
    def strained(self) -> Equations:
        """The same equations, with symbols for the forces of bristles where there are any."""
        own = {each.of: SX.sym(each.of, len(each.names)) for each in strains(self.mechanism)}
        return replace(self, strains=own) if own else self

    def in_chart(self, chart: Chart) -> Equations:
        """Return the same equations in another chart."""
        return replace(self, chart=chart)

    def about(self, reference: np.ndarray) -> Equations:
        """Return the same equations, and all that was derived of them, about another closed
        reference configuration."""
        equations = copy(self)
        object.__setattr__(equations, "reference", reference)
        return equations

    @cached_property
    def v(self) -> ca.SX:
        """Independent rates (n) [m/s, rad/s]."""
        return SX.sym("v", self.mobility)

    @cached_property
    def elimination(self) -> Elimination:
        """Solve Phi w = 0 and Phi w' + gamma = 0 for the dependent rates, in the chart's order."""
        Phi_a = self.rows.Phi[:, list(self.chart.independent)]
        X, _ = solve(self.chart, self.rows.Phi, -Phi_a)
        L = self.scatter(X, SX.eye(self.mobility))
        gamma = ca.substitute(self.rows.gamma, self.rows.rates, ca.mtimes(L, self.v))
        X, pivots = solve(self.chart, self.rows.Phi, ca.horzcat(-Phi_a, -gamma))
        full = self.scatter(X, ca.horzcat(SX.eye(self.mobility), SX.zeros(self.mobility)))
        return Elimination(full[:, :-1], full[:, -1], weakest(pivots))

    def scatter(self, dependent: dict[int, ca.SX], independent: ca.SX) -> ca.SX:
        """Arrange rows of dependent and independent rates in the tree's order; they stay sparse
        where none is dependent."""
        rows = dict(zip(self.chart.independent, ca.vertsplit(independent), strict=True)) | dependent
        found = ca.vertcat(*[rows[j] for j in range(self.nv)])
        return ca.densify(found) if dependent else found

    @property
    def rates(self) -> ca.SX:
        """Return w = L v (nv), Eq. (7)."""
        return ca.mtimes(self.elimination.L, self.v)

    @cached_property
    def freedoms(self) -> tuple[effects.Freedom, ...]:
        """Freedoms of joints, and transmissions, in which friction, a spring, a stop or a rotor
        acts."""
        of_joints = effects.freedoms(self.joints, strains=self.strains)
        return (*of_joints, *effects.lines(self.joints, self.strains))

    @cached_property
    def touching(self) -> list[contact.ContactForces]:
        """What acts where bodies may touch."""
        return contact.touching(self.mechanism, self.tree, self.rates, self.strains)

    @property
    def strain_rates(self) -> ca.SX:
        """The rates of the strains, in their order."""
        found = {}
        for freedom in self.freedoms:
            if freedom.friction.bristle and freedom.strain is not None:
                w = ca.mtimes(freedom.J, self.rates)
                found[freedom.rates[0]] = freedom.friction.bristle.stiffness * freedom.bending(w)
        found |= {of.touch.name: of.strain_rate for of in self.touching if of.strain is not None}
        for own in rubbing.rubbing(self.joints, self.strains):
            if own.strain is not None:
                found[bearing_name(own.joint)] = own.strain_rate(self.rates)
        return ca.vertcat(SX(0, 1), *(found[of] for of in self.strains))

    @cached_property
    def gaps(self) -> dict[str, ca.SX]:
        """How far what may meet is apart, negative where it presses or pulls, by name [m, rad]."""
        ends = (end for freedom in self.freedoms for end in freedom.ends)
        places = contact.touches(self.mechanism, self.tree)
        met = {meeting_name(place.name): -place.pressing.depth for place in places}
        slack = effects.slack_gaps(self.joints)
        return {end.name: -end.pressing.depth for end in ends} | met | slack

    @cached_property
    def inertia(self) -> tuple[ca.SX, ca.SX]:
        """Return M = L' H L (n x n), Eq. (10), and H_d L (k x n), the rows of H L that belong to
        dependent rates.

        With L = [1; L_d]:  M = H_aa + H_ad L_d + L_d' (H_dd L_d + H_da).  M's lower triangle
        repeats the upper one.
        """
        L = self.elimination.L
        H = dynamics.generalised_inertia(self.tree) + effects.rotor_inertia(self.freedoms, self.nv)
        a, d = list(self.chart.independent), list(self.chart.dependent)
        if not d:
            return ca.triu2symm(ca.triu(ca.densify(H[a, a]))), SX.zeros(0, self.mobility)
        L_d = L[d, :]
        coupling = ca.mtimes(H[d, d], L_d) + H[d, a]
        M = H[a, a] + ca.mtimes(H[a, d], L_d) + ca.mtimes(L_d.T, coupling)
        return ca.triu2symm(ca.triu(ca.densify(M))), coupling

    @property
    def wrenches(self) -> dict[int, tuple[ca.SX, ca.SX]]:
        """Wrenches of springs between points, of contacts and of a fluid, by node in its axes."""
        return effects.point_wrenches(self.mechanism, self.tree, self.rates, self.strains)

    def tree_forces(self, accelerations: ca.SX, gravity: ca.SX, passive: bool = True) -> ca.SX:
        """Return h (nv): the forces on the tree's rates that w' and the weight need beside springs
        and friction.

        accelerations: w' (nv); gravity: (3) [m/s^2]; passive: whether springs and friction count.
        """
        wrenches = self.wrenches if passive else {}
        h = dynamics.inertia_forces(self.tree, self.rates, accelerations, gravity, wrenches)
        h += effects.rotor_forces(self.freedoms, self.tree, self.rates, accelerations)
        return h - effects.joint_forces(self.freedoms, self.rates) if passive else h

    def bias_forces(self, gravity: ca.SX, passive: bool = True) -> ca.SX:
        """Return C v + G - f (n) under a given gravity, Eqs. (11), (12): L' (h + H b), where b is
        zero but for b_d.

        gravity: (3) [m/s^2]; passive: whether springs and friction count.
        """
        L, b, _ = self.elimination
        forces = ca.mtimes(L.T, self.tree_forces(SX.zeros(self.nv), gravity, passive))
        dependent = list(self.chart.dependent)
        return forces + ca.mtimes(self.inertia[1].T, b[dependent]) if dependent else forces

    def accelerations(self, applied: ca.SX) -> ca.SX:
        """Return v' (n), Eq. (9), under forces S' u (n) beside weight, springs and friction.

        applied: S' u.
        """
        if not self.recursive:
            forces = applied - self.bias_forces(self.gravity)
            return solve_symmetric(self.inertia[0], forces)
        tree, w = self.tree, self.rates
        forces = ca.mtimes(self.elimination.L, applied) + effects.joint_forces(self.freedoms, w)
        rotors = ca.densify(ca.diag(effects.rotor_inertia(self.freedoms, self.nv)))
        wrenches = self.wrenches
        bounds = articulated.largest(self.mechanism, tree) + rotors
        heavy = articulated.heaviness(self.mechanism, tree, bounds)
        x, lost = articulated.accelerations(
            tree, w, forces, rotors, bounds, heavy, self.gravity, wrenches
        )
        x[self.chart.independent[0]] += unless(ca.sumsqr(lost) < HIDDEN**-2)
        return x[list(self.chart.independent)]

    @cached_property
    def recursive(self) -> bool:
        """Tell whether articulated inertias take fewer operations than M: in open trees, from about
        ten rates of a chain on, where no inertia couples rates beside the bodies'.
        """
        n = self.mobility
        if self.rows.names or any(present(line.rotor) for line in effects.lines(self.joints)):
            return False
        return PAIR * self.tree.pairs + n**3 / 3 + 2 * n**2 > MORE * n

    @cached_property
    def actuation(self) -> ca.SX:
        """Return S (actuators x n), the actuated rates S v; forces u of the actuators are S' u on
        the rates v."""
        return ca.mtimes(self.joints.rate_rows(self.mechanism.actuators), self.elimination.L)

    @property
    def gravity(self) -> ca.SX:
        return SX(vector(self.mechanism.gravity))


def conditions(equations: Equations, at: Callable[[ca.SX], ca.SX] = lambda of: of) -> ca.SX:
    """Return the largest |phi| in own units, of rows that are not held what rounded numbers do not
    explain, and how far quaternions are from length 1; at: where all of it but that is told."""
    rows = equations.rows
    found = at(ca.vertcat(rows.phi * ca.DM(1 / rows.units), rows.excess))
    every = ca.vertcat(found, *equations.tree.norms())
    return ca.mmax(ca.fabs(every)) if equations.constrained else SX(0)


def sizes(samples: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of Phi's columns, and those of its rows over these.

    samples: Phi at the reference, where lengths are taken, and near it: where they vanish at the
    reference their largest ones there, and 1 where they are zero everywhere, up to the rounding of
    CAD (a ball on a hinge's axis)
    """
    columns = lengths(samples, 0)
    return columns, lengths((Phi / columns for Phi in samples), 1)


def lengths(samples: Iterable[np.ndarray], axis: int) -> np.ndarray:
    """Return the lengths of rows or columns for `sizes`."""
    found = np.array([np.linalg.norm(Phi, axis=axis) for Phi in samples])
    largest = found.max(axis=0)
    there = largest > ROUNDING * largest.max(initial=0.0)
    return np.where(there, np.where(found[0] > VANISHING * largest, found[0], largest), 1.0)


def scaled(Phi: np.ndarray, sizes: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Return Phi over the sizes of its columns and rows."""
    columns, rows = sizes
    return Phi / columns / rows[:, None]


def smallest_singular(Phi: np.ndarray, rank: int) -> np.ndarray:
    """Return the singular value number `rank` of matrices (..., rows x columns), 1 for rank 0."""
    if rank > LARGE:
        found = [least_singular(one, rank) for one in Phi.reshape(-1, *Phi.shape[-2:])]
        if None not in found:
            return np.array(found).reshape(Phi.shape[:-2])
    return np.linalg.svd(Phi, compute_uv=False)[..., rank - 1] if rank else np.ones(Phi.shape[:-2])


def above(Phi: np.ndarray, rank: int, bound: float) -> np.ndarray:
    """Tell of which matrices (..., rows x columns) the singular value number `rank` is above a
    bound.

    Phi Phi' - bound^2 has as many positive eigenvalues as Phi has singular values above the bound,
    and by Sylvester's law of inertia as many positive pivots. Where one of these is too small to
    tell, and of FEW matrices, singular values are found.
    """
    if prod(Phi.shape[:-2]) <= FEW:
        return smallest_singular(Phi, rank) > bound
    rows = np.ascontiguousarray(np.moveaxis(Phi.reshape(-1, *Phi.shape[-2:]), 0, -1))
    S = (rows[:, None] * rows).sum(axis=2)
    S[np.diag_indices(len(S))] -= bound**2
    unsure, count = DOUBTFUL * np.abs(S).max(axis=(0, 1), initial=0.0), np.zeros(S.shape[2], int)
    weakest = np.full(S.shape[2], np.inf)
    for i in range(len(S)):
        pivot, column = S[i, i].copy(), S[i + 1 :, i]
        weakest, count = np.fmin(weakest, np.abs(pivot)), count + (pivot > 0)
        pivot[pivot == 0] = 1.0
        S[i + 1 :, i + 1 :] -= (column / pivot)[:, None] * column
    found = count >= rank
    doubtful = np.flatnonzero(~(weakest > unsure))
    if rank and doubtful.size:
        found[doubtful] = smallest_singular(np.moveaxis(rows[..., doubtful], -1, 0), rank) > bound
    return found.reshape(Phi.shape[:-2])
