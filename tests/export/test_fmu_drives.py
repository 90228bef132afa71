"""Drives in FMUs: commands come in, and motors, lags and bounds act as they do in runs."""

import numpy as np
import pytest
from fmpy.validation import validate_fmu

import linkwork as lw

from tests.export import fmus
from tests.export.fmus import Instance
from tests.export.test_fmu import KINDS, simulated

MOTOR = {
    "type": "dc_motor",
    "resistance": 2.0,
    "inductance": 0.01,
    "torque_constant": 0.5,
    "gear": 40.0,
    "initial_current": 0.1,
}
LAG = {"type": "lag", "time_constant": 0.03}
BOUND = {"type": "saturated", "limit": 1.5}


def driven(name: str, **drives: dict) -> lw.Robot:
    """Return a robot of the catalogue with drives."""
    return lw.Robot(lw.Robot(name).mechanism.model_copy(update={"drives": drives}))


def platform() -> lw.Robot:
    return driven("prr3", slide_1=MOTOR, slide_3=LAG)


def crank() -> lw.Robot:
    """A crank that a motor turns, told by the rate of its slider."""
    motor = {**MOTOR, "gear": 4.0, "initial_current": 0.0}
    mechanism = lw.robots.slider_crank().model_copy(update={"drives": {"crank": motor}})
    return lw.Robot(mechanism, independent=["slide"])


def export(robot: lw.Robot, version="3.0", **more) -> lw.export.FmuExport:
    return lw.export.fmu(robot, version, platforms=(), **{"drives": robot.drives, **more})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fmus")


@pytest.mark.long
@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_simulations_are_those_of_runs_with_drives(version, folder):
    """Also the states of drives at the end, and their units."""
    robot = platform()
    file = fmus.built(export(robot, version), folder)
    assert validate_fmu(str(file)) == []
    given = {"command.slide_1": 12.0, "force.slide_2": 2.0, "command.slide_3": 3.0}
    how = {"drives": robot.drives, "rtol": 1e-11, "atol": 1e-12}
    run = robot.simulate(robot.home, [*given.values()], duration=0.2, **how)
    for kind, tolerance, close in zip(KINDS, (1e-9, 1e-8), (1e-7, 2e-5), strict=True):
        found = simulated(file, kind, 0.2, tolerance, **given)
        positions = [found[f"joint.{each}"][-1] for each in robot.coordinates]
        np.testing.assert_allclose(positions, run.final.positions, atol=close)
    one = Instance(file, me=False)
    one.initialise(tolerance=1e-10, **{each.replace(".", "__"): x for each, x in given.items()})
    states = ["drive.slide_1.current", "drive.slide_3.force"]
    np.testing.assert_array_equal(one.get(*states), [0.1, 0.0])
    one.step(0.0, 0.2)
    expected = run.dataset["drive_state"].values[-1]
    np.testing.assert_allclose(one.get(*states), expected, rtol=1e-7)
    units = {each.name: each.unit for each in one.description.modelVariables}
    assert units["command.slide_1"] == "V" and units["command.slide_3"] == "N"
    assert units["drive.slide_1.current"] == "A"
    assert units["der(drive.slide_1.current)"] == "A/s"


@pytest.mark.long
def test_charts_change_with_drives(folder):
    """A motor turns a crank on past its dead centres, where the rate of the slider says nothing."""
    robot = crank()
    file = fmus.built(export(robot), folder)
    how = {"drives": robot.drives, "rtol": 1e-11, "atol": 1e-12}
    run = robot.simulate(robot.home, [24.0], duration=0.5, **how)
    assert abs(run.final.positions[0]) > np.pi
    for kind, close in zip(KINDS, (1e-6, 1e-4), strict=True):
        found = simulated(file, kind, 0.5, 1e-10, **{"command.crank": 24.0})
        positions = [found[f"joint.{each}"][-1] for each in robot.coordinates]
        np.testing.assert_allclose(positions, run.final.positions, atol=close)


@pytest.mark.long
@pytest.mark.parametrize("robot", [platform, crank])
def test_directional_derivatives_with_drives_are_exact(robot, folder):
    """Of all derivatives and outputs along commands and states, beside differences; of the crank in
    a chart that is not its own."""
    robot = robot()
    outputs = ["positions", "rates", "accelerations", "reactions", "closure"]
    one = Instance(fmus.built(export(robot, outputs=outputs), folder))
    start = {f"start_rate__{each}": 3.0 for each in robot.independent if robot.mobility < 2}
    one.go(**start, **{f"command__{each}": 12.0 for each in robot.mechanism.drives})
    if robot.mobility < 2:
        leave_own_chart(one)
    inputs = [each for each in one.names if each.startswith(("command.", "force."))]
    unknowns = [f"der({each})" for each in one.state_names]
    unknowns += [each for each in one.names if each.startswith(("acceleration.", "reaction."))]
    states, random = one.states(), np.random.default_rng(3)
    closed = [k for k, each in enumerate(one.state_names) if each.startswith("drive.")]
    seeds = random.normal(size=len(closed) + len(inputs))
    knowns = [*(one.state_names[k] for k in closed), *inputs]
    exact = one.tangent(unknowns, knowns, seeds)
    ends, begin = [], one.get(*inputs)
    for sign in (1e-4, -1e-4):
        moved = states.copy()
        moved[closed] += sign * seeds[: len(closed)]
        one.put(moved)
        for name, x in zip(inputs, begin + sign * seeds[len(closed) :], strict=True):
            one.set(name, x)
        ends.append(one.get(*unknowns))
    found = (ends[0] - ends[1]) / 2e-4
    assert np.abs(exact[: len(states)]).max() > 1.0
    np.testing.assert_allclose(exact, found, atol=1e-6 * np.abs(exact).max())


def leave_own_chart(one: Instance) -> None:
    """Go on to a dead centre, where the own independent rate says nothing, with all events."""
    for k in range(1, 4000):
        one.put(one.states() + 5e-4 * one.rates())
        one.own.setTime(k * 5e-4)
        one.rates()
        if one.own.completedIntegratorStep()[0]:
            one.own.enterEventMode()
            one.update()
            one.own.enterContinuousTimeMode()
        if abs(np.sin(one.get("joint.crank")[0])) < 0.005:
            return
    raise AssertionError("no dead centre")


@pytest.mark.long
def test_forces_are_inputs_where_no_drives_are_given(folder):
    plain = export(platform(), drives=None)
    assert "force.slide_1" in plain.variables and "drive.slide_1.current" not in plain.variables
    assert any("the drives of slide_1, slide_3 are no part" in note for note in plain.notes)
    bounded = driven("prr3", slide_1=BOUND)
    one = Instance(fmus.built(export(bounded), folder))
    one.go(command__slide_1=9.0)
    free = lw.Robot("prr3")
    expected = free.forward_dynamics(free.home, [1.5, 0.0, 0.0])
    np.testing.assert_allclose(
        one.get(*(f"der(w.{each})" for each in free.independent)), expected, rtol=1e-12
    )


@pytest.mark.parametrize(
    ("drives", "sentence"),
    [
        ({"slide": lw.control.Lag(0.1)}, "there is no actuator 'slide' for a drive"),
        ({"slide_1": "lag"}, "the drive of 'slide_1' is 'lag'; give one of linkwork.control"),
        ([lw.control.Lag(0.1)], "give them by name"),
    ],
)
def test_what_is_no_drive_is_refused(drives, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        export(lw.Robot("prr3"), drives=drives)


def test_drives_that_read_turns_of_closing_joints_are_refused():
    """But not those that read the rate alone."""
    joints = tuple(lw.Robot("four_bar").coordinates)
    mechanism = lw.Robot("four_bar").mechanism.model_copy(update={"actuators": joints})
    robot = lw.Robot(mechanism)
    closing = next(each for each in joints if each not in robot.equations.tree.coordinates)
    servo = lw.control.Servo(gain=20.0, bias_position=-20.0)
    with pytest.raises(lw.LinkworkError, match="reads an angle that an FMU knows within a turn"):
        export(robot, drives={closing: servo})
    found = export(robot, drives={closing: lw.control.Servo(gain=20.0, bias_rate=-1.0)})
    assert f"command.{closing}" in found.variables


def turned_arm(name: str = "turn") -> lw.Robot:
    """Return two links, and an actuator of the turn of the second against the ground."""
    link = lw.Body(mass=1.0, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.02))
    joints = {
        "shoulder": lw.RevoluteJoint(connects=("ground", "upper")),
        "elbow": lw.RevoluteJoint(
            connects=("upper", "fore"), frames=(lw.Frame(position=(0.4, 0, 0)), lw.Frame())
        ),
    }
    turn = lw.Displacement(body="fore", base="ground", moment=(0, 0, 1))
    return lw.Robot(
        lw.Mechanism(
            bodies={"upper": link, "fore": link},
            joints=joints,
            transmissions={name: turn},
            actuators=(name,),
        )
    )


def test_a_drive_of_a_turn_between_bodies_is_that_of_a_run(folder):
    """No joint has that angle; it follows from the tree's coordinates."""
    robot = turned_arm()
    servo = lw.control.Servo(gain=20.0, bias_position=-20.0, bias_rate=-1.0)
    one = Instance(fmus.built(export(robot, drives={"turn": servo}), folder))
    one.go(command__turn=0.7)
    expected = robot.forward_dynamics(robot.home, [20.0 * 0.7])
    np.testing.assert_allclose(
        one.get(*(f"der(w.{each})" for each in robot.independent)), expected, rtol=1e-12
    )
