"""The Agile Wrist, a spherical 3-RRR of links of 90 degrees: a platform that turns about a fixed
point.

    motor i     axis u_i = e_i, an axis of the ground                              motor_i, actuated
    elbow i     axis w_i = Rot(e_i, q_i) e_{i+1}, carried by proximal link i       elbow_i
    wrist i     axis v_i = R e_{i+2}, fixed in the platform                        wrist_i
    distal link i spans a right angle:   w_i . v_i = 0

All nine axes meet in the origin. At q = 0 the platform's axes are the ground's and the wrist is
isotropic: the rate of motor i turns the platform about e_i alone. Gruebler's formula counts 6 * 7 -
5 * 9 = -3 freedoms; the wrist has three, six of its closure rows depend on the others. With all
frames in the origin these six vanish identically.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from linkwork.mechanism import Body, Inertia, Mechanism, RevoluteJoint, Tool
from linkwork.robots.uniform import require_kinds, require_masses, require_sizes, vector

ON_EDGE = (-9.81 / sqrt(3), -9.81 / sqrt(3), -9.81 / sqrt(3))


def agile_wrist(
    proximal_radius: float = 0.15,
    distal_radius: float = 0.12,
    platform_radius: float = 0.08,
    proximal_mass: float = 0.35,
    distal_mass: float = 0.25,
    platform_mass: float = 0.6,
    motor_inertia: float = 0.0,
    gravity: tuple[float, float, float] = ON_EDGE,
) -> Mechanism:
    """Describe the Agile Wrist, a spherical 3-RRR with right angles between the axes of each link.

    Links are thin quarter circles about the origin from one axis to the next; the platform is a
    disc across (1, 1, 1), the wrist's axis of symmetry, at platform_radius / sqrt(2) from the
    origin, so that its rim meets its three axes.

    Args:
        proximal_radius, distal_radius: radii of the quarter circles [m].
        platform_radius: of the disc [m].
        proximal_mass, distal_mass, platform_mass: masses [kg].
        motor_inertia: of each motor, seen at its axis [kg m^2].
        gravity: acceleration of gravity in the ground's axes, which are the motors' [m/s^2]; by
            default the axis of symmetry (1, 1, 1) stands upright.

    Returns:
        The mechanism: joints motor_1..3 (actuated), elbow_1..3, wrist_1..3, all zero in the
            reference; its tool is the
        platform's frame in the origin.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero.

    Source: Gosselin & Angeles, The optimum kinematic design of a spherical three-degree-of-freedom
    parallel manipulator, Journal of Mechanisms, Transmissions, and Automation in Design 111 (1989)
    202-207; Bidault, Teng & Angeles, Structural optimization of a spherical parallel manipulator
    using a two-level approach, ASME DETC 2001 (the Agile Wrist); dimensions ours.
    """
    require_kinds(agile_wrist, locals())
    require_sizes(
        proximal_radius=proximal_radius,
        distal_radius=distal_radius,
        platform_radius=platform_radius,
    )
    require_masses(
        proximal_mass=proximal_mass,
        distal_mass=distal_mass,
        platform_mass=platform_mass,
        motor_inertia=motor_inertia,
    )
    # Each leg: two quarters of a circle about the origin, from the motor's axis u over w to the
    # platform's v.
    bodies, motors, elbows, wrists = {}, {}, {}, {}
    for i in range(3):
        u, w, v = np.roll(np.eye(3), -i, axis=0)
        proximal, distal = f"proximal_{i + 1}", f"distal_{i + 1}"
        bodies |= {
            proximal: quarter_circle(proximal_mass, proximal_radius, u, w),
            distal: quarter_circle(distal_mass, distal_radius, w, v),
        }
        motors[f"motor_{i + 1}"] = RevoluteJoint(
            connects=("ground", proximal), axis=vector(u), rotor_inertia=motor_inertia
        )
        elbows[f"elbow_{i + 1}"] = RevoluteJoint(connects=(proximal, distal), axis=vector(w))
        wrists[f"wrist_{i + 1}"] = RevoluteJoint(connects=(distal, "platform"), axis=vector(v))
    return Mechanism(
        name="Agile Wrist",
        gravity=gravity,
        bodies=bodies | {"platform": tilted_disc(platform_mass, platform_radius)},
        joints=motors | elbows | wrists,
        actuators=tuple(motors),
        tools={"centre": Tool(body="platform")},
    )


def quarter_circle(mass: float, radius: float, start: np.ndarray, end: np.ndarray) -> Body:
    """Return a thin uniform arc n(t) = cos t start + sin t end, 0 <= t <= pi/2, of this radius
    about the origin.

    Mean of n: 2/pi (start + end);  mean of n n': (start start' + end end') / 2 + (start end' + end
    start') / pi.
    """
    mean = 2 / pi * (start + end)
    second = (np.outer(start, start) + np.outer(end, end)) / 2 + (
        np.outer(start, end) + np.outer(end, start)
    ) / pi
    spread = second - np.outer(mean, mean)
    return body(mass, radius * mean, mass * radius**2 * (np.trace(spread) * np.eye(3) - spread))


def tilted_disc(mass: float, radius: float) -> Body:
    """Return a thin disc with the normal n = (1, 1, 1) / sqrt(3): I = m r^2 / 4 (1 + n n')."""
    normal = np.ones(3) / sqrt(3)
    return body(
        mass,
        radius / sqrt(2) * normal,
        mass * radius**2 / 4 * (np.eye(3) + np.outer(normal, normal)),
    )


def body(mass: float, centre: np.ndarray, inertia: np.ndarray) -> Body:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    return Body(
        mass=mass,
        centre_of_mass=vector(centre),
        inertia=Inertia(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz),
    )
