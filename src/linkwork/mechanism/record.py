"""Frozen records with refusals of one sentence.

Every part of a `Mechanism` is a `Record`: immutable data, checked once when it is made. A refusal is a `MechanismError`
that names the place ("bodies.link_1.mass"), the value found there and what would be accepted.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from linkwork.errors import LinkworkError

Real = Annotated[float, Field(allow_inf_nan=False)]
Vector3 = tuple[Real, Real, Real]


class MechanismError(LinkworkError):
    """Refuse a description: `where` is the path of the element, `what` the sentence about it."""

    def __init__(self, what: str, where: tuple[str, ...] = ()):
        self.where, self.what = where, what
        super().__init__(f"{'.'.join(where)}: {what}" if where else what)


class Record(BaseModel):
    """A frozen piece of a description; unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise first_refusal(error, type(self)) from None


def first_refusal(error: ValidationError, record: type[BaseModel]) -> MechanismError:
    """Turn pydantic's list of errors into one sentence about the first of them."""
    first = error.errors()[0]
    where = tuple(str(part) for part in first["loc"])
    if where and isinstance(first["input"], dict) and first["input"].get("type") == where[-1]:
        where = where[:-1]  # the tag of a union ("joints", "slide_1", "prismatic") is no part of the path
    context = first.get("ctx", {})
    cause = context.get("error")
    if isinstance(cause, MechanismError):
        return MechanismError(cause.what, where + cause.where)
    if isinstance(cause, ValueError):
        return MechanismError(str(cause), where)
    match first["type"]:
        case "missing":
            return MechanismError(f"is missing; {describe(where, record)}", where)
        case "extra_forbidden":
            known = ", ".join(record.model_fields)
            return MechanismError(f"is not a known field; the fields here are {known}", where)
        case "union_tag_invalid":
            known = context["expected_tags"].replace("'", "")
            return MechanismError(f"{context['tag']!r} is not one of the types {known}", (*where, "type"))
        case "union_tag_not_found":
            return MechanismError("is missing; name the type, such as revolute", (*where, "type"))
        case _:
            message = first["msg"][0].lower() + first["msg"][1:]
            return MechanismError(f"{first['input']!r} is not accepted: {message}", where)


def describe(where: tuple[str, ...], record: type[BaseModel]) -> str:
    field = record.model_fields.get(where[-1]) if where else None
    return (field.description or "give a value") if field else "give a value"


def checked_name(name: str) -> str:
    """Accept a name: not empty, no dot (dots separate the parts of a path), no control character."""
    if not name.strip() or name != name.strip() or "." in name or not name.isprintable():
        raise ValueError(f"{name!r} cannot be a name: give printable text without dots or spaces around it")
    return name


Name = Annotated[str, AfterValidator(checked_name)]
