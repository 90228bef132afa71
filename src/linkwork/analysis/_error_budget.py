"""Error budget: how far the tool is off for what is made, fitted and measured inexactly.

Every source k, of d_k numbers, lies in a ball of radius s_k (`error_sources`) and moves the tool by
J_k e_k to first order (`tool_errors`: the loops close again, the actuators stay). So

    covariance          C = sum_k s_k^2 / (d_k + 2) J_k J_k'      sources independent, each uniform
    worst case along n  h(n) = sum_k s_k |J_k' n|                 all sources at their worst
    worst case          max h(n) over |n| = 1                     the largest |error|

h is the support function of the set of all errors, a zonotope where every source is one number. Its
largest value is found on directions spread over the sphere and from the best ones by ascent, n <-
error(n) / |error(n)|, which never falls and ends where the error points along n. An error of that
size is attained, and none is larger than the largest value on the directions over the cosine of
their spacing (0.2 %).

Source: Merlet 2006, Parallel Robots, ch. 9 (accuracy); JCGM 100:2008 (GUM), 4.3.7 and 5.1
(rectangular distributions, combined uncertainty).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from linkwork.analysis.error_sources import ErrorSource, sources_of
from linkwork.analysis.freed_numbers import freed
from linkwork.analysis.tool_errors import ToolErrors, require_held
from linkwork.checks import amount, needed, shown
from linkwork.errors import LinkworkError
from linkwork.mechanism.task import LENGTHS, DistanceTo
from linkwork.model.task import task_if_any
from linkwork.patience import announced
from linkwork.robot import Robot, State

PLANE, SPHERE = 180, 2000  # directions over half the circle, and over half the sphere
BEST, ASCENTS = 8, 100
SETTLED = 1e-14  # growth of the largest error that ends the ascent, over it
SHOWN = 12  # sources in a repr
OUT_OF_PLANE = [0, 1, 5]  # rows of [rotation; translation]


@dataclass(frozen=True)
class Contribution:
    """Hold what one source does to the tool.

    source: it
    share: of the mean square of the position's error over all states, from 0 to 1
    deviation: root mean square of the position's error that it makes alone [m]; worst: the largest
        one at any state [m]
    turn_share, turn_deviation, worst_turn: the same of the tool's rotation [1, rad, rad]
    """

    source: ErrorSource
    share: float
    deviation: float
    worst: float
    turn_share: float
    turn_deviation: float
    worst_turn: float


@dataclass(frozen=True, eq=False)
class ErrorBudget:
    """Hold the errors of a tool at states (...), by source; all to first order, in the axes of the
    ground, or of the body that the tool is relative to.

    name: of the robot; planar: whether it moves in a plane; tool: positions (..., 3) [m]
    sources: what is inexact
    sensitivities: per source, the tool's [rotation; translation] per number of the source, or along
        its axes (..., 6, d) [rad, m over its unit]; of a planar robot in the plane, zero out of it
    turns: whether the tool is led in its orientation alone, by which sources are ranked then
    """

    name: str
    planar: bool
    tool: np.ndarray
    sources: tuple[ErrorSource, ...]
    sensitivities: tuple[np.ndarray, ...]
    turns: bool = False

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the tool's [rotation; translation] (..., 6, 6) [rad^2, rad m, m^2]: sources
        independent, each anywhere within its bounds alike."""
        parts = zip(self.sources, self.sensitivities, strict=True)
        return sum(
            (source.deviation**2 * J @ np.swapaxes(J, -1, -2) for source, J in parts),
            np.zeros((*self.tool.shape[:-1], 6, 6)),
        )

    @property
    def deviation(self) -> np.ndarray:
        """Root mean square of the position's error (...) [m]."""
        return np.sqrt(np.trace(self.covariance[..., 3:, 3:], axis1=-2, axis2=-1))

    @property
    def turn_deviation(self) -> np.ndarray:
        """Root mean square of the rotation's error (...) [rad]."""
        return np.sqrt(np.trace(self.covariance[..., :3, :3], axis1=-2, axis2=-1))

    @property
    def ellipsoid(self) -> tuple[np.ndarray, np.ndarray]:
        """Half axes (..., 3) [m], largest first, of the ellipsoid of one standard deviation of the
        position, and their directions, the columns of (..., 3, 3); in the plane the third is
        zero."""
        values, vectors = np.linalg.eigh(self.covariance[..., 3:, 3:])
        return np.sqrt(np.maximum(values[..., ::-1], 0)), vectors[..., ::-1]

    @property
    def bounds(self) -> np.ndarray:
        """Worst case of each component of the tool's [rotation; translation] (..., 6) [rad, m]."""
        parts = zip(self.sources, self.sensitivities, strict=True)
        return sum(
            (source.size * np.linalg.norm(J, axis=-1) for source, J in parts),
            np.zeros((*self.tool.shape[:-1], 6)),
        )

    @property
    def worst(self) -> np.ndarray:
        """Largest distance that the tool's position can be off (...) [m], and is off where all
        sources are at their worst; at most 0.2 % below the exact one."""
        return self._largest(slice(3, 5 if self.planar else 6))

    @property
    def worst_turn(self) -> np.ndarray:
        """Largest angle that the tool can be turned (...) [rad], likewise."""
        return self._largest(slice(2, 3) if self.planar else slice(0, 3))

    @property
    def contributions(self) -> tuple[Contribution, ...]:
        """What each source does, the largest share of the position's error first, then of the
        rotation's; the other way round of a tool that is led in its orientation alone."""
        found = []
        for source, J in zip(self.sources, self.sensitivities, strict=True):
            means = [source.deviation**2 * mean_square(part) for part in split(J)]
            most = [
                source.size * np.linalg.norm(part, 2, axis=(-2, -1)).max(initial=0.0)
                for part in split(J)
            ]
            shares = [over(mean, whole) for mean, whole in zip(means, self._means, strict=True)]
            position, turn = zip(shares, np.sqrt(means), most, strict=True)
            found.append(Contribution(source, *map(float, (*position, *turn))))
        ranked = sorted(found, key=lambda each: (each.share, each.turn_share), reverse=True)
        return tuple(sorted(ranked, key=lambda each: -each.turn_share) if self.turns else ranked)

    @property
    def _means(self) -> tuple[float, float]:
        """Mean squares over all states of the errors of position and rotation."""
        return float(np.mean(self.deviation**2)), float(np.mean(self.turn_deviation**2))

    def _largest(self, rows: slice) -> np.ndarray:
        """Return the largest length of some components of the error (...)."""
        batch = self.tool.shape[:-1]
        parts = [
            source.size * J.reshape(-1, *J.shape[-2:])[:, rows]
            for source, J in zip(self.sources, self.sensitivities, strict=True)
        ]
        count = int(np.prod(batch, dtype=int))
        return np.array([largest([part[k] for part in parts]) for k in range(count)]).reshape(batch)

    def __repr__(self) -> str:
        worst, turned = self.worst.ravel(), self.worst_turn.ravel()
        mean, turn_mean = np.sqrt(self._means)
        states = self.worst.size
        lines = [
            f"Error budget of {self.name}: {amount(len(self.sources), 'source')}, "
            f"{amount(states, 'state')}, to first order",
            f"position  deviation {mean:.4g} m (rms), worst case {worst.max():.4g} m"
            + f" at state {worst.argmax()}" * (states > 1),
            f"rotation  deviation {turn_mean:.4g} rad (rms), worst case {turned.max():.4g} rad"
            + f" at state {turned.argmax()}" * (states > 1),
            f"{'source':<44} {'size':>13} {'share':>7} "
            f"{'worst alone [rad]' if self.turns else 'worst alone [m]':>17}",
        ]
        ranked = self.contributions
        for each in ranked[:SHOWN]:
            size = f"{each.source.size:.3g} {each.source.unit}"
            position, turn = (each.share, each.worst), (each.turn_share, each.worst_turn)
            share, worst_alone = turn if self.turns else position
            lines.append(
                f"{str(each.source)[-44:]:<44} {size:>13} {share:>7.1%} {worst_alone:>17.3g}"
            )
        lines += [f"... and {len(ranked) - SHOWN} more"] * (len(ranked) > SHOWN)
        return "\n".join(lines)


@announced("finding the error budget")
def error_budget(
    robot: Robot,
    states: State,
    tolerances: Mapping[str, float] | None = None,
    *,
    clearances: float | Mapping[str, float] | None = None,
    resolution: float | Mapping[str, float] | None = None,
) -> ErrorBudget:
    """Find how far the tool is off at states, for tolerances, play and the drives' resolution.

    To first order: dx = J_x w + x_p dp, where the loops close again (phi_p dp + Phi w = 0) and the
    actuators stay at the coordinates that they measure.

    Args:
        robot: with as many actuators as freedoms, and a tool; its numbers need not be free.
        states: one or a stack (...), as `assemble` gives for poses all over a workspace; their
            rates do not matter.
        tolerances: largest deviations of numbers by path, as for `Robot.free` [their units]; a
            pattern stands for all that match: "rod_*.length", "pivot_*.frames.?.position.x".
        clearances: radii of the play of joints, by name or one for all [m]: how far the two frames
            of a joint may be apart, in any direction (of the plane, where the robot is planar).
        resolution: steps of what the actuators measure, by name or one for all [m, rad]: errors of
            up to half a step.

    Returns:
        An `ErrorBudget`.

    Raises:
        LinkworkError: no tool, more or fewer actuators than freedoms; a path, joint or actuator
            that there is not, or no size; singular poses, by number; numbers whose errors no joint
            takes up, for the mechanism is overconstrained.
    """
    needed(robot, Robot)
    if not isinstance(states, State):
        raise LinkworkError(
            f"the states are {shown(states)}; give a State, as robot.assemble makes"
        )
    require_held(robot)
    sources = sources_of(robot, tolerances, clearances, resolution)
    # The robot with all these numbers free.
    opened, places = freed(robot, (path for source in sources for path in source.numbers))
    q = opened.state(robot.own(states).positions).q
    # One after the other all moves of the numbers, which are columns of their sources.
    numbers = tuple(opened.parameters)
    moves = np.zeros((len(numbers), sum(source.moves.shape[1] for source in sources)))
    names, columns = list[str](), list[slice]()
    for source in sources:
        rows, own = [numbers.index(places[path]) for path in source.numbers], source.moves
        columns.append(slice(len(names), len(names) + own.shape[1]))
        moves[rows, columns[-1]] = own
        names += [source.name] * own.shape[1]
    errors = ToolErrors(opened, moves, tuple(names))
    per_move, per_actuator = errors(q.reshape(-1, q.shape[-1]))
    if robot.planar:  # errors are those in the plane
        per_move[:, OUT_OF_PLANE] = per_actuator[:, OUT_OF_PLANE] = 0.0
    found = []
    for source, own in zip(sources, columns, strict=True):
        if source.kind == "resolution":
            J = per_actuator[:, :, [robot.actuators.index(source.name)]]
        else:
            J = per_move[:, :, own]
        found.append(J.reshape(*states.batch, *J.shape[1:]))
    poses = robot.tool_pose(states)
    tool = np.zeros((*states.batch, 3))
    size = 2 if robot.planar else 3
    tool[..., :size] = poses[..., :size]
    task = task_if_any(robot) or ()
    turns = bool(task) and not any(isinstance(c, DistanceTo) or c in LENGTHS for c in task)
    return ErrorBudget(robot.mechanism.name, robot.planar, tool, sources, tuple(found), turns)


def split(J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the position and of the rotation."""
    return J[..., 3:, :], J[..., :3, :]


def mean_square(J: np.ndarray) -> float:
    """Return the mean over all states of the sum of squares."""
    return float(np.mean(np.sum(J**2, axis=(-2, -1))))


def over(part: float, whole: float) -> float:
    return part / whole if whole > 0 else 0.0


def largest(parts: list[np.ndarray]) -> float:
    """Return the largest length of a sum of vectors parts_k e_k with |e_k| <= 1; each d x d_k."""
    n = directions(len(parts[0]))
    sizes = np.array([np.linalg.norm(n @ part, axis=1) for part in parts]).sum(axis=0)
    best, found = n[np.argsort(sizes)[::-1][:BEST]], 0.0
    for _ in range(ASCENTS):
        error = np.zeros_like(best)
        for part in parts:
            along = best @ part
            size = np.linalg.norm(along, axis=1, keepdims=True)
            error += np.divide(along, size, out=np.zeros_like(along), where=size > 0) @ part.T
        lengths = np.linalg.norm(error, axis=1, keepdims=True)
        grown, found = float(lengths.max()) - found, float(lengths.max())
        if grown <= SETTLED * found:
            break
        best = np.divide(error, lengths, out=best, where=lengths > 0)
    return found


@cache
def directions(size: int) -> np.ndarray:
    """Return unit vectors (N, size) spread over half the sphere: the error of the other half is the
    opposite one."""
    if size == 1:
        return np.ones((1, 1))
    if size == 2:
        angles = np.pi * (np.arange(PLANE) + 0.5) / PLANE
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    # Equal heights, turned by the golden angle from one to the next.
    z = (np.arange(SPHERE) + 0.5) / SPHERE
    angles = np.pi * (3 - np.sqrt(5)) * np.arange(SPHERE)
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), z], axis=1)
