"""Commands called in this process."""

from typer.testing import CliRunner

from linkwork.cli import app


def call(*words):
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, [str(word) for word in words])


def refused(*words):
    """Call a command that must refuse; return its one sentence."""
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("linkwork: ")
    assert result.stderr.count("\n") == 1
    return result.stderr
