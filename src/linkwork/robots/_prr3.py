"""The planar 3-PRR robot of Kordjazi, Akbarzadeh & Tahani, ICME 2010 ("the paper").

    base triangle  A = (0, 0), B = (l3, 0), C = (l3/2, sqrt(3)/2 l3)
    slider i       at P_i + q_i d_i,  d_i = (cos a_i, sin a_i)                    slide_i, actuated
                   a = (0, 2 pi/3, 4 pi/3)
    link i         absolute angle a_i + q_{3+i}, length l1, mass centre           pivot_i
                   at its middle
    platform       vector from vertex i to the centre: length l2,                 wrist_i
                   angle a_i + q_{3+i} + q_{6+i}

The platform's frame lies in its centre; at angle zero the vector from vertex 1 to the centre points
along x.
"""

from __future__ import annotations

from math import asin, cos, pi, sin, sqrt

from linkwork.mechanism import (
    Body,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    PrismaticJoint,
    RevoluteJoint,
    Tool,
)
from linkwork.robots.uniform import require_kinds

ALONG_X = (1.0, 0.0, 0.0)


def prr3(
    l1: float = 0.3,
    l2: float = 0.15,
    l3: float = 1.0,
    slider_mass: float = 0.18718,
    link_mass: float = 0.52007,
    platform_mass: float = 1.41901,
    slider_inertia: float = 1.71e-5,
    link_inertia: float = 9.09e-4,
    platform_inertia: float = 5.076e-3,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the planar 3-PRR robot; the defaults are the paper's data (Table 1, read in g m^2).

    Args:
        l1: length of the links [m].
        l2: distance from the platform's centre to its vertices [m].
        l3: side of the base triangle [m].
        slider_mass, link_mass, platform_mass: masses [kg].
        slider_inertia, link_inertia, platform_inertia: moments of inertia about the mass centres,
            about z [kg m^2].
        gravity: acceleration of gravity in the ground's axes [m/s^2]; the paper's motion is
            horizontal.

    Returns:
        The mechanism: joints slide_1..3 (actuated), pivot_1..3, wrist_1..3; its tool is the
            platform's centre.

    Source: the paper, section 2 and Table 1.
    """
    require_kinds(prr3, locals())
    corners = ((0.0, 0.0), (l3, 0.0), (l3 / 2, sqrt(3) / 2 * l3))
    # A leg: a slider along a side of the base's triangle, a link, and a corner of the platform.
    slides, pivots, wrists = {}, {}, {}
    for i, (x, y) in enumerate(corners, start=1):
        a = (i - 1) * 2 * pi / 3
        slides[f"slide_{i}"] = PrismaticJoint(
            connects=("ground", f"slider_{i}"),
            frames=(Frame.planar(x, y, a), Frame()),
            axis=ALONG_X,
        )
        pivots[f"pivot_{i}"] = RevoluteJoint(connects=(f"slider_{i}", f"link_{i}"))
        vertex = Frame.planar(-l2 * cos(a), -l2 * sin(a), a)
        wrists[f"wrist_{i}"] = RevoluteJoint(
            connects=(f"link_{i}", "platform"), frames=(Frame.planar(l1), vertex)
        )
    slider = Body(mass=slider_mass, inertia=Inertia(zz=slider_inertia))
    link = Body(mass=link_mass, centre_of_mass=(l1 / 2, 0.0, 0.0), inertia=Inertia(zz=link_inertia))
    platform = Body(mass=platform_mass, inertia=Inertia(zz=platform_inertia))
    return Mechanism(
        name="3-PRR",
        gravity=gravity,
        bodies={f"slider_{i}": slider for i in (1, 2, 3)}
        | {f"link_{i}": link for i in (1, 2, 3)}
        | {"platform": platform},
        joints=slides | pivots | wrists,
        actuators=tuple(slides),
        tools={"centre": Tool(body="platform")},
        reference=symmetric_pose(l1, l2, l3),
    )


def symmetric_pose(l1: float, l2: float, l3: float) -> dict[str, float]:
    """Return the joint coordinates with the platform in the middle of the base at angle pi/6, the
    three legs alike.

    In leg 1's axes the base's centre is (l3/2, l3/(2 sqrt 3)), and the vertex lies l2 before it at
    the angle pi/6: l1 sin q4 = h - l2 sin(pi/6); of the two working modes the one with the slider
    behind the vertex is taken.
    """
    height = l3 / (2 * sqrt(3)) - l2 * sin(pi / 6)
    if not abs(height) < l1:
        raise MechanismError(
            f"links of l1 = {l1} m do not reach the platform; l1 must exceed {abs(height):.6g} m"
        )
    pivot = asin(height / l1)
    slide = l3 / 2 - l2 * cos(pi / 6) - l1 * cos(pivot)
    return {
        **{f"slide_{i}": slide for i in (1, 2, 3)},
        **{f"pivot_{i}": pivot for i in (1, 2, 3)},
        **{f"wrist_{i}": pi / 6 - pivot for i in (1, 2, 3)},
    }
