"""The linear Delta robot: three carriages on columns, three parallelograms of rods, a platform that
only translates.

    carriage i    at base_radius e_i + q_i z                                      slide_i, actuated
                  e_i = (cos f_i, sin f_i, 0),  f = (-pi/2, pi/6, 5 pi/6),  t_i = z x e_i
    rods          from the carriage -+ spread/2 t_i to P + platform_radius e_i -+ spread/2 t_i:
                  |P + (platform_radius - base_radius) e_i - q_i z| = rod

z points up, the carriages run above the platform. Nothing but the six rods holds the platform.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from linkwork.mechanism import Frame, FreeJoint, Mechanism, MechanismError, PrismaticJoint, Tool
from linkwork.robots.points import TRIANGLE, compass
from linkwork.robots.poses import QuaternionPose, free_coordinates
from linkwork.robots.rods import End, Parts, Rods
from linkwork.robots.uniform import cube, disc, require_kinds, require_masses, require_sizes, vector


def linear_delta(
    base_radius: float = 0.3,
    platform_radius: float = 0.05,
    rod: float = 0.5,
    spread: float = 0.08,
    carriage_mass: float = 0.8,
    platform_mass: float = 0.5,
    rod_mass: float = 0.0,
    rod_radius: float = 0.005,
    idle_spins: bool = False,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe a linear Delta robot with three upright columns.

    Args:
        base_radius, platform_radius: distances of the columns and of the rods' lower ends from the
            centres [m].
        rod: length of the rods [m].
        spread: distance between the two rods of a leg [m].
        carriage_mass, platform_mass: masses [kg]; the platform is a disc.
        rod_mass: mass of a rod [kg]; zero makes the rods distance constraints.
        rod_radius: of the rods, for their inertia [m].
        idle_spins: with rods of mass, make both their ends spherical joints: each rod then spins
            freely about itself (mobility 9, six of it idle). If not, the upper ends are universal
            joints.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints slide_1..3 (actuated; height of the carriages [m]), rod_1_left ..
            rod_3_right (or knuckle_
        and ball_ at both ends of these bodies), and pose, a free joint which says where the
        platform is, at the origin in the reference; its tool is the platform's centre.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero, rods that are parallel or
            do not reach.

    Source: geometry as in Williams, The Delta parallel robot: kinematics solutions, Ohio University
    2015, prismatic inputs; dimensions ours.
    """
    require_kinds(linear_delta, locals())
    # Carriages stand above the platform, all at one height.
    require_sizes(
        base_radius=base_radius,
        platform_radius=platform_radius,
        rod=rod,
        spread=spread,
        rod_radius=rod_radius,
    )
    require_masses(carriage_mass=carriage_mass, platform_mass=platform_mass, rod_mass=rod_mass)
    inset = base_radius - platform_radius
    if not 0 < abs(inset) < rod:
        raise MechanismError(
            f"base_radius and platform_radius differ by {abs(inset):.6g} m; give a difference "
            f"above zero, so that the rods are not parallel, and below rod = {rod} m"
        )
    lift = sqrt(rod**2 - inset**2)
    # A leg: an upright column, its carriage, and two rods side by side.
    centre = QuaternionPose.of(Frame())
    rods = Rods(rod, rod_mass, rod_radius, idle_spins)
    slides, legs = Parts(), Parts()
    for i, f in enumerate(TRIANGLE, start=1):
        e, t = compass(f)
        slide, body = f"slide_{i}", f"carriage_{i}"
        foot = Frame(position=vector(base_radius * e))
        column = PrismaticJoint(connects=("ground", body), frames=(foot, Frame()))
        slides |= Parts({body: cube(carriage_mass, spread)}, {slide: column}, {slide: lift})
        carriage = End(
            body,
            np.zeros(3),
            QuaternionPose.of(Frame(position=vector(base_radius * e + (0.0, 0.0, lift)))),
        )
        vertex = End("platform", platform_radius * e, centre)
        legs |= rods.pair(str(i), carriage, vertex, (spread / 2 * t, spread / 2 * t))
    return Mechanism(
        name="linear Delta",
        gravity=gravity,
        bodies=slides.bodies
        | legs.bodies
        | {"platform": disc(platform_mass, platform_radius, platform_radius / 4)},
        joints=slides.joints | legs.joints | {"pose": FreeJoint(connects=("ground", "platform"))},
        actuators=tuple(slides.joints),
        tools={"centre": Tool(body="platform")},
        reference=slides.reference | legs.reference | free_coordinates("pose", centre),
    )
