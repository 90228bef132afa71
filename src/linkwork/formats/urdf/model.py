"""A URDF file as it is: links, and the tree of joints between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import inf

import numpy as np

from linkwork.formats import drake, poses, xml
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.urdf.unread import QUATERNION
from linkwork.formats.xml import Element
from linkwork.mechanism import GROUND

CLOSES = "it closes a loop here; readers of trees refuse such a file, or take one of both joints"
TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical")
ONE_FREEDOM = ("revolute", "continuous", "prismatic", "screw")
DRAKE = {"ball": "spherical", "universal": "universal", "planar": "planar", "screw": "screw"}
WORLD = "world"  # Drake's name of ground, which need not be a link
NO_LIMIT = 1e9  # what bounds a slide that nothing bounds; URDF wants a limit [m]
FRAME_MASS = 1e-6  # links lighter than this that are fixed and carry nothing are frames [kg]


@dataclass(frozen=True)
class UrdfJoint:
    """Hold a joint as the file gives it: its type, links, X_parent_joint and unit axis; a file
    beside may change the type."""

    element: Element
    name: str
    type: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    axes: tuple[str, str] = ("x", "y")  # of a universal joint


@dataclass
class UrdfModel:
    """Hold a tree of links.

    Attributes:
        links: the elements by name, parents before children.
        joints: by name.
        base: the root link.
        carriers: the joint that carries a link, by link.
        carried: the links that a link carries, by link.
        frames: the links that are frames of others: the body that they are fixed to, and
            X_body_link.
        bodies, labels: what the links and the joints are called here.
        names: gives names to joints.
    """

    root: Element
    names: FreeNames
    links: dict[str, Element] = field(default_factory=dict)
    joints: dict[str, UrdfJoint] = field(default_factory=dict)
    base: str = ""
    carriers: dict[str, UrdfJoint] = field(default_factory=dict)
    carried: dict[str, list[str]] = field(default_factory=dict)
    frames: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    bodies: dict[str, str] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)

    @property
    def size(self) -> float:
        """Return the greatest distance between two joints of a link [m]; 1 where there is none."""
        return (
            max(
                (float(np.linalg.norm(joint.origin[:3, 3])) for joint in self.joints.values()),
                default=0.0,
            )
            or 1.0
        )

    def chain(self, link: str) -> list[UrdfJoint]:
        """Return the joints from a link up to the base."""
        chain = []
        while link != self.base:
            chain.append(self.carriers[link])
            link = self.carriers[link].parent
        return chain

    def seat(self, link: str) -> tuple[str, np.ndarray]:
        """Return the body that a link is, or is fixed to, and the link's pose in it."""
        return self.frames.get(link, (self.bodies[link], np.eye(4)))

    def at_zero(self, link: str) -> np.ndarray:
        """Return the pose of a link in the root link where all joints are at zero."""
        X = np.eye(4)
        for joint in self.chain(link):
            X = joint.origin @ X
        return X

    def put(self, joint: UrdfJoint) -> None:
        """Take a joint in the place of the one of its name; a second one that carries a link closes
        a loop."""
        self.joints[joint.name] = joint
        if self.carriers.get(joint.child, joint).name == joint.name:
            self.carriers[joint.child] = joint

    def closes(self, joint: UrdfJoint) -> bool:
        """Tell whether a joint carries a link that another one carries."""
        return self.carriers[joint.child].name != joint.name

    def merge(self, joint: UrdfJoint, between: list[UrdfJoint]) -> None:
        """Take one joint in the place of a chain; `between` are the joints before it, whose links
        vanish."""
        for old in between:
            del self.joints[old.name], self.carriers[old.child], self.links[old.child]
        self.carried[joint.parent] = [
            joint.child if link == between[0].child else link for link in self.carried[joint.parent]
        ]
        self.put(joint)

    def find_frames(self) -> None:
        """Find the links that are frames of others: light, fixed, and carrying only such links
        themselves."""
        found: set[str] = set()
        for link in reversed(self.links):
            fixed = link != self.base and self.carriers[link].type == "fixed"
            if (
                fixed
                and weight(self.links[link]) <= FRAME_MASS
                and found.issuperset(self.carried.get(link, []))
            ):
                found.add(link)
        for link in self.links:
            if link in found:
                body, X = self.seat(self.carriers[link].parent)
                self.frames[link] = body, X @ self.carriers[link].origin


def read_model(root: Element, notes: Notes, moving: bool = False) -> UrdfModel:
    """Read the links and joints of a document whose root is <robot>; what is no tree is refused.

    moving: whether the root link is a body of its own rather than ground, unless a floating joint
        carries all else
    """
    model, links = UrdfModel(root, FreeNames(notes)), _named_links(root)
    _put_joints(model, links, notes)
    _follow_tree(model, links)
    # Names of bodies and joints here; the root link is ground, or a body.
    carried = [model.carriers[name].type for name in model.carried.get(model.base, [])]
    ground = () if moving and carried != ["floating"] else (model.base,)
    body_names = FreeNames(notes, (GROUND,))
    model.bodies = {
        name: GROUND if name in ground else body_names.give(name, link)
        for name, link in model.links.items()
    }
    model.labels = {
        name: model.names.give(name, joint.element) for name, joint in model.joints.items()
    }
    return model


def _named_links(root: Element) -> dict[str, Element]:
    """Return the links of a document by name, and the world where joints name it."""
    links: dict[str, Element] = {}
    for link in root.each("link"):
        name = link.text("name")
        if name in links:
            raise link.refusal("has the name of another link; names are given once")
        links[name] = link
    joints = root.each("joint", drake.JOINT)
    carrying = (inner for each in joints for inner in each.each("parent"))
    if WORLD not in links and any(inner.attributes.get("link") == WORLD for inner in carrying):
        links[WORLD] = replace(root, tag="link", attributes={"name": WORLD}, children=[])
    return links


def _put_joints(model: UrdfModel, links: dict[str, Element], notes: Notes) -> None:
    """Put the joints into a model, of which each link is carried by one; others close loops."""
    for element in model.root.each("joint", drake.JOINT):
        joint = _read_joint(element, links, notes)
        if joint.name in model.joints:
            raise element.refusal("has the name of another joint; names are given once")
        model.put(joint)
        if model.closes(joint):
            other = xml.shortened(model.carriers[joint.child].name)
            notes.on(element, f"carries {xml.shortened(joint.child)}, as {other} does: {CLOSES}")
        else:
            model.carried.setdefault(joint.parent, []).append(joint.child)


def _follow_tree(model: UrdfModel, links: dict[str, Element]) -> None:
    """Find a model's one root, and put the links in the order of the tree, which reaches all."""
    roots = [name for name in links if name not in model.carriers]
    if not links:
        raise model.root.refusal("holds no links")
    if len(roots) != 1:
        found = (
            f"the links {', '.join(map(repr, roots[:4]))} are carried by no joint"
            if roots
            else "every link is carried"
        )
        raise model.root.refusal(f"{found}; exactly one link is the root")
    model.base = roots[0]
    waiting = [model.base]
    while waiting:
        model.links[link] = links[link := waiting.pop()]
        waiting += model.carried.get(link, [])[::-1]
    lost = next((name for name in links if name not in model.links), None)
    if lost:
        raise links[lost].refusal(
            "hangs in a circle of joints that does not reach the root link; URDF is a tree"
        )


def _read_joint(element: Element, links: dict[str, Element], notes: Notes) -> UrdfJoint:
    kinds: dict[str, str] = (
        DRAKE if element.tag == drake.JOINT else dict(zip(TYPES, TYPES, strict=True))
    )
    kind = kinds[element.choice("type", tuple(kinds), "")]
    ends = [element.named(end).text("link") for end in ("parent", "child")]
    for link in ends:
        if link not in links:
            raise element.refusal(f"there is no link {link!r}")
    if ends[0] == ends[1]:
        raise element.refusal(f"connects {ends[0]!r} to itself")
    if _stands_still(element):
        notes.on(element, "is fixed: its axis has no length, and its limits leave it no motion")
        kind = "fixed"
    axis = np.zeros(3) if kind in ("fixed", "floating", "spherical") else axis_of(element)
    return UrdfJoint(element, element.text("name"), kind, ends[0], ends[1], origin(element), axis)


def _stands_still(element: Element) -> bool:
    """Tell whether a joint has an axis without length, and limits that are one number."""
    axis, limit = element.first("axis"), element.first("limit")
    if not (axis and limit and {"lower", "upper"} <= limit.attributes.keys()):
        return False
    ends = {limit.number(name, most=inf) for name in ("lower", "upper")}
    return not any(axis.vector("xyz", (1.0, 0.0, 0.0))) and len(ends) == 1


def origin(element: Element, tag: str = "origin") -> np.ndarray:
    """Return the pose that <origin xyz rpy>, or <origin xyz quat_xyzw>, inside an element gives."""
    inner = element.first(tag)
    return np.eye(4) if inner is None else placed(inner)


def placed(inner: Element) -> np.ndarray:
    """Return the pose that the attributes of an element give."""
    zero = (0.0, 0.0, 0.0)
    place, given = inner.vector("xyz", zero), QUATERNION in inner.attributes
    if not given:
        return poses.pose(place, poses.from_rpy(*inner.vector("rpy", zero)))
    if "rpy" in inner.attributes:
        raise inner.refusal(f"gives its orientation as rpy and {QUATERNION}; keep one of them")
    *axis, w = inner.numbers(QUATERNION, (4,))
    if np.hypot(w, np.linalg.norm(axis)) < 1e-12:
        raise inner.refusal(f"{QUATERNION} has no length; give a direction")
    return poses.pose(place, poses.from_quaternion(w, *axis))


def axis_of(element: Element, tag: str = "axis") -> np.ndarray:
    """Return the unit <axis xyz> inside an element."""
    inner = element.first(tag)
    axis = np.array(inner.vector("xyz", (1.0, 0.0, 0.0)) if inner else (1.0, 0.0, 0.0))
    if np.linalg.norm(axis) < 1e-12:
        raise (inner or element).refusal("axis has no length; give a direction such as '0 0 1'")
    return poses.unit(axis)


def weight(link: Element) -> float:
    """Return the mass of a link [kg]."""
    inertial = link.first("inertial")
    mass = inertial and inertial.first("mass")
    return mass.number("value") if mass else 0.0
