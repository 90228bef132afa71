"""A run from the command line: where it starts, what drives it, where it is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from linkwork.cli.catalogue import built, refuse_unwritable
from linkwork.cli.entries import by_name, read_columns
from linkwork.cli.goal_words import Lead, off_goal
from linkwork.cli.poses import tidied
from linkwork.cli.source import Source
from linkwork.cli.start import StartOptions
from linkwork.cli.terminal import console, facts, named, patience, show_json, tidy
from linkwork.control import Drive
from linkwork.errors import LinkworkError
from linkwork.model.labels import POSES
from linkwork.patience import interruptions_held
from linkwork.robot import Motion, Robot
from linkwork.runs import running
from linkwork.runs.endings import passed_limits
from linkwork.runs.settings import Settings
from linkwork.simulation import Run, Sampled, Status

FORMATS = (".nc", ".csv")
FEW = 12  # joint coordinates that are all printed; of more those of the actuated joints
MOST_CHARTS = 8  # changes of the independent rates that are printed
SAMPLES = 201  # of a path that a controller follows
INTERRUPTED = 130  # exit status, as of programs that Ctrl-C ends


@dataclass(frozen=True)
class Load:
    """Say what drives a run: constant forces, or a file of forces over time and how it is read
    between its times; drives: whether these are the commands of the description's own drives."""

    constant: str | None
    file: Path | None
    kind: Literal["spline", "linear", "hold"]
    drives: bool = False

    @property
    def given(self) -> bool:
        """Whether there is anything."""
        return self.constant is not None or self.file is not None

    def own_drives(self, robot: Robot) -> dict[str, Drive]:
        """Return the description's drives, where they are asked for."""
        if self.drives and not robot.mechanism.drives:
            raise LinkworkError("--drives: the description gives no drives; leave the option out")
        return robot.drives if self.drives else {}

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
        refuse_unwritable("--out", self.file, self.overwrite)


def settings(duration: float, samples: int, **options: Any) -> Settings:
    """Return how a run is computed; refuse what makes none in the options' own names."""
    if not 0 < duration < np.inf:
        raise LinkworkError(f"--duration {duration:g}: give a positive, finite number of seconds")
    if samples < 2:
        raise LinkworkError(f"--samples {samples}: give at least 2")
    return Settings(duration=duration, samples=samples, **options)


def simulate(
    source: Source,
    start: StartOptions,
    load: Load,
    lead: Lead,
    how: Settings,
    target: Target,
    as_json: bool,
) -> int:
    """Simulate, print how it went, write what was computed; return the exit status."""
    # The start, and what acts: a path that is followed from its beginning says where that is.
    lead.check(load.given)
    with patience("preparing the run"):
        robot = built(source)
        state, forces, goal = start.state(robot), load.forces(robot), None
        if lead.controller is not None:
            goal = lead.reached(robot, state, how.duration, SAMPLES)
            if isinstance(goal, Motion) and not start.given:
                state = goal.state.at(0)
            forces = lead.law(robot, goal)
    with patience("simulating"):
        run = running.simulate(robot, state, forces, how, drives=load.own_drives(robot))
        data, status = told_of(robot, run, goal)
    # How it went, and where it is.
    if target.file is not None:
        with interruptions_held() as came:
            run.save(target.file)
        status = INTERRUPTED if came() else status
        data["written"] = [target.file]
    if as_json:
        show_json(data)
        return status
    print_ending(robot, data)
    if target.file is not None:
        console().print(f"{target.file} written", soft_wrap=True)
    return status


def told_of(robot: Robot, run: Run, goal: Any) -> tuple[dict[str, Any], int]:
    """Return what is told of a run, and the exit status; Ctrl-C, now that the run is there, leaves
    out how far off it is."""
    try:
        return ending(robot, run, goal), left_with(run)
    except KeyboardInterrupt:
        with interruptions_held():
            return ending(robot, run, goal), INTERRUPTED


def left_with(run: Run) -> int:
    """Return the exit status of a run: 0 where it reached its end, 1 before, 130 interrupted."""
    if run.status is Status.CANCELLED:
        return INTERRUPTED
    return 0 if run.success else 1


def ending(robot: Robot, run: Run, goal: Any) -> dict[str, Any]:
    """Return how a run ended and where, in which charts it went, and which limits it passed, as
    plain data; goal: what a controller led to, if one did."""
    statistics, attrs = run.statistics, run.attrs
    found: dict[str, Any] = {
        "status": run.status,
        "message": run.message,
        "method": attrs["method"],
        "steps": run.steps,
        "rejected": run.rejected,
        "evaluations": run.nfev,
        "projections": statistics.projections,
        "independent": attrs["charts"],
        "closure_error": run.closure_error,
        "pivot": statistics.pivot,
        "pivot_time": statistics.pivot_time,
        "error_estimate": run.error_estimate,
        "limits_passed": passed_limits(robot, run),
        "time": float(attrs["final_time"]),
        "joints": dict(zip(robot.coordinates, run.final.positions.tolist(), strict=True)),
        "rates": dict(zip(run.final.independent, run.final.rates.tolist(), strict=True)),
    }
    if robot.mechanism.tools:
        pose = tidy(robot.tool_pose(run.final), robot.equations.tree.length)
        found["tool"] = dict(zip(POSES[robot.planar], pose.tolist(), strict=True))
    if goal is not None and len(run.time):
        off = np.abs(off_goal(robot, run, goal))
        found["off_goal"] = {
            name: {"most": most, "last": last}
            for name, most, last in zip(robot.actuators, off.max(axis=0), off[-1], strict=True)
        }
    return found


def shortened(charts: str) -> str:
    """Return in which rates a run went, of many changes the first ones and the last."""
    parts = charts.split("; ")
    if len(parts) <= MOST_CHARTS:
        return charts
    left_out = f"... {len(parts) - MOST_CHARTS:,} more"
    return "; ".join([*parts[: MOST_CHARTS - 1], left_out, parts[-1]])


def print_ending(robot: Robot, data: Mapping[str, Any]) -> None:
    """Print how a run ended."""
    rows = [
        ("status", f"{data['status'].name.lower()}: {data['message']}"),
        ("method", str(data["method"])),
        ("steps", f"{data['steps']} accepted, {data['rejected']} rejected"),
        (
            "evaluations",
            f"{data['evaluations']} of the equations of motion, {data['projections']} projections",
        ),
        ("independent", shortened(str(data["independent"]))),
        ("closure error", f"{data['closure_error']:.2g} (own lengths, rad)"),
        ("smallest pivot", f"{data['pivot']:.3g} at {data['pivot_time']:.4g} s"),
        ("limits passed", "; ".join(data["limits_passed"]) or "none"),
    ]
    place = f"at {data['time']:.6g} s"
    few = len(robot.coordinates) <= FEW
    shown = [name for name in data["joints"] if few or name in robot.actuators]
    joints = np.array([data["joints"][name] for name in shown])
    rows.append((f"joints {place}", named(shown, tidied(robot, joints))))
    if "tool" in data:
        pose = np.array([*data["tool"].values()])
        rows.append((f"tool {place}", named([*data["tool"]], tidied(robot, pose))))
    if "off_goal" in data:
        parts = (
            f"{name} {off['most']:.3g} at most, {off['last']:.3g} at the end"
            for name, off in data["off_goal"].items()
        )
        rows.append(("off the goal", "; ".join(parts)))
    console().print(facts(rows))
