"""A mechanism written as MJCF, the model format of MuJoCo.

Names survive: a joint of several freedoms becomes hinges and slides named "joint.freedom". qpos0 is
the home configuration, where the loops are closed, and hinges and slides have the mechanism's own
coordinates (`ref`).

MuJoCo's equality constraints are soft: at a closed state the accelerations differ from those of
rigid loops by about (1 - d)/d of what the constraint forces do, with the impedance d = 0.9999, the
greatest that MuJoCo takes.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.body_elements import check, write_body
from linkwork.formats.mjcf.differences import tell_differences
from linkwork.formats.mjcf.fluid_elements import write_fluid
from linkwork.formats.mjcf.geoms import BETWEEN
from linkwork.formats.mjcf.laws import numbers
from linkwork.formats.mjcf.line_elements import write_actuator, write_cables, write_combinations
from linkwork.formats.mjcf.model_plan import Home, ModelPlan, plan
from linkwork.formats.mjcf.sheet import Sheet
from linkwork.formats.mjcf.tie_elements import write_gears, write_screws, write_springs, write_tie
from linkwork.formats.notes import Notes
from linkwork.formats.tools_told import tell_tools
from linkwork.mechanism import GROUND, Mechanism
from linkwork.mechanism.files import write_whole

STIFF = {"solref": "0.02 1", "solimp": "0.9999 0.9999 0.001 0.5 2"}
OPTION = {
    "timestep": "0.001",
    "integrator": "RK4",
    "solver": "Newton",
    "tolerance": "1e-12",
    "iterations": "100",
}


def write_mjcf(mechanism: Mechanism, path: Path) -> tuple[str, ...]:
    """Write a mechanism as an MJCF file with its loops closed; return notes on what MuJoCo takes
    otherwise.

    Raises:
        MechanismError: MJCF cannot hold the mechanism, its loops cannot be closed, or the file
            cannot be written.
    """
    text, notes = to_mjcf(mechanism, home_of(mechanism), folder=path.absolute().parent)
    write_whole(path, text)
    return notes


def home_of(mechanism: Mechanism) -> Home:
    """Close the loops of a mechanism from its reference."""
    from linkwork.equations import derive, functions
    from linkwork.kernels import compile_function

    equations = derive(mechanism)
    q, still, p = equations.reference, np.zeros(equations.mobility), np.zeros(0)
    (positions,) = compile_function(functions.positions(equations))(q, p)
    origins, orientations, *_ = compile_function(functions.bodies_motion(equations))(q, still, p)
    places = zip(
        mechanism.bodies, origins.reshape(-1, 3), orientations.reshape(-1, 3, 3), strict=True
    )
    placed = {body: poses.pose(origin, R) for body, origin, R in places}
    return Home(
        {GROUND: np.eye(4), **placed},
        dict(zip(mechanism.coordinates, map(float, positions), strict=True)),
    )


def to_mjcf(
    mechanism: Mechanism,
    home: Home,
    held: ModelPlan | None = None,
    folder: Path | None = None,
) -> tuple[str, tuple[str, ...]]:
    """Return the text of an MJCF file and notes.

    Args:
        home: a configuration in which the loops are closed.
        held: how the file is to hold the mechanism, as `model_plan` says it from this home.
        folder: of the file; meshes are named relative to it, and left out without one.
    """
    notes = Notes()
    sheet = Sheet(mechanism, home, held or plan(mechanism, home), notes, folder)
    return text_of(sheet), notes.sentences()


def text_of(sheet: Sheet) -> str:
    """Write all elements, and return the text of the file."""
    # What is the same for all mechanisms.
    root, mechanism = sheet.root, sheet.mechanism
    ET.SubElement(root, "compiler", angle="radian", inertiafromgeom="false")
    ET.SubElement(root, "option", attrib={"gravity": numbers(mechanism.gravity)} | OPTION)
    default = ET.SubElement(root, "default")
    ET.SubElement(default, "equality", attrib=STIFF)
    ET.SubElement(default, "geom", contype="0", conaffinity="0", group="1")
    between = ET.SubElement(default, "default", attrib={"class": BETWEEN})
    ET.SubElement(between, "geom", rgba="0.4 0.5 0.6 1")
    root.append(sheet.sections["asset"])
    # Bodies with their shapes and joints, then what refers to them.
    sheet.elements[GROUND] = ET.SubElement(root, "worldbody")
    check(sheet)
    for seat in sheet.plan.seats.values():
        write_body(sheet, seat)
    tell_tools(mechanism, sheet.notes)
    for name, tool in mechanism.tools.items():
        sheet.site(name, tool.body, sheet.home.poses[tool.body] @ poses.of_frame(tool.frame))
    for tie in sheet.plan.ties:
        write_tie(sheet, tie)
    write_springs(sheet)
    write_screws(sheet)
    write_gears(sheet)
    write_combinations(sheet)
    write_cables(sheet)
    for name in mechanism.actuators:
        write_actuator(sheet, name)
    write_fluid(sheet)
    write_key(sheet)
    tell_differences(sheet)
    # Sections with anything in them, assets before the bodies.
    if not len(sheet.sections["asset"]):
        root.remove(sheet.sections["asset"])
    behind = [section for name, section in sheet.sections.items() if name != "asset"]
    root.extend(section for section in behind if len(section))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def write_key(sheet: Sheet) -> None:
    """Write qpos at home; it is also where MuJoCo starts."""
    qpos: list[float] = []
    for seat in sheet.plan.seats.values():
        for move in seat.moves:
            X = sheet.home.poses[seat.body]
            match move.kind:
                case "free":
                    qpos += [*X[:3, 3], *poses.to_quaternion(X[:3, :3])]
                case "ball":
                    qpos += [1, 0, 0, 0]
                case _:
                    qpos.append(move.ref)
    sheet.add("keyframe", "key", name="home", qpos=numbers(qpos))
