"""The bench: a study made ready to run: robot with free numbers, controllers, starts, and the form
of its results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from linkwork.control import Drive
from linkwork.control.acting import bristles
from linkwork.control.described_drives import drive
from linkwork.control.drives import Extra
from linkwork.control.goals import target
from linkwork.equations.algebra import wrapped
from linkwork.model import task
from linkwork.robot import Motion, Robot, State
from linkwork.runs.quantities import QUANTITIES, Axis, axes_of, lacks
from linkwork.runs.settings import Settings
from linkwork.simulation import Signal, Status
from linkwork.sweeps.driving_cases import Case, controlled, pushed, reached
from linkwork.sweeps.home import (
    REFUSED,
    UNREACHABLE,
    begun,
    home,
    rates_given,
    same_start,
)
from linkwork.sweeps.outputs import Output
from linkwork.sweeps.study import Study, StudyError

STATUSES = {status.value: status.name for status in Status} | {
    UNREACHABLE: "UNREACHABLE",
    REFUSED: "REFUSED",
}
"""How members end: as runs do; or without a run, as their start is out of reach, or no description
may hold their numbers."""


MANY = 2**7  # controllers, more than a byte can number
OWN_UNITS = ("coordinate", "task", "extra")  # axes of whose components each has its own unit


@dataclass(frozen=True)
class Field:
    """Describe an array of the results: its axes, of which the first is "member", and
    attributes."""

    axes: tuple[str, ...]
    kind: str
    attrs: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Bench:
    """Hold a study that is ready to run.

    robot: with the study's numbers free; drives: by actuator; start: where runs start that vary
        nothing of it
    cases: one for each controller
    """

    study: Study
    robot: Robot
    drives: Mapping[str, Drive]
    start: State
    cases: tuple[Case, ...]

    @classmethod
    def of(cls, study: Study) -> Bench:
        """Make a study ready.

        Raises:
            StudyError: names that fit neither robot nor controllers, poses out of reach; where it
                stands in the study.
        """
        robot = Robot(study.mechanism, free=study.paths)
        for name in study.drives:
            if name not in robot.actuators:
                there = ", ".join(robot.actuators) or "none"
                raise StudyError(
                    f"there is no actuator {name!r}; there are {there}", ("drives", name)
                )
        drives = {name: drive(given, ("drives", name)) for name, given in study.drives.items()}
        start = home(study, robot)
        nominal = Robot(study.mechanism, robot.independent) if study.controllers else robot
        goals = {name: reached(study, name, nominal, start) for name in study.controllers}
        first = next(iter(goals.values()), None)
        if isinstance(first, Motion) and study.start.tool is None and not study.start.joints:
            start = robot.make_state(first.state.q[0], start.rates)
        start = begun(study, robot, start)
        if not study.controllers:
            cases = (pushed(study, robot, drives),)
        else:
            cases = tuple(
                controlled(study, name, goals[name], nominal, robot, drives)
                for name in study.controllers
            )
        bench = cls(study, robot, drives, start, cases)
        for name in study.varied:
            bench.require_known(name)
        bench.require_components()
        return bench

    def settings(self, threads: int | None) -> Settings:
        """Return how the runs are computed."""
        names = ("duration", "method", "step", "rtol", "atol", "max_steps", "on_singular")
        given = {name: getattr(self.study, name) for name in names}
        return Settings(**given, save_at=self.times, threads=threads)

    @cached_property
    def times(self) -> np.ndarray:
        """The times that are looked at (K) [s]."""
        return np.linspace(0, self.study.duration, self.study.samples)

    @cached_property
    def extras(self) -> tuple[Extra, ...]:
        """The extra states of the drives, and those of bristles."""
        of_drives = tuple(
            extra._replace(name=f"{name}.{extra.name}")
            for name, given in self.drives.items()
            for extra in given.extras
        )
        return of_drives + bristles(self.robot.names)

    @cached_property
    def labels(self) -> Mapping[str, tuple[str, ...]]:
        """The names along each axis of components."""
        return {name: tuple(axis.names) for name, axis in self._axes.items()}

    @cached_property
    def _axes(self) -> Mapping[str, Axis]:
        return axes_of(self.robot, self.extras)

    @cached_property
    def outputs(self) -> Mapping[str, Output]:
        """The outputs by name."""
        return {name: Output.read(text) for name, text in self.study.outputs.items()}

    @cached_property
    def quantities(self) -> tuple[str, ...]:
        """The quantities that are measured."""
        return tuple(
            dict.fromkeys(
                [*(output.quantity for output in self.outputs.values()), *self.study.trajectories]
            )
        )

    @cached_property
    def fields(self) -> Mapping[str, Field]:
        """The arrays of the results by name."""
        # What is varied, and which controller leads.
        found = {name: Field(("member",), "f8", {"role": "varied"}) for name in self.study.varied}
        if len(self.cases) > 1:
            names = self.study.controllers
            kind = "i1" if len(self.cases) < MANY else "i4"
            found["controller"] = Field(("member",), kind, flags(dict(enumerate(names))))
        # How each member ended.
        found |= {
            "status": Field(("member",), "i1", flags(STATUSES)),
            "end_time": Field(("member",), "f8", {"units": "s"}),
            "nfev": Field(("member",), "i8", {}),
            "pivot": Field(
                ("member",), "f8", {"units": "1", "description": "smallest relative pivot met"}
            ),
            "closure_error": Field(("member",), "f8", {"units": "own lengths, rad"}),
        }
        # What is asked of the runs: numbers of each, and trajectories.
        for name, output in self.outputs.items():
            attrs = {
                "role": "output",
                "units": output.unit,
                "description": self.study.outputs[name],
            }
            found[name] = Field(
                ("member", *(() if output.axis is None else (output.axis,))), "f8", attrs
            )
        for name in self.study.trajectories:
            axis = QUANTITIES[name].axis
            found[name] = Field(
                ("member", "time", *(() if axis is None else (axis,))),
                "f8",
                {"units": QUANTITIES[name].unit},
            )
        return found

    def shape(self, field: Field, members: int) -> tuple[int, ...]:
        """Return the shape of a field's array for a number of members."""
        sizes = {"member": members, "time": len(self.times)} | {
            axis: len(names) for axis, names in self.labels.items()
        }
        return tuple(sizes[axis] for axis in field.axes)

    def unit(self, output: Output, component: str) -> str:
        """Return the unit of an output's component: of slides or of turns, where a quantity has
        both; its own, where components have their own units."""
        axis = QUANTITIES[output.quantity].axis
        if axis in OWN_UNITS:
            names, units = self._axes[axis]
            return output.reduced(units[list(names).index(component)])
        slide, *turn = output.unit.split(", ")
        if axis == "pose":
            angular = component not in ("x", "y", "z")
        else:
            angular = self.robot.labels.units.get(component) == "rad"
        return turn[0] if turn and angular else slide

    @cached_property
    def same_start(self) -> bool:
        """Whether all members start at the same coordinates."""
        return same_start(self.study, self.robot)

    # What varies

    def parameter(self, name: str, case: int) -> str | None:
        """Return the parameter of the runs that a varied name stands for; none if it is another
        controller's, or a start's."""
        if name in self.study.paths:
            return name
        section, _, rest = name.partition(".")
        if section == "forces":
            return name
        if section == "drives":
            return rest
        controller = tuple(self.study.controllers)[case] + "." if self.study.controllers else ""
        return (
            rest.removeprefix(controller)
            if section == "controllers" and rest.startswith(controller)
            else None
        )

    def parameters(self, case: int, values: np.ndarray) -> dict[str, np.ndarray]:
        """Return the runs' parameters (M) by name for varied values (M, varied); nan where a
        controller has none."""
        names = [self.parameter(name, case) for name in self.study.varied]
        given = {name: values[:, i] for i, name in enumerate(names) if name is not None}
        return self.cases[case].values(self.robot, given)

    def require_known(self, name: str) -> None:
        """Refuse a varied name that fits nothing."""
        section, _, rest = name.partition(".")
        if name in self.study.paths:
            return
        if section == "start":
            kind, _, label = rest.partition(".")
            given = self.study.start.tool
            tool = task.asked_of(self.robot, len(given)).labels if given else ()
            known = {
                "tool": tool,
                "joints": [each for each in self.robot.coordinates if each in self.robot.rates],
                "rates": rates_given(self.study, self.robot),
            }
            if label in known.get(kind, ()):
                return
            allowed = [f"start.{part}.{each}" for part, names in known.items() for each in names]
        else:
            own = [self.parameter(name, i) in case.numbers for i, case in enumerate(self.cases)]
            if any(own):
                return
            allowed = self.allowed(section)
        raise StudyError(
            f"is nothing that can vary; there are {', '.join(allowed) or 'none'}",
            self.study.place(name),
        )

    def allowed(self, section: str) -> list[str]:
        """Return the names of a section that can vary."""
        if section == "controllers":
            pairs = zip(self.study.controllers, self.cases, strict=False)
            return [
                f"controllers.{name}.{gain}"
                for name, case in pairs
                for gain in case.numbers
                if gain not in self.of_drives
            ]
        return (
            [f"drives.{name}" for name in self.of_drives]
            if section == "drives"
            else list(self.cases[0].parameters)
        )

    @cached_property
    def of_drives(self) -> tuple[str, ...]:
        """The names of the drives' numbers."""
        return tuple(
            f"{name}.{number}" for name, given in self.drives.items() for number in given.numbers
        )

    def require_components(self) -> None:
        """Refuse outputs that this robot does not have."""
        for name, output in self.outputs.items():
            self.require_quantity(output.quantity, ("outputs", name))
            axis = QUANTITIES[output.quantity].axis
            names = self.labels[axis] if axis else ()
            if output.component and output.component not in names:
                there = f"there are {', '.join(names)}" if names else "it has none"
                raise StudyError(
                    f"{output.quantity} has no component {output.component!r}; {there}",
                    ("outputs", name),
                )
        for index, name in enumerate(self.study.trajectories):
            self.require_quantity(name, ("trajectories", str(index)))

    def require_quantity(self, name: str, where: tuple[str, ...]) -> None:
        """Refuse a quantity that this study's runs do not have."""
        quantity, aimless = QUANTITIES[name], not self.study.controllers
        reason = lacks(quantity, self._axes) or (
            quantity.aimed and aimless and "there is no controller"
        )
        if reason:
            raise StudyError(f"{name!r} is not defined here: {reason}", where)

    # Goals

    def wanted_joints(self, case: int) -> Signal:
        """Return the coordinates over time that a controller leads the actuated joints to."""
        return self._wanted[case]

    @cached_property
    def _wanted(self) -> tuple[Signal, ...]:
        names = self.robot.names
        return tuple(
            target(case.goal, names).positions for case in self.cases if case.goal is not None
        )

    def tool_error(self, case: int, times: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return the tool's distance (rows, pose) from the goal's at the saved times of a number
        (rows)."""
        wanted = self._wanted_poses[case][times]
        if self.robot.planar:
            error = poses - wanted
            error[:, 2] = wrapped(error[:, 2])
            return error
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_rotvec(poses[:, 3:]) * Rotation.from_rotvec(wanted[:, 3:]).inv()
        return np.concatenate([poses[:, :3] - wanted[:, :3], turn.as_rotvec()], axis=1)

    @cached_property
    def _wanted_poses(self) -> list[np.ndarray]:
        found = []
        for case in self.cases:
            goal = case.goal
            if isinstance(goal, Motion):
                q = goal.state.q[:: (len(goal.time) - 1) // (len(self.times) - 1)]
            else:
                q = np.tile(goal.q, (len(self.times), 1))  # pyright: ignore
            found.append(self.robot.tool_poses(q))
        return found


def flags(meanings: Mapping[int, str]) -> dict[str, Any]:
    """Return attributes that say what whole numbers mean (CF conventions)."""
    return {
        "flag_values": list(meanings),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in meanings.values()),
    }
