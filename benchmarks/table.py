"""Figures and sections: what was promised, what was measured, and the tables that say so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.table import Table

from benchmarks.machine import Machine

SIGNS = {"at most": "≤", "at least": "≥"}


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
        """Tell whether the bound is kept; None where nothing was promised or nothing could be measured."""
        if self.value is None or self.bound is None:
            return None
        return self.value <= self.bound if self.sense == "at most" else self.value >= self.bound

    @property
    def digits(self) -> int:
        """Return how many digits to show: more where three would hide on which side of the bound the value lies."""
        if self.value is None or self.bound is None:
            return 3
        return 5 if abs(self.value - self.bound) < 5e-3 * abs(self.bound) else 3

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Return what, promised, measured, met as texts."""
        promised = "" if self.bound is None else f"{SIGNS[self.sense]} {quantity(self.bound, self.unit)}"
        measured = "not measurable here" if self.value is None else quantity(self.value, self.unit, self.digits)
        return self.what, promised, measured, {True: "yes", False: "NO", None: ""}[self.met]


@dataclass(frozen=True)
class Section:
    """Hold the figures of one benchmark, how they were measured, the raw numbers behind them, and pictures by file name."""

    title: str
    method: str
    figures: Sequence[Figure]
    raw: dict[str, Any] = field(default_factory=dict)
    pictures: dict[str, str] = field(default_factory=dict)


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Write a number with so many significant digits, all of those before the point at least, and its unit."""
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        text = f"{value:.{max(digits, len(str(int(abs(value)))))}g}"
    else:
        text = f"{value:.1e}"
    return f"{text} {unit}".rstrip()


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs of a text, each on one line with an empty line after it."""
    found = [" ".join(part.split()) for part in text.split("\n\n")]
    return [line for part in found for line in (part, "")]


def terminal(section: Section) -> Table:
    """Return a section as a table for a terminal of 80 columns."""
    table = Table(title=section.title, title_justify="left", width=80)
    for name in ("figure", "promised", "measured", "met"):
        table.add_column(name, justify="left" if name == "figure" else "right", overflow="fold")
    for figure in section.figures:
        style = {True: "green", False: "red", None: ""}[figure.met]
        table.add_row(*figure.cells, style=style)
    return table


def markdown(sections: Sequence[Section], machine: Machine, command: str, seconds: float) -> str:
    """Return all sections as one page, with the machine and the command that made it."""
    lines = [
        "# Foundation: what was promised and what was measured",
        "",
        f"Written by `{command}` on {machine.date}, in {seconds:.0f} s. How the figures are measured and what they mean:",
        "[benchmarks](../../docs/benchmarks.md). Raw numbers: `foundation.json`.",
        "",
        *(f"- {name}: {value}" for name, value in machine.lines().items()),
        "",
    ]
    for section in sections:
        lines += [f"## {section.title}", "", *paragraphs(section.method), "| figure | promised | measured | met |"]
        lines += ["| --- | --- | --- | --- |"]
        for figure in section.figures:
            what, promised, measured, met = figure.cells
            what = f"{what} ({figure.note})" if figure.note else what
            lines.append(f"| {what} | {promised} | {measured} | {met} |")
        lines.append("")
    return "\n".join(lines)
