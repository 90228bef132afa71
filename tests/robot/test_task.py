"""Task coordinates: robots of mixed freedoms are led where closed forms say, and refused in words
where what is asked makes no task."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork import Body, DistanceTo, Frame, Inertia, Mechanism, Robot, Tool, TurnAbout
from linkwork.equations.task import task_map
from linkwork.mechanism.task import NAMES
from linkwork.model import dexterity
from linkwork.model.task import values
from linkwork.paths import Path, circle, line

from tests.robot.mixed_freedoms import pose_of_three_legs, scara, three_legs

TILTED = ("z", "azimuth", "tilt")
AHEAD = Frame(position=(1.0, 0.0, 0.0))


@pytest.fixture(scope="module", params=["RRS", "RPS"])
def legs(request):
    return Robot(three_legs(request.param))


@pytest.fixture(scope="module")
def arm():
    return Robot(scara())


def placed(robot, state):
    pose = robot.tool_pose(state)
    return pose[:3], Rotation.from_rotvec(pose[3:]).as_matrix()


def test_the_task_is_chosen_where_it_is_plain(arm, legs):
    assert arm.task == ("x", "y", "z", "rz")
    assert legs.task == ("z", "rx", "ry")
    assert Robot(lw.robots.delta()).task == ("x", "y", "z")
    assert Robot(lw.robots.five_bar()).task == ("x", "y")
    flipped = Robot(scara(rotation=(np.pi, 0.0, 0.0)))
    assert flipped.task == ("x", "y", "z", "turn")
    assert flipped.task_values(flipped.home)[3] == pytest.approx(0, abs=1e-12)
    turned = flipped.assemble(
        tool=flipped.task_values(flipped.home) + np.array([0.01, 0, 0.05, 2.5])
    )
    assert turned["wrist"] == pytest.approx(
        -0.4 + 2.5 - sum(turned[name] - flipped.home[name] for name in ("shoulder", "elbow"))
    )


def test_three_legs_tilt_without_torsion_and_shift_along(legs):
    for z, azimuth, tilt in ((0.5, 0.3, 0.2), (0.45, 2.0, 0.3), (0.52, -1.0, 0.1)):
        position, R = pose_of_three_legs(z, azimuth, tilt)
        state = legs.assemble(tool={"z": z, "azimuth": azimuth, "tilt": tilt})
        np.testing.assert_allclose(placed(legs, state)[0], position, atol=1e-12)
        np.testing.assert_allclose(placed(legs, state)[1], R, atol=1e-12)
        assert legs.task_values(state, ("torsion",)) == pytest.approx(0, abs=1e-12)
        np.testing.assert_allclose(legs.task_values(state, TILTED), [z, azimuth, tilt], atol=1e-12)
        r = Rotation.from_matrix(R).as_rotvec()
        same = legs.assemble(tool=[z, r[0], r[1]])
        np.testing.assert_allclose(same.positions, state.positions, atol=1e-12)


def test_stacks_equal_single_ones(legs, arm):
    random = np.random.default_rng(4)
    for robot in (legs, arm):
        values = robot.task_values(robot.home)
        near = values + random.uniform(-0.03, 0.03, (2, 6, values.size))
        stack = robot.assemble(tool=near)
        np.testing.assert_allclose(robot.task_values(stack), near, atol=1e-11)
        one = robot.assemble(tool=near[1, 3])
        np.testing.assert_allclose(stack.positions[1, 3], one.positions, atol=1e-11)


def test_the_elbow_keeps_its_side(arm):
    values = arm.task_values(arm.home)
    away = arm.assemble(tool=values + np.array([-0.3, 0.1, 0.1, 2.0]))
    assert np.sign(away["elbow"]) == np.sign(arm.home["elbow"]) == 1
    left = arm.assemble({"shoulder": 1.0, "elbow": -0.8, "lift": 0.0, "wrist": 0.0})
    assert arm.assemble(tool=values, guess=left)["elbow"] < 0


def swung(s):
    """A tilt that goes round once while the platform nods and sinks, with derivatives."""
    turn = 2 * np.pi * s
    x = np.stack([0.5 - 0.02 * s**2, turn, 0.2 + 0.05 * s], axis=1)
    dx = np.stack([-0.04 * s, 2 * np.pi + 0 * s, 0.05 + 0 * s], axis=1)
    return x, dx, np.stack([-0.04 + 0 * s, 0 * s, 0 * s], axis=1)


def test_following_gives_exact_rates_and_accelerations(legs):
    motion = legs.follow(Path(swung), 2.0, samples=401, what=TILTED)
    assert motion.what == TILTED
    found = legs.task_values(motion.state, TILTED)
    np.testing.assert_allclose(found[:, [0, 2]], motion.tool[:, [0, 2]], atol=1e-11)
    np.testing.assert_allclose(np.exp(1j * found[:, 1]), np.exp(1j * motion.tool[:, 1]), atol=1e-11)
    h, q = motion.time[1], motion.positions[:, [0, 1, 4]]
    names = [legs.coordinates[k] for k in (0, 1, 4)]
    rates = motion.joint_rates[:, [legs.rates.index(n) for n in names if n in legs.rates]]
    own = [k for k, n in enumerate(names) if n in legs.rates]
    slopes = (q[:-4] - 8 * q[1:-3] + 8 * q[3:-1] - q[4:])[:, own] / (12 * h)
    np.testing.assert_allclose(rates[2:-2], slopes, atol=1e-5)
    bends = (rates[:-4] - 8 * rates[1:-3] + 8 * rates[3:-1] - rates[4:]) / (12 * h)
    places = [legs.rates.index(n) for n in names if n in legs.rates]
    np.testing.assert_allclose(motion.joint_accelerations[2:-2, places], bends, atol=1e-4)


@pytest.mark.parametrize(
    ("turn", "samples"), [(9.0, 3), (-40.0, 2), (100.0, 11), (2 * np.pi, 2), (-4 * np.pi, 2)]
)
def test_whole_turns_between_samples_are_counted(arm, turn, samples):
    """The wrist of a SCARA robot turns as its tool, less than the two joints before it."""
    values = arm.task_values(arm.home)
    path = line(values, values + np.array([0.02, 0, 0, turn]))
    moved = np.diff(arm.follow(path, 1.0, samples=samples).positions[[0, -1]], axis=0)[0]
    assert moved[[0, 1, 3]].sum() == pytest.approx(turn, abs=1e-12)


@pytest.mark.parametrize("samples", [2, 3, 5])
def test_whole_circles_between_samples_are_counted(samples):
    """An arm of two links whose tool goes around its shoulder turns there, and not at its elbow."""
    planar = Robot(
        lw.Mechanism(
            name="two links",
            bodies={name: lw.Body(mass=1.0) for name in ("upper", "lower")},
            joints={
                "shoulder": lw.RevoluteJoint(connects=("ground", "upper")),
                "elbow": lw.RevoluteJoint(connects=("upper", "lower"), frames=(AHEAD, lw.Frame())),
            },
            tools={"tip": lw.Tool(body="lower", frame=AHEAD)},
            reference={"elbow": 1.0},
        )
    )
    x, y = planar.task_values(planar.home)
    around = circle((0.0, 0.0), np.hypot(x, y), start=np.arctan2(y, x))
    moved = np.diff(planar.follow(around, 1.0, samples=samples).positions[[0, -1]], axis=0)
    assert moved == pytest.approx(np.array([[2 * np.pi, 0.0]]), abs=1e-12)


@pytest.mark.parametrize(("turn", "samples"), [(2 * np.pi, 2), (13.0, 3), (60.0, 2)])
def test_joints_that_close_loops_count_the_turns_that_a_tool_takes_them(turn, samples):
    """The shafts of a Cardan joint turn together, never a quarter of a turn apart."""
    bend, (shaft, out) = 0.6, ("shaft", "out")
    cardan = Robot(
        lw.Mechanism(
            name="cardan",
            bodies={name: lw.Body(mass=1.0) for name in (shaft, out)},
            joints={
                "first": lw.RevoluteJoint(connects=("ground", shaft)),
                "cross": lw.UniversalJoint(connects=(shaft, out), axes=((1, 0, 0), (0, 1, 0))),
                "last": lw.RevoluteJoint(
                    connects=("ground", out), frames=(lw.Frame(rotation=(bend, 0, 0)), lw.Frame())
                ),
            },
            tools={"hand": lw.Tool(body=shaft, task=(TurnAbout(axis=(0, 0, 1)),))},
        )
    )
    value = cardan.task_values(cardan.home)
    motion = cardan.follow(line(value, value + turn), 1.0, samples=samples)
    first, last = (motion.state[name] - motion.state[name][0] for name in ("first", "last"))
    assert first == pytest.approx(turn * np.linspace(0, 1, samples), abs=1e-9)
    assert np.abs(last - first).max() < np.pi / 2
    cross = motion.state["cross.angle_1"]
    assert np.abs(cross).max() <= bend + 1e-9


def test_a_stated_task_is_led_in(arm):
    stated = Robot(scara(task=("x", "y", TurnAbout(axis=(0, 0, 2)), DistanceTo(point=(0, 0, 1)))))
    assert stated.task == ("x", "y", "turn", "distance")
    state = stated.assemble(tool=[0.4, 0.3, 1.0, 1.2])
    position, R = placed(stated, state)
    np.testing.assert_allclose(position[:2], [0.4, 0.3], atol=1e-12)
    assert np.linalg.norm(position - [0, 0, 1]) == pytest.approx(1.2, abs=1e-12)
    np.testing.assert_allclose(R[:2, 0], [np.cos(1.0), np.sin(1.0)], atol=1e-12)
    whole = stated.assemble(tool=arm.tool_pose(arm.home))
    np.testing.assert_allclose(whole.positions, arm.home.positions, atol=1e-10)


def test_a_pose_is_told_relative_to_another_body(arm):
    mechanism = scara()
    fields = {name: getattr(mechanism, name) for name in type(mechanism).model_fields}
    frame = Frame(position=(0.02, 0.01, -0.1), rotation=(0.1, 0.2, 0.3))
    tools = {"hand": Tool(body="hand", frame=frame, relative_to="upper")}
    robot = Robot(Mechanism(**(fields | {"tools": tools})))
    state = robot.state(arm.home.positions, [0.3, -0.5, 0.2, 0.7])
    poses = robot.body_poses(state)
    (p, R), (p_B, R_B) = poses["hand"], poses["upper"]
    position, orientation = placed(robot, state)
    np.testing.assert_allclose(position, R_B.T @ (p + R @ frame.position - p_B), atol=1e-14)
    own = Rotation.from_rotvec(frame.rotation).as_matrix()
    np.testing.assert_allclose(orientation, R_B.T @ R @ own, atol=1e-14)
    # The pose does not see the shoulder: three of its freedoms are led.
    values = robot.task_values(state, ("y", "z", "rz"))
    aim = robot.assemble(tool=dict(zip(("y", "z", "rz"), values + 0.05, strict=True)), guess=state)
    np.testing.assert_allclose(robot.task_values(aim, ("y", "z", "rz")), values + 0.05, atol=1e-11)


def test_derivatives_of_all_coordinates_are_those_of_finite_differences():
    random, h = np.random.default_rng(2), 1e-4
    task = (
        *NAMES[4:],
        TurnAbout(axis=(1, 2, 0.5), zero=(0.1, 0, 0.2)),
        DistanceTo(point=(1, 2, 3)),
    )
    # Of a rotation vector that is not asked for whole.
    task, k = tuple(name for name in task if name != "rz"), np.arange(-2, 3)
    read = task_map(task)
    for size in (1.0, 0.1):
        R = Rotation.from_rotvec(size * random.normal(size=3))
        p, omega, alpha, v, a = random.normal(size=(5, 3))

        def pose(t, R=R, p=p, omega=omega, alpha=alpha, v=v, a=a):
            turned = Rotation.from_rotvec(omega * t + alpha * t**2 / 2) * R
            return np.concatenate([p + v * t + a * t**2 / 2, turned.as_matrix().ravel(), [0]])

        _, E, bias = (np.array(part) for part in read(pose(0), np.append(omega, v)))
        x = np.array([np.array(read(pose(i * h), np.zeros(6))[0]).ravel() for i in k])
        slope = np.array([1, -8, 0, 8, -1]) @ x / (12 * h)
        bend = np.array([-1, 16, -30, 16, -1]) @ x / (12 * h**2)
        np.testing.assert_allclose(E @ np.append(omega, v), slope, atol=1e-8)
        second = E @ np.append(alpha, a) + bias.ravel()
        np.testing.assert_allclose(second, bend, atol=1e-4 / size)


def test_the_jacobian_and_its_derivative_are_those_of_the_motion(legs, arm):
    """Along a motion of constant independent accelerations, by differences of task values."""
    random = np.random.default_rng(7)
    tilted, aside, every = (
        [-0.02, 0.2, 0.2],
        [-0.05, 0.02, 0.1, 0.3],
        (*TILTED, "torsion", "x", "roll"),
    )
    for robot, what, moved in ((legs, None, tilted), (legs, every, tilted), (arm, None, aside)):
        start = robot.assemble(tool=robot.task_values(robot.home) + moved)
        v, a = random.uniform(-0.3, 0.3, (2, robot.mobility))
        state, h = start.with_rates(v), 1e-3
        aim = [float(start[name]) for name in robot.independent]
        values = []
        for k in range(-2, 3):
            ahead = aim + v * k * h + a * (k * h) ** 2 / 2
            given = dict(zip(robot.independent, ahead, strict=True))
            values.append(robot.task_values(robot.assemble(given, guess=start), what))
        slope = np.array([1, -8, 0, 8, -1]) @ values / (12 * h)
        bend = np.array([-1, 16, -30, 16, -1]) @ values / (12 * h**2)
        np.testing.assert_allclose(robot.jacobian(state, what) @ v, slope, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(robot.task_rates(state, what), slope, rtol=1e-7, atol=1e-9)
        found = robot.task_accelerations(state, a, what)
        np.testing.assert_allclose(found, bend, rtol=1e-5, atol=1e-6)
        # The twist is that of the body, whose mass centre is where the tool is.
        body = robot.bodies.index(next(iter(robot.mechanism.tools.values())).body)
        np.testing.assert_allclose(
            robot.tool_twist(state), robot.twists(state)[body], rtol=1e-12, atol=1e-14
        )
        place = ("x", "y", "z")
        np.testing.assert_allclose(
            robot.tool_acceleration(state, a)[3:], robot.task_accelerations(state, a, place)
        )
        stack = robot.jacobian(robot.state(np.tile(start.positions, (3, 1))), what)
        np.testing.assert_allclose(stack[2], robot.jacobian(start, what), atol=1e-14)


def test_the_jacobian_of_a_relative_pose_is_that_of_its_values():
    mechanism = scara()
    fields = {name: getattr(mechanism, name) for name in type(mechanism).model_fields}
    tool = Tool(body="hand", frame=Frame(position=(0.1, 0, 0)), relative_to="upper")
    robot, h = Robot(Mechanism(**(fields | {"tools": {"hand": tool}}))), 1e-3
    v, a, what = np.array([0.3, -0.5, 0.2, 0.7]), np.array([0.1, 0.4, -0.2, 0.3]), ("x", "z", "rz")
    values = [
        robot.task_values(robot.state(robot.home.positions + v * t + a * t**2 / 2), what)
        for t in h * np.arange(-2, 3)
    ]
    state = robot.state(robot.home.positions, v)
    slope = np.array([1, -8, 0, 8, -1]) @ values / (12 * h)
    bend = np.array([-1, 16, -30, 16, -1]) @ values / (12 * h**2)
    np.testing.assert_allclose(robot.task_rates(state, what), slope, atol=1e-10)
    np.testing.assert_allclose(robot.task_accelerations(state, a, what), bend, atol=1e-7)


def test_runs_tell_the_task_that_a_tool_states(arm):
    robot = Robot(scara(task=("x", "z", TurnAbout(), DistanceTo())))
    run = robot.simulate(robot.home, duration=0.1, save_at=[0.0, 0.05, 0.1])
    told = run["task_position"]
    assert list(told["task"].values) == ["x", "z", "turn", "distance"]
    states = robot.state(run["joint_position"].values)
    np.testing.assert_allclose(told, robot.task_values(states), atol=1e-12)
    assert "task_position" not in arm.simulate(arm.home, duration=0.1).dataset


def refused(sentence, call, *given, **named):
    with pytest.raises(lw.LinkworkError) as error:
        call(*given, **named)
    assert sentence in str(error.value)
    assert "\n" not in str(error.value)


def test_what_makes_no_task_is_refused(arm, legs):
    refused("'q' is no coordinate of a pose", Tool, body="a", task=("x", "q"))
    refused("did you mean tilt", Tool, body="a", task=("x", "tild"))
    refused("'x' is named twice", Tool, body="a", task=("x", "x"))
    refused("names no coordinate", Tool, body="a", task=())
    refused("'foo' is not a type", Tool, body="a", task=("x", {"type": "foo"}))
    refused("the axis has no length", TurnAbout, axis=(0, 0, 0))
    refused("is the name of a coordinate", Tool, body="a", task=(TurnAbout(name="rz"),))
    refused("relative to the same body", Tool, body="a", relative_to="a")
    refused("is asked for nothing", arm.assemble, tool={})
    refused("'yoll'", arm.assemble, tool={"yoll": 1.0})
    refused("give numbers", arm.assemble, tool={"x": "far"})
    refused("give 4 numbers", arm.assemble, tool=[0.0] * 5)
    refused("give 2", legs.follow, Path(swung), 1.0, what=("z", "azimuth"))
    refused(
        "3 numbers are given for z, tilt; give 2", legs.follow, Path(swung), 1.0, what=("z", "tilt")
    )
    upright = lw.paths.line([0.5, 0, 0], [0.5, 0.1, 0])
    what, start = ("x", "y", "z", "tilt"), np.append(arm.tool_pose(arm.home)[:3], 0.0)
    level = lw.paths.line(start, [0.5, 0.4, 0, 0.0])
    refused("the tool's tilt has no rate at this pose", arm.follow, level, 1.0, what=what)
    useless = Robot(scara(task=what))
    refused("x, y, z, tilt only 3 coordinates are independent", useless.follow, level, 1.0)
    refused("leg-singular", legs.follow, upright, 1.0, what=("z", "tilt_x", "torsion"))
    assert Robot(lw.robots.four_bar()).task == ()
    refused("azimuth has no rate at this pose", arm.jacobian, arm.home, ("azimuth",))
    refused("azimuth has no rate at this pose", legs.jacobian, legs.home, ("azimuth",))
    refused("led in z, rotation x, rotation y: give 3", legs.assemble, tool=[0.5, 0, 0, 0])
    bound = Robot(scara(task=("x", "y", "rx", "rz")))
    refused("only 3 coordinates are independent", bound.assemble, tool=[0.5, 0.4, 0, 0])
    refused("the tool moves at home in x, y, z, rz", bound.follow, level, 1.0)
    refused(
        "no coordinate of the tool 'angle'",
        Robot(scara(task=("x", "angle"))).assemble,
        tool=[0.5, 0],
    )
    refused("names no tool", Robot(lw.robots.bricard()).jacobian, None)


def test_no_configurations_have_no_conditioning_and_no_task_values(legs):
    """Chunks of runs and stretches between two charts may hold no saved state."""
    none = np.empty((0, legs.equations.nq))
    assert dexterity.conditioning(legs, none).shape == (0,)
    assert values(legs, none, legs.task).shape == (0, 3)


def test_a_tool_that_moves_in_too_few_directions_is_told():
    """As the platform of a 3-PRR seen from a link that it is hinged to: it only turns there."""
    tools = {"hand": Tool(body="platform", relative_to="link_1")}
    robot = Robot(lw.robots.prr3().model_copy(update={"tools": tools}))
    with pytest.raises(
        lw.LinkworkError, match="has 3 freedoms and its tool moves in 1 of them, so"
    ):
        robot.task_values(robot.home)


def test_one_freedom_is_told_as_one():
    robot = Robot(lw.robots.four_bar())
    with pytest.raises(lw.LinkworkError, match="and the robot 1 freedom; name the coordinates"):
        robot.task_values(robot.home)


def test_the_task_that_a_refusal_suggests_is_one():
    """The tip of a level pendulum moves up and down; it is not led in x."""
    level = lw.robots.pendulum()
    refused("such as task=('y',) of the tool", Robot(level).task_coordinates)
    described = level.model_dump()
    described["tools"]["mass"]["task"] = ("y",)
    assert Robot(Mechanism(**described)).task == ("y",)


def ball(**tool: object) -> Robot:
    """Return a body on a spherical joint, with a tool."""
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.3))
    joint = lw.SphericalJoint(connects=("ground", "ball"))
    tools = {"hand": Tool(body="ball", **tool)}
    return Robot(Mechanism(bodies={"ball": body}, joints={"pivot": joint}, tools=tools))


UNDETERMINED = {
    "tilt half a turn": ((np.pi, 0, 0), ("azimuth", "torsion", "tilt_x", "tilt_y")),
    "the same about y": ((0, np.pi, 0), ("azimuth", "torsion", "tilt_x", "tilt_y")),
    "pitch a quarter turn": ((0, np.pi / 2, 0), ("roll", "yaw")),
    "upright": ((0, 0, 0.7), ("azimuth",)),
}


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-12])
@pytest.mark.parametrize("pose", UNDETERMINED)
def test_coordinates_that_a_pose_does_not_determine_are_nan(pose, noise):
    robot, (turn, undetermined) = ball(), UNDETERMINED[pose]
    asked = ("azimuth", "torsion", "tilt_x", "tilt_y", "roll", "pitch", "yaw", "rx", "ry", "rz")
    x, y, z, w = (Rotation.from_rotvec([noise, noise, 0]) * Rotation.from_rotvec(turn)).as_quat()
    state = robot.state([w, x, y, z])
    for which in (state, robot.state(np.array([state.positions] * 2))):
        found = robot.task_values(which, asked)
        assert found.shape == (*which.batch, len(asked))
        for name, value in zip(asked, found.T, strict=True):
            assert np.isnan(value).all() == (name in undetermined), name
    # With a tilt of zero every azimuth is right, so that both lead the tool from there.
    if pose == "upright":
        np.testing.assert_allclose(robot.task_values(state, ("azimuth", "tilt"))[1], 0, atol=1e-11)
    else:
        assert robot.task_values(state, ("tilt",))[0] == pytest.approx(np.linalg.norm(turn))


def test_a_turn_that_a_pose_does_not_determine_is_nan():
    robot = ball(task=(TurnAbout(axis=(0, 0, 1)), "tilt_x", "tilt_y"))
    assert np.isnan(robot.task_values(robot.state([0, 1, 0, 0]))[0])
    across = robot.state([np.cos(1.5), np.sin(1.5), 0, 0])
    np.testing.assert_allclose(robot.task_values(across), [0, 0, -3], atol=1e-12)


def test_values_of_a_robot_without_a_tool_are_refused():
    with pytest.raises(lw.LinkworkError, match="names no tool"):
        robot = Robot(lw.robots.bricard())
        robot.task_values(robot.home)


def test_coordinates_that_move_with_open_loops_alone_are_refused():
    """The roll of a leaning tool stays where a platform turns about the vertical alone."""
    described = lw.robots.par4()
    (name, tool), *_ = described.tools.items()
    leaning = Tool(
        body=tool.body, frame=Frame(rotation=(0.3, 0.5, -0.2)), task=("x", "y", "z", "roll")
    )
    robot = Robot(described.model_copy(update={"tools": {name: leaning}}))
    refused("x, y, z, roll only 3 coordinates are independent", robot.jacobian, robot.home)


def test_the_task_that_a_refusal_suggests_is_what_the_robot_leads_best():
    """Of a SCARA robot whose axes lean by 0.1 rad the turn about z, and not about y."""
    leaning = scara().model_dump()
    leaning["joints"]["shoulder"]["frames"][0]["turn"] = (0.1, 0.0, 0.0)
    refused("such as task=('x', 'y', 'z', 'rz')", Robot(Mechanism(**leaning)).task_coordinates)


@pytest.mark.parametrize("turned", [(0, 0, 1.0), (np.pi, 0, 0), (0, np.pi, 0), (0.4, 0, 0)])
def test_a_planar_tool_is_seen_from_a_body_that_lies_anyhow(turned):
    """Face up by x, y and angle, face down by the angle about its own z axis, aslant in space."""
    inertia = Inertia(xx=0.01, yy=0.01, zz=0.01)
    bodies = {name: Body(mass=1, inertia=inertia) for name in ("upper", "fore")}
    elbow = tuple(Rotation.from_rotvec(turned).apply([0.5, 0, 0]))
    shoulder = (Frame(), Frame(rotation=turned))
    ahead = (Frame(position=elbow, rotation=turned), Frame())
    joints = {
        "shoulder": lw.RevoluteJoint(connects=("ground", "upper"), frames=shoulder),
        "elbow": lw.RevoluteJoint(connects=("upper", "fore"), frames=ahead),
    }
    tool = Tool(body="fore", frame=Frame(position=(0.4, 0, 0)), relative_to="upper")
    robot = Robot(Mechanism(bodies=bodies, joints=joints, tools={"tip": tool}))
    state, h = robot.state([0.3, 0.7], [0.2, -0.5]), 1e-5
    (p, R), (p_B, R_B) = (robot.body_poses(state)[name] for name in ("fore", "upper"))
    position, seen = R_B.T @ (p + R @ tool.frame.position - p_B), R_B.T @ R
    flat = abs(R_B[2, 2]) == pytest.approx(1, abs=1e-12)
    turns = [np.arctan2(seen[1, 0], seen[0, 0])] if flat else Rotation.from_matrix(seen).as_rotvec()
    expected = np.concatenate([position[: 2 if flat else 3], turns])
    np.testing.assert_allclose(robot.tool_pose(state), expected, atol=1e-12)
    what = ("x", "y", "angle") if flat else ("x", "y", "z", "roll", "pitch", "yaw")
    ahead, before = (
        robot.task_values(robot.state(state.positions + k * h * state.rates), what) for k in (1, -1)
    )
    np.testing.assert_allclose(robot.task_rates(state, what), (ahead - before) / (2 * h), atol=1e-8)
