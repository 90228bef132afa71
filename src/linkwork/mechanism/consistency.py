"""Consistency: what a description names is there, and all of it hangs together, or is refused."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from linkwork.mechanism.joints import FEW, QUATERNION, GearJoint, JointBase
from linkwork.mechanism.record import MechanismError
from linkwork.mechanism.refusal import shown
from linkwork.mechanism.transmissions import (
    Cable,
    Combination,
    Displacement,
    Thrust,
    Transmission,
)

SHOWN = 100  # names in one sentence


def check_connects(
    connects: tuple[str, str], bodies: Collection[str], where: tuple[str, ...]
) -> None:
    """Refuse what does not connect two different bodies."""
    for body in connects:
        require(body, bodies, "body", (*where, "connects"))
    if connects[0] == connects[1]:
        raise MechanismError(f"connects {connects[0]!r} to itself; name two bodies", where)


def check_ratios(
    ratios: Mapping[str, float],
    coordinates: Collection[str],
    joints: Collection[str],
    where: tuple[str, ...],
    what: str,
) -> None:
    """Refuse ratios of what is no coordinate, or a part of a quaternion."""
    for label in ratios:
        require(label, coordinates, "coordinate", where)
        if label.rpartition(".")[2] in QUATERNION and label not in joints:
            raise MechanismError(
                f"{label!r} is part of a quaternion and cannot {what}; name an angle or a slide",
                where,
            )


def check_gear(
    name: str,
    gear: GearJoint,
    coordinates: Collection[str],
    transmissions: Mapping[str, Transmission],
    joints: Collection[str],
) -> None:
    """Refuse a gear of what has no length, or of one coordinate alone."""
    where, lines = ("joints", name, "ratios"), gear.ratios.keys() & transmissions.keys()
    for label in sorted(lines):
        line = transmissions[label]
        if isinstance(line, Thrust | Displacement):
            raise MechanismError(
                f"{label!r} is a {line.type}, which has no length that can be held; name a cable, "
                "a slider_crank, a sum or a joint coordinate",
                where,
            )
    named = dict.fromkeys((*coordinates, *transmissions))
    check_ratios(gear.ratios, named, joints, where, "be geared")
    if len(gear.coupled) < 2 and not lines.intersection(gear.coupled):
        raise MechanismError(FEW, where)
    if gear.teeth and gear.teeth.at in lines:
        raise MechanismError(
            f"the teeth rub at {gear.teeth.at!r}, a transmission; name a joint coordinate",
            ("joints", name, "teeth", "at"),
        )


def check_transmissions(
    transmissions: Mapping[str, Transmission],
    coordinates: Collection[str],
    rates: Collection[str],
    joints: Collection[str],
    bodies: Collection[str],
    ground: str,
) -> None:
    """Refuse transmissions with names of joints, or of what there is not."""
    if not transmissions:
        return
    taken, every = {*coordinates, *rates, *joints}, dict.fromkeys((ground, *bodies))
    for name, line in transmissions.items():
        where = ("transmissions", name)
        if name in taken:
            raise MechanismError(
                f"{name!r} is the name of a joint; give the transmission another", where
            )
        if isinstance(line, Combination):
            check_ratios(line.ratios, coordinates, joints, (*where, "ratios"), "be combined")
        elif isinstance(line, Thrust):
            require(line.body, bodies, "body", (*where, "body"))
        else:
            own = ("path",) if isinstance(line, Cable) else ()
            for body in line.bodies:
                require(body, every, "body", (*where, *own))
            if not isinstance(line, Cable) and line.bodies[0] == line.bodies[1]:
                raise MechanismError(
                    f"acts between {line.bodies[0]!r} and itself, where nothing moves; name two "
                    "bodies",
                    where,
                )


def check_actuators(
    actuators: Sequence[str], rates: Collection[str], joints: Mapping[str, JointBase]
) -> None:
    """Refuse actuators of what does not move, or that are named twice; rates: of joints and
    transmissions."""
    seen = set()
    for name in actuators:
        joint = joints.get(name)
        if joint is not None and name not in rates:
            own = joint.rates(name)
            cure = f"actuate one of its rates {', '.join(own)}" if own else "actuate another joint"
            raise MechanismError(
                f"{name!r} is a {joint.type} joint and cannot be actuated; {cure}", ("actuators",)
            )
        require(name, rates, "joint", ("actuators",))
        if name in seen:
            raise MechanismError(
                f"{name!r} is named twice; name each actuated joint once", ("actuators",)
            )
        seen.add(name)


def check_drives(drives: Mapping[str, Mapping[str, Any]], actuators: Collection[str]) -> None:
    """Refuse drives of what is no actuator, or of no type."""
    for name, drive in drives.items():
        require(name, actuators, "actuator", ("drives",))
        if not isinstance(drive.get("type"), str):
            raise MechanismError(
                "is missing; give the type of a drive of linkwork.control, such as servo",
                ("drives", name, "type"),
            )


def check_connected(
    bodies: Collection[str], connects: Iterable[tuple[str, str]], ground: str
) -> None:
    """Refuse bodies that no chain of joints connects to ground; connects: both bodies of each
    joint."""
    joined = reached(ground, neighbours(connects))
    loose = next((name for name in bodies if name not in joined), None)
    if loose is not None:
        raise MechanismError(
            "no chain of joints connects it to ground; add a joint to it", ("bodies", loose)
        )


def require(name: str, known: Collection[str], kind: str, where: tuple[str, ...]) -> None:
    """Refuse a name that is not among the known ones, and show those."""
    if name not in known:
        names = ", ".join(islice(known, SHOWN)) or "(none)"
        more = f" and {len(known) - SHOWN} more" if len(known) > SHOWN else ""
        raise MechanismError(
            f"there is no {kind} {shown(name)}; the {kind} names are {names}{more}", where
        )


def neighbours(connects: Iterable[tuple[str, str]]) -> dict[str, set[str]]:
    """Return the bodies that joints connect each body to; connects: both bodies of each joint."""
    found: dict[str, set[str]] = {}
    for first, second in connects:
        found.setdefault(first, set()).add(second)
        found.setdefault(second, set()).add(first)
    return found


def reached(start: str, joined: Mapping[str, set[str]]) -> set[str]:
    """Return the bodies to which chains of joints lead from a body, itself among them; joined:
    `neighbours`."""
    found, beyond = set[str](), [start]
    while beyond:
        body = beyond.pop()
        if body not in found:
            found.add(body)
            beyond += joined.get(body, ())
    return found
