"""A regular pose is never called singular where only the order of elimination, or a determinant of
a firm block, is weak, and a singular one always is.

Whether a pose is singular is told by the least singular value of the constraints of all joints, of
the oracle's rows, and by NumPy, compared with home.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw
from linkwork.model.checks import PIVOT_BOUND

from tests.catalogue import built
from tests.oracle.maximal import MaximalOracle
from tests.products import first
from tests.robot.oracle_state import Seen

LOST = 1e-3  # of the least singular value at home


def least(robot: lw.Robot, positions: np.ndarray) -> float:
    """Return the least singular value of the constraints of all joints that leaves the mobility,
    over that at home."""
    found = []
    for q in (positions, robot.home.positions):
        oracle = MaximalOracle(robot.mechanism, dict(zip(robot.coordinates, q, strict=True)))
        A = oracle.rows(oracle.poses(oracle.near), oracle._rest).A
        found.append(np.linalg.svd(A, compute_uv=False)[A.shape[1] - robot.mobility - 1])
    return float(found[0] / found[1])


def moving(robot: lw.Robot, seed: int) -> lw.State:
    return robot.home.with_rates(2.0 * np.random.default_rng(seed).normal(size=robot.mobility))


@pytest.mark.long
@pytest.mark.parametrize("seed", first(2, [3, 12, 8]))
def test_a_run_stops_where_the_constraints_are_dependent_and_nowhere_else(seed):
    """A falling delta robot comes to singular poses of its platform (but for seed 3), and to weak
    orders before them."""
    robot = built("delta")
    run = robot.simulate(moving(robot, seed), duration=1.0)
    positions = run["joint_position"].values
    energy = run["kinetic_energy"].values + run["potential_energy"].values
    assert np.ptp(energy) < 1e-4
    if seed == 3:
        assert run.status is lw.Status.FINISHED
    else:
        assert run.status is lw.Status.SINGULAR
        assert least(robot, positions[-1]) < LOST
        assert "branches of motion meet (a bifurcation)" in run.message


# States


@pytest.fixture(scope="module")
def stewart():
    return built("stewart")


@pytest.fixture(scope="module")
def turned(stewart):
    """The platform turned about its axis, step by step, to where the home order of elimination
    comes upon a zero."""

    def turned(guess: lw.State, angle: float) -> lw.State:
        return stewart.assemble(
            tool=stewart.tool_pose(stewart.home) + angle * np.eye(6)[5], guess=guess
        )

    before, low, high = stewart.home, 0.82, 0.86
    for angle in np.linspace(0, low, 8)[1:]:
        before = turned(before, angle)
    while (middle := (low + high) / 2) not in (low, high):
        low, high = (
            (middle, high) if stewart.chart.pivot(turned(before, middle).q) > 0 else (low, middle)
        )
    rates = np.random.default_rng(1).normal(size=6)
    return [turned(before, low + beside).with_rates(rates) for beside in (-1e-3, 0.0, 1e-3)]


FORCES = np.array([3.0, -1.0, 2.0, 0.5, -2.0, 1.0])


@pytest.mark.long
def test_a_state_where_only_the_order_of_elimination_is_weak_gets_its_answers(stewart, turned):
    """Accelerations, rates and energies are the oracle's; what follows from them fits: M, inverse
    dynamics, other charts."""
    state = turned[1]
    assert abs(stewart.chart.pivot(state.q)) < 1e-6
    assert least(stewart, state.positions) > 0.5
    Seen.of(stewart, state).agree(FORCES, 1e-9)
    found = stewart.forward_dynamics(state, FORCES)
    assert np.allclose(stewart.inverse_dynamics(state, found), FORCES, atol=1e-9)
    M, kinetic = stewart.mass_matrix(state), stewart.energy(state)[0]
    assert np.isclose(state.rates @ M @ state.rates / 2, kinetic, rtol=1e-10)
    assert np.allclose(
        stewart.twist_map(state) @ state.rates, stewart.twists(state).ravel(), atol=1e-10
    )
    assert np.allclose(
        stewart.rate_map(state) @ state.rates, stewart.joint_rates(state), atol=1e-10
    )
    assert np.allclose(stewart.actuation(state), np.eye(6), atol=1e-10)
    assert np.isclose(
        stewart.observe(state).rate("pose.wz"),
        stewart.joint_rates(state)[stewart.rates.index("pose.wz")],
    )
    other = stewart.in_chart(state, [f"pose.{name}" for name in ("x", "y", "z", "wx", "wy", "wz")])
    assert np.allclose(stewart.joint_rates(other), stewart.joint_rates(state), atol=1e-10)
    assert np.allclose(stewart.in_chart(other, stewart.independent).rates, state.rates, atol=1e-10)


@pytest.mark.long
def test_derivatives_and_reactions_at_a_weak_order_lie_between_those_beside_it(stewart, turned):
    models = [stewart.linearise(state, FORCES) for state in turned]
    A = [np.hstack([model.A, model.B]) for model in models]
    wrenches = [stewart.reactions(state, FORCES).wrenches for state in turned]
    for before, there, behind in (A, wrenches):
        assert np.allclose(there, (before + behind) / 2, atol=1e-4 * np.abs(there).max())


def test_stacks_with_weak_orders_get_each_state_s_answers(stewart, turned):
    states = stewart.state(np.stack([state.positions for state in turned]), turned[0].rates)
    for ask in (stewart.forward_dynamics, lambda state, u: stewart.reactions(state, u).wrenches):
        expected = [ask(state, FORCES) for state in turned]
        assert np.allclose(ask(states, FORCES), expected, rtol=1e-9, atol=1e-7)
    assert np.allclose(stewart.mass_matrix(states)[1], stewart.mass_matrix(turned[1]), rtol=1e-9)


def test_a_run_starts_where_the_order_of_its_chart_is_weak(stewart, turned):
    run = stewart.simulate(turned[1], FORCES, duration=0.05, rtol=1e-10, atol=1e-12)
    assert run.status is lw.Status.FINISHED
    assert np.allclose(run["joint_rate"].values[0], stewart.joint_rates(turned[1]), atol=1e-9)


def test_a_state_whose_rates_do_not_determine_the_motion_is_refused_in_every_order(stewart, turned):
    """Turned by a quarter the legs' rates leave a motion of the platform (Fichter)."""
    state = turned[1]
    for angle in np.linspace(0.84, np.pi / 2, 10)[1:]:
        state = stewart.assemble(
            tool=stewart.tool_pose(stewart.home) + angle * np.eye(6)[5], guess=state
        )
    state = state.with_rates(np.ones(6))
    for ask in (
        stewart.forward_dynamics,
        stewart.inverse_dynamics,
        stewart.linearise,
        stewart.reactions,
    ):
        with pytest.raises(lw.LinkworkError, match="singular"):
            ask(state, FORCES)
    with pytest.raises(lw.LinkworkError, match="singular"):
        stewart.mass_matrix(state)


# Singular poses that were stepped over


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", [8, 12])
def test_only_poses_where_rank_is_lost_are_told_as_singular(seed):
    """Near singular poses weak orders are stepped over as well: with seed 8 there is nothing else
    to tell."""
    robot = built("delta")
    start, options = moving(robot, seed), {"duration": 0.9, "on_singular": "step_over"}
    told = robot.simulate(start, **options).singular_times
    assert len(told) == (seed == 12)
    run = robot.simulate(start, **options, save_at=[0.0, *told])
    assert all(least(robot, q) < 1e-9 for q in run["joint_position"].values[1:])


@pytest.mark.parametrize("beside", [-1e-2, -1e-3, -1e-4, -3e-5, 3e-5, 1e-4, 1e-3, 1e-2])
def test_rates_near_a_weak_order_are_those_of_a_dense_solution(stewart, turned, beside):
    """Behind a weak pivot a block is solved by cofactors, which lose its square and more."""
    tool = stewart.tool_pose(turned[1]) + beside * np.eye(6)[5]
    state = stewart.assemble(tool=tool, guess=turned[1]).with_rates(turned[1].rates)
    assert abs(stewart.chart.pivot(state.q)) < 0.05
    equations = stewart.equations
    read = ca.Function("Phi", [equations.tree.q], [equations.rows.Phi])
    Phi, names = np.array(read(state.q)), equations.tree.rates
    free = [names.index(name) for name in stewart.independent]
    held = [k for k in range(len(names)) if k not in free]
    w = np.zeros(len(names))
    w[free] = state.rates
    w[held] = np.linalg.lstsq(Phi[:, held], -Phi[:, free] @ state.rates)[0]
    found = stewart.joint_rates(state)[[stewart.rates.index(name) for name in names]]
    np.testing.assert_allclose(found, w, rtol=1e-11, atol=1e-11)
    forces = stewart.inverse_dynamics(state, stewart.forward_dynamics(state, FORCES))
    np.testing.assert_allclose(forces, FORCES, rtol=1e-9, atol=1e-9)


# Blocks whose determinant is small while their singular values are not


ROD, PLATFORM, MASS, SLIDER, PUSH, TURN = 1.0, 0.1, 1.0, 2.0, 8.0, 0.4


@pytest.fixture(scope="module")
def hung():
    """Make a platform that only translates, hung by three rods from slides that point outward."""
    joints: dict[str, lw.PrismaticJoint | lw.RodJoint] = {
        "x": lw.PrismaticJoint(connects=("ground", "cross"), axis=(1, 0, 0)),
        "y": lw.PrismaticJoint(connects=("cross", "column"), axis=(0, 1, 0)),
        "z": lw.PrismaticJoint(connects=("column", "platform"), axis=(0, 0, 1)),
    }
    for i in range(3):
        angle = 2 * np.pi * i / 3 + 0.3
        e, slider = np.array([np.cos(angle), np.sin(angle), 0.0]), f"slider_{i}"
        joints[f"slide_{i}"] = lw.PrismaticJoint(connects=("ground", slider), axis=tuple(e))
        frames = (lw.Frame(), lw.Frame(position=tuple(PLATFORM * e)))
        joints[f"rod_{i}"] = lw.RodJoint(connects=(slider, "platform"), frames=frames, length=ROD)
    slides = tuple(f"slide_{i}" for i in range(3))
    masses = {"cross": 0.0, "column": 0.0, "platform": MASS}
    masses |= {f"slider_{i}": SLIDER for i in range(3)}
    mechanism = lw.Mechanism(
        name="hung",
        bodies={name: lw.Body(mass=mass) for name, mass in masses.items()},
        joints=joints,
        actuators=slides,
        gravity=(0, 0, -9.81),
        reference=dict.fromkeys(slides, PLATFORM + 0.5) | {"z": -np.sqrt(0.75)},
    )
    return lw.Robot(mechanism)


def swung(least: float) -> np.ndarray:
    """Return how far all slides are beside the platform, and their speed, TURN s after they turn
    back at a least distance: of one freedom by hand."""

    def slope(_, y):
        x, v = y
        h = np.sqrt(ROD**2 - x**2)
        force = 3 * PUSH - MASS * x / h * (9.81 + ROD**2 / h**3 * v**2)
        return v, force / (3 * SLIDER + MASS * (x / h) ** 2)

    return solve_ivp(slope, (0, TURN), (least, 0.0), rtol=1e-12, atol=1e-14).y[:, -1]


@pytest.fixture
def towards(hung):
    """Make a state from which the rods become nearly parallel, and those of the way back."""
    x, v = swung(0.004)
    start = hung.assemble(dict.fromkeys(hung.actuators, PLATFORM + x)).with_rates([-v] * 3)
    return start, PLATFORM + x


@pytest.mark.parametrize("method", ["dormand_prince", "dop853", "rk4"])
def test_runs_pass_where_a_block_is_firm_and_its_determinant_small(hung, towards, method):
    """Two singular values are a hundredth of those at home, and the determinant is its square."""
    start, end = towards
    options = {"step": 1e-3} if method == "rk4" else {"rtol": 1e-10}
    run = hung.simulate(start, [PUSH] * 3, duration=2 * TURN, method=method, **options)
    assert run.status is lw.Status.FINISHED
    nearest = hung.run_chart.pivot(hung.assemble(dict.fromkeys(hung.actuators, 0.104)).q)
    assert nearest < PIVOT_BOUND
    np.testing.assert_allclose(run.final.positions[-3:], end, atol=1e-9)


def test_members_and_steps_pass_where_a_block_is_firm(hung, towards):
    start, end = towards
    stack = hung.state(np.tile(start.positions, (2, 1)), start.rates)
    members = hung.ensemble(stack, [PUSH] * 3, duration=2 * TURN, rtol=1e-10)
    assert not members.failed.size
    steppers = hung.stepper(stack, dt=1e-3)
    for _ in range(800):
        steppers.step([PUSH] * 3)
    for positions in (*members.final.positions, steppers.alone(1).state.positions):
        np.testing.assert_allclose(positions[-3:], end, atol=1e-9)
