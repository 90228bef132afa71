"""The list of methods: what is listed once is known everywhere, also to the docs."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import linkwork as lw
from linkwork.runs.ensemble import in_lanes
from linkwork.simulation import BOGACKI_SHAMPINE, Tableau, methods

from tests.cli.calls import call
from tests.simulation.test_orders import METHODS as MEASURED
from tests.sweeps.carts import study

DOCS = Path(__file__).parents[2] / "docs"
NEW = "bogacki_shampine"


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(lw.robots.double_pendulum())


@pytest.fixture
def listed(monkeypatch):
    """One more pair on the list, and nowhere else."""
    entry = methods.Entry(Tableau, lambda: BOGACKI_SHAMPINE, "order 3")
    monkeypatch.setitem(methods.METHODS, NEW, entry)


def table() -> dict[str, tuple[bool, str]]:
    """The table of the docs: whether a step is asked for, and what a method is for, by name."""
    text = (DOCS / "howto" / "simulate.md").read_text()
    rows = re.findall(r'^\| `"(\w+)"`(.*?) \| (.*) \|$', text, flags=re.MULTILINE)
    return {name: (step == " with `step=`", use) for name, step, use in rows}


def test_the_table_of_the_docs_is_the_list():
    entries = methods.METHODS.items()
    assert table() == {name: (entry.fixed, entry.use) for name, entry in entries}


def test_the_door_names_every_method():
    named = re.findall(r'"(\w+)"', str(lw.Robot.simulate.__doc__))
    assert set(methods.METHODS) <= set(named)


@pytest.mark.parametrize("name", methods.METHODS)
def test_what_a_method_is_said_to_be_it_is(name):
    entry = methods.METHODS[name]
    made = methods.integrator(name, 0.01 if entry.fixed else None)
    assert isinstance(made, entry.kind)
    assert (made.step is not None) == entry.fixed
    assert made in [make(0.01) for make, *_ in MEASURED.values()]
    assert (made.stiff, made.in_lanes) == (name == "rodas", entry.kind is Tableau)


def test_a_pair_that_is_listed_runs_alone_and_in_lanes(robot, listed):
    options = {"duration": 0.2, "rtol": 1e-5, "method": NEW, "save_at": [0.1, 0.2]}
    run = robot.simulate(robot.home, **options)
    assert run.success and run.attrs["method"] == "Bogacki-Shampine 3(2)"
    exact = robot.simulate(robot.home, duration=0.2, save_at=[0.1, 0.2], rtol=1e-12)
    ours, theirs = (one["joint_position"].values for one in (run, exact))
    np.testing.assert_allclose(ours, theirs, atol=1e-4)
    many = robot.ensemble(robot.home, np.zeros((3, len(robot.actuators))), **options)
    assert in_lanes(many.members, BOGACKI_SHAMPINE)
    for member in range(3):
        np.testing.assert_allclose(many.dataset.joint_position[member], ours, rtol=1e-12)


def test_a_pair_that_is_listed_is_named_by_refusals_and_taken_by_studies(robot, listed):
    with pytest.raises(lw.LinkworkError, match=f"there are .*, {NEW}$"):
        robot.simulate(robot.home, duration=0.1, method="euler")
    with pytest.raises(lw.LinkworkError, match=f"^{NEW} chooses its own steps"):
        robot.simulate(robot.home, duration=0.1, method=NEW, step=0.1)
    assert study(method=NEW).method == NEW


def test_a_pair_that_is_listed_is_taken_by_the_command_line(listed):
    run = "simulate", "double_pendulum", "--duration", 0.1, "--rtol", 1e-5, "--json"
    assert json.loads(call(*run, "--method", NEW).stdout)["method"] == "Bogacki-Shampine 3(2)"
