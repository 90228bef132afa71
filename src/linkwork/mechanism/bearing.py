"""Bearings: what a joint carries presses its surfaces together, and they rub.

With the wrench [M; F] that a joint's constraints transmit, about the origin of F2, and its axis a,

    across   F_n = F - a (a . F),  borne at one place, or at two with the distance `span` along the
             axis:  F_n / 2 +- (M_n x a) / span,  M_n = M - a (a . M)
    along    F_a = a . F of a revolute joint, borne at `thrust_radius`

A slide rubs with the sum of the forces across, a revolute joint at `radius` with their sum and at
`thrust_radius` with |F_a|. Moments about the axis of a slide do not count.

The teeth of a gear rub with the force that the gear transmits to one of its coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from linkwork.mechanism.contact import Sliding
from linkwork.mechanism.record import Amount, MechanismError, PathName, Positive, Record


class SlidingBearing(Record):
    """Rub by what a prismatic joint carries across its axis."""

    friction: Sliding = Field(description="of the surfaces; its coefficient times what they carry")
    span: Positive | None = Field(
        default=None,
        description="distance of two bearings along the axis, of which the origin of F2 is the "
        "middle [m]; one that bears no moment if left out",
    )


class JournalBearing(SlidingBearing):
    """Rub by what a revolute joint carries: across its axis at the radius of the journal, along it
    at that of the thrust face."""

    radius: Positive = Field(description="radius of the journal [m]")
    thrust_radius: Amount = Field(
        default=0.0, description="radius at which what is carried along the axis rubs [m]"
    )


class GearTeeth(Record):
    """Rub by the force that a gear transmits to a coordinate: of the power through the gear the
    part m is lost there.

    From the other coordinates to this one the gear has the efficiency 1 - m, from this one to the
    others 1 / (1 + m).
    """

    friction: Sliding = Field(
        description="of the teeth; its coefficient m times the force that the gear transmits to "
        "the coordinate, its rates those of ratio times coordinate"
    )
    at: PathName = Field(description="coordinate of the gear at which the teeth rub")


Bearing = SlidingBearing | GearTeeth


def bearings(joints: Mapping[str, object]) -> dict[str, Bearing]:
    """Return what rubs by what it carries, by the names of joints: bearings, and teeth of gears."""
    found = {
        name: getattr(joint, "bearing", None) or getattr(joint, "teeth", None)
        for name, joint in joints.items()
    }
    return {name: own for name, own in found.items() if own is not None}


def loaded(joints: Mapping[str, object]) -> tuple[str, ...]:
    """Return names of the forces along lines by whose size joints rub, which has a kink where they
    turn round: of a gear's teeth, thrust, and along two lines across the axis of each bearing."""
    return tuple(
        label
        for name, own in bearings(joints).items()
        if own.friction.coefficient or own.friction.static
        for label in line_names(name, own)
    )


def line_names(joint: str, bearing: Bearing) -> tuple[str, ...]:
    """Return the names of the forces along lines that a joint's bearing carries: those across its
    axis along two directions of F1, one bearing after the other, then thrust."""
    if isinstance(bearing, GearTeeth):
        return (f"{joint}: load",)
    across = tuple(f"{joint}: load across {k}" for k in range(1, 3 if bearing.span is None else 5))
    thrusts = isinstance(bearing, JournalBearing) and bearing.thrust_radius
    return (*across, f"{joint}: load") if thrusts else across


def bearing_name(joint: str) -> str:
    """Return what a joint's bearing is called among bristles and powers."""
    return f"{joint}: bearing"


def require_no_bearings(joints: Mapping[str, object], what: str, instead: str) -> None:
    """Refuse what does not know bearings, by the joints' names."""
    if found := bearings(joints):
        raise MechanismError(
            f"{what} the friction of {what_rubs(found)}, which depends on what they carry: "
            f"{', '.join(found)}; {instead}"
        )


def what_rubs(found: Mapping[str, Bearing]) -> str:
    """Return what rubs in a word: bearings, teeth, or both."""
    teeth = [isinstance(own, GearTeeth) for own in found.values()]
    return "teeth" if all(teeth) else "bearings and teeth" if any(teeth) else "bearings"
