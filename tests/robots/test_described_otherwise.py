"""How a mechanism is described does not matter: in which order bodies and joints stand, where the
frames of bodies lie in them, and which way joints lead."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.analysis import assembly_modes
from linkwork.mechanism import Frame, Inertia, Mechanism

from tests.catalogue import built

ROBOTS = ("prr3", "five_bar", "delta", "rrs3", "stewart")
PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")
HINGES_AND_SLIDES = ("revolute", "prismatic")
Pose = tuple[Rotation, np.ndarray]  # of a new frame in the former one


def reordered(mechanism: Mechanism, seed: int) -> Mechanism:
    """Return a mechanism with its bodies and joints in another order."""
    random, parts = np.random.default_rng(seed), {}
    for kind in ("bodies", "joints"):
        items = [*getattr(mechanism, kind).items()]
        parts[kind] = dict(items[k] for k in random.permutation(len(items)))
    return mechanism.model_copy(update=parts)


def reframed(mechanism: Mechanism, seed: int, planar: bool) -> Mechanism:
    """Return a mechanism told in other frames of its bodies and of the ground."""
    random, poses = np.random.default_rng(seed), {}
    for name in (*mechanism.bodies, "ground"):
        turn, shift = random.normal(size=3), 0.3 * random.normal(size=3)
        if planar:
            turn, shift = turn * (0, 0, 1), shift * (1, 1, 0)
        poses[name] = Rotation.from_rotvec(turn), shift
    joints: dict[str, Any] = dict(mechanism.joints)
    for name, joint in mechanism.pairs.items():
        ends = zip(joint.connects, joint.frames, strict=True)
        frames = tuple(told_in(poses[body], frame) for body, frame in ends)
        joints[name] = joint.model_copy(update={"frames": frames})
    bodies = {}
    for name, body in mechanism.bodies.items():
        R, p = poses[name]
        update = {"centre_of_mass": R.inv().apply(np.array(body.centre_of_mass) - p), "shapes": ()}
        if not planar:
            matrix = R.inv().as_matrix() @ tensor(body.inertia) @ R.as_matrix()
            update["inertia"] = Inertia(
                **{a + b: matrix["xyz".index(a), "xyz".index(b)] for a, b in PAIRS}
            )
        bodies[name] = body.model_copy(update=update)
    tools = {
        name: tool.model_copy(update={"frame": told_in(poses[tool.body], tool.frame)})
        for name, tool in mechanism.tools.items()
    }
    gravity = poses["ground"][0].inv().apply(mechanism.gravity)
    parts = {"bodies": bodies, "joints": joints, "tools": tools, "gravity": gravity}
    return mechanism.model_copy(update=parts)


def told_in(pose: Pose, frame: Frame) -> Frame:
    """Return a frame of a body as its new frame tells it."""
    R, p = pose
    rotation = (R.inv() * Rotation.from_rotvec(frame.rotation)).as_rotvec()
    return frame.model_copy(
        update={"position": R.inv().apply(np.array(frame.position) - p), "rotation": rotation}
    )


def tensor(inertia: Inertia) -> np.ndarray:
    """Return the matrix of an inertia."""
    of = {pair: getattr(inertia, pair) or 0.0 for pair in PAIRS}
    return np.array([[of["".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])


def turned_round(mechanism: Mechanism) -> tuple[Mechanism, dict[str, float]]:
    """Return a mechanism in which every second hinge and slide leads the other way, and the signs
    of its coordinates by name."""
    pairs = mechanism.pairs
    able = [name for name, joint in pairs.items() if joint.type in HINGES_AND_SLIDES]
    joints: dict[str, Any] = dict(mechanism.joints)
    reference = dict(mechanism.reference)
    for name in able[::2]:
        joint = pairs[name]
        other = {"connects": joint.connects[::-1], "frames": joint.frames[::-1]}
        joints[name] = joint.model_copy(update=other)
        reference[name] *= -1
    signs = dict.fromkeys(able[::2], -1.0)
    return mechanism.model_copy(update={"joints": joints, "reference": reference}), signs


def require_alike(robot: lw.Robot, other: lw.Robot, signs: dict[str, float]) -> None:
    """Compare motions, forces and energies of two robots at a random state, by name."""
    random = np.random.default_rng(5)

    def own(values: dict[str, float]) -> dict[str, float]:
        return {name: signs.get(name, 1.0) * value for name, value in values.items()}

    near = {name: robot.home[name] + 0.003 * random.normal() for name in robot.independent}
    joints = {name: float(value) for name, value in near.items()}
    rates = {name: random.normal() for name in robot.independent}
    forces = {name: random.normal() for name in robot.actuators}
    state = robot.assemble(joints).with_rates(rates)
    again = other.assemble(own(joints)).with_rates(own(rates))
    for told in (accelerations, holding_forces, energy):
        one, two = told(robot, state, forces), own(told(other, again, own(forces)))
        scale = max(map(abs, one.values()))
        assert two == pytest.approx(one, rel=0, abs=1e-9 * scale)


def accelerations(robot: lw.Robot, state: lw.State, forces: dict[str, float]) -> dict[str, float]:
    """Return the accelerations of all joints by name."""
    found = robot.joint_accelerations(state, robot.forward_dynamics(state, forces))
    return dict(zip(robot.rates, found.tolist(), strict=True))


def holding_forces(robot: lw.Robot, state: lw.State, _: dict[str, float]) -> dict[str, float]:
    """Return the actuators' forces that hold a pose by name."""
    return dict(zip(robot.actuators, robot.holding_forces(state).tolist(), strict=True))


def energy(robot: lw.Robot, state: lw.State, _: dict[str, float]) -> dict[str, float]:
    """Return the kinetic energy."""
    return {"kinetic energy": float(robot.energy(state)[0])}


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ROBOTS)
def test_order_and_frames_do_not_matter(name):
    robot = built(name)
    told = reordered(reframed(robot.mechanism, 1, robot.planar), 2)
    require_alike(robot, lw.Robot(told), {})


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", ROBOTS)
def test_which_way_joints_lead_turns_signs_alone(name):
    told, signs = turned_round(built(name).mechanism)
    require_alike(built(name), lw.Robot(told), signs)


@pytest.mark.long
@pytest.mark.parametrize(("name", "count"), [("delta", 16), ("prr3", 2), ("rrs3", 8)])
def test_modes_are_as_many(name, count):
    robot = built(name)
    told = reordered(reframed(robot.mechanism, 3, robot.planar), 4)
    assert len(assembly_modes(lw.Robot(told))) == len(assembly_modes(robot)) == count
