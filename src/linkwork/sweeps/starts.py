"""Starts: close the loops of all members at a time, each with its own lengths, at its own
coordinates or tool pose.

They are led from where the study starts (`robot.leading`). Members that do not converge so, or on
another working mode, are assembled one by one, with shorter steps.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.mechanism.numbers import edited
from linkwork.mechanism.record import MechanismError
from linkwork.model import task
from linkwork.robot import State
from linkwork.sweeps.home import JOINTS, RATES, REFUSED, TOOL, UNREACHABLE, posed
from linkwork.sweeps.preparation import Bench

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
        status[i], q[i] = started_alone(
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
    # What the start asks for: joints, a pose of the tool, or the independent joints' coordinates.
    robot, start = bench.robot, bench.study.start
    given = {name: np.full(len(q), value) for name, value in start.joints.items()}
    given |= {
        name.removeprefix(JOINTS): column for name, column in of.items() if name.startswith(JOINTS)
    }
    pose = asked = None
    if start.tool is not None:
        asked = task.asked_of(robot, len(start.tool))
        columns = [
            of.get(f"{TOOL}{name}", value)
            for name, value in zip(asked.labels, start.tool, strict=True)
        ]
        pose = np.stack([np.broadcast_to(column, len(q)) for column in columns], axis=1)
    if not given and pose is None:
        given = {
            name: np.full(len(q), bench.start[name])
            for name in robot.independent
            if name in robot.coordinates
        }
    # Joints on any mode, then the tool on the one that these lead to.
    closed = np.ones(len(q), dtype=bool)
    if given:
        leader = robot.leader_of_joints(robot.joints_asked(tuple(given)))
        y, any_mode = np.stack(list(given.values()), axis=1), np.zeros(len(leader.modes.stages))
        q, closed, _ = leader.closed(leader.step, q, (y, p), any_mode, contracting=False)
    if pose is not None and asked is not None:
        leader, pose = robot.leader_of_tool(asked, kept=True), asked.given(pose)
        modes = leader.signs(q, p)
        q, _, kept = leader.closed(leader.step, q, (pose, p), modes, contracting=False)
        closed &= kept
    return q, closed


def started_alone(
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
