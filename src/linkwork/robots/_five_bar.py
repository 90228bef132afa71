"""The planar five-bar robot (5R): two actuated cranks, two distal links that meet at the tool."""

from __future__ import annotations

from linkwork.mechanism import Frame, Mechanism, RevoluteJoint, Tool
from linkwork.robots.plane import uniform_rod
from linkwork.robots.uniform import require_kinds


def five_bar(
    base: float = 0.3,
    proximal: float = 0.25,
    distal: float = 0.35,
    proximal_mass: float = 0.4,
    distal_mass: float = 0.3,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe a symmetric five-bar with uniform rods, driven at the two pivots of its base.

    Args:
        base: distance between the fixed pivots, at (0, 0) and (base, 0) [m].
        proximal, distal: lengths of the cranks and of the distal links [m].
        proximal_mass, distal_mass: masses [kg].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Source: geometry as in Liu, Wang & Pritschow, Mechanism and Machine Theory 41 (2006) 119-144;
    dimensions ours.
    """
    require_kinds(five_bar, locals())

    # Two links on either side, each along its own x axis.
    bodies = {f"proximal_{i}": uniform_rod(proximal_mass, proximal) for i in (1, 2)}
    bodies |= {f"distal_{i}": uniform_rod(distal_mass, distal) for i in (1, 2)}
    # Both motors stand on the ground; the tip closes the loop.
    joints = {
        "motor_1": RevoluteJoint(connects=("ground", "proximal_1")),
        "motor_2": RevoluteJoint(
            connects=("ground", "proximal_2"), frames=(Frame.planar(base), Frame())
        ),
        "elbow_1": RevoluteJoint(
            connects=("proximal_1", "distal_1"), frames=(Frame.planar(proximal), Frame())
        ),
        "elbow_2": RevoluteJoint(
            connects=("proximal_2", "distal_2"), frames=(Frame.planar(proximal), Frame())
        ),
        "tip": RevoluteJoint(
            connects=("distal_1", "distal_2"), frames=(Frame.planar(distal), Frame.planar(distal))
        ),
    }
    return Mechanism(
        name="five-bar",
        gravity=gravity,
        bodies=bodies,
        joints=joints,
        actuators=("motor_1", "motor_2"),
        tools={"tip": Tool(body="distal_1", frame=Frame.planar(distal))},
        reference={
            "motor_1": 2.06319780954,
            "motor_2": 1.07713218105,
            "elbow_1": -1.36627557076,
            "elbow_2": 1.36698142936,
            "tip": 1.74719137163,
        },
    )
