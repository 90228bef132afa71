"""Published mechanisms of one freedom, reduced by hand: with one coordinate s, the inertia J(s) and
the potential V(s),

    L = J(s) s'^2 / 2 - V(s),      J s'' = Q - J_s s'^2 / 2 - V_s

J and V are written from the geometry in closed form, with plain sines and roots, so that they are
analytic: the derivatives J_s and V_s come from one evaluation at s + i h, exact to rounding (Squire
& Trapp, SIAM Review 40, 1998).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.special import ellipj

g = 9.81
STEP = 1e-100  # h


@dataclass(frozen=True)
class OneFreedom:
    """Hold the analytic function s -> (J, V)."""

    terms: Callable[[complex], tuple[complex, complex]]

    def acceleration(self, s: float, rate: float, force: float = 0.0) -> float:
        """Return s''."""
        J, V = self.terms(complex(s, STEP))
        return (force - J.imag / STEP * rate**2 / 2 - V.imag / STEP) / J.real

    def energy(self, s: float, rate: float) -> float:
        """Return J s'^2 / 2 + V."""
        J, V = self.terms(complex(s))
        return J.real * rate**2 / 2 + V.real

    def motion(
        self, times: ArrayLike, s: float, rate: float, tolerance: float = 1e-13
    ) -> np.ndarray:
        """Return (s, s') at the times (2, times), from (s, s') at t = 0, without force."""
        return solve_ivp(
            lambda _, y: [y[1], self.acceleration(y[0], y[1])],
            (0.0, np.max(times)),
            [s, rate],
            method="DOP853",
            t_eval=times,
            rtol=tolerance,
            atol=tolerance,
        ).y


def pendulum(times: ArrayLike, length: float = 1.0) -> np.ndarray:
    """Return the angle from the x axis of a point mass let go there: q = 2 asin(k cd(w t, k)) -
    pi/2, k = sin(pi/4)."""
    _, cn, dn, _ = ellipj(np.sqrt(g / length) * np.asarray(times), 0.5)
    return 2 * np.arcsin(np.sqrt(0.5) * cn / dn) - np.pi / 2


def n_four_bar(loops: int) -> OneFreedom:
    """Reduce the N-four-bar (m = l = 1) to its cranks' angle, while they stay parallel.

    N + 1 rods turn about their ends, J = 1/3 each, and lift their middles; N couplers move with the
    cranks' tips.
    """
    return OneFreedom(
        lambda s: (complex((loops + 1) / 3 + loops), ((loops + 1) / 2 + loops) * g * np.sin(s))
    )


# The spatial slider-crank: s = t, the crank's angle.

r, L, Y, Z = 0.08, 0.3, 0.1, 0.12
SLIDER_CRANK_MASSES, CRANK_INERTIA, ROD_INERTIA = (0.12, 0.5, 2.0), 1e-4, (4e-4, 4e-3, 4e-3)


def slide(t: complex) -> complex:
    """Return the slider's place: L^2 less the squares of the pin's y and z."""
    return np.sqrt(L**2 - (Y - r * np.sin(t)) ** 2 - (Z + r * np.cos(t)) ** 2)


def spatial_slider_crank() -> OneFreedom:
    """Reduce the IFToMM slider-crank: the rod turns by c_1 about x, then by c_2 across; sin c_2 =
    |(B_y, B_z)| / L."""
    m_crank, m_rod, m_slider = SLIDER_CRANK_MASSES

    def terms(t: complex) -> tuple[complex, complex]:
        y, z, y_t, z_t = Y - r * np.sin(t), Z + r * np.cos(t), -r * np.cos(t), -r * np.sin(t)
        x, square = slide(t), y**2 + z**2
        x_t = -(y * y_t + z * z_t) / x
        c1_t, c2_t = (y * z_t - z * y_t) / square, -x_t / np.sqrt(square)
        middle = (x_t**2 + y_t**2 + z_t**2) / 4
        xx, yy, zz = ROD_INERTIA
        turning = xx * c1_t**2 * x**2 / L**2 + yy * c2_t**2 + zz * c1_t**2 * square / L**2
        J = CRANK_INERTIA + m_crank * r**2 / 4 + m_rod * middle + m_slider * x_t**2 + turning
        return J, g * (m_crank * (Z + z) / 2 + m_rod * z / 2)

    return OneFreedom(terms)


# The Bricard linkage: s = psi, going round the closed curve of its configurations.

ALONG, ACROSS = (
    0.1**2 / 6,
    (1 + 0.1**2) / 12,
)  # moments of a rod of 1 kg, 1 m, 0.1 m square about its middle
RIGHT_ANGLES = np.arcsin(1 / np.sqrt(3))  # psi at which all neighbouring rods are perpendicular


def bricard_turns(psi: complex) -> tuple[complex, complex]:
    """Return the angles theta, phi between neighbouring rods, at hinges 1, 3, 5 and at hinges 2, 4,
    6.

    The hinges' axes are perpendicular from rod to rod and all rods are of one length; then the
    six-bar closes with (1 + cos theta)(1 + cos phi) = 1, that is (1 + tan^2 theta/2)(1 + tan^2
    phi/2) = 4 (Chen, You & Tarnai, Int. J. Solids and Structures 42, 2005, threefold-symmetric
    Bricard linkages): tan theta/2 = sqrt 3 sin psi.
    """
    s, c = np.sin(psi), np.cos(psi)
    return 2 * np.arctan(np.sqrt(3) * s), 2 * np.arctan(np.sqrt(3) * c / np.sqrt(1 + 3 * s**2))


def bricard_rods(psi: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the six rods' directions e, hinge axes u and starting points o (6, 3); the last rod is
    the ground."""
    e, u, o = np.array([0, 0, -1]), np.array([0, -1, 0]), np.zeros(3)
    turns, rows = bricard_turns(psi), []
    for i in range(6):
        e = np.cos(turns[i % 2]) * e + np.sin(turns[i % 2]) * cross(u, e)
        rows.append((e, u, o))
        u, o = (-1) ** i * cross(e, u), o + e
    directions, axes, origins = (np.array(row) for row in zip(*rows, strict=True))
    return directions, axes, origins


def bricard() -> OneFreedom:
    """Reduce the Bricard linkage (1 kg, 1 m, section 0.1 m, gravity along -y)."""

    def terms(psi: complex) -> tuple[complex, complex]:
        s, root = np.sin(psi), 1 + 3 * np.sin(psi) ** 2
        rates = 2 * np.sqrt(3) * np.cos(psi) / root, -2 * np.sqrt(3) * s / np.sqrt(root)
        directions, axes, origins = bricard_rods(psi)
        omega, v, J = np.zeros(3), np.zeros(3), 0.0
        for i, (e, u) in enumerate(zip(directions[:5], axes[:5], strict=True)):
            omega = omega + u * rates[i % 2]
            swing = cross(omega, e)
            middle = v + swing / 2
            J += middle @ middle + ACROSS * (swing @ swing) + ALONG * (omega @ e) ** 2
            v = v + swing
        return J, g * np.sum(origins[:5, 1] + directions[:5, 1] / 2)

    return OneFreedom(terms)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a x b."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
