"""The report of the paper's study: complete, self-contained, escaped, with and without engines."""

import dataclasses
import re

import pytest
import xarray
from typer.testing import CliRunner

from linkwork.cli import app
from linkwork.lab import engines, reproduction
from linkwork.lab.comparison import NOC, PRESCRIBED
from linkwork.views.pages import PageTable, duration, environment, picture, short
from linkwork.views.style import svg

from tests.views.pages import Reader


@pytest.fixture(scope="module")
def drawn(comparison):
    return {name: svg(figure) for name, figure in reproduction.figures(comparison).items()}


@pytest.fixture(scope="module")
def html(comparison, drawn):
    return reproduction.render(comparison, drawn)


@pytest.mark.long
def test_the_page_is_self_contained_and_small(html):
    page = Reader(html)
    assert page.open == []
    assert not {"link", "img", "iframe", "object", "base"} & set(page.tags)
    assert page.tags.count("script") == 2 and "default-src 'none'" in html
    assert page.references and all(reference.startswith("#") for reference in page.references)
    assert "@import" not in html
    addresses = set(re.findall(r"https?://[^\s\"'<]*", html))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert len(html.encode()) < 3_000_000


def test_every_reference_within_the_page_has_one_target(html):
    page = Reader(html)
    assert len(page.identifiers) == len(set(page.identifiers))
    assert {reference[1:] for reference in page.references} <= set(page.identifiers)


def test_the_page_shows_the_papers_figures_and_the_tables_with_units(html, comparison):
    assert Reader(html).tags.count("svg") == 5
    for number in (4, 5, 6, 7):
        assert html.count(f"Figure {number}.") == 1
    for unit in ("[kg]", "[kg m²]", "[m]", "[rad]", "[m/s²]", "[ms]"):
        assert unit in html
    for curve in comparison.curves:
        assert curve.title in html


def test_names_in_a_page_are_escaped(comparison, drawn, monkeypatch):
    robot = comparison.robot
    odd = robot.mechanism.model_copy(update={"name": "<script>alert(1)</script>"})
    monkeypatch.setitem(vars(robot), "mechanism", odd)
    page = reproduction.render(comparison, drawn)
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page


def test_tables_and_captions_are_escaped(drawn):
    template = environment().from_string(
        '{% from "parts.html" import show_table, show_picture %}{{ show_table(table) }}{{ '
        "show_picture(picture) }}"
    )
    page = template.render(
        table=PageTable("<b>", ("<i> [m]",), [("<u>",)]),
        picture=picture("p", "<s>", drawn["robot"]),
    )
    assert not {"b", "i", "u", "s"} & set(Reader(page).tags)


def test_without_engines_the_page_says_so_and_shows_the_rest(comparison, drawn):
    alone = dataclasses.replace(
        comparison, curves=comparison.curves[:2], failures={"mujoco": "MuJoCo refuses: <it>"}
    )
    page = reproduction.render(alone, drawn)
    assert "Exudyn is not shown: not installed; pip install" in page
    assert "MuJoCo is not shown: MuJoCo refuses: &lt;it&gt;." in page
    assert Reader(page).tags.count("svg") == 5
    assert [curve.source for curve in alone.curves] == [PRESCRIBED, NOC]


def test_an_engine_that_fails_is_reported_and_loses_nothing(robot, monkeypatch):
    def fail(name, mechanism):
        raise engines.EngineError(f"{name} is ill")

    monkeypatch.setattr(engines, "build", fail)
    motion = reproduction.prescribed_motion(robot, samples=101)
    found = reproduction.compare(robot, motion, ["exudyn"], step=1e-2)
    assert found.failures == {"exudyn": "exudyn is ill"}
    assert [curve.source for curve in found.curves] == [PRESCRIBED, NOC]
    assert reproduction.absent(found)["Exudyn"] == "exudyn is ill"


@pytest.mark.long
def test_the_command_without_engines_writes_everything(tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "available", lambda: ())
    result = CliRunner(env={"COLUMNS": "80"}).invoke(
        app, ["reproduce", "--out", str(tmp_path / "new" / "demo")]
    )
    assert result.exit_code == 0, result.output
    assert "Pinocchio is not shown: not installed" in result.output
    folder = tmp_path / "new" / "demo"
    written = {path.name for path in folder.iterdir()}
    assert written == {
        "report.html",
        "reproduction.nc",
        *(f"{name}.svg" for name in reproduction.CAPTIONS),
    }
    data = xarray.load_dataset(folder / "reproduction.nc")
    assert list(data.source.values) == ["prescribed", "noc"]
    assert float(data.spline_error.max()) < 1e-9
    assert float(abs(data.tool_pose.diff("source")).max()) < 1e-10
    assert "Linkwork (NOC)" in result.stdout


def test_the_command_refuses_a_file_as_folder(tmp_path):
    place = tmp_path / "file"
    place.write_text("")
    result = CliRunner().invoke(app, ["reproduce", "--out", str(place)])
    assert result.exit_code == 2
    assert result.stderr == f"linkwork: --out {place}: is a file; name a folder\n"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (-0.0, "0"), (None, "–"), (float("nan"), "–"), (1.234e-9, "1.2·10⁻⁹"),
     (0.0125, "0.013"), (-27.3, "−27"), (1000, "1000"), (0.00099999, "0.001"),
     (9.99e-10, "1.0·10⁻⁹"), (-2e7, "−2.0·10⁷")],
)  # fmt: skip
def test_numbers_in_few_digits(value, text):
    assert short(value) == text


@pytest.mark.parametrize(
    ("value", "text"), [(None, "–"), (1.084, "1.08 s"), (0.0306, "30.6 ms"), (3.06e-5, "30.6 µs")]
)
def test_wall_times_in_their_unit(value, text):
    assert duration(value) == text
