"""The table of quantities: what stands there is told everywhere, and is what the datasets hold."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Lag, Wrench
from linkwork.runs.quantities import QUANTITIES, Place, SavedQuantity
from linkwork.runs.run_record import RunRecord
from linkwork.sweeps.chunk import compute
from linkwork.viewer import traces
from linkwork.views.run_report import render

from tests.catalogue import built
from tests.sweeps.carts import study
from tests.views.pages import Reader

TIMES = np.linspace(0, 0.2, 11)


@pytest.fixture
def squares(monkeypatch) -> str:
    """Put a quantity into the table: the squares of all joint rates."""
    quantity = SavedQuantity(
        "squared_rate", ("rate",), "m^2/s^2", lambda s: s.joints[1] ** 2, "Squares."
    )
    monkeypatch.setitem(QUANTITIES, quantity.name, quantity)
    return quantity.name


def test_a_quantity_of_the_table_is_told_by_runs_and_ensembles(squares):
    robot = built("prr3")
    run = robot.simulate(robot.home, [1.0, 0.0, 0.5], duration=0.2, save_at=TIMES)
    runs = robot.ensemble(robot.home, [[1.0, 0.0, 0.5]], duration=0.2, save_at=TIMES)
    for data, axes in (run.dataset, ("time", "rate")), (runs.dataset, ("member", "time", "rate")):
        assert data[squares].dims == axes
        assert data[squares].attrs["units"] == "m^2/s^2"
        np.testing.assert_array_equal(data[squares].values, data["joint_rate"].values ** 2)
        assert data[squares].values.any()


def test_the_shapes_of_quantities_are_known_without_their_values(monkeypatch):
    robot = lw.Robot("prr3")
    wrench = Wrench("platform", force=[1.0, 0.0, 0.0])
    drives = {"slide_1": Lag(0.01)}
    plain = robot.simulate(robot.home, [1.0, 0.0, 0.5], duration=0.2)
    acted = robot.simulate(robot.home, duration=0.2, drives=drives, wrenches=[wrench])
    unread = robot.simulate(robot.home, [1.0, 0.0, 0.5], duration=0.2)
    for run in plain, acted:
        shapes = {name: run.variables[name].values.shape for name in run.variables}
        assert {name: run.variables.shape(name) for name in shapes} == shapes
    # Nor is anything evaluated to tell what there is, and to differentiate it.
    weights = np.ones(plain.variables["tool_pose"].shape)
    expected = plain.gradient({"tool_pose": weights})
    monkeypatch.setattr(RunRecord, "_measured", None)
    assert "joint_rate" in unread.variables and "external_wrench" not in unread.variables
    assert unread.gradient({"tool_pose": weights}) == expected


@pytest.mark.long
def test_a_quantity_of_the_table_is_shown_in_the_report_and_in_the_viewer(squares):
    robot = built("prr3")
    run = robot.simulate(robot.home, [1.0, 0.0, 0.5], duration=0.2, save_at=TIMES)
    text = Reader(render(robot, run)).text
    assert "Squares." in text and "Peaks of the squared rate" in text
    assert squares in traces.quantities(run)
    shown = traces.traces(run, squares, robot.actuators)
    np.testing.assert_array_equal(shown.values.T, run["joint_rate"].values[:, :3] ** 2)


def test_a_quantity_of_the_table_is_asked_for_in_studies(squares):
    given = study(outputs={"last": f"final {squares}.rail"}, trajectories=(squares, "joint_rate"))
    found = compute(given, 0)
    np.testing.assert_array_equal(found[squares], found["joint_rate"] ** 2)
    np.testing.assert_array_equal(found["last"], found[squares][:, -1, 0])
    assert found["last"].any()


FORCES = {
    "numbers": [[1.0, 0.0, 0.5], [0.0, 2.0, 0.0]],
    "signals": [lw.Sampled(TIMES, np.outer(np.sin(9 * TIMES), [1.0, k, 0.0])) for k in (1, 2)],
}


@pytest.mark.parametrize("forces", FORCES)
def test_quantities_see_the_forces_of_each_member(monkeypatch, forces):
    pushed = SavedQuantity("pushed", ("actuator",), "N", lambda s: s.acted.force)
    monkeypatch.setitem(QUANTITIES, pushed.name, pushed)
    robot, given = built("prr3"), FORCES[forces]
    found = robot.ensemble(robot.home, given, duration=0.2, save_at=TIMES).dataset["pushed"].values
    for member, own in enumerate(given):
        run = robot.simulate(robot.home, own, duration=0.2, save_at=TIMES)
        np.testing.assert_array_equal(found[member], run["actuator_force"].values)


def test_only_runs_tell_what_follows_from_them_as_a_whole(monkeypatch):
    whole = SavedQuantity("share", (), "1", lambda run: run.time / run.time[-1], whole=True)
    monkeypatch.setitem(QUANTITIES, whole.name, whole)
    robot = built("pendulum")
    run = robot.simulate(robot.home, duration=0.2, save_at=TIMES)
    np.testing.assert_array_equal(run["share"].values, TIMES / 0.2)
    assert "share" not in robot.ensemble(robot.home, None, duration=0.2, save_at=TIMES).dataset


@pytest.fixture
def awaited(monkeypatch) -> tuple[list[str], lw.Run]:
    """Return what was asked of a quantity of a whole run, and a run that tells it."""
    asked: list[str] = []

    def half(run):
        asked.append("once more")
        return run.time / 2

    quantity = SavedQuantity("half_time", (), "s", half, whole=True)
    monkeypatch.setitem(QUANTITIES, quantity.name, quantity)
    robot = built("pendulum")
    return asked, robot.simulate(robot.home, duration=0.2, save_at=TIMES)


def test_what_follows_from_a_whole_run_is_found_once_when_its_values_are_asked_for(awaited):
    asked, run = awaited
    data = run.dataset
    later = data.isel(time=slice(2, None))
    assert data["half_time"].shape == (11,) and data["half_time"].dtype == float
    assert asked == []
    np.testing.assert_array_equal(later["half_time"].values, TIMES[2:] / 2)
    np.testing.assert_array_equal(run.variables["half_time"].values, TIMES / 2)
    np.testing.assert_array_equal((data["half_time"] + 1).values, TIMES / 2 + 1)
    assert len(asked) == 1


def test_what_is_awaited_is_an_array_like_others_when_it_is_copied_and_written_to(awaited):
    _, run = awaited
    kept = pickle.loads(pickle.dumps(run.dataset))
    copied = run.dataset.copy(deep=True)
    copied["half_time"][0] = 7.0
    np.testing.assert_array_equal(kept["half_time"].values, TIMES / 2)
    np.testing.assert_array_equal(copied["half_time"].values, [7.0, *TIMES[1:] / 2])
    np.testing.assert_array_equal(run.dataset["half_time"].values, TIMES / 2)


def test_awaited_quantities_are_saved(awaited, tmp_path):
    _, run = awaited
    found = lw.Run.load(run.save(tmp_path / "run.nc"))
    np.testing.assert_array_equal(found.variables["half_time"].values, TIMES / 2)


def test_the_documents_name_all_quantities_that_studies_may_ask_for():
    text = (Path(lw.__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    asked = [each.name for each in QUANTITIES.values() if each.belongs(Place.STUDY)]
    assert asked and all(f"`{name}`" in text for name in asked)
