"""Calibration: geometry from measured poses of the tool, or from redundant encoders.

    min_p sum |r_k(p)|^2,    r = what was measured less what is foretold, over the noise

by Levenberg and Marquardt's method on exact derivatives through the closed loops
(`measured_poses`), in the combinations of p that are seen (`_observability`) from where it begins;
what is not seen stays as described, and is named. With J at the end and f = rows - rank,

    cov p = (J'J)^+

where the noise is stated; else its sizes follow from what remains (`noise_shares`). Where it is
stated, |r|^2 is chi-square distributed with f degrees of freedom if the model holds.
Source: Hollerbach, Khalil & Gautier 2016, Springer Handbook of Robotics, ch. 8 (model
identification); Marquardt 1963; Borm & Menq 1991 (observability).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np

from linkwork.analysis._observability import Observability, observed, told
from linkwork.analysis.measured_poses import (
    MeasuredPoses,
    PoseModel,
    measured_rows,
    model_of,
    readings_of,
    spatial,
)
from linkwork.analysis.noise_shares import NoiseShares
from linkwork.analysis.outliers import beyond_noise, warned_of_sample
from linkwork.analysis.settled_squares import settled
from linkwork.checks import amount, by_name, finite, in_order, needed, shown
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.mechanism import Mechanism
from linkwork.mechanism.parameter_units import with_unit
from linkwork.model.labels import POSES
from linkwork.patience import announced
from linkwork.robot import Robot

TOLERANCE = 1e-15
OTHER_UNIT = 100.0  # times as far apart as the tool's positions, from which on a unit is off
TURNS = 4 * np.pi  # from where on rotations are hardly radians
TOO_FAR = 1e3  # of what remains, over the least noise, where loops do not close
UNTOLD = 1e-9  # of the robot's length, or rad: what remains by rounding
ROUNDED = 1e-9  # of the robot's length, which is no distance between poses
SHOWN, WIDE = 16, 88


@dataclass(frozen=True, eq=False)
class Calibration:
    """Hold calibrated numbers.

    robot: with the values that were found
    observability: at the end; its deviations hold for the stated noise
    described: values before (np); remains: what was measured less what is foretold, over the noise
        (N, rows)
    weighed: whether the noise was stated
    sizes, shares: of the noise by which each row is weighed (rows), and how much of it each kind
        of row has in fact: "tool.position", "tool.rotation" and further joints
    """

    robot: Robot
    observability: Observability
    described: np.ndarray
    remains: np.ndarray
    weighed: bool
    sizes: np.ndarray
    shares: NoiseShares

    @property
    def values(self) -> dict[str, float]:
        """Values that were found, by path."""
        return dict(self.robot.parameters)

    @property
    def mechanism(self) -> Mechanism:
        """The description with these values, to be saved."""
        return self.robot.mechanism

    @property
    def freedoms(self) -> int:
        """Degrees of freedom f of what remains: rows less combinations that are seen."""
        return self.remains.size - self.observability.rank

    @property
    def chi_square(self) -> float:
        """|r|^2; near `freedoms` where the stated noise and the model hold."""
        return float(np.sum(self.remains**2))

    @property
    def scale(self) -> float:
        """By how much the noise of all rows together differs from that of their weights: 1 where it
        is stated, infinite where it is not and no row is left over to tell it."""
        if self.weighed:
            return 1.0
        return float(np.sqrt(self.chi_square / self.freedoms)) if self.freedoms else np.inf

    @property
    def noise(self) -> dict[str, float]:
        """Deviations of the noise that what remains tells, of "tool.position" [m], "tool.rotation"
        [rad] and further joints; infinite where no row is left over. Stated so, they weigh a second
        calibration better."""
        sizes = dict(zip(self.shares.kinds, self.sizes, strict=True))
        return {k: float(sizes[k] * s2**0.5) for k, s2 in self.shares.squares.items()}

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the numbers (np x np) in what is seen of them, in their units."""
        seen = self.observability
        if self.weighed or not seen.rank:
            return seen.covariance
        if np.isinf([*self.shares.squares.values()]).any():
            return np.full_like(seen.covariance, np.inf)
        V = seen.directions[:, : seen.rank] * seen.sizes[:, None] / seen.singular[: seen.rank]
        return V @ self.shares.covariance @ V.T

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the numbers (np); infinite where one is not told by itself."""
        own = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return np.where(self.observability.seen, own, np.inf)

    @property
    def unseen(self) -> tuple[dict[str, float], ...]:
        """Combinations that were not seen, and stay as described."""
        return self.observability.unseen

    def __repr__(self) -> str:
        head = (
            f"Calibration({amount(len(self.described), 'number')} from "
            f"{amount(len(self.remains), 'pose')}, {self.observability.rank} seen, chi-square "
            f"{self.chi_square:.4g} of {self.freedoms})"
        )
        lines = []
        for (path, value), deviation in zip(self.values.items(), self.deviations, strict=True):
            text = f"{path} = {value:.8g} +- {deviation:.2g}"
            lines.append(with_unit(self.mechanism, path, text)[:WIDE])
        rest = [f"... and {len(lines) - SHOWN} more"] if len(lines) > SHOWN else []
        unseen = [f"not seen: {told(each)}"[:WIDE] for each in self.unseen]
        return "\n  ".join([head, *lines[:SHOWN], *rest, *unseen[:SHOWN]])


@announced("calibrating")
def calibrate(robot: Robot, measured: MeasuredPoses) -> Calibration:
    """Find the free numbers of a robot from measured poses.

    Args:
        robot: with the numbers free that are to be found (`Robot.free`): positions and turns of
            frames, lengths, named quantities. It begins with their values.
        measured: readings of the actuators, and what was measured there.

    Returns:
        A `Calibration`: values, deviations, what is not seen, and the description that holds them.

    Raises:
        LinkworkError: nothing free or nothing measured, measured values that are not finite or do
            not fit the samples, fewer of them than combinations that are seen; singular poses;
            numbers that open loops which no joint closes; samples at which the loops do not close.

    Warns:
        ModelWarning: positions that look like millimetres, rotations that look like degrees; least
            squares that are not found; a sample that does not fit in with the others; more left
            over than the stated noise explains.
    """
    from scipy.optimize import least_squares

    # What was measured, in one form.
    if not isinstance(measured, MeasuredPoses):
        raise LinkworkError(f"measured is {shown(measured)}; give MeasuredPoses(states, ...)")
    needed(robot, Robot)
    q, readings = readings_of(robot, measured.states)
    tool, joints = values_of(robot, measured, len(q))
    model = model_of(
        robot,
        measured_rows(robot, tool),
        tuple(measured.joints),
        measured.position,
        measured.rotation,
        measured.encoders,
    )
    target = None if tool is None else spatial(robot, tool)
    if target is not None:
        warn_of_units(robot, target, model.evaluated(q, robot.p)["x"][:, :3, 0])
    fit = Fit(model, readings, target, joints, q)
    # The combinations that are seen from where it begins.
    first = observed(model, fit.slopes(robot.p), len(q))
    count = q.shape[0] * model.scales.size
    if not first.rank:
        raise LinkworkError("what was measured tells nothing of the free numbers; free others")
    if count < first.rank:
        raise LinkworkError(
            f"{amount(count, 'measured number')} do not tell {amount(first.rank, 'combination')} "
            "of the free numbers; measure more poses, or free others"
        )
    seen = first.directions[:, : first.rank] * first.sizes[:, None] / first.singular[: first.rank]
    found = least_squares(
        lambda y: fit.tried(robot.p + seen @ y),
        np.zeros(first.rank),
        jac=lambda y: -fit.slopes(robot.p + seen @ y) @ seen,  # pyright: ignore
        method="lm",
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=TOLERANCE,
    )
    if not settled(found, count * (UNTOLD * model.reach) ** 2 / 2):
        warnings.warn(
            "the numbers that fit best are not found: the search ended where what remains still "
            "falls; begin nearer to the robot as it is, or leave out samples at which loops hardly "
            "close",
            ModelWarning,
            stacklevel=3,
        )
    p = robot.p + seen @ found.x
    other = robot.with_parameters(dict(zip(robot.parameters, map(float, p), strict=True)))
    remains = fit.remains(p).reshape(len(q), -1)
    seen, left = at_end(first, fit.slopes(p))
    shares = NoiseShares(model.kinds, remains, left)
    made = Calibration(other, seen, robot.p.copy(), remains, model.weighed, model.scales, shares)
    if np.abs(remains).max() > UNTOLD * model.reach:
        warn_of_misfit(made, left)
    return made


def warn_of_misfit(found: Calibration, left: np.ndarray) -> None:
    """Warn of a sample that stands out from the others, and of more than the stated noise; left: of
    the derivatives at the end (rows, rank)."""
    if warned_of_sample(found.remains, left, stacklevel=4):
        return
    if found.weighed and beyond_noise(found.chi_square, found.freedoms):
        times = np.sqrt(found.chi_square / found.freedoms)
        warnings.warn(
            f"what remains is {times:.3g} times the stated noise (chi-square "
            f"{found.chi_square:.4g} of {found.freedoms}): deviations are told too small by as "
            "much or more; state a larger noise, or free what else differs from the description",
            ModelWarning,
            stacklevel=4,
        )


def at_end(first: Observability, slopes: np.ndarray) -> tuple[Observability, np.ndarray]:
    """Return what derivatives at the end (rows, np) tell in the combinations that were sought, and
    their left singular vectors (rows, rank)."""
    sought, rank = first.directions[:, : first.rank], first.rank
    left, singular, Vt = np.linalg.svd(slopes * first.sizes @ sought, full_matrices=False)
    directions = np.concatenate([sought @ Vt.T, first.directions[:, rank:]], axis=1)
    values = np.concatenate([singular, np.zeros(len(first.numbers) - rank)])
    return replace(first, singular=values, directions=directions), left


@dataclass(eq=False)
class Fit:
    """Hold measured values beside a model, and where its loops closed last.

    readings (N, n); tool (N, 6) or None; joints (N, further joints)
    q: where the loops closed last (N, nq); at: the numbers with which they did; found: the slopes
        there, once they were asked for
    """

    model: PoseModel
    readings: np.ndarray
    tool: np.ndarray | None
    joints: np.ndarray
    q: np.ndarray
    at: np.ndarray | None = None
    found: np.ndarray | None = None

    def close(self, p: np.ndarray) -> np.ndarray:
        """Return configurations (N, nq) closed with p, begun where they closed last."""
        if self.at is None or not np.array_equal(p, self.at):
            self.q, self.at = self.model.closed(self.q, self.readings, p), p.copy()
            self.found = None
        return self.q

    def remains(self, p: np.ndarray) -> np.ndarray:
        """Return what remains with p, over the noise (N rows)."""
        return self.model.remains(self.close(p), p, self.tool, self.joints).ravel()

    def tried(self, p: np.ndarray) -> np.ndarray:
        """Return what remains with p, very much where the loops do not close, or the tool is held
        by nothing: a step too far."""
        before = self.q, self.at, self.found
        try:
            self.slopes(p)
            return self.remains(p)
        except LinkworkError:
            self.q, self.at, self.found = before
            return np.full(
                self.q.shape[0] * self.model.scales.size, TOO_FAR / self.model.scales.min()
            )

    def slopes(self, p: np.ndarray) -> np.ndarray:
        """Return the derivative of what is foretold by p, over the noise (N rows, np)."""
        q = self.close(p)
        if self.found is None:
            self.found = self.model.slopes(q, p, self.tool).reshape(-1, p.size)
        return self.found


def warn_of_units(robot: Robot, tool: np.ndarray, foretold: np.ndarray) -> None:
    """Warn where measured poses [rotation vector; position] (N, 6) can hardly be in metres and
    radians, beside positions (N, 3) that are foretold."""
    seen, own = (np.linalg.norm(x - x.mean(axis=0)) for x in (tool[:, 3:], foretold))
    if own > ROUNDED * robot.equations.tree.length and seen > OTHER_UNIT * own:
        warnings.warn(
            f"the measured positions are {seen / own:.4g} times as far apart as those of the "
            "tool; are they in millimetres? give metres",
            ModelWarning,
            stacklevel=4,
        )
    if np.abs(tool[:, :3]).max(initial=0.0) > TURNS:
        warnings.warn(
            f"measured rotations go up to {np.abs(tool[:, :3]).max():.4g}; are they in degrees? "
            "give radians",
            ModelWarning,
            stacklevel=4,
        )


def values_of(
    robot: Robot, measured: MeasuredPoses, count: int
) -> tuple[np.ndarray | None, np.ndarray]:
    """Return the measured poses (N, 6 or 3), if there are any, and readings (N, further joints)."""
    tool = None
    if measured.tool is not None:
        tool = finite(measured.tool, "the measured poses")
        widths = (3,) if robot.planar else (6, 3)
        if tool.ndim != 2 or len(tool) != count or tool.shape[1] not in widths:
            fits = " or ".join(f"({count}, {width})" for width in widths)
            raise LinkworkError(f"the measured poses have the shape {tool.shape}; give {fits}")
        in_order(measured.tool, POSES[robot.planar][: tool.shape[1]], "the measured poses")
    columns = []
    example = "{'elbow_1': [0.1, 0.2]}"
    for name, values in by_name(measured.joints, "the readings of joints", example).items():
        column = finite(values, f"the readings of {name!r}")
        if column.shape != (count,):
            raise LinkworkError(
                f"the readings of {name!r} have the shape {column.shape}; give ({count},)"
            )
        columns.append(column)
    return tool, np.array(columns).reshape(len(columns), count).T
