"""Ensembles of all that one run can do, against the same runs one by one: methods, events,
samplers, drives; charts."""

import time

import numpy as np
import pytest

import linkwork as lw
from linkwork import Sampled, Status
from linkwork.control import DCMotor, Event, Sampler, Wrench
from linkwork.equations import charts_at
from linkwork.errors import LinkworkError

from tests.products import first
from tests.robot.one_by_one import random, require_equal

T = np.linspace(0.0, 0.4, 5)
RUN = {"duration": 0.4, "save_at": T}


@pytest.fixture(scope="module")
def prr3():
    return lw.Robot(lw.robots.prr3())


@pytest.fixture(scope="module")
def forces():
    return 0.3 * random(5, 3)


def moving(robot, rates):
    """Return states in the home configuration with different rates."""
    return robot.state(np.tile(robot.home.positions, (len(rates), 1)), rates)


@pytest.mark.parametrize(
    ("method", "step"),
    [("dop853", None), ("rodas", None), ("rk4", 2e-3), ("symplectic_euler", 2e-3)],
)
def test_members_by_any_method(prr3, forces, method, step):
    options = RUN | {"method": method, "step": step}
    members = prr3.ensemble(prr3.home, forces, **options)
    require_equal(members, [prr3.simulate(prr3.home, u, **options) for u in forces])
    assert members.success


def test_members_by_any_method_change_charts(prr3):
    rates = np.linspace(0.1, 1.5, 4)[:, None] * np.cos(np.arange(3))
    states = moving(prr3, rates)
    options = RUN | {"method": "dop853"}
    runs = [prr3.simulate(states.at(i), [1.0, 1.0, 1.0], **options) for i in range(4)]
    assert any("; from" in run.attrs["charts"] for run in runs)
    require_equal(prr3.ensemble(states, [1.0, 1.0, 1.0], **options), runs)


@pytest.mark.parametrize("method", ["dormand_prince", "dop853"])
def test_events_of_each_member(prr3, forces, method):
    """The first ends a run, the second happens at other times and numbers in each, the third knows
    the time alone."""
    start = prr3.home.positions[0]
    events = [
        Event(lambda t, state: state["slide_1"] - start - 0.02, name="far", terminal=True),
        Event(lambda t, state: state.rate("slide_2"), name="turns"),
        Event(lambda t, state: lw.math.sin(20 * t), direction=-1, name="falls"),
    ]
    options = RUN | {"events": events, "method": method}
    members = prr3.ensemble(prr3.home.with_rates([0.05, 0.02, 0.0]), forces, **options)
    runs = [prr3.simulate(prr3.home.with_rates([0.05, 0.02, 0.0]), u, **options) for u in forces]
    require_equal(members, runs)
    assert {Status.EVENT, Status.FINISHED} == set(members.status.tolist())
    found = members.dataset
    assert found.event_member.values.tolist() == [
        i for i, run in enumerate(runs) for _ in run.coords["event"].values
    ]
    assert np.allclose(found.event_time[found.event == "falls"] % (np.pi / 10), np.pi / 20, 0, 1e-7)
    with pytest.raises(LinkworkError, match="there is no member 5"):
        members.events(5)


def test_ready_events_by_name(prr3, forces):
    members = prr3.ensemble(prr3.home, forces, events="singular", **RUN)
    require_equal(members, [prr3.simulate(prr3.home, u, events="singular", **RUN) for u in forces])


def test_nothing_is_watched_for_unasked(prr3, forces):
    members = prr3.ensemble(prr3.home, forces, **RUN)
    assert members.events(0) == ()
    assert "event" not in members.dataset.coords


def gentle(t, state):
    return {"slide_1": -4.0 * (state["slide_1"] - 0.25), "slide_2": -state.rate("slide_2")}


@pytest.mark.parametrize("compiled", [True, False])
def test_a_sampled_controller_leads_every_member(prr3, compiled):
    states = prr3.assemble(tool=[[0.5, 0.28 + 0.01 * i, 1.2] for i in range(4)])
    sampler = Sampler(gentle, rate=50, delay=0.02, compiled=compiled)
    members = prr3.ensemble(states, sampler, **RUN)
    require_equal(members, [prr3.simulate(states.at(i), sampler, **RUN) for i in range(4)])


def test_gains_of_each_member_s_sampled_controller(prr3):
    def law(t, state):
        return {"slide_1": -state.parameter("kp", 4.0) * (state["slide_1"] - 0.25)}

    gains, sampler = np.array([1.0, 4.0, 9.0]), Sampler(law, rate=50, compiled=True)
    members = prr3.ensemble(prr3.home, sampler, {"kp": gains}, **RUN)
    require_equal(
        members, [prr3.simulate(prr3.home, sampler, parameters={"kp": k}, **RUN) for k in gains]
    )


def test_members_that_a_python_function_leads_run_one_after_the_other(prr3):
    """So a controller with a memory sees each run from its start to its end, as where they are
    simulated in turn."""
    seen = []

    def law(t, state):
        seen.append(t)
        time.sleep(1e-3)
        return [0.1, 0.0, 0.0]

    prr3.ensemble(moving(prr3, np.zeros((3, 3))), Sampler(law, rate=20), duration=0.2, threads=2)
    assert np.allclose(seen, np.tile([0.0, 0.05, 0.1, 0.15], 3))


def test_a_controller_that_raises_ends_its_member_alone(prr3):
    start = prr3.home.positions[0]

    def law(t, state):
        if state["slide_1"] > start + 0.05:
            raise ZeroDivisionError("too far")
        return [0.0, 0.0, 0.0]

    states = moving(prr3, [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [-0.1, 0.0, 0.0]])
    sampler = Sampler(law, rate=100)
    members = prr3.ensemble(states, sampler, **RUN)
    require_equal(members, [prr3.simulate(states.at(i), sampler, **RUN) for i in range(3)])
    assert members.status.tolist() == [Status.FINISHED, Status.CALLBACK_FAILED, Status.FINISHED]
    assert "ZeroDivisionError: too far" in members.message(1)


def test_drives_and_wrenches_of_members_with_their_own_forces(prr3, forces):
    drives = {"slide_1": DCMotor(resistance=2.0, inductance=0.01, torque_constant=0.5)}
    wrenches = [Wrench("platform", force=Sampled(T, random(5, 3)))]
    options = RUN | {"drives": drives, "wrenches": wrenches}
    signals = [Sampled(T, random(5, 3, seed=i)) for i in range(3)]
    for given in (forces, signals):
        runs = [prr3.simulate(prr3.home, u, **options) for u in given]
        require_equal(prr3.ensemble(prr3.home, given, **options), runs)
        assert len({run.attrs["final_q"].tobytes() for run in runs}) == len(given)


def test_members_alone_that_fail_are_named_and_the_others_go_on(prr3, forces):
    bad = forces.copy()
    bad[2, 1] = np.nan
    members = prr3.ensemble(prr3.home, bad, method="dop853", **RUN)
    assert members.failed.tolist() == [2]
    assert members.status[2] == Status.NON_FINITE
    others = np.arange(5) != 2
    runs = [prr3.simulate(prr3.home, u, method="dop853", **RUN) for u in bad[others]]
    for i, run in zip(np.flatnonzero(others), runs, strict=True):
        np.testing.assert_allclose(members.final.q[i], run.attrs["final_q"], rtol=1e-12, atol=1e-13)


def test_members_alone_each_have_their_parameters():
    robot = lw.Robot(lw.robots.prr3()).free("platform.mass")
    masses = np.linspace(0.5, 3.0, 4)
    options = RUN | {"method": "rodas"}
    members = robot.ensemble(robot.home, [0.3, 0.1, 0.0], {"platform.mass": masses}, **options)
    runs = [
        robot.simulate(robot.home, [0.3, 0.1, 0.0], parameters={"platform.mass": m}, **options)
        for m in masses
    ]
    require_equal(members, runs)


def test_an_interruption_keeps_the_members_alone_that_are_done(prr3):
    seen = []

    def interrupt(done, members):
        seen.append(done)
        if done:
            raise KeyboardInterrupt

    members = prr3.ensemble(
        prr3.home,
        0.1 * random(200, 3),
        method="rk4",
        step=2e-5,
        duration=1.0,
        threads=1,
        progress=interrupt,
    )
    done = members.status == Status.FINISHED
    assert 0 < seen[-1] <= done.sum() < len(members)
    assert set(members.status[~done].tolist()) == {Status.CANCELLED}
    assert "cancelled at t = 0 s" in members.message(int(members.failed[-1]))
    np.testing.assert_allclose(members.final.q[members.failed[-1]], prr3.home.q)


def test_an_interruption_within_a_controller_is_one_of_all(prr3):
    calls = []

    def law(t, state):
        calls.append(t)
        if len(calls) > 30:
            raise KeyboardInterrupt
        return [0.0, 0.0, 0.0]

    states = moving(prr3, np.zeros((4, 3)))
    members = prr3.ensemble(states, Sampler(law, rate=100), duration=0.2)
    assert members.status.tolist() == [Status.FINISHED] + 3 * [Status.CANCELLED]


def test_progress_of_members_alone(prr3, forces):
    seen = []
    prr3.ensemble(
        prr3.home, forces, method="dop853", duration=0.1, progress=lambda *now: seen.append(now)
    )
    assert seen[-1] == (5, 5)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"method": "euler"}, "there is no method 'euler'"),
        ({"method": "rk4"}, r"rk4 needs a step \[s\]"),
        ({"step": 1e-3}, "a step of 0.001 s needs a method that keeps to it"),
        ({"progress": "yes"}, "progress is .yes.; give True or False"),
        ({"events": "collisions"}, "there are no events 'collisions'"),
        ({"forces": Sampler(lambda t, state: [0.0], rate=100, compiled=True)}, "1 "),
        (
            {"forces": [Sampled([0.0, 0.05], np.zeros((2, 3)))] * 2, "method": "dop853"},
            "samples for the whole run",
        ),
    ],
)
def test_bad_options_are_refused_in_one_sentence(prr3, options, sentence):
    with pytest.raises(LinkworkError, match=sentence):
        prr3.ensemble(prr3.home, **({"duration": 0.1} | options))


# Charts


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", first(2, ["prr3", "stewart", "five_bar"]))
def test_charts_chosen_for_many_are_those_chosen_for_each(name):
    """At random configurations; each determines the motion there, with pivots that are not weak."""
    robot = lw.Robot(getattr(lw.robots, name)())
    q = robot.ensemble(moving(robot, 2.0 * random(12, robot.mobility)), duration=0.3).final.q
    Phi = robot.chart.constraint_jacobian(q)
    preferred = tuple(robot.equations.tree.rates.index(name) for name in robot.independent)
    found = {}
    for members, chart in charts_at(robot.equations, Phi, preferred):
        found |= dict.fromkeys(members.tolist(), robot.chart.in_chart(chart))
    assert sorted(found) == list(range(12))
    for i, chart in found.items():
        alone = robot.chart.better(q[i], preferred)
        assert alone.key == chart.key
        (pivots,) = alone.kernel("pivots")(q[i])
        assert pivots.min() > 0.12
        solved = alone.equations.scaled(Phi[i])[np.ix_(alone.key.rows, alone.key.dependent)]
        assert np.linalg.cond(solved) < 1e3


def test_what_is_chosen_does_not_depend_on_what_was_chosen_before():
    """The same runs in one order and in the other, by robots that know no charts yet."""
    forces, ends = 3.0 * random(10, 3, seed=1), []
    for order in (slice(None), slice(None, None, -1)):
        robot = lw.Robot(lw.robots.prr3())
        start = robot.home.with_rates([0.3, -0.2, 0.1])
        runs = [robot.simulate(start, u, duration=1.0, save_at=[1.0]) for u in forces[order]][order]
        assert len(robot.run_charts) > 5
        ends.append(
            [(run.attrs["charts"], run.nfev, run.attrs["final_q"].tolist()) for run in runs]
        )
    assert ends[0] == ends[1]
