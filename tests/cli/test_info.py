"""The facts of a robot: as data for prr3, as text for the whole catalogue, and what mobility is
explained by."""

import json

import pytest

import linkwork as lw
from linkwork.cli import info
from linkwork.cli.info import gather, print_tables

from tests.catalogue import built
from tests.cli.calls import call


@pytest.fixture
def without_kernels(monkeypatch):
    """Leave out the sizes of the compiled functions, which take long to compile for all robots."""
    monkeypatch.setattr(info, "KERNELS", ())
    monkeypatch.setenv("COLUMNS", "80")


def told(robot, capsys):
    print_tables(gather(robot))
    return capsys.readouterr().out


def fact(text, name):
    """Return the value of one fact, its lines joined."""
    lines = text.split("\n\n")[0].splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(name))
    rest = [line for line in lines[first + 1 :]]
    last = next((i for i, line in enumerate(rest) if line[:1] != " "), len(rest))
    return " ".join(
        [lines[first].removeprefix(name).strip(), *(line.strip() for line in rest[:last])]
    ).strip()


def test_facts_as_json():
    result = call("info", "prr3", "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert list(facts) == [
        "name", "mobility", "gruebler", "planar", "actuators", "transmissions", "drives", "tools",
        "bodies", "joints", "springs", "loops", "redundant", "idle", "quantities", "chart",
        "kernels",
    ]  # fmt: skip
    assert (facts["mobility"], facts["gruebler"], facts["loops"]) == (3, 3, 2)
    assert (len(facts["bodies"]), len(facts["joints"]), facts["springs"]) == (7, 9, [])
    assert facts["planar"] is True
    assert facts["redundant"] == facts["idle"] == []
    assert facts["actuators"] == facts["chart"]["independent"] == ["slide_1", "slide_2", "slide_3"]
    cut = [joint for joint in facts["joints"] if joint["role"] == "cut"]
    assert len(cut) == facts["loops"]
    assert all(joint["type"] == "revolute" and not joint["actuated"] for joint in cut)
    kernels = {kernel["name"]: kernel for kernel in facts["kernels"]}
    assert kernels["motion"]["inputs"] == {"q": 7, "v": 3, "u": 3}
    assert all(kernel["operations"] > 0 for kernel in kernels.values())


def test_facts_for_people_fit_80_columns():
    result = call("info", "prr3")
    assert result.exit_code == 0
    assert max(map(len, result.output.splitlines())) <= 80
    for word in (
        "mobility",
        "loops",
        "redundant",
        "slide_1",
        "wrist_3",
        "platform",
        "inverse_dynamics",
        "cut",
    ):
        assert word in result.output


@pytest.mark.parametrize("name", lw.robots.__all__)
def test_every_joint_of_the_catalogue_has_one_line_of_80_columns(name, capsys, without_kernels):
    robot = built(name)
    text = told(robot, capsys)
    assert max(map(len, text.splitlines())) <= 80
    lines = text.split("\n\n")[1].splitlines()[2:]
    assert [line.split()[:2] for line in lines] == [
        [joint, described.type] for joint, described in robot.mechanism.joints.items()
    ]
    for line, joint in zip(lines, robot.mechanism.pairs.values(), strict=True):
        assert " - ".join(joint.connects) in line
    assert fact(text, "independent") == ", ".join(robot.independent)


MOBILITIES = {
    "five_bar": "2, planar; Gruebler's formula gives 2",
    "bricard": (
        "1, spatial; Gruebler's formula gives 0, because one closure row depends on the others: "
        "1 named below"
    ),
    "bennett": (
        "1, spatial; Gruebler's formula gives -2, because 3 closure rows depend on the others: "
        "3 named below"
    ),
    "agile_wrist": "3, spatial; Gruebler's formula gives -3, because 6 closure rows depend on "
    "the others: 6 that the geometry makes vanish",
}
"""Counted by hand: 6 r - 5 j for r bodies and j revolute joints in space, 3 r - 2 j in the
plane."""


@pytest.mark.parametrize(("name", "sentence"), MOBILITIES.items())
def test_mobility_is_told_beside_grueblers_formula(name, sentence, capsys, without_kernels):
    assert fact(told(built(name), capsys), "mobility") == sentence


def test_redundant_rows_are_named(capsys, without_kernels):
    robot = built("bennett")
    assert len(robot.redundant) == 3
    assert fact(told(robot, capsys), "redundant rows") == "; ".join(robot.redundant)


BODY = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))


def test_limits_springs_gears_and_actuated_freedoms_are_told(capsys, without_kernels):
    mechanism = lw.Mechanism(
        bodies={"arm": BODY, "sleeve": BODY, "ball": BODY},
        joints={
            "hinge": lw.RevoluteJoint(
                connects=("ground", "arm"),
                axis=(1, 0, 0),
                limits=lw.Limits(lower=-1, upper=2, speed=4),
                spring=lw.Spring(stiffness=3),
            ),
            "tube": lw.CylindricalJoint(
                connects=("arm", "sleeve"),
                limits={"slide": lw.Limits(upper=0.5), "angle": lw.Limits(speed=3)},
                spring={"slide": lw.Spring(stiffness=40)},
            ),
            "knob": lw.SphericalJoint(
                connects=("sleeve", "ball"), limits={"turn": lw.Limits(upper=1.5)}
            ),
            "wheels": lw.GearJoint(
                ratios={"hinge": 1, "tube.angle": -2},
                powers={"tube.angle": (0.5,)},
                teeth={"at": "hinge", "friction": {"coefficient": 0.1}},
            ),
        },
        springs={
            "coil": lw.PointSpring(
                connects=("ground", "ball"), points=((1, 0, 0), (0, 0, 0.2)), stiffness=500
            )
        },
        actuators=("hinge", "tube.slide", "knob.wx", "knob.wz"),
    )
    robot = lw.Robot(mechanism)
    text = told(robot, capsys)
    assert (
        fact(text, "limits")
        == "hinge from -1 to 2 rad; hinge at most 4 rad/s; tube.slide to 0.5 m; "
        "tube.angle at most 3 rad/s; knob.turn to 1.5 rad"
    )
    assert (
        fact(text, "springs") == "hinge 3 N m/rad; tube.slide 40 N/m; coil (ground - ball) 500 N/m"
    )
    bearings = fact(text, "bearings")
    assert bearings == "wheels rubs by its teeth, at hinge, with the coefficient 0.1"
    lines = {
        line.split()[0]: " ".join(line.split()) for line in text.split("\n\n")[1].splitlines()[2:]
    }
    assert lines["wheels"] == "wheels gear hinge - 2 tube.angle + 0.5 tube.angle^2 gear"
    assert lines["hinge"].endswith("tree yes")
    assert lines["tube"].endswith("tree slide")
    assert lines["knob"].endswith("tree wx, wz")


def test_actuators_and_tools_are_told(capsys, without_kernels):
    """Those that act along a transmission, too, as in grippers' files, and their drives."""
    mechanism = lw.Mechanism(
        bodies={"left": BODY, "right": BODY},
        joints={
            "hinge": lw.RevoluteJoint(connects=("ground", "left")),
            "other": lw.RevoluteJoint(connects=("ground", "right")),
        },
        transmissions={
            "split": lw.Combination(ratios={"hinge": -1, "other": 0.5}),
            "fan": lw.Thrust(body="left", force=(0, 1, 0)),
        },
        actuators=("split", "fan", "other"),
        drives={"split": {"type": "servo", "gain": 5.0}},
        tools={"tip": lw.Tool(body="left"), "thumb": lw.Tool(body="right")},
    )
    text = told(lw.Robot(mechanism), capsys)
    assert fact(text, "actuators") == (
        "split (along -hinge + 0.5 other; servo); fan (along a thrust); other"
    )
    assert fact(text, "tools") == "tip on left, thumb on right"


def test_idle_freedoms_are_told(capsys, without_kernels):
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"crank": BODY, "rod": BODY, "slider": BODY},
            joints={
                "pivot": lw.RevoluteJoint(connects=("ground", "crank")),
                "pin": lw.SphericalJoint(
                    connects=("crank", "rod"), frames=(lw.Frame.planar(0.2), lw.Frame())
                ),
                "wrist": lw.SphericalJoint(
                    connects=("rod", "slider"), frames=(lw.Frame.planar(0.5), lw.Frame())
                ),
                "slide": lw.PrismaticJoint(connects=("ground", "slider"), axis=(1, 0, 0)),
            },
            actuators=("pivot",),
            reference={"slide": 0.4},
        )
    )
    text = told(robot, capsys)
    assert fact(text, "idle freedoms") == "rod: spin about the line through pin and wrist"
    assert fact(text, "mobility") == "2, spatial; Gruebler's formula gives 2"


def test_markup_in_names_is_printed_as_it_is(tmp_path):
    path = tmp_path / "odd.yaml"
    mechanism = lw.robots.prr3()
    mechanism.model_copy(update={"name": "[red]3-PRR[/]"}).save(path)
    assert "[red]3-PRR[/]" in call("info", path).output


def test_named_quantities_are_told(without_kernels, capsys):
    mechanism = lw.robots.pendulum().with_quantities({"rod": 0.3, "half": "rod/2"}, {})
    facts = gather(lw.Robot(mechanism))
    assert facts["quantities"] == {"rod": 0.3, "half": 0.15}
    assert fact(told(lw.Robot(mechanism), capsys), "quantities") == "rod = 0.3, half = 0.15"
    assert "quantities" not in told(lw.Robot("pendulum"), capsys)


def test_home_is_told_and_that_it_passes_limits(tmp_path):
    mechanism = lw.robots.slider_crank()
    name = mechanism.actuators[0]
    limited = mechanism.model_dump()
    limited["joints"][name]["limits"] = {"upper": mechanism.reference[name] - 0.1}
    lw.Mechanism(**limited).save(tmp_path / "limited.yaml")
    text = call("info", tmp_path / "limited.yaml").stdout
    assert fact(text, "home").startswith(f"{name} {mechanism.reference[name]:.5g}; x ")
    assert "is above its upper limit" in fact(text, "limits passed")
    assert "limits passed" not in call("info", "slider_crank").stdout


def test_a_pose_relative_to_another_body_is_told_so(capsys, without_kernels):
    mechanism = lw.robots.prr3()
    own = lw.Tool(body="platform", relative_to="link_1")
    fields = {name: getattr(mechanism, name) for name in type(mechanism).model_fields}
    robot = lw.Robot(lw.Mechanism(**fields | {"tools": {"hand": own}}))
    info.print_tables(info.structure(robot) | {"kernels": []}, info.at_home(robot))
    assert "relative to link_1" in " ".join(capsys.readouterr().out.split())
