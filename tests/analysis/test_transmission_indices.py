"""Input and output transmission indices against published closed forms: sines of transmission
angles in the plane, force lines of the Delta and of the hexapod in space."""

import json

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import dexterity, transmission_indices
from linkwork.equations.algebra import rotation_matrix

from tests.catalogue import built
from tests.cli.calls import call


def placed(robot, state, joint):
    """Return where a joint's second frame is."""
    own = robot.mechanism.joints[joint]
    p, R = robot.body_poses(state)[own.connects[1]]
    return p + R @ own.frames[1].position


def unit(v):
    return v / np.linalg.norm(v)


def sine(a, b):
    return float(np.linalg.norm(np.cross(unit(a), unit(b))))


def crossing(p, f, q, g):
    """Return where two lines of the plane meet."""
    s, _ = np.linalg.solve(np.column_stack([f, -g])[:2], (q - p)[:2])
    return p + s * f


def test_a_five_bar_by_the_sines_of_its_angles():
    """Liu & Wang: at the elbows, and between the distal links, whichever of them holds the
    tool."""
    robot = built("five_bar")
    states = robot.assemble(tool=[[0.15, 0.4], [0.1, 0.35], [0.2, 0.45]])
    elbows = np.abs(np.sin([states["elbow_1"], states["elbow_2"]])).T
    tips = np.abs(np.sin(states["tip"]))[:, None] * [1, 1]
    other = lw.Tool(body="distal_2", frame=lw.Frame.planar(0.35))
    twin = lw.Robot(robot.mechanism.model_copy(update={"tools": {"tip": other}}))
    for one in (robot, twin):
        found = transmission_indices(one, states)
        np.testing.assert_allclose(found.input, elbows, atol=1e-12)
        np.testing.assert_allclose(found.output, tips, atol=1e-12)
        np.testing.assert_allclose(found.local, np.minimum(elbows.min(axis=1), tips[:, 0]))
        np.testing.assert_allclose(np.sin(found.output_angle), tips)
        np.testing.assert_allclose(np.sin(found.input_angle), elbows)


@pytest.mark.parametrize(
    ("name", "inner", "outer"), [("rrr3", "elbow_{}", "wrist_{}"), ("prr3", "pivot_{}", "wrist_{}")]
)
def test_planar_platforms_by_hand(name, inner, outer):
    """Input: the angle between a link and its crank, or across its slide; output: between the link
    and the line from its end to where the other two links' lines meet."""
    robot = built(name)
    aside = np.array([0.03, -0.02, 0.15])
    state = robot.assemble(tool=robot.tool_pose(robot.home) + aside)
    starts, ends = (
        [placed(robot, state, form.format(i)) for i in (1, 2, 3)] for form in (inner, outer)
    )
    f = [unit(end - start) for start, end in zip(starts, ends, strict=True)]
    found = transmission_indices(robot, state)
    for i in range(3):
        j, k = {0, 1, 2} - {i}
        actuator = robot.actuators[i]
        joint = robot.mechanism.joints[actuator]
        if name == "prr3":
            along = rotation_matrix(joint.frames[0].rotation)[:, 0]
            expected = abs(f[i] @ along)
        else:
            expected = sine(f[i], starts[i] - np.array(joint.frames[0].position))
        assert found.input[i] == pytest.approx(expected, abs=1e-12)
        centre = crossing(ends[j], f[j], ends[k], f[k])
        assert found.output[i] == pytest.approx(sine(f[i], ends[i] - centre), abs=1e-12)
        line = np.array([*np.cross(ends[i], f[i]), *f[i]])
        wrench = found.wrenches[i]
        assert np.allclose(wrench[[2, 3, 4]], wrench[3:] @ f[i] * line[[2, 3, 4]], atol=1e-12)


def test_a_delta_by_the_directions_of_its_rods():
    """Its platform does not turn: where motor i moves alone it goes across the other two legs'
    rods. Rods with masses, and other joints at their ends, transmit the same."""
    pose = [0.1, -0.15, -0.95]
    robot = built("delta")
    state = robot.assemble(tool=pose)
    found, poses, joints = (
        transmission_indices(robot, state),
        robot.body_poses(state),
        robot.mechanism.joints,
    )
    f, tangents = [], []
    for i in (1, 2, 3):
        rod, motor = joints[f"rod_{i}_left"], joints[f"motor_{i}"]
        ends = [
            poses[body][0] + poses[body][1] @ frame.position
            for body, frame in zip(rod.connects, rod.frames, strict=True)
        ]
        f.append(unit(ends[1] - ends[0]))
        (p, R) = poses[motor.connects[1]]
        axis = R @ rotation_matrix(motor.frames[1].rotation) @ motor.axis
        tangents.append(unit(np.cross(axis, ends[rod.connects.index(motor.connects[1])] - p)))
    for i in range(3):
        j, k = {0, 1, 2} - {i}
        assert found.input[i] == pytest.approx(abs(f[i] @ tangents[i]), abs=1e-10)
        free = unit(np.cross(f[j], f[k]))
        assert found.output[i] == pytest.approx(abs(f[i] @ free), abs=1e-10)
    np.testing.assert_allclose(found.output, dexterity(robot, state).transmissibility, atol=1e-9)
    heavy = lw.Robot(lw.robots.delta(rod_mass=0.02))
    same = transmission_indices(heavy, heavy.assemble(tool=pose))
    np.testing.assert_allclose(same.input, found.input, atol=1e-9)
    np.testing.assert_allclose(same.output, found.output, atol=1e-9)


def test_a_hexapod_by_its_lines():
    """Legs that slide transmit all of their actuators' power; what they give the platform follows
    from their Pluecker lines."""
    robot = built("stewart")
    aside = np.array([0.1, -0.05, 0.2, 0.1, -0.15, 0.2])
    state = robot.assemble(tool=robot.task_values(robot.home) + aside)
    found = transmission_indices(robot, state)
    np.testing.assert_allclose(found.input, 1.0, atol=1e-12)
    joints = robot.mechanism.joints
    ends = [n for n, j in joints.items() if j.connects[1] == "platform" and j.type != "free"]
    top = np.array([placed(robot, state, name) for name in ends])
    bodies = [joints[name].connects[0] for name in ends]
    tubes = [next(j for j in joints.values() if j.connects[1] == body) for body in bodies]
    f = np.array(
        [
            robot.body_poses(state)[tube.connects[1]][1]
            @ rotation_matrix(tube.frames[1].rotation)
            @ tube.axis
            for tube in tubes
        ]
    )
    W = np.hstack([np.cross(top, f), f])
    motions = np.linalg.inv(W)
    for i in range(6):
        omega, v = np.split(motions[:, i], 2)
        at_end = v + np.cross(omega, top[i])
        assert found.output[i] == pytest.approx(abs(f[i] @ unit(at_end)), abs=1e-10)


def test_linkages_of_one_freedom():
    """The transmission angle of a four-bar is that between coupler and rocker, where the rocker is
    what is driven."""
    mechanism = built("four_bar").mechanism
    tool = lw.Tool(body="rocker", frame=lw.Frame.planar(0.05), task=("x",))
    robot = lw.Robot(mechanism.model_copy(update={"tools": {"tool": tool}}))
    found = transmission_indices(robot, robot.home)
    assert found.output[0] == pytest.approx(abs(np.sin(robot.home["rocker_pin"])), abs=1e-9)
    assert found.input[0] == pytest.approx(abs(np.sin(robot.home["crank_pin"])), abs=1e-9)


def test_a_stretched_leg_transmits_nothing():
    robot = built("five_bar")
    state = robot.assemble({"motor_1": 1.0, "elbow_1": 0.0})
    found = transmission_indices(robot, state)
    assert found.input[0] == 0.0 and np.isnan(found.output[0]) and found.local == 0.0
    near = transmission_indices(robot, robot.assemble({"motor_1": 1.0, "elbow_1": 1e-4}))
    assert near.input[0] == pytest.approx(1e-4, rel=1e-6)


def test_legs_without_one_wrench_are_refused_by_name():
    cases = {
        "par4": "motor_1, motor_2, motor_3, motor_4 drive one leg between 'ground' and 'front'",
        "puma560": "joint_1, .* drive one leg between 'ground' and 'link_6'",
        "bricard": "names no tool",
        "bennett": "leg of 'hinge_1' has no unique transmission wrench",
    }
    for name, sentence in cases.items():
        with pytest.raises(lw.LinkworkError, match=sentence):
            transmission_indices(built(name), built(name).home)


def test_the_command_line_tells_them():
    def told(name):
        return json.loads(call("analyse", name, "dexterity", "--json").stdout)

    found, robot = told("rrr3"), built("rrr3")
    indices = transmission_indices(robot, robot.home)
    assert [*found["output index"].values()] == pytest.approx(indices.output.tolist())
    assert found["local index"] == pytest.approx(float(indices.local))
    assert "drive one leg" in told("par4")["refused"]
    assert "1.571" in call("analyse", "prr3", "dexterity").stdout


def test_an_empty_stack_has_no_indices():
    robot = lw.Robot("prr3")
    found = transmission_indices(robot, robot.state(np.zeros((0, len(robot.coordinates)))))
    assert found.input.shape == found.output_angle.shape == (0, 3)
    assert found.wrenches.shape == (0, 3, 6) and found.local.shape == (0,)
