"""Assembling: make states from values of some joints' coordinates, and from tool poses."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import among, amount_is, shown
from linkwork.errors import LinkworkError
from linkwork.model import checks, task
from linkwork.model.asked import JointsAsked
from linkwork.model.assembly import UnreachableError
from linkwork.model.leading import Leader
from linkwork.model.posing import Rates, stacked, start_of
from linkwork.model.state import State, with_positions
from linkwork.model.turning import as_threads, by_threads, threaded, turned

if TYPE_CHECKING:
    from linkwork.model.model import Model

BRANCHES = ("guess", "any")

Placed = tuple[list[int], np.ndarray] | None


def assemble(
    robot: Model,
    joints: Mapping[str, ArrayLike] | None,
    tool: ArrayLike | Mapping[str, ArrayLike] | None,
    rates: Rates,
    guess: State | None,
    branch: str = "guess",
) -> State:
    """Close the loops at given joint coordinates or at a tool pose: `Robot.assemble`."""
    begun, asked = start_of(robot, guess), None
    start = begun.q
    if not among(branch, BRANCHES):
        raise LinkworkError(f"branch is {branch!r}; give {' or '.join(map(repr, BRANCHES))}")
    if tool is None and isinstance(joints, Mapping):
        names, values = asked_of(robot, joints)
        asked = robot.joints_asked(names).places, values.copy()
        names = by_threads(robot.chart, names, values, begun.positions)
        q = at_joints(robot, names, values, start)
    elif tool is not None and joints is None:
        asked_tool, values = task.asked(robot, tool)
        q = led(robot.leader_of_tool(asked_tool, kept=branch == "guess"), start, values)
    else:
        raise LinkworkError("say where to assemble: joint coordinates by name, or tool=pose")
    return wound(robot, stacked(robot, q, rates), robot.home if guess is None else guess, asked)


def asked_of(robot: Model, joints: Mapping[str, ArrayLike]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of joint coordinates and their values (..., names)."""
    if all([type(value) is float and isfinite(value) for value in joints.values()]):
        checks.known(joints, robot.coordinates, "joint")
        return tuple(joints), np.array([*joints.values()], float)
    parts = {name: checks.finite(value, f"joint {name!r}") for name, value in joints.items()}
    checks.known(parts, robot.coordinates, "joint")
    needed = task.freedoms(robot)
    for name, part in parts.items():
        if part.ndim and len(parts) < needed:
            raise LinkworkError(
                f"joint {name!r} is {shown(part.tolist())}; give one number, or values of "
                f"{needed} joints for a stack"
            )
    batch = checks.together(*{part.shape for part in parts.values()} or ((),))
    values = np.empty((*batch, len(parts)))
    for k, part in enumerate(parts.values()):
        values[..., k] = part
    return tuple(parts), values


def at_joints(
    robot: Model, names: tuple[str, ...], values: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Return q (..., nq) at joint coordinates (..., names), with the whole turns of what is asked.

    As many as determine the motion, or more, are led to on the branch of the start; fewer by
    shortened steps.
    """
    asked, given = robot.joints_asked(names), len(names)
    try:
        if given < task.freedoms(robot):
            q = near_joints(robot, asked, values, start)
        else:
            q = led(robot.leader_of_joints(asked), start, values)
    except UnreachableError as error:
        if given <= robot.mobility:
            raise
        raise UnreachableError(
            f"{amount_is(given, 'joint')} given, but {robot.mobility} determine all others; "
            f"leave some out, or give values that fit together: {error}"
        ) from None
    return turned(robot.chart, q, asked.turns, values[..., asked.angular]) if asked.turns else q


def near_joints(
    robot: Model, asked: JointsAsked, values: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Return q (nq) at joint coordinates (names), fewer than determine the motion, by shortened
    steps from the start, or from where its tree has these coordinates already."""
    least = robot.least(asked)
    try:
        return robot.assembler.at(least, values, start)
    except UnreachableError:
        return robot.assembler.at(least, values, asked.put(least.tree, start, values))


def led(leader: Leader, start: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return q (..., nq) at what is asked (..., rows)."""
    q = leader.lead(start, values.reshape(-1, values.shape[-1]))
    return q.reshape(*values.shape[:-1], start.size)


def wound(robot: Model, made: State, guess: State, asked: Placed = None) -> State:
    """Return states with the whole turns of joints that close loops as near as they come to what is
    asked, by place.

    Others keep those of the guess: as many where they are read without a jump, else as near as they
    come to it.
    """
    labels = robot.labels
    if not labels.may_wind:
        return made
    kept = made.positions
    if guess is not robot.home and np.count_nonzero(turns := robot.windings(guess)):
        kept = labels.turned(kept, np.broadcast_to(turns, kept.shape))
    goal = np.where(labels.jumps, guess.positions, kept)
    if len(ties := threaded(robot.chart)):
        goal[..., ties[:, 0].astype(int)] = as_threads(robot.chart, guess.positions, kept)
    if asked is not None:
        places, values = asked
        goal[..., places] = values
    told = labels.nearest(made.positions, goal)
    return made if told is made.positions else with_positions(made, told)
