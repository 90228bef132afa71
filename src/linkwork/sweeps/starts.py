"""Starts: close the loops of all members at a time, each with its own lengths, at its own
coordinates or tool pose.

They are led straight from where the study starts (`robot.leading`), without leaving its branch.
Members that no straight way leads to are assembled one by one; so are all where fewer joints are
asked for than determine the others, which are where `Robot.assemble` puts them from there.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.model import task
from linkwork.model.assembling import wound
from linkwork.model.leading import Leader
from linkwork.model.posing import rates_told
from linkwork.model.turning import turned
from linkwork.robot import State
from linkwork.runs.members import possible
from linkwork.sweeps.home import JOINTS, RATES, REFUSED, TOOL, UNREACHABLE, posed, rates_given
from linkwork.sweeps.preparation import Bench

Values = Mapping[str, np.ndarray]


def starts(bench: Bench, values: np.ndarray) -> tuple[State, np.ndarray]:
    """Return a stack of states for members with varied values (M, varied), and 0 for each,
    UNREACHABLE, or REFUSED."""
    study, robot, count = bench.study, bench.robot, len(values)
    of = {name: values[:, i] for i, name in enumerate(study.varied)}
    q, p = np.tile(bench.start.q, (count, 1)), np.tile(robot.p, (count, 1))
    for path in study.paths:
        p[:, list(robot.parameters).index(path)] = of[path]
    able = possible(study.robot, {path: of[path] for path in study.paths}, count)
    status = np.where(able, 0, REFUSED)
    if not bench.same_start:
        q, closed = closed_together(bench, q, p, of)
        for i in np.flatnonzero(~closed & (status == 0)):
            own = {name: float(column[i]) for name, column in of.items()}
            status[i], q[i] = started_alone(bench, own, q[i])
    q[status != 0] = bench.start.q
    v, told = rates_of(bench, of, q, p)
    status[(status == 0) & ~told] = UNREACHABLE
    (positions,) = robot.kernel("positions")(q, p)
    found = State.known(positions, v, q, robot.coordinates, robot.independent)
    given = joints_given(bench, of, count)
    asked = robot.joints_asked(tuple(given)).places, stacked(given)
    return wound(robot, found, bench.start, asked if given else None), status


def rates_of(
    bench: Bench, of: Values, q: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the independent rates (M, n) of members, and which of them those that the start gives
    determine (M)."""
    robot, given = bench.robot, bench.study.start.rates
    names = rates_given(bench.study, robot)
    table = np.stack(
        [of.get(f"{RATES}{name}", np.full(len(q), given.get(name, 0.0))) for name in names], axis=1
    )
    if names == robot.independent:
        return table, np.ones(len(q), dtype=bool)
    return rates_told(robot, names, table, q, p)


def closed_together(
    bench: Bench, q: np.ndarray, p: np.ndarray, of: Values
) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates (M, nq) of members with parameters p (M, np), and which of them are
    closed."""
    # What the start asks for: joints, a pose of the tool, or the independent joints' coordinates.
    robot, start = bench.robot, bench.study.start
    given, pose, leader = joints_given(bench, of, len(q)), None, None
    if start.tool is not None:
        asked = task.asked_of(robot, len(start.tool))
        leader = robot.leader_of_tool(asked, kept=True)
        columns = [
            of.get(f"{TOOL}{name}", np.full(len(q), value))
            for name, value in zip(asked.labels, start.tool, strict=True)
        ]
        pose = asked.given(np.stack(columns, axis=1))
    elif not given:
        given = {
            name: np.full(len(q), bench.start[name])
            for name in robot.independent
            if name in robot.coordinates
        }
    # Joints, with the whole turns that are asked for, then the tool on the mode that these lead to.
    closed = np.ones(len(q), dtype=bool)
    if given:
        joints = robot.joints_asked(tuple(given))
        if len(joints.what) < task.freedoms(robot):
            return q, ~closed
        q, closed = led(robot.leader_of_joints(joints), q, stacked(given), p)
        q = turned(robot.chart, q, joints.turns, stacked(given)[:, joints.angular])
    if leader is not None and pose is not None:
        q, kept = led(leader, q, pose, p)
        closed &= kept
    return q, closed


def joints_given(bench: Bench, of: Values, count: int) -> dict[str, np.ndarray]:
    """Return the joint coordinates (M) by name that the start asks for."""
    given = {name: np.full(count, value) for name, value in bench.study.start.joints.items()}
    return given | {
        name.removeprefix(JOINTS): column for name, column in of.items() if name.startswith(JOINTS)
    }


def stacked(given: Values) -> np.ndarray:
    """Return columns (M) side by side (M, names)."""
    return np.stack([*given.values()], axis=1) if given else np.empty(0)


def led(
    leader: Leader, q: np.ndarray, y: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return how far straight ways to what is asked (M, rows) lead from configurations (M, nq),
    each with its parameters and on its mode, and which of them to their ends (M)."""
    out = leader.outputs(q, p)
    way, modes = leader.least.asked.way(out, y), leader.modes.signs(leader.matrix(out))
    return leader.walked(q, way, np.arange(len(q)), modes, leader.step, 1.0, p)


def started_alone(
    bench: Bench, values: Mapping[str, float], q: np.ndarray
) -> tuple[int, np.ndarray]:
    """Return 0 and a member's coordinates (nq), or UNREACHABLE and those given where it has
    none."""
    study, own = bench.study, {path: values[path] for path in bench.study.paths}
    try:
        robot = bench.robot.with_parameters(own) if own else bench.robot
        return 0, posed(study, robot, values, bench.start).q
    except LinkworkError:
        return UNREACHABLE, q
