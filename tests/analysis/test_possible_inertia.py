"""Possible masses and moments: the forces that were measured, and bodies that can be; payloads told
by forces."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.analysis._base_parameters import random_motions
from linkwork.analysis.possible_inertia import PossibleBody
from linkwork.mechanism.numbers import located

from tests.analysis.mechanisms import cart
from tests.catalogue import built
from tests.equations.evaluation import close

EFFECTS = ("joint_2.friction.viscous", "joint_2.friction.coulomb")


def motion(robot: lw.Robot, samples: int, seed: int) -> tuple[lw.State, np.ndarray]:
    random, n = np.random.default_rng(seed), robot.mobility
    states = robot.state(random.uniform(-2, 2, (samples, n)), random.uniform(-2, 2, (samples, n)))
    return states, random.uniform(-8, 8, (samples, n))


def measured(robot: lw.Robot, samples: int, noise: float, seed: int) -> analysis.Measured:
    states, accelerations = motion(robot, samples, seed)
    forces = robot.inverse_dynamics(states, accelerations)
    forces = forces + noise * np.random.default_rng(seed + 1).standard_normal(forces.shape)
    return analysis.Measured(states, accelerations, forces)


def truth() -> lw.Mechanism:
    """The arm with other masses, mass centres and inertias than it is described by."""
    described, random = lw.robots.puma560(), np.random.default_rng(5)
    bodies = {}
    for name, body in described.bodies.items():
        about = PossibleBody.of(body, 30.0, 0.5)
        bodies[name] = about.body(0.1 * random.standard_normal(about.size), body)
    joint = described.joints["joint_2"]
    joints = {
        **described.joints,
        "joint_2": joint.model_copy(update={"friction": lw.Friction(viscous=9.0)}),
    }
    return lw.Mechanism(**{**dict(described), "bodies": bodies, "joints": joints})


def pseudo(body: lw.Body) -> np.ndarray:
    """Return the pseudo-inertia (4 x 4) about the frame's origin."""
    c, I = np.array(body.centre_of_mass), body.inertia.tensor()  # noqa: E741
    Sigma = np.trace(I) / 2 * np.eye(3) - I + body.mass * np.outer(c, c)
    return np.block([[Sigma, body.mass * c[:, None]], [body.mass * c, body.mass]])


def test_all_numbers_of_a_body_are_free_about_it():
    """At zero it is the body itself, whose moments move in ten directions; anywhere it can be."""
    body = lw.robots.puma560().bodies["link_3"]
    about, random = PossibleBody.of(body, 30.0, 0.5), np.random.default_rng(0)
    same = about.body(np.zeros(10), body)
    close(same.inertia.tensor(), body.inertia.tensor(), 1e-7)
    J = np.array([np.imag(about.moments(1e-30j * e)) / 1e-30 for e in np.eye(10)])
    assert np.linalg.matrix_rank(J / np.linalg.norm(J, axis=1, keepdims=True), 1e-9) == 10
    for _ in range(50):
        other = about.body(2 * random.standard_normal(10), body)
        assert np.linalg.eigvalsh(pseudo(other)).min() > 0


def test_identified_masses_are_put_back_into_a_description_that_needs_the_same_forces():
    real, described = lw.Robot(truth()), lw.Robot("puma560")
    states, dv = motion(real, 60, 3)
    data = measured(real, 200, 0.0, 1)
    data = analysis.Measured(
        described.state(data.states.positions, data.states.rates), data.accelerations, data.forces
    )
    found = analysis.possible(analysis.identify(described, data, EFFECTS))
    other = lw.Robot(found)
    close(other.inverse_dynamics(states, dv), real.inverse_dynamics(states, dv), 1e-5)
    assert located(found, "joint_2.friction.viscous")[1] == pytest.approx(9.0, rel=1e-4)
    assert all(np.linalg.eigvalsh(pseudo(body)).min() > 0 for body in found.bodies.values())
    assert lw.Mechanism.parse(found.text) == found


def test_dampers_give_what_viscous_friction_lacks():
    """Described with a damper of 3 N s/m, the cart has one of 1."""
    described, real = (cart(2.0, 50.0, damping) for damping in (3.0, 1.0))
    q, v, dv = np.random.default_rng(0).standard_normal((3, 50, 1))
    forces = real.inverse_dynamics(real.state(q, v), dv)
    data = analysis.Measured(described.state(q, v), dv, forces)
    found = analysis.possible(analysis.identify(described, data, ("slide.friction.viscous",)))
    other = lw.Robot(found)
    close(other.inverse_dynamics(other.state(q, v), dv), forces, 1e-6)


def test_forces_without_noise_are_met_by_what_is_found():
    """Of a Delta with other masses: weights of residuals are those of rounding there, in a valley
    so narrow that a search in the wrong measure stood still where it began, as if it were done."""
    robot, random = built("delta"), np.random.default_rng(4)
    bodies = {
        name: body.model_copy(update={"mass": body.mass * random.uniform(0.7, 1.4)})
        for name, body in robot.mechanism.bodies.items()
    }
    real = lw.Robot(robot.mechanism.model_copy(update={"bodies": bodies}))
    around = robot.tool_pose(robot.home)[:3] + random.uniform(-0.1, 0.1, (60, 3))
    rates, accelerations = random.uniform(-4, 4, (2, 60, 3))
    states = robot.assemble(tool=around).with_rates(rates)
    forces = real.inverse_dynamics(real.state(states.positions, rates), accelerations)
    data = analysis.Measured(states, accelerations, forces)
    found = lw.Robot(analysis.possible(analysis.identify(robot, data)))
    again = found.inverse_dynamics(found.state(states.positions, rates), accelerations)
    close(again, forces, 1e-10)


def test_noise_leaves_bodies_possible():
    """Twenty noisy samples tell no body's inertia; what is found is possible all the same."""
    real, described = lw.Robot(truth()), lw.Robot("puma560")
    data = measured(real, 20, 2.0, 7)
    data = analysis.Measured(
        described.state(data.states.positions, data.states.rates), data.accelerations, data.forces
    )
    found = analysis.possible(analysis.identify(described, data))
    assert all(np.linalg.eigvalsh(pseudo(body)).min() > 0 for body in found.bodies.values())
    left = lw.Robot(found).inverse_dynamics(data.states, data.accelerations) - data.forces
    assert np.sqrt(np.mean(left**2)) < 6.0


@pytest.mark.parametrize("name", ["puma560", "pendulum"])
def test_a_payload_is_told_by_forces(name):
    """In space and in the plane: mass, mass centre and inertia; the description then carries it."""
    robot = lw.Robot(lw.robots.pendulum((0.5, 0.4), (3.0, 2.0)) if name == "pendulum" else name)
    flat = robot.planar
    inertia = lw.Inertia(zz=0.02) if flat else lw.Inertia(xx=0.02, yy=0.03, zz=0.025, xy=0.004)
    centre = (0.03, -0.02, 0.0) if flat else (0.03, -0.02, 0.08)
    loaded = lw.Robot(robot.mechanism.with_payload(2.5, centre, inertia))
    states, dv = motion(loaded, 200, 2)
    forces = loaded.inverse_dynamics(states, dv)
    own = robot.state(states.positions, states.rates)
    found = analysis.payload(robot, analysis.Measured(own, dv, forces))
    assert found.mass == pytest.approx(2.5, rel=1e-5)
    close(np.array(found.centre_of_mass), np.array(centre), 1e-5)
    close(found.inertia.tensor(), inertia.tensor(), 1e-5)
    again = lw.Robot(found.mechanism)
    close(again.inverse_dynamics(states, dv), forces, 1e-4)


def test_a_payload_lies_within_its_deviation():
    robot = lw.Robot("puma560")
    loaded = lw.Robot(
        robot.mechanism.with_payload(2.5, (0.0, 0.0, 0.1), lw.Inertia(xx=0.02, yy=0.02, zz=0.02))
    )
    apart = []
    for seed in range(12):
        data = measured(loaded, 60, 0.5, 20 * seed)
        own = robot.state(data.states.positions, data.states.rates)
        found = analysis.payload(robot, analysis.Measured(own, data.accelerations, data.forces))
        apart.append((found.mass - 2.5) / found.deviation)
    assert 0.4 < np.sqrt(np.mean(np.square(apart))) < 1.8


def carried(name: str, centre: tuple[float, float], samples: int) -> analysis.EstimatedPayload:
    """Return what exact forces tell of 0.7 kg at a tool in the plane."""
    robot = built(name)
    load = robot.mechanism.with_payload(0.7, (*centre, 0.0), lw.Inertia(zz=0.02))
    loaded = lw.Robot(load)
    states, dv = random_motions(loaded, samples, 2)
    forces = loaded.inverse_dynamics(states, dv)
    own = robot.state(states.positions, states.rates)
    return analysis.payload(robot, analysis.Measured(own, dv, forces))


def test_a_payload_far_from_the_tool_is_found():
    """What fits lies along a narrow, bent valley; masses that were off by 180 % came with a
    deviation of 0.002 %."""
    found = carried("prr3", (0.3, 0.2), 40)
    assert found.mass == pytest.approx(0.7, abs=3 * found.deviation)
    close(np.array(found.centre_of_mass), np.array([0.3, 0.2, 0.0]), 1e-6)


def test_a_payload_that_is_not_told_has_no_deviation():
    """Turns about one axis tell m c and the inertia about it, and no mass: the guess decides."""
    found = carried("pendulum", (0.1, -0.1), 40)
    assert np.isinf(found.deviation)
    assert np.isinf(found.centre_deviations[:2]).all()
    assert repr(found).endswith("of tool 'mass', a guess in part)")
    assert "a guess" not in repr(carried("prr3", (0.03, 0.02), 20))
    pendulum = built("pendulum")
    states, dv = random_motions(pendulum, 20, 5)
    load = pendulum.mechanism.with_payload(0.7, (0.1, -0.1, 0.0), lw.Inertia(zz=0.02))
    loaded, again = lw.Robot(load), lw.Robot(found.mechanism)
    close(again.inverse_dynamics(states, dv), loaded.inverse_dynamics(states, dv), 1e-5)


def test_a_payload_on_the_other_side_is_found():
    """A mass at the tool could not have such forces."""
    robot = lw.Robot(lw.robots.pendulum((0.5, 0.4), (3.0, 2.0)))
    load = robot.mechanism.with_payload(2.5, (-1.0, 0.8, 0.0), lw.Inertia(zz=0.02))
    states, dv = motion(lw.Robot(load), 30, 2)
    forces = lw.Robot(load).inverse_dynamics(states, dv)
    own = robot.state(states.positions, states.rates)
    found = analysis.payload(robot, analysis.Measured(own, dv, forces))
    assert found.mass == pytest.approx(2.5, rel=1e-6)


def test_many_samples_take_no_square_matrix_of_all_their_forces():
    """Which would be 1.15 GB here, and 115 GB of ten times as many."""
    robot = built("puma560")
    data = measured(lw.Robot(robot.mechanism.with_payload(2.0, (0, 0, 0.08))), 2000, 0.1, 5)
    states = robot.state(data.states.positions, data.states.rates)
    tracemalloc.start()
    try:
        analysis.payload(robot, analysis.Measured(states, data.accelerations, data.forces))
        assert tracemalloc.get_traced_memory()[1] < 0.5e9
    finally:
        tracemalloc.stop()


def test_refusals():
    robot = lw.Robot("puma560")
    data = measured(robot, 20, 0.0, 1)
    lighter = analysis.Measured(data.states, data.accelerations, 0.0 * data.forces)
    with pytest.raises(lw.LinkworkError, match="tell no mass above zero"):
        analysis.payload(robot, lighter)
    with pytest.raises(lw.LinkworkError, match="there is no tool 'claw'; the tools are hand"):
        analysis.payload(robot, data, tool="claw")
    with pytest.raises(lw.LinkworkError, match="measured is 3; give a Measured motion"):
        analysis.payload(robot, 3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(lw.LinkworkError, match=r"give what analysis\.identify returns"):
        analysis.possible(data)  # pyright: ignore[reportArgumentType]
    q, dv, forces = data.states, data.accelerations, data.forces
    for wrong, sentence in (
        (analysis.Measured(q, dv, np.nan * forces), r"measured forces\[0, 0\] is nan"),
        (analysis.Measured(q, np.nan * dv, forces), r"measured accelerations\[0, 0\] is nan"),
        (analysis.Measured(q, dv, forces[:5]), r"shape \(5, 6\); give \(20, 6\)"),
        (analysis.Measured(q, dv[:, :3], forces), r"shape \(20, 3\); give \(20, 6\)"),
        (analysis.Measured(robot.home, dv[0], forces[0]), "give a stack"),
    ):
        for ask in (analysis.payload, analysis.identify):
            with pytest.raises(lw.LinkworkError, match=sentence):
                ask(robot, wrong)
    few = analysis.Measured(
        robot.state(data.states.positions[:1], data.states.rates[:1]),
        data.accelerations[:1],
        data.forces[:1],
    )
    with pytest.raises(lw.LinkworkError, match="6 measured forces do not tell a payload"):
        analysis.payload(robot, few)
    with pytest.raises(lw.LinkworkError, match="spread"):
        analysis.payload(robot, data, spread=0.0)
