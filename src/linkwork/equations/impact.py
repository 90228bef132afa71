"""The force with which parts that meet press on each other, as an expression of depth and rate.

    F = k d^n max(1 + c d', 0)    for d > 0,  0 else          stored: k d^(n + 1) / (n + 1)

It is switched exactly, so that free flight is free and has no derivatives of any order, and
continuous in depth and rate; for n > 1 so is its slope in the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from linkwork.mechanism.impact import Impact

TINY = 1e-100  # depth of which powers and their derivatives are finite


@dataclass(frozen=True)
class Pressing:
    """Hold a law and the depth of parts in each other, negative where they are apart."""

    law: Impact
    depth: ca.SX

    @property
    def elastic(self) -> ca.SX:
        """The force at rest."""
        return self.law.stiffness * self._power(self.law.exponent)

    @property
    def potential(self) -> ca.SX:
        """The energy that is stored."""
        power = self.law.exponent + 1
        return self.law.stiffness * self._power(power) / power

    def dissipative(self, rate: ca.SX) -> ca.SX:
        """Return what the rate of the depth adds to the force at rest."""
        return self.elastic * ca.fmax(self.law.loss * rate, -1)

    def force(self, rate: ca.SX) -> ca.SX:
        """Return the force, for the rate of the depth."""
        return self.elastic * ca.fmax(1 + self.law.loss * rate, 0)

    def _power(self, exponent: float) -> ca.SX:
        """Return d^exponent, zero where parts are apart."""
        apart = self.depth <= 0
        return ca.if_else(apart, 0, ca.constpow(ca.if_else(apart, TINY, self.depth), exponent))
