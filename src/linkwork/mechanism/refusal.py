"""Refusals: one sentence that names the element, the value found there and what would be accepted.

The checks themselves are pydantic's; its list of errors becomes one sentence here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from typing import Any, get_args

from pydantic import BaseModel, BeforeValidator, ValidationError

from linkwork.checks import plain
from linkwork.checks import suggestion as suggestion
from linkwork.errors import LinkworkError

LONG = 60  # characters, above which a value is not shown in full
VANISHES = (
    "is nearer to zero than any number that a computer holds in full, about 2e-308; give 0, or "
    "check its unit"
)
PLAIN = BeforeValidator(plain)  # no truth value for a number


class MechanismError(LinkworkError):
    """Refuse a description: `what` is the sentence, `where` the element's path, `place` the file
    and line if any."""

    def __init__(self, what: str, where: tuple[str, ...] = (), place: str = ""):
        self.what, self.where, self.place = what, where, place
        path = ".".join(
            part if part.isprintable() and len(part) <= LONG else shown(part) for part in where
        )
        super().__init__(": ".join(part for part in (place, path, what) if part))


def first_refusal(
    error: ValidationError, record: type[BaseModel], fields: Mapping[str, Any]
) -> MechanismError:
    """Turn pydantic's errors about the fields of a record into one: about an unknown field, else
    about the first."""
    # The fault to tell: an unknown name before anything else, for it may be a misspelt one.
    errors: Sequence[Any] = error.errors(include_url=False)
    first = next((one for one in errors if one["type"] == "extra_forbidden"), errors[0])
    kind = first["type"]
    location = first["loc"]
    value = first["input"]
    context = first.get("ctx", {})
    where = path_in(fields, location)
    # Our own checks have their sentences.
    cause = context.get("error")
    if isinstance(cause, MechanismError):
        return MechanismError(cause.what, where + cause.where)
    if isinstance(cause, ValueError):
        return MechanismError(str(cause), where)
    if kind == "extra_forbidden":
        known = record.model_fields
        fix = f"{suggestion(where[-1], known)}; the fields here are {', '.join(known)}"
        return MechanismError(f"is not a known field{fix}", where)

    # What was expected there, in the field's own words.
    field = record.model_fields[str(location[0])]
    expected = f"expected {field.description or 'a value'}"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return wrong_type(value, field.annotation, where)
    if kind in ("model_type", "model_attributes_type"):
        expected = fields_of(field.annotation)
    if kind == "missing" and isinstance(location[-1], int):
        lacking = sum(
            one["type"] == "missing" and one["loc"][:-1] == location[:-1] for one in errors
        )
        context = {"max_length": location[-1] + lacking}
    elif kind == "missing":
        return MechanismError(f"is missing; {expected}", (*where, str(location[-1])))
    # Faults that people make in files; then whatever else pydantic says.
    if value is None:
        return MechanismError(f"is empty; {expected}", where)
    if kind == "string_type" and isinstance(value, int | float):
        return no_name(value, where)
    return MechanismError(f"{complaint(kind, value, context, first['msg'])}; {expected}", where)


def complaint(kind: str, value: Any, context: Mapping[str, Any], message: str) -> str:
    """Say what is wrong with a value, by pydantic's kind of error."""
    match kind:
        case "missing" | "too_long":
            return f"give {context['max_length']} {noun(value)}{but(value)}"
        case "too_short":
            return f"give {context['min_length']} {noun(value)} or more{but(value)}"
        case "float_type" | "float_parsing":
            return f"{shown(value)} is not a number"
        case "finite_number":
            return f"{shown(value)} is not a finite number"
        case "greater_than_equal":
            return f"{shown(value)} is below {context['ge']:g}"
        case "less_than_equal":
            return f"{shown(value)} is above {context['le']:g}"
        case "less_than":
            return f"{shown(value)} is not below {context['lt']:g}"
        case "greater_than":
            return f"{shown(value)} is not above {context['gt']:g}"
        case "string_type":
            return f"{shown(value)} is not text"
        case "tuple_type":
            return f"{shown(value)} is not a list"
        case "dict_type" | "mapping_type":
            return f"{shown(value)} is not a mapping from names to values"
        case "model_type" | "model_attributes_type":
            return f"{shown(value)} is not a mapping of fields"
        case _:
            return f"{shown(value)} is not accepted: {message[0].lower()}{message[1:]}"


def path_in(data: Any, location: Sequence[str | int]) -> tuple[str, ...]:
    """Return the parts of pydantic's location that lead somewhere in the data; its marks of unions
    and keys do not."""
    where = []
    for part in location:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            continue
        where.append(str(part))
    return tuple(where)


def but(items: object) -> str:
    """Say how many items there are, where that is known: iterators are used up by now."""
    return f", not {len(items)}" if isinstance(items, Sized) else ""


def noun(items: Iterable[Any]) -> str:
    """Name what the items of a list are."""
    for kinds, name in (((int, float), "numbers"), (str, "names")):
        if (found := list(items)) and all(isinstance(item, kinds) for item in found):
            return name
    return "entries"


def no_name(value: object, where: tuple[str, ...]) -> MechanismError:
    """Refuse what stands where a name is to stand."""
    short = isinstance(value, int | float) and len(str(value)) <= LONG
    fix = f"put it in quotes to use it as a name: '{value}'" if short else "give a name"
    return MechanismError(f"{shown(value)} is not text; {fix}", where)


def vet(fields: Any, where: tuple[str, ...] = ()) -> None:
    """Refuse sets, which have no order, and mappings whose keys are no text, wherever they are
    among fields."""
    if isinstance(fields, set | frozenset):
        raise MechanismError(
            f"{shown(fields)} is a set, which has no order; give one value, or a list", where
        )
    if isinstance(fields, dict):
        for key, value in fields.items():
            if not isinstance(key, str):
                raise no_name(key, (*where, shown(key)))
            vet(value, (*where, key))
    elif isinstance(fields, list | tuple):
        for index, value in enumerate(fields):
            if not isinstance(value, float | int | str):
                vet(value, (*where, str(index)))


def wrong_type(fields: Any, annotation: Any, where: tuple[str, ...]) -> MechanismError:
    """Refuse fields whose `type` is left out or is none of the annotation's types."""
    records = dict.fromkeys(records_in(annotation))
    known = [record.model_fields["type"].default for record in records]
    word = fields.get("type") if isinstance(fields, Mapping) else None
    fault = (
        "is missing"
        if word is None
        else f"{shown(word)} is not a type{suggestion(str(word), known)}"
    )
    called = zip(known, (getattr(record, "elsewhere", ()) for record in records), strict=True)
    meant = [name for name, others in called if str(word).lower() in others]
    here = f"; what others call {word} is {meant[0]} here" if meant else ""
    return MechanismError(f"{fault}; the types are {', '.join(known)}{here}", (*where, "type"))


def fields_of(annotation: Any) -> str:
    """Say which fields a record of this annotation takes."""
    first, *others = dict.fromkeys(records_in(annotation))
    return (
        "give a type and its fields"
        if others
        else f"give the fields {', '.join(first.model_fields)}"
    )


def records_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Find the records that an annotation speaks of."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from records_in(part)


def shown(value: Any) -> str:
    """Show a value in a sentence: a long one by its kind or its beginning."""
    text = repr(value)
    if len(text) <= LONG:
        return text
    if isinstance(value, Mapping | list | tuple):
        return "a mapping" if isinstance(value, Mapping) else "a list"
    return f"{text[: LONG - 4]} ..."
