"""The store: what xarray reads, what is resumed, what is refused, and what faults of the disk leave
behind."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray
import zarr

import linkwork as lw
from linkwork.sweeps import StudyError, runner, store, summary, sweep, write
from linkwork.sweeps.chunk import compute
from linkwork.sweeps.report import ends_of, figure

from tests.sweeps.carts import CART, FILE, file, finished, results, study


def counted(monkeypatch) -> list[int]:
    """Note which chunks are computed."""
    done = []

    def noted(study, index, threads=None):
        done.append(index)
        return compute(study, index, threads)

    monkeypatch.setattr(runner, "compute", noted)
    return done


def test_xarray_reads_names_units_and_labels(tmp_path):
    outputs = {"end": "final joint_position", "where": "peak tool_pose"}
    sweep(study(outputs=outputs, trajectories=("tool_pose",)), tmp_path)
    found = results(tmp_path)
    assert found["end"].dims == ("member", "coordinate")
    assert found["tool_pose"].dims == ("member", "time", "pose")
    assert found["coordinate"].values.tolist() == ["rail"]
    assert found["time"].attrs["units"] == "s"
    assert found["cart.mass"].attrs["role"] == "varied"
    np.testing.assert_allclose(
        found["end"].sel(coordinate="rail"), 3 * 0.5**2 / 2 / found["cart.mass"]
    )
    np.testing.assert_array_equal(found["where"], np.abs(found["tool_pose"]).max("time"))


def test_another_version_does_not_add_to_a_store_but_tells_what_is_finished(tmp_path):
    sweep(study(), tmp_path)
    group = zarr.open_group(tmp_path / "results.zarr", mode="r+")
    group.attrs["linkwork"] = "0.0.9"
    assert sweep(study(), tmp_path).before == 4
    (tmp_path / "results.zarr" / "end" / "c" / "1").unlink()
    with pytest.raises(StudyError, match=r"begun by version 0\.0\.9 .*, and this is \d.* go on"):
        sweep(study(), tmp_path)


def test_what_is_finished_is_not_computed_again(tmp_path, monkeypatch):
    done = counted(monkeypatch)
    outcome = sweep(study(), tmp_path)
    assert (outcome.before, outcome.computed, done) == (0, 4, [0, 1, 2, 3])
    outcome = sweep(study(), tmp_path)
    assert (outcome.before, outcome.computed, done) == (4, 0, [0, 1, 2, 3])


@pytest.mark.sample(2)
@pytest.mark.parametrize("damage", ["flipped bit", "cut off", "gone", "of another chunk"])
def test_a_corrupted_chunk_is_found_and_computed_again(tmp_path, monkeypatch, damage):
    sweep(study(), tmp_path)
    before, done = results(tmp_path), counted(monkeypatch)
    part = tmp_path / "results.zarr" / "end" / "c" / "2"
    content = bytearray(part.read_bytes())
    if damage == "flipped bit":
        content[-3] ^= 4
        part.write_bytes(content)
    elif damage == "cut off":
        part.write_bytes(content[:10])
    elif damage == "gone":
        part.unlink()
    else:
        part.write_bytes((part.parent / "1").read_bytes())
    outcome = sweep(study(), tmp_path)
    assert (outcome.corrupted, outcome.before, done) == (1, 3, [2])
    assert results(tmp_path).identical(before)


def test_a_store_of_another_study_is_refused(tmp_path):
    sweep(study(name="first"), tmp_path)
    before = results(tmp_path)
    with pytest.raises(
        StudyError, match=r"holds the results of another study \(first\); give another folder"
    ):
        sweep(study(duration=0.6), tmp_path)
    assert results(tmp_path).identical(before)


def test_what_is_another_study_of_the_same_name_is_told(tmp_path):
    sweep(study(), tmp_path)
    heavier = CART.model_copy(update={"bodies": {"cart": lw.Body(mass=3.0)}})
    with pytest.raises(StudyError, match=r"\(study, with another robot, duration\); give another"):
        sweep(study(robot=heavier, duration=0.6), tmp_path)


def test_arrays_of_a_store_without_its_study_are_named(tmp_path):
    sweep(study(), tmp_path)
    place = tmp_path / "results.zarr"
    expected = results(tmp_path)["end"].values
    (place / "zarr.json").write_text("{")
    with pytest.raises(
        StudyError, match=r"is lost, zarr\.open_array reads .*, end, .* in it; give"
    ):
        sweep(study(), tmp_path)
    np.testing.assert_array_equal(zarr.open_array(place / "end", mode="r")[:], expected)


@pytest.mark.sample(4)
@pytest.mark.parametrize("text", ["nonsense", '{"name": 3}', "[]", {"a": 1}, 7, None])
def test_a_store_that_says_nonsense_of_its_study_is_refused(tmp_path, text):
    sweep(study(), tmp_path)
    group = zarr.open_group(tmp_path / "results.zarr", mode="r+")
    group.attrs["study"] = text
    with pytest.raises(
        StudyError,
        match=r"holds the results of another study \(another program's, or of another version",
    ):
        sweep(study(), tmp_path)


@pytest.mark.parametrize("content", ["", "{}", '{"zarr_format": 3, "node_type": "group"}', None])
def test_what_is_no_store_is_refused(tmp_path, content):
    sweep(study(), tmp_path)
    if content is None:
        (tmp_path / "results.zarr" / "zarr.json").unlink()
    else:
        (tmp_path / "results.zarr" / "zarr.json").write_text(content)
    with pytest.raises(
        StudyError,
        match=(
            r"results\.zarr (is no store of a study that can be read|holds the results of "
            r"another)"
        ),
    ):
        sweep(study(), tmp_path)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "damage", ["emptied", "cut off", "gone", "array gone", "names damaged", "times gone"]
)
def test_damaged_descriptions_are_mended(tmp_path, damage):
    """Each array can be read by itself again, besides through the description of the group that
    repeats its own."""
    sweep(study(outputs={"end": "final joint_position"}), tmp_path)
    before, store = results(tmp_path), tmp_path / "results.zarr"
    part = store / "end" / "zarr.json"
    if damage in ("emptied", "cut off"):
        part.write_bytes(part.read_bytes()[: 100 * (damage == "cut off")])
    elif damage == "gone":
        part.unlink()
    elif damage == "array gone":
        shutil.rmtree(store / "end")
    elif damage == "names damaged":
        (store / "coordinate" / "c" / "0").write_bytes(b"nonsense")
    else:
        (store / "time" / "c" / "0").unlink()
    assert sweep(study(outputs={"end": "final joint_position"}), tmp_path).computed == (
        4 if damage == "array gone" else 0
    )
    assert results(tmp_path).identical(before)
    assert xarray.open_zarr(store, consolidated=False).load().identical(before)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "damage",
    [
        ('"units": "m, rad"', '"units": "n, rad"'),
        ('"coordinate"', '"coordinaue"'),
        ("FINISHED SINGULAR", "FINISHED!SINGULAR"),
        ('"fill_value": "NaN"', '"fill_value": 0.0'),
        ('"name": "store of carts"', '"name": "store of darts"'),
    ],
)
def test_what_the_group_repeats_of_descriptions_is_not_trusted(tmp_path, damage):
    """A damaged name, unit or meaning there is neither read nor handed on to the arrays."""
    carts = study(name="store of carts", outputs={"end": "final joint_position"})
    sweep(carts, tmp_path)
    before, group = results(tmp_path), tmp_path / "results.zarr" / "zarr.json"
    was = group.read_text()
    assert damage[0] in was
    group.write_text(was.replace(*damage))
    assert sweep(carts, tmp_path).computed == 0
    assert results(tmp_path).identical(before) and group.read_text() == was
    own = xarray.open_zarr(tmp_path / "results.zarr", consolidated=False).load()
    assert own.identical(before)


def test_a_finished_store_is_left_alone(tmp_path):
    sweep(study(), tmp_path)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    before = [path.stat().st_mtime_ns for path in files]
    sweep(study(), tmp_path)
    assert [path.stat().st_mtime_ns for path in files] == before


def test_a_full_disk_ends_the_study_in_one_sentence_and_it_goes_on_later(tmp_path, monkeypatch):
    original, writes = zarr.Array.__setitem__, []

    def full(array, place, values):
        writes.append(array.name)
        if array.name == "/end" and writes.count("/end") == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        original(array, place, values)

    with monkeypatch.context() as patch:
        patch.setattr(zarr.Array, "__setitem__", full)
        with pytest.raises(
            StudyError, match="cannot be written: no space left on device; what is finished is kept"
        ):
            sweep(study(), tmp_path)
    assert finished(tmp_path).tolist() == [True, True, False, False]
    done = counted(monkeypatch)
    sweep(study(), tmp_path)
    assert done == [2, 3]


SMALL_DISK = """
mount -t tmpfs -o size=300k none "$1" || exit 77
cp carts.yaml cart.yaml "$1"
cd "$1"
"$2" -m linkwork sweep carts.yaml --out out
echo "status $?"
mount -o remount,size=100m "$1"
"$2" -m linkwork sweep carts.yaml --out out
echo "status $?"
"""


@pytest.mark.long
@pytest.mark.skipif(shutil.which("unshare") is None, reason="file systems of our own need unshare")
def test_a_disk_that_is_really_full(tmp_path):
    file(tmp_path, FILE.replace("members: 1024", "members: 256"))
    (tmp_path / "disk").mkdir()
    words = ["unshare", "-rm", "sh", "-c", SMALL_DISK, "sh", str(tmp_path / "disk"), sys.executable]
    done = subprocess.run(
        words, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    if done.returncode in (1, 77) and "status" not in done.stdout:
        pytest.skip(f"no file system of our own: {done.stderr}")
    sentences = [line for line in done.stderr.splitlines() if "space left" in line]
    assert "status 2" in done.stdout and done.stdout.rstrip().endswith("status 0"), (
        done.stdout + done.stderr
    )
    assert len(sentences) == 1 and sentences[0].endswith("the same command goes on from there")
    assert "256 finished" in done.stdout and "finished before: " in done.stdout


def test_a_store_that_another_process_makes_meanwhile_is_taken(tmp_path, monkeypatch):
    original, made = store.lay_out, []

    def later(place, bench):
        original(place, bench)
        if isinstance(place, Path):
            with monkeypatch.context() as other:
                other.setattr(store, "lay_out", original)
                made.append(sweep(study(), tmp_path))

    monkeypatch.setattr(store, "lay_out", later)
    assert sweep(study(), tmp_path).before == made[0].computed == 4
    assert [path.name for path in tmp_path.iterdir()] == ["results.zarr"]


@pytest.mark.parametrize("name", ["table.csv", "plots.svg"])
def test_a_table_or_plot_that_cannot_be_written_is_named(tmp_path, name):
    outcome = sweep(study(), tmp_path)
    (tmp_path / name).mkdir()
    with pytest.raises(StudyError, match=f"{name} cannot be written: is a directory"):
        write(outcome.store, summary(outcome.store), tmp_path)


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(StudyError, match="cannot be written: not a directory"):
        sweep(study(), tmp_path / "taken" / "deeper")


def test_table_and_plots(tmp_path):
    outcome = sweep(
        study(outputs={"end": "final joint_position", "force": "peak actuator_force.rail"}),
        tmp_path,
    )
    found, data = summary(outcome.store), results(tmp_path)
    end, force = found.rows
    assert (end.output, end.unit, end.count) == ("end.rail", "m", 40)
    assert (force.output, force.unit, force.deviation) == ("force", "N", 0)
    values = data["end"].values[:, 0]
    assert end.mean == pytest.approx(values.mean(), rel=1e-13)
    assert end.deviation == pytest.approx(values.std(ddof=1), rel=1e-12)
    assert (end.least_member, end.largest_member) == (values.argmin(), values.argmax())
    assert end.correlation["cart.mass"] == pytest.approx(
        np.corrcoef(values, data["cart.mass"])[0, 1], rel=1e-12
    )
    assert np.isnan(force.correlation["cart.mass"])
    table, plots = write(outcome.store, found, tmp_path)
    rows = table.read_text().splitlines()
    assert len(rows) == 3 and rows[1].startswith(",end.rail,m,40,")
    drawn = plots.read_text()
    assert "cart.mass" in drawn
    ticks = [panel.count('<g id="xtick_') for panel in drawn.split('<g id="axes_')[1:]]
    assert len(ticks) == 4 and max(ticks) <= 4


def test_what_varies_by_ratios_is_drawn_so_and_the_legend_covers_no_panel(tmp_path):
    masses = {"type": "log_uniform", "low": 0.1, "high": 10.0}
    laws = {"slow": 1.0, "quick": 100.0}
    goal = {"type": "pose", "joints": {"rail": 0.1}}
    controllers = {
        name: {"type": "pd", "kp": kp, "kd": 1.0, "goal": goal} for name, kp in laws.items()
    }
    cart = study(vary={"cart.mass": masses}, controllers=controllers, forces={})
    outcome = sweep(cart, tmp_path)
    drawn = figure(outcome.store, summary(outcome.store))
    drawn.draw_without_rendering()
    across, members, *_ = drawn.axes
    assert (across.get_xscale(), members.get_xscale()) == ("log", "linear")
    assert across.get_xlabel() == "cart.mass\n[kg]"
    (legend,) = drawn.legends
    assert [text.get_text() for text in legend.get_texts()] == [*laws]
    box = legend.get_window_extent()
    assert not any(box.overlaps(axes.get_window_extent()) for axes in drawn.axes)


@pytest.mark.parametrize("size", [0.3, -1e10, 1e-300, 5e-324, 0.0])
def test_members_that_only_rounding_tells_apart_are_drawn(size):
    values = size * (1 + 1e-16 * np.array([-1, 0, 3, 0]))
    low, high = ends_of(values)
    assert low < values.min() and values.max() < high
    assert np.histogram(values, 30, (low, high))[0].sum() == 4


def test_the_report_reads_a_part_at_a_time_and_draws_a_bounded_number(tmp_path, monkeypatch):
    monkeypatch.setattr("linkwork.sweeps.report.PLOTTED", 10)
    outcome = sweep(study(), tmp_path)
    assert len(summary(outcome.store).points["end"]) == 10


@pytest.mark.long
def test_memory_does_not_grow_with_the_number_of_members(tmp_path):
    """Neither that of computing, with a trajectory of 1.6 kB for each member, nor that of reading
    for the report."""

    def peaks(members: int) -> np.ndarray:
        design = {"type": "random", "members": members}
        given = study(design=design, samples=201, chunk=250, trajectories=("joint_position",))
        tracemalloc.start()
        outcome = sweep(given, tmp_path / str(members))
        _, computing = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        summary(outcome.store)
        _, reading = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return np.array([computing, reading])

    peaks(250)
    few, chunk, further = peaks(1000), 250 * 201 * 8, 3000 * 201 * 8
    assert (few > chunk).all()  # it sees the arrays
    assert (
        peaks(4000) < few + further / 2
    ).all()  # how far writing lags behind is a matter of what else the machine does
