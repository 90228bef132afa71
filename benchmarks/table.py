"""Figures and sections: what was promised, what was measured, and the tables that say so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.console import Group
from rich.table import Table
from rich.text import Text

from benchmarks.machine import Machine

SIGNS = {"at most": "≤", "at least": "≥"}
STYLES = {"yes": "green", "NO": "red"}


@dataclass(frozen=True)
class Figure:
    """Hold one measured number and, where one was promised, its bound.

    value: None where this machine cannot measure it; `note` then says why.
    """

    what: str
    value: float | None
    unit: str = ""
    bound: float | None = None
    sense: Literal["at most", "at least"] = "at most"
    note: str = ""

    @property
    def met(self) -> bool | None:
        """Tell whether the bound is kept; None where nothing was promised or nothing could be
        measured."""
        if self.value is None or self.bound is None:
            return None
        return self.value <= self.bound if self.sense == "at most" else self.value >= self.bound

    @property
    def digits(self) -> int:
        """Return how many digits to show: more where three would hide on which side of the bound
        the value lies."""
        if self.value is None or self.bound is None:
            return 3
        return 5 if abs(self.value - self.bound) < 5e-3 * abs(self.bound) else 3

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Return what, promised, measured, met as texts."""
        promised = (
            "" if self.bound is None else f"{SIGNS[self.sense]} {quantity(self.bound, self.unit)}"
        )
        measured = (
            "not measurable here"
            if self.value is None
            else quantity(self.value, self.unit, self.digits)
        )
        return self.what, promised, measured, {True: "yes", False: "NO", None: ""}[self.met]

    @property
    def noted(self) -> tuple[str, str, str, str]:
        """Return the same texts with the note beside what."""
        what, promised, measured, met = self.cells
        return (f"{what} ({self.note})" if self.note else what), promised, measured, met


@dataclass(frozen=True)
class Listing:
    """Hold a table of many numbers of a kind: its column titles and its rows, all of them texts."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Section:
    """Hold the figures of one benchmark, how they were measured, the raw numbers behind them, and
    pictures by file name."""

    title: str
    method: str
    figures: Sequence[Figure] = ()
    raw: dict[str, Any] = field(default_factory=dict)
    pictures: dict[str, str] = field(default_factory=dict)
    listing: Listing | None = None

    def tables(self, notes: bool) -> list[Listing]:
        """Return the figures, with their notes or without, and the listing, as far as there are
        any."""
        rows = [figure.noted if notes else figure.cells for figure in self.figures]
        found = [Listing(("figure", "promised", "measured", "met"), rows)] if rows else []
        return found if self.listing is None else [*found, self.listing]


@dataclass(frozen=True)
class Page:
    """Hold sections that are written together: a title, the name of the files, the sections."""

    title: str
    name: str
    sections: Sequence[Section]


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Write a number with so many significant digits, all of those before the point at least, and
    its unit."""
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        text = f"{value:.{max(digits, len(str(int(abs(value)))))}g}"
    else:
        text = f"{value:.1e}"
    return f"{text} {unit}".rstrip()


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs of a text, each on one line with an empty line after it."""
    found = [" ".join(part.split()) for part in text.split("\n\n")]
    return [line for part in found for line in (part, "")]


def terminal(section: Section) -> Group:
    """Return a section as tables for a terminal of 80 columns."""
    tables = []
    for listing in section.tables(notes=False):
        table = Table(
            title=section.title,
            title_justify="left",
            width=80,
            collapse_padding=True,
            pad_edge=False,
        )
        first, *others = map(Text, listing.columns)
        table.add_column(first, overflow="fold", no_wrap=listing is section.listing)
        for name in others:
            table.add_column(name, justify="right", overflow="fold")
        for row in listing.rows:
            table.add_row(*map(Text, row), style=STYLES.get(row[-1], ""))
        tables.append(table)
    return Group(*tables)


def markdown(page: Page, machine: Machine, command: str, seconds: float) -> str:
    """Return all sections of a page, with the machine and the command that made it."""
    lines = [
        f"# {page.title}: what was promised and what was measured",
        "",
        (
            f"Written by `{command}` on {machine.date}, in {seconds:.0f} s. How the figures are "
            "measured and what they mean:"
        ),
        f"[benchmarks](../../docs/benchmarks.md). Raw numbers: `{page.name}.json`.",
        "",
        *(f"- {name}: {value}" for name, value in machine.lines().items()),
        "",
    ]
    for section in page.sections:
        lines += [f"## {section.title}", "", *paragraphs(section.method)]
        for listing in section.tables(notes=True):
            rows = (listing.columns, ["---"] * len(listing.columns), *listing.rows)
            lines += [*(f"| {' | '.join(row)} |" for row in rows), ""]
    return "\n".join(lines)
