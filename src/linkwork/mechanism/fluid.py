"""What a fluid around the bodies is like, and what of the bodies it acts on.

The forces follow from the motion of the body at the moment, as if the fluid were at rest but for a
steady wind, and no body disturbed it for another (`linkwork.equations.fluid`).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from linkwork.mechanism.frame import Frame
from linkwork.mechanism.record import Amount, Name, Positive, Record, Vector3

Sides = tuple[Positive, Positive, Positive]
Amounts = tuple[Amount, Amount, Amount]


class Fluid(Record):
    """Surround all bodies: air, water."""

    density: Amount = Field(default=0.0, description="mass per volume [kg/m^3]")
    viscosity: Amount = Field(default=0.0, description="dynamic viscosity [Pa s]")
    wind: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="velocity in the ground's axes [m/s]"
    )


class _Immersed(Record):
    body: Name = Field(description="name of the body")
    frame: Frame = Field(
        default=Frame(), description="its middle and its axes, in the body's frame"
    )


class BoxDrag(_Immersed):
    """Resist the motion of a box: drag on its sides, and Stokes' drag of a sphere of its mean
    side."""

    type: Literal["box"] = "box"
    size: Sides = Field(description="lengths of its edges along the frame's axes [m]")


class EllipsoidDrag(_Immersed):
    """Act on an ellipsoid with drag, lift, and what accelerates the fluid that it carries along."""

    type: Literal["ellipsoid"] = "ellipsoid"
    radii: Sides = Field(description="its half axes along the frame's axes [m]")
    blunt: Amount = Field(default=0.5, description="drag coefficient of what it shows the flow")
    slender: Amount = Field(
        default=0.25, description="drag coefficient of what its largest section is beyond that"
    )
    angular: Amount = Field(default=1.5, description="drag coefficient of turning")
    lift: Amount = Field(
        default=1.0, description="coefficient of the lift by its slant to the flow (Kutta)"
    )
    magnus: Amount = Field(default=1.0, description="coefficient of the lift by turning (Magnus)")
    added_mass: Amounts | None = Field(
        default=None,
        description=(
            "fluid that slides along with it over the density, by axis [m^3]; an ellipsoid's if "
            "left out"
        ),
    )
    added_inertia: Amounts | None = Field(
        default=None,
        description=(
            "inertia of the fluid that turns with it over the density, by axis [m^5]; an "
            "ellipsoid's if left out"
        ),
    )


Drag = Annotated[BoxDrag | EllipsoidDrag, Field(discriminator="type")]
