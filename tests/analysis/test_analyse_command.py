"""`linkwork analyse`: what it prints is what the library finds, in 80 columns; files; refusals in
one sentence."""

import json

import numpy as np
import pytest
import xarray

import linkwork as lw
from linkwork.analysis import workspace

from tests.analysis.mechanisms import cart
from tests.catalogue import built
from tests.cli.calls import call, refused


def printed(*words):
    result = call("analyse", *words)
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stdout.splitlines() if not line.endswith(" written")]
    assert max(map(len, lines)) <= 80
    return result.stdout


@pytest.mark.long
def test_modes_are_counted_and_listed():
    text = printed("five_bar", "modes")
    assert "2 (sure)" in text and "likely missing" in text
    assert "4 (sure)" in printed("five_bar", "modes", "--tool", "0.15,0.3")
    assert "assembly modes  0" in printed(
        "five_bar", "modes", "--joints", "motor_1=3.14159,motor_2=0", "--starts", "500"
    )


@pytest.mark.long
def test_a_singular_pose_is_named():
    text = printed("rpr3", "singularities", "--tool", "0.5,0.288675134594813,0")
    assert "II: actuator-singular" in text and "angle 1" in text
    assert "no: regular" in printed("five_bar", "singularities")


@pytest.mark.long
def test_a_map_is_printed_written_and_drawn(tmp_path):
    file, picture = tmp_path / "map.nc", tmp_path / "map.svg"
    words = (
        "--grid",
        "x=-0.2:0.5:15,y=0.1:0.5:9",
        "--rates",
        "2",
        "--forces",
        "motor_1=1,motor_2=2",
    )
    text = printed(
        "five_bar",
        "workspace",
        *words,
        "--out",
        file,
        "--picture",
        picture,
        "--limits",
        "motor_1=0:3",
    )
    expected = workspace(
        built("five_bar"),
        {"x": np.linspace(-0.2, 0.5, 15), "y": np.linspace(0.1, 0.5, 9)},
        rates=2.0,
        forces=[1.0, 2.0],
        limits={"motor_1": (0.0, 3.0)},
    )
    assert expected.attrs["message"] in text
    xarray.testing.assert_allclose(
        xarray.load_dataset(file, engine="scipy")["isotropic_force"], expected["isotropic_force"]
    )
    assert picture.read_text().startswith("<?xml")
    assert "none of 4 poses is reached" in printed(
        "five_bar", "workspace", "--grid", "x=5:6:2,y=5:6:2"
    )


def test_small_motions_stiffness_and_rest():
    text = printed("pendulum", "linearise", "--joints", "hinge_1=-1.5707963267948966")
    assert "stable" in text and f"{np.sqrt(9.81) / (2 * np.pi):.6g}" in text
    assert "falls away" not in text
    assert "falls away" in printed("pendulum", "linearise", "--joints", "hinge_1=90deg")
    assert "no: it accelerates" in printed("pendulum", "linearise", "--forces", "0")
    assert "3.044e+05" in printed(
        "prr3", "stiffness", "--joint-stiffness", "slide_1=1e5,slide_2=1e5,slide_3=1e5"
    )
    assert "y -1, angle -1.5708" in printed("pendulum", "equilibrium", "--all")


def test_poles_are_told_where_forces_have_no_potential(tmp_path):
    ball = lw.SphericalJoint(connects=("ground", "arm"))
    cube = lw.Inertia(xx=0.1, yy=0.2, zz=0.25)
    body = lw.Body(mass=2, centre_of_mass=(0.3, 0.1, 0.2), inertia=cube)
    held = lw.Mechanism(bodies={"arm": body}, joints={"b": ball}, actuators=ball.rates("b"))
    held.save(tmp_path / "held.yml")
    text = printed(str(tmp_path / "held.yml"), "linearise")
    assert "at rest, by the poles; natural modes are" in " ".join(text.split())
    assert "pole, real" in text and "frequency" not in text


def test_parameters_described_and_identified(tmp_path):
    mechanism, file = tmp_path / "cart.yaml", tmp_path / "run.nc"
    cart().mechanism.save(mechanism)
    robot = lw.Robot.from_file(mechanism)
    robot.simulate(robot.home, [3.0], duration=1.0, save_at=np.linspace(0, 1, 50)).save(file)
    assert "mass.mass" in printed(mechanism, "parameters")
    text = printed(mechanism, "parameters", "--run", file, "--effects", "slide.friction.viscous")
    value = next(line for line in text.splitlines() if "mass.mass" in line).split()[0]
    assert float(value) == pytest.approx(2.0, rel=1e-5)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("nope", "modes"), "there is no robot 'nope'"),
        (
            ("five_bar", "modes", "--tool", "1,2", "--joints", "motor_1=1,motor_2=2"),
            "are both given",
        ),
        (("five_bar", "modes", "--joints", "motor_1=1"), "but the mobility is 2"),
        (("bricard", "singularities"), "names no tool"),
        (("five_bar", "workspace", "--grid", "x=0:1"), "x=0:1 is no axis"),
        (("five_bar", "workspace", "--grid", "x=0,x=1"), "given twice"),
        (("five_bar", "workspace", "--grid", "0,1"), "has no name"),
        (
            ("five_bar", "workspace", "--grid", "x=0,y=0", "--limits", "motor_1=1"),
            "give lower:upper",
        ),
        (("five_bar", "workspace", "--grid", "x=0,y=0", "--out", "map.csv"), "ends in .nc"),
        (
            ("five_bar", "workspace", "--grid", "x=0,y=0", "--picture", "no/map.svg"),
            "there is no folder 'no'",
        ),
        (
            ("five_bar", "stiffness", "--joint-stiffness", "1e5"),
            "give name=value for each stiff joint",
        ),
        (("five_bar", "parameters", "--run", "missing.nc"), "cannot read a run"),
        (("pendulum", "equilibrium", "--forces", "50"), "no stable equilibrium"),
    ],
)
def test_refusals_are_one_sentence(words, told):
    assert told in refused("analyse", *words)


@pytest.mark.long
def test_numbers_are_found_from_a_table_and_written(tmp_path):
    """Poses of a robot whose pivot is off are told by a table; the description is put right."""
    name, off = "pivot_2.frames.0.position.x", 1.0005
    real = lw.Robot("rpr3").free(name).with_parameters({name: off})
    random = np.random.default_rng(2)
    goals = real.tool_pose(real.home) + random.uniform(-0.1, 0.1, (6, 3))
    lines = ["angle,slide_3,x,y,slide_1,slide_2"]
    for pose in goals:
        state = real.assemble(tool=pose)
        row = (pose[2], state["slide_3"], pose[0], pose[1], state["slide_1"], state["slide_2"])
        lines.append(",".join(repr(float(x)) for x in row))
    file, out = tmp_path / "poses.csv", tmp_path / "found.yaml"
    file.write_text("\n".join(lines))
    words = ("rpr3", "calibrate", "--poses", file, "--free", "pivot_2.frames.0.position.[xy]")
    text = printed(*words, "--position", "1e-5", "--rotation", "1e-4", "--out", out)
    assert "1.0005" in text and "of 16 degrees of freedom" in text
    assert lw.Mechanism.load(out).joints["pivot_2"].frames[0].position[0] == pytest.approx(off)
    told = call("analyse", *words, "--json")
    assert json.loads(told.stdout)["values"][name] == pytest.approx(off)
    assert {*json.loads(told.stdout)["noise"]} == {"tool.position", "tool.rotation"}
    assert "(tool.position)" in printed(*words, "--rotation", "1e-4")
    # Columns that do not make poses, lines that have none, files that exist.
    assert "found.yaml exists" in refused("analyse", *words, "--out", out)
    file.write_text("\n".join(line.split(",", 1)[1] for line in lines))
    assert "has x, y of the tool's pose; give x, y, angle" in refused("analyse", *words)
    file.write_text("\n".join([*lines, lines[-1].replace(",", ",9", 1)]))
    assert "poses.csv, line 8: " in refused("analyse", *words)
    file.write_text(f"{lines[0]}\n0,800,0.5,0.3,700,900\n")
    assert "times the mechanism's own length of" in refused("analyse", *words)
    assert "is it in millimetres? give metres" in refused("analyse", *words)
    file.write_text(lines[0] + "\n")
    assert "poses.csv holds no rows below its names" in refused("analyse", *words)
