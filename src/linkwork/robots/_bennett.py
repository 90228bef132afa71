"""The Bennett linkage: four links in space, four skew revolute joints, one freedom, three rows too
many.

    links         crank and rocker: length a, twist alpha;  coupler and ground: length b, twist beta
    it moves if   sin(alpha) / a = sin(beta) / b
    closure       Rz(q_1) Tx(a) Rx(alpha) Rz(q_2) Tx(b) Rx(beta)
                  Rz(q_3) Tx(a) Rx(alpha) Rz(q_4) Tx(b) Rx(beta) = 1:
                  q_3 = -q_1,  q_4 = -q_2,
                  tan(q_1 / 2) tan(q_2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2)

Gruebler's formula counts 6 * 3 - 5 * 4 = -2 freedoms.
"""

from __future__ import annotations

from math import asin, atan2, cos, isfinite, pi, sin

from linkwork.mechanism import Frame, Mechanism, MechanismError, RevoluteJoint, Tool
from linkwork.robots.uniform import (
    ALONG_X,
    require_kinds,
    require_masses,
    require_sizes,
    rod,
    tube_mass,
)


def bennett(
    length_1: float = 0.3,
    length_2: float = 0.5,
    twist_1: float = pi / 6,
    crank: float = 1.0,
    link_radius: float = 0.01,
    density: float = 2700.0,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe a Bennett linkage of round rods, four skew hinges in space that move with one
    freedom.

    Args:
        length_1: a, of crank and rocker [m].
        length_2: b, of coupler and ground [m].
        twist_1: alpha, from a link's first to its second axis about its length [rad]; beta = asin(b
            sin(alpha) / a).
        crank: q_1 in the reference configuration [rad].
        link_radius: of the rods [m].
        density: of the rods [kg/m^3].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints hinge_1 (actuated; ground to crank), hinge_2, hinge_3, hinge_4
            (rocker to ground); its tool
        is the end of the coupler.

    Raises:
        MechanismError: a size that is not above zero, a density below zero, lengths and a twist
            that no second twist fits.

    Source: Bennett, A new mechanism, Engineering 76 (1903) 777-778; closure as in Hunt, Kinematic
    Geometry of Mechanisms, 1978; dimensions ours.
    """
    require_kinds(bennett, locals())
    # sin(alpha) / a = sin(beta) / b: the second twist follows.
    require_sizes(length_1=length_1, length_2=length_2, link_radius=link_radius)
    require_masses(density=density)
    a, b, alpha = length_1, length_2, twist_1
    if not 0 < alpha < pi:
        raise MechanismError(f"is {alpha}; give an angle between 0 and pi [rad]", ("twist_1",))
    if not isfinite(crank):
        raise MechanismError(f"is {crank}; give a finite angle [rad]", ("crank",))
    sine = b * sin(alpha) / a
    if not sine <= 1:
        raise MechanismError(
            f"no twist of links of {b} m fulfils sin(beta) = {sine:.6g}; length_2 must not "
            f"exceed {a / sin(alpha):.6g} m"
        )
    beta = asin(sine)
    if not abs(beta - alpha) > 1e-9:
        raise MechanismError(
            f"four links of {a} m with equal twists only fold; give length_2 another value",
            ("length_2",),
        )
    # The angle opposite the crank, from half-angle tangents.
    second = 2 * atan2(
        sin((beta + alpha) / 2) * cos(crank / 2), sin((beta - alpha) / 2) * sin(crank / 2)
    )
    # Opposite links are equal; each has its far hinge turned by its twist.
    short, long = (
        rod(tube_mass(density, length, (0.0, link_radius)), length, link_radius, 0.0, ALONG_X)
        for length in (a, b)
    )
    far_short, far_long = (
        Frame(position=(length, 0.0, 0.0), rotation=(twist, 0.0, 0.0))
        for length, twist in ((a, alpha), (b, beta))
    )
    back = Frame(position=(-b, 0.0, 0.0), rotation=(-beta, 0.0, 0.0))
    return Mechanism(
        name="Bennett linkage",
        gravity=gravity,
        bodies={"crank": short, "coupler": long, "rocker": short},
        joints={
            "hinge_1": RevoluteJoint(connects=("ground", "crank")),
            "hinge_2": RevoluteJoint(connects=("crank", "coupler"), frames=(far_short, Frame())),
            "hinge_3": RevoluteJoint(connects=("coupler", "rocker"), frames=(far_long, Frame())),
            "hinge_4": RevoluteJoint(connects=("rocker", "ground"), frames=(far_short, back)),
        },
        actuators=("hinge_1",),
        tools={"end": Tool(body="coupler", frame=far_long)},
        reference={"hinge_1": crank, "hinge_2": second, "hinge_3": -crank, "hinge_4": -second},
    )
