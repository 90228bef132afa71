"""Collocation: the motion of a robot between two states as equations of its states at points of
time.

In each of N intervals of the time T the coordinates a and rates v are polynomials of degree d that
keep a' = v, v' = w at d points of Radau's, where the accelerations w are those of the robot
(`motion_points`) under forces u that are constant in the interval:

    sum_j C_ji a_j = (T / N) v_i,    sum_j C_ji v_j = (T / N) w_i,    i = 1 ... d

The order is 2 d - 1. Forces that are constant in intervals are what a sampled controller holds.
Unknowns are over sizes of their own, so that all are about one.

Source: Betts 2010, Practical Methods for Optimal Control, ch. 4; Hairer & Wanner 1996, IV.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.design.motion_points import Closing, MotionPoints
from linkwork.ipopt import Programme

DEGREE = 3
LEAST = 1e-4  # square of forces over their sizes, of a guess
SHORTEST = 1e-3  # duration that is tried, over that of the guess


class MotionGuess(NamedTuple):
    """Hold a motion on a mesh: its duration T [s], and, each column by column, q and (a, v) at the
    nodes, w at the points, u in the intervals."""

    T: float
    q: np.ndarray
    y: np.ndarray
    w: np.ndarray
    u: np.ndarray

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.u, self.y, self.w

    def lasting(self, T: float) -> MotionGuess:
        """Return the same way, gone in another time, with the same forces."""
        n, quicker = len(self.w), self.T / T
        y = np.vstack([self.y[:n], quicker * self.y[n:]])
        return self._replace(T=T, y=y, w=quicker**2 * self.w)


@dataclass(frozen=True, eq=False)
class MotionMesh:
    """Hold the mesh of a motion: nodes, DEGREE in each interval and the end, at which states are
    unknown, and points, DEGREE + 1 in each interval, the first at its begin, at which the robot is
    asked. The last point of an interval is at the node at which the next one begins."""

    intervals: int

    @cached_property
    def parts(self) -> np.ndarray:
        """Where in an interval its points are: 0, and Radau's up to 1."""
        return np.array([0.0, *ca.collocation_points(DEGREE, "radau")])

    @property
    def nodes(self) -> np.ndarray:
        """Times of all nodes over T."""
        inside = np.arange(self.intervals)[:, None] + self.parts[:-1]
        return np.append(inside.ravel() / self.intervals, 1.0)

    @property
    def times(self) -> np.ndarray:
        """Times of all points over T."""
        return ((np.arange(self.intervals)[:, None] + self.parts) / self.intervals).ravel()

    @property
    def places(self) -> np.ndarray:
        """The node of each point."""
        first = np.arange(self.intervals)[:, None] * DEGREE
        return (first + np.arange(DEGREE + 1)).ravel()

    @property
    def pieces(self) -> np.ndarray:
        """The interval of each point."""
        return np.repeat(np.arange(self.intervals), DEGREE + 1)

    def equations(self, a: ca.MX, v: ca.MX, w: ca.MX, T: ca.MX | float) -> list[ca.MX]:
        """Return what is zero along a motion with coordinates and rates at the nodes and
        accelerations at the points."""
        C, _, _ = ca.collocation_coeff(list(self.parts[1:]))
        slopes = ca.kron(ca.DM.eye(self.intervals), ca.sparsify(C))
        places = self.places.tolist()
        inner = [k for k in range(len(places)) if k % (DEGREE + 1)]
        h, own = T / self.intervals, [places[k] for k in inner]
        return [
            ca.mtimes(a[:, places], slopes) - h * v[:, own],
            ca.mtimes(v[:, places], slopes) - h * w[:, inner],
        ]


@dataclass(frozen=True, eq=False)
class MotionProgramme:
    """Hold the unknowns of a motion over their sizes: share of the guessed duration, none where it
    is held, u (actuators x intervals), y = (a, v) (2 n x nodes) and w (n x points); and what is
    asked of them, with its derivatives.

    ends: (a, v) at the start and at the end; own: sizes of a (n) and of u; quick: whether the
        duration is minimised, or else the effort
    """

    mesh: MotionMesh
    points: MotionPoints
    guess: MotionGuess
    ends: tuple[np.ndarray, np.ndarray]
    own: tuple[np.ndarray, np.ndarray]
    quick: bool

    @cached_property
    def sizes(self) -> np.ndarray:
        """Sizes of the numbers of a point: a, v, w, u."""
        (way, forces), T = self.own, self.guess.T
        return np.concatenate([way, way / T, way / T**2, forces])

    def split(self, parts: Sequence[np.ndarray], power: int) -> list[np.ndarray]:
        """Return u, y, w times a power of their sizes."""
        n = self.points.held
        own = self.sizes[3 * n :], self.sizes[: 2 * n], self.sizes[2 * n : 3 * n]
        return [part * size[:, None] ** power for part, size in zip(parts, own, strict=True)]

    @cached_property
    def parts(self) -> tuple[ca.MX, ...]:
        """Symbols share, u, y, w."""
        shapes = [(int(self.quick), 1), *(part.shape for part in self.guess.parts)]
        return tuple(ca.MX.sym("x", *shape) for shape in shapes)

    @cached_property
    def x(self) -> ca.MX:
        return ca.vertcat(*map(ca.vec, self.parts))

    @cached_property
    def start(self) -> np.ndarray:
        """The guess, as x."""
        flat = [part.ravel(order="F") for part in self.split(self.guess.parts, -1)]
        return np.concatenate([np.ones(int(self.quick)), *flat])

    @cached_property
    def at_points(self) -> ca.DM:
        """What x is multiplied by to be what the points are asked at (width x points, column by
        column)."""
        n, mesh = self.points.held, self.mesh
        begins = np.cumsum([part.numel() for part in self.parts])
        count, m = len(mesh.places), len(self.guess.u)
        columns = [
            begins[1] + 2 * n * mesh.places[:, None] + np.arange(2 * n),
            begins[2] + n * np.arange(count)[:, None] + np.arange(n),
            begins[0] + m * mesh.pieces[:, None] + np.arange(m),
        ]
        flat = np.hstack(columns).ravel()
        rows = np.arange(flat.size).tolist()
        values = ca.DM(np.tile(self.sizes, count))
        return ca.DM.triplet(rows, flat.tolist(), values, len(rows), int(begins[3]))

    @cached_property
    def closing(self) -> Closing:
        return Closing(self.points, self.guess.q)

    @cached_property
    def asked(self) -> tuple[ca.MX, ca.MX]:
        """q (nq) and (a, v, w, u) at the points."""
        n = self.points.held
        X = ca.reshape(ca.mtimes(self.at_points, self.x), self.points.width, -1)
        a = ca.diag(self.sizes[:n]) @ self.parts[2][:n, :]
        return self.closing(a)[:, self.mesh.places.tolist()], X

    @cached_property
    def along(self) -> ca.MX:
        """What is zero but for what the robot does: ends, and collocation."""
        n, (share, _, y, w) = self.points.held, self.parts
        T = share if share.numel() else 1.0
        size, (start, end) = self.sizes[: 2 * n], self.ends
        held = [y[:, 0] - ca.DM(start / size), y[:, -1] - ca.DM(end / size)]
        held += self.mesh.equations(y[:n, :], y[n:, :], w, T)
        return ca.vertcat(*map(ca.vec, held))

    @property
    def effort(self) -> ca.MX:
        """The mean of u'u, over what the actuators take at least or in the guess."""
        n, u = self.points.held, self.parts[1]
        size = max(float((self.guess.u**2).sum(0).mean()), LEAST * (self.own[1] ** 2).sum())
        return ca.sumsqr(ca.diag(self.sizes[3 * n :]) @ u) / u.shape[1] / size

    def programme(self) -> Programme:
        """Return the programme that IPOPT solves."""
        x, points, count = self.x, self.points, len(self.mesh.places)
        f = ca.sum1(self.parts[0]) if self.quick else self.effort
        # What holds along the motion, then at each point, and their slopes.
        q, X = self.asked
        value, slope, bend = (each.map(count) for each in points.functions)
        g = ca.vertcat(self.along, ca.vec(value(q, X)))
        blocks = ca.diagcat(*ca.horzsplit(slope(q, X), points.width))
        J = ca.vertcat(ca.jacobian(self.along, x), ca.mtimes(blocks, self.at_points))
        # The second derivative of all that multipliers weigh.
        weights, first = ca.MX.sym("weights", g.numel()), self.along.numel()
        of_f, none = ca.MX.sym("of_f"), ca.MX.sym("none", 0)
        alone = of_f * f + ca.dot(weights[:first], self.along)
        own = bend(q, X, ca.reshape(weights[first:], -1, count))
        blocks = ca.diagcat(*ca.horzsplit(own, points.width))
        H = ca.hessian(alone, x)[0] + ca.mtimes([self.at_points.T, blocks, self.at_points])
        slopes = (
            ca.Function("jac_g", [x, none], [g, J]),
            ca.Function("hess_lag", [x, none, of_f, weights], [ca.triu(H)]),
        )
        return Programme(x, f, g, self.start, self.bounds, self.g_bounds(g), slopes=slopes)

    @property
    def most(self) -> np.ndarray:
        """Limits of the actuators' forces."""
        return self.points.limits.of(self.points.robot.actuators)["force"]

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of x: of the share, and of the forces."""
        n, (share, u, *rest) = self.points.held, self.parts
        most = np.tile(self.most / self.sizes[3 * n :], u.shape[1])
        none = np.full(sum(part.numel() for part in rest), np.inf)
        least, longest = [SHORTEST] * share.numel(), [np.inf] * share.numel()
        return np.concatenate([least, -most, -none]), np.concatenate([longest, most, none])

    def g_bounds(self, g: ca.MX) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of g: margins are not negative, all else is zero."""
        first, count = self.along.numel(), len(self.mesh.places)
        rows = np.zeros((count, (g.numel() - first) // count))
        rows[:, self.points.held :] = np.inf
        return np.zeros(g.numel()), np.concatenate([np.zeros(first), rows.ravel()])

    def motion(self, x: np.ndarray) -> MotionGuess:
        """Return the motion of unknowns, with forces within their limits."""
        share, *flat = np.split(x, np.cumsum([part.numel() for part in self.parts])[:-1])
        own = [
            part.reshape(like.shape, order="F")
            for part, like in zip(flat, self.guess.parts, strict=True)
        ]
        u, y, w = self.split(own, 1)
        T, most = self.guess.T * (share.item() if self.quick else 1.0), self.most[:, None]
        return MotionGuess(T, self.closing.q.T, y, w, np.clip(u, -most, most))
