"""A platform that only turns, the 3-UPU wrist, by its closed form: legs by the law of cosines."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.analysis import singularity

BASE, TOP, HOME = 0.3, 0.2, Rotation.from_rotvec([0.1, -0.2, 0.9])
AZIMUTHS = 2 * np.pi / 3 * np.arange(3)


def cone(rise):
    """Return three directions (3, 3) about z that rise by an angle over the xy plane."""
    c, s = np.cos(rise), np.sin(rise)
    return np.stack([c * np.cos(AZIMUTHS), c * np.sin(AZIMUTHS), s + 0 * AZIMUTHS], axis=1)


AXES, TOP_AXES = cone(-0.3), cone(0.46)  # of the joints: of the base, and of the platform in it


def vectors(turn):
    """Return the rotation vector of a matrix."""
    return tuple(map(float, Rotation.from_matrix(turn).as_rotvec()))


@cache
def wrist():
    """A 3-UPU wrist: the outer axes of the universal joints meet in one point, the inner ones of
    each leg are parallel (Karouia & Parenti-Castelli, A three-dof tripod for generating spherical
    rotation, Advances in Robot Kinematics 2000)."""
    bodies = {"platform": lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.01, yy=0.012, zz=0.015))}
    joints, reference = {}, {}
    thin, R = lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-4), HOME.as_matrix()
    for i, (a, e) in enumerate(zip(AXES, TOP_AXES, strict=True), start=1):
        leg = TOP * R @ e - BASE * a
        length, inner = np.linalg.norm(leg), np.cross(a, leg) / np.linalg.norm(np.cross(a, leg))
        along = np.column_stack([np.cross(inner, leg / length), inner, leg / length])
        seat = np.column_stack([a, inner, np.cross(a, inner)])
        top = np.column_stack([R @ e, inner, np.cross(R @ e, inner)])
        bodies[f"barrel_{i}"] = lw.Body(mass=0.5, centre_of_mass=(0, 0, 0.05), inertia=thin)
        bodies[f"rod_{i}"] = lw.Body(mass=0.3, centre_of_mass=(0, 0, -0.05), inertia=thin)
        on_base = lw.Frame(position=tuple(map(float, BASE * a)), rotation=vectors(seat))
        on_top = lw.Frame(position=tuple(map(float, TOP * e)), rotation=vectors(R.T @ top))
        joints[f"lower_{i}"] = lw.UniversalJoint(
            connects=("ground", f"barrel_{i}"), frames=(on_base, lw.Frame())
        )
        joints[f"jack_{i}"] = lw.PrismaticJoint(connects=(f"barrel_{i}", f"rod_{i}"))
        joints[f"upper_{i}"] = lw.UniversalJoint(
            connects=(f"rod_{i}", "platform"),
            frames=(lw.Frame(), on_top),
            axes=((0, 1, 0), (1, 0, 0)),
        )
        lower, upper = seat.T @ along, along.T @ top
        reference |= {
            f"jack_{i}": float(length),
            f"lower_{i}.angle_2": float(np.arctan2(lower[0, 2], lower[2, 2])),
            f"upper_{i}.angle_1": float(np.arctan2(upper[0, 2], upper[2, 2])),
        }
    return lw.Robot(
        lw.Mechanism(
            bodies=bodies,
            joints=joints,
            actuators=("jack_1", "jack_2", "jack_3"),
            tools={"hand": lw.Tool(body="platform")},
            reference=reference,
        )
    )


def lengths(turn):
    """l_i^2 = b^2 + p^2 - 2 b p a_i . R e_i."""
    cosines = np.sum(AXES * turn.apply(TOP_AXES), axis=1)
    return np.sqrt(BASE**2 + TOP**2 - 2 * BASE * TOP * cosines)


def slopes(turn):
    """l_i' = W omega, from the derivative of the lengths along R' = [omega x] R."""
    return -BASE * TOP * np.cross(turn.apply(TOP_AXES), AXES) / lengths(turn)[:, None]


def rotation_rates(r):
    """Return J_l^-1 of r' = J_l^-1 omega, from J_l = int_0^1 exp([s r x]) ds of the exponential map
    (Gauss points), not from its closed form."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    turns = Rotation.from_rotvec(np.outer((nodes + 1) / 2, r)).as_matrix()
    return np.linalg.inv(np.tensordot(weights / 2, turns, axes=1))


TURNS = [HOME, HOME * Rotation.from_rotvec([0.2, 0.1, -0.3]), Rotation.from_rotvec([0, 0, 0.6])]


def test_a_3_upu_wrist_only_turns():
    robot = wrist()
    assert robot.mobility == 3 and robot.task == ("rx", "ry", "rz") and robot.notes == ()
    assert singularity(robot, robot.home).kinds == ()
    for turn in TURNS:
        state = robot.assemble(tool=turn.as_rotvec())
        np.testing.assert_allclose(robot.tool_pose(state), [0, 0, 0, *turn.as_rotvec()], atol=1e-12)
        found = [state[name] for name in robot.actuators]
        np.testing.assert_allclose(found, lengths(turn), atol=1e-12)


@pytest.mark.parametrize("turn", TURNS)
def test_the_jacobian_of_three_turns_is_that_of_the_angular_velocity(turn):
    """It differs from the derivative of the rotation vector by J_l of the exponential map."""
    robot = wrist()
    state = robot.assemble(tool=turn.as_rotvec())
    J, W = robot.jacobian(state), slopes(turn)
    np.testing.assert_allclose(J, np.linalg.inv(W), atol=1e-9)
    r = turn.as_rotvec()
    for k, column in enumerate(J.T):
        ends = [
            robot.assemble({n: state[n] + h * (i == k) for i, n in enumerate(robot.actuators)})
            for h in (1e-5, -1e-5)
        ]
        slope = np.subtract(*[robot.tool_pose(end)[3:] for end in ends]) / 2e-5
        np.testing.assert_allclose(slope, rotation_rates(r) @ column, atol=1e-6)
    # Two of the three coordinates are led by their own rates.
    rows = robot.jacobian(state, ("rx", "rz"))
    np.testing.assert_allclose(rows, (rotation_rates(r) @ J)[[0, 2]], atol=1e-9)


def test_a_turn_is_singular_where_the_legs_do_not_turn_the_platform():
    """Where the normals of the legs' planes lie in one plane."""
    robot = wrist()
    about = [Rotation.from_rotvec([0, 0, angle]) for angle in (0.3, 1e-2, 1e-3)]
    told = [singularity(robot, robot.assemble(tool=turn.as_rotvec())).actuator for turn in about]
    dets = [abs(np.linalg.det(slopes(turn))) for turn in about]
    np.testing.assert_allclose(told[1] / told[2], dets[1] / dets[2], rtol=0.05)
