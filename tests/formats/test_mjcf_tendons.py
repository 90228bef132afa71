"""Spatial tendons as cables, weights that are carried, springs by time and ratio: accelerations are
MuJoCo's; cables round surfaces have the lengths that it gives them."""

import casadi as ca
import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.equations.cables import way
from linkwork.formats import load, poses, save
from linkwork.mechanism import Cable

from tests.catalogue import WHOLE
from tests.formats.test_mjcf_actuators import compared
from tests.model_collections import MuJoCoSide, apart

ARM = """<mujoco>
<compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody>
 <site name="w" pos="0.1 0.3 1.2"/>
 <geom name="drum" type="cylinder" size="0.05 0.1" pos="0 0.05 1" euler="1.5 0 0"/>
 <body name="a" pos="0 0 1" gravcomp="0.7">
  <joint name="j1" axis="0 1 0" springdamper="0.3 0.8" springref="0.2"/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0.5 0 0"/>
  <site name="s1" pos="0.2 0.05 0.05"/><geom name="ball" type="sphere" size="0.06" pos="0.4 0 0"/>
  <body name="b" pos="0.5 0 0" gravcomp="1.2">
   <joint name="j2" axis="0 1 0.3"/><geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0.1"/>
   <site name="s2" pos="0.2 0 0.08"/><site name="s3" pos="0.35 0.03 0"/>
  </body>
 </body>
</worldbody>
<tendon>
 <spatial name="t1" stiffness="40" damping="1" springlength="0.1 0.3">
  <site site="w"/><site site="s1"/><geom geom="ball"/><site site="s2"/>
  <pulley divisor="2"/><site site="w"/><site site="s3"/>
 </spatial>
 <spatial name="t2" stiffness="30">
  <site site="w"/><geom geom="drum"/><site site="s1"/><geom geom="ball"/><site site="s2"/>
 </spatial>
 <spatial name="t3"><site site="s1"/><site site="s3"/></spatial>
</tendon>
<actuator><motor tendon="t1" gear="-2"/><position tendon="t3" kp="10" kv="2"/></actuator>
</mujoco>"""


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    return path


def test_cables_and_carried_weights_do_what_they_do_in_mujoco(arm, tmp_path):
    imported = load(arm)
    assert not imported.mechanism.caveats
    assert [line.type for line in imported.mechanism.transmissions.values()] == 3 * ["cable"]
    assert compared(arm, tmp_path) < 1e-12


def test_a_cable_may_begin_behind_a_pulley(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.replace('name="t3">', 'name="t3" stiffness="9"><pulley divisor="4"/>'))
    assert compared(path, tmp_path) < 1e-12


def test_inertia_along_a_cable_is_mujocos(arm, tmp_path):
    arm.write_text(ARM.replace('name="t3"', 'name="t3" armature="0.2"'))
    assert not load(arm).mechanism.caveats
    assert compared(arm, tmp_path) < 1e-12
    arm.write_text(arm.read_text().replace("springdamper", "user"))
    assert compared(arm, tmp_path) < 1e-12


def test_what_is_written_moves_as_what_was_read(arm, tmp_path):
    save(load(arm).mechanism, tmp_path / "again.xml")
    assert compared(tmp_path / "again.xml", tmp_path) < 1e-12


def test_the_energy_balance_knows_them(arm):
    robot = lw.Robot(load(arm).mechanism)
    run = robot.simulate(robot.home, [1.0, 0.3], duration=0.3, drives=robot.drives, rtol=1e-11)
    assert run.success
    assert np.abs(run["energy_balance"]).max() < 1e-8 * np.abs(run["work"]).max()
    assert np.isfinite(run["conditioning"]).all()


def test_a_joint_brings_what_lifts_cables_and_thrusts_leave_it():
    """A pendulum hangs at rest: (m - m_lift) g - u_cable - u_thrust."""
    hung = lw.Mechanism.parse("""
linkwork: 1
bodies: {rod: {mass: 2, centre_of_mass: [0, 0, -0.5], inertia: {xx: 0.1, yy: 0.1, zz: 0.1}}}
joints: {pivot: {type: revolute, connects: [ground, rod], axis: [0, 1, 0]}}
lifts: {balloon: {body: rod, point: [0, 0, -0.3], mass: 0.5}}
transmissions:
  wire: {type: cable, path: [{type: point, body: ground, point: [0, 0, -1]},
                             {type: point, body: rod, point: [0, 0, -0.7]}]}
  fan: {type: thrust, body: rod, force: [0, 0, 1]}
actuators: [wire, fan]
""")
    robot = lw.Robot(hung)
    force = robot.reactions(robot.home, [3.0, 4.0])["pivot"][3:]
    assert force == pytest.approx([0, 0, 1.5 * 9.81 - 3 - 4])


@pytest.mark.sample(4)
@pytest.mark.parametrize("led", ["", "inside", "beside", "from_elsewhere"])
@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_a_cable_round_a_surface_has_the_length_that_mujoco_gives_it(kind, led):
    """Inside a surface MuJoCo finds where the cable touches to six digits, and so the length, which
    is least there, to twelve."""
    random, bent, far = np.random.default_rng(3), 0, {"beside": 1.6, "from_elsewhere": 1.1}
    for k in range(40):
        if not WHOLE and k >= 20 and bent > 2:
            break
        radius, quaternion = random.uniform(0.05, 0.3), random.normal(size=4)
        centre, (a, b) = random.normal(size=3) / 10, random.normal(size=(2, 3)) / 2
        away = random.normal(size=3)
        away *= radius / np.linalg.norm(away) * far.get(led, 0.7)
        away *= random.uniform(0.5, 1.5) if led == "from_elsewhere" else 1
        said = {"a": a, "b": b, "centre": centre, "quaternion": quaternion, "s": centre + away}
        said = {name: " ".join(map(repr, map(float, value))) for name, value in said.items()}
        model = mj.MjModel.from_xml_string(
            """<mujoco><worldbody><site name="a" pos="{a}"/><site name="b" pos="{b}"/>
            <site name="s" pos="{s}"/>
            <geom name="g" type="{kind}" size="{radius} 1" pos="{centre}" quat="{quaternion}"/>
            <body><joint/><geom size="1"/></body></worldbody><tendon><spatial><site site="a"/>
            <geom geom="g"{side}/><site site="b"/></spatial></tendon></mujoco>""".format(
                kind=kind, radius=radius, side=' sidesite="s"' if led else "", **said
            )
        )
        data = mj.MjData(model)
        mj.mj_forward(model, data)
        X = poses.pose(centre, poses.from_quaternion(*(quaternion / np.linalg.norm(quaternion))))
        surface = {"type": kind, "body": "ground", "radius": radius, "frame": poses.frame_of(X)}
        at = "other" if led == "from_elsewhere" else "ground"
        side = {"body": at, "point": tuple(centre + away)}
        surface |= {"": {}, "inside": {"inside": True}}.get(led, {"side": side})
        ends = [{"type": "point", "body": "ground", "point": tuple(end)} for end in (a, b)]
        cable = Cable(path=(ends[0], surface, ends[1]))  # pyright: ignore
        found = float(way(cable, lambda _: (ca.SX.eye(3), ca.SX.zeros(3))).length)
        assert found == pytest.approx(data.ten_length[0], rel=1e-12)
        bent += found > np.linalg.norm(b - a) + 1e-9
    assert bent > 2


def test_a_branch_of_a_cable_needs_two_points():
    point = {"type": "point", "body": "ground"}
    ball = {"type": "sphere", "body": "ground", "radius": 0.1}
    pulley = {"type": "pulley", "divisor": 2}
    one_ball, two_balls = [point, ball], [point, ball, ball, point]
    for path in ([], [point], [pulley], one_ball, two_balls, [point, point, pulley]):
        with pytest.raises(lw.MechanismError, match="a branch of a cable begins and ends with a"):
            Cable(path=path)


RING = '<site name="ring" pos="0.02 0.05 1"/><geom name="drum"'


def test_a_cable_led_inside_does_what_it_does_in_mujoco(arm, tmp_path):
    """MuJoCo finds where it touches to six digits."""
    text = ARM.replace('<geom geom="drum"/>', '<geom geom="drum" sidesite="ring"/>')
    arm.write_text(text.replace('<geom name="drum"', RING))
    imported = load(arm)
    assert not imported.mechanism.caveats and "ring" not in imported.mechanism.tools
    assert compared(arm, tmp_path) < 1e-6
    save(imported.mechanism, tmp_path / "again.xml")
    assert load(tmp_path / "again.xml").mechanism.transmissions["t2"].path[1].inside
    assert compared(tmp_path / "again.xml", tmp_path) < 1e-6


@pytest.mark.parametrize("side", ["w", "s1"])
def test_a_cable_passes_by_the_side_that_it_does_in_mujoco(arm, tmp_path, side):
    """Once the side lies on the surface's own body, once on another one."""
    arm.write_text(ARM.replace('<geom geom="drum"/>', f'<geom geom="drum" sidesite="{side}"/>'))
    imported = load(arm)
    assert not imported.mechanism.caveats and side not in imported.mechanism.tools
    assert compared(arm, tmp_path) < 1e-12
    save(imported.mechanism, tmp_path / "again.xml")
    assert compared(tmp_path / "again.xml", tmp_path) < 1e-12


def test_a_side_lies_outside_of_the_surface():
    ball = {"type": "sphere", "body": "ground", "radius": 0.1}
    near = ball | {"side": {"body": "ground", "point": (0, 0.05, 0)}}
    ends = ({"type": "point", "body": "ground"}, {"type": "point", "body": "ground"})
    with pytest.raises(lw.MechanismError, match="from the centre, within the radius"):
        Cable(path=(ends[0], near, ends[1]))  # pyright: ignore
    with pytest.raises(lw.MechanismError, match="has no side; leave one"):
        Cable(path=(ends[0], near | {"inside": True}, ends[1]))  # pyright: ignore


PAIR = """<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
 <site name="w" pos="0.4 0.1 0.5"/>
 <body name="a"><joint name="j1" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>
  <site name="s1" pos="0.3 0 0.1"/>
  <body name="c" pos="0.5 0 0"><joint name="j3" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>
   <site name="s3" pos="0.1 0 0.1"/></body>
 </body>
 <body name="b" pos="0 1 0"><joint name="j2" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/>
  <site name="s2" pos="0.2 0 0.2"/></body>
</worldbody><tendon>{tendon}</tendon></mujoco>"""
FIXED = '<fixed armature="2"><joint joint="{}" coef="0.7"/><joint joint="{}" coef="-0.5"/></fixed>'
SPATIAL = '<spatial armature="2"><site site="{}"/><site site="w"/>{}<site site="{}"/></spatial>'


@pytest.mark.parametrize(
    ("tendon", "told"),
    [
        (FIXED.format("j1", "j2"), True),
        (FIXED.format("j1", "j3"), False),
        (FIXED.format("j3", "j2").replace("-0.5", "0"), False),
        (SPATIAL.format("s1", "", "s2"), True),
        (SPATIAL.format("s1", "", "s3"), False),
        (SPATIAL.format("s1", '<pulley divisor="2"/><site site="w"/>', "s2"), True),
        (SPATIAL.format("s3", '<pulley divisor="2"/><site site="s1"/>', "w"), False),
    ],
)
def test_inertia_that_couples_branches_is_whole_and_mujocos_without_the_coupling(
    tmp_path, tendon, told
):
    path = tmp_path / "pair.xml"
    path.write_text(PAIR.format(tendon=tendon))
    mechanism = load(path).mechanism
    assert [("on different branches of the tree" in c) for c in mechanism.caveats] == told * [True]
    notes = save(mechanism, tmp_path / "again.xml")
    assert [("on different branches of the tree" in note) for note in notes].count(True) == told
    # MuJoCo's inertia without the tendon, and with that of its whole length.
    model = mj.MjModel.from_xml_path(str(path))
    data, M, J = mj.MjData(model), np.zeros((3, 3)), np.zeros(3)
    data.qpos[:] = 0.3, -0.2, 0.4
    mj.mj_forward(model, data)
    J[model.ten_J_colind[: model.ten_J_rownnz[0]]] = data.ten_J[: model.ten_J_rownnz[0]]
    accelerations, model.tendon_armature[:] = data.qacc.copy(), 0.0
    mj.mj_forward(model, data)
    mj.mj_fullM(model, data, M)
    whole = np.linalg.solve(M + 2.0 * np.outer(J, J), -data.qfrc_bias)
    # Ours is the whole; MuJoCo's is where no branches are coupled.
    robot = lw.Robot(mechanism)
    names = [model.joint(k).name for k in range(3)]
    state = robot.state(dict(zip(names, data.qpos, strict=True)))
    found = dict(zip(robot.independent, robot.forward_dynamics(state, []), strict=True))
    assert [found[name] for name in names] == pytest.approx(whole, rel=1e-10)
    assert (np.abs(accelerations - whole).max() > 1e-3 * np.abs(whole).max()) == told


def test_an_inertia_along_a_cable_over_a_cylinder_is_left_out_where_mujoco_refuses_it(tmp_path):
    start = {"type": "point", "body": "ground", "point": (0.2, 0.1, 0.3)}
    end = {"type": "point", "body": "rod", "point": (0.1, 0.0, 0.4)}
    over = {"type": "cylinder", "body": "ground", "radius": 0.05}
    mechanism = lw.Mechanism(
        bodies={"rod": lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))},
        joints={"pivot": lw.RevoluteJoint(connects=("ground", "rod"))},
        transmissions={"cable": Cable(path=(start, over, end), inertia=0.4)},  # pyright: ignore
    )
    notes = save(mechanism, tmp_path / "cable.xml")
    assert any("its inertia is left out" in note for note in notes)
    assert mj.MjModel.from_xml_path(str(tmp_path / "cable.xml")).ntendon == 1


BENT = """<mujoco><option gravity="0 0 -9.81"/>
<default><geom contype="0" conaffinity="0"/></default>
<worldbody><site name="w" pos="0.1 0 1"/>
 <body name="a"><joint name="h" axis="0 1 0" ref="20"/><geom type="box" size=".1 .2 .3"/>
  <site name="s" pos="0.3 0 0"/><site name="t" pos="0.2 0.1 0"/>
  <body name="b" pos="0.5 0 0"><joint name="k" type="slide" axis="1 0 0.3" ref="0.1"/>
   <geom size="0.1"/></body></body>
</worldbody><tendon>{tendon}</tendon><equality>{equality}</equality></mujoco>"""
SUM = '<fixed name="f" {}><joint joint="h" coef="0.7"/><joint joint="k" coef="-1.2"/></fixed>'
LINE = '<spatial name="f" {}><site site="w"/><site site="s"/></spatial>'


def bent(tmp_path, tendon="", equality=""):
    path = tmp_path / "bent.xml"
    path.write_text(BENT.format(tendon=tendon, equality=equality))
    return path


@pytest.mark.sample(5)
@pytest.mark.parametrize(
    "given", ["-0.6", "-0.6 -0.2", "-0.5 0.3", "-1", "-1 -1", "-2", "0.2", "0"]
)
@pytest.mark.parametrize("kind", [SUM, LINE], ids=["fixed", "spatial"])
def test_springs_of_tendons_rest_at_what_is_given_below_zero_too(kind, given, tmp_path):
    """-1 alone means where the joints' springs rest."""
    path = bent(tmp_path, kind.format(f'stiffness="30" springlength="{given}"'))
    mechanism = load(path).mechanism
    assert not mechanism.caveats
    assert apart(lw.Robot(mechanism), MuJoCoSide(path)) < 1e-9
    again = tmp_path / "again.xml"
    save(mechanism, again)
    assert apart(lw.Robot(mechanism), MuJoCoSide(again)) < 1e-9


@pytest.mark.parametrize("held", [False, True])
def test_a_tendon_between_two_points_of_one_body_does_nothing(held, tmp_path):
    line = '<spatial name="f" stiffness="3"><site site="s"/><site site="t"/></spatial>'
    path = bent(tmp_path, line, '<tendon tendon1="f"/>' if held else "")
    imported = load(path)
    assert any("both of its ends are on one body" in note for note in imported.notes)
    robot = lw.Robot(imported.mechanism)
    assert robot.mobility == 2 and apart(robot, MuJoCoSide(path)) < 1e-9


def test_a_tendon_of_one_joint_that_is_held_locks_it(tmp_path):
    line = '<fixed name="f" stiffness="3"><joint joint="h" coef="2"/></fixed>'
    path = bent(tmp_path, line, '<tendon name="e" tendon1="f" polycoef="0.3"/>')
    robot = lw.Robot(load(path).mechanism)
    assert robot.independent == ("k",)
    at = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    assert at["h"] == pytest.approx(np.radians(20) + 0.3 / 2)
    assert apart(robot, MuJoCoSide(path)) < 1e-9
    nothing = bent(tmp_path, line.replace('"2"', '"0"'), '<tendon tendon1="f"/>')
    assert lw.Robot(load(nothing).mechanism).mobility == 2


def test_a_spring_at_rest_at_minus_one_is_written_as_such(tmp_path):
    mechanism = load(bent(tmp_path, SUM.format('stiffness="30" springlength="-0.9"'))).mechanism
    line = mechanism.transmissions["f"]
    spring = line.spring.model_copy(update={"rest": -1.0})
    lines = {"f": line.model_copy(update={"spring": spring})}
    path = tmp_path / "again.xml"
    save(mechanism.model_copy(update={"transmissions": lines}), path)
    model = mj.MjModel.from_xml_path(str(path))
    np.testing.assert_allclose(model.tendon_lengthspring, [[-1.0, -1.0]])
    assert load(path).mechanism.transmissions["f"].spring.rest == -1.0


def test_springs_have_names_that_can_be_names_here_and_a_held_one_is_read_again(tmp_path):
    line = LINE.replace('name="f"', 'name="a.b"').format('stiffness="30" springlength="0.1"')
    mechanism = load(bent(tmp_path, line)).mechanism
    assert list(mechanism.springs) == ["a_b"]
    held = load(bent(tmp_path, line, '<tendon tendon1="a.b"/>')).mechanism
    save(held, tmp_path / "again.xml")
    again = load(tmp_path / "again.xml").mechanism
    assert len(again.springs) == 1 and lw.Robot(again).mobility == lw.Robot(held).mobility == 1


def test_tendons_without_names_are_all_there(tmp_path):
    pair = [f'stiffness="{k}" springlength="0.1"' for k in (30, 50)]
    path = bent(tmp_path, "".join(LINE.replace('name="f"', "").format(each) for each in pair))
    mechanism = load(path).mechanism
    assert [spring.stiffness for spring in mechanism.springs.values()] == [30, 50]
    assert apart(lw.Robot(mechanism), MuJoCoSide(path)) < 1e-9
    sums = "".join(SUM.replace('name="f"', "").format(each) for each in pair)
    path = bent(tmp_path, sums + SUM.replace('"f"', '"tendon_2"').format(pair[0]))
    assert apart(lw.Robot(load(path).mechanism), MuJoCoSide(path)) < 1e-9
