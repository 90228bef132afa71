"""Robots in micrometres and micrograms, or a million times larger and heavier: analyses give the
answers scaled likewise."""

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.cli.poses import modes_at

from tests.oracle.scaling import Scale
from tests.products import sampled

SCALES = [(1e-6, 1e-6), (1e6, 1e6)]
MADE = {
    "pendulum": lw.robots.pendulum(),
    "double_pendulum": lw.robots.double_pendulum(),
    "five_bar": lw.robots.five_bar(),
    "rpr3": lw.robots.rpr3(gravity=(0.0, -9.81, 0.0)),
}


def pair(name, L, M):
    """Return the scale, the robot and the scaled robot."""
    scale = Scale(MADE[name], L, M)
    return scale, lw.Robot(MADE[name]), lw.Robot(scale.mechanism)


@pytest.mark.parametrize(("units", "name"), sampled(SCALES, ["pendulum", "double_pendulum"]))
def test_equilibria_and_their_vibrations_are_the_same(units, name):
    L, M = units
    scale, plain, robot = pair(name, L, M)
    expected, found = (analysis.equilibria(one, starts=6) for one in (plain, robot))
    assert [one.stable for one in found] == [one.stable for one in expected]
    for one, other in zip(found, expected, strict=True):
        assert np.allclose(one.state.positions, other.state.positions, rtol=0, atol=1e-7)
        assert np.allclose(one.stiffness / scale.energy, other.stiffness, rtol=1e-6)
        vibrations = [
            analysis.natural_modes(*which).frequencies
            for which in ((robot, one.state), (plain, other.state))
        ]
        assert np.allclose(*vibrations, rtol=1e-6)


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_a_parallel_robot_is_held_vibrates_and_yields_the_same(L, M):
    scale, plain, robot = pair("rpr3", L, M)
    forces = analysis.natural_modes(plain, plain.home), analysis.natural_modes(robot, robot.home)
    assert np.allclose(forces[1].frequencies, forces[0].frequencies, rtol=1e-6)
    u = plain.inverse_dynamics(plain.home, np.zeros(3))
    there = analysis.equilibrium(plain, u, stable=False).state
    found = analysis.equilibrium(robot, u * scale.forces(robot.actuators), stable=False).state
    assert np.allclose(found.positions / scale.coordinates(), there.positions, rtol=0, atol=1e-9)
    with pytest.raises(lw.LinkworkError, match="no equilibrium under these forces"):
        analysis.natural_modes(robot, robot.home, 0.99 * u * scale.forces(robot.actuators))
    with pytest.raises(lw.LinkworkError, match="the state moves"):
        analysis.natural_modes(robot, robot.home.with_rates(1e-3 * scale.rates(robot.independent)))
    per_leg = {name: 1e5 for name in plain.actuators}
    own = np.repeat([1.0, L], 3)
    K, C = analysis.tool_stiffness(plain, plain.home, per_leg)
    K_own, C_own = analysis.tool_stiffness(robot, robot.home, {name: 1e5 * M for name in per_leg})
    assert np.allclose(
        K_own * own * own[:, None] / scale.energy, K, rtol=1e-9, atol=1e-9 * np.abs(K).max()
    )
    assert np.allclose(
        C_own / own / own[:, None] * scale.energy, C, rtol=1e-9, atol=1e-9 * np.abs(C).max()
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("units", "led"), sampled(SCALES, [("five_bar", None), ("rpr3", (0.5, 0.3, 0.9))])
)
def test_the_same_starts_end_in_the_same_modes(units, led):
    (L, M), (name, tool) = units, led
    scale, plain, robot = pair(name, L, M)
    lengths = [L, L, 1.0][: plain.mobility]
    pose = plain.tool_pose(plain.home)[: plain.mobility] if tool is None else np.array(tool)
    modes = [
        (analysis.assembly_modes(plain), analysis.assembly_modes(robot)),
        (analysis.working_modes(plain, pose), analysis.working_modes(robot, pose * lengths)),
    ]
    for expected, found in modes:
        assert len(found) == len(expected) > 1
        assert abs(found.converged - expected.converged) < 1e-3 * expected.starts
        assert np.allclose(
            found.states.positions / scale.coordinates(),
            expected.states.positions,
            rtol=0,
            atol=1e-7,
        )
        assert np.array_equal(found.signs, expected.signs)


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_the_same_poses_are_reached_and_as_well_conditioned(L, M):
    _, plain, robot = pair("rpr3", L, M)
    x, y = np.linspace(-0.5, 1.5, 15), np.linspace(-0.5, 1.3, 15)
    limits = {f"slide_{i}": (0.3, 0.9) for i in (1, 2, 3)}
    expected = analysis.workspace(plain, {"x": x, "y": y, "angle": 1.0}, limits=limits)
    limits = {name: (L * lower, L * upper) for name, (lower, upper) in limits.items()}
    found = analysis.workspace(robot, {"x": L * x, "y": L * y, "angle": 1.0}, limits=limits)
    assert 0.05 < expected.reachable.mean() < 0.95
    assert np.array_equal(found.reachable.values, expected.reachable.values)
    for name in ("conditioning", "det_A", "det_B"):
        assert np.allclose(
            found[name].values, expected[name].values, rtol=1e-6, atol=1e-9, equal_nan=True
        )


@pytest.mark.parametrize(("L", "M"), SCALES)
@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_a_pose_is_singular_whatever_its_units(angle, L, M):
    _, plain, robot = pair("rpr3", L, M)
    pose = np.array([0.5, 0.5 / np.sqrt(3), angle])
    expected = analysis.singularity(plain, plain.assemble(tool=pose))
    found = analysis.singularity(robot, robot.assemble(tool=pose * [L, L, 1.0]))
    assert found.kinds == expected.kinds == (("II",) if angle == 0 else ())
    assert np.allclose(
        [found.leg, found.actuator], [expected.leg, expected.actuator], rtol=1e-6, atol=1e-9
    )
    assert found.tool.keys() == expected.tool.keys()


@pytest.mark.parametrize(("L", "M"), [*SCALES, (1e-9, 1.0)])
def test_input_output_relations_are_the_same_but_for_units(L, M):
    _, plain, robot = pair("rpr3", L, M)
    (A, B), (A_own, B_own) = (analysis.input_output(one, one.home) for one in (plain, robot))
    relation = A_own / np.diag(B_own)[:, None] / L * [L, L, 1.0]
    assert np.allclose(relation, A / np.diag(B)[:, None], rtol=1e-9, atol=1e-12)


def test_steps_of_a_grid_in_nanometres_are_compared_with_each_other():
    mapped = analysis.workspace(
        lw.Robot(Scale(MADE["rpr3"], 1e-8).mechanism),
        {"x": [0.0, 4e-9, 5e-9], "y": [0.0, 1e-9, 2e-9], "angle": 1.0},
    )
    with pytest.raises(lw.LinkworkError, match="equally spaced"):
        analysis.inscribed(mapped)


@pytest.mark.parametrize(
    ("L", "M", "T"), [(1.0, 1.0, 1.0), (1e-6, 1e6, 1e4), (1e6, 1e-6, 1e-4), (1e-6, 1e-6, 1e-4)]
)
@pytest.mark.parametrize(("length", "expected"), [(0.3, True), (0.5, False)])
@pytest.mark.parametrize("driven", [("cart",), ("cart", "pole_1")])
def test_a_cart_reaches_two_pendulums_unless_they_are_alike(length, expected, driven, L, M, T):
    """Pendulums of equal length on one cart swing against each other, whatever its force does."""
    joints: dict[str, lw.mechanism.Joint] = {
        "cart": lw.PrismaticJoint(connects=("ground", "cart"), axis=(1, 0, 0))
    }
    bodies = {"cart": lw.Body(mass=2.0)}
    for name, own in (("pole_1", 0.5), ("pole_2", length)):
        bodies[name] = lw.Body(mass=1.0, centre_of_mass=(0, -own, 0), inertia=lw.Inertia(zz=0.01))
        joints[name] = lw.RevoluteJoint(connects=("cart", name))
    mechanism = lw.Mechanism(bodies=bodies, joints=joints, actuators=driven, gravity=(0, -9.81, 0))
    robot = lw.Robot(Scale(mechanism, L, M, T).mechanism)
    model = analysis.linearise(robot, robot.home)
    assert model.controllable is (expected or len(driven) == 2)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("units", "name"),
    sampled([(1e-6, 1e-6, 1e4), (1e6, 1e6, 1e-4), (1e-6, 1.0, 1e-4)], ["five_bar", "rpr3"]),
)
def test_the_same_parameters_are_seen_excited_and_identified(units, name):
    L, M, T = units
    mechanism = MADE[name]
    scale = Scale(mechanism, L, M, T)
    plain, robot = lw.Robot(mechanism), lw.Robot(scale.mechanism)
    effect = f"{plain.actuators[0]}.friction.viscous"
    bases = [analysis.base_parameters(one, [effect]) for one in (plain, robot)]
    assert np.array_equal(bases[1].columns, bases[0].columns)
    slide = L if name == "rpr3" else 1.0
    moments = [M, *3 * [M * L], *6 * [M * L**2]]
    dimensions = np.array([*moments * len(plain.bodies), M * L**2 / slide**2 / T])
    dimensions = dimensions[bases[0].columns]
    assert np.allclose(bases[1].described / dimensions, bases[0].described, rtol=1e-6, atol=1e-9)
    found = []
    for one, time, factors in ((plain, 1.0, 1.0), (robot, T, slide)):
        middle = one.home.positions[[one.coordinates.index(actuator) for actuator in one.actuators]]
        ranges = {
            actuator: (at - 0.1 * factors, at + 0.1 * factors)
            for actuator, at in zip(one.actuators, middle, strict=True)
        }
        bounds = {"rates": 0.5 * factors / time, "accelerations": 2.0 * factors / time**2}
        wanted = analysis.exciting_trajectory(
            one, period=2.0 * time, ranges=ranges, **bounds, effects=[effect], trials=8
        )
        motion = wanted.motion(one, 41)
        measured = analysis.Measured(
            motion.state,
            motion.accelerations,
            one.inverse_dynamics(motion.state, motion.accelerations),
        )
        found.append((wanted, analysis.identify(one, measured, [effect])))
    (wanted, known), (own, identified) = found
    assert np.allclose(own.coefficients / slide, wanted.coefficients, rtol=0, atol=1e-6)
    assert own.condition == pytest.approx(wanted.condition, rel=1e-3)
    assert identified.condition == pytest.approx(known.condition, rel=1e-3)
    assert np.allclose(
        identified.values / dimensions, known.values, rtol=1e-4, atol=1e-6 * abs(known.values).max()
    )


@pytest.mark.parametrize("L", [1e-6, 1.0, 1e4])
@pytest.mark.parametrize("task", [("x", "y"), ("x", "y", "z", "rz")])
def test_arms_that_turn_and_slide_are_as_well_conditioned(task, L):
    """Where the slide has the length r, K has the rows (0, 1 / r) of the hinge, (1, 0) of the slide
    and (0, -1 / r) of the wrist: turns count by r of the reference, with z and rz by r / sqrt 2."""
    links = {name: lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1)) for name in ("one", "two")}
    joints: dict[str, lw.mechanism.Joint] = {
        "hinge": lw.RevoluteJoint(connects=("ground", "one")),
        "slide": lw.PrismaticJoint(connects=("one", "two"), axis=(1, 0, 0)),
    }
    if len(task) > 2:
        links |= {name: links["one"] for name in ("three", "four")}
        joints["lift"] = lw.PrismaticJoint(connects=("two", "three"))
        joints["wrist"] = lw.RevoluteJoint(connects=("three", "four"))
    mechanism = lw.Mechanism(
        bodies=links,
        joints=joints,
        actuators=tuple(joints),
        tools={"end": lw.Tool(body=list(links)[-1], task=task)},
        reference={"slide": 0.5},
    )
    robot = lw.Robot(Scale(mechanism, L).mechanism)
    state = robot.assemble(tool=[0.2 * L, *(0.0 for _ in task[1:])])
    length = 0.5 if len(task) == 2 else 0.5 / np.sqrt(2)
    assert analysis.dexterity(robot, state).length / L == pytest.approx(length, rel=1e-9)
    count = min(len(task), 3)
    K = np.array([[1.0, 0, 0], [0, length / 0.2, 0], [0, -length / 0.2, 1]])[:count, :count]
    expected = 1 / np.linalg.cond(K)
    assert robot.conditioning(state) == pytest.approx(expected, rel=1e-9)
    assert analysis.singularity(robot, state).kinds == ()


@pytest.mark.parametrize("T", [1e-5, 1.0, 1e4])
def test_the_command_line_tells_equilibria_at_any_pace(T):
    robot = lw.Robot(Scale(MADE["double_pendulum"], T=T).mechanism)
    held = analysis.equilibrium(robot)
    assert modes_at(robot, held.state, held.forces)[1] == "stable"
    bent = robot.state(held.state.positions + 0.1)
    assert modes_at(robot, bent, held.forces) == (None, "no: it accelerates")


@pytest.mark.parametrize(("L", "M", "T"), [(1e-6, 1e-9, 1.0), (100.0, 1e6, 1.0), (1.0, 1.0, 1e-4)])
def test_friction_and_payloads_are_told_of_robots_of_any_size(L, M, T):
    """Of forces of a twentieth of noise the friction that is possible is near what is identified;
    without noise the payload is what was carried, though one plane tells no moments."""
    scale = Scale(MADE["double_pendulum"], L, M, T)
    robot = lw.Robot(scale.mechanism)
    names = [f"{name}.friction.viscous" for name in robot.actuators]
    t, pace, swing = np.linspace(0, 2, 60)[:, None], np.array([3.0, 5.0]), np.array([1.0, 0.7])
    state = robot.state(swing * np.sin(pace * t), swing * pace * np.cos(pace * t) / T)
    accelerations = -swing * pace**2 * np.sin(pace * t) / T**2
    # Friction.
    rubbed = {name: 0.5 * scale.energy * T for name in names}
    rubbing = robot.free(*names).with_parameters(rubbed)
    forces = rubbing.inverse_dynamics(state, accelerations)
    noise = 0.05 * np.abs(forces).max() * np.random.default_rng(0).normal(size=forces.shape)
    known = analysis.identify(robot, analysis.Measured(state, accelerations, forces + noise), names)
    found = lw.Robot(analysis.possible(known)).free(*names).p / (scale.energy * T)
    assert np.allclose(found, 0.35, rtol=0, atol=0.05)
    # A payload.
    point = lw.Inertia(zz=1e-3 * M * L**2)
    heavy = lw.Robot(scale.mechanism.with_payload(0.3 * M, (0.0, 0.0, 0.0), point))
    forces = heavy.inverse_dynamics(heavy.state(state.positions, state.rates), accelerations)
    told = analysis.payload(robot, analysis.Measured(state, accelerations, forces))
    assert told.mass / M == pytest.approx(0.3, rel=1e-4)
