"""Loops of a URDF that is written, in a file beside it, as LAAS's example-parallel-robots have
them:

    closed_loop: [[closedloop1_A, closedloop1_B], ...]   type: [6d | 3d, ...]   name_mot: [...]

The frames are links without mass. Of a spherical joint 3d holds their origins together. Any other
joint that closes a loop is a joint of the file's tree, which carries the first frame, and 6d holds
the two frames together: so it keeps its coordinate, its friction and its motor.

Source: https://github.com/Gepetto/example-parallel-robots.
"""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree as ET

from linkwork.equations.joints import held_length, pattern
from linkwork.formats import poses, xml
from linkwork.formats.urdf.sheet import (
    UrdfSheet,
    add_joint,
    free_name,
    steps_of,
    tell_unheld,
    write_steps,
)
from linkwork.formats.urdf.sidecars import LAAS
from linkwork.mechanism import MechanismError, PairJoint

BALL = ("ball",)


def write_closing(sheet: UrdfSheet, name: str, joint: PairJoint) -> None:
    """Write the two frames that a joint that closes a loop holds together, and its motion."""
    kind = pattern(joint)
    if held_length(joint) is not None or ("ball" in kind and kind != BALL):
        raise sheet.refusal(
            f"joint {name!r}, a {joint.type} joint, closes a loop, which neither two frames nor "
            "two points hold",
            "write .xml (MJCF) or .yaml",
        )
    near, far = (
        poses.inverse(sheet.carriers[body]) @ poses.of_frame(frame)
        for body, frame in zip(joint.connects, joint.frames, strict=True)
    )
    count = len(sheet.closings) + 1
    A, B = (free_name(sheet, f"closedloop{count}_{side}") for side in "AB")
    first, second = joint.connects
    for link in (A, B):
        ET.SubElement(sheet.root, "link", name=link)
    # The first frame moves as the joint does, but for what a point leaves free.
    if kind in ((), BALL):
        add_joint(sheet, free_name(sheet, f"{A} frame"), "fixed", first, A, near)
        tell_unheld(sheet, name, joint)
    else:
        write_steps(sheet, name, steps_of(joint, name, True), (first, A), near)
    add_joint(sheet, free_name(sheet, f"{B} frame"), "fixed", second, B, far)
    sheet.closings.append(((A, B), "3d" if kind == BALL else "6d"))


def closings_text(sheet: UrdfSheet) -> str:
    """Return the file of loops."""
    frames, kinds = [list(pair) for pair, _ in sheet.closings], [kind for _, kind in sheet.closings]
    motors = [label.replace(".", "_") for label in sheet.mechanism.actuators]
    lines = {"closed_loop": frames, "type": kinds, "name_mot": motors}
    return "".join(f"{key}: {json.dumps(value)}\n" for key, value in lines.items())


def closings_place(path: Path) -> Path:
    """Return the file of loops beside a URDF.

    Raises:
        MechanismError: a file of that name that holds something else.
    """
    place = path.with_suffix(".yaml")
    if place.is_file() and not LAAS.search(xml.contents(place).decode("utf-8", "replace")):
        raise MechanismError(
            f"{place}: is there and holds no loops of a URDF, which would be written to it; give "
            "the URDF another name"
        )
    return place
