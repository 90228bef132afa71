"""Contact forces: surfaces that press by the law of `impact`, and rub.

With the gap g of a place and its gradient G for a motion of the second body there (`surfaces`), C
for a turn about it, and the relative velocity u of the bodies, of which u_t slides along the
surface, and omega,

    on the second body  F(-g, -g') G + f,    g' = G . u + C . omega
    f = -m(|u_t|) N u_t / sqrt(|u_t|^2 + r^2)
    m(s) = m_c + (m_s - m_c) exp(-(s / s_0)^2),    N = F |G|

or, of a bristle with the force s over the normal force,

    f = -N (s + damping z'),   s' = stiffness z' + omega_1 x s,   z' = u_t - |u_t| s / m(|u_t|)

and F C as a moment; the opposite on the first, at the same points: nothing but what dissipates
takes energy.
Source: Armstrong-Helouvry, Dupont & Canudas de Wit, Automatica 30 (1994) 1083-1138 (m);
Canudas de Wit, Olsson, Astrom & Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425 (z).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from linkwork.equations.algebra import Number, cross, dot, present, zero
from linkwork.equations.impact import Pressing
from linkwork.equations.meeting import TINY, Meeting
from linkwork.equations.surfaces import meetings
from linkwork.equations.tree import Node, Tree
from linkwork.mechanism import Mechanism, Sliding
from linkwork.mechanism.contact import touch_names


@dataclass(frozen=True)
class Touch:
    """Hold a place where two nodes' bodies may touch, by its name, the law that they press by, and
    that they rub by.
    """

    name: str
    nodes: tuple[Node, Node]
    meeting: Meeting
    pressing: Pressing
    friction: Sliding

    def at(
        self, motions: Sequence[tuple[ca.SX, ca.SX]], strain: ca.SX | None = None
    ) -> ContactForces:
        """Return what acts for motions (omega, v of the origin) of both nodes, and a bristle's
        force, in the ground's axes."""
        return ContactForces(self, tuple(motions), strain)


@dataclass(frozen=True)
class ContactForces:
    """Tell forces on the second body, in the ground's axes, for motions of both.

    strain: the force of its bristle over the normal force, where a run has it
    """

    touch: Touch
    motions: tuple[tuple[ca.SX, ca.SX], ...]
    strain: ca.SX | None = None

    def apart(self, point: ca.SX) -> ca.SX:
        """Return the velocity of the second body against the first at a point."""
        first, second = (
            v + cross(omega, point - node.O)
            for node, (omega, v) in zip(self.touch.nodes, self.motions, strict=True)
        )
        return second - first

    @cached_property
    def rate(self) -> ca.SX:
        """The rate of the depth, -g'."""
        meeting, ((omega_1, _), (omega_2, _)) = self.touch.meeting, self.motions
        found = -dot(meeting.gradient, self.apart(meeting.centre))
        return found if meeting.couple is None else found - dot(meeting.couple, omega_2 - omega_1)

    @cached_property
    def pressed(self) -> ca.SX:
        """The force that presses."""
        return self.touch.pressing.force(self.rate) * self.touch.meeting.gradient

    @cached_property
    def sliding(self) -> ca.SX:
        """The velocity along the surface."""
        return self.along(self.apart(self.touch.meeting.point))

    @cached_property
    def rubbed(self) -> ca.SX:
        """The force that rubs."""
        law, gradient = self.touch.friction, self.touch.meeting.gradient
        if not rubs(law):
            return zero()
        normal = self.touch.pressing.force(self.rate) * ca.sqrt(ca.sumsqr(gradient))
        square = ca.sumsqr(self.sliding)
        if self.strain is not None and law.bristle:
            return -normal * self.along(self.strain + law.bristle.damping * self.bending)
        return -coefficient(law, square) * normal * self.sliding / ca.sqrt(square + law.rate**2)

    def along(self, vector: ca.SX) -> ca.SX:
        """Return the part of a vector along the surface."""
        normal = self.touch.meeting.normal
        return vector - normal * dot(normal, vector)

    @property
    def bending(self) -> ca.SX:
        """The rate z' at which the bristle bends."""
        u = self.sliding
        return bending(u, self.strain, coefficient(self.touch.friction, ca.sumsqr(u)))

    @property
    def strain_rate(self) -> ca.SX:
        """The rate of the strain, which turns with the first body; apart a damped bristle
        straightens."""
        bristle, s = self.touch.friction.bristle, self.strain
        assert bristle is not None and s is not None
        bent = bristle.stiffness * self.bending
        if present(bristle.damping):
            loose = -bristle.stiffness / bristle.damping * s
            bent = ca.if_else(self.touch.pressing.depth > 0, bent, loose)
        return bent + cross(self.motions[0][0], s)

    @property
    def power(self) -> ca.SX:
        """What dissipates."""
        pressing = self.touch.pressing
        return dot(self.rubbed, self.sliding) - pressing.dissipative(self.rate) * self.rate

    def wrenches(self) -> Iterator[tuple[Node, ca.SX, ca.SX]]:
        """Yield the nodes that move with the moment about their origins and the force on them, in
        the ground's axes."""
        meeting = self.touch.meeting
        for sign, node in zip((-1, 1), self.touch.nodes, strict=True):
            if node.index >= 0:
                moment = cross(meeting.centre - node.O, self.pressed)
                if meeting.couple is not None:
                    moment += self.touch.pressing.force(self.rate) * meeting.couple
                if rubs(self.touch.friction):
                    moment += cross(meeting.point - node.O, self.rubbed)
                yield node, sign * moment, sign * (self.pressed + self.rubbed)


def bending(w: ca.SX, strain: ca.SX | None, sliding: Number) -> ca.SX:
    """Return the rate z' = w - |w| s / D at which a bristle with the force s bends."""
    assert strain is not None
    rate = ca.fabs(w) if w.numel() == 1 else ca.sqrt(ca.sumsqr(w) + TINY)
    return w - rate * strain / sliding


def rubs(law: Sliding) -> bool:
    """Tell whether there is any friction."""
    return present(law.coefficient) or (law.static is not None and present(law.static))


def coefficient(law: Sliding, square: ca.SX) -> ca.SX:
    """Return the coefficient of friction for the square of a sliding rate."""
    if law.static is None:
        return ca.SX(law.coefficient)
    fallen = ca.exp(-square / law.stribeck_rate**2)
    return law.coefficient + (law.static - law.coefficient) * fallen


def touches(mechanism: Mechanism, tree: Tree) -> Iterator[Touch]:
    """Yield the places where bodies may touch."""
    for name, contact in mechanism.contacts.items():
        first, second = (tree.node(body) for body in contact.connects)
        for own, meeting in zip(touch_names(name, contact), meetings(tree, contact), strict=True):
            pressing = Pressing(contact, -meeting.gap)
            yield Touch(own, (first, second), meeting, pressing, contact.friction)


def touching(
    mechanism: Mechanism, tree: Tree, rates: ca.SX, strains: Mapping[str, ca.SX] | None = None
) -> list[ContactForces]:
    """Return what acts where bodies may touch, for the tree's rates and the strains of bristles, by
    place."""
    strains = strains or {}
    found = list(touches(mechanism, tree))
    if not found:
        return []
    omega = tree.angular_velocities(rates)
    v = tree.velocities(omega, rates)

    def motion(node: Node) -> tuple[ca.SX, ca.SX]:
        A = node.axes.matrix
        return ca.mtimes(A, omega[node.index]), ca.mtimes(A, v[node.index])

    return [
        touch.at([motion(node) for node in touch.nodes], strains.get(touch.name)) for touch in found
    ]
