"""Free directions: turned frames are those of other readers of the file, their derivatives are
smooth also at zero, and a mechanism that a tilt locks is refused."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.equations.algebra import symbol
from linkwork.equations.body_motion import tool_pose
from linkwork.equations.derivation import derive
from linkwork.equations.frames import exponential, frame_matrix, turned_back, turned_by
from linkwork.equations.orientation import Orientation
from linkwork.mechanism.numbers import edited
from linkwork.mechanism.record import swapped

TURN = (0.3, -0.2, 0.5)


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-9, 0.4999, 0.5001, 1.0, 3.0, 6.0])
def test_the_exponential_of_a_free_rotation_vector(size):
    r = size * np.array(TURN) / np.linalg.norm(TURN)
    free = [symbol(name) for name in "abc"]
    R = ca.Function("R", [ca.vertcat(*free)], [exponential(free)])
    expected = Rotation.from_rotvec(r).as_matrix()
    assert np.abs(np.array(R(r)) - expected).max() < 3e-16 * 4


@pytest.mark.parametrize(
    "r", [(0.0, 0.0, 0.0), (0.0, 1e-9, 0.0), (0.28, 0.3, 0.28), (2.0, 1.0, -2.0)]
)
def test_its_derivative_is_that_of_differences(r):
    """Also where the vector is zero, and where the series ends."""
    free = [symbol(name) for name in "abc"]
    p = ca.vertcat(*free)
    J = ca.Function("J", [p], [ca.jacobian(ca.vec(exponential(free).T), p)])
    h, found = 1e-6, np.array(J(r))
    for k in range(3):
        ends = [
            Rotation.from_rotvec(np.array(r) + s * h * np.eye(3)[k]).as_matrix() for s in (1, -1)
        ]
        expected = (ends[0] - ends[1]).ravel() / (2 * h)
        assert np.abs(found[:, k] - expected).max() < 1e-9


def test_frames_of_free_numbers_are_those_of_numbers():
    frame = lw.Frame(rotation=(0.4, 0.0, -0.7), turn=TURN)
    R = frame_matrix(frame)
    assert np.abs(R - Rotation.from_rotvec(frame.orientation).as_matrix()).max() < 1e-15
    names = [symbol(name) for name in ("r", "t")]
    free = swapped(frame, rotation=(0.4, 0.0, names[0]), turn=(0.3, names[1], 0.5))
    evaluated = ca.Function("R", names, [frame_matrix(free)])
    assert np.abs(np.array(evaluated(-0.7, -0.2)) - R).max() < 1e-15
    for base in (
        Orientation.identity(),
        Orientation.identity().then_turn(np.eye(3)[2], ca.SX(0.3)),
    ):
        there = turned_by(base, free)
        back = ca.Function("back", names, [turned_back(there, free).matrix])
        assert there.axes is base.axes
        assert np.abs(np.array(back(-0.7, -0.2)) - np.array(ca.DM(base.matrix))).max() < 1e-15


def test_a_whole_orientation_is_its_two_turns():
    rotation, turn = (0.4, 0.0, -0.7), (1e-3, -2e-3, 0.0)
    R = Rotation.from_rotvec(rotation) * Rotation.from_rotvec(turn)
    found = lw.Frame(rotation=rotation, turn=turn).orientation
    assert np.abs(Rotation.from_rotvec(found).as_matrix() - R.as_matrix()).max() < 1e-15
    assert lw.Frame(rotation=rotation).orientation == rotation


def test_a_planar_mechanism_stays_one_when_it_turns_in_its_plane():
    robot = lw.Robot(lw.robots.four_bar())
    paths = [f"{name}.frames.{k}.turn.z" for name in robot.mechanism.joints for k in (0, 1)]
    free = robot.free(*paths)
    assert free.planar and free.redundant == robot.redundant == ()
    other = free.with_parameters({paths[0]: 0.1})
    crank = next(iter(robot.mechanism.joints))
    shifted = robot.assemble({crank: robot.home[crank] + 0.1})
    found = other.assemble({crank: robot.home[crank]})
    poses = other.body_poses(found), robot.body_poses(shifted)
    for name in robot.bodies:
        for mine, theirs in zip(poses[0][name], poses[1][name], strict=True):
            assert np.abs(mine - theirs).max() < 1e-12


def test_values_that_lock_a_linkage_of_redundant_rows_are_refused():
    """Bennett's linkage moves by its geometry alone: a tilt locks it."""
    mechanism = lw.robots.bennett()
    name = next(iter(mechanism.pairs))
    free = lw.Robot(mechanism).free(f"{name}.frames.0.turn.x")
    assert free.redundant
    with pytest.raises(lw.LinkworkError, match=r"the loops (hold more|do not close)"):
        free.with_parameters({f"{name}.frames.0.turn.x": 0.01})


def test_numbers_of_robots_with_several_redundant_rows():
    """A mass is that of the description with it; a hinge that is turned out of parallel locks."""
    mechanism = lw.robots.tripteron()
    tilts = [f"root_1.frames.{k}.turn.y" for k in (0, 1)]
    body = next(iter(mechanism.bodies))
    free = lw.Robot(mechanism).free(f"{body}.mass", *tilts)
    assert len(free.redundant) > 1
    with pytest.raises(lw.LinkworkError, match="the loops hold more"):
        free.with_parameters(dict.fromkeys(tilts, 0.05))
    heavy = free.with_parameters({f"{body}.mass": 3.0})
    bodies = mechanism.bodies | {body: mechanism.bodies[body].model_copy(update={"mass": 3.0})}
    again = lw.Robot(mechanism.model_copy(update={"bodies": bodies}))
    rates = np.full(3, 0.3)
    assert np.array_equal(
        heavy.forward_dynamics(heavy.home.with_rates(rates), np.ones(3)),
        again.forward_dynamics(again.home.with_rates(rates), np.ones(3)),
    )


def test_bodies_that_give_zz_alone_may_not_be_turned_out_of_their_plane():
    with pytest.raises(lw.MechanismError, match="gives only zz, but free turns of frames"):
        lw.Robot(lw.robots.four_bar()).free("crank_pin.frames.0.turn.x")


def test_the_tool_moves_with_a_free_turn_as_differences_say():
    """The derivative at values of the description, where turns are zero."""
    mechanism = lw.robots.puma560()
    paths = [
        f"{name}.frames.{k}.turn.{c}" for name in mechanism.pairs for k in (0, 1) for c in "xyz"
    ]
    equations = derive(mechanism, free=paths)
    pose = ca.vertcat(*tool_pose(equations.tree, mechanism.first_tool)[:2])
    slopes = ca.Function(
        "slopes", [equations.tree.q, equations.p], [ca.jacobian(pose, equations.p)]
    )
    q, h = equations.reference, 1e-6
    found = np.array(slopes(q, np.zeros(len(paths))))
    for k in range(0, len(paths), 5):
        ends = []
        for sign in (1, -1):
            other = derive(edited(mechanism, {paths[k]: sign * h}), equations.independent)
            there = ca.vertcat(*tool_pose(other.tree, mechanism.first_tool)[:2])
            ends.append(np.array(ca.Function("x", [other.tree.q], [there])(q)).ravel())
        assert np.abs(found[:, k] - (ends[0] - ends[1]) / (2 * h)).max() < 1e-9, paths[k]


def test_equations_to_print_of_free_turns_are_refused():
    free = lw.Robot(lw.robots.four_bar()).free("crank_pin.frames.0.turn.z")
    with pytest.raises(lw.LinkworkError, match=r"'crank_pin.frames.0.turn.z' turns a frame"):
        free.latex()


def test_a_turned_frame_goes_into_model_files_and_back(tmp_path):
    """MuJoCo reads the file that is written of a turned arm, and stands where the robot does."""
    mujoco = pytest.importorskip("mujoco")
    arm = lw.robots.puma560()
    given = {"joint_3.frames.0.turn.x": 0.02, "joint_5.frames.1.turn.y": -0.03}
    robot = lw.Robot(arm).free(*given).with_parameters(given)
    lw.formats.save(robot.mechanism, tmp_path / "arm.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    q = np.linspace(0.1, 0.6, 6)
    for name, value in zip(robot.coordinates, q, strict=True):
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)
    poses = robot.body_poses(robot.state(q))
    for name, (p, R) in poses.items():
        assert np.abs(data.body(name).xpos - p).max() < 1e-9
        assert np.abs(data.body(name).xmat.reshape(3, 3) - R).max() < 1e-9
