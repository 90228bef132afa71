"""A run from the command line: where it starts, what drives it, where it is written."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Literal

import numpy as np

from linkwork.cli.catalogue import built, refuse_existing
from linkwork.cli.entries import by_name, numbers, read_columns
from linkwork.cli.source import Source
from linkwork.cli.terminal import console, facts, patience
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.runs import running
from linkwork.runs.recording import passed_limits
from linkwork.runs.settings import Settings
from linkwork.simulation import Run, Sampled

FORMATS = (".nc", ".csv")
FEW = 12  # joint coordinates that are all printed; of more those of the actuated joints


@dataclass(frozen=True)
class StartOptions:
    """Say where a run starts: a tool pose, joint coordinates (the branch, where both are given),
    rates of joints."""

    tool: str | None
    joints: str | None
    rates: str | None

    def state(self, robot: Robot) -> State:
        """Return the state [m, rad, m/s, rad/s]; the robot's reference pose at rest where nothing
        is said."""
        state = robot.home
        if self.joints is not None:
            state = robot.assemble(by_name(self.joints, robot.coordinates, "--joints"))
        if self.tool is not None:
            state = robot.assemble(tool=numbers(self.tool, "--tool"), guess=state)
        if self.rates is not None:
            state = robot.state(state.positions, self.started(robot, self.rates))
        return state

    def started(self, robot: Robot, text: str) -> dict[str, float]:
        """Return rates by name: the independent ones, those left out at zero, or as many of other
        joints."""
        names = robot.rates if "=" in text else robot.independent
        rates = by_name(text, names, "--rates")
        rest = dict.fromkeys(robot.independent, 0.0)
        return rest | rates if set(rates) <= set(rest) else rates


@dataclass(frozen=True)
class Load:
    """Say what drives a run: constant forces, or a file of forces over time and how it is read
    between its times."""

    constant: str | None
    file: Path | None
    kind: Literal["spline", "linear", "hold"]

    def forces(self, robot: Robot) -> dict[str, float] | Sampled | None:
        """Return the actuator forces [N, N m]; none where nothing is said."""
        if self.constant is not None and self.file is not None:
            raise LinkworkError("--forces and --forces-csv are both given; keep one of them")
        if self.file is not None:
            times, values = read_columns(self.file, robot.actuators)
            return Sampled(times, values, self.kind)
        return (
            by_name(self.constant, robot.actuators, "--forces")
            if self.constant is not None
            else None
        )


@dataclass(frozen=True)
class Target:
    """Say where a run is written, if anywhere."""

    file: Path | None
    overwrite: bool

    def check(self) -> None:
        """Refuse what cannot be written before anything is computed."""
        if self.file is None:
            return
        if self.file.suffix.lower() not in FORMATS:
            raise LinkworkError(
                f"--out {self.file}: a run is written as {' or '.join(FORMATS)}, not "
                f"{self.file.suffix!r}"
            )
        if not self.file.parent.is_dir():
            raise LinkworkError(f"--out {self.file}: there is no folder '{self.file.parent}'")
        if self.file.is_dir():
            raise LinkworkError(f"--out {self.file}: is a folder; name a file in it")
        refuse_existing(self.file, self.overwrite)
        try:
            TemporaryFile(dir=self.file.parent).close()
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise LinkworkError(
                f"--out {self.file}: nothing can be written into '{self.file.parent}': {reason}"
            ) from None


def settings(duration: float, rtol: float, atol: float, samples: int, on_singular: str) -> Settings:
    """Return how a run is computed; refuse what makes none in the options' own names."""
    if not 0 < duration < np.inf:
        raise LinkworkError(f"--duration {duration:g}: give a positive, finite number of seconds")
    if samples < 2:
        raise LinkworkError(f"--samples {samples}: give at least 2")
    times = np.linspace(0, duration, samples)
    return Settings(duration=duration, rtol=rtol, atol=atol, save_at=times, on_singular=on_singular)


def simulate(
    source: Source, start: StartOptions, load: Load, how: Settings, target: Target
) -> bool:
    """Simulate, print how it went, write what was computed; return whether the run reached its
    end."""
    with patience("preparing the run"):
        robot = built(source)
        state, forces = start.state(robot), load.forces(robot)
    with patience("simulating"):
        run = running.simulate(robot, state, forces, how)
    print_ending(robot, run)
    if target.file is not None:
        run.save(target.file)
        console().print(f"{target.file} written", soft_wrap=True)
    return run.success


def print_ending(robot: Robot, run: Run) -> None:
    """Print how a run ended and where, in which charts it went, and which limits it passed."""
    statistics = run.statistics
    rows = [
        ("status", f"{run.status.name.lower()}: {run.message}"),
        ("steps", f"{run.steps} accepted, {run.rejected} rejected"),
        (
            "evaluations",
            f"{run.nfev} of the equations of motion, {statistics.projections} projections",
        ),
        ("independent", str(run.attrs["charts"])),
        ("closure error", f"{run.closure_error:.2g} (own lengths, rad)"),
        ("smallest pivot", f"{statistics.pivot:.3g} at {statistics.pivot_time:.4g} s"),
        ("limits passed", "; ".join(passed_limits(robot, run)) or "none"),
    ]
    variables, time = run.variables, run.coords["time"].values
    if len(time):
        place = f"at {time[-1]:.6g} s"
        shown = robot.coordinates if len(robot.coordinates) <= FEW else robot.actuators
        rows.append((f"joints {place}", last(run, "joint_position", "coordinate", shown)))
        if "tool_pose" in variables:
            rows.append((f"tool {place}", last(run, "tool_pose", "pose")))
    console().print(facts(rows))


def last(run: Run, quantity: str, dim: str, shown: Collection[str] | None = None) -> str:
    """Return the last values of a quantity by name, of all components or of those shown."""
    values = zip(run.coords[dim].values, run.variables[quantity].values[-1], strict=True)
    return ", ".join(
        f"{name} {value:.6g}" for name, value in values if shown is None or name in shown
    )
