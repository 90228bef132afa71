"""Members that cannot be are told one by one, and numbers that nothing may have before anything is
computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork.control.cylinders import BEYOND
from linkwork.mechanism import MechanismError
from linkwork.sweeps.chunk import bench_of, empty
from linkwork.sweeps.preparation import REFUSED, UNREACHABLE

from tests.sweeps.carts import CART, study, whole

RAIL = CART.joints["rail"]
CYLINDER = {
    "area_a": 1e-3,
    "area_b": 1e-3,
    "stroke": 0.3,
    "retracted": 0.0,
    "supply": 1e7,
    "exhaust": 1e5,
    "initial_a": 1e5,
    "initial_b": 1e5,
    "dead_volume": 1e-5,
}


def test_frictions_that_no_description_may_hold_together_are_refused_member_by_member():
    friction = lw.Friction(coulomb=1.0, static=1.5, stribeck_rate=0.01)
    rubbing = CART.model_copy(
        update={"joints": {"rail": RAIL.model_copy(update={"friction": friction})}}
    )
    vary = {
        "rail.friction.coulomb": {"type": "uniform", "low": 0.5, "high": 1.4},
        "rail.friction.static": {"type": "uniform", "low": 1.1, "high": 2},
    }
    found = whole(study(robot=rubbing, vary=vary))
    never = found["rail.friction.static"] < found["rail.friction.coulomb"]
    assert 0 < never.sum() < 40
    np.testing.assert_array_equal(found["status"], np.where(never, REFUSED, 0))


def rubbing(coulomb, static):
    """The cart on a rail that rubs."""
    friction = lw.Friction(coulomb=coulomb, static=static, stribeck_rate=0.01)
    rail = RAIL.model_copy(update={"friction": friction})
    return CART.model_copy(update={"joints": {"rail": rail}})


def test_frictions_are_judged_by_what_varies_beside_them_not_by_the_described_ones():
    """Sliding friction above the described static one, below all that it is told with."""
    vary = {
        "rail.friction.coulomb": {"type": "uniform", "low": 1.6, "high": 1.9},
        "rail.friction.static": {"type": "uniform", "low": 2, "high": 3},
    }
    assert (whole(study(robot=rubbing(1.0, 1.5), vary=vary))["status"] == 0).all()
    vary["rail.friction.coulomb"]["high"] = 3.5
    with pytest.raises(
        MechanismError, match=r"coulomb: reaches 3\.5, .* static friction 3 is below"
    ):
        study(robot=rubbing(1.0, 1.5), vary=vary)
    del vary["rail.friction.static"]
    with pytest.raises(
        MechanismError, match=r"reaches 1\.6, .* static friction 1\.5 is below that"
    ):
        study(robot=rubbing(1.0, 1.5), vary=vary)


def test_formulas_that_bend_are_judged_at_every_member(tmp_path):
    """A mass that is above zero at both ends of what it follows from, and below between them."""
    CART.save(path := tmp_path / "cart.yaml")
    text = path.read_text().replace("linkwork: 1\n", "linkwork: 1\nlet: {x: 1}\n")
    path.write_text(text.replace("mass: 2.0", "mass: 4*(x - 0.5)**2 - 0.1"))
    robot = lw.Mechanism.load(path)
    found = whole(study(robot=robot, vary={"x": {"type": "uniform", "low": 0.0, "high": 1.0}}))
    never = 4 * (found["x"] - 0.5) ** 2 <= 0.1
    assert 0 < never.sum() < 40
    np.testing.assert_array_equal(found["status"], np.where(never, REFUSED, 0))
    free = lw.Robot(robot).free("x")
    with pytest.raises(lw.LinkworkError, match=r"member 2: .*mass: -0\.1 is (not above|below) 0"):
        free.ensemble(free.home, [0.1], {"x": [0.0, 1.0, 0.5, 0.9]}, duration=1e-3)


def test_members_of_which_the_drive_cannot_start_are_out_of_reach():
    """In a study; an ensemble is refused."""
    found = whole(
        study(
            duration=1e-3,
            start={"joints": {"rail": 0.1}},
            drives={"rail": {"type": "hydraulic_cylinder"} | CYLINDER},
            vary={
                "start.joints.rail": {"type": "uniform", "low": -0.1, "high": 0.2},
                "drives.rail.stroke": {"type": "uniform", "low": 0.1, "high": 0.3},
            },
        )
    )
    x = found["start.joints.rail"]
    part = x / found["drives.rail.stroke"]
    outside = (part < -BEYOND) | (part > 1 + BEYOND)
    assert 0 < outside.sum() < 40
    np.testing.assert_array_equal(found["status"], np.where(outside, UNREACHABLE, 0))
    robot, drives = lw.Robot(CART), {"rail": lw.control.HydraulicCylinder(**CYLINDER)}
    options = {"duration": 1e-3, "drives": drives}
    start = robot.state({"rail": 0.2})
    with pytest.raises(lw.LinkworkError, match=r"0\.2 m lies outside .* to 0\.1 m"):
        robot.ensemble(start, [0.1], {"rail.stroke": [0.3, 0.1]}, **options)
    none = robot.ensemble(robot.state({"rail": np.zeros(0)}), [0.1], **options)
    assert len(none) == 0


@pytest.mark.parametrize(
    ("acting", "name", "sentence"),
    [
        (
            {"drives": {"rail": {"type": "lag", "time_constant": 0.1}}},
            "drives.rail.time_constant",
            "reaches -0.049.*, which the drive may not have: .*give a positive number",
        ),
        (
            {
                "controllers": {
                    "one": {"type": "sliding_mode", "slope": 1, "gain": 1, "boundary": 0.1}
                    | {"goal": {"type": "pose", "joints": {"rail": 0.1}}}
                },
                "forces": {},
            },
            "controllers.one.boundary",
            "reaches -0.049.*, which the controller may not have: boundary: .*not above 0",
        ),
    ],
)
def test_numbers_that_nothing_that_acts_may_have(acting, name, sentence):
    vary = {name: {"type": "normal", "mean": 0.01, "deviation": 0.01}}
    with pytest.raises(MechanismError, match=sentence):
        study(vary=vary, **acting)


def test_a_zero_between_two_ends_that_are_possible_is_none():
    belt = {"belt": lw.mechanism.Combination(ratios={"rail": 1.0})}
    robot = lw.Robot(CART.model_copy(update={"transmissions": belt, "actuators": ("belt",)}))
    free = robot.free("belt.ratios.rail")
    with pytest.raises(lw.LinkworkError, match=r"member 1: .*combines no coordinate"):
        free.ensemble(free.home, [0.1], {"belt.ratios.rail": [-1.0, 0.0, 1.0]}, duration=1e-3)


def test_numbers_of_a_drive_are_judged_with_those_that_vary_beside_them():
    muscle = {"type": "muscle", "peak_force": 10, "optimum_length": 0.5, "least_excitation": 0.5}
    vary = {
        "drives.rail.least_excitation": {"type": "uniform", "low": 0.1, "high": 0.2},
        "drives.rail.largest_excitation": {"type": "uniform", "low": 0.3, "high": 0.4},
    }
    changes = {"drives": {"rail": muscle}, "forces": {"rail": 0.3}, "duration": 1e-3}
    assert (whole(study(vary=vary, **changes))["status"] == 0).all()
    vary["drives.rail.least_excitation"]["high"] = 0.35
    with pytest.raises(MechanismError, match=r"reaches 0\.35, 0\.3, .* so that 0 <= least"):
        study(vary=vary, **changes)


def test_more_controllers_than_a_byte_can_number():
    bench = bench_of(study(duration=1e-3))
    many = replace(bench, cases=bench.cases * 130)
    assert empty(many, 1)["controller"].dtype == np.int32
