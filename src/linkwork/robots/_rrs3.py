"""The 3-RRS: three legs of a driven hinge, a knee and a ball, in upright planes 120 degrees apart,
and a platform that rises and tilts.

    leg i    in the vertical plane of e_i = (cos f_i, sin f_i, 0),  t_i = z x e_i,
             f = (0, 2 pi/3, 4 pi/3)
    knee i   K_i = (base_radius + proximal cos q_i) e_i + proximal sin q_i z      motor_i, actuated
    ball i   B_i = P + platform_radius R e_i,  t_i' B_i = 0,  |B_i - K_i| = distal

Both hinges of a leg turn about -t_i, so that positive angles raise it. That the balls stay in the
legs' planes leaves the platform three freedoms: with azimuth f and tilt t of R = Rz(f) Ry(t) Rz(-f)
its torsion is zero, and its centre is drawn aside as it tilts,

    P = (-h cos 2 f, h sin 2 f, z),  h = platform_radius (1 - cos t) / 2.

Source: Bonev, Zlatanov & Gosselin, Advantages of the modified Euler angles in the design and
control of PKMs, Parallel Kinematic Machines International Conference 2002 (zero torsion).
"""

from __future__ import annotations

from math import acos, atan2, hypot, pi, sin

from linkwork.mechanism import (
    Frame,
    Mechanism,
    MechanismError,
    RevoluteJoint,
    SphericalJoint,
    Tool,
)
from linkwork.robots.points import compass
from linkwork.robots.poses import ball_coordinates, turn
from linkwork.robots.rods import Parts
from linkwork.robots.uniform import (
    ALONG_X,
    disc,
    require_kinds,
    require_masses,
    require_sizes,
    rod,
    vector,
)

AZIMUTHS = (0.0, 2 * pi / 3, 4 * pi / 3)
BACK = (0.0, -1.0, 0.0)
LEVEL = turn(BACK, 0.0)


def rrs3(
    base_radius: float = 0.2,
    platform_radius: float = 0.15,
    proximal: float = 0.15,
    distal: float = 0.2,
    height: float = 0.25,
    link_radius: float = 0.01,
    proximal_mass: float = 0.3,
    distal_mass: float = 0.3,
    platform_mass: float = 1.0,
    motor_inertia: float = 0.002,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the 3-RRS, a platform on three legs of two links each that rises and tilts without
    torsion.

    Args:
        base_radius, platform_radius: distances of the motors' axes and of the balls from the
            centres [m].
        proximal, distal: lengths of a leg's driven link and of the one above it [m].
        height: of the level platform over the base in the reference, knees outside [m].
        link_radius: of the links, round rods, for their inertia [m].
        proximal_mass, distal_mass, platform_mass: masses [kg]; the platform is a disc.
        motor_inertia: of each motor and its gear, seen at the proximal link [kg m^2].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints motor_1..3 (actuated), knee_1..3, ball_1..3; its tool is the
            platform's centre, led in z, rx, ry.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero, legs that do not reach the
            platform bent.

    Source: Bonev, Zlatanov & Gosselin, Advantages of the modified Euler angles in the design and
    control of PKMs, Parallel Kinematic Machines International Conference 2002, which tells this
    family's motion; dimensions and masses ours.
    """
    require_kinds(rrs3, locals())
    require_sizes(
        base_radius=base_radius,
        platform_radius=platform_radius,
        proximal=proximal,
        distal=distal,
        height=height,
        link_radius=link_radius,
    )
    require_masses(
        proximal_mass=proximal_mass,
        distal_mass=distal_mass,
        platform_mass=platform_mass,
        motor_inertia=motor_inertia,
    )
    hip, knee = leg_angles(platform_radius - base_radius, height, proximal, distal)
    # Three equal legs about z; x of a link is its length, y across its leg's plane.
    motors, knees, balls = Parts(), Parts(), Parts()
    for i, f in enumerate(AZIMUTHS, start=1):
        e, _ = compass(f)
        lower, upper, facing = f"proximal_{i}", f"distal_{i}", (0.0, 0.0, f)
        shaft = Frame(position=vector(base_radius * e), rotation=facing)
        motors |= Parts(
            {lower: rod(proximal_mass, proximal, link_radius, 0.0, ALONG_X)},
            {
                f"motor_{i}": RevoluteJoint(
                    connects=("ground", lower),
                    frames=(shaft, Frame()),
                    axis=BACK,
                    rotor_inertia=motor_inertia,
                )
            },
            {f"motor_{i}": hip},
        )
        knees |= Parts(
            {upper: rod(distal_mass, distal, link_radius, 0.0, ALONG_X)},
            {
                f"knee_{i}": RevoluteJoint(
                    connects=(lower, upper),
                    frames=(Frame(position=(proximal, 0.0, 0.0)), Frame()),
                    axis=BACK,
                )
            },
            {f"knee_{i}": knee},
        )
        # The ball's frames are the upper link's and the leg's plane as drawn on the platform.
        seat = Frame(position=vector(platform_radius * e), rotation=facing)
        balls |= Parts(
            {},
            {
                f"ball_{i}": SphericalJoint(
                    connects=(upper, "platform"),
                    frames=(Frame(position=(distal, 0.0, 0.0)), seat),
                )
            },
            ball_coordinates(f"ball_{i}", turn(BACK, hip + knee), LEVEL),
        )
    links, parts = motors | knees, motors | knees | balls
    return Mechanism(
        name="3-RRS",
        gravity=gravity,
        bodies=links.bodies
        | {"platform": disc(platform_mass, platform_radius, platform_radius / 10)},
        joints=parts.joints,
        actuators=tuple(motors.joints),
        tools={"centre": Tool(body="platform")},
        reference=parts.reference,
    )


def leg_angles(x: float, z: float, proximal: float, distal: float) -> tuple[float, float]:
    """Return hip and knee angle [rad] of a leg that ends x outside and z above its motor's axis
    [m], its knee outside: by the law of cosines.

    cos knee = (x^2 + z^2 - proximal^2 - distal^2) / (2 proximal distal)
    """
    reach = hypot(x, z)
    cosine = (reach**2 - proximal**2 - distal**2) / (2 * proximal * distal)
    if not abs(cosine) < 1:
        raise MechanismError(
            f"legs of {proximal} m and {distal} m do not reach a platform {z} m above the base "
            f"bent; proximal + distal must exceed {reach:.6g} m and |proximal - distal| must be "
            "less"
        )
    knee = acos(cosine)
    return atan2(z, x) - atan2(distal * sin(knee), proximal + distal * cosine), knee
