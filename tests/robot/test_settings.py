"""Settings: every door makes the same ones, and refuses the same."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields
from inspect import signature
from typing import get_args

import numpy as np
import pytest

import linkwork as lw
from linkwork.cli.motion_commands import OnSingular, simulate
from linkwork.robot.simulated import ACTING, OPTIONS
from linkwork.runs.accuracy import tightened
from linkwork.runs.passage import portion
from linkwork.runs.settings import ON_SINGULAR, Settings
from linkwork.simulation import DORMAND_PRINCE, RK4, SHARP_SMART
from linkwork.simulation.native_loop import LOOK, VOTES
from linkwork.sweeps import Study

DEFAULTS = {one.name: one.default for one in fields(Settings) if one.init}
OWN = {"samples"}  # a door may save at so many times where nothing is said
NOT_SETTINGS = {"self", "state", "states", "forces", "progress"} | ACTING


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(lw.robots.pendulum())


def defaults(door) -> dict:
    """The defaults of a door's arguments that say how runs are computed."""
    found = signature(door).parameters.items()
    return {name: one.default for name, one in found if name in DEFAULTS and name != "duration"}


@pytest.mark.parametrize("door", [lw.Robot.simulate, lw.Robot.ensemble, simulate])
def test_the_defaults_of_all_doors_are_those_of_settings(door):
    own = {name: given for name, given in defaults(door).items() if name not in OWN}
    assert own == {name: DEFAULTS[name] for name in own}


def test_the_defaults_of_studies_are_those_of_settings():
    own = {name: one.default for name, one in Study.model_fields.items() if name in DEFAULTS}
    own = {name: given for name, given in own.items() if name not in OWN | {"duration"}}
    assert own == {name: DEFAULTS[name] for name in own}
    assert {"method", "step", "rtol", "atol", "max_steps", "on_singular"} == set(own)


def test_what_to_do_at_a_bifurcation_is_listed_alike_at_all_doors():
    assert (
        tuple(OnSingular) == get_args(Study.model_fields["on_singular"].annotation) == ON_SINGULAR
    )


def test_what_doors_ask_beside_what_acts_are_the_settings():
    own = set(signature(lw.Robot.ensemble).parameters) - NOT_SETTINGS
    assert own == set(DEFAULTS)
    assert set(OPTIONS) - ACTING == set(DEFAULTS) - {"threads"}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"duration": 0.0}, "the duration is 0.0; give a positive number"),
        ({"rtol": -1e-6}, "rtol is -1e-06; give a positive number"),
        ({"rtol": 1e-15}, "rtol is 1e-15, less than what doubles can hold; give at least 2.3e-14"),
        ({"rtol": 2}, "rtol is 2; give a positive number below 1"),
        ({"atol": np.nan}, "atol is nan; give finite numbers"),
        ({"max_step": 0}, "max_step is 0; give a positive number"),
        ({"max_steps": 0.5}, "max_steps is 0.5; give a whole number, at least 1"),
        ({"step": 0.1}, "a step of 0.1 s needs a method that keeps to it: 'rk4' or "),
        ({"method": "rk4"}, r"rk4 needs a step \[s\]"),
        ({"on_singular": "jump"}, "on_singular is 'jump'; give 'stop' or 'step_over'"),
        ({"samples": 1}, "samples is 1; give at least 2, the first and the last"),
        ({"samples": 2.5}, "samples is 2.5; give a whole number, at least 1"),
        ({"samples": 3, "save_at": [0.0]}, "save_at and samples are both given; keep one of them"),
        ({"save_at": [0.0, np.inf]}, r"save_at\[1\] is inf; give finite numbers"),
    ],
    ids=lambda of: "" if isinstance(of, str) else next(iter(of)),
)
def test_all_doors_refuse_alike(robot, given, told):
    options = {"duration": 0.1} | given
    run = robot.simulate(robot.home, duration=0.1)
    doors = (robot.simulate, robot.ensemble)
    for door in (*(lambda door=door: door(robot.home, **options) for door in doors),
                 lambda: robot.resume(run, **options), lambda: Settings(**options)):  # fmt: skip
        with pytest.raises(lw.LinkworkError, match=f"^{told}"):
            door()


def test_threads_are_counted(robot):
    with pytest.raises(lw.LinkworkError, match=r"^threads is 0; give a whole number"):
        robot.ensemble(robot.home, duration=0.1, threads=0)


def test_settings_do_not_change():
    made = Settings(duration=1, save_at=0.5)
    with pytest.raises(FrozenInstanceError):
        made.rtol = 1.0  # pyright: ignore[reportAttributeAccessIssue]
    other = made.but(rtol=1e-3)
    assert (made.rtol, other.rtol, other.save_at.tolist()) == (1e-8, 1e-3, [0.5])


def test_a_method_that_is_asked_for_is_kept_and_another_follows_from_inputs_and_tolerance():
    def taken(smooth, **options):
        return Settings(duration=1.0, **options).suited(smooth).integrator

    assert taken(True) is SHARP_SMART
    assert taken(True, rtol=1e-5) is taken(False) is DORMAND_PRINCE
    assert taken(True, method="dormand_prince") is DORMAND_PRINCE
    assert taken(False, method="sharp_smart") is SHARP_SMART
    assert Settings(duration=1.0).leave_stiff
    assert all(0.6 * portion(nq) > LOOK + VOTES for nq in range(1, 1000, 7))  # of large robots too
    assert not Settings(duration=1.0, method="dormand_prince").leave_stiff


def test_a_companion_is_finer_than_users_may_ask_for():
    fine = tightened(Settings(duration=1.0, rtol=1e-13, atol=1e-14))
    assert (fine.rtol, fine.atol) == pytest.approx((1e-14, 1e-15))
    halved = tightened(Settings(duration=1.0, method="rk4", step=0.2))
    assert (halved.integrator, halved.rtol) == (RK4(0.1), 1e-8)
    assert halved.told == {"step": 0.1} and fine.told == {"rtol": fine.rtol, "atol": fine.atol}
