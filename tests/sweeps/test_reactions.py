"""Reactions as outputs: a cart whose rail bears what is known in closed form, and runs by
`Robot.simulate`."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.model import reactions
from linkwork.model.network import Network
from linkwork.sweeps import Study, StudyError, report, sweep
from linkwork.sweeps.chunk import bench_of

from tests.sweeps.carts import CART, study, whole

G = 9.81
GEARED = lw.Mechanism(
    bodies={"cart": {"mass": 2.0}, "other": {"mass": 1.0}},
    joints={
        "rail": {"type": "prismatic", "connects": ("ground", "cart"), "axis": (1, 0, 0)},
        "other": {"type": "prismatic", "connects": ("ground", "other"), "axis": (1, 0, 0)},
        "gear": {"type": "gear", "ratios": {"rail": -1.0, "other": 1.0}},
    },
    actuators=("rail",),
)


def test_what_a_rail_bears():
    """Beside the force along the rail that drives it, the weight of the cart: its moment about the
    rail's origin is m g x."""
    T, start = 0.5, 0.1
    found = whole(
        study(
            robot=lw.Mechanism(**CART.model_dump() | {"gravity": (0, 0, -G)}),
            start={"joints": {"rail": start}},
            vary={
                "cart.mass": {"type": "uniform", "low": 1, "high": 3},
                "forces.rail": {"type": "uniform", "low": -1, "high": 4},
            },
            outputs={
                "force": "peak reaction_force.rail",
                "moment": "final reaction_moment",
                "mean": "mean reaction_moment.rail",
            },
            trajectories=("reaction_force",),
            samples=401,
        )
    )
    m, F = found["cart.mass"], found["forces.rail"]
    np.testing.assert_allclose(found["force"], np.hypot(m * G, F), rtol=1e-12)
    np.testing.assert_allclose(
        found["reaction_force"], np.hypot(m * G, F)[:, None, None] * np.ones((40, 401, 1))
    )
    moment = m * G * np.abs(start + F / m * T**2 / 2)
    np.testing.assert_allclose(found["moment"][:, 0], moment, rtol=1e-9)
    forwards = F > 0
    mean = m * G * (start + F / m * T**2 / 6)
    np.testing.assert_allclose(
        found["mean"][forwards], mean[forwards], rtol=1e-5
    )  # by the trapezoidal rule


def test_reactions_are_those_of_the_runs_that_simulate_makes(monkeypatch):
    robot, times = lw.robots.prr3(), np.linspace(0, 0.2, 21)
    given = Study(
        robot=robot,
        duration=0.2,
        samples=21,
        start={"tool": (0.5, 0.3, 0.5)},
        forces={"slide_1": 2.0},
        vary={"platform.mass": {"type": "uniform", "low": 1, "high": 2}},
        design={"type": "random", "members": 6},
        outputs={"force": "peak reaction_force.wrist_1", "moment": "rms reaction_moment"},
        trajectories=("reaction_force", "reaction_moment"),
    )
    found = whole(given)
    monkeypatch.setattr(reactions, "MEMORY", 7 * Network.of(robot).numbers)
    in_pieces = whole(given)
    for name in given.trajectories:
        np.testing.assert_allclose(in_pieces[name], found[name], rtol=1e-12, atol=1e-12)
    plant = lw.Robot(robot, free=("platform.mass",))
    for i in (0, 5):
        other = plant.with_parameters({"platform.mass": found["platform.mass"][i]})
        run = other.simulate(
            other.assemble(tool=(0.5, 0.3, 0.5)), {"slide_1": 2.0}, duration=0.2, save_at=times
        )
        transmitted = run.reactions()
        expected = transmitted.values
        force = np.linalg.norm(expected[..., 3:], axis=-1)
        np.testing.assert_allclose(found["reaction_force"][i], force, rtol=1e-6)
        np.testing.assert_allclose(
            found["reaction_moment"][i],
            np.linalg.norm(expected[..., :3], axis=-1),
            rtol=1e-6,
            atol=1e-8,
        )
        wrist = transmitted["joint"].values.tolist().index("wrist_1")
        np.testing.assert_allclose(found["force"][i], force[:, wrist].max(), rtol=1e-6)


def test_reactions_have_joints_and_units(tmp_path):
    outcome = sweep(
        study(outputs={"force": "peak reaction_force", "impulse": "integral reaction_moment.rail"}),
        tmp_path,
    )
    force, impulse = report.summary(outcome.store).rows
    assert (force.output, force.unit) == ("force.rail", "N")
    assert (impulse.output, impulse.unit) == ("impulse", "N m s")


def test_coordinates_have_their_own_units():
    """Of a tool that is shifted and turned, a bristle that bends along a rail, and a quaternion."""
    joints = {
        "rail": lw.PrismaticJoint(
            connects=("ground", "cart"),
            axis=(1, 0, 0),
            friction=lw.Friction(coulomb=1.0, bristle=lw.Bristle(stiffness=1e3)),
        ),
        "spin": lw.RevoluteJoint(connects=("cart", "arm")),
        "float": lw.FreeJoint(connects=("ground", "stone")),
    }
    body = {"mass": 1.0, "inertia": {"xx": 0.1, "yy": 0.1, "zz": 0.1}}
    robot = lw.Mechanism(
        bodies={name: body for name in ("cart", "arm", "stone")},
        joints=joints,
        actuators=("rail", "spin"),
        tools={"tip": lw.Tool(body="arm", task=("x", "rz", "direction_x"))},
    )
    outputs = {
        "x": ("final task_position.x", "m"),
        "turn": ("final task_position.rz", "rad"),
        "turned": ("integral task_position.rz", "rad s"),
        "part": ("final task_position.direction_x", "1"),
        "bend": ("peak drive_state.rail.bristle", "N"),
        "qw": ("final joint_position.float.qw", "1"),
        "swift": ("final joint_rate.spin", "rad/s"),
    }
    told = {name: text for name, (text, _) in outputs.items()}
    bench = bench_of(study(robot=robot, outputs=told))
    for name, (_, unit) in outputs.items():
        output = bench.outputs[name]
        assert bench.unit(output, output.component) == unit


def test_reactions_that_are_not_there():
    with pytest.raises(StudyError, match=r"reaction_force has no component 'hook'; there are rail"):
        bench_of(study(outputs={"force": "peak reaction_force.hook"}))


def test_a_gear_whose_ratio_varies_pushes_by_each_members_own():
    """r x_2 = x_1: the force F moves m_1 + m_2 / r^2, and the rail bears m_1 (g and a)."""
    geared = {
        "robot": GEARED,
        "start": {},
        "forces": {"rail": 3.0},
        "design": {"type": "random", "members": 2},
        "vary": {"gear.ratios.other": {"type": "uniform", "low": 1, "high": 2}},
    }
    found = whole(study(outputs={"force": "peak reaction_force.rail"}, **geared))
    m_1, m_2, r = 2.0, 1.0, found["gear.ratios.other"]
    a = 3.0 / (m_1 + m_2 / r**2)
    np.testing.assert_allclose(found["force"], m_1 * np.hypot(G, a), rtol=1e-12)
