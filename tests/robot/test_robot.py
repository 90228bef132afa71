"""The robot's interface: shapes, batches, kinematics, and agreement with the textbook
formulation."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.lab.textbook import Textbook
from linkwork.robot import Robot
from linkwork.robots import prr3


@pytest.fixture(scope="module")
def robot():
    return Robot(prr3())


@pytest.fixture(scope="module")
def states(robot):
    """60 random states over the workspace, away from its edge and its singular poses, with random
    rates."""
    return workspace_states(robot, 60)


def workspace_states(robot, count, seed=3):
    random = np.random.default_rng(seed)
    poses = [0.5, np.sqrt(3) / 6, 0.8] + random.uniform(-1, 1, (8 * count, 3)) * [0.25, 0.25, 1.0]
    poses = poses[[np.abs(across_rails(pose)).max() < 0.29 for pose in poses]]
    reached = robot.assemble(tool=poses)
    regular = np.flatnonzero(np.abs(robot.kernel("maps")(reached.q)[-1][:, 0]) > 0.5)[:count]
    assert regular.size == count
    return reached.at(regular).with_rates(random.normal(size=(count, 3)))


def across_rails(pose):
    """Return how far the platform's vertices stand from their rails; within l1 = 0.3 m the pose can
    be reached."""
    (x, y, angle), a = pose, 2 * np.pi / 3 * np.arange(3)
    corners = np.array([[0, 0], [1, 0], [0.5, np.sqrt(3) / 2]])
    vertices = np.column_stack([x - 0.15 * np.cos(angle + a), y - 0.15 * np.sin(angle + a)])
    return np.sum((vertices - corners) * np.column_stack([-np.sin(a), np.cos(a)]), axis=1)


def test_names_and_sizes(robot):
    assert robot.mobility == 3
    assert robot.joints == tuple(
        f"{kind}_{i}" for kind in ("slide", "pivot", "wrist") for i in (1, 2, 3)
    )
    assert robot.actuators == ("slide_1", "slide_2", "slide_3")
    assert robot.bodies == (
        *(f"{kind}_{i}" for kind in ("slider", "link") for i in (1, 2, 3)),
        "platform",
    )
    assert robot.coordinates == robot.rates == robot.joints
    assert robot.independent == robot.actuators
    assert robot.redundant == robot.idle == ()


def test_inverse_kinematics_puts_the_tool_there(robot):
    state = robot.assemble(tool=[0.52, 0.27, 0.42])
    assert np.allclose(robot.tool_pose(state), [0.52, 0.27, 0.42], atol=1e-13)
    assert robot.closure_error(state) < 1e-13
    p, R = robot.body_poses(state)["platform"]
    assert np.allclose(p, [0.52, 0.27, 0], atol=1e-13)
    assert np.isclose(np.arctan2(R[1, 0], R[0, 0]), 0.42, atol=1e-13)


def test_inverse_kinematics_in_closed_form(robot):
    """For leg i the slider lies where a circle of radius l1 about the vertex meets the side
    (the paper's geometry)."""
    x, y, angle = 0.47, 0.31, 0.6
    state = robot.assemble(tool=[x, y, angle])
    for i, corner in enumerate(([0, 0], [1, 0], [0.5, np.sqrt(3) / 2])):
        a = 2 * np.pi / 3 * i
        vertex = np.array([x - 0.15 * np.cos(angle + a), y - 0.15 * np.sin(angle + a)])
        along, across = (vertex - corner) @ [[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]
        assert np.isclose(state.positions[i], along - np.sqrt(0.3**2 - across**2), atol=1e-13)


def test_direct_kinematics_from_a_guess(robot):
    guess = robot.assemble(tool=[0.52, 0.27, 0.42])
    state = robot.assemble({"slide_1": 0.2, "slide_2": 0.2, "slide_3": 0.2}, guess=guess)
    assert np.allclose([state["slide_1"], state["slide_2"], state["slide_3"]], 0.2, atol=1e-13)
    assert robot.closure_error(state) < 1e-13


def test_cut_joints_can_be_asked_for(robot):
    wrist = robot.home["wrist_3"] + 0.05
    state = robot.assemble({"wrist_3": wrist, "slide_1": 0.17, "slide_2": 0.16})
    assert np.isclose(state["wrist_3"], wrist, atol=1e-12)


def test_state_round_trip(robot, states):
    again = robot.state(states.positions, states.rates)
    assert np.abs(again.positions - states.positions).max() < 1e-13
    by_name = robot.state(
        dict(zip(robot.coordinates, states.positions[0], strict=True)),
        {"slide_1": 1, "slide_2": 2, "slide_3": 3},
    )
    assert np.allclose(by_name.positions, states.positions[0], atol=1e-13)
    assert by_name.rates.tolist() == [1, 2, 3]


def test_a_slightly_open_state_is_closed(robot):
    positions = robot.home.positions.copy()
    positions[4] += 3e-7
    state = robot.state(positions)
    assert robot.closure_error(state) < 1e-13
    assert np.abs(state.positions - positions).max() < 1e-6


def test_textbook_and_compiled_path_agree(robot, states):
    """The method twice: the paper's matrices and the kernels, to 1e-11 relative on random
    states."""
    textbook = Textbook(robot.mechanism)
    u = np.random.default_rng(8).normal(size=(12, 3))
    some = states.at(slice(0, 12))
    M, Cv, L, T = (
        robot.mass_matrix(some),
        robot.coriolis(some),
        robot.rate_map(some),
        robot.twist_map(some),
    )
    v_dot = robot.forward_dynamics(some, u)
    back = robot.inverse_dynamics(some, v_dot)
    for k in range(12):
        q, v = some.positions[k], some.rates[k]
        for found, expected in (
            (M[k], textbook.M(q)),
            (Cv[k], textbook.C(q, v) @ v),
            (L[k], textbook.L(q)),
            (T[k], textbook.T(q)),
            (v_dot[k], textbook.forward_dynamics(q, v, u[k])),
            (back[k], textbook.inverse_dynamics(q, v, v_dot[k])),
        ):
            assert np.abs(found - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())


def test_forward_after_inverse_is_the_identity(robot, states):
    wanted = np.random.default_rng(9).normal(size=(60, 3))
    found = robot.forward_dynamics(states, robot.inverse_dynamics(states, wanted))
    assert np.abs(found - wanted).max() < 1e-11


def test_batches_give_the_numbers_of_single_states(robot, states):
    u = np.random.default_rng(10).normal(size=(60, 3))
    stacked = [
        robot.forward_dynamics(states, u),
        robot.inverse_dynamics(states, u),
        robot.mass_matrix(states),
        robot.coriolis(states),
        robot.gravity(states),
        robot.rate_map(states),
        robot.twist_map(states),
        robot.joint_rates(states),
        robot.tool_pose(states),
        robot.twists(states),
        robot.closure_error(states),
    ]
    for k in (0, 7, 59):
        one = states.at(k)
        single = [
            robot.forward_dynamics(one, u[k]),
            robot.inverse_dynamics(one, u[k]),
            robot.mass_matrix(one),
            robot.coriolis(one),
            robot.gravity(one),
            robot.rate_map(one),
            robot.twist_map(one),
            robot.joint_rates(one),
            robot.tool_pose(one),
            robot.twists(one),
            robot.closure_error(one),
        ]
        for many, alone in zip(stacked, single, strict=True):
            assert many.shape[1:] == np.shape(alone)
            assert np.abs(many[k] - alone).max() < 1e-13 * max(1, np.abs(alone).max())


def test_leading_dimensions(robot, states):
    grid = robot.state(states.positions.reshape(5, 12, 9), states.rates.reshape(5, 12, 3))
    assert robot.mass_matrix(grid).shape == (5, 12, 3, 3)
    assert robot.twist_map(grid).shape == (5, 12, 42, 3)
    assert robot.forward_dynamics(grid, [0, 0, 0]).shape == (5, 12, 3)


def test_power_equals_the_forces_on_the_tool(robot, states):
    """Virtual work: with v = 0 and no gravity in the plane, G vanishes and L maps powers one to
    one."""
    assert np.abs(robot.gravity(states)).max() < 1e-14
    rates = robot.rate_map(states) @ states.rates[..., None]
    assert np.abs(rates[..., 0] - robot.joint_rates(states)).max() < 1e-13
    assert np.abs(rates[:, :3, 0] - states.rates).max() < 1e-13


def test_follow_gives_consistent_rates_and_accelerations(robot):
    path = lw.paths.together(lw.paths.circle([0.5, 0.28], 0.05), lw.paths.swing(1.2, 0.2))
    motion = robot.follow(path, duration=1.0, samples=401)
    h = motion.time[1]
    numeric = np.gradient(motion.positions, h, axis=0, edge_order=2)
    assert np.abs(numeric - motion.joint_rates)[2:-2].max() < 2e-3
    numeric = np.gradient(motion.joint_rates, h, axis=0, edge_order=2)
    assert np.abs(numeric - motion.joint_accelerations)[2:-2].max() < 8e-2
    assert np.abs(robot.tool_pose(motion.state) - motion.tool).max() < 1e-13
    assert np.abs(motion.joint_rates[:, :3] - motion.rates).max() == 0


def test_simulation_returns_to_the_prescribed_motion(robot):
    path = lw.paths.together(lw.paths.circle([0.5, 0.28], 0.05), lw.paths.swing(1.2, 0.2))
    motion = robot.follow(path, duration=1.0, samples=501)
    forces = robot.inverse_dynamics(motion)
    run = robot.simulate(
        motion.state.at(0), forces, duration=1.0, rtol=1e-10, atol=1e-12, save_at=motion.time
    )
    assert run.status is lw.Status.FINISHED
    assert run.closure_error < 1e-12
    found = run["joint_position"].values
    assert np.abs(found - motion.positions).max() < 1e-7
    assert np.abs(run["joint_acceleration"].values - motion.joint_accelerations).max() < 1e-4


def test_energy_of_force_free_runs(robot):
    """Free motion of 1 s that stays clear of singular poses keeps its energy to 1e-10 at rtol
    1e-10, the loops to 1e-12."""
    random = np.random.default_rng(5)
    for _ in range(8):
        pose = [0.5, np.sqrt(3) / 6, 1.4] + random.uniform(-1, 1, 3) * [0.05, 0.05, 0.2]
        start = robot.assemble(tool=pose).with_rates(0.03 * random.normal(size=3))
        run = robot.simulate(start, duration=1.0, rtol=1e-10, atol=1e-12)
        assert run.status is lw.Status.FINISHED
        energy = run["kinetic_energy"].values + run["potential_energy"].values
        assert np.abs(energy - energy[0]).max() < 1e-10 * abs(energy[0])
        assert run.closure_error < 1e-12


def test_file_and_catalogue_describe_the_same_robot(robot, tmp_path):
    robot.mechanism.save(tmp_path / "x.yaml")
    again = Robot.from_file(tmp_path / "x.yaml")
    assert again.mechanism == robot.mechanism
    assert np.array_equal(again.mass_matrix(again.home), robot.mass_matrix(robot.home))
