"""The commands, called in this process: what they print and write, and what they refuse."""

import json

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

import linkwork as lw
from linkwork.cli import app


@pytest.fixture(scope="module", autouse=True)
def _everything_is_compiled():
    """Compile first what is compiled once per machine, for that is announced on stderr."""
    robot = lw.Robot(lw.robots.prr3())
    robot.simulate(robot.home, duration=0.01)


def call(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def refused(*words):
    """Call a command that must refuse; return its one sentence."""
    result = call(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert result.stderr.startswith("linkwork: ")
    assert result.stderr.count("\n") == 1
    return result.stderr


def test_version_and_list_of_robots():
    assert call("--version").output == f"linkwork {lw.__version__}\n"
    result = call("robots")
    assert result.exit_code == 0
    assert "prr3" in result.output


def test_info_as_json_has_the_facts_of_the_robot():
    result = call("info", "prr3", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert list(facts) == [
        "name", "mobility", "planar", "actuators", "bodies", "joints", "loops", "redundant", "chart", "kernels",
    ]  # fmt: skip
    assert (facts["mobility"], facts["loops"], len(facts["bodies"]), len(facts["joints"])) == (3, 2, 7, 9)
    assert facts["planar"] is True
    assert facts["redundant"] == []
    assert facts["actuators"] == facts["chart"]["independent"] == ["slide_1", "slide_2", "slide_3"]
    cut = [joint for joint in facts["joints"] if joint["role"] == "cut"]
    assert len(cut) == facts["loops"]
    assert all(joint["type"] == "revolute" and not joint["actuated"] for joint in cut)
    kernels = {kernel["name"]: kernel for kernel in facts["kernels"]}
    assert kernels["motion"]["inputs"] == {"q": 7, "v": 3, "u": 3}
    assert all(kernel["operations"] > 0 for kernel in kernels.values())


def test_info_for_people_fits_80_columns_and_names_everything():
    result = CliRunner(env={"COLUMNS": "80"}).invoke(app, ["info", "prr3"])
    assert result.exit_code == 0
    assert max(map(len, result.output.splitlines())) <= 80
    for word in ("mobility", "loops", "redundant", "slide_1", "wrist_3", "platform", "inverse_dynamics", "cut"):
        assert word in result.output


def test_markup_in_names_is_printed_as_it_is(tmp_path):
    path = tmp_path / "odd.yaml"
    mechanism = lw.robots.prr3()
    mechanism.model_copy(update={"name": "[red]3-PRR[/]"}).save(path)
    assert "[red]3-PRR[/]" in call("info", path).output


def test_export_writes_a_file_that_is_the_same_robot(tmp_path):
    path = tmp_path / "robot.yaml"
    assert call("export", "prr3", path).exit_code == 0
    assert lw.Mechanism.load(path) == lw.robots.prr3()
    assert json.loads(call("info", path, "--json").stdout) == json.loads(call("info", "prr3", "--json").stdout)
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
    assert "there is no robot 'nobody'; name one of the catalogue (bricard, " in refused("info", "nobody")
    assert "none.yaml: cannot be read: no such file or directory" in refused("info", tmp_path / "none.yaml")
    broken = tmp_path / "broken.yaml"
    broken.write_text("linkwork: 1\nbodies: {a: {mass: -1}}\njoints: {}\n")
    assert "bodies.a.mass" in refused("info", broken)


def test_words_that_are_no_commands_or_options_exit_with_2():
    for words in (("simulat",), ("info", "prr3", "--loud"), ("simulate", "prr3")):
        result = call(*words)
        assert result.exit_code == 2
        assert result.stdout == ""


def test_an_interruption_exits_with_130_and_says_nothing(monkeypatch):
    def interrupt(name):
        raise KeyboardInterrupt

    monkeypatch.setattr("linkwork.cli.info.find", interrupt)
    result = call("info", "prr3")
    assert (result.exit_code, result.output) == (130, "")


def simulated(path, *words):
    result = call("simulate", "prr3", "--duration", 0.25, "--samples", 6, "--out", path, *words)
    assert result.exit_code == 0, result.output
    return result


def test_simulate_writes_the_run_that_the_library_computes(tmp_path):
    path = tmp_path / "run.nc"
    result = simulated(path, "--forces", "1,-0.5,0", "--tool", "0.5,0.29,1.6", "--rates", "slide_2=0.1")
    for word in ("finished", "steps", "evaluations", "closure error", "tool at 0.25 s"):
        assert word in result.stdout
    robot = lw.Robot(lw.robots.prr3())
    state = robot.assemble(tool=[0.5, 0.29, 1.6]).with_rates([0, 0.1, 0])
    run = robot.simulate(state, [1, -0.5, 0], duration=0.25, save_at=np.linspace(0, 0.25, 6))
    loaded = xarray.load_dataset(path)
    for name in ("joint_position", "joint_rate", "actuator_force", "tool_pose"):
        np.testing.assert_allclose(loaded[name], run.dataset[name], rtol=0, atol=1e-12)


def test_simulate_writes_csv_and_takes_forces_from_csv(tmp_path):
    forces, path = tmp_path / "forces.csv", tmp_path / "run.csv"
    forces.write_text("time,slide_3,slide_2,slide_1\n0,0,0,1\n0.1,0,0,3\n0.3,0,0,-1\n")
    simulated(path, "--forces-csv", forces, "--kind", "hold", "--joints", "slide_1=0.2,slide_2=0.2,slide_3=0.2")
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    columns = lines[0].split(",")
    table = np.loadtxt(lines[1:], delimiter=",")
    assert table.shape == (6, len(columns))
    np.testing.assert_allclose(table[:, columns.index("time")], np.linspace(0, 0.25, 6))
    np.testing.assert_allclose(table[0, [columns.index(f"joint_position.slide_{i}") for i in (1, 2, 3)]], 0.2)
    np.testing.assert_allclose(table[:, columns.index("actuator_force.slide_1")], [1, 1, 3, 3, 3, 3])


def test_simulate_keeps_files_unless_told_to_replace_them(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("precious")
    assert "exists" in refused("simulate", "prr3", "--duration", 0.1, "--out", path)
    assert path.read_text() == "precious"
    simulated(path, "--overwrite")
    assert path.read_text() != "precious"


def test_a_run_that_ends_early_exits_with_1_and_keeps_what_it_has(tmp_path):
    path = tmp_path / "run.nc"
    result = call("simulate", "prr3", "--duration", 2, "--forces", "slide_1=50", "--out", path)
    assert result.exit_code == 1
    assert "stopped at t = " in result.stdout
    kept = xarray.load_dataset(path)
    assert kept.attrs["status"] == "SINGULAR"
    assert 1 < kept.sizes["time"] < 101


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--forces", "1,2"), "--forces holds 2 numbers; give 3"),
        (("--forces", "1,2,3", "--forces-csv", "x.csv"), "--forces and --forces-csv are both given"),
        (("--forces-csv", "x.csv"), "x.csv cannot be read: no such file"),
        (("--joints", "slide_9=1"), "--joints: there is no 'slide_9'"),
        (("--joints", "slide_1=5"), "cannot be assembled with slide_1 = 5"),
        (("--tool", "3,3,0"), "cannot be assembled with the tool at [3.0, 3.0, 0.0]"),
        (("--tool", "3"), "a tool pose of 1 numbers is not understood"),
        (("--rates", "pivot_1=1"), "--rates: there is no 'pivot_1'"),
        (("--duration", "-1"), "--duration -1: give a positive"),
        (("--duration", "nan"), "--duration nan: give a positive"),
        (("--samples", "1"), "--samples 1: give at least 2"),
        (("--rtol", "0"), "rtol must be positive"),
        (("--out", "run.mat"), "--out run.mat: a run is written as .nc or .csv, not '.mat'"),
        (("--out", "no-such-folder/run.nc"), "there is no folder 'no-such-folder'"),
    ],
)
def test_simulate_refuses_in_one_sentence(words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sentence in refused("simulate", "prr3", "--duration", 0.1, *words)


def test_forces_that_do_not_cover_the_run_are_refused(tmp_path):
    forces = tmp_path / "forces.csv"
    forces.write_text("time,slide_1,slide_2,slide_3\n0,0,0,0\n0.1,0,0,0\n0.2,1,0,0\n0.3,0,0,0\n")
    assert "give samples for the whole run" in refused("simulate", "prr3", "--duration", 1, "--forces-csv", forces)
