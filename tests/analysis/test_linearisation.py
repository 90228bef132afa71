"""Linear models, natural modes, stiffness: closed forms, finite differences on the manifold,
quasi-coordinates."""

import sys

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import (
    jacobians,
    linearise,
    natural_modes,
    stiffness_matrix,
    tool_stiffness,
)

from tests.analysis.mechanisms import arm, cart
from tests.catalogue import built
from tests.products import first
from tests.robot.mixed_freedoms import three_legs

G = 9.81


def nudged(robot, state, xi):
    """Return the closed state at a small shift of the independent joints."""
    chart = robot.chart_of(state)
    q = state.q + robot.assembler.still(state.q)["derivatives"] @ chart.tree_rates(state.q, xi)
    for _ in range(4):
        q, _ = chart.kernel("closure_step")(q)
    return lw.State(
        *robot.kernel("positions")(q), state.rates, q, state.coordinates, state.independent
    )


def by_differences(robot, state, forces, h=1e-6):
    """Return d v'/d xi and d v'/d v by central differences of the forward dynamics."""
    n = len(state.independent)
    slopes = []
    for of in (lambda e: nudged(robot, state, e), lambda e: state.with_rates(state.rates + e)):
        ends = [
            [robot.forward_dynamics(of(sign * h * e), forces) for e in np.eye(n)]
            for sign in (1, -1)
        ]
        slopes.append((np.array(ends[0]) - np.array(ends[1])).T / (2 * h))
    return np.hstack(slopes)


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "name", first(4, ["prr3", "stewart", "flyball_governor", "four_bar", "five_bar", "delta"])
)
def test_it_is_the_slope_of_the_forward_dynamics_in_motion(name):
    robot, random = built(name), np.random.default_rng(5)
    state = robot.home.with_rates(0.3 * random.standard_normal(robot.mobility))
    forces = random.standard_normal(len(robot.actuators))
    model = linearise(robot, state, forces)
    n = robot.mobility
    expected = by_differences(robot, state, forces)
    np.testing.assert_allclose(
        model.A[n:], expected, rtol=1e-5, atol=1e-6 * max(1, np.abs(expected).max())
    )
    np.testing.assert_allclose(model.A[:n], np.hstack([np.zeros((n, n)), np.eye(n)]), atol=1e-12)
    M, S = robot.mass_matrix(state), robot.actuation(state)
    np.testing.assert_allclose(model.B[n:], np.linalg.solve(M, S.T), rtol=1e-9, atol=1e-12)
    assert not model.B[:n].any() and not model.D.any()


@pytest.mark.long
def test_shifts_of_a_turning_body_change_by_its_turn_too():
    """Rates wx, wy, wz are no derivatives of coordinates: xi = S^+ (q_near - q) followed over time
    by differences."""
    robot, random = built("stewart"), np.random.default_rng(3)
    pose = tuple(f"pose.{rate}" for rate in ("x", "y", "z", "wx", "wy", "wz"))
    state = robot.in_chart(robot.home.with_rates(0.5 * random.standard_normal(6)), pose)
    chart = robot.chart_of(state)
    tree, columns = robot.equations.tree, list(chart.equations.chart.independent)

    def moving(q, v):
        return robot.assembler.still(q)["derivatives"] @ chart.tree_rates(q, v)

    def read(q, dq):
        return np.linalg.lstsq(robot.assembler.still(q)["derivatives"], dq, rcond=None)[0][columns]

    A = linearise(robot, state, robot.holding_forces(state)).A[:6]
    xi, dv = random.standard_normal(6), random.standard_normal(6)
    small, h = 1e-6, 1e-4
    near = [nudged(robot, state, sign * small * xi).q for sign in (1, -1)]
    at = []
    for t in (h, -h):
        q = state.q + t * moving(state.q, state.rates)
        ends = [
            one + t * moving(one, state.rates + sign * small * dv)
            for sign, one in zip((1, -1), near, strict=True)
        ]
        at.append(read(q, (ends[0] - ends[1]) / (2 * small)))
    slope = (at[0] - at[1]) / (2 * h)
    np.testing.assert_allclose(A @ np.concatenate([xi, dv]), slope, atol=1e-6)
    assert np.abs(A[:, :6]).max() > 0.1
    assert tree.quaternions


def test_a_mass_on_a_spring_and_damper():
    m, k, d = 2.0, 50.0, 3.0
    model = linearise(cart(m, k, d), cart(m, k, d).state({"slide": 0.3}, {"slide": 0.2}))
    np.testing.assert_allclose(model.A, [[0, 1], [-k / m, -d / m]], atol=1e-12)
    np.testing.assert_allclose(model.B, [[0], [1 / m]])
    np.testing.assert_allclose(
        model.poles,
        [
            (-d - 1j * np.sqrt(4 * m * k - d**2)) / (2 * m),
            (-d + 1j * np.sqrt(4 * m * k - d**2)) / (2 * m),
        ],
    )
    assert model.states == ("slide", "slide rate") and model.inputs == ("slide",)
    assert model.controllable
    modes = natural_modes(cart(m, k), cart(m, k).state({"slide": 0.1}))
    assert modes.stable and modes.frequencies == pytest.approx([np.sqrt(k / m) / (2 * np.pi)])
    assert modes.dataset.frequency.attrs["units"] == "Hz"


def test_pendulums_swing_as_the_books_say():
    """One: sqrt(g/l); two equal ones: omega^2 = (2 -+ sqrt 2) g/l, the second mass sqrt 2 times as
    far, with or against."""
    one = built("pendulum")
    assert natural_modes(one, one.state({"hinge_1": -np.pi / 2})).frequencies == pytest.approx(
        [np.sqrt(G) / (2 * np.pi)]
    )
    two = arm(0.5, 0.5)
    modes = natural_modes(two, two.state({"hinge_1": -np.pi / 2, "hinge_2": 0.0}))
    expected = np.sqrt((2 + np.array([-1, 1]) * np.sqrt(2)) * G / 0.5) / (2 * np.pi)
    np.testing.assert_allclose(modes.frequencies, expected, rtol=1e-12)
    angles = np.cumsum(modes.shapes, axis=0)
    np.testing.assert_allclose(angles[1] / angles[0], [np.sqrt(2), -np.sqrt(2)], rtol=1e-9)
    np.testing.assert_allclose(modes.shapes.T @ modes.M @ modes.shapes, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(modes.joints, modes.shapes)
    upright = natural_modes(one, one.state({"hinge_1": np.pi / 2}))
    assert not upright.stable and upright.frequencies == pytest.approx([-np.sqrt(G) / (2 * np.pi)])


def test_stiffness_is_the_second_derivative_of_the_potential_energy():
    robot = built("delta")
    state, h = robot.home, 1e-4
    u = robot.holding_forces(state)
    K = stiffness_matrix(robot, state, u)
    places = [robot.coordinates.index(name) for name in robot.actuators]

    def potential(xi):
        near = nudged(robot, state, xi)
        return robot.energy(near)[1] - u @ near.positions[places]

    e = h * np.eye(3)
    expected = [
        [
            (potential(a + b) - potential(a - b) - potential(b - a) + potential(-a - b))
            / (4 * h * h)
            for a in e
        ]
        for b in e
    ]
    np.testing.assert_allclose(K, expected, atol=1e-5 * np.abs(K).max())
    np.testing.assert_allclose(K, K.T, atol=1e-9 * np.abs(K).max())


@pytest.mark.parametrize("name", ["stewart", "prr3"])
def test_the_tool_s_stiffness_is_the_actuators_seen_through_the_jacobian(name):
    """K_x = K' k K with q' = K x'."""
    robot = built(name)
    k = 1e5 * np.arange(1, len(robot.actuators) + 1)
    stiffness, compliance = tool_stiffness(
        robot, robot.home, dict(zip(robot.actuators, k, strict=True))
    )
    K = jacobians(robot)(robot.home.q)[0]
    order = [3, 4, 5, 0, 1, 2] if name == "stewart" else [3, 4, 2]
    expected = K.T @ (k[:, None] * K)
    np.testing.assert_allclose(
        stiffness[np.ix_(order, order)], expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max()
    )
    np.testing.assert_allclose(
        stiffness @ compliance @ stiffness,
        stiffness,
        rtol=1e-7,
        atol=1e-6 * np.abs(stiffness).max(),
    )


def test_weight_adds_to_the_tool_s_stiffness():
    """A pendulum hanging down on a joint spring: turning stiffness k + m g l, to the side
    (k + m g l) / l^2."""
    robot = built("pendulum")
    hanging = robot.state({"hinge_1": -np.pi / 2})
    stiffness, _ = tool_stiffness(robot, hanging, {"hinge_1": 5.0}, forces=[0.0])
    _, compliance = tool_stiffness(robot, hanging, {"hinge_1": 5.0})
    assert 1 / tool_stiffness(robot, hanging, {"hinge_1": 5.0}, forces=[0.0])[1][
        3, 3
    ] == pytest.approx(5.0 + G)
    assert 1 / compliance[3, 3] == pytest.approx(5.0)
    assert stiffness[4, 4] == pytest.approx(0, abs=1e-9)


def test_stiffness_without_symmetry_is_the_inverse_of_the_compliance():
    """A thrust follows an arm: the tool's stiffness in the plane was told as if it did not, and
    natural modes of what is symmetric of it were 2.6 % off those of the poles."""
    described = lw.robots.double_pendulum()
    tip = described.first_tool.body
    fan = lw.mechanism.Thrust(body=tip, force=(0.0, 1.0, 0.0))
    fields = {name: getattr(described, name) for name in type(described).model_fields}
    made = {**fields, "transmissions": {"fan": fan}, "actuators": ("fan",)}
    robot = lw.Robot(lw.Mechanism(**made))
    state = robot.state([0.3, 0.9])
    springs = dict.fromkeys(robot.independent, 50.0)
    stiffness, compliance = tool_stiffness(robot, state, springs, forces=[20.0])
    assert np.abs(compliance - compliance.T).max() > 0.01 * np.abs(compliance).max()
    np.testing.assert_allclose(compliance @ stiffness @ compliance, compliance, atol=1e-12)
    held = lw.analysis.equilibrium(robot, [20.0], guess=state, stable=False)
    with pytest.raises(lw.LinkworkError, match="under what fan exert the stiffness is not symm"):
        natural_modes(robot, held.state, [20.0])
    ball = lw.SphericalJoint(connects=("ground", "arm"), spring={"turn": lw.Spring(stiffness=30)})
    body = lw.Body(
        mass=2, centre_of_mass=(0.3, 0.1, 0.2), inertia=lw.Inertia(xx=0.1, yy=0.2, zz=0.25)
    )
    hung = lw.Mechanism(bodies={"arm": body}, joints={"b": ball}, actuators=ball.rates("b"))
    hung = lw.Robot(hung)
    with pytest.raises(lw.LinkworkError, match=r"under what b\.wx, b\.wy, b\.wz exert"):
        natural_modes(hung, hung.home)


def test_outputs_are_joints_and_their_rates():
    robot = built("prr3")
    state = robot.home.with_rates([0.3, -0.2, 0.1])
    model = linearise(robot, state, outputs=("wrist_2", "wrist_2 rate"))
    xi, h = np.array([0.3, -0.5, 0.7]), 1e-6
    ends = [nudged(robot, state, sign * h * xi) for sign in (1, -1)]
    slope = (ends[0]["wrist_2"] - ends[1]["wrist_2"]) / (2 * h)
    k = robot.rates.index("wrist_2")
    turn = np.diff([robot.joint_rates(one)[k] for one in reversed(ends)])[0] / (2 * h)
    np.testing.assert_allclose(model.C @ np.append(xi, np.zeros(3)), [slope, turn], atol=1e-7)
    np.testing.assert_allclose(model.C[1, 3:], robot.rate_map(state)[k], atol=1e-12)


@pytest.mark.parametrize(("name", "what"), [("prr3", "xy angle"), ("legs", "z tilt_x ry torsion")])
def test_outputs_and_forces_of_the_tool_are_those_of_its_task(name, what):
    robot = lw.Robot(three_legs("RRS")) if name == "legs" else built("prr3")
    state = robot.assemble(tool=robot.task_values(robot.home) + 0.05)
    state, names = state.with_rates([0.3, -0.2, 0.1]), tuple(what.replace("xy", "x y").split())
    outputs = [f"tool {x}{rate}" for rate in ("", " rate") for x in names]
    model = linearise(robot, state, outputs=outputs, inputs=("tool " + names[0], *robot.actuators))
    xi, h, k = np.array([0.3, -0.5, 0.7]), 1e-6, len(names)
    ends = [nudged(robot, state, sign * h * xi) for sign in (1, -1)]
    slopes = [
        np.subtract(*[read(one, names) for one in ends]) / (2 * h)
        for read in (robot.task_values, robot.task_rates)
    ]
    found = model.C @ np.append(xi, np.zeros(3))
    np.testing.assert_allclose(found, np.concatenate(slopes), atol=1e-6)
    np.testing.assert_allclose(model.C[k:, 3:], model.C[:k, :3], atol=1e-12)
    # A force on a task coordinate does what the actuators' forces do that it is worth, J' f.
    asked = names[:3] if name == "prr3" else ("z", "rx", "ry")
    with_forces = linearise(robot, state, inputs=[f"tool {x}" for x in asked])
    J = jacobians(robot, asked)(state.q)[1]
    np.testing.assert_allclose(with_forces.B, model.B[:, 1:] @ J.T, atol=1e-9)
    np.testing.assert_allclose(with_forces.B[:, 0], model.B[:, 0], atol=1e-12)
    assert model.inputs == ("tool " + names[0], *robot.actuators) and model.outputs == (*outputs,)


def test_a_component_of_the_rotation_vector_is_one_whatever_forces_are_asked_for():
    """All three among the outputs are turns; one of them is not, though the others are inputs."""
    robot = built("agile_wrist")
    turn = np.array([0.3, -0.4, 0.5])
    state = robot.assemble(tool=robot.task_values(robot.home) + turn)
    outputs, J = ("tool rx", "tool rx rate"), robot.jacobian(state, ("rx",))[0]
    for inputs in (("tool ry", "tool rz"), robot.actuators):
        model = linearise(robot, state, outputs=outputs, inputs=inputs)
        np.testing.assert_allclose(model.C[0, :3], J, rtol=1e-12)
    pushed = linearise(robot, state, outputs=("tool ry", "tool rz"), inputs=("tool rx",)).B[3:, 0]
    np.testing.assert_allclose(robot.mass_matrix(state) @ pushed, J, rtol=1e-9)


def test_forces_on_the_tool_press_on_what_rubs():
    """m a = t.f - mu (m g cos A - n.f) - m g sin A of a block that slides up a slope A, t along it,
    n across."""
    slope, mu, mass = 0.4, 0.3, 2.0
    block = lw.PrismaticJoint(
        connects=("ground", "block"),
        axis=(1, 0, 0),
        frames=(lw.Frame(rotation=(0, 0, slope)), lw.Frame()),
        bearing=lw.SlidingBearing(friction=lw.Sliding(coefficient=mu, rate=1e-7)),
    )
    described = lw.Mechanism(
        bodies={"block": lw.Body(mass=mass, inertia=lw.Inertia(zz=0.01))},
        joints={"slide": block},
        gravity=(0, -G, 0),
        tools={"tool": lw.Tool(body="block")},
    )
    robot = lw.Robot(described)
    model = linearise(robot, robot.home.with_rates([1.0]), inputs=("tool x", "tool y"))
    c, s = np.cos(slope), np.sin(slope)
    np.testing.assert_allclose(model.B[1] * mass, [c - mu * s, s + mu * c], rtol=1e-12)


def test_a_mass_on_a_spring_answers_forces_of_all_frequencies():
    m, k, d = 2.0, 50.0, 3.0
    model = linearise(cart(m, k, d), cart(m, k, d).home, outputs=("slide",))
    omega = 2 * np.pi * np.array([[0.0, 0.3, 0.8], [1.0, 5.0, 20.0]])
    expected = 1 / (k - m * omega**2 + 1j * d * omega)
    np.testing.assert_allclose(model.response(omega / (2 * np.pi))[..., 0, 0], expected, rtol=1e-10)


def test_what_no_actuator_drives_is_not_controllable():
    described = lw.robots.pendulum((1.0, 1.0), (1.0, 1.0))
    for actuators, expected in ((("hinge_1",), True), ((), False)):
        robot = lw.Robot(described.model_copy(update={"actuators": actuators}))
        assert (
            linearise(robot, robot.state({"hinge_1": -np.pi / 2, "hinge_2": 0.0})).controllable
            is expected
        )


def test_it_becomes_a_system_of_python_control():
    system = linearise(cart(), cart().home).to_control()
    assert system.nstates == 2 and system.input_labels == ["slide"]


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (
            lambda: linearise(arm(), arm().state({"hinge_1": [0, 1], "hinge_2": [1, 1]})),
            "one state, not a stack",
        ),
        (lambda: linearise(arm(), arm().home, [1.0]), "2 numbers"),
        (lambda: linearise(arm(), arm().home, {"hinge_7": 1.0}), "there is no actuator 'hinge_7'"),
        (lambda: linearise(arm(), arm().home, outputs=("elbow",)), "there is no output 'elbow'"),
        (lambda: linearise(arm(), arm().home, outputs=("tool w",)), "coordinate of the tool 'w'"),
        (lambda: linearise(arm(), arm().home, inputs=("slide",)), "there is no input 'slide'"),
        (lambda: linearise(arm(), arm().home).response("low"), "the frequencies"),
        (lambda: natural_modes(arm(), arm().home, [0.0, 0.0]), "no equilibrium under these forces"),
        (lambda: natural_modes(arm(), arm().home.with_rates([1.0, 0.0])), "the state moves"),
        (lambda: tool_stiffness(arm(), arm().home, {"hinge_1": 1.0}), "leave the robot loose"),
        (lambda: tool_stiffness(arm(), arm().home, {"hinge_1": -1.0}), "not below zero"),
        (lambda: tool_stiffness(arm(), arm().home, {"hinge": 1.0}), "there is no rate 'hinge'"),
    ],
)
def test_refusals(ask, told):
    with pytest.raises(lw.LinkworkError, match=told) as refusal:
        ask()
    assert "\n" not in str(refusal.value)


def test_without_python_control_a_sentence_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(lw.LinkworkError, match=r"install linkwork\[control\]"):
        linearise(cart(), cart().home).to_control()
