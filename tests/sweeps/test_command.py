"""The command `linkwork sweep`, and the page about it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from linkwork.sweeps import Study
from linkwork.sweeps.chunk import bench_of

from tests.cli.calls import call, refused
from tests.sweeps.carts import FILE, file, results

PAGE = Path(__file__).parents[2] / "docs" / "sweeps.md"
SMALL = FILE.replace("members: 1024", "members: 64")


@pytest.mark.long
def test_a_study_ends_in_a_table_and_plots(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file(tmp_path, SMALL)
    result = call("sweep", "carts.yaml")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("carts: 64 members; 64 finished\n")
    (row,) = [
        line
        for line in result.stdout.splitlines()
        if line.startswith("end.rail") or line.startswith("end ")
    ]
    mean, least = (float(row.split()[i]) for i in (2, 4))
    end = results(tmp_path / "carts")["end"].values
    assert mean == pytest.approx(end.mean(), rel=1e-3) and least == pytest.approx(
        end.min(), rel=1e-3
    )
    assert all(len(line) <= 80 for line in result.stdout.splitlines())
    assert {path.name for path in (tmp_path / "carts").iterdir()} == {
        "results.zarr",
        "table.csv",
        "plots.svg",
    }
    again = call("sweep", "carts.yaml", "--threads", 1)
    assert "finished before: 4 chunks" in again.stdout
    (tmp_path / "carts" / "results.zarr" / "end" / "c" / "1").write_bytes(b"nonsense")
    assert "corrupted on disk and computed again: 1 chunk" in call("sweep", "carts.yaml").stdout


def test_a_study_of_which_nobody_reaches_the_end_exits_with_1(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file(tmp_path, SMALL.replace("duration: 0.5", "duration: 0.5\nmax_steps: 1"))
    result = call("sweep", "carts.yaml")
    assert result.exit_code == 1 and "64 too_many_steps" in result.stdout


def test_refusals(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file(tmp_path, SMALL)
    assert "--threads 0: give at least 1" in refused("sweep", "carts.yaml", "--threads", 0)
    assert "--threads and --scheduler are both given" in refused(
        "sweep", "carts.yaml", "--threads", 1, "--scheduler", "x"
    )
    assert "--out cart.yaml: is a file" in refused("sweep", "carts.yaml", "--out", "cart.yaml")
    file(tmp_path, SMALL.replace("start.rates.rail", "start.rates.rial"))
    assert "carts.yaml: line 9: vary.start.rates.rial: is nothing" in refused("sweep", "carts.yaml")
    monkeypatch.setattr("linkwork.cli.sweep.NEEDED", ("no_such_package",))
    assert "sweeps need the package no_such_package; install linkwork[sweeps]" in refused(
        "sweep", "carts.yaml"
    )


@pytest.mark.parametrize(
    "text", re.findall(r"```yml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
)
def test_the_page_s_studies(text, tmp_path):
    (tmp_path / "study.yaml").write_text(text)
    assert bench_of(Study.load(tmp_path / "study.yaml")).quantities
