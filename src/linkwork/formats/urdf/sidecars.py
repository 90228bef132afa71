"""Loops that URDF itself cannot hold, in the conventions in use.

URDF+ (generalized_rbda): inside the file itself,

    <loop name type><predecessor link><origin/></predecessor><successor
    link><origin/></successor><axis/></loop> <coupling name><predecessor link/><successor
    link/><ratio value/></coupling> <joint ... independent="true|false">

A coupling holds ratio * (sum of the joints from the nearest common link to the predecessor) - (the
same to the successor) = 0. Independent joints are the actuators; a joint that does not say is one.

urdfdom's proposal: inside the file itself, with a frame and an axis on either side,

    <constraint name type><parent link/><parent_origin/><parent_axis/><child link/><child_origin/>
    <child_axis/></constraint>

The axes meet; those of a universal joint are square to each other.

Isaac Sim, and Drake of old: inside the file itself, with the axis in both frames,

    <loop_joint name type><link1 link xyz rpy/><link2 link xyz rpy/><axis/></loop_joint>

Gazebo: inside <gazebo>, an SDF <joint> between two links, at zero where all joints of the URDF are.

LAAS (example-parallel-robots): a file robot.yaml, or of the model's own name, beside it,

    closed_loop: [[frame, frame], ...]   type: [6d | 3d, ...]   name_mot: [joint, ...]
    joint_name: [joint, ...]             joint_type: [SPHERICAL | FIXED | UJOINT_XY | ..., ...]

6d is a fixed joint between two frames (links, or joints: then the frame of what they carry), 3d a
spherical one; a joint that is SPHERICAL, FIXED or UJOINT_ab is of that type whatever the URDF says.
Three hinges through one point with nothing but massless links between are a spherical joint.

Source: https://github.com/ROAM-Lab-ND/generalized_rbda,
https://github.com/Gepetto/example-parallel-robots (readers),
https://github.com/ros/urdfdom/pull/264 (proposal), http://sdformat.org/spec (joint),
https://docs.isaacsim.omniverse.nvidia.com (URDF importer: loop_joint).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from linkwork.formats import poses, xml
from linkwork.formats.notes import Notes
from linkwork.formats.sdf.scopes import read_pose, thread_pitch
from linkwork.formats.urdf.model import (
    ONE_FREEDOM,
    UrdfJoint,
    UrdfModel,
    axis_of,
    origin,
    placed,
    weight,
)
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    FixedJoint,
    GearJoint,
    Joint,
    MechanismError,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    ScrewJoint,
    SphericalJoint,
    UniversalJoint,
)
from linkwork.mechanism.document import DocumentNode, read_document

KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")
LAAS = re.compile(r"^(closed_loop|name_mot|joint_name)\s*:", re.MULTILINE)
UNIVERSAL = re.compile(r"UJOINT_([XYZ])([XYZ])")
LOOPS = ("revolute", "continuous", "prismatic", "fixed", "spherical", "ball", "planar")
CONSTRAINTS = (*LOOPS, "universal")
JOINTS: dict[str, type] = {
    "revolute": RevoluteJoint,
    "continuous": RevoluteJoint,
    "prismatic": PrismaticJoint,
    "screw": ScrewJoint,
    "fixed": FixedJoint,
    "spherical": SphericalJoint,
    "ball": SphericalJoint,
    "planar": PlanarJoint,
    "universal": UniversalJoint,
}
LOOP_JOINT, LINK = "loop_joint", "link1"
ENDS = {"loop": (("predecessor", "successor"), origin), LOOP_JOINT: ((LINK, "link2"), placed)}
"""The two ends of a loop, and what gives the frame of one."""
MODEL = "__model__"  # SDF's name of the frame of the whole model
GAZEBO = ("revolute", "continuous", "prismatic", "screw", "fixed", "ball")
OWN_LINKS = "in a <gazebo> is left out: it leads to a link that only a <gazebo> has"
TAKEN = "in a <gazebo> is left out: another joint has its name"
# Of three hinges that are a spherical joint: mass of links, distance of axes, over the robot's.
LIGHT, NEAR = 1e-6, 5e-4


@dataclass(frozen=True)
class Closure:
    """Hold a joint that closes a loop: a type of joint between frames of two links, and its other
    fields."""

    name: str
    type: type
    links: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray] = (np.eye(4), np.eye(4))
    axis: np.ndarray | None = None
    more: Mapping[str, float] = field(default_factory=dict)


@dataclass
class Closures:
    """Hold all closures and gears, and the actuators where a convention names them."""

    closures: list[Closure] = field(default_factory=list)
    gears: dict[str, Joint] = field(default_factory=dict)
    actuators: tuple[str, ...] | None = None

    def frames(self) -> set[str]:
        """Return the links that closures are made of."""
        return {link for closure in self.closures for link in closure.links}

    def joints(self, model: UrdfModel) -> dict[str, Joint]:
        """Return the joints, between the bodies that the links are or are fixed to."""
        made: dict[str, Joint] = {}
        for closure in self.closures:
            (one, X), (two, Y) = map(model.seat, closure.links)
            if one == two:
                fault = (
                    f"the loop {closure.name!r} connects {one!r} to itself, to which both its "
                    "links are fixed"
                )
                raise MechanismError(f"{model.root.file}: {fault}")
            frames = poses.frame_of(X @ closure.frames[0]), poses.frame_of(Y @ closure.frames[1])
            axis = {} if closure.axis is None else {"axis": tuple(map(float, closure.axis))}
            fields = {"connects": (one, two), "frames": frames, **axis, **closure.more}
            made[closure.name] = closure.type(**fields)
        return made | self.gears


def read_closures(model: UrdfModel, notes: Notes, merging: bool) -> Closures:
    """Read the loops in the file and those beside it; joints of the model change their type as the
    file beside says."""
    found = Closures()
    _read_urdf_plus(model, found, notes)
    path = _beside(model.root.file)
    if path is not None:
        _Laas(path, model, notes).read(found, merging)
    return found


# -------------------------------------------------------------------------------------------- URDF+


def _read_urdf_plus(model: UrdfModel, found: Closures, notes: Notes) -> None:
    names = set(model.joints)
    inside = [
        *model.root.each("loop", "coupling", "constraint"),
        *(loop for loop in model.root.each(LOOP_JOINT) if loop.first(LINK)),
        *_gazebo_joints(model, notes),
    ]
    read = {"loop": _loop, LOOP_JOINT: _loop, "constraint": _constraint, "joint": _gazebo_joint}
    for element in inside:
        name = element.text("name")
        if name in names:
            raise element.refusal("has the name of another joint; names are given once")
        names.add(name)
        label = model.names.give(name, element)
        if element.tag in read:
            found.closures.append(read[element.tag](label, element, model))
        else:
            found.gears[label] = _coupling(element, model)
    said = {
        joint.name: joint.element.attributes.get("independent") for joint in model.joints.values()
    }
    if any(word is not None for word in said.values()):
        found.actuators = tuple(
            name
            for name, word in said.items()
            if (word or "true").lower() == "true" and model.joints[name].type in ONE_FREEDOM
        )


def _link(element: Element, model: UrdfModel) -> str:
    name = element.text("link")
    if name not in model.links:
        raise element.refusal(f"there is no link {name!r}")
    return name


def _loop(name: str, element: Element, model: UrdfModel) -> Closure:
    """Return the loop that a <loop> or a <loop_joint> closes."""
    kind = element.attributes.get("type", "revolute")
    if kind not in LOOPS:
        raise element.refusal(f"type {kind!r} is not one of {', '.join(LOOPS)}")
    names, pose = ENDS[element.tag]
    ends = sorted(element.each(*names), key=lambda end: end.tag)
    if len(ends) != len(names):
        ends = [element.named(name) for name in names]
    links = (_link(ends[0], model), _link(ends[1], model))
    frames = (pose(ends[0]), pose(ends[1]))
    if kind in ("revolute", "continuous", "prismatic"):
        return Closure(name, JOINTS[kind], links, frames, axis_of(element))
    if kind == "planar":
        turn = poses.pose(rotation=poses.from_z(axis_of(element)))
        frames = frames[0] @ turn, frames[1] @ turn
    return Closure(name, JOINTS[kind], links, frames)


def _constraint(name: str, element: Element, model: UrdfModel) -> Closure:
    """Return the loop that a <constraint> closes: its axes are z, or x and y of a universal one."""
    kind = element.choice("type", CONSTRAINTS, "")
    links = tuple(_link(element.named(end), model) for end in ("parent", "child"))
    origins = [origin(element, f"{end}_origin") for end in ("parent", "child")]
    axes = [axis_of(element, f"{end}_axis") for end in ("parent", "child")]
    if kind in ("fixed", "spherical", "ball"):
        frames, axis = origins, None
    elif kind == "universal":
        turns = [poses.completed({k: along}) for k, along in enumerate(axes)]
        frames = [X @ poses.pose(rotation=R) for X, R in zip(origins, turns, strict=True)]
        axis = None
    else:
        turns = [poses.from_z(along) for along in axes]
        frames = [X @ poses.pose(rotation=R) for X, R in zip(origins, turns, strict=True)]
        axis = None if kind == "planar" else np.array([0.0, 0.0, 1.0])
    first, second = links
    return Closure(name, JOINTS[kind], (first, second), (frames[0], frames[1]), axis)


def _gazebo_joints(model: UrdfModel, notes: Notes) -> Iterator[Element]:
    """Yield the joints in <gazebo> between links of the file, whose names are not taken."""
    gazebos, names = [*model.root.each("gazebo")], set(model.joints)
    own = {link.attributes.get("name") for gazebo in gazebos for link in gazebo.each("link")}
    own -= model.links.keys()
    for joint in (joint for gazebo in gazebos for joint in gazebo.each("joint")):
        ends, name = {end.content for end in joint.each("parent", "child")}, joint.text("name")
        if own & ends or name in names:
            notes.on(joint, TAKEN if name in names else OWN_LINKS, alters=True)
        else:
            names.add(name)
            yield joint


def _gazebo_joint(name: str, element: Element, model: UrdfModel) -> Closure:
    """Return the loop that an SDF joint inside <gazebo> closes."""
    kind = element.choice("type", GAZEBO, "")
    ends = []
    for end in ("parent", "child"):
        link = element.named(end).content
        if link not in model.links:
            raise element.refusal(f"there is no link {xml.shortened(link)}")
        ends.append(link)
    pose, axis = element.inner("pose"), element.first("axis")
    own = np.eye(4) if pose is None else read_pose(pose)
    far = _seen_from(pose, "relative_to", ends[1], model) @ own
    near = poses.inverse(model.at_zero(ends[0])) @ model.at_zero(ends[1]) @ far
    along, more = None, {"pitch": thread_pitch(element)} if kind == "screw" else {}
    if kind not in ("fixed", "ball"):
        inner = axis and axis.inner("xyz")
        along = np.array((0.0, 0.0, 1.0) if not inner else inner.vector("xyz"))
        if np.linalg.norm(along) < 1e-12:
            raise element.refusal("xyz has no length; give a direction such as '0 0 1'")
        if inner and "expressed_in" in inner.attributes:
            told = _seen_from(inner, "expressed_in", ends[1], model)
            along = far[:3, :3].T @ told[:3, :3] @ along
        along = poses.unit(along)
    return Closure(name, JOINTS[kind], (ends[0], ends[1]), (near, far), along, more)


def _seen_from(element: Element | None, key: str, link: str, model: UrdfModel) -> np.ndarray:
    """Return the pose in a link, where all joints are at zero, of what an element's numbers are
    told from: the model, a link that it names, or else that link."""
    name = link if element is None else element.attributes.get(key) or link
    if name == link:
        return np.eye(4)
    if element is not None and name not in (*model.links, MODEL):
        raise element.refusal(f"{key} {xml.shortened(name)} is no link of the robot")
    there = np.eye(4) if name == MODEL else model.at_zero(name)
    return poses.inverse(model.at_zero(link)) @ there


def _coupling(element: Element, model: UrdfModel) -> Joint:
    ends = [_link(element.named(end), model) for end in ("predecessor", "successor")]
    ratio = element.named("ratio").number("value")
    chains = [model.chain(link) for link in ends]
    common = {joint.name for joint in chains[0]} & {joint.name for joint in chains[1]}
    ratios: dict[str, float] = {}
    for chain, factor in zip(chains, (ratio, -1.0), strict=True):
        for joint in chain:
            if joint.name in common or joint.type == "fixed":
                continue
            if joint.type not in ONE_FREEDOM:
                raise element.refusal(
                    f"couples across {joint.name!r}, a {joint.type} joint; only hinges and "
                    "slides are coupled"
                )
            ratios[model.labels[joint.name]] = factor
    return element.make(GearJoint, ratios=ratios)


# --------------------------------------------------------------------------------------------- LAAS


def _beside(path: Path) -> Path | None:
    """Return the file of loops beside a model, if there is one."""
    for candidate in (path.with_suffix(".yaml"), path.with_name("robot.yaml")):
        if candidate.is_file() and LAAS.search(xml.contents(candidate).decode("utf-8", "replace")):
            return candidate
    return None


class _Laas:
    """Read a file of loops and change the model as it says."""

    def __init__(self, path: Path, model: UrdfModel, notes: Notes):
        self.path, self.model, self.notes = path, model, notes
        try:
            self.node: DocumentNode = read_document(xml.contents(path).decode("utf-8"))
        except UnicodeDecodeError:
            raise MechanismError(f"{path}: is not UTF-8 text") from None
        except MechanismError as error:
            raise MechanismError(error.what, error.where, f"{path}: {error.place}") from None
        if not isinstance(self.node.data, dict):
            raise MechanismError(f"{path}: is not a mapping; its keys are {', '.join(KEYS)}")

    def read(self, found: Closures, merging: bool) -> None:
        self.notes.say(f"{self.path.name}: closes the loops of {self.model.root.file.name}")
        for key in self.node.data:
            if key not in KEYS:
                self.notes.say(f"{self.path.name}: {key} is left out: it is not known here")
        self._change_types()
        names = self._texts("name_mot")
        for name in list(names):
            if name not in self.model.joints:
                file = self.model.root.file.name
                self.notes.say(
                    f"{self.path.name}: the motor {xml.shortened(name)} is left out: {file} has no "
                    "such joint"
                )
                names.remove(name)
        if merging:
            self._merge_spherical(set(names))
        found.actuators = tuple(names)
        loops = self.node.data.get("closed_loop") or []
        kinds = self._texts("type") or ["6d"] * (len(loops) if isinstance(loops, list) else 0)
        if not isinstance(loops, list) or len(kinds) != len(loops):
            raise self._refusal(
                ("closed_loop",), "is not a list of pairs of frames with one type each"
            )
        for index, (pair, kind) in enumerate(zip(loops, kinds, strict=True)):
            found.closures.append(self._closure(index, pair, kind))

    def _closure(self, index: int, pair: Any, kind: str) -> Closure:
        where = ("closed_loop", str(index))
        if (
            not isinstance(pair, list)
            or len(pair) != 2
            or not all(isinstance(name, str) for name in pair)
        ):
            raise self._refusal(where, "is not a pair of frames; give two names of links or joints")
        if kind.lower() not in ("6d", "3d"):
            raise self._refusal(("type", str(index)), f"{xml.shortened(kind)} is not one of 6d, 3d")
        joint = FixedJoint if kind.lower() == "6d" else SphericalJoint
        return Closure(
            self.model.names.give(f"loop_{index + 1}"),
            joint,
            (self._frame(pair[0], where), self._frame(pair[1], where)),
        )

    def _frame(self, name: str, where: tuple[str, ...]) -> str:
        """Return the link of that name, or the link that the joint of that name carries."""
        if name in self.model.links:
            return name
        if name in self.model.joints:
            return self.model.joints[name].child
        raise self._refusal(
            where, f"there is no link or joint {xml.shortened(name)} in {self.model.root.file.name}"
        )

    def _change_types(self) -> None:
        names, kinds = self._texts("joint_name"), self._texts("joint_type")
        if len(names) != len(kinds):
            raise self._refusal(
                ("joint_type",),
                f"holds {len(kinds)} types for the {len(names)} joints of joint_name",
            )
        for index, (name, kind) in enumerate(zip(names, kinds, strict=True)):
            if name not in self.model.joints:
                file = self.model.root.file.name
                self.notes.say(
                    f"{self.path.name}: the type of {xml.shortened(name)} is left out: {file} "
                    "has no such joint"
                )
                continue
            joint, axes = self.model.joints[name], UNIVERSAL.fullmatch(kind)
            if axes and axes[1] != axes[2]:
                changed = replace(joint, type="universal", axes=(axes[1].lower(), axes[2].lower()))
            elif kind in ("SPHERICAL", "FIXED"):
                changed = replace(joint, type=kind.lower())
            else:
                raise self._refusal(
                    ("joint_type", str(index)),
                    f"{xml.shortened(kind)} is not SPHERICAL, FIXED or UJOINT_XY etc.",
                )
            self.model.put(changed)

    def _merge_spherical(self, driven: set[str]) -> None:
        """Make one spherical joint of three hinges through one point that carry each other by
        massless links."""
        light = LIGHT * sum(map(weight, self.model.links.values()))
        for last in list(self.model.joints.values()):
            trio = None if self.model.closes(last) else self._trio(last, driven, light)
            if trio is None:
                continue
            first, second, _ = trio
            X, lost = first.origin @ second.origin @ last.origin, self._lost(first, second, last)
            self.model.merge(
                replace(last, type="spherical", parent=first.parent, origin=X), [first, second]
            )
            file = self.model.root.file.name
            self.notes.say(
                f"{file}: {first.name}, {second.name} and {last.name} are one spherical joint, "
                f"{last.name!r}{lost}",
                alters=bool(lost),
            )

    def _lost(self, *trio: UrdfJoint) -> str:
        """Say what a spherical joint in the place of three hinges leaves out: their distance, and
        their links' mass."""
        apart = sum(float(np.linalg.norm(joint.origin[:3, 3])) for joint in trio[1:])
        mass = sum(weight(self.model.links[joint.parent]) for joint in trio[1:])
        if apart <= poses.TINY and not mass:
            return ""
        return (
            f"; the distances of {apart:.2g} m and the mass of {mass:.2g} kg between them are "
            "left out (merging=False, --no-merging keeps them)"
        )

    def _trio(
        self, last: UrdfJoint, driven: set[str], light: float
    ) -> tuple[UrdfJoint, UrdfJoint, UrdfJoint] | None:
        model, trio = self.model, [last]
        while len(trio) < 3:
            link = trio[0].parent
            alone = link in model.carriers and len(model.carried[link]) == 1
            if not alone or weight(model.links[link]) > light:
                return None
            trio.insert(0, model.carriers[link])
        hinges = all(
            joint.type in ("revolute", "continuous") and joint.name in model.joints
            for joint in trio
        )
        if (
            not hinges
            or driven & {joint.name for joint in trio}
            or any(j.element.first("mimic") for j in trio)
        ):
            return None
        X, points, axes = np.eye(4), [], []
        for joint in trio:
            X = X @ joint.origin
            points.append(X[:3, 3])
            axes.append(X[:3, :3] @ joint.axis)
        together = all(np.linalg.norm(p - points[0]) < NEAR * model.size for p in points)
        apart = all(np.linalg.norm(np.cross(a, b)) > 1e-6 for a, b in combinations(axes, 2))
        return (trio[0], trio[1], trio[2]) if together and apart else None

    def _texts(self, key: str) -> list[str]:
        items = self.node.data.get(key) or []
        if not isinstance(items, list) or not all(isinstance(item, str) for item in items):
            raise self._refusal((key,), "is not a list of names")
        return items

    def _refusal(self, where: tuple[str, ...], what: str) -> MechanismError:
        return MechanismError(what, where, f"{self.path}: line {self.node.line_of(where)}")
