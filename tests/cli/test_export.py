"""`linkwork export`: C, FMUs and CasADi, what it says, what it refuses."""

import json
import zipfile

import casadi as ca
import pytest
from typer.testing import CliRunner

import linkwork as lw
from linkwork.cli import app


def call(*words):
    return CliRunner().invoke(app, ["export", *map(str, words)])


def test_c_is_written_to_a_folder(tmp_path):
    result = call("prr3", "--to", "c", "--out", tmp_path, "--functions", "motion, closure")
    assert result.exit_code == 0, result.output
    assert f"{tmp_path / 'robot_3_prr.h'} written" in result.stdout
    assert "robot_3_prr_motion(" in (tmp_path / "robot_3_prr.c").read_text()
    again = call("prr3", "--to", "c", "--out", tmp_path)
    assert again.exit_code == 2 and "--overwrite to replace it" in again.stderr


def test_numbers_that_stay_free_and_data(tmp_path):
    words = "--free", "platform.mass", "--name", "arm", "--json"
    result = call("prr3", "--to", "c", "--out", tmp_path, *words)
    assert result.exit_code == 0, result.output
    assert "arm_real platform_mass;" in (tmp_path / "arm.h").read_text()
    assert "motion" in json.loads(result.stdout)["functions"]


def test_what_is_left_out_is_said(tmp_path):
    result = call("bricard", "--to", "c", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert "jacobian is left out: the mechanism names no tool" in result.stderr


def test_an_fmu_is_written_to_a_file(tmp_path):
    file = tmp_path / "own.fmu"
    words = "--to", "fmu", "--platforms", "none", "--free", "gravity.y", "--outputs", "rates"
    result = call("pendulum", file, *words, "--fmi", "2.0", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["platforms"] == [] and "parameter.gravity.y" in told["variables"]
    with zipfile.ZipFile(file) as archive:
        assert b'fmiVersion="2.0"' in archive.read("modelDescription.xml")
    again = call("pendulum", file, *words)
    assert again.exit_code == 2 and "--overwrite to replace it" in again.stderr


def test_drives_of_the_description_are_in_an_fmu_on_request(tmp_path):
    robot = tmp_path / "driven.yaml"
    lag = {"type": "lag", "time_constant": 0.1}
    lw.Robot("prr3").mechanism.model_copy(update={"drives": {"slide_2": lag}}).save(robot)
    words = "--to", "fmu", "--platforms", "none", "--drives", "--json"
    result = call(robot, tmp_path / "driven.fmu", *words)
    assert result.exit_code == 0, result.output
    variables = json.loads(result.stdout)["variables"]
    assert {"force.slide_1", "command.slide_2", "drive.slide_2.force"} <= {*variables}


def test_functions_of_casadi(tmp_path):
    file = tmp_path / "prr3.casadi"
    words = "--functions", "gravity,closed", "--free", "gravity.y", "--json"
    result = call("prr3", file, "--to", "casadi", *words)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["functions"] == ["gravity", "closed"]
    gravity, closed = ca.FileDeserializer(str(file)).unpack()
    assert gravity.name_in() == ["q", "p"] and closed.name_out() == ["q"]
    again = call("prr3", file, "--to", "casadi")
    assert again.exit_code == 2 and "--overwrite to replace it" in again.stderr
    result = call("bricard", tmp_path / "bricard.casadi", "--to", "casadi")
    assert "jacobian is left out: the mechanism names no tool" in result.stderr


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--to", "c"), "give it as --out DIR"),
        (("robot.yaml", "--to", "c", "--out", "there"), "give it as --out DIR"),
        ((), "name the mechanism file to write"),
        (
            ("robot.yaml", "--functions", "motion"),
            "--functions is of C and CasADi; give it with --to c or casadi",
        ),
        (("--out", "there"), "--out is of C; give it with --to c; name FILE.yaml behind the robot"),
        (("--to", "fmu", "--out", "there"), "--to c; name FILE.fmu behind the robot"),
        (("f.fmu", "--to", "fmu", "--out", "there"), "--out is of C; give it with --to c"),
        (("robot.yaml", "--to", "fmu"), "an FMU is written to a file"),
        (("robot.yaml", "--outputs", "rates"), "--outputs is of FMUs; give it with --to fmu"),
        (("robot.fmu", "--to", "fmu", "--drives"), "the description gives no drives"),
        (("robot.yaml", "--drives"), "--drives is of FMUs; give it with --to fmu"),
        (("--to", "casadi"), "name it behind the robot, FILE.casadi"),
        (("robot.yaml", "--to", "casadi"), "name it behind the robot, FILE.casadi"),
        (("f.casadi", "--to", "casadi", "--functions", "no"), "there is no function 'no'"),
        (("no/f.casadi", "--to", "casadi", "--functions", "gravity"), "cannot be written"),
        (("f.casadi", "--to", "casadi", "--misra"), "--misra is of C; give it with --to c"),
        (("robot.txt",), "a mechanism file ends in .yaml, not '.txt'"),
        (("robot.tex",), "ends in .yaml, not '.tex'; give --to latex"),
        (("robot.fmu",), "give --to fmu"),
        (("robot.casadi",), "give --to casadi"),
        (("robot.py",), "give --to sympy"),
        (("robot.c",), "give --to c --out DIR"),
        (("robot.urdf",), "'linkwork convert' writes model files such as this"),
    ],
)
def test_refusals(words, sentence):
    result = call("prr3", *words)
    assert result.exit_code == 2
    assert sentence in result.stderr.replace("\n", " ")
    assert result.stderr.count("\n") == 1


def test_equations_are_written(tmp_path):
    tex, module = tmp_path / "crank.tex", tmp_path / "crank.py"
    result = call("slider_crank", tex, "--to", "latex", "--symbols", "all")
    assert result.exit_code == 0, result.output
    assert r"\begin{align*}" in tex.read_text() and "l_{1}" in tex.read_text()
    result = call("slider_crank", module, "--to", "sympy", "--free", "crank.mass")
    assert result.exit_code == 0, result.output
    assert "m_crank = Symbol(" in module.read_text()
    for words, sentence in (
        (["slider_crank", "--to", "latex"], "name the file to write, FILE.tex"),
        (["slider_crank", module, "--to", "sympy"], "--overwrite"),
        (["slider_crank", tmp_path / "a.yaml", "--symbols", "all"], "--symbols is of LaTeX and Sy"),
    ):
        again = call(*words)
        assert again.exit_code == 2 and sentence in again.stderr
