"""URDF that is written: read again it moves the same, and Pinocchio reads its tree."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
import yaml

import linkwork as lw
from linkwork.formats import load, poses, save
from linkwork.formats.poses import from_rpy, to_rpy
from linkwork.formats.urdf.writer import to_urdf
from linkwork.mechanism import (
    Body,
    Frame,
    Friction,
    GearJoint,
    Inertia,
    Limits,
    Mechanism,
    MechanismError,
    RevoluteJoint,
    ScrewJoint,
    Spring,
    UniversalJoint,
)

EARTH = (0.0, 0.0, -9.81)
FREE = Limits()
PART = Inertia(xx=0.02, yy=0.03, zz=0.025, xy=0.001, xz=-0.002, yz=0.003)
SKEW = Frame(position=(0.1, -0.2, 0.3), rotation=(0.3, -0.5, 0.7))


def again(robot: lw.Robot, path, loops: Literal["inside", "beside"] = "inside") -> lw.Robot:
    """Return the robot that a written file is, from the same reference."""
    save(robot.mechanism, path, loops=loops)
    home = dict(zip(map(plain, robot.coordinates), robot.home.positions.tolist(), strict=True))
    names = load(path).mechanism.coordinates
    reference = {name: value for name, value in home.items() if name in names}
    return lw.Robot(load(path, reference=reference).mechanism)


def plain(label: str) -> str:
    return label.replace(".", "_")


def difference(robot: lw.Robot, other: lw.Robot) -> float:
    """Return how far the accelerations of shared joints are apart, over the largest."""
    rng = np.random.default_rng(5)
    v, u = rng.normal(size=robot.mobility), rng.normal(size=len(robot.actuators))
    state = robot.state(robot.home.positions, v)
    rates = dict(zip(map(plain, robot.rates), robot.joint_rates(state), strict=True))
    forces = dict(zip(map(plain, robot.actuators), u, strict=True))
    assert {*other.actuators} == {*forces}
    theirs = other.state(other.home.positions, [rates[name] for name in other.independent])
    mine = dict(zip(map(plain, robot.independent), robot.forward_dynamics(state, u), strict=True))
    found = other.forward_dynamics(theirs, [forces[name] for name in other.actuators])
    shared = [(mine[name], x) for name, x in zip(other.independent, found, strict=True)]
    return max(abs(a - b) for a, b in shared) / max(1.0, *(abs(a) for a, _ in shared))


def standing(name: str) -> Mechanism:
    """Return a robot of the catalogue under the gravity that readers of URDF take."""
    mechanism = getattr(lw.robots, name)()
    return mechanism.model_copy(update={"gravity": EARTH})


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    "name", ["prr3", "slider_crank", "bennett", "spatial_slider_crank", "agile_wrist", "stewart"]
)
def test_what_is_written_is_read_as_the_same_robot(name, tmp_path):
    robot = lw.Robot(standing(name))
    other = again(robot, tmp_path / "robot.urdf")
    assert other.mobility == robot.mobility
    assert difference(robot, other) < 1e-9


@pytest.mark.sample(5)
@pytest.mark.parametrize(
    "name", ["prr3", "four_bar", "bennett", "spatial_slider_crank", "agile_wrist", "stewart"]
)
def test_loops_beside_the_file_are_read_as_the_same_robot(name, tmp_path):
    robot = lw.Robot(standing(name))
    other = again(robot, tmp_path / "robot.urdf", "beside")
    assert other.mobility == robot.mobility
    assert difference(robot, other) < 1e-9
    assert not re.search("<loop|<constraint|independent", (tmp_path / "robot.urdf").read_text())


def test_loops_beside_the_file_are_written_as_others_have_them(tmp_path):
    notes = save(standing("four_bar"), tmp_path / "bars.urdf", loops="beside")
    lines = (tmp_path / "bars.yaml").read_text().splitlines()
    frames = '[["closedloop1_A", "closedloop1_B"]]'
    assert lines == [f"closed_loop: {frames}", 'type: ["6d"]', 'name_mot: ["crank_pivot"]']
    assert any("the loops are in bars.yaml" in note for note in notes)
    save(standing("stewart"), tmp_path / "six.urdf", loops="beside")
    assert 'type: ["3d", ' in (tmp_path / "six.yaml").read_text()


@pytest.mark.parametrize("name", ["prr3", "bennett", "spatial_slider_crank"])
def test_pinocchio_finds_frames_beside_the_file_together(name, tmp_path):
    """The frames that the file of loops names meet at home; those of 6d have the same axes."""
    pin = pytest.importorskip("pinocchio")
    robot = lw.Robot(standing(name))
    save(robot.mechanism, tmp_path / "robot.urdf", loops="beside")
    model = pin.buildModelFromUrdf(str(tmp_path / "robot.urdf"))
    home = dict(zip(map(plain, robot.coordinates), robot.home.positions.tolist(), strict=True))
    q = pin.neutral(model)
    for name, joint in zip([*model.names][1:], [*model.joints][1:], strict=True):
        x = home[name]
        q[joint.idx_q : joint.idx_q + joint.nq] = [x] if joint.nq == 1 else [np.cos(x), np.sin(x)]
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    beside = yaml.safe_load((tmp_path / "robot.yaml").read_text())
    for (A, B), kind in zip(beside["closed_loop"], beside["type"], strict=True):
        first, second = (data.oMf[model.getFrameId(each)] for each in (A, B))
        np.testing.assert_allclose(first.translation, second.translation, atol=1e-12)
        if kind == "6d":
            np.testing.assert_allclose(first.rotation, second.rotation, atol=1e-12)


def test_a_driven_joint_that_closes_a_loop_is_driven_again(tmp_path):
    """By a motor of the joint that carries the first frame, where <loop> has none."""
    joints = tuple(lw.robots.four_bar().coordinates)
    changes = {"actuators": joints, "gravity": EARTH}
    robot = lw.Robot(lw.robots.four_bar().model_copy(update=changes))
    with pytest.raises(MechanismError, match="closes a loop, which URDF drives none of"):
        save(robot.mechanism, tmp_path / "robot.urdf")
    other = again(robot, tmp_path / "robot.urdf", "beside")
    assert other.actuators == joints
    assert difference(robot, other) < 1e-9


def test_where_loops_cannot_stand(tmp_path):
    own = tmp_path / "arm.yaml"
    standing("four_bar").save(own)
    kept = own.read_text()
    with pytest.raises(MechanismError, match=r"arm\.yaml: is there and holds no loops of a URDF"):
        save(standing("four_bar"), tmp_path / "arm.urdf", loops="beside")
    assert own.read_text() == kept
    with pytest.raises(lw.LinkworkError, match="loops stand beside URDF alone"):
        save(standing("four_bar"), tmp_path / "arm.xml", loops="beside")
    with pytest.raises(lw.LinkworkError, match='loops is \'outside\'; give "inside" or "beside"'):
        save(standing("four_bar"), tmp_path / "arm.urdf", loops="outside")  # pyright: ignore
    with pytest.raises(
        MechanismError, match="a rod joint, closes a loop, which neither two frames"
    ):
        save(standing("delta"), tmp_path / "delta.urdf", loops="beside")


def test_ends_that_are_not_bounded_are_read_as_such(tmp_path):
    mechanism = lw.robots.prr3()
    joints = dict(mechanism.joints)
    joints["slide_1"] = joints["slide_1"].model_copy(update={"limits": Limits(upper=0.5)})
    save(mechanism.model_copy(update={"joints": joints}), tmp_path / "robot.urdf")
    read = load(tmp_path / "robot.urdf").mechanism
    assert read.joints["slide_1"].limits == Limits(upper=0.5)
    assert read.joints["slide_2"].limits == Limits()


def test_limits_of_joints_that_close_loops_are_told(tmp_path):
    mechanism, path = standing("four_bar"), tmp_path / "bars.urdf"
    joints = {
        name: joint.model_copy(update={"limits": Limits(speed=7.0)})
        for name, joint in mechanism.joints.items()
    }
    notes = save(mechanism.model_copy(update={"joints": joints}), path)
    assert [note for note in notes if note.startswith("joints.rocker_pin: limits are left out")]
    assert path.read_text().count('velocity="7.0"') == len(joints) - 1
    beside = save(mechanism.model_copy(update={"joints": joints}), path, loops="beside")
    assert not [note for note in beside if "limits" in note]
    assert path.read_text().count('velocity="7.0"') == len(joints)


def arm() -> Mechanism:
    """Return a tree of a screw, a universal joint and geared hinges, with all that URDF holds."""
    bodies = {
        name: Body(mass=mass, centre_of_mass=(0.1, 0.2, -0.1), inertia=PART)
        for name, mass in (("nut", 2.0), ("fork", 1.5), ("first", 0.7), ("second", 0.4))
    }
    acting = {
        "friction": Friction(viscous=0.2),
        "spring": Spring(stiffness=3.0, rest=0.1),
        "limits": Limits(lower=-1.0, upper=2.0),
    }
    joints = {
        "thread": ScrewJoint(connects=("ground", "nut"), frames=(SKEW, Frame()), pitch=0.02),
        "cross": UniversalJoint(connects=("fork", "nut"), frames=(SKEW, SKEW)),
        "elbow": RevoluteJoint(connects=("fork", "first"), frames=(SKEW, Frame()), **acting),
        "tip": RevoluteJoint(connects=("first", "second"), frames=(SKEW, SKEW), axis=(0.6, 0.8, 0)),
        "wheels": GearJoint(ratios={"elbow": 1.0, "tip": 2.0}, offset=0.3),
    }
    actuators = ("thread", "cross.angle_1", "cross.angle_2", "elbow")
    reference = {"elbow": 0.3, "cross.angle_1": 0.4, "thread": 0.5}
    return Mechanism(
        name="arm",
        bodies=bodies,
        joints=joints,
        actuators=actuators,
        reference=reference,
        gravity=EARTH,
    )


def test_loops_whose_coordinates_have_no_zero_are_told(tmp_path):
    """A <constraint> says where its axes are, not how far apart they stand at zero."""
    names, at, joints = ["ground", *(f"p{k}" for k in range(5))], np.eye(4), {}
    for k, ends in enumerate(pairwise(names)):
        X = poses.pose(np.random.default_rng(k).uniform(-0.5, 0.5, 3), from_rpy(k, 1, 2))
        at = at @ X
        joints[f"j{k}"] = RevoluteJoint(connects=ends, frames=(poses.frame_of(X), Frame()))
    frames = Frame(), poses.frame_of(poses.inverse(at))
    joints["cross"] = UniversalJoint(connects=("ground", "p4"), frames=frames)
    bodies = {name: Body(mass=1.0, inertia=PART) for name in names[1:]}
    mechanism = Mechanism(name="ring", bodies=bodies, joints=joints, actuators=("j0",))
    notes = save(mechanism, tmp_path / "robot.urdf")
    assert "<constraint" in (tmp_path / "robot.urdf").read_text()
    assert any("joints.cross" in note and "which has no zero" in note for note in notes)


def test_screws_universal_joints_gears_and_what_acts(tmp_path):
    robot = lw.Robot(arm())
    other = again(robot, tmp_path / "arm.urdf")
    assert difference(robot, other) < 1e-9
    elbow = other.mechanism.joints["elbow"]
    assert elbow.limits == Limits(lower=-1.0, upper=2.0)  # pyright: ignore


def test_pinocchio_reads_the_same_tree():
    """M = L' H L with the tree's inertia by Pinocchio, from the file, and L of this robot."""
    pin = pytest.importorskip("pinocchio")
    robot = lw.Robot(standing("prr3"))
    text, _ = to_urdf(robot.mechanism)
    model = pin.buildModelFromXML(text)
    values = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    q, names = pin.neutral(model), list(model.names)[1:]
    for name, joint in zip(names, list(model.joints)[1:], strict=True):
        x = values[name]
        q[joint.idx_q : joint.idx_q + joint.nq] = [x] if joint.nq == 1 else [np.cos(x), np.sin(x)]
    H = np.triu(pin.crba(model, model.createData(), q))
    H = H + np.triu(H, 1).T
    places = [joint.idx_v for joint in list(model.joints)[1:]]
    L = robot.rate_map(robot.home)[[robot.rates.index(name) for name in names]]
    M = L.T @ H[np.ix_(places, places)] @ L
    np.testing.assert_allclose(M, robot.mass_matrix(robot.home), rtol=1e-12, atol=1e-12)


def test_what_is_left_out_is_said():
    changes = {"gravity": (0.0, -1.0, 0.0), "actuators": ("shoulder",)}
    _, notes = to_urdf(turning(rotors=(0.3, 0.2)).model_copy(update=changes))
    assert any("URDF holds no gravity, which is (0 -1 0) here" in note for note in notes)
    assert any("rotor inertias of joints that are not driven are left out" in n for n in notes)


def turning(rotors: tuple[float, float], limits: Limits = FREE) -> Mechanism:
    """Return an arm of two hinges with rotors."""
    shoulder, elbow = rotors
    body = Body(mass=1.0, centre_of_mass=(0.1, 0.2, -0.1), inertia=PART)
    joints = {
        "shoulder": RevoluteJoint(connects=("ground", "a"), rotor_inertia=shoulder, limits=limits),
        "elbow": RevoluteJoint(connects=("a", "b"), frames=(SKEW, SKEW), rotor_inertia=elbow),
    }
    return Mechanism(
        name="turning",
        bodies={"a": body, "b": body},
        joints=joints,
        actuators=("shoulder", "elbow"),
        gravity=EARTH,
    )


@pytest.mark.parametrize("loops", ["inside", "beside"])
def test_rotors_of_driven_joints_are_read_again(loops, tmp_path):
    """All driven joints have a drive, so that those without a rotor stay driven; none is given a
    limit of effort."""
    robot = lw.Robot(turning((0.3, 0.0), Limits(lower=-1.0, upper=2.0)))
    other = again(robot, tmp_path / "turning.urdf", loops)
    assert difference(robot, other) < 1e-12
    joints = other.mechanism.joints.items()
    rotors = {name: joint.rotor_inertia for name, joint in joints}  # pyright: ignore
    assert rotors == {"shoulder": 0.3, "elbow": 0.0}
    assert not other.drives


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("delta", "joint 'rod_1_left', a rod joint, closes a loop, which URDF with loops has no"),
        ("andrews", "URDF has no place for springs, as for 'CD'; write .xml (MJCF) or .yaml"),
    ],
)
def test_refusals(name, sentence, tmp_path):
    with pytest.raises(MechanismError, match=re.escape(sentence)):
        save(getattr(lw.robots, name)(), tmp_path / "robot.urdf")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("short", [0.0, 1e-16, 1e-11, 1e-8, 1e-6, 0.1])
def test_orientations_are_written_to_rounding_where_pitch_is_a_quarter_turn(short):
    for side in (1.0, -1.0):
        for roll, yaw in ((0.0, 0.0), (0.4, -1.1), (3.0, 2.5), (-2.0, 0.7)):
            R = from_rpy(roll, side * (np.pi / 2 - short), yaw)
            np.testing.assert_allclose(from_rpy(*to_rpy(R)), R, atol=2e-15)
