"""Quantities: all that is told of saved states, in one table: name, axes, unit, and function.

Runs, ensembles, studies, the report of a run and the viewer read this table. Quantities are
functions of the states saved (`saved_states`), but for those that follow from a run as a whole
(`run_record`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Flag, auto
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from linkwork.control.drives import Extra
from linkwork.equations.fluid import felt
from linkwork.mechanism.limits import touching
from linkwork.mechanism.task import labels as labels_of
from linkwork.mechanism.task import unit
from linkwork.model.labels import POSES
from linkwork.model.reactions import COMPONENTS
from linkwork.model.task import stated
from linkwork.runs.saved_states import SavedStates
from linkwork.runs.system import System
from linkwork.simulation import Variable

if TYPE_CHECKING:
    from linkwork.model.model import Model


class Place(Flag):
    """Name what tells quantities: the datasets of runs and of ensembles, and studies that ask."""

    RUN = auto()
    ENSEMBLE = auto()
    STUDY = auto()
    ALL = RUN | ENSEMBLE | STUDY


@dataclass(frozen=True)
class SavedQuantity:
    """Describe a quantity of saved states.

    name: by which it is asked for; axes: of its components; unit: or two, of slides and of turns
    of: gives its values (K, ...) of `SavedStates`, or of a whole `run_record.RunRecord`
    caption: of its picture in a run's report, which has one where this is given
    places: what tells it
    still: whether it follows from q, z and t alone, and so is known on the way over singular poses
    turning: whether it is coordinates of joints, whose turns are counted along each run
    whole: whether it follows from a run as a whole; aimed: whether it needs a goal
    acting: whether runs tell it only where more acts than forces over time
    unless_zero: whether runs tell it only where it does not vanish
    own_unit: gives its unit in a system, instead of `unit`
    """

    name: str
    axes: tuple[str, ...]
    unit: str
    of: Callable[[Any], np.ndarray]
    caption: str = ""
    places: Place = Place.ALL
    still: bool = False
    turning: bool = False
    whole: bool = False
    aimed: bool = False
    acting: bool = False
    unless_zero: bool = False
    own_unit: Callable[[System], str] | None = None

    def belongs(self, place: Place) -> bool:
        """Tell whether it is told in a place: only runs tell what follows from a run as a whole,
        and studies know one axis of components.
        """
        if place is Place.RUN:
            return place in self.places
        few = place is Place.ENSEMBLE or len(self.axes) < 2
        return place in self.places and few and not self.whole

    @property
    def axis(self) -> str | None:
        """The axis of its components, if it has any."""
        return self.axes[0] if self.axes else None

    def values(self, states: SavedStates) -> np.ndarray:
        """Return its values (K, ...).

        Near a singular pose rates and accelerations do not follow from the state: on the way over
        one a quantity is the polynomial through its values at the nodes of the crossing.
        Coordinates do follow, and are not interpolated, for angles may jump by a turn.
        """
        if states.over is None or self.still:
            return self.of(states)
        return states.over.through(self.of(states.over.nodes))

    def told(
        self, values: Any, system: System, *axes: str, shape: tuple[int, ...] = ()
    ) -> Variable:
        """Return values, or what finds them, over some axes and its own as a variable."""
        unit = self.own_unit(system) if self.own_unit else self.unit
        return Variable((*axes, *self.axes), values, {"units": unit}, shape)


def extra_units(system: System) -> str:
    """Return the units of the extra states."""
    return ", ".join(extra.unit for extra in system.extras)


def command_units(system: System) -> str:
    """Return the units of what drives are commanded, each once."""
    drives = system.acting.drives if system.acting else ()
    return ", ".join(dict.fromkeys(drive.unit for drive in drives))


def tracking_error(states: SavedStates) -> np.ndarray:
    """Return  x_d - x  of the actuated joints (K, actuators), as controllers see it."""
    assert states.aim is not None and states.t is not None
    actuated = [states.robot.coordinates.index(name) for name in states.robot.actuators]
    return states.aim.joints(states.t) - states.joints[0][:, actuated]


def tool_error(states: SavedStates) -> np.ndarray:
    """Return the tool's distance from the pose that is wanted (K, pose)."""
    assert states.aim is not None and states.places is not None
    return states.aim.tool_error(states.places, states.tool)


def closure_error(states: SavedStates) -> np.ndarray:
    """Return the largest gap of each state's loops (K,), rows that are not held included."""
    assert states.residual is not None
    return np.maximum(states.residual, states.chart.unheld_gap(states.q))


RUN, STUDY, ASKED = Place.RUN, Place.STUDY, Place.RUN | Place.STUDY
JOINTS, RATES, DRIVEN = ("coordinate",), ("rate",), ("actuator",)
WELL_POSED = "How well the actuators move the tool: 1 alike in all directions, 0 singular."
TABLE = (
    SavedQuantity(
        "joint_position",
        JOINTS,
        "m, rad",
        lambda s: s.joints[0],
        "Joint coordinates.",
        still=True,
        turning=True,
    ),
    SavedQuantity("joint_rate", RATES, "m/s, rad/s", lambda s: s.joints[1], "Joint rates."),
    SavedQuantity(
        "joint_acceleration", RATES, "m/s^2, rad/s^2", lambda s: s.moving(s.v_dot)[2], places=ASKED
    ),
    SavedQuantity(
        "actuator_force",
        DRIVEN,
        "N, N m",
        lambda s: s.acted.force,
        "Forces and torques of the actuators.",
        places=ASKED,
    ),
    SavedQuantity("kinetic_energy", (), "J", lambda s: s.energies[0], places=ASKED),
    SavedQuantity("potential_energy", (), "J", lambda s: s.energies[1], places=ASKED),
    SavedQuantity("energy", (), "J", lambda s: s.energy, places=STUDY),
    SavedQuantity("closure_error", (), "own lengths, rad", closure_error, places=RUN, still=True),
    SavedQuantity(
        "tool_pose", ("pose",), "m, rad", lambda s: s.tool, "Pose of the tool.", still=True
    ),
    SavedQuantity(
        "task_position",
        ("task",),
        "m, rad",
        lambda s: s.task,
        "Task coordinates of the tool.",
        still=True,
    ),
    SavedQuantity(
        "tool_error", ("pose",), "m, rad", tool_error, places=STUDY, still=True, aimed=True
    ),
    SavedQuantity(
        "tracking_error", DRIVEN, "m, rad", tracking_error, places=STUDY, still=True, aimed=True
    ),
    SavedQuantity(
        "drive_state",
        ("extra",),
        "",
        lambda s: s.z[:, : len(s.system.extras)],
        still=True,
        own_unit=extra_units,
    ),
    SavedQuantity(
        "command",
        DRIVEN,
        "",
        lambda s: s.acted.command,
        "Commands to the drives.",
        places=ASKED,
        acting=True,
        own_unit=command_units,
    ),
    SavedQuantity(
        "external_wrench",
        ("wrench", "wrench_component"),
        "N m, N",
        lambda s: s.acted.wrenches,
        places=RUN,
    ),
    SavedQuantity(
        "actuator_power",
        DRIVEN,
        "W",
        lambda s: s.powers.actuators,
        "Power of the actuators.",
        places=ASKED,
    ),
    SavedQuantity(
        "friction_power", RATES, "W", lambda s: s.powers.friction, places=RUN, unless_zero=True
    ),
    SavedQuantity(
        "damper_power", ("spring",), "W", lambda s: s.powers.dampers, places=RUN, unless_zero=True
    ),
    SavedQuantity(
        "contact_power", ("touch",), "W", lambda s: s.powers.contacts, places=RUN, unless_zero=True
    ),
    SavedQuantity(
        "fluid_power", ("drag",), "W", lambda s: s.powers.drags, places=RUN, unless_zero=True
    ),
    SavedQuantity(
        "contact_force", ("touch", "direction"), "N", lambda s: s.contacts[0], places=RUN
    ),
    SavedQuantity(
        "contact_gap",
        ("touch",),
        "m",
        lambda s: s.contacts[1],
        "Gaps where bodies may touch, negative where they press.",
        places=ASKED,
        still=True,
    ),
    SavedQuantity("external_power", ("wrench",), "W", lambda s: s.powers.wrenches, places=RUN),
    SavedQuantity("reaction_moment", ("joint",), "N m", lambda s: s.reactions[0], places=STUDY),
    SavedQuantity("reaction_force", ("joint",), "N", lambda s: s.reactions[1], places=STUDY),
    SavedQuantity(
        "conditioning", (), "1", lambda s: s.conditioning, WELL_POSED, places=ASKED, still=True
    ),
    SavedQuantity("work", (), "J", lambda run: run.work, places=RUN, whole=True),
    SavedQuantity(
        "energy_balance", (), "J", lambda run: run.energy_balance, places=RUN, whole=True
    ),
)
QUANTITIES: dict[str, SavedQuantity] = {quantity.name: quantity for quantity in TABLE}
"""The table."""


class Axis(NamedTuple):
    """Hold the names of components, and the unit of each where they have units of their own."""

    names: Sequence[str]
    units: Sequence[str] = ()


LACKING = {
    "pose": "the robot has no tool",
    "task": "the tool states no task",
    "extra": "no drive has a state",
    "joint": "no joint is between two bodies",
    "spring": "no spring has a damper",
    "wrench": "no wrench acts",
    "touch": "no contact is described",
    "drag": "no fluid acts",
}
"""Why a quantity is not defined whose axis has no names, for axes of which a robot may have
none."""
AXES = ("coordinate", "rate", "actuator", *LACKING, "wrench_component", "direction")


def axes_of(
    robot: Model, extras: Sequence[Extra] = (), pushed: Sequence[str] = ()
) -> dict[str, Axis]:
    """Return all axes of components by name, of a robot on which drives and wrenches act; pushed:
    the bodies of these."""
    mechanism, tools = robot.mechanism, robot.mechanism.tools
    resisted = (*mechanism.springs, *mechanism.transmissions)
    damped = any(spring.damping for spring in mechanism.springs.values()) or any(
        any(line.resistance) for line in mechanism.transmissions.values()
    )
    of_each = [robot.unit(label) for label in robot.rates]
    return {
        "coordinate": Axis(robot.coordinates, [robot.unit(label) for label in robot.coordinates]),
        "rate": Axis(robot.rates, [f"{unit}/s" for unit in of_each]),
        "actuator": Axis(robot.actuators),
        "joint": Axis(tuple(robot.mechanism.pairs)),
        "spring": Axis(resisted if damped else ()),
        "pose": Axis(POSES[robot.planar] if tools else ()),
        "task": Axis(labels_of(stated(robot)), [unit(item) for item in stated(robot)]),
        "extra": Axis([extra.name for extra in extras], [extra.unit for extra in extras]),
        "wrench": Axis([f"{i}: {body}" for i, body in enumerate(pushed)]),
        "wrench_component": Axis(COMPONENTS),
        "touch": Axis(touching(robot.mechanism)),
        "drag": Axis(tuple(mechanism.drags) if felt(mechanism) else ()),
        "direction": Axis(("x", "y", "z")),
    }


def lacks(quantity: SavedQuantity, axes: Mapping[str, Axis]) -> str:
    """Say why a quantity is not defined on some axes; nothing where it is."""
    return next(
        (LACKING[axis] for axis in quantity.axes if axis in LACKING and not axes[axis].names), ""
    )


def is_told(quantity: SavedQuantity, place: Place, axes: Mapping[str, Axis]) -> bool:
    """Tell whether a quantity is told in a place and defined on some axes."""
    return quantity.belongs(place) and not lacks(quantity, axes)


def told_by(place: Place, axes: Mapping[str, Axis]) -> list[SavedQuantity]:
    """Return the quantities that are told in a place and defined on some axes."""
    return [each for each in QUANTITIES.values() if is_told(each, place, axes)]


def coords_of(quantities: Iterable[SavedQuantity], axes: Mapping[str, Axis]) -> dict[str, Variable]:
    """Return the labels of the axes of some quantities."""
    used = {axis for quantity in quantities for axis in quantity.axes}
    return {name: labels(name, *axis) for name, axis in axes.items() if name in used}


def labels(axis: str, names: Sequence[str], units: Sequence[str] = ()) -> Variable:
    """Return the names along an axis, with the unit of each where they have one."""
    attrs = {"unit_of_each": ", ".join(units)} if units else {}
    return Variable((axis,), np.array(names, dtype=object), attrs)
