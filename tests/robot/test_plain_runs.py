"""What lies between `robot.simulate` and the compiled loop, and what is kept from one run to the
next."""

import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import linkwork as lw
from linkwork.runs import passage
from linkwork.runs.settings import Settings, settings_of
from linkwork.simulation import native

SOURCE = str(Path(lw.__file__).parent)
MOST_MOVES = 25
MOST_KEPT = 1024


def files_called(work, monkeypatch) -> list[str]:
    """Return the files of the library in which functions are called, in order, until a compiled
    loop starts."""
    called, loop = [], native.integrate

    def watch(frame, event, _):
        if event == "call" and frame.f_code.co_filename.startswith(SOURCE):
            called.append(frame.f_code.co_filename)

    def started(*given):
        sys.setprofile(None)
        return loop(*given)

    monkeypatch.setattr(native, "integrate", started)
    sys.setprofile(watch)
    try:
        work()
    finally:
        sys.setprofile(None)
    return called


@pytest.mark.parametrize("forces", [None, [5.0, 0.0, 0.0], {"slide_1": 5.0}])
def test_a_plain_run_comes_to_the_compiled_loop_in_few_moves_between_files(
    forces, monkeypatch, code_at_once
):
    robot = lw.Robot(lw.robots.prr3())

    def work():
        robot.simulate(robot.home, forces, duration=0.1)

    work()
    called = files_called(work, monkeypatch)
    moves = sum(one != other for one, other in pairwise(called))
    assert called[0].endswith("simulated.py")
    assert called[-1].endswith("integration.py") or called[-1].endswith("tableaus.py")
    assert moves <= MOST_MOVES


def test_a_chart_is_chosen_once_for_a_pose_that_runs_come_to_again(monkeypatch):
    robot, asked = lw.Robot(lw.robots.prr3()), []

    def counted(*given):
        asked.append(given)
        return choice(*given)

    choice = passage.choice
    monkeypatch.setattr(passage, "choice", counted)
    runs = [robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0) for _ in range(2)]
    assert len(asked) == 3
    other = lw.Robot(lw.robots.prr3())
    other.simulate(other.home, [-2.0, 1.0, 0.5], duration=2.0)  # comes to other charts first
    runs.append(other.simulate(other.home, [5.0, 0.0, 0.0], duration=1.0))
    first = runs[0].dataset
    for run in runs[1:]:
        assert run.attrs["charts"] == runs[0].attrs["charts"]
        assert all(np.array_equal(first[name], run[name]) for name in first)
    assert robot.once.cache_info().maxsize == MOST_KEPT


def test_equal_settings_are_made_once_and_lists_do_not_hinder():
    given = {"duration": 0.5, "rtol": 1e-6}
    assert settings_of(**given) is settings_of(**given)
    assert settings_of(**given).duration == Settings(**given).duration
    assert settings_of(**given, save_at=[0.1, 0.2]).save_at.tolist() == [0.1, 0.2]
    with pytest.raises(lw.LinkworkError, match="duration"):
        settings_of(duration=-1.0)


def test_forces_are_told_apart_by_their_bits():
    robot = lw.Robot(lw.robots.prr3())
    forces = np.array([5.0, 0.0, 0.0])
    first = robot.simulate(robot.home, forces, duration=0.1)
    forces[0] = 4.0
    second = robot.simulate(robot.home, forces, duration=0.1)
    assert not np.array_equal(first.attrs["final_q"], second.attrs["final_q"])
    again = robot.simulate(robot.home, {"slide_1": 5.0}, duration=0.1)
    assert np.array_equal(first.attrs["final_q"], again.attrs["final_q"])


def test_threads_get_what_one_alone_gets():
    robot = lw.Robot(lw.robots.prr3())
    forces = [[5.0, 0.0, 0.1 * k] for k in range(4)]

    def end(u) -> np.ndarray:
        return robot.simulate(robot.home, u, duration=1.0).attrs["final_q"]

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(end, forces * 8))
    alone = lw.Robot(lw.robots.prr3())
    expected = [alone.simulate(alone.home, u, duration=1.0).attrs["final_q"] for u in forces]
    for k, one in enumerate(found):
        assert np.array_equal(one, expected[k % len(forces)])
