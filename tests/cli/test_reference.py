"""`--reference` and `load(..., reference=)`: where loops are closed from, for models that cannot
say it themselves."""

import json
from math import cos, hypot, sin

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load
from linkwork.mechanism import MechanismError
from linkwork.sweeps import Study
from linkwork.sweeps.chunk import bench_of

from tests.cli.calls import call, refused

FLAT = """<mujoco><worldbody>
<body name="crank"><joint name="a" axis="0 0 1"/>
 <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/>
 <body name="coupler" pos=".5 0 0"><joint name="b" axis="0 0 1"/>
  <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body></body>
<body name="rocker" pos="1 0 0"><joint name="c" axis="0 0 1"/>
 <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body>
</worldbody><equality><connect body1="coupler" body2="rocker" anchor="1 0 0"/></equality>
<actuator><motor joint="a"/></actuator></mujoco>"""
STUDY = """study: 1
robot: flat.xml
reference: {reference}
duration: 0.01
vary: {{gravity.z: {{type: values, values: [-9.81]}}}}
outputs: {{end: final joint_position}}
"""
BENT = {"a": 0.7, "b": -0.7, "c": 0.7}


@pytest.fixture
def flat(tmp_path):
    """A parallelogram drawn in a line, in a format without a reference."""
    path = tmp_path / "flat.xml"
    path.write_text(FLAT)
    return path


def test_a_model_is_loaded_about_the_reference_that_is_given(flat):
    robot = lw.Robot(load(flat, reference=BENT).mechanism)
    a, b, c = robot.home.positions[:3]
    assert robot.mobility == 1
    assert np.allclose([a, b, c], [a, -a, a], atol=1e-9)
    assert (
        hypot(
            0.5 * cos(a) + cos(a + b) - 1 - 0.5 * cos(c), 0.5 * sin(a) + sin(a + b) - 0.5 * sin(c)
        )
        < 1e-12
    )


def test_a_reference_that_names_no_joint_is_refused(flat):
    with pytest.raises(MechanismError, match="there is no joint 'd'"):
        load(flat, reference={"d": 1.0})


def test_the_coordinates_that_a_reference_does_not_name_stay(flat):
    mechanism = load(flat, reference=BENT).mechanism.with_reference({"b": -0.6})
    assert dict(mechanism.reference) == BENT | {"b": -0.6}


@pytest.mark.parametrize("command", ["info", "analyse", "simulate", "export", "convert"])
def test_commands_take_a_reference(flat, tmp_path, command, compiled):
    target = tmp_path / "out.yaml"
    rest = {
        "info": ["--json"],
        "analyse": ["equilibrium"],
        "simulate": ["--duration", "0.01"],
        "export": [target],
        "convert": [target],
    }[command]
    option = ["--reference", "a=0.7,b=-0.7,c=0.7"]
    words = (
        [command, *option, flat, *rest] if command == "analyse" else [command, flat, *option, *rest]
    )
    result = call(*words)
    assert result.exit_code == 0, result.output
    if command == "info":
        assert json.loads(result.stdout)["mobility"] == 1
    if target.exists():
        assert dict(lw.Mechanism.load(target).reference) == BENT


def test_a_reference_of_unknown_joints_is_refused_by_the_command(flat):
    result = call("info", flat, "--reference", "d=1")
    assert result.exit_code == 2
    assert "--reference: there is no 'd'; the names are a, b, c" in result.stderr.splitlines()[-1]


def test_what_is_decided_about_a_singular_reference_is_told(flat):
    result = call("info", flat, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["mobility"] == 1
    assert "branches of motion meet at the given reference" in " ".join(result.stderr.split())


def test_a_study_has_a_reference(flat, tmp_path):
    path = tmp_path / "study.yaml"
    path.write_text(STUDY.format(reference="{a: 0.7, b: -0.7, c: 0.7}"))
    bench = bench_of(Study.load(path))
    a, b, c = bench.start.positions[:3]
    assert np.allclose([a, b, c], [0.7, -0.7, 0.7], atol=1e-6)
    path.write_text(STUDY.format(reference="{d: 0.7}"))
    with pytest.raises(MechanismError, match=r"line 3: reference: there is no joint 'd'"):
        Study.load(path)


def test_a_report_takes_a_reference_for_the_robot_that_is_named(flat, tmp_path):
    robot = lw.Robot(load(flat, reference=BENT).mechanism)
    run = robot.simulate(robot.home, duration=0.01, save_at=[0, 0.01]).save(tmp_path / "run.nc")
    words = ("report", run, "--out", tmp_path / "report.html", "--reference", "a=0.7,b=-0.7,c=0.7")
    assert call(*words, "--robot", flat).exit_code == 0
    assert "where the loops of the robot of --robot are closed from" in refused(
        *words, "--overwrite"
    )
