"""The command as users start it: a process, its exit status and its two streams."""

import json
import os
import subprocess
from pathlib import Path

import pytest

import linkwork as lw

from tests.processes import PATIENCE, finished, python

PROBE = """
import sys
from linkwork.cli import main
try:
    main()
finally:
    print(sorted({name.partition(".")[0] for name in sys.modules}), file=sys.stderr)
"""


def run(*words, code=None):
    return finished(*(("-c", code) if code else ("-m", "linkwork")), *words)


@pytest.mark.long
def test_a_refusal_is_one_line_on_stderr_and_status_2():
    result = run("info", "nobody.yaml")
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr == "linkwork: nobody.yaml: cannot be read: no such file or directory\n"
    assert "Traceback" in run("info", "nobody.yaml", "--debug").stderr


@pytest.mark.long
def test_info_loads_no_heavy_packages():
    result = run("info", "prr3", "--json", code=PROBE)
    assert json.loads(result.stdout)["mobility"] == 3
    loaded = result.stderr.splitlines()[-1]
    for package in ("numba", "scipy", "xarray", "pandas", "matplotlib", "jinja2"):
        assert f"'{package}'" not in loaded


def test_help_loads_hardly_anything():
    result = run("--help", code=PROBE)
    for package in ("numpy", "casadi", "pydantic", "llvmlite"):
        assert f"'{package}'" not in result.stderr.splitlines()[-1]


@pytest.mark.long
def test_the_views_load_matplotlib_only_to_draw():
    assert (
        run(code="import sys, linkwork.views; print('matplotlib' in sys.modules)").stdout
        == "False\n"
    )


@pytest.mark.long
def test_warnings_are_one_sentence_each(tmp_path):
    (tmp_path / "file").touch()
    with_cache = {**os.environ, "LINKWORK_CACHE_DIR": str(tmp_path / "file" / "cache")}
    result = finished("-m", "linkwork", "info", "pendulum", env=with_cache)
    assert result.returncode == 0
    assert result.stderr.startswith("linkwork: warning: Kernels cannot be cached in ")
    assert result.stderr.count("\n") == 1


@pytest.mark.long
def test_letters_that_the_output_does_not_hold_are_escapes(tmp_path):
    mechanism = lw.robots.pendulum().model_dump()
    hinge = mechanism["joints"].pop("hinge_1")
    mechanism |= {"joints": {"Übertrager": hinge}, "actuators": [], "reference": {}}
    lw.Mechanism(**mechanism).save(tmp_path / "fünf.yaml")
    plain = {**os.environ, "PYTHONIOENCODING": "ascii"}
    told = finished("-m", "linkwork", "info", tmp_path / "fünf.yaml", env=plain)
    assert told.returncode == 0 and "\\xdcbertrager" in told.stdout
    data = finished("-m", "linkwork", "info", tmp_path / "fünf.yaml", "--json", env=plain)
    assert "Übertrager" in str(json.loads(data.stdout))


@pytest.mark.sample(3)
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
@pytest.mark.parametrize("words", [("--help",), ("--version",), ("info", "--help"), ("robots",)])
def test_an_output_that_takes_nothing_is_refused(words):
    with open("/dev/full", "w") as full:
        result = finished(
            "-m", "linkwork", *words, capture_output=False, stdout=full, stderr=subprocess.PIPE
        )
    assert result.returncode == 2
    assert result.stderr == "linkwork: no space left on device\n"


@pytest.mark.long
def test_an_output_that_nobody_reads_to_its_end_is_no_error():
    with python("-m", "linkwork", "info", "prr3") as process:
        assert process.stdout and process.stderr
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
        process.wait(PATIENCE)
