"""The planar 3-RRR robot: three actuated cranks, three distal links, a platform with three
freedoms.

    base triangle    A = (0, 0), B = (b, 0), C = (b/2, sqrt(3)/2 b); middle G = (b/2, b/(2 sqrt 3))
    crank i          from corner i, at the angle m_i from the x axis, length l1   motor_i, actuated
    distal link i    at the angle m_i + e_i, length l2                            elbow_i
    platform         vertex i at P + R(phi) r d_i,                                wrist_i
                     d_i = (cos a_i, sin a_i),  a = (7/6, 11/6, 1/2) pi,  phi = m_i + e_i + w_i
    loops            corner_i + l1 (cos m_i, sin m_i) + l2 (cos (m_i + e_i), sin (m_i + e_i))
                     = P + R(phi) r d_i

The platform's frame lies in its centre; at angle zero its triangle is parallel to the base's.
"""

from __future__ import annotations

from math import atan2, remainder, sqrt, tau

from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint, Tool
from linkwork.robots.plane import corners, meet, uniform_rod, vertices
from linkwork.robots.uniform import require_kinds, require_masses, require_sizes


def rrr3(
    base: float = 0.6,
    proximal: float = 0.22,
    distal: float = 0.2,
    radius: float = 0.08,
    proximal_mass: float = 0.5,
    distal_mass: float = 0.3,
    platform_mass: float = 0.8,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the planar 3-RRR robot with uniform rods, driven at the three pivots of its base.

    Args:
        base: b, side of the base triangle [m].
        proximal, distal: l1 and l2, lengths of the cranks and of the distal links [m].
        radius: r, distance from the platform's centre to its vertices [m].
        proximal_mass, distal_mass, platform_mass: masses [kg]; the platform's inertia is that of a
            disc, m r^2 / 2.
        gravity: acceleration of gravity in the ground's axes [m/s^2]; the robot moves horizontally.

    Returns:
        The mechanism: joints motor_1..3 (actuated), elbow_1..3, wrist_1..3; its tool is the
            platform's centre. In the
        reference the platform is in the middle at angle zero, all elbows on the same side.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero, links that do not reach
            the platform.

    Source: architecture as in Gosselin & Angeles, The optimum kinematic design of a planar
    three-degree-of-freedom parallel manipulator, J. Mech. Trans. Automation in Design 110 (1988)
    35-41; dimensions ours.
    """
    require_kinds(rrr3, locals())
    require_sizes(base=base, proximal=proximal, distal=distal, radius=radius)
    require_masses(
        proximal_mass=proximal_mass, distal_mass=distal_mass, platform_mass=platform_mass
    )
    # A leg: two links between motor, elbow and wrist.
    motors, elbows, wrists, reference = {}, {}, {}, {}
    for i, (corner, vertex) in enumerate(
        zip(corners(base), vertices(radius), strict=True), start=1
    ):
        motors[f"motor_{i}"] = RevoluteJoint(
            connects=("ground", f"proximal_{i}"), frames=(Frame.planar(*corner), Frame())
        )
        elbows[f"elbow_{i}"] = RevoluteJoint(
            connects=(f"proximal_{i}", f"distal_{i}"), frames=(Frame.planar(proximal), Frame())
        )
        wrists[f"wrist_{i}"] = RevoluteJoint(
            connects=(f"distal_{i}", "platform"),
            frames=(Frame.planar(distal), Frame.planar(*vertex)),
        )
        # The reference: the platform in the middle, all elbows on one side.
        top = (base / 2 + vertex[0], base / (2 * sqrt(3)) + vertex[1])
        x, y = meet(corner, proximal, top, distal, 1, f"leg {i}: proximal and distal links")
        motor = atan2(y - corner[1], x - corner[0])
        elbow = remainder(atan2(top[1] - y, top[0] - x) - motor, tau)
        reference |= {f"motor_{i}": motor, f"elbow_{i}": elbow, f"wrist_{i}": -motor - elbow}
    platform = Body(mass=platform_mass, inertia=Inertia(zz=platform_mass * radius**2 / 2))
    return Mechanism(
        name="3-RRR",
        gravity=gravity,
        bodies=dict.fromkeys(
            (f"proximal_{i}" for i in (1, 2, 3)), uniform_rod(proximal_mass, proximal)
        )
        | dict.fromkeys((f"distal_{i}" for i in (1, 2, 3)), uniform_rod(distal_mass, distal))
        | {"platform": platform},
        joints=motors | elbows | wrists,
        actuators=tuple(motors),
        tools={"centre": Tool(body="platform")},
        reference=reference,
    )
