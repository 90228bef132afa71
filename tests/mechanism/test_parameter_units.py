"""Units and least values of free parameters: those of the fields that they are, and where they are
told."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism.parameter_units import least_of_parameter, unit_of_parameter
from linkwork.runs.members import allowed
from linkwork.views import write_report

from tests.catalogue import built

UNITS = {
    "platform.mass": "kg",
    "platform.com.x": "m",
    "platform.inertia.zz": "kg m^2",
    "gravity.z": "m/s^2",
    "slide_1.friction.viscous": "N s/m",
    "pivot_1.friction.coulomb": "N m",
    "slide_1.rotor_inertia": "kg",
    "pivot_1.rotor_inertia": "kg m^2",
    "pivot_1.frames.0.position.x": "m",
    "slide_1.spring.stiffness": "N/m",
    "kp": "",
}


@pytest.mark.parametrize("path", UNITS)
def test_numbers_have_the_units_of_their_fields(path):
    assert unit_of_parameter(lw.robots.prr3(), path) == UNITS[path]


@pytest.mark.parametrize("path", [path for path in UNITS if path != "kp"])
def test_the_least_numbers_are_the_least_that_descriptions_hold(path):
    mechanism = lw.robots.prr3()
    least = least_of_parameter(mechanism, path)
    assert (least is None) == allowed(mechanism, {path: -1e-9})
    assert least is None or allowed(mechanism, {path: least})


def test_what_has_to_be_above_zero_has_the_smallest_number_above_for_its_least():
    rod = next(name for name, joint in lw.robots.delta().joints.items() if joint.type == "rod")
    least = least_of_parameter(lw.robots.delta(), f"{rod}.length")
    assert least is not None and 0 < least < 1e-300
    assert not allowed(lw.robots.delta(), {f"{rod}.length": 0.0})


def test_freedoms_that_slide_and_those_that_turn_are_told_apart():
    joints = {"c": lw.CylindricalJoint(connects=("ground", "b"))}
    mechanism = lw.Mechanism(bodies={"b": lw.Body(mass=1.0)}, joints=joints)
    assert unit_of_parameter(mechanism, "c.friction.slide.viscous") == "N s/m"
    assert unit_of_parameter(mechanism, "c.friction.angle.viscous") == "N m s/rad"
    assert unit_of_parameter(mechanism, "c.rotor_inertia.slide") == "kg"
    assert unit_of_parameter(mechanism, "c.rotor_inertia.angle") == "kg m^2"


@pytest.mark.long
def test_reports_and_notebooks_tell_them(tmp_path):
    robot = built("pendulum")
    free = robot.free(f"{robot.bodies[0]}.mass")
    name = next(iter(free.parameters))
    run = free.simulate(free.home, duration=0.1, save_at=np.linspace(0, 0.1, 3))
    text = write_report(free, run, tmp_path / "run.html").read_text(encoding="utf-8")
    assert f"{name} = {free.parameters[name]!r} kg" in text
    assert f"{name} = {free.parameters[name]:g} kg" in free._repr_html_()
    many = free.ensemble(free.home, parameters={name: [1.0, 2.0]}, duration=0.1)
    assert f"{name} [kg]" in many._repr_html_()
