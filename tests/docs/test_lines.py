"""Lines of code are at most 100 columns long, those of the docs where Markdown lets them end."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
FOLDERS = ("src", "tests", "benchmarks", "examples", "docs")
COLUMNS = 100
WHOLE = ("|", "#", "![")  # how rows, headings and pictures begin, which are one line each
SAID = re.compile(r"^```text\n.*?^```", re.S | re.M)  # what a terminal shows


@pytest.mark.parametrize("page", [pytest.param(page, id=page.name) for page in PAGES])
def test_lines_of_text_and_code_fit(page):
    lines = SAID.sub("", page.read_text(encoding="utf-8")).splitlines()
    long = [line for line in lines if len(line) > COLUMNS and not line.startswith(WHOLE)]
    assert long == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_lines_of_code_fit_with_their_comments(folder):
    """Ruff leaves out comments that are for tools."""
    long = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if len(line) > COLUMNS
    ]
    assert long == []
