"""What `linkwork analyse ROBOT dexterity` does: how well the actuators move the tool, by
`linkwork.analysis`."""

from __future__ import annotations

from linkwork import analysis
from linkwork.cli import studies
from linkwork.cli.entries import names
from linkwork.cli.poses import joints_told, pose_of, pose_told
from linkwork.cli.source import Source
from linkwork.cli.terminal import console, facts, patience, show_json, table
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State


def dexterity(
    source: Source, joints: str | None, tool: str | None, what: str | None, as_json: bool
) -> None:
    """Print how well the actuators move the tool in a configuration."""
    robot = studies.made(source)
    state = studies.configuration(robot, joints, tool)
    with patience("measuring the configuration"):
        told = analysis.dexterity(robot, state, what=names(what))
        indices, why = indices_of(robot, state)
    # What is told of each actuator.
    columns = {"transmissibility": told.transmissibility, "angle": told.transmission_angle}
    if indices is not None:
        columns |= {"input index": indices.input, "output index": indices.output}
    # As data, or as tables.
    if as_json:
        of = ("what", "length", "conditioning", "manipulability")
        by = {
            name: dict(zip(told.actuators, values, strict=True)) for name, values in columns.items()
        }
        found = {name: getattr(told, name) for name in of} | {"refused": why} | by
        local = {"local index": None if indices is None else indices.local}
        show_json(
            {"joints": joints_told(robot, state), "pose": pose_told(robot, state)} | found | local
        )
        return
    # Facts, then each actuator.
    rows = [
        ("configuration", pose_of(robot, state)),
        ("led in", ", ".join(told.what)),
        ("conditioning", f"{told.conditioning:.4g}  1 / cond, l = {told.length:.4g} m"),
        ("manipulability", f"{told.manipulability:.4g}  |det J|"),
    ]
    local = (
        f"none: {why}"
        if indices is None
        else f"{indices.local:.4g}  the least input or output index"
    )
    out = console()
    out.print(facts([*rows, ("local index", local)]))
    out.print()
    lines = [
        (name, *(f"{values[k]:.4g}" for values in columns.values()))
        for k, name in enumerate(told.actuators)
    ]
    heads = [f"{name} [rad]" if name == "angle" else name for name in columns]
    out.print(table(("", *heads), lines, numbers=range(1, len(columns) + 1)))


def indices_of(
    robot: Robot, state: State
) -> tuple[analysis.TransmissionIndices | None, str | None]:
    """Return the transmission indices, or why there are none."""
    try:
        return analysis.transmission_indices(robot, state), None
    except LinkworkError as refused:
        return None, str(refused)
