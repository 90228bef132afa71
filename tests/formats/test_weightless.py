"""Motions without mass are told when a file is read, those that run are not."""

import warnings

import pytest

import linkwork as lw
from linkwork.errors import ModelWarning
from linkwork.formats import load

HEAVY = '<inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>'
POINT = '<inertial pos="0 0 0.1" mass="1" diaginertia="0 0 0"/>'
MODEL = """<mujoco model="arm"><compiler boundinertia="0"/><worldbody><body name="a">
<joint name="first" axis="0 0 1"/>{heavy}<body name="b" pos="0.3 0 0">{joint}{own}{further}</body>
</body></worldbody>{more}</mujoco>"""
JOINT = '<joint name="second" axis="0 0 1" armature="{}"/>'
CHILD = f'<body name="c" pos="0.1 0 0">{HEAVY}</body>'
GEAR = '<equality><joint joint1="second" joint2="first" polycoef="0 2"/></equality>'


def written(folder, own="", further="", more="", armature=0.0, joint=JOINT):
    path, joint = folder / "arm.xml", joint.format(armature)
    path.write_text(MODEL.format(heavy=HEAVY, joint=joint, own=own, further=further, more=more))
    return path


@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"own": POINT},
        {"own": POINT, "joint": '<joint name="second" type="ball"/>'},
        {"further": f'<body name="c" pos="0 0 0.1">{POINT}</body>'},
    ],
)
def test_what_moves_no_mass_is_told_and_does_not_run(parts, tmp_path):
    path = written(tmp_path, **parts)
    with pytest.warns(ModelWarning, match="the motion of 'second' moves no mass, and forces"):
        robot = lw.Robot(load(path).mechanism)
    with pytest.raises(lw.LinkworkError, match="some motion moves no mass"):
        robot.forward_dynamics(robot.home.with_rates([1.0] * robot.mobility), [])


@pytest.mark.parametrize(
    "parts",
    [
        {"own": HEAVY},
        {"armature": 0.1},
        {"further": CHILD},
        {"further": CHILD.replace('">', '"><joint name="third" axis="1 0 0"/>', 1)},
        {"more": GEAR},
    ],
)
def test_what_runs_is_not_told(parts, tmp_path):
    path = written(tmp_path, **parts)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        robot = lw.Robot(load(path).mechanism)
    assert robot.simulate(robot.home, duration=0.01).success
