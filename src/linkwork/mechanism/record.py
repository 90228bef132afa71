"""Frozen records: every part of a `Mechanism` is immutable data, checked once when it is made."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from inspect import Parameter, Signature, cleandoc
from textwrap import fill
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, Union, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from linkwork.mechanism.refusal import PLAIN, VANISHES, MechanismError, first_refusal, shown, vet
from linkwork.readonly import fix_entries

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


R = TypeVar("R", bound=BaseModel)


class Written(str):
    """Text that a signature shows as it is."""

    __slots__ = ()
    __repr__ = str.__str__


def plain_type(kind: Any) -> Written:
    """Return a type as it is written without what is checked of it."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return plain_type(inner[0])
    if origin is Literal:
        return Written(" | ".join(map(repr, inner)))
    told = ["..." if each is Ellipsis else plain_type(each) for each in inner]
    if origin in (Union, UnionType):
        return Written(" | ".join(told))
    if origin is not None:
        return Written(f"{origin.__name__}[{', '.join(told)}]")
    return Written("None" if kind is NoneType else getattr(kind, "__name__", str(kind)))


def left_out(field: FieldInfo) -> Any:
    """Return what a field is where it is left out; empty where it may not be."""
    if field.is_required():
        return Parameter.empty
    return field.get_default(call_default_factory=True)


class Fields:
    """The signature of a record, made when it is asked for: its fields with their plain types."""

    def __get__(self, instance: Any, record: type[Record]) -> Signature:
        told = [
            Parameter(
                name,
                Parameter.KEYWORD_ONLY,
                default=left_out(field),
                annotation=plain_type(field.annotation),
            )
            for name, field in record.model_fields.items()
        ]
        return Signature(told, return_annotation=None)


class Record(BaseModel):
    """A frozen piece of a description; unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    own_doc: ClassVar[str] = ""

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Let its signature be plain, and its docstring end with its fields."""
        super().__pydantic_init_subclass__(**options)
        cls.__signature__ = Fields()  # pyright: ignore[reportAttributeAccessIssue]
        cls.own_doc = cleandoc(cls.__doc__ or "")
        told = (
            fill(
                f"{name}: {field.description}", 96, initial_indent="    ", subsequent_indent=" " * 8
            )
            for name, field in cls.model_fields.items()
            if field.description
        )
        cls.__doc__ = "\n".join([cls.own_doc, "", "Args:", *told])

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe the record by its own docstring: the schema tells its fields apart."""
        found = handler(core_schema)
        handler.resolve_ref_schema(found)["description"] = cls.own_doc
        return found

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """Tell what is not left out."""
        for name, field in type(self).model_fields.items():
            if (value := getattr(self, name)) != left_out(field):
                yield name, value

    def __init__(self, /, **fields: Any) -> None:
        vet(fields)
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise first_refusal(error, type(self), fields) from None
        fix_entries(vars(self))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values of some fields, which are checked as all are.

        Args:
            update: values by the name of the field.
            deep: whether what is held is copied, too; without other values.

        Raises:
            MechanismError: fields that there are not, values that they may not have.
        """
        return type(self)(**{**vars(self), **update}) if update else super().model_copy(deep=deep)

    copy = model_copy  # pyright: ignore[reportAssignmentType]

    def __setattr__(self, name: str, value: Any) -> None:
        raise MechanismError(f"{name} of a frozen {type(self).__name__} is not set; make another")


def swapped(record: R, **fields: Any) -> R:
    """Return a copy of a record with other values of some fields, unchecked: symbols of free
    numbers, and what is not whole yet."""
    return BaseModel.model_copy(record, update=fields)  # pyright: ignore[reportReturnType]


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
