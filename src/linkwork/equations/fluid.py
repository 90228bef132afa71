"""Forces of a fluid on bodies that move in it.

With omega and u the angular velocity and the velocity against the fluid of a frame's origin, in the
frame's axes, density rho and viscosity mu, the force f and the moment n are

of a box with the sides b, s their mean:
    f_i = -3 pi mu s u_i   - rho/2 b_j b_k |u_i| u_i
    n_i = -pi mu s^3 w_i   - rho/64 b_i (b_j^4 + b_k^4) |w_i| w_i

of an ellipsoid with the half axes a, volume V, s = 2/3 (a_1 + a_2 + a_3), g_i = a_j a_k:
    f = p x omega + c_M rho V omega x u + c_K rho (e x u) x u - (3 pi mu s + rho |u| A) u
    n = p x u + h x omega                                     - (pi mu s^3 + rho |m|) omega
    p = rho diag(m_a) u,  h = rho diag(I_a) omega        momenta of the fluid that is carried along
    P = pi sqrt(sum g_i^4 u_i^2 / sum g_i^2 u_i^2)       area shown to the flow
    A = c_b P + c_s (P_max - P)
    e_i = P (sum g_i^2 u_i^2) g_i^2 u_i / (|u| sum g_i^4 u_i^2)
    m_i = omega_i (c_a J_i + c_s (J_max - J_i)),  J_i = 8/15 pi a_i max(a_j, a_k)^4

What would follow from accelerations, as if the fluid that is carried along were heavy, is left out:
m_a and I_a act by their momenta alone. The added masses are Lamb's (Hydrodynamics, sec. 114, 373):

    m_a = V k_i / (2 - k_i),   k_i = a_1 a_2 a_3 int_0^inf dx / ((a_i^2 + x) sqrt(prod (a_j^2 + x)))
    I_a = V/5 (a_j^2 - a_k^2)^2 (k_k - k_j) / (2 (a_j^2 - a_k^2) + (a_j^2 + a_k^2) (k_j - k_k))

Source: the models are those of MuJoCo 4 (documentation, Computation/Fluid forces), for which see
also Andersen, Pesavento & Wang, J. Fluid Mechanics 541 (2005) 65-90.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, cross, dot, present, vector
from linkwork.equations.frames import frame_matrix
from linkwork.equations.tree import Node, Tree, offset
from linkwork.mechanism import BoxDrag, EllipsoidDrag, Fluid, Mechanism

TINY = 1e-200  # square of a velocity that has no direction [m^2/s^2]
ALIKE = (
    1e-6  # half axes that differ by less carry no fluid when they turn, as parts of the greatest
)


class AddedMass(NamedTuple):
    """The fluid that an ellipsoid carries along, by axis, for a density of one: its mass [m^3] when
    it slides and its inertia [m^5] when it turns."""

    mass: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class Resistance:
    """Hold what the fluid does to a node's body: force and moment about the middle of what it acts
    on, and the motion there (omega; v), all in the ground's axes; arm: from the node's origin."""

    node: Node
    arm: ca.SX
    force: ca.SX
    moment: ca.SX
    motion: tuple[ca.SX, ca.SX]

    @property
    def wrench(self) -> tuple[Node, ca.SX, ca.SX]:
        """The node, the moment about its origin and the force."""
        return self.node, self.moment + cross(self.arm, self.force), self.force

    @property
    def power(self) -> ca.SX:
        """What it brings into the mechanism; of wind also more than none."""
        omega, v = self.motion
        return dot(self.moment, omega) + dot(self.force, v)


def resisting(mechanism: Mechanism, tree: Tree, rates: ca.SX) -> Iterator[Resistance]:
    """Yield what the fluid does for the tree's rates; nothing where there is none."""
    if not felt(mechanism):
        return
    fluid, omegas = mechanism.fluid, tree.angular_velocities(rates)
    velocities = tree.velocities(omegas, rates)
    for drag in mechanism.drags.values():
        # The motion in the ground's axes, and in those of the frame.
        node = tree.node(drag.body)
        A, arm = node.axes.matrix, offset(node, vector(drag.frame.position))
        omega = ca.mtimes(A, omegas[node.index])
        v = ca.mtimes(A, velocities[node.index]) + cross(omega, arm)
        R = ca.mtimes(node.R.matrix, SX(frame_matrix(drag.frame)))
        seen = ca.mtimes(R.T, omega), ca.mtimes(R.T, v - SX(vector(fluid.wind)))
        box = isinstance(drag, BoxDrag)
        acting = on_box(drag, fluid, *seen) if box else on_ellipsoid(drag, fluid, *seen)
        force, moment = (ca.mtimes(R, part) for part in acting)
        yield Resistance(node, arm, force, moment, (omega, v))


def felt(mechanism: Mechanism) -> bool:
    """Tell whether there is a fluid and anything that it acts on."""
    return bool(mechanism.drags) and any(
        map(present, (mechanism.fluid.density, mechanism.fluid.viscosity))
    )


def in_wind(mechanism: Mechanism) -> bool:
    """Tell whether a fluid that moves acts on anything: its forces have no potential."""
    return felt(mechanism) and any(mechanism.fluid.wind)


def on_box(drag: BoxDrag, fluid: Fluid, omega: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return force and moment on a box, in its axes."""
    b, (x, y, z) = SX(vector(drag.size)), drag.size
    side = (x + y + z) / 3
    areas = ca.vertcat(y * z, z * x, x * y) / 2
    turned = b * ca.vertcat(y**4 + z**4, z**4 + x**4, x**4 + y**4) / 64
    force = -3 * pi * fluid.viscosity * side * u - fluid.density * areas * ca.fabs(u) * u
    moment = (
        -pi * fluid.viscosity * side**3 * omega - fluid.density * turned * ca.fabs(omega) * omega
    )
    return force, moment


def on_ellipsoid(drag: EllipsoidDrag, fluid: Fluid, omega: ca.SX, u: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return force and moment on an ellipsoid, in its axes."""
    a, rho = np.array(drag.radii), fluid.density
    volume, (middle, most) = 4 / 3 * pi * a.prod(), sorted(a)[1:]
    # The fluid that it carries along.
    mass, inertia = (
        SX(np.array(lamb) if own is None else vector(own))
        for lamb, own in zip(added(a), (drag.added_mass, drag.added_inertia), strict=True)
    )
    p, h = rho * mass * u, rho * inertia * omega
    # What it shows the flow, and how that slants.
    speed = ca.sqrt(ca.sumsqr(u) + TINY)
    g = np.roll(a, -1) * np.roll(a, -2)
    g = SX(g / g.max())
    slant, shown = ca.sumsqr(g * u), ca.sumsqr(g**2 * u)
    largest = pi * middle * most
    area = largest * ca.sqrt((shown + TINY) / (slant + TINY))
    normal = area * slant / (speed * (shown + TINY)) * g**2 * u
    faced = drag.blunt * area + drag.slender * (largest - area)
    # Turning.
    J = np.array([8 / 15 * pi * a[i] * max(a[i - 1], a[i - 2]) ** 4 for i in range(3)])
    greatest = 8 / 15 * pi * middle * most**4
    turned = omega * (drag.angular * SX(J) + drag.slender * SX(greatest - J))
    # Momenta, lifts, drag; Stokes' drag is that of a sphere.
    sphere = 2 / 3 * a.sum()
    force = cross(p, omega) + drag.magnus * rho * volume * cross(omega, u)
    force += drag.lift * rho * cross(cross(normal, u), u)
    force -= (3 * pi * fluid.viscosity * sphere + rho * speed * faced) * u
    moment = cross(p, u) + cross(h, omega)
    quadratic = rho * ca.sqrt(ca.sumsqr(turned) + TINY)
    return force, moment - (pi * fluid.viscosity * sphere**3 + quadratic) * omega


def added(a: np.ndarray) -> AddedMass:
    """Return the fluid that an ellipsoid with the half axes a carries along."""
    from scipy.special import elliprd

    volume, square = 4 / 3 * pi * a.prod(), a**2
    near, far = np.roll(square, -1), np.roll(square, -2)
    k = 2 / 3 * a.prod() * elliprd(near, far, square)
    gap, both, apart = near - far, near + far, np.roll(k, -1) - np.roll(k, -2)
    round_ = abs(gap) < ALIKE * square.max()
    turned = np.where(
        round_, 0.0, -gap * gap * apart / np.where(round_, 1.0, 2 * gap + both * apart)
    )
    return AddedMass(volume * k / (2 - k), volume * turned / 5)
