"""What the wrenches in the joints follow from: what every body and every joint's freedoms need
(`needed_wrenches`), the friction of bearings included, and where the joints are."""

from __future__ import annotations

import casadi as ca

from linkwork.equations import bearings, gears
from linkwork.equations.algebra import SX
from linkwork.equations.equations import Equations
from linkwork.equations.functions import function
from linkwork.equations.needed_wrenches import (
    bodies_need,
    frames,
    joint_twists,
    known_forces,
    line_tensions,
    on_body,
)
from linkwork.equations.rubbing import rubbing


def joint_loads(equations: Equations) -> ca.Function:
    """Return (q, v, v', u, s, w) -> what the joints have to bring, where they are, and the weakest
    relative pivot, under forces u of the actuators and s of bristles, if the equations have any;
    wrenches w (6r) from outside are felt by the friction of bearings alone.

    Outputs, in the ground's axes: `needed` [moment about the mass centre; force] of every body
    (6r), `centres` (3r); of every joint that connects two bodies the `origins` of F1 and F2 (6J);
    of every rate the `twists` s (6m) and the known forces f (m); of a unit multiplier of each gear
    what it is on the rates that it pushes, the `slopes` (`Network.geared`), and on bodies, the
    `pulls` [moment about the mass centre; force] (`Network.pulled`).
    """
    # What acts in a motion.
    dv = SX.sym("dv", equations.mobility)
    u = SX.sym("u", len(equations.mechanism.actuators))
    L, b, pivot = equations.elimination
    accelerations = ca.mtimes(L, dv) + b
    tensions = line_tensions(equations, accelerations, u)
    needed, centres = bodies_need(equations, accelerations, tensions)
    pairs = equations.mechanism.pairs
    sides = {name: frames(equations, joint) for name, joint in pairs.items()}
    twists = [twist for name, joint in pairs.items() for twist in joint_twists(joint, *sides[name])]
    outside = SX.sym("outside", 6 * len(equations.mechanism.bodies))
    f = known_forces(equations, accelerations, u, tensions)
    by_body = tuple(zip(equations.mechanism.bodies, ca.vertsplit(outside, 6), strict=True))
    # Bearings rub by what they carry.
    phi = bearings.friction(equations, dv, u, by_body)
    if phi is not None:
        labels = equations.mechanism.rates
        for own, force in zip(rubbing(equations.joints), ca.vertsplit(phi), strict=True):
            f[labels.index(own.rate)] += force
    # How the gears push.
    slopes, pulls = [], []
    for gear in equations.mechanism.gears.values():
        line = gears.pushing(gear, equations.joints)
        rates, bodies = gears.pushed(gear, equations.mechanism)
        slopes += [line.ratios[rate] for rate in rates]
        pulls += [on_body(equations, line, body) for body in bodies]
    # All of it.
    outputs = {
        "needed": ca.vertcat(SX(0, 1), *needed),
        "centres": ca.vertcat(SX(0, 1), *centres),
        "origins": ca.vertcat(SX(0, 1), *[frame.P for pair in sides.values() for frame in pair]),
        "twists": ca.vertcat(SX(0, 1), *twists),
        "f": f,
        "slopes": ca.vertcat(SX(0, 1), *slopes),
        "pulls": ca.vertcat(SX(0, 1), *pulls),
        "pivot": pivot,
    }
    s = ca.vertcat(SX(0, 1), *equations.strains.values())
    return function("joint_loads", equations, outputs, v=equations.v, dv=dv, u=u, s=s, w=outside)


def strained_loads(equations: Equations) -> ca.Function:
    """Return `joint_loads` with the forces of bristles."""
    return joint_loads(equations.strained)


def joint_axes(equations: Equations) -> ca.Function:
    """Return q -> the axes R_1, R_2 of every joint that connects two bodies, row by row (18J), in
    the ground's axes."""
    sides = (
        frame for joint in equations.mechanism.pairs.values() for frame in frames(equations, joint)
    )
    axes = ca.vertcat(SX(0, 1), *[ca.vec(frame.R.matrix.T) for frame in sides])
    return function("joint_axes", equations, {"axes": axes})
