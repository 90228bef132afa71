"""Judges: whether an answer of the robot is right, by the multiplier oracle of the plain mechanism
and by NumPy alone.

They read joint coordinates and rates, in units of the plain mechanism; poses, twists,
accelerations, energies and powers are the oracle's own. A run is right if its samples at
Chebyshev's points t_k solve the oracle's equations of motion,

    Y(t_k) = Y(0) + integral of Y'(t) from 0 to t_k,  Y = (mass centres, axes of the bodies,
    twists),

the integral by Clenshaw and Curtis: a defect shows errors of the run, for the oracle's Y' is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

import linkwork as lw

from tests.hostile.changes import force_units, units
from tests.hostile.mechanisms import ROUNDED, Subject
from tests.oracle.maximal import MaximalOracle, Poses, Twists, pseudo_inverse

NODES = 25
DRIVEN = 1e-5  # least part of the motions that actuators must show, for forces to be asked back
LOST = 0.02  # of the least singular value at home, below which the constraints are nearly dependent


@dataclass(frozen=True)
class Seen:
    """Hold what the oracle sees of joint coordinates and rates.

    open, sliding: largest gap of a joint [m, rad] and of a constraint's rate
    """

    oracle: MaximalOracle
    poses: Poses
    twists: Twists
    open: float
    sliding: float

    @classmethod
    def of(cls, subject: Subject, positions: np.ndarray, rates: np.ndarray) -> Seen:
        """See the coordinates and rates of all joints of the described mechanism."""
        judged = subject.judged
        q = positions / units(judged, judged.coordinates, subject.length)
        w = rates / units(judged, judged.rates, subject.length)
        oracle = MaximalOracle(judged, dict(zip(judged.coordinates, q, strict=True)))
        poses = oracle.poses(oracle.near)
        gap = max(
            (np.abs(part).max(initial=0) for part in oracle.residuals(poses).values()), default=0.0
        )
        if subject.accuracy >= ROUNDED:
            poses = oracle.assemble(poses)
        rows = oracle.rows(poses, oracle._rest)
        left, right = np.vstack([rows.A, rows.F]), np.concatenate([np.zeros(len(rows.A)), w])
        t = np.linalg.lstsq(left, right, rcond=1e-9)[0]
        return cls(
            oracle,
            poses,
            oracle.by_body(t),
            float(gap),
            float(np.abs(left @ t - right).max(initial=0)),
        )

    def accelerations(self, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the accelerations of all joints, and those of the bodies (r, 6), under actuator
        forces."""
        found = self.oracle.accelerations(self.poses, self.twists, forces)
        joints = self.oracle.joint_accelerations(self.poses, self.twists, found)
        return joints, np.array([np.concatenate(found[name]) for name in found])

    def flow(self, accelerations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return Y and Y': mass centre, the axes and the twist of every body, and their
        derivatives."""
        y, slope = [], []
        for (name, body), (alpha, a) in zip(
            self.oracle.mechanism.bodies.items(), accelerations.reshape(-1, 2, 3), strict=True
        ):
            (p, R), (omega, v) = self.poses[name], self.twists[name]
            y += [p + R @ body.centre_of_mass, R.T.ravel(), omega, v]
            slope += [v, np.cross(omega, R.T).ravel(), alpha, a]
        return np.concatenate(y), np.concatenate(slope)


# States


def state_is_right(subject: Subject, state: lw.State, forces: np.ndarray) -> None:
    """Closure, accelerations, energies, and the forces back from the accelerations, at one
    state."""
    robot, judged = subject.robot, subject.judged
    seen = Seen.of(subject, state.positions, robot.joint_rates(state))
    closed(subject, seen)
    u = forces * force_units(judged, subject.length, subject.mass)
    v_dot = robot.forward_dynamics(state, u)
    found = robot.joint_accelerations(state, v_dot) / units(judged, judged.rates, subject.length)
    loose = cache(lambda: tolerance(seen))
    agree("accelerations", found, seen.accelerations(forces)[0], subject.accuracy, loose)
    joule = subject.mass * subject.length**2
    kinetic, potential = np.array(robot.energy(state)) / joule
    agree(
        "energies",
        np.array([kinetic, potential]),
        np.array(seen.oracle.energy(seen.poses, seen.twists)),
        max(1e-8, subject.accuracy),
    )
    if (
        len(robot.actuators) == robot.mobility
        and weak_rates(subject, state.positions, robot.actuators) > DRIVEN
    ):
        again = robot.inverse_dynamics(state, v_dot) / force_units(
            judged, subject.length, subject.mass
        )
        agree("forces from accelerations", again, forces, subject.accuracy, loose)
    if robot.mobility:
        M = robot.mass_matrix(state)
        half = state.rates @ M @ state.rates / 2 / joule
        agree("kinetic energy by the mass matrix", np.array([half]), np.array([kinetic]), 1e-8)


def closed(subject: Subject, seen: Seen) -> None:
    """The loops are closed and the rates keep them so."""
    size = 1 + max((np.abs(p).max() for p, _ in seen.poses.values()), default=0.0)
    speed = 1 + max(
        (np.abs(part).max() for twist in seen.twists.values() for part in twist), default=0.0
    )
    loose = 1e-5 if subject.accuracy >= ROUNDED else 1e-10
    assert seen.open < loose * size, f"the loops are open by {seen.open:.3g}"
    assert seen.sliding < max(loose, 1e-8) * speed, (
        f"the rates open the loops by {seen.sliding:.3g}"
    )


def tolerance(seen: Seen) -> float:
    """Return the relative error of accelerations that rounding allows here: it grows as constraints
    become dependent."""
    return min(1e-4, 1e-11 / nearness(seen) ** 2)


def nearness(seen: Seen) -> float:
    """Return the least singular value of the constraints that counts, over the largest."""
    A = seen.oracle.rows(seen.poses, seen.oracle._rest).A
    values = np.linalg.svd(
        A / np.maximum(np.linalg.norm(A, axis=1, keepdims=True), 1e-300), compute_uv=False
    )
    values = values[values > 1e-9 * values.max(initial=0)]
    return float(values.min(initial=1.0) / values.max(initial=1.0))


def agree(
    what: str,
    found: np.ndarray,
    expected: np.ndarray,
    allowed: float,
    more: Callable[[], float] = lambda: 0.0,
) -> None:
    """Require numbers to agree, relative to the largest of them and 1; what is more than allowed
    may be allowed by `more`."""
    error = np.abs(found - expected).max(initial=0) / (1 + np.abs(expected).max(initial=0))
    if not error <= allowed:
        allowed = max(allowed, more())
        assert error <= allowed, (
            f"{what} differ by {error:.3g} (relative, {allowed:.2g} allowed): {found}, not "
            f"{expected}"
        )


# Runs


@cache
def nodes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Chebyshev's points on [0, 1], the matrix of integrals from 0 to them, and that of
    coefficients."""
    x = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    coefficients = np.linalg.inv(chebyshev.chebvander(x, NODES - 1))
    integral = (
        np.array([chebyshev.chebval(x, chebyshev.chebint(c, lbnd=-1)) for c in coefficients.T]).T
        / 2
    )
    return (x + 1) / 2, integral, coefficients


def run_is_right(subject: Subject, run: lw.Run, forces: np.ndarray, allowed: float) -> float:
    """Judge a run that was saved at Chebyshev's points under constant forces; return the largest
    defect.

    Args:
        forces: of the actuators, in units of the plain mechanism.
        allowed: relative defect.
    """
    judged, data = subject.judged, run.dataset
    t = data["time"].values
    assert len(t) == NODES, f"{len(t)} of {NODES} samples were saved: {run.message}"
    a_unit = units(judged, judged.rates, subject.length)
    states, slopes, powers, energies = [], [], [], []
    for k in range(NODES):
        seen = Seen.of(subject, data["joint_position"].values[k], data["joint_rate"].values[k])
        closed(subject, seen)
        joints, bodies = seen.accelerations(forces)
        found = data["joint_acceleration"].values[k] / a_unit
        agree(
            f"accelerations at {t[k]:.6g} s",
            found,
            joints,
            subject.accuracy,
            lambda seen=seen: tolerance(seen),
        )
        y, slope = seen.flow(bodies)
        states.append(y)
        slopes.append(slope)
        energies.append(sum(seen.oracle.energy(seen.poses, seen.twists)))
        powers.append(seen.oracle.power(seen.poses, seen.twists, forces))
    Y, dY, span = np.array(states), np.array(slopes), t[-1] - t[0]
    _, integral, coefficients = nodes()
    defect = Y - Y[0] - span * integral @ dY
    unresolved = span * np.abs((coefficients @ dY)[-3:]).max(initial=0)
    scale = 1 + np.abs(Y).max()
    worst = np.abs(defect).max() / scale
    limit = allowed + 10 * unresolved / scale + subject.accuracy
    assert worst <= limit, (
        f"the run's defect is {worst:.3g} of its size (allowed {limit:.3g}, unresolved "
        f"{unresolved:.2g})"
    )
    balance_is_right(subject, run, np.array(energies), np.array(powers), allowed)
    return float(worst)


def balance_is_right(
    subject: Subject, run: lw.Run, energies: np.ndarray, powers: np.ndarray, allowed: float
) -> None:
    """The run's energies are the oracle's, and its balance is finite and tells of no loss that
    there is not."""
    _, integral, coefficients = nodes()
    data, joule = run.dataset, subject.mass * subject.length**2
    found = (data["kinetic_energy"].values + data["potential_energy"].values) / joule
    agree("energies along the run", found, energies, max(1e-8, subject.accuracy))
    span = np.ptp(data["time"].values)
    true = energies - energies[0] - span * integral @ powers
    unresolved = span * np.abs((coefficients @ powers)[-3:]).max()
    told = data["energy_balance"].values / joule
    assert np.isfinite(told).all(), f"the energy balance is {told}"
    scale = 1 + np.abs(energies).max() + np.abs(data["kinetic_energy"].values / joule).max()
    error = np.abs(told - true).max() / scale
    assert error <= allowed + 10 * unresolved / scale + subject.accuracy, (
        f"the energy balance is told as {told[-1]:.3g} J, but it is {true[-1]:.3g} J "
        f"({error:.3g} relative)"
    )


# Refusals and endings


def dependent(subject: Subject, positions: np.ndarray) -> bool:
    """Tell whether the constraints of all joints are nearly dependent at a configuration, compared
    with home."""
    return least(subject, positions) < LOST * least(subject, subject.robot.home.positions)


def least(subject: Subject, positions: np.ndarray) -> float:
    """Return the singular value of the constraints' rows that leaves as many freedoms as the robot
    has."""
    still = np.zeros(len(subject.judged.rates))
    seen = Seen.of(subject, positions, still)
    A = seen.oracle.rows(seen.poses, seen.oracle._rest).A
    values = np.linalg.svd(A, compute_uv=False)
    rank = A.shape[1] - subject.robot.mobility
    return float(values[rank - 1]) if 0 < rank <= len(values) else 1.0


def weak_rates(subject: Subject, positions: np.ndarray, names: tuple[str, ...]) -> float:
    """Return the least part of the free motions that rates show, of the most that any rate shows of
    one."""
    seen = Seen.of(subject, positions, np.zeros(len(subject.judged.rates)))
    rows = seen.oracle.rows(seen.poses, seen.oracle._rest)
    every = rows.F @ pseudo_inverse(rows.A)[1]
    shown = every[[subject.judged.rates.index(name) for name in names]]
    if shown.shape[0] != shown.shape[1]:
        return 0.0
    return float(
        np.linalg.svd(shown, compute_uv=False).min(initial=1.0)
        / np.linalg.norm(every, axis=1).max(initial=1e-300)
    )
