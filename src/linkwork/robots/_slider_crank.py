"""The planar slider-crank: a driven crank, a connecting rod, a slider on a line beside the crank's
pivot.

crank     from (0, 0) at the angle t, length r                                    crank, actuated
rod       from the crank's pin at the angle b = t + p, length l, to the slider    pin
slider    at (s, h): s = r cos t + l cos b,  h = r sin t + l sin b                 slide; wrist = -b
"""

from __future__ import annotations

from math import asin, cos, pi, sin

from linkwork.mechanism import (
    Body,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    PrismaticJoint,
    RevoluteJoint,
    Tool,
)
from linkwork.robots.uniform import ALONG_X, require_kinds, require_masses, require_sizes

START = pi / 4  # the crank's angle in the reference


def slider_crank(
    crank: float = 0.1,
    rod: float = 0.3,
    offset: float = 0.0,
    masses: tuple[float, float, float] = (0.4, 0.6, 1.0),
    centres: tuple[float, float] = (0.05, 0.15),
    inertias: tuple[float, float] = (3.3e-4, 4.5e-3),
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0),
) -> Mechanism:
    """Describe a planar slider-crank, driven at the crank.

    Args:
        crank, rod: r and l, lengths [m].
        offset: h, height of the slider's line above the crank's pivot [m].
        masses: of crank, rod and slider [kg].
        centres: distance of the mass centres of crank and rod from the crank's pivot and from its
            pin [m].
        inertias: of crank and rod about their mass centres, about z [kg m^2].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints crank (actuated), pin, wrist, slide; its tool is the slider. In the
            reference the crank is at
        the angle pi/4, the slider on the side of positive x.

    Raises:
        MechanismError: a length that is not above zero, a mass below zero, a rod that does not
            reach the slider's line.

    Source: Norton, Design of Machinery, ch. 4 (offset slider-crank); dimensions ours.
    """
    require_kinds(slider_crank, locals())
    # The rod spans what the crank leaves between its pin and the slide's line.
    require_sizes(crank=crank, rod=rod)
    require_masses(**dict(zip(("crank_mass", "rod_mass", "slider_mass"), masses, strict=True)))
    rise = offset - crank * sin(START)
    if not abs(rise) < rod:
        raise MechanismError(
            f"the rod of {rod} m does not reach the slider's line; rod must exceed "
            f"{abs(rise):.6g} m"
        )
    tilt = asin(rise / rod)
    centred = [
        Body(mass=mass, centre_of_mass=(centre, 0, 0), inertia=Inertia(zz=inertia))
        for mass, centre, inertia in zip(masses[:2], centres, inertias, strict=True)
    ]
    line = Frame.planar(0.0, offset)
    return Mechanism(
        name="slider-crank",
        gravity=gravity,
        bodies={
            "crank": centred[0],
            "rod": centred[1],
            "slider": Body(mass=masses[2], inertia=Inertia(zz=0.0)),
        },
        joints={
            "crank": RevoluteJoint(connects=("ground", "crank")),
            "pin": RevoluteJoint(connects=("crank", "rod"), frames=(Frame.planar(crank), Frame())),
            "wrist": RevoluteJoint(connects=("rod", "slider"), frames=(Frame.planar(rod), Frame())),
            "slide": PrismaticJoint(
                connects=("ground", "slider"), frames=(line, Frame()), axis=ALONG_X
            ),
        },
        actuators=("crank",),
        tools={"slider": Tool(body="slider")},
        reference={
            "crank": START,
            "pin": tilt - START,
            "wrist": -tilt,
            "slide": crank * cos(START) + rod * cos(tilt),
        },
    )
