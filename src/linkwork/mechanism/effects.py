"""What acts inside a joint or between two points, apart from actuators: friction, springs, dampers,
limits, stops.

Forces act on the second body, against the coordinate q or the rate w of a freedom; for the free
turn of a spherical joint q is the rotation vector of R_12 and w the relative angular velocity.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from pydantic import Field, model_validator

from linkwork.mechanism.impact import Stop
from linkwork.mechanism.record import Amount, MechanismError, Name, Positive, Real, Record, Vector3


class Bristle(Record):
    """Let dry friction stick, as if bristles bent before they slip (LuGre): s' = stiffness z',
    z' = w - |w| s / D(w), and s + damping z' is the force, with the friction D of steady sliding.

    In a contact both are for a normal force of 1 N.
    """

    stiffness: Positive = Field(
        description="force per deflection [N/m, N m/rad]; of contacts per normal force [1/m]"
    )
    damping: Amount = Field(
        default=0.0,
        description="force per rate of it [N s/m, N m s/rad]; of contacts per normal force [s/m]",
    )


class Friction(Record):
    """Resist a rate: F = -(viscous + c_1 |w| + c_2 |w|^2 + ... + D(|w|) / sqrt(|w|^2 +
    coulomb_rate^2)) w, with D(w) = coulomb + (static - coulomb) exp(-(w / stribeck_rate)^2).

    With a bristle runs have its force for that of D.
    """

    viscous: Amount = Field(default=0.0, description="force per rate [N s/m, N m s/rad]")
    powers: tuple[Real, ...] = Field(
        default=(), description="c_1, c_2 ..., by which the force per rate grows with the rate"
    )
    coulomb: Amount = Field(
        default=0.0, description="force at rates well above coulomb_rate [N, N m]"
    )
    coulomb_rate: Positive = Field(
        default=0.01,
        description=(
            "rate at which the smoothed Coulomb force reaches 71 % of its value [m/s, rad/s]"
        ),
    )
    static: Amount | None = Field(
        default=None, description="force that breaks loose [N, N m]; coulomb if left out"
    )
    stribeck_rate: Positive = Field(
        default=0.01, description="rate at which it has fallen most of the way [m/s, rad/s]"
    )
    bristle: Bristle | None = Field(default=None, description="sticks in runs, by a state")

    @model_validator(mode="after")
    def _rubs(self):
        require_friction(self.coulomb, self.static, self.bristle, "coulomb")
        return self

    @property
    def dry(self) -> tuple[float, ...]:
        """The forces of dry friction: of sliding, and what breaks loose where that is told."""
        return (self.coulomb,) if self.static is None else (self.coulomb, self.static)

    @property
    def smooth(self) -> tuple[float, ...]:
        """The coefficients of the force that grows with the rate."""
        return (self.viscous, *self.powers)


def require_friction(
    sliding: float, static: float | None, bristle: Bristle | None, name: str
) -> None:
    """Refuse friction at rest that is below that of sliding, and bristles without friction."""
    if static is not None and static < sliding:
        raise MechanismError(
            f"static friction {static:g} is below that of sliding, {sliding:g}; give at least "
            "that, or leave it out",
            ("static",),
        )
    if bristle is not None and not sliding:
        raise MechanismError(
            f"a bristle slips at the friction of steady sliding, of which there is none; give "
            f"{name}",
            ("bristle",),
        )


class Spring(Record):
    """Pull a coordinate towards its rest and damp its rate: with x = q - rest
    F = -(stiffness + k_1 x + k_2 x^2 + ...) x - damping w; in brackets |x| for a free turn."""

    stiffness: Amount = Field(default=0.0, description="force per displacement [N/m, N m/rad]")
    powers: tuple[Real, ...] = Field(
        default=(), description="k_1, k_2 ..., by which the stiffness grows with the displacement"
    )
    rest: Real = Field(default=0.0, description="coordinate without force [m, rad]")
    damping: Amount = Field(default=0.0, description="force per rate [N s/m, N m s/rad]")

    @property
    def pulls(self) -> tuple[float, ...]:
        """The coefficients of the force that grows with the displacement."""
        return (self.stiffness, *self.powers)


class Limits(Record):
    """Bound a coordinate and its rate; the motion does not stop there, but passing a limit is
    reported."""

    lower: Real | None = Field(default=None, description="least value [m, rad]; none if left out")
    upper: Real | None = Field(default=None, description="largest value [m, rad]; none if left out")
    speed: Positive | None = Field(
        default=None, description="largest rate either way [m/s, rad/s]; none if left out"
    )

    @property
    def bounded(self) -> bool:
        """Whether the coordinate itself has an end."""
        return self.lower is not None or self.upper is not None

    @property
    def interval(self) -> tuple[float, float]:
        """The least and the largest value, infinite where there is none."""
        lower = -inf if self.lower is None else self.lower
        return lower, inf if self.upper is None else self.upper

    @model_validator(mode="after")
    def _ordered(self):
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise MechanismError(
                f"the lower limit {self.lower} is not below the upper limit {self.upper}"
            )
        return self


class Effects(NamedTuple):
    """Hold what acts in one freedom of a joint, apart from actuators, and what bounds it.

    rotor: inertia that moves with the rate [kg m^2; kg for a slide]; stop: at its ends, if any
    """

    friction: Friction = Friction()
    spring: Spring = Spring()
    limits: Limits = Limits()
    rotor: float = 0.0
    stop: Stop | None = None

    @property
    def ends(self) -> dict[str, float]:
        """The coordinates at which the stop begins, by side: "lower", "upper"."""
        if self.stop is None:
            return {}
        found = {}
        for side in ("lower", "upper"):
            own, limit = getattr(self.stop, side), getattr(self.limits, side)
            if own is not None or limit is not None:
                found[side] = limit if own is None else own
        return found

    @property
    def loads(self) -> tuple[float, ...]:
        """The numbers that are all zero where no force and no rotor acts."""
        friction, spring = self.friction, self.spring
        own = *friction.smooth, *friction.dry, *spring.pulls, spring.damping
        return (*own, self.stop.stiffness if self.stop else 0.0, self.rotor)


def require_ends(own: Effects, where: tuple[str, ...]) -> None:
    """Refuse a stop that begins nowhere, or above before below."""
    ends = own.ends
    if own.stop and not ends:
        raise MechanismError(
            "the stop begins nowhere; give it lower or upper, or give the joint limits", where
        )
    if len(ends) == 2 and not ends["lower"] < ends["upper"]:
        raise MechanismError(
            f"the stop's lower end {ends['lower']:g} is not below its upper end {ends['upper']:g}",
            where,
        )


class PointSpring(Record):
    """Pull two points of two bodies together: tension stiffness (l - rest_length) + damping l', l
    their distance."""

    connects: tuple[Name, Name] = Field(description="names of the two bodies")
    points: tuple[Vector3, Vector3] = Field(
        description="a point in the first and one in the second body's frame [m]"
    )
    stiffness: Amount = Field(default=0.0, description="tension per length [N/m]")
    rest_length: Amount = Field(default=0.0, description="length without tension [m]")
    damping: Amount = Field(default=0.0, description="tension per rate of the length [N s/m]")


class Lift(Record):
    """Carry the weight of a mass at a point of a body: F = -mass gravity. It balances a body's own
    weight, or is the buoyancy of what a body displaces."""

    body: Name = Field(description="name of the body")
    point: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="where the force acts, in the body's frame [m]"
    )
    mass: Real = Field(description="mass whose weight is carried [kg]")
