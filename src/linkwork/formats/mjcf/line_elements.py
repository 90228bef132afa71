"""Transmissions and actuators as elements of MJCF: tendons of joints, cables, sites, laws."""

from __future__ import annotations

from math import nextafter
from xml.etree import ElementTree as ET

from linkwork.formats import poses
from linkwork.formats.mjcf.branches import on_one_branch
from linkwork.formats.mjcf.laws import law_of, number, numbers
from linkwork.formats.mjcf.sheet import Sheet, placed, put, put_graded
from linkwork.mechanism import (
    Cable,
    Combination,
    Displacement,
    LoadedLength,
    MechanismError,
    PulleyBlock,
    SliderCrank,
    Thrust,
    ViaPoint,
)


def write_combinations(sheet: Sheet) -> None:
    """Write combinations of coordinates as tendons of joints, with what acts along them."""
    for name, line in sheet.mechanism.transmissions.items():
        if not isinstance(line, Combination):
            continue
        for label, ratio in line.ratios.items():
            if ratio and not sheet.is_hinge_or_slide(label):
                raise MechanismError(
                    f"transmissions.{name}.ratios: {label!r} is no hinge or slide in MJCF and "
                    "cannot be combined"
                )
        tendon = sheet.add("tendon", "fixed", name=line_name(sheet, name))
        for label, ratio in line.ratios.items():
            if ratio:
                ET.SubElement(tendon, "joint", joint=label, coef=number(ratio))
        write_along(sheet, tendon, line, line.offset)
        tell_off_tree(sheet, name, line)


def write_cables(sheet: Sheet) -> None:
    """Write cables as spatial tendons, with sites and unseen geoms of their own."""
    for name, line in sheet.mechanism.transmissions.items():
        if not isinstance(line, Cable):
            continue
        tendon = sheet.add("tendon", "spatial", name=line_name(sheet, name))
        for k, part in enumerate(line.path):
            label = f"{name}.{k}"
            if isinstance(part, PulleyBlock):
                ET.SubElement(tendon, "pulley", divisor=number(part.divisor))
            elif isinstance(part, ViaPoint):
                X = sheet.home.poses[part.body] @ poses.shift(part.point)
                sheet.site(label, part.body, X)
                ET.SubElement(tendon, "site", site=label)
            else:
                size = [part.radius] if part.type == "sphere" else [part.radius, part.radius]
                own = {"name": label, "type": part.type, "size": numbers(size), "group": "4"}
                own |= placed(poses.of_frame(part.frame))
                ET.SubElement(sheet.elements[part.body], "geom", attrib=own)
                led = ET.SubElement(tendon, "geom", geom=label)
                if part.inside or part.side:
                    centre = ViaPoint(body=part.body, point=part.frame.position)
                    side = part.side or centre
                    X = sheet.home.poses[side.body] @ poses.shift(side.point)
                    sheet.site(f"{label}.side", side.body, X)
                    led.set("sidesite", f"{label}.side")
        write_along(sheet, tendon, line, 0.0)
        tell_inertia(sheet, name, line, tendon)


def write_along(sheet: Sheet, tendon: ET.Element, line: LoadedLength, offset: float) -> None:
    """Write what acts along a tendon, whose length is ahead of MuJoCo's by an offset."""
    spring = line.spring
    put_graded(tendon, "stiffness", spring.pulls)
    put_graded(tendon, "damping", (spring.damping + line.friction.viscous, *line.friction.powers))
    put(tendon, "frictionloss", line.friction.coulomb)
    put(tendon, "armature", line.inertia)
    if any(spring.pulls):
        rest = spring.rest - offset
        end = rest + spring.slack
        if rest == end == -1.0:  # by which MuJoCo means none
            end = nextafter(end, 0.0)
        tendon.set("springlength", numbers((rest, end)))


def tell_inertia(sheet: Sheet, name: str, line: Cable, tendon: ET.Element) -> None:
    """Leave out the inertia along a cable where MuJoCo refuses it, and note it; note others that
    MuJoCo takes otherwise."""
    if not line.inertia or tendon.find("geom") is None:
        tell_off_tree(sheet, name, line)
        return
    del tendon.attrib["armature"]
    sheet.notes.say(
        f"transmissions.{name}: its inertia is left out: MuJoCo has none along cables that are led "
        "over spheres or cylinders",
        alters=True,
    )


def tell_off_tree(sheet: Sheet, name: str, line: Combination | Cable) -> None:
    """Note an inertia along a length that couples branches of the file's tree."""
    seats = sheet.plan.seats
    owners = {move.name: seat.name for seat in seats.values() for move in seat.moves}

    def chain(body: str) -> list[str]:
        on_way = sheet.plan.chain(body) if body in seats else []
        return [seat for seat in on_way if seat in seats and seats[seat].moves]

    if line.inertia and not on_one_branch(line, owners, chain):
        sheet.notes.say(
            f"transmissions.{name}: its inertia couples joints on different branches of the tree; "
            "MuJoCo leaves this out of its inertia matrix, and here it is whole"
        )


def line_name(sheet: Sheet, name: str) -> str:
    """Return the name of a transmission's tendon, which may not be that of another tendon."""
    taken = {*sheet.mechanism.joints, *sheet.mechanism.springs}
    return name if name not in taken else f"{name}.line"


def write_actuator(sheet: Sheet, name: str) -> None:
    """Write an actuator with the law that its drive is."""
    line = sheet.mechanism.transmissions.get(name)
    tag, gear, shown = law_of(sheet.mechanism, name, sheet.notes)
    if isinstance(line, Thrust):
        sheet.site(
            f"{name}.site",
            line.body,
            sheet.home.poses[line.body] @ poses.shift(line.point),
        )
        wrench = [gear * float(x) for x in (*line.force, *line.moment)]
        given = {"site": f"{name}.site", "gear": numbers(wrench)}
        sheet.add("actuator", tag, name=name, **given, **shown)
    elif isinstance(line, SliderCrank | Displacement):
        sheet.add("actuator", tag, name=name, **_between(sheet, name, line, gear), **shown)
    elif line is not None:
        given = {"tendon": line_name(sheet, name), "gear": number(gear)}
        sheet.add("actuator", tag, name=name, **given, **shown)
    elif sheet.is_hinge_or_slide(name):
        given = {} if gear == 1 else {"gear": number(gear)}
        sheet.add("actuator", tag, name=name, joint=name, **given, **shown)
    else:
        write_ball_actuator(sheet, name, tag, gear, shown)


def _between(
    sheet: Sheet, name: str, line: SliderCrank | Displacement, gear: float
) -> dict[str, str]:
    """Return the attributes of an actuator between two sites, which are added."""
    if isinstance(line, SliderCrank):
        keys, others = ("slidersite", "cranksite"), poses.shift(line.pin.point)
        ends = (line.body, poses.of_frame(line.frame)), (line.pin.body, others)
        more = {"gear": number(gear), "cranklength": number(line.rod)}
    else:
        keys, wrench = ("refsite", "site"), (*line.force, *line.moment)
        ends = (
            (line.base, poses.of_frame(line.base_frame)),
            (line.body, poses.of_frame(line.frame)),
        )
        more = {"gear": numbers(gear * float(x) for x in wrench)}
    for key, (body, X) in zip(keys, ends, strict=True):
        sheet.site(f"{name}.{key}", body, sheet.home.poses[body] @ X)
        more[key] = f"{name}.{key}"
    return more


def write_ball_actuator(
    sheet: Sheet, rate: str, tag: str, gear: float, law: dict[str, str]
) -> None:
    """Write an actuator of an axis of a ball."""
    name, _, freedom = rate.partition(".")
    joint = sheet.mechanism.pairs[name]
    near, _ = sheet.home.frames(joint)
    axis = near[:3, "xyz".index(freedom[-1])]
    ball = name if name in sheet.moves else f"{name}.turn"
    owner = next(
        seat for seat in sheet.plan.seats.values() if any(move.name == ball for move in seat.moves)
    )
    along = gear * (sheet.home.poses[owner.body][:3, :3].T @ axis)
    if sheet.moves[ball].backwards:
        sheet.add("actuator", tag, name=rate, joint=ball, gear=numbers(-along), **law)
    else:
        sheet.add("actuator", tag, name=rate, jointinparent=ball, gear=numbers(along), **law)
