"""Orientations that add the angles of parallel axes instead of multiplying their matrices.

Every orientation is kept in the form

    R = left . Rot(axis, angle) . right

with a constant unit axis and a constant right factor. A further turn about an axis parallel to this one only adds to
the angle; in a planar mechanism every body then costs one sine and one cosine and no product of matrices. A turn about
any other axis starts a new form, whose left factor is the matrix so far.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, skew, snap

PARALLEL = 1e-12


@dataclass(frozen=True)
class Orientation:
    """Represent R_0B = left Rot(axis, angle) right: left 3 x 3 (expression), axis, right constant, angle [rad]."""

    left: ca.SX
    axis: np.ndarray
    angle: ca.SX
    right: np.ndarray

    @classmethod
    def identity(cls) -> Orientation:
        return cls(SX.eye(3), np.zeros(3), SX(0), np.eye(3))

    @cached_property
    def matrix(self) -> ca.SX:
        """R_0B as an expression: Rot = a a' + cos (1 - a a') + sin [a x]."""
        if not self.axis.any():
            return ca.densify(ca.mtimes(self.left, SX(self.right)))
        along = snap(np.outer(self.axis, self.axis))
        s, c = ca.sin(self.angle), ca.cos(self.angle)
        turn = SX(along) + c * SX(snap(np.eye(3) - along)) + s * SX(skew(self.axis))
        return ca.densify(ca.mtimes(ca.mtimes(self.left, turn), SX(self.right)))

    def then_constant(self, rotation: np.ndarray) -> Orientation:
        """Return R_0B rotation; a constant rotation about the axis goes into the angle."""
        right = snap(self.right @ rotation)
        if self.axis.any() and np.linalg.norm(right @ self.axis - self.axis) < PARALLEL:
            offset = angle_about(self.axis, right)
            return Orientation(self.left, self.axis, self.angle + offset, np.eye(3))
        return Orientation(self.left, self.axis, self.angle, right)

    def then_turn(self, axis: np.ndarray, angle: ca.SX) -> Orientation:
        """Return R_0B Rot(axis, angle)."""
        turned = snap(self.right @ axis)
        if not self.axis.any():
            return Orientation(self.left, turned, angle, self.right).then_constant(np.eye(3))
        for sign in (1, -1):
            if np.linalg.norm(turned - sign * self.axis) < PARALLEL:
                return Orientation(self.left, self.axis, self.angle + sign * angle, self.right)
        return Orientation(self.matrix, snap(axis), angle, np.eye(3))

    def angle_from(self, other: Orientation) -> ca.SX | None:
        """Return the angle of this orientation relative to another, where both turn about one axis; else None.

        With equal left and right factors, R_other' R = right' Rot(axis, angle - angle_other) right.
        """
        same = np.allclose(self.axis, other.axis, atol=PARALLEL) and np.allclose(self.right, other.right, atol=PARALLEL)
        if same and ca.is_equal(self.left, other.left, 1):
            return self.angle - other.angle
        return None


def angle_about(axis: np.ndarray, rotation: np.ndarray) -> float:
    """Return the angle [rad] of a rotation matrix whose axis is known: tan = axis . vee(R - R') / (trace - 1)."""
    vee = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    return float(np.arctan2(axis @ vee, np.trace(rotation) - 1))
