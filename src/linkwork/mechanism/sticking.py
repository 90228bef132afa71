"""Bristles: what sticks in dry friction, and the states that it has in a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from linkwork.mechanism.bearing import bearing_name, bearings
from linkwork.mechanism.contact import touch_names
from linkwork.mechanism.joints import SLIDES
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.refusal import MechanismError
from linkwork.mechanism.transmissions import LoadedLength


class Strain(NamedTuple):
    """Name the states of one bristle: of what (the first rate of a freedom, a bearing, a
    transmission, or a place of a contact), their own names, and their unit."""

    of: str
    names: tuple[str, ...]
    unit: str


def strains(mechanism: Mechanism) -> Iterator[Strain]:
    """Yield the states of all bristles: the force of each in a joint's freedom, its share of what a
    bearing carries, and of the normal force, in the ground's axes, in a place of a contact."""
    for name, joint in mechanism.joints.items():
        for part in joint.parts(name):
            if part.effects.friction.bristle:
                own = tuple(f"{rate}.bristle" for rate in part.rates)
                yield Strain(part.rates[0], own, "N" if part.name in SLIDES else "N m")
    for name, bearing in bearings(mechanism.joints).items():
        if bearing.friction.bristle:
            yield Strain(bearing_name(name), (f"{name}.bearing_bristle",), "1")
    for name, line in mechanism.transmissions.items():
        if isinstance(line, LoadedLength) and line.friction.bristle:
            yield Strain(name, (f"{name}.bristle",), "N, N m")
    for name, contact in mechanism.contacts.items():
        for touch in touch_names(name, contact) if contact.friction.bristle else ():
            yield Strain(touch, tuple(f"{touch}.bristle_{axis}" for axis in "xyz"), "1")


def require_no_bristles(mechanism: Mechanism, what: str, instead: str) -> None:
    """Refuse what has no place for the states of bristles, by what sticks."""
    if names := ", ".join(strain.of for strain in strains(mechanism)):
        raise MechanismError(
            f"{what} friction that sticks by bristles, which have states of their own: {names}; "
            f"{instead}"
        )
