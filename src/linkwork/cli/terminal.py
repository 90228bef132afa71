"""What the commands print: tables that fit 80 columns, plain data, and a sign of life where
something takes long."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console, Group
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from linkwork.patience import hushed, later

PATIENCE = 1.0  # how long nothing is shown [s]
BETWEEN = 2  # columns of the terminal between those of a table
WORDS = 24  # width that a column of words is given at least, if it takes so much
PART = 40  # characters of the longest part of a list
ROUNDING = 1e-12  # of lengths over the robot's own, and of angles, that is shown as zero


def console() -> Console:
    """Return a console that prints text as it is: names are no markup."""
    return Console(markup=False, highlight=False)


def table(
    header: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()
) -> Group:
    """Return a table; the columns in `numbers` are set flush right, and not broken.

    Columns that do not fit side by side follow below, beside the first one again.
    """
    blocks = fitting(header, rows, numbers, console().width)
    parts: list[Table | str] = []
    for block in blocks:
        parts += [""] if parts else []
        parts.append(_block(header, rows, numbers, block))
    return Group(*parts)


def fitting(
    header: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int], width: int
) -> list[list[int]]:
    """Return the columns that stand side by side in so much width, the first one always."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    least = [own if k in numbers else min(own, WORDS) for k, own in enumerate(widths)]
    blocks = [[0]]
    for column in range(1, len(header)):
        taken = sum(least[k] + BETWEEN for k in blocks[-1])
        if taken + least[column] > width and len(blocks[-1]) > 1:
            blocks.append([0])
        blocks[-1].append(column)
    return blocks


def _block(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    numbers: Sequence[int],
    columns: Sequence[int],
) -> Table:
    made = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
    for index in columns:
        kept = index in numbers
        justify = "right" if kept else "left"
        made.add_column(Text(header[index]), justify=justify, overflow="fold", no_wrap=kept)
    for row in rows:
        made.add_row(*(Text(row[index]) for index in columns))
    return made


def facts(rows: Sequence[tuple[str, str]]) -> Table:
    """Return a list of names and values; a value that is itself a list is broken between its
    parts."""
    made = Table.grid(padding=(0, 2, 0, 0))
    made.add_column()
    made.add_column(overflow="fold")
    width = console().width - max((len(name) for name, _ in rows), default=0) - 2 * BETWEEN
    for name, value in rows:
        made.add_row(Text(name, style="bold"), Text(broken(value, width)))
    return made


def broken(value: str, width: int) -> str:
    """Return a list of short parts in lines of so much width; other text as it is."""
    parts = re.split(r"(?<=[,;]) ", value)
    if len(value) <= width or max(map(len, parts)) > PART:
        return value
    lines = [parts[0]]
    for part in parts[1:]:
        if len(lines[-1]) + 1 + len(part) <= width:
            lines[-1] += f" {part}"
        else:
            lines.append(part)
    return "\n".join(lines)


def named(labels: Sequence[str], values: Any, digits: int = 6) -> str:
    """Return values by name as text, "x 0.5, y 0.29"."""
    pairs = zip(labels, np.asarray(values, float).tolist(), strict=True)
    return ", ".join(f"{label} {value:.{digits}g}" for label, value in pairs)


def tidy(values: Any, size: Any = 1.0) -> np.ndarray:
    """Return values of which those are zero that are rounding of others of some size."""
    given = np.asarray(values, float)
    return np.where(np.abs(given) <= ROUNDING * np.asarray(size), 0.0, given)


def show_json(data: Any) -> None:
    """Print plain data as JSON; what is not a finite number is null, and letters that the stream
    does not hold are JSON's own escapes."""
    text = json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        text = json.dumps(plain(data), indent=2, allow_nan=False)
    print(text)


def plain(value: Any) -> Any:
    """Return numbers, arrays and names as JSON holds them; complex numbers as [real, imaginary]."""
    match value:
        case Mapping():
            return {str(name): plain(part) for name, part in value.items()}
        case Enum():
            return value.name.lower()
        case Path():
            return str(value)
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case complex():
            return [plain(value.real), plain(value.imag)]
        case float():
            return value if np.isfinite(value) else None
        case str() | int() | None:
            return value
    return [plain(part) for part in value]


@contextmanager
def patience(what: str) -> Iterator[None]:
    """Show what is going on, and for how long, on the terminal's stderr, once it has taken longer
    than a second."""
    terminal = Console(stderr=True)
    if not terminal.is_terminal:
        yield
        return
    parts = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    shown = Progress(*parts, console=terminal, transient=True)
    shown.add_task(f"{what} ...", total=None)
    try:
        with later(PATIENCE, shown.start), hushed():
            yield
    finally:
        shown.stop()
