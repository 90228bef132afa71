"""What holds bodies together beside the tree, as elements of MJCF: ties, springs, screws, gears."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.equations.joints import motions_of
from linkwork.formats import poses
from linkwork.formats.mjcf.laws import number, numbers
from linkwork.formats.mjcf.model_plan import ADVANCE, ModelTie
from linkwork.formats.mjcf.sheet import Sheet
from linkwork.formats.mjcf.tree import WORLD
from linkwork.mechanism import GROUND, MechanismError


def write_tie(sheet: Sheet, tie: ModelTie) -> None:
    """Write what closes a loop."""
    one, two = (WORLD if seat == GROUND else seat for seat in tie.seats)
    match tie.kind:
        case "connect":
            X = sheet.home.poses[
                GROUND if tie.seats[0] == GROUND else sheet.plan.seats[tie.seats[0]].body
            ]
            anchor = numbers(poses.point(poses.inverse(X), tie.points[0]))
            sheet.add("equality", "connect", name=tie.name, body1=one, body2=two, anchor=anchor)
        case "weld":
            sheet.add("equality", "weld", name=tie.name, body1=one, body2=two)
        case "rod":
            straight_tendon(sheet, tie.name, tie.seats, tie.points)
            gap = tie.length - float(np.linalg.norm(tie.points[1] - tie.points[0]))
            sheet.add(
                "equality",
                "tendon",
                name=tie.name,
                tendon1=tie.name,
                polycoef=numbers((gap, 0, 0, 0, 0)),
            )


def straight_tendon(
    sheet: Sheet,
    name: str,
    seats: tuple[str, str],
    points: Iterable[np.ndarray],
    **attributes: str,
) -> None:
    """Write a tendon between two points, in ground at home."""
    tendon = sheet.add("tendon", "spatial", name=name, **attributes)
    for end, seat, p in zip(("near", "far"), seats, points, strict=True):
        sheet.site(f"{name}.{end}", seat, poses.shift(p))
        ET.SubElement(tendon, "site", site=f"{name}.{end}")


def write_springs(sheet: Sheet) -> None:
    """Write springs between points as tendons."""
    for name, spring in sheet.mechanism.springs.items():
        points = [
            poses.point(sheet.home.poses[b], p)
            for b, p in zip(spring.connects, spring.points, strict=True)
        ]
        label = name if name not in sheet.mechanism.joints else f"{name}.spring"
        straight_tendon(
            sheet,
            label,
            spring.connects,
            points,
            stiffness=number(spring.stiffness),
            springlength=number(spring.rest_length),
            damping=number(spring.damping),
        )


def write_screws(sheet: Sheet) -> None:
    """Couple the advance of screws to their turn."""
    for name, joint in sheet.mechanism.pairs.items():
        for motion, part in zip(motions_of(joint), joint.parts(name), strict=True):
            if motion.pitch is not None:
                ends = {"joint1": f"{name}.{ADVANCE}", "joint2": part.coordinates[0]}
                line = numbers((0, float(motion.pitch), 0, 0, 0))
                sheet.add("equality", "joint", name=name, **ends, polycoef=line)


def write_gears(sheet: Sheet) -> None:
    """Couple hinges and slides: two of them by a joint equality, more by a tendon of joints."""
    for name, gear in sheet.mechanism.gears.items():
        ratios = {label: ratio for label, ratio in gear.ratios.items() if ratio}
        for label in ratios:
            if not sheet.is_hinge_or_slide(label):
                raise MechanismError(
                    f"joints.{name}.ratios: {label!r} is no hinge or slide in MJCF and "
                    "cannot be geared"
                )
        gap = gear.offset - sum(ratio * sheet.moves[label].ref for label, ratio in ratios.items())
        if len(ratios) == 2:
            (one, first), (two, second) = ratios.items()
            line = numbers((gap / first, -second / first, 0, 0, 0))
            sheet.add("equality", "joint", name=name, joint1=one, joint2=two, polycoef=line)
        else:
            tendon = sheet.add("tendon", "fixed", name=name)
            for label, ratio in ratios.items():
                ET.SubElement(tendon, "joint", joint=label, coef=number(ratio))
            sheet.add(
                "equality",
                "tendon",
                name=name,
                tendon1=name,
                polycoef=numbers((gap, 0, 0, 0, 0)),
            )
