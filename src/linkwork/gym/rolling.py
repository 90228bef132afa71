"""A ball that rolls on a plane of a moving body, as further states of a decision process.

With R, p the body's frame, Omega its angular velocity, n = R e_z, and the point of contact at
p + rho, rho = R (x, y, height), which moves with the body at V = p' + Omega x rho:

    rolling           c' = V + r omega x n                      c: the ball's centre
    about the contact h' = (Omega x n) x c' + n x g,            h = k r omega + n x c'
    in the body       R (x', y', 0) = r (omega - Omega) x n

k = I / (m r^2), 2/5 of a full ball. h, the angular momentum about the moving point of contact over
m r, changes by velocities alone, so that no acceleration of the body is needed:

    r omega = (h - (n . h) n - n x V) / (1 + k) + (n . h) n / k

The ball neither slips nor leaves the plane, and does not act back on the body: it is light beside
it. On a plane at rest c'' = g_t / (1 + k), 5/7 of gravity's part along the plane.

Source: Neimark & Fufaev, Dynamics of Nonholonomic Systems, ch. III (a ball on a moving surface).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linkwork import checks, math
from linkwork.control.drives import Extra
from linkwork.control.observation import Observation
from linkwork.errors import LinkworkError

FULL = 2 / 5


@dataclass(frozen=True)
class RollingBall:
    """Describe a ball on the plane z = height of a body's frame.

    Attributes:
        body: its name; height: of the plane in the body's frame [m].
        radius: r [m]; gravity: in the ground's axes [m/s^2].
        inertia: k = I / (m r^2) [1], 2/5 of a full ball, 2/3 of a hollow one.
        name: of the ball; its states are name.x, name.y, where it touches, in the body's frame [m],
            and name.hx, hy, hz, h in the ground's axes [m/s].
    """

    body: str
    height: float
    radius: float
    gravity: tuple[float, float, float]
    inertia: float = FULL
    name: str = "ball"

    def __post_init__(self) -> None:
        for what in ("body", "name"):
            if not isinstance(getattr(self, what), str):
                told = checks.shown(getattr(self, what))
                raise LinkworkError(f"the {what} of a ball is {told}; give a name")
        checks.number(self.height, "the height of a ball's plane")
        checks.positive(self.radius, "the radius of a ball", "m")
        checks.amount_of(self.inertia, "the inertia of a ball")
        if checks.finite(self.gravity, "the gravity of a ball").shape != (3,):
            raise LinkworkError(
                f"the gravity of a ball is {checks.shown(self.gravity)}; give three numbers"
            )

    @property
    def states(self) -> tuple[Extra, ...]:
        """The states, at rest in the middle at first."""
        units = {"x": "m", "y": "m", "hx": "m/s", "hy": "m/s", "hz": "m/s"}
        return tuple(Extra(f"{self.name}.{part}", unit, 0.0) for part, unit in units.items())

    def place(self, state: Observation) -> np.ndarray:
        """Return (x, y) [m].

        state: of the run, with the ball's states.
        """
        return math.array([state.extra(f"{self.name}.{part}") for part in ("x", "y")])

    def velocity(self, state: Observation) -> np.ndarray:
        """Return (x', y') [m/s], relative to the body.

        state: of the run, with the ball's states.
        """
        frame, normal, _, spin = self._motion(state)
        relative = math.cross(spin - self.radius * frame.angular_velocity, normal)
        return (frame.rotation.T @ relative)[:2]

    def rates(self, state: Observation) -> np.ndarray:
        """Return the rates of the states (5).

        state: of the run, with the ball's states.
        """
        frame, normal, velocity, spin = self._motion(state)
        turning = math.cross(frame.angular_velocity, normal)
        moment = math.cross(turning, velocity + math.cross(spin, normal))
        moment = moment + math.cross(normal, math.array(list(self.gravity)))
        return math.array([*self.velocity(state), *moment])

    def _motion(self, state: Observation) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray]:
        """Return the body's motion, n, V and r omega."""
        frame, (x, y) = state.body(self.body), self.place(state)
        normal = frame.rotation[:, 2]
        arm = frame.rotation @ math.array([x, y, self.height])
        velocity = frame.velocity + math.cross(frame.angular_velocity, arm)
        h = math.array([state.extra(f"{self.name}.{part}") for part in ("hx", "hy", "hz")])
        about = math.dot(normal, h) * normal
        along = h - about - math.cross(normal, velocity)
        return frame, normal, velocity, along / (1 + self.inertia) + about / self.inertia
