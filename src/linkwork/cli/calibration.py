"""What `linkwork analyse ROBOT calibrate` does: numbers of a description from a table of measured
poses, by `linkwork.analysis`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linkwork import analysis
from linkwork.analysis._observability import told as summed
from linkwork.analysis.calibration import Calibration
from linkwork.checks import at
from linkwork.cli import studies
from linkwork.cli.catalogue import refuse_unwritable
from linkwork.cli.entries import names, read_table
from linkwork.cli.source import Source
from linkwork.cli.terminal import console, facts, patience, show_json, table
from linkwork.errors import LinkworkError
from linkwork.mechanism.parameter_units import unit_of_parameter
from linkwork.model.labels import POSES
from linkwork.robot import Robot, State

SUFFIXES = (".yaml", ".yml")


@dataclass(frozen=True)
class MeasuredTable:
    """Say which table holds what was measured, how well, and what is to be found of it.

    position, rotation, encoders: standard deviations; out: where the description with the values
    that are found is written
    """

    poses: Path
    free: str
    position: float | None
    rotation: float | None
    encoders: float | None
    out: Path | None
    overwrite: bool

    def check(self) -> None:
        """Refuse what cannot be written, before anything is computed."""
        if self.out is None:
            return
        if self.out.suffix.lower() not in SUFFIXES:
            raise LinkworkError(
                f"--out {self.out}: give a name that ends in {' or '.join(SUFFIXES)}"
            )
        refuse_unwritable("--out", self.out, self.overwrite)


def calibrate(
    source: Source, joints: str | None, tool: str | None, asked: MeasuredTable, as_json: bool
) -> None:
    """Print the numbers that measured poses tell, and write the description that holds them."""
    # The robot, and where the description stands at the readings.
    asked.check()
    robot = studies.made(source).free(*(names(asked.free) or ()))
    near = studies.configuration(robot, joints, tool)
    measured = measured_poses(robot, asked, near)
    found = analysis.calibrate(robot, measured)
    if asked.out is not None:
        found.mechanism.save(asked.out)
    if as_json:
        show_json(told(found) | {"written": [] if asked.out is None else [asked.out]})
        return
    # Each number beside what was described, what was not seen, and how well all of it fits.
    units = [unit_of_parameter(robot.mechanism, path) for path in found.values]
    lines = zip(found.values.values(), found.deviations, found.described, units, strict=True)
    rows = [
        (f"{value:.8g}", f"{own:.2g}", f"{before:.8g}", unit, path)
        for (value, own, before, unit), path in zip(lines, found.values, strict=True)
    ]
    out = console()
    out.print(table(("found", "+-", "described", "unit", "number"), rows, numbers=(0, 1, 2)))
    out.print()
    fits = f"{found.chi_square:.4g} of {found.freedoms} degrees of freedom"
    noise = ", ".join(f"{size:.2g} ({kind})" for kind, size in found.noise.items())
    rest = [] if found.weighed else [("noise", noise)]
    rest += [("not seen", summed(each)) for each in found.unseen]
    out.print(facts([("chi-square" if found.weighed else "remains", fits), *rest]))
    if asked.out is not None:
        out.print(f"{asked.out} written", soft_wrap=True)


def measured_poses(robot: Robot, asked: MeasuredTable, near: State) -> analysis.MeasuredPoses:
    """Return what the table holds; refuse columns that make no poses, and readings at which the
    description has none, by their lines."""
    wanted = POSES[robot.planar] if robot.mechanism.tools else ()
    others = [name for name in robot.coordinates if name not in robot.actuators]
    lines, columns = read_table(asked.poses, robot.actuators, (*wanted, *others))
    pose = [name for name in wanted if name in columns]
    if pose and pose not in ([*wanted], [*wanted[:3]]):
        raise LinkworkError(
            f"{asked.poses} has {', '.join(pose)} of the tool's pose; give {', '.join(wanted)}"
            + ("" if robot.planar else ", or x, y, z alone")
        )
    if not lines:
        raise LinkworkError(
            f"{asked.poses} holds no rows below its names; give one for each sample"
        )
    positions = []
    with patience("closing the loops"):
        for k, line in enumerate(lines):
            readings = {name: float(columns[name][k]) for name in robot.actuators}
            with at(f"{asked.poses}, line {line}: "):
                positions.append(robot.assemble(readings, guess=near).positions)
    return analysis.MeasuredPoses(
        robot.state(np.array(positions).reshape(len(lines), -1)),
        np.column_stack([columns[name] for name in pose]) if pose else None,
        {name: columns[name] for name in others if name in columns},
        asked.position,
        asked.rotation,
        asked.encoders,
    )


def told(found: Calibration) -> dict[str, Any]:
    """Return what was found, by name."""
    deviations = dict(zip(found.values, found.deviations.tolist(), strict=True))
    described = dict(zip(found.values, found.described.tolist(), strict=True))
    return {
        "values": found.values,
        "deviations": deviations,
        "described": described,
        "unseen": list(found.unseen),
        "chi_square": found.chi_square,
        "freedoms": found.freedoms,
        "weighed": found.weighed,
        "noise": found.noise,
    }
