"""How commands tell what they found: tables in 80 columns, plain data, completion."""

import json
import os
import re

import numpy as np
import pytest
import typer

import linkwork as lw
from linkwork.cli import app
from linkwork.cli.options import files_like, methods_like, robots_like
from linkwork.cli.terminal import broken, console, facts, plain, table, tidy
from linkwork.simulation.methods import METHODS

from tests.cli.calls import call
from tests.processes import finished


def printed(renderable) -> list[str]:
    out = console()
    with out.capture() as text:
        out.print(renderable)
    return text.get().splitlines()


@pytest.mark.parametrize("columns", [3, 9, 20])
@pytest.mark.parametrize("width", [40, 80])
def test_numbers_are_never_broken_and_lines_fit(columns, width, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    rng = np.random.default_rng(columns)
    rows = [
        [f"joint_{k}", *(f"{value:.6g}" for value in rng.normal(size=columns) * 1e-17)]
        for k in range(3)
    ]
    header = ["", *(f"coordinate_{k}" for k in range(columns))]
    lines = printed(table(header, rows, numbers=range(1, columns + 1)))
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    assert all(re.search(rf"(?<!\S){re.escape(cell)}(?!\S)", text) for row in rows for cell in row)


def test_words_are_broken_between_words(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    rows = [("a name", "word " * 40, "1.5")]
    lines = printed(table(("", "words", "number"), rows, numbers=(2,)))
    assert max(map(len, lines)) <= 80 and sum(line.count("word ") for line in lines) >= 40


def test_lists_of_facts_are_broken_between_their_parts():
    text = ", ".join(f"joint_{k} {k}.25" for k in range(12))
    lines = broken(text, 40).split("\n")
    assert max(map(len, lines)) <= 40 and " ".join(lines) == text
    assert not any(line.endswith(("joint_", " ")) or re.match(r"\d", line) for line in lines)
    assert broken("a sentence, " * 5 + "x" * 60, 40).count("\n") == 0


def test_a_name_that_is_longer_than_a_line_is_told_whole(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    lines = printed(facts([("joint", "x" * 70)]))
    assert "".join(lines).count("x") == 70 and max(map(len, lines)) <= 40


def test_what_is_rounding_is_shown_as_zero():
    assert tidy([1e-17, -3.0, 2e-13, 1e-11], 1.0).tolist() == [0.0, -3.0, 0.0, 1e-11]


def test_plain_data_is_json():
    data = {
        "a": np.array([1.0, np.nan]),
        "b": (1j, np.float64(2)),
        "c": lw.Status.FINISHED,
        1: None,
    }
    assert plain(data) == {"a": [1.0, None], "b": [[0.0, 1.0], 2.0], "c": "finished", "1": None}


def commands(group=None, words=()):
    """Yield all commands with the words that call them."""
    for word, command in (group or typer.main.get_command(app)).commands.items():  # pyright: ignore
        if hasattr(command, "commands"):
            yield from commands(command, (*words, word))
        else:
            yield (*words, word), command


def test_every_command_tells_plain_data_and_what_its_options_are():
    for words, command in commands():
        options = {name for parameter in command.params for name in parameter.opts}
        assert "--json" in options, words
        assert all(p.help for p in command.params if p.opts != ["--help"]), words
        told = ("analyse", "prr3", *words[1:]) if words[0] == "analyse" else words
        text = call(*told, "--help").stdout
        assert max(map(len, text.splitlines())) <= 80, words
        assert "…" not in text, f"{words}: a word is longer than its column"


def test_help_is_broken_where_the_terminal_ends():
    listed = call("--help").stdout
    assert "limits, springs, sizes" in " ".join(listed.replace("│", " ").split())
    for words, command in commands():
        paragraphs = str(command.help).split("\n\n")
        assert not any("\n" in paragraph for paragraph in paragraphs), words
        # Typer takes what stands in brackets for a style, and drops a unit there.
        assert [param.name for param in command.params if "[" in (param.help or "")] == [], words


SUBJECTS = {
    "modes": ("five_bar",),
    "singularities": ("five_bar",),
    "workspace": ("five_bar", "--grid", "x=0:0.3:5,y=0.3"),
    "dexterity": ("five_bar",),
    "linearise": ("five_bar",),
    "stiffness": ("five_bar", "--joint-stiffness", "motor_1=1e3,motor_2=1e3"),
    "equilibrium": ("pendulum",),
    "parameters": ("pendulum",),
}


@pytest.mark.parametrize("subject", SUBJECTS)
def test_studies_are_told_as_plain_data(subject):
    robot, *words = SUBJECTS[subject]
    result = call("analyse", robot, subject, *words, "--json")
    assert result.exit_code == 0, result.output
    json.loads(result.stdout)


def test_stiffnesses_of_an_equilibrium_say_along_what():
    words = ("analyse", "double_pendulum", "equilibrium")
    (told,) = json.loads(call(*words, "--json").stdout)
    assert len(told["stiffness"]) == len(told["independent"]) == 2
    assert f", along {', '.join(told['independent'])}" in call(*words).stdout
    own = ", ".join(f"{row[k]:.4g}" for k, row in enumerate(told["stiffness"]))
    assert f" {own}, along " in call(*words).stdout


def test_rounding_of_stiffnesses_is_shown_as_zero():
    """Level, with equal springs, a 3-RRS is stiff in z, rx and ry, each by itself."""
    words = ("--joint-stiffness", "motor_1=1e5,motor_2=1e5,motor_3=1e5")
    *_, x, y, z, rx, ry, rz = call("analyse", "rrs3", "stiffness", *words).stdout.splitlines()
    for row in (x, y, rz):
        assert row.split()[1:] == ["0"] * 6
    for row, own in ((z, 3), (rx, 4), (ry, 5)):
        others = row.split()
        assert float(others.pop(own)) > 1e4 and others[1:] == ["0"] * 5


def test_files_that_are_written_are_told_as_plain_data(tmp_path):
    file, model = tmp_path / "robot.yaml", tmp_path / "robot.xml"
    assert json.loads(call("export", "prr3", file, "--json").stdout) == {"written": [str(file)]}
    assert json.loads(call("convert", file, model, "--json").stdout)["written"] == [str(model)]
    names = [each["name"] for each in json.loads(call("robots", "--json").stdout)]
    assert names == lw.robots.__all__


def test_the_methods_that_may_be_named_are_the_librarys():
    assert methods_like("") == [*METHODS]
    assert methods_like("do") == ["dormand_prince", "dop853"]


def test_names_and_files_are_completed(tmp_path, monkeypatch):
    for name in ("mine.yaml", "mine.txt", "model.urdf", "run.nc"):
        (tmp_path / name).touch()
    (tmp_path / "models").mkdir()
    monkeypatch.chdir(tmp_path)
    assert robots_like("prr") == ["prr3"] and robots_like("mi") == ["mine.yaml"]
    assert robots_like("m") == ["mine.yaml", "model.urdf", "models/"]
    assert files_like(f"{tmp_path}/ru", (".nc",)) == [f"{tmp_path}/run.nc"]
    assert files_like("nowhere/a", (".nc",)) == []


def test_the_shell_is_told_what_may_follow():
    asked = {"_LINKWORK_COMPLETE": "complete_bash", "COMP_CWORD": "2"}
    env = {**os.environ, **asked, "COMP_WORDS": "linkwork info prr"}
    told = finished("-m", "linkwork", env=env).stdout
    assert told.split() == ["prr3"]


def test_a_folder_alone_does_not_end_the_word(tmp_path, monkeypatch):
    """Shells put a space behind a completion that is alone: what is in the folder goes with it."""
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "arm.yaml").touch()
    monkeypatch.chdir(tmp_path)
    assert robots_like("ro") == ["robots/", "robots/arm.yaml"]
    assert robots_like("robots/") == ["robots/arm.yaml"]


def test_a_way_without_slope_is_told_in_words():
    """The Tripteron's determinants are constant: no way of its tool leads to where they vanish."""
    assert "inf" not in (said := call("analyse", "tripteron", "singularities").stdout)
    assert len(re.findall(r"way to kind I+ +none to first order", said)) == 2


def test_a_way_with_a_slope_is_told_as_a_length_or_an_angle():
    said = call("analyse", "delta", "singularities").stdout
    assert re.search(r"way to kind II +0\.\d+ m of the tool, to first order", said)
    assert re.search(r"way to kind I +0\.\d+ rad of the actuators, to first order", said)
