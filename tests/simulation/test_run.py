"""A run's files hold what it holds, or are not written at all."""

import csv
import os
import stat
from pathlib import Path

import numpy as np
import pytest

from linkwork.errors import LinkworkError
from linkwork.simulation import Run, Statistics, Status, Variable

TIMES = np.array([0.0, 0.1, 1 / 3])
POSITION = np.array([[1.0, 2.0], [np.pi, -1e-300], [1 / 3, 6.0]])
TRACE = np.arange(18.0).reshape(2, 3, 3) / 7


@pytest.fixture
def run():
    return Run(
        variables={
            "position": Variable(("time", "joint"), POSITION, {"units": "m"}),
            "trace": Variable(("body", "time", "axis"), TRACE, {"units": "m"}),
            "energy": Variable(("time",), np.array([1.0, 2.0, 3.0]), {"units": "J"}),
            "mass": Variable(("body",), np.array([0.5, 0.25]), {"units": "kg"}),
        },
        coords={
            "time": Variable(("time",), TIMES, {"units": "s"}),
            "joint": Variable(("joint",), np.array(["slider, left", "pivot"])),
            "body": Variable(("body",), np.array(["link", "platform"])),
        },
        attrs={"robot": "3-PRR"},
        status=Status.SINGULAR,
        message="The run stopped at t = 0.333 s.",
        statistics=Statistics(79, 13, 1, 28, 4e-16, 0.25, 0.2),
    )


def test_dataset_has_names_units_and_the_ending(run):
    dataset = run.dataset
    assert dataset["position"].sel(joint="pivot", time=0.1) == -1e-300
    assert dataset["position"].attrs["units"] == "m"
    assert dataset.attrs["status"] == "SINGULAR"
    assert dataset.attrs["nfev"] == run.nfev == 79
    assert dataset is run.dataset
    assert (run.success, run.steps, run.rejected, run.closure_error) == (False, 13, 1, 4e-16)


def test_netcdf_round_trip(run, tmp_path):
    loaded = Run.load(run.save(tmp_path / "run.nc"))
    assert loaded.dataset.identical(run.dataset)
    assert (loaded.status, loaded.message, loaded.statistics) == (
        run.status,
        run.message,
        run.statistics,
    )
    assert loaded.attrs == run.attrs
    assert loaded.variables["trace"].dims == ("body", "time", "axis")


def test_csv_has_named_columns_at_full_precision(run, tmp_path):
    lines = run.save(str(tmp_path / "run.csv")).read_text().splitlines()
    assert lines[:4] == [
        "# The run stopped at t = 0.333 s.",
        "# units: time [s], position [m], trace [m], energy [J]",
        "# mass.link = 0.5 [kg]",
        "# mass.platform = 0.25 [kg]",
    ]
    header, *rows = csv.reader(lines[4:])
    assert header[:4] == ["time", "position.slider, left", "position.pivot", "trace.link.0"]
    assert header[-2:] == ["trace.platform.2", "energy"]
    table = np.array(rows, dtype=float)
    np.testing.assert_array_equal(table[:, 0], TIMES)
    np.testing.assert_array_equal(table[:, 1:3], POSITION)
    np.testing.assert_array_equal(table[:, 3:9], np.concatenate(TRACE, axis=1))


def test_csv_of_a_run_without_samples(tmp_path):
    empty = Run(
        {"position": Variable(("time", "joint"), np.empty((0, 2)), {"units": "m"})},
        {"time": Variable(("time",), np.empty(0), {"units": "s"})},
        {},
        Status.FINISHED,
        "The run reached its end.",
        Statistics(1, 0, 0, 0, 0.0, 1.0, 0.0),
    )
    assert (
        empty.save(tmp_path / "run.csv").read_text().splitlines()[-1]
        == "time,position.0,position.1"
    )


def test_a_file_is_replaced_whole_or_left_as_it_was(run, tmp_path, monkeypatch):
    path = run.save(tmp_path / "run.csv")
    before = path.read_text()

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savetxt", fail)
    with pytest.raises(LinkworkError, match=r"cannot write '.*run.csv': No space left on device"):
        run.save(path)
    assert path.read_text() == before
    assert os.listdir(tmp_path) == ["run.csv"]


def test_a_disk_that_cannot_be_written_is_told(run, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(np, "savetxt", fail)
    monkeypatch.setattr(Path, "unlink", fail)
    with pytest.raises(LinkworkError, match=r"cannot write '.*run.csv': Read-only file system"):
        run.save(tmp_path / "run.csv")


def test_saved_files_have_the_usual_permissions(run, tmp_path):
    (tmp_path / "other").touch()
    usual = stat.S_IMODE((tmp_path / "other").stat().st_mode)
    assert stat.S_IMODE(run.save(tmp_path / "run.csv").stat().st_mode) == usual


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("run.txt", "its suffix must be one of .nc, .csv, not '.txt'"),
        ("run", "not ''"),
        ("nowhere/run.nc", "there is no folder '.*nowhere'"),
        ("folder.nc", "it is a folder"),
    ],
)
def test_places_that_cannot_be_written_are_refused(run, tmp_path, name, sentence):
    (tmp_path / "folder.nc").mkdir()
    with pytest.raises(LinkworkError, match=sentence):
        run.save(tmp_path / name)
    assert os.listdir(tmp_path) == ["folder.nc"]


def test_attributes_that_netcdf_cannot_hold_are_refused(run, tmp_path):
    run.attrs["robot"] = object()
    with pytest.raises(LinkworkError, match=r"NetCDF cannot hold what the run holds: .*robot"):
        run.save(tmp_path / "run.nc")
    assert os.listdir(tmp_path) == []


def test_files_that_hold_no_run_are_refused(run, tmp_path):
    with pytest.raises(LinkworkError, match="No such file or directory"):
        Run.load(tmp_path / "none.nc")
    with pytest.raises(LinkworkError, match="it is not a NetCDF file"):
        Run.load(run.save(tmp_path / "run.csv"))
    run.dataset[["energy"]].drop_attrs().to_netcdf(tmp_path / "other.nc", engine="scipy")
    with pytest.raises(LinkworkError, match="its attribute 'status' is missing"):
        Run.load(tmp_path / "other.nc")


def test_damaged_files_are_refused(run, tmp_path):
    """Bytes of the header are changed: the file is read as a run, or refused in one sentence."""
    whole, random, refused = run.save(tmp_path / "run.nc").read_bytes(), np.random.default_rng(0), 0
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[random.integers(400)] = random.integers(256)
        (tmp_path / "run.nc").write_bytes(damaged)
        try:
            Run.load(tmp_path / "run.nc")
        except LinkworkError:
            refused += 1
    assert refused > 30


def test_axes_must_match_the_array():
    with pytest.raises(LinkworkError, match=r"shape \(3,\) needs 1 axis names"):
        Variable(("time", "joint"), TIMES)
