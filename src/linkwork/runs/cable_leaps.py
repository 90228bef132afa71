"""Leaps of cables: how far states are from where energy of a cable leaps, told where one begins
there."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from linkwork.checks import amount
from linkwork.control.observation import Quantity, expression
from linkwork.equations import Equations, functions
from linkwork.errors import ModelWarning
from linkwork.mechanism.limits import at_surfaces

if TYPE_CHECKING:
    from linkwork.mechanism import Mechanism
    from linkwork.model.model import Model

BENDS = 4.0  # times that a gap bends within a step, by which it is farther from zero


def leaps(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of the leaps of cables with energy: "pull leaps at the sphere of arm
    (path.1)"."""
    return tuple(name for name, each in at_surfaces(mechanism).items() if each.what == "leaps at")


def gaps(robot: Model, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return how far cables are from where their energy leaps (N, leaps), negative where they are
    as good as there.

    q (N, nq); p (1 or N, np): of the robot
    """
    kernel = robot.chart.compiled("leaps", leaps_function)
    return kernel(np.ascontiguousarray(q), np.ascontiguousarray(p))[0]


def leaps_function(equations: Equations) -> ca.Function:
    """Return q -> how far cables are from where they leap."""
    names = leaps(equations.mechanism)
    found = [expression(equations, Quantity("surface", name)) for name in names]
    return functions.function("leaps", equations, {"gaps": ca.vertcat(*found)})


def tell_leaps(robot: Model, q: np.ndarray, p: np.ndarray) -> None:
    """Warn of states q (..., nq) at which cables are as good as where their energy leaps; p
    (..., np)."""
    if not robot.names.surfaces or not (names := leaps(robot.mechanism)):
        return
    there = ~(gaps(robot, np.atleast_2d(q), np.atleast_2d(p)) > 0)
    for name, which in zip(names, there.T, strict=True):
        count = int(which.sum())
        many = f" ({amount(count, 'state')} of {which.size})" if which.size > 1 else ""
        if count:
            warnings.warn(
                f"a run begins where {name}, within 1e-3 rad, or 1e-3 of the radius{many}: "
                "rounding decides on which side the cable lies, and no event tells if it leaps; "
                "begin farther away",
                ModelWarning,
                stacklevel=3,
            )


def may_leap(before: np.ndarray, middle: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Tell for which members (N,) a gap (N, leaps) may have come to zero within a step, by its
    values at both ends and in the middle."""
    side = np.where(before > 0, 1.0, -1.0)
    nearest = np.minimum(side * before, np.minimum(side * middle, side * after))
    near = nearest <= BENDS * np.abs(before - 2 * middle + after)
    return np.asarray(near.any(axis=1))
