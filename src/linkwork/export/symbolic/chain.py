"""Bodies placed along the spanning tree, in closed form.

A place moves from frame to frame: by constant vectors and rotations, and by the motions of joints.
Its columns say what unit rates do to it, in its own axes:

    omega = sum omega_j q_j',   v = sum v_j q_j'        each turned along and carried by omega x r

so that what lies inward of both of two columns leaves no trace in their products. A constant
rotation waits until an axis is met that it does not turn; about a parallel axis it is added to the
angle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from linkwork.equations.joints import ElementaryMotion, motions_of
from linkwork.equations.topology import Branch, Topology
from linkwork.errors import LinkworkError
from linkwork.export.symbolic.dimensions import MASS_CENTRE, BodyPoint, Dimensions
from linkwork.export.symbolic.exact import exact_angle, exact_matrix, exact_vector
from linkwork.export.symbolic.trig import (
    ONE,
    ZERO,
    Angle,
    Matrix,
    Trig,
    Vector,
    applied,
    chained,
    cosine,
    cross,
    plus,
    sine,
    symbol,
    times,
    transposed,
)
from linkwork.mechanism import GROUND, Mechanism, PairJoint

PARALLEL = 1e-12  # largest difference of unit vectors that are one
NOWHERE: Vector = (ZERO, ZERO, ZERO)
UPRIGHT: Matrix = ((ONE, ZERO, ZERO), (ZERO, ONE, ZERO), (ZERO, ZERO, ONE))


@dataclass(frozen=True)
class SymbolicFrame:
    """Hold a frame on its way outward.

    R, p: orientation and origin in the ground's axes; columns: what unit rates do, in its axes
    waiting: constant rotation that is still to come; axis: of the last turn, with its group
    outset: the constant orientation before the first turn
    angle: of a plane's: signs of its coordinates, and what is added [rad]
    """

    R: Matrix = UPRIGHT
    p: Vector = NOWHERE
    columns: Mapping[str, tuple[Vector, Vector]] = field(default_factory=dict)
    waiting: np.ndarray = field(default_factory=lambda: np.eye(3))
    axis: tuple[int, np.ndarray] | None = None
    outset: np.ndarray = field(default_factory=lambda: np.eye(3))
    angle: tuple[Mapping[str, int], float] = field(default_factory=lambda: ({}, 0.0))

    def moved(self, d: Vector) -> SymbolicFrame:
        """Return the frame moved by a vector in its axes; what waits does not turn it."""
        columns = {
            name: (omega, plus(v, cross(omega, d))) for name, (omega, v) in self.columns.items()
        }
        return replace(self, p=plus(self.p, applied(self.R, d)), columns=columns)

    def turned(self, R: np.ndarray) -> SymbolicFrame:
        """Return the frame turned by a constant rotation, which waits."""
        return replace(self, waiting=self.waiting @ R)

    def settled(self) -> SymbolicFrame:
        """Return the frame in the axes that waited."""
        if np.array_equal(self.waiting, np.eye(3)):
            return self
        return replace(
            self.rotated(exact_matrix(self.waiting)),
            waiting=np.eye(3),
            axis=None if self.axis is None else (self.axis[0], self.waiting.T @ self.axis[1]),
            outset=self.outset @ self.waiting if self.axis is None else self.outset,
        )

    def rotated(self, R: Matrix) -> SymbolicFrame:
        """Return the frame in axes that R turns."""
        back = transposed(R)
        columns = {
            name: (applied(back, omega), applied(back, v))
            for name, (omega, v) in self.columns.items()
        }
        return replace(self, R=chained(self.R, R), columns=columns)

    def with_column(self, name: str, omega: Vector, v: Vector) -> SymbolicFrame:
        """Return the frame with what a unit rate does to it added."""
        own = self.columns.get(name, (NOWHERE, NOWHERE))
        column = plus(own[0], omega), plus(own[1], v)
        return replace(self, columns={**self.columns, name: column})


@dataclass
class Chain:
    """Place bodies and joints' frames, and remember angles.

    groups: axes of turns next to ground, by group; angles: constants that are added to coordinates
    bodies: the frame of each body that its joint of the tree leads to, and where that is on it
    """

    mechanism: Mechanism
    topology: Topology
    dimensions: Dimensions
    flat: bool
    groups: dict[int, np.ndarray | None] = field(default_factory=dict)
    angles: dict[str, tuple[Angle, Trig]] = field(default_factory=dict)
    bodies: dict[str, tuple[SymbolicFrame, BodyPoint | None]] = field(
        default_factory=lambda: {GROUND: (SymbolicFrame(), None)}
    )

    def grow(self) -> None:
        """Place all bodies, outward."""
        for branch in self.topology.branches:
            self.bodies[branch.body] = self.behind(branch, self.bodies[branch.parent])

    def behind(
        self, branch: Branch, parent: tuple[SymbolicFrame, BodyPoint | None]
    ) -> tuple[SymbolicFrame, BodyPoint | None]:
        """Return the frame behind a joint of the tree."""
        joint = self.topology.joints[branch.joint]
        if branch.joint not in self.mechanism.pairs:
            raise LinkworkError(
                f"{branch.body} floats, and its turns have no closed form in angles; "
                "equations are printed of mechanisms whose joints turn and slide about and along "
                "axes"
            )
        near, far = (1, 0) if branch.reversed else (0, 1)
        at = self.to(branch.parent, parent, BodyPoint(branch.joint, near))
        return self.across(at, branch.joint, joint, far), BodyPoint(branch.joint, far)

    def to(
        self, body: str, start: tuple[SymbolicFrame, BodyPoint | None], end: BodyPoint
    ) -> SymbolicFrame:
        """Return the frame of another place of a body."""
        frame, at = start
        turn = np.eye(3) if at is None else self.dimensions.axes(at).T
        axes = frame.waiting @ turn
        d = self.dimensions.between(body, at, end, axes, self.flat)
        return frame.moved(d).turned(turn @ self.dimensions.axes(end))

    def across(self, frame: SymbolicFrame, name: str, joint: PairJoint, far: int) -> SymbolicFrame:
        """Return the frame on the other side of a joint."""
        motions = list(zip(motions_of(joint), joint.coordinates(name), strict=False))
        if any(motion.what == "ball" for motion, _ in motions):
            raise LinkworkError(
                f"joint {name!r} turns freely, by a quaternion, which has no closed form in angles;"
                " equations are printed of mechanisms whose tree turns and slides about and along "
                "axes: make it a universal and a revolute joint"
            )
        for motion, label in motions if far else reversed(motions):
            frame = self.stepped(frame, motion if far else motion.reversed(), label, joint, name)
        return frame

    def stepped(
        self,
        frame: SymbolicFrame,
        motion: ElementaryMotion,
        label: str,
        joint: PairJoint,
        name: str,
    ) -> SymbolicFrame:
        """Return the frame behind one motion."""
        q = symbol(f"q:{label}")
        if motion.what == "slide":
            along = exact_vector(frame.waiting @ np.asarray(motion.slide, float))
            return frame.moved(times(along, q)).with_column(label, NOWHERE, along)
        frame = self.about(frame, motion.turn, label)
        if motion.what == "screw":
            pitch = self.dimensions.pitch(name)
            along = times(exact_vector(frame.waiting @ np.asarray(motion.turn)), pitch)
            frame = frame.moved(times(along, q)).with_column(label, NOWHERE, along)
        return frame

    def about(self, frame: SymbolicFrame, axis: np.ndarray, label: str) -> SymbolicFrame:
        """Return the frame turned about an axis by a coordinate."""
        # What waits is added to the angle, or stays behind it, or turns the axes first.
        phase, along = 0.0, frame.waiting @ axis
        if np.abs(along - axis).max() <= PARALLEL:
            phase, base = turn_about(frame.waiting, axis), replace(frame, waiting=np.eye(3))
        elif np.abs(along).max() > 1 - PARALLEL:
            base = frame
        else:
            base, along = frame.settled(), axis
        angle = self.angle_of(base, along, label, phase)
        # Rot(a, x) = a a' + cos x (1 - a a') + sin x [a x]
        a, c, s = exact_vector(along), cosine(angle), sine(angle)
        crossed = (
            (ZERO, -a[2], a[1]),
            (a[2], ZERO, -a[0]),
            (-a[1], a[0], ZERO),
        )
        rows = [
            tuple(
                a[i] * a[j] + c * ((ONE if i == j else ZERO) - a[i] * a[j]) + s * crossed[i][j]
                for j in range(3)
            )
            for i in range(3)
        ]
        turned = base.rotated((rows[0], rows[1], rows[2]))  # pyright: ignore[reportArgumentType]
        sign, (signs, constant) = 1 if along[2] > 0 else -1, frame.angle
        return replace(
            turned.with_column(label, a, NOWHERE),
            axis=(angle[0], along),
            angle=({**signs, label: sign}, constant + sign * phase),
        )

    def angle_of(self, frame: SymbolicFrame, axis: np.ndarray, label: str, phase: float) -> Angle:
        """Return the angle of a turn, its coordinate and a phase, in the group of its axis."""
        if frame.axis is not None and abs(abs(frame.axis[1] @ axis) - 1) <= PARALLEL:
            group = frame.axis[0]
        elif frame.axis is None:
            fixed = frame.outset @ axis
            near = (
                g
                for g, known in self.groups.items()
                if known is not None and abs(abs(known @ fixed) - 1) <= PARALLEL
            )
            group = next(near, len(self.groups))
            self.groups.setdefault(group, fixed)
        else:
            group = len(self.groups)
            self.groups[group] = None
        angle = (group, label)
        self.angles[label] = angle, exact_angle(phase)
        return angle

    def mass_centre(self, body: str) -> SymbolicFrame:
        """Return the frame in a body's mass centre, in the axes that its joint leads to."""
        frame, at = self.bodies[body]
        turn = np.eye(3) if at is None else self.dimensions.axes(at).T
        d = self.dimensions.between(body, at, MASS_CENTRE, frame.waiting @ turn, self.flat)
        return frame.moved(d)

    def inertia(self, body: str) -> Matrix:
        """Return a body's inertia about its mass centre, in the axes of its frame."""
        frame, at = self.bodies[body]
        turn = np.eye(3) if at is None else self.dimensions.axes(at).T
        R = exact_matrix(frame.waiting @ turn)
        return chained(chained(R, self.dimensions.inertia(body)), transposed(R))


def turn_about(R: np.ndarray, axis: np.ndarray) -> float:
    """Return the angle of a rotation about its axis."""
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    return float(np.arctan2(skew @ axis, (np.trace(R) - 1) / 2))
