"""A mechanism written as URDF: its spanning tree as links and joints, the joints that close loops
as <loop> and <constraint> beside them, which programs that know a tree alone pass over.

A link's frame is that of the joint that carries it. A joint of several freedoms becomes hinges and
slides called "joint_freedom", with links without mass between; a screw a hinge and a slide that
mimics it. Coordinates are the mechanism's own, and zero where they are there; loops are closed by
the frames on both of their sides, and where the file is read, from a reference.

Source: the URDF specification, https://wiki.ros.org/urdf/XML; `sidecars` for the loops.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.equations.joints import held_length, motions_of, pattern
from linkwork.equations.topology import Branch, span
from linkwork.formats import poses
from linkwork.formats.masses import solid_of, unheld, whole_weights
from linkwork.formats.mjcf.laws import numbers
from linkwork.formats.reading import EARTH
from linkwork.formats.tools_told import tell_tools
from linkwork.formats.urdf.closings import closings_place, closings_text, write_closing
from linkwork.formats.urdf.sheet import (
    UrdfSheet,
    add_joint,
    add_origin,
    free_name,
    steps_of,
    tell_unheld,
    write_steps,
)
from linkwork.mechanism import (
    GROUND,
    Box,
    Cylinder,
    Mechanism,
    PairJoint,
    Sphere,
)
from linkwork.mechanism.bearing import bearings
from linkwork.mechanism.effects import Friction
from linkwork.mechanism.files import write_whole
from linkwork.mechanism.record import HUGE

DRAKE = "https://drake.mit.edu"  # the namespace of its elements
FLOATING = ("slide", "slide", "slide", "ball")
PLANAR, CROSSED = ("slide", "slide", "turn"), ("turn", "turn")
LOOPS = {
    (): "fixed",
    ("turn",): "revolute",
    ("slide",): "prismatic",
    ("ball",): "spherical",
    PLANAR: "planar",
}
"""What a joint that closes a loop is called, by its motions."""


def write_urdf(mechanism: Mechanism, path: Path, beside: bool = False) -> tuple[str, ...]:
    """Write a mechanism as URDF with loops; return notes on what the file does not hold.

    Args:
        beside: whether the loops stand in a file of its name that ends in .yaml (`closings`).

    Raises:
        MechanismError: URDF cannot hold the mechanism, or a file cannot be written.
    """
    sheet = written(mechanism, beside)
    place = closings_place(path) if beside else None
    write_whole(path, text_of(sheet))
    if place is not None:
        write_whole(place, closings_text(sheet))
        sheet.notes.say(f"the loops are in {place.name}")
    return sheet.notes.sentences()


def to_urdf(mechanism: Mechanism) -> tuple[str, tuple[str, ...]]:
    """Return the text of a URDF file and notes."""
    sheet = written(mechanism)
    return text_of(sheet), sheet.notes.sentences()


def text_of(sheet: UrdfSheet) -> str:
    """Return the text of a file."""
    ET.indent(sheet.root)
    return ET.tostring(sheet.root, encoding="unicode") + "\n"


def written(mechanism: Mechanism, beside: bool = False) -> UrdfSheet:
    """Return a file with all that it holds; beside: whether loops stand in a file of their own."""
    sheet = UrdfSheet(mechanism, ET.Element("robot", name=mechanism.name), beside)
    refuse_what_moves(sheet)
    topology = span(mechanism)
    for name in () if beside else topology.cuts:
        if cut_rates := {*topology.closing[name].rates(name)} & {*mechanism.actuators}:
            raise sheet.refusal(
                f"the driven joint {min(cut_rates)!r} closes a loop, which URDF drives none of",
                "write its loops beside it, or .xml (MJCF) or .yaml",
            )
    # Links and joints of the tree, from ground outwards; then what closes its loops.
    ET.SubElement(sheet.root, "link", name=GROUND)
    for branch in topology.branches:
        write_branch(sheet, branch, topology.joints[branch.joint])
    for name, joint in topology.closing.items():
        close = write_closing if beside else write_loop
        close(sheet, name, joint)
    write_gears(sheet)
    if any(sheet.rotors.values()):
        write_rotors(sheet)
    tell_tools(mechanism, sheet.notes)
    for name, tool in mechanism.tools.items():
        write_tool(sheet, name, tool.body, poses.of_frame(tool.frame))
    for body in whole_weights(mechanism).values():
        gazebo = ET.SubElement(sheet.root, "gazebo", reference=body)
        ET.SubElement(gazebo, "gravity").text = "false"
    tell_losses(sheet)
    return sheet


def refuse_what_moves(sheet: UrdfSheet) -> None:
    """Refuse what acts on the motion and has no place in URDF."""
    if lost := unheld(sheet.mechanism):
        raise sheet.refusal(
            f"URDF has no place for {lost[0]}, as for {lost[1]!r}", "write .xml (MJCF) or .yaml"
        )


# -------------------------------------------------------------------------------------------- tree


def write_branch(sheet: UrdfSheet, branch: Branch, joint: PairJoint) -> None:
    """Write a joint of the tree, and the link that it carries."""
    near, far = (1, 0) if branch.reversed else (0, 1)
    X = poses.inverse(sheet.carriers[branch.parent]) @ poses.of_frame(joint.frames[near])
    sheet.carriers[branch.body] = poses.of_frame(joint.frames[far])
    kind = pattern(joint)
    if "ball" in kind and (kind != FLOATING or branch.reversed):
        raise sheet.refusal(
            f"joint {branch.joint!r} turns freely in the tree, where URDF has no such joint",
            "make it a universal and a revolute joint, or write .xml (MJCF) or .yaml",
        )
    write_link(sheet, branch.body)
    if kind in ((), FLOATING):
        what = "floating" if kind else "fixed"
        add_joint(sheet, branch.joint, what, branch.parent, branch.body, X)
        tell_unheld(sheet, branch.joint, joint)
        return
    # Each motion a hinge or a slide, with links between; a screw is both.
    steps = steps_of(joint, branch.joint, not branch.reversed)
    write_steps(sheet, branch.joint, steps, (branch.parent, branch.body), X)


# ------------------------------------------------------------------------------------------- links


def write_link(sheet: UrdfSheet, name: str) -> None:
    """Write the link that a body is, in the frame of the joint that carries it."""
    body, back = sheet.mechanism.bodies[name], poses.inverse(sheet.carriers[name])
    element = ET.SubElement(sheet.root, "link", name=name)
    solid = solid_of(body)
    tensor = solid.inertia
    if body.inertia.planar and body.inertia.zz:
        tensor = np.eye(3) * body.inertia.zz  # what a plane does not feel, so that it is rigid
    # Mass and moments, in the frame of the link.
    if solid.mass or tensor.any():
        inertial = ET.SubElement(element, "inertial")
        ET.SubElement(inertial, "origin", xyz=numbers(poses.point(back, solid.centre)), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=repr(float(solid.mass)))
        own = back[:3, :3] @ tensor @ back[:3, :3].T
        places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
        places["izz"] = (2, 2)
        ET.SubElement(
            inertial, "inertia", {key: repr(float(own[at])) for key, at in places.items()}
        )
    # Shapes, as far as URDF has them.
    for shape in body.shapes:
        geometry = ET.Element("geometry")
        match shape:
            case Box():
                ET.SubElement(geometry, "box", size=numbers(shape.size))
            case Sphere():
                ET.SubElement(geometry, "sphere", radius=repr(shape.radius))
            case Cylinder():
                size = {"radius": repr(shape.radius), "length": repr(shape.length)}
                ET.SubElement(geometry, "cylinder", size)
            case _:
                sheet.notes.say(f"{name}: shapes that are no box, sphere or cylinder are left out")
                continue
        visual = ET.SubElement(element, "visual")
        add_origin(visual, back @ poses.of_frame(shape.frame))
        visual.append(geometry)


def write_tool(sheet: UrdfSheet, name: str, body: str, X: np.ndarray) -> None:
    """Write a tool as a link without mass that is fixed to its body."""
    link = free_name(sheet, name)
    if link != name:
        sheet.notes.say(f"the tool {name!r} is called {link!r}: {name!r} is a link")
    ET.SubElement(sheet.root, "link", name=link)
    pose = poses.inverse(sheet.carriers[body]) @ X
    add_joint(sheet, free_name(sheet, f"{name} frame"), "fixed", body, link, pose)


# ------------------------------------------------------------------------------------------- loops


def write_loop(sheet: UrdfSheet, name: str, joint: PairJoint) -> None:
    """Write a joint that closes a loop, by its frames on both links."""
    kind = pattern(joint)
    ends = [
        poses.inverse(sheet.carriers[body]) @ poses.of_frame(frame)
        for body, frame in zip(joint.connects, joint.frames, strict=True)
    ]
    if kind == CROSSED:
        write_constraint(sheet, name, joint, ends)
    elif kind not in LOOPS or held_length(joint) is not None:
        raise sheet.refusal(
            f"joint {name!r}, a {joint.type} joint, closes a loop, which URDF with loops has "
            f"no word for ({', '.join(LOOPS.values())}, universal)",
            "write .xml (MJCF) or .yaml",
        )
    else:
        element = ET.SubElement(sheet.root, "loop", name=name, type=LOOPS[kind])
        for tag, body, X in zip(("predecessor", "successor"), joint.connects, ends, strict=True):
            add_origin(ET.SubElement(element, tag, link=body), X)
        axis = getattr(joint, "axis", (0.0, 0.0, 1.0))
        ET.SubElement(element, "axis", xyz=numbers(axis))
    tell_unheld(sheet, name, joint)


def write_constraint(sheet: UrdfSheet, name: str, joint: PairJoint, ends: list[np.ndarray]) -> None:
    """Write a joint of two crossing axes that closes a loop, by an axis on either side."""
    element = ET.SubElement(sheet.root, "constraint", name=name, type="universal")
    axes = [motion.turn for motion in motions_of(joint)]
    sides = zip(("parent", "child"), joint.connects, ends, axes, strict=True)
    for tag, body, X, axis in sides:
        ET.SubElement(element, tag, link=body)
        add_origin(element, poses.pose(X[:3, 3]), f"{tag}_origin")
        ET.SubElement(element, f"{tag}_axis", xyz=numbers(X[:3, :3] @ axis))
    sheet.notes.say(
        f"joints.{name}: is a <constraint>, which has no zero; read again its coordinates count "
        "from elsewhere, and a reference gives those of other joints alone"
    )


def write_gears(sheet: UrdfSheet) -> None:
    """Write gears of two hinges or slides as <mimic>: q = multiplier q_other + offset."""
    joints = {element.attrib["name"]: element for element in sheet.root.iter("joint")}
    for name, gear in sheet.mechanism.gears.items():
        used = list(gear.coupled)
        used.sort(key=lambda label: label in sheet.mechanism.actuators)  # driven ones lead
        own = [label.replace(".", "_") for label in used]
        free = [at in joints and joints[at].find("mimic") is None for at in own]
        follower = free.index(True) if any(free) else None
        held = follower is not None and all(at in joints for at in own)
        if len(used) != 2 or follower is None or gear.powers or not held:
            raise sheet.refusal(
                f"the gear {name!r} couples other than two hinges or slides of the tree by ratios, "
                "which mimic holds",
                "write .xml (MJCF) or .yaml",
            )
        ratio = gear.ratios[used[follower]]
        values = {
            "joint": own[1 - follower],
            "multiplier": repr(-gear.ratios[used[1 - follower]] / ratio),
            "offset": repr(gear.offset / ratio),
        }
        ET.SubElement(joints[own[follower]], "mimic", values)


def write_rotors(sheet: UrdfSheet) -> None:
    """Write the drives of all driven joints with their rotors, as Drake has them; it passes over
    those of joints whose limit of effort is zero."""
    sheet.root.set("xmlns:drake", DRAKE)
    for joint in list(sheet.root.iter("joint")):
        if (name := joint.attrib["name"]) not in sheet.rotors:
            continue
        drive = ET.SubElement(sheet.root, "transmission", name=free_name(sheet, f"{name} drive"))
        ET.SubElement(drive, "type").text = "transmission_interface/SimpleTransmission"
        ET.SubElement(drive, "joint", name=name)
        motor = ET.SubElement(drive, "actuator", name=name)
        ET.SubElement(motor, "drake:gear_ratio", value="1")
        ET.SubElement(motor, "drake:rotor_inertia", value=repr(float(sheet.rotors[name])))
        if (limit := joint.find("limit")) is not None:
            limit.set("effort", repr(HUGE))


def tell_losses(sheet: UrdfSheet) -> None:
    """Note what the file does not hold."""
    say, mechanism = sheet.notes.say, sheet.mechanism
    if tuple(mechanism.gravity) != EARTH:
        say(
            f"URDF holds no gravity, which is ({numbers(mechanism.gravity)}) here; what reads it "
            f"takes ({numbers(EARTH)})",
            alters=True,
        )
    if mechanism.reference:
        say("the reference is left out: give it where the file is read (reference=, --reference)")
    own = [each for joint in mechanism.pairs.values() for each in joint.effects().values()]
    plain = Friction()
    if any(each.stop for each in own):
        say("stops are left out: URDF has limits alone", alters=True)
    if any(any((*each.spring.powers, *each.friction.powers)) for each in own):
        say("powers of springs and friction are left out", alters=True)
    if any(each.spring.damping or each.friction.static or each.friction.bristle for each in own):
        say("dampers of springs, static friction and bristles are left out", alters=True)
    if named := ", ".join(bearings(mechanism.joints)):
        say(f"{named}: friction that grows with load is left out", alters=True)
    if any(each.friction.coulomb_rate != plain.coulomb_rate for each in own):
        say("the rate at which Coulomb friction is smoothed is left out", alters=True)
