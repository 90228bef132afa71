"""The native file format: YAML with the fields of `Mechanism`, read safely.

The first key is `linkwork: 1`, the version of the format. Numbers are SI and radians. Defaults are
left out.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import yaml

from linkwork.mechanism.document import EMPTY, NUMBER, TRUTH, DocumentNode, read_document
from linkwork.mechanism.json_schema import FORMAT_VERSION
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.parameter_units import refuse_units
from linkwork.mechanism.places import located
from linkwork.mechanism.quantities import standing, worked_out
from linkwork.mechanism.record import Record, swapped
from linkwork.mechanism.refusal import MechanismError, shown

NATIVE = (".yaml", ".yml")
"""Suffixes of mechanism files."""
MAX_BYTES = 20_000_000

Described = TypeVar("Described")


def parsed(text: str, folder: Path | None = None) -> Mechanism:
    """Return the mechanism that a file's text describes; every refusal names the line where there
    is one.

    folder: of the file, in which the meshes that it names are looked for, and have to be
    """

    def made(**fields: Any) -> Mechanism:
        if "formulas" in fields:
            raise MechanismError(
                "is not a known field; write formulas in the places of the numbers", ("formulas",)
            )
        fields = worked_out(fields, Mechanism)
        mechanism = Mechanism(**(fields if folder is None else _placed(fields, folder)))
        refuse_units(mechanism)
        return mechanism

    return described(read_document(text), "linkwork", FORMAT_VERSION, "mechanism", made)


def written(mechanism: Mechanism) -> str:
    """Return a mechanism as a file's text."""
    texts: dict[str, Any] = {}
    for path, text in standing(mechanism).items():
        *parents, last = located(mechanism, path)[0]
        inner = texts
        for part in parents:
            inner = inner.setdefault(part, {})
        inner[last] = text
    plain = _plain(mechanism, texts)
    plain.pop("formulas", None)
    fields = {"linkwork": FORMAT_VERSION} | plain
    return yaml.dump(fields, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=120)


def read_yaml(path: Path) -> Mechanism:
    """Read a mechanism; every refusal begins with the file's name, and the line where there is
    one."""
    try:
        text = text_of(path)
        if text.lstrip().startswith("<"):
            raise MechanismError(
                "this is a model file, not a mechanism file; read it by "
                "linkwork.formats.load(path).mechanism, or turn it into one by 'linkwork convert'",
                place=f"line {text[: text.index('<')].count(chr(10)) + 1}",
            )
        return parsed(text, path.parent)
    except MechanismError as error:
        place = f"{path}: {error.place}" if error.place else str(path)
        raise MechanismError(error.what, error.where, place) from None


def write_yaml(mechanism: Mechanism, path: Path) -> None:
    """Write a mechanism, atomically.

    Raises:
        MechanismError: a name that ends as files of another kind do; the file cannot be written.
    """
    if path.suffix and path.suffix.lower() not in NATIVE:
        raise MechanismError(
            f"would be YAML under a name in {path.suffix}; give one in .yaml, or write a file of "
            "another kind by linkwork.formats.save",
            place=str(path),
        )
    write_whole(path, written(_seen_from(path.parent, mechanism)))


def write_whole(path: Path, text: str) -> None:
    """Write a text in place of the file of that name, if there is one: at once, or not at all.

    Raises:
        MechanismError: the file cannot be written.
    """
    temporary = path.parent / f".{path.name}.{os.getpid()}"
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except (OSError, ValueError) as error:
        with suppress(OSError, ValueError):
            temporary.unlink()
        raise MechanismError(f"cannot be written: {_reason(error)}", place=str(path)) from None


def _placed(fields: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the fields of a mechanism with the meshes' files named from the root, and there."""
    bodies = fields.get("bodies")
    for name, body in bodies.items() if isinstance(bodies, dict) else ():
        shapes = body.get("shapes") if isinstance(body, dict) else None
        for number, shape in enumerate(shapes if isinstance(shapes, list) else ()):
            if not isinstance(shape, dict) or shape.get("type") != "mesh":
                continue
            file = shape.get("file")
            if isinstance(file, str) and "\0" not in file and file.strip():
                shape["file"] = str(folder / file)
                if not (folder / file).is_file():
                    raise MechanismError(
                        f"there is no file {shown(file)} in {str(folder)!r}; give the path of a "
                        "mesh, relative to this file",
                        ("bodies", name, "shapes", str(number), "file"),
                    )
    return fields


def _seen_from(folder: Path, mechanism: Mechanism) -> Mechanism:
    """Return a mechanism that names the files of its meshes from a folder, where they lie in it or
    in the one around it."""
    root = folder.resolve()
    bodies = dict(mechanism.bodies)
    for name, body in mechanism.bodies.items():
        shapes = tuple(
            swapped(shape, file=Path(os.path.relpath(shape.file, root)).as_posix())
            if shape.type == "mesh" and Path(shape.file).is_relative_to(root.parent)
            else shape
            for shape in body.shapes
        )
        if shapes != body.shapes:
            bodies[name] = swapped(body, shapes=shapes)
    return swapped(mechanism, bodies=bodies)


def _reason(error: OSError | ValueError) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def text_of(path: Path, what: str = "a mechanism file", most: int = MAX_BYTES) -> str:
    """Return the text of a YAML file of at most so many bytes; refusals say what it should be."""
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
    except (OSError, ValueError) as error:
        raise MechanismError(f"cannot be read: {_reason(error)}") from None
    if len(content) > most:
        raise MechanismError(f"is larger than {most // 10**6} MB; {what} is far smaller")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise MechanismError(
            f"is not UTF-8 text; {what} is YAML text", place=f"line {line}"
        ) from None


def described(
    root: DocumentNode, key: str, version: int, what: str, make: Callable[..., Described]
) -> Described:
    """Return what a document describes, made of its fields; every refusal names the line.

    key: of the first line, which gives the version of the format; what: it describes
    """
    first_line = f"the first line should be '{key}: {version}'"
    if not isinstance(root.data, dict):
        raise MechanismError(f"holds no {what}; {first_line}", place=f"line {root.line}")
    fields = dict(root.data)
    given = fields.pop(key, None)
    try:
        if given is None:
            raise MechanismError(f"is missing; {first_line}", (key,))
        if given != version:
            raise MechanismError(
                f"{shown(given)} is not a format version this program reads; give {version}", (key,)
            )
        return make(**fields)
    except MechanismError as error:
        raise MechanismError(error.what, error.where, f"line {root.line_of(error.where)}") from None


def _plain(value: Any, texts: Mapping[str, Any]) -> Any:
    """Turn records into dicts, the type first and without the fields at their defaults, and tuples
    into lists.

    texts: formulas that stand for numbers in it, by field, name or index
    """
    if isinstance(value, Record):
        fields = {name: getattr(value, name) for name in type(value).model_fields}
        kind = {"type": fields.pop("type")} if "type" in fields else {}
        return kind | {
            name: _written(item, texts.get(name, {}))
            for name, item in fields.items()
            if name in texts or not _is_default(value, name, item)
        }
    if isinstance(value, Mapping):
        return {key: _written(item, texts.get(key, {})) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_written(item, texts.get(str(k), {})) for k, item in enumerate(value)]
    return value


def _written(value: Any, text: Any) -> Any:
    """Return a value as plain data, or the formula that it follows from."""
    return text if isinstance(text, str) else _plain(value, text)


def _is_default(record: Record, name: str, value: Any) -> bool:
    field = type(record).model_fields[name]
    return not field.is_required() and value == field.get_default(call_default_factory=True)


class Dumper(yaml.SafeDumper):
    """Write vectors and small records on one line, and in quotes the text that would be read as
    something else."""


def _flat(value: Any) -> bool:
    items = value.values() if isinstance(value, dict) else value
    return all(not isinstance(item, dict | list) for item in items)


Dumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar(
        "tag:yaml.org,2002:str", text, style=None if text.isprintable() else '"'
    ),
)
Dumper.add_representer(
    list,
    lambda dumper, data: dumper.represent_sequence(
        "tag:yaml.org,2002:seq", data, flow_style=_flat(data)
    ),
)
Dumper.add_representer(
    dict,
    lambda dumper, data: dumper.represent_mapping(
        "tag:yaml.org,2002:map", data.items(), flow_style=_flat(data)
    ),
)
# NumPy's, too.
Dumper.add_multi_representer(float, lambda dumper, number: dumper.represent_float(float(number)))
for pattern, meaning in ((NUMBER, "float"), (TRUTH, "bool"), (EMPTY, "null")):
    Dumper.add_implicit_resolver(f"tag:yaml.org,2002:{meaning}", pattern, None)
