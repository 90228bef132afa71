"""Axes for a hinge on a body that moves freely, where the hinge's axis is none of the body's.

The body has the orientation A right, with a constant right factor, and the hinge the constant axis
n = right axis in its axes A. In axes A W, with a constant W whose last column is n,

    A Rot(n, angle) right = A W Rot(e_3, angle) W' right

so that what hangs on the hinge moves as in a plane: vectors are turned by a constant once, on their
way to the body, and beyond by a sine and a cosine. Parallel hinges of a body have one W.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

import casadi as ca
import numpy as np

from linkwork.equations.algebra import Vector, constant, snap

PARALLEL = 1e-12
LAST = np.array([0.0, 0.0, 1.0])
AxesT = TypeVar("AxesT")


class HingeAxes(NamedTuple, Generic[AxesT]):
    """Hold axes A W, the sign of the hinge's axis along their last one, and W' right."""

    axes: AxesT
    sign: int
    right: np.ndarray


def hinge_axes(
    A: AxesT,
    beside: dict[bytes, AxesT],
    right: Vector,
    axis: np.ndarray,
    made: Callable[[AxesT, ca.SX], AxesT],
) -> HingeAxes[AxesT]:
    """Return the axes of a hinge, those of a parallel one if there are any.

    beside: those that A has already, by W; new ones are added. made: gives the axes A W
    """
    assert isinstance(right, np.ndarray)
    n = right @ axis
    for known, axes in beside.items():
        W = np.frombuffer(known).reshape(3, 3)
        for sign in (1, -1):
            if np.linalg.norm(n - sign * W[:, 2]) < PARALLEL:
                return HingeAxes(axes, sign, snap(W.T @ right))
    W = snap(right @ completed(axis))
    beside[W.tobytes()] = made(A, constant(W))
    return HingeAxes(beside[W.tobytes()], 1, snap(W.T @ right))


def completed(axis: np.ndarray) -> np.ndarray:
    """Return a rotation whose last column is a unit vector."""
    first = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
