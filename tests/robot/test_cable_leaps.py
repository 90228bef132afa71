"""Cables at surfaces: no run goes on silently where the energy of a cable would leap, and a cable
that ends on its drum is as long as plane geometry has it."""

import warnings

import casadi as ca
import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.stepping import StepError

CRANK = """linkwork: 1
bodies: {{crank: {{mass: 1, inertia: {{xx: 0.02, yy: 0.05, zz: 0.05}}}}}}
joints: {{j: {{type: revolute, connects: [ground, crank], axis: [0, 0, 1]}}}}
transmissions:
  pull: {{type: cable, path: [{{type: point, body: ground, point: [0.5, 0, 0]}},
          {surface}, {{type: point, body: crank, point: {end}}}], {law}}}
actuators: [pull]
"""
LED = (
    "{type: sphere, body: ground, radius: 0.1, side: {type: point, body: ground, point: [0, 1, 0]}}"
)
SHORT = "{type: cylinder, body: ground, radius: 0.1}"
SPRING = "spring: {stiffness: 2, rest: 0.1}"


def crank(surface: str, law: str, end: str = "[0.3, 0, 0]") -> lw.Robot:
    free = ("transmissions.pull.spring.stiffness",) if law == SPRING else ()
    text = CRANK.format(surface=surface, law=law, end=end)
    return lw.Robot(lw.Mechanism.parse(text), free=free)


@pytest.mark.parametrize(
    ("surface", "law", "leap"),
    [(LED, SPRING, 1.5 * np.pi), (SHORT, "inertia: 0.2", np.pi), (SHORT, SPRING, None)],
)
def test_a_run_ends_where_a_cable_would_leap_with_energy(surface, law, leap):
    """By a side at the half-line behind the surface, the shorter way opposite to the other end;
    without inertia only the rate leaps there. Steps end where it touches the surface at first."""
    robot = crank(surface, law)
    run = robot.simulate(robot.state([1.5], [8.0]), duration=0.7)
    touching = np.arccos(0.1 / 0.5) + np.arccos(0.1 / 0.3)
    row = abs(run.time - run.coords["event_time"].values[0]).argmin()
    assert run["joint_position"].values[row, 0] == pytest.approx(touching, abs=1e-8)
    exact = leap is not None and law == SPRING
    assert abs(run["energy_balance"].values).max() < (1e-9 if exact else 1e-6)
    if leap is None:
        assert run.success
        return
    assert "the event 'pull leaps at the " in run.message and "of ground (path.1)'" in run.message
    assert float(run.final["j"]) == pytest.approx(leap - 1e-3, abs=1e-8)
    # Members end there, too, and whoever goes on does so knowingly.
    members = robot.ensemble(robot.state([[1.5], [1.5]], [[8.0], [8.0]]), duration=0.7, samples=2)
    assert len(members.failed) == 2
    assert robot.resume(run, duration=0.1).success


def test_a_cable_may_end_on_its_drum():
    """The end lies on the circle but for rounding, on either side of it."""
    end = 0.1 * np.array([np.cos(0.1), np.sin(0.1)])
    robot = crank("{type: cylinder, body: crank, radius: 0.1}", SPRING, str([*end.tolist(), 0]))
    equations = robot.equations
    of = [equations.tree.q, equations.p]
    length = ca.Function("length", of, [equations.joints.position("pull")])
    for q in np.linspace(-3.0, 3.0, 61):
        turn = abs(q + 0.1)
        past = min(turn, 2 * np.pi - turn) - np.arccos(0.1 / 0.5)
        chord = np.sqrt(0.26 - 0.1 * np.cos(turn))
        wound = np.sqrt(0.24) + 0.1 * past
        assert float(length(q, 2.0)) == pytest.approx(wound if past > 0 else chord, abs=1e-14)


def test_where_a_cable_comes_off_rounding_does_not_take_it_to_the_other_side():
    """A tenth of the states within 1e-8 rad were accelerated the other way."""
    robot = crank(SHORT, SPRING)
    off = 2 * np.pi - np.arccos(0.1 / 0.5) - np.arccos(0.1 / 0.3)
    q = off + np.outer([1e-11, 1e-9, 1e-7], np.linspace(-1, 1, 101)).reshape(-1, 1)
    found = robot.forward_dynamics(robot.state(q, np.zeros_like(q)), [0.0])
    assert abs(found - found[50]).max() < 1e-6


LEAPS = [(LED, SPRING, 1.5 * np.pi), (SHORT, "inertia: 0.2", np.pi)]


@pytest.mark.parametrize(("surface", "law", "leap"), LEAPS)
def test_whoever_begins_where_a_cable_leaps_is_told(surface, law, leap):
    robot = crank(surface, law)
    there, beside = robot.state([leap - 5e-4], [1.0]), robot.state([leap - 2e-3], [-1.0])
    told = {"match": "a run begins where pull leaps at the .* of ground .path.1., within 1e-3 rad"}
    with pytest.warns(ModelWarning, **told):
        robot.simulate(there, duration=1e-3)
    with pytest.warns(ModelWarning, match="1 state of 2"):
        robot.ensemble(robot.state([[leap - 5e-4], [1.0]], [[1.0], [1.0]]), duration=1e-3)
    with pytest.warns(ModelWarning, **told):
        stepper = robot.stepper(there, 1e-3)
    with pytest.warns(ModelWarning, **told):
        stepper.reset(there)
    many = robot.stepper(robot.state([[1.5], [1.5]], [[1.0], [1.0]]), 1e-3)
    with pytest.warns(ModelWarning, **told):
        many.reset(1, there)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = robot.simulate(beside, duration=1e-3)
        robot.resume(run, duration=1e-3)
        robot.stepper(beside, 1e-3).step()


@pytest.mark.parametrize("speed", [0.5, 8.0, -8.0])
@pytest.mark.parametrize(("surface", "law", "leap"), LEAPS)
def test_steppers_stop_before_a_leap_as_runs_do(surface, law, leap, speed):
    """At 8 rad/s the range in which a cable is as good as leaping is passed within a step."""
    robot = crank(surface, law)
    start = robot.state([leap - 0.02 * np.sign(speed)], [speed])
    ends = robot.simulate(start, duration=1.0, method="rk4", step=1e-3)
    assert ends.status is lw.Status.EVENT
    stepper = robot.stepper(start, 1e-3)
    with pytest.raises(StepError, match="ended by the event 'pull leaps at") as told:
        stepper.step(steps=1000)
    assert told.value.status is lw.Status.EVENT
    assert told.value.time == pytest.approx(ends.time[-1], abs=1e-12)
    np.testing.assert_allclose(stepper.q, ends["joint_position"].values[-1], rtol=0, atol=1e-12)
    stepper.step()  # whoever goes on does so knowingly
    # Members keep the state before the step; the others go on.
    away = robot.state([1.0], [0.1])
    pair = [
        np.array([getattr(one, part) for one in (start, away)] * 5)
        for part in ("positions", "rates")
    ]
    starts = robot.state(*pair)
    many = robot.stepper(starts, 1e-3)
    many.step(steps=30)
    many.step(steps=20)
    whole = int(ends.time[-1] / 1e-3)
    assert many.status.tolist() == [int(lw.Status.EVENT), 0] * 5
    assert many.time[::2] == pytest.approx(whole * 1e-3) and many.time[1::2] == pytest.approx(0.05)
    other = robot.stepper(start, 1e-3)
    other.step(steps=whole)
    np.testing.assert_array_equal(many.y[::2], np.tile(other.y, (5, 1)))
    with pytest.raises(StepError, match="pull leaps at"):
        many.alone(0).step()
    many.reset(0, away)
    many.step(steps=5)
    assert many.status[0] == 0
