"""Attached models are those that MuJoCo's compiler makes: names, poses, settings, and what comes
with them."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load

from tests.formats import mujoco_side as side

LEG = """<mujoco model="leg">
<compiler angle="radian" eulerseq="zyx" boundmass="0.5" meshdir="shapes" {compiler}/>
<default><geom contype="0" conaffinity="0"/><joint damping="0.3" limited="false"/>
 <default class="big"><geom size="0.2"/><general biastype="affine"/></default></default>
<asset><mesh file="tip.obj"/></asset>
<worldbody>
 <body name="out" pos="0 0.1 0"><joint name="jo" axis="1 0 0"/><geom size="0.1"/></body>
 <frame name="fr" pos="0 0 1" childclass="big">
  <body name="a" euler="0.3 0.2 0.1"><joint name="j" axis="0 1 0" stiffness="1" springref="0.2"/>
   <geom name="g" pos="0.1 0 0"/><geom type="mesh" mesh="tip"/>
   <body name="b" pos="1 0 0"><joint name="k"/><geom size="0.01" pos="0.1 0 0"/>
    <site name="s" pos="0.1 0 0"/></body>
  </body>
 </frame>
</worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/><joint joint="k" coef="2"/></fixed>
 <fixed name="to"><joint joint="j" coef="1"/><joint joint="jo" coef="1"/></fixed></tendon>
<actuator><position name="m" joint="j" kp="3"/><motor joint="jo"/><motor tendon="to"/>
 <position tendon="t" kp="2"/><motor site="s" gear="0 0 1 0 0 0"/></actuator>
</mujoco>"""
TRUNK = """<mujoco model="trunk"><compiler angle="degree"/>
<default><geom contype="0" conaffinity="0" density="900"/><joint armature="0.1"/>
 <default class="own"><geom density="10"/></default></default>
<asset><model name="leg" file="parts/leg.xml"/></asset>
<worldbody><body name="base" childclass="own"><joint name="q"/><geom size="0.3" pos="0.1 0 0"/>
 {attached}<body name="z" euler="0 20 0"><joint name="l"/><geom size="0.2" pos="0 0.2 0"/></body>
</body></worldbody>
<actuator><motor joint="q"/>{motor}</actuator>
</mujoco>"""
TIP = "v 0 0 0\nv .3 0 0\nv 0 .2 0\nv 0 0 .4\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ATTACHED = {
    "body": '<frame euler="0 0 30"><attach model="leg" body="a" prefix="p_"/></frame>',
    "frame": '<attach model="leg" frame="fr" prefix="p_"/>',
    "all": '<frame pos="1 0 0"><attach model="leg" prefix="p_"/></frame>',
    "world": '<attach model="leg" body="world" prefix="p_"/>',
    "twice": '<attach model="leg" body="a" prefix="p_"/><attach model="leg" prefix="r/"/>',
    "replicas": '<replicate count="2" euler="0 0 40"><attach model="leg" body="a" prefix="p_"/>'
    "</replicate>",
}


def written(folder, attached, motor="", compiler="", leg=LEG):
    """Write both models and the mesh; return the path of the one that the other is attached to."""
    shapes = folder / "parts" / "shapes"
    shapes.mkdir(parents=True, exist_ok=True)
    (shapes / "tip.obj").write_text(TIP)
    (folder / "parts" / "leg.xml").write_text(leg.format(compiler=compiler))
    path = folder / "trunk.xml"
    path.write_text(TRUNK.format(attached=attached, motor=motor))
    return path


def difference(path):
    """Return the largest difference of accelerations to MuJoCo's compile of the same file, under
    the same controls, over the largest of them."""
    robot = lw.Robot(load(path).mechanism)
    model = mj.MjModel.from_xml_path(str(path))
    data, random, worst = mj.MjData(model), np.random.default_rng(3), 0.0
    names = {model.body(i).name for i in range(1, model.nbody)}
    assert names == {*robot.mechanism.bodies} and model.nu == len(robot.actuators)
    for _ in range(3):
        q = dict(zip(robot.coordinates, random.uniform(-1, 1, len(robot.coordinates)), strict=True))
        w = dict(zip(robot.rates, random.normal(size=len(robot.rates)), strict=True))
        control = random.uniform(-2, 2, model.nu)
        side.set_state(model, data, q, w, control)
        expected = side.accelerations(model, data)
        state, drives = robot.state(q, w), robot.drives
        seen = robot.observe(state)
        u = [
            drives.get(name, lw.control.Ideal()).equations(
                command, seen[name], seen.rate(name), []
            )[0]
            for name, command in zip(robot.actuators, control, strict=True)
        ]
        wanted = np.array([expected[name] for name in robot.independent])
        found = robot.forward_dynamics(state, u)
        worst = max(worst, np.abs(found - wanted).max() / np.abs(wanted).max())
    return worst


@pytest.mark.sample(5)
@pytest.mark.parametrize("name", ATTACHED)
def test_attached_models_move_as_mujocos(name, tmp_path):
    assert difference(written(tmp_path, ATTACHED[name])) < 1e-9


@pytest.mark.parametrize(
    "compiler",
    ['inertiafromgeom="true" settotalmass="7"', 'inertiagrouprange="0 1" boundinertia="0.1"'],
)
def test_masses_are_those_of_its_own_compiler(compiler, tmp_path):
    leg = LEG.replace(
        '<body name="b" pos="1 0 0">', "<body name='b'>" + '<geom group="2" size="1"/>'
    )
    inertial = '<inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/>'
    leg = leg.replace('<joint name="jo" axis="1 0 0"/>', inertial + '<joint name="jo"/>')
    path = written(tmp_path, ATTACHED["all"], compiler=compiler, leg=leg)
    assert difference(path) < 1e-9


def test_ranges_are_limits_as_its_own_compiler_says(tmp_path):
    path = written(tmp_path, ATTACHED["body"])
    joint = '<joint name="{}" range="-2 40"'
    leg = LEG.replace('limited="false"/>', "/>").replace('<joint name="j"', joint.format("j"))
    own = TRUNK.format(attached=ATTACHED["body"], motor="")
    (tmp_path / "parts" / "leg.xml").write_text(leg.format(compiler=""))
    path.write_text(own.replace('<joint name="q"', joint.format("q")))
    joints = load(path).mechanism.joints
    assert joints["p_j"].limits.upper == 40 and np.isclose(joints["q"].limits.upper, np.radians(40))


def test_models_attached_in_one_another_and_referred_to_by_name(tmp_path):
    own = 'eulerseq="xyz" angle="degree"'
    leg = LEG.replace("</body>\n </frame>", '<attach model="toe" prefix="toe_"/></body>\n </frame>')
    leg = leg.replace("<asset>", '<asset><model file="toe.xml"/>')
    tie = '<equality><joint joint1="p_toe_h" joint2="l" polycoef="0 2 0 0 0"/></equality>'
    path = written(tmp_path, ATTACHED["body"], '<motor joint="p_toe_h"/>', leg=leg)
    (tmp_path / "parts" / "toe.xml").write_text(
        f'<mujoco model="toe"><compiler {own}/><default><geom contype="0" conaffinity="0" '
        'density="5"/></default><worldbody><body name="c" euler="20 30 40"><joint name="h"/>'
        '<geom size="0.2" pos="0.1 0 0"/></body></worldbody></mujoco>'
    )
    assert difference(path) < 1e-9
    path.write_text(path.read_text().replace("</worldbody>", f"</worldbody>{tie}"))
    assert "p_toe_h" in load(path).mechanism.joints


@pytest.mark.parametrize("ours", ["true", "false"])
def test_boxes_are_fitted_as_the_model_that_all_is_attached_to_says(ours, tmp_path):
    leg = LEG.replace('type="mesh"', 'type="box"').replace("meshdir", 'fitaabb="true" meshdir')
    path = written(tmp_path, ATTACHED["body"], leg=leg)
    own = f'<compiler fitaabb="{ours}" angle'
    path.write_text(path.read_text().replace("<compiler angle", own))
    assert difference(path) < 1e-6


THROUGH = {
    "by its own name": ('<joint name="jo"/>', ATTACHED["body"]),
    "by the name with the prefix": ('<joint name="p_jo"/><site name="jo"/>', ATTACHED["body"]),
    "through another one": (
        "",
        '<attach model="leg" body="out" prefix="p_"/><attach model="leg" body="a" prefix="p_"/>',
    ),
}


@pytest.mark.parametrize("case", THROUGH)
def test_a_tendon_goes_on_through_what_stands_before(case, tmp_path):
    """As MuJoCo looks for its parts: with the prefix, then, if another one has it, without."""
    joint, attached = THROUGH[case]
    leg = LEG.replace('<fixed name="to">', '<fixed name="to" stiffness="9" springlength="0.3">')
    leg = leg.replace('<asset><mesh file="tip.obj"/></asset>', "")
    leg = leg.replace('<geom type="mesh" mesh="tip"/>', "")
    arm = f'<body name="arm">{joint}<geom size="0.2" pos="0.3 0 0"/></body>' if joint else ""
    path = written(tmp_path, arm + attached, leg=leg)
    assert "p_to" in load(path).mechanism.transmissions
    assert difference(path) < 1e-9


HANGS = '<body name="r"><joint name="r"/><geom size="0.1"/>{}</body>'
COPIED = '<replicate count="2" offset="0 0 1" sep="_">{}</replicate>'
FINGER = '<body name="hand"><attach model="finger" body="f" prefix="p-"/></body>'
BESIDE = {
    "before": FINGER + COPIED.format(HANGS.format("")),
    "behind": COPIED.format(HANGS.format("")) + FINGER,
    "inside": COPIED.format(HANGS.format(FINGER)),
    "twice": COPIED.format(HANGS.format(FINGER.replace("p-", "q-"))) + FINGER,
}


@pytest.mark.parametrize("case", BESIDE)
def test_replicas_and_attached_models_come_in_the_order_of_the_tree(case, tmp_path):
    """Actuators are those of MuJoCo in its order, and a tendon goes on through a copy that stands
    before."""
    (tmp_path / "finger.xml").write_text("""<mujoco model="finger"><worldbody>
<body name="f"><joint name="f"/><geom size="0.1"/></body>
<body name="g"><joint name="r_1"/><geom size="0.1"/></body></worldbody>
<tendon><fixed name="t" stiffness="2"><joint joint="f" coef="1"/><joint joint="r_1" coef="3"/>
</fixed></tendon><actuator><motor joint="f"/><motor joint="r_1"/></actuator></mujoco>""")
    path = tmp_path / "hand.xml"
    path.write_text(f"""<mujoco><asset><model name="finger" file="finger.xml"/></asset>
<worldbody>{BESIDE[case]}</worldbody><actuator><motor joint="r"/></actuator></mujoco>""")
    model, mechanism = mj.MjModel.from_xml_path(str(path)), load(path).mechanism
    joints = [model.joint(number).name for number in range(model.njnt)]
    assert list(mechanism.actuators) == [joints[number] for number in model.actuator_trnid[:, 0]]
    lines = [tuple(line.ratios) for line in mechanism.transmissions.values()]
    assert lines == [("p-f", "r_1")] * model.ntendon
    assert model.ntendon == (case in ("behind", "twice"))


def test_what_is_not_attached_is_noted(tmp_path):
    leg = LEG.replace("<asset>", '<option gravity="0 0 -1"/><asset>')
    leg = leg.replace("</mujoco>", '<keyframe><key name="home" qpos="0 0 0"/></keyframe></mujoco>')
    path = written(tmp_path, ATTACHED["body"], leg=leg)
    imported = load(path)
    for remark in (
        "<fixed 'to'> is left out, as MuJoCo does: not all",
        "<option> is left out: the",
    ):
        assert any(remark in note for note in imported.notes)
    assert any("keyframes of attached models are not read" in note for note in imported.notes)
    assert not imported.mechanism.caveats and imported.mechanism.gravity[2] == -9.81


MERGED = {
    "": "",
    'density="3"': 'wind="1 2 3" density="3.0"',
    'gravity="0 0 -2"': 'timestep="0.001" viscosity="2" gravity="0 0 -2"',
    '><flag gravity="enable"/></option><option': '><flag gravity="disable"/></option><option',
    'wind="0 1 0"': 'wind="0 1 1"',
    'density="0"': 'density="1"',
}


@pytest.mark.parametrize("mode", ["warning", "merge", "error"])
@pytest.mark.parametrize("own", MERGED)
@pytest.mark.parametrize("middle", [False, True])
def test_options_of_attached_models_are_taken_over_as_by_mujoco(tmp_path, own, mode, middle):
    """Of the model itself, and through one between."""

    def model(name, options, child, mode):
        asset = f'<asset><model name="m" file="{child}.xml"/></asset>' if child else ""
        attach = '<attach model="m" body="b" prefix="p_"/>' if child else ""
        (tmp_path / f"{name}.xml").write_text(
            f'<mujoco model="{name}"><compiler conflict="{mode}"/><option {options}/>{asset}'
            f'<worldbody><body name="b"><joint/><geom size="1"/>{attach}</body></worldbody>'
            "</mujoco>"
        )

    model("child", MERGED[own], None, "warning")
    model("between", "", "child", "merge")
    model("main", own, "between" if middle else "child", mode)
    path = tmp_path / "main.xml"
    try:
        option = mj.MjModel.from_xml_path(str(path)).opt
    except ValueError:
        with pytest.raises(lw.MechanismError, match="give both the same, or one of them none"):
            load(path)
        return
    found = load(path).mechanism
    none = option.disableflags & mj.mjtDisableBit.mjDSBL_GRAVITY
    assert found.gravity == pytest.approx((0, 0, 0) if none else option.gravity)
    assert found.fluid.wind == pytest.approx(option.wind)
    assert (found.fluid.density, found.fluid.viscosity) == (option.density, option.viscosity)


def test_models_that_want_different_options_are_refused_as_by_mujoco(tmp_path):
    for name, wind in (("one", "0 1 0"), ("two", "0 2 0")):
        (tmp_path / f"{name}.xml").write_text(
            f'<mujoco><option wind="{wind}"/><worldbody><body name="b"><joint/><geom size="1"/>'
            "</body></worldbody></mujoco>"
        )
    path = tmp_path / "main.xml"
    path.write_text("""<mujoco><compiler conflict="merge"/>
<asset><model name="m" file="one.xml"/><model name="n" file="two.xml"/></asset>
<worldbody><attach model="m" body="b" prefix="p_"/><attach model="n" body="b" prefix="q_"/>
</worldbody></mujoco>""")
    with pytest.raises(ValueError, match="Attach conflict"):
        mj.MjModel.from_xml_path(str(path))
    with pytest.raises(lw.MechanismError, match=r"two.xml: line 1: <option>: wind is another one"):
        load(path)


def test_files_outside_stated_folders_are_left_out_with_a_warning(tmp_path):
    written(tmp_path, ATTACHED["body"])
    path = tmp_path / "parts" / "deeper" / "trunk.xml"
    path.parent.mkdir()
    path.write_text(
        TRUNK.format(attached=ATTACHED["body"], motor="").replace("parts/leg", "../leg")
    )
    caveats = load(path).mechanism.caveats
    assert any("<model 'leg'> is not read: file '../leg.xml' lies outside" in c for c in caveats)
    assert any("<attach> is left out" in caveat for caveat in caveats)
    assert "p_a" in load(path, includes=tmp_path / "parts").mechanism.bodies


@pytest.mark.parametrize(
    ("attached", "sentence"),
    [
        ('<attach model="arm" prefix="p_"/>', "there is no model 'arm' among the assets"),
        ('<attach model="leg" body="x" prefix="p_"/>', "there is no body 'x' in that model"),
        ('<attach model="leg" frame="a" prefix="p_"/>', "there is no frame 'a' in that model"),
        ('<attach model="leg" body="a" frame="fr" prefix="p_"/>', "a body and a frame; keep one"),
        ('<attach model="leg"/>', "has no attribute 'prefix'"),
        ('<attach model="leg" body="a" prefix="p"/>' * 2, "has the name of another body"),
    ],
)
def test_attachments_that_are_refused(attached, sentence, tmp_path):
    with pytest.raises(lw.MechanismError, match=sentence):
        load(written(tmp_path, attached))


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('file="tip.obj"/>', 'file="tip.obj"/><model file="leg.xml"/>', "is attached to itself"),
        (
            'file="tip.obj"/>',
            'file="tip.obj"/><model file="no.xml"/>',
            "line 5: .*no.xml: cannot be read",
        ),
        ('childclass="big"', 'childclass="huge"', "there is no default class 'huge'"),
        ("mujoco", "robot", "is no MJCF model"),
    ],
)
def test_models_that_are_refused(old, new, sentence, tmp_path):
    with pytest.raises(lw.MechanismError, match=sentence):
        load(written(tmp_path, ATTACHED["body"], leg=LEG.replace(old, new)))


def test_actuators_that_an_option_switches_off_are_told(tmp_path):
    off = '<option actuatorgroupdisable="1 3"/>'
    leg = LEG.replace("<asset>", f"{off}<asset>").replace('kp="3"', 'kp="3" group="3"')
    path = written(tmp_path, ATTACHED["body"], leg=leg)
    said = "<option> switches off actuators of some groups, which is left out: take these out"
    alone = path.parent / "parts" / "leg.xml"
    assert any(said in caveat for caveat in load(alone).mechanism.caveats)
    assert not load(path).mechanism.caveats
    text = path.read_text()
    path.write_text(text.replace("<compiler", '<compiler conflict="merge"'))
    assert any(said in caveat for caveat in load(path).mechanism.caveats)
    alone.write_text(alone.read_text().replace("1 3", "1 2"))
    assert not load(path).mechanism.caveats
    alone.write_text(alone.read_text().replace("1 2", "one"))
    with pytest.raises(lw.MechanismError, match="actuatorgroupdisable"):
        load(alone)
