"""Members of ensembles that change charts stay in lanes, and come bit for bit to what they come to
alone."""

from collections.abc import Sequence

import numpy as np
import pytest

import linkwork as lw
from linkwork import Sampled, Status
from linkwork.runs import ensemble, passage
from linkwork.runs.ensemble import Ensemble

T = np.linspace(0.0, 1.0, 9)
PUSHED = np.array([5.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def prr3():
    return lw.Robot(lw.robots.prr3())


@pytest.fixture
def never_alone(monkeypatch):
    def refused(*given):
        raise AssertionError("a member runs by itself")

    monkeypatch.setattr(ensemble, "by_themselves", refused)


def pushes(count: int) -> np.ndarray:
    random = np.random.default_rng(8)
    return PUSHED * random.uniform(0.4, 1.3, (count, 1))


def require_the_same(members: Ensemble, runs: Sequence[lw.Run]) -> None:
    """Require that every member came to what its own run came to, to the last bit."""
    for i, run in enumerate(runs):
        assert members.status[i] == run.status
        assert members.message(i) == run.message
        assert members.end_time[i] == run.attrs["final_time"]
        assert np.array_equal(members.final.q[i], run.attrs["final_q"])
        for name in ("nfev", "steps", "rejected", "pivot"):
            assert getattr(members, name)[i] == getattr(run.statistics, name)
        for name in ("joint_position", "joint_rate", "tool_pose"):
            own = run[name].values
            assert np.array_equal(members.dataset[name].values[i, : len(own)], own)


def charts(runs: Sequence[lw.Run]) -> list[int]:
    return [run.attrs["charts"].count("from") for run in runs]


def test_members_that_change_charts_stay_in_lanes(prr3, never_alone):
    u, options = pushes(21), {"duration": 1.0, "save_at": T}
    runs = [prr3.simulate(prr3.home, own, **options) for own in u]
    assert len(set(charts(runs))) > 1
    assert max(charts(runs)) > 2
    require_the_same(prr3.ensemble(prr3.home, u, **options), runs)


def test_steps_in_which_pivots_fall_are_as_accurate_as_others(prr3):
    """They go most of the way to where the rates determine nothing, and their errors' estimates may
    be small by accident. Truth: what constant forces do from rest is the kinetic energy."""
    u = np.array([[10.8343, 0.0948, -0.0572], [10.844, 0.1787, 0.0931], [10.6118, 0.1978, 0.1399]])
    start = prr3.assemble(tool=[0.5, np.sqrt(3) / 6, 1.2])
    members = prr3.ensemble(start, u, duration=0.5)
    runs = [prr3.simulate(start, own, duration=0.5) for own in u]
    slides = [prr3.coordinates.index(f"slide_{leg}") for leg in (1, 2, 3)]
    for i, (own, run) in enumerate(zip(u, runs, strict=True)):
        work = (run["joint_position"].values - start.positions)[:, slides] @ own
        assert np.abs(run["kinetic_energy"].values - work).max() < 1e-6 * work.max()
        assert np.array_equal(members.final.q[i], run.attrs["final_q"])
        assert members.nfev[i] == run.statistics.nfev


def test_first_steps_in_new_charts_are_those_that_failed_in_the_old_ones(prr3, monkeypatch):
    """They take fewer trials than guesses do, and runs come as near to where tight ones come to."""
    u, options = pushes(12), {"duration": 0.8, "save_at": [0.8]}
    exact = [prr3.simulate(prr3.home, own, **options, rtol=1e-12, atol=1e-14) for own in u]

    def found() -> tuple[int, int, int, float]:
        runs = [prr3.simulate(prr3.home, own, **options, rtol=1e-8, atol=1e-10) for own in u]
        errors = [
            np.abs(run.attrs["final_q"] - best.attrs["final_q"]).max()
            for run, best in zip(runs, exact, strict=True)
        ]
        done = [run.statistics for run in runs]
        refused, work = sum(each.rejected for each in done), sum(each.nfev for each in done)
        return sum(charts(runs)), refused, work, float(np.median(errors))

    changes, refused, work, error = found()
    monkeypatch.setattr(passage, "LONGER", 0.0)
    others, refused_guesses, work_of_guesses, error_of_guesses = found()
    assert changes == others > 12
    assert refused < refused_guesses - changes
    assert work < 0.98 * work_of_guesses
    assert error < 2 * error_of_guesses


@pytest.mark.parametrize("threads", [1, 2])
def test_neither_neighbours_nor_threads_change_a_bit_of_who_changes_charts(prr3, threads):
    u, order = pushes(40), np.random.default_rng(2).permutation(40)
    whole = prr3.ensemble(prr3.home, u, duration=1.0)
    mixed = prr3.ensemble(prr3.home, u[order], duration=1.0, threads=threads)
    few = prr3.ensemble(prr3.home, u[order[:3]], duration=1.0)
    for name in ("nfev", "steps", "pivot", "end_time"):
        assert np.array_equal(getattr(whole, name)[order], getattr(mixed, name))
    assert np.array_equal(whole.final.q[order], mixed.final.q)
    assert np.array_equal(whole.final.q[order[:3]], few.final.q)


@pytest.mark.long
def test_own_parameters_and_own_signals_go_from_chart_to_chart(never_alone):
    robot = lw.Robot(lw.robots.prr3()).free("platform.mass")
    masses, t = np.linspace(0.8, 1.4, 4), np.linspace(0.0, 1.0, 6)
    kinds = ("spline", "linear", "hold", "linear")
    signals = [Sampled(t, PUSHED * (1 + 0.2 * np.sin(t))[:, None], kind) for kind in kinds]
    options = {"duration": 1.0, "save_at": T}
    runs = [
        robot.with_parameters({"platform.mass": mass}).simulate(robot.home, signal, **options)
        for mass, signal in zip(masses, signals, strict=True)
    ]
    assert min(charts(runs)) > 1
    members = robot.ensemble(robot.home, signals, {"platform.mass": masses}, **options)
    require_the_same(members, runs)


def test_members_that_run_out_of_steps_in_a_later_chart_say_so(prr3, never_alone):
    u, options = pushes(9), {"duration": 1.0, "save_at": T}
    most = int(np.median(prr3.ensemble(prr3.home, u, **options).steps))
    runs = [prr3.simulate(prr3.home, own, **options, max_steps=most) for own in u]
    assert {run.status for run in runs} >= {Status.TOO_MANY_STEPS}
    require_the_same(prr3.ensemble(prr3.home, u, **options, max_steps=most), runs)


def test_members_come_to_singular_poses_in_lanes(never_alone):
    """The bound of their pivots is lowered, and raised again behind a pose that is only close."""
    robot = lw.Robot(lw.robots.five_bar())
    rates = np.array([[0.0, 4.0], [0.0, 6.0], [0.5, 7.0], [-3.0, 3.0], [2.0, -5.0], [6.0, 6.0]])
    positions = np.broadcast_to(robot.home.positions, (len(rates), len(robot.coordinates)))
    states, options = robot.state(positions, rates), {"duration": 0.6, "save_at": 0.6 * T}
    runs = [robot.simulate(states.at(i), **options) for i in range(len(rates))]
    require_the_same(robot.ensemble(states, **options), runs)


def test_members_that_step_over_poses_go_on_from_their_lanes_alone(prr3):
    u, options = pushes(5), {"duration": 1.0, "save_at": T, "on_singular": "step_over"}
    runs = [prr3.simulate(prr3.home, own, **options) for own in u]
    require_the_same(prr3.ensemble(prr3.home, u, **options), runs)
