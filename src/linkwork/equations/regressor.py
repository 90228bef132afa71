"""Regressor: inverse dynamics as a linear function of masses, moments, friction and rotors.

    M v' + C v + G - f = Y(q, v, v') pi + r(q, v, v')

pi are, of every body, m, m c and the inertia I_O about the origin of its frame, in its axes, and of
every freedom of a joint the coefficients of viscous friction (a damper's included), Coulomb
friction and rotor inertia; r is what springs, stops, contacts, transmissions and static friction
take. In a body's axes, with the acceleration a of its origin less gravity, and [x] the matrix of x
cross,

    F = m a + ([alpha] + [omega][omega]) m c,      N = m c x a + I_O alpha + omega x I_O omega.

Source: Khalil & Dombre 2002, ch. 9 and 12 (linearity in the inertial parameters).
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from linkwork.equations import body_motion, effects
from linkwork.equations.algebra import SX, cross, point_acceleration, spin, zero
from linkwork.equations.equations import Equations
from linkwork.equations.moments import Moments
from linkwork.equations.tree import near_offset
from linkwork.mechanism import Mechanism
from linkwork.mechanism.joints import SLIDES, OneFreedom

ELEMENTS = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
OF_BODIES = (
    "mass",
    *(f"first_moment.{axis}" for axis in "xyz"),
    *(f"inertia_at_origin.{name}" for name in ELEMENTS),
)


def names(mechanism: Mechanism) -> tuple[str, ...]:
    """Name the parameters pi: "platform.mass", "platform.first_moment.x",
    "slide_1.friction.viscous" ..."""
    return (
        *(f"{body}.{name}" for body in mechanism.bodies for name in OF_BODIES),
        *of_freedoms(mechanism),
    )


def values(mechanism: Mechanism) -> np.ndarray:
    """Return the parameters pi (k) of a description, in the order of `names` [kg, kg m, kg m^2, N
    s/m, N ...]."""
    pi: list[float] = []
    for body in mechanism.bodies.values():
        moments = Moments.of_body(body, np.zeros(3))
        pi += [moments.m, *moments.h, *(moments.I[place] for place in ELEMENTS.values())]
    for joint in mechanism.pairs.values():
        for own in joint.effects().values():
            pi += [own.friction.viscous + own.spring.damping, own.friction.coulomb, own.rotor]
    return np.array(pi)


def units(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the units of the parameters pi (k), in the order of `names`."""
    of_body = ("kg", *3 * ["kg m"], *len(ELEMENTS) * ["kg m^2"])
    found = list(of_body * len(mechanism.bodies))
    for joint in mechanism.pairs.values():
        for freedom in joint.effects():
            slides = freedom in SLIDES
            found += ["N s/m", "N", "kg"] if slides else ["N m s/rad", "N m", "kg m^2"]
    return tuple(found)


def sizes(mechanism: Mechanism, length: float, pace: float) -> np.ndarray:
    """Return the energies [J] (k) that a unit of each parameter takes on motions by a length [m],
    or 1 rad, at a pace [1/s]."""
    found: list[float] = []
    for _ in mechanism.bodies:
        found += [length**2 * pace**2] + 3 * [length * pace**2] + len(ELEMENTS) * [pace**2]
    for joint in mechanism.pairs.values():
        for freedom in joint.effects():
            own = length if freedom in SLIDES else 1.0
            found += [own**2 * pace, own, own**2 * pace**2]
    return np.array(found)


def of_freedoms(mechanism: Mechanism) -> Iterator[str]:
    """Name the parameters of the joints' freedoms, as in the description."""
    for name, joint in mechanism.pairs.items():
        for freedom in joint.effects():
            part = "" if isinstance(joint, OneFreedom) else f".{freedom}"
            yield from (
                f"{name}.friction{part}.viscous",
                f"{name}.friction{part}.coulomb",
                f"{name}.rotor_inertia{part}",
            )


def regressor(equations: Equations, dv: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return Y (n x k) and r (n) for the accelerations v' (n)."""
    L, b, _ = equations.elimination
    tree, w, dw = equations.tree, equations.rates, ca.mtimes(L, dv) + b
    columns = [body_columns(equations, w, dw), freedom_columns(equations, w, dw)]
    rest = spring_forces(equations) + line_forces(equations, w, dw)
    return ca.mtimes(L.T, ca.horzcat(SX(len(tree.rates), 0), *columns)), ca.mtimes(L.T, rest)


def body_columns(equations: Equations, w: ca.SX, dw: ca.SX) -> ca.SX:
    """Return the forces (nv x 10 r) on the tree's rates that a unit of each body's parameters
    takes."""
    tree, mechanism = equations.tree, equations.mechanism
    omega = tree.angular_velocities(w)
    alpha, a = tree.accelerations(omega, w, dw, -equations.gravity)
    blocks = [SX(len(tree.rates), 0)]
    for name in mechanism.bodies:
        node = tree.node(name)
        i, d, own = node.index, near_offset(node, np.zeros(3)), node.R.near.T
        turn, turn_rate = ca.mtimes(own, omega[i]), ca.mtimes(own, alpha[i])
        origin = ca.mtimes(own, point_acceleration(a[i], omega[i], alpha[i], d))
        wrenches = ca.horzcat(*unit_wrenches(turn, turn_rate, origin))
        R = node.R.matrix
        J = body_motion.jacobian(tree, node, d)
        blocks.append(ca.mtimes(J[:3, :].T, ca.mtimes(R, wrenches[:3, :])))
        blocks[-1] += ca.mtimes(J[3:, :].T, ca.mtimes(R, wrenches[3:, :]))
    return ca.horzcat(*blocks)


def unit_wrenches(omega: ca.SX, alpha: ca.SX, a: ca.SX) -> Iterator[ca.SX]:
    """Yield the wrench [N; F] that a unit of m, of each element of m c and of each element of I_O
    takes, in the body's axes."""
    yield ca.vertcat(zero(), a)
    for e in np.eye(3):
        e = SX(e)
        yield ca.vertcat(cross(e, a), cross(alpha, e) + spin(omega, e))
    for place in ELEMENTS.values():
        E = np.zeros((3, 3))
        E[place] = E[place[::-1]] = 1
        yield ca.vertcat(ca.mtimes(SX(E), alpha) + cross(omega, ca.mtimes(SX(E), omega)), zero())


def freedom_columns(equations: Equations, w: ca.SX, dw: ca.SX) -> ca.SX:
    """Return the forces (nv x 3 per freedom) on the tree's rates that a unit of friction and rotor
    inertia takes."""
    tree, blocks = equations.tree, [SX(len(equations.tree.rates), 0)]
    for freedom in effects.freedoms(equations.joints, every=True):
        J, rate = freedom.J, ca.mtimes(freedom.J, w)
        sharp, acceleration = rate / freedom.softened(rate), freedom.acceleration(tree, w, dw)
        if freedom.friction.static is not None:
            sharp *= 1 - freedom.fallen(rate)
        blocks.append(ca.mtimes(J.T, ca.horzcat(rate, sharp, acceleration)))
    return ca.horzcat(*blocks)


def spring_forces(equations: Equations) -> ca.SX:
    """Return the forces (nv) on the tree's rates that springs, stops, contacts and static friction
    take, powers of rates and dampers between points included."""
    tree = equations.tree
    total = SX.zeros(len(tree.rates))
    for freedom in equations.freedoms:
        own = ca.mtimes(freedom.J, equations.rates)
        held, line = freedom.pull, freedom.rates[0] in equations.mechanism.transmissions
        if not line:
            held = sum((end.drag(own) for end in freedom.ends), held)
            held -= effects.polynomial((0.0, *freedom.friction.powers), effects.size_of(own)) * own
        if freedom.friction.static is not None and not line:
            rise = freedom.friction.static * freedom.fallen(own)
            held -= rise / freedom.softened(own) * own
        total -= ca.mtimes(freedom.J.T, held)
    for index, wrench in equations.wrenches.items():
        node = tree.nodes[index]
        moment, force = (ca.mtimes(node.axes.matrix, part) for part in wrench)
        total -= ca.mtimes(body_motion.jacobian(tree, node, zero()).T, ca.vertcat(moment, force))
    return total


def line_forces(equations: Equations, w: ca.SX, dw: ca.SX) -> ca.SX:
    """Return the forces (nv) on the tree's rates that friction and inertia along transmissions
    take, for the tree's rates and their derivatives."""
    total = SX.zeros(len(equations.tree.rates))
    for line in effects.lines(equations.joints):
        taken = line.rotor * line.acceleration(equations.tree, w, dw) - line.drag(
            ca.mtimes(line.J, w)
        )
        total += ca.mtimes(line.J.T, taken)
    return total
