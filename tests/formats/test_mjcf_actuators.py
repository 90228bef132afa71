"""Actuators and tendons of joints: under the same controls the file moves as MuJoCo has it move."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, save

from tests.formats import mujoco_side as side

ARM = """<mujoco>
<compiler angle="radian"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody>
 <body name="a" pos="0 0 1">
  <joint name="j1" axis="0 1 0" damping="0.1" range="-2 2" {joint}/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0.5 0 0"/>
  <site name="s" pos="0.2 0.1 0" euler="0.1 0.2 0.3"/>
  <body name="b" pos="0.5 0 0">
   <joint name="j2" axis="0 1 0.3" ref="0.2" armature="0.01"/>
   <geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0.1"/>
   <body name="c" pos="0.4 0 0.1">
    <joint name="j3" type="slide" axis="0.3 0 1"/><geom type="box" size="0.05 0.06 0.07"/>
   </body>
   <body name="d" pos="0.4 0 0.1">
    <joint name="j4" axis="1 0 1"/><geom type="box" size="0.05 0.06 0.07" pos="0.1 0 0"/>
   </body>
  </body>
 </body>
</worldbody>
<tendon>
 <fixed name="split" stiffness="30" damping="0.7" springlength="0.05 0.2" armature="0.03">
  <joint joint="j1" coef="0.5"/><joint joint="j2" coef="-0.8"/>
 </fixed>
 <fixed name="plain" stiffness="11">
  <joint joint="j3" coef="1.5"/><joint joint="j4" coef="0.2"/>
 </fixed>
</tendon>
<actuator>{actuators}</actuator>
</mujoco>"""
ACTUATORS = """
<motor name="m1" joint="j1" gear="2.5" ctrlrange="-1 1"/>
<position name="p2" joint="j2" kp="20" kv="1.5" ctrlrange="-1 1" forcerange="-5 5" gear="1.2"/>
<velocity name="v2" joint="j2" kv="2" forcerange="-4 4"/>
<general name="t" tendon="split" gaintype="affine" gainprm="3 0.5 0.1" biastype="affine"
 biasprm="0.3 -5 -0.2" gear="1.7" forcerange="-6 6"/>
<position name="dr" joint="j4" kp="7" dampratio="0.9"/>
<damper name="da" joint="j3" kv="3" ctrlrange="0 2"/>
<motor name="th" site="s" gear="0.3 0.2 1 0.1 0 0.4"/>
<position name="tl" tendon="plain" kp="9" dampratio="1.1" gear="0.7"/>
<cylinder name="cy" joint="j3" timeconst="0.3" area="2" bias="0.1 -3 -0.2"/>
<intvelocity name="iv" joint="j4" kp="5" actrange="-0.5 0.5"/>
<position name="lag" joint="j1" kp="4" timeconst="0.2"/>"""


HELD = '<equality><tendon tendon1="plain"/></equality>'


def compared(path, tmp_path, seed=1, mechanism=None):
    """Return the largest difference of accelerations under the same controls, over the largest of
    them, at some states; mechanism: in place of what the file is read as."""
    robot = lw.Robot(mechanism or load(path).mechanism)
    model, data = side.compiled(path)
    random, drives, worst = np.random.default_rng(seed), robot.drives, 0.0
    for _ in range(3):
        q = dict(zip(robot.coordinates, random.uniform(-1, 1, len(robot.coordinates)), strict=True))
        w = dict(zip(robot.rates, random.normal(size=len(robot.rates)), strict=True))
        control, activation = random.uniform(-2, 2, model.nu), random.uniform(-0.5, 0.5, model.na)
        data.act[:] = activation
        side.set_state(model, data, q, w, control)
        expected = side.accelerations(model, data)
        state, z = robot.state(q, w), iter(activation)
        seen, u = robot.observe(state), []
        for name, command in zip(robot.actuators, control, strict=True):
            drive = drives.get(name, lw.control.Ideal())
            own = [next(z) for _ in drive.extras]
            u.append(drive.equations(command, seen[name], seen.rate(name), own)[0])
        found = robot.forward_dynamics(state, u)
        wanted = np.array([expected[name] for name in robot.independent])
        worst = max(worst, np.abs(found - wanted).max() / np.abs(wanted).max())
    return worst


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(joint="", actuators=ACTUATORS))
    return path


def test_controls_do_what_they_do_in_mujoco(arm, tmp_path):
    imported = load(arm)
    expected = ("j1", "j2", "v2", "split", "j4", "j3", "th", "plain", "cy", "iv", "lag")
    assert imported.mechanism.actuators == expected
    assert not imported.mechanism.caveats
    assert compared(arm, tmp_path) < 1e-12


def test_what_is_written_moves_as_what_was_read(arm, tmp_path):
    path = tmp_path / "again.xml"
    save(load(arm).mechanism, path)
    assert compared(path, tmp_path) < 1e-12


def test_actuators_add_inertia_and_damping_as_in_mujoco(arm, tmp_path):
    """Those of joints, of a tendon, and in the gain by a damping ratio."""
    text = arm.read_text()
    for name, own in (("m1", 0.03), ("t", 0.2), ("dr", 0.01)):
        added = f'armature="{own}" damping="{3 * own}"'
        text = text.replace(f'name="{name}"', f'name="{name}" {added}')
    arm.write_text(text)
    assert not load(arm).mechanism.caveats
    assert compared(arm, tmp_path) < 1e-12
    elsewhere = '<actuator><motor site="s" gear="1 0 0 0 0 0" armature="0.2"/>'
    arm.write_text(text.replace("<actuator>", elsewhere))
    (caveat,) = load(arm).mechanism.caveats
    assert "has an armature or a damping, which is left out: it acts on no single" in caveat


def test_a_tendon_that_is_held_never_comes_to_the_end_of_its_range(tmp_path):
    path = tmp_path / "arm.xml"
    text = ARM.format(joint="", actuators='<motor joint="j1"/>')
    text = text.replace('name="plain"', 'name="plain" range="0 1"')
    path.write_text(text)
    assert load(path).mechanism.transmissions["plain"].stop
    path.write_text(text.replace("<actuator>", HELD + "<actuator>"))
    mechanism = load(path).mechanism
    assert not mechanism.caveats and mechanism.transmissions["plain_2"].stop is None
    robot = lw.Robot(mechanism)
    assert robot.simulate(robot.home, duration=0.1).success


def test_a_joint_bounds_what_its_one_actuator_does(tmp_path):
    path = tmp_path / "arm.xml"
    motor = '<position joint="j1" kp="20" gear="-1.5" forcerange="-9 4"/>'
    path.write_text(ARM.format(joint='actuatorfrcrange="-3 2"', actuators=motor))
    law = load(path).mechanism.drives["j1"]
    assert (law["least_force"], law["largest_force"]) == pytest.approx((-2 / 1.5, 2))
    assert compared(path, tmp_path) < 1e-12


def test_ranges_whose_ends_are_not_in_order_are_none(tmp_path):
    """Where nothing else says that they hold, as MuJoCo takes them; `auto` is the same word."""
    path = tmp_path / "arm.xml"
    none = 'ctrlrange="0 0" ctrllimited="auto" forcerange="1 -1"'
    drives = f"""<motor joint="j1" {none}/><position joint="j2" kp="20" {none}/>
<general joint="j3" dyntype="filter" dynprm="0.1" actrange="1 1" actlimited="auto"/>"""
    text = ARM.format(joint='actuatorfrcrange="0 0"', actuators=drives)
    text = text.replace('range="-2 2"', 'range="0 0"').replace('stiffness="11"', 'range="2 1"')
    path.write_text(text)
    mechanism = load(path).mechanism
    assert not mechanism.joints["j1"].limits.bounded
    told = [caveat for caveat in mechanism.caveats if "says forcerange '1 -1': no limit" in caveat]
    assert len(told) == len(mechanism.caveats) == 2  # of the motor and of the position
    assert mechanism.drives["j3"]["type"] == "lagging_servo"
    assert compared(path, tmp_path) < 1e-12


def test_a_tendon_that_follows_another_is_a_gear(tmp_path):
    path = tmp_path / "arm.xml"
    text = ARM.format(joint="", actuators='<motor joint="j1"/>')
    held = '<equality><tendon tendon1="split" tendon2="plain" polycoef="0.1 2"/></equality>'
    path.write_text(text.replace("<actuator>", f"{held}<actuator>"))
    gear = load(path).mechanism.joints["split_plain"]
    assert gear.ratios == pytest.approx({"j1": 0.5, "j2": -0.8, "j3": -3.0, "j4": -0.4})
    assert gear.offset == pytest.approx(0.1 - 0.8 * 0.2)


def test_a_run_is_led_by_the_files_own_servos(tmp_path):
    """The energy balance closes with the work of servos, dampers and slack springs."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(joint="", actuators=ACTUATORS))
    robot = lw.Robot(load(path).mechanism)
    control = np.full(len(robot.actuators), 0.3)
    run = robot.simulate(robot.home, control, duration=0.3, drives=robot.drives, rtol=1e-11)
    assert run.success
    assert np.abs(run["energy_balance"]).max() < 1e-8 * np.abs(run["work"]).max()
    model, data = side.compiled(path)
    model.opt.timestep, model.opt.integrator = 1e-4, mj.mjtIntegrator.mjINT_RK4
    data.ctrl[:] = 0.3
    while data.time < 0.3 - 1e-9:
        mj.mj_step(model, data)
    own = dict(zip(robot.coordinates, run["joint_position"].values[-1], strict=True))
    assert data.qpos == pytest.approx([own[f"j{k}"] for k in (1, 2, 3, 4)], abs=1e-5)


@pytest.mark.parametrize(("control", "shown"), [(0.3, 0.12), (-0.4, -0.05), (0.08, 0.08)])
def test_a_lag_stays_within_the_range_of_its_activation(tmp_path, control, shown):
    """MuJoCo bounds it at the ends of steps: its errors of first order are extrapolated."""
    path = tmp_path / "arm.xml"
    lag = 'dyntype="filter" dynprm="0.02" actlimited="true" actrange="-0.05 0.12"'
    path.write_text(ARM.format(joint="", actuators=f'<general joint="j3" gainprm="7" {lag}/>'))
    robot = lw.Robot(load(path).mechanism)
    run = robot.simulate(robot.home, [control], duration=0.4, drives=robot.drives, rtol=1e-10)
    assert run["actuator_force"].values[-1] == pytest.approx([7 * shown], abs=1e-6)
    ends = []
    for step in (2e-4, 1e-4):
        model, data = side.compiled(path)
        model.opt.timestep, model.opt.integrator = step, mj.mjtIntegrator.mjINT_RK4
        data.ctrl[:] = control
        while data.time < 0.4 - 1e-9:
            mj.mj_step(model, data)
        ends.append(data.qpos.copy())
    own = dict(zip(robot.coordinates, run["joint_position"].values[-1], strict=True))
    expected = [own[f"j{k}"] for k in (1, 2, 3, 4)]
    assert 2 * ends[1] - ends[0] == pytest.approx(expected, abs=2e-5)


def test_a_tendon_bounds_what_its_one_actuator_does(tmp_path):
    path = tmp_path / "arm.xml"
    motor = '<position tendon="split" kp="20" gear="2"/>'
    text = ARM.format(joint='actuatorfrcrange="-3 2"', actuators=motor)
    path.write_text(text.replace('name="split"', 'name="split" actuatorfrcrange="-0.5 1"'))
    with_both = load(path)
    (note,) = (note for note in with_both.notes if "actuatorfrcrange" in note)
    assert "<joint 'j1'> says actuatorfrcrange, which is left out" in note
    law = with_both.mechanism.drives["split"]
    assert (law["least_force"], law["largest_force"]) == (-0.5, 1)
    path.write_text(path.read_text().replace('actuatorfrcrange="-3 2"', ""))
    assert compared(path, tmp_path) < 1e-12


MOTORS = """
<pid name="p" joint="j1" kp="4" kv="0.7" input="pos" posrange="-1 1"/>
<pid name="v" joint="j2" kp="3" dampratio="0.8" input="vel" gear="1.3"/>
<dcmotor name="e" joint="j4" motorconst="0.5 0.4" resistance="0.8" gear="3" ctrlrange="-2 2"
 saturation="-1 0 0"/>
<dcmotor name="n" joint="j3" nominal="12 3 100" saturation="0 2 0"/>
<dcmotor name="k" tendon="plain" motorconst="0.3" resistance="2" input="pos" controller="5 0 1"/>
<dcmotor name="m" tendon="split" motorconst="0.3" nominal="6 2 30" saturation="0.1"/>
"""


def test_motors_and_controllers_are_servos(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(joint="", actuators=MOTORS))
    assert not load(path).mechanism.caveats
    assert compared(path, tmp_path) < 1e-12


def test_a_motor_whose_current_lags_is_a_dc_motor(tmp_path):
    """The force is that of MuJoCo as its time step, by which it goes ahead, goes to zero."""
    path = tmp_path / "arm.xml"
    motor = '<dcmotor joint="j1" motorconst="0.5" resistance="0.8" inductance="0 0.02" gear="3"/>'
    path.write_text(ARM.format(joint="", actuators=motor))
    robot = lw.Robot(load(path).mechanism)
    drive, (model, data) = robot.drives["j1"], side.compiled(path)
    model.opt.timestep = 1e-9
    data.qvel[0], data.ctrl[:], data.act[:] = 0.4, 5.0, 1.5
    mj.mj_forward(model, data)
    force, (change,) = drive.equations(5.0, 0.0, 0.4, (1.5,))
    assert data.qfrc_actuator[0] == pytest.approx(force, rel=1e-6)
    assert data.act_dot[0] == pytest.approx(change, rel=1e-6)


@pytest.mark.parametrize(
    ("actuator", "told"),
    [
        ('<pid joint="j1" kp="3" ki="2"/>', "for no drive here has its ki"),
        ('<pid joint="j1" kp="3" slewmax="2"/>', "for no drive here has its slewmax"),
        ('<pid joint="j1" kp="3"/>', "has the inputs vel, which stay zero here"),
        ('<dcmotor joint="j1" motorconst="1" resistance="1" cogging="1 2 0"/>', "its cogging"),
        ('<dcmotor joint="j1" motorconst="1" resistance="1" thermal="1 2 0 1 1 1"/>', "thermal"),
        ('<dcmotor joint="j1" motorconst="1" resistance="1" lugre="1 2 3 4 5"/>', "its lugre"),
        (
            '<dcmotor joint="j1" motorconst="1" resistance="1" inductance="1" saturation="1"/>',
            "its bounds of voltage or torque",
        ),
        (
            '<dcmotor joint="j1" motorconst="1" resistance="1" input="pos" controller="1 1"/>',
            "its controller",
        ),
        ('<adhesion body="a" ctrlrange="0 1"/>', "pulls at the contacts of a body"),
        ('<orientation joint="j1" kp="3"/>', "acts on three rates at once"),
    ],
)
def test_what_a_motor_has_beyond_drives_is_named(actuator, told, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(joint="", actuators=actuator))
    assert any(told in note for note in load(path).notes)


@pytest.mark.parametrize(
    ("numbers", "told"),
    [
        ("", "no motor constant above 0"),
        ('motorconst="-0.1" resistance="2"', "no motor constant above 0"),
        ('nominal="12 0.1"', "no motor constant above 0"),
        ('motorconst="0.1"', "no resistance above 0"),
        ('motorconst="0.1" resistance="-1"', "no resistance above 0"),
        ('motorconst="0.1" resistance="1" inductance="-1"', "an inductance below 0"),
    ],
)
def test_a_motor_without_its_constants_is_refused_as_by_mujoco(numbers, told, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(joint="", actuators=f'<dcmotor joint="j1" {numbers}/>'))
    with pytest.raises(ValueError, match="DC motor"):
        mj.MjModel.from_xml_path(str(path))
    with pytest.raises(lw.MechanismError, match=f"line .*: <dcmotor.*: has {told}"):
        load(path)
