"""The examples of README and docs do what they show: each page's code runs, block after block, as a
reader would run it."""

import re
import shlex
from pathlib import Path

import matplotlib
import pytest
from typer.testing import CliRunner

import linkwork as lw
from linkwork.cli import app

pytestmark = pytest.mark.filterwarnings("error:.* is .* now$:DeprecationWarning")

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```", re.S | re.M)


def named(pages):
    return [pytest.param(page, id=str(page.relative_to(ROOT))) for page in pages]


def called(line):
    """Call a line of a terminal; only the project's own command is called."""
    words = shlex.split(line, comments=True)
    if words[:1] == ["linkwork"]:
        result = CliRunner(env={"COLUMNS": "80"}).invoke(app, words[1:])
        assert result.exit_code == 0, f"{line}: {result.output}"


@pytest.mark.long
@pytest.mark.parametrize(
    "page", named(page for page in PAGES if BLOCK.search(page.read_text(encoding="utf-8")))
)
def test_code(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    matplotlib.use("agg")
    names = {"__name__": "__main__"}
    for number, (language, text) in enumerate(BLOCK.findall(page.read_text(encoding="utf-8"))):
        if language == "python":
            exec(compile(text, f"{page.name}, block {number}", "exec"), names)
        else:
            for line in text.replace("\\\n", " ").splitlines():
                called(line)


def mechanisms():
    for page in PAGES:
        for index, text in enumerate(
            re.findall(r"```yaml\n(linkwork:.*?)```", page.read_text(encoding="utf-8"), re.S)
        ):
            yield pytest.param(text, id=f"{page.name}-{index}")


@pytest.mark.parametrize("text", list(mechanisms()))
def test_mechanism_files(text, tmp_path):
    (tmp_path / "example.yaml").write_text(text)
    robot = lw.Robot.from_file(tmp_path / "example.yaml")
    assert robot.closure_error(robot.home) < 1e-12


@pytest.mark.parametrize("page", named(PAGES))
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
