"""Identification: masses and friction from measured motions and forces, by least squares.

    S' u - known = Y_b(q, v, v') beta + noise

stacked over all samples, rows weighted by the size of their noise. With W the weighted stack and r
what remains,

    beta = W^+ s,    sigma^2 = |r|^2 / (rows - r),    cov beta = sigma^2 (W' W)^-1

A periodic motion is measured best by fitting a Fourier series to it, whose derivatives need no
differences. Its coordinates are those of the actuators; the other joints follow by the direct
kinematics, and so no sensors but the motors' are needed.
Source: Khalil & Dombre 2002, ch. 12; Swevers, Ganseman, Tukel, De Schutter & Van Brussel, IEEE
Trans. Robotics and Automation 13 (1997) 730-740 (periodic excitation).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from linkwork.analysis._base_parameters import NEGLIGIBLE, Base, base_parameters, pace
from linkwork.analysis.all_rows import on_mode
from linkwork.analysis.outliers import warned_by_rates
from linkwork.analysis.square import of_joints
from linkwork.checks import finite, in_order, needed, shown
from linkwork.errors import LinkworkError
from linkwork.mechanism.numbers import located
from linkwork.model import checks
from linkwork.model.linear import one_state, own_rates
from linkwork.notebooks import Portrayed
from linkwork.patience import announced
from linkwork.robot import Robot, State, UnreachableError
from linkwork.runs.resuming import as_in, described
from linkwork.simulation import Run

REWEIGHTED = 3
LEFT_OVER = 1e-9  # part of the largest force that rounding may leave
APART = 1e-6  # smallest over largest singular value of harmonics that samples tell apart
SHOWN, WIDE = 12, 76  # lines, and characters of a line, in a repr


@dataclass(frozen=True, eq=False)
class Measured:
    """Hold measured motion and forces: states (N), accelerations (N, n) of the rates that are
    independent at home, as those of the states, forces u (N, actuators)."""

    states: State
    accelerations: np.ndarray
    forces: np.ndarray

    def __repr__(self) -> str:
        return f"Measured({self.states}, with accelerations and forces)"


@dataclass(frozen=True, eq=False)
class Identification(Portrayed):
    """Hold identified base parameters.

    base: what they stand for; values, deviations: beta and its standard deviation (r), in the unit
    of the first of the
        parameters in each
    condition: of the stacked regressor, its columns brought to equal length; residual: root mean
    square of what remains of
        the forces, by independent rate (n) [N, N m]
    root: square root W of the inverse of beta's covariance, W' W (r x r)
    """

    base: Base
    values: np.ndarray
    deviations: np.ndarray
    condition: float
    residual: np.ndarray
    root: np.ndarray

    def __repr__(self) -> str:
        pairs = zip(self.values, self.deviations, self.names, strict=True)
        lines = [f"{value:.6g} +- {deviation:.2g}  {name}" for value, deviation, name in pairs]
        rest = [f"... and {len(lines) - SHOWN} more"] if len(lines) > SHOWN else []
        head = f"Identification({len(lines)} base parameters, condition {self.condition:.4g})"
        return "\n  ".join([head, *(line[:WIDE] for line in lines[:SHOWN]), *rest])

    @property
    def names(self) -> tuple[str, ...]:
        """What each parameter stands for."""
        return self.base.names

    @property
    def described(self) -> np.ndarray:
        """Values of the description (r)."""
        return self.base.described

    def forces(self, states: State, accelerations: np.ndarray) -> np.ndarray:
        """Return what the identified parameters foretell for the forces on the independent rates
        (..., n) [N, N m].

        states: one or a stack; accelerations: v' (..., n) [m/s^2, rad/s^2] of the rates that are
        independent at home, as those of the states
        """
        robot = self.base.regressor.robot
        states = in_rates_of_home(robot, states)
        accelerations = checks.accelerations(accelerations, states.independent)
        Y, known = self.base.regressor.with_known(states, accelerations)
        return Y[..., self.base.columns] @ self.values + known


@announced("identifying parameters")
def identify(
    robot: Robot, measured: Measured | Run, effects: Sequence[str] = (), *, seed: int = 0
) -> Identification:
    """Identify the base parameters of a robot from a measured motion.

    Args:
        robot: its geometry, springs and all that is not identified are taken as described; of a
            run, with the values that free numbers had in it.
        measured: a motion with its forces, or a run.
        effects: joint effects to identify beside the masses: "slide_1.friction.viscous",
            "slide_1.friction.coulomb", "slide_1.rotor_inertia".
        seed: of the random motions on which the base parameters are found.

    Raises:
        LinkworkError: too few samples, a motion that does not tell all base parameters apart;
            states of another robot, or in rates other than those of home; a run with other values
            of what is not identified, and not free.

    Warns:
        ModelWarning: a sample does not fit in with the others.
    """
    # Y beta = S' u - (known part), each row multiplied by its rate's own unit so that rows compare.
    robot = as_measured(robot, measured, effects)
    data = motion_of(robot, measured)
    base = base_parameters(robot, effects, seed=seed)
    states, n, own = data.states, robot.mobility, own_rates(robot, data.states)
    applied = np.einsum("kan,ka->kn", robot.actuation(states), data.forces)
    Y, known = base.regressor.with_known(states, data.accelerations)
    # Energies: all samples of one rate, then of the next.
    right = (own * (applied - known)).T.ravel()
    rows = np.swapaxes(own[:, None] * Y[..., base.columns], 0, 1).reshape(right.size, -1)
    if right.size <= rows.shape[1]:
        raise LinkworkError(
            f"{right.size} measured forces do not give {rows.shape[1]} parameters; measure more "
            "samples"
        )
    # Columns of equal length: the singular values then tell of the motion, not of the units; but of
    # rounding where a column is no more than that.
    lengths = np.linalg.norm(rows, axis=0)
    even = rows / np.where(lengths > 0, lengths, 1.0)
    sigma = np.linalg.svd(even, compute_uv=False)
    sizes = lengths / base.regressor.units(pace(robot))[base.columns]
    if not (sigma[-1] > 1e-10 * sigma[0] and sizes.min() > NEGLIGIBLE * sizes.max()):
        weakest = base.names[int(np.argmin(sizes))]
        raise LinkworkError(
            f"the motion does not tell the {rows.shape[1]} base parameters apart (least seen: "
            f"{weakest}); use a richer one, such as analysis.exciting_trajectory gives"
        )
    # Least squares, weighed anew by what remains: a rate measured with more noise counts less.
    beta, weights = np.zeros(rows.shape[1]), np.ones(n)
    for _ in range(REWEIGHTED):
        scale = np.repeat(weights, len(right) // n)
        beta = np.linalg.lstsq(even * scale[:, None], right * scale, rcond=None)[0] / lengths
        remains = (right - rows @ beta).reshape(n, -1)
        noise = np.sqrt(np.mean(remains**2, axis=1))
        weights = 1 / np.maximum(noise, 1e-12 * max(np.abs(right).max(), 1e-300))
    weighted = even * np.repeat(weights, len(right) // n)[:, None]
    freedom = right.size / (right.size - beta.size)
    Q, R = np.linalg.qr(weighted)
    deviations = np.linalg.norm(np.linalg.inv(R), axis=1) / lengths * np.sqrt(freedom)
    root = R * lengths / np.sqrt(freedom)
    if left_over(remains, right):
        warned_by_rates(weights[:, None] * remains, Q, stacklevel=3)
    return Identification(base, beta, deviations, float(sigma[0] / sigma[-1]), noise / own, root)


def left_over(remains: np.ndarray, forces: np.ndarray) -> bool:
    """Tell whether more remains of forces than rounding leaves."""
    return bool(np.abs(remains).max() > LEFT_OVER * np.abs(forces).max())


def as_measured(robot: Robot, measured: Measured | Run, told: Sequence[str] = ()) -> Robot:
    """Return the robot with the values that its free numbers had in a run, but for those of bodies
    and those named, which the forces are to tell."""
    needed(robot, Robot)
    if not isinstance(measured, Run):
        return robot

    def known(path: str) -> bool:
        kind, *names = located(robot.mechanism, path)[0]
        return kind != "bodies" and ".".join(names) not in told

    values = described(robot, measured)
    return as_in(robot, {x: values[x] for x in values if known(x)}, "identify by")


def motion_of(robot: Robot, measured: Measured | Run) -> Measured:
    """Return a measured motion with its forces, as numbers that fit the robot."""
    if isinstance(measured, Run):
        return of_run(robot, measured)
    if not isinstance(measured, Measured):
        raise LinkworkError(f"measured is {shown(measured)}; give a Measured motion, or a run")
    if not isinstance(measured.states, State) or len(measured.states.batch) != 1:
        raise LinkworkError(
            f"the measured states are {shown(measured.states)}; give a stack (N) of states, one "
            "for each sample"
        )
    states = in_rates_of_home(robot, measured.states)
    count, given = *states.batch, []
    for what, values, names in (
        ("accelerations", measured.accelerations, robot.independent),
        ("forces", measured.forces, robot.actuators),
    ):
        given.append(finite(values, f"the measured {what}"))
        if given[-1].shape != (count, len(names)):
            raise LinkworkError(
                f"the measured {what} have the shape {given[-1].shape}; give {(count, len(names))}"
            )
        in_order(values, names, f"the measured {what}")
    return Measured(states, *given)


def in_rates_of_home(robot: Robot, states: State) -> State:
    """Return states as the robot's own; refuse those whose rates are not those of home."""
    states = robot.own(states)
    if states.independent != robot.independent:
        raise LinkworkError(
            f"the states hold the rates of {', '.join(states.independent)}; bring them to "
            "those of home: robot.in_chart(states, robot.independent)"
        )
    return states


def of_run(robot: Robot, run: Run) -> Measured:
    """Return the samples of a run as a measured motion."""
    missing = [name for name in robot.independent if name not in robot.rates]
    if missing:
        raise LinkworkError(
            f"a run does not hold the rates {', '.join(missing)}; give a `Measured` motion"
        )
    if "external_wrench" in run.variables:
        raise LinkworkError(
            "wrenches from outside act in the run, which are none of the actuators' forces; give "
            "a run without them, or a `Measured` motion"
        )
    places = [robot.rates.index(name) for name in robot.independent]
    rates = run.variables["joint_rate"].values[:, places]
    states = robot.state(run.variables["joint_position"].values, rates)
    accelerations = run.variables["joint_acceleration"].values[:, places]
    return Measured(states, accelerations, run.variables["actuator_force"].values)


def periodic(
    robot: Robot,
    time: ArrayLike,
    positions: ArrayLike,
    forces: ArrayLike,
    *,
    period: float,
    harmonics: int,
    guess: State | None = None,
) -> Measured:
    """Return a measured periodic motion, its positions smoothed and differentiated by a Fourier
    series.

    Args:
        robot: with as many actuators as freedoms, whose rates are the independent ones.
        time: (N) [s]; positions: of the actuators (N, n) [m, rad]; forces: u (N, n) [N, N m].
        period: of the motion [s]; harmonics: number of harmonics of the series.
        guess: a state on the assembly mode of the motion, near its start; `home` if left out.

    Raises:
        LinkworkError: wrong shapes, columns that are labelled in another order, fewer samples than
            coefficients, or at times that do not tell the harmonics apart; UnreachableError where
            the loops do not close.
    """
    needed(robot, Robot)
    # What was measured fits the robot and itself, and determines the series.
    n = len(robot.actuators)
    if robot.independent != robot.actuators:
        raise LinkworkError(
            "a motion is measured in its actuators where their rates are the independent ones"
        )
    t = checks.finite(time, "time")
    q_a, u = (
        checks.finite(part, name) for part, name in ((positions, "positions"), (forces, "forces"))
    )
    if t.ndim != 1 or q_a.shape != (t.size, n) or u.shape != (t.size, n):
        raise LinkworkError(
            f"time, positions and forces have the shapes {t.shape}, {q_a.shape}, {u.shape}; give "
            f"(N,), (N, {n})"
        )
    for part, name in ((positions, "the positions"), (forces, "the forces")):
        in_order(part, robot.actuators, name)
    checks.positive(period, "the period")
    if not isinstance(harmonics, int) or harmonics < 1 or t.size <= 2 * harmonics + 1:
        raise LinkworkError(
            f"harmonics is {harmonics!r} for {t.size} samples; give a number from 1 to less than "
            "half of these"
        )
    # One series through the positions; its derivatives are the rates and accelerations.
    series = [fourier(t, 2 * np.pi / period, harmonics, order) for order in range(3)]
    coefficients, _, _, sigma = np.linalg.lstsq(series[0], q_a, rcond=None)
    if not sigma[-1] > APART * sigma[0]:
        raise LinkworkError(
            f"the samples are at times of the period that do not tell {harmonics} harmonics apart; "
            "measure at other times, all over the period, or give fewer harmonics"
        )
    smooth, v, dv = (basis @ coefficients for basis in series)
    start, _ = one_state(robot, robot.home if guess is None else guess)
    return Measured(robot.make_state(tracked(robot, smooth, start), v), dv, u)


def fourier(t: np.ndarray, omega: float, harmonics: int, order: int) -> np.ndarray:
    """Return the basis (N, 1 + 2 harmonics) 1, cos, sin of a Fourier series at times, or its time
    derivative of an order."""
    k = omega * np.arange(1, harmonics + 1)
    phase = np.multiply.outer(t, k) + order * np.pi / 2
    constant = np.ones((t.size, 1)) if order == 0 else np.zeros((t.size, 1))
    return np.hstack([constant, k**order * np.cos(phase), k**order * np.sin(phase)])


def tracked(robot: Robot, positions: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return q (N, nq) along actuated coordinates (N, n), on the assembly mode of a start (nq)."""
    q, good = on_mode(of_joints(robot, robot.actuators), start, positions, 30)
    if not good.all():
        k = int(np.argmin(good))
        where = ", ".join(
            f"{name} = {value:.6g}"
            for name, value in zip(robot.actuators, positions[k], strict=True)
        )
        raise UnreachableError(
            f"sample {k} ({where}) cannot be reached on this assembly mode; give another guess"
        )
    return q
