"""Study files: what is read, and refusals that name the line."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.sweeps import Study, StudyError
from linkwork.sweeps.chunk import bench_of
from linkwork.sweeps.study import in_file

from tests.sweeps.carts import CART, FILE, file, study

PD = "controllers: {soft: {type: pd, kp: 40, kd: 4, goal: {type: pose, joints: {rail: 0.2}}}}"


def refusal(folder, text: str) -> str:
    """Read a study and make it ready; return the sentence with which that is refused."""
    path = file(folder, text)
    with pytest.raises(StudyError) as found, in_file(path):
        bench_of(Study.load(path))
    sentence = str(found.value)
    assert sentence.startswith(str(path)) and "\n" not in sentence
    return sentence.removeprefix(f"{path}: ")


def test_a_study_is_read_with_its_robot_beside_it(tmp_path):
    given = Study.load(file(tmp_path))
    assert given.robot == CART
    assert (given.members, given.chunk_length, given.chunks) == (1024, 16, 64)
    assert given.varied == ("cart.mass", "start.rates.rail") and given.paths == ("cart.mass",)
    assert Study.model_validate_json(given.text) == given
    assert given.digest != study().digest == study().digest
    text = FILE.replace("cart.yaml", "prr3").replace("cart.mass", "platform.mass")
    assert Study.load(file(tmp_path, text)).robot == lw.robots.prr3()


def test_without_a_word_chunks_are_as_long_as_memory_likes():
    assert study(chunk=None, design={"type": "random", "members": 10**6}).chunk_length == 4096
    assert (
        study(chunk=None, samples=100_001, design={"type": "random", "members": 10**6}).chunk_length
        == 19
    )
    assert study(chunk=None).chunk_length == 40


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("study: 1", "", "line 2: study: is missing; the first line should be 'study: 1'"),
        ("study: 1", "study: 2", "line 1: study: 2 is not a format version this program reads"),
        ("robot: cart.yaml", "robot: prr4", (
            "line 3: robot: there is no robot 'prr4' (did you mean prr3?)"
        )),
        ("robot: cart.yaml", "robot: none.yaml", "line 3: robot: "),
        ("duration: 0.5", "duration: -1", (
            "line 4: duration: -1 is not above 0; expected length of each run [s]"
        )),
        ("duration: 0.5", "durations: 1", (
            "line 4: durations: is not a known field (did you mean duration?)"
        )),
        ("duration: 0.5", "package: .", (
            "line 4: package: is not a known field (did you mean packages?); the fields here are "
        )),
        ("{rail: 3}", "{rial: 3}", (
            "line 5: forces.rial: there is no actuator 'rial'; there are rail"
        )),
        ("sobol", "sobl", "line 6: design.type: 'sobl' is not a type (did you mean sobol?)"),
        ("1024", "2.5", "line 6: design.members: 2.5 is not accepted"),
        ("sobol, members: 1024, seed: 2", "grid", (
            "line 8: vary.cart.mass: is 'uniform', but a grid needs levels or values"
        )),
        ("cart.mass: {type: uniform, low: 1", "cart.mass: {type: levels, count: 3, low: 1", (
            "but levels are for a grid"
        )),
        ("low: 1, high: 3", "low: 3, high: 1", (
            "line 8: vary.cart.mass: low = 3 is not below high = 1"
        )),
        ("low: 1, high: 3", "low: -1, high: 3", (
            "line 8: vary.cart.mass: reaches -1, which the robot may not have: "
        )),
        ("type: uniform, low: 1, high: 3", "type: normal, mean: 1, deviation: 0.5", (
            "vary.cart.mass: reaches -1.9989"
        )),
        ("type: uniform, low: 1, high: 3", "type: normal, mean: 1, deviation: 0", (
            "deviation: 0 is not above 0"
        )),
        ("type: uniform, low: 1, high: 3", "type: gamma", (
            "line 8: vary.cart.mass.type: 'gamma' is not a type"
        )),
        ("cart.mass", "cart.mas", (
            "line 8: vary.cart.mas: 'cart.mas' leads to no number: bodies.cart has no 'mas'"
        )),
        ("cart.mass", "rail.axis.x", (
            "line 8: vary.rail.axis.x: 'rail.axis.x' is part of a direction and cannot be free"
        )),
        ("start.rates.rail", "start.rates.rial", (
            "line 9: vary.start.rates.rial: is nothing that can vary; there are start."
        )),
        ("start.rates.rail", "start.tool.x", "line 9: vary.start.tool.x: is nothing that can vary"),
        ("start.rates.rail", "drives.rail.gear", (
            "line 9: vary.drives.rail.gear: is nothing that can vary; there are none"
        )),
        ("start.rates.rail", "bodies.cart.mass", (
            "line 7: vary: 'cart.mass' and 'bodies.cart.mass' are the same number"
        )),
        ("final joint_position.rail", "last joint_position", (
            "line 11: outputs.end: 'last' is no reduction"
        )),
        ("final joint_position.rail", "final joint_positions", "did you mean joint_position?"),
        ("final joint_position.rail", "final", (
            "line 11: outputs.end: 'final' is no output; give a reduction and a quantity"
        )),
        ("joint_position.rail", "joint_position.x", (
            "line 11: outputs.end: joint_position has no component 'x'; there"
        )),
        ("joint_position.rail", "tracking_error", (
            "line 11: outputs.end: 'tracking_error' is not defined here"
        )),
        ("  end:", "  status:", "line 11: outputs.status: is the name of something else"),
        ("chunk: 16", "trajectories: [tool_poses]", (
            "line 12: trajectories.0: 'tool_poses' is no quantity (did you"
        )),
        ("chunk: 16", PD, "line 5: forces: and controllers are both given; keep one of them"),
        ("forces: {rail: 3}", PD.replace("pd,", "pdd,"), (
            "controllers.soft.type: 'pdd' is not a type (did you mean pd?)"
        )),
        ("forces: {rail: 3}", PD.replace("rail", "rial"), (
            "line 5: controllers.soft.goal: there is no joint 'rial'"
        )),
        ("forces: {rail: 3}", PD.replace("kd: 4, ", ""), "line 5: controllers.soft.kd: is missing"),
        ("chunk: 16", "drives: {rail: {type: lag}}", (
            "line 12: drives.rail.time_constant: is missing"
        )),
        ("chunk: 16", (
            "drives: {rail: {type: lag, time_constant: 0}}"
        ), "line 12: drives.rail: time_constant of Lag is 0"),
        ("chunk: 16", (
            "drives: {rial: {type: lag, time_constant: 1}}"
        ), "line 12: drives.rial: there is no actuator 'rial'"),
        ("chunk: 16", "method: rk5", (
            "line 12: method: there is no method 'rk5'; there are sharp_smart"
        )),
        ("chunk: 16", "method: rk4", "step: rk4 needs a step [s]"),
        ("chunk: 16", "step: 0.01", (
            "line 12: step: a step of 0.01 s needs a method that keeps to it"
        )),
        ("chunk: 16", "chunk: 0", "line 12: chunk: 0 is below 1"),
        ("chunk: 16", "start: {tool: [0, 1, 0]}", (
            "line 12: start: the mechanism cannot be assembled with the tool at"
        )),
    ],
)  # fmt: skip
def test_refusals_name_line_and_element(tmp_path, old, new, sentence):
    assert old in FILE
    assert sentence in refusal(tmp_path, FILE.replace(old, new))


def test_a_file_that_is_not_there_or_no_text(tmp_path):
    with pytest.raises(StudyError, match=r"none\.yaml: cannot be read: no such file"):
        Study.load(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(StudyError, match="is not UTF-8 text"):
        Study.load(tmp_path / "binary.yaml")


def test_gains_that_vary_are_those_of_controllers(tmp_path):
    text = FILE.replace("forces: {rail: 3}", PD).replace("start.rates.rail", "controllers.soft.ki")
    assert (
        "is nothing that can vary; there are controllers.soft.kp, controllers.soft.kd"
        in refusal(tmp_path, text)
    )


URDF = """<robot name="box"><link name="base"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="1" velocity="3"/></joint></robot>"""
STUDY = """study: 1
robot: box.urdf
{keys}
duration: 0.1
vary: {{arm.mass: {{type: values, values: [1, 2]}}}}
outputs: {{most: peak joint_position.hinge}}
"""


def test_a_model_file_is_read_as_the_study_says(tmp_path):
    """As --floating, --package-path and --reference of commands."""
    (tmp_path / "box.urdf").write_text(URDF)
    (tmp_path / "turned.yaml").write_text("hinge: 0.5")
    (tmp_path / "meshes").mkdir()
    plain = Study.load(file(tmp_path, STUDY.format(keys="")))
    assert list(plain.robot.joints) == ["hinge"]
    keys = "root: floating\npackages: meshes\nreference: {hinge: 40 deg}"
    read = Study.load(file(tmp_path, STUDY.format(keys=keys)))
    assert "floating_base" in read.robot.joints and read.reference["hinge"] == np.deg2rad(40)
    assert Study.load(file(tmp_path, STUDY.format(keys="reference: turned.yaml"))).reference == {
        "hinge": 0.5
    }


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ("root: 1", "line 3: root: is 1; give fixed or floating"),
        ("packages: none", "which is no folder"),
        ("packages: 3", "line 3: packages: 3 is no folder; give one, or a list of them"),
        ("reference: {hinge: 40 mm}", "line 3: reference: the reference: hinge: '40 mm': the unit"),
        ("reference: {knee: 1}", "knee"),
    ],
)
def test_what_does_not_fit_the_model_file_is_refused(keys, sentence, tmp_path):
    (tmp_path / "box.urdf").write_text(URDF)
    assert sentence in refusal(tmp_path, STUDY.format(keys=keys))


def test_robots_of_the_catalogue_are_not_read(tmp_path):
    text = FILE.replace("cart.yaml", "prr3\nroot: floating")
    assert "line 4: root: is of files, but 'prr3' is a robot of the catalogue" in refusal(
        tmp_path, text
    )
