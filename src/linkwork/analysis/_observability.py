"""Observability: which combinations of free numbers measured poses tell, and the poses that tell
them best.

With J the derivatives of all that is measured by the free numbers, over the noise and in their own
units, and J = U diag(s) V' of rank r:

    seen                combinations v_1 .. v_r;  unseen: those that change nothing, J v = 0
    deviations          cov p = V_r diag(1 / s^2) V_r'
    O1 = (s_1 s_2 .. s_r)^(1/r) / sqrt(poses)

A choice of poses is D-optimal where no exchange of one of them makes det J'J larger, which among
as many poses is O1's choice, too.
Source: Borm & Menq 1991, Int. J. Robotics Research 10, 51-63 (O1); Fedorov 1972, Theory of Optimal
Experiments (exchange); Driels & Pathre 1990, J. Robotic Systems 7, 179-197.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from linkwork.analysis.measured_poses import PoseModel, model_of, readings_of
from linkwork.checks import among, amount, names, needed, shown
from linkwork.errors import LinkworkError
from linkwork.mechanism.parameter_units import unit_of_parameter
from linkwork.patience import announced
from linkwork.robot import Robot, State

UNSEEN = 1e-9  # singular value over the largest: rounding
BARE = 1e-7  # part of a combination that is none
SHOWN = 12
SWAPS = 1000
GROWTH = 1e-9  # of the logarithm of the determinant that ends the exchange
Measures = Literal["pose", "position", "nothing"]


@dataclass(frozen=True, eq=False)
class Observability:
    """Hold which combinations of the free numbers are seen.

    numbers: paths (np); sizes: their own units (np): the robot's length, 1 rad
    singular: singular values of J, largest first (np); directions: the columns V (np x np)
    poses: how many are measured; weighed: whether the noise is stated, so that `deviations` are
    """

    numbers: tuple[str, ...]
    sizes: np.ndarray
    singular: np.ndarray
    directions: np.ndarray
    poses: int
    weighed: bool

    @property
    def rank(self) -> int:
        """Number of combinations that are seen."""
        return int(np.sum(self.singular > UNSEEN * max(self.singular.max(initial=0.0), 1e-300)))

    @property
    def index(self) -> float:
        """O1 of the combinations that are seen."""
        seen = self.singular[: self.rank]
        return float(np.exp(np.mean(np.log(seen))) / np.sqrt(self.poses)) if self.rank else 0.0

    @property
    def condition(self) -> float:
        """Largest over smallest singular value of the combinations that are seen."""
        return float(self.singular[0] / self.singular[self.rank - 1]) if self.rank else np.inf

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the numbers (np x np) in what is seen of them, in their units."""
        V = self.directions[:, : self.rank] * self.sizes[:, None]
        return (V / self.singular[: self.rank] ** 2) @ V.T

    @property
    def seen(self) -> np.ndarray:
        """Whether a number is told by itself (np): it is in no combination that is not seen."""
        return np.abs(self.directions[:, self.rank :]).max(axis=1, initial=0.0) < BARE

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the numbers (np) in their units; infinite where one is not told by
        itself."""
        own = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return np.where(self.seen, own, np.inf)

    @property
    def unseen(self) -> tuple[dict[str, float], ...]:
        """Combinations that change nothing of what is measured: steps of the numbers by path, in
        their units, the first one 1; each has a number that no other has."""
        rows, _ = echelon(self.directions[:, self.rank :].T)
        found = []
        for row in rows * self.sizes:
            own = {path: x for path, x in zip(self.numbers, row, strict=True) if x}
            first = next(iter(own.values()))
            found.append({path: float(x / first) for path, x in own.items()})
        return tuple(found)

    @property
    def sufficient(self) -> tuple[str, ...]:
        """As many of the numbers as combinations are seen, which tell all that is: with the others
        as they are, each is told by itself."""
        _, left_out = echelon(self.directions[:, self.rank :].T)
        return tuple(path for k, path in enumerate(self.numbers) if k not in left_out)

    def __repr__(self) -> str:
        head = (
            f"Observability({amount(len(self.numbers), 'number')}, {self.rank} seen, "
            f"{amount(self.poses, 'pose')}, O1 {self.index:.4g}, condition {self.condition:.4g})"
        )
        lines = [f"not seen: {told(each)}" for each in self.unseen]
        rest = [f"... and {len(lines) - SHOWN} more"] if len(lines) > SHOWN else []
        return "\n  ".join([head, *lines[:SHOWN], *rest])


def told(combination: Mapping[str, float]) -> str:
    """Return a combination of numbers as a sum."""
    parts = []
    for path, x in combination.items():
        sign = "- " if x < 0 else "+ " if parts else ""
        parts.append(f"{sign}{'' if abs(abs(x) - 1) < 1e-9 else f'{abs(x):.4g} '}{path}")
    return " ".join(parts)


def echelon(rows: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return rows that span the same space, each with a number 1 that no other has, and the places
    of these (Gauss-Jordan with full pivoting); parts that are rounding are zero."""
    rows, places = rows.copy(), []
    for k in range(len(rows)):
        i, j = divmod(int(np.argmax(np.abs(rows[k:]))), rows.shape[1])
        rows[[k, k + i]] = rows[[k + i, k]]
        rows[k] /= rows[k, j]
        places.append(j)
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, j], rows[k])
    largest = np.abs(rows).max(axis=1, initial=0.0, keepdims=True)
    return np.where(np.abs(rows) > BARE * largest, rows, 0.0), places


def own_sizes(robot: Robot) -> np.ndarray:
    """Return the own units of a robot's free numbers: its length, 1 rad, else their size."""
    units = [unit_of_parameter(robot.mechanism, path) for path in robot.parameters]
    length = robot.equations.tree.length
    return np.array(
        [
            length if unit in ("m", "m, rad") else 1.0 if unit == "rad" else max(abs(value), 1.0)
            for unit, value in zip(units, robot.p, strict=True)
        ]
    )


def observed(model: PoseModel, slopes: np.ndarray, poses: int) -> Observability:
    """Return which combinations are seen by stacked derivatives (rows, np) of a model; what moves
    by no more than rounding of its own unit is not."""
    robot, sizes = model.robot, own_sizes(model.robot)
    J = slopes * sizes
    rows = np.concatenate([J, np.zeros((max(0, sizes.size - len(J)), sizes.size))])
    _, singular, Vt = np.linalg.svd(rows, full_matrices=False)
    singular = np.where(singular > UNSEEN * model.reach, singular, 0.0)
    return Observability(tuple(robot.parameters), sizes, singular, Vt.T, poses, model.weighed)


def planned(
    robot: Robot,
    states: State,
    measure: Measures,
    joints: Sequence[str],
    noise: Mapping[str, float | Mapping[str, float] | None],
) -> tuple[PoseModel, np.ndarray]:
    """Return the model of poses that are to be measured, and its derivatives at them (N, rows,
    np)."""
    if not among(measure, ("pose", "position", "nothing")):
        raise LinkworkError(
            f"measure is {shown(measure)}; choose from 'pose', 'position', 'nothing'"
        )
    space = {"pose": range(6), "position": range(3, 6), "nothing": ()}
    plane = {"pose": (2, 3, 4), "position": (3, 4), "nothing": ()}
    rows = tuple((plane if robot.planar else space)[measure])
    model = model_of(robot, rows, names(joints, "joints"), **noise)  # pyright: ignore
    q, readings = readings_of(robot, states)
    return model, model.slopes(model.closed(q, readings, robot.p), robot.p)


@announced("finding what poses tell")
def observability(
    robot: Robot,
    states: State,
    *,
    measure: Measures = "pose",
    joints: Sequence[str] = (),
    position: float | None = None,
    rotation: float | None = None,
    encoders: float | Mapping[str, float] | None = None,
) -> Observability:
    """Find which combinations of a robot's free numbers measured poses would tell.

    Args:
        robot: with the numbers free that are to be found.
        states: that are to be measured (N).
        measure: of the tool: its "pose", its "position", or "nothing".
        joints: further joints that have an encoder, beside the actuators.
        position, rotation, encoders: standard deviations of the noise, as in `MeasuredPoses`.

    Raises:
        LinkworkError: nothing free, nothing measured, singular poses, numbers that open loops.
    """
    needed(robot, Robot)
    noise = {"position": position, "rotation": rotation, "encoders": encoders}
    model, slopes = planned(robot, states, measure, joints, noise)
    return observed(model, slopes.reshape(-1, slopes.shape[-1]), len(slopes))


@announced("choosing poses")
def best_poses(
    robot: Robot,
    candidates: State,
    count: int,
    *,
    measure: Measures = "pose",
    joints: Sequence[str] = (),
    position: float | None = None,
    rotation: float | None = None,
    encoders: float | Mapping[str, float] | None = None,
    starts: int = 5,
    seed: int = 0,
) -> tuple[int, ...]:
    """Choose the poses whose measurement tells a robot's free numbers best (D-optimal).

    Beginning with choices at random, that pose is exchanged for that candidate by which det J'J of
    what all candidates together see grows most, until none grows; the best end is returned. A pose
    may be chosen once.

    Args:
        robot, measure, joints, position, rotation, encoders: as in `observability`.
        candidates: states that can be measured (N); count: how many are to be.
        starts: random choices to begin with; seed: of these.

    Returns:
        The numbers of the chosen candidates, ascending.

    Raises:
        LinkworkError: as `observability`; a count that is not from 1 to the number of candidates,
            or so small that what the candidates see is not told.
    """
    needed(robot, Robot)
    noise = {"position": position, "rotation": rotation, "encoders": encoders}
    model, slopes = planned(robot, candidates, measure, joints, noise)
    many, rows, _ = slopes.shape
    if not isinstance(count, int) or isinstance(count, bool) or not 0 < count <= many:
        raise LinkworkError(f"count is {shown(count)}; give a number from 1 to {many}")
    whole = observed(model, slopes.reshape(-1, slopes.shape[-1]), many)
    if not whole.rank:
        raise LinkworkError("these poses tell nothing of the free numbers; free others")
    if count * rows < whole.rank:
        least = -(-whole.rank // rows)
        raise LinkworkError(
            f"{amount(count, 'pose')} of {amount(rows, 'number')} each do not tell "
            f"{amount(whole.rank, 'combination')}; measure {least} poses or more"
        )
    # In the combinations that all candidates see, of unit size there: the determinant is free of
    # units.
    V = whole.directions[:, : whole.rank] * whole.sizes[:, None] / whole.singular[: whole.rank]
    J = slopes @ V
    blocks = np.swapaxes(J, 1, 2) @ J
    random = np.random.default_rng(seed)
    ends = [exchanged(blocks, random.permutation(many)[:count]) for _ in range(max(starts, 1))]
    best = max(ends, key=lambda chosen: volume(blocks[chosen].sum(axis=0)))
    rank = observed(model, slopes[best].reshape(count * rows, -1), count).rank
    if rank < whole.rank:
        raise LinkworkError(
            f"the best choice of {amount(count, 'pose')} tells {rank} of the "
            f"{amount(whole.rank, 'combination')} that all candidates see; choose more poses"
        )
    return tuple(sorted(int(k) for k in best))


def exchanged(blocks: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return a choice of matrices (N, r, r) of which no exchange makes the sum's determinant
    larger."""
    chosen, tiny = chosen.copy(), 1e-12 * np.eye(blocks.shape[1])
    for _ in range(SWAPS):
        total = blocks[chosen].sum(axis=0) + tiny
        others = np.setdiff1d(np.arange(len(blocks)), chosen)
        if not others.size:
            return chosen
        best = (volume(total) + GROWTH, 0, 0)
        for place, k in enumerate(chosen):
            sizes = volume(total - blocks[k] + blocks[others])
            j = int(np.argmax(sizes))
            best = max(best, (float(sizes[j]), place, int(others[j])))
        if best[0] <= volume(total) + GROWTH:
            return chosen
        chosen[best[1]] = best[2]
    return chosen


def volume(M: np.ndarray) -> np.ndarray:
    """Return the logarithm of determinants (...) of matrices that are positive semidefinite."""
    return np.linalg.slogdet(M)[1]
