"""Paths, controllers and the equations at one state, from the command line: the same numbers as the
library's, and refusals in one sentence."""

import json
import re

import numpy as np
import pytest

import linkwork as lw
from linkwork.cli import entries
from linkwork.cli.goal_words import CONTROLLERS, GOALS, Lead
from linkwork.cli.measured_words import MeasuredWords
from linkwork.cli.words import fields, values
from linkwork.control.goals import target
from linkwork.motions.tables import read_columns

from tests.catalogue import built
from tests.cli.calls import call, refused
from tests.robot.mixed_freedoms import scara

pytestmark = pytest.mark.usefixtures("compiled")

CIRCLE = "circle centre=0.5,0.29 radius=0.04 orientation=1.2"


def told(*words):
    """Return what a command prints as JSON."""
    result = call(*words, "--json")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def motion():
    path = lw.paths.circle([0.5, 0.29], 0.04, 1.2)
    return built("prr3").follow(path, 1.0, samples=101)


def test_a_path_is_followed_and_its_forces_drive_the_robot_along_it(motion, tmp_path):
    robot, table, forces = built("prr3"), tmp_path / "motion.csv", tmp_path / "forces.csv"
    words = ("follow", "prr3", "--path", CIRCLE, "--duration", 1)
    found = told(*words, "--out", table, "--forces-out", forces)
    u = robot.inverse_dynamics(motion).values
    assert found["actuators"]["slide_1"]["largest force"] == pytest.approx(u[:, 0].max())
    assert found["joints"]["slide_2"]["rate"] == pytest.approx(
        np.abs(motion.joint_rates[:, 1]).max()
    )
    assert found["written"] == [str(table), str(forces)]
    assert np.allclose(read_columns(table)["u slide_3"], u[:, 2])
    pose = ",".join(map(str, motion.tool[0]))
    run = told("simulate", "prr3", "--duration", 1, "--forces-csv", forces, "--tool", pose)
    assert np.allclose([*run["tool"].values()], motion.tool[-1], rtol=0, atol=1e-5)
    text = call(*words).stdout
    assert "largest force" in text and max(map(len, text.splitlines())) <= 80
    assert all(re.search(rf"slide_1 +{unit} +[-\d]", text) for unit in ("m", "N"))  # told once each


def test_a_table_is_followed_on_the_branch_that_it_tells(motion, tmp_path):
    """Home lies on another one: the same slides hold the platform at another angle there."""
    lw.motions.write_csv(tmp_path / "motion.csv", motion, built("prr3"))
    found = told("follow", "prr3", "--path", tmp_path / "motion.csv")
    last = {name: 1 for name in ("pivot_1", "wrist_3")}
    for name in last:
        column = motion.positions[:, built("prr3").coordinates.index(name)]
        assert found["joints"][name]["to"] == pytest.approx(column.max(), abs=1e-6)


def test_a_controller_leads_a_run_along_a_path_from_its_beginning(motion):
    words = ("simulate", "prr3", "--duration", 1, "--goal", CIRCLE)
    exact = told(*words, "--controller", "computed_torque kp=400 kd=40")
    assert np.allclose([*exact["tool"].values()], motion.tool[-1], rtol=0, atol=1e-6)
    assert max(off["most"] for off in exact["off_goal"].values()) < 1e-6
    heavy = "computed_torque kp=400 kd=40 model.platform.mass=2 sampled.rate=500"
    wrong = told(*words, "--controller", heavy)
    assert max(off["most"] for off in wrong["off_goal"].values()) > 1e-4


@pytest.mark.sample(1)
@pytest.mark.parametrize("tabled", [False, True])
def test_paths_of_many_turns_are_led_along(tabled, tmp_path):
    """Between the samples that there are at least, too."""
    robot, goal = built("prr3"), "circle centre=0.5,0.29 radius=0.03 orientation=1.2 turns=30"
    path = lw.paths.circle([0.5, 0.29], 0.03, 1.2, turns=30)
    fine = robot.follow(path, 1.0, samples=8001)
    if tabled:
        goal = str(tmp_path / "motion.csv")
        lw.motions.write_csv(tmp_path / "motion.csv", fine, robot)
    led = Lead("pd kp=400 kd=40", goal).reached(robot, fine.state.at(0), 1.0, 201)
    wanted = target(led, robot.names).positions(fine.time)
    assert np.allclose(wanted, fine.positions[:, :3], rtol=0, atol=1e-6)


def test_a_controller_leads_the_tool_in_its_task(motion):
    gains = "kd=40 kp.x=400 kp.y=400 kp.angle=300"
    words = ("simulate", "prr3", "--duration", 1, "--goal", CIRCLE, "--controller")
    exact = told(*words, f"task_computed_torque {gains}")
    assert np.allclose([*exact["tool"].values()], motion.tool[-1], rtol=0, atol=1e-6)
    stiff = told(*words, "task_pd_with_gravity kp=4e4 kd=400")
    assert np.allclose([*stiff["tool"].values()], motion.tool[-1], rtol=0, atol=1e-3)


def test_a_controller_leads_to_a_pose_as_the_library_does():
    found = told("simulate", "prr3", "--duration", 0.3, "--controller", "pd kp=400 kd.slide_1=40 "
                 "kd.slide_2=40 kd.slide_3=50", "--goal", "pose tool=0.5,0.29,1.2")  # fmt: skip
    robot = built("prr3")
    gains = dict(zip(robot.actuators, (40.0, 40.0, 50.0), strict=True))
    law = lw.control.PD(robot.assemble(tool=[0.5, 0.29, 1.2]), kp=400.0, kd=gains)
    run = robot.simulate(robot.home, law, duration=0.3)
    assert np.allclose([*found["joints"].values()], run.final.positions, rtol=0, atol=1e-9)
    held = told("simulate", "prr3", "--duration", 0.1, "--controller", "lqr position=1e4 force=1")
    assert max(off["most"] for off in held["off_goal"].values()) < 1e-12


def test_methods_and_steps_are_chosen():
    found = told("simulate", "prr3", "--duration", 0.1, "--method", "rk4", "--step", 0.001)
    assert found["steps"] == 100 and found["method"] == "Runge-Kutta 4"
    assert "Rodas" in told("simulate", "prr3", "--duration", 0.1, "--method", "rodas")["method"]


def test_the_equations_are_told_at_one_state():
    robot = built("prr3")
    state = robot.state(robot.home.positions, {"slide_2": 0.3})
    inverse = told("dynamics", "prr3", "--rates", "slide_2=0.3", "--accelerations", "slide_1=2")
    u = robot.inverse_dynamics(state, [2.0, 0.0, 0.0])
    assert np.allclose([*inverse["forces"].values()], u, rtol=1e-12)
    assert np.allclose([*inverse["C v"].values()], robot.coriolis(state), rtol=1e-12)
    M = [[*row.values()] for row in inverse["M"].values()]
    assert np.allclose(M, robot.mass_matrix(state), rtol=1e-12)
    text = ",".join(map(repr, u.tolist()))
    forward = told("dynamics", "prr3", "--rates", "slide_2=0.3", "--forces", text)
    assert np.allclose([*forward["accelerations"].values()], [2.0, 0.0, 0.0], atol=1e-12)
    assert "acceleration" in call("dynamics", "stewart").stdout


def test_rounding_is_no_coordinate():
    """Platforms that stand, or fall, along the axis are at 1e-16 m of it."""
    for words in (("dynamics", "stewart"), ("simulate", "delta", "--duration", 0.05)):
        told_of = call(*words).stdout.partition("joints")[2]
        assert told_of and not re.search(r"e-1[4-9]", told_of)


def test_words_are_the_fields_of_records():
    texts = fields(["a=1", "b=1,2", "c=1,2;3,4", "d.x=5", "d.y.z=6", "e=word"], "--goal")
    assert values(texts, "--goal") == {
        "a": 1.0, "b": [1.0, 2.0], "c": [[1.0, 2.0], [3.0, 4.0]], "d": {"x": 5.0, "y.z": 6.0},
        "e": "word",
    }  # fmt: skip
    assert {"pose", "circle", "line", "through"} == {*GOALS}
    assert {"pd", "computed_torque", "lqr"} <= {*CONTROLLERS}


def test_robots_of_mixed_freedoms_are_led_in_task_coordinates(tmp_path):
    """By name, or in the order of the task."""
    file = tmp_path / "scara.yaml"
    scara().save(file)
    robot, tool = lw.Robot(file), {"x": 0.4, "y": 0.2, "z": -0.1, "rz": 0.3}
    words = ",".join(f"{name}={value}" for name, value in tool.items())
    modes = told("analyse", file, "modes", "--tool", words)
    assert modes["count"] == 2 and modes["what"] == [*tool]
    run = told("simulate", file, "--duration", 0.01, "--rtol", 1e-10, "--tool", words)
    start = robot.assemble(tool=tool)
    assert run["joints"]["shoulder"] == pytest.approx(float(start["shoulder"]), abs=1e-3)
    line = "line start=0.4,0.2,-0.1,0.3 end=0.45,0.1,-0.1,0"
    path = ("follow", file, "--path", line, "--duration", 1, "--tool", words)
    found = told(*path, "--what", "x,y,z,rz")
    assert found == told(*path)
    last = robot.assemble(tool=[0.45, 0.1, -0.1, 0.0], guess=start)
    assert found["joints"]["shoulder"]["from"] == pytest.approx(float(last["shoulder"]), abs=1e-6)
    judged = told("analyse", file, "singularities", "--what", "x,y,z,rz")
    assert judged["kinds"] == [] and judged["leg"] > 0.01
    for refusal in ((*path[:-1], "x=0.4,w=1"), (*path, "--what", "x,y,z,qq")):
        assert "there is no coordinate of the tool" in refused(*refusal)


def read(robot, text, what=None):
    """Return the fields of a goal in words, whose lengths and angles may have units."""
    return MeasuredWords(built(robot), what)(fields(text.split(), "--goal"), "--goal")


def test_lengths_and_angles_of_goals_may_have_units():
    assert read("prr3", "centre=50cm,290mm radius=4cm orientation=90deg turns=2") == {
        "centre": [0.5, 0.29], "radius": 0.04, "orientation": np.pi / 2, "turns": 2.0,
    }  # fmt: skip
    assert read("prr3", "tool=0.5,29cm,180deg joints.slide_1=30mm joints.pivot_1=1turn") == {
        "tool": [0.5, 0.29, np.pi], "joints": {"slide_1": 0.03, "pivot_1": 2 * np.pi},
    }  # fmt: skip
    poses = read("stewart", "poses=0,0,1m,0,90deg,0;1cm,0,1,0,0,0.5turn")["poses"]
    assert poses == [[0, 0, 1, 0, np.pi / 2, 0], [0.01, 0, 1, 0, 0, np.pi]]
    turned = read("stewart", "centre=0,0,1 orientation=0,0,30deg")
    assert turned["orientation"] == [0, 0, np.pi / 6]
    assert read("prr3", "start=30deg,1cm", ("angle", "x")) == {"start": [np.pi / 6, 0.01]}
    for robot, text, sentence in (
        (
            "prr3",
            "tool=0.5,29deg,1",
            "--goal: tool: '29deg': the unit is not known; it is no angle",
        ),
        ("prr3", "centre=0,0 orientation=1cm", "--goal: orientation: '1cm': the unit is not known"),
        ("prr3", "centre=0,", "--goal: centre: '' is not a number"),
        ("prr3", "joints.slide_1=3deg", "--goal: joints.slide_1: '3deg': the unit is not known"),
        ("prr3", "joints.slid_1=3cm", "there is no 'slid_1' (did you mean slide_1?)"),
        ("puma560", "start=1,2,3,4", "a tool pose of 4 numbers is not understood"),
    ):
        with pytest.raises(lw.LinkworkError, match=re.escape(sentence)):
            read(robot, text)


def test_what_linearise_says_of_modes_that_nothing_pulls_back_fits_the_terminal():
    shown = call("analyse", "prr3", "linearise").stdout
    assert "Nothing pulls back 3 modes of 0 Hz" in shown
    assert max(map(len, shown.splitlines())) <= 80


RUN = ("simulate", "prr3", "--duration", 0.1)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ((*RUN, "--controller", "pdd kp=1"), "there is no 'pdd' (did you mean pd?); give one of"),
        ((*RUN, "--controller", "pd kp=1"), "--controller: pd: kd: is missing"),
        ((*RUN, "--controller", "pd kp=1 kd=x"), "kd: 'x' is not a number"),
        ((*RUN, "--controller", "pd kp 1"), "'kp' has no name; write name=value"),
        ((*RUN, "--controller", "pd kp=1 kp=2 kd=1"), "'kp' is given twice"),
        ((*RUN, "--controller", ""), "--controller: there is no ''; give one of pd"),
        ((*RUN, "--goal", "pose"), "give --controller, too"),
        ((*RUN, "--controller", "pd kp=1 kd=1", "--forces", "1,2,3"), "both given; keep one"),
        ((*RUN, "--controller", "lqr position=1 force=1", "--goal", CIRCLE), "follows no path"),
        ((*RUN, "--method", "rk4"), "rk4 needs a step"),
        ((*RUN, "--step", "0.1"), "needs a method that keeps to it"),
        (("follow", "prr3", "--path", CIRCLE), "give --duration, too"),
        (("follow", "prr3", "--path", "circle", "--duration", 1), "circle: centre: is missing"),
        (("follow", "prr3", "--path", "spiral", "--duration", 1), "there is no 'spiral'"),
        (("follow", "prr3", "--path", "none.csv"), "cannot be read as a table: no such file"),
        (("follow", "prr3", "--path", CIRCLE, "--duration", 1, "--samples", 1), "at least 2"),
        (("follow", "prr3", "--path", CIRCLE, "--duration", 1, "--out", "a.nc"), "written as .csv"),
        (("follow", "prr3", "--path", CIRCLE, "--duration", 1, "--out", "no/a.csv"), "no folder"),
        (("dynamics", "prr3", "--forces", "1,2,3", "--accelerations", "1,2,3"), "both given"),
        (("inverse", "prr3"), "use 'linkwork dynamics'"),
        (
            ("follow", "prr3", "--path", CIRCLE, "--out", "a.csv", "--forces-out", "./a.csv"),
            "--out and --forces-out are both a.csv; name two files",
        ),
        (
            ("follow", "prr3", "--path", CIRCLE, "--duration", 1, "--what", "x,x,y"),
            "x, x, y names a coordinate twice",
        ),
        (("trajectory", "prr3"), "use 'linkwork follow'"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_refused(words, sentence):
    assert sentence in refused(*words)


@pytest.mark.parametrize(
    "words",
    [
        ("follow", "nobody", "--path", CIRCLE, "--out"),
        ("follow", "nobody", "--path", CIRCLE, "--forces-out"),
        ("analyse", "nobody", "calibrate", "--poses", "no.csv", "--free", "a", "--out"),
        ("analyse", "nobody", "workspace", "--grid", "x=0:1:3", "--out"),
    ],
)
def test_files_that_cannot_be_written_are_refused_before_anything_is_computed(words, tmp_path):
    suffix = {"follow": "csv", "calibrate": "yaml", "workspace": "nc"}[
        words[0] if words[0] == "follow" else words[2]
    ]
    for folder, why in (("/proc", "nothing can be written"), (tmp_path / "no", "there is no fol")):
        assert f"{words[-1]} {folder}/a.{suffix}: {why}" in refused(*words, f"{folder}/a.{suffix}")


def test_commas_in_names_of_actuators_are_no_commas_between_columns(tmp_path):
    arm = built("double_pendulum").mechanism.model_dump()
    joints = {"a,b": arm["joints"].pop("hinge_1")} | arm["joints"]
    arm |= {"joints": joints, "actuators": ["a,b", "hinge_2"], "reference": {}}
    lw.Mechanism(**arm).save(tmp_path / "arm.yaml")
    (tmp_path / "way.csv").write_text('time,"a,b",hinge_2\n0,0,0\n1,0.1,0.1\n2,0.3,0\n')
    words = ("follow", tmp_path / "arm.yaml", "--path", tmp_path / "way.csv", "--forces-out")
    assert call(*words, tmp_path / "forces.csv").exit_code == 0
    names = ("a,b", "hinge_2")
    _, values = entries.read_columns(tmp_path / "forces.csv", names)
    assert values.shape == (101, 2)


def test_a_table_has_times_of_its_own(tmp_path):
    words = ("follow", "prr3", "--duration", 3, "--path")
    table = tmp_path / "motion.csv"
    table.touch()
    assert "has times of its own; leave --duration out" in refused(*words, table)
    assert "cannot be read as a table: no such file" in refused(*words, tmp_path / "none.csv")
