"""Named quantities: numbers of a description that several others follow from by formulas.

`let` holds the quantities, `formulas` the texts by the paths of the numbers that follow; the fields
themselves hold plain numbers. A quantity may follow from others. A formula that no longer gives the
number at its place, because a part was exchanged in code, is dropped where the description is
written and refused where its quantities change.
"""

from __future__ import annotations

import keyword
import re
from collections import abc
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeVar, get_args, get_origin

from pydantic import AfterValidator, WithJsonSchema

from linkwork import checks
from linkwork.mechanism import formulas as formula
from linkwork.mechanism.places import Where, located, placed
from linkwork.mechanism.record import Record, swapped
from linkwork.mechanism.refusal import MechanismError, shown

Described = TypeVar("Described", bound=Record)
QUANTITY = r"[A-Za-z_][A-Za-z0-9_]*"


def checked_quantity(name: str) -> str:
    """Accept the name of a quantity: one that formulas can hold."""
    taken = name in formula.FUNCTIONS or name in formula.CONSTANTS or keyword.iskeyword(name)
    if taken or not re.fullmatch(QUANTITY, name):
        raise ValueError(
            f"{shown(name)} cannot be the name of a quantity: give letters, digits and _, and no "
            "name of a function, of pi or deg, or word of Python's"
        )
    return name


QuantityName = Annotated[
    str,
    AfterValidator(checked_quantity),
    WithJsonSchema({"type": "string", "pattern": f"^{QUANTITY}$"}),
]
PLAIN = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*\Z", re.ASCII)
FIXED = {
    "axis": "a vector of unit length",
    "axes": "a vector of unit length",
    "elastic": "short for other parts",
}
"""What formulas do not stand in, and why."""


def quantities(let: Mapping[str, Any], formulas: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of named quantities, those that follow from others worked out.

    let: values by name; formulas: of those that follow, by name

    Raises:
        MechanismError: a circle, or a formula that has no value; `where` names the quantity.
    """
    found: dict[str, Any] = {}

    def find(name: str, asking: tuple[str, ...]) -> None:
        if name in asking:
            circle = " -> ".join((*asking[asking.index(name) :], name))
            raise MechanismError(f"follows from itself: {circle}", ("let", name))
        if name in found or name not in let:
            return
        if name not in formulas:
            found[name] = float(let[name]) if isinstance(let[name], int) else let[name]
            return
        with told(("let", name)):
            needed = formula.names_in(formulas[name])
        for other in needed:
            find(other, (*asking, name))
        known = {other: found[other] for other in let if other in found}
        with told(("let", name)):
            found[name] = formula.value_of(formulas[name], known)

    for name in let:
        find(name, ())
    return {name: found[name] for name in let}


class told:
    """Say where in a description what is refused inside stands."""

    def __init__(self, where: Where):
        self.where = where

    def __enter__(self) -> None: ...

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if isinstance(error, MechanismError) and not error.where:
            raise MechanismError(error.what, self.where) from None


def worked_out(fields: Mapping[str, Any], record: type[Record]) -> dict[str, Any]:
    """Return the fields of a description with the values of the formulas in it, and these under
    `formulas`.

    fields: plain data, as a file holds them; record: the kind of description

    Raises:
        MechanismError: formulas that have no value, or stand where none may; `where` names the
            number.
    """
    # Named quantities first.
    given = fields.get("let")
    let = dict(given) if isinstance(given, Mapping) else {}
    own = {name: text for name, text in let.items() if means_formula(text, True)}
    values = quantities(let, own)
    texts: dict[Where, str] = {("let", name): text for name, text in own.items()}
    result = {**fields, "let": values} if let else dict(fields)
    # Then all numbers that are given by texts.
    rest = {name: part for name, part in fields.items() if name != "let"}
    for where, text in numeric_texts(record, rest, ()):
        if not means_formula(text, bool(let)):
            continue
        with told(where):
            refuse_place(where, text, fields)
            result = put(result, where, formula.value_of(text, values))
        texts[where] = text
    return {**result, "formulas": {".".join(at): t for at, t in texts.items()}} if texts else result


def means_formula(text: Any, named: bool) -> bool:
    """Tell whether a text where a number is expected is a formula; `named`: whether quantities are
    named, so that it cannot be a slip of another kind."""
    if not isinstance(text, str) or PLAIN.match(text):
        return False
    return named or (formula.is_formula(text) and not formula.names_in(text))


def refuse_place(where: Where, text: str, fields: Mapping[str, Any]) -> None:
    """Refuse a formula where the number is made into something else."""
    for part, why in FIXED.items():
        if part in where:
            raise MechanismError(f"is {why}, in which formulas do not stand; give a number", where)
    if (
        where[0] == "bodies"
        and "shapes" in where
        and fields["bodies"][where[1]].get("mass") is None
        and formula.names_in(text)
    ):
        raise MechanismError(
            "gives the body its mass, which would not follow from the formula; give the body a "
            "mass, or a number here",
            where,
        )


def numeric_texts(kind: Any, data: Any, where: Where) -> Iterator[tuple[Where, str]]:
    """Yield the texts in plain data that stand where their kind, an annotation, wants a number."""
    kinds = alternatives(kind)
    if isinstance(data, str):
        if float in kinds and str not in kinds:
            yield where, data
    elif isinstance(data, Mapping):
        records = [each for each in kinds if isinstance(each, type) and issubclass(each, Record)]
        own = [each for each in records if type_of(each) == data.get("type", type_of(each))]
        for key, item in data.items():
            field = own[0].model_fields.get(key) if own else None
            inner = field.annotation if field else mapped(kinds) if not records else None
            if inner is not None:
                yield from numeric_texts(inner, item, (*where, str(key)))
    elif isinstance(data, list | tuple):
        for index, item in enumerate(data):
            for inner in listed(kinds, index):
                yield from numeric_texts(inner, item, (*where, str(index)))


def alternatives(kind: Any) -> list[Any]:
    """Return the kinds that an annotation allows, without what is said about them."""
    if get_origin(kind) is Annotated:
        return alternatives(get_args(kind)[0])
    if str(get_origin(kind)) in ("typing.Union", "<class 'types.UnionType'>"):
        return [each for part in get_args(kind) for each in alternatives(part)]
    return [kind]


def type_of(record: type[Record]) -> Any:
    """Return the `type` that a kind of record has in files, if it has one."""
    field = record.model_fields.get("type")
    return field.default if field else None


def mapped(kinds: list[Any]) -> Any:
    """Return the kind of the values of a mapping, if there is one among some kinds."""
    return next((get_args(each)[1] for each in kinds if get_origin(each) is abc.Mapping), None)


def listed(kinds: list[Any], index: int) -> list[Any]:
    """Return the kind of an element of a list, if some kinds have one."""
    for each in kinds:
        if get_origin(each) is tuple:
            parts = get_args(each)
            return [parts[0]] if parts[-1:] == (...,) else list(parts[index : index + 1])
    return []


def put(data: Any, where: Where, value: Any) -> Any:
    """Return plain data with another value at a place."""
    if not where:
        return value
    if isinstance(data, Mapping):
        return {**data, where[0]: put(data[where[0]], where[1:], value)}
    return [put(x, where[1:], value) if str(k) == where[0] else x for k, x in enumerate(data)]


def own_formulas(mechanism: Any) -> dict[str, str]:
    """Return the formulas of the named quantities of a description, by name."""
    return {
        path.partition(".")[2]: text
        for path, text in mechanism.formulas.items()
        if path.startswith("let.")
    }


def dependents(mechanism: Any, names: set[str]) -> set[str]:
    """Return some named quantities and all that follow from them."""
    own, found = own_formulas(mechanism), set(names)
    while more := {
        name
        for name, text in own.items()
        if name not in found and found & {*formula.names_in(text)}
    }:
        found |= more
    return found


def following(mechanism: Any, names: set[str]) -> dict[str, str]:
    """Return the formulas of numbers that follow from named quantities, by path."""
    every = dependents(mechanism, names)
    return {
        path: text
        for path, text in mechanism.formulas.items()
        if not path.startswith("let.") and every & {*formula.names_in(text)}
    }


def borne(mechanism: Any, where: Where) -> Iterator[Where]:
    """Yield the places of the numbers that follow from a named quantity.

    Raises:
        MechanismError: the quantity bears nothing, or a formula does not give the number that
            stands there.
    """
    _, name = where
    found = following(mechanism, {name})
    if not found:
        raise MechanismError(
            f"'let.{name}' stands in no formula, so that nothing follows from it; use it in one"
        )
    for path, text in found.items():
        if not holds(mechanism, path, text):
            raise MechanismError(
                f"'let.{name}' bears on {path} by {shown(text)}, but another number stands there; "
                "give the formula anew, or remove it"
            )
        yield located(mechanism, path)[0]


def holds(mechanism: Any, path: str, text: str) -> bool:
    """Tell whether a formula gives the number that stands at its place."""
    try:
        value = formula.value_of(text, mechanism.let)
        return located(mechanism, path)[1] == value
    except MechanismError:
        return False


def standing(mechanism: Any) -> dict[str, str]:
    """Return the formulas that give the numbers at their places, by path."""
    return {path: text for path, text in mechanism.formulas.items() if holds(mechanism, path, text)}


def reworked(mechanism: Any, changed: set[str]) -> Any:
    """Return a description in which all that follows from changed quantities is worked out anew,
    unchecked."""
    let = quantities(mechanism.let, own_formulas(mechanism))
    result = swapped(mechanism, let=let)
    for path, text in following(mechanism, changed).items():
        with told(tuple(path.split("."))):
            value = formula.value_of(text, let)
        result = placed(result, located(mechanism, path)[0], value)
    return result


def with_quantities(
    mechanism: Described, let: Mapping[str, float | str], formulas: Mapping[str, str] | None
) -> Described:
    """Return the description with named quantities and formulas; see
    `Mechanism.with_quantities`."""
    whole: Any = mechanism
    let = checks.by_name(let, "the named quantities", "{'rod': 0.3}")
    formulas = checks.by_name(formulas, "the formulas", "{'bar.length': 'rod/2'}")
    own = own_formulas(whole) | {name: text for name, text in let.items() if isinstance(text, str)}
    own = {name: text for name, text in own.items() if name not in let or text == let[name]}
    values = quantities({**whole.let, **let}, own)
    texts = {path: text for path, text in whole.formulas.items() if not path.startswith("let.")}
    for path, text in formulas.items():
        where = located(mechanism, path)[0]
        refuse_place(where, text, {"bodies": {name: {"mass": 0.0} for name in whole.bodies}})
        texts[".".join(where)] = text
    every = {f"let.{name}": text for name, text in own.items()} | texts
    made = swapped(whole, let=values, formulas=every)
    result = reworked(made, set(values))
    for path, text in texts.items():  # those of plain numbers, too
        with told(tuple(path.split("."))):
            result = placed(result, located(mechanism, path)[0], formula.value_of(text, values))
    return result
