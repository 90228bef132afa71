"""Actuators along belts, cables and displacements: what they move by the chain rule, by closed
forms, and which of them act along a coordinate at all."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

import linkwork as lw
from linkwork import design, motions
from linkwork.analysis import (
    along,
    assembly_modes,
    dexterity,
    equilibrium,
    input_output,
    jacobians,
    natural_modes,
    singularity,
    tensions,
    workspace,
)
from linkwork.analysis.actuated_coordinates import with_coordinate
from linkwork.mechanism import Cable, Combination, Displacement, Thrust, ViaPoint

from tests.analysis.mechanisms import postures, turned
from tests.catalogue import built

RATIOS = {
    "five_bar": np.array([[1.5, 0.4], [-0.3, 2.0]]),
    "par4": np.diag([1.0, 2.0, -1.5, 0.5]) + 0.3 * np.eye(4, k=1),
}
ANCHORS = np.array([[0, 0], [2, 0], [1, 2.0]])
ENDS = np.array([[-0.1, -0.05], [0.1, -0.05], [0, 0.1]])


@cache
def belted(name):
    """A robot whose motors' belts turn several of its cranks at a time."""
    described = built(name).mechanism
    lines = {
        f"belt_{i}": Combination(
            ratios=dict(zip(described.actuators, row, strict=True)), offset=0.1 * i
        )
        for i, row in enumerate(RATIOS[name].tolist())
    }
    return lw.Robot(
        described.model_copy(update={"transmissions": lines, "actuators": tuple(lines)})
    )


@cache
def plate(kind):
    """A plate in the plane that three cables pull, or displacements push."""
    lines = {
        f"cable_{i}": Cable(
            path=(
                ViaPoint(body="ground", point=(*ANCHORS[i].tolist(), 0)),
                ViaPoint(body="plate", point=(*ENDS[i].tolist(), 0)),
            )
        )
        for i in range(3)
    }
    if kind == "displacements":
        lines = {
            "aslant": Displacement(body="plate", base="ground", force=(1, 0.3, 0)),
            "up": Displacement(body="plate", base="ground", force=(0, 1, 0)),
            "turn": Displacement(body="plate", base="ground", moment=(0, 0, 2.0)),
        }
    return lw.Robot(
        lw.Mechanism(
            bodies={"plate": lw.Body(mass=1, inertia=lw.Inertia(zz=0.1))},
            joints={"plane": lw.PlanarJoint(connects=("ground", "plate"))},
            transmissions=lines,
            actuators=tuple(lines),
            tools={"plate": lw.Tool(body="plate")},
            gravity=(0, 0, 0),
            reference={"plane.x": 1.0, "plane.y": 0.7},
        )
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", RATIOS)
def test_belts_move_what_their_cranks_do(name):
    """a' = M q' of the cranks' rates: K = M K_q, J = J_q M^-1, det A alike over its reference."""
    robot, direct, M = belted(name), built(name), RATIOS[name]
    home = direct.task_values(direct.home)
    poses = np.add(home, [[0.0] * len(home), [0.02, -0.03, 0.04, 0.1][: len(home)]])
    states = direct.assemble(tool=poses)
    found, told = jacobians(robot)(states.q), jacobians(direct)(states.q)
    np.testing.assert_allclose(found.K, M @ told.K, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(found.J, told.J @ np.linalg.inv(M), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.det_A, told.det_A, rtol=1e-9)
    own = robot.state(states.positions)
    np.testing.assert_allclose(dexterity(robot, own).conditioning, robot.conditioning(own))
    A, B = input_output(robot, own)
    np.testing.assert_allclose(A, B @ found.K, atol=1e-9)
    assert not singularity(robot, own.at(0)).kinds
    np.testing.assert_allclose(along(robot, own).det_A, found.det_A)


@pytest.mark.parametrize("name", RATIOS)
def test_workspaces_of_belts_are_those_of_their_cranks(name):
    grid = {"x": np.linspace(-0.3, 0.6, 7), "y": np.linspace(-0.4, 0.5, 7)}
    grid |= {"par4": {"z": [-0.8, -0.5], "rz": 0.2}}.get(name, {})
    found, told = (workspace(robot, grid, rates=1.0) for robot in (belted(name), built(name)))
    np.testing.assert_array_equal(found.reachable, told.reachable)
    offsets = 0.1 * np.arange(len(RATIOS[name]))
    lengths = told.actuator_position.values @ RATIOS[name].T + offsets
    np.testing.assert_allclose(found.actuator_position, lengths, atol=1e-9)
    assert found.isotropic_velocity.attrs == told.isotropic_velocity.attrs


def test_cables_pull_along_their_directions():
    robot, pose = plate("cables"), np.array([1.3, 0.5, 0.9])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    arms = ENDS @ np.array([[c, s], [-s, c]])
    ways = arms + pose[:2] - ANCHORS
    u = ways / np.linalg.norm(ways, axis=1)[:, None]
    expected = np.column_stack([u, arms[:, 0] * u[:, 1] - arms[:, 1] * u[:, 0]])
    np.testing.assert_allclose(
        jacobians(robot)(robot.assemble(tool=pose).q).K, expected, atol=1e-12
    )
    mapped = workspace(robot, {"x": [1.3], "y": 0.5, "angle": 0.9})
    lengths = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(mapped.actuator_position.values[0], lengths, atol=1e-12)
    assert mapped.actuator_position.attrs["units"] == "m, m, m"


def test_assembly_modes_of_cables_are_where_three_circles_meet():
    pose = {"plane.x": 1.3, "plane.y": 0.5, "plane.angle": 0.9}
    described = plate("cables").mechanism.model_copy(update={"reference": pose})
    modes = assembly_modes(lw.Robot(described))
    lengths = np.linalg.norm(ENDS @ turned(np.eye(2), 0.9).T + [1.3, 0.5] - ANCHORS, axis=1)
    angles = postures(ANCHORS, ENDS, lengths)
    np.testing.assert_allclose(np.sort(modes.states["plane.angle"]), angles, atol=1e-3)
    assert len(assembly_modes(belted("five_bar"))) == 2


def test_displacements_push_as_they_are_described():
    robot = plate("displacements")
    state = robot.assemble(tool=[0.6, 0.9, -0.4])
    expected = [[1, 0.3, 0], [0, 1, 0], [0, 0, 2.0]]
    np.testing.assert_allclose(jacobians(robot)(state.q).K, expected, atol=1e-12)
    natural_modes(robot, state, [0.0, 0.0, 0.0])


@cache
def ball(lines):
    """A ball in a socket, its weight below the middle."""
    body = lw.Body(mass=1, centre_of_mass=(0, 0, -0.1), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.05))
    return lw.Robot(
        lw.Mechanism(
            bodies={"ball": body},
            joints={"socket": lw.SphericalJoint(connects=("ground", "ball"))},
            transmissions=dict(lines),
            actuators=tuple(name for name, _ in lines),
            tools={"ball": lw.Tool(body="ball", task=("rx", "ry", "rz"))},
        )
    )


def test_what_acts_along_no_coordinate_has_no_potential_wherever_it_is_told():
    """The angular velocity is no rate of a rotation vector, but about one axis."""
    axes = {"x": (1.0, 0, 0), "y": (0, 1.0, 0), "z": (0, 0, 1.0)}
    lines = {
        name: Displacement(body="ball", base="ground", moment=axis) for name, axis in axes.items()
    }
    robot = ball(tuple(lines.items()))
    assert with_coordinate(robot) == ()
    assert with_coordinate(plate("displacements")) == ("aslant", "up", "turn")
    with pytest.raises(lw.LinkworkError, match="'x' acts along no coordinate"):
        jacobians(robot)
    held = robot.assemble(tool=[0.3, 0.2, 0.5])
    with pytest.raises(lw.LinkworkError, match="x, y, z exert the stiffness is not symmetric"):
        natural_modes(robot, held)
    with pytest.raises(lw.LinkworkError, match="x, y, z exert has no potential; take stable=F"):
        equilibrium(robot, {"z": 0.5}, guess=held)
    fans = {name: Thrust(body="ball", moment=axis) for name, axis in axes.items()}
    with pytest.raises(lw.LinkworkError, match="'x' acts along no coordinate"):
        singularity(fanned := ball(tuple(fans.items())), fanned.home)


@cache
def hung(count):
    """A plate in the plane, on which weight acts, between cables to its corners from a frame."""
    corners = np.array([[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1], [0, 0.15]])
    posts = np.array([[2.0, -2], [-2, -2], [2, 2], [-2, 2], [0, 2.5]])
    lines = {
        f"cable_{i}": Cable(
            path=(
                ViaPoint(body="ground", point=(*posts[i].tolist(), 0)),
                ViaPoint(body="plate", point=(*corners[i].tolist(), 0)),
            )
        )
        for i in range(count)
    }
    return lw.Robot(
        lw.Mechanism(
            bodies={"plate": lw.Body(mass=2.0, inertia=lw.Inertia(zz=0.1))},
            joints={"plane": lw.PlanarJoint(connects=("ground", "plate"))},
            transmissions=lines,
            actuators=tuple(lines),
            tools={"plate": lw.Tool(body="plate")},
            gravity=(0, -9.81, 0),
        )
    )


@pytest.mark.parametrize("count", [4, 5])
def test_tensions_are_the_least_that_keep_cables_taut(count):
    """By SLSQP over all forces with the same effect; forces of least norm push at some cable."""
    robot, random = hung(count), np.random.default_rng(1)
    poses = random.uniform(-0.4, 0.4, (12, 3)) * (1, 1, 0.3)
    states = robot.assemble(tool=poses).with_rates(random.uniform(-1, 1, (12, 3)))
    wanted = random.uniform(-2, 2, (12, 3))
    found, pushed = tensions(robot, states, wanted, least=5.0, most=200.0), 0
    assert found.max() <= -5.0 + 1e-7 and found.min() >= -200.0
    np.testing.assert_allclose(robot.forward_dynamics(states, found), wanted, atol=1e-9)
    for k, u in enumerate(robot.inverse_dynamics(states, wanted)):
        S, pushed = robot.actuation(states.at(k)), pushed + (u > 0).any()
        best = minimize(
            lambda y: y @ y,
            found[k] - 3.0,
            jac=lambda y: 2 * y,
            method="SLSQP",
            bounds=[(-200.0, -5.0)] * count,
            constraints={"type": "eq", "fun": lambda y, S=S, u=u: S.T @ (y - u)},
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert found[k] @ found[k] <= best.fun * (1 + 1e-7)
    assert pushed > 3


def test_a_hung_plate_is_held_and_led_by_taut_cables():
    robot = hung(4)
    held = tensions(robot, robot.home, least=2.0)
    assert held.max() == pytest.approx(-2.0)
    run = robot.simulate(robot.home, held, duration=0.5)
    assert np.abs(run["joint_position"].values).max() < 1e-9
    motion = robot.follow(
        lw.paths.together(lw.paths.circle([0, 0.1], 0.1), lw.paths.swing(0, 0.1)), duration=1.0
    )
    led = tensions(robot, motion, least=2.0)
    assert isinstance(led, lw.Sampled) and led.values.max() <= -2.0 + 1e-9
    wanted = robot.forward_dynamics(motion.state, led.values)
    np.testing.assert_allclose(wanted, motion.accelerations, atol=1e-9)


def test_motions_that_push_at_cables_say_so():
    """A plate that is driven downwards faster than it falls, by what may push from above."""
    robot = hung(4)
    limits, said = motions.ActuatorLimits(force=60.0), r"the cable 'cable_\d' pushes with up to"
    with pytest.warns(lw.errors.ModelWarning, match=said) as told:
        motions.fastest(robot, lw.paths.line([0, 0.2, 0], [0, -0.2, 0.0]), limits, points=51)
    assert told[0].filename == __file__
    end = robot.assemble(tool=[0, -0.2, 0])
    with pytest.warns(lw.errors.ModelWarning, match=said) as told:
        design.optimal_motion(robot, robot.home, end, limits, intervals=6)
    assert told[0].filename == __file__


def test_tensions_that_nothing_gives_are_refused():
    robot = hung(4)
    cases = [
        ((built("five_bar"), built("five_bar").home), {}, "no actuator of the robot pulls at a c"),
        ((robot, robot.home), {"least": 3.0, "most": 2.0}, "give 0 <= least < most"),
        ((robot, robot.home), {"least": -1.0}, "give 0 <= least < most"),
        ((robot, robot.home), {"most": 5.0}, "no forces move the robot so with every cable's"),
        ((robot, robot.state([[0, 0, 0], [0, 3.0, 0]])), {}, "move the robot so in state 1 with"),
    ]
    for given, more, sentence in cases:
        with pytest.raises(lw.LinkworkError, match=sentence):
            tensions(*given, **more)
