"""Tensions: forces of actuators that pull at cables, which do not push.

    u = u_0 + B x,   S' u_0 = M v' + C v + G - f of least norm,   S' B = 0,   B'B = 1

Of all u that move the robot alike that of least norm is taken whose cables pull by what is allowed:
least |x| with linear inequalities, which is solved exactly by non-negative least squares.
Source: Lawson & Hanson 1974, Solving Least Squares Problems, ch. 23 (LDP); Pott 2018, Cable-Driven
Parallel Robots, ch. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import needed, number, positive
from linkwork.errors import LinkworkError
from linkwork.mechanism.transmissions import cables_among
from linkwork.model.state import Motion, State
from linkwork.robot import Robot
from linkwork.simulation import Sampled

BARE = 1e-8  # residual, over the largest bound, from which on no forces keep the bounds
KEPT = 1e-9  # of the largest force, by which rounding may pass a bound


@overload
def tensions(
    robot: Robot, motion: Motion, *, least: float = 0.0, most: float | None = None
) -> Sampled: ...


@overload
def tensions(
    robot: Robot,
    motion: State,
    accelerations: ArrayLike | None = None,
    *,
    least: float = 0.0,
    most: float | None = None,
) -> np.ndarray: ...


def tensions(
    robot: Robot,
    motion: State | Motion,
    accelerations: ArrayLike | None = None,
    *,
    least: float = 0.0,
    most: float | None = None,
) -> np.ndarray | Sampled:
    """Find the actuator forces of least norm that move a robot with every driven cable taut.

    Args:
        robot: with cables (transmissions of the type `cable`) among its actuators.
        motion: a state or a stack (N) of them, or a `Motion`, whose own accelerations are taken.
        accelerations: v' (..., n) [m/s^2, rad/s^2] in the order of the states' `independent`; zero
            if left out, so that a state at rest is held.
        least, most: tension of every driven cable [N]; `most` None: no upper bound.

    Returns:
        u (..., actuators) [N, N m], below zero where a cable pulls; of a motion a `Sampled` signal.

    Raises:
        LinkworkError: no cable among the actuators; bounds out of order; what `inverse_dynamics`
            refuses; bounds within which no tensions move the robot so, with the first state.
    """
    needed(robot, Robot)
    cables = cables_among(robot.mechanism.transmissions, robot.actuators)
    if not cables:
        raise LinkworkError(
            "no actuator of the robot pulls at a cable; take robot.inverse_dynamics"
        )
    if robot.rubs:
        raise LinkworkError(
            "the robot has bearings that rub by what they carry, and so by the tensions; leave "
            "them out"
        )
    low = number(least, "the least tension")
    high = inf if most is None else positive(most, "the most tension", "N")
    if not 0 <= low < high:
        raise LinkworkError(f"tensions from {low:g} to {high:g} N; give 0 <= least < most")
    # The forces of least norm, and in each state what internal forces are to be added.
    if isinstance(motion, Motion):
        found = robot.inverse_dynamics(motion)
        states, u = motion.state, found.values.copy()
    else:
        states = robot.own(motion)
        rest = np.zeros_like(states.rates) if accelerations is None else accelerations
        u = np.array(robot.inverse_dynamics(states, rest))
    for index in np.ndindex(u.shape[:-1]):
        state = states.at(index) if index else states  # pyright: ignore[reportArgumentType]
        added = taut(u[index], robot.internal_forces(state), cables, low, high)
        if added is None:
            when = f" at t = {motion.time[index[0]]:.6g} s" if isinstance(motion, Motion) else ""
            where = when or (f" in state {', '.join(map(str, index))}" if index else "")
            raise LinkworkError(
                f"no forces move the robot so{where} with every cable's tension from {low:g} to "
                f"{high:g} N; give wider bounds, or another pose"
            )
        u[index] += added
    return Sampled(motion.time, u) if isinstance(motion, Motion) else u


def taut(
    u: np.ndarray, B: np.ndarray, cables: Sequence[int], low: float, high: float
) -> np.ndarray | None:
    """Return the least internal forces (actuators), of a basis B (actuators, k), that with forces u
    (actuators) make tensions -u of cables (places) from a lowest to a highest one; None if there
    are none."""
    from scipy.optimize import nnls

    # G x >= h, in parts of the largest bound.
    G = np.concatenate([-B[cables], B[cables]])
    h = np.concatenate([low + u[cables], -high - u[cables]])
    G, h = G[np.isfinite(h)], h[np.isfinite(h)]
    size = max(np.abs(u).max(), low, 1e-300)
    x = np.zeros(B.shape[1])
    if B.shape[1] and (h > 0).any():
        rows = np.vstack([G.T, h / size])
        goal = np.zeros(len(rows))
        goal[-1] = 1.0
        y, rest = nnls(rows, goal)
        if rest < BARE:
            return None
        remains = rows @ y - goal
        x = -size * remains[:-1] / remains[-1]
    return B @ x if (G @ x - h >= -KEPT * max(size, np.abs(x).max(initial=0.0))).all() else None
