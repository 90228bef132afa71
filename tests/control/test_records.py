"""Laws and drives are records: listed once, each number described once, and what is the user's own
is told apart."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from dataclasses import dataclass, fields
from functools import partial
from typing import ClassVar, get_type_hints

import pytest

import linkwork as lw
from linkwork import control
from linkwork.control import (
    LQR,
    PD,
    DCMotor,
    Drive,
    HydraulicCylinder,
    Lag,
    PneumaticCylinder,
    Sampler,
    Saturated,
)
from linkwork.control.captured import Open
from linkwork.control.controllers import Controller, Form
from linkwork.control.described_drives import drive
from linkwork.control.kept_traces import value
from linkwork.control.plant import Plant
from linkwork.control.records import described, number
from linkwork.mechanism import MechanismError
from linkwork.mechanism.record import Positive
from linkwork.sweeps.controllers import RECORDS, record

from tests.control.plants import cart

GAINS = {"kp": 2.0, "kd": 1.0}


def ready(base: type) -> set[type]:
    """Return the classes of the package beneath a base from which things are made."""
    for module in pkgutil.iter_modules(control.__path__, f"{control.__name__}."):
        importlib.import_module(module.name)
    below = {kind for each in base.__subclasses__() for kind in (each, *ready(each))}
    return {
        kind
        for kind in below
        if kind.__module__.startswith("linkwork.") and not inspect.isabstract(kind)
    }


def test_every_drive_and_controller_is_listed_and_exported():
    assert ready(Drive) == set(control.DRIVES) and ready(Controller) == set(control.LAWS)
    assert {kind.__name__ for kind in (*control.DRIVES, *control.LAWS)} <= set(control.__all__)


def test_the_names_in_study_files_are_those_that_the_classes_say():
    assert {kind.type: kind.__name__ for kind in control.DRIVES} == {
        "": "Ideal",
        "saturated": "Saturated",
        "lag": "Lag",
        "dc_motor": "DCMotor",
        "hydraulic_cylinder": "HydraulicCylinder",
        "pneumatic_cylinder": "PneumaticCylinder",
        "servo": "Servo",
        "lagging_servo": "LaggingServo",
        "integrating_servo": "IntegratingServo",
        "muscle": "Muscle",
    }
    types = [each.model_fields["type"].default for each in RECORDS]
    joints = ["pd", "pd_with_gravity", "pid", "computed_torque", "sliding_mode", "lqr"]
    assert types == [*joints, "task_pd_with_gravity", "task_computed_torque"]


@pytest.mark.parametrize("kind", control.DRIVES)
def test_every_number_of_a_drive_is_described(kind):
    hints = get_type_hints(kind)
    assert set(described(kind)) == {
        entry.name for entry in fields(kind) if hints[entry.name] in (float, float | None)
    }
    assert all(told.unit for told in described(kind).values())


@pytest.mark.parametrize("kind", [Saturated, Lag, DCMotor, HydraulicCylinder, PneumaticCylinder])
def test_the_bounds_that_are_described_are_held(kind):
    numbers = dict.fromkeys(described(kind), 1.0)
    assert kind(**numbers)
    for name, told in described(kind).items():
        if told.kind is Positive:
            with pytest.raises(
                lw.LinkworkError, match=f"{name} of {kind.__name__} is 0.0; give a positive number"
            ):
                kind(**numbers | {name: 0.0})


def test_docstrings_end_with_the_numbers():
    told = inspect.getdoc(DCMotor) or ""
    assert "\nresistance: R [ohm], above 0\n" in told and told.endswith(
        "\ninitial_current: i at the start [A]"
    )
    assert "\nkp: [N/m, N m/rad]; one number, or one by actuator\n" in (inspect.getdoc(PD) or "")
    assert "\nstroke: [m], above 0\n" in (inspect.getdoc(PneumaticCylinder) or "")


def test_ready_parts_are_settled_and_those_of_the_users_own_are_not():
    class Own(PD):
        pass

    @dataclass(frozen=True)
    class Halved(Drive):
        def equations(self, command, x, w, z):
            return command / 2, ()

    law, own = PD({"slide": 0.2}, 30.0, 2.0), Own({"slide": 0.2}, 30.0, 2.0)
    value([law, {"slide": Saturated(2.0)}, control.Wrench("cart", [1.0, 0, 0])])
    value([Sampler(law, compiled=True), Sampler(lambda t, state: [1.0]), lambda t, state: [1.0]])
    for mine in (own, Halved(), {"slide": Halved()}, Sampler(own, compiled=True)):
        with pytest.raises(Open):
            value(mine)
    for made in (partial(control.Wrench, "cart"), control.Event):
        value(made(lambda t, state: [1.0, 0, 0]))
        with pytest.raises(Open):
            value(made(own))


def test_a_law_in_one_file_is_one_of_studies():
    """What a class says of itself is all that a study needs to know."""

    @dataclass(frozen=True, eq=False)
    class Stiff(PD):
        stiffness: float = number("of the end", "N/m", Positive, 1.0)
        forms: ClassVar = (Form("stiff", "u = kp e", "Stiff", ("kp", "kd", "stiffness")),)

    made = record(Stiff, Stiff.forms[0])
    given = {
        "type": "stiff",
        "goal": {"type": "pose", "joints": {"slide": 0.2}},
        "stiffness": 3.0,
    } | GAINS
    plant = cart(mass=2.0)
    law = made(**given).law(plant.home, plant)
    assert type(law) is Stiff and (law.kp, law.kd, law.stiffness, law.goal) == (
        2.0,
        1.0,
        3.0,
        plant.home,
    )
    with pytest.raises(
        MechanismError, match=r"stiffness: -1.0 is not above 0; expected of the end \[N/m\]"
    ):
        made(**given | {"stiffness": -1.0})
    with pytest.raises(MechanismError, match="stiffness: is missing"):
        made(**{name: value for name, value in given.items() if name != "stiffness"})
    with pytest.raises(MechanismError, match="model: is not a known field"):
        made(**given, model={})


def test_drives_of_studies_take_the_numbers_that_they_describe():
    assert drive({"type": "saturated", "limit": 2}, ()) == Saturated(2.0)
    with pytest.raises(
        MechanismError, match="smooth: is not a known field; the fields here are limit"
    ):
        drive({"type": "saturated", "limit": 2, "smooth": 1}, ())
    with pytest.raises(
        MechanismError,
        match=r"type: 'ideal' is not a type.*; the types are saturated, lag, dc_motor,",
    ):
        drive({"type": "ideal"}, ())


def test_a_robot_is_all_that_controllers_ask_of_it():
    robot = cart(mass=2.0)
    assert isinstance(robot, Plant) and not isinstance(robot.home, Plant)
    assert LQR.still and not PD.still
