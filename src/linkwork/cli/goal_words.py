"""What leads a robot on the command line: a goal, and the controller that follows it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linkwork import motions
from linkwork.cli.measured_words import MeasuredWords
from linkwork.cli.words import record_of
from linkwork.control.goals import target
from linkwork.errors import LinkworkError
from linkwork.motions.tables import read_columns
from linkwork.robot import Motion, Robot, State
from linkwork.simulation import Run
from linkwork.sweeps.controllers import RECORDS
from linkwork.sweeps.goals import AlongPath, Circle, Goal, Line, Pose, Through, told

PATHS: dict[str, type[AlongPath]] = {"circle": Circle, "line": Line, "through": Through}
GOALS: dict[str, type[Goal]] = {"pose": Pose, **PATHS}
CONTROLLERS = {one.FORM.type: one for one in RECORDS}
TABLE = ".csv"


@dataclass(frozen=True)
class Lead:
    """Say which controller leads a run, and to what, as text."""

    controller: str | None = None
    goal: str | None = None

    def check(self, loaded: bool) -> None:
        """Refuse what does not go together; loaded: whether forces are given."""
        if self.goal is not None and self.controller is None:
            raise LinkworkError("--goal says where a controller leads to; give --controller, too")
        if self.controller is not None and loaded:
            raise LinkworkError(
                "--controller and forces are both given; keep one of them, for the controller "
                "gives the forces"
            )

    def reached(self, robot: Robot, start: State, duration: float, samples: int) -> Any:
        """Return the goal, a state or a motion; start: where the robot is."""
        if self.goal is not None and tabled(self.goal):
            table = self.goal

            def led(count: int) -> Motion:
                return along(robot, table, "--goal", duration, count, start)

            return told(led, robot, samples)
        if self.goal is None:
            return Pose().reached(robot, start, duration, samples)
        goal = record_of(self.goal, "--goal", GOALS, MeasuredWords(robot))
        return goal.reached(robot, start, duration, samples)

    def law(self, robot: Robot, goal: State | Motion) -> Any:
        """Return the controller to a goal."""
        assert self.controller is not None
        record = record_of(self.controller, "--controller", CONTROLLERS, goal=Pose())
        if record.LAW.still and not isinstance(goal, State):
            raise LinkworkError(
                f"--controller: {record.FORM.type} holds a pose and follows no path; give a pose "
                "as --goal, or another controller"
            )
        return record.forces(goal, robot)


def tabled(text: str) -> bool:
    """Tell whether a text names a table of a motion."""
    return Path(text).suffix.lower() == TABLE


def along(
    robot: Robot,
    text: str,
    option: str,
    duration: float | None,
    samples: int,
    guess: State,
    what: tuple[str, ...] | None = None,
) -> Motion:
    """Return the motion along a path: of a table over its own time, of words over a duration [s].

    what: names of the tool's coordinates that the path has; those of its task if left out, and
    joints' of a table
    """
    if tabled(text):
        columns = read_columns(Path(text))
        names = what or (robot.independent if {*robot.independent} <= {*columns} else ())
        if {*robot.coordinates} <= {*columns}:  # which say on which branch it is
            guess = robot.state({name: columns[name][0] for name in robot.coordinates})
        timed = motions.read_csv(text, names)
        return motions.follow(robot, timed, samples=samples, guess=guess, what=what)
    path = record_of(text, option, PATHS, MeasuredWords(robot, what)).path
    if duration is None:
        raise LinkworkError(f"{option} says no times; give --duration, too")
    return robot.follow(path, duration, samples=samples, guess=guess, what=what)


def off_goal(robot: Robot, run: Run, goal: State | Motion) -> np.ndarray:
    """Return how far the actuated joints are from a goal at the saved times (K, actuators)."""
    wanted = target(goal, robot.names)
    places = [robot.coordinates.index(name) for name in robot.actuators]
    found = run["joint_position"].values[:, places]
    return np.stack([np.asarray(wanted.at(t)[0], float) for t in run.time]) - found
