"""Legs that drop on a floor under one law of contact, in Linkwork, MuJoCo and Exudyn.

    python -m tests.dropped FOLDER [--seconds 0.2] [--fall 0.002]

FOLDER holds clones, each named owner+name; PAL's Kangaroo, without its motors, drops from the
fall [m] on four corners of each sole. Told are how far the pelvis is apart in the engines at the
end [m], how far the loops of each are open [m], and what energy the run has lost beside its work.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import linkwork as lw
from linkwork.lab.engines.interface import load_engine

from tests.public_legs import BENT, KANGAROO

SOLE = [(x, y, 0.0) for x in (-0.09, 0.09) for y in (-0.04, 0.04)]
FINE, SOFT = 2e-5, (-1e9, -1e4)  # steps [s]; MuJoCo's solref of loops


@dataclass(frozen=True)
class Floor:
    """Hold a level floor, its law of contact, and the balls that may touch it: bodies with points
    of one radius."""

    height: float
    feet: tuple[tuple[str, tuple[float, float, float]], ...]
    radius: float = 0.0
    stiffness: float = 2e5
    dissipation: float = 0.6
    friction: float = 0.5
    rate: float = 0.02

    def contacts(self) -> dict[str, lw.Contact]:
        """Return it as contacts of a mechanism."""
        frame = lw.Frame(position=(0, 0, self.height))
        return {
            f"foot {k}": lw.Contact(
                connects=("ground", body),
                surfaces=(lw.Plane(frame=frame), lw.Points(points=(at,), radius=self.radius)),
                stiffness=self.stiffness,
                dissipation=self.dissipation,
                friction=lw.Sliding(coefficient=self.friction, rate=self.rate),
            )
            for k, (body, at) in enumerate(self.feet)
        }

    def force(
        self, centre: np.ndarray, v: np.ndarray, omega: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the force on a ball and the moment about its centre, which moves with v."""
        depth = self.height + self.radius - centre[2]
        if depth <= 0:
            return np.zeros(3), np.zeros(3)
        arm = np.array([0, 0, depth / 2 - self.radius])
        u = v + np.cross(omega, arm)
        N = self.stiffness * depth**1.5 * max(1 - self.dissipation * v[2], 0.0)
        slip = np.sqrt(u[0] ** 2 + u[1] ** 2 + self.rate**2)
        force = np.array([-self.friction * N * u[0] / slip, -self.friction * N * u[1] / slip, N])
        return force, np.cross(arm, force)


def in_mujoco(mechanism: lw.Mechanism, floor: Floor, times: np.ndarray) -> np.ndarray:
    """Return where the first foot's body is (K, 3), by MuJoCo from home with forces put on."""
    mujoco = load_engine("mujoco", "MuJoCo")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "leg.xml"
        lw.formats.save(mechanism, path)
        model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = FINE
    model.eq_solref[:] = SOFT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT  # told in a run, no stops there
    data, found = mujoco.MjData(model), []
    mujoco.mj_resetDataKeyframe(model, data, 0)
    feet = [(model.body(body).id, np.array(at)) for body, at in floor.feet]
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for t in times:
        while data.time < t - FINE / 2:
            mujoco.mj_forward(model, data)
            data.qfrc_applied[:] = 0
            for body, at in feet:
                centre = data.xpos[body] + data.xmat[body].reshape(3, 3) @ at
                mujoco.mj_jac(model, data, linear, angular, centre, body)
                force, moment = floor.force(centre, linear @ data.qvel, angular @ data.qvel)
                data.qfrc_applied[:] += linear.T @ force + angular.T @ moment
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        found.append(data.xpos[feet[0][0]].copy())
    return np.array(found)


@contextmanager
def floored(floor: Floor) -> Iterator[None]:
    """Let Exudyn's systems be built with a floor."""
    from linkwork.lab.engines import exudyn, exudyn_items

    items, scene = load_engine("exudyn.itemInterface", "Exudyn"), exudyn_items.scene

    def pressed(_s: Any, _t: float, _n: Any, x: Any, _r: Any, v: Any, w: Any, *_: Any) -> Any:
        """The spring's force and torque on its first end, against those on the foot, in the
        ground's axes."""
        return -np.concatenate(floor.force(np.array(x), np.array(v), np.array(w)))

    def with_floor(*given: Any) -> Any:
        built = scene(*given)
        ground = exudyn_items.marker(built.system, built.seats["ground"], np.eye(4))
        for body, at in floor.feet:
            frame = np.eye(4)
            frame[:3, 3] = at
            foot = exudyn_items.marker(built.system, built.seats[body], frame)
            spring = items.RigidBodySpringDamper(
                markerNumbers=[ground, foot], springForceTorqueUserFunction=pressed
            )
            built.system.AddObject(spring)
        return built

    with patch.object(exudyn, "scene", with_floor):
        yield


def in_exudyn(
    robot: lw.Robot, floor: Floor, seconds: float, step: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return times, where the first foot's body is (K, 3), and how far loops are open at most, by
    Exudyn from home."""
    from linkwork.lab.engines.exudyn import ExudynEngine

    home, nothing = robot.home, np.zeros(len(robot.actuators))
    with floored(floor):
        engine = ExudynEngine(robot.mechanism)
        rates = np.zeros(len(robot.rates))
        run = engine.simulate(home.positions, rates, nothing, seconds, step)
    body = list(robot.mechanism.bodies).index(floor.feet[0][0])
    return run.time, run.body_poses[:, body, :3, 3], run.closure_error


def kangaroo(folder: Path) -> lw.Mechanism:
    """Return the Kangaroo's lower body, free."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = folder / KANGAROO / "kangaroo_lower_body.xml"
        return lw.Robot.from_file(path, reference=BENT).mechanism


def dropped(mechanism: lw.Mechanism, floor: Floor, times: np.ndarray) -> lw.Run:
    """Return the run from home, saved at times."""
    robot = lw.Robot(mechanism.model_copy(update={"contacts": floor.contacts()}))
    options: Any = {"save_at": times, "rtol": 1e-10, "atol": 1e-12}
    return robot.simulate(robot.home, duration=times[-1], **options)


def foot_of(run: lw.Run, robot: lw.Robot, body: str) -> np.ndarray:
    """Return where a body is (K, 3)."""
    return robot.body_poses(robot.state(run.dataset["joint_position"].values))[body][0]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.dropped")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=0.2)
    parser.add_argument("--fall", type=float, default=0.002)
    parser.add_argument("--step", type=float, default=1e-4, help="of Exudyn [s]")
    asked = parser.parse_args()
    mechanism = kangaroo(asked.folder)
    robot, soles = lw.Robot(mechanism), ("left_foot_sole", "right_foot_sole")
    feet = tuple((sole, corner) for sole in soles for corner in SOLE)
    poses = robot.body_poses(robot.home)
    heights = [(poses[body][0] + poses[body][1] @ at)[2] for body, at in feet]
    floor = Floor(min(heights) - asked.fall, feet)
    times = np.linspace(0, asked.seconds, 11)[1:]
    run = dropped(mechanism, floor, times)
    own = foot_of(run, robot, soles[0])
    data = run.dataset
    print(f"Linkwork: {run.status.name}, {run.steps} steps, begins: ", end="")
    print(sum("begins" in name for name in run.coords["event"].values))
    print(f"  loops open by {data['closure_error'].values.max():.1e} m at most", end="")
    print(f", energy beside work {np.abs(data['energy_balance'].values).max():.1e} J")
    theirs = in_mujoco(mechanism, floor, times)
    print(f"MuJoCo: left sole apart by {np.abs(theirs - own).max():.1e} m, of a way of", end="")
    print(f" {np.abs(own - poses[soles[0]][0]).max():.1e} m")
    t, places, gap = in_exudyn(robot, floor, asked.seconds, asked.step)
    at = [int(np.abs(t - time).argmin()) for time in times]
    print(f"Exudyn: left sole apart by {np.abs(places[at] - own).max():.1e} m", end="")
    print(f", loops open by {gap:.1e} m")


if __name__ == "__main__":
    main()
