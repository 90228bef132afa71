"""Mechanisms whose equations of motion have a closed form, and that form: tau = M q_a'' + C q_a' +
G.

The formulas are Lagrange's equations of one or two coordinates, written from the geometry (as in
Goldstein, "Classical Mechanics", ch. 1, and, for the slider-crank, Norton, "Design of Machinery");
they know nothing of twists.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, cos, pi, sin, tan

import numpy as np

from linkwork.mechanism import Body, Frame, Inertia, Mechanism, PrismaticJoint, RevoluteJoint

g = 9.81
DOWN = (0.0, -g, 0.0)


def bar(mass: float, centre: float, inertia: float) -> Body:
    """Return a planar body with its mass centre on its x axis."""
    return Body(mass=mass, centre_of_mass=(centre, 0.0, 0.0), inertia=Inertia(zz=inertia))


@dataclass(frozen=True)
class Pendulum:
    """Swing in a plane tilted from the vertical: (I + m a^2) q'' + m g cos(tilt) a sin q = tau, q
    from below."""

    m: float = 1.3
    a: float = 0.4
    I: float = 0.07  # noqa: E741
    tilt: float = 0.6

    def mechanism(self) -> Mechanism:
        plane = Frame(
            rotation=(-self.tilt, 0.0, 0.0)
        )  # the plane's y axis is tilted away from the ground's
        return Mechanism(
            gravity=DOWN,
            bodies={"bob": bar(self.m, self.a, self.I)},
            joints={
                "hinge": RevoluteJoint(
                    connects=("ground", "bob"), frames=(plane, Frame.planar(angle=pi / 2))
                )
            },
            actuators=("hinge",),
        )

    def force(self, q: float, rate: float, acceleration: float) -> float:
        return (self.I + self.m * self.a**2) * acceleration + self.m * g * cos(
            self.tilt
        ) * self.a * sin(q)


@dataclass(frozen=True)
class DoublePendulum:
    """Swing in the vertical xy plane: absolute angles theta_1 = q_1, theta_2 = q_1 + q_2 from the x
    axis, l_1 long."""

    m: tuple[float, float] = (1.1, 0.7)
    a: tuple[float, float] = (0.25, 0.3)
    I: tuple[float, float] = (0.03, 0.02)  # noqa: E741
    l1: float = 0.6

    def mechanism(self) -> Mechanism:
        return Mechanism(
            gravity=DOWN,
            bodies={f"bar_{i + 1}": bar(self.m[i], self.a[i], self.I[i]) for i in (0, 1)},
            joints={
                "shoulder": RevoluteJoint(connects=("ground", "bar_1")),
                "elbow": RevoluteJoint(
                    connects=("bar_1", "bar_2"), frames=(Frame.planar(self.l1), Frame())
                ),
            },
            actuators=("shoulder", "elbow"),
        )

    def force(self, q: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Apply Lagrange's equations to the absolute angles; a force Q_2 of theta_2 acts on both
        q_1 and q_2."""
        (m1, m2), (a1, a2), (I1, I2), l1 = self.m, self.a, self.I, self.l1
        th1, th2 = q[0], q[0] + q[1]
        w1, w2 = rate[0], rate[0] + rate[1]
        al1, al2 = acceleration[0], acceleration[0] + acceleration[1]
        c, s = cos(th1 - th2), sin(th1 - th2)
        Q1 = (I1 + m1 * a1**2 + m2 * l1**2) * al1 + m2 * l1 * a2 * (c * al2 + s * w2**2)
        Q2 = (I2 + m2 * a2**2) * al2 + m2 * l1 * a2 * (c * al1 - s * w1**2)
        Q1 += (m1 * a1 + m2 * l1) * g * cos(th1)
        Q2 += m2 * a2 * g * cos(th2)
        return np.array([Q1 + Q2, Q2])


@dataclass(frozen=True)
class SliderCrank:
    """Drive a crank (length r) with a rod (length l, mass centre at b) and a slider on the x axis;
    gravity along -y.

    With sin(beta) = (r/l) sin(theta), every body's motion is a function of theta, so with the
    kinetic energy
    J(theta) theta'^2 / 2:   tau = J theta'' + J_theta theta'^2 / 2 + V_theta.
    """

    r: float = 0.2
    l: float = 0.7  # noqa: E741
    a: float = 0.08
    b: float = 0.3
    m: tuple[float, float, float] = (0.9, 0.6, 1.4)
    I: tuple[float, float] = (0.011, 0.025)  # noqa: E741

    def mechanism(self) -> Mechanism:
        return Mechanism(
            gravity=DOWN,
            bodies={
                "crank": bar(self.m[0], self.a, self.I[0]),
                "rod": bar(self.m[1], self.b, self.I[1]),
                "slider": bar(self.m[2], 0.0, 0.01),
            },
            joints={
                "main": RevoluteJoint(connects=("ground", "crank")),
                "pin": RevoluteJoint(
                    connects=("crank", "rod"), frames=(Frame.planar(self.r), Frame())
                ),
                "wrist": RevoluteJoint(
                    connects=("slider", "rod"), frames=(Frame(), Frame.planar(self.l))
                ),
                "guide": PrismaticJoint(connects=("ground", "slider"), axis=(1.0, 0.0, 0.0)),
            },
            actuators=("main",),
            reference=dict(
                zip(("main", "pin", "wrist", "guide"), self.coordinates(0.5), strict=True)
            ),
        )

    def coordinates(self, theta: float) -> tuple[float, float, float, float]:
        """Return all joint coordinates: main, pin, wrist, guide."""
        beta = asin(self.r / self.l * sin(theta))
        return theta, -theta - beta, -beta, self.r * cos(theta) + self.l * cos(beta)

    def force(self, theta: float, rate: float, acceleration: float) -> float:
        r, l, a, b = self.r, self.l, self.a, self.b  # noqa: E741
        (m1, m2, m3), (I1, I2) = self.m, self.I
        c, s = cos(theta), sin(theta)
        beta = asin(r / l * s)
        beta_1 = r * c / (l * cos(beta))
        beta_2 = -r * s / (l * cos(beta)) + beta_1**2 * tan(beta)
        x_1 = -r * s - l * sin(beta) * beta_1
        x_2 = -r * c - l * cos(beta) * beta_1**2 - l * sin(beta) * beta_2
        rod_1 = np.array([-r * s - b * sin(beta) * beta_1, r * c - b * cos(beta) * beta_1])
        rod_2 = np.array(
            [
                -r * c - b * cos(beta) * beta_1**2 - b * sin(beta) * beta_2,
                -r * s + b * sin(beta) * beta_1**2 - b * cos(beta) * beta_2,
            ]
        )
        J = I1 + m1 * a**2 + I2 * beta_1**2 + m2 * rod_1 @ rod_1 + m3 * x_1**2
        half_J_1 = I2 * beta_1 * beta_2 + m2 * rod_1 @ rod_2 + m3 * x_1 * x_2
        V_1 = g * (m1 * a * c + m2 * rod_1[1])
        return J * acceleration + half_J_1 * rate**2 + V_1
