"""The programs of the folder examples run as they are, and their page and pictures are theirs."""

import runpy
import sys
from pathlib import Path

import matplotlib
import pytest

from tests.docs.test_catalogue_page import script

pytestmark = pytest.mark.filterwarnings("error:.* is .* now$:DeprecationWarning")

gallery = script("gallery")
EXAMPLES = gallery.examples()


@pytest.mark.sample(2)
@pytest.mark.parametrize("example", [pytest.param(path, id=path.stem) for path in EXAMPLES])
def test_an_example_runs_and_draws_its_picture(example, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example)])
    matplotlib.use("agg")
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out.strip()
    assert (tmp_path / gallery.picture(example)).stat().st_size > 5000


@pytest.mark.parametrize("example", [pytest.param(path, id=path.stem) for path in EXAMPLES])
def test_an_example_is_short(example):
    lines = example.read_text(encoding="utf-8").splitlines()
    assert 20 <= len(lines) <= 60
    assert max(map(len, lines)) <= 100


def test_they_are_in_order():
    assert [path.name[:3] for path in EXAMPLES] == [
        f"{number:02}_" for number in range(1, len(EXAMPLES) + 1)
    ]


def test_the_page_is_what_the_examples_say():
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.page(), (
        "write it anew: python docs/gallery.py"
    )


def test_every_example_has_its_picture_and_there_are_no_others():
    wanted = {gallery.picture(path) for path in EXAMPLES}
    assert {path.name for path in Path(gallery.PICTURES).iterdir()} == wanted
