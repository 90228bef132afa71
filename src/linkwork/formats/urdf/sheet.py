"""A URDF file while it is written: hinges and slides of its tree, with what acts in them."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.equations.joints import ElementaryMotion, motions_of
from linkwork.formats.mjcf.laws import numbers
from linkwork.formats.notes import Notes
from linkwork.formats.poses import to_rpy
from linkwork.formats.urdf.model import NO_LIMIT
from linkwork.mechanism import GROUND, Limits, Mechanism, MechanismError, PairJoint
from linkwork.mechanism.effects import Effects


@dataclass
class UrdfSheet:
    """Hold the file while it is written.

    beside: whether loops stand in a file of their own, where the URDF says nothing of them
    carriers: of each body, the frame of its link in it
    closings: pairs of frames that close loops, with their types (`closings`)
    rotors: what the rotors of driven joints add to their inertia, by the joint's name in the file
    """

    mechanism: Mechanism
    root: ET.Element
    beside: bool = False
    notes: Notes = field(default_factory=Notes)
    carriers: dict[str, np.ndarray] = field(default_factory=lambda: {GROUND: np.eye(4)})
    closings: list[tuple[tuple[str, str], str]] = field(default_factory=list)
    rotors: dict[str, float] = field(default_factory=dict)

    @property
    def names(self) -> set[str]:
        """The names of links and joints that are taken."""
        return {element.attrib["name"] for element in self.root if "name" in element.attrib}

    def refusal(self, what: str, instead: str) -> MechanismError:
        return MechanismError(f"{self.mechanism.name}: {what}; {instead}")


Steps = list[tuple[str, ElementaryMotion, Effects | None]]


def steps_of(joint: PairJoint, name: str, forwards: bool) -> Steps:
    """Return hinges and slides of a joint with their names; a slide of a screw follows its
    hinge."""
    effects = list(joint.effects().values()) or [Effects()] * len(motions_of(joint))
    found: Steps = []
    labels = joint.coordinates(name)
    for label, motion, own in zip(labels, motions_of(joint), effects, strict=True):
        found.append((label, motion if forwards else motion.reversed(), own))
        if motion.what == "screw":
            found.append((label, motion if forwards else motion.reversed(), None))
    return found if forwards else found[::-1]


def write_steps(
    sheet: UrdfSheet, name: str, steps: Steps, links: tuple[str, str], X: np.ndarray
) -> None:
    """Write hinges and slides one after the other from a link to another, with links between."""
    parent, end = links
    for place, (label, motion, own) in enumerate(steps):
        last = place == len(steps) - 1
        child = end if last else free_name(sheet, f"between {name}")
        if not last:
            ET.SubElement(sheet.root, "link", name=child)
        write_step(sheet, label, motion, own, (parent, child), X)
        parent, X = child, np.eye(4)


def write_step(
    sheet: UrdfSheet,
    label: str,
    motion: ElementaryMotion,
    own: Effects | None,
    links: tuple[str, str],
    X: np.ndarray,
) -> None:
    """Write a hinge or a slide; `own` is None for the slide that follows a screw's hinge."""
    name = label.replace(".", "_")
    # The slide of a screw follows its turn.
    if own is None:
        pitch = float(motion.pitch)  # pyright: ignore[reportArgumentType]
        element = add_joint(sheet, f"{name}_advance", "prismatic", *links, X, motion.turn)
        ET.SubElement(element, "limit", bounds(Limits(), "prismatic"))
        ET.SubElement(element, "mimic", joint=name, multiplier=repr(pitch), offset="0")
        if not sheet.beside:
            element.set("independent", "false")
        return
    # A joint of one freedom, with the rotor of its motor.
    slides = motion.what == "slide"
    axis = np.asarray(motion.slide if slides else motion.turn, float)
    bounded = slides or own.limits.bounded
    kind = "prismatic" if slides else "revolute" if bounded else "continuous"
    element = add_joint(sheet, name, kind, *links, X, axis)
    if driven := label in sheet.mechanism.actuators:
        sheet.rotors[name] = own.rotor
    elif own.rotor:
        sheet.notes.say(
            "rotor inertias of joints that are not driven are left out: URDF has none", alters=True
        )
    if not sheet.beside:
        element.set("independent", "true" if driven else "false")
    # What bounds it and resists it, and a spring of Gazebo's.
    if bounded or own.limits.speed is not None:
        ET.SubElement(element, "limit", bounds(own.limits, kind))
    if own.friction.viscous or own.friction.coulomb:
        friction = own.friction
        damping = {"damping": repr(friction.viscous), "friction": repr(friction.coulomb)}
        ET.SubElement(element, "dynamics", damping)
    if own.spring.stiffness:
        gazebo = ET.SubElement(sheet.root, "gazebo", reference=name)
        ET.SubElement(gazebo, "springStiffness").text = repr(own.spring.stiffness)
        ET.SubElement(gazebo, "springReference").text = repr(own.spring.rest)


def bounds(limits: Limits, kind: str) -> dict[str, str]:
    """Return the attributes of <limit>; URDF wants both ends, but of what is continuous, and an
    effort and a velocity."""
    rest = {"effort": "0", "velocity": repr(limits.speed or 0)}
    if kind == "continuous":
        return rest
    lower = -NO_LIMIT if limits.lower is None else limits.lower
    upper = NO_LIMIT if limits.upper is None else limits.upper
    return {"lower": repr(lower), "upper": repr(upper), **rest}


def add_joint(
    sheet: UrdfSheet,
    name: str,
    kind: str,
    parent: str,
    child: str,
    X: np.ndarray,
    axis: np.ndarray | None = None,
) -> ET.Element:
    """Add a joint of the tree."""
    if any(other.attrib["name"] == name for other in sheet.root.iter("joint")):
        raise sheet.refusal(
            f"two joints would be called {name!r}, for URDF's names have no dots", "rename one"
        )
    element = ET.SubElement(sheet.root, "joint", name=name, type=kind)
    add_origin(element, X)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    if axis is not None:
        ET.SubElement(element, "axis", xyz=numbers(axis))
    return element


def add_origin(element: ET.Element, X: np.ndarray, tag: str = "origin") -> None:
    """Add a pose by position and the angles of Rz(yaw) Ry(pitch) Rx(roll)."""
    ET.SubElement(element, tag, xyz=numbers(X[:3, 3]), rpy=numbers(to_rpy(X[:3, :3])))


def free_name(sheet: UrdfSheet, wanted: str) -> str:
    """Return a name that no link, joint or body has."""
    taken, name = sheet.names | {*sheet.mechanism.bodies}, wanted
    count = 1
    while name in taken:
        count += 1
        name = f"{wanted} {count}"
    return name


def tell_unheld(sheet: UrdfSheet, name: str, joint: PairJoint) -> None:
    """Note what acts in a joint that is no hinge or slide of the tree."""
    if any(any(own.loads) for own in joint.effects().values()):
        sheet.notes.say(
            f"joints.{name}: friction, springs, stops and rotors are left out: URDF has them in "
            "hinges and slides of the tree alone",
            alters=True,
        )
    if any(own.limits != Limits() for own in joint.effects().values()):
        sheet.notes.say(
            f"joints.{name}: limits are left out: URDF has them in hinges and slides of the tree "
            "alone"
        )
