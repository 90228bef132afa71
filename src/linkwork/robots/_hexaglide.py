"""The Hexaglide 6-PUS: six carriages on parallel rails carry a platform by rods of constant length.

    carriage i    at (q_i, y_i, 0) on a rail along x                              slide_i, actuated
    rod i         from the carriage to P + R b_i:   |P + R b_i - (q_i, y_i, 0)| = rod,
                  so with d = P + R b_i - (0, y_i, 0)
                  q_i = d_x + s_i sqrt(rod^2 - d_y^2 - d_z^2),
                  s_i = 1 or -1: the carriage is ahead or behind

z points up, the platform hangs below the rails.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from linkwork.mechanism import Frame, FreeJoint, Mechanism, MechanismError, PrismaticJoint, Tool
from linkwork.robots.points import circle, six_points
from linkwork.robots.poses import QuaternionPose, free_coordinates
from linkwork.robots.rods import End, Parts, Rods
from linkwork.robots.uniform import (
    ALONG_X,
    cube,
    disc,
    require_kinds,
    require_masses,
    require_sizes,
)

RAILS = (0.5, 0.1, 0.1, -0.5, -0.1, -0.1)
SIDES = (1, 1, -1, 1, 1, -1)
PLATFORM = circle(0.2, (30.0, 105.0, 120.0, -30.0, -105.0, -120.0))
HOME = Frame(position=(0.0, 0.0, -0.45))


def hexaglide(
    rod: float = 0.7,
    rails: Sequence[float] = RAILS,
    sides: Sequence[int] = SIDES,
    platform_points: Sequence[Sequence[float]] = PLATFORM,
    home: Frame = HOME,
    carriage_mass: float = 1.5,
    platform_mass: float = 4.0,
    platform_radius: float = 0.2,
    rod_mass: float = 0.5,
    rod_radius: float = 0.008,
    idle_spins: bool = False,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe a Hexaglide, six carriages on parallel rails that carry a platform by rods of
    constant length.

    Args:
        rod: length of the rods [m].
        rails: y_1..y_6 of the rails [m]; two carriages may share one.
        sides: s_1..s_6, 1 for a carriage ahead of its platform point (at larger x), -1 for one
            behind.
        platform_points: b_1..b_6 in the platform's frame [m].
        home: the platform's pose in the reference configuration.
        carriage_mass, platform_mass: masses [kg]; the platform is a disc.
        platform_radius: of the disc, for its inertia [m].
        rod_mass: mass of a rod [kg]; zero makes the rods distance constraints.
        rod_radius: of the rods, for their inertia [m].
        idle_spins: with rods of mass, make both their ends spherical joints: each rod then spins
            freely about itself (mobility 12, six of it idle). If not, the ends at the carriages are
            universal joints.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints slide_1..6 (actuated; x of the carriages [m]), knuckle_i and ball_i at
            the ends of rod i
        (or the joints rod_1..6), and pose, a free joint which says where the platform is; its tool
        is the platform's frame.

    Raises:
        MechanismError: other than six points, rails or sides, a size that is not above zero, a mass
            below zero, rods that do not reach their rails at home.

    Source: Honegger, Codourey & Burdet, Adaptive control of the Hexaglide, a 6 dof parallel
    manipulator, IEEE ICRA 1997; layout of the rails and dimensions ours.
    """
    require_kinds(hexaglide, locals())
    # What is given makes six legs.
    require_sizes(rod=rod, platform_radius=platform_radius, rod_radius=rod_radius)
    require_masses(carriage_mass=carriage_mass, platform_mass=platform_mass, rod_mass=rod_mass)
    b = six_points("platform_points", platform_points)
    for name, values in (("rails", rails), ("sides", sides)):
        if len(values) != 6:
            raise MechanismError(f"give six values, not {len(values)}", (name,))
    if not all(side in (1, -1) for side in sides):
        raise MechanismError(f"{tuple(sides)} is not made of 1 (ahead) and -1 (behind)", ("sides",))
    # A leg: a rail, a carriage where the rod meets the rail on its side, and the rod.
    pose = QuaternionPose.of(home)
    rods = Rods(rod, rod_mass, rod_radius, idle_spins)
    slides, legs = Parts(), Parts()
    for i in range(6):
        slide, body = f"slide_{i + 1}", f"carriage_{i + 1}"
        x, y, z = pose.point(b[i])
        square = rod**2 - (y - rails[i]) ** 2 - z**2
        if not square > 0:
            raise MechanismError(
                f"rod {i + 1} of {rod} m does not reach its rail at home; lengthen it or move home"
            )
        position = float(x) + sides[i] * sqrt(square)
        rail = PrismaticJoint(
            connects=("ground", body),
            frames=(Frame(position=(0.0, rails[i], 0.0)), Frame()),
            axis=ALONG_X,
        )
        slides |= Parts({body: cube(carriage_mass, 0.1)}, {slide: rail}, {slide: position})
        carriage = End(
            body, np.zeros(3), QuaternionPose.of(Frame(position=(position, rails[i], 0.0)))
        )
        legs |= rods.between(str(i + 1), carriage, End("platform", b[i], pose))
    return Mechanism(
        name="Hexaglide",
        gravity=gravity,
        bodies=slides.bodies
        | legs.bodies
        | {"platform": disc(platform_mass, platform_radius, platform_radius / 5)},
        joints=slides.joints | legs.joints | {"pose": FreeJoint(connects=("ground", "platform"))},
        actuators=tuple(slides.joints),
        tools={"centre": Tool(body="platform")},
        reference=slides.reference | legs.reference | free_coordinates("pose", pose),
    )
