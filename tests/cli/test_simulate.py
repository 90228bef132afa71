"""Runs from the command line: the same numbers as the library's, where they start and end, what is
refused."""

import json

import numpy as np
import pytest
import xarray

import linkwork as lw
from linkwork.cli.simulate import MOST_CHARTS

from tests.catalogue import built
from tests.cli.calls import call, refused

pytestmark = pytest.mark.usefixtures("compiled")


def simulated(path, *words, robot="prr3"):
    result = call("simulate", robot, "--duration", 0.25, "--samples", 6, "--out", path, *words)
    assert result.exit_code == 0, result.output
    return result


def told_of(result, first, after):
    """Return what is printed of one fact, before the next one, its lines joined."""
    return " ".join(result.stdout.split(first)[1].split(after)[0].split())


def test_the_run_is_written_that_the_library_computes(tmp_path):
    path = tmp_path / "run.nc"
    result = simulated(
        path, "--forces", "1,-0.5,0", "--tool", "0.5,0.29,1.6", "--rates", "slide_2=0.1"
    )
    for word in (
        "finished",
        "steps",
        "evaluations",
        "closure error",
        "tool at 0.25 s",
        "slide_1, slide_2, slide_3",
    ):
        assert word in result.stdout
    robot = built("prr3")
    state = robot.assemble(tool=[0.5, 0.29, 1.6]).with_rates([0, 0.1, 0])
    run = robot.simulate(state, [1, -0.5, 0], duration=0.25, save_at=np.linspace(0, 0.25, 6))
    loaded = xarray.load_dataset(path)
    for name in ("joint_position", "joint_rate", "actuator_force", "tool_pose"):
        np.testing.assert_allclose(loaded[name], run.dataset[name], rtol=0, atol=1e-12)


def test_csv_is_written_and_forces_are_taken_from_csv(tmp_path):
    forces, path = tmp_path / "forces.csv", tmp_path / "run.csv"
    forces.write_text("time,slide_3,slide_2,slide_1\n0,0,0,1\n0.1,0,0,3\n0.3,0,0,-1\n")
    simulated(
        path,
        "--forces-csv",
        forces,
        "--kind",
        "hold",
        "--joints",
        "slide_1=0.2,slide_2=20cm,slide_3=200 mm",
    )
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    columns = lines[0].split(",")
    table = np.loadtxt(lines[1:], delimiter=",")
    assert table.shape == (6, len(columns))
    np.testing.assert_allclose(table[:, columns.index("time")], np.linspace(0, 0.25, 6))
    np.testing.assert_allclose(
        table[0, [columns.index(f"joint_position.slide_{i}") for i in (1, 2, 3)]], 0.2
    )
    np.testing.assert_allclose(
        table[:, columns.index("actuator_force.slide_1")], [1, 1, 3, 3, 3, 3]
    )


def test_coordinates_and_rates_of_joints_of_many_freedoms_go_by_their_names(tmp_path):
    path = tmp_path / "run.nc"
    simulated(
        path,
        "--joints",
        "cross.angle_1=-0.5",
        "--rates",
        "ball.wx=0.3",
        robot="spatial_slider_crank",
    )
    start = xarray.load_dataset(path).isel(time=0)
    assert float(start.joint_position.sel(coordinate="cross.angle_1")) == pytest.approx(
        -0.5, abs=1e-12
    )
    assert float(start.joint_rate.sel(rate="ball.wx")) == pytest.approx(0.3, abs=1e-12)


def test_rates_of_other_joints_determine_the_motion_too(tmp_path):
    path = tmp_path / "run.nc"
    simulated(path, "--rates", "pivot_1=0.1,pivot_2=0.2,wrist_1=-0.3")
    rates = xarray.load_dataset(path).isel(time=0).joint_rate
    np.testing.assert_allclose(
        rates.sel(rate=["pivot_1", "pivot_2", "wrist_1"]), [0.1, 0.2, -0.3], atol=1e-12
    )


def test_files_are_kept_unless_they_shall_be_replaced(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("precious")
    assert "exists" in refused("simulate", "prr3", "--duration", 0.1, "--out", path)
    assert path.read_text() == "precious"
    simulated(path, "--overwrite")
    assert path.read_text() != "precious"


@pytest.fixture
def two_squares():
    """Two four-bars of equal lengths: at the angle pi all their links lie on one line, and branches
    of motion meet."""
    return ("simulate", "n_four_bar", "--duration", 2, "--rates", "pivot_0=1")


def test_a_run_that_ends_early_exits_with_1_and_keeps_what_it_has(two_squares, tmp_path):
    path = tmp_path / "run.nc"
    result = call(*two_squares, "--out", path)
    assert result.exit_code == 1
    assert "stopped at t = " in result.stdout
    kept = xarray.load_dataset(path)
    assert kept.attrs["status"] == "SINGULAR"
    assert 1 < kept.sizes["time"] < 101


def test_bifurcations_are_stepped_over_if_asked(two_squares):
    result = call(*two_squares, "--on-singular", "step_over")
    assert result.exit_code == 0, result.output
    assert "finished" in result.stdout
    wrong = call(*two_squares, "--on-singular", "jump")
    assert (wrong.exit_code, wrong.stdout) == (2, "")


def test_changes_of_chart_are_told():
    result = call("simulate", "five_bar", "--duration", 0.3, "--forces", "2,-2", "--samples", 2)
    assert result.exit_code == 0, result.output
    taken = told_of(result, "independent", "closure error")
    charts = [part.partition(": ")[2] for part in taken.split("; ")]
    assert charts[0] == "motor_1, motor_2"
    assert len(set(charts)) > 1


def test_limits_that_are_passed_are_told(tmp_path):
    path = tmp_path / "arm.yaml"
    joint = lw.robots.pendulum().joints["hinge_1"]
    limited = joint.model_copy(update={"limits": lw.Limits(lower=-0.1)})
    lw.robots.pendulum().model_copy(update={"joints": {"hinge_1": limited}}).save(path)
    result = call("simulate", path, "--duration", 0.5)
    assert result.exit_code == 0
    # it falls by g t^2 / 2 = 0.1 rad in sqrt(0.2 / 9.81) = 0.143 s; times are 5 ms apart
    told = told_of(result, "limits passed", "joints at")
    assert told.startswith("hinge_1 is below its lower limit -0.1 from t = 0.145 s on")
    assert (
        told_of(call("simulate", "pendulum", "--duration", 0.5), "limits passed", "joints at")
        == "none"
    )


def test_of_many_joints_the_actuated_ones_are_told(monkeypatch):
    words = ("simulate", "prr3", "--duration", 0.01)
    assert "slide_1 " in (told := told_of(call(*words), "joints at 0.01 s", "tool at"))
    assert "wrist_3 " in told
    monkeypatch.setattr("linkwork.cli.simulate.FEW", 8)
    assert "slide_1 " in (told := told_of(call(*words), "joints at 0.01 s", "tool at"))
    assert "wrist_3 " not in told


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--forces", "1,2"), "--forces holds 2 numbers; give 3"),
        (
            ("--forces", "1,2,3", "--forces-csv", "x.csv"),
            "--forces and --forces-csv are both given",
        ),
        (("--forces-csv", "x.csv"), "x.csv cannot be read: no such file"),
        (("--joints", "slide_9=1"), "--joints: there is no 'slide_9'"),
        (("--joints", "slide_1=5"), "cannot be assembled with slide_1 = 5"),
        (("--tool", "3,3,0"), "cannot be assembled with the tool at [3.0, 3.0, 0.0]"),
        (("--tool", "3"), "a tool pose of 1 number is not understood"),
        (("--rates", "slide_9=1"), "--rates: there is no 'slide_9'"),
        (("--rates", "pivot_1=1"), "1 rate is given; give 3"),
        (
            ("--rates", "1,2"),
            "--rates holds 2 numbers; give 3, one each for slide_1, slide_2, slide_3",
        ),
        (("--duration", "-1"), "--duration -1: give a positive"),
        (("--duration", "nan"), "--duration nan: give a positive"),
        (("--samples", "1"), "--samples 1: give at least 2"),
        (("--rtol", "0"), "rtol is 0.0; give a positive number"),
        (("--out", "run.mat"), "--out run.mat: a run is written as .nc or .csv, not '.mat'"),
        (("--out", "no-such-folder/run.nc"), "there is no folder 'no-such-folder'"),
        (("--out", "folder.nc", "--overwrite"), "--out folder.nc: is a folder; name a file in it"),
        (("--out", "/proc/run.nc"), "--out /proc/run.nc: nothing can be written into '/proc': "),
    ],
)
def test_what_is_refused_in_one_sentence(words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.nc").mkdir()
    assert sentence in refused("simulate", "prr3", "--duration", 0.1, *words)


@pytest.mark.parametrize("out", ["run.mat", "/proc/run.nc", "folder.nc"])
def test_what_cannot_be_written_is_refused_before_the_robot_is_looked_at(
    out, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.nc").mkdir()
    assert refused("simulate", "nobody", "--duration", 1, "--out", out).startswith(
        f"linkwork: --out {out}"
    )


def test_forces_that_do_not_cover_the_run_are_refused(tmp_path):
    forces = tmp_path / "forces.csv"
    forces.write_text("time,slide_1,slide_2,slide_3\n0,0,0,0\n0.1,0,0,0\n0.2,1,0,0\n0.3,0,0,0\n")
    assert "give samples for the whole run" in refused(
        "simulate", "prr3", "--duration", 1, "--forces-csv", forces
    )


def test_a_run_starts_at_the_turns_asked_for_and_tells_a_limit_where_it_is_passed(tmp_path):
    """hinge_3 of Bennett's linkage, which closes its loop, two turns back: within limits there, and
    beyond them at home."""
    described = lw.robots.bennett()
    hinge = described.joints["hinge_3"].model_copy(
        update={"limits": lw.Limits(lower=-14.0, upper=-10.0)}
    )
    path, out = tmp_path / "linkage.yaml", tmp_path / "run.nc"
    described.model_copy(update={"joints": described.joints | {"hinge_3": hinge}}).save(path)
    asked = -1.0 - 4 * np.pi
    within = simulated(out, "--joints", f"hinge_3={asked!r}", robot=path)
    start = xarray.load_dataset(out).isel(time=0)
    assert float(start.joint_position.sel(coordinate="hinge_3")) == pytest.approx(asked, abs=1e-12)
    assert told_of(within, "limits passed", "joints at") == "none"
    beyond = call("simulate", path, "--duration", 0.25)
    assert told_of(beyond, "limits passed", "joints at").startswith(
        "hinge_3 is above its upper limit -10 from t = 0 s on"
    )
    passing = call(
        "simulate",
        path,
        "--duration",
        0.25,
        "--joints",
        f"hinge_3={asked!r}",
        "--rates",
        "hinge_1=5",
    )
    assert "hinge_3 is below its lower limit -14 from t = 0" in told_of(
        passing, "limits passed", "joints at"
    )


def test_forces_are_commands_of_the_descriptions_own_drives_on_request(tmp_path):
    servo = {"type": "servo", "gain": 40.0, "bias_position": -40.0, "bias_rate": -8.0}
    mechanism = lw.robots.pendulum()
    name = mechanism.actuators[0]
    described = mechanism.model_copy(update={"drives": {name: servo}})
    described.save(tmp_path / "led.yaml")
    simulated(tmp_path / "run.nc", "--drives", "--forces", "0.3", robot=tmp_path / "led.yaml")
    robot = lw.Robot(described)
    given = {"duration": 0.25, "save_at": np.linspace(0, 0.25, 6)}
    expected = robot.simulate(robot.home, [0.3], drives=robot.drives, **given)
    with xarray.open_dataset(tmp_path / "run.nc") as run:
        np.testing.assert_allclose(run["actuator_force"], expected["actuator_force"], rtol=1e-12)
    words = refused("simulate", "pendulum", "--duration", 1, "--drives")
    assert "the description gives no drives" in words


def test_of_many_changes_of_chart_the_first_and_the_last_are_told():
    words = ("simulate", "prr3", "--duration", 6, "--forces", "0.5,0,0")
    charts = json.loads(call(*words, "--json").stdout)["independent"].split("; ")
    told = " ".join(call(*words).stdout.split())
    assert len(charts) > MOST_CHARTS
    assert f"... {len(charts) - MOST_CHARTS} more; {charts[-1]}" in told
    assert charts[MOST_CHARTS - 2] in told and charts[MOST_CHARTS - 1] not in told
