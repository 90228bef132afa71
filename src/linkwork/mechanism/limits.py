"""Limits: which joint coordinates of a mechanism have a range and which rates are limited, and what
may meet in the range."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from linkwork.mechanism.contact import touch_names
from linkwork.mechanism.effects import Limits
from linkwork.mechanism.joints import TURN, JointFreedom
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.record import Record, swapped
from linkwork.mechanism.transmissions import Cable, LoadedLength, PulleyBlock, acts


class LimitedRange(NamedTuple):
    """Hold the limits of a coordinate, that of a free turn qw; `name`: to report it by."""

    coordinate: str
    limits: Limits
    name: str


class LimitedSpeed(NamedTuple):
    """Hold the limit of speed of one rate, or of the three of a free turn together; `name`: to
    report it by."""

    rates: tuple[str, ...]
    speed: float
    name: str


def limited(mechanism: Mechanism) -> Iterator[LimitedRange]:
    """Yield the coordinates that have limits."""
    for name, joint in mechanism.joints.items():
        for part in joint.parts(name):
            limits, first = part.effects.limits, part.coordinates[0]
            if limits.bounded:
                yield LimitedRange(first, limits, reported(name, part, first))


def speed_limited(mechanism: Mechanism) -> Iterator[LimitedSpeed]:
    """Yield the rates that have a limit of speed."""
    for name, joint in mechanism.joints.items():
        for part in joint.parts(name):
            if (speed := part.effects.limits.speed) is not None:
                yield LimitedSpeed(part.rates, speed, reported(name, part, part.rates[0]))


def reported(joint: str, part: JointFreedom, own: str) -> str:
    """Return the name by which a part of a joint is reported: its own, or the turn's."""
    return f"{joint}.{TURN}" if part.name == TURN else own


def undriven_speeds(mechanism: Mechanism) -> Iterator[tuple[tuple[str, ...], float]]:
    """Yield the rates and limits of speed of what is no actuator by itself."""
    for limit in speed_limited(mechanism):
        if len(limit.rates) != 1 or limit.rates[0] not in mechanism.actuators:
            yield limit.rates, limit.speed


def meetings(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of all that may meet: the ends of stops of joints and transmissions, and
    the places of contacts."""
    stops = tuple(
        name
        for joint_name, joint in mechanism.joints.items()
        for part in joint.parts(joint_name)
        for name in end_names(part).values()
    )
    lines = mechanism.transmissions.items()
    stops += tuple(end for name, line in lines for end in line_ends(name, line).values())
    return stops + tuple(map(meeting_name, touching(mechanism)))


def slack_ends(name: str, line: LoadedLength) -> dict[str, tuple[int, float]]:
    """Return the ends of a spring's slack by name, "mesh: spring at the lower end": on which side
    it pulls, -1 or 1, and where from its rest on."""
    spring = line.spring
    if not (any(map(acts, spring.pulls)) and acts(spring.slack)):
        return {}
    ends = {"lower": (-1, 0.0), "upper": (1, spring.slack)}
    return {f"{name}: spring at the {side} end": end for side, end in ends.items()}


def pulling(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the ends of slack at which springs begin to pull."""
    lines = mechanism.transmissions.items()
    return tuple(
        end
        for name, line in lines
        if isinstance(line, LoadedLength)
        for end in slack_ends(name, line)
    )


class AtSurface(NamedTuple):
    """Hold a cable, the place of a surface in its path, and what happens there: its energy "leaps
    at" it, it "touches" it or comes off it, or it "lines up with" its axis between both ends."""

    cable: Cable
    place: int
    what: str


def at_surfaces(mechanism: Mechanism) -> dict[str, AtSurface]:
    """Return what may happen to cables at surfaces by name: "pull leaps at the sphere of arm
    (path.1)"."""
    found: dict[str, AtSurface] = {}
    held = {
        label
        for gear in mechanism.gears.values()
        for label in gear.ratios
        if any(map(acts, gear.polynomial(label)))
    }
    for name, line in mechanism.transmissions.items():
        if not isinstance(line, Cable):
            continue
        # The length of a held one may leap no more than if an inertia moved with it.
        if name in held:
            line = swapped(line, inertia=1.0)
        happening = (
            AtSurface(line, place, what)
            for what, places in (
                ("leaps at", line.leaps),
                ("touches", line.rounded),
                ("lines up with", line.lines_up),
            )
            for place in places
        )
        for each in happening:
            part = line.path[each.place]
            body = "" if isinstance(part, PulleyBlock) else part.body
            found[f"{name} {each.what} the {part.type} of {body} (path.{each.place})"] = each
    return found


def touching(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the places where contacts may touch."""
    contacts = mechanism.contacts.items()
    return tuple(touch for name, contact in contacts for touch in touch_names(name, contact))


def meeting_name(touch: str) -> str:
    """Return what a place of a contact is called among all that may meet."""
    return f"{touch}: contact"


def line_ends(name: str, line: Record) -> dict[str, str]:
    """Return the names of the ends of a transmission's stop, by side: "mesh: lower stop"."""
    ends = line.ends if isinstance(line, LoadedLength) else {}
    return {side: f"{name}: {side} stop" for side in ends}


def end_names(part: JointFreedom) -> dict[str, str]:
    """Return the names of the ends of a freedom's stop, by side: "hinge: lower stop"."""
    first = part.coordinates[0]
    own = f"{first.rpartition('.')[0]}.{TURN}" if part.name == TURN else first
    return {side: f"{own}: {side} stop" for side in part.effects.ends}
