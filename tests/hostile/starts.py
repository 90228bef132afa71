"""Where hostile cases start: at home, in motion, whole turns away, at poses where the robot's own
rates are singular.

Starts are found by singular values of the robot's constraint Jacobian Phi, and handed to the robot
by names, as a user does it. The judges trust none of this: they see joint coordinates and rates
only, and measure for themselves.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from math import pi

import numpy as np

import linkwork as lw

from tests.hostile.changes import slides
from tests.hostile.mechanisms import Subject
from tests.oracle import pairs
from tests.oracle.lagrange import pivoted

KINDS = ("home", "moving", "turned", "singular")
WELL = 1e-3  # rates determine the motion where their least part of it is more than this
WAYS, STEP, STEPS, HALVINGS = 5, 0.05, 120, 45
NOISE, CLOSED = 1e-10, 1e-9


class NoStart(Exception):
    """Tell that a mechanism has no start of this kind."""


@dataclass(frozen=True)
class Start:
    """Hold a closed configuration q of the tree with the tree's rates w, in the units of the
    described mechanism.

    turns: whole turns to add, by joint coordinate
    """

    q: np.ndarray
    w: np.ndarray
    turns: np.ndarray

    def positions(self, subject: Subject) -> np.ndarray:
        """Return the coordinates of all joints."""
        return subject.robot.kernel("positions")(self.q)[0] + 2 * pi * self.turns

    def state(self, subject: Subject, *, other_chart: bool = False) -> lw.State:
        """Return the robot's state, made of its joint coordinates and as many rates as it has
        freedoms, by name.

        These are the robot's own rates, or others where its own are singular or if others are asked
        for.
        """
        robot, positions = subject.robot, self.positions(subject)
        names = chart(subject, self, other_chart)
        rates = {name: self.w[robot.equations.tree.rates.index(name)] for name in names}
        if names == robot.independent:
            return robot.state(positions, rates)
        return robot.in_chart(robot.state(positions), names).with_rates(rates)


def start(subject: Subject, kind: str, seed: int) -> Start:
    """Return a start of a kind; the seed decides on everything that is free."""
    rng, robot = np.random.default_rng(seed), subject.robot
    still = np.zeros(len(robot.coordinates))
    if kind == "home":
        return Start(robot.home.q, np.zeros(robot.equations.nv), still)
    if kind == "singular":
        q = singular(subject)
        return Start(q, motions(subject, q) @ rng.normal(size=robot.mobility), still)
    q = scattered(subject, rng)
    turns = (
        rng.integers(-3, 4, len(robot.coordinates)) * turning(subject)
        if kind == "turned"
        else still
    )
    return Start(q, motions(subject, q) @ rng.normal(size=robot.mobility), turns)


def turning(subject: Subject) -> np.ndarray:
    """Tell which coordinates are angles that may be whole turns away: those of no screw and no
    gear."""
    mechanism = subject.described
    geared = {label for gear in mechanism.gears.values() for label in gear.ratios}
    pairs_ = mechanism.pairs.items()
    angles = {
        label for name, joint in pairs_ if joint.type != "screw" for label in joint.angles(name)
    }
    if not angles - geared:
        raise NoStart("there is no angle to turn")
    return np.array([label in angles - geared for label in mechanism.coordinates])


def scattered(subject: Subject, rng: np.random.Generator) -> np.ndarray:
    """Return a closed configuration near home."""
    q = subject.robot.home.q
    direction = rng.normal(size=subject.robot.mobility)
    for part in (0.2, 0.1, 0.05, 0.02):
        found = closed(subject, moved(subject, q, part * motions(subject, q) @ direction))
        if found is not None:
            return found
    raise NoStart("nothing near home can be assembled")


@cache
def singular(subject: Subject) -> np.ndarray:
    """Return a configuration where the determinant of the robot's own rates passes zero on a motion
    from home."""
    for way in range(WAYS):
        with suppress(NoStart):
            return singular_along(subject, np.random.default_rng(way))
    raise NoStart("no singular pose is near")


def singular_along(subject: Subject, rng: np.random.Generator) -> np.ndarray:
    """Follow a motion from home until the determinant of the robot's own rates passes zero, and
    halve the last step."""
    q = subject.robot.home.q
    N = motions(subject, q)
    ahead, last = N @ rng.normal(size=N.shape[1]), 0.0
    for _ in range(STEPS):
        ahead = N @ np.linalg.lstsq(N, ahead, rcond=None)[0]
        step = STEP * ahead / max(np.linalg.norm(ahead / units(subject)), 1e-300)
        there, M, found = determined(subject, q, N, step)
        if found * last < 0:
            return between(subject, q, N, step, last)
        q, N, last = there, M, found
    raise NoStart("there is none on this way")


def between(
    subject: Subject, q: np.ndarray, N: np.ndarray, step: np.ndarray, first: float
) -> np.ndarray:
    """Halve a step until the determinant of the rates vanishes."""
    low, high, there = 0.0, 1.0, q
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        there, _, found = determined(subject, q, N, middle * step)
        low, high = (middle, high) if found * first > 0 else (low, middle)
    return there


def determined(
    subject: Subject, q: np.ndarray, N: np.ndarray, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the configuration a step ahead, its free motions turned as N is, and the determinant
    of the robot's rates."""
    there = closed(subject, moved(subject, q, step))
    if there is None:
        raise NoStart("the way leads out of reach")
    M, unit = motions(subject, there), units(subject)[:, None]
    U, _, Vt = np.linalg.svd((M / unit).T @ (N / unit))
    M = M @ (U @ Vt)
    return (
        there,
        M,
        float(np.linalg.det((M / unit)[list(subject.robot.equations.chart.independent)])),
    )


def chart(subject: Subject, start: Start, other: bool) -> tuple[str, ...]:
    """Return the robot's own rates, or, where they are singular or if others are asked for, the
    best others."""
    robot = subject.robot
    N = motions(subject, start.q) / units(subject)[:, None]
    tree, own = robot.equations.tree.rates, list(robot.equations.chart.independent)
    if not other and share(N[own]) > WELL:
        return robot.independent
    rest = [i for i in range(len(tree)) if i not in own]
    for first in (rest, range(len(tree))):
        _, pivots = pivoted(N[list(first)].T) if len(first) >= robot.mobility else (None, [])
        chosen = [first[i] for i in pivots[: robot.mobility]]
        if len(chosen) == robot.mobility and share(N[chosen]) > 0.1:
            return tuple(tree[i] for i in chosen)
    raise NoStart("no rates of this robot determine its motion well there")


def share(rows: np.ndarray) -> float:
    """Return the least part of the free motions that some rates show: the smallest singular value
    of their rows of N."""
    return (
        float(np.linalg.svd(rows, compute_uv=False).min(initial=1.0))
        if rows.shape[0] == rows.shape[1]
        else 0.0
    )


# Closed configurations, by singular values


def jacobian(subject: Subject, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Phi over the units of its columns, each row over its length, and these lengths; noise
    is no row."""
    Phi = subject.robot.chart.constraint_jacobian(q) * units(subject)
    lengths = np.linalg.norm(Phi, axis=1)
    lengths = np.where(lengths > NOISE * lengths.max(initial=0.0), lengths, np.inf)
    return Phi / lengths[:, None], lengths


def motions(subject: Subject, q: np.ndarray) -> np.ndarray:
    """Return the free motions N (nv x n) of the tree's rates, orthonormal in their units: those of
    least Phi w."""
    unit, (Phi, _) = units(subject), jacobian(subject, q)
    every = np.linalg.svd(np.vstack([Phi, np.zeros((unit.size, unit.size))]))[2]
    return unit[:, None] * every[unit.size - subject.robot.mobility :].T


def closed(subject: Subject, q: np.ndarray) -> np.ndarray | None:
    """Close the loops by Gauss and Newton's method, least steps, to rounding; None where they do
    not close."""
    chart, rank = subject.robot.chart, subject.robot.equations.nv - subject.robot.mobility
    last = np.inf
    for _ in range(30 if rank else 0):
        Phi, lengths = jacobian(subject, q)
        U, s, Vt = np.linalg.svd(Phi, full_matrices=False)
        step = -(Vt[:rank].T / s[:rank]) @ U[:, :rank].T @ (chart.residuals(q) / lengths)
        size = np.abs(step).max()
        if size < CLOSED and size >= last / 2:
            return q
        q, last = moved(subject, q, units(subject) * step * min(1.0, 0.5 / max(size, 1e-300))), size
    return q if last < CLOSED or not rank else None


def moved(subject: Subject, q: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return q after a step of the tree's rates; free turns are turned by the rotation vector."""
    tree, q = subject.robot.equations.tree, q.copy()
    places = {label: i for i, label in enumerate(tree.coordinates)}
    for i, rate in enumerate(tree.rates):
        if rate in places:
            q[places[rate]] += step[i]
        elif rate.endswith(".wx"):
            name = rate.removesuffix(".wx")
            turn = [places[f"{name}.{part}"] for part in ("qw", "qx", "qy", "qz")]
            q[turn] = product(pairs.quaternion(pairs.exponential(step[i : i + 3])), q[turn])
    return q


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the quaternion product a b."""
    return np.array(
        [a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))]
    )


@cache
def units(subject: Subject) -> np.ndarray:
    """Return the units of the tree's rates: the described mechanism's length where they are
    slides."""
    own = slides(subject.described)
    rates = subject.robot.equations.tree.rates
    return np.array([subject.length if rate in own else 1.0 for rate in rates])
