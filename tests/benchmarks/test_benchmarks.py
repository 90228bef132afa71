"""The benchmarks run, on tiny sizes, and what they measure against is right. Nothing here depends
on speed."""

import numpy as np
import pytest
from rich.console import Console

import linkwork as lw
from linkwork.kernels import cache
from linkwork.robots import prr3

from benchmarks import (
    accuracy,
    by_hand,
    kernel,
    native,
    reference,
    runs,
    size,
    table,
    tasks,
    timing,
)
from benchmarks.machine import Machine, describe


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(prr3())


@pytest.fixture(scope="module")
def task(robot):
    return tasks.second_of_motion(robot, samples=51)


@pytest.mark.long
def test_terms_agree_with_forty_digits():
    """M, C v, G, forces and accelerations in ten states over the workspace, gravity in the
    plane."""
    for name, errors in accuracy.against_oracle(10).items():
        assert errors.shape == (10,)
        assert 0 <= errors.max() < 1e-12, name


def test_states_lie_on_both_sides_of_the_singular_surface(robot):
    states = tasks.workspace_states(robot, 30)
    poses = robot.tool_pose(states)
    assert (poses[:, 2] < 0.7).any() and (poses[:, 2] > 0.95).any()
    assert np.abs(states.rates).max() > 1
    for pose, q in zip(poses, states.positions, strict=True):
        assert np.allclose(0.3 * np.sin(q[3:6]), tasks.across_rails(pose), atol=1e-12)


def test_equations_by_hand_agree_with_the_kernel(robot):
    states = tasks.workspace_states(robot, 10)
    forces = np.random.default_rng(1).normal(size=(10, 3))
    exact, rates = robot.forward_dynamics(states, forces), robot.joint_rates(states)
    for k, pose in enumerate(robot.tool_pose(states)):
        x = by_hand.from_joints(states.positions[k], pose)
        x_dot, acceleration = by_hand.derivative(x, states.rates[k], forces[k])
        assert np.abs(acceleration - exact[k]).max() < 1e-12 * np.abs(exact[k]).max()
        assert np.allclose(x_dot[:6], rates[k, :6], atol=1e-12)


def test_the_reference_agrees_with_other_integrators_and_equations(robot, task):
    """Extrapolation in long doubles, DOP853 on the kernel and DOP853 on the equations by hand meet
    at the end."""
    found = reference.reference(robot, tasks.Task(task.start, task.signal, duration=0.1))
    assert found.order < 1e-10
    assert found.integrator < 1e-12
    assert found.formulation < 1e-12


def test_midpoint_rule_and_extrapolation_reach_their_orders():
    """y' = y over one step of h: the error of k columns falls like h^(2k + 1)."""
    for columns in (1, 2, 3):
        errors = []
        for h in (0.4, 0.2):
            y = reference.extrapolate(
                lambda y, u: y, np.ones(1), np.zeros((4, 1)), np.longdouble(h), columns
            )
            errors.append(abs(float(y[0]) - np.exp(h)))
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * columns + 1, abs=0.35)


def test_lookup_evaluates_the_signal(task):
    lookup = by_hand.Lookup(task.signal)
    for t in (0.0, 0.013, 0.5, 0.999, 1.0):
        assert np.allclose(lookup(t), task.signal(t), rtol=1e-13, atol=1e-13)


def test_native_loops_evaluate_every_state(robot):
    """The blocks, the chain and the row of states give the numbers of the kernel called from
    Python."""
    compiled = robot.kernel("motion")
    _, x = kernel.inputs(robot, 8 * compiled.lanes)
    nq, n = robot.equations.nq, robot.mobility
    expected = np.hstack(compiled(x[:, :nq], x[:, nq : nq + n], x[:, nq + n :]))
    out = np.zeros_like(expected)
    native.evaluate_independent(compiled.address, x, out)
    assert np.allclose(out, expected, rtol=1e-11)
    last = np.zeros(compiled.n_out)
    native.evaluate_chained(compiled.address, x, nq + n, 0.0, np.zeros(compiled.n_in), last)
    assert np.allclose(last, expected[-1], rtol=1e-11)
    batch = native.in_batches(compiled, x)
    batch.call()
    assert batch.items == native.REPEATS * len(x)


def test_compiled_loop_ends_where_integrate_does(robot, task):
    loop = runs.compiled_loop(robot, task, 1e-6)
    for _ in range(2):
        assert np.array_equal(loop(), runs.integrated(robot, task, 1e-6).q_end)


def test_interleaved_times_count_items():
    seconds = timing.interleaved(
        {"a": timing.Contender(lambda: sum(range(1000)), items=10)}, rounds=3, block=1e-4
    )
    assert seconds["a"].shape == (3,)
    assert (seconds["a"] > 0).all()


@pytest.mark.long
def test_engines_solve_the_same_task(robot, task):
    """Pinocchio, MuJoCo, Exudyn and SciPy end near the reference, each within what its method can
    do."""
    work_precision = pytest.importorskip(
        "benchmarks.work_precision", reason="the engines are not installed"
    )
    short = tasks.Task(task.start, task.signal, duration=0.2)
    exact = reference.reference(robot, short)
    grid = work_precision.Grid(
        tolerances=(1e-6, 1e-8), steps=(50, 100), exudyn_steps=(50, 100), rounds=1
    )
    curves = work_precision.measure(robot, short, exact, grid)
    assert max(curves[work_precision.LINKWORK].errors) < 1e-5
    assert max(curves[work_precision.NUMPY].errors) < 1e-5
    assert max(curves[work_precision.PINOCCHIO].errors) < 1e-7
    assert max(curves[work_precision.MUJOCO].errors) < 1e-6
    assert max(curves[work_precision.EXUDYN].errors) < 1e-4
    assert "</svg>" in work_precision.plot(curves)
    assert work_precision.figures(curves, exact)


def test_other_hands_compute_the_same_accelerations(robot):
    others = pytest.importorskip("benchmarks.others", reason="the engines are not installed")
    errors = others.errors(robot, count=5)
    assert (
        max(
            errors["Pinocchio"].max(),
            errors["NumPy by hand"].max(),
            errors["Linkwork, batch"].max(),
        )
        < 1e-12
    )
    assert errors["MuJoCo"].max() < 1e-4


def test_time_at_equal_error_is_interpolated():
    work_precision = pytest.importorskip(
        "benchmarks.work_precision", reason="the engines are not installed"
    )
    curve = work_precision.Curve([1.0, 2.0, 3.0], [1e-2, 1e-4, 1e-6], [1.0, 10.0, 100.0])
    assert curve.time_at(1e-3) == pytest.approx(np.sqrt(10))
    assert curve.time_at(1e-6) == pytest.approx(100)
    assert curve.time_at(1e-7) is None


def test_floating_point_operations_are_counted():
    names = ("vfmadd213pd", "vfnmsub231sd", "vaddpd", "vmovapd", "vdivsd", "vpaddq")
    listing = "".join(f"\t{name}\t%ymm1, %ymm2, %ymm3\n" for name in names)
    assert size.floating_point_operations(listing) == 2 + 2 + 1 + 0 + 1 + 0


def test_figures_know_whether_they_are_met():
    assert table.Figure("a", 3.0, "ns", 4.0).met is True
    assert table.Figure("a", 3.0, "", 4.0, "at least").met is False
    assert table.Figure("a", None, "ns", 17.0).cells == ("a", "≤ 17 ns", "not measurable here", "")
    assert table.Figure("a", 1.23456e-14).cells == ("a", "", "1.2e-14", "")
    assert table.Figure("a", 59.97, "", 60, "at least").cells == ("a", "≥ 60", "59.97", "NO")
    assert table.quantity(14123.4, "µs") == "14123 µs"


def test_tables_hold_listings_beside_figures():
    listing = table.Listing(("robot", "batch [ns]"), [("pendulum", "1")])
    section = table.Section(
        "Catalogue", "All.", [table.Figure("a", 3.0, note="so")], listing=listing
    )
    page = table.markdown(
        table.Page("Mechanisms", "mechanisms", [section]), describe(lanes=2), "", 1.0
    )
    assert "# Mechanisms: what" in page and "`mechanisms.json`" in page
    assert "| robot | batch [ns] |\n| --- | --- |\n| pendulum | 1 |" in page
    assert "| a (so) |  | 3 |  |" in page
    console = Console(width=80)
    with console.capture() as capture:
        console.print(table.terminal(section))
    shown = capture.get()
    assert "pendulum" in shown and "batch [ns]" in shown and "figure" in shown


def test_tables_name_machine_command_and_figures():
    machine = describe(lanes=2)
    section = table.Section(
        "Speed", "One way.\n\nAnother.", [table.Figure("a", 3.0, "ns", 4.0, note="so")]
    )
    page = table.markdown(
        table.Page("Speed", "speed", [section]), machine, "python -m benchmarks", 12.3
    )
    assert "| a (so) | ≤ 4 ns | 3 ns | yes |" in page
    assert machine.cpu in page and "python -m benchmarks" in page and "GFLOP/s" in page


def test_the_machine_is_measured():
    machine = describe(lanes=2)
    assert isinstance(machine, Machine)
    assert 0.5 < machine.clock < 10
    assert machine.peak > machine.clock
    assert "numpy" in machine.packages


def test_an_empty_cache_is_empty_and_leaves_the_usual_one_in_place():
    usual = cache.folder()
    with timing.empty_cache():
        assert cache.folder() != usual and not list(cache.folder().iterdir())
    assert cache.folder() == usual


def test_times_are_said_in_their_unit():
    assert timing.best(np.array([2.5e-8, 3e-8])) == "best 25 ns"
    assert timing.best(np.array([2.5e-5])) == "best 25 µs"
    assert timing.best(np.array([2.5])) == "best 2.5e+03 ms"
