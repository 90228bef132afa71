"""The Delta robot of Clavel with rotary drives: three arms, three parallelograms of rods, a
platform that only translates.

    leg i    in the vertical plane of e_i = (cos f_i, sin f_i, 0),  t_i = z x e_i,
             f = (-pi/2, pi/6, 5 pi/6)
    elbow i  E_i = (base_radius + arm cos q_i) e_i - arm sin q_i z           motor_i, actuated
    rods     from E_i -+ spread/2 t_i to P + platform_radius e_i -+ spread/2 t_i:
             |P + platform_radius e_i - E_i| = rod

z points up, the platform hangs below the base, arms are level at q = 0 and turn down. Nothing but
the six rods holds the platform, in position and in orientation.
"""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import Frame, FreeJoint, Mechanism, Tool
from linkwork.robots.arms import Arms, arm_angle
from linkwork.robots.points import TRIANGLE, compass
from linkwork.robots.poses import QuaternionPose, free_coordinates
from linkwork.robots.rods import End, Parts, Rods
from linkwork.robots.uniform import ALONG_Y, disc, require_kinds, require_masses, require_sizes


def delta(
    base_radius: float = 0.164,
    platform_radius: float = 0.044,
    arm: float = 0.524,
    rod: float = 1.244,
    spread: float = 0.131,
    height: float = 0.9,
    arm_mass: float = 1.5,
    platform_mass: float = 0.8,
    arm_radius: float = 0.03,
    motor_inertia: float = 0.05,
    rod_mass: float = 0.0,
    rod_radius: float = 0.007,
    idle_spins: bool = False,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the rotary Delta robot; the lengths between its joints are an ABB FlexPicker's.

    Args:
        base_radius, platform_radius: distances of the motors' axes and of the rods' lower ends from
            the centres [m].
        arm, rod: lengths of the arms and rods [m].
        spread: distance between the two rods of a leg [m].
        height: of the base over the platform in the reference configuration [m].
        arm_mass, platform_mass: masses [kg]; arms are round rods, the platform is a disc.
        arm_radius: of the arms, for their inertia [m].
        motor_inertia: of each motor and its gear, seen at the arm [kg m^2].
        rod_mass: mass of a rod [kg]; zero makes the rods distance constraints.
        rod_radius: of the rods, for their inertia [m].
        idle_spins: with rods of mass, make both their ends spherical joints: each rod then spins
            freely about itself (mobility 9, six of it idle). If not, the upper ends are universal
            joints.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints motor_1..3 (actuated), rod_1_left .. rod_3_right (or knuckle_ and
            ball_ at both ends of
        these bodies), and pose, a free joint which says where the platform is; its tool is the
        platform's centre.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero, arms and rods that do not
            reach the platform.

    Source: Clavel, Conception d'un robot parallèle rapide à 4 degrés de liberté, EPFL 1991;
    geometry and lengths as in Williams, The Delta parallel robot: kinematics solutions, Ohio
    University 2015 (ABB FlexPicker IRB 360-1/1600: base, platform, arm, rod, spread); masses,
    radii, motor_inertia and height ours.
    """
    require_kinds(delta, locals())
    # The platform lies level below the base: all arms hang at one angle.
    require_sizes(
        base_radius=base_radius,
        platform_radius=platform_radius,
        arm=arm,
        rod=rod,
        spread=spread,
        height=height,
        arm_radius=arm_radius,
        rod_radius=rod_radius,
    )
    require_masses(
        arm_mass=arm_mass,
        platform_mass=platform_mass,
        motor_inertia=motor_inertia,
        rod_mass=rod_mass,
    )
    centre = QuaternionPose.of(Frame(position=(0.0, 0.0, -height)))
    angle = arm_angle(platform_radius - base_radius, -height, arm, rod)
    arms = Arms(base_radius, arm, arm_radius, arm_mass, motor_inertia)
    rods = Rods(rod, rod_mass, rod_radius, idle_spins)
    # A leg: a motor, its arm, and two rods side by side from the elbow to the platform.
    motors, legs = Parts(), Parts()
    for i, f in enumerate(TRIANGLE, start=1):
        e, t = compass(f)
        drive, elbow = arms.at(str(i), f, angle)
        motors |= drive
        vertex = End("platform", platform_radius * e, centre)
        legs |= rods.pair(str(i), elbow, vertex, (spread / 2 * np.array(ALONG_Y), spread / 2 * t))
    return Mechanism(
        name="Delta",
        gravity=gravity,
        bodies=motors.bodies
        | legs.bodies
        | {"platform": disc(platform_mass, platform_radius, platform_radius / 4)},
        joints=motors.joints | legs.joints | {"pose": FreeJoint(connects=("ground", "platform"))},
        actuators=tuple(motors.joints),
        tools={"centre": Tool(body="platform")},
        reference=motors.reference | legs.reference | free_coordinates("pose", centre),
    )
