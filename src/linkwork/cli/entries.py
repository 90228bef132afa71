"""Numbers given on the command line or in a file of forces."""

from __future__ import annotations

import csv
from collections.abc import Container, Iterable, Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.formats.references import amount

TIME = "time"


def by_name(
    text: str,
    names: Sequence[str],
    option: str,
    angles: Container[str] | None = None,
) -> dict[str, float]:
    """Return the values of "slide_1=5,slide_2=1" by name, or of "5,1,0" in the order of all names.

    Args:
        angles: which names are angles, where values may have units, as in "crank=40deg".

    Raises:
        LinkworkError: not a number, a name that is unknown or given twice, another count of
            numbers.
    """
    parts = text.split(",")
    if not any("=" in part for part in parts):
        if len(parts) != len(names):
            raise LinkworkError(
                f"{option} holds {len(parts)} number{'s' * (len(parts) > 1)}; give {len(names)}, "
                f"one each for {', '.join(names)}, or name=value"
            )
        return {
            name: number(part, option) if angles is None else amount(part, name in angles, option)
            for name, part in zip(names, parts, strict=True)
        }
    found: dict[str, float] = {}
    for part in parts:
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise LinkworkError(
                f"{option}: {part.strip()!r} has no name; write name=value for all, or for none"
            )
        if name not in names:
            raise LinkworkError(f"{option}: there is no {name!r}; the names are {', '.join(names)}")
        if name in found:
            raise LinkworkError(f"{option}: {name!r} is given twice; keep one of them")
        found[name] = _value(value, name, option, angles)
    return found


def _value(given: str, name: str, option: str, angles: Container[str] | None) -> float:
    """Return the value that is given for a name; where angles are known it may have a unit."""
    place = f"{option}: {name}"
    return number(given, place) if angles is None else amount(given, name in angles, place)


def number(text: str, place: str) -> float:
    """Return a finite number; the refusal of another text begins with its place."""
    try:
        value = float(text)
    except ValueError:
        raise LinkworkError(f"{place}: {text.strip()!r} is not a number") from None
    if not isfinite(value):
        raise LinkworkError(f"{place}: {text.strip()} is not a finite number")
    return value


def read_columns(path: Path, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read samples over time from a CSV file: a column `time` [s] and one for each name, in any
    order.

    Lines that begin with # and empty lines are passed over.

    Returns:
        times (N,) and values (N, len(names)) in the order of the names.

    Raises:
        LinkworkError: the file cannot be read, columns are missing, unknown or double, an entry is
            no number, a time does not increase; the line in the file is named.
    """
    lines, columns = read_table(path, (TIME, *names))
    values = np.column_stack([columns[name] for name in (TIME, *names)])
    if len(values) < 2:
        raise LinkworkError(f"{path} holds {len(values)} rows of numbers; give at least two")
    late = np.flatnonzero(~(np.diff(values[:, 0]) > 0))
    if late.size:
        k = int(late[0]) + 1
        raise LinkworkError(
            f"{path}, line {lines[k]}: the time {values[k, 0]:g} s does not come after "
            f"{values[k - 1, 0]:g} s in the row before; times must increase"
        )
    return values[:, 0], values[:, 1:]


def read_table(
    path: Path, needed: Sequence[str], further: Sequence[str] = ()
) -> tuple[list[int], dict[str, np.ndarray]]:
    """Read the columns of a CSV file by name: all of those needed, and those of further ones that
    it has, in any order.

    Lines that begin with # and empty lines are passed over.

    Returns:
        The number of each row's line, and columns (N,) by name.

    Raises:
        LinkworkError: the file cannot be read, columns are missing, unknown or double, an entry is
            no number; the line in the file is named.
    """
    rows = list(_rows(path))
    if not rows:
        raise LinkworkError(
            f"{path} is empty; its first line names the columns: {','.join(needed)}"
        )
    header = [title.strip() for title in rows[0][1]]
    _check_header(path, header, needed, further)
    values = np.array([_entries(path, line, row, header) for line, row in rows[1:]]).reshape(
        -1, len(header)
    )
    return [line for line, _ in rows[1:]], dict(zip(header, values.T, strict=True))


def _rows(path: Path):
    """Yield the line number and the entries of each row."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            for row in reader:
                if any(entry.strip() for entry in row) and not row[0].lstrip().startswith("#"):
                    yield reader.line_num, row
    except OSError as error:
        raise LinkworkError(
            f"{path} cannot be read: {(error.strerror or str(error)).lower()}"
        ) from None
    except (UnicodeDecodeError, csv.Error):
        raise LinkworkError(
            f"{path} is not a CSV file: UTF-8 text with commas between the entries"
        ) from None


def _check_header(
    path: Path, header: list[str], needed: Sequence[str], further: Sequence[str]
) -> None:
    every = ", ".join([*needed, *further])
    for title in header:
        if title not in (*needed, *further):
            raise LinkworkError(f"{path} has an unknown column {title!r}; the columns are {every}")
        if header.count(title) > 1:
            raise LinkworkError(f"{path} has the column {title!r} more than once; keep one of them")
    missing = [name for name in needed if name not in header]
    if missing:
        raise LinkworkError(f"{path} lacks the column {missing[0]!r}; the columns are {every}")


def _entries(path: Path, line: int, row: list[str], header: list[str]) -> list[float]:
    if len(row) != len(header):
        raise LinkworkError(
            f"{path}, line {line}: holds {len(row)} entries; give {len(header)}: "
            f"{', '.join(header)}"
        )
    return [
        number(entry, f"{path}, line {line}, column {title!r}")
        for entry, title in zip(row, header, strict=True)
    ]


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names of "x,y,rz"; None where nothing is said."""
    return None if text is None else tuple(part.strip() for part in text.split(","))


def pairs(text: str, option: str) -> Iterable[tuple[str, str]]:
    """Yield the names and values of "a=1,b=2"."""
    seen: set[str] = set()
    for part in text.split(","):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals:
            raise LinkworkError(f"{option}: {part.strip()!r} has no name; write name=value")
        if name in seen:
            raise LinkworkError(f"{option}: {name!r} is given twice; keep one of them")
        seen.add(name)
        yield name, value
