"""What acts besides actuators and weight: friction, springs, stops and rotors in joints, springs
between points.

A freedom of a joint has a displacement x and rates w; for a turn or slide both are one number, for
a free turn x is the rotation vector of R_12 (the short way) and w the relative angular velocity,
both in F1's axes:

    force      -k (x - rest) - d w - (viscous + coulomb / sqrt(w . w + r^2)) w
    potential  k (x - rest) . (x - rest) / 2
    powers     k + k_1 (x - rest) + ... for k, of a free turn in |x|; viscous + c_1 |w| + ... for
               viscous
    dry        with Stribeck's rise D(w) for coulomb; in a run with a bristle its force s instead:
               -s - damping z',  s' = stiffness z',  z' = w - |w| s / D(w)
    friction   vanishes with w, and is stiff at rest: d(force)/dw = -(viscous + coulomb / r) there
    rotor      kinetic energy J w . w / 2:  J adds to the tree's inertia, by the rows that give w
               from the tree's rates
    stop       force and potential of `impact` past an end, against it; that of a free turn bounds
               |x|, which grows with  x . w / |x|

The same acts along transmissions, whose springs may have a range of lengths without force.

A spring between points at the distance l pulls with the tension  k (l - l_0) + d l'. Surfaces that
meet press and rub (`contact`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from linkwork.equations import contact, fluid
from linkwork.equations.algebra import SX, Number, cross, dot, present, vector
from linkwork.equations.dynamics import add
from linkwork.equations.impact import Pressing
from linkwork.equations.joint_map import JointMap, derivative
from linkwork.equations.tree import Node, Tree, near_offset
from linkwork.mechanism import Friction, LoadedLength, Mechanism, PointSpring, SlackSpring, Spring
from linkwork.mechanism.impact import Stop
from linkwork.mechanism.joints import TURN, JointFreedom
from linkwork.mechanism.limits import end_names, line_ends, slack_ends

TINY = 1e-300  # square of a length that is not divided by zero
NONE: Mapping[str, ca.SX] = {}


@dataclass(frozen=True)
class StopEnd:
    """Hold an end of a stop by its name, and how the depth past it grows with the rates: outward .
    w."""

    name: str
    pressing: Pressing
    outward: ca.SX

    def drag(self, w: ca.SX) -> ca.SX:
        """Return what rates add to the stop's force on the freedom."""
        return -self.outward * self.pressing.dissipative(dot(self.outward, w))


@dataclass(frozen=True)
class Freedom:
    """Hold a freedom, or a transmission, in which something acts: displacement x, rows J (rates x
    nv) with w = J w_tree, and what acts.

    rates: names of w, or the one of a transmission; ends: of its stop; strain: the force of its
        bristle, where a run has it
    """

    rates: tuple[str, ...]
    x: ca.SX
    J: ca.SX
    friction: Friction
    spring: Spring
    rotor: Number
    ends: tuple[StopEnd, ...] = ()
    strain: ca.SX | None = None

    def force(self, w: ca.SX) -> ca.SX:
        """Return the force of spring, friction and stops on the freedom."""
        return self.pull + self.drag(w)

    @property
    def pull(self) -> ca.SX:
        """The force of spring and stops at rest."""
        pull = -polynomial(self.spring.pulls, self.reach) * self.stretch
        return sum((-end.outward * end.pressing.elastic for end in self.ends), pull)

    @property
    def stretch(self) -> ca.SX:
        """How far the spring is from where it rests."""
        beyond = self.x - self.spring.rest
        if not isinstance(self.spring, SlackSpring) or not present(self.spring.slack):
            return beyond
        return ca.fmax(beyond - self.spring.slack, 0) + ca.fmin(beyond, 0)

    @property
    def reach(self) -> ca.SX:
        """The stretch by which the stiffness grows: with its sign, or the angle of a free turn."""
        return self.stretch if self.stretch.is_scalar() else size_of(self.stretch)

    def drag(self, w: ca.SX) -> ca.SX:
        """Return the force of friction, damper and what stops take on the freedom."""
        resistance = polynomial(self.friction.smooth, size_of(w)) + self.spring.damping
        drag = sum((end.drag(w) for end in self.ends), -resistance * w)
        if self.strain is not None and self.friction.bristle:
            return drag - self.strain - self.friction.bristle.damping * self.bending(w)
        if self.dry:
            drag -= self.sliding(w) / self.softened(w) * w
        return drag

    @property
    def dry(self) -> bool:
        """Whether there is friction that does not vanish with the rate."""
        return any(map(present, self.friction.dry))

    def sliding(self, w: ca.SX) -> Number:
        """Return the dry friction of steady sliding, D."""
        sliding, static = self.friction.coulomb, self.friction.static
        return sliding if static is None else sliding + (static - sliding) * self.fallen(w)

    def fallen(self, w: ca.SX) -> ca.SX:
        """Return exp(-|w|^2 / s^2), the part of the way from sliding to static friction."""
        return ca.exp(-ca.sumsqr(w) / self.friction.stribeck_rate**2)

    def bending(self, w: ca.SX) -> ca.SX:
        """Return the rate z' at which a bristle bends."""
        return contact.bending(w, self.strain, self.sliding(w))

    def softened(self, w: ca.SX) -> ca.SX:
        """Return sqrt(w . w + r^2), the length of w that Coulomb friction sees."""
        return ca.sqrt(ca.sumsqr(w) + self.friction.coulomb_rate**2)

    def acceleration(self, tree: Tree, rates: ca.SX, accelerations: ca.SX) -> ca.SX:
        """Return the derivative of the freedom's rates, J w' + (dJ/dt) w, for those of the tree."""
        turning = ca.mtimes(derivative(self.J, tree, rates), rates)
        return ca.mtimes(self.J, accelerations) + turning

    @property
    def potential(self) -> ca.SX:
        shares = [k / power for power, k in enumerate(self.spring.pulls, start=2)]
        stored = polynomial(shares, self.reach) * ca.sumsqr(self.stretch)
        return sum((end.pressing.potential for end in self.ends), stored)


def polynomial(coefficients: Sequence[Number], x: ca.SX) -> Number:
    """Return c_0 + c_1 x + c_2 x^2 + ..."""
    if not any(map(present, coefficients[1:])):
        return coefficients[0]
    total = SX(0)
    for c in reversed(coefficients):
        total = total * x + c
    return total


def size_of(x: ca.SX) -> ca.SX:
    """Return |x| of a displacement or of rates."""
    return ca.fabs(x) if x.is_scalar() else ca.sqrt(ca.sumsqr(x) + TINY)


def ends(part: JointFreedom, x: ca.SX) -> Iterator[StopEnd]:
    """Yield the ends of a freedom's stop; that of a free turn bounds the length of x."""
    effects, names = part.effects, end_names(part)
    size, along = x, SX(1)
    if part.name == TURN:
        size = ca.sqrt(ca.sumsqr(x) + TINY)
        along = x / size
    for side, bound in effects.ends.items():
        if side == "upper" or part.name != TURN:
            yield stop_end(names[side], effects.stop, side, size - bound, along)


def stop_end(
    name: str, stop: Stop | None, side: str, beyond: ca.SX, along: ca.SX | None = None
) -> StopEnd:
    """Return an end of a stop; beyond: how far the size of x is above it, along: its gradient."""
    assert stop is not None
    sign, gradient = 1 if side == "upper" else -1, SX(1) if along is None else along
    return StopEnd(name, Pressing(stop, sign * beyond), sign * gradient)


def slack_gaps(joints: JointMap) -> dict[str, ca.SX]:
    """Return how far lengths are within the slack of springs along them, by the end's name."""
    found = {}
    for name, line in joints.mechanism.transmissions.items():
        if isinstance(line, LoadedLength):
            for end, (side, at) in slack_ends(name, line).items():
                found[end] = side * (at + line.spring.rest - joints.position(name))
    return found


def freedoms(
    joints: JointMap, every: bool = False, strains: Mapping[str, ca.SX] = NONE
) -> tuple[Freedom, ...]:
    """Return the freedoms of joints in which something acts, or every freedom; strains: forces of
    bristles, by the freedom's first rate."""
    found = []
    for name, joint in joints.mechanism.joints.items():
        for part in joint.parts(name):
            own = part.effects
            if every or any(map(present, own.loads)):
                x = ca.vertcat(*map(joints.position, part.coordinates))
                x = rotation_vector(x) if part.name == TURN else x
                J = joints.rate_rows(part.rates)
                stop = tuple(ends(part, x))
                strain = strains.get(part.rates[0])
                acts = own.friction, own.spring, own.rotor
                found.append(Freedom(part.rates, x, J, *acts, stop, strain))
    return tuple(found)


def lines(joints: JointMap, strains: Mapping[str, ca.SX] = NONE) -> tuple[Freedom, ...]:
    """Return the transmissions along which something acts beside an actuator; strains: forces of
    bristles, by name."""
    found = []
    for name, line in joints.mechanism.transmissions.items():
        if isinstance(line, LoadedLength) and any(map(present, line.loads)):
            x, J = joints.position(name), joints.rate_row(name)
            own, ends, names = (line.friction, line.spring, line.inertia), [], line_ends(name, line)
            for side, bound in line.ends.items():
                ends.append(stop_end(names[side], line.stop, side, x - bound))
            found.append(Freedom((name,), x, J, *own, tuple(ends), strains.get(name)))
    return tuple(found)


def rotation_vector(p: ca.SX) -> ca.SX:
    """Return the rotation vector of a unit quaternion (w, x, y, z), of length at most pi: 2
    atan2(|u|, w) u / |u|."""
    w, u = p[0], p[1:]
    length = ca.sqrt(ca.sumsqr(u) + TINY)
    return 2 * ca.atan2(length, ca.fabs(w)) / length * ca.if_else(w < 0, -u, u)


def joint_forces(freedoms: tuple[Freedom, ...], rates: ca.SX) -> ca.SX:
    """Return the forces (nv) of friction and springs in joints on the tree's rates."""
    return sum(
        (ca.mtimes(f.J.T, f.force(ca.mtimes(f.J, rates))) for f in freedoms),
        SX.zeros(rates.numel()),
    )


def rotor_inertia(freedoms: tuple[Freedom, ...], nv: int) -> ca.SX:
    """Return what rotors add to the tree's generalised inertia, J' J_rotor J."""
    rotors = (f.rotor * ca.mtimes(f.J.T, f.J) for f in freedoms if present(f.rotor))
    return sum(rotors, SX(nv, nv))


def rotor_forces(
    freedoms: tuple[Freedom, ...], tree: Tree, rates: ca.SX, accelerations: ca.SX
) -> ca.SX:
    """Return what rotors add to the inertia forces, J' J_rotor (J w' + (dJ/dt) w)."""
    total = SX.zeros(rates.numel())
    for f in freedoms:
        if present(f.rotor):
            total += f.rotor * ca.mtimes(f.J.T, f.acceleration(tree, rates, accelerations))
    return total


@dataclass(frozen=True)
class Pull:
    """Hold a spring between two points: nodes, vectors from their origins in their axes, gap and
    length.

    gap: from the first to the second point, in the ground's axes
    """

    spring: PointSpring
    nodes: tuple[Node, Node]
    arms: tuple[ca.SX, ca.SX]
    gap: ca.SX
    length: ca.SX

    @property
    def needs_direction(self) -> bool:
        """Whether the tension at length zero, k (-l_0) + d l', needs a direction to act in."""
        return present(self.spring.rest_length) or present(self.spring.damping)

    @property
    def potential(self) -> ca.SX:
        return self.spring.stiffness * (self.length - self.spring.rest_length) ** 2 / 2

    def force(self, apart: ca.SX) -> ca.SX:
        """Return the force on the first point, for the relative velocity of the second.

        A spring without rest length and damping pulls by its gap, which needs no direction where
        the ends meet.
        """
        spring = self.spring
        if not self.needs_direction:
            return spring.stiffness * self.gap
        direction = self.gap / self.length
        tension = spring.stiffness * (self.length - spring.rest_length) + spring.damping * dot(
            direction, apart
        )
        return tension * direction


def pulls(mechanism: Mechanism, tree: Tree) -> Iterator[Pull]:
    """Yield the springs between points."""
    for spring in mechanism.springs.values():
        first, second = (tree.node(body) for body in spring.connects)
        near, far = (vector(point) for point in spring.points)
        gap = tree.point(second, far) - tree.point(first, near)
        length = ca.sqrt(ca.sumsqr(gap))
        arms = near_offset(first, near), near_offset(second, far)
        yield Pull(spring, (first, second), arms, gap, length)


def point_wrenches(
    mechanism: Mechanism, tree: Tree, rates: ca.SX, strains: Mapping[str, ca.SX] = NONE
) -> dict[int, tuple[ca.SX, ca.SX]]:
    """Return the wrenches (moment about the node's origin, force) of springs between points, of
    weights that are carried, of fluid and of contacts, by node in its axes."""
    wrenches: dict[int, tuple[ca.SX, ca.SX]] = {}
    omega = tree.angular_velocities(rates) if mechanism.springs else []
    v = tree.velocities(omega, rates) if mechanism.springs else []
    for pull in pulls(mechanism, tree):
        first, second = (
            ca.mtimes(node.axes.matrix, v[node.index] + cross(omega[node.index], arm))
            for node, arm in zip(pull.nodes, pull.arms, strict=True)
        )
        pulled = pull.force(second - first)
        for sign, node, arm in zip((1, -1), pull.nodes, pull.arms, strict=True):
            if node.index >= 0:
                force = ca.mtimes(node.axes.matrix.T, sign * pulled)
                add(wrenches, node.index, cross(arm, force), force)
    for node, arm, force in lifted(mechanism, tree):
        near = ca.mtimes(node.axes.matrix.T, force)
        add(wrenches, node.index, cross(arm, near), near)
    acting = [touch.wrenches() for touch in contact.touching(mechanism, tree, rates, strains)]
    acting += [(of.wrench,) for of in fluid.resisting(mechanism, tree, rates)]
    for wrenches_there in acting:
        for node, moment, force in wrenches_there:
            add(
                wrenches,
                node.index,
                *(ca.mtimes(node.axes.matrix.T, part) for part in (moment, force)),
            )
    return wrenches


def lifted(mechanism: Mechanism, tree: Tree) -> Iterator[tuple[Node, ca.SX, ca.SX]]:
    """Yield of each weight that is carried the node, the vector from its origin to the point in its
    axes, and the force in the ground's."""
    for lift in mechanism.lifts.values():
        node = tree.node(lift.body)
        yield (
            node,
            near_offset(node, vector(lift.point)),
            -lift.mass * SX(vector(mechanism.gravity)),
        )


def stored(mechanism: Mechanism, tree: Tree) -> ca.SX:
    """Return the potential energy of springs between points, of weights that are carried and of
    contacts."""
    total = sum((pull.potential for pull in pulls(mechanism, tree)), SX(0))
    for lift in mechanism.lifts.values():
        place = tree.point(tree.node(lift.body), vector(lift.point))
        total += lift.mass * dot(SX(vector(mechanism.gravity)), place)
    return sum((of.pressing.potential for of in contact.touches(mechanism, tree)), total)
