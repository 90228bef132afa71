"""A path from the command line: the motion of all joints along it, and the forces that it takes."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linkwork.checks import amount, writing
from linkwork.cli.catalogue import built, refuse_unwritable
from linkwork.cli.goal_words import along, tabled
from linkwork.cli.source import Source
from linkwork.cli.start import StartOptions
from linkwork.cli.terminal import console, facts, patience, show_json, table, tidy
from linkwork.errors import LinkworkError
from linkwork.model.limits import passed
from linkwork.motions import write_csv
from linkwork.robot import Motion, Robot
from linkwork.simulation import Sampled

FEW = 12  # joint coordinates that are all printed; of more those of the actuated joints
SUFFIX = ".csv"
FORCES = {"m": "N", "rad": "N m"}  # units by that of what they move
HEADS = {"rate": "rate [/s]", "acceleration": "acceleration [/s²]", "power": "power [W]"}


@dataclass(frozen=True)
class Files:
    """Say where the motion, and the forces alone, are written, if anywhere."""

    motion: Path | None
    forces: Path | None
    overwrite: bool

    def check(self) -> None:
        """Refuse what cannot be written before anything is computed."""
        for option, file in (("--out", self.motion), ("--forces-out", self.forces)):
            if file is None:
                continue
            if file.suffix.lower() != SUFFIX:
                raise LinkworkError(f"{option} {file}: a table is written as {SUFFIX}")
            refuse_unwritable(option, file, self.overwrite)
        if self.motion and self.forces and self.motion.resolve() == self.forces.resolve():
            raise LinkworkError(f"--out and --forces-out are both {self.motion}; name two files")

    def write(self, robot: Robot, motion: Motion, forces: Sampled | None) -> list[Path]:
        """Write what is asked for, and return the files."""
        written = []
        if self.motion is not None:
            written.append(write_csv(self.motion, motion, robot, forces=forces))
        if self.forces is not None:
            assert forces is not None
            with writing(self.forces), self.forces.open("w", newline="", encoding="utf-8") as file:
                rows = csv.writer(file)
                rows.writerow(["time", *robot.actuators])
                rows.writerows(np.column_stack([forces.times, forces.values]).tolist())
            written.append(self.forces)
        return written


def follow(
    source: Source,
    path: str,
    duration: float | None,
    samples: int,
    start: StartOptions,
    what: tuple[str, ...] | None,
    files: Files,
    as_json: bool,
) -> None:
    """Lead the tool along a path; print how far and how fast joints go and what they need."""
    # The motion, and the forces that it takes where the actuators can give them.
    files.check()
    if samples < 2:
        raise LinkworkError(f"--samples {samples}: give at least 2")
    if tabled(path) and not Path(path).exists():
        raise LinkworkError(f"--path {path} cannot be read as a table: no such file")
    if tabled(path) and duration is not None:
        raise LinkworkError(f"--path {path} has times of its own; leave --duration out")
    with patience("deriving the equations of motion"):
        robot = built(source)
    with patience("following the path"):
        motion = along(robot, path, "--path", duration, samples, start.state(robot), what)
        forces, reason = needed(robot, motion, files.forces is not None)
    written = files.write(robot, motion, forces)
    beyond = passed(robot, motion.positions, motion.joint_rates, motion.time)
    # What it comes to, as plain data or as tables.
    data = extremes(robot, motion, forces)
    if as_json:
        whole = {"duration": motion.time[-1], "samples": len(motion.time)}
        told = {"limits_passed": beyond, "without_forces": reason or None, "written": written}
        show_json(whole | data | told)
        return
    # Facts, then a table of extremes for each kind of quantity.
    out = console()
    rows = [
        ("motion", f"{motion.time[-1]:.6g} s, {amount(len(motion.time), 'sample')}"),
        ("limits passed", "; ".join(beyond) or "none"),
    ]
    out.print(facts(rows + [("forces", reason)] * bool(reason)))
    few = len(robot.coordinates) <= FEW
    for title, found in data.items():
        names = [name for name in found if few or name in robot.actuators or title != "joints"]
        if names:
            header = [title, "unit", *(HEADS.get(head, head) for head in found[names[0]])]
            values = np.array([[*found[name].values()] for name in names])
            shown = tidy(values, np.abs(values).max(axis=0))
            units = [robot.labels.unit(name) for name in names]
            if title == "actuators":
                units = [FORCES[unit] for unit in units]
            lines = [
                (name, unit, *(f"{number:.6g}" for number in row))
                for name, unit, row in zip(names, units, shown, strict=True)
            ]
            out.print()
            out.print(table(header, lines, numbers=range(2, len(header))))
    out.print()
    for file in written:
        out.print(f"{file} written", soft_wrap=True)


def needed(robot: Robot, motion: Motion, asked: bool) -> tuple[Sampled | None, str]:
    """Return the forces of the actuators, or why there are none; a refusal where they are asked
    for."""
    try:
        return robot.inverse_dynamics(motion), ""
    except LinkworkError as error:
        if asked:
            raise
        return None, f"none: {error}"


def extremes(
    robot: Robot, motion: Motion, forces: Sampled | None
) -> dict[str, dict[str, dict[str, float]]]:
    """Return ranges of the joints' coordinates, their largest rates and accelerations, and forces
    and powers of the actuators [SI], by name."""
    joints = {}
    for k, label in enumerate(robot.coordinates):
        joints[label] = {"from": motion.positions[:, k].min(), "to": motion.positions[:, k].max()}
    rates = {}
    for k, label in enumerate(robot.rates):
        rates[label] = {
            "rate": np.abs(motion.joint_rates[:, k]).max(),
            "acceleration": np.abs(motion.joint_accelerations[:, k]).max(),
        }
    if set(rates) == set(joints):
        joints, rates = {label: joints[label] | rates[label] for label in joints}, {}
    found = {"joints": joints, "rates": rates}
    if forces is not None and robot.actuators:
        actuated = robot.actuation(motion.state) @ motion.state.rates[..., None]
        power = forces.values * actuated[..., 0]
        columns = zip(robot.actuators, forces.values.T, power.T, strict=True)
        found["actuators"] = {
            name: {"least force": u.min(), "largest force": u.max(), "power": np.abs(P).max()}
            for name, u, P in columns
        }
    return found
