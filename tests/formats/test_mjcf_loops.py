"""Equality constraints and tendons as the joints that they are; the loops move as MuJoCo's soft
ones do, but exactly."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, save
from linkwork.mechanism import MechanismError

from tests.formats import samples
from tests.formats.mujoco_side import accelerations, compiled, set_state
from tests.model_collections import MuJoCoSide, acceleration

SOFT = 1e-4
"""Of MuJoCo's estimate of the inverse inertia; the error of its accelerations is in proportion."""
ANCHOR = '<connect name="pin" body1="coupler" body2="rocker" anchor="0.3 0.3 {z}"/>'


def read(text, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(text, encoding="utf-8")
    return load(path)


def kinds(mechanism):
    return {name: joint.type for name, joint in mechanism.joints.items()}


def assert_same_accelerations(mechanism, text, bound=1e-5, rates=True):
    """Compare at qpos0 with random rates and forces."""
    rng = np.random.default_rng(3)
    robot, (model, data) = lw.Robot(mechanism), compiled(text, SOFT)
    model.opt.tolerance, model.opt.iterations = 1e-14, 200
    model.eq_solimp[:, :2] = 0.9999
    state = robot.home.with_rates(rng.normal(size=robot.mobility) * rates)
    forces = rng.normal(size=len(mechanism.actuators))
    values = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    set_state(
        model, data, values, dict(zip(robot.rates, robot.joint_rates(state), strict=True)), forces
    )
    ours = dict(
        zip(
            robot.rates,
            robot.joint_accelerations(state, robot.forward_dynamics(state, forces)),
            strict=True,
        )
    )
    theirs = accelerations(model, data)
    scale = max(map(abs, ours.values()))
    for name, value in theirs.items():
        assert ours[name] == pytest.approx(value, abs=bound * (1 + scale)), name


def test_two_connects_are_a_revolute_joint(tmp_path):
    text = samples.FOUR_BAR.format(
        equality=ANCHOR.format(z=-0.1) + ANCHOR.format(z=0.3).replace("pin", "pin2")
    )
    imported = read(text, tmp_path)
    assert kinds(imported.mechanism)["pin"] == "revolute"
    assert imported.notes == ()
    pin = imported.mechanism.joints["pin"]
    assert pin.connects == ("coupler", "rocker")
    assert pin.frames[0].position == pytest.approx((0.3, 0.3, 0.1))
    assert lw.Robot(imported.mechanism).mobility == 1
    assert_same_accelerations(imported.mechanism, text)


def test_one_connect_in_a_planar_loop_is_a_revolute_joint_and_said_to_be(tmp_path):
    text = samples.FOUR_BAR.format(equality=ANCHOR.format(z=0))
    imported = read(text, tmp_path)
    assert kinds(imported.mechanism)["pin"] == "revolute"
    assert "<connect 'pin'> closes a loop that moves in a plane" in imported.notes[0]
    assert_same_accelerations(imported.mechanism, text)


BASE = '<body name="base">{}<inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>'


@pytest.mark.parametrize("carrier", ["", '<joint name="tilt" axis="1 0 0"/>'])
def test_points_that_are_apart_across_the_plane_are_on_one_axis(carrier, tmp_path):
    """As of legs from drawings, whose sites lie in the two links' own planes."""
    text = samples.FOUR_BAR.format(equality='<connect name="pin" site1="a" site2="b"/>')
    text = text.replace('name="elbow"/>', 'name="elbow"/><site name="a" pos="0.3 0.3 0.1"/>')
    text = text.replace("<worldbody>", f"<worldbody>{BASE.format(carrier)}")
    text = text.replace("</worldbody>", "</body></worldbody>")
    robots, warned = [], []
    for z in (0.1, 0.102):
        site = f'<site name="b" pos="0.3 0 {z}"/>'
        apart = text.replace('<joint name="pivot"', f'{site}<joint name="pivot"')
        imported = read(apart, tmp_path)
        warned += [any("turn what carries the loop" in c for c in imported.mechanism.caveats)]
        robots.append(lw.Robot(imported.mechanism))
        if not carrier:
            assert_same_accelerations(imported.mechanism, apart)
    assert warned == [False, bool(carrier)] and robots[1].mobility == 1 + bool(carrier)
    assert "on one axis with both points" in imported.notes[0]
    rates = [0.7, -1.2][: robots[0].mobility]
    a, b = (robot.forward_dynamics(robot.home.with_rates(rates), [0.3]) for robot in robots)
    np.testing.assert_allclose(a, b, rtol=1e-11)


def test_one_connect_in_a_loop_that_is_not_planar_is_a_spherical_joint(tmp_path):
    connect = '<connect name="socket" body1="rod" body2="slider" anchor="0.3 0.1 0.05"/>'
    text = samples.SPATIAL.format(more="", equality=connect)
    mechanism = read(text, tmp_path).mechanism
    assert kinds(mechanism)["socket"] == "spherical"
    assert mechanism.reference == {"rail": 0.1}
    assert_same_accelerations(mechanism, text)


def test_a_connect_between_sites_meets_where_they_are(tmp_path):
    near = '<site name="end" pos="0.35 0.2 0.05"/>'
    text = samples.SPATIAL.format(more="", equality='<connect site1="end" site2="seat"/>')
    text = text.replace(
        '<joint name="ball" type="ball"/>', f'<joint name="ball" type="ball"/>{near}'
    )
    mechanism = read(text, tmp_path).mechanism
    joint = mechanism.joints["loop_rod_slider"]
    assert joint.type == "spherical"
    assert [frame.position for frame in joint.frames] == [(0.35, 0.2, 0.05), (0.01, 0.0, 0.0)]
    assert mechanism.tools == {}


def test_three_connects_are_a_fixed_joint_and_so_is_a_weld(tmp_path):
    points = ("0.1 0 0", "0 0.2 0", "0 0 0.3")
    connects = "".join(f'<connect body1="rod" body2="disc" anchor="{point}"/>' for point in points)
    weld = '<weld name="w" body1="rod" body2="disc"/>'
    seen = []
    for equality in (connects, weld):
        mechanism = read(samples.SPATIAL.format(more="", equality=equality), tmp_path).mechanism
        assert "fixed" in kinds(mechanism).values()
        robot = lw.Robot(mechanism)
        (p, R), (q, S) = (robot.body_poses(robot.home)[body] for body in ("disc", "rod"))
        seen.append((R.T @ (q - p), R.T @ S))
    np.testing.assert_allclose(seen[0][0], seen[1][0], atol=1e-12)
    np.testing.assert_allclose(seen[0][1], seen[1][1], atol=1e-12)


@pytest.mark.parametrize(
    "weld",
    [
        'body1="disc" body2="slider"',
        'body1="disc" body2="slider" anchor="0.1 0.2 0.3"',
        'body1="disc" body2="slider" relpose="0.4 0.3 0.1 0.9 0 0.1 0.2"',
        'body1="disc" body2="slider" relpose="0.4 0.3 0.1 0.9 0 0.1 0.2" anchor="0.1 0 0.2"',
        'body1="slider"',
        'site1="hub" site2="seat"',
    ],
)
def test_welds_hold_where_mujoco_has_no_gap(weld, tmp_path):
    """At the poses that the fixed joint demands, MuJoCo sees no gap."""
    text = samples.SPATIAL.format(more="", equality=f'<weld name="w" {weld}/>')
    text = text.replace(
        '<joint name="spin"', '<site name="hub" pos="0.1 0 0" euler="0 5 0"/><joint name="spin"'
    )
    text = text.replace('<joint name="rail" type="slide" axis="1 0.2 0" ref="0.1"/>', "").replace(
        '<joint name="roll" type="hinge" axis="1 0.2 0"/>', '<freejoint name="loose"/>'
    )
    mechanism = read(text, tmp_path).mechanism
    assert kinds(mechanism)["w"] == "fixed"
    robot, (model, data) = lw.Robot(mechanism), compiled(text)
    assert robot.mobility == (3 if weld == 'body1="slider"' else 4) + (weld == 'body1="slider"')
    values = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    set_state(model, data, values, dict.fromkeys(robot.rates, 0.0))
    assert data.nefc == 6
    np.testing.assert_allclose(data.efc_pos, 0, atol=1e-9)


def test_a_weld_without_torque_is_a_connect(tmp_path):
    equality = '<weld name="w" body1="rod" body2="slider" torquescale="0" anchor="0 0 0"/>'
    assert (
        kinds(read(samples.SPATIAL.format(more="", equality=equality), tmp_path).mechanism)["w"]
        == "spherical"
    )


@pytest.mark.parametrize(
    ("one", "two", "offset"), [("rail", "spin", 0.12), ("spin", "rail", -0.01)]
)
def test_a_linear_joint_equality_is_a_gear(one, two, offset, tmp_path):
    equality = f'<joint name="g" joint1="{one}" joint2="{two}" polycoef="0.02 0.3 0 0 0"/>'
    text = samples.SPATIAL.format(more="", equality=equality)
    mechanism = read(text, tmp_path).mechanism
    gear = mechanism.joints["g"]
    assert gear.ratios == {one: 1.0, two: -0.3}
    assert gear.offset == pytest.approx(offset)
    robot, (model, data) = lw.Robot(mechanism), compiled(text)
    values = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    set_state(model, data, values, dict.fromkeys(robot.rates, 0.0))
    np.testing.assert_allclose(data.efc_pos, 0, atol=1e-10)
    assert_same_accelerations(mechanism.model_copy(update={"reference": values}), text)


CURVES = {
    "joint": '<joint name="g" joint1="{0}" joint2="{1}" polycoef="0.01 0.3 -0.4 0.5 0.2"/>',
    "tendons": '<tendon name="g" tendon1="t" tendon2="u" polycoef="0.01 0.3 -0.4 0.5 0.2"/>',
}
OF_JOINTS = (
    '<tendon><fixed name="t"><joint joint="rail" coef="2"/><joint joint="roll" coef="-0.5"/>'
    '</fixed><fixed name="u"><joint joint="spin" coef="0.7"/></fixed></tendon>'
)


@pytest.mark.parametrize(
    "curve", [("joint", "rail", "spin"), ("joint", "spin", "rail"), ("tendons",)]
)
def test_a_polynomial_equality_is_a_gear_with_powers(curve, tmp_path):
    """Read, and written again, it moves as exact constraints with MuJoCo's own rows say, whose
    derivative is that of differences."""
    equality = CURVES[curve[0]].format(*curve[1:])
    text = samples.SPATIAL.format(more=OF_JOINTS, equality=equality)
    imported = read(text, tmp_path)
    assert not imported.mechanism.caveats
    assert imported.mechanism.joints["g"].powers
    robot = lw.Robot(imported.mechanism)
    notes = save(imported.mechanism, tmp_path / "again.xml")
    assert any("g: gears with powers are exact at rest only" in note for note in notes)
    state = robot.home.with_rates(np.random.default_rng(3).normal(size=robot.mobility))
    unforced = np.zeros(len(robot.actuators))
    a = robot.joint_accelerations(state, robot.forward_dynamics(state, unforced))
    found = dict(zip(robot.rates, a, strict=True))
    values = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    for name in ("model.xml", "again.xml"):
        side = MuJoCoSide(tmp_path / name)
        set_state(side.model, side.data, values, rates)
        np.testing.assert_allclose(side.data.efc_pos, 0, atol=1e-10)
        q, v = side.data.qpos.copy(), side.data.qvel.copy()
        side.data.qacc[:] = acceleration(side, q, v, robot.mobility)
        side.data.qpos[:] = q
        for label, wanted in accelerations(side.model, side.data).items():
            assert found[label] == pytest.approx(wanted, abs=1e-8)


def test_what_a_gear_with_powers_cannot_hold_is_told(tmp_path):
    """MJCF ends at the fourth power."""
    fifth = lw.GearJoint(ratios={"rail": 1, "roll": 0}, powers={"roll": (0, 0, 0, 0.1)})
    free = read(samples.SPATIAL.format(more="", equality=""), tmp_path).mechanism
    geared = free.model_copy(update={"joints": {**free.joints, "g": fifth}})
    with pytest.raises(MechanismError, match=r"up to the power 4; write \.yaml"):
        save(geared, tmp_path / "again.xml")


def test_a_joint_equality_of_one_joint_locks_it(tmp_path):
    text = samples.SPATIAL.format(more="", equality='<joint joint1="roll" polycoef="0.25"/>')
    mechanism = read(text, tmp_path).mechanism
    robot = lw.Robot(mechanism)
    assert (
        robot.mobility
        == lw.Robot(read(samples.SPATIAL.format(more="", equality=""), tmp_path).mechanism).mobility
        - 1
    )
    assert robot.home["roll"] == pytest.approx(0.25)


def test_a_locked_screw_is_advanced_as_far_as_it_is_turned(tmp_path):
    nut, lock = (
        lw.ScrewJoint(connects=("ground", "nut"), pitch=0.1),
        '<joint joint1="nut" polycoef="0.5"/>',
    )
    arm = lw.RevoluteJoint(connects=("nut", "arm"), axis=(1.0, 0.0, 0.0))
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=1.0, yy=1.0, zz=1.0))
    free = lw.Mechanism(
        name="vice", bodies={"nut": body, "arm": body}, joints={"nut": nut, "arm": arm}
    )
    lw.formats.save(free, tmp_path / "free.xml")
    text = (tmp_path / "free.xml").read_text().replace("</equality>", lock + "</equality>")
    robot = lw.Robot(read(text, tmp_path).mechanism)
    assert robot.home["nut"] == pytest.approx(0.5)
    assert robot.body_poses(robot.home)["nut"][0] == pytest.approx([0.0, 0.0, 0.05])


STRAIGHT = (
    '<tendon><spatial name="cable" {0}><site site="hub"/><site site="seat"/></spatial></tendon>'
)


def with_hub(text):
    return text.replace(
        '<joint name="spin"', '<site name="hub" pos="0.1 0 0.1"/><joint name="spin"'
    )


def test_a_tendon_held_at_its_length_is_a_rod(tmp_path):
    equality = '<tendon name="rod_1" tendon1="cable" polycoef="0 0 0 0 0"/>'
    text = with_hub(samples.SPATIAL.format(more=STRAIGHT.format(""), equality=equality))
    mechanism = read(text, tmp_path).mechanism
    model, data = compiled(text)
    mj.mj_forward(model, data)
    assert mechanism.joints["rod_1"].length == pytest.approx(data.ten_length[0], abs=1e-12)
    assert_same_accelerations(mechanism, text, rates=False)


@pytest.mark.parametrize("length", ["", 'springlength="0.2"', 'springlength="0.2 0.2"'])
def test_a_tendon_with_stiffness_is_a_spring_between_two_points(length, tmp_path):
    text = with_hub(
        samples.SPATIAL.format(
            more=STRAIGHT.format(f'stiffness="30" damping="2" {length}'), equality=""
        )
    )
    imported = read(text, tmp_path)
    assert imported.notes == ()
    assert imported.mechanism.springs["cable"].stiffness == 30
    assert_same_accelerations(imported.mechanism, text, bound=1e-9)


def test_a_held_tendon_of_joints_is_a_gear(tmp_path):
    coefficients = {"rail": 2, "spin": -1, "roll": 0.5}
    parts = "".join(
        f'<joint joint="{name}" coef="{value}"/>' for name, value in coefficients.items()
    )
    tendon = f'<tendon><fixed name="f">{parts}</fixed></tendon>'
    text = samples.SPATIAL.format(
        more=tendon, equality='<tendon tendon1="f" polycoef="0.01 0 0 0 0"/>'
    )
    gear = read(text, tmp_path).mechanism.joints["f"]
    assert gear.ratios == coefficients
    assert gear.offset == pytest.approx(2 * 0.1 + 0.01)


def test_points_that_cannot_meet_stay_spherical_joints_and_are_noted(tmp_path):
    sites = '<site name="a" pos="0 0 0"/><site name="b" pos="0 0 0.2"/>'
    text = samples.SPATIAL.format(
        more="",
        equality=(
            '<connect name="c1" site1="a" site2="seat"/><connect name="c2" site1="b" '
            'site2="seat2"/>'
        ),
    )
    text = text.replace(
        '<joint name="ball" type="ball"/>', f'<joint name="ball" type="ball"/>{sites}'
    ).replace('<site name="seat"', '<site name="seat2" pos="0 0 0.3"/><site name="seat"')
    imported = read(text, tmp_path)
    assert "hold points together that lie differently far apart" in imported.notes[0]
    assert [kinds(imported.mechanism)[name] for name in ("c1", "c2")] == ["spherical", "spherical"]


@pytest.mark.parametrize(
    ("equality", "words"),
    [
        ('<joint joint1="ball"/>', "'ball' is a ball joint; only hinges and slides are coupled"),
        ('<tendon polycoef="0"/>', "has no attribute 'tendon1'"),
        ('<connect body1="rod" body2="slider"/>', "has no attribute 'anchor'"),
        ('<connect site1="seat"/>', "has no attribute 'site2'"),
    ],
)
def test_refusals(equality, words, tmp_path):
    with pytest.raises(MechanismError) as refusal:
        read(samples.SPATIAL.format(more="", equality=equality), tmp_path)
    assert words in str(refusal.value)
