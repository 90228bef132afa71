"""Exciting trajectories: periodic motions of the actuators that tell the base parameters apart as
well as possible.

    q_i(t) = c_i + sum_k (a_ik / (omega k)) sin(omega k t) - (b_ik / (omega k)) cos(omega k t)

Each actuator's series is stretched until it meets its first bound (range, rate or acceleration), so
that every trial keeps them. Between N samples in a period of the highest harmonic a series is at
most its largest sample over cos(pi / N), which is taken for its largest value. Of very many trials
the best is improved by a search without derivatives. What is made small is the condition number of
the stacked regressor, its columns measured by what random motions within the same bounds bring.
Source: Swevers et al., IEEE Trans. Robotics and Automation 13 (1997) 730-740; Ehlich & Zeller,
Mathematische Zeitschrift 86 (1964) 41-44 (between samples).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from linkwork.analysis._base_parameters import Base, base_parameters
from linkwork.analysis._workspace import positive
from linkwork.analysis.all_rows import on_mode
from linkwork.analysis.identification import fourier, tracked
from linkwork.analysis.newton import Solver, solver
from linkwork.analysis.square import of_joints
from linkwork.checks import MOST, amount, count, finite, needed, random_numbers
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.model import checks
from linkwork.model.linear import own_rates
from linkwork.patience import announced
from linkwork.robot import Motion, Robot

SAMPLES = 40
DENSE = 32  # samples in a period of the highest harmonic
MOST_HARMONICS, MOST_TRIALS = 1000, 1_000_000  # which memory and patience hold
IMPOSSIBLE = 1e12
BLIND = 1e6  # condition from which on hardly any noise leaves the parameters apart


@dataclass(frozen=True, eq=False)
class Excitation:
    """Hold a periodic motion of the actuators.

    actuators: names; period [s]; coefficients: (1 + 2 harmonics, n) [m, rad], of 1, then of cos(k w
    t), then of sin(k w t), k = 1 .. harmonics, w = 2 pi / period
    condition: of the stacked regressor, its columns measured by those of random motions within the
    bounds
    """

    actuators: tuple[str, ...]
    period: float
    coefficients: np.ndarray
    condition: float

    def __repr__(self) -> str:
        harmonics = amount((len(self.coefficients) - 1) // 2, "harmonic")
        told = f"{harmonics} in {self.period:.6g} s, condition {self.condition:.4g}"
        return f"Excitation({told}, actuators: {', '.join(self.actuators)})"

    def sample(self, time: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return positions, rates and accelerations of the actuators (N, n).

        time: of the samples (N) [s]
        """
        t, harmonics = finite(time, "the time"), (len(self.coefficients) - 1) // 2
        basis = (fourier(t, 2 * np.pi / self.period, harmonics, order) for order in range(3))
        q, v, dv = (part @ self.coefficients for part in basis)
        return q, v, dv

    def motion(self, robot: Robot, samples: int = 201) -> Motion:
        """Return the motion of the whole robot over one period, to simulate with or to take forces
        from; samples: number of equally spaced times, both ends among them."""
        needed(robot, Robot)
        time = np.linspace(0, self.period, count(samples, "samples", MOST))
        q, v, dv = self.sample(time)
        states = robot.make_state(tracked(robot, q, robot.home.q), v)
        _, rates, accelerations, _ = robot.kernel("joints_motion")(states.q, v, dv)
        tool = robot.tool_poses(states.q) if robot.mechanism.tools else np.empty((samples, 0))
        return Motion(time, states, dv, rates, accelerations, tool)


@dataclass(frozen=True, eq=False)
class Search:
    """Hold what trials are judged by.

    middle, half, rates, accelerations: bounds of the actuators (n)
    """

    problem: Solver
    base: Base
    period: float
    harmonics: int
    middle: np.ndarray
    half: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray

    @cached_property
    def dense(self) -> list[np.ndarray]:
        """The bases of positions, rates and accelerations over a period."""
        time = np.linspace(0, self.period, DENSE * self.harmonics, endpoint=False)
        omega = 2 * np.pi / self.period
        return [fourier(time, omega, self.harmonics, order) for order in range(3)]

    def coefficients(self, shape: np.ndarray) -> np.ndarray:
        """Return coefficients (1 + 2 harmonics, n) of a trial's shape: stretched to the bounds.

        The first n numbers of the shape move the middle of each motion within its range, for as
        much less amplitude.
        """
        n = self.middle.size
        offset = np.tanh(shape[:n])
        own = shape[n:].reshape(2 * self.harmonics, n)
        k = np.tile(np.arange(1, self.harmonics + 1), 2)[:, None]
        series = np.vstack([np.zeros((1, n)), own / k])
        largest = [
            np.abs(basis @ series).max(axis=0) / np.cos(np.pi / DENSE) for basis in self.dense
        ]
        bounds = (self.half * (1 - np.abs(offset)), self.rates, self.accelerations)
        sizes = [np.where(size > 0, size, 1.0) for size in largest]
        stretch = np.min([bound / size for bound, size in zip(bounds, sizes, strict=True)], axis=0)
        series = series * stretch
        series[0] = self.middle + self.half * offset
        return series

    def stacked(self, shape: np.ndarray) -> np.ndarray | None:
        """Return the stacked regressor of the base parameters (rows, r) of a trial, None where it
        leaves the workspace."""
        time = np.linspace(0, self.period, SAMPLES, endpoint=False)
        trial = Excitation(self.problem.square.what, self.period, self.coefficients(shape), np.inf)
        q_a, v, dv = trial.sample(time)
        robot = self.problem.square.robot
        start = robot.home.q
        q, good = on_mode(self.problem.square, start, q_a, 12)
        if not good.all():
            return None
        states = robot.make_state(q, v)
        Y = (
            own_rates(robot, states)[:, None]
            * self.base.regressor(states, dv)[..., self.base.columns]
        )
        if not np.isfinite(Y).all():
            raise LinkworkError(
                "what the trials tell of the parameters is not finite; give another period, ranges "
                "or bounds"
            )
        return Y.reshape(-1, len(self.base))

    def condition(self, shape: np.ndarray, sizes: np.ndarray) -> float:
        """Return the condition number of a trial, very large where it leaves the workspace."""
        Y = self.stacked(shape)
        if Y is None:
            return IMPOSSIBLE
        sigma = np.linalg.svd(Y / sizes, compute_uv=False)
        return float(sigma[0] / max(sigma[-1], sigma[0] / IMPOSSIBLE))


@announced("designing an exciting trajectory")
def exciting_trajectory(
    robot: Robot,
    *,
    period: float,
    ranges: Mapping[str, tuple[float, float]],
    rates: ArrayLike | Mapping[str, float],
    accelerations: ArrayLike | Mapping[str, float],
    harmonics: int = 3,
    effects: Sequence[str] = (),
    trials: int = 200,
    seed: int = 0,
) -> Excitation:
    """Find a periodic motion of the actuators from which the base parameters can be identified
    well.

    Args:
        robot: with as many actuators as freedoms, whose rates are the independent ones.
        period: [s]; harmonics: of the Fourier series.
        ranges: lower and upper bound of each actuated coordinate, by name [m, rad], around home's
            assembly mode.
        rates, accelerations: largest ones of the actuators: one number, one each, or by name
            [m/s, rad/s; per s].
        effects: joint effects to identify, as in `identify`.
        trials: number of random trials; the best of them is improved by as many evaluations again;
            seed: of these.

    Raises:
        LinkworkError: bounds that do not fit, ranges of which no trial stays in the workspace.

    Warns:
        ModelWarning: a best motion that hardly tells the parameters apart.
    """
    needed(robot, Robot)
    from scipy.optimize import minimize

    # What is asked fits the robot.
    if robot.independent != robot.actuators:
        raise LinkworkError(
            "exciting trajectories are made of actuators whose rates are the independent ones"
        )
    period = checks.positive(period, "the period")
    if not all(type(number) is int and number > 0 for number in (harmonics, trials)):
        raise LinkworkError(
            f"harmonics and trials are {harmonics!r} and {trials!r}; give whole numbers above zero"
        )
    count(harmonics, "harmonics", MOST_HARMONICS)
    count(trials, "trials", MOST_TRIALS)
    # The search: Fourier series about the middle of the ranges, each number of them free.
    lower, upper = range_of(robot, ranges)
    largest = [
        positive(robot, bound, name)
        for bound, name in ((rates, "rates"), (accelerations, "accelerations"))
    ]
    search = Search(
        solver(of_joints(robot, robot.actuators)),
        base_parameters(robot, effects),
        period,
        harmonics,
        (lower + upper) / 2,
        (upper - lower) / 2,
        *(np.ones(lower.size) if bound is None else bound for bound in largest),
    )
    # Trials that stay in the workspace; the spread of their columns makes parameters of different
    # units comparable.
    random = random_numbers(seed)
    shapes = random.standard_normal((trials, lower.size * (1 + 2 * harmonics)))
    stacks = [(shape, Y) for shape in shapes if (Y := search.stacked(shape)) is not None]
    if not stacks:
        raise LinkworkError(
            f"none of {trials} trials stays in the workspace on this assembly mode; narrow the "
            "ranges"
        )
    sizes = np.sqrt(np.mean([np.sum(Y**2, axis=0) for _, Y in stacks], axis=0))
    # The best trial, improved; Powell's method needs no slopes of what has kinks.
    best = min((shape for shape, _ in stacks), key=lambda shape: search.condition(shape, sizes))
    found = minimize(
        lambda shape: np.log(search.condition(shape, sizes)),
        best,
        method="Powell",
        options={"maxfev": trials},
    )
    best = min((best, np.asarray(found.x)), key=lambda shape: search.condition(shape, sizes))
    condition = search.condition(best, sizes)
    if condition > BLIND:
        warnings.warn(
            f"the best motion that is found hardly tells the base parameters apart (condition "
            f"{condition:.2g}); give wider ranges, larger rates and accelerations, more harmonics "
            "or more trials",
            ModelWarning,
            stacklevel=3,
        )
    return Excitation(robot.actuators, float(period), search.coefficients(best), condition)


def range_of(
    robot: Robot, ranges: Mapping[str, tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper bounds of all actuators (n)."""
    if not isinstance(ranges, Mapping):
        raise LinkworkError(
            f"the ranges are {ranges!r}; give (lower, upper) by name of the actuator"
        )
    checks.known(ranges, robot.actuators, "actuator")
    missing = [name for name in robot.actuators if name not in ranges]
    if missing:
        raise LinkworkError(
            f"the ranges lack {', '.join(missing)}; give all of {', '.join(robot.actuators)}"
        )
    pairs = np.array(
        [checks.finite(ranges[name], f"the range of {name!r}") for name in robot.actuators]
    )
    if pairs.shape != (len(robot.actuators), 2) or not (pairs[:, 0] < pairs[:, 1]).all():
        raise LinkworkError(
            f"the ranges {dict(ranges)} do not fit; give (lower, upper) with lower < upper for each"
        )
    return pairs[:, 0], pairs[:, 1]
