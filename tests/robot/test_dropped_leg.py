"""A free body on a leg with a closed loop that drops on a plane, beside MuJoCo and beside the same
forces written by hand."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw

from tests.dropped import Floor, foot_of, in_exudyn
from tests.equations.evaluation import close

K, C, MU, RATE, R = 2e5, 0.6, 0.5, 0.02, 0.02
TIMES = np.linspace(0.02, 0.3, 15)


def leg(touches: bool) -> lw.Robot:
    """Return a trunk on a five-bar leg, whose foot is a ball at the end of a shank."""
    thigh = lw.Body(
        mass=0.3, centre_of_mass=(0.1, 0, 0), inertia=lw.Inertia(xx=1e-4, yy=1e-3, zz=1e-3)
    )
    trunk = lw.Body(mass=3.0, inertia=lw.Inertia(xx=0.02, yy=0.03, zz=0.03))
    along, turned = (0.2, 0.0, 0.0), lw.Frame(position=(0.2, 0, 0))
    hips = {"hip_1": -0.05, "hip_2": 0.05}
    joints: dict[str, lw.mechanism.PairJoint] = {
        "float": lw.FreeJoint(connects=("ground", "trunk"))
    }
    for i, (name, x) in enumerate(hips.items(), start=1):
        rest = 2.4 if i == 1 else 0.75
        joints[name] = lw.RevoluteJoint(
            connects=("trunk", f"thigh_{i}"),
            axis=(0, 1, 0),
            frames=(lw.Frame(position=(x, 0, 0)), lw.Frame()),
            spring=lw.Spring(stiffness=40.0, rest=rest, damping=0.3),
        )
        joints[f"knee_{i}"] = lw.RevoluteJoint(
            connects=(f"thigh_{i}", f"shank_{i}"), axis=(0, 1, 0), frames=(turned, lw.Frame())
        )
    joints["ankle"] = lw.RevoluteJoint(
        connects=("shank_1", "shank_2"), axis=(0, 1, 0), frames=(turned, turned)
    )
    contact = lw.Contact(
        connects=("ground", "shank_1"),
        surfaces=(lw.Plane(), lw.Points(points=(along,), radius=R)),
        stiffness=K,
        dissipation=C,
        friction=lw.Sliding(coefficient=MU, rate=RATE),
    )
    return lw.Robot(
        lw.Mechanism(
            name="leg",
            bodies={"trunk": trunk}
            | {f"{part}_{i}": thigh for i in (1, 2) for part in ("thigh", "shank")},
            joints=joints,
            contacts={"foot": contact} if touches else {},
            reference={"hip_1": 2.4, "hip_2": 0.75, "knee_1": -1.7, "knee_2": 1.7, "float.z": 0.33},
        )
    )


@pytest.fixture(scope="module")
def dropped() -> tuple[lw.Robot, lw.Run]:
    robot = leg(touches=True)
    run = robot.simulate(robot.home, duration=TIMES[-1], save_at=TIMES, rtol=1e-10, atol=1e-12)
    assert run.status is lw.Status.FINISHED, run.message
    return robot, run


def test_the_loop_stays_closed_and_the_energy_is_kept(dropped):
    robot, run = dropped
    assert "foot: contact begins" in run.coords["event"].values
    assert robot.mobility == 8 and run["contact_power"].values.min() < -0.1
    assert run["closure_error"].values.max() < 1e-13 * robot.size
    close(run["energy_balance"].values, 0 * TIMES, 1e-8)


def test_it_is_the_leg_with_the_same_force_written_by_hand(dropped):
    """A wrench on the shank at its foot, of where that is and how it moves."""
    _, run = dropped
    plain = leg(touches=False)

    def depth(state):
        shank = state.body("shank_1")
        foot = shank.position + shank.rotation @ np.array([0.2, 0.0, 0.0])
        return R - foot[2]

    def force(t, state):
        shank, d = state.body("shank_1"), depth(state)
        at = shank.rotation @ np.array([0.2, 0.0, 0.0]) - np.array([0, 0, 1]) * (R - d / 2)
        w, v = shank.angular_velocity, shank.velocity
        u = [
            v[0] + w[1] * at[2] - w[2] * at[1],
            v[1] + w[2] * at[0] - w[0] * at[2],
            v[2] + w[0] * at[1] - w[1] * at[0],
        ]
        N = K * lw.math.maximum(d, 0.0) ** 1.5 * lw.math.maximum(1 - C * u[2], 0.0)
        slip = lw.math.sqrt(u[0] ** 2 + u[1] ** 2 + RATE**2)
        return [-MU * N * u[0] / slip, -MU * N * u[1] / slip, N], at

    def moment(t, state):
        F, at = force(t, state)
        return [
            at[1] * F[2] - at[2] * F[1],
            at[2] * F[0] - at[0] * F[2],
            at[0] * F[1] - at[1] * F[0],
        ]

    push = lw.control.Wrench("shank_1", force=lambda t, state: force(t, state)[0], moment=moment)
    event = lw.control.Event(lambda t, state: depth(state), name="foot", cuts=True)
    other = plain.simulate(
        plain.home,
        duration=TIMES[-1],
        save_at=TIMES,
        wrenches=[push],
        events=[event],
        rtol=1e-10,
        atol=1e-12,
    )
    found, expected = (one["joint_position"].values for one in (run, other))
    close(found, expected, 1e-7)


def test_it_moves_as_in_mujoco_under_the_same_compliance(dropped, tmp_path):
    """MuJoCo holds its loop softly, and its small steps are of first order."""
    mujoco = pytest.importorskip("mujoco")
    _, run = dropped
    plain = leg(touches=False)
    lw.formats.save(plain.mechanism, tmp_path / "leg.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "leg.xml"))
    model.opt.timestep = 4e-5
    model.eq_solref[:] = (-1e9, -1e4)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    shank, trunk = (model.body(name).id for name in ("shank_1", "trunk"))
    places = []
    for t in TIMES:
        while data.time < t - 1e-9:
            mujoco.mj_forward(model, data)
            foot = data.body(shank).xpos + data.body(shank).xmat.reshape(3, 3)[:, 0] * 0.2
            d = R - foot[2]
            data.qfrc_applied[:] = 0
            if d > 0:
                at = foot - [0, 0, R - d / 2]
                J = np.zeros((3, model.nv))
                mujoco.mj_jac(model, data, J, None, at, shank)
                u = J @ data.qvel
                N = K * d**1.5 * max(1 - C * u[2], 0)
                slip = np.hypot(np.hypot(u[0], u[1]), RATE)
                data.qfrc_applied[:] = J.T @ [-MU * N * u[0] / slip, -MU * N * u[1] / slip, N]
            mujoco.mj_step(model, data)
        places.append(data.body(trunk).xpos.copy())
    names = ["float.x", "float.z"]
    found = run["joint_position"].sel(coordinate=names).values
    close(found, np.array(places)[:, [0, 2]], 5e-5)


@pytest.mark.long
def test_it_moves_as_in_exudyn_under_the_same_compliance(dropped):
    """Exudyn holds its loop by multipliers, at the end of each of its steps, of second order."""
    pytest.importorskip("exudyn")
    _, run = dropped
    foot = (("shank_1", (0.2, 0.0, 0.0)),)
    floor = Floor(0.0, foot, R, K, C, MU, RATE)
    plain = leg(touches=False)
    time, places, gap = in_exudyn(plain, floor, TIMES[-1], 2e-4)
    found = foot_of(run, plain, "shank_1")
    at = np.abs(time[:, None] - TIMES).argmin(axis=0)
    close(places[at], found, 1e-5)
    assert gap < 1e-9
