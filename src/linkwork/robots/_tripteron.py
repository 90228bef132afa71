"""The Tripteron 3-PRRR: three orthogonal legs, each with all its axes parallel, and a platform that
only translates.

    carriage i  at q_i e_i on its rail along e_i, an axis of the ground           slide_i, actuated
    links of i  proximal and distal, in the plane across e_i: turn about e_i by root_i, elbow_i
    tip i       the third revolute joint, axis e_i, on the platform               tip_i

With i, j, k cyclic and at zero angles the proximal link along e_j and the distal link along e_k:

    q_i = P_i,  P_j + proximal = proximal cos a + (-distal) sin(a + b),
                P_k + distal = proximal sin a + distal cos(a + b)

where a = root_i, b = elbow_i: the coordinates of the platform's centre P are those of the drives,
fully decoupled. A leg keeps the platform from turning about e_j and e_k, so three legs do it twice:
Gruebler's formula counts 6 * 10 - 5 * 12 = 0 freedoms, the robot has three, three of its closure
rows depend on the others (it is overconstrained).
"""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import Frame, Mechanism, PrismaticJoint, RevoluteJoint, Tool
from linkwork.robots.uniform import cube, require_kinds, require_masses, require_sizes, rod, vector


def tripteron(
    proximal: float = 0.3,
    distal: float = 0.3,
    offset: float = 0.06,
    link_radius: float = 0.012,
    carriage_mass: float = 0.8,
    proximal_mass: float = 0.4,
    distal_mass: float = 0.3,
    platform_mass: float = 0.5,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the Tripteron, whose platform translates as its three drives do, each along its own
    axis.

    All joint coordinates are zero in the reference, with right angles at the elbows.

    Args:
        proximal, distal: lengths of the links [m].
        offset: distance of the platform's three joints from its centre, joint i at -offset e_i [m].
        link_radius: of the links, round rods, for their inertia [m].
        carriage_mass, proximal_mass, distal_mass, platform_mass: masses [kg]; carriages and
            platform are cubes of side offset.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints slide_1..3 (actuated), root_1..3, elbow_1..3, tip_1..3; its tool is
            the platform's centre.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero.

    Source: Kong & Gosselin, Kinematics and singularity analysis of a novel type of 3-CRR 3-dof
    translational parallel manipulator, International Journal of Robotics Research 21 (2002)
    791-798; Gosselin, Kong, Foucault & Bonev, A fully decoupled 3-dof translational parallel
    mechanism, Parallel Kinematic Machines 2004; dimensions ours.
    """
    require_kinds(tripteron, locals())
    require_sizes(proximal=proximal, distal=distal, offset=offset, link_radius=link_radius)
    require_masses(
        carriage_mass=carriage_mass,
        proximal_mass=proximal_mass,
        distal_mass=distal_mass,
        platform_mass=platform_mass,
    )
    # Three equal legs, square to each other: a slide along e and three hinges parallel to it.
    bodies, slides, roots, elbows, tips = {}, {}, {}, {}, {}
    for i in range(3):
        e, e_j, e_k = np.roll(np.eye(3), -i, axis=0)
        axis, label = vector(e), str(i + 1)
        carriage, first, second = f"carriage_{label}", f"proximal_{label}", f"distal_{label}"
        bodies |= {
            carriage: cube(carriage_mass, offset),
            first: rod(proximal_mass, proximal, link_radius, 0.0, e_j),
            second: rod(distal_mass, distal, link_radius, 0.0, e_k),
        }
        # In the reference the legs are bent at a right angle in their plane.
        start = Frame(position=vector(-offset * e - proximal * e_j - distal * e_k))
        slides[f"slide_{label}"] = PrismaticJoint(
            connects=("ground", carriage), frames=(start, Frame()), axis=axis
        )
        roots[f"root_{label}"] = RevoluteJoint(connects=(carriage, first), axis=axis)
        elbow, tip, hold = (
            Frame(position=vector(p)) for p in (proximal * e_j, distal * e_k, -offset * e)
        )
        elbows[f"elbow_{label}"] = RevoluteJoint(
            connects=(first, second), frames=(elbow, Frame()), axis=axis
        )
        tips[f"tip_{label}"] = RevoluteJoint(
            connects=(second, "platform"), frames=(tip, hold), axis=axis
        )
    return Mechanism(
        name="Tripteron",
        gravity=gravity,
        bodies=bodies | {"platform": cube(platform_mass, offset)},
        joints=slides | roots | elbows | tips,
        actuators=tuple(slides),
        tools={"centre": Tool(body="platform")},
    )
