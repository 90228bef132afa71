"""The benchmarks of simulation and analysis run, on tiny sizes, and what they compare agrees.
Nothing here depends on speed."""

import json

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import prr3
from linkwork.simulation import native_rosenbrock

from benchmarks import (
    analysis,
    calls,
    control,
    learning,
    legs,
    runs,
    scipy_runs,
    single,
    stepper,
    stiff,
    tasks,
)
from tests.catalogue import WHOLE


def values(figures):
    return {figure.what: figure.value for figure in figures if figure.value is not None}


def listed(section):
    """Return the rows of the listing, each as long as its titles."""
    assert section.listing is not None
    assert all(len(row) == len(section.listing.columns) for row in section.listing.rows)
    return section.listing.rows


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(prr3())


@pytest.mark.parametrize("method", ["dormand_prince", "dop853", "rodas"])
def test_the_loop_alone_ends_where_the_run_does(robot, method):
    task = tasks.second_of_pushing(robot)
    way = single.Way({"method": method}, 3)
    found = []
    loop = runs.loop_of(lambda: found.append(single.simulated(robot, task, way)), way.module)
    for _ in range(2):
        y = loop()
        assert np.array_equal(y[: robot.equations.nq], found[0].attrs["final_q"])
    assert np.array_equal(
        runs.joints_at_end(robot, found[0]), found[0].variables["joint_position"].values[-1]
    )
    assert way.module is (native_rosenbrock if method == "rodas" else single.native)


def test_all_methods_meet_in_the_same_second():
    section = single.run(rounds=1)
    assert len(listed(section)) == 2 * len(single.WAYS)
    for _, name, _, _, error, *_ in listed(section):
        assert float(error) < (0.02 if name.startswith("symplectic") else 1e-6), name
    assert len(values(section.figures)) == 2
    json.dumps(section.raw)


def test_a_plain_run_is_timed_beside_its_loop():
    section = single.plain(rounds=1)
    assert {name for name, _ in listed(section)} == {"robot.simulate", "compiled loop"}
    assert len(values(section.figures)) == 1
    json.dumps(section.raw)


def test_changes_of_chart_are_timed_beside_a_run_without_any():
    section = single.changing(rounds=1)
    assert [name for name, _ in listed(section)] == [
        *("no change", "changes", "no change, loops", "changes, loops"),
    ]
    assert [figure.what for figure in section.figures] == ["a change of chart, one of 3 on the way"]
    json.dumps(section.raw)


@pytest.mark.long
def test_steppers_of_both_engines_are_timed():
    section = stepper.run(rounds=1, robots=16, stack=1024)
    assert len(listed(section)) == 12
    assert len(values(section.figures)) == 6
    json.dumps(section.raw)


@pytest.mark.long
def test_environments_are_timed():
    section = learning.run(rounds=1, robots=16, steps=3)
    assert len(listed(section)) == 5
    assert len(values(section.figures)) == 1
    json.dumps(section.raw)


def test_scipy_ends_near_the_run(robot):
    task = tasks.second_of_pushing(robot)
    end = runs.joints_at_end(robot, single.simulated(robot, task, single.EXACT))
    u = task.signal(np.zeros(1))[0]
    for method in scipy_runs.METHODS:
        done = scipy_runs.solved(
            robot, task.start, lambda _: u, np.array([0.0, 1.0]), 1e-9, 1e-11, method
        )
        assert np.abs(done.positions[-1] - end).max() < 1e-6, method
        assert 0 < done.closure_error < 1e-6
        assert done.nfev > 10


@pytest.mark.long
def test_the_ensemble_stands_beside_rollouts_and_loops():
    ensemble = pytest.importorskip("benchmarks.ensemble", reason="the engines are not installed")
    sizes = ensemble.Sizes(
        changing=32,
        members=40,
        rollouts=4,
        loops=1,
        rounds=1,
        tolerances=(1e-5, 1e-9),
        steps=(25, 100),
    )
    section = ensemble.run(sizes)
    found = {row[:2]: row for row in listed(section)}
    assert len(found) == 2 + 2 + 1 + 2
    for by in (ensemble.ROLLOUT, ensemble.PINOCCHIO):
        assert float(found[by, "100 steps"][-1]) < 1e-6
        assert float(found[by, "25 steps"][-1]) > 10 * float(found[by, "100 steps"][-1])
    assert float(found[ensemble.LINKWORK, "rtol 1e-09"][-1]) < 1e-8
    assert values(section.figures)["members that did not reach their ends"] == 0
    json.dumps(section.raw)


@pytest.mark.long
def test_computed_torque_leads_the_sliders_however_it_is_called():
    """With the exact model the error obeys e'' + kd e' + kp e = 0, critically damped: e = e_0
    (1 + w t) exp(-w t)."""
    section = control.run(duration=0.4, rounds=1)
    found = {row[0]: row for row in listed(section)}
    assert set(found) == set(control.WAYS)
    wt = control.KD / 2 * 0.2
    errors = section.raw["errors"]
    assert errors[control.TRACED] == pytest.approx(
        control.OFFSET * (1 + wt) * np.exp(-wt), rel=1e-2
    )
    assert all(error < control.OFFSET / 2 for error in errors.values())
    assert found[control.PYTHON][2] == found[control.SAMPLED][2]
    assert len(section.figures) == 3
    json.dumps(section.raw)


def test_the_loop_of_a_sampled_controller_starts_anew(robot):
    """What the controller holds at the end of one call is not what the next one starts with."""
    law = control.Sampler(
        lambda t, state: [10 * (0.3 - state["slide_1"]), 0.0, 0.0],
        rate=100.0,
        delay=0.02,
        compiled=True,
    )
    start = tasks.second_of_pushing(robot).start
    loop = runs.loop_of(lambda: robot.simulate(start, law, duration=0.2, save_at=[0.2]))
    first = loop().copy()
    assert np.array_equal(first, loop())


def test_the_governor_moves_as_its_closed_form():
    sizes = stiff.Sizes(duration=0.2, tolerances=(1e-4, 1e-6), rounds=1, exact=1e-9)
    section = stiff.run(sizes)
    assert len(listed(section)) == 6
    errors = {row[:2]: float(row[3]) for row in listed(section)}
    assert errors["Linkwork, RODAS", "1e-06"] < 1e-6
    assert all(error < 1e-3 for error in errors.values())
    assert section.figures[0].met
    json.dumps(section.raw)


@pytest.mark.long
@pytest.mark.parametrize("name", ["planar", *["linkage", "hexapod"] * WHOLE])
def test_all_hands_end_near_references_that_share_nothing_with_the_library(name):
    trajectories = pytest.importorskip(
        "benchmarks.trajectories", reason="the engines are not installed"
    )
    problem = getattr(trajectories, name)()
    grid = trajectories.Grid(tolerances=(1e-6, 1e-8), scipy=(1e-6,), steps=(50, 100), rounds=1)
    section = trajectories.run(grid, [lambda: problem])
    errors = {row[1:3]: (float(row[3]), float(row[4])) for row in listed(section)}
    for method in trajectories.OURS:
        error, gap = errors[f"Linkwork, {method}", "rtol 1e-08"]
        assert error < 1e-5 and gap < 1e-11
    for method in trajectories.scipy_runs.METHODS:
        assert errors[f"SciPy, {method}", "rtol 1e-06"][0] < 1e-3
    finest = f"{100 * problem.finer} steps"
    assert errors[trajectories.MUJOCO, finest][0] < 1e-4
    assert errors[trajectories.EXUDYN, finest][0] < 0.02
    ((title, picture),) = section.pictures.items()
    assert title == f"work_precision_{problem.name}.svg" and "</svg>" in picture
    json.dumps(section.raw)


def test_dietmaier_s_forty_are_found_and_timed():
    section = analysis.modes(seeds=(3,))
    assert section.figures[0].value == section.figures[1].value == 40


def test_a_map_has_as_many_poses_as_it_says():
    section = analysis.maps(along=8, rounds=1)
    assert "512 poses" in section.figures[0].what
    assert 0.02 < section.raw["reached"] < 0.98


@pytest.mark.long
def test_calls_at_one_state_are_timed_for_both_robots():
    section = calls.run(rounds=1, states=4, stack=16)
    assert len(values(section.figures)) == 8
    assert len(listed(section)) == 17
    assert all(float(cell) > 0 for _, *cells in listed(section) for cell in cells)
    json.dumps(section.raw)


def test_calls_of_legs_are_timed_one_by_one_and_in_stacks():
    section = legs.run(states=16, rounds=1)
    assert len(section.figures) == 20
    assert all(figure.value > 0 for figure in section.figures)


def test_a_drag_keeps_the_loops_closed():
    seeing = pytest.importorskip(
        "benchmarks.seeing", reason="the viewer or the engines are not installed"
    )
    section = seeing.drag(steps=10, rounds=1)
    assert values(section.figures)["largest closure error along the drag"] < 1e-9
    json.dumps(section.raw)


@pytest.mark.long
def test_the_report_is_weighed(monkeypatch):
    seeing = pytest.importorskip(
        "benchmarks.seeing", reason="the viewer or the engines are not installed"
    )
    from linkwork.lab import comparison

    def short():
        robot = lw.Robot(prr3())
        return comparison.compare(
            robot, seeing.reproduction.prescribed_motion(robot, samples=201), []
        )

    monkeypatch.setattr(seeing.reproduction, "study", short)
    section = seeing.report()
    assert section.figures[0].met and section.raw["bytes"] > 50_000
