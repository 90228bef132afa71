"""Limits: which joint coordinates lie outside the range that the description gives, and which rates
are above their limits, in one state or along a run.

A free turn is limited by the angle between the joint's two frames, 2 acos |qw|, and by the length
of its angular velocity.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from linkwork.mechanism.joints import TURN
from linkwork.mechanism.limits import limited, speed_limited

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
    flat = positions.reshape(-1, positions.shape[-1])
    found = []
    for label, limits, name in limited(robot.mechanism):
        place = robot.coordinates.index(label)
        values, size = flat[:, place], robot.labels.sizes[place]
        if name.endswith(f".{TURN}"):
            values = 2 * np.arccos(np.clip(np.abs(values), 0, 1))
        for bound, sign, side in (
            (limits.lower, -1, "below its lower"),
            (limits.upper, 1, "above its upper"),
        ):
            if bound is None:
                continue
            beyond = sign * (values - bound) > ROUNDING * max(size, abs(bound))
            if beyond.any():
                when = "" if time is None else f" from t = {time[int(np.argmax(beyond))]:.6g} s on"
                worst = values[beyond][np.argmax(sign * values[beyond])]
                found.append(f"{name} is {side} limit {bound:g}{when}: it reaches {worst:.6g}")
    return (*found, *too_fast(robot, rates, time)) if rates is not None else tuple(found)


def too_fast(robot: Model, rates: np.ndarray, time: np.ndarray | None) -> Iterator[str]:
    """Yield one sentence for each limit of speed that rates of joints (..., r) pass."""
    for labels, bound, name in speed_limited(robot.mechanism):
        own = rates[..., [robot.rates.index(label) for label in labels]]
        speeds = np.linalg.norm(own, axis=-1).ravel()
        beyond = speeds > bound * (1 + SLIPPED)
        if beyond.any():
            when = "" if time is None else f" from t = {time[int(np.argmax(beyond))]:.6g} s on"
            worst = speeds[beyond].max()
            yield f"{name} is above its limit of speed {bound:g}{when}: it reaches {worst:.6g}"
