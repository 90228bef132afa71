"""The command as users start it: a process, its exit status and its two streams."""

import json

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


def test_a_refusal_is_one_line_on_stderr_and_status_2():
    result = run("info", "nobody.yaml")
    assert result.returncode == 2
    assert result.stdout == ""
    assert result.stderr == "linkwork: nobody.yaml: cannot be read: no such file or directory\n"
    assert "Traceback" in run("info", "nobody.yaml", "--debug").stderr


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


def test_the_views_load_matplotlib_only_to_draw():
    assert (
        run(code="import sys, linkwork.views; print('matplotlib' in sys.modules)").stdout
        == "False\n"
    )


def test_an_output_that_nobody_reads_to_its_end_is_no_error():
    with python("-m", "linkwork", "info", "prr3") as process:
        assert process.stdout and process.stderr
        process.stdout.close()
        assert "Traceback" not in process.stderr.read()
        process.wait(PATIENCE)
