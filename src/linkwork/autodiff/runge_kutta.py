"""A step of the classical Runge-Kutta method, made of a robot's functions.

k_i = f(y_i, u),  y_(i+1) = y + c_i h k_i,  y <- y + h (k_1 + 2 k_2 + 2 k_3 + k_4) / 6
q <- closure_step(closure_step(q))
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from linkwork.autodiff.offered import Offered
from linkwork.mechanism.sticking import require_no_bristles

STAGES = ((0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0))
"""Of each evaluation: how far along it the next one lies, over h, and its weight, over h / 6."""
LOOSE = 1e3  # residual that is left after a step, over that of runs, from which on loops are open
CLOSURES = 2  # Newton steps that close the loops after a step

Array = Any
Motion = Callable[..., tuple[Array, Array]]


def composed(
    motion: Motion, newton: Callable[..., Array] | None
) -> Callable[..., tuple[Array, Array]]:
    """Return q, v, u, h[, p] -> q, v after a step of length h (..., 1).

    motion: q, v, u[, p] -> q', v'; newton: q[, p] -> q after a step that closes loops, if there are
    any
    """

    def step(q: Array, v: Array, u: Array, h: Array, *p: Array) -> tuple[Array, Array]:
        after_q, after_v, at_q, at_v = q, v, q, v
        for along, weight in STAGES:
            dq, dv = motion(at_q, at_v, u, *p)
            after_q, after_v = after_q + h / 6 * weight * dq, after_v + h / 6 * weight * dv
            at_q, at_v = q + h * along * dq, v + h * along * dv
        if newton:
            for _ in range(CLOSURES):
                after_q = newton(after_q, *p)
        return after_q, after_v

    return step


def require_steps(offered: Offered) -> None:
    """Refuse robots whose friction has states of its own."""
    require_no_bristles(
        offered.robot.mechanism,
        "a step leaves out",
        "robot.simulate and robot.stepper take steps with them",
    )
