"""What every body needs of its joints, and what the joints bring along their own freedoms.

Newton and Euler for each body about its mass centre, in the ground's axes; the joints bring

    moment = I alpha + omega x I omega - moments of point springs
    force = m (a - g) - forces of point springs

and along its own freedoms a joint brings a known force for each rate w: that of friction, spring
and rotor J,

    f = -k (x - rest) - d w - friction - J w' + u    beside those of gears,

and what acts along transmissions adds to the forces on joint rates and on bodies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import casadi as ca
import numpy as np

from linkwork.equations import effects
from linkwork.equations.algebra import SX, cross, point_acceleration, present, vector, zero
from linkwork.equations.closure import Side, side
from linkwork.equations.equations import Equations
from linkwork.equations.joints import motions_of
from linkwork.equations.moments import tensor
from linkwork.equations.transmissions import Along
from linkwork.equations.tree import in_base, near_offset
from linkwork.mechanism import PairJoint


def line_tensions(equations: Equations, accelerations: ca.SX, u: ca.SX) -> dict[str, ca.SX]:
    """Return the force along each transmission: the actuator's, and that of what acts there."""
    mechanism, w = equations.mechanism, equations.rates
    found = dict.fromkeys(mechanism.transmissions, SX(0))
    for freedom in equations.freedoms:
        if (name := freedom.rates[0]) in found:
            found[name] = own_force(equations, freedom, w, accelerations)
    for name, force in zip(mechanism.actuators, ca.vertsplit(u) if u.numel() else [], strict=True):
        if name in found:
            found[name] += force
    return found


def own_force(
    equations: Equations, freedom: effects.Freedom, w: ca.SX, accelerations: ca.SX
) -> ca.SX:
    """Return the force of spring, friction and rotor in a freedom, or along a transmission."""
    force = freedom.force(ca.mtimes(freedom.J, w))
    if present(freedom.rotor):
        force -= freedom.rotor * freedom.acceleration(equations.tree, w, accelerations)
    return force


def bodies_need(
    equations: Equations, accelerations: ca.SX, tensions: Mapping[str, ca.SX]
) -> tuple[list[ca.SX], list[ca.SX]]:
    """Return [moment about the mass centre; force] that the joints bring to each body, and the mass
    centres.

    tensions: forces along transmissions, by name
    """
    tree, w, mechanism = equations.tree, equations.rates, equations.mechanism
    omega = tree.angular_velocities(w)
    alpha, a = tree.accelerations(omega, w, accelerations, -equations.gravity)
    pulls = equations.wrenches
    needed, centres = [], []
    for name, body in mechanism.bodies.items():
        node, c = tree.node(name), vector(body.centre_of_mass)
        i, d = node.index, near_offset(node, c)
        inertia = ca.mtimes(ca.mtimes(node.R.near, SX(tensor(body.inertia))), node.R.near.T)
        pulled = pulls.get(i, (zero(), zero()))
        force = body.mass * point_acceleration(a[i], omega[i], alpha[i], d) - pulled[1]
        moment = ca.mtimes(inertia, alpha[i]) + cross(omega[i], ca.mtimes(inertia, omega[i]))
        moment -= pulled[0] - cross(d, pulled[1])
        moment, force = (ca.mtimes(node.axes.matrix, part) for part in (moment, force))
        for line, tension in tensions.items():
            pull = on_body(equations, equations.joints.along(line), name)
            moment, force = moment - tension * pull[:3], force - tension * pull[3:]
        needed += [moment, force]
        centres.append(tree.point(node, c))
    return needed, centres


def on_body(equations: Equations, line: Along, name: str) -> ca.SX:
    """Return [moment about the mass centre; force] of a unit force along a line on a body."""
    node, found = equations.tree.node(name), SX(6, 1)
    d = near_offset(node, vector(equations.mechanism.bodies[name].centre_of_mass))
    for body, arm, wrench in line.wrenches:
        if body == name:
            lever = ca.mtimes(node.axes.matrix, arm - d)
            found += ca.vertcat(wrench[:3] + cross(lever, wrench[3:]), wrench[3:])
    return found


def frames(equations: Equations, joint: PairJoint) -> tuple[Side, Side]:
    """Return a joint's frames F1 and F2."""
    first, second = (
        side(equations.tree, body, frame)
        for body, frame in zip(joint.connects, joint.frames, strict=True)
    )
    return first, second


def joint_twists(joint: PairJoint, first: Side, second: Side) -> Iterator[ca.SX]:
    """Yield s of each rate of a joint; the second axis of two turns (a universal joint) is fixed in
    F2."""
    motions = motions_of(joint)
    crossed = sum(motion.turns for motion in motions) == 2
    for motion in motions:
        if motion.ball:
            yield from (ca.vertcat(in_base(first.R, e), zero()) for e in np.eye(3))
        else:
            R = second.R if crossed and motion is motions[-1] else first.R
            yield ca.vertcat(in_base(R, motion.turn), in_base(R, motion.slide))


def known_forces(
    equations: Equations, accelerations: ca.SX, u: ca.SX, tensions: Mapping[str, ca.SX]
) -> ca.SX:
    """Return f (m) of friction, springs, rotors, actuators and combinations for the rates of all
    joints, in the mechanism's order."""
    mechanism, labels, w = equations.mechanism, equations.mechanism.rates, equations.rates
    f = SX.zeros(len(labels))
    for freedom in effects.freedoms(equations.joints, strains=equations.strains):
        force = own_force(equations, freedom, w, accelerations)
        f[[labels.index(label) for label in freedom.rates]] += force
    for place, name in enumerate(mechanism.actuators):
        if name not in tensions:
            f[labels.index(name)] += u[place]
    for name, tension in tensions.items():
        for label, ratio in equations.joints.along(name).ratios.items():
            f[labels.index(label)] += ratio * tension
    return f
