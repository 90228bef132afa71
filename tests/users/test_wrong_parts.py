"""Parts of descriptions, drives, controllers, events and paths made with values of a wrong kind:
either they are taken, or one sentence says what would be right."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis, control, gym, lab, mechanism, paths, sweeps

NAN = float("nan")
FRAME, SLIDING = mechanism.Frame(), mechanism.Sliding(coefficient=0.1)
PIN = mechanism.ViaPoint(body="a")
BODY = mechanism.Body(mass=1.0, inertia=mechanism.Inertia(zz=1.0))
NEEDED = {
    "Body": {"mass": 1.0},
    "BoxDrag": {"body": "a", "size": (1, 1, 1)},
    "Bristle": {"stiffness": 1e3},
    "Cable": {"path": [PIN, mechanism.ViaPoint(body="b")]},
    "Combination": {"ratios": {"a": 1}},
    "Displacement": {"body": "a", "base": "b", "force": (1, 0, 0)},
    "Ellipsoid": {"radii": (1, 1, 1)},
    "EllipsoidDrag": {"body": "a", "radii": (1, 1, 1)},
    "GearJoint": {"ratios": {"a": 1, "b": 2}},
    "GearTeeth": {"friction": SLIDING, "at": "a"},
    "HeightField": {"heights": ((0, 0), (0, 1)), "spacing": (1, 1)},
    "Inertia": {"zz": 1.0},
    "JournalBearing": {"friction": SLIDING, "radius": 0.1},
    "Lift": {"body": "a", "mass": 1.0},
    "Mechanism": {
        "bodies": {"a": BODY},
        "joints": {"j": mechanism.RevoluteJoint(connects=("ground", "a"))},
    },
    "MeshFile": {"file": "a.stl"},
    "PointSpring": {"connects": ("a", "b"), "points": ((0, 0, 0), (0, 0, 1))},
    "Polygon": {"points": [(0, 0), (1, 0), (0, 1)], "thickness": 0.1},
    "PulleyBlock": {"divisor": 2},
    "SliderCrank": {"pin": PIN, "body": "b", "rod": 1.0},
    "SlidingBearing": {"friction": SLIDING},
    "Stop": {"stiffness": 1e3},
    "Thrust": {"body": "a", "force": (1, 0, 0)},
    "Tool": {"body": "a"},
    "ViaPoint": {"body": "a"},
}


def wrong() -> list[Any]:
    """Return what fits few fields: other kinds, numbers that are none, arrays, huge numbers."""
    plain = [None, "nonsense", "", NAN, 10**30, 10**400, 1e300, 1e-320, True, [], [1.0, 2.0], {}]
    odd = [{1: 2}, {"a": "b"}, {1, 2}, b"x", object(), lambda *given: given, iter([1, 2]), type]
    arrays = [np.zeros((2, 2)), np.zeros((0, 3)), np.array(["a"] * 3), np.array([None, 1, 2])]
    hidden = np.ma.masked_array([1.0, 2, 3], [False, True, False])
    return [*plain, *odd, *arrays, np.array([1j, 2, 3]), hidden, 1 + 2j, [10**30] * 3, ["a", "a"]]


def faults(make: Callable[..., Any], given: dict[str, Any], names: Any) -> list[str]:
    """Return what is raised that is no sentence of ours, each argument made wrong in turn."""
    found = []
    for name in names:
        for value in wrong():
            try:
                repr(make(**{**given, name: value}))
            except lw.LinkworkError as refusal:
                if "\n" in str(refusal) or len(str(refusal)) > 700:
                    found.append(f"{name}={value!r}: {refusal}"[:900])
            except Exception as error:
                found.append(f"{name}={value!r}: {type(error).__name__}: {error}"[:900])
    return found


RECORDS = [
    kind
    for kind in (getattr(mechanism, name) for name in mechanism.__all__)
    if inspect.isclass(kind) and hasattr(kind, "model_fields") and kind.__name__ != "PairJoint"
]


@pytest.mark.parametrize("kind", RECORDS, ids=lambda kind: kind.__name__)
def test_each_field_of_a_description_made_wrong_in_turn(kind):
    usual = {"connects": ("a", "b"), "length": 1.0, "pitch": 0.1, "radius": 0.1, "size": (1, 1, 1)}
    usual |= {"axis": (0, 0, 1), "point": (0, 0, 1), "body": "a", "force": (1, 0, 0)}
    usual |= {"surfaces": [mechanism.Points(points=[(0, 0, 0)]), mechanism.Plane()]}
    usual |= {"points": [(0, 0, 0)], "stiffness": 1e3}
    given = NEEDED.get(kind.__name__) or {
        name: usual[name] for name, field in kind.model_fields.items() if field.is_required()
    }
    assert kind(**given)
    assert not faults(kind, given, kind.model_fields)


@pytest.mark.parametrize("kind", control.DRIVES, ids=lambda kind: kind.__name__)
def test_each_number_of_a_drive_made_wrong_in_turn(kind):
    given = dict.fromkeys(control.records.described(kind), 0.5) | {"stroke": 1.0}
    given |= {"largest_length": 1.5, "lengthening": 1.5, "largest_excitation": 1.0}
    own = inspect.signature(kind).parameters
    assert not faults(kind, {k: v for k, v in given.items() if k in own}, own)


def test_what_is_said_of_parts_names_them_and_what_would_be_right():
    cylinder = dict.fromkeys(control.records.described(control.PneumaticCylinder), 0.5)
    sliding = {"goal": {"hinge_1": 0.1}, "slope": 1.0, "gain": 1.0, "model": None}
    joint = mechanism.RevoluteJoint
    for sentence, ask in {
        "connects: {'a'} is a set, which has no order; give one value, or a list": (
            lambda: joint(connects={"a"})
        ),
        "inertia.1: 1 is not text; put it in quotes to use it as a name: '1'": (
            lambda: mechanism.Body(mass=1.0, inertia={1: 2})
        ),
        "position.0: 1j is a complex number; give a real one": (
            lambda: mechanism.Frame(position=(1j, 0, 0))
        ),
        "exponent: True is a truth value; give a number": (
            lambda: mechanism.Stop(stiffness=1.0, exponent=True)
        ),
        "axis: give 3 entries": lambda: joint(connects=("a", "b"), axis=iter([1, 2])),
        "resistance of DCMotor is None; give numbers": lambda: control.DCMotor(None, 1.0, 1.0),
        "leakage of HydraulicCylinder is -1; give a number, not below zero": (
            lambda: control.HydraulicCylinder(*[0.5] * 8, leakage=-1)
        ),
        "temperature of PneumaticCylinder is 0; give a positive number": (
            lambda: control.PneumaticCylinder(**{**cylinder, "temperature": 0})
        ),
        "critical_ratio of PneumaticCylinder is 2; give a ratio of pressures, at most 1": (
            lambda: control.PneumaticCylinder(**{**cylinder, "critical_ratio": 2})
        ),
        "numbers of Muscle do not fit; give them so that 0 <= initial_activation <= 1": (
            lambda: control.Muscle(1.0, 1.0, initial_activation=2.0)
        ),
        "the boundary of SlidingMode is 0; give a positive number": (
            lambda: control.SlidingMode(boundary=0, **sliding)
        ),
        "the parts of a description are not changed in place; make another description": (
            lambda: lw.robots.prr3().bodies.update(platform=BODY)
        ),
        "name of a frozen Mechanism is not set; make another": (
            lambda: setattr(lw.robots.prr3(), "name", "other")
        ),
        "terminal of the event 'event' is 1; give True or False": (
            lambda: control.Event(len, terminal=1)
        ),
        "compiled is 'no'; give True or False": lambda: control.Sampler(len, compiled="no"),
        "the robot is None; give a linkwork.Robot": lambda: control.limit_events(None),
        "the law of a path gave 1; let it return three arrays": (
            lambda: paths.line([0, 0], [1, 0], law=lambda tau: 1).sample([0, 1], 1.0)
        ),
        "the duration is -1; give a positive number": (
            lambda: paths.line([0, 0], [1, 0]).sample([0, 1], -1)
        ),
        "the square of the number of turns is inf": lambda: paths.circle([0, 0], 1.0, turns=1e300),
    }.items():
        with pytest.raises(lw.LinkworkError) as refusal:
            ask()
        assert sentence in str(refusal.value)


def test_huge_and_tiny_numbers_at_the_doors_of_a_robot():
    robot = lw.Robot("pendulum")
    state, run = robot.home, robot.simulate(robot.home, [0.0], duration=0.01)
    line = paths.line([0.0], [0.1])
    for sentence, ask in {
        "rates is 1000": lambda: robot.state(state.positions, 10**400),
        "the duration is 1000": lambda: robot.simulate(state, [0.0], duration=10**400),
        "samples is 1e+300; give at most 100,000,000": lambda: run.resampled(1e300),
        "length is 9.99989e-321, nearer to zero than any number that a computer holds in full": (
            lambda: robot.reactions(state, [0.0], length=1e-320)
        ),
        "the square of the duration is inf": lambda: line.sample([0.0], 1e300),
        "which numbers of steps do not tell apart": (
            lambda: robot.stepper(state, 1e-3, [0.0]).reset(time=1e30)
        ),
        "the times have the shape (1, 1)": lambda: line.sample([[0.0]], 1.0),
        "branch is array": lambda: robot.assemble({"hinge_1": 0.1}, branch=np.zeros(2)),
        "weights is 'all'; give numbers": (
            lambda: robot.inverse_dynamics_derivatives(state, [0.0], weights="all")
        ),
        "the named quantities are 3; give them by name": (
            lambda: robot.mechanism.with_quantities(3)
        ),
        "the coordinates are 3; give them by name": lambda: robot.mechanism.with_reference(3),
        "the response is infinite at one of the frequencies": (
            lambda: lw.Robot(zero_gravity()).linearise(state).response(0.0)
        ),
    }.items():
        with pytest.raises(lw.LinkworkError) as refusal:
            ask()
        assert sentence in str(refusal.value), refusal.value
    assert line.sample(0.5, 1.0)[0].shape == (1, 1)


def zero_gravity() -> mechanism.Mechanism:
    """Return a pendulum that nothing pulls back: its frequency is zero."""
    return lw.Robot("pendulum").mechanism.model_copy(update={"gravity": (0.0, 0.0, 0.0)})


def test_results_and_processes_asked_for_what_they_cannot_tell():
    robot, other = lw.Robot("pendulum"), lw.Robot("five_bar")
    law = {"observation": lambda t, s: [0.0], "reward": lambda t, s, action: 0.0}
    pushed = robot.simulate(robot.home, lambda t, s: [lw.math.sin(9 * t)], duration=0.5, samples=20)
    found = analysis.identify(robot, pushed)
    ball = {"body": "plate", "height": 0.1, "radius": 0.1, "gravity": (0, 0, -9.81)}
    masses = {"rod_1.mass": {"type": "levels", "low": 1, "high": 2, "count": 3}}
    study = {"robot": robot.mechanism, "duration": 1.0, "vary": masses}
    study["outputs"] = {"energy": "final energy"}
    elbow = other.in_chart(other.home, ["elbow_1", "elbow_2"])
    told = analysis.identify(
        other, other.simulate(other.home, [0.1, 0.2], duration=0.2, samples=200)
    )
    for sentence, ask in {
        "accelerations is 'nonsense'; give 1 number: hinge_1": (
            lambda: found.forces(robot.home, "nonsense")
        ),
        "bring them to those of home: robot.in_chart": lambda: told.forces(elbow, [0.0, 0.0]),
        "q is [1.0, 2.0]; give 4 numbers": (
            lambda: analysis.jacobians(other)(np.array([1.0, 2.0]).tolist())
        ),
        "the radius of a ball is -1; give a positive number": (
            lambda: gym.RollingBall(**{**ball, "radius": -1})
        ),
        "the gravity of a ball is (0, 0); give three numbers": (
            lambda: gym.RollingBall(**{**ball, "gravity": (0, 0)})
        ),
        "the id is None; give a name": lambda: gym.register(None, lambda: None, 5),
        "rtol: 2 is not below 1; expected relative tolerance, below 1": (
            lambda: sweeps.Study(**study, rtol=2)
        ),
        "max_steps: True is a truth value; give a number": (
            lambda: sweeps.Study(**study, max_steps=True)
        ),
        "there is no engine ['mujoco']; the engines are": (
            lambda: lab.engines.build(["mujoco"], robot.mechanism)
        ),
        "the mechanism is 3; give a linkwork.Mechanism": lambda: lab.engines.build("mujoco", 3),
        "num_envs is 1000": (
            lambda: gym.Environments(
                gym.DecisionProcess(robot=robot, dt=0.1, low=-1.0, high=1.0, **law), 10**30
            )
        ),
    }.items():
        with pytest.raises(lw.LinkworkError) as refusal:
            ask()
        assert sentence in str(refusal.value), refusal.value


def test_a_tool_led_in_no_coordinate_is_refused():
    robot = lw.Robot("prr3")
    for ask in (robot.jacobian, robot.task_values, robot.task_rates):
        with pytest.raises(lw.LinkworkError, match="no coordinate of the tool is named"):
            ask(robot.home, [])


def test_sliding_mode_leads_a_robot_of_one_actuator():
    robot = lw.Robot("pendulum")
    goal = robot.state(robot.home.positions + 0.1)
    law = control.SlidingMode(goal=goal, slope=20.0, gain=5.0, boundary=0.05, model=robot)
    run = robot.simulate(robot.home, law, duration=1.0)
    assert abs(run["joint_position"][-1, 0] - goal.positions[0]) < 1e-5
