"""The catalogue's page and its pictures are those of the robots as they are."""

import xml.etree.ElementTree as ElementTree
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from linkwork import robots

from tests.catalogue import built

DOCS = Path(__file__).parents[2] / "docs"
PICTURES = DOCS / "images" / "catalogue"


def script(name):
    """Import a script of the docs folder."""
    spec = spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec and spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_what_the_robots_say():
    page = script("catalogue").page({name: built(name) for name in robots.__all__})
    written = (DOCS / "catalogue.md").read_text(encoding="utf-8")
    assert written == page, "write the page anew: python docs/catalogue.py"


def test_every_robot_has_its_entry_with_picture_source_and_code():
    entries = (DOCS / "catalogue.md").read_text(encoding="utf-8").split("\n## ")[1:]
    assert [entry.partition("\n")[0] for entry in entries] == robots.__all__
    for name, entry in zip(robots.__all__, entries, strict=True):
        assert f"](images/catalogue/{name}.svg)" in entry
        assert f"`lw.Robot(lw.robots.{name}())`" in entry
        for title in ("Mobility", "Redundant rows", "Independent rates", "Source"):
            value = entry.partition(f"| {title} | ")[2].partition(" |\n")[0]
            assert value, f"{name}: {title}"


@pytest.mark.parametrize("name", robots.__all__)
def test_every_robot_has_a_small_picture_of_all_its_joints(name):
    path = PICTURES / f"{name}.svg"
    assert path.stat().st_size < 60_000
    identifiers = {element.get("id") for element in ElementTree.parse(path).iter()}
    pairs = built(name).mechanism.pairs
    assert {
        joint for joint, described in pairs.items() if described.type != "free"
    } <= identifiers, "draw the pictures anew: python docs/images.py"
    assert "http" not in path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")


def test_there_are_no_other_pictures():
    assert {path.stem for path in PICTURES.iterdir()} == set(robots.__all__)


def test_a_picture_is_drawn_like_the_one_that_is_kept():
    drawn = script("images").portrait(built("five_bar"))
    kept = (PICTURES / "five_bar.svg").read_text(encoding="utf-8")
    words = [
        [
            element.text
            for element in ElementTree.fromstring(text).iter()
            if element.tag.endswith("}text")
        ]
        for text in (drawn, kept)
    ]
    assert words[0] == words[1]
