"""Limits and gains on the other side of a square map of rates: motor rates = J joint rates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class TransferredLimits(NamedTuple):
    """Hold what limits of the motors leave to each joint (..., k).

    alone: with nothing in the other joints; most: in some motion, or with some torques, of all
    """

    alone: np.ndarray
    most: np.ndarray


class TransferredGains(NamedTuple):
    """Hold stiffness and damping matrices (..., k, k) [N/m, N m/rad; N s/m, N m s/rad]."""

    kp: np.ndarray
    kd: np.ndarray


def across(limits: np.ndarray, there: np.ndarray, back: np.ndarray) -> TransferredLimits:
    """Return what |there x| <= limits leaves of x, back being the inverse of there (..., k, k).

    alone_i = min_m limits_m / |there_mi|,    most_i = sum_m |back_im| limits_m
    """
    return TransferredLimits(least(limits, there), applied(np.abs(back), limits))


def congruent(matrix: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return by^T matrix by (..., k, k)."""
    return transposed(by) @ matrix @ by


def transposed(matrix: np.ndarray) -> np.ndarray:
    """Return matrices (..., k, k) with rows and columns exchanged."""
    return np.swapaxes(matrix, -1, -2)


def applied(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return matrices (..., k, k) times vectors (..., k)."""
    return (matrix @ vector[..., None])[..., 0]


def least(limits: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return min_m limits_m / |matrix_mi| (..., i)."""
    with np.errstate(divide="ignore"):
        return (limits[:, None] / np.abs(matrix)).min(axis=-2)
