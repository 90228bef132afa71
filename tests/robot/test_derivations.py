"""What was derived of a mechanism is kept on disk: the same to the last bit, and only where it is
the same."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import derive, functions
from linkwork.equations.orientation import GROUND_AXES
from linkwork.model import derivations
from linkwork.model.derivations import packed, unpacked

from tests.processes import finished
from tests.products import sampled

NAMES = ("motion", "closure_step", "terms", "joints_motion", "energy", "assembly")
FIRST_RUN = """
import linkwork as lw
robot = lw.Robot(lw.robots.prr3())
robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=0.1)
"""
IDLE = {"networkx", "xarray", "matplotlib", "pandas", "linkwork.runs.ensemble", "linkwork.views"}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def made(folder: Path, monkeypatch) -> list[lw.Mechanism]:
    """Return the mechanisms that were derived, as they come."""
    found = []

    def counted(mechanism, *given):
        found.append(mechanism)
        return derive(mechanism, *given)

    monkeypatch.setattr(derivations, "derive", counted)
    return found


@pytest.mark.parametrize(
    ("free", "name"),
    sampled(
        [(), ("gravity.z", "gravity.x")],
        ["prr3", "stewart", "bricard", "flyball_governor", "puma560"],
    ),
)
def test_equations_that_were_kept_give_the_same_functions(name, free):
    equations = derive(getattr(lw.robots, name)(), free=free)
    again = unpacked(packed(equations))
    for function in NAMES:
        one, other = (getattr(functions, function)(part) for part in (equations, again))
        assert one.serialize() == other.serialize()
    assert np.array_equal(equations.reference, again.reference)
    assert (equations.chart, equations.notes, equations.redundant) == (
        again.chart,
        again.notes,
        again.redundant,
    )


def test_all_trees_stand_on_one_ground():
    again = unpacked(packed(derive(lw.robots.puma560())))
    for node in again.tree.nodes:
        axes = node.before
        while axes.parent is not None:
            axes = axes.parent
        assert axes is GROUND_AXES


def test_functions_are_kept_as_they_are():
    function = functions.motion(derive(lw.robots.four_bar()))
    assert unpacked(packed(function)).serialize() == function.serialize()


def test_a_mechanism_is_derived_once_and_runs_alike_from_the_folder(made):
    mechanism, runs = lw.robots.four_bar(), []
    for _ in range(2):
        robot = lw.Robot(mechanism)
        runs.append(robot.simulate(robot.home, [1.0], duration=0.5))
    assert len(made) == 1
    assert np.array_equal(runs[0].attrs["final_q"], runs[1].attrs["final_q"])
    first, second = (run.dataset for run in runs)
    assert all(np.array_equal(first[name], second[name]) for name in first)


def test_the_chart_of_runs_is_chosen_once(made, monkeypatch):
    mechanism = lw.robots.stewart()
    first = lw.Robot(mechanism).run_chart
    monkeypatch.setattr("linkwork.model.model.shorter", lambda *_: pytest.fail("chosen anew"))
    assert lw.Robot(mechanism).run_chart.key == first.key


def other_versions(monkeypatch) -> None:
    monkeypatch.setattr("numpy.__version__", "0.0")


def other_source(monkeypatch) -> None:
    monkeypatch.setattr("linkwork.kernels.cache.source", lambda package: b"other source")


def other_machine(monkeypatch) -> None:
    kind = replace(derivations.this_machine(), cpu="generic")
    monkeypatch.setattr(derivations, "this_machine", lambda: kind)


@pytest.mark.parametrize("change", [other_versions, other_source, other_machine])
def test_nothing_is_taken_from_another_version_or_machine(made, monkeypatch, change):
    lw.Robot(lw.robots.pendulum())
    change(monkeypatch)
    lw.Robot(lw.robots.pendulum())
    assert len(made) == 2


def test_what_is_asked_for_tells_derivations_apart(made):
    mechanism = lw.robots.five_bar()
    heavier = mechanism.model_copy(update={"gravity": (0.0, 0.0, -1.0)})
    robots = [
        lw.Robot(mechanism),
        lw.Robot(heavier),
        lw.Robot(mechanism, independent=["elbow_1", "elbow_2"]),
        lw.Robot(mechanism).free("gravity.z"),
    ]
    assert len(made) == 4
    assert len({robot.equations.key for robot in robots}) == 4


def test_numbers_of_numpy_come_back_as_they_were():
    kept = unpacked(packed((np.float64(0.1), np.bool_(True))))
    assert kept == (0.1, True) and [type(one) for one in kept] == [np.float64, np.bool_]


def test_what_may_not_be_read_is_derived_anew(folder):
    for _ in range(2):
        assert derivations.kept(lambda: Path("here"), "a part") == Path("here")


def test_a_damaged_derivation_is_made_anew(made, folder):
    lw.Robot(lw.robots.pendulum())
    for file in folder.iterdir():
        file.write_bytes(file.read_bytes()[:-1])
    with pytest.warns(RuntimeWarning, match="damaged"):
        lw.Robot(lw.robots.pendulum())
    assert len(made) == 2


def test_only_what_a_derivation_is_made_of_is_read():
    with pytest.raises(pickle.UnpicklingError, match="no part of a derivation"):
        unpacked(packed(Path("here")))


@pytest.mark.long
@pytest.mark.usefixtures("folder")
def test_a_first_run_in_a_process_loads_what_it_needs_only():
    exec(FIRST_RUN, {})  # derived here
    loaded = finished("-c", FIRST_RUN + "import sys; print(*sys.modules)")
    assert loaded.returncode == 0, loaded.stderr
    assert not IDLE & set(loaded.stdout.split())


def test_motion_is_derived_once_for_its_kernel_and_for_its_size(folder, monkeypatch):
    made, motion = [], functions.motion

    def counted(equations):
        made.append(equations)
        return motion(equations)

    monkeypatch.setattr(functions, "motion", counted)
    robot = lw.Robot(lw.robots.stewart())
    chart = robot.chart
    assert not chart.large and chart.kernel("motion").n_out and len(made) == 1
