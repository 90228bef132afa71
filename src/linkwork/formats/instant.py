"""A mechanism at one instant, in plain numbers: its generalised inertia in the rates of a spanning
tree, and what loops and gears hold of them.

    M = sum_i J_i' diag(I_i, m_i 1) J_i + rotors + what moves along combinations,    C w = 0

J_i: rates -> [omega; v of the mass centre]; each body about its own, so that a gram at the end of a
long arm is not lost in rounding. Loops count as they stand: they need not be closed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from linkwork.equations import gears
from linkwork.equations.algebra import rotation_matrix, turn_matrix
from linkwork.equations.joints import complete, motions_of
from linkwork.equations.reference import Pose, across
from linkwork.equations.topology import span
from linkwork.formats import poses
from linkwork.mechanism import GROUND, Combination, Frame, Mechanism
from linkwork.mechanism.joints import PairJoint

ROUNDED = 1e-12  # of the velocities between two bodies


@dataclass(frozen=True)
class Mover:
    """Say how the rates on a body's way to ground move it.

    places: of these rates in w
    turns, slides, points: in ground's axes (k, 3); a unit rate gives omega = turn and, of a point x
        of the body, v = slide + turn x (x - point)
    """

    places: np.ndarray
    turns: np.ndarray
    slides: np.ndarray
    points: np.ndarray

    def velocities(self, x: np.ndarray) -> np.ndarray:
        """Return v of a point of the body by each rate (k, 3)."""
        return self.slides + np.cross(self.turns, x - self.points)

    def twists(self, x: np.ndarray) -> np.ndarray:
        """Return [omega; v] of a point of the body by each rate (k, 6)."""
        return np.concatenate([self.turns, self.velocities(x)], axis=1)

    def ahead(self, more: Mover) -> Mover:
        """Return how a body moves that has further rates behind these."""
        ends = zip(vars(self).values(), vars(more).values(), strict=True)
        return Mover(*(np.concatenate(pair) for pair in ends))


STANDING = Mover(np.zeros(0, int), *(np.zeros((0, 3)) for _ in range(3)))


@dataclass(frozen=True)
class Instant:
    """Hold a mechanism's spanning tree at one instant.

    q: joint coordinates by name
    rates: names of w, those of joints that are not in the description included
    joints: that of each rate
    at, movers: pose in ground, and what moves it, of each body
    closing: the joints that close loops
    """

    mechanism: Mechanism
    q: Mapping[str, float]
    rates: tuple[str, ...]
    joints: tuple[str, ...]
    at: Mapping[str, Pose]
    movers: Mapping[str, Mover]
    closing: Mapping[str, PairJoint]

    @classmethod
    def of(cls, mechanism: Mechanism, q: Mapping[str, float]) -> Instant:
        """Place a mechanism at joint coordinates, by name; those that are left out are zero."""
        topology = span(mechanism)
        rates: list[str] = []
        owners: list[str] = []
        at: dict[str, Pose] = {GROUND: (np.zeros(3), np.eye(3))}
        movers = {GROUND: STANDING}
        for branch in topology.branches:
            joint = topology.joints[branch.joint]
            own = coordinates_of(joint, branch.joint, q)
            at[branch.body] = across(joint, own, at[branch.parent], backwards=branch.reversed)
            moved = motions(joint, own, at[joint.connects[0]], len(rates))
            if branch.reversed:
                moved = replace(moved, turns=-moved.turns, slides=-moved.slides)
            movers[branch.body] = movers[branch.parent].ahead(moved)
            rates += joint.rates(branch.joint)
            owners += [branch.joint] * len(moved.places)
        return cls(mechanism, q, tuple(rates), tuple(owners), at, movers, topology.closing)

    def inertia(self) -> np.ndarray:
        """Return M (nw, nw)."""
        mechanism = self.mechanism
        M = np.zeros((len(self.rates),) * 2)
        for name, body in mechanism.bodies.items():
            p, R = self.at[name]
            mover = self.movers[name]
            v = mover.velocities(p + R @ np.array(body.centre_of_mass))
            inertia = R @ body.inertia.tensor() @ R.T
            own = mover.turns @ inertia @ mover.turns.T + float(body.mass) * v @ v.T
            M[np.ix_(mover.places, mover.places)] += own
        # What moves with single rates, and along sums of them.
        moving = [
            ({label: 1.0}, part.effects.rotor)
            for name, joint in mechanism.pairs.items()
            for part in joint.parts(name)
            for label in part.rates
        ]
        lines = mechanism.transmissions.values()
        moving += [(line.ratios, line.inertia) for line in lines if isinstance(line, Combination)]
        for ratios, inertia in moving:
            if inertia:
                J = self._sum(ratios)
                own = np.flatnonzero(J)
                M[np.ix_(own, own)] += float(inertia) * np.outer(J[own], J[own])
        return M

    def held(self) -> np.ndarray:
        """Return C (rows, nw) of loops and gears, but those that hold lengths of transmissions."""
        loops = [row for name in self.closing for row in self._held_by(name)]
        geared = self.mechanism.gears.values()
        labels = self.mechanism.coordinates
        held = [
            self._sum(
                {
                    label: gears.polynomial(gear.polynomial(label), self._position(label))[1]
                    for label in gear.ratios
                }
            )
            for gear in geared
            if gear.ratios.keys() <= {*labels}
        ]
        return np.array([*loops, *held]).reshape(-1, len(self.rates))

    def _sum(self, ratios: Mapping[str, float]) -> np.ndarray:
        """Return J (nw) of a sum of joint rates, times their ratios."""
        J = np.zeros(len(self.rates))
        for label, ratio in ratios.items():
            if label in self._places:
                J[self._places[label]] += float(ratio)
            else:
                J += float(ratio) * self._closing_rates[label]
        return J

    def _position(self, label: str) -> float:
        return float(self.q.get(label, 0.0))

    @cached_property
    def _places(self) -> dict[str, int]:
        return {label: k for k, label in enumerate(self.rates)}

    @cached_property
    def _closing_rates(self) -> dict[str, np.ndarray]:
        """The rates of joints that close loops, as sums of the tree's."""
        found: dict[str, np.ndarray] = {}
        for name, joint in self.closing.items():
            S, between = self._between(name)
            found |= dict(zip(joint.rates(name), np.linalg.pinv(S) @ between, strict=True))
        return found

    def _between(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return [omega; v] of the second body of a joint against the first, at the first frame's
        origin: by each rate of the joint (6, k), and of the tree (6, nw)."""
        joint = self.closing[name]
        first, second = joint.connects
        x, _ = self._end(first, joint.frames[0])
        own = motions(joint, coordinates_of(joint, name, self.q), self.at[first], 0)
        between = np.zeros((6, len(self.rates)))
        for body, sign in ((second, 1.0), (first, -1.0)):
            mover = self.movers[body]
            between[:, mover.places] += sign * mover.twists(x).T
        return own.twists(x).T, between

    def _held_by(self, name: str) -> np.ndarray:
        """Return C of a joint that closes a loop: a rod's length, or what its motions do not
        span."""
        joint = self.closing[name]
        if complete(joint):
            S, between = self._between(name)
            rows = between - S @ (np.linalg.pinv(S) @ between)
            return rows[np.abs(rows).max(axis=1) > ROUNDED * np.abs(between).max()]
        (x1, x2), (one, two) = zip(*map(self._end, joint.connects, joint.frames), strict=True)
        row = np.zeros((1, len(self.rates)))
        row[0, two.places] += two.velocities(x2) @ (x2 - x1)
        row[0, one.places] -= one.velocities(x1) @ (x2 - x1)
        return row

    def _end(self, body: str, frame: Frame) -> tuple[np.ndarray, Mover]:
        """Return where a joint's frame on a body stands, and what moves the body."""
        p, R = self.at[body]
        return p + R @ np.array(frame.position), self.movers[body]


def coordinates_of(joint: PairJoint, name: str, q: Mapping[str, float]) -> np.ndarray:
    """Return a joint's own coordinates; a quaternion that is left out is no turn."""
    return np.array([q.get(c, float(c.endswith(".qw"))) for c in joint.coordinates(name)])


def motions(joint: PairJoint, q: np.ndarray, first: Pose, start: int) -> Mover:
    """Return how a joint's rates, from a place in w on, move its second body against the first, in
    ground's axes; first: the first body's pose."""
    frame, (p, R) = joint.frames[0], first
    p, R = p + R @ np.array(frame.position), R @ rotation_matrix(frame.orientation)
    columns, left = [], list(q)
    for motion in motions_of(joint):
        own, left = left[: motion.coordinates], left[motion.coordinates :]
        if motion.ball:
            columns += [(axis, np.zeros(3), p) for axis in R.T]
            R = R @ poses.from_quaternion(*own)
        else:
            columns.append((R @ motion.turn, R @ motion.slide, p))
            p = p + R @ motion.slide * own[0]
            R = R @ turn_matrix(motion.turn, own[0])
    parts = np.array(columns).reshape(-1, 3, 3).transpose(1, 0, 2)
    return Mover(np.arange(start, start + len(columns)), *parts)
