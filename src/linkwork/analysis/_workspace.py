"""Workspace: which poses of a grid the tool can reach, on one working mode, and how well the robot
works there.

All poses are solved at a time by Newton's method (`newton`), first from one configuration of the
working mode, then, wave by wave, from neighbours that are solved. A solution counts where it is on
the working mode: where the determinants of the inverse problem's stages have the signs that they
have at the guess (`square`). So the boundary is drawn by the determinants, not by where Newton's
method happens to end. Legs that are coupled make one stage, whose sign does not tell all branches
(an arm's elbow and shoulder both turned over): there the poses count that straight ways from the
guess and from neighbour to neighbour, across cells, too, lead to (`grid_branches`), and those where
each leg has a sign of its own (`model.leg_sides`); what only has all signs in common is told, and
left out. Where rows of the loops depend on each other one that is kept may vanish in vain: ways are
led and determinants told by all rows then (`all_rows`).

    conditioning        1 / cond K, between lengths over time (`jacobians`): 0 singular, 1 isotropic
    isotropic velocity  min_i rate_i / |row i of K|      what the tool reaches in every direction,
                                                         without turning
    isotropic force     min_i force_i / |column i of J|  what it bears in every direction,
                                                         without moment

A constant-orientation workspace is a grid with the angle constant; the reachable one is
`reachable.any("angle")` of a grid over angles, too, the dexterous one `reachable.all("angle")`.
Source: Merlet 2006, Parallel Robots, ch. 7 (workspaces); Gosselin & Angeles 1991, J. Mech. Design
113 (conditioning).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.analysis._jacobians import Jacobians, jacobians
from linkwork.analysis.all_rows import all_rows
from linkwork.analysis.grid_branches import (
    DIRECT,
    GridBranch,
    led,
    tells,
    tells_all,
)
from linkwork.analysis.grid_steps import aside, beside, neighbours, one_of
from linkwork.analysis.measured_reach import attributes, measured, measured_at
from linkwork.analysis.newton import (
    Solver,
    random_configurations,
    solver,
)
from linkwork.analysis.turning_alone import turns_alone
from linkwork.checks import by_name, reals
from linkwork.equations.algebra import wrapped
from linkwork.errors import LinkworkError
from linkwork.mechanism.limits import limited
from linkwork.mechanism.task import unit
from linkwork.model import checks, task
from linkwork.model.evaluation import of_actuators
from linkwork.model.leg_sides import LegSides
from linkwork.model.posing import start_of
from linkwork.patience import announced
from linkwork.robot import Robot, State

if TYPE_CHECKING:
    import xarray

FAR, NEAR = 12, 10  # Newton steps from the guess, and from a neighbour
STARTS, ITERATIONS = 4096, 40  # random configurations, and Newton's steps from each
LONE = 256  # poses that no neighbour leads to, of which it is tried whether others do
SINGULAR = 1e-9
COARSE = 0.2  # part of the way to a neighbour, of steps that are tried before any shorter ones
Step = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Solve poses (N, n) from configurations (N, nq) at others (N, n): configurations, and whether they
are solved."""
Kept = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Configurations (N, nq), and whether they are found -> those, and whether they are kept."""


@announced("mapping the workspace")
def workspace(
    robot: Robot,
    grid: Mapping[str, ArrayLike],
    *,
    guess: State | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
    rates: ArrayLike | Mapping[str, float] | None = None,
    forces: ArrayLike | Mapping[str, float] | None = None,
    length: float | None = None,
) -> xarray.Dataset:
    """Map the workspace over a grid of tool poses, on the working mode of a guess.

    Args:
        robot: with as many actuators as freedoms, and a tool.
        grid: coordinates of the tool by name, as many as freedoms, of its `task` or of any pose,
            such as x, y, angle in the plane, x, y, z, rz, tilt ... in space [m, rad]; each an
            increasing or decreasing sequence, or one number.
        guess: a state on the working mode; `home` if left out.
        limits: lower and upper bounds of joint coordinates by name [m, rad], beside those in the
            description; such angles keep them where one of their whole turns does.
        rates: largest actuator rates [m/s, rad/s], for the isotropic velocity.
        forces: largest actuator forces [N, N m], for the isotropic force.
        length: characteristic length l [m]; that of `Jacobians.characteristic_length` if left out.

    Returns:
        A dataset over the coordinates that are sequences: reachable; actuator_position [m, rad],
        angles that may turn once more with all bodies where they are within half a turn of home's;
        conditioning; det_A, det_B over their values at the reference; isotropic_velocity [m/s],
        isotropic_turn_rate [rad/s], isotropic_force [N], isotropic_moment [N m] where rates
        and forces are given. What is out of reach is NaN. Its attrs say what was computed, in
        `message` how much is reached, and what may be on parts of the mode that hang together with
        the guess nowhere.

    Raises:
        LinkworkError: unknown coordinates or joints, another number of them than freedoms,
            sequences that are no grid, a guess that is leg-singular.
    """
    axes = read_grid(robot, grid)
    J = jacobians(robot, tuple(axes))
    problem, poses = solver(J.inverse), Poses.of(axes)
    assert J.inverse.asked is not None
    start = start_of(robot, guess).q
    held = replace(poses, values=J.inverse.asked.given(poses.values))
    q, good, apart = reach(problem, held, start, J)
    for part in (good, apart):
        part[part] = within(robot, q[part], bounds(robot, limits))
    return dataset(
        J,
        poses,
        start,
        q,
        good,
        apart,
        positive(robot, rates, "rates"),
        positive(robot, forces, "forces"),
        length,
    )


@dataclass(frozen=True, eq=False)
class Poses:
    """Hold a grid of poses: axes by name, and all poses (N, n) in the order of the grid."""

    axes: dict[str, np.ndarray]
    values: np.ndarray

    @classmethod
    def of(cls, axes: dict[str, np.ndarray]) -> Poses:
        mesh = np.meshgrid(*(np.atleast_1d(axis) for axis in axes.values()), indexing="ij")
        return cls(axes, np.stack([part.ravel() for part in mesh], axis=1))

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the coordinates that are sequences."""
        return tuple(name for name, axis in self.axes.items() if axis.ndim)

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(axis.size for axis in self.axes.values() if axis.ndim)


def read_grid(robot: Robot, grid: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
    """Return the axes of a grid: finite numbers, sequences strictly monotonic."""
    if not isinstance(grid, Mapping):
        raise LinkworkError(
            f"the grid is {grid!r}; give the tool's coordinates by name, such as {{'x': numbers, "
            f"'y': 0.2}}"
        )
    axes = {str(name): checks.finite(values, f"the grid's {name}") for name, values in grid.items()}
    for name, axis in axes.items():
        steps = np.diff(axis) if axis.ndim == 1 else np.zeros(0)
        if axis.ndim > 1 or not axis.size or not ((steps > 0).all() or (steps < 0).all()):
            raise LinkworkError(
                f"the grid's {name} is no sequence of increasing or decreasing numbers, nor one "
                "number"
            )
    return axes


def reach(
    problem: Solver, poses: Poses, start: np.ndarray, J: Jacobians
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return configurations (N, nq) at the poses, which of these are reached on the working mode of
    the start (N), and which others may be on it, but hang together with it nowhere (N)."""
    determinants, by_all = problem.verdict(start, poses.values[0])[1], all_rows(J.inverse).spared
    require_regular(all_rows(J.inverse).sizes(start[None]) if J.spared else determinants)
    mode = np.sign(determinants)
    if not tells_all(J):
        # Signs do not tell all branches: what hangs together with the start is what is reached.
        branch = GridBranch.by_all_rows(J) if by_all else GridBranch.by_kept_rows(J, problem, mode)
        q, good = branch.begun(start, poses.values)
        steps = partial(branch.walked, finest=COARSE), branch.walked_where_met
        for step in steps:
            spread(poses, q, good, step, good)
        # Other neighbours, or straight ways from the start, may lead where the first one does not.
        lone = some_of(~good)
        q[lone], good[lone] = branch.begun(start, poses.values[lone], lone.size)
        axes = len(poses.shape)
        spread(poses, q, good, branch.walked_where_met, good, beside(axes)[::-1])
        to = np.vstack([beside(axes), aside(axes)])
        spread(poses, q, good, branch.walked_farther, good, to, hopeful(poses, q, good, branch, to))
        # What signs tell to be on the mode, each leg's by itself, is on it where all legs have one.
        side = side_at(J, start)
        more = not_told_apart(problem, poses, q, good, branch, mode, side)
        if not (side and all(tells(J, stage.columns) for stage in side.stages.stages)):
            return q, good, more & ~good
        good |= more  # ways also lead past where a sign changes that other rows stand in for
    elif by_all:
        # A row that is kept may vanish in vain: the tool is led by all rows.
        begin, here = (
            np.tile(one, (len(poses.values), 1))
            for one in (start, task.values(J.robot, start, J.task))
        )
        q, good = led(J, begin, here, poses.values)
        spread(poses, q, good, partial(led, J), good)
    else:

        def near(q: np.ndarray, _: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return problem.solve(q, end, NEAR, mode)

        q, good = problem.solve(start, poses.values, FAR, mode)
        spread(poses, q, good, near, good)
        # A part of the mode that does not hang together with the rest on the grid.
        lone = some_of(~good)
        q[lone], good[lone] = scattered(problem, poses.values[lone], mode)
        spread(poses, q, good, near, lone)
    return q, good, np.zeros(len(good), bool)


def side_at(J: Jacobians, start: np.ndarray) -> LegSides | None:
    """Return on which side of their stretched poses single legs are at a start (nq), if that is
    told."""
    leader = all_rows(J.inverse).leader
    return leader.side(start, leader.signs(start[None])[0])


def not_told_apart(
    problem: Solver,
    poses: Poses,
    q: np.ndarray,
    good: np.ndarray,
    branch: GridBranch,
    mode: np.ndarray,
    side: LegSides | None,
) -> np.ndarray:
    """Return at which poses (N) Newton's method leads to solutions that neither the signs of a mode
    nor the side of a leg tell apart from what is reached, which is among them; q: written to."""
    rows = all_rows(branch.J.inverse)

    def on_side(found: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if side is not None:
            there[there] = side.keeps(rows.matrix(found[there]))
        return found, there

    def kept(found: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if not rows.spared:  # where a determinant vanishes branches meet
            there[there] = rows.leader.signs(found[there]).all(axis=1)
        return on_side(found, there)

    def near(q: np.ndarray, _: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return kept(*branch.solve(q, q, end, DIRECT))

    _, good = on_side(q, good.copy())
    to = beside(len(poses.shape))
    spread(poses, q, good, near, good, to)
    if not rows.spared:  # else signs are told from near configurations alone
        lone = some_of(~good)
        q[lone], good[lone] = scattered(problem, poses.values[lone], mode, q[good], kept)
        spread(poses, q, good, near, lone, to)
    return good


def some_of(which: np.ndarray) -> np.ndarray:
    """Return the places of some of those that are true (N), spread evenly over all of them."""
    places = np.flatnonzero(which)
    return places[:: max(1, -(-places.size // LONE))]


def scattered(
    problem: Solver,
    poses: np.ndarray,
    mode: np.ndarray,
    known: np.ndarray | None = None,
    kept: Kept = lambda *found: found,
) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (N, nq) of a mode at poses (N, n) to which random ones lead (fixed
    seed), and which these are (N).

    known: configurations (K, nq), of which every second one of these is
    kept: which are, of those found
    """
    count, random = len(poses), np.random.default_rng(1990)
    each = STARTS // max(count, 16)
    q = random_configurations(problem.square, problem.length, count * each, random)
    if known is not None and len(known):
        q[::2] = known[random.integers(len(known), size=len(q[::2]))]
    q, good = kept(*problem.solve(q, np.repeat(poses, each, axis=0), ITERATIONS, mode))
    good = good.reshape(count, each)
    first = good.argmax(axis=1) + each * np.arange(count)
    return q[first], np.asarray(good.any(axis=1))


def require_regular(determinants: np.ndarray) -> None:
    """Refuse a guess where working modes meet."""
    if np.abs(determinants).min(initial=np.inf) < SINGULAR:
        raise LinkworkError(
            "the guess is leg-singular, where working modes meet; give a guess on one of them"
        )


def spread(
    poses: Poses,
    q: np.ndarray,
    good: np.ndarray,
    step: Step,
    begin: np.ndarray,
    steps: np.ndarray | None = None,
    able: np.ndarray | None = None,
) -> None:
    """Solve, wave by wave, the poses beside those that are solved; q, good: written to.

    Args:
        begin: where from, of what is solved.
        steps: to neighbours, of which one after the other is gone on from where the first does not
            lead there; from one of those beside each if left out.
        able: which poses are tried (N), all if left out.
    """
    to = beside(len(poses.shape)) if steps is None else steps
    fresh = np.zeros(good.size, bool)
    fresh[begin] = good[begin]
    while fresh.any():
        tried = ~good if able is None else ~good & able
        pairs = neighbours(poses.shape, fresh, tried, to)
        fresh = np.zeros(good.size, bool)
        for targets, sources in [one_of(pairs, good.size)] if steps is None else pairs:
            left = ~good[targets]
            targets, sources = targets[left], sources[left]
            if targets.size:
                found, solved = step(q[sources], poses.values[sources], poses.values[targets])
                q[targets[solved]] = found[solved]
                fresh[targets[solved]] = good[targets[solved]] = True


def hopeful(
    poses: Poses, q: np.ndarray, good: np.ndarray, branch: GridBranch, steps: np.ndarray
) -> np.ndarray:
    """Return at which poses (N) Newton's method leads to some solution of the mode from the first
    one that is solved some steps (K, axes) from them: at most others there is none."""
    met = np.zeros(good.size, bool)
    targets, sources = one_of(neighbours(poses.shape, good, ~good, -steps)[::-1], good.size)
    if targets.size:
        _, met[targets] = branch.solve(q[sources], q[sources], poses.values[targets], DIRECT)
    return met


def bounds(
    robot: Robot, given: Mapping[str, tuple[float, float]] | None
) -> list[tuple[str, float, float]]:
    """Return lower and upper bounds of coordinates: those described, and those given."""
    found = [(own.coordinate, *own.limits.interval) for own in limited(robot.mechanism)]
    for name, pair in by_name(given, "the limits", f"{{'{robot.coordinates[0]}': (0, 1)}}").items():
        checks.known((name,), robot.coordinates, "joint")
        ends = reals(pair)
        if ends is None or ends.shape != (2,) or not ends[0] < ends[1]:
            raise LinkworkError(
                f"the limits of {name!r} are {pair!r}; give a lower and a larger upper bound"
            )
        found.append((name, float(ends[0]), float(ends[1])))
    return found


def within(robot: Robot, q: np.ndarray, limits: list[tuple[str, float, float]]) -> np.ndarray:
    """Tell which configurations (N, nq) keep the bounds; angles that turn alone may differ by whole
    turns."""
    inside = np.ones(len(q), bool)
    if not limits:
        return inside
    (positions,) = robot.kernel("positions")(q)
    for label, lower, upper in limits:
        values = positions[:, robot.coordinates.index(label)]
        if label.endswith(".qw") and robot.unit(label) == "1":
            values = 2 * np.arccos(np.clip(np.abs(values), 0, 1))
        elif robot.once(turns_alone, label):
            # Beyond a limit on one side alone every angle is, after some turns.
            if not np.isfinite(middle := (lower + upper) / 2):
                continue
            values = middle + wrapped(values - middle)
        inside &= (values >= lower) & (values <= upper)
    return inside


def positive(
    robot: Robot, values: ArrayLike | Mapping[str, float] | None, what: str
) -> np.ndarray | None:
    """Return positive bounds of all actuators: one number, one each, or by name."""
    if values is None:
        return None
    if not isinstance(values, Mapping) and np.ndim(values) == 0:
        values = [checks.number(values, what)] * len(robot.actuators)
    return of_actuators(robot, values, what)


def dataset(
    J: Jacobians,
    poses: Poses,
    start: np.ndarray,
    q: np.ndarray,
    good: np.ndarray,
    apart: np.ndarray,
    rates: np.ndarray | None,
    forces: np.ndarray | None,
    length: float | None,
) -> xarray.Dataset:
    """Measure the reached configurations and name the result; apart: what is told as left out."""
    import xarray

    # Quantities are measured where the tool gets to; all other poses of the grid hold NaN.
    robot, scale = J.robot, J.characteristic_length if length is None else length
    reached = np.flatnonzero(good)
    # All that is reached is on the side of the guess.
    side = float(all_rows(J.inverse).along(start[None])[0]) if J.spared else None
    at = partial(measured_at, J, rates=rates, forces=forces, scale=scale, side=side)
    values = measured(q[reached], at)
    variables = {
        "reachable": (
            poses.dims,
            good.reshape(poses.shape),
            {"long_name": "tool can reach the pose"},
        )
    }
    for name, part in values.items():
        full = np.full((good.size, *part.shape[1:]), np.nan)
        full[reached] = part
        dims = (*poses.dims, "actuator") if part.ndim == 2 else poses.dims
        variables[name] = (dims, full.reshape((*poses.shape, *part.shape[1:])), attributes(name, J))
    # The grid's own axes, of which single numbers have no dimension.
    assert J.inverse.asked is not None
    what = J.inverse.asked.what
    coords = {
        name: ((name,) if axis.ndim else (), axis, {"units": unit(item)})
        for (name, axis), item in zip(poses.axes.items(), what, strict=True)
    }
    attrs = {
        "mechanism": robot.mechanism.name,
        "characteristic_length": scale,
        "characteristic_length_units": "m",
        "message": message(good, poses) + left_out(apart, poses),
    }
    return xarray.Dataset(variables, {**coords, "actuator": list(J.direct.what)}, attrs)


def message(good: np.ndarray, poses: Poses) -> str:
    """Say how much of a grid is reached."""
    if good.any():
        return f"{int(good.sum())} of {good.size} poses are reached"
    ranges = ", ".join(
        f"{name} from {axis.min():g} to {axis.max():g}" for name, axis in poses.axes.items()
    )
    return (
        f"none of {good.size} poses is reached on this working mode ({ranges}); choose others, "
        "or another guess"
    )


def left_out(apart: np.ndarray, poses: Poses) -> str:
    """Say what may be reached besides, on parts of the mode by themselves."""
    if not apart.any():
        return ""
    first = zip(poses.axes, poses.values[np.argmax(apart)], strict=True)
    return (
        f"; at {int(apart.sum())} more, such as "
        f"{', '.join(f'{name} {value:g}' for name, value in first)}, there are solutions of the "
        "same signs that hang together with the guess nowhere on this grid: take one as guess"
    )
