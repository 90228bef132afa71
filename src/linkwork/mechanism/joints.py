"""Joint types as data: which two bodies, where, about or along which axis.

A joint connects a first to a second body (`connects`) and has a frame on each (`frames`). Its
coordinates measure the second frame's motion relative to the first; at zero the two coincide. Any
joint may close a loop: nothing here knows of trees.

A joint's motion is made of `freedoms`. Each is a turn or a slide of one coordinate and one rate,
except "turn": the free turning of a spherical joint, whose coordinates are the unit quaternion
(qw, qx, qy, qz) of R_12 and whose rates (wx, wy, wz) [rad/s] are the angular velocity of F2
relative to F1 in F1's axes. A joint of one such freedom names its coordinate and rate like itself;
the others add the freedom: "cylinder.slide", "ball.qw", "ball.wx".
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot
from typing import Annotated, ClassVar, Literal, NamedTuple, get_args

from pydantic import AfterValidator, Field, model_validator

from linkwork.mechanism.bearing import GearTeeth, JournalBearing, SlidingBearing
from linkwork.mechanism.effects import Effects, Friction, Limits, Spring, require_ends
from linkwork.mechanism.elastic import Elastic
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.impact import Stop
from linkwork.mechanism.record import (
    Amount,
    MechanismError,
    Name,
    PathName,
    Positive,
    Real,
    Record,
    Vector3,
    followed,
)

__all__ = [
    "CylindricalJoint",
    "FixedJoint",
    "FreeJoint",
    "GearJoint",
    "Joint",
    "PairJoint",
    "PlanarJoint",
    "PrismaticJoint",
    "RevoluteJoint",
    "RodJoint",
    "ScrewJoint",
    "SphericalJoint",
    "UniversalJoint",
]
TURN = "turn"
SLIDES = ("slide", "x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
ANGULAR_VELOCITY = ("wx", "wy", "wz")
EFFECTS = ("friction", "spring", "limits", "rotor_inertia", "stop")
"""The fields of a joint, in the order of `Effects`."""


def unit_axis(axis: Vector3) -> Vector3:
    """Normalise an axis; one without length is refused."""
    length = hypot(*axis)
    if length < 1e-12:
        raise ValueError(f"axis {list(axis)} has no length; give a direction such as [0, 0, 1]")
    if abs(length - 1) < 1e-15:
        return axis
    x, y, z = axis
    return followed(x / length), followed(y / length), followed(z / length)


Axis = Annotated[Vector3, AfterValidator(unit_axis)]


class JointFreedom(NamedTuple):
    """Name one freedom of a joint and what it brings; a free turn has four coordinates and three
    rates."""

    name: str
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    effects: Effects


class JointBase(Record):
    """Say what all joint types share: the freedoms, by name, and the coordinates and rates these
    bring; `elsewhere`: what others call the type."""

    elsewhere: ClassVar[tuple[str, ...]] = ()
    freedoms: ClassVar[tuple[str, ...]] = ()
    type: str

    def coordinates(self, name: str) -> tuple[str, ...]:
        """Return the names of the coordinates of a joint of this type called `name`."""
        return tuple(label for own in self._names(name, QUATERNION) for label in own)

    def rates(self, name: str) -> tuple[str, ...]:
        """Return the names of the rates of a joint of this type called `name`."""
        return tuple(label for own in self._names(name, ANGULAR_VELOCITY) for label in own)

    def angles(self, name: str) -> tuple[str, ...]:
        """Return the names of the coordinates that are angles [rad] of a joint of this type called
        `name`."""
        parts = self.parts(name)
        return tuple(part.coordinates[0] for part in parts if part.name not in (*SLIDES, TURN))

    def parts(self, name: str) -> tuple[JointFreedom, ...]:
        """Return the freedoms of a joint of this type called `name`."""
        coordinates = self._names(name, QUATERNION)
        columns = coordinates, self._names(name, ANGULAR_VELOCITY), self.effects().values()
        return tuple(map(JointFreedom, self.freedoms, *columns))

    def effects(self) -> dict[str, Effects]:
        """Return what acts in each freedom, by its name."""
        return {}

    def _names(self, name: str, turning: tuple[str, ...]) -> list[tuple[str, ...]]:
        """Return the coordinates or rates of each freedom; `turning`: how those of a free turn
        end."""
        if len(self.freedoms) == 1 and self.freedoms != (TURN,):
            return [(name,)]
        return [
            tuple(f"{name}.{part}" for part in (turning if freedom == TURN else (freedom,)))
            for freedom in self.freedoms
        ]


class PairJoint(JointBase):
    """Connect the first body's frame F1 to the second body's frame F2."""

    connects: tuple[Name, Name] = Field(description="names of the first and the second body")
    frames: tuple[Frame, Frame] = Field(
        default=(Frame(), Frame()), description="joint frame in the first and in the second body"
    )


class OneFreedom(PairJoint):
    """Give a joint's one freedom friction, a spring, limits, a rotor and a stop."""

    friction: Friction = Field(default=Friction(), description="resists the joint's rate")
    spring: Spring = Field(
        default=Spring(), description="pulls the joint's coordinate towards its rest"
    )
    limits: Limits = Field(
        default=Limits(),
        description="range of the joint's coordinate and rate; passing it is reported",
    )
    rotor_inertia: Amount = Field(
        default=0.0, description="inertia that moves with the joint's rate [kg m^2; kg for a slide]"
    )
    stop: Stop | None = Field(default=None, description="presses back past the joint's ends")
    elastic: Elastic | None = Field(
        default=None, description="motor that drives the joint through a spring"
    )

    def effects(self) -> dict[str, Effects]:
        own = Effects(self.friction, self.spring, self.limits, self.rotor_inertia, self.stop)
        return {self.freedoms[0]: own}

    @model_validator(mode="after")
    def _stops_somewhere(self):
        require_ends(self.effects()[self.freedoms[0]], ("stop",))
        return self


class ManyFreedoms(PairJoint):
    """Give a joint's freedoms friction, springs, limits, rotors and stops, each by the name of the
    freedom."""

    friction: Mapping[Name, Friction] = Field(
        default_factory=dict, description="by freedom; resists its rate"
    )
    spring: Mapping[Name, Spring] = Field(
        default_factory=dict, description="by freedom; pulls towards its rest"
    )
    limits: Mapping[Name, Limits] = Field(
        default_factory=dict, description="by freedom; passing them is reported"
    )
    rotor_inertia: Mapping[Name, Amount] = Field(
        default_factory=dict,
        description="by freedom; inertia that moves with its rate [kg m^2; kg for a slide]",
    )
    stop: Mapping[Name, Stop] = Field(
        default_factory=dict, description="by freedom; presses back past its ends"
    )

    def effects(self) -> dict[str, Effects]:
        return {
            freedom: Effects(
                self.friction.get(freedom, Friction()),
                self.spring.get(freedom, Spring()),
                self.limits.get(freedom, Limits()),
                self.rotor_inertia.get(freedom, 0.0),
                self.stop.get(freedom),
            )
            for freedom in self.freedoms
        }

    @model_validator(mode="after")
    def _known_freedoms(self):
        for field in EFFECTS:
            for freedom in getattr(self, field):
                if freedom not in self.freedoms:
                    raise MechanismError(
                        f"there is no freedom {freedom!r}; the freedoms of a {self.type} joint are "
                        f"{', '.join(self.freedoms)}",
                        (field,),
                    )
        turn = self.spring.get(TURN, Spring())
        if turn.rest:
            raise MechanismError(
                "the spring of a free turn rests where the two frames agree, not at "
                f"{turn.rest}; turn a frame instead",
                ("spring", TURN, "rest"),
            )
        if self.limits.get(TURN, Limits()).lower is not None:
            raise MechanismError(
                "a free turn has no lower limit; give upper, the largest angle between the two "
                "frames",
                ("limits", TURN, "lower"),
            )
        for freedom, own in self.effects().items():
            if freedom == TURN and own.stop and own.stop.lower is not None:
                raise MechanismError(
                    "the stop of a free turn has no lower end; give upper, the largest angle "
                    "between the two frames",
                    ("stop", TURN, "lower"),
                )
            require_ends(own, ("stop", freedom))
        return self


class FixedJoint(PairJoint):
    """Weld the two frames together: no coordinate."""

    elsewhere: ClassVar = ("weld", "rigid")
    type: Literal["fixed"] = "fixed"


class RevoluteJoint(OneFreedom):
    """Let F2 turn by q [rad] about `axis` (the same components in F1 and F2): R_12 = Rot(axis, q),
    p_12 = 0."""

    freedoms: ClassVar = ("angle",)
    elsewhere: ClassVar = ("hinge", "pin", "rotary", "continuous")
    type: Literal["revolute"] = "revolute"
    axis: Axis = Field(default=(0.0, 0.0, 1.0), description="unit axis in the joint frames")
    bearing: JournalBearing | None = Field(
        default=None, description="rubs by what the joint carries"
    )


class PrismaticJoint(OneFreedom):
    """Let F2 slide by q [m] along `axis` (the same components in F1 and F2): R_12 = 1, p_12 = q
    axis."""

    freedoms: ClassVar = ("slide",)
    elsewhere: ClassVar = ("slide", "slider", "sliding", "linear")
    type: Literal["prismatic"] = "prismatic"
    axis: Axis = Field(default=(0.0, 0.0, 1.0), description="unit axis in the joint frames")
    bearing: SlidingBearing | None = Field(
        default=None, description="rubs by what the joint carries"
    )


class ScrewJoint(OneFreedom):
    """Let F2 turn by q [rad] about `axis` and advance along it: R_12 = Rot(axis, q), p_12 = pitch q
    axis."""

    freedoms: ClassVar = ("angle",)
    type: Literal["screw"] = "screw"
    axis: Axis = Field(default=(0.0, 0.0, 1.0), description="unit axis in the joint frames")
    pitch: Real = Field(
        description=(
            "advance along the axis per radian [m/rad]; a lead of one turn is 2 pi times this"
        )
    )


class CylindricalJoint(ManyFreedoms):
    """Let F2 turn about and slide along `axis`: R_12 = Rot(axis, angle), p_12 = slide axis."""

    freedoms: ClassVar = ("angle", "slide")
    type: Literal["cylindrical"] = "cylindrical"
    axis: Axis = Field(default=(0.0, 0.0, 1.0), description="unit axis in the joint frames")


class UniversalJoint(ManyFreedoms):
    """Let F2 turn about two crossing axes: R_12 = Rot(axes[0], angle_1) Rot(axes[1], angle_2), p_12
    = 0.

    The first axis is fixed in F1, the second in F2; they are perpendicular.
    """

    freedoms: ClassVar = ("angle_1", "angle_2")
    elsewhere: ClassVar = ("cardan", "hooke", "gimbal")
    type: Literal["universal"] = "universal"
    axes: tuple[Axis, Axis] = Field(
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        description="unit axes, the first in F1 and the second in F2",
    )

    @model_validator(mode="after")
    def _perpendicular(self):
        cosine = sum(x * y for x, y in zip(*self.axes, strict=True))
        if abs(cosine) > 1e-9:
            raise MechanismError(
                f"the axes {list(self.axes[0])} and {list(self.axes[1])} of a universal joint "
                "are not perpendicular; turn one of them, or use two revolute joints",
                ("axes",),
            )
        return self


class SphericalJoint(ManyFreedoms):
    """Let F2 turn freely about the common origin: p_12 = 0, R_12 by its unit quaternion."""

    freedoms: ClassVar = (TURN,)
    elsewhere: ClassVar = ("ball", "ball-and-socket")
    type: Literal["spherical"] = "spherical"


class PlanarJoint(ManyFreedoms):
    """Let F2 slide in the xy plane of F1 and turn about its z axis: p_12 = (x, y, 0), R_12 = Rot(z,
    angle)."""

    freedoms: ClassVar = ("x", "y", "angle")
    type: Literal["planar"] = "planar"


class FreeJoint(ManyFreedoms):
    """Let F2 move freely: p_12 = (x, y, z), R_12 by its unit quaternion. It says nothing but where
    a body starts."""

    freedoms: ClassVar = ("x", "y", "z", TURN)
    type: Literal["free"] = "free"


class RodJoint(PairJoint):
    """Keep the origins of F1 and F2 at the distance `length` [m], as a massless rod between two
    ball joints does."""

    type: Literal["rod"] = "rod"
    length: Positive = Field(description="distance between the two frames' origins [m]")


FEW = (
    "a gear couples at least two coordinates, or a length of a transmission, by ratios other than "
    "zero"
)


class GearJoint(JointBase):
    """Couple joint coordinates and lengths: the sum of P_i(q_i) keeps the value `offset`.

        P_i(q) = ratio_i q + c_i2 q^2 + c_i3 q^3 + ...

    Two wheels of radii r_1, r_2 in outer mesh on one carrier: ratios r_1 and r_2 (they turn against
    each other). A cam, or a knee whose bones slide as it bends, has `powers` too. A rope that does
    not stretch is a cable with the ratio 1, whose length stays `offset`; two of them are tied so.
    """

    type: Literal["gear"] = "gear"
    ratios: Mapping[PathName, Real] = Field(
        description="ratio by coordinate or by transmission that has a length, at least two or a "
        "single length [1; m/rad between kinds]"
    )
    powers: Mapping[PathName, tuple[Real, ...]] = Field(
        default_factory=dict, description="c_2, c_3 ... of the square, the cube ..., by the same"
    )
    offset: Real = Field(
        default=0.0, description="value that the sum keeps [unit of ratio times coordinate]"
    )
    teeth: GearTeeth | None = Field(default=None, description="rub by what the gear transmits")

    @model_validator(mode="after")
    def _couples(self):
        if alone := sorted(self.powers.keys() - self.ratios.keys()):
            raise MechanismError(
                f"{alone[0]!r} has no ratio; give one, 0 where only its powers count", ("powers",)
            )
        if not self.coupled:
            raise MechanismError(FEW, ("ratios",))
        even = [label for label in self.coupled if not any(self.powers.get(label, ()))]
        if self.teeth and self.teeth.at not in even:
            raise MechanismError(
                f"the teeth rub at {self.teeth.at!r}, which the gear does not couple by a ratio "
                f"alone; give one of {', '.join(even)}",
                ("teeth", "at"),
            )
        return self

    @property
    def coupled(self) -> tuple[str, ...]:
        """What it couples: coordinates and lengths whose polynomials are not zero."""
        return tuple(label for label in self.ratios if any(self.polynomial(label)))

    def polynomial(self, label: str) -> tuple[float, ...]:
        """Return the ratio of a coordinate, c_2, c_3 ...

        label: of the coordinate, as in `ratios` and `powers`.
        """
        return (self.ratios[label], *self.powers.get(label, ()))


Joint = Annotated[
    FixedJoint
    | RevoluteJoint
    | PrismaticJoint
    | ScrewJoint
    | CylindricalJoint
    | UniversalJoint
    | SphericalJoint
    | PlanarJoint
    | FreeJoint
    | RodJoint
    | GearJoint,
    Field(discriminator="type"),
]
TYPES: dict[str, type[JointBase]] = {
    kind.model_fields["type"].default: kind for kind in get_args(get_args(Joint)[0])
}
"""The joint types by their name in files."""
