"""The Orthoglide: a Delta with three orthogonal rails, isotropic where its rods lie along them.

    carriage i    at (offset + rod + q_i) e_i, e_i an axis of the ground          slide_i, actuated
    rods          from the carriage -+ spread/2 t_i to P + offset e_i -+ spread/2 t_i,
                  (P_i - rod - q_i)^2 + P_j^2 + P_k^2 = rod^2,  t_i = e_{i+1}

At q = 0 the platform is at the origin and moves along e_i exactly as carriage i does. In each leg
the rods keep the platform from turning about e_i x t_i = e_{i+2}.
"""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import Frame, FreeJoint, Mechanism, PrismaticJoint, Tool
from linkwork.robots.poses import QuaternionPose, free_coordinates
from linkwork.robots.rods import End, Parts, Rods
from linkwork.robots.uniform import cube, require_kinds, require_masses, require_sizes, vector


def orthoglide(
    rod: float = 0.31,
    offset: float = 0.05,
    spread: float = 0.08,
    carriage_mass: float = 0.8,
    platform_mass: float = 0.5,
    rod_mass: float = 0.0,
    rod_radius: float = 0.005,
    idle_spins: bool = False,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the Orthoglide, a Delta on three orthogonal rails; the rods have the prototype's
    length, other data ours.

    The parallelograms are pairs of rods, which move as the paper's hinged ones do without their
    redundant rows.

    Args:
        rod: length of the rods [m].
        offset: distance of the rods' ends from the platform's centre along the axes [m].
        spread: distance between the two rods of a leg [m].
        carriage_mass, platform_mass: masses [kg]; carriages and platform are cubes of sides spread
            and offset.
        rod_mass: mass of a rod [kg]; zero makes the rods distance constraints.
        rod_radius: of the rods, for their inertia [m].
        idle_spins: with rods of mass, make both their ends spherical joints: each rod then spins
            freely about itself (mobility 9, six of it idle). If not, the ends at the carriages are
            universal joints.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints slide_1..3 (actuated), rod_1_left .. rod_3_right (or knuckle_ and
            ball_ at both ends of
        these bodies), and pose, a free joint which says where the platform is, at the origin in the
        reference; its tool is the platform's centre.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero.

    Source: Wenger & Chablat, Kinematic analysis of a new parallel machine tool: the Orthoglide,
    Advances in Robot Kinematics 2000; length: Chablat & Wenger, IEEE Transactions on Robotics and
    Automation 19 (2003) 403-410.
    """
    require_kinds(orthoglide, locals())
    require_sizes(rod=rod, offset=offset, spread=spread, rod_radius=rod_radius)
    require_masses(carriage_mass=carriage_mass, platform_mass=platform_mass, rod_mass=rod_mass)
    centre = QuaternionPose.of(Frame())
    rods = Rods(rod, rod_mass, rod_radius, idle_spins)
    slides, legs = Parts(), Parts()
    for i in range(3):
        e, half = np.eye(3)[i], spread / 2 * np.eye(3)[(i + 1) % 3]
        body, start = f"carriage_{i + 1}", Frame(position=vector((offset + rod) * e))
        rail = PrismaticJoint(connects=("ground", body), frames=(start, Frame()), axis=vector(e))
        slides |= Parts({body: cube(carriage_mass, spread)}, {f"slide_{i + 1}": rail})
        carriage = End(body, np.zeros(3), QuaternionPose.of(start))
        vertex = End("platform", offset * e, centre)
        legs |= rods.pair(str(i + 1), carriage, vertex, (half, half))
    return Mechanism(
        name="Orthoglide",
        gravity=gravity,
        bodies=slides.bodies | legs.bodies | {"platform": cube(platform_mass, offset)},
        joints=slides.joints | legs.joints | {"pose": FreeJoint(connects=("ground", "platform"))},
        actuators=tuple(slides.joints),
        tools={"centre": Tool(body="platform")},
        reference=legs.reference | free_coordinates("pose", centre),
    )
