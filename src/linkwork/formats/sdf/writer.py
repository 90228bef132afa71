"""A mechanism written as SDF: links where the loops are closed, joints between any two of them.

All joints of an SDF file are at zero where its poses put the links, so that coordinates count from
the mechanism's home; names, axes and directions are its own.

Source: the SDF specification, http://sdformat.org/spec.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.equations.joints import held_length, motions_of, pattern
from linkwork.formats import poses
from linkwork.formats.masses import solid_of, unheld, whole_weights
from linkwork.formats.mjcf.laws import numbers
from linkwork.formats.mjcf.model_plan import Home
from linkwork.formats.mjcf.writer import home_of
from linkwork.formats.notes import Notes
from linkwork.formats.tools_told import tell_tools
from linkwork.mechanism import (
    GROUND,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Mechanism,
    MechanismError,
    PairJoint,
    Sphere,
)
from linkwork.mechanism.bearing import bearings
from linkwork.mechanism.effects import Effects
from linkwork.mechanism.files import write_whole

VERSION = "1.11"
DRAKE = "https://drake.mit.edu"  # the namespace of its elements
UNBOUNDED = "1e16"  # what the specification takes for no limit
WORLD = "world"
FREE = ("slide", "slide", "slide", "ball")
TYPES = {
    (): "fixed",
    ("turn",): "revolute",
    ("slide",): "prismatic",
    ("screw",): "screw",
    ("ball",): "ball",
    ("turn", "turn"): "universal",
}
"""What a joint is called, by its motions."""
SCOPE = "::"
NAMING = ("name", "attached_to", "relative_to", "joint")  # attributes that are names of parts
INSTEAD = "write .xml (MJCF) or .yaml"


@dataclass
class SdfSheet:
    """Hold the file while it is written: what of, with its loops closed at home; links: what those
    of the bodies are called."""

    mechanism: Mechanism
    home: Home
    model: ET.Element
    notes: Notes = field(default_factory=Notes)
    links: dict[str, str] = field(default_factory=dict)

    def refusal(self, what: str) -> MechanismError:
        return MechanismError(f"{self.mechanism.name}: {what}; {INSTEAD}")


def write_sdf(mechanism: Mechanism, path: Path) -> tuple[str, ...]:
    """Write a mechanism as SDF; return notes on what the file does not hold.

    Raises:
        MechanismError: SDF cannot hold the mechanism, its loops cannot be closed, or the file
            cannot be written.
    """
    text, notes = to_sdf(mechanism)
    write_whole(path, text)
    return notes


def to_sdf(mechanism: Mechanism) -> tuple[str, tuple[str, ...]]:
    """Return the text of an SDF file and notes."""
    # A world with its gravity, and one model in it.
    root = ET.Element("sdf", version=VERSION)
    world = ET.SubElement(root, "world", name=mechanism.name)
    ET.SubElement(world, "gravity").text = numbers(mechanism.gravity)
    model = ET.SubElement(world, "model", name=mechanism.name)
    sheet = SdfSheet(mechanism, Home({}, {}), model)
    refuse_unheld(sheet)
    sheet.home, sheet.links = home_of(mechanism), links_of(sheet)
    # Links at home, joints between them, frames.
    for name in mechanism.bodies:
        write_link(sheet, name)
    for name, joint in mechanism.pairs.items():
        write_joint(sheet, name, joint)
    write_gears(sheet)
    tell_tools(mechanism, sheet.notes)
    for name, tool in mechanism.tools.items():
        link = sheet.links[tool.body]
        called = f"{name} frame" if name in {*sheet.links.values(), *mechanism.joints} else name
        frame = ET.SubElement(model, "frame", name=called, attached_to=link)
        add_pose(frame, poses.of_frame(tool.frame), relative_to=link)
    tell_losses(sheet)
    rename_scoped(root, sheet.notes)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n", sheet.notes.sentences()


def refuse_unheld(sheet: SdfSheet) -> None:
    """Refuse what acts on the motion, or holds it, and has no place in SDF."""
    mechanism = sheet.mechanism
    if lost := unheld(mechanism):
        raise sheet.refusal(f"SDF has no place for {lost[0]}, as for {lost[1]!r}")
    for name, joint in mechanism.pairs.items():
        kind = pattern(joint)
        floats = kind == FREE and GROUND in joint.connects
        if not floats and (kind not in TYPES or held_length(joint) is not None):
            raise sheet.refusal(f"joint {name!r}, a {joint.type} joint, is none of SDF's")


def links_of(sheet: SdfSheet) -> dict[str, str]:
    """Return what each body's link is called, ground's the world: names are given once in a model,
    so that a body gives way to a joint of its name."""
    mechanism, found = sheet.mechanism, {GROUND: WORLD}
    for body in mechanism.bodies:
        name = body
        while (
            name in mechanism.joints or name == WORLD or (name != body and name in mechanism.bodies)
        ):
            name = f"{name} link"
        if name != body:
            sheet.notes.say(f"bodies.{body}: its link is called {name!r}")
        found[body] = name
    return found


def rename_scoped(root: ET.Element, notes: Notes) -> None:
    """Give names without the mark by which SDF names what is inside models."""
    names = {element.attrib["name"] for element in root.iter() if "name" in element.attrib}
    called: dict[str, str] = {}
    for name in sorted(name for name in names if SCOPE in name):
        own = name.replace(SCOPE, "_")
        while own in names:
            own += "_"
        names.add(own)
        called[name] = own
    for element in root.iter() if called else ():
        for key in NAMING:
            if element.get(key) in called:
                element.set(key, called[element.attrib[key]])
        if element.tag in ("parent", "child"):
            element.text = called.get(element.text or "", element.text)
    if called:
        notes.say(f"names have '_' for {SCOPE!r}, which is SDF's for what is inside models")


def add_pose(element: ET.Element, X: np.ndarray, **attributes: str) -> None:
    """Add a pose by position and the angles of Rz(yaw) Ry(pitch) Rx(roll)."""
    pose = ET.SubElement(element, "pose", attributes)
    pose.text = f"{numbers(X[:3, 3])} {numbers(poses.to_rpy(X[:3, :3]))}"


def add(element: ET.Element, tag: str, value: float) -> None:
    ET.SubElement(element, tag).text = repr(float(value))


# ------------------------------------------------------------------------------------------- links


def write_link(sheet: SdfSheet, name: str) -> None:
    """Write a body at home."""
    body = sheet.mechanism.bodies[name]
    link = ET.SubElement(sheet.model, "link", name=sheet.links[name])
    add_pose(link, sheet.home.poses[name])
    solid = solid_of(body)
    tensor = solid.inertia
    if body.inertia.planar and body.inertia.zz:
        tensor = np.eye(3) * body.inertia.zz  # what a plane does not feel, so that it is rigid
    inertial = ET.SubElement(link, "inertial")
    add_pose(inertial, poses.pose(solid.centre))
    add(inertial, "mass", solid.mass)
    inertia = ET.SubElement(inertial, "inertia")
    for i, row in enumerate("xyz"):
        for j, column in enumerate("xyz"[i:], start=i):
            add(inertia, f"i{row}{column}", tensor[i, j])
    if name in whole_weights(sheet.mechanism).values():
        ET.SubElement(link, "gravity").text = "false"
    if not solid.mass:
        sheet.notes.say(f"{name}: has no mass, which other programs than this may refuse")
    write_shapes(sheet, name, link)


def write_shapes(sheet: SdfSheet, name: str, link: ET.Element) -> None:
    """Write what a body looks like."""
    for number, shape in enumerate(sheet.mechanism.bodies[name].shapes, start=1):
        geometry = ET.Element("geometry")
        match shape:
            case Box():
                ET.SubElement(ET.SubElement(geometry, "box"), "size").text = numbers(shape.size)
            case Sphere():
                add(ET.SubElement(geometry, "sphere"), "radius", shape.radius)
            case Ellipsoid():
                radii = ET.SubElement(ET.SubElement(geometry, "ellipsoid"), "radii")
                radii.text = numbers(shape.radii)
            case Cylinder() | Capsule():
                kind = "cylinder" if isinstance(shape, Cylinder) else "capsule"
                solid = ET.SubElement(geometry, kind)
                add(solid, "radius", shape.radius)
                add(solid, "length", shape.length)
            case _:
                sheet.notes.say(f"{name}: polygons and meshes are left out")
                continue
        visual = ET.SubElement(link, "visual", name=f"shape {number}")
        add_pose(visual, poses.of_frame(shape.frame))
        visual.append(geometry)


# ------------------------------------------------------------------------------------------ joints


def write_joint(sheet: SdfSheet, name: str, joint: PairJoint) -> None:
    """Write a joint in its frame on the child, which is never ground; bodies that are free float
    without one."""
    kind = pattern(joint)
    if kind == FREE:
        return
    first, second = joint.connects
    reversed_ = second == GROUND
    if reversed_ and kind == ("turn", "turn"):
        raise sheet.refusal(f"joint {name!r} leads to ground by two axes; name ground first")
    parent, child, far = (second, first, 0) if reversed_ else (first, second, 1)
    element = ET.SubElement(sheet.model, "joint", name=name, type=TYPES[kind])
    ET.SubElement(element, "parent").text = sheet.links[parent]
    ET.SubElement(element, "child").text = sheet.links[child]
    add_pose(element, poses.of_frame(joint.frames[far]))
    motions = motions_of(joint)
    labels, effects = joint.coordinates(name), list(joint.effects().values())
    if kind in ((), ("ball",)):
        if any(any(own.loads) for own in effects):
            sheet.notes.say(f"joints.{name}: what acts in a ball joint is left out", alters=True)
        return
    if kind == ("screw",):
        pitch = float(motions[0].pitch)  # pyright: ignore[reportArgumentType]
        add(element, "screw_thread_pitch", 2 * pi * pitch)
    # Its axes in the frame of the child at home.
    for place, (label, motion, own) in enumerate(zip(labels, motions, effects, strict=True)):
        axis = np.asarray(motion.slide if motion.what == "slide" else motion.turn, float)
        for other, turned in zip(motions[place + 1 :], labels[place + 1 :], strict=True):
            axis = poses.turn(other.turn, -sheet.home.coordinates[turned])[:3, :3] @ axis
        write_axis(sheet, element, "axis" if not place else "axis2", label, axis, own, reversed_)
    write_rotors(sheet, element, labels, effects)


def write_rotors(
    sheet: SdfSheet, joint: ET.Element, labels: tuple[str, ...], effects: list[Effects]
) -> None:
    """Write the rotor of a driven joint with one axis, as Drake has it; note others."""
    if not any(own.rotor for own in effects):
        return
    if len(labels) != 1 or labels[0] not in sheet.mechanism.actuators:
        sheet.notes.say(
            "rotor inertias are left out but of driven joints with one axis: SDF has none",
            alters=True,
        )
        return
    sheet.model.set("xmlns:drake", DRAKE)
    add(joint, "drake:gear_ratio", 1.0)
    add(joint, "drake:rotor_inertia", effects[0].rotor)


def write_axis(
    sheet: SdfSheet,
    joint: ET.Element,
    tag: str,
    label: str,
    axis: np.ndarray,
    own: Effects,
    reversed_: bool,
) -> None:
    """Write an axis with what acts about or along it, its coordinate counted from home."""
    home = sheet.home.coordinates[label]
    element = ET.SubElement(joint, tag)
    ET.SubElement(element, "xyz").text = numbers(-axis if reversed_ else axis)
    limit = ET.SubElement(element, "limit")
    for end, value in (("lower", own.limits.lower), ("upper", own.limits.upper)):
        unbounded = UNBOUNDED if end == "upper" else f"-{UNBOUNDED}"
        ET.SubElement(limit, end).text = unbounded if value is None else repr(value - home)
    driven = label in sheet.mechanism.actuators
    ET.SubElement(limit, "effort").text = UNBOUNDED if driven else "0"
    add(limit, "velocity", own.limits.speed or 0)
    dynamics = ET.SubElement(element, "dynamics")
    add(dynamics, "damping", own.friction.viscous)
    add(dynamics, "friction", own.friction.coulomb)
    if own.spring.stiffness:
        add(dynamics, "spring_reference", own.spring.rest - home)
        add(dynamics, "spring_stiffness", own.spring.stiffness)


def write_gears(sheet: SdfSheet) -> None:
    """Write gears of two coordinates as <mimic>; at home, where both are zero, they hold."""
    places = {}
    for element in sheet.model.iter("joint"):
        name = element.attrib["name"]
        labels = sheet.mechanism.pairs[name].coordinates(name)
        tags = [tag for tag in ("axis", "axis2") if element.find(tag) is not None]
        places |= {label: (name, tag, element) for label, tag in zip(labels, tags, strict=False)}
    for name, gear in sheet.mechanism.gears.items():
        used = [label for label in gear.coupled if label in places]
        passive = [label for label in used if label not in sheet.mechanism.actuators]
        if len(used) != 2 or len(gear.ratios) != 2 or gear.powers or not passive:
            raise sheet.refusal(
                f"the gear {name!r} couples other than two coordinates by ratios of which one is "
                "not driven"
            )
        follower = passive[0]
        leader = next(label for label in used if label != follower)
        _, tag, element = places[follower]
        axis = element.find(tag)
        assert axis is not None
        if axis.find("mimic") is not None:
            raise sheet.refusal(f"{follower!r} follows two gears, as {name!r}")
        mimic = ET.SubElement(axis, "mimic", joint=places[leader][0], axis=places[leader][1])
        add(mimic, "multiplier", -gear.ratios[leader] / gear.ratios[follower])


def tell_losses(sheet: SdfSheet) -> None:
    """Note what the file does not hold."""
    say, mechanism = sheet.notes.say, sheet.mechanism
    if any(sheet.home.coordinates[label] for label in mechanism.coordinates):
        say("coordinates count from home, where SDF's joints are at zero")
    own = [each for joint in mechanism.pairs.values() for each in joint.effects().values()]
    if any(each.stop for each in own):
        say("stops are left out: SDF's limits follow another law", alters=True)
    if any(any((*each.spring.powers, *each.friction.powers)) for each in own):
        say("powers of springs and friction are left out", alters=True)
    if any(each.spring.damping or each.friction.static or each.friction.bristle for each in own):
        say("dampers of springs, static friction and bristles are left out", alters=True)
    if named := ", ".join(bearings(mechanism.joints)):
        say(f"{named}: friction that grows with load is left out", alters=True)
