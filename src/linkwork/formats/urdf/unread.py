"""What links and joints of URDF say that nobody reads: attributes that URDF does not have, elements
that are given again, and quaternions in files of before they were.

Of elements that stand there more than once the first counts, as for urdfdom, by which ROS and
Pinocchio read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from linkwork.checks import suggestion
from linkwork.formats import drake
from linkwork.formats.notes import Notes
from linkwork.formats.versions import numbered, tell_repeats
from linkwork.formats.xml import Element

QUATERNION = "quat_xyzw"
OLDEST, QUATERNIONS = (1, 0), (1, 1)  # versions; from which on an <origin> may say one
ONCE = {
    "link": ("inertial",),
    "joint": ("origin", "parent", "child", "axis", "dynamics", "limit", "mimic"),
    "inertial": ("origin", "mass", "inertia"),
}
"""Elements of which one is read, by what they stand in."""
ATTRIBUTES = {
    "origin": ("xyz", "rpy", QUATERNION),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "dynamics": ("damping", "friction"),
    "mimic": ("joint", "multiplier", "offset"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
"""What these elements may say; most others are the words of some program, and move nothing."""
PLACING = ("origin", "axis")
BLANKS = (
    "has blanks behind numbers, at which urdfdom (ROS, Pinocchio) says that it cannot read on and "
    "leaves the rest at zero; all are read here"
)


def tell_unread(root: Element, notes: Notes) -> None:
    """Note what the links and joints of a document say that is not read."""
    for element in _telling(root):
        kind = "joint" if element.tag == drake.JOINT else element.tag
        tell_repeats(element, ONCE[kind], notes)
        for part in element.children:
            blank = any(said != said.rstrip() for said in part.attributes.values())
            if part.tag == "inertia" and blank:
                notes.on(part, BLANKS)
            known = ATTRIBUTES.get(part.tag, tuple(part.attributes))
            missing = [name for name in known if name not in part.attributes]
            for name in part.attributes.keys() - {*known}:
                # It may be what it is nearly called, and is not said; or place something.
                alters = part.tag in PLACING or bool(suggestion(name, missing))
                notes.on(part, f"says {name}, which is left out: URDF has none", alters=alters)


def _telling(root: Element) -> Iterator[Element]:
    """Yield the joints and links, and what links say of their mass."""
    yield from root.each("joint", drake.JOINT)
    for link in root.each("link"):
        yield link
        yield from link.each("inertial")


def of_its_version(root: Element, notes: Notes) -> Element:
    """Return a document without the quaternions that its version does not have, as urdfdom takes
    it; they are noted."""
    if (numbered(root.attributes.get("version", "")) or OLDEST) >= QUATERNIONS:
        return root

    def without(element: Element) -> Element:
        attributes = element.attributes
        if element.tag == "origin" and QUATERNION in attributes:
            remark = f"says {QUATERNION}, which counts from version 1.1 of URDF on; it is left out"
            notes.on(element, remark, alters=True)
            attributes = {key: said for key, said in attributes.items() if key != QUATERNION}
        return replace(element, attributes=attributes, children=[*map(without, element.children)])

    return without(root) if any(QUATERNION in each.attributes for each in _all(root)) else root


def _all(element: Element) -> Iterator[Element]:
    yield element
    for child in element.children:
        yield from _all(child)
