"""The stiff flyball governor (IFToMM A05) in closed form: spindle angle q, slider height s, rods
a_1, a_2 below the horizontal.

A point at the distance r along a rod is c + r cos a from the axis and h - r sin a high; a rod's
middle is at r = b, its ball at r = l. A rod's moments about its middle are K along it and E_m
across; about the hinge, with the ball, E. With

    J(a) = K sin^2 a + E_m cos^2 a + m (c + b cos a)^2 + m_ball (c + l cos a)^2
    L = (J_0 + J(a_1) + J(a_2)) q'^2/2 + E (a_1'^2 + a_2'^2)/2 + m_s s'^2/2 - m_s g s + W
    (sin a_1 + sin a_2)

and springs of tension F = k (span - rest) + d span', span^2 = (b cos a)^2 + (h - b sin a - s)^2,
Lagrange's equations are

    ((J_0 + J(a_1) + J(a_2)) q')' = torque,    E a'' = J_a q'^2/2 + W cos a - F span_a,
    m_s s'' = -m_s g - F_1 span_1,s - F_2 span_2,s
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

h, length, section, side, density, ball, k, damping, rest, g = (
    1.0,
    1.0,
    0.01,
    0.1,
    3000.0,
    5.0,
    8e5,
    4e4,
    0.5,
    9.81,
)
c, b = side / 2, length / 2
rod = density * section**2 * length
slider = density * side**3
K, E_m = rod * section**2 / 6, rod * (length**2 + section**2) / 12
E = E_m + rod * b**2 + ball * length**2
W = (rod * b + ball * length) * g
J_0 = density * section**2 * h * section**2 / 6 + slider * side**2 / 6
START = np.array([0.0, 0.5, np.pi / 6, np.pi / 6])


def accelerations(y: np.ndarray, rates: np.ndarray, torque: float = 0.0) -> np.ndarray:
    """Return (q'', s'', a_1'', a_2'')."""
    s, a = y[1], y[2:]
    q_, s_, a_ = rates[0], rates[1], rates[2:]
    sin, cos = np.sin(a), np.cos(a)
    J = K * sin**2 + E_m * cos**2 + rod * (c + b * cos) ** 2 + ball * (c + length * cos) ** 2
    J_a = 2 * sin * ((K - E_m) * cos - rod * b * (c + b * cos) - ball * length * (c + length * cos))
    rise = h - b * sin - s
    span = np.sqrt((b * cos) ** 2 + rise**2)
    span_a, span_s = -b * cos * (b * sin + rise) / span, -rise / span
    F = k * (span - rest) + damping * (span_a * a_ + span_s * s_)
    return np.concatenate(
        [
            [
                (torque - np.sum(J_a * a_) * q_) / (J_0 + np.sum(J)),
                -g - np.sum(F * span_s) / slider,
            ],
            (J_a * q_**2 / 2 + W * cos - F * span_a) / E,
        ]
    )


def motion(times: ArrayLike, spin: float = 2 * np.pi, tolerance: float = 1e-10) -> np.ndarray:
    """Return (q, s, a_1, a_2, and their rates) at the times (8, times), by Radau's method of order
    5."""

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[4:], accelerations(y[:4], y[4:])])

    def jacobian(t: float, y: np.ndarray) -> np.ndarray:
        return np.imag([rates(t, column) for column in y + 1e-100j * np.eye(8)]).T / 1e-100

    start = np.concatenate([START, [spin, 0.0, 0.0, 0.0]])
    return solve_ivp(
        rates,
        (0.0, np.max(times)),
        start,
        method="Radau",
        t_eval=times,
        rtol=tolerance,
        atol=1e-12,
        jac=jacobian,
    ).y
