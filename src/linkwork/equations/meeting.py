"""What is told of a place where two surfaces may meet."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

TINY = 1e-300  # square of a distance that is not divided by zero
PARALLEL = 1e-12  # square of the sine between segments that count as parallel


@dataclass(frozen=True)
class Meeting:
    """Hold a place where two surfaces may meet, in the ground's axes: how far they are apart.

    centre: where the force acts that presses, along the `gradient` of the gap for a motion of the
        second body there; point: where they rub, and the unit `normal` there, out of the first body
    couple: the gradient for turns of the second body about the centre; None where it is nothing
    """

    gap: ca.SX
    centre: ca.SX
    gradient: ca.SX
    point: ca.SX
    normal: ca.SX
    couple: ca.SX | None = None

    def turned(self) -> Meeting:
        """Return the place with both bodies exchanged."""
        couple = None if self.couple is None else -self.couple
        return Meeting(self.gap, self.centre, -self.gradient, self.point, -self.normal, couple)


def share(s: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(s, 0), 1)
