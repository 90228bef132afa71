"""The 3-PRR's equations as one writes them by hand in NumPy, lean: what a careful user has without
a library.

With the slides s, the links' absolute angles theta_i, the platform's centre p and angle psi, and w
= (theta, p, psi):

    p = P_i + s_i d_i + l1 e(theta_i) + l2 e(psi + a_i)    i = 1, 2, 3
    A w' = B s',    A w'' = B s'' + g,
    row pair i:  p'' - l1 n_i theta_i'' - l2 n_psi,i psi'' = d_i s_i'' + g_i
    g_i = -l1 e_i theta_i'^2 - l2 e_psi,i psi'^2           e = (cos, sin), n = (-sin, cos)
    w' = X s',  w'' = X s'' + b,   X = A^-1 B,  b = A^-1 g

    u = F_s + X' F_w:
    F_s,i = (m_s + m_l) s_i'' + m_l l1/2 (d_i . n_i theta_i'' - d_i . e_i theta_i'^2)
    F_w = (m_l l1/2 d_i . n_i s_i'' + (I_l + m_l l1^2/4) theta_i'', m_p p'', I_p psi'')
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import get_lapack_funcs

from linkwork.simulation import Signal

from benchmarks.tasks import ALONG, L1, L2, Task

gesv, getrs = get_lapack_funcs(("gesv", "getrs"), dtype=float)

SLIDER, LINK, PLATFORM = 0.18718, 0.52007, 1.41901
LINK_INERTIA, PLATFORM_INERTIA = 9.09e-4, 5.076e-3

D = np.column_stack([np.cos(ALONG), np.sin(ALONG)])
B = np.zeros((6, 3))
B[[0, 2, 4], [0, 1, 2]], B[[1, 3, 5], [0, 1, 2]] = D[:, 0], D[:, 1]
A_FIXED = np.zeros((6, 6))
A_FIXED[0::2, 3] = A_FIXED[1::2, 4] = 1.0
INERTIAS = np.array([LINK_INERTIA + LINK * L1**2 / 4] * 3 + [PLATFORM, PLATFORM, PLATFORM_INERTIA])
SLIDING = (SLIDER + LINK) * np.eye(3)
HALF = LINK * L1 / 2


def derivative(x: np.ndarray, s_dot: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x' (9,) and s'' (3,) for x = (s, theta, p, psi) [m, rad], the slides' rates [m/s] and
    forces [N]."""
    angles = np.concatenate([x[3:6], x[8] + ALONG])
    cosines, sines = np.cos(angles), np.sin(angles)
    c, s, c_p, s_p = cosines[:3], sines[:3], cosines[3:], sines[3:]
    A = A_FIXED.copy()
    A.flat[0:27:13], A.flat[6:33:13] = L1 * s, -L1 * c
    A[0::2, 5], A[1::2, 5] = L2 * s_p, -L2 * c_p
    factors, pivots, X, _ = gesv(A, B)
    w_dot = X.dot(s_dot)
    square, turning = w_dot[:3] ** 2, w_dot[5] ** 2
    g = np.empty(6)
    g[0::2] = -L1 * c * square - L2 * c_p * turning
    g[1::2] = -L1 * s * square - L2 * s_p * turning
    b = getrs(factors, pivots, g)[0]
    coupling = HALF * (D[:, 1] * c - D[:, 0] * s)
    mixed = coupling[:, None] * X[:3]
    M = SLIDING + mixed + mixed.T + X.T.dot(INERTIAS[:, None] * X)
    bias = coupling * b[:3] - HALF * (D[:, 0] * c + D[:, 1] * s) * square + X.T.dot(INERTIAS * b)
    return np.concatenate([s_dot, w_dot]), gesv(M, u - bias)[2]


def from_joints(positions: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return x (9,) from the joint coordinates q1..q9 and the platform's pose (x, y, angle)."""
    return np.concatenate([positions[:3], ALONG + positions[3:6], pose])


def sliding_and_pivoting(x: np.ndarray) -> np.ndarray:
    """Return the coordinates of slide_1..3 and pivot_1..3 (6,) [m, rad]."""
    return np.concatenate([x[:3], x[3:6] - ALONG])


class Lookup:
    """Evaluate a signal with equally spaced knots at one time, as quickly as Python does."""

    def __init__(self, signal: Signal):
        self.coefficients = signal.coefficients
        self.knots = signal.knots.tolist()
        self.last, self.per_second = len(self.knots) - 2, 1 / (self.knots[1] - self.knots[0])

    def __call__(self, t: float) -> np.ndarray:
        i = min(int(t * self.per_second), self.last)
        s, c = t - self.knots[i], self.coefficients[i]
        return c[0] + s * (c[1] + s * (c[2] + s * c[3]))


def simulate(task: Task, pose: np.ndarray, rtol: float, atol: float) -> np.ndarray:
    """Return slide_1..3 and pivot_1..3 at the end of a task (6,) by SciPy's RK45; pose: of the
    platform at the start."""
    forces = Lookup(task.signal)

    def f(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate(derivative(y[:9], y[9:], forces(t)))

    start = np.concatenate([from_joints(task.start.positions, pose), task.start.rates])
    end = solve_ivp(
        f, (0.0, task.duration), start, method="RK45", rtol=rtol, atol=atol, t_eval=[task.duration]
    )
    return sliding_and_pivoting(end.y[:, -1])
