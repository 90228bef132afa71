"""The stiff flyball governor of the IFToMM benchmark library: a turning shaft, two rods with balls,
a slider on springs.

    shaft     upright along z from the ground, height h, turns by q               spindle, actuated
    slider    on the shaft at the height s                                        slide
    rod i     about a horizontal hinge at the height h, c from the axis, a_i      hinge_1, hinge_2
              below the horizontal; a point at the distance r along it:
              c + r cos a_i from the axis, h - r sin a_i high
    ball i    at the rod's end, r = l
    spring i  from the rod's middle to the slider, c from the axis; without tension at the length l0

There is no loop: springs stand where Watt's governor has links, and so stiff that these hardly
move. In the reference both springs are without tension: s = h - l/2 sin a - sqrt(l0^2 -
(l/2 cos a)^2).
"""

from __future__ import annotations

from math import cos, isfinite, pi, sin, sqrt

from linkwork.mechanism import (
    Body,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    PointSpring,
    PrismaticJoint,
    RevoluteJoint,
    Tool,
)
from linkwork.robots.uniform import cube, require_kinds, require_masses, require_sizes


def flyball_governor(
    height: float = 1.0,
    rod: float = 1.0,
    section: float = 0.01,
    side: float = 0.1,
    density: float = 3000.0,
    ball_mass: float = 5.0,
    stiffness: float = 8e5,
    damping: float = 4e4,
    rest_length: float = 0.5,
    angle: float = pi / 6,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe the flyball governor: a turning shaft, two rods with balls, a slider on stiff
    springs.

    The benchmark's motion starts from the reference with the spindle at 2 pi rad/s and lasts 10 s.

    Args:
        height: h, of the shaft and of the hinges [m].
        rod: l, length of the rods [m].
        section: side of the square section of shaft and rods [m].
        side: of the slider, a cube; the hinges and the springs' lower ends are c = side / 2 from
            the axis [m].
        density: of all but the balls [kg/m^3].
        ball_mass: mass of each ball, a point [kg].
        stiffness, damping: of each spring [N/m, N s/m].
        rest_length: l0, of each spring [m].
        angle: a, of the rods below the horizontal in the reference [rad].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints spindle (actuated), slide, hinge_1, hinge_2: four freedoms; its tool
            is the slider.

    Raises:
        MechanismError: a size that is not above zero, a mass below zero, springs that do not reach
            the slider.

    Source: IFToMM library of computational benchmark problems, A05, stiff flyball governor.
    """
    require_kinds(flyball_governor, locals())
    # The springs have to reach the slider, however much they pull there.
    require_sizes(height=height, rod=rod, section=section, side=side, rest_length=rest_length)
    require_masses(density=density, ball_mass=ball_mass)
    if not isfinite(angle):
        raise MechanismError(f"is {angle}; give a finite angle [rad]", ("angle",))
    across = rod / 2 * abs(cos(angle))
    if not across < rest_length:
        raise MechanismError(
            f"springs of {rest_length} m do not reach the slider; rest_length must exceed "
            f"{across:.6g} m"
        )
    c, beam_mass = side / 2, density * section**2
    # A spindle, a slider on it, and on either side a rod on a hinge and a spring to its middle.
    joints: dict[str, RevoluteJoint | PrismaticJoint] = {
        "spindle": RevoluteJoint(connects=("ground", "shaft")),
        "slide": PrismaticJoint(connects=("shaft", "slider")),
    }
    springs = {}
    for i, out in ((1, 1.0), (2, -1.0)):
        joints[f"hinge_{i}"] = RevoluteJoint(
            connects=("shaft", f"rod_{i}"),
            frames=(Frame(position=(out * c, 0.0, height)), Frame()),
            axis=(0.0, out, 0.0),
        )
        springs[f"spring_{i}"] = PointSpring(
            connects=("slider", f"rod_{i}"),
            points=((out * c, 0.0, 0.0), (out * rod / 2, 0.0, 0.0)),
            stiffness=stiffness,
            rest_length=rest_length,
            damping=damping,
        )
    # Square beams; the slider is a cube.
    along, upright = beam_inertia(beam_mass * height, height, section)
    shaft = Body(
        mass=beam_mass * height,
        centre_of_mass=(0, 0, height / 2),
        inertia=Inertia(xx=upright, yy=upright, zz=along),
    )
    return Mechanism(
        name="flyball governor",
        gravity=gravity,
        bodies={"shaft": shaft, "slider": cube(density * side**3, side)}
        | {
            f"rod_{i}": loaded_rod(beam_mass * rod, rod, section, ball_mass, out)
            for i, out in ((1, 1.0), (2, -1.0))
        },
        joints=joints,
        springs=springs,
        actuators=("spindle",),
        tools={"slider": Tool(body="slider")},
        reference={
            "slide": height - rod / 2 * sin(angle) - sqrt(rest_length**2 - across**2),
            "hinge_1": angle,
            "hinge_2": angle,
        },
    )


def beam_inertia(mass: float, length: float, section: float) -> tuple[float, float]:
    """Return a square beam's moments about its middle: along m b^2 / 6, across m (l^2 + b^2) / 12
    [kg m^2]."""
    return mass * section**2 / 6, mass * (length**2 + section**2) / 12


def loaded_rod(mass: float, length: float, section: float, ball_mass: float, out: float) -> Body:
    """Return a square rod along out x from the origin, with a point mass at its end.

    Their mass centres are l/2 apart: across, m b / (m + b) (l/2)^2 adds to the rod's own moment.
    """
    total = mass + ball_mass
    along, across = beam_inertia(mass, length, section)
    across += mass * ball_mass / total * (length / 2) ** 2 if total else 0.0
    centre = out * length * ((mass / 2 + ball_mass) / total if total else 0.5)
    return Body(
        mass=total,
        centre_of_mass=(centre, 0.0, 0.0),
        inertia=Inertia(xx=along, yy=across, zz=across),
    )
