"""Posing: make states from coordinates, from tool poses, and along tool paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import shown
from linkwork.equations.reference import CLOSED, tree_coordinates, unit
from linkwork.errors import LinkworkError
from linkwork.model import checks, task
from linkwork.model.asked import JointsAsked, ToolAsked
from linkwork.model.assembly import OPEN_LOOPS, UnreachableError
from linkwork.model.closing import settled
from linkwork.model.labels import Labels
from linkwork.model.leading import Leader
from linkwork.model.led_path import ANOTHER, Prescribed, led_along, require_one_arc
from linkwork.model.stacks import undoubted
from linkwork.model.state import Motion, State, with_positions
from linkwork.model.turning import turned
from linkwork.paths import Path
from linkwork.threads import number_of

if TYPE_CHECKING:
    from linkwork.model.model import Model

MOST_SAMPLES = 10_000_000
BRANCHES = ("guess", "any")

Rates = ArrayLike | Mapping[str, ArrayLike] | None
Placed = tuple[list[int], np.ndarray] | None


def state(
    robot: Model,
    positions: ArrayLike | Mapping[str, ArrayLike],
    rates: Rates,
    tolerance: float,
    threads: int | None = 1,
) -> State:
    """Make a state from the coordinates of all joints: `Robot.state`."""
    checks.positive(tolerance, "the tolerance")
    told = undoubted(robot, positions, tolerance, number_of(threads))
    if told is not None:
        v = np.zeros(robot.mobility) if rates is None else independent_rates(robot, rates, told.q)
        batch = checks.together(told.q.shape[:-1], v.shape[:-1])
        read, v, q = (
            np.ascontiguousarray(np.broadcast_to(x, (*batch, x.shape[-1])))
            for x in (told.read, v, told.q)
        )
        return State(read, v, q, robot.coordinates, robot.independent)
    given = checks.values_by_name(positions, robot.coordinates, "positions", "joint coordinate")
    q = of_tree(robot, given)
    closure_step = robot.kernel("closure_step")
    gap = closure_step(q)[1][..., 0]
    if not (widest := gap.max(initial=0.0)) <= tolerance:
        require_turns(given, robot.labels)
        checks.require_closed(gap, tolerance, lambda index: open_row(robot, q[index]))
    if widest > CLOSED:
        q, gap = settled(closure_step, q, robot.p)
        require_closing(robot, q, gap)
    made, labels = stacked(robot, q, rates), robot.labels
    windings, mismatch = labels.compared(given, made.positions)
    if not mismatch.max(initial=0.0) <= 10 * tolerance:
        require_turns(given, labels)
        require_consistent(made.positions, given, labels, mismatch > 10 * tolerance)
    return with_positions(made, labels.turned(made.positions, windings))


def require_turns(given: np.ndarray, labels: Labels) -> None:
    """Refuse quaternions of length zero."""
    for name, places in labels.all_quaternions.items():
        if not np.linalg.norm(given[..., places], axis=-1).min(initial=np.inf) > 0:
            raise LinkworkError(
                f"the quaternion of joint {name!r} is zero; give one of any other length, such "
                "as 1, 0, 0, 0"
            )


def require_consistent(
    closed: np.ndarray, given: np.ndarray, labels: Labels, wrong: np.ndarray
) -> None:
    """Refuse coordinates that contradict the closed configuration; wrong: which do (..., m).

    Angles may differ by whole turns where these act on nothing. A quaternion may be given at any
    length and with either sign.
    """
    if not wrong.any():
        return
    index = tuple(int(i) for i in np.argwhere(wrong)[0])
    name, there = (
        labels.equations.mechanism.coordinates[index[-1]],
        np.broadcast_to(given, wrong.shape)[index[:-1]],
    )
    value = there[index[-1]]
    for places in labels.all_quaternions.values():
        if index[-1] in places:
            p = there[places]
            value *= np.copysign(1 / np.linalg.norm(p), p @ closed[index[:-1]][places])
    acting = (
        ", and its spring, gear or thread counts whole turns" if labels.counted[index[-1]] else ""
    )
    raise LinkworkError(
        f"joint {name!r} is given as {value:.6g}, but the other joints make it "
        f"{closed[index]:.6g}{acting}"
    )


def require_closing(robot: Model, q: np.ndarray, gap: np.ndarray) -> None:
    """Refuse configurations that Newton's method does not close."""
    if not (gap <= OPEN_LOOPS).all():
        index = tuple(int(i) for i in np.argwhere(~(gap <= OPEN_LOOPS))[0])
        raise LinkworkError(
            f"the loops do not close from these positions: {open_row(robot, q[index])} stays "
            f"open by {gap[index]:.3g}; give positions nearer to a closed configuration, or "
            "close them by robot.assemble"
        )


def assemble(
    robot: Model,
    joints: Mapping[str, ArrayLike] | None,
    tool: ArrayLike | Mapping[str, ArrayLike] | None,
    rates: Rates,
    guess: State | None,
    branch: str = "guess",
) -> State:
    """Close the loops at given joint coordinates or at a tool pose: `Robot.assemble`."""
    start, asked = start_of(robot, guess), None
    if branch not in BRANCHES:
        raise LinkworkError(f"branch is {branch!r}; give {' or '.join(map(repr, BRANCHES))}")
    if isinstance(joints, Mapping) and tool is None:
        names, values = asked_of(robot, joints)
        asked = [robot.coordinates.index(name) for name in names], values
        q = at_joints(robot, names, values, start)
    elif tool is not None and joints is None:
        asked_tool, values = task.asked(robot, tool)
        q = led(robot.leader_of_tool(asked_tool, kept=branch == "guess"), start, values)
    else:
        raise LinkworkError("say where to assemble: joint coordinates by name, or tool=pose")
    return wound(robot, stacked(robot, q, rates), robot.home if guess is None else guess, asked)


def asked_of(robot: Model, joints: Mapping[str, ArrayLike]) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the names of joint coordinates and their values (..., names)."""
    parts = {name: checks.finite(value, f"joint {name!r}") for name, value in joints.items()}
    checks.known(parts, robot.coordinates, "joint")
    needed = robot.mobility - len(robot.spins)
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

    Stacks, and values of the independent ones, are led to on the branch of the start.
    """
    asked = robot.joints_asked(names)
    independent = robot.determined_by(asked) and set(names) == set(robot.independent)
    if values.ndim > 1 or independent:
        q = led(robot.leader_of_joints(asked), start, values)
    else:
        q = alone(robot, asked, values, start)
    return turned(robot.chart, q, asked.turns, values[..., asked.angular]) if asked.turns else q


def alone(robot: Model, asked: JointsAsked, values: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return q (nq) at any joint coordinates (rows) that shortened steps from a start lead to."""
    try:
        return robot.assembler.at(robot.least(asked), values, start)
    except UnreachableError as error:
        if values.size <= robot.mobility:
            raise
        raise UnreachableError(
            f"{values.size} joints are given, but {robot.mobility} determine all others; leave "
            f"some out, or give values that fit together: {error}"
        ) from None


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
    if guess is not robot.home:
        kept = labels.turned(kept, np.broadcast_to(robot.windings(guess), kept.shape))
    goal = np.where(labels.jumps, guess.positions, kept)
    if asked is not None:
        places, values = asked
        goal[..., places] = values
    return with_positions(made, labels.nearest(made.positions, goal))


def follow(
    robot: Model,
    path: Path,
    duration: float,
    samples: int,
    guess: State | None,
    what: Sequence[str] | None,
) -> Motion:
    """Lead the tool along a path: `Robot.follow`."""
    # What is asked for is a motion along a path of whole poses.
    checks.positive(duration, "the duration")
    if not isinstance(samples, int) or samples < 2:
        raise LinkworkError(
            f"a motion needs a whole number of samples, at least 2, not {shown(samples)}"
        )
    if samples > MOST_SAMPLES:
        raise LinkworkError(
            f"a motion of {samples} samples does not fit into memory; give at most {MOST_SAMPLES}"
        )
    if not isinstance(path, Path):
        raise LinkworkError(f"the path is {shown(path)}; give one made by linkwork.paths")
    time = np.linspace(0, duration, samples)
    robot.require_tool()

    def moving(times: np.ndarray) -> list[np.ndarray]:
        return [checks.finite(part, "the path") for part in path.sample(times, duration)]

    poses, *derivatives = moving(time)
    asked = require_full_pose(robot, poses.shape[1], what)

    def sampled(times: np.ndarray) -> Prescribed:
        return Prescribed(asked, times, *asked.given_motion(*moving(times)))

    # The first pose as any other; the next ones from those before, moved on by their rates.
    way = Prescribed(asked, time, *asked.given_motion(poses, *derivatives))
    leader = robot.leader_of_tool(asked, kept=True)
    led = led_along(leader, robot.assembler, start_of(robot, guess), way)
    along, (v, v_dot) = led[0], (robot.chart.from_tree(each) for each in led[1:])
    # One branch all the way.
    if not (kept := leader.keeps(along)).all():
        raise LinkworkError(f"at t = {time[np.argmin(kept)]:.6g} s: {ANOTHER}")
    require_one_arc(leader, robot.assembler, led, way, sampled)
    # Angles without jumps, ahead by the turns that the guess had.
    made = robot.make_state(along, v)
    positions, joint_rates, joint_accelerations, _ = robot.kernel("joints_motion")(
        made.q, made.rates, v_dot
    )
    positions = robot.labels.unwrapped(time, positions, joint_rates)
    first = wound(robot, made.at(0), robot.home if guess is None else guess)
    turns = robot.labels.windings(first.positions, positions[0])
    made = with_positions(made, robot.labels.turned(positions, turns))
    return Motion(time, made, v_dot, joint_rates, joint_accelerations, poses, asked.labels)


def stacked(robot: Model, q: np.ndarray, rates: Rates) -> State:
    """Return the states of configurations q (..., nq) with rates, their leading dimensions brought
    together."""
    if rates is None:
        return robot.make_state(q, np.zeros((*q.shape[:-1], robot.mobility)))
    v = independent_rates(robot, rates, q)
    batch = checks.together(q.shape[:-1], v.shape[:-1])
    return robot.make_state(
        np.broadcast_to(q, (*batch, q.shape[-1])), np.broadcast_to(v, (*batch, robot.mobility))
    )


def start_of(robot: Model, guess: State | None) -> np.ndarray:
    """Return q (nq) of a guess, of `home` where there is none."""
    q = (robot.home if guess is None else robot.own(guess)).q
    if q.ndim != 1:
        raise LinkworkError("the guess is a stack of states; give one of them")
    return q


def independent_rates(robot: Model, rates: Rates, q: np.ndarray) -> np.ndarray:
    """Return v (..., n) from an array, from the independent rates by name, or from n rates of any
    joints by name."""
    if rates is None:
        return np.zeros(robot.mobility)
    if isinstance(rates, Mapping) and set(rates) <= set(robot.independent):
        rates = {name: rates.get(name, 0.0) for name in robot.independent}
    if not isinstance(rates, Mapping) or set(rates) <= set(robot.independent):
        return checks.values_by_name(rates, robot.independent, "rates", "independent rate")
    checks.known(rates, robot.rates, "rate")
    if len(rates) != robot.mobility:
        example = ", ".join(robot.independent)
        raise LinkworkError(
            f"{checks.amount_is(len(rates), 'rate')} given; give {robot.mobility}, for "
            f"instance {example}"
        )
    L = robot.kernel("maps")(q)[0].reshape(*q.shape[:-1], robot.mobility, -1)
    A = np.swapaxes(L[..., [robot.rates.index(name) for name in rates]], -1, -2)
    given = checks.values_by_name(rates, tuple(rates), "rates", "rate")
    checks.together(given.shape[:-1], A.shape[:-2])
    if np.linalg.cond(A).max(initial=0.0) > 1 / checks.PIVOT_BOUND**2:
        raise LinkworkError(
            f"the rates {', '.join(rates)} do not determine the motion here; give others"
        )
    return np.linalg.solve(A, given[..., None])[..., 0]


def of_tree(robot: Model, positions: np.ndarray) -> np.ndarray:
    """Return q (..., nq) from the coordinates of all joints (..., m), its quaternions at length
    1."""
    tree, topology = robot.equations.tree, robot.equations.topology
    if not topology.added:
        q = positions.take(robot.labels.of_tree, axis=-1)
    else:
        require_turns(positions, robot.labels)
        flat = positions.reshape(-1, positions.shape[-1])
        values = (dict(zip(robot.coordinates, row, strict=True)) for row in flat)
        found = [tree_coordinates(robot.mechanism, topology, tree, value) for value in values]
        q = np.array(found).reshape(*positions.shape[:-1], -1)
    if not tree.quaternions:
        return q
    with np.errstate(invalid="ignore"):
        return unit(tree, q)


def open_row(robot: Model, q: np.ndarray) -> str:
    """Name the closure row that is open most."""
    rows = robot.equations.rows
    return rows.names[int(np.argmax(np.abs(robot.chart.residuals(q) / rows.units)))]


def require_full_pose(robot: Model, size: int, what: Sequence[str] | None) -> ToolAsked:
    """Return what a path of so many coordinates asks for; refuse other than as many as freedoms."""
    asked, needed = task.asked_of(robot, size, what), task.freedoms(robot)
    if size != needed:
        besides = " besides spins of members about themselves" if robot.spins else ""
        raise LinkworkError(
            f"the path prescribes {size} coordinates of the tool, but the mobility is "
            f"{needed}{besides}; prescribe {needed}"
        )
    return asked
