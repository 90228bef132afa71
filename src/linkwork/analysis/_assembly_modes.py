"""Assembly modes and working modes: all real solutions of the direct and of the inverse kinematics.

Newton's method runs from very many random configurations (`newton`). What they end in is gathered
by where the tool is (direct kinematics) or where the actuated joints are (inverse kinematics). How
often each solution was found tells how sure the count is: with f_1 of them found once and f_2 found
twice, about

    f_1 (f_1 - 1) / (2 (f_2 + 1))

are missing. The search goes on until each solution was found several times, and nothing new for as
long as it took.
Source: Chao, Scandinavian J. Statistics 11 (1984) 265-270, bias-corrected (the number of unseen
classes).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from linkwork.analysis._jacobians import of_actuators
from linkwork.analysis.actuated_coordinates import actuated_coordinates
from linkwork.analysis.all_rows import all_rows
from linkwork.analysis.newton import Solver, random_configurations, solver
from linkwork.analysis.square import Square, of_joints, of_tool
from linkwork.analysis.turning_alone import (
    comes_back,
    idle_wheels,
    meshed,
    meshing_turns,
    moved_by,
    shown,
    turned_with,
    with_threads,
)
from linkwork.checks import amount, needed, random_numbers
from linkwork.equations import body_motion, functions
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function
from linkwork.mechanism.limits import limited
from linkwork.model import checks, limits, task
from linkwork.model.modes import determinant
from linkwork.model.turning import as_threads, by_threads, threaded
from linkwork.notebooks import Portrayed
from linkwork.patience import announced
from linkwork.robot import Robot, State

ROUND = 8192
ITERATIONS = 60
WIDE = 3.0  # lengths of the mechanism from home that slides begin at: beyond its mirror image
SAME = 1e-5  # difference of poses, lengths relative to the mechanism's own, that counts as none
SURE = 5
UNENDING = 8  # turns that angles begin within whose gears never stand as they did
MOST = 10_000


@dataclass(frozen=True, eq=False)
class Modes(Portrayed):
    """Hold the real solutions of a direct or inverse kinematic problem, and how sure their number
    is.

    what, asked: names and values [m, rad] of what was asked for: joint coordinates, or the tool's
        pose
    states: the solutions, at rest, stacked, those nearest to the reference first
    hits: how many starts ended in each; first: the number of the start that found it first
    starts: how many there were; converged: how many of them ended in a solution
    signs: (modes, stages) of the determinants of the system's stages, relative to the reference.
        Where rows of the loops depend on each other these are stages of all rows, and 0 is what no
        way along closed loops is found to
    within_limits: whether all joints are within their limits; robot: whose they are
    endless: whether gears of a ratio that is no fraction leave further ones, turn by turn
    """

    what: tuple[str, ...]
    asked: np.ndarray
    states: State
    hits: np.ndarray
    first: np.ndarray
    starts: int
    converged: int
    signs: np.ndarray
    within_limits: np.ndarray
    robot: Robot | None = field(default=None, repr=False)
    endless: bool = False

    def __len__(self) -> int:
        return len(self.hits)

    def __getitem__(self, index: int) -> State:
        """Return one of the solutions, at rest."""
        return self.states.at(range(len(self))[index])

    def __iter__(self) -> Iterator[State]:
        return iter(self.states)

    @property
    def missing(self) -> float:
        """Estimate of how many solutions were not found (Chao 1984)."""
        once, twice = int(np.sum(self.hits == 1)), int(np.sum(self.hits == 2))
        return once * (once - 1) / (2 * (twice + 1))

    @property
    def found(self) -> tuple[np.ndarray, np.ndarray]:
        """How many solutions (k) were known after how many starts (k): where the count went up."""
        return np.sort(self.first) + 1, np.arange(1, len(self) + 1)

    @property
    def sure(self) -> bool:
        """Tell whether each solution was found several times, and none in the second half of the
        starts; not where there is no end of them."""
        return (
            bool(len(self))
            and not self.endless
            and self.hits.min() >= SURE
            and 2 * (self.first.max() + 1) <= self.starts
        )

    def __repr__(self) -> str:
        rarest = f", the rarest {self.hits.min()} times" if len(self) else ""
        return (
            f"Modes({len(self)} found from {self.starts} starts{rarest}; about "
            f"{self.missing:.2g} missing)"
        )


@announced("searching for assembly modes")
def assembly_modes(
    robot: Robot, joints: Mapping[str, float] | None = None, *, starts: int = 400_000, seed: int = 0
) -> Modes:
    """Find the assembly modes: all real solutions of the direct kinematics, told apart by the
    tool's pose.

    Without a tool they are told apart by the poses of all bodies that do not just spin about
    themselves.

    Args:
        robot: its closed loops are solved.
        joints: as many joint coordinates as the mobility, by name [m, rad]; the actuated ones at
            home if left out, lengths of belts and cables among them.
        starts: most random starts to try; the search ends earlier once the count is sure.
        seed: of the random starts.

    Returns:
        `Modes`; none where the joint coordinates cannot be reached.

    Raises:
        LinkworkError: unknown names, wrong count, coordinates that do not determine the motion, a
            continuum of solutions.
    """
    needed(robot, Robot)
    by = by_tool if robot.mechanism.tools else by_bodies
    if joints is None:
        names = actuated(robot)
        if not {*names} <= {*robot.coordinates}:
            lengths = actuated_coordinates(robot, robot.home.q)
            return search(of_actuators(robot), lengths, by, starts, seed)
        joints = {name: float(robot.home[name]) for name in names}
    if not isinstance(joints, Mapping):
        raise LinkworkError(
            f"the joints are {joints!r}; give coordinates by name, such as "
            f"{{'{robot.coordinates[0]}': 0.1}}"
        )
    asked = np.array([checks.number(value, f"joint {name!r}") for name, value in joints.items()])
    checks.known(joints, robot.coordinates, "joint")
    square = of_joints(robot, by_threads(robot.chart, [*joints], asked, robot.home.positions))
    return search(square, asked, by, starts, seed)


@announced("searching for working modes")
def working_modes(
    robot: Robot,
    tool: ArrayLike | None = None,
    *,
    what: Sequence[str] | None = None,
    starts: int = 400_000,
    seed: int = 0,
) -> Modes:
    """Find the working modes: all real solutions of the inverse kinematics, told apart by the
    actuated joints, or by the poses of all bodies where actuators are no joints.

    Args:
        robot: its closed loops are solved.
        tool: the tool's pose in the coordinates `what` [m, rad]; that at home if left out.
        what: names of coordinates, of the tool's `task` or of any pose; the task if left out.
        starts, seed: as in `assembly_modes`.

    Raises:
        LinkworkError: no tool, a pose of another size, coordinates that do not determine the
            motion, a continuum of solutions.
    """
    needed(robot, Robot)
    square = of_tool(robot, None if what is None else checks.names(what, "what"))
    if tool is None:
        asked = robot.task_values(robot.home, square.what)
    else:
        asked = checks.vector(tool, "the tool's pose", square.what, "tool coordinate")
        if asked.ndim != 1:
            raise LinkworkError(
                f"the tool's pose has the shape {asked.shape}; give one pose: "
                f"{', '.join(square.what)}"
            )
        asked = checks.finite(asked, "the tool's pose")
    assert square.asked is not None
    asked = square.asked.given(asked)
    told = robot.actuators and {*robot.actuators} <= {*robot.coordinates}
    return search(square, asked, by_actuators if told else by_bodies, starts, seed)


def actuated(robot: Robot) -> tuple[str, ...]:
    """Return the actuated coordinates, of which there have to be as many as the mobility."""
    if len(robot.actuators) != task.freedoms(robot):
        raise LinkworkError(
            f"the robot has {amount(len(robot.actuators), 'actuator')} and the mobility "
            f"{robot.mobility}; say which {task.freedoms(robot)} of its joint "
            "coordinates are given"
        )
    return robot.actuators


def search(square: Square, asked: np.ndarray, key, most: int, seed: int) -> Modes:
    """Run Newton's method from random starts until the count of solutions is sure."""
    if not isinstance(most, int) or most < 1:
        raise LinkworkError(f"starts is {most!r}; give a whole number above zero")
    problem, random = solver(square), random_numbers(seed)
    gathered = Gathered.none(
        square.equations.nq, key(square, square.equations.reference[None]).shape[1]
    )
    tried = 0
    while tried < most:
        count = min(ROUND, most - tried)
        q, good = problem.solve(scattered(problem, asked, count, random), asked, ITERATIONS)
        q[good], good[good] = counted(square, asked, q[good])
        if (hit := np.flatnonzero(good)).size:
            gathered = gathered.with_more(q[hit], key(square, q[hit]), tried + hit)
        tried += count
        if len(gathered.q) > MOST:
            raise LinkworkError(
                f"more than {MOST} solutions are found: {', '.join(square.what)} leave a "
                "continuum of them"
            )
        if (
            len(gathered.q)
            and gathered.hits.min() >= SURE
            and 2 * (gathered.first.max() + 1) <= tried
        ):
            break
    return told(problem, asked, gathered, key, tried)


def scattered(
    problem: Solver, asked: np.ndarray, count: int, random: np.random.Generator
) -> np.ndarray:
    """Return random starts at which the tree's own coordinates already have the asked values, and
    gears are in mesh."""
    square, tree, given = problem.square, problem.square.equations.tree, list[str]()
    q = random_configurations(square, WIDE * problem.length, count, random)
    for name, turns in square.robot.once(meshing_turns).items():
        if name in tree.places:
            q[:, tree.places[name]] *= turns or UNENDING
    for name, value in zip(square.what, asked, strict=True):
        if square.asked is None and name in tree.places:
            q[:, tree.places[name]] = value
            given.append(name)
    return meshed(square.robot, q, given)


def counted(square: Square, asked: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return solutions (N, nq) with the whole turns of their threads, and which of them have what
    is asked then, too (N)."""
    q, good = with_threads(square.robot, q)
    for name, value in zip(square.what, asked, strict=True) if square.asked is None else ():
        tree = square.equations.tree
        if name in tree.places and not square.robot.joints_asked((name,)).wraps[0]:
            good &= np.abs(q[:, tree.places[name]] - value) < np.pi
    return q, good


def told(problem: Solver, asked: np.ndarray, gathered: Gathered, key, tried: int) -> Modes:
    """Return the solutions in order, with what is known about them."""
    square, robot = problem.square, problem.square.robot
    home = key(square, robot.equations.reference[None])
    order = np.argsort(np.linalg.norm(gathered.key - home, axis=1), kind="stable")
    q = gathered.q[order]
    given = {} if square.asked else dict(zip(square.what, asked.tolist(), strict=True))
    states = unwound(robot, q, given)
    signs = signs_of(problem, states.q).astype(int)
    inside = np.array([not limits.passed(robot, row) for row in states.positions], bool)
    hits, first = gathered.hits[order], gathered.first[order]
    asked = square.asked.told(asked) if square.asked else asked
    count = int(hits.sum())
    unended = {name for name, turns in robot.once(meshing_turns).items() if not turns}
    endless = bool(unended) and not unended & {*given}
    counts = hits, first, tried, count
    return Modes(square.what, asked, states, *counts, signs, inside, robot, endless)


def signs_of(problem: Solver, q: np.ndarray) -> np.ndarray:
    """Return the signs of the stages' determinants (N, stages) at configurations (N, nq), by all
    rows of stages some of whose rows could stand for others."""
    rows = all_rows(problem.square)
    if not rows.spared:
        return problem.signs(q)
    # Of stages without such rows they are told without a way.
    modes, base = rows.leader.modes, problem.square.base[None]
    signs, A = rows.led_signs(q, modes.turned), rows.matrix(np.concatenate([base, q]))
    for k, stage in enumerate(modes.by_all_rows):
        if len(stage.rows) == len(stage.columns):
            own = np.sign(determinant(A, stage.rows, stage.columns))
            signs[:, k] = own[1:] * own[0]
    return signs


def unwound(robot: Robot, q: np.ndarray, asked: Mapping[str, float]) -> State:
    """Return states at rest of configurations (N, nq), their angles within half a turn of where
    they are at home, of what is asked of them, or of the middle of their limits.

    Starts are any number of turns apart, so that solutions may be, too. Angles whose whole turns
    move a body or open a loop (screws, gears between more than idle wheels) stay as they are.
    """
    goal = np.array(
        [
            asked.get(label, value)
            for label, value in zip(robot.coordinates, robot.home.positions, strict=True)
        ],
        float,
    )
    for own in limited(robot.mechanism):
        label, (lower, upper) = own.coordinate, own.limits.interval
        place = robot.coordinates.index(label)
        if label not in asked and robot.labels.angular[place]:
            low, high = lower + np.pi, upper - np.pi
            goal[place] = np.clip(goal[place], low, high) if low <= high else (low + high) / 2
    # Of the tree's angles, with idle wheels in mesh; then of those that close loops.
    q = q.copy()
    advancing = threaded(robot.chart)[:, 0].astype(int).tolist()
    for k, label in enumerate(robot.equations.tree.coordinates):
        if (turn := robot.once(turned_with, label)) is None:
            continue
        if (place := robot.coordinates.index(label)) not in advancing:
            q -= np.round((q[:, [k]] - goal[place]) / (2 * np.pi)) * turn
    states = robot.make_state(q, np.zeros((len(q), robot.mobility)))
    goal = np.tile(goal, (len(q), 1))
    goal[:, advancing] = as_threads(robot.chart, robot.home.positions, states.positions)
    return replace(states, positions=robot.labels.nearest(states.positions, goal))


@dataclass(frozen=True, eq=False)
class Gathered:
    """Hold solutions that differ, by their keys: q (M, nq), key (M, d), hits (M), first (M)."""

    q: np.ndarray
    key: np.ndarray
    hits: np.ndarray
    first: np.ndarray

    @classmethod
    def none(cls, nq: int, size: int) -> Gathered:
        return cls(np.empty((0, nq)), np.empty((0, size)), np.empty(0, int), np.empty(0, int))

    def with_more(self, q: np.ndarray, key: np.ndarray, number: np.ndarray) -> Gathered:
        """Return the solutions with more of them: those that are known are counted, the others
        added.

        Args:
            q, key: of the new ones (N, nq), (N, d); number: of their starts (N), increasing.
        """
        from scipy.spatial import KDTree

        known = np.asarray(
            KDTree(self.key).query(key)[1] if len(self.key) else np.zeros(len(key)), int
        )
        new = np.ones(len(key), bool)
        if len(self.key):
            new = np.linalg.norm(self.key[known] - key, axis=1) > SAME
        hits = (
            self.hits + np.bincount(known[~new], minlength=len(self.hits))
            if len(self.hits)
            else self.hits
        )
        if not new.any():
            return Gathered(self.q, self.key, hits, self.first)
        group = groups(key[new])
        _, leader, counts = np.unique(group, return_index=True, return_counts=True)
        return Gathered(
            np.concatenate([self.q, q[new][leader]]),
            np.concatenate([self.key, key[new][leader]]),
            np.concatenate([hits, counts]),
            np.concatenate([self.first, number[new][leader]]),
        )


def groups(key: np.ndarray) -> np.ndarray:
    """Return a number for each point (N, d) that those within a small distance, directly or by
    others, share (N)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    # Equal points are joined first: pairs among thousands of hits of one solution would be too
    # many.
    rounded, inverse = np.unique(np.round(key / SAME), axis=0, return_inverse=True)
    pairs = KDTree(rounded).query_pairs(2.0, output_type="ndarray")
    links = coo_array(
        (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(rounded), len(rounded))
    )
    return connected_components(links, directed=False)[1][inverse.ravel()]


def by_tool(square: Square, q: np.ndarray) -> np.ndarray:
    """Return the tool's position, in own lengths, and orientation (N, 12); equal poses have equal
    numbers."""
    position, orientation = tool_kernel(square.robot)(q)
    return np.concatenate([position / square.equations.tree.length, orientation], axis=1)


@lru_cache(maxsize=16)
def tool_kernel(robot: Robot) -> Kernel:
    """Return the kernel q -> position (3) and orientation (9) of the tool."""
    equations = robot.equations
    position, orientation, _ = body_motion.tool_pose(equations.tree, robot.mechanism.first_tool)
    outputs = {"position": position, "orientation": orientation}
    return compile_function(functions.function("tool", equations, outputs)).given(robot.p)


def by_actuators(square: Square, q: np.ndarray) -> np.ndarray:
    """Return the actuated coordinates (N, d), or those that gears tie to them (`shown`), angles
    that bodies come back with by their cosines and sines."""
    robot = square.robot
    told = [robot.once(shown, name) for name in robot.actuators]
    names = [*dict.fromkeys(name for each in told for name in each)]
    places = [robot.coordinates.index(name) for name in names]
    values = robot.kernel("positions")(q)[0][:, places] / robot.labels.sizes[places]
    alone = np.array([robot.once(comes_back, name) for name in names], bool)
    alone &= ~np.isin(places, threaded(robot.chart)[:, 0])
    turns = values[:, alone]
    return np.concatenate([values[:, ~alone], np.cos(turns), np.sin(turns)], axis=1)


def by_bodies(square: Square, q: np.ndarray) -> np.ndarray:
    """Return the positions and orientations of all bodies but idle wheels and those that may spin
    about themselves (N, 12 r)."""
    robot = square.robot
    spinning = {body for member in square.equations.spins.values() for body in member}
    for wheel in robot.once(idle_wheels):
        spinning |= moved_by(robot, wheel, 1.0)
    fixed = [k for k, body in enumerate(robot.bodies) if body not in spinning]
    origins, orientations, *_ = robot.kernel("bodies_motion")(q, np.zeros(robot.mobility))
    origins = origins / square.equations.tree.length
    parts = origins.reshape(len(q), -1, 3)[:, fixed], orientations.reshape(len(q), -1, 9)[:, fixed]
    return np.concatenate([part.reshape(len(q), -1) for part in parts], axis=1)
