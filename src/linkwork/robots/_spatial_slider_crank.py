"""The spatial slider-crank of the IFToMM benchmark library: a crank about x, a rod between ball and
cross, a slider along x.

    crank     about the x axis through A = (0, y, z), upright at t = 0, length r    crank, actuated
              B = A + r (0, -sin t, cos t)                                          ball
    slider    C = (s, 0, 0),  s^2 = l^2 - B_y^2 - B_z^2                             slide
    rod       from B to C, length l; the cross at C has one pin along x             cross
              in the slider, the other across the rod:
              C - B = l (cos c_2, sin c_1 sin c_2, -cos c_1 sin c_2)

The published problem says "universal joint" and not which way its pins lie. With the first along x,
as in Haug's revolute-cylindrical joint, the motion stays within 1e-4 m of F. Gonzalez's published
solution for 5 s; with it along y or z the two are 3e-3 m apart after one second.
"""

from __future__ import annotations

from math import acos, atan2, sqrt

import numpy as np

from linkwork.mechanism import (
    Body,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    PrismaticJoint,
    RevoluteJoint,
    SphericalJoint,
    Tool,
    UniversalJoint,
)
from linkwork.robots.poses import ball_coordinates, product, turn
from linkwork.robots.uniform import ALONG_X, ALONG_Y, require_kinds, require_masses, require_sizes


def spatial_slider_crank(
    crank: float = 0.08,
    rod: float = 0.3,
    pivot: tuple[float, float] = (0.1, 0.12),
    masses: tuple[float, float, float] = (0.12, 0.5, 2.0),
    crank_inertia: tuple[float, float, float] = (1e-4, 1e-4, 1e-5),
    rod_inertia: tuple[float, float, float] = (4e-4, 4e-3, 4e-3),
    slider_inertia: float = 1e-4,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Mechanism:
    """Describe a slider-crank between a crank about x and a slider along x; the defaults are the
    benchmark's data.

    Args:
        crank, rod: r and l, lengths [m].
        pivot: (y, z), where the crank's axis crosses the plane x = 0 [m].
        masses: of crank, rod and slider [kg]; the mass centres of crank and rod are their middles.
        crank_inertia, rod_inertia: principal moments about the mass centres, the crank along its z
            axis, the rod along its x axis [kg m^2].
        slider_inertia: about every axis [kg m^2]; the slider does not turn.
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints crank (actuated), slide, cross, ball; its tool is the slider. In the
            reference the crank is
        upright; the benchmark's motion starts there with the crank's rate 6 rad/s.

    Raises:
        MechanismError: a length that is not above zero, a mass below zero, a rod that does not
            reach the slider's axis.

    Source: IFToMM library of computational benchmark problems, spatial rigid slider-crank mechanism
    (Masoudi, after Haug, Computer-Aided Kinematics and Dynamics of Mechanical Systems, 1989, sec.
    12.2).
    """
    require_kinds(spatial_slider_crank, locals())
    # The rod spans what lies between the crank's pin, which stands upright, and the slide.
    require_sizes(crank=crank, rod=rod)
    require_masses(**dict(zip(("crank_mass", "rod_mass", "slider_mass"), masses, strict=True)))
    y, z = pivot
    far = sqrt(y**2 + (z + crank) ** 2)
    if not far < rod:
        raise MechanismError(
            f"the rod of {rod} m does not reach the slider's axis; rod must exceed {far:.6g} m"
        )
    slide = sqrt(rod**2 - far**2)
    # How the universal joint at the slider and the ball at the crank hold it there.
    cross_1, cross_2 = atan2(-y, z + crank), acos(slide / rod)
    rod_turn = product(turn(ALONG_X, cross_1), turn(ALONG_Y, cross_2))
    centres = ((0.0, 0.0, crank / 2), (-rod / 2, 0.0, 0.0), (0.0, 0.0, 0.0))
    bodies = {
        name: Body(mass=mass, centre_of_mass=centre, inertia=Inertia(xx=xx, yy=yy, zz=zz))
        for name, mass, centre, (xx, yy, zz) in zip(
            ("crank", "rod", "slider"),
            masses,
            centres,
            (crank_inertia, rod_inertia, (slider_inertia,) * 3),
            strict=True,
        )
    }
    axle, pin = Frame(position=(0.0, y, z)), Frame(position=(0.0, 0.0, crank))
    return Mechanism(
        name="spatial slider-crank",
        gravity=gravity,
        bodies=bodies,
        joints={
            "crank": RevoluteJoint(
                connects=("ground", "crank"), frames=(axle, Frame()), axis=ALONG_X
            ),
            "slide": PrismaticJoint(connects=("ground", "slider"), axis=ALONG_X),
            "cross": UniversalJoint(connects=("slider", "rod"), axes=(ALONG_X, ALONG_Y)),
            "ball": SphericalJoint(
                connects=("crank", "rod"), frames=(pin, Frame(position=(-rod, 0.0, 0.0)))
            ),
        },
        actuators=("crank",),
        tools={"slider": Tool(body="slider")},
        reference={"slide": slide, "cross.angle_1": cross_1, "cross.angle_2": cross_2}
        | ball_coordinates("ball", np.array([1.0, 0.0, 0.0, 0.0]), rod_turn),
    )
