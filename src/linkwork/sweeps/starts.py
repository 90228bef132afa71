"""Starts: close the loops of all members at a time, each with its own lengths, at its own
coordinates or tool pose.

    [Phi; J] s = -[phi; x - x_d],  q <- q + N s  Gauss-Newton steps of least length, for all members
    together

from where the study starts, as `Robot.assemble` does it for one state. Members that do not converge
so, or on another working mode, are assembled one by one, with shorter steps.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linkwork.equations.algebra import wrapped
from linkwork.equations.reference import CLOSED, unit
from linkwork.errors import LinkworkError
from linkwork.mechanism.numbers import edited
from linkwork.mechanism.record import MechanismError
from linkwork.robot import Robot, State
from linkwork.robot.assembly import MATRICES
from linkwork.robot.labels import POSES
from linkwork.robot.modes import same
from linkwork.sweeps.home import JOINTS, RATES, REFUSED, TOOL, UNREACHABLE, posed
from linkwork.sweeps.preparation import Bench

TURNS_LAST = {True: [3, 4, 2], False: [3, 4, 5, 0, 1, 2]}
ROUNDS = 30
DAMPING = 1e-12  # of the normal equations, relative to their trace
LONGEST = 0.5  # step of a rate [m, rad]
Values = Mapping[str, np.ndarray]


def starts(bench: Bench, values: np.ndarray) -> tuple[State, np.ndarray]:
    """Return a stack of states for members with varied values (M, varied), and 0 for each,
    UNREACHABLE, or REFUSED."""
    study, robot, count = bench.study, bench.robot, len(values)
    of = {name: values[:, i] for i, name in enumerate(study.varied)}
    q, v = np.tile(bench.start.q, (count, 1)), np.tile(bench.start.rates, (count, 1))
    p, status = np.tile(robot.p, (count, 1)), np.zeros(count, dtype=int)
    for path in study.paths:
        p[:, list(robot.parameters).index(path)] = of[path]
    left = np.arange(count) if bench.several_in_an_inertia else np.empty(0, dtype=int)
    if not bench.same_start:
        q, closed = closed_together(bench, q, p, of)
        left = np.union1d(left, np.flatnonzero(~closed))
    for i in left:
        status[i], q[i] = closed_alone(
            bench, {name: float(column[i]) for name, column in of.items()}, q[i]
        )
    for name in of:
        if name.startswith(RATES):
            v[:, robot.independent.index(name.removeprefix(RATES))] = of[name]
    q[status != 0] = bench.start.q
    (positions,) = robot.kernel("positions")(q, p)
    return State(positions, v, q, robot.coordinates, robot.independent), status


def closed_together(
    bench: Bench, q: np.ndarray, p: np.ndarray, of: Values
) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates (M, nq) of members with parameters p (M, np), and which of them are
    closed."""
    robot, start = bench.robot, bench.study.start
    given = {name: np.full(len(q), value) for name, value in start.joints.items()}
    given |= {
        name.removeprefix(JOINTS): column for name, column in of.items() if name.startswith(JOINTS)
    }
    pose = None
    if start.tool is not None:
        names = POSES[robot.planar]
        columns = [
            of.get(f"{TOOL}{name}", value) for name, value in zip(names, start.tool, strict=False)
        ]
        pose = np.stack([np.broadcast_to(column, len(q)) for column in columns], axis=1)
    if not given and pose is None:
        given = {
            name: np.full(len(q), bench.start[name])
            for name in robot.independent
            if name in robot.coordinates
        }
    closed = np.ones(len(q), dtype=bool)
    if given:
        q, closed = solved(robot, q, p, given, None)
    if pose is not None:
        begin, (q, closed) = q, solved(robot, q, p, {}, pose)
        leader = robot.leader(pose.shape[1], kept=True)
        closed &= same(leader.signs(begin, p), leader.signs(q, p))
    return q, closed


def solved(
    robot: Robot, q: np.ndarray, p: np.ndarray, joints: Values, pose: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return q (M, nq) with the given joint coordinates or tool poses, and where that was
    reached."""
    q, closed, open_ = q.copy(), np.zeros(len(q), dtype=bool), np.arange(len(q))
    for _ in range(ROUNDS):
        part = {name: column[open_] for name, column in joints.items()}
        residual, J, N, aligned = rows(
            robot, q[open_], p[open_], part, None if pose is None else pose[open_]
        )
        size = np.abs(residual).max(axis=1, initial=0.0)
        met = size <= CLOSED * np.maximum(
            1.0, np.abs(q[open_] / robot.equations.tree.units).max(axis=1, initial=0.0)
        )
        closed[open_[met]] = aligned[met]
        going = ~met & np.isfinite(size)
        open_, residual, J, N = open_[going], residual[going], J[going], N[going]
        if not open_.size:
            break
        step = least_step(J, residual)
        step *= np.minimum(
            1.0, LONGEST / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300)
        )
        q[open_] = unit(robot.equations.tree, q[open_] + np.einsum("mij,mj->mi", N, step))
    return q, closed


def least_step(J: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the shortest steps s (M, nv) of least |J s + residual|."""
    A = np.swapaxes(J, 1, 2) @ J
    damping = DAMPING * np.trace(A, axis1=1, axis2=2)[:, None, None]
    right = np.swapaxes(J, 1, 2) @ residual[..., None]
    return -np.linalg.solve(A + np.maximum(damping, 1e-300) * np.eye(A.shape[1]), right)[..., 0]


def rows(robot: Robot, q: np.ndarray, p: np.ndarray, joints: Values, pose: np.ndarray | None):
    """Return the residuals (M, rows), their Jacobians in the tree's rates, the maps N from these to
    q', all in the mechanism's own units, and whether joints' frames face each other as they should
    (M).
    """
    # phi, poses and coordinates, with their Jacobians, in one call.
    kernel, nv = robot.kernel("assembly"), len(robot.equations.tree.rates)
    out = {
        name: value
        for (name, _), value in zip(
            kernel.outputs, kernel(q, np.zeros((len(q), nv)), p), strict=True
        )
    }
    for name in MATRICES:
        if name in out:
            out[name] = np.swapaxes(out[name].reshape(len(q), nv, -1), 1, 2)
    # Loops have to close; joints, then the tool, have to be where they are asked.
    tree, units = robot.equations.tree, [robot.equations.rows.units]
    residuals, jacobians = [out["phi"]], [out["Phi"]]
    if joints:
        places = [robot.coordinates.index(name) for name in joints]
        error = out["coordinates"][:, places] - np.stack(list(joints.values()), axis=1)
        residuals.append(np.where(robot.labels.angular[places], wrapped(error), error))
        jacobians.append(out["J_coordinates"][:, [robot.rates.index(name) for name in joints]])
        units.append(robot.labels.sizes[places])
    if pose is not None:
        residuals.append(pose_error(robot.planar, out, pose))
        asked = list(TURNS_LAST[robot.planar][: pose.shape[1]])
        jacobians.append(out["J_tool"][:, asked])
        units.append(np.where(np.array(asked) < 3, 1.0, tree.length))
    heights = np.concatenate(units)
    return (
        np.concatenate(residuals, axis=1) / heights,
        np.concatenate(jacobians, axis=1) * tree.rate_units / heights[:, None],
        out["derivatives"] * tree.rate_units,
        out["alignment"][:, 0] >= 0,
    )


def pose_error(planar: bool, out: Values, pose: np.ndarray) -> np.ndarray:
    """Return how far the tools are from poses (M, 2 or 3 in the plane, 3 or 6 in space); turns the
    short way round."""
    if planar:
        return np.concatenate(
            [out["position"][:, :2] - pose[:, :2], wrapped(out["angle"] - pose[:, 2:])], axis=1
        )
    moved = out["position"] - pose[:, :3]
    if pose.shape[1] == 3:
        return moved
    from scipy.spatial.transform import Rotation

    turn = (
        Rotation.from_matrix(out["orientation"].reshape(-1, 3, 3))
        * Rotation.from_rotvec(pose[:, 3:]).inv()
    )
    return np.concatenate([moved, turn.as_rotvec()], axis=1)


def closed_alone(
    bench: Bench, values: Mapping[str, float], q: np.ndarray
) -> tuple[int, np.ndarray]:
    """Return 0 and a member's coordinates (nq), or why it has none: UNREACHABLE, or REFUSED."""
    study, own = bench.study, {path: values[path] for path in bench.study.paths}
    try:
        edited(study.robot, own)
        if bench.same_start:
            return 0, q
        robot = bench.robot.with_parameters(own) if own else bench.robot
        return 0, posed(study, robot, values, bench.start).q
    except MechanismError:
        return REFUSED, q
    except LinkworkError:
        return UNREACHABLE, q
