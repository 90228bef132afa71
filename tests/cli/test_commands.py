"""The commands about robots and files, called in this process: what they print and write, and what
they refuse."""

import json

import pytest

import linkwork as lw

from tests.cli.calls import call, refused


def test_version():
    assert call("--version").output == f"linkwork {lw.__version__}\n"


def test_the_list_of_robots_is_the_catalogue():
    result = call("robots")
    assert result.exit_code == 0
    listed = [
        line.split()[0] for line in result.output.splitlines()[2:] if not line.startswith(" ")
    ]
    assert listed == lw.robots.__all__
    assert max(map(len, result.output.splitlines())) <= 80


@pytest.mark.long
def test_export_writes_a_file_that_is_the_same_robot(tmp_path):
    path = tmp_path / "robot.yaml"
    assert call("export", "prr3", path).exit_code == 0
    assert lw.Mechanism.load(path) == lw.robots.prr3()
    assert json.loads(call("info", path, "--json").stdout) == json.loads(
        call("info", "prr3", "--json").stdout
    )
    assert "exists; give another name, or --overwrite" in refused("export", "prr3", path)
    assert call("export", "prr3", path, "--overwrite").exit_code == 0
    assert "ends in .yaml, not '.txt'" in refused("export", "prr3", tmp_path / "robot.txt")


@pytest.mark.parametrize("debug", [("--debug", "info", "nobody"), ("info", "nobody", "--debug")])
def test_debug_shows_the_traceback_wherever_it_stands(debug):
    result = call(*debug)
    assert result.exit_code == 2
    assert "Traceback" in result.stderr
    assert "there is no robot 'nobody'" in result.stderr


def test_robots_that_are_refused(tmp_path):
    names = ", ".join(lw.robots.__all__)
    assert f"there is no robot 'nobody'; name one of the catalogue ({names})" in refused(
        "info", "nobody"
    )
    assert "none.yaml: cannot be read: no such file or directory" in refused(
        "info", tmp_path / "none.yaml"
    )
    broken = tmp_path / "broken.yaml"
    broken.write_text("linkwork: 1\nbodies: {a: {mass: -1}}\njoints: {}\n")
    assert "bodies.a.mass" in refused("info", broken)


def test_words_that_are_no_commands_or_options_exit_with_2():
    for words in (("simulat",), ("info", "prr3", "--loud"), ("simulate", "prr3")):
        result = call(*words)
        assert result.exit_code == 2
        assert result.stdout == ""


@pytest.mark.parametrize(
    ("word", "meant"), [("list", "robots"), ("run", "simulate"), ("analyze", "analyse")]
)
def test_words_of_other_tools_lead_to_the_command_that_is_meant(word, meant):
    assert (
        refused(word, "prr3") == f"linkwork: there is no command {word!r}; use 'linkwork {meant}'\n"
    )
    assert call(meant, "--help").exit_code == 0


def test_an_interruption_exits_with_130_and_says_nothing(monkeypatch):
    def interrupt(source):
        raise KeyboardInterrupt

    monkeypatch.setattr("linkwork.cli.info.built", interrupt)
    result = call("info", "prr3")
    assert (result.exit_code, result.output) == (130, "")


def test_an_interruption_while_a_library_is_loaded_is_no_refusal(monkeypatch):
    """What is compiled turns it into an ImportError, and a refusal may come of that."""

    def traced(*_):
        try:
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt as error:
                raise ImportError("initialization failed") from error
        except ImportError:
            raise lw.errors.LinkworkError("the controller cannot be traced") from None

    monkeypatch.setattr("linkwork.cli.info.built", traced)
    result = call("info", "prr3")
    assert (result.exit_code, result.output) == (130, "")
