"""Charts told by tables: the numbers of a chart's own kernels, and runs that are the same."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from numba import types

import linkwork as lw
from linkwork.control import Event, Lag, Sampler, Wrench
from linkwork.equations.chart_choice import relative_pivots
from linkwork.kernels import PAYS, kernel
from linkwork.kernels.program import Program
from linkwork.model import charts
from linkwork.model.chart_tables import tabled, varying
from linkwork.runs.system import system
from linkwork.simulation import partitioned
from linkwork.simulation.compiled import compiled_once
from linkwork.simulation.vectors import LANES

from tests.oracle.random_joints import random_loops
from tests.products import first
from tests.robot.test_crossing import OVER, RATE, parallelogram

NAMES = "motion", "closure_step", "tree_rates"
CASES = {
    "3-PRR": (lw.robots.prr3, ()),
    "Bricard, a row left out": (lw.robots.bricard, ()),
    "ball joints, a block of three": (lw.robots.stewart, ()),
    "free numbers": (lw.robots.five_bar, ("bodies.proximal_1.mass",)),
    "everything": (lambda: random_loops(5, 1, effects=True, rods=1, gears=1, freedoms=2), ()),
    "a free body": (lambda: random_loops(8, 1, effects=True, platform="free"), ()),
    "two loops": (lambda: random_loops(5, 2, effects=True, rods=1, gears=1, freedoms=2), ()),
}
RUN = first(5, tuple(CASES))


@pytest.mark.long
@pytest.mark.parametrize("case", RUN)
def test_numbers_are_those_of_the_chart_s_own_kernels(case):
    """In the home chart and in one chosen elsewhere, at states near home that are a little open."""
    make, free = CASES[case]
    robot = lw.Robot(make(), free=free)
    rng, q = np.random.default_rng(2), robot.home.q
    for chart in (robot.chart, robot.chart.better(q, ())):
        for name in NAMES:
            own, found = chart.kernel(name), tabled(robot.chart.compiled, chart.equations, name)
            more = rng.normal(size=found.n_in - q.size - robot.p.size)
            x = (q + 1e-3 * rng.normal(size=q.size), more, robot.p)
            expected, values = own.flat(*x), found.flat(*x)
            scale = np.abs(expected).max()
            np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-11 * scale)


def test_pivots_that_vary_are_those_that_count():
    """The trace of the pivots tells which of them are constants."""
    for make in (lw.robots.prr3, lw.robots.stewart, lw.robots.delta, lw.robots.bricard):
        robot = lw.Robot(make())
        program: Program = robot.kernel("pivots").traced()
        traced = [program.nodes[k].op != "const" for k in program.results]
        assert varying(robot.equations.chart, robot.equations.rows.pattern) == traced


@compiled_once("a positive matrix for the tests", types.void(*[types.float64[::1]] * 2))
def solved_positive(M, b):
    partitioned.solved_positive(M, b.size, b)


def test_a_singular_inertia_is_not_finite():
    M, b = np.outer([1.0, 2.0], [1.0, 2.0]), np.ones(2)
    solved_positive(M.ravel(), b)
    assert not np.isfinite(b).all()


@pytest.mark.long
def test_runs_by_tables_end_where_others_do(monkeypatch):
    """Nobody waits for kernels of charts on the way, and the results are the same each time."""
    mechanism, compiled = lw.robots.rrr3(), []

    def run(large: int) -> np.ndarray:
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(mechanism)
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        found = robot.simulate(start, duration=1.0, rtol=1e-10, atol=1e-12)
        assert found.success and len(robot.run_charts) > 1
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        compiled.append(any("motion" in chart._kernels for chart in others))
        return found.variables["joint_position"].values[-1]

    own, told, again = run(10**9), run(0), run(0)
    assert compiled == [True, False, False]
    np.testing.assert_allclose(told, own, atol=1e-8)
    np.testing.assert_array_equal(told, again)


def test_a_chart_that_is_used_for_long_gets_kernels_of_its_own(monkeypatch):
    monkeypatch.setattr(charts, "LARGE", 0)
    robot = lw.Robot(lw.robots.five_bar())
    chart = robot.chart.better(robot.home.q, ())
    assert chart.single("motion") is not chart.kernel("motion")
    chart.count(charts.OWN)
    assert chart.single("motion") is chart.kernel("motion")
    assert robot.chart.single("motion") is robot.chart.kernel("motion")


def pushed(t, state):
    """A controller with feedback of every kind that a run offers."""
    first, *others = state.names.actuators
    pull = 5 * (0.1 - state[first]) - 0.2 * state.rate(first) + lw.math.sin(20 * t)
    return {first: pull} | dict.fromkeys(others, 0.3)


def sticking() -> lw.Mechanism:
    """A five-bar whose passive hinges stick: states of bristles."""
    mechanism = lw.robots.five_bar()
    name = next(name for name in mechanism.joints if name not in mechanism.actuators)
    stick = lw.Friction(coulomb=0.1, bristle=lw.Bristle(stiffness=100.0, damping=1.0))
    joint = mechanism.joints[name].model_copy(update={"friction": stick})
    return mechanism.model_copy(update={"joints": {**mechanism.joints, name: joint}})


ACTED = {
    "wrench, drive, event": (lw.robots.prr3, ()),
    "free numbers": (lw.robots.five_bar, ("bodies.proximal_1.mass",)),
    "ball joints": (lw.robots.stewart, ()),
    "bristles": (sticking, ()),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize("case", ACTED)
def test_what_acts_is_that_of_the_chart_s_own_kernels(case):
    """Motion with what acts and events, in a chart that is told, beside those compiled for it."""
    make, free = ACTED[case]
    robot = lw.Robot(make(), free=free)
    rng, q, body = np.random.default_rng(3), robot.home.q, robot.bodies[-1]
    acting = {
        "drives": {robot.actuators[0]: Lag(0.05)},
        "wrenches": [Wrench(body, force=lambda t, state: [state.rate(robot.rates[0]), 1, t])],
    }
    events = (Event(lambda t, state: state[robot.coordinates[-1]] - t, name="seen"),)
    runs = system(robot, pushed, events=events, parameters={}, span=(0.0, 1.0), **acting)
    chart = robot.chart.better(q, ())
    for entry, name in (("motion", "motion"), ("seen", "events")):
        own = runs.kernel(chart, name)
        asked = runs.kernel(chart.free, "balance" if name == "motion" else name)
        found = chart.by_table(entry, asked)
        more = rng.normal(size=own.n_in - q.size - runs.p(chart).size)
        x = (q + 1e-3 * rng.normal(size=q.size), more, runs.p(chart))
        expected = own.flat(*x)
        np.testing.assert_allclose(
            found.flat(*x), expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max()
        )


def told_and_own(monkeypatch, *, each: str, **options) -> list[lw.Run]:
    """Return a run whose charts are compiled, and one whose charts are told by tables."""
    found = []
    for large in (10**9, 0):
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(lw.robots.rrr3())
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        run = robot.simulate(
            start, **options, duration=1.0, rtol=1e-10, atol=1e-12, save_at=[0.2, 0.6, 1.0]
        )
        assert run.success and len(robot.run_charts) > 1
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        run[each]
        assert any(chart._kernels for chart in others) == (large > 0)
        found.append(run)
    return found


MEASURED = (
    *("joint_position", "joint_rate", "joint_acceleration", "actuator_force"),
    *("kinetic_energy", "energy_balance", "actuator_power"),
)


@pytest.mark.sample(1)
@pytest.mark.parametrize("kind", ["controller", "drives", "sampled", "plain"])
def test_runs_with_what_acts_are_the_same_by_tables(kind, monkeypatch):
    """States, accelerations, forces, energies and events, and no kernel is made for a chart."""
    forces = {"sampled": Sampler(pushed, rate=100.0), "plain": [0.5, 0.0, 0.0]}.get(kind, pushed)
    names = lw.robots.rrr3().actuators
    drives = dict.fromkeys(names, Lag(0.05)) if kind == "drives" else None
    events = [Event(lambda t, state: state.rate(names[1]), name="turned round")]
    own, told = told_and_own(
        monkeypatch, each="joint_acceleration", forces=forces, drives=drives, events=events
    )
    for name in MEASURED:
        expected = own[name].values
        np.testing.assert_allclose(
            told[name].values, expected, atol=1e-7 * max(1.0, np.abs(expected).max()), err_msg=name
        )
    times = [run.coords["event_time"].values for run in (own, told)]
    np.testing.assert_allclose(*times, atol=1e-8)
    assert times[0].size


def test_a_run_by_tables_with_drives_goes_on_bit_for_bit(monkeypatch):
    """Stopped in a chart that is told, and gone on with by the same robot and by a fresh one."""
    monkeypatch.setattr(charts, "LARGE", 0)
    robot, fresh = lw.Robot(lw.robots.rrr3()), lw.Robot(lw.robots.rrr3())
    given = {"forces": pushed, "drives": dict.fromkeys(robot.actuators, Lag(0.05))}
    start = robot.home.with_rates([4.0, -3.0, 2.0])
    half = robot.simulate(start, duration=0.5, **given)
    assert len(robot.run_charts) > 2
    one, other = (each.resume(half, duration=0.5, **given) for each in (robot, fresh))
    for name in ("joint_position", "joint_rate", "joint_acceleration", "drive_state"):
        np.testing.assert_array_equal(one[name].values, other[name].values)


def test_what_asks_for_the_chart_itself_is_compiled_for_it(monkeypatch):
    """det S is that of the rates that are independent at the moment; no table tells it."""
    monkeypatch.setattr(charts, "LARGE", 0)
    robot = lw.Robot(lw.robots.rrr3())
    start = robot.home.with_rates([4.0, -3.0, 2.0])
    watched = Event(lambda t, state: state.actuation_determinant, name="singular")
    run = robot.simulate(start, duration=1.0, events=[watched])
    assert run.success and len(robot.run_charts) > 1
    state = run.final
    np.testing.assert_allclose(
        robot.observe(state).actuation_determinant, np.linalg.det(robot.actuation(state)), 1e-9
    )
    np.testing.assert_allclose(robot.observe(state).positions, state.positions, atol=1e-12)


def test_forces_along_the_task_are_those_of_compiled_charts(monkeypatch):
    """The task's Jacobian by the actuators needs a chart's own independent rates."""

    def pulled(t, state):
        return dict(
            zip(state.names.actuators, state.task_jacobian.T @ [1.0, 0.5, 0.0], strict=True)
        )

    mechanism, found = lw.robots.rrr3(), []
    tools = {
        name: tool.model_copy(update={"task": ("x", "y", "rz")})
        for name, tool in mechanism.tools.items()
    }
    for large in (10**9, 0):
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(mechanism.model_copy(update={"tools": tools}))
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        run = robot.simulate(start, forces=pulled, duration=1.0, rtol=1e-10, atol=1e-12)
        assert run.success and len(robot.run_charts) > 1
        found.append(run["joint_position"].values[-1])
    np.testing.assert_allclose(*found, atol=1e-8)


def test_what_a_table_began_to_measure_is_measured_to_the_end(monkeypatch):
    """Also where the chart was used for so long meanwhile that it got kernels of its own."""
    monkeypatch.setattr(charts, "LARGE", 0)
    robot = lw.Robot(lw.robots.rrr3())
    start = robot.home.with_rates([4.0, -3.0, 2.0])
    runs = [robot.simulate(start, duration=0.3, save_at=[0.3]) for _ in range(2)]
    expected = runs[0]["joint_acceleration"].values
    assert runs[1]["kinetic_energy"].size
    for chart in robot.run_charts.values():
        chart.count(charts.OWN)
    np.testing.assert_array_equal(runs[1]["joint_acceleration"].values, expected)


def in_lanes(address: int, x: np.ndarray, n_out: int) -> np.ndarray:
    """Return the outputs (LANES, n_out) of what evaluates states side by side; x: (LANES, n_in)."""
    held = [np.zeros(size * len(x) + 8) for size in (x.shape[1], n_out)]
    starts = [-part.ctypes.data % 64 // 8 for part in held]
    given, found = (
        part[start : start + part.size - 8].reshape(-1, len(x))
        for part, start in zip(held, starts, strict=True)
    )
    given[:] = x.T
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)
    kind(address)(given.ctypes.data, found.ctypes.data)
    return found.T


@pytest.mark.long
@pytest.mark.parametrize("case", RUN)
def test_states_side_by_side_are_as_each_alone(case):
    """To the last digit, with a singular state in one of the lanes; every entry."""
    make, free = CASES[case]
    robot = lw.Robot(make(), free=free)
    rng, q = np.random.default_rng(4), robot.home.q
    chart = robot.chart.better(q, ())
    for name in (*NAMES, "tree_motion"):
        one, wide = (
            tabled(robot.chart.compiled, chart.equations, name, wide=side) for side in (False, True)
        )
        more = rng.normal(size=(LANES, one.n_in - q.size - robot.p.size))
        near = q + 1e-3 * rng.normal(size=(LANES, q.size))
        x = np.hstack([near, more, np.broadcast_to(robot.p, (LANES, robot.p.size))])
        x[-1, : q.size] = np.nan
        expected = np.array([one.flat(state) for state in x])
        found = in_lanes(wide.address, x, one.n_out)
        np.testing.assert_array_equal(found[:-1], expected[:-1])
        assert np.isnan(found[-1]).any()


@pytest.mark.long
@pytest.mark.parametrize("acted", [False, True])
def test_ensembles_by_tables_are_those_of_compiled_charts(acted, monkeypatch):
    """Of members that go through many charts, none of which gets kernels of its own; events, too.

    Each is, to the last digit, what it is when it runs alone.
    """
    options, found = {"duration": 1.0, "rtol": 1e-10, "atol": 1e-12, "samples": 5}, []
    if acted:
        options["drives"] = dict.fromkeys(lw.robots.rrr3().actuators, Lag(0.05))
        options["events"] = [Event(lambda t, state: state.rate(state.names.actuators[1]))]
    for large in (10**9, 0):
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(lw.robots.rrr3())
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        forces = np.linspace(-0.5, 0.5, 9)[:, None] * [1.0, 0.0, -1.0]
        ran = robot.ensemble(start, forces, **options)
        assert ran.success and len(robot.run_charts) > 1
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        found.append([ran.dataset[name].values for name in ("joint_position", "joint_rate")])
        assert any("closure_step" in chart._kernels for chart in others) == (large > 0)
        alone = robot.simulate(start, forces[3], **options)
        np.testing.assert_array_equal(
            ran.dataset["joint_position"].values[3], alone["joint_position"].values
        )
    for own, told in zip(*found, strict=True):
        # The first member, through eight charts, is 2e-6 rad/s off the motion itself.
        np.testing.assert_allclose(told, own, atol=5e-6)


def test_what_is_bound_has_a_function_of_its_own_as_long_as_it_lives():
    """Many at a time; those that are left are given to others."""
    robot = lw.Robot(lw.robots.five_bar())
    equations, q = robot.equations, robot.home.q
    held = [tabled(robot.chart.compiled, equations, name) for name in NAMES for _ in range(50)]
    assert len({each.address for each in held}) == len(held)
    freed = held.pop().address
    other = tabled(robot.chart.compiled, equations, "closure_step")
    assert other.address == freed
    np.testing.assert_array_equal(
        other.flat(q), robot.chart.kernel("closure_step").flat(q, robot.p)
    )


SLOPED = {name: (*CASES[name], False) for name in list(CASES)[:4]} | {
    f"{name}, acted": (*ACTED[name], True) for name in ("free numbers", "bristles")
}


@pytest.mark.long
@pytest.mark.parametrize("case", SLOPED)
def test_jacobians_are_those_of_the_chart_s_own_kernels(case):
    """df/dy and df/dr at states that are a little open; quaternions off their length, too."""
    make, free, acted = SLOPED[case]
    robot = lw.Robot(make(), free=free)
    rng, q, body = np.random.default_rng(5), robot.home.q, robot.bodies[-1]
    forces, drives, wrenches = None, None, ()
    if acted:
        forces, drives = pushed, {robot.actuators[0]: Lag(0.05)}
        wrenches = [Wrench(body, force=lambda t, state: [state.rate(robot.rates[0]), 1, t])]
    runs = system(robot, forces, drives, wrenches, (), {}, (0.0, 1.0), joined=True)
    for chart in (robot.chart, robot.chart.better(q, ())):
        tangent, found = runs.kernel(chart, "tangent"), runs.slopes(chart)
        *sizes, directions = (size for _, size in tangent.inputs)
        p = runs.p(chart)
        more = rng.normal(size=sum(sizes) - q.size - p.size)
        state = q + 1e-3 * rng.normal(size=q.size), more, p
        expected = tangent(
            *np.split(np.concatenate(state), np.cumsum(sizes)[:-1]), np.eye(directions)
        )
        scale = np.abs(expected[0]).max()
        np.testing.assert_allclose(
            found.flat(*state).reshape(expected[0].shape),
            expected[0],
            rtol=1e-9,
            atol=1e-11 * scale,
        )


@pytest.mark.long
def test_stiff_runs_by_tables_are_those_of_compiled_charts(monkeypatch):
    """From chart to chart, and no kernel is made for any of them."""
    found = []
    for large in (10**9, 0):
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(lw.robots.rrr3())
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        run = robot.simulate(
            start, pushed, duration=0.5, rtol=1e-9, atol=1e-11, save_at=[0.25, 0.5], method="rodas"
        )
        assert run.success and len(robot.run_charts) > 1
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        assert any(chart._kernels for chart in others) == (large > 0)
        found.append(run["joint_position"].values)
    np.testing.assert_allclose(*found, atol=1e-8)


@pytest.mark.parametrize("case", RUN)
def test_pivots_by_numbers_are_those_of_the_kernel(case):
    make, free = CASES[case]
    robot = lw.Robot(make(), free=free)
    rng, q = np.random.default_rng(6), robot.home.q
    chart = robot.chart.better(q, ())
    states = q + 1e-2 * rng.normal(size=(4, q.size))
    Phi = chart.constraint_jacobian(states)
    found = relative_pivots(chart.equations, chart.key, Phi)
    expected = chart.kernel("pivots")(states)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.sample(2)
@pytest.mark.parametrize("frame", ["ground", "second"])
@pytest.mark.parametrize("make", [lw.robots.rrr3, sticking])
def test_reactions_by_tables_are_those_of_compiled_charts(make, frame, monkeypatch):
    """Along a run through many charts, of which none gets kernels of its own; bristles, too."""
    found = []
    for large in (10**9, 0):
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(make())
        start = robot.home.with_rates(np.linspace(4.0, -3.0, robot.mobility))
        run = robot.simulate(start, duration=0.5, rtol=1e-10, atol=1e-12, samples=9)
        reactions = run.reactions(frame=frame).values
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        assert any(chart._kernels for chart in others) == (large > 0 and bool(others))
        found.append(reactions)
    own, told = found
    np.testing.assert_allclose(told, own, atol=1e-6 * np.abs(own).max())


def test_ways_over_singular_poses_by_tables_are_those_of_compiled_charts(monkeypatch):
    """A parallelogram that folds flat five times, in the chart of its rocker: its own rate."""
    mechanism, found = parallelogram(gravity=(0.0, -1.0, 0.0)), []
    for large in (10**9, 0):
        monkeypatch.setattr(charts, "LARGE", large)
        robot = lw.Robot(mechanism)
        start = robot.in_chart(robot.home.with_rates([RATE]), ("rocker_pivot",))
        run = robot.simulate(start, duration=5.0, samples=20, **OVER)
        assert run.success and run.singular_times.size >= 4
        others = [chart for chart in robot.run_charts.values() if chart.home is not None]
        assert others and any(chart._kernels for chart in others) == (large > 0)
        found.append(run["joint_position"].values)
    np.testing.assert_allclose(*found, atol=1e-7)


def test_runs_that_are_interpreted_at_first_are_those_of_compiled_kernels(monkeypatch, tmp_path):
    """Bit for bit: in charts told by tables, too, and when code takes over on the way."""
    monkeypatch.setattr(charts, "LARGE", 0)
    mechanism = lw.robots.rrr3()

    def run(robot: lw.Robot) -> np.ndarray:
        start = robot.home.with_rates([4.0, -3.0, 2.0])
        found = robot.simulate(start, duration=1.0, rtol=1e-10, atol=1e-12)
        assert found.success and len(robot.run_charts) > 1
        return found.variables["joint_position"].values

    compiled = run(lw.Robot(mechanism))
    monkeypatch.setattr(kernel, "LONG", 0)
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path))
    robot = lw.Robot(mechanism)
    np.testing.assert_array_equal(run(robot), compiled)
    motion, forces = robot.kernel("motion"), robot.chart._kernels["uncharted motion"]
    for told in (motion, forces):
        assert told._tapes and not told._modules
        told._tapes[0]._table[0] = PAYS - 20
    np.testing.assert_array_equal(run(robot), compiled)
    assert motion._modules and forces._modules


def test_steppers_have_code_from_the_first_step_on(monkeypatch, tmp_path):
    monkeypatch.setattr(charts, "LARGE", 0)
    monkeypatch.setattr(kernel, "LONG", 0)
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path))
    robot = lw.Robot(lw.robots.five_bar())
    stepper = robot.stepper(robot.home, 1e-3)
    assert not robot.run_chart.kernel("motion")._tapes[0].evaluations
    stepper.step()
    assert robot.run_chart.kernel("motion")._modules
