"""Orientations that add the angles of parallel axes, in axes that are as near as possible.

Every orientation is kept in the form

    R_0B = A . Rot(axis, angle) . right

with a constant unit axis and a constant right factor, which may hold free numbers; A turns
components in the node's `Axes` into the ground's. A further turn about a parallel axis only adds to
the angle; in a planar mechanism every body then costs one sine and one cosine, and all vectors are
written in the ground's axes. A turn about any other axis starts new axes, those of the body before
it: there its own axis is constant, and what hangs on it again moves as in a plane. So does what
hangs on a body that moves freely (`hinge_axes`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, Vector, constant, present, skew, snap, turn_matrix, zero
from linkwork.equations.hinge_axes import LAST, PARALLEL, hinge_axes

NO_TURN = np.eye(3).tobytes()


@dataclass(frozen=True, eq=False)
class Axes:
    """Hold axes in which vectors are written: `turn` (3 x 3) leads from components in them to the
    parent's; beside: those that turn against them by constants (`hinge_axes`)."""

    parent: Axes | None
    turn: ca.SX
    beside: dict[bytes, Axes] = field(default_factory=dict, repr=False)

    @cached_property
    def depth(self) -> int:
        return 0 if self.parent is None else self.parent.depth + 1

    @cached_property
    def matrix(self) -> ca.SX:
        """A (3 x 3): components in these axes to the ground's."""
        return SX.eye(3) if self.parent is None else ca.mtimes(self.parent.matrix, self.turn)


GROUND_AXES = Axes(None, SX.eye(3))


def convert(x: ca.SX, source: Axes, target: Axes) -> ca.SX:
    """Return components of a vector, or of the columns of a matrix, in other axes."""
    down = []
    while source is not target:
        if source.depth >= target.depth and source.parent is not None:
            x, source = ca.mtimes(source.turn, x), source.parent
        elif target.parent is not None:
            down.append(target.turn)
            target = target.parent
    for turn in reversed(down):
        x = ca.mtimes(turn.T, x)
    return x


@dataclass(frozen=True, eq=False)
class Orientation:
    """Represent R_0B = A Rot(axis, angle) right: axes A, axis and right constant, angle [rad] an
    expression; right is one, too, where a direction is free."""

    axes: Axes
    axis: np.ndarray
    angle: ca.SX
    right: Vector
    _turned: dict[bytes, ca.SX] = field(default_factory=dict, repr=False)

    @classmethod
    def identity(cls) -> Orientation:
        return cls(GROUND_AXES, np.zeros(3), SX(0), np.eye(3))

    @cached_property
    def near(self) -> ca.SX:
        """Rot(axis, angle) right: the body's axes to `axes`."""
        plain = isinstance(self.right, np.ndarray) and np.array_equal(self.right, np.eye(3))
        return ca.densify(self.turn if plain else ca.mtimes(self.turn, constant(self.right)))

    @cached_property
    def turn(self) -> ca.SX:
        """Rot(axis, angle)."""
        if not self.axis.any():
            return SX.eye(3)
        return turn_about(self.axis, ca.cos(self.angle), ca.sin(self.angle))

    @cached_property
    def matrix(self) -> ca.SX:
        """R_0B as an expression."""
        return ca.densify(ca.mtimes(self.axes.matrix, self.near))

    def turned(self, local: Vector) -> ca.SX:
        """Return a constant vector of the body in `axes`, not to be changed in place: the same one
        is made once."""
        key = local.tobytes() if isinstance(local, np.ndarray) else None
        if key not in self._turned:
            local = snap(local)
            placed = constant(snap(self.right @ local)) if present(local) else zero()
            found = ca.mtimes(self.turn, placed) if present(local) else zero()
            if key is None:
                return found
            self._turned[key] = found
        return self._turned[key]

    def then_constant(self, rotation: Vector) -> Orientation:
        """Return R_0B rotation; a constant rotation about the axis goes into the angle."""
        constants = rotation, self.right
        if all(isinstance(R, np.ndarray) and R.tobytes() == NO_TURN for R in constants):
            return self
        right = snap(self.right @ rotation)
        if isinstance(right, SX):
            return Orientation(self.axes, self.axis, self.angle, right)
        if self.axis.any() and np.linalg.norm(right @ self.axis - self.axis) < PARALLEL:
            offset = angle_about(self.axis, right)
            return Orientation(self.axes, self.axis, self.angle + offset, np.eye(3))
        return Orientation(self.axes, self.axis, self.angle, right)

    def then_turn(self, axis: np.ndarray, angle: ca.SX) -> Orientation:
        """Return R_0B Rot(axis, angle)."""
        turned = snap(self.right @ axis)
        if isinstance(turned, SX):
            return Orientation(Axes(self.axes, self.near), snap(axis), angle, np.eye(3))
        if not self.axis.any():
            if self.axes.parent is None or np.count_nonzero(turned) == 1:
                return Orientation(self.axes, turned, angle, self.right).then_constant(np.eye(3))
            of = hinge_axes(self.axes, self.axes.beside, self.right, axis, Axes)
            return Orientation(of.axes, LAST, of.sign * angle, of.right).then_constant(np.eye(3))
        for sign in (1, -1):
            if np.linalg.norm(turned - sign * self.axis) < PARALLEL:
                return Orientation(self.axes, self.axis, self.angle + sign * angle, self.right)
        across = angle_across(self.axis, turned)
        if across is None:
            return Orientation(Axes(self.axes, self.near), snap(axis), angle, np.eye(3))
        # The new axes turn about the old axis, too, up to where the new one is among them.
        phi, along = across
        c, s = ca.cos(self.angle), ca.sin(self.angle)
        if phi:
            c, s = np.cos(phi) * c - np.sin(phi) * s, np.cos(phi) * s + np.sin(phi) * c
        right = snap(turn_matrix(self.axis, -phi) @ self.right)
        return Orientation(Axes(self.axes, turn_about(self.axis, c, s)), along, angle, right)

    def keeps(self, axis: np.ndarray) -> bool:
        """Tell whether a turn about an axis of this frame only adds to the angle."""
        turned = self.right @ axis
        along = np.cross(turned, self.axis) if isinstance(turned, np.ndarray) else np.ones(3)
        return bool(np.linalg.norm(along) < PARALLEL)

    def then_matrix(self, rotation: ca.SX) -> Orientation:
        """Return R_0B rotation for a rotation given as an expression: the start of new axes, those
        of the result."""
        return Orientation(
            Axes(self.axes, ca.mtimes(self.near, rotation)), np.zeros(3), SX(0), np.eye(3)
        )

    def turns_with(self, other: Orientation) -> bool:
        """Tell whether this orientation differs from another by a constant rotation, R_other' R =
        right_other' right."""
        same = self.axes is other.axes and np.allclose(self.axis, other.axis, atol=PARALLEL)
        return same and ca.is_equal(self.angle, other.angle, 10)

    def angle_from(self, other: Orientation) -> ca.SX | None:
        """Return the angle of this orientation relative to another, where both turn about one axis;
        else None.

        With equal axes and right factors, R_other' R = right' Rot(axis, angle - angle_other) right.
        """
        if isinstance(self.right, SX) or isinstance(other.right, SX):
            return None
        same = np.allclose(self.axis, other.axis, atol=PARALLEL) and np.allclose(
            self.right, other.right, atol=PARALLEL
        )
        return self.angle - other.angle if same and self.axes is other.axes else None


def turn_about(axis: np.ndarray, c: ca.SX, s: ca.SX) -> ca.SX:
    """Return Rot(a, angle) = a a' + cos (1 - a a') + sin [a x] for cosine and sine of the angle."""
    along = snap(np.outer(axis, axis))
    across, spin = constant(snap(np.eye(3) - along)), constant(skew(axis))
    return constant(along) + c * across + s * spin


def angle_across(axis: np.ndarray, direction: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Return the angle [rad] about one of the axes from another one to a direction across it, and
    the other one, which is the nearest; None where this is no such direction."""
    if np.count_nonzero(axis) != 1 or axis @ direction:
        return None
    k = int(np.abs(direction).argmax())
    nearest = np.sign(direction[k]) * np.eye(3)[k]
    return float(np.arctan2(axis @ np.cross(nearest, direction), nearest @ direction)), nearest


def angle_about(axis: np.ndarray, rotation: np.ndarray) -> float:
    """Return the angle [rad] of a rotation matrix whose axis is known: tan = axis . vee(R - R') /
    (trace - 1)."""
    vee = rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]]
    return float(np.arctan2(axis @ vee, np.trace(rotation) - 1))
