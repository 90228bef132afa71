"""The Par4: four arms with parallelograms of rods, and a travelling plate of two halves and two
bars that shifts in x, y, z and turns about z.

    leg i    in the vertical plane of e_i = (cos f_i, sin f_i, 0),  t_i = z x e_i,
             f = (-pi/4, pi/4, 3 pi/4, 5 pi/4);  right half: legs 1, 2, left half: legs 3, 4
    elbow i  E_i = (base_radius + arm cos q_i) e_i - arm sin q_i z           motor_i, actuated
    halves   H = C +- bar/2 (cos a, sin a, 0), right and left, their axes the ground's
    bars     front and back, their middles at C +- width/2 y, turned about z by a
    rods     from E_i -+ spread/2 t_i to V_i -+ spread/2 t_i:  |V_i - E_i| = rod,
             V_i = H + platform_radius e_i -+ bar/2 x

z points up, the plate hangs below the base, arms are level at q = 0 and turn down. Halves and bars
are a parallelogram with upright hinges, so that the halves turn alike; two legs alone would let a
half turn about one line, and these lines differ. The tool is the middle of the front bar.

Gruebler's formula counts 6 * 8 - 5 * 8 - 8 = 0 freedoms, the robot has four: three rows of the
plane parallelogram depend on the others, and one of the two halves' common orientation.
"""

from __future__ import annotations

from math import pi

import numpy as np

from linkwork.mechanism import Frame, FreeJoint, Joint, Mechanism, RevoluteJoint, Tool
from linkwork.robots.arms import Arms, arm_angle
from linkwork.robots.points import compass
from linkwork.robots.poses import QuaternionPose, free_coordinates
from linkwork.robots.rods import End, Parts, Rods
from linkwork.robots.uniform import (
    ALONG_X,
    ALONG_Y,
    require_kinds,
    require_masses,
    require_sizes,
    vector,
)
from linkwork.robots.uniform import rod as round_rod

AZIMUTHS = {"right": (-pi / 4, pi / 4), "left": (3 * pi / 4, 5 * pi / 4)}
SIDES = {"right": 1, "left": -1}
BARS = {"front": 1, "back": -1}


def par4(
    base_radius: float = 0.25,
    platform_radius: float = 0.1,
    arm: float = 0.35,
    rod: float = 0.8,
    spread: float = 0.1,
    bar: float = 0.1,
    width: float = 0.1,
    height: float = 0.65,
    arm_mass: float = 0.8,
    half_mass: float = 0.2,
    bar_mass: float = 0.15,
    arm_radius: float = 0.025,
    bar_radius: float = 0.01,
    motor_inertia: float = 0.03,
    rod_mass: float = 0.0,
    rod_radius: float = 0.006,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the Par4, whose articulated travelling plate shifts in three directions and turns
    about the vertical.

    Args:
        base_radius, platform_radius: distances of the motors' axes and, in the reference, of the
            rods' lower ends from the centres [m].
        arm, rod: lengths of the arms and rods [m].
        spread: distance between the two rods of a leg [m].
        bar, width: length of the plate's bars and distance between them, which is that of a half's
            two hinges [m].
        height: of the base over the plate in the reference configuration [m].
        arm_mass, half_mass, bar_mass: masses [kg], round rods all of them; half and bar: of one of
            the plate's two halves and of its two bars.
        arm_radius, bar_radius: of the arms and of halves and bars, for their inertia [m].
        motor_inertia: of each motor and its gear, seen at the arm [kg m^2].
        rod_mass: mass of a rod [kg]; zero makes the rods distance constraints.
        rod_radius: of the rods, for their inertia [m].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints motor_1..4 (actuated), rod_1_left .. rod_4_right (or knuckle_ and
            ball_ at both ends of these bodies), right_front, right_back, left_front, left_back,
            hinges between halves and bars, and pose, a free joint which says where the right half
            is; its tool is the middle of the front bar, led in x, y, z, rz. A gear that makes the
            turn of a gripper larger than the bars' is left out.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero, arms and rods that do not
            reach the plate.

    Source: Nabat, de la O Rodriguez, Company, Krut & Pierrot, Par4: very high speed parallel robot
    for pick-and-place, International Conference on Intelligent Robots and Systems 2005;
    dimensions and masses ours.
    """
    require_kinds(par4, locals())
    require_sizes(
        base_radius=base_radius,
        platform_radius=platform_radius,
        arm=arm,
        rod=rod,
        spread=spread,
        bar=bar,
        width=width,
        height=height,
        arm_radius=arm_radius,
        bar_radius=bar_radius,
        rod_radius=rod_radius,
    )
    require_masses(
        arm_mass=arm_mass,
        half_mass=half_mass,
        bar_mass=bar_mass,
        motor_inertia=motor_inertia,
        rod_mass=rod_mass,
    )
    # The plate lies below the base, not turned: all arms hang at one angle.
    angle = arm_angle(platform_radius - base_radius, -height, arm, rod)
    arms = Arms(base_radius, arm, arm_radius, arm_mass, motor_inertia)
    rods = Rods(rod, rod_mass, rod_radius, spinning=False)
    motors, legs, halves = Parts(), Parts(), Parts()
    for side, sign in SIDES.items():
        aside = sign * bar / 2 * np.array(ALONG_X)
        placed = QuaternionPose.of(Frame(position=vector((*aside[:2], -height))))
        halves |= Parts(
            {side: round_rod(half_mass, width, bar_radius, -width / 2, ALONG_Y)},
            {"pose": FreeJoint(connects=("ground", side))} if side == "right" else {},
            free_coordinates("pose", placed) if side == "right" else {},
        )
        # A leg: a motor, its arm, and two rods side by side from the elbow to its half.
        for f in AZIMUTHS[side]:
            label = str(len(motors.joints) + 1)
            e, t = compass(f)
            drive, elbow = arms.at(label, f, angle)
            vertex = End(side, platform_radius * e - aside, placed)
            motors |= drive
            legs |= rods.pair(
                label, elbow, vertex, (spread / 2 * np.array(ALONG_Y), spread / 2 * t)
            )
    plate = halves | parallelogram(bar, width, bar_mass, bar_radius)
    return Mechanism(
        name="Par4",
        gravity=gravity,
        bodies=motors.bodies | legs.bodies | plate.bodies,
        joints=motors.joints | legs.joints | plate.joints,
        actuators=tuple(motors.joints),
        tools={"gripper": Tool(body="front")},
        reference=motors.reference | legs.reference | plate.reference,
    )


def parallelogram(bar: float, width: float, mass: float, radius: float) -> Parts:
    """Return the two bars of a plate and their hinges with its halves."""
    hinges: dict[str, Joint] = {
        f"{side}_{name}": RevoluteJoint(
            connects=(side, name),
            frames=(
                Frame(position=(0.0, ahead * width / 2, 0.0)),
                Frame(position=(sign * bar / 2, 0.0, 0.0)),
            ),
        )
        for side, sign in SIDES.items()
        for name, ahead in BARS.items()
    }
    bodies = {name: round_rod(mass, bar, radius, -bar / 2, ALONG_X) for name in BARS}
    return Parts(bodies, hinges)
