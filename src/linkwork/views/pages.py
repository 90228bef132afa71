"""Pages: self-contained HTML with figures as inline SVG; nothing is loaded from anywhere.

All text that is put into a page is escaped; only figures made here are put in as they are.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

VIEWS = "linkwork.views"
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class PageTable:
    """Hold a table: its columns' titles with units, rows of text, and a caption; all but the first
    column are numbers where `numbers` says so."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = True


@dataclass(frozen=True)
class Picture:
    """Hold a figure as SVG for a page; `name` is unique on the page and tells what is seen."""

    name: str
    caption: str
    svg: Markup


def picture(name: str, caption: str, drawing: str) -> Picture:
    """Turn a figure, written as SVG, into a picture for a page: no preamble, and identifiers that
    are its own."""
    from markupsafe import Markup

    drawing = drawing[drawing.index("<svg") :]
    drawing = re.sub(r'\b(id=")', rf"\1{name}-", drawing)
    drawing = re.sub(r'(url\(#|href="#)', rf"\1{name}-", drawing)
    drawing = re.sub(r' width="[\d.]+pt" height="[\d.]+pt"', "", drawing, count=1)
    drawing = drawing.replace("<svg ", f'<svg role="img" aria-label="{name}" ', 1)
    return Picture(name, caption, Markup(drawing))


def page(template: str, package: str = VIEWS, **content: Any) -> str:
    """Return a page from a template in the folder `templates` of a package."""
    return environment(package).get_template(template).render(**content)


@lru_cache
def environment(package: str = VIEWS) -> Environment:
    """Return what renders the templates of a package, which may build on those here."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader(VIEWS)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["short"] = short
    return made


def short(value: float | None, digits: int = 2) -> str:
    """Return a number in few digits: 0.0125, 1.2·10⁻⁹; a dash for none."""
    if value is None or value != value:
        return "–"
    rounded = float(f"{value:.{digits}g}") + 0.0  # no minus before a zero
    if rounded == 0 or 1e-3 <= abs(rounded) < 1e5:
        return f"{rounded:.10g}".replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    factor = "" if mantissa == "1" else f"{mantissa}·"
    return f"{factor}10{str(int(exponent)).translate(RAISED)}".replace("-", "−")


def duration(seconds: float | None) -> str:
    """Return a wall time in its natural unit: 35 ms."""
    if seconds is None:
        return "–"
    scale, unit = (1, "s") if seconds >= 1 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "µs")
    return f"{seconds * scale:.3g} {unit}"
