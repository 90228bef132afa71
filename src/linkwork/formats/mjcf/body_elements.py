"""Bodies of a mechanism as elements of MJCF: their masses, joints and shapes."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.formats import poses, xml
from linkwork.formats.mjcf.fluid_elements import axes_of_box
from linkwork.formats.mjcf.geoms import BETWEEN, corners_of, mesh_file, size_of
from linkwork.formats.mjcf.laws import number, numbers
from linkwork.formats.mjcf.model_plan import Move, Seat
from linkwork.formats.mjcf.principal import principal_axes
from linkwork.formats.mjcf.sheet import Sheet, placed, put, put_graded
from linkwork.formats.mjcf.tree import UNLIMITED, WORLD
from linkwork.mechanism import Body, MechanismError, Shape
from linkwork.mechanism.body import rigid

# Radius of gyration given to bodies without inertia, which MuJoCo refuses [m]; as part of the
# mechanism's size, where that is less.
POINT_RADIUS, POINT_PART = 1e-4, 1e-3
LEAST, LEAST_IN_FULL = 1e-15, 1e-14
"""Least moments of inertia that MuJoCo takes, about principal axes and of tensors [kg m^2]."""
POINT_MASS = 1e-8  # mass given to bodies without it, as part of the mechanism's mass
FLAT = 1e-10
"""What is added to flat bodies, as part of their greatest moment: MuJoCo has no tolerance for a + b
>= c."""
STROKE = 0.01  # radius of what is drawn, as part of the mechanism's size


def check(sheet: Sheet) -> None:
    """Refuse what MJCF or MuJoCo does not take."""
    if WORLD in sheet.mechanism.bodies:
        raise MechanismError(
            f"bodies.{WORLD}: is the name that MJCF gives to ground; rename the body"
        )
    if any(len(sheet.plan.chain(name)) > xml.DEEPEST - 10 for name in sheet.plan.seats):
        raise MechanismError(
            f"joints: a chain of more than {xml.DEEPEST - 10} bodies is too deep for a file "
            "of nested bodies"
        )
    tied = {end for tie in sheet.plan.ties for end in tie.seats}
    inner = {seat.parent for seat in sheet.plan.seats.values()}
    for seat in sheet.plan.seats.values():
        useless = not sheet.mechanism.bodies[seat.body].inertia.tensor().any() and (
            seat.name in tied or seat.name not in inner
        )
        # A motor behind a spring has no inertia but its rotor's, which is its joint's there.
        useless = useless and not all(move.effects.rotor for move in seat.moves)
        if seat.name in sheet.plan.light and (useless or not sheet.total):
            raise MechanismError(
                f"bodies.{seat.body}: moves without mass and inertia, which MuJoCo refuses; "
                "give it some (a massless body is written only inside a chain of joints)"
            )


def write_body(sheet: Sheet, seat: Seat) -> None:
    """Write a body with its mass, joints and shapes."""
    X = sheet.home.poses[seat.body]
    parent = sheet.plan.seats.get(seat.parent)
    relative = poses.inverse(sheet.home.poses[parent.body]) @ X if parent else X
    element = ET.SubElement(
        sheet.elements[seat.parent], "body", attrib={"name": seat.name} | placed(relative)
    )
    sheet.elements[seat.name] = element
    lifted(sheet, element, seat)
    body = sheet.mechanism.bodies[seat.body]
    if body.mass or body.inertia.tensor().any() or seat.name in sheet.plan.light or not seat.share:
        write_inertial(sheet, element, seat, body)
    for move in seat.moves:
        element.append(joint_of(sheet, move, poses.inverse(X)))
    draw(sheet, element, seat, poses.inverse(X))


def lifted(sheet: Sheet, element: ET.Element, seat: Seat) -> None:
    """Write what carries a body's own weight; MuJoCo carries weights at mass centres only."""
    body = sheet.mechanism.bodies[seat.body]
    for name, lift in sheet.mechanism.lifts.items():
        if lift.body != seat.body:
            continue
        if lift.point == body.centre_of_mass and body.mass and "gravcomp" not in element.attrib:
            element.set("gravcomp", number(lift.mass / body.mass))
        else:
            sheet.notes.say(
                f"lifts.{name}: is left out: MuJoCo carries a body's own weight only, once and "
                "at its mass centre"
            )


def write_inertial(sheet: Sheet, element: ET.Element, seat: Seat, body: Body) -> None:
    """Write a body's share of mass and inertia, with what MuJoCo needs at least."""
    I, mass = seat.share * body.inertia.tensor(), seat.share * body.mass  # noqa: E741
    if body.inertia.planar:
        I = seat.share * body.inertia.zz * np.eye(3)  # noqa: E741
        sheet.notes.say(
            "bodies that give zz alone are written with xx = yy = zz, which a planar motion "
            "does not feel"
        )
    # What has no mass and moves is given a little.
    if not seat.share:
        mass = POINT_MASS * sheet.total
        sheet.notes.say(
            f"{seat.name}: is a body of {mass:.3g} kg between a ball and slides, which "
            "MuJoCo's loops want apart"
        )
    elif seat.name in sheet.plan.light:
        mass = POINT_MASS * sheet.total
        sheet.notes.say(
            f"bodies.{seat.body}: moves without mass, which MuJoCo refuses; {mass:.3g} kg are added"
        )
    # Moments that MuJoCo refuses are those of no rigid body, of flat bodies, and zero.
    a, b, c = np.linalg.eigvalsh(I)
    if not rigid(a, b, c):
        raise MechanismError(
            f"bodies.{seat.body}.inertia: one moment exceeds the sum of the others, which "
            "MuJoCo refuses; give moments of a rigid body"
        )
    if a + b < c * (1 + FLAT):
        I = I + FLAT * c * np.eye(3)  # noqa: E741
        sheet.notes.say(
            f"moments of flat bodies are written larger by {FLAT:g} of the greatest: MuJoCo "
            "refuses one that is the sum of the others but for its rounding"
        )
    if seat.moves and a < LEAST_IN_FULL:
        I = I + raised(sheet, seat, mass, float(a)) * np.eye(3)  # noqa: E741
    # In the axes of the shape that has them, or in the body's own, if MuJoCo takes these.
    given = {"pos": numbers(body.centre_of_mass), "mass": number(mass)}
    R = axes_of_box(sheet, seat)
    if R is None and seat.moves and np.linalg.eigvalsh(I)[0] < LEAST_IN_FULL:
        R = principal_axes(I)
    if R is None:
        elements = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
        given["fullinertia"] = numbers(elements)
    else:
        given["quat"] = numbers(poses.to_quaternion(R))
        given["diaginertia"] = numbers(np.diag(R.T @ I @ R))
    ET.SubElement(element, "inertial", attrib=given)


def raised(sheet: Sheet, seat: Seat, mass: float, least: float) -> float:
    """Return what is added to the moments of a body that moves whose least one is small [kg m^2],
    and note it."""
    point = mass * min(POINT_RADIUS, POINT_PART * sheet.size) ** 2
    if least < point or not seat.share:
        added = max(point, LEAST)
        if seat.share:
            sheet.notes.say(
                f"bodies.{seat.body}: has no inertia about some axis, which MuJoCo refuses; "
                f"a radius of gyration of {np.sqrt(added / mass):.3g} m is added"
            )
        return added
    if least >= LEAST:
        return 0.0
    sheet.notes.say(
        f"bodies.{seat.body}: has a moment of inertia of {least:.3g} kg m^2, less than MuJoCo "
        f"takes; all of its moments are written larger by {LEAST - least:.3g}"
    )
    return LEAST - least


def joint_of(sheet: Sheet, move: Move, into: np.ndarray) -> ET.Element:
    """Return a joint in a body's frame; `into` turns ground's components into the body's."""
    friction, spring, limits = move.effects[:3]
    element = ET.Element("joint", name=move.name, type=move.kind)
    if move.kind != "free":
        element.set("pos", numbers(poses.point(into, move.anchor)))
    if move.kind in ("hinge", "slide"):
        element.set("axis", numbers(into[:3, :3] @ move.axis))
        put(element, "ref", move.ref)
    put_graded(element, "damping", (friction.viscous + spring.damping, *friction.powers))
    put(element, "frictionloss", friction.coulomb)
    put_graded(element, "stiffness", spring.pulls)
    put(element, "springref", spring.rest if any(spring.pulls) else 0.0)
    put(element, "armature", move.effects.rotor)
    if limits.bounded:
        lower = -UNLIMITED if limits.lower is None else limits.lower
        upper = UNLIMITED if limits.upper is None else limits.upper
        element.set("range", numbers((0.0 if move.kind == "ball" else lower, upper)))
    return element


def draw(sheet: Sheet, element: ET.Element, seat: Seat, into: np.ndarray) -> None:
    """Add the body's shapes; without any, bars from its first joint to all others. They have no
    mass."""
    # Shapes of the body itself, but of none of its parts.
    shapes = sheet.mechanism.bodies[seat.body].shapes
    if shapes:
        if seat.name == seat.body:
            for shape in shapes:
                write_geom(sheet, element, seat, shape)
        return
    # Else its first anchor, joined to those of the joints and ties that leave it.
    points = [move.anchor for move in seat.moves[:1]]
    points += [
        child.moves[0].anchor
        for child in sheet.plan.seats.values()
        if child.parent == seat.name and child.moves
    ]
    points += [
        p
        for tie in sheet.plan.ties
        for end, p in zip(tie.seats, tie.points, strict=True)
        if end == seat.name
    ]
    # Bars too short to be seen are a ball.
    local = [poses.point(into, p) for p in points]
    radius = number(STROKE * sheet.size)
    bars = [p for p in local[1:] if np.linalg.norm(p - local[0]) > STROKE * sheet.size]
    for p in bars:
        bar = {
            "class": BETWEEN,
            "type": "capsule",
            "fromto": numbers((*local[0], *p)),
            "size": radius,
        }
        ET.SubElement(element, "geom", attrib=bar)
    if local and not bars:
        ball = {"class": BETWEEN, "type": "sphere", "pos": numbers(local[0]), "size": radius}
        ET.SubElement(element, "geom", attrib=ball)


def write_geom(sheet: Sheet, element: ET.Element, seat: Seat, shape: Shape) -> None:
    """Write a shape as a geom of a body, if MJCF has it."""
    size = size_of(shape)
    mesh = mesh_of(sheet, shape)
    if size is None and mesh is None:
        sheet.unshown[seat.body] = None
        return
    own = {"size": numbers(size)} if size is not None else {"mesh": str(mesh)}
    kind = shape.type if size is not None else "mesh"
    fields = {"type": kind} | own | placed(poses.of_frame(shape.frame))
    colour = {} if shape.colour is None else {"rgba": numbers((*shape.colour, 1))}
    ET.SubElement(element, "geom", attrib=fields | colour)


def mesh_of(sheet: Sheet, shape: Shape) -> str | None:
    """Return the name among the assets of a file's mesh, or of the hull of a shape's corners; None
    where there is none that MuJoCo reads."""
    # One asset for each file and scale; MuJoCo weighs none, but has to be able to.
    if corners := corners_of(shape):
        own = {"vertex": numbers(number for corner in corners for number in corner)}
    else:
        found = mesh_file(shape)
        if found is None or sheet.folder is None:
            return None
        path, scale = found
        file = Path(os.path.relpath(path.resolve(), sheet.folder)).as_posix()
        own = {"file": file, "scale": numbers(scale)}
    own["inertia"] = "shell"
    for asset in sheet.sections["asset"]:
        if all(asset.get(key) == value for key, value in own.items()):
            return asset.attrib["name"]
    name = f"mesh_{len(sheet.sections['asset']) + 1}"
    sheet.add("asset", "mesh", name=name, **own)
    return name
