"""What two features of MJCF make together: each case once moved otherwise than in MuJoCo, without a
word."""

import pytest

import linkwork as lw
from linkwork.formats import load

from tests.formats import mujoco_side as side

FORM = """<mujoco>
<compiler angle="radian" {compiler}/><option {option}>{flags}</option>
<default><geom contype="0" conaffinity="0"/>{default}</default>
<worldbody>
 <body name="a" pos="0 0.1 1" quat="0.9 0.2 0 0.1">
  <joint name="j" axis="0 1 0.2" damping="0.1" range="-2 2" {joint}/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0.5 0 0"/><site name="s" pos="0.2 0.1 0"/>
  <body name="b" pos="0.5 0 0.1" quat="0.8 0 0.3 0.1" {body}>
   <joint name="k" axis="0.3 1 0" ref="0.2"/>{mass}<site name="t" pos="0.1 0 0.2"/>
   <body name="c" pos="0 0 0.3"><site name="u"/></body>
  </body>
 </body>{world}
</worldbody>{more}<actuator>{actuators}</actuator>
</mujoco>"""
BOX = '<geom type="box" size="0.05 0.06 0.07" pos="0.1 0 0.05" quat="1 0.3 0 0.2"/>'
OFTEN = {"mass": BOX}


def written(path, **parts):
    empty = dict.fromkeys(
        ("compiler", "option", "flags", "default", "joint", "body", "world", "more", "actuators"),
        "",
    )
    path.write_text(FORM.format(**empty | OFTEN | parts))
    return path


SERVOS = """<position kp="5" kv="2"/><default class="i"><velocity kv="3"/>\
<default class="g"><general gear="2"/></default></default>\
<default class="n"><general gainprm="3 0.2 0.1" biasprm="0.3 -4 -0.5" gaintype="affine" \
biastype="affine" gear="1 0.5"/></default>"""
SAME = {
    "a servo of another kind than its class": {
        "default": SERVOS,
        "actuators": '<intvelocity joint="j"/><velocity joint="k"/>',
    },
    "a servo of the kind that a class around its own has": {
        "default": SERVOS,
        "actuators": '<position joint="j" class="i"/><general joint="k"/>',
    },
    "a servo after what a class says of all": {
        "default": SERVOS,
        "actuators": '<position joint="j" class="g"/><velocity joint="k" class="g"/>',
    },
    "some numbers of those that a class gives": {
        "default": SERVOS,
        "actuators": '<general joint="j" class="n" biasprm="1" gear="3"/>',
    },
    "a damper without kv": {"actuators": '<damper joint="j" ctrlrange="0.5 1"/>'},
    "a damping ratio of <general>": {
        "actuators": '<general joint="k" gainprm="3" biastype="affine" biasprm="0 -3 0.8"/>'
    },
    "a damping ratio at a site": {
        "actuators": '<intvelocity site="t" gear="0.2 1 0 0 0.3 0" kp="4" dampratio="0.9"/>'
    },
    "controls that are not clamped": {
        "flags": '<flag clampctrl="disable"/>',
        "actuators": '<motor joint="j" ctrlrange="-0.1 0.1"/>',
    },
    "a range that is the joint's, after what a class says": {
        "default": '<position ctrlrange="-1 1"/>',
        "actuators": '<position joint="j" kp="5" inheritrange="0.1"/>',
    },
    "ranges of a general servo and of one along a tendon": {
        "more": '<tendon><fixed name="t" range="-1 1" limited="false"><joint joint="j" coef="2"/>\
</fixed></tendon>',
        "actuators": '<position tendon="t" kp="5" inheritrange="0.2"/><general joint="j" \
gainprm="4" biastype="affine" biasprm="0 -4" ctrlrange="-1 1" inheritrange="0.1"/>',
    },
    "motors after what a class says of them": {
        "default": '<dcmotor nominal="12 3 20"/>',
        "actuators": '<dcmotor joint="j" motorconst="0.5"/><dcmotor joint="k" nominal="6"/>',
    },
    "a controller of which a class gives the damping": {
        "default": '<dcmotor nominal="12 3 20" input="pos" controller="3 0 0.5"/>',
        "actuators": '<dcmotor joint="j" controller="4"/>',
    },
    "a motor whose nominal point fills in what its class leaves out": {
        "default": '<dcmotor motorconst="1" resistance="3"/>',
        "actuators": '<dcmotor joint="j" nominal="12 3 20"/>',
    },
    "motors whose damping slows their nominal point": {
        "actuators": '<dcmotor joint="j" nominal="12 3 20" damping="0.02"/>'
        '<dcmotor joint="k" nominal="12 0 20" resistance="2" damping="0.02"/>',
    },
    "motors after a nominal point that a class's damping slows": {
        "default": '<dcmotor nominal="12 3 20" damping="0.05"/>',
        "actuators": '<dcmotor joint="j" damping="0.2"/><dcmotor joint="k" motorconst="0.4"/>',
    },
    "motors after the numbers of a general one": {
        "default": '<general gaintype="dcmotor" gainprm="2 1 0 0 3 0 0.5" dynprm="0"/>',
        "actuators": '<dcmotor joint="j" input="pos"/>'
        '<dcmotor joint="k" nominal="12 3 20" controller="0 0 0"/>',
    },
    "a muscle after the numbers of a general one": {
        "default": '<general gaintype="muscle" gainprm="0.7 1.1 5 200 0.4 1.7 1.4 1.2 1.3" \
dynprm="0.1 0.2"/>',
        "actuators": '<muscle joint="j" lengthrange="-1 1" vmax="2"/>',
    },
    "a fluid on a body of bounds": {
        "compiler": 'boundmass="0.2" boundinertia="0.004"',
        "option": 'density="40" viscosity="0.2"',
        "mass": "",
    },
    "a fluid on a body whose moments are raised": {
        "compiler": 'boundinertia="0.01"',
        "option": 'density="40"',
        "mass": '<inertial pos="0.1 0 0" mass="0.5" \
fullinertia="0.001 0.002 0.0025 0.0001 0.0002 0.0003"/>',
    },
    "a total mass without what is fused into the world": {
        "compiler": 'settotalmass="4" fusestatic="true"',
        "world": f'<body name="d">{BOX}<body>{BOX}</body></body>',
        "joint": 'stiffness="3"',
    },
    "a tendon that no joint changes": {
        "more": '<tendon><spatial name="still" armature="0.1"><site site="t"/>\
<site site="u"/></spatial><spatial name="far"><site site="t"/><site site="s"/>\
<site site="u"/></spatial></tendon>\
<equality><tendon tendon1="still"/></equality>',
        "actuators": '<motor tendon="far"/>',
    },
}


@pytest.mark.sample(8)
@pytest.mark.parametrize("parts", SAME.values(), ids=SAME)
def test_it_moves_as_in_mujoco(parts, tmp_path):
    path = written(tmp_path / "model.xml", **parts)
    assert not load(path).mechanism.caveats
    assert side.apart(load(path).mechanism, path) < 1e-11


@pytest.mark.parametrize("ends", ["joint", "tendon"])
def test_a_polynomial_of_one_number_has_the_slope_one(ends, tmp_path):
    """Of an equality's coefficients those that are left out are MuJoCo's: 0 1 0 0 0."""
    tendons = "".join(
        f'<fixed name="t{name}"><joint joint="{name}" coef="1"/></fixed>' for name in "jk"
    )
    name = "" if ends == "joint" else "t"
    path = written(
        tmp_path / "model.xml",
        more=f"<tendon>{tendons}</tendon><equality>"
        f'<{ends} {ends}1="{name}j" {ends}2="{name}k" polycoef="0.1"/></equality>',
    )
    robot = lw.Robot(load(path).mechanism)
    state = robot.assemble({"k": 0.5})
    assert robot.mobility == 1
    assert float(state["j"]) == pytest.approx(0.1 + (0.5 - 0.2), abs=1e-12)


FREE = '<body name="d" pos="1 0 0"><joint name="f" type="{}"/><geom size="0.1"/></body>'


@pytest.mark.parametrize(
    ("kind", "actuator", "driven"),
    [
        ("free", '<position joint="f" kp="4" dampratio="1"/>', "f.x"),
        ("free", '<position jointinparent="f" kp="4" kv="1" gear="0 0 0 0 1 0"/>', None),
        ("ball", '<motor jointinparent="f" gear="0 1 0" forcerange="-1 1"/>', None),
    ],
)
def test_drives_in_space_are_those_that_runs_take(kind, actuator, driven, tmp_path):
    """A free joint has no length in MuJoCo; turns in space have no drive here."""
    path = written(tmp_path / "model.xml", world=FREE.format(kind), actuators=actuator)
    imported = load(path)
    assert [*imported.mechanism.drives] == ([driven] if driven else [])
    assert all("bias_position" not in law for law in imported.mechanism.drives.values())
    told = any("taken as a plain actuator" in note for note in imported.notes)
    assert told == (driven is None)
    if driven:
        damping = side.compiled(path)[0].actuator_biasprm[0, 2]
        assert imported.mechanism.drives[driven]["bias_rate"] == pytest.approx(damping, rel=1e-12)


def test_a_gear_of_a_freedom_of_an_exported_joint_counts(tmp_path):
    body = '<body><joint name="w.angle" axis="0 0 1"/><joint name="w.slide" type="slide"/>'
    path = written(
        tmp_path / "model.xml",
        world=f"{body}{BOX}</body>",
        actuators='<velocity joint="w.angle" kv="3" gear="2"/>',
    )
    assert load(path).mechanism.drives["w.angle"]["gear"] == 2


BOUNDED = {
    "says delay, which is left out: drives act at once": {
        "actuators": '<position joint="j" kp="2" delay="0.02" nsample="3"/>',
    },
    "it bounds the sum": {
        "joint": 'actuatorfrcrange="-1 1"',
        "actuators": '<motor joint="j"/><velocity joint="j"/>',
    },
    "or what a tendon does": {
        "joint": 'actuatorfrcrange="-1 1"',
        "actuators": '<motor site="t"/>',
    },
    "MuJoCo bounds it": {
        "joint": 'actuatorfrcrange="-1 1" actuatorgravcomp="true"',
        "body": 'gravcomp="0.5"',
        "actuators": '<motor joint="k"/>',
    },
    "and not in MuJoCo, where no actuator acts": {
        "joint": 'actuatorgravcomp="true"',
        "body": 'gravcomp="0.5"',
    },
}


@pytest.mark.parametrize(("told", "parts"), BOUNDED.items(), ids=BOUNDED)
def test_what_no_mechanism_has_is_warned_of(told, parts, tmp_path):
    path = written(tmp_path / "model.xml", **parts)
    assert any(told in caveat for caveat in load(path).mechanism.caveats)
    side.compiled(path)


def test_a_loop_in_a_plane_meets_a_mocap_body_that_a_keyframe_turns(tmp_path):
    """The loop's hinge is across the plane in which it moves, however the body is turned."""
    arm = '<body name="{}" pos="{} 0 0"><joint name="{}"/><geom size="0.05"/>'
    path = tmp_path / "model.xml"
    path.write_text(
        f'<mujoco><worldbody><body name="m" mocap="true" pos="0.6 0 0"/>'
        f"{arm.format('a', 0, 'j')}{arm.format('b', 0.3, 'k')}"
        f"{arm.format('c', 0.3, 'l')}</body></body></body></worldbody>"
        '<equality><connect body1="c" body2="m" anchor="0 0 0"/></equality>'
        '<keyframe><key name="home" qpos="0.4 -0.8 0.3" mpos="0.5 0.05 0" mquat="1 0.7 0.2 0"/>'
        "</keyframe></mujoco>"
    )
    assert lw.Robot(load(path).mechanism).mobility == 1
