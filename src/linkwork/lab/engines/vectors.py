"""A tree's coordinates and rates in an engine's own order and axes, and the forces that act in its
joints.

An engine's q and v differ from the joints' coordinates and rates in order and in the rates of a
ball, which are the angular velocity in the axes of the body that it carries:

    v = R' w,   v' = R' w',   tau = R' f
    R -> R',    v = -w,       tau = -f     for a ball that leads backwards

where w is the angular velocity of F2 relative to F1 in F1's axes, R = R_12 and f the torque
conjugate to w.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.lab.engines.joints import Step
from linkwork.lab.engines.motion import applied, places
from linkwork.mechanism import Friction, Mechanism, Spring
from linkwork.mechanism.effects import Effects

Quaternion = tuple[int, int, int, int]


@dataclass(frozen=True)
class StepPlaces:
    """Say where a step's coordinates are in q and its rates in v."""

    step: Step
    q: slice
    v: slice


@dataclass(frozen=True)
class Drives:
    """Say which entries of v are driven, and which balls are among them."""

    places: np.ndarray
    balls: tuple[StepPlaces, ...]


@dataclass(frozen=True)
class Vectors:
    """Translate between all joints' coordinates and rates and an engine's q and v; leading
    dimensions are kept.

    Attributes:
        mechanism: names the joints' coordinates and rates.
        order: places of w, x, y, z in the engine's quaternions.
        spans: the steps in the engine's order.
    """

    mechanism: Mechanism
    order: Quaternion
    spans: tuple[StepPlaces, ...]

    @classmethod
    def of(cls, mechanism: Mechanism, steps: Sequence[Step], order: Quaternion) -> Vectors:
        """Lay out q and v for these steps."""
        spans, nq, nv = [], 0, 0
        for step in steps:
            ends = nq + len(step.coordinates), nv + len(step.rates)
            spans.append(StepPlaces(step, slice(nq, ends[0]), slice(nv, ends[1])))
            nq, nv = ends
        return cls(mechanism, order, tuple(spans))

    @cached_property
    def balls(self) -> tuple[StepPlaces, ...]:
        """Return the spans of balls."""
        return tuple(span for span in self.spans if span.step.motion == "ball")

    @cached_property
    def scalars(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the places in q and in v of all turns and slides."""
        single = [span for span in self.spans if span.step.motion != "ball"]
        return np.array([span.q.start for span in single], int), np.array(
            [span.v.start for span in single], int
        )

    @cached_property
    def columns(self) -> np.ndarray:
        """Return for each entry of q its place among all joint coordinates."""
        place = places(self.mechanism.coordinates)
        labels = [
            span.step.coordinates[part]
            for span in self.spans
            for part in (np.argsort(self.order) if span.step.motion == "ball" else (0,))
        ]
        return np.array([place[label] for label in labels], int)

    @cached_property
    def rate_columns(self) -> np.ndarray:
        """Return for each entry of v its place among all joint rates."""
        place = places(self.mechanism.rates)
        return np.array([place[label] for span in self.spans for label in span.step.rates], int)

    @cached_property
    def _factors(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the entries of q and v over the joints' coordinates and rates."""
        q, v = np.ones(len(self.columns)), np.ones(len(self.rate_columns))
        for span in self.spans:
            if span.step.motion != "ball":
                q[span.q] = v[span.v] = span.step.factor
            elif span.step.backwards:
                q[span.q.start + np.array(self.order[1:])] = v[span.v] = -1.0
        return q, v

    @cached_property
    def _leading(self) -> tuple[np.ndarray, np.ndarray]:
        """Tell which entries of q and v are the joints' own: all but the slides of split screws."""
        follow = [span for span in self.spans if span.step.follows]
        q, v = np.ones(len(self.columns), bool), np.ones(len(self.rate_columns), bool)
        q[[span.q.start for span in follow]] = v[[span.v.start for span in follow]] = False
        return q, v

    def drives(self, rates: Sequence[str]) -> Drives:
        """Return where these joint rates are in v."""
        place = places(self.mechanism.rates)
        own = np.where(self._leading[1], self.rate_columns, -1)
        found = np.array([np.flatnonzero(own == place[name])[0] for name in rates], int)
        return Drives(
            found, tuple(ball for ball in self.balls if set(rates) & set(ball.step.rates))
        )

    def into(self, positions: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return q and v of the joints' coordinates (..., nq) and rates (..., nv)."""
        q = positions[..., self.columns] * self._factors[0]
        v = rates[..., self.rate_columns] * self._factors[1]
        for ball in self.balls:
            q[..., ball.q] /= np.linalg.norm(q[..., ball.q], axis=-1, keepdims=True)
            if not ball.step.backwards:
                v[..., ball.v] = applied(
                    np.swapaxes(self.rotation(q, ball), -1, -2), v[..., ball.v]
                )
        return q, v

    def out_of(
        self, q: np.ndarray, v: np.ndarray, a: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return all joints' coordinates, rates and accelerations from q, v, v'; those that q does
        not hold are zero."""
        leading, moving = self._leading
        positions = np.zeros((*q.shape[:-1], len(self.mechanism.coordinates)))
        positions[..., self.columns[leading]] = (q * self._factors[0])[..., leading]
        found = []
        for values in (v, a):
            turned = values * self._factors[1]
            for ball in self.balls:
                if not ball.step.backwards:
                    turned[..., ball.v] = applied(self.rotation(q, ball), values[..., ball.v])
            whole = np.zeros((*q.shape[:-1], len(self.mechanism.rates)))
            whole[..., self.rate_columns[moving]] = turned[..., moving]
            found.append(whole)
        return positions, found[0], found[1]

    def forces(self, q: np.ndarray, drives: Drives, forces: np.ndarray) -> np.ndarray:
        """Return tau (nv,) of forces conjugate to the driven rates."""
        tau = np.zeros(len(self.rate_columns))
        tau[drives.places] = forces
        for ball in drives.balls:
            tau[ball.v] = (
                -tau[ball.v] if ball.step.backwards else tau[ball.v] @ self.rotation(q, ball)
            )
        return tau

    def rotation(self, q: np.ndarray, ball: StepPlaces) -> np.ndarray:
        """Return the rotation matrices of a ball's quaternion in q, as the engine sees it."""
        parts = q[..., ball.q][..., list(self.order)]
        R = Rotation.from_quat(parts.reshape(-1, 4), scalar_first=True).as_matrix()
        return R.reshape(*q.shape[:-1], 3, 3)


@dataclass(frozen=True)
class JointForces:
    """Compute what springs, dampers and friction do in the joints of a tree, in an engine's
    vectors.

    tau = -k (q - rest) - (c + F / sqrt(v^2 + r^2)) v

    A ball's q is its rotation vector and v^2 = |v|^2; c is the viscous friction and the damping
    together. The form is the same for a ball seen from its other side or in other axes.

    Attributes:
        rotors: the rotor inertia that belongs to each entry of v, (nv,).
        at, moving: the places in q and v of the turns and slides on which something acts.
        constants: k, rest, c, F, r of these, (5, m).
        balls: the balls on which something acts, with their constants.
    """

    vectors: Vectors
    rotors: np.ndarray
    at: np.ndarray
    moving: np.ndarray
    constants: np.ndarray
    balls: tuple[tuple[StepPlaces, tuple[float, ...]], ...]

    @classmethod
    def of(cls, vectors: Vectors) -> JointForces:
        """Collect the effects of the joints that the engine's tree holds."""
        acting = effects(vectors.mechanism)
        rotors = np.zeros(len(vectors.rate_columns))
        single, turning = [], []
        for span in vectors.spans:
            own = acting[span.step.rates[0]]
            if not span.step.follows:
                rotors[span.v] = own.rotor
                if any(own.loads[:-1]):
                    pushed = turning if span.step.motion == "ball" else single
                    pushed.append((span, constants_of(own.friction, own.spring)))
        return cls(
            vectors=vectors,
            rotors=rotors,
            at=np.array([span.q.start for span, _ in single], int),
            moving=np.array([span.v.start for span, _ in single], int),
            constants=np.reshape([numbers for _, numbers in single], (-1, 5)).T,
            balls=tuple(turning),
        )

    def add_to(self, tau: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
        """Add the forces to tau (nv,)."""
        if len(self.at):
            k, rest, c, F, r = self.constants
            w = v[self.moving]
            tau[self.moving] -= k * (q[self.at] - rest) + (c + F / np.sqrt(w * w + r * r)) * w
        for ball, (k, _, c, F, r) in self.balls:
            turn, w = Rotation.from_matrix(self.vectors.rotation(q, ball)).as_rotvec(), v[ball.v]
            tau[ball.v] -= k * turn + (c + F / np.sqrt(w @ w + r * r)) * w


def constants_of(friction: Friction, spring: Spring) -> tuple[float, ...]:
    """Return k, rest, c, F, r."""
    damping = friction.viscous + spring.damping
    return spring.stiffness, spring.rest, damping, friction.coulomb, friction.coulomb_rate


def effects(mechanism: Mechanism) -> Mapping[str, Effects]:
    """Return what acts in each freedom by its (first) rate."""
    pairs = mechanism.pairs.items()
    return {part.rates[0]: part.effects for name, joint in pairs for part in joint.parts(name)}
