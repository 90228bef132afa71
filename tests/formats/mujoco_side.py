"""MuJoCo's own reading of a model, in the mechanism's terms: coordinates, rates and accelerations
by name.

MuJoCo gives a ball's angular velocity in the body's axes; the mechanism in F1's, which are the
body's at qpos0: w = R w_body and dw/dt = R dw_body/dt, R the joint's own rotation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco as mj
import numpy as np

import linkwork as lw

FREE, BALL = int(mj.mjtJoint.mjJNT_FREE), int(mj.mjtJoint.mjJNT_BALL)
QUATERNION, TURNING = ("qw", "qx", "qy", "qz"), ("wx", "wy", "wz")
GAP = 1e-5  # of the differences of Jacobians [s]


def compiled(source: str | Path, softness: float = 1.0) -> tuple[mj.MjModel, mj.MjData]:
    """Compile a text or file; `softness` scales MuJoCo's estimate of the inverse inertia that
    constraints feel."""
    text = source.read_text(encoding="utf-8") if isinstance(source, Path) else source
    model = mj.MjModel.from_xml_string(text)
    for estimate in (model.body_invweight0, model.dof_invweight0, model.tendon_invweight0):
        estimate[:] *= softness
    return model, mj.MjData(model)


def joints(model: mj.MjModel):
    """Yield the joints with the names of their coordinates and rates in a mechanism."""
    for index in range(model.njnt):
        joint = model.joint(index)
        places = ("x", "y", "z") if joint.type[0] == FREE else ()
        if joint.type[0] not in (FREE, BALL):
            yield joint, (joint.name,), (joint.name,)
        else:
            yield (
                joint,
                *(
                    tuple(f"{joint.name}.{part}" for part in (*places, *turning))
                    for turning in (QUATERNION, TURNING)
                ),
            )


def rotation(quaternion: np.ndarray) -> np.ndarray:
    R = np.zeros(9)
    mj.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def set_state(
    model: mj.MjModel,
    data: mj.MjData,
    coordinates: Mapping[str, float],
    rates: Mapping[str, float],
    forces: Sequence[float] | float = 0.0,
) -> None:
    """Set qpos, qvel and the controls, and evaluate the forward dynamics."""
    for joint, labels, names in joints(model):
        q, v = (
            np.array([coordinates[label] for label in labels]),
            np.array([rates[name] for name in names]),
        )
        if len(q) > 1:
            v[-3:] = rotation(q[-4:]).T @ v[-3:]
        data.qpos[joint.qposadr[0] :][: len(q)], data.qvel[joint.dofadr[0] :][: len(v)] = q, v
    data.ctrl[:] = forces
    mj.mj_forward(model, data)


def accelerations(model: mj.MjModel, data: mj.MjData) -> dict[str, float]:
    """Return dv/dt of all joints by name."""
    found = {}
    for joint, labels, names in joints(model):
        a = data.qacc[joint.dofadr[0] :][: len(names)].copy()
        if len(labels) > 1:
            a[-3:] = rotation(data.qpos[joint.qposadr[0] :][: len(labels)][-4:]) @ a[-3:]
        found |= dict(zip(names, a, strict=True))
    return found


def apart(mechanism: lw.Mechanism, source: str | Path, seed: int = 1) -> float:
    """Return how far a tree's accelerations under the same controls are from MuJoCo's, in parts of
    these, at two states; all of its actuators are the mechanism's, and no limit acts."""
    robot, (model, data) = lw.Robot(mechanism), compiled(source)
    model.opt.disableflags |= int(mj.mjtDisableBit.mjDSBL_LIMIT | mj.mjtDisableBit.mjDSBL_CONTACT)
    random, worst = np.random.default_rng(seed), 0.0
    for _ in range(2):
        q = {name: random.uniform(-1, 1) for name in robot.coordinates}
        state = robot.state(q, {name: random.normal() for name in robot.rates})
        q = {name: float(state[name]) for name in robot.coordinates}
        command, z = random.uniform(-2, 2, model.nu), random.uniform(-0.5, 0.5, model.na)
        data.act[:] = z
        rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
        set_state(model, data, q, rates, command)
        # Each drive with its own activations, in MuJoCo's order.
        seen, left, u = robot.observe(state), iter(z), []
        for name, own in zip(robot.actuators, command, strict=True):
            drive = robot.drives.get(name, lw.control.Ideal())
            states = [next(left) for _ in drive.extras]
            u.append(drive.equations(own, seen[name], seen.rate(name), states)[0])
        expected = accelerations(model, data)
        wanted = np.array([expected[name] for name in robot.independent])
        found = robot.forward_dynamics(state, u)
        worst = max(worst, np.abs(found - wanted).max() / np.abs(wanted).max())
    return worst


def jacobians(model: mj.MjModel, data: mj.MjData) -> np.ndarray:
    """Return the Jacobians of all bodies' angular velocity and mass centre, (bodies, 6, nv), the
    world's left out."""
    found = np.zeros((model.nbody - 1, 6, model.nv))
    for index in range(1, model.nbody):
        mj.mj_jacBodyCom(model, data, found[index - 1, 3:], found[index - 1, :3], index)
    return found


def body_accelerations(
    model: mj.MjModel,
    data: mj.MjData,
    twists: Mapping[str, tuple[np.ndarray, np.ndarray]],
    forces: Sequence[float],
    reset: bool = True,
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return (alpha, a) of the mass centres by body, where the bodies have given twists, at the
    keyframe if `reset`.

    A part of a body ("body.joint") moves like the body.
    """
    if reset:
        mj.mj_resetDataKeyframe(model, data, 0)
    mj.mj_forward(model, data)
    names = [model.body(index).name for index in range(1, model.nbody)]
    J = jacobians(model, data)
    t = np.concatenate([np.concatenate(twists[name.partition(".")[0]]) for name in names])
    data.qvel[:] = np.linalg.lstsq(J.reshape(-1, model.nv), t, rcond=None)[0]
    np.testing.assert_allclose(J.reshape(-1, model.nv) @ data.qvel, t, atol=1e-8)
    data.ctrl[:] = forces
    mj.mj_forward(model, data)
    sides = []
    for gap in (GAP, -GAP):
        near = mj.MjData(model)
        near.qpos[:] = data.qpos
        mj.mj_integratePos(model, near.qpos, data.qvel, gap)
        mj.mj_kinematics(model, near)
        mj.mj_comPos(model, near)
        sides.append(jacobians(model, near))
    a = J @ data.qacc + (sides[0] - sides[1]) @ data.qvel / (2 * GAP)
    return {name: (row[:3], row[3:]) for name, row in zip(names, a, strict=True) if "." not in name}
