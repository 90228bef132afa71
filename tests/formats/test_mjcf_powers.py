"""Springs and dampers of MJCF that grow by powers, and springs of free joints: joints, tendons and
actuators move as in MuJoCo, which is asked beside."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.formats import load, save

from tests.formats import mujoco_side as side

MASS = '<inertial pos="0.1 0.05 -0.1" mass="1.3" diaginertia="0.02 0.03 0.04"/>'
TREE = f"""<mujoco><worldbody>
 <body><joint name="a" axis="1 0 0" stiffness="1 -0.5 3" springref="20" damping="0.3 0.2 0.1"/>
  {MASS}<site name="one" pos="0.1 0 0"/>
  <body pos="0.3 0 0.1"><joint name="b" type="slide" stiffness="0 4" damping="0 0 2"/>{MASS}
   <body pos="0 0.2 0"><joint name="c" type="ball" stiffness="2 1 0.5" damping="0.2"/>{MASS}
    <site name="two" pos="0 0.3 0.1"/></body></body></body>
 <body pos="1 0 0"><joint name="d" springdamper="0.5 0.7" stiffness="1 2 3" damping="4 5 6"/>{MASS}
 </body></worldbody>
 <tendon><spatial name="line" stiffness="1 2 3" damping="0.3 0.2 0.1" springlength="0.1 0.2">
   <site site="one"/><site site="two"/></spatial>
  <fixed name="sum" stiffness="3 0 1" damping="0 1"><joint joint="a" coef="0.7"/>
   <joint joint="d" coef="-0.4"/></fixed></tendon>
 <actuator><motor joint="a" gear="-2" damping="0.1 0.2 0.3" armature="0.1"/>
  <motor tendon="sum" gear="-3" damping="0.1 0.2 0.3"/></actuator></mujoco>"""
FREE = f"""<mujoco><worldbody><body pos="0.1 0.2 0.3" euler="20 -30 50">
 <joint name="p" type="free" {{}}/>{MASS}</body></worldbody>{{}}</mujoco>"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    path = tmp_path_factory.mktemp("powers") / "tree.xml"
    path.write_text(TREE)
    return path, load(path).mechanism


def test_springs_and_dampers_that_grow_move_as_in_mujoco(tree):
    path, mechanism = tree
    assert not mechanism.caveats
    assert mechanism.joints["a"].spring.powers == (-0.5, 3.0)
    assert mechanism.joints["b"].friction.powers == (0.0, 2.0)
    assert side.apart(mechanism, path) < 1e-9


def test_they_are_written_as_they_are_read(tree, tmp_path):
    save(tree[1], tmp_path / "again.xml")
    again = load(tmp_path / "again.xml").mechanism
    assert side.apart(again, tmp_path / "again.xml") < 1e-9
    for name in "abcd":
        assert again.joints[name].effects() == tree[1].joints[name].effects()
    kept = tree[1].transmissions["sum"].friction.powers
    assert again.transmissions["sum"].friction.powers == kept


def test_what_mujoco_has_of_each_axis_is_warned_of(tmp_path):
    path = tmp_path / "ball.xml"
    path.write_text(TREE.replace('stiffness="2 1 0.5" damping="0.2"', 'damping="0.2 1"'))
    (caveat,) = load(path).mechanism.caveats
    assert "<joint 'c'> has a damping that is not linear; it is against the turn as a" in caveat


@pytest.mark.parametrize(
    "key", ["", '<keyframe><key name="home" qpos="1 0 0 0.8 0 0 0.6"/></keyframe>']
)
@pytest.mark.parametrize("own", ['stiffness="7" damping="1 2"', 'springdamper="0.5 0.7"'])
def test_a_free_joint_is_pulled_to_where_its_body_stands(own, key, tmp_path):
    path = tmp_path / "free.xml"
    path.write_text(FREE.format(own.replace("1 2", "0.3"), key))
    imported = load(path)
    assert not imported.mechanism.caveats
    assert any("is counted from qpos0" in note for note in imported.notes)
    robot, (model, data) = lw.Robot(imported.mechanism), side.compiled(path)
    first = Rotation.from_quat(model.qpos0[3:], scalar_first=True)
    if key:
        turned = Rotation.from_quat(
            [robot.home[f"p.{k}"] for k in ("qw", "qx", "qy", "qz")], scalar_first=True
        )
        np.testing.assert_allclose(
            (turned * first).as_matrix(),
            Rotation.from_quat([0.8, 0, 0, 0.6], scalar_first=True).as_matrix(),
            atol=1e-12,
        )
    random = np.random.default_rng(3)
    state = robot.state(
        dict(zip(robot.coordinates, random.normal(size=7), strict=True)), random.normal(size=6)
    )
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    turn = Rotation.from_quat(state.positions[3:], scalar_first=True) * first
    place = np.concatenate([state.positions[:3], turn.as_quat(scalar_first=True)])
    side.set_state(model, data, dict(zip(robot.coordinates, place, strict=True)), rates)
    wanted = side.accelerations(model, data)
    found = robot.forward_dynamics(state, [])
    np.testing.assert_allclose(
        found, [wanted[name] for name in robot.independent], rtol=1e-9, atol=1e-9
    )


def test_powers_of_a_free_joint_are_warned_of(tmp_path):
    path = tmp_path / "free.xml"
    path.write_text(FREE.format('stiffness="1 2" damping="1 2"', ""))
    caveats = " ".join(load(path).mechanism.caveats)
    assert "where MuJoCo has them of the distance" in caveats
    assert "has a damping that is not linear; it is against the turn as a whole" in caveats
