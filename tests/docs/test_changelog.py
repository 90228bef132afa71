"""The changelog stays what a user reads: short, and grouped by areas."""

import re
from pathlib import Path

TEXT = (Path(__file__).parents[2] / "CHANGELOG.md").read_text(encoding="utf-8")
PARTS = re.split(r"^### (.*)\n", TEXT.partition("## Unreleased")[2], flags=re.M)
MOST = 3000  # words that a user reads of one version


def test_what_is_not_released_yet_is_told_briefly():
    assert len("".join(PARTS).split()) <= MOST


def test_each_change_stands_in_an_area():
    kinds = dict(zip(PARTS[1::2], PARTS[2::2], strict=True))
    assert list(kinds) == ["Added", "Changed", "Fixed"]
    for text in kinds.values():
        assert re.match(r"\n[A-Z][\w ,]*\n\n- ", text)  # the first area, and its first change
