"""Numbers that the docs repeat from the benchmarks' results are those of the results: each is
followed by a mark that names page and figure, <!-- simulation: a step from Python, out= -->."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = {
    path.stem: json.loads(path.read_text(encoding="utf-8"))
    for path in (ROOT / "benchmarks" / "results").glob("*.json")
}
PAGE, NUMBER = "|".join(RESULTS), r"\d[\d,]*(?:\.\d+)?"
MARK = re.compile(rf"<!-- ({PAGE}): (.*?) -->")
SHOWN = rf"({NUMBER})(?: to ({NUMBER}))?(?: (ns|us|µs|ms|s|million))?"
MARKED = re.compile(SHOWN + MARK.pattern)
UNITS = {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "ms": 1e-3}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def marked() -> Iterator[Any]:
    """Yield the number, or two, their unit, page and figure of each mark."""
    for path in PAGES:
        for found in MARKED.finditer(path.read_text(encoding="utf-8")):
            yield pytest.param(*found.groups(), id=f"{path.stem}, {found[5]}")


def last_digit(text: str) -> float:
    """Return what the last digit counts that was not rounded away."""
    whole, _, decimals = text.replace(",", "").partition(".")
    return 10.0 ** (-len(decimals) or len(whole) - len(whole.rstrip("0")))


@pytest.mark.parametrize(("low", "high", "unit", "page", "what"), [*marked()])
def test_a_number_is_that_of_the_results(low, high, unit, page, what):
    figures = [each for part in RESULTS[page]["sections"].values() for each in part["figures"]]
    (figure,) = (each for each in figures if each["what"] == what)
    value = figure["value"] * UNITS.get(figure["unit"], 1.0) / UNITS.get(unit, 1.0)
    least, most = (float(text.replace(",", "")) for text in (low, high or low))
    room = 0.5 * last_digit(high or low)
    assert least - room <= value <= most + room


def test_each_mark_stands_behind_a_number():
    texts = [path.read_text(encoding="utf-8") for path in PAGES]
    marks, numbers = (sum(len(each.findall(text)) for text in texts) for each in (MARK, MARKED))
    assert marks == numbers > 5
