"""The planar 3-RPR robot: three legs of actuated length between a base and a platform, cylinders
and pistons with inertia.

    base triangle  A = (0, 0), B = (b, 0), C = (b/2, sqrt(3)/2 b); middle G = (b/2, b/(2 sqrt 3))
    cylinder i     turns about corner i, at the angle p_i from the x axis   pivot_i
    piston i       its tip at the distance s_i from the corner              slide_i, actuated
    platform       vertex i at P + R(phi) r d_i,                            wrist_i
                   d_i = (cos a_i, sin a_i),  a = (7/6, 11/6, 1/2) pi,  phi = p_i + w_i
    loops          corner_i + s_i (cos p_i, sin p_i) = P + R(phi) r d_i

The platform's frame lies in its centre; at angle zero its triangle is parallel to the base's.
There, in the middle, the three legs meet in one point and cannot hold the platform's turn; the
reference is turned by pi/3 from it.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin, sqrt

from linkwork.mechanism import Body, Frame, Inertia, Mechanism, PrismaticJoint, RevoluteJoint, Tool
from linkwork.robots.plane import corners, uniform_rod, vertices
from linkwork.robots.uniform import ALONG_X, require_kinds, require_masses, require_sizes

TURN = pi / 3


def rpr3(
    base: float = 1.0,
    radius: float = 0.15,
    cylinder: float = 0.3,
    piston: float = 0.3,
    cylinder_mass: float = 1.2,
    piston_mass: float = 0.5,
    platform_mass: float = 1.5,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the planar 3-RPR robot with uniform cylinders and pistons.

    Args:
        base: b, side of the base triangle [m].
        radius: r, distance from the platform's centre to its vertices [m].
        cylinder, piston: lengths of the cylinders, from the corners, and of the pistons, back from
            their tips [m].
        cylinder_mass, piston_mass, platform_mass: masses [kg]; the platform's inertia is that of a
            disc, m r^2 / 2.
        gravity: acceleration of gravity in the ground's axes [m/s^2]; the robot moves horizontally.

    Returns:
        The mechanism: joints slide_1..3 (actuated; the lengths of the legs [m]), pivot_1..3,
            wrist_1..3; its tool is the
        platform's centre. In the reference the platform is in the middle of the base at the angle
        pi/3.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero.

    Source: architecture as in Gosselin & Sefrioui, Polynomial solutions for the direct kinematic
    problem of planar three-degree-of-freedom parallel manipulators, ICAR 1991; dimensions ours.
    """
    require_kinds(rpr3, locals())
    require_sizes(base=base, radius=radius, cylinder=cylinder, piston=piston)
    require_masses(
        cylinder_mass=cylinder_mass, piston_mass=piston_mass, platform_mass=platform_mass
    )
    # A leg: a pivot, a slide and a wrist.
    pivots, slides, wrists, reference = {}, {}, {}, {}
    for i, (corner, vertex) in enumerate(
        zip(corners(base), vertices(radius), strict=True), start=1
    ):
        pivots[f"pivot_{i}"] = RevoluteJoint(
            connects=("ground", f"cylinder_{i}"), frames=(Frame.planar(*corner), Frame())
        )
        slides[f"slide_{i}"] = PrismaticJoint(
            connects=(f"cylinder_{i}", f"piston_{i}"), axis=ALONG_X
        )
        wrists[f"wrist_{i}"] = RevoluteJoint(
            connects=(f"piston_{i}", "platform"), frames=(Frame(), Frame.planar(*vertex))
        )
        # The reference: the platform in the middle, turned by TURN.
        dx = base / 2 + cos(TURN) * vertex[0] - sin(TURN) * vertex[1] - corner[0]
        dy = base / (2 * sqrt(3)) + sin(TURN) * vertex[0] + cos(TURN) * vertex[1] - corner[1]
        angle = atan2(dy, dx)
        reference |= {f"pivot_{i}": angle, f"slide_{i}": hypot(dx, dy), f"wrist_{i}": TURN - angle}
    rod = uniform_rod(piston_mass, piston)
    platform = Body(mass=platform_mass, inertia=Inertia(zz=platform_mass * radius**2 / 2))
    return Mechanism(
        name="3-RPR",
        gravity=gravity,
        bodies=dict.fromkeys(
            (f"cylinder_{i}" for i in (1, 2, 3)), uniform_rod(cylinder_mass, cylinder)
        )
        | dict.fromkeys(
            (f"piston_{i}" for i in (1, 2, 3)),
            rod.model_copy(update={"centre_of_mass": (-piston / 2, 0.0, 0.0)}),
        )
        | {"platform": platform},
        joints=pivots | slides | wrists,
        actuators=tuple(slides),
        tools={"centre": Tool(body="platform")},
        reference=reference,
    )
