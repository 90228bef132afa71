"""What holds bodies together beside the tree, as elements of MJCF: ties, springs, screws, gears."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree as ET

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from linkwork.equations.cables import way
from linkwork.equations.joints import motions_of
from linkwork.formats import poses
from linkwork.formats.mjcf.laws import number, numbers
from linkwork.formats.mjcf.line_elements import line_name
from linkwork.formats.mjcf.model_plan import ADVANCE, ModelTie
from linkwork.formats.mjcf.sheet import Sheet
from linkwork.formats.mjcf.tree import WORLD
from linkwork.mechanism import GROUND, Cable, Combination, GearJoint, MechanismError

DEGREE = 4  # of the polynomials of equalities


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
    """Couple hinges and slides: two of them by a joint equality, more by a tendon of joints, which
    follows another one where a coordinate has powers."""
    for name, gear in sheet.mechanism.gears.items():
        if not sheet.mechanism.transmissions.keys().isdisjoint(gear.coupled):
            write_length_tie(sheet, name, gear)
            continue
        curved = curved_coordinate(sheet, name, gear)
        ratios = {label: gear.ratios[label] for label in gear.coupled if label != curved}
        gap = gear.offset - sum(ratio * sheet.moves[label].ref for label, ratio in ratios.items())
        if curved:
            # P(ref + x) in powers of x = q - ref.
            about = Polynomial([sheet.moves[curved].ref, 1.0])
            a = [-float(c) for c in Polynomial([-gap, *gear.polynomial(curved)])(about).coef]
        elif len(ratios) == 2:
            curved, second = ratios.popitem()
            a = [gap, -second]
        else:
            a = [gap]
        a += [0.0] * (DEGREE + 1 - len(a))
        if len(ratios) == 1:
            ((one, first),) = ratios.items()
            ends = {"joint1": one, "joint2": curved or ""}
            sheet.add(
                "equality", "joint", name=name, **ends, polycoef=numbers(c / first for c in a)
            )
            continue
        _joints_tendon(sheet, name, ratios)
        ends = {"tendon1": name}
        if curved:
            ends["tendon2"] = f"{name}.{curved}"
            _joints_tendon(sheet, ends["tendon2"], {curved: 1.0})
        sheet.add("equality", "tendon", name=name, **ends, polycoef=numbers(a))


def write_length_tie(sheet: Sheet, name: str, gear: GearJoint) -> None:
    """Write a gear of lengths as an equality of tendons: one length, or one by the other; what it
    couples of joints linearly is a tendon of its own."""
    # Tendons by name, each with its polynomial, and its length at home.
    tendons: dict[str, tuple[tuple[float, ...], float]] = {}
    summed: dict[str, float] = {}
    for label in gear.coupled:
        polynomial, line = gear.polynomial(label), sheet.mechanism.transmissions.get(label)
        if isinstance(line, Cable | Combination):
            tendons[line_name(sheet, label)] = polynomial, length_at_home(sheet, line)
        elif line is not None or not sheet.is_hinge_or_slide(label):
            raise MechanismError(f"joints.{name}.ratios: {label!r} has no tendon in MJCF")
        elif any(polynomial[1:]):
            tendons[f"{name}.{label}"] = polynomial, sheet.moves[label].ref
            _joints_tendon(sheet, f"{name}.{label}", {label: 1.0})
        else:
            summed[label] = polynomial[0]
    if summed:
        at_home = sum(ratio * sheet.moves[label].ref for label, ratio in summed.items())
        tendons[name] = (1.0,), at_home
        _joints_tendon(sheet, name, summed)
    # The first one is linear; the length of the other one is counted from home, too.
    (one, (first, x1)), *others = sorted(tendons.items(), key=lambda t: any(t[1][0][1:]))
    ends = dict(zip(("tendon1", "tendon2"), (one, *(other for other, _ in others)), strict=False))
    series = Polynomial([gear.offset - first[0] * x1])
    for _, (polynomial, x2) in others:
        series = series - Polynomial([0.0, *polynomial])(Polynomial([x2, 1.0]))
    a = [float(c) / first[0] for c in series.coef]
    if len(others) > 1 or any(first[1:]) or any(a[DEGREE + 1 :]):
        raise MechanismError(
            f"joints.{name}: MJCF ties two lengths, of which one may have powers up to the power "
            f"{DEGREE}; write .yaml, which holds all"
        )
    a += [0.0] * (DEGREE + 1 - len(a))
    sheet.add("equality", "tendon", name=name, **ends, polycoef=numbers(a[: DEGREE + 1]))


def length_at_home(sheet: Sheet, line: Cable | Combination) -> float:
    """Return the length of a cable, or of a combination, at home."""
    home = sheet.home
    if isinstance(line, Combination):
        own = (ratio * home.coordinates[label] for label, ratio in line.ratios.items())
        return line.offset + sum(own)

    def place(body: str) -> tuple[ca.SX, ca.SX]:
        return ca.SX(home.poses[body][:3, :3]), ca.SX(home.poses[body][:3, 3])

    return float(way(line, place).length)


def curved_coordinate(sheet: Sheet, name: str, gear: GearJoint) -> str | None:
    """Return the coordinate of a gear that has powers; refuse what MJCF cannot couple."""
    for label in gear.coupled:
        if not sheet.is_hinge_or_slide(label):
            raise MechanismError(
                f"joints.{name}.ratios: {label!r} is no hinge or slide in MJCF and cannot be geared"
            )
    curved = [label for label in gear.coupled if any(gear.powers.get(label, ()))]
    if len(curved) > 1 or any(any(gear.polynomial(label)[DEGREE:]) for label in curved):
        raise MechanismError(
            f"joints.{name}.powers: MJCF holds those of one coordinate of a gear up to the power "
            f"{DEGREE}; write .yaml, which holds all"
        )
    return next(iter(curved), None)


def _joints_tendon(sheet: Sheet, name: str, ratios: Mapping[str, float]) -> None:
    tendon = sheet.add("tendon", "fixed", name=name)
    for label, ratio in ratios.items():
        ET.SubElement(tendon, "joint", joint=label, coef=number(ratio))
