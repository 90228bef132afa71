"""A user's script runs, and is typed."""

from importlib.resources import files
from pathlib import Path

import pytest

from tests.processes import finished

SCRIPT = Path(__file__).with_name("script.py")


@pytest.mark.long
def test_the_script_runs_in_a_fresh_folder(tmp_path):
    done = finished("-W", "error::DeprecationWarning:__main__", SCRIPT, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "True The run reached its end" in done.stdout
    assert (tmp_path / "report.html").stat().st_size > 10_000


def test_the_package_says_that_it_is_typed():
    assert files("linkwork").joinpath("py.typed").is_file()
