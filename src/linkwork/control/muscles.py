"""Muscles as drives: an activation that follows the command, and a pull by length and rate.

    L = (l - tendon_length) / L_0,   V = l' / (vmax L_0),   l = gear x,   l' = gear w
    F = -gear F_0 (FL(L) FV(V) a + FP(L))
    a' = (c - a) / tau,   tau = t_1 (1/2 + 3/2 a) where c > a,   t_2 / (1/2 + 3/2 a) where c < a

with the command c within 0 and 1. FL is 1 at L = 1 and 0 at lmin and lmax, of parabolas that meet
at 1/2 half-way; FV is 0 from V = -1 on, 1 at rest, and reaches fvmax at V = fvmax - 1; FP is a
parabola from L = 1 on, fpmax / 2 half-way to lmax, and straight from there.

Sources: the MJCF reference of MuJoCo 4, "actuator/muscle", and its computation of forces; the time
constants are those of Millard, Uchida, Seth & Delp, J. Biomechanical Engineering 135 (2013) 021005.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from linkwork import math
from linkwork.control.drives import Drive, Extra
from linkwork.control.records import number
from linkwork.errors import LinkworkError
from linkwork.mechanism.record import Amount, Positive

AT_ONCE = 1e-15  # width of a change of time constants that is a jump


@dataclass(frozen=True)
class Muscle(Drive):
    """Pull as a muscle does along a length, by tension alone; the command is its excitation, from 0
    to 1."""

    peak_force: float = number("F_0, of the active muscle at rest at L = 1", "N", Positive)
    optimum_length: float = number("L_0", "m", Positive)
    tendon_length: float = number("what of l is no muscle", "m", default=0.0)
    gear: float = number("l by joint coordinate", "1", default=1.0)
    least_length: float = number("lmin, in L", "1", default=0.5)
    largest_length: float = number("lmax, in L", "1", default=1.6)
    fastest: float = number("vmax, of shortening, in L", "1/s", Positive, 1.5)
    passive: float = number("fpmax, passive force at lmax, of F_0", "1", Amount, 1.3)
    lengthening: float = number("fvmax, largest force in lengthening, of F_0", "1", default=1.2)
    activation_time: float = number("t_1", "s", Positive, 0.01)
    deactivation_time: float = number("t_2", "s", Positive, 0.04)
    blend: float = number("width in c - a from t_2 to t_1, 0 for a jump", "1", Amount, 0.0)
    least_excitation: float = number("bound of c", "1", default=0.0)
    largest_excitation: float = number("bound of c", "1", default=1.0)
    initial_activation: float = number("a at the start", "1", default=0.0)

    type: ClassVar[str] = "muscle"
    unit: ClassVar[str] = "1"

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(map(math.symbolic, vars(self).values())):
            return
        fits = {
            "least_length < 1 < largest_length": self.least_length < 1 < self.largest_length,
            "lengthening > 1": self.lengthening > 1,
            "0 <= least_excitation <= largest_excitation <= 1": (
                0 <= self.least_excitation <= self.largest_excitation <= 1
            ),
            "0 <= initial_activation <= 1": 0 <= self.initial_activation <= 1,
        }
        for rule, holds in fits.items():
            if not holds:
                raise LinkworkError(f"numbers of Muscle do not fit; give them so that {rule}")

    @property
    def extras(self):
        return (Extra("activation", "1", self.initial_activation),)

    def equations(self, command, x, w, z):
        c = math.clip(command, self.least_excitation, self.largest_excitation)
        return self.force(z[0], self.gear * x, self.gear * w), (self.activating(c, z[0]),)

    def activating(self, excitation: Any, activation: Any) -> Any:
        """Return a' for an excitation and an activation."""
        more = excitation - activation
        slower = 0.5 + 1.5 * math.clip(activation, 0, 1)
        up, down = self.activation_time * slower, self.deactivation_time / slower
        s = math.clip(more / math.maximum(self.blend, AT_ONCE) + 0.5, 0, 1)
        share = s**3 * (s * (6 * s - 15) + 10)
        return more / (down + (up - down) * share)

    def force(self, activation: Any, length: Any, rate: Any) -> Any:
        """Return F for an activation, l and l'.

        activation: from 0 to 1; length: l [m, rad]; rate: l' [m/s, rad/s].
        """
        L = (length - self.tendon_length) / self.optimum_length
        V = rate / (self.optimum_length * self.fastest)
        active = self.by_length(L) * self.by_rate(V) * activation
        return -self.gear * self.peak_force * (active + self.at_rest(L))

    def by_length(self, L: Any) -> Any:
        """Return FL: half parabolas up to 1/2 and to 1, and down again.

        L: of the muscle, its length over the optimum one.
        """
        low, high = self.least_length, self.largest_length
        width = math.where(L < 1, (1 - low) / 2, (high - 1) / 2)
        away = math.abs(L - 1) / width
        return math.where(away < 1, 1 - away**2 / 2, math.maximum(2 - away, 0) ** 2 / 2)

    def by_rate(self, V: Any) -> Any:
        """Return FV.

        V: of the muscle, its rate over the fastest one.
        """
        y = self.lengthening - 1
        slow, fast = math.maximum(V + 1, 0), math.maximum(y - V, 0)
        return math.where(V < 0, slow**2, self.lengthening - fast**2 / y)

    def at_rest(self, L: Any) -> Any:
        """Return FP."""
        x = math.maximum(L - 1, 0) / ((self.largest_length - 1) / 2)
        return self.passive * math.where(x < 1, x**2 / 2, x - 0.5)
