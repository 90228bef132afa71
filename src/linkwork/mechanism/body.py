"""Rigid bodies: mass, mass centre, inertia about the mass centre in the body frame's axes, shapes
for drawing.

A body that only ever turns about the z axis of its own frame (a planar mechanism) may give `zz`
alone.
"""

from __future__ import annotations

from typing import Any, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from linkwork.mechanism.record import Amount, MechanismError, Real, Record, Vector3
from linkwork.mechanism.shapes import Shape


class Inertia(Record):
    """Hold the inertia tensor about the mass centre, in the body's axes [kg m^2]; `zz` alone for
    planar bodies.

    No principal moment of a rigid body exceeds the sum of the others, and none is negative.
    `moments: any` keeps a tensor that breaks this rule, as model files of others may: the equations
    of motion need no more than a generalised inertia that is positive.
    """

    zz: Amount = Field(description="moment of inertia about z [kg m^2]")
    xx: Amount | None = Field(default=None, description="moment of inertia about x [kg m^2]")
    yy: Amount | None = Field(default=None, description="moment of inertia about y [kg m^2]")
    xy: Real = Field(default=0.0, description="off-diagonal element of the tensor [kg m^2]")
    xz: Real = Field(default=0.0, description="off-diagonal element of the tensor [kg m^2]")
    yz: Real = Field(default=0.0, description="off-diagonal element of the tensor [kg m^2]")
    moments: Literal["rigid", "any"] = Field(
        default="rigid",
        description="rigid: no principal moment exceeds the sum of the others; any: it may",
    )

    @property
    def planar(self) -> bool:
        """Tell whether `zz` alone is given."""
        return self.xx is None

    def tensor(self) -> np.ndarray:
        """Return the 3 x 3 tensor [kg m^2]; the elements that a planar body leaves out are zero."""
        xx, yy = self.xx or 0.0, self.yy or 0.0
        return np.array(
            [[xx, self.xy, self.xz], [self.xy, yy, self.yz], [self.xz, self.yz, self.zz]]
        )

    @model_validator(mode="after")
    def _physical(self) -> Self:
        if (self.xx is None) != (self.yy is None):
            raise MechanismError(
                "give xx, yy and zz, or zz alone for a body that moves in its xy plane"
            )
        if self.planar:
            if self.xy or self.xz or self.yz:
                raise MechanismError(
                    "xy, xz and yz need xx and yy too; give zz alone for a planar body"
                )
            return self
        a, b, c = np.linalg.eigvalsh(self.tensor())
        if self.moments == "rigid" and a < -1e-12 * c:
            raise MechanismError(
                f"principal moments {a:.6g}, {b:.6g}, {c:.6g} kg m^2: none may be negative"
            )
        if self.moments == "rigid" and not rigid(a, b, c):
            raise MechanismError(
                f"principal moments {a:.6g}, {b:.6g}, {c:.6g} kg m^2 violate the triangle "
                "inequality: no moment may exceed the sum of the other two (moments: any keeps "
                "them)"
            )
        return self


def rigid(a: float, b: float, c: float) -> bool:
    """Tell whether principal moments a <= b <= c are those of a rigid body, up to rounding: a + b
    >= c."""
    return a + b >= c * (1 - 1e-9)


def _without_mass(schema: dict[str, Any]) -> None:
    """Let the mass be left out where there are shapes, which may have a density."""
    del schema["required"]
    schema["anyOf"] = [{"required": ["mass"]}, {"required": ["shapes"]}]


FROM_SHAPES: Any = ...  # no default: what is left out has to follow from shapes


class Body(Record):
    """Describe a rigid body by mass [kg], mass centre [m, body frame] and inertia about it
    [kg m^2, body axes].

    `shapes` is what it looks like. A body without shapes is drawn between its joints. One that
    gives no mass has mass, mass centre and inertia of its shapes that have a density.
    """

    model_config = ConfigDict(json_schema_extra=_without_mass)

    mass: Amount = Field(default=FROM_SHAPES, description="mass [kg], zero or more")
    centre_of_mass: Vector3 = Field(
        default=(0.0, 0.0, 0.0), description="mass centre in the body's frame [m]"
    )
    inertia: Inertia = Field(
        default_factory=lambda: Inertia(xx=0.0, yy=0.0, zz=0.0), description="about the mass centre"
    )
    shapes: tuple[Shape, ...] = Field(default=(), description="what the body looks like")

    @model_validator(mode="before")
    @classmethod
    def _weighed(cls, fields: Any) -> Any:
        if not isinstance(fields, dict) or fields.get("mass") is not None:
            return fields
        if not any(_density_of(shape) is not None for shape in _listed(fields.get("shapes"))):
            return fields
        from linkwork.mechanism.density import mass_fields

        given = next((name for name in ("centre_of_mass", "inertia") if name in fields), None)
        if given is not None:
            raise MechanismError(
                "is given without a mass, and the shapes' densities give all three; give a mass "
                "too, or leave it out",
                (given,),
            )
        try:
            shapes = SHAPES.validate_python(fields["shapes"])
        except ValidationError:
            return {**fields, "mass": 0.0}  # the shapes are refused as they are checked
        return {**fields, **(mass_fields(shapes) or {})}


SHAPES: TypeAdapter[tuple[Shape, ...]] = TypeAdapter(tuple[Shape, ...])


def _listed(shapes: Any) -> list[Any]:
    return list(shapes) if isinstance(shapes, list | tuple) else []


def _density_of(shape: Any) -> Any:
    return shape.get("density") if isinstance(shape, dict) else getattr(shape, "density", None)
