"""The site builds without a warning and without a network, and holds everything that it leads
to."""

import os
import re
from pathlib import Path

import pytest

from tests.processes import PATIENCE, finished

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.long  # each asks for the whole site


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    words = ("mkdocs", "build", "--strict", "--quiet", "--site-dir", folder)
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    built = finished("-m", *words, cwd=ROOT, env=quiet, timeout=3 * PATIENCE)
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def pages(site):
    return [path for path in site.rglob("*.html") if path.name != "404.html"]


def test_every_page_of_the_docs_is_in_the_site(site):
    written = {
        path.relative_to(ROOT / "docs").with_suffix(".html")
        for path in (ROOT / "docs").rglob("*.md")
    }
    assert written <= {path.relative_to(site) for path in pages(site)}
    assert {"changelog.html", "contributing.html", "results"} <= {
        path.name for path in site.iterdir()
    }


def test_nothing_is_loaded_from_elsewhere(site):
    for path in pages(site):
        text = path.read_text(encoding="utf-8")
        loaded = re.findall(
            r"<(?:script|link|img|iframe|source)\b[^>]*?(?:src|href)=\"((?:https?:)?//[^\"]+)", text
        )
        assert loaded == [], path.name
    for path in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(?:https?:)?//", path.read_text(encoding="utf-8")), (
            path.name
        )


def test_every_link_leads_to_a_file_of_the_site(site):
    for path in pages(site):
        for target in re.findall(r"(?:href|src)=\"([^\"#?]+)", path.read_text(encoding="utf-8")):
            if not re.match(r"[a-z]+:", target):
                assert (path.parent / target).exists(), (
                    f"{path.relative_to(site)} leads to {target}"
                )


def test_links_through_the_repository_lead_through_the_site(site):
    measured = (site / "benchmarks.html").read_text(encoding="utf-8")
    assert 'href="results/foundation.html"' in measured
    assert 'href="../benchmarks.html"' in (site / "results" / "foundation.html").read_text(
        encoding="utf-8"
    )


def test_classes_list_their_fields(site):
    page = (site / "api" / "control.html").read_text(encoding="utf-8")
    assert re.search(r"<li>\s*(?:<p>)?<code>kp</code>:", page)
