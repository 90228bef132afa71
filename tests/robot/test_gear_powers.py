"""Gears whose coordinates have powers: a slide on a curve, by hand, where it stands still too."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import save

from tests.equations.evaluation import close

M, J, G = 1.5, 0.2, 9.81
C = np.array([0.0, -0.3, 0.25, 0.4, -0.1])  # of z by the angle: c_0, c_1 ...


def lift(actuators=("turn",), c=C, **reference: float) -> lw.Robot:
    """Return a wheel that lifts a mass by z = c_0 + c_1 angle + c_2 angle^2 + ..."""
    bodies = {
        "wheel": lw.Body(mass=1.0, inertia=lw.Inertia(xx=J, yy=J, zz=J)),
        "mass": lw.Body(mass=M),
    }
    joints = {
        "turn": lw.RevoluteJoint(connects=("ground", "wheel"), axis=(0, 0, 1)),
        "z": lw.PrismaticJoint(connects=("ground", "mass"), axis=(0, 0, 1)),
        "cam": lw.GearJoint(
            ratios={"z": 1.0, "turn": -c[1]}, powers={"turn": tuple(-c[2:])}, offset=c[0]
        ),
    }
    return lw.Robot(
        lw.Mechanism(
            bodies=bodies,
            joints=joints,
            actuators=actuators,
            reference=reference,
            gravity=(0, 0, -G),
        )
    )


def by_hand(angle: float, rate: float, moment: float) -> float:
    """Return the angle's acceleration: (J + m z'^2) a + m z' z'' w^2 + m g z' = moment."""
    z = np.polynomial.Polynomial(C)
    slope, bend = z.deriv()(angle), z.deriv(2)(angle)
    return (moment - M * slope * (bend * rate**2 + G)) / (J + M * slope**2)


def test_a_mass_on_a_curve_moves_as_by_hand():
    robot = lift()
    for angle, rate, moment in [(0.0, 1.0, 0.0), (1.3, -2.0, 3.0), (-0.7, 0.5, -1.0)]:
        state = robot.assemble({"turn": angle}).with_rates({"turn": rate})
        close(state["z"], np.polynomial.Polynomial(C)(angle), 1e-14)
        a = robot.forward_dynamics(state, [moment])
        close(a, [by_hand(angle, rate, moment)], 1e-12)
        close(robot.inverse_dynamics(state, a), [moment], 1e-12)
        # The gear pushes the mass by its multiplier, whose slope at the slide is 1.
        slope, bend = (np.polynomial.Polynomial(C).deriv(k)(angle) for k in (1, 2))
        lifted = M * (G + slope * a[0] + bend * rate**2)
        close(robot.reactions(state, [moment]).gears["cam"], lifted, 1e-12)


def test_energy_is_kept_and_the_gear_stays_closed():
    robot = lift()
    start = robot.assemble({"turn": -1.0}).with_rates({"turn": 1.0})
    run = robot.simulate(start, duration=2.0, rtol=1e-10)
    assert run.status == 0
    assert run.closure_error < 1e-13
    assert abs(run.final["turn"] + 1.0) > 0.1
    close(sum(robot.energy(run.final)), sum(robot.energy(start)), 1e-8)


def test_the_wheel_is_independent_where_the_mass_stands_still():
    """A driven mass at the crest of its curve: its rate says nothing of the wheel's."""
    robot = lift(("z",), np.array([0.1, 0.0, -0.5]))
    assert robot.independent == ("turn",)
    state = robot.home.with_rates({"turn": 2.0})
    close(
        robot.joint_accelerations(state, robot.forward_dynamics(state, [5.0])), [0.0, -4.0], 1e-13
    )
    run = robot.simulate(robot.assemble({"turn": -0.5}).with_rates({"turn": 4.0}), duration=0.5)
    assert run.status == 0
    assert run.final["turn"] > 0.5
    assert run.closure_error < 1e-13


def test_coefficients_can_be_free():
    robot = lift().free("cam.powers.turn.0", "cam.powers.turn.2")
    assert [*robot.parameters] == ["cam.powers.turn.0", "cam.powers.turn.2"]
    other = robot.with_parameters({"cam.powers.turn.0": 0.7})
    named = lift(c=np.array([0.0, -0.3, -0.7, 0.4, -0.1]))
    for of in (other, named):
        state = of.assemble({"turn": 0.8}).with_rates({"turn": 1.0})
        found = of.forward_dynamics(state, [1.0])
        gear = of.reactions(state, [1.0]).gears["cam"]
        if of is other:
            wanted = found, gear
    close(wanted[0], found, 1e-13)
    close(wanted[1], gear, 1e-13)


def test_the_loop_equation_is_printed():
    assert "0.1 q_{1}^{4} -  0.4 q_{1}^{3} -  0.25 q_{1}^{2} + 0.3 q_{1} + q_{2}" in lift().latex()


def test_a_file_holds_powers(tmp_path):
    mechanism = lift().mechanism
    mechanism.save(tmp_path / "cam.yaml")
    assert lw.Mechanism.load(tmp_path / "cam.yaml") == mechanism
    for suffix in ("urdf", "sdf"):
        with pytest.raises(lw.LinkworkError, match="by ratios"):
            save(mechanism, tmp_path / f"cam.{suffix}")


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"ratios": {"a": 1.0, "b": 2.0}, "powers": {"c": [1.0]}}, "'c' has no ratio; give one"),
        ({"ratios": {"a": 1.0, "b": 1.0}, "powers": {"b": [float("nan")]}}, "powers.b.0"),
        (
            {
                "ratios": {"a": 1.0, "b": 1.0},
                "powers": {"b": [0.5]},
                "teeth": {"at": "b", "friction": {"coefficient": 0.1}},
            },
            "does not couple by a ratio alone; give one of a",
        ),
    ],
)
def test_refusals(fields, told):
    with pytest.raises(lw.MechanismError, match=told):
        lw.GearJoint(**fields)
