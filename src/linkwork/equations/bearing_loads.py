"""What bearings carry.

The constraints' wrenches follow from what every body needs (`needed_wrenches`), a joint of the tree
carrying what the bodies behind it need beyond what closing joints bring, whose multipliers are

    Phi_d' lambda = (h(q, w, w') - f - S' u - J' phi)_d

with the friction phi of bearings. All are affine in the accelerations v' and in phi.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import body_motion, gears
from linkwork.equations.algebra import SX, Number, cross, dot, present, vector, zero
from linkwork.equations.closure import Cut, line
from linkwork.equations.elimination import solve
from linkwork.equations.equations import Equations
from linkwork.equations.joints import motions_of
from linkwork.equations.joints.kind import transversals
from linkwork.equations.needed_wrenches import (
    bodies_need,
    frames,
    joint_twists,
    known_forces,
    line_tensions,
    on_body,
)
from linkwork.equations.rubbing import Rubbing, rubbing
from linkwork.equations.transmissions import Along
from linkwork.equations.tree import in_base, near_offset
from linkwork.mechanism import GearTeeth, JournalBearing
from linkwork.mechanism.bearing import line_names

Wrench = tuple[str, ca.SX]
"""A body and what acts on it from outside: [moment about its mass centre; force], in the ground's
axes."""


class Placed(NamedTuple):
    """Hold a wrench in the ground's axes: a point, the moment about it, the force."""

    point: ca.SX
    moment: ca.SX
    force: ca.SX

    def about(self, point: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return moment and force about another point."""
        return self.moment + cross(self.point - point, self.force), self.force


@dataclass(frozen=True)
class BearingLoads:
    """Tell what bearings carry in equations, for accelerations v' (n), their friction phi, actuator
    forces u and wrenches from outside on bodies.

    given: multipliers by row, in place of those that follow
    """

    equations: Equations
    dv: ca.SX
    phi: ca.SX
    u: ca.SX
    outside: tuple[Wrench, ...] = ()
    given: Mapping[str, ca.SX] | None = None

    @cached_property
    def rubbing(self) -> tuple[Rubbing, ...]:
        return rubbing(self.equations.joints, self.equations.strains)

    @cached_property
    def accelerations(self) -> ca.SX:
        """Those of the tree's rates, w' = L v' + b."""
        L, b, _ = self.equations.elimination
        return ca.mtimes(L, self.dv) + b

    @cached_property
    def tensions(self) -> dict[str, ca.SX]:
        return line_tensions(self.equations, self.accelerations, self.u)

    @cached_property
    def needed(self) -> dict[str, Placed]:
        """What the joints have to bring to each body."""
        mechanism = self.equations.mechanism
        found, centres = bodies_need(self.equations, self.accelerations, self.tensions)
        for place, name in enumerate(mechanism.bodies):
            for body, wrench in self.outside:
                if body == name:
                    found[2 * place] -= wrench[:3]
                    found[2 * place + 1] -= wrench[3:]
        for gear, multiplier in self.geared:
            for body in dict.fromkeys(body for body, *_ in gear.wrenches):
                place = list(mechanism.bodies).index(body)
                pull = multiplier * on_body(self.equations, gear, body)
                found[2 * place] -= pull[:3]
                found[2 * place + 1] -= pull[3:]
        return {
            name: Placed(centre, *found[2 * place : 2 * place + 2])
            for place, (name, centre) in enumerate(zip(mechanism.bodies, centres, strict=True))
        }

    @cached_property
    def geared(self) -> list[tuple[Along, ca.SX]]:
        """What a unit multiplier of each gear does, and its multiplier."""
        joints = self.equations.joints
        return [
            (gears.pushing(gear, joints), self.multipliers.get(f"{name}: ratio", SX(0)))
            for name, gear in self.equations.mechanism.gears.items()
        ]

    @cached_property
    def multipliers(self) -> Mapping[str, ca.SX]:
        """lambda of each row that is held, by its name."""
        if self.given is not None:
            return self.given
        equations, w = self.equations, self.accelerations
        r = equations.tree_forces(w, equations.gravity)
        actuated = equations.joints.rate_rows(equations.mechanism.actuators)
        r -= ca.mtimes(actuated.T, self.u) + ca.mtimes(rows_of(self.rubbing, equations).T, self.phi)
        for body, wrench in self.outside:
            r -= ca.mtimes(centre_jacobian(equations, body).T, wrench)
        right = SX.sym("right", len(equations.rows.names))
        X, _ = solve(equations.chart, equations.rows.Phi, right)
        work = sum((X[k] * r[k] for k in equations.chart.dependent), SX(0))
        found = ca.gradient(work, right) if right.numel() else SX(0, 1)
        return dict(zip(equations.rows.names, ca.vertsplit(found), strict=True))

    @cached_property
    def known(self) -> dict[str, ca.SX]:
        """The forces that act along the freedoms of joints, by rate: those of gears and bearings
        among them."""
        equations, mechanism = self.equations, self.equations.mechanism
        f = known_forces(equations, self.accelerations, self.u, self.tensions)
        found = dict(zip(mechanism.rates, ca.vertsplit(f), strict=True))
        for own, force in zip(self.rubbing, ca.vertsplit(self.phi), strict=True):
            found[own.rate] += force
        for gear, multiplier in self.geared:
            for label, slope in gear.ratios.items():
                found[label] += slope * multiplier
        return found

    @cached_property
    def closing(self) -> dict[str, tuple[Placed, ...]]:
        """What each closing joint brings to its second body."""
        return {cut.joint: (self.held(cut), *self.driven(cut.joint)) for cut in self.equations.cuts}

    def held(self, cut: Cut) -> Placed:
        """Return what the rows of a closing joint bring to its second body."""
        moment, force = zero(), zero()
        A, that, this = cut.this.node.axes.matrix, cut.that.P, cut.this.P
        for row in cut.rows:
            size = self.multipliers.get(f"{cut.joint}: {row.name}")
            if size is None:
                continue
            if row.length is not None:
                force += size * (that - this) / row.length
                continue
            along = size * ca.mtimes(A, line(cut, row))
            if row.f is not None:
                moment += along
                continue
            force += along
            if row.pitch is not None:
                moment -= row.pitch * along
        return Placed(that, -moment, -force) if cut.swapped else Placed(that, moment, force)

    def driven(self, joint: str) -> Iterator[Placed]:
        """Yield what acts along a joint's freedoms, on its second body."""
        equations, described = self.equations, self.equations.mechanism.pairs[joint]
        first, second = frames(equations, described)
        twists = joint_twists(described, first, second)
        for label, twist in zip(described.rates(joint), twists, strict=True):
            z, s = twist[:3], twist[3:]
            if z.is_zero():
                yield Placed(second.P, zero(), self.known[label] * s / ca.sumsqr(s))
            else:
                yield Placed(second.P, self.known[label] * z / ca.sumsqr(z), zero())

    def carried(self, joint: str, point: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return moment about a point and force that a joint brings to one of its bodies."""
        equations = self.equations
        moment, force = zero(), zero()
        if joint in self.closing:
            for wrench in self.closing[joint]:
                moment, force = plus((moment, force), wrench.about(point))
            return moment, force
        behind = [name for name in self.needed if joint in inward(equations, name)]
        for name in behind:
            moment, force = plus((moment, force), self.needed[name].about(point))
        for name, wrenches in self.closing.items():
            first, second = (body in behind for body in equations.mechanism.pairs[name].connects)
            for wrench in wrenches if first != second else ():
                sign = -1 if second else 1
                moment, force = plus((moment, force), wrench.about(point), sign)
        return moment, force

    @cached_property
    def vectors(self) -> tuple[tuple[tuple[Number, ca.SX], ...], ...]:
        """What each bearing carries: radii and vectors [N]."""
        return tuple(tuple(self._vectors(own)) for own in self.rubbing)

    def lines(self, own: Rubbing) -> dict[str, ca.SX]:
        """Return what a bearing carries along lines, by the names of `line_names`."""
        vectors = [x for _, x in self._vectors(own)]
        parts = [x for x in vectors if x.numel() == 1]
        if not own.teeth:
            joint = self.equations.mechanism.pairs[own.joint]
            R = frames(self.equations, joint)[0].R
            (axis,) = (motion.turn + motion.slide for motion in motions_of(joint))
            across = transversals(axis, np.eye(3)[np.abs(axis).argmin()])
            lines = [in_base(R, e) for e in across]
            parts = [dot(e, x) for x in vectors if x.numel() == 3 for e in lines] + parts
        return dict(zip(line_names(own.joint, own.bearing), parts, strict=True))

    def _vectors(self, own: Rubbing) -> Iterator[tuple[Number, ca.SX]]:
        bearing = own.bearing
        if isinstance(bearing, GearTeeth):
            yield own.radius, self.multipliers.get(f"{own.joint}: ratio", SX(0))
            return
        joint = self.equations.mechanism.pairs[own.joint]
        first, second = frames(self.equations, joint)
        (twist,) = joint_twists(joint, first, second)
        axis = twist[3:] if twist[:3].is_zero() else twist[:3]
        moment, force = self.carried(own.joint, second.P)
        across = force - axis * dot(axis, force)
        if bearing.span is None:
            yield own.radius, across
        else:
            pair = cross(moment, axis) / bearing.span
            yield own.radius, across / 2 + pair
            yield own.radius, across / 2 - pair
        if isinstance(bearing, JournalBearing) and present(bearing.thrust_radius):
            yield bearing.thrust_radius, dot(axis, force)


def plus(
    one: tuple[ca.SX, ca.SX], other: tuple[ca.SX, ca.SX], sign: int = 1
) -> tuple[ca.SX, ca.SX]:
    """Return the sum of two wrenches about one point."""
    return one[0] + sign * other[0], one[1] + sign * other[1]


def inward(equations: Equations, body: str) -> set[str]:
    """Return the joints between ground and a body in the tree."""
    return {node.joint for node in equations.tree.path(equations.tree.node(body))}


def rows_of(own: Sequence[Rubbing], equations: Equations) -> ca.SX:
    """Return J (K x nv), the rows of the rates of bearings."""
    return ca.vertcat(SX(0, equations.nv), *(each.J for each in own))


def centre_jacobian(equations: Equations, body: str) -> ca.SX:
    """Return J (6 x nv) of a body's mass centre, [omega; v]."""
    node = equations.tree.node(body)
    centre = vector(equations.mechanism.bodies[body].centre_of_mass)
    return body_motion.jacobian(equations.tree, node, near_offset(node, centre))
