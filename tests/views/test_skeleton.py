"""The points that are drawn, against the robot's own kinematics and the descriptions' lengths."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.scene.skeleton import skeleton

from tests.catalogue import built

SLIDES = {"prismatic": "", "cylindrical": ".slide"}


@pytest.mark.parametrize("name", lw.robots.__all__)
def test_the_two_sides_of_every_joint_of_the_catalogue_stand_as_its_coordinates_say(name):
    robot = built(name)
    state = robot.home
    for joint in skeleton(robot, state).joints:
        gap = joint.far - joint.near
        described = robot.mechanism.joints[joint.name]
        if joint.type == "rod":
            assert np.linalg.norm(gap) == pytest.approx(described.length, abs=1e-9)
            continue
        slide = (
            state[joint.name + SLIDES[joint.type]] * joint.axes[0]
            if joint.type in SLIDES
            else np.zeros(3)
        )
        np.testing.assert_allclose(gap, slide, atol=1e-9)


def test_every_kind_of_joint_has_its_axes_and_its_gap(zoo):
    state, drawn = zoo.home, skeleton(zoo, zoo.home)
    joints = {joint.name: joint for joint in drawn.joints}
    assert set(joints) == set(zoo.mechanism.pairs) - {"free"}
    names = ("revolute", "universal", "planar", "spherical", "fixed", "rod")
    assert [len(joints[name].axes) for name in names] == [1, 2, 1, 0, 0, 0]
    screw, cylindrical, planar = joints["screw"], joints["cylindrical"], joints["planar"]
    np.testing.assert_allclose(screw.far - screw.near, (0, 0, 0.05 * state["screw"]), atol=1e-12)
    np.testing.assert_allclose(
        cylindrical.far - cylindrical.near,
        state["cylindrical.slide"] * cylindrical.axes[0],
        atol=1e-12,
    )
    gap = planar.far - planar.near
    assert gap @ planar.axes[0] == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(gap) == pytest.approx(
        np.hypot(state["planar.x"], state["planar.y"]), abs=1e-12
    )
    assert joints["universal"].axes[0] @ joints["universal"].axes[1] == pytest.approx(0, abs=1e-12)
    assert [name for name, joint in joints.items() if joint.driven] == ["universal", "prismatic"]
    assert [joint.name for joint in drawn.gears["gear"]] == ["screw", "revolute"]
    np.testing.assert_allclose(drawn.anchors, [(0.6, 0, 0)])


def test_points_are_those_of_the_papers_robot(robot):
    state = robot.assemble(tool=[0.52, 0.27, 0.42])
    drawn = skeleton(robot, state)
    corners = drawn.bodies["platform"][:3]
    np.testing.assert_allclose(
        np.linalg.norm(corners[:, :2] - [0.52, 0.27], axis=1), 0.15, atol=1e-12
    )
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, 0.15 * np.sqrt(3), atol=1e-12)
    for i in (1, 2, 3):
        ends = drawn.bodies[f"link_{i}"]
        assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(0.3, abs=1e-12)
    np.testing.assert_allclose(drawn.tools["centre"][0], [0.52, 0.27, 0], atol=1e-12)


def test_hinges_that_meet_in_a_point_move_out_along_their_axes():
    robot = built("agile_wrist")
    drawn = skeleton(robot, robot.home)
    for joint in drawn.joints:
        assert np.linalg.norm(joint.far) > 0.03
        np.testing.assert_allclose(np.cross(joint.far, joint.axes[0]), 0, atol=1e-12)
    assert set(drawn.arcs) == {f"{part}_{i}" for part in ("proximal", "distal") for i in (1, 2, 3)}
    # the mass centre of a quarter circle of 0.15 m lies at 2 / pi of that along either axis
    np.testing.assert_allclose(drawn.joints[0].far, (0.15 * 2 / np.pi, 0, 0), atol=1e-12)


def test_hinges_that_do_not_meet_stay_where_they_are_described():
    robot = built("bricard")
    drawn = skeleton(robot, robot.home)
    assert not drawn.arcs
    corners = [(1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1), (0, 0, 0)]
    for joint, corner in zip(drawn.joints, np.roll(corners, 1, axis=0), strict=True):
        assert min(np.linalg.norm(np.array(corners) - joint.far, axis=1)) < 1e-12, (
            joint.name,
            corner,
        )


@pytest.mark.parametrize(
    ("name", "masses"),
    [
        ("pendulum", {"rod_1": (1, 0, 0)}),
        ("double_pendulum", {"rod_1": (1, 0, 0), "rod_2": (2, 0, 0)}),
        ("five_bar", {}),
        ("puma560", {}),
    ],
)
def test_masses_that_are_points_are_shown(name, masses):
    robot = built(name)
    drawn = skeleton(robot, robot.home).masses
    assert set(drawn) == set(masses)
    for body, place in masses.items():
        np.testing.assert_allclose(drawn[body], place, atol=1e-12)


def test_the_governors_balls_are_shown_near_the_ends_of_its_rods():
    robot = built("flyball_governor")
    drawn = skeleton(robot, robot.home)
    assert set(drawn.masses) == {"rod_1", "rod_2"}
    # 0.3 kg of rod and a ball of 5 kg: their common centre is (0.15 + 5) / 5.3 of the rod from its
    # hinge
    hinge = next(joint.far for joint in drawn.joints if joint.name == "hinge_1")
    assert np.linalg.norm(drawn.masses["rod_1"] - hinge) == pytest.approx(5.15 / 5.3)


def test_a_body_that_nothing_but_a_free_joint_holds_is_a_point():
    body = lw.Body(mass=1.0, centre_of_mass=(0, 0, 0.5), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"stone": body}, joints={"flight": lw.FreeJoint(connects=("ground", "stone"))}
        )
    )
    drawn = skeleton(robot, robot.home)
    np.testing.assert_allclose(drawn.points, [(0, 0, 0.5)])


def test_a_body_without_mass_and_joints_of_its_own_is_its_origin():
    joints = {"flight": lw.FreeJoint(connects=("ground", "air"))}
    robot = lw.Robot(
        lw.Mechanism(bodies={"air": lw.Body(mass=0.0)}, joints=joints, reference={"flight.x": 2.0})
    )
    np.testing.assert_allclose(skeleton(robot, robot.home).points, [(2, 0, 0)])
