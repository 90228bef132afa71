"""Reports from the command line: of runs that hold their mechanism, of those that do not; what is
refused."""

import numpy as np
import pytest
import xarray

import linkwork as lw

from tests.catalogue import built
from tests.cli.calls import call, refused


@pytest.fixture
def saved(tmp_path):
    """Return a saved run of a robot that is in no catalogue."""
    mechanism = lw.robots.pendulum().model_copy(update={"name": "näme <b>"})
    robot = lw.Robot(mechanism)
    return robot.simulate(robot.home, duration=0.1, save_at=np.linspace(0, 0.1, 5)).save(
        tmp_path / "run.nc"
    )


@pytest.mark.long
def test_a_saved_run_is_enough(saved, tmp_path):
    out = tmp_path / "report.html"
    result = call("report", saved, "--out", out)
    assert result.exit_code == 0, result.output
    assert "written" in result.stdout
    assert "<h1>näme &lt;b&gt;: report of a run</h1>" in out.read_text(encoding="utf-8")
    assert f"{out} exists" in refused("report", saved, "--out", out).replace("\n", "")
    assert call("report", saved, "--out", out, "--overwrite").exit_code == 0


@pytest.mark.long
def test_a_run_that_does_not_hold_its_mechanism_is_looked_up_or_told(saved, tmp_path):
    bare = xarray.load_dataset(saved)
    del bare.attrs["description"]
    bare.to_netcdf(tmp_path / "bare.nc", engine="scipy")
    words = ("report", tmp_path / "bare.nc", "--out", tmp_path / "bare.html")
    assert "'näme <b>' is not in the catalogue; say whose run it is by --robot" in refused(*words)
    assert call(*words, "--robot", "pendulum").exit_code == 0
    bare.attrs["mechanism"] = built("pendulum").mechanism.name
    bare.to_netcdf(tmp_path / "bare.nc", engine="scipy")
    assert call(*words, "--overwrite").exit_code == 0


@pytest.mark.sample(10)
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("no.nc", "--out", "r.html"), "cannot read a run from 'no.nc'"),
        (("run.csv", "--out", "r.html"), "'run.csv' is no saved run; give a file that ends in .nc"),
        (("run.nc", "--out", "r.pdf"), "--out r.pdf: a report is written as .html, not '.pdf'"),
        (("run.nc", "--out", "no/r.html"), "--out no/r.html: there is no folder 'no'"),
        (("run.nc", "--out", "r.html", "--robot", "stewart"), "the run is not one of the robot"),
        (("run.nc", "--out", "r.html", "--floating"), "--floating says how the robot of --robot"),
        (("run.nc", "--out", "r.html", "--package-path", "."), "--package-path says how the"),
        (("run.nc", "--out", "r.html", "--no-merging"), "--no-merging says how the robot of"),
        (("run.nc", "--out", "r.html", "--include-root", "."), "--include-root says how the"),
        (("run.nc", "--out", "r.html", "--reference", "hinge=1"), "--reference says where the"),
        (("run.nc", "--out", "/proc/r.html"), "'/proc/r.html' cannot be written"),
    ],
)
def test_what_is_refused(words, sentence, saved, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sentence in refused("report", *words)
    assert not list(tmp_path.glob("*.html"))


@pytest.mark.long
def test_the_film_of_a_report_shows_another_run(saved, tmp_path):
    out = tmp_path / "both.html"
    assert call("report", saved, "--over", saved, "--out", out).exit_code == 0
    assert "another run, laid over" in out.read_text(encoding="utf-8")
    told = refused("report", saved, "--over", tmp_path / "x.yaml", "--out", out, "--overwrite")
    assert "is no saved run" in told


def test_only_runs_are_viewed_over_each_other():
    assert "--over lays a run over another one" in refused("view", "prr3", "--over", "run.nc")
