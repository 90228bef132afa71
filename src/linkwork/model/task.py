"""Task: the coordinates in which a tool is led: those that its description states, or what it moves
in at home where that is plain.

Plain are the whole pose, the position or the orientation of as many coordinates as freedoms; else
the coordinates of the pose that move at home, where the others stand still there (to first order:
farther away these may move along, parasitically).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations.independence import largest_rows
from linkwork.equations.reference import unit
from linkwork.errors import LinkworkError
from linkwork.mechanism import TurnAbout
from linkwork.mechanism.task import NAMES, TaskCoordinate, label, labels
from linkwork.model import checks
from linkwork.model.asked import TWIST_ROWS, ToolAsked, long_name, values_kernel
from linkwork.model.closing import settled
from linkwork.model.directly import DirectCalls
from linkwork.model.labels import POSES

if TYPE_CHECKING:
    from linkwork.model.model import Model

Task = tuple[TaskCoordinate, ...]
SAMPLES, SPREAD = 4, 0.02  # configurations near home, and how far they are from it
DEPENDENT = 1e-6  # singular value, over the largest, of dependent rows
STRAIGHT = 1e-6  # sine between two directions that counts as none
TURNED = 2.0  # rotation vector [rad] up to which two of its components lead a tool


def stated(robot: Model) -> Task:
    """Return the task that the description states of the first tool; none where it states none."""
    return (robot.mechanism.first_tool.task if robot.mechanism.tools else None) or ()


def freedoms(robot: Model) -> int:
    """Return the number of freedoms besides spins of members about themselves."""
    return robot.mobility - len(robot.spins)


def task_of(robot: Model) -> Task:
    """Return the task of the first tool: that of its description, or the one that is chosen.

    Raises:
        LinkworkError: no tool; a stated task that is not one of this robot, or depends on itself;
            none stated and none plain.
    """
    robot.require_tool()
    found = task_if_any(robot)
    if found is None:
        raise LinkworkError(not_plain(robot))
    return found


def task_if_any(robot: Model) -> Task | None:
    """Return the same, None where no task is stated and none plain."""
    task = stated(robot)
    if not task:
        return robot.once(led_coordinates) if robot.mechanism.tools else None
    robot.once(require_independent, task)
    return task


def require_independent(robot: Model, task: Task) -> None:
    """Refuse a stated task of coordinates that this robot does not have, or that depend on each
    other at home and near it."""
    known(robot, labels(task))
    asked = ToolAsked(task, robot.equations.tree.length, robot.planar)
    own = np.repeat([1.0, robot.equations.tree.length], 3)
    ranks_there = [0]
    for q, motions in zip(around(robot), robot.once(tool_motions), strict=True):
        out = {name: part[None] for name, part in robot.assembler.still(q).items()}
        rows = asked.mapped(out)[1][0] * own / asked.units[:, None] @ motions
        rows = np.where(np.isfinite(rows).all(axis=1, keepdims=True), rows, 0)
        ranks_there += ranks(rows[None], motions)
    needed = min(len(task), freedoms(robot))
    if max(ranks_there) < needed:
        names, moves = ", ".join(labels(task)), moving(robot)
        own_names = zip(POSES[robot.planar], moves, strict=True)
        able = ", ".join(name for name, moved in own_names if moved)
        raise LinkworkError(
            f"of the task {names} only {max(ranks_there)} coordinates are independent; the tool "
            f"moves at home in {able}"
        )


def not_plain(robot: Model) -> str:
    """Say that no task is plain, and what would state one."""
    names, maps = POSES[robot.planar], robot.once(tool_motions)
    able = max(ranks_there := ranks(maps, maps))
    if able < freedoms(robot):
        return (
            f"the robot has {freedoms(robot)} freedoms and its tool moves in {able} of them, so "
            "that no task leads the robot; give the tool to another body, or name what is asked of "
            "it"
        )
    # Where most can be led, those that the robot leads best.
    there = maps[ranks_there.index(able)][[TWIST_ROWS[name] for name in names]]
    task = tuple(names[k] for k in sorted(largest_rows(there, able)))
    return (
        f"the tool's pose has {len(names)} coordinates, of which {sum(moving(robot))} move at "
        f"home, and the robot {freedoms(robot)} freedom{'s' * (freedoms(robot) > 1)}; name the "
        f"coordinates that the tool is led in, of {', '.join(names)} and others (such as "
        f"task={task!r} of the tool)"
    )


def known(robot: Model, names: Sequence[str]) -> Task:
    """Return task coordinates by name: those of the tool's task, or of any pose; refuse others."""
    own = {label(item): item for item in stated(robot) or mixed(robot) or ()}
    allowed = POSES[True] if robot.planar else tuple(name for name in NAMES if name != "angle")
    records = tuple(name for name, item in own.items() if not isinstance(item, str))
    checks.known(names, (*allowed, *records), "coordinate of the tool")
    if not names:
        raise LinkworkError("no coordinate of the tool is named; name one at least")
    return tuple(own.get(name, name) for name in names)


def named(robot: Model, what: Sequence[str] | None) -> Task:
    """Return task coordinates by name, those of the task if left out; kept for calls to come."""
    if what is None:
        return robot.once(task_of)
    return robot.once(known, checks.names(what, "what"))


def led_coordinates(robot: Model, near: bool = False) -> Task | None:
    """Return the coordinates of the tool's pose that the robot can lead: all, the position, the
    orientation, or those that move at home while the others do not; None where none are plain.

    They have to be independent at the reference or near it.

    near: whether that is enough, where a part of the pose is asked for by so many numbers. If
        not, it may lack one direction at the reference, where a leg or an arm is stretched, but
        not more: a tool that shifts only as it tilts lacks two when it is level, and is not led in
        them.
    """
    names = POSES[robot.planar]
    maps = robot.once(tool_motions)

    def parts(near: bool) -> Task | None:
        for chosen in (names, names[: 2 if robot.planar else 3], names[3:]):
            if not chosen or len(chosen) != freedoms(robot):
                continue
            here, *aside = ranks(maps[:, [TWIST_ROWS[name] for name in chosen]], maps)
            enough = near or chosen == names or here >= freedoms(robot) - 1
            if max(here, *aside) == freedoms(robot) and enough:
                return chosen
        return None

    return parts(False) or mixed(robot) or (parts(True) if near else None)


def moving(robot: Model) -> list[bool]:
    """Tell which coordinates of the pose move at home."""
    sizes = np.linalg.norm(robot.once(tool_motions)[0], axis=1)
    large = sizes > DEPENDENT * sizes.max(initial=0.0)
    return [bool(large[TWIST_ROWS[name]]) for name in POSES[robot.planar]]


def mixed(robot: Model) -> Task | None:
    """Return the coordinates that move at home, where they are as many as freedoms."""
    names = POSES[robot.planar]
    found = [name for name, moves in zip(names, moving(robot), strict=True) if moves]
    maps, rows = robot.once(tool_motions), [TWIST_ROWS[name] for name in found]
    if len(found) != freedoms(robot) or ranks(maps[:1, rows], maps)[0] < len(found):
        return None
    turns = [name for name in found if name in POSES[False][3:]]
    if robot.planar or not turns:
        return tuple(found)
    # Components of a rotation vector that is far from zero are no angles of such turns.
    r = robot.tool_poses(robot.equations.reference)[3:]
    angle = float(np.linalg.norm(r))
    if len(turns) == 2 and angle > TURNED:
        return None
    if len(turns) == 1:
        axis = np.eye(3)[TWIST_ROWS[turns[0]]]
        if np.linalg.norm(np.cross(axis, r)) > STRAIGHT * max(angle, STRAIGHT):
            about = TurnAbout(axis=tuple(axis.tolist()), zero=tuple(r.tolist()))
            return tuple(about if name in turns else name for name in found)
    return tuple(found)


def ranks(maps: np.ndarray, motions: np.ndarray) -> list[int]:
    """Return the ranks of matrices (K, rows, columns); motions: the tool's, beside which what is
    small is rounding."""
    sigma = np.linalg.svd(maps, compute_uv=False)
    largest = max(float(sigma.max(initial=0.0)), float(np.abs(motions).max(initial=0.0)), 1e-300)
    return np.sum(sigma > DEPENDENT * largest, axis=1).tolist()


def tool_motions(robot: Model) -> np.ndarray:
    """Return the tool's twists (K, 6, n) in own units on orthonormal motions that the loops allow:
    at the reference, then near it."""
    tree, rows, found = robot.equations.tree, robot.equations.rows, []
    kept, scale = list(robot.equations.chart.rows), np.repeat([1.0, tree.length], 3)
    for q in around(robot):
        out = robot.assembler.still(q)
        Phi = out["Phi"][kept] * tree.rate_units / rows.units[kept][:, None]
        allowed = np.linalg.svd(Phi)[2][len(kept) :].T if kept else np.eye(len(tree.rates))
        found.append(out["J_tool"] * tree.rate_units / scale[:, None] @ allowed)
    return np.array(found)


def around(robot: Model) -> list[np.ndarray]:
    """Return the reference and configurations near it (fixed seed), loops closed where they can
    be."""
    random, q, tree = np.random.default_rng(1990), robot.equations.reference, robot.equations.tree
    near = [q + SPREAD * tree.units * random.standard_normal(q.size) for _ in range(SAMPLES)]
    closed, gaps = settled(robot.kernel("closure_step"), unit(tree, np.array(near)), robot.p)
    shut = gaps <= checks.OPEN_LOOPS
    return [q, *np.where(shut[:, None], closed, near)]


def asked_of(robot: Model, size: int, what: Sequence[str] | None = None) -> ToolAsked:
    """Return what so many numbers of the tool ask for: those named; or the task where they are as
    many; or else a pose's."""
    length = robot.equations.tree.length
    if what is not None:
        task = known(robot, checks.names(what, "what"))
        if len({*what}) < len(task):
            raise LinkworkError(f"{', '.join(what)} names a coordinate twice; name each once")
        if len(task) != size:
            raise LinkworkError(
                f"{size} numbers are given for {', '.join(labels(task)) or 'nothing'}; give "
                f"{len(task)}"
            )
        return ToolAsked(task, length, robot.planar)
    own = stated(robot)
    poses = (2, 3) if robot.planar else (3, 6)
    if own and size == len(own):
        return ToolAsked(task_of(robot), length, robot.planar)
    if not own and size == freedoms(robot) and size != poses[1]:
        chosen = led_coordinates(robot, True)
        if chosen is not None and len(chosen) == size:
            return ToolAsked(chosen, length, robot.planar)
        if size not in poses:
            raise LinkworkError(not_plain(robot))
    own = own or (mixed(robot) if size not in poses else ()) or ()
    plain = [POSES[robot.planar][:count] for count in poses]
    if size not in poses and own and labels(own) not in plain:
        raise LinkworkError(
            f"the tool is led in {', '.join(map(long_name, labels(own)))}: give {len(own)} "
            "numbers, a whole pose, or coordinates by name"
        )
    return ToolAsked.of(size, length, robot.planar)


def values(robot: Model, q: np.ndarray, task: Task, p: np.ndarray | None = None) -> np.ndarray:
    """Return the task coordinates (..., k) of configurations (..., nq), whole rotation vectors
    included, NaN where they are not determined; p: free parameters, the robot's own if left
    out."""
    return values_kernel(robot.chart, task)(q, robot.p if p is None else p)[0]


def values_directly(robot: Model, task: Task) -> DirectCalls:
    """Return the shortest calls of task coordinates at one state."""
    kernel = partial(values_kernel, task=task)
    return DirectCalls(
        robot.coordinates, robot.charts, kernel, lambda found, _: (0, (found.outputs[0][1],))
    )


def asked(robot: Model, tool: ArrayLike | Mapping[str, ArrayLike]) -> tuple[ToolAsked, np.ndarray]:
    """Return what is asked of the tool, as numbers or by name, and the held values (..., k)."""
    robot.require_tool()
    if not isinstance(tool, np.ndarray) and isinstance(tool, Mapping):
        names = checks.names(tool, "tool")
        if not names:
            raise LinkworkError("the tool is asked for nothing; give coordinates by name")
        values, told = checks.joined(tool, names, "tool"), asked_of(robot, len(names), names)
    else:
        values = checks.finite(tool, "tool")
        values = values if values.ndim else values[None]
        told = robot.once(asked_of, values.shape[-1])
        checks.in_order(tool, told.labels, "the tool's coordinates")
    return told, told.given(values)
