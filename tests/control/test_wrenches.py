"""External wrenches and payloads against weight, springs, couples, T' w and bodies that are welded
on."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Wrench

from tests.control.plants import cart


def accelerations(robot, state, wrenches=(), forces=None):
    """Return the accelerations of all joints at the start of a run."""
    return robot.simulate(state, forces, duration=1e-3, wrenches=wrenches, save_at=[0.0])[
        "joint_acceleration"
    ].values[0]


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(lw.robots.prr3(gravity=(0, 0, 0)))


@pytest.fixture(scope="module")
def state(robot):
    return robot.assemble(tool=[0.52, 0.27, 0.42]).with_rates([0.3, -0.2, 0.1])


def test_weight_as_wrenches_in_space():
    """Forces m g at the mass centres of all bodies of a weightless delta robot are gravity."""
    heavy = lw.robots.delta()
    light = heavy.model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    weights = [
        Wrench(name, force=body.mass * np.array(heavy.gravity), point=body.centre_of_mass)
        for name, body in heavy.bodies.items()
        if body.mass
    ]
    with_weight, without = lw.Robot(heavy), lw.Robot(light)
    pose = with_weight.tool_pose(with_weight.home)[:3] + np.array([0.03, 0.02, 0.04])
    expected = accelerations(with_weight, with_weight.assemble(tool=pose))
    assert np.allclose(
        accelerations(without, without.assemble(tool=pose), weights), expected, 1e-9, 1e-9
    )
    assert not np.allclose(
        accelerations(without, without.assemble(tool=pose)), expected, 1e-3, 1e-3
    )


def test_a_traced_wrench_is_a_spring_between_points(robot, state):
    spring = lw.PointSpring(
        connects=("ground", "platform"),
        points=((0.1, 0.5, 0), (0.05, -0.02, 0)),
        stiffness=40.0,
        rest_length=0.2,
    )
    sprung = lw.Robot(robot.mechanism.model_copy(update={"springs": {"s": spring}}))

    def pull(t, seen):
        body = seen.body("platform")
        gap = np.array([0.1, 0.5, 0]) - (body.position + body.rotation @ np.array([0.05, -0.02, 0]))
        return 40.0 * (1 - 0.2 / lw.math.norm(gap)) * gap

    expected = accelerations(sprung, sprung.state(state.positions, state.rates))
    found = accelerations(robot, state, [Wrench("platform", force=pull, point=(0.05, -0.02, 0))])
    assert np.allclose(found, expected, 1e-10, 1e-10)


def test_a_moment_is_a_couple_in_either_frame(robot, state):
    moment = accelerations(robot, state, [Wrench("link_2", moment=[0, 0, 0.6])])
    couple = [
        Wrench("link_2", force=[0, s * 2.0, 0], point=(0.1 + s * 0.15, 0, 0), frame="body")
        for s in (1, -1)
    ]
    assert np.allclose(accelerations(robot, state, couple), moment, 1e-10, 1e-10)


def test_body_and_ground_axes_differ_by_the_bodys_orientation(robot, state):
    _, R = robot.body_poses(state)["platform"]
    local = np.array([1.0, 2.0, 0.0])
    first = accelerations(
        robot, state, [Wrench("platform", force=local, point=(0.1, 0, 0), frame="body")]
    )
    second = accelerations(robot, state, [Wrench("platform", force=R @ local, point=(0.1, 0, 0))])
    assert np.allclose(first, second, 1e-11, 1e-11)


def test_generalised_forces_are_T_transposed_w(robot, state):
    """M v' changes by T_i' [moment; force] of the platform, whose mass centre is its origin."""
    w = np.array([0, 0, 0.7, 3.0, -2.0, 0])
    push = Wrench("platform", moment=w[:3], force=w[3:])
    change = (accelerations(robot, state, [push]) - accelerations(robot, state))[:3]
    T = robot.twist_map(state)[-6:]
    assert np.allclose(robot.mass_matrix(state) @ change, T.T @ w, 1e-10, 1e-10)


def test_a_sampled_wrench_acts_over_time():
    plant = cart(mass=2.0)
    times = np.linspace(0, 1, 101)
    push = lw.Sampled(times, np.stack([np.sin(5 * times), 0 * times, 0 * times], axis=1))
    run = plant.simulate(
        plant.home, duration=1.0, wrenches=[Wrench("cart", force=push)], save_at=times
    )
    assert np.allclose(run["joint_rate"].values[:, 0], (1 - np.cos(5 * times)) / 10, 0, 1e-7)
    recorded = run["external_wrench"].sel(wrench_component="force_x").values[:, 0]
    assert np.allclose(recorded, np.sin(5 * times), 0, 1e-6)


def test_constants_of_a_wrench_are_not_compiled_in(robot, state, monkeypatch):
    from linkwork.kernels import kernel

    accelerations(robot, state, [Wrench("platform", force=[1.0, 0, 0])])
    monkeypatch.setattr(kernel, "load", lambda *args: pytest.fail("compiled anew"))
    accelerations(robot, state, [Wrench("platform", force=[2.0, 5.0, 0])])


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Wrench("platfrom", force=[1, 0, 0]), "there is no body 'platfrom' for a wrench"),
        (
            lambda: Wrench("platform", force=[1, 0]),
            r"the force of the wrench on 'platform' is \[1, 0\]; give three numbers",
        ),
        (lambda: Wrench("platform", force="abc"), "the force of the wrench on 'platform' is 'abc'"),
        (
            lambda: Wrench("platform", moment=[0, 0, np.inf]),
            r"the moment of the wrench on 'platform'\[2\] is inf",
        ),
        (
            lambda: ("platform", [1, 0, 0]),
            r"one of wrenches is \('platform', .*; give linkwork.control.Wrench",
        ),
        (
            lambda: Wrench("platform", force=lw.Sampled([0, 1e-9], np.zeros((2, 3)))),
            "the wrench on 'platform' reads a signal",
        ),
        (
            lambda: Wrench("platform", frame="tool"),
            "the frame of the wrench on 'platform' is 'tool'",
        ),
        (lambda: Wrench("platform", point=(1, 2)), "the point of the wrench on 'platform'"),
        (
            lambda: Wrench("platform", force=lambda t, s: [1, 2]),
            "the wrench on 'platform' returns 2 values",
        ),
    ],
)
def test_refusals(robot, state, make, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        accelerations(robot, state, [make()])


def test_one_wrench_is_no_list_of_them(robot, state):
    with pytest.raises(lw.LinkworkError, match=r"wrenches are Wrench.*; give a list"):
        robot.simulate(state, duration=0.1, wrenches=Wrench("platform"))


def test_an_undefined_wrench_is_named(robot):
    lost = Wrench("platform", force=lambda t, s: [lw.math.log(0.02 - t), 0, 0])
    run = robot.simulate(robot.home, duration=0.05, wrenches=[lost])
    assert (
        run.status is lw.Status.NON_FINITE
        and "the wrench on 'platform' is infinite or undefined" in run.message
    )


# Payloads


def welded(mechanism, payload, frame):
    """Return the mechanism with the payload as a body of its own, fixed to the tool's body."""
    tool = next(iter(mechanism.tools.values()))
    joint = lw.FixedJoint(connects=(tool.body, "payload"), frames=(frame, lw.Frame()))
    bodies, joints = {**mechanism.bodies, "payload": payload}, {**mechanism.joints, "weld": joint}
    return mechanism.model_copy(update={"bodies": bodies, "joints": joints})


@pytest.mark.parametrize(
    ("make", "inertia"),
    [
        (lw.robots.prr3, lw.Inertia(zz=0.01)),
        (lw.robots.puma560, lw.Inertia(xx=0.3, yy=0.2, zz=0.4, xy=0.02, xz=-0.03, yz=0.01)),
    ],
)
def test_a_payload_is_a_welded_body(make, inertia):
    mechanism = make()
    name, tool = next(iter(mechanism.tools.items()))
    planar = inertia.planar
    frame = lw.Frame(
        position=(0.02, 0.03, 0.0 if planar else 0.1),
        rotation=(0, 0, 0.4) if planar else (0.3, -0.2, 0.5),
    )
    mechanism = mechanism.model_copy(update={"tools": {name: lw.Tool(body=tool.body, frame=frame)}})
    payload = lw.Body(
        mass=1.7, centre_of_mass=(0.04, -0.05, 0.0 if planar else 0.06), inertia=inertia
    )
    carrying = lw.Robot(mechanism.with_payload(1.7, payload.centre_of_mass, inertia))
    other = lw.Robot(welded(mechanism, payload, frame))
    state = carrying.home.with_rates(np.linspace(-1, 1, carrying.mobility))
    same = other.state(
        dict(zip(carrying.coordinates, state.positions, strict=True)),
        dict(zip(carrying.independent, state.rates, strict=True)),
    )
    order = [other.independent.index(rate) for rate in carrying.independent]
    M = other.mass_matrix(same)[np.ix_(order, order)]
    assert np.allclose(carrying.mass_matrix(state), M, 1e-10, 1e-12)
    u = np.linspace(1, 2, len(carrying.actuators))
    assert np.allclose(
        carrying.forward_dynamics(state, u), other.forward_dynamics(same, u)[order], 1e-9, 1e-10
    )


def test_payload_refusals():
    mechanism = lw.robots.prr3()
    with pytest.raises(lw.LinkworkError, match="there is no tool 'gripper'; the tools are centre"):
        mechanism.with_payload(1.0, tool="gripper")
    with pytest.raises(lw.LinkworkError, match="mass"):
        mechanism.with_payload(-1.0)
    with pytest.raises(lw.LinkworkError, match="xx and yy"):
        lw.robots.puma560().with_payload(1.0, inertia=lw.Inertia(zz=0.1))
