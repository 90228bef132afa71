"""Limits: which joint coordinates lie outside the range that the description gives, and which rates
are above their limits, in one state or along a run.

A free turn is limited by the angle between the joint's two frames, 2 acos |qw|, and by the length
of its angular velocity.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from linkwork.mechanism.joints import TURN
from linkwork.mechanism.limits import LimitedSpeed, limited, speed_limited

if TYPE_CHECKING:
    from linkwork.model.model import Model

ROUNDING = 1e-12
"""How far behind a limit a coordinate is still at it, over the mechanism's own length or 1 rad, or
the limit."""
SLIPPED = 1e-9  # likewise of a rate above its limit, which solved motions keep to


def passed(
    robot: Model,
    positions: np.ndarray,
    rates: np.ndarray | None = None,
    time: np.ndarray | None = None,
) -> tuple[str, ...]:
    """Return one sentence for each limit that coordinates (..., m) and rates of joints (..., r)
    pass, with the time (K,) [s] where it first happens; of rates none if these are left out."""
    bounds: Bounds = robot.once(bounds_of)
    values = positions.reshape(-1, positions.shape[-1])[:, bounds.places]
    if bounds.turning.any():
        turns = np.abs(values[:, bounds.turning])
        values[:, bounds.turning] = 2 * np.arccos(np.clip(turns, 0, 1))
    all_beyond, found = bounds.signs * (values - bounds.values) > bounds.rounding, []
    for k in np.flatnonzero(np.count_nonzero(all_beyond, axis=0)):
        beyond, own = all_beyond[:, k], values[:, k]
        when = "" if time is None else f" from t = {time[int(np.argmax(beyond))]:.6g} s on"
        worst = own[beyond][np.argmax(bounds.signs[k] * own[beyond])]
        found.append(f"{bounds.said[k]}{when}: it reaches {worst:.6g}")
    return (*found, *too_fast(robot, rates, time)) if rates is not None else tuple(found)


class Bounds(NamedTuple):
    """Hold the bounds of coordinates one by one: places of these, which are qw of free turns, the
    bounds with their signs (1: upper, -1: lower) and rounding, and what is said beyond them."""

    places: np.ndarray
    turning: np.ndarray
    values: np.ndarray
    signs: np.ndarray
    rounding: np.ndarray
    said: list[str]


def bounds_of(robot: Model) -> Bounds:
    """Return the bounds of a robot's coordinates."""
    found, said = [], []
    for label, limits, name in limited(robot.mechanism):
        place, turning = robot.coordinates.index(label), name.endswith(f".{TURN}")
        size = robot.labels.sizes[place]
        sides = (limits.lower, -1.0, "below its lower"), (limits.upper, 1.0, "above its upper")
        for bound, sign, side in sides:
            if bound is not None:
                found.append((place, turning, bound, sign, ROUNDING * max(size, abs(bound))))
                said.append(f"{name} is {side} limit {bound:g}")
    places, turning, values, signs, rounding = np.array(found, float).reshape(-1, 5).T
    return Bounds(places.astype(int), turning > 0, values, signs, rounding, said)


def speeds_of(robot: Model) -> tuple[LimitedSpeed, ...]:
    """Return what has a limit of speed."""
    return tuple(speed_limited(robot.mechanism))


def too_fast(robot: Model, rates: np.ndarray, time: np.ndarray | None) -> Iterator[str]:
    """Yield one sentence for each limit of speed that rates of joints (..., r) pass."""
    for labels, bound, name in robot.once(speeds_of):
        own = rates[..., [robot.rates.index(label) for label in labels]]
        speeds = np.linalg.norm(own, axis=-1).ravel()
        beyond = speeds > bound * (1 + SLIPPED)
        if beyond.any():
            when = "" if time is None else f" from t = {time[int(np.argmax(beyond))]:.6g} s on"
            worst = speeds[beyond].max()
            yield f"{name} is above its limit of speed {bound:g}{when}: it reaches {worst:.6g}"
