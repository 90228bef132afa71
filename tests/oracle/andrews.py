"""Andrews' squeezer from the IVP test set's own equations, to compare with at 1e-10.

The test set (Mazzia & Magherini 2008, problem "Andrews' squeezing mechanism"; Hairer & Wanner,
Solving Ordinary Differential Equations II, sec. VII.7) writes, for q = (beta, Theta, gamma, Phi,
delta, Omega, epsilon),

    M(q) q'' = f(q, q') - G(q)' lambda,     g(q) = 0,     G = dg/dq

with M and f worked out by hand. With g'' = G q'' + (dG/dt) q' = 0 the accelerations and multipliers
are

    [M  G'] [q''   ]   [f            ]
    [G  0 ] [lambda] = [-(dG/dt) q'  ]

The motion follows from the state (q, q'), of which only (beta, beta') counts: before every use the
other six angles are set by Newton's method and the other six rates by G q' = 0. Nothing is shared
with the library.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, sin

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

m1, m2, m3, m4, m5, m6, m7 = 0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498
I1, I2, I3, I4, I5, I6, I7 = 2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5
xa, ya, xb, yb, xc, yc = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072
c0, l0, torque = 4530.0, 0.07785, 0.033
d, da, e, ea, rr, ra, ss, sa, sb = (
    0.028,
    0.0115,
    0.02,
    0.01421,
    0.007,
    0.00092,
    0.035,
    0.01874,
    0.01043,
)
sc, sd, ta, tb, u, ua, ub, zf, zt, fa = (
    0.018,
    0.02,
    0.02308,
    0.00916,
    0.04,
    0.01228,
    0.00449,
    0.02,
    0.04,
    0.01421,
)

START = np.array(
    [
        -0.0617138900142764496358948458001,
        0.0,
        0.455279819163070380255912382449,
        0.222668390165885884674473185609,
        0.487364979543842550225598953530,
        -0.222668390165885884674473185609,
        1.23054744454982119249735015568,
    ]
)


def closures(q: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return g (6,) [m]."""
    be, th, ga, ph, de, om, ep = q
    x, y = rr * cos(be) - d * cos(be + th), rr * sin(be) - d * sin(be + th)
    return np.array(
        [
            x - ss * sin(ga) - xb,
            y + ss * cos(ga) - yb,
            x - e * sin(ph + de) - zt * cos(de) - xa,
            y + e * cos(ph + de) - zt * sin(de) - ya,
            x - zf * cos(om + ep) - u * sin(ep) - xa,
            y - zf * sin(om + ep) + u * cos(ep) - ya,
        ]
    )


def jacobian(q: np.ndarray) -> np.ndarray:
    """Return G (6, 7)."""
    be, th, ga, ph, de, om, ep = q
    G = np.zeros((6, 7))
    G[::2, 1], G[1::2, 1] = d * sin(be + th), -d * cos(be + th)
    G[::2, 0], G[1::2, 0] = G[::2, 1] - rr * sin(be), G[1::2, 1] + rr * cos(be)
    G[:2, 2] = -ss * cos(ga), -ss * sin(ga)
    G[2:4, 3] = -e * cos(ph + de), -e * sin(ph + de)
    G[2:4, 4] = G[2:4, 3] + [zt * sin(de), -zt * cos(de)]
    G[4:, 5] = zf * sin(om + ep), -zf * cos(om + ep)
    G[4:, 6] = G[4:, 5] + [-u * cos(ep), -u * sin(ep)]
    return G


def curvature(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return (dG/dt) q' (6,): the second derivative of g along constant rates."""
    be, th, ga, ph, de, om, ep = q
    w = v[0], v[0] + v[1], v[2], v[3] + v[4], v[4], v[5] + v[6], v[6]
    s1, s2, s3, s4, s5, s6, s7 = (rate**2 for rate in w)
    x = -rr * cos(be) * s1 + d * cos(be + th) * s2
    y = -rr * sin(be) * s1 + d * sin(be + th) * s2
    return np.array(
        [
            x + ss * sin(ga) * s3,
            y - ss * cos(ga) * s3,
            x + e * sin(ph + de) * s4 + zt * cos(de) * s5,
            y - e * cos(ph + de) * s4 + zt * sin(de) * s5,
            x + zf * cos(om + ep) * s6 + u * sin(ep) * s7,
            y + zf * sin(om + ep) * s6 - u * cos(ep) * s7,
        ]
    )


def mass_matrix(q: np.ndarray) -> np.ndarray:
    """Return M (7, 7) [kg m^2]."""
    _, th, _, ph, _, om, _ = q
    M = np.zeros((7, 7))
    M[0, 0] = m1 * ra**2 + m2 * (rr**2 - 2 * da * rr * cos(th) + da**2) + I1 + I2
    M[1, 0] = M[0, 1] = m2 * (da**2 - da * rr * cos(th)) + I2
    M[1, 1] = m2 * da**2 + I2
    M[2, 2] = m3 * (sa**2 + sb**2) + I3
    k = e - ea
    M[3, 3] = m4 * k**2 + I4
    M[4, 3] = M[3, 4] = m4 * (k**2 + zt * k * sin(ph)) + I4
    M[4, 4] = m4 * (zt**2 + 2 * zt * k * sin(ph) + k**2) + m5 * (ta**2 + tb**2) + I4 + I5
    k = zf - fa
    M[5, 5] = m6 * k**2 + I6
    M[6, 5] = M[5, 6] = m6 * (k**2 - u * k * sin(om)) + I6
    M[6, 6] = m6 * (k**2 - 2 * u * k * sin(om) + u**2) + m7 * (ua**2 + ub**2) + I6 + I7
    return M


def spring(q: np.ndarray) -> tuple[float, float, float]:
    """Return the spring's length [m] and its force on K3 [N]."""
    ga = q[2]
    x, y = sd * cos(ga) + sc * sin(ga) + xb - xc, sd * sin(ga) - sc * cos(ga) + yb - yc
    length = hypot(x, y)
    force = -c0 * (length - l0) / length
    return length, force * x, force * y


def forces(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return f (7,) [N m]."""
    _, th, ga, ph, _, om, _ = q
    be_, th_, _, ph_, de_, om_, ep_ = v
    _, fx, fy = spring(q)
    return np.array(
        [
            torque - m2 * da * rr * th_ * (th_ + 2 * be_) * sin(th),
            m2 * da * rr * be_**2 * sin(th),
            fx * (sc * cos(ga) - sd * sin(ga)) + fy * (sd * cos(ga) + sc * sin(ga)),
            m4 * zt * (e - ea) * de_**2 * cos(ph),
            -m4 * zt * (e - ea) * ph_ * (ph_ + 2 * de_) * cos(ph),
            -m6 * u * (zf - fa) * ep_**2 * cos(om),
            m6 * u * (zf - fa) * om_ * (om_ + 2 * ep_) * cos(om),
        ]
    )


def accelerations(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return q'' (7,) [rad/s^2] and lambda (6,) [N]."""
    G = jacobian(q)
    KKT = np.block([[mass_matrix(q), G.T], [G, np.zeros((6, 6))]])
    solution = np.linalg.solve(KKT, np.concatenate([forces(q, v), -curvature(q, v)]))
    return solution[:7], solution[7:]


def energy(q: np.ndarray, v: np.ndarray) -> float:
    """Return kinetic energy, the spring's energy, and that still in the drive: v'M v/2 + c0
    (l - l0)^2/2 - torque beta."""
    return v @ mass_matrix(q) @ v / 2 + c0 * (spring(q)[0] - l0) ** 2 / 2 - torque * q[0]


def closed(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the state with beta and beta' kept, the other angles and rates such that g = 0 and G
    q' = 0."""
    q = np.array(q, dtype=float)
    for _ in range(20):
        step = np.linalg.solve(jacobian(q)[:, 1:], closures(q))
        q[1:] -= step
        if max(abs(step)) < 1e-12:
            break
    G = jacobian(q)
    return q, np.concatenate([v[:1], np.linalg.solve(G[:, 1:], -G[:, 0] * v[0])])


def motion(
    times: ArrayLike, start: np.ndarray = START, tolerance: float = 1e-13
) -> tuple[np.ndarray, np.ndarray]:
    """Return q and q' (times, 7) from rest at t = 0, by Dormand and Prince's method of order 8."""

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        q, v = closed(y[:7], y[7:])
        return np.concatenate([v, accelerations(q, v)[0]])

    run = solve_ivp(
        rates,
        (0.0, np.max(times)),
        np.concatenate([closed(start, np.zeros(7))[0], np.zeros(7)]),
        method="DOP853",
        t_eval=times,
        rtol=tolerance,
        atol=tolerance,
    )
    states = [closed(y[:7], y[7:]) for y in run.y.T]
    return np.array([q for q, _ in states]), np.array([v for _, v in states])
