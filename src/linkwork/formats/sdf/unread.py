"""What links and joints of SDF say again, of which the first counts, and what their inertials and
axes say that SDF does not have."""

from __future__ import annotations

from linkwork.formats.notes import Notes
from linkwork.formats.versions import tell_repeats
from linkwork.formats.xml import Element

AXIS = ("xyz", "dynamics", "limit", "mimic", "use_parent_model_frame")
ONCE = {
    "link": ("pose", "inertial", "gravity", "kinematic"),
    "inertial": ("pose", "mass", "inertia", "density"),
    "joint": ("pose", "parent", "child", "axis", "axis2"),
    "axis": AXIS,
    "axis2": AXIS,
}
"""Elements of which one is read, by what they stand in."""
KNOWN = {
    "joint": (
        *("pose", "parent", "child", "axis", "axis2", "physics", "sensor", "plugin"),
        *("gearbox_ratio", "gearbox_reference_body", "thread_pitch", "screw_thread_pitch"),
    ),
    "inertial": ("pose", "mass", "inertia", "density", "fluid_added_mass"),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "axis": (*AXIS, "initial_position"),
    "axis2": (*AXIS, "initial_position"),
    "dynamics": ("damping", "friction", "spring_stiffness", "spring_reference"),
}
"""Elements that these may hold; those of others by their prefix ("drake:...") are no matter."""
BEGINS = "is left out: joints begin where the poses of their links put them"
SEEN = "says relative_to, which is left out: an inertial is placed in its link"


def tell_unread(element: Element, notes: Notes) -> None:
    """Note what an element and those in it say again, and what is left out of them."""
    tell_repeats(element, ONCE.get(element.tag, ()), notes, alters=True)
    for child in element.children:
        known = KNOWN.get(element.tag, (child.tag,))
        if child.tag not in known and ":" not in child.tag:
            notes.on(child, f"in a <{element.tag}> is left out: it is not known here", alters=True)
        if (element.tag, child.tag) == ("inertial", "pose") and child.attributes.get("relative_to"):
            notes.on(child, SEEN, alters=True)
        if child.tag == "initial_position" and child.content.strip("+-0. "):
            notes.on(child, BEGINS)
        if child.tag in (*ONCE, *KNOWN):
            tell_unread(child, notes)
