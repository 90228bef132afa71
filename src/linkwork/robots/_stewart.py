"""The Gough-Stewart platform 6-UPS: six legs of tube and rod, each driven in its length, carry a
platform.

    leg i   from A_i on the base to P + R b_i on the platform:
            |P + R b_i - A_i| = q_i                                                leg_i, actuated
    tube i  universal joint in A_i, first axis level; the leg's axis is the tube's z   universal_i
    rod i   slides in the tube, its origin in the ball joint at b_i                         ball_i

z points up, the base is at z = 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linkwork.mechanism import (
    Frame,
    FreeJoint,
    Mechanism,
    MechanismError,
    PrismaticJoint,
    SphericalJoint,
    Tool,
    UniversalJoint,
)
from linkwork.robots.points import circle, six_points
from linkwork.robots.poses import QuaternionPose, ball_coordinates, free_coordinates
from linkwork.robots.rods import End, Parts, direction, pointing
from linkwork.robots.uniform import (
    disc,
    require_kinds,
    require_masses,
    require_sizes,
    tube,
    tube_mass,
)

BASE = circle(3.0, (-2.5, 2.5, 117.5, 122.5, 237.5, 242.5))
PLATFORM = circle(1.0, (-50.0, 50.0, 70.0, 170.0, 190.0, 290.0))
HOME = Frame(position=(0.0, 0.0, 2.0))
STEEL = 76e3 / 9.81


def stewart(
    base_points: Sequence[Sequence[float]] = BASE,
    platform_points: Sequence[Sequence[float]] = PLATFORM,
    home: Frame = HOME,
    tube_radii: tuple[float, float] = (0.03, 0.05),
    segment: float = 0.75,
    platform_radius: float = 1.0,
    platform_thickness: float = 0.05,
    leg_density: float = STEEL,
    platform_density: float = STEEL,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe a Gough-Stewart platform with heavy legs; the defaults are those of the MathWorks
    example.

    The lower part of each leg is a tube, the upper a full rod which fits into it; the platform is a
    disc.

    Args:
        base_points: A_1..A_6 in the ground [m].
        platform_points: b_1..b_6 in the platform's frame [m].
        home: the platform's pose in the reference configuration.
        tube_radii: inner radius of the tubes, which is that of the rods, and outer radius [m].
        segment: length of a tube and of a rod over the length of its leg at home [1].
        platform_radius, platform_thickness: of the disc, whose middle is the origin of the
            platform's frame [m].
        leg_density, platform_density: mass per volume [kg/m^3]; zero makes the part massless.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints universal_1..6, leg_1..6 (actuated; the leg's length [m]), ball_1..6,
            and pose, a free
        joint which says where the platform is; its tool is the platform's frame.

    Raises:
        MechanismError: other than six points, a size that is not above zero, a density below zero,
            a leg without length.

    Source: Smith & Wendlandt, Creating a Stewart platform model using SimMechanics, The MathWorks
    2002: base radius 3 m, half spread 2.5 deg; platform radius 1 m, half spread 10 deg, turned by
    60 deg; height 2 m; weight 76 kN/m^3.
    """
    require_kinds(stewart, locals())
    # Points, tubes and densities that make six legs.
    A, b = six_points("base_points", base_points), six_points("platform_points", platform_points)
    inner, outer = tube_radii
    require_sizes(
        inner=inner,
        outer=outer,
        segment=segment,
        radius=platform_radius,
        thickness=platform_thickness,
    )
    require_masses(leg_density=leg_density, platform_density=platform_density)
    if not inner < outer:
        raise MechanismError(
            f"the inner radius {inner} m is not below the outer radius {outer} m", ("tube_radii",)
        )
    # A leg stands between two points, which may not coincide.
    ground, pose = QuaternionPose.of(Frame()), QuaternionPose.of(home)
    legs = Parts()
    for i in range(6):
        foot, tip = End("ground", A[i], ground), End("platform", b[i], pose)
        if not np.linalg.norm(tip.position - foot.position) > 1e-9:
            raise MechanismError(
                f"leg {i + 1} has no length at home; move its platform point or home", ("home",)
            )
        legs |= leg(str(i + 1), foot, tip, segment, tube_radii, leg_density)
    mass = tube_mass(platform_density, platform_thickness, (0.0, platform_radius))
    return Mechanism(
        name="Gough-Stewart platform",
        gravity=gravity,
        bodies=legs.bodies | {"platform": disc(mass, platform_radius, platform_thickness)},
        joints=legs.joints | {"pose": FreeJoint(connects=("ground", "platform"))},
        actuators=tuple(f"leg_{i}" for i in range(1, 7)),
        tools={"centre": Tool(body="platform")},
        reference=legs.reference | free_coordinates("pose", pose),
    )


def leg(
    label: str, foot: End, tip: End, segment: float, radii: tuple[float, float], density: float
) -> Parts:
    """Return a UPS leg: tube from the foot on, rod up to the tip."""
    along, length = direction(foot, tip)
    aim, part = pointing(along), segment * length
    lower, upper = f"tube_{label}", f"rod_{label}"
    universal, slide, ball = f"universal_{label}", f"leg_{label}", f"ball_{label}"
    full = (0.0, radii[0])
    return Parts(
        bodies={
            lower: tube(tube_mass(density, part, radii), part, radii, 0.0, aim.axis),
            upper: tube(tube_mass(density, part, full), part, full, -part, aim.axis),
        },
        joints={
            universal: UniversalJoint(
                connects=(foot.body, lower), frames=(foot.frame, Frame()), axes=aim.axes
            ),
            slide: PrismaticJoint(connects=(lower, upper), axis=aim.axis),
            ball: SphericalJoint(connects=(upper, tip.body), frames=(Frame(), tip.frame)),
        },
        reference={
            f"{universal}.angle_1": aim.angles[0],
            f"{universal}.angle_2": aim.angles[1],
            slide: length,
        }
        | ball_coordinates(ball, aim.quaternion, tip.pose.quaternion),
    )
