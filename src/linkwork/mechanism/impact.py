"""How parts that meet press on each other: the law of Hunt and Crossley, for stops and contacts.

At the depth d, the force  k d^n max(1 + c d', 0)  is zero where the parts part, grows steadily from
there, and never pulls. A free mass that comes in with the rate v_i goes with v_o, whatever mass, k
and n are:

    a - ln(1 + a) = -b - ln(1 - b),    a = c v_i,  b = c v_o

Source: Hunt & Crossley 1975, Coefficient of restitution interpreted as damping in vibroimpact.
"""

from __future__ import annotations

from functools import lru_cache
from math import log1p
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from linkwork.mechanism.record import Amount, Positive, Real, Record
from linkwork.mechanism.refusal import PLAIN

SMALL = 0.1  # |u| up to which (u - ln(1 + u)) / u^2 is summed
TERMS = 18
HALVINGS = 60


def compliant(stiffness: Any) -> Any:
    """Refuse rigid contact."""
    if stiffness == "rigid" or stiffness == float("inf"):
        raise ValueError(
            "rigid contact, by complementarity conditions, is not there: its impacts are jumps of "
            "the rates, and with friction its forces may be none or many; give a stiffness, such "
            "as m v^2 over the square of the depth that does not matter"
        )
    return stiffness


class Impact(Record):
    """Press back where parts meet: F = stiffness d^exponent max(1 + c d', 0) at the depth d > 0.

    c is `dissipation`, and what leaves a free mass that comes in with `impact_rate` the share
    `restitution` of that rate; both add up.
    """

    stiffness: Annotated[Positive, BeforeValidator(compliant)] = Field(
        description="force per depth^exponent [N/m^exponent, N m/rad^exponent]"
    )
    exponent: Annotated[float, Field(ge=1, le=10, allow_inf_nan=False), PLAIN] = Field(
        default=1.5, description="power of the depth; 1.5 of round bodies (Hertz), 1 of a spring"
    )
    dissipation: Amount = Field(
        default=0.0, description="part by which the force grows per rate of the depth [s/m, s/rad]"
    )
    restitution: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False), PLAIN] = Field(
        default=1.0, description="rate after an impact over that before, at impact_rate"
    )
    impact_rate: Positive = Field(
        default=1.0, description="rate of the impact that restitution is told for [m/s, rad/s]"
    )

    @property
    def loss(self) -> Any:
        """The number c [s/m, s/rad]."""
        return self.dissipation + loss_of(self.restitution) / self.impact_rate


class Stop(Impact):
    """Stop a freedom at its ends: past `upper`, or the upper limit, by d = q - upper, and likewise
    below `lower`."""

    lower: Real | None = Field(
        default=None, description="coordinate where it begins below [m, rad]; the limit if left out"
    )
    upper: Real | None = Field(
        default=None, description="coordinate where it begins above [m, rad]; the limit if left out"
    )


@lru_cache
def loss_of(restitution: float) -> float:
    """Return a = c v_i for v_o = restitution v_i, by halving the interval (0, 1 / restitution)."""
    if restitution == 1:
        return 0.0
    low, high = 0.0, 1 / restitution
    for _ in range(HALVINGS):
        a = (low + high) / 2
        if excess(a) > restitution**2 * excess(-restitution * a):
            low = a
        else:
            high = a
    return (low + high) / 2


def excess(u: float) -> float:
    """Return (u - ln(1 + u)) / u^2, which is 1 / 2 at zero and infinite at -1."""
    if abs(u) < SMALL:
        return sum((-u) ** k / (k + 2) for k in range(TERMS))
    return (u - log1p(u)) / u**2 if u > -1 else float("inf")
