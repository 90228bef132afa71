"""Frozen records: every part of a `Mechanism` is immutable data, checked once when it is made."""

from __future__ import annotations

import sys
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, WithJsonSchema

from linkwork.mechanism.refusal import PLAIN, VANISHES, MechanismError, first_refusal, shown

__all__ = [
    "HUGE",
    "Amount",
    "MechanismError",
    "Name",
    "PathName",
    "Positive",
    "Real",
    "Record",
    "Vector3",
]

HUGE = 1e50
"""Of lengths, angles, masses and the like: moments of inertia of greater ones are not finite."""


def held_in_full(number: float) -> float:
    """Accept zero, and numbers that a double holds with all its digits."""
    if 0 < abs(number) < sys.float_info.min:
        raise ValueError(f"{number:g} {VANISHES}")
    return number


def followed(number: float) -> float:
    """Return a number that follows from others of size one: zero where a double does not hold it
    with all its digits."""
    return 0.0 if abs(number) < sys.float_info.min else number


FULL = AfterValidator(held_in_full)
Real = Annotated[float, Field(allow_inf_nan=False), PLAIN, FULL]
Amount = Annotated[float, Field(ge=0, le=HUGE, allow_inf_nan=False), PLAIN, FULL]
Positive = Annotated[float, Field(gt=0, le=HUGE, allow_inf_nan=False), PLAIN, FULL]
Component = Annotated[float, Field(ge=-HUGE, le=HUGE, allow_inf_nan=False), PLAIN, FULL]
Vector3 = tuple[Component, Component, Component]


class Record(BaseModel):
    """A frozen piece of a description; unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, /, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise first_refusal(error, type(self), fields) from None


def checked_name(name: str) -> str:
    """Accept a name: not empty, no dot (dots separate the parts of a path), no control
    character."""
    if not name.strip() or name != name.strip() or "." in name or not name.isprintable():
        raise ValueError(
            f"{shown(name)} cannot be a name: give printable text without dots or spaces around it"
        )
    return name


def checked_path(path: str) -> str:
    """Accept the name of a coordinate or rate: a name, or joint.freedom."""
    joint, dot, freedom = path.partition(".")
    checked_name(joint)
    if dot:
        checked_name(freedom)
    return path


NAME = r"[^\s.](?:[^.]*[^\s.])?"
Name = Annotated[
    str, AfterValidator(checked_name), WithJsonSchema({"type": "string", "pattern": f"^{NAME}$"})
]
PathName = Annotated[
    str,
    AfterValidator(checked_path),
    WithJsonSchema({"type": "string", "pattern": rf"^{NAME}(?:\.{NAME})?$"}),
]
