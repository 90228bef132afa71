"""The mechanism in MuJoCo: a spanning tree whose loops are closed by soft equality constraints.

    M q'' + h = S' u + J' f,   J q'' + gamma + R f = -b r' - k r          (r: the gaps, R: MuJoCo's regularisation)

A cut revolute joint becomes one `connect` (planar loop) or two on its axis, between sites; a cut prismatic joint stays
in the tree and leads to one part of its body, and a `weld` joins the parts. The constraints' impedance is 0.9999,
MuJoCo's greatest, and R, which MuJoCo takes from `body_invweight0`, is scaled down by `softness`. As J q'' + gamma is in
the equation, the restoring terms only have to undo drift: critical damping with a time constant far above the step. (The
shortest allowed, two steps, costs the Runge-Kutta method its order: accelerations are then off by 1e-4.)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.engines.common import (
    Branch,
    EngineError,
    EngineRun,
    Forces,
    Tie,
    branches,
    checked,
    checked_forces,
    coordinates,
    inertia_tensor,
    instants,
    load_engine,
    run_on_tree,
    spanning_tree,
    ties,
)
from linkwork.mechanism import GROUND, Mechanism

mj = load_engine("mujoco", "MuJoCo")

IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
SOLREF = (0.05, 1.0)  # time constant of the restoring terms [s] and their damping ratio
TOLERANCE, ITERATIONS = 1e-10, 50  # of MuJoCo's Newton solver
UNUSED = ("CONTACT", "LIMIT", "FRICTIONLOSS", "SPRING", "DAMPER", "SENSOR", "WARMSTART", "ISLAND", "CLAMPCTRL")
"""Features switched off: none is in the model; without warm starts a result depends on its state alone."""


class MujocoEngine:
    """Evaluate and simulate a mechanism with MuJoCo's `mj_forward` and `mj_step`.

    Args:
        mechanism: the description; every body that moves has mass and inertia.
        softness: factor on MuJoCo's estimate of the inverse inertia that a constraint feels, to which R is
            proportional; 1 is MuJoCo as it comes, smaller is stiffer until rounding wins (near 1e-4).

    Attributes:
        mechanism, tree: the description, and the spanning tree chosen in it.
        model, data: MuJoCo's own objects.
        columns: for each of the model's coordinates its place among all joint coordinates.
        drives: for each actuator its place among the model's coordinates.

    Raises:
        EngineError: MuJoCo is missing or refuses the model, or actuated joints alone close a loop.
    """

    name = "mujoco"
    version = str(mj.__version__)

    def __init__(self, mechanism: Mechanism, softness: float = 1e-3):
        self.mechanism, self.tree = mechanism, spanning_tree(mechanism)
        spec = mj.MjSpec()
        self._seats = {GROUND: spec.worldbody}
        for branch in branches(self.tree):
            self._grow(branch)
        for number, tie in enumerate(ties(self.tree)):
            self._close(spec, tie, number)
        try:
            self.model = spec.compile()
        except ValueError as error:
            raise EngineError(f"MuJoCo refuses {mechanism.name!r}: {' '.join(str(error).split())}") from None
        self._set_options(softness)
        self.data = mj.MjData(self.model)
        place = coordinates(mechanism)
        names = [self.model.joint(index).name for index in range(self.model.njnt)]
        self.columns = np.array([place[name] for name in names], dtype=int)
        self.drives = np.array([names.index(name) for name in mechanism.actuators], dtype=int)

    def _grow(self, branch: Branch) -> None:
        """Add a joint and the part of a body that it carries."""
        item, described = branch.edge, self.mechanism.bodies[branch.edge.bodies[1]]
        pose = item.frames[0] @ np.linalg.inv(item.frames[1])
        body = self._seats[item.bodies[0]].add_body(name=f"body {branch.part}", pos=pose[:3, 3], quat=quaternion(pose))
        body.mass, body.ipos, body.explicitinertial = branch.share * described.mass, described.centre_of_mass, True
        body.fullinertia = branch.share * inertia_tensor(described)[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
        if item.kind != "fixed":
            joint = mj.mjtJoint.mjJNT_HINGE if item.kind == "revolute" else mj.mjtJoint.mjJNT_SLIDE
            body.add_joint(name=item.joint, type=joint, pos=item.frames[1][:3, 3], axis=item.frames[1][:3, 2])
        self._seats[branch.part] = body

    def _close(self, spec: Any, tie: Tie, number: int) -> None:
        sites = f"tie {number} near", f"tie {number} far"
        for site, part, frame in zip(sites, tie.parts, tie.frames, strict=True):
            self._seats[part].add_site(name=site, pos=frame[:3, 3], quat=quaternion(frame))
        kind = {"point": mj.mjtEq.mjEQ_CONNECT, "weld": mj.mjtEq.mjEQ_WELD}[tie.kind]
        equality = spec.add_equality(type=kind, objtype=mj.mjtObj.mjOBJ_SITE, name1=sites[0], name2=sites[1])
        equality.solimp, equality.solref = IMPEDANCE, SOLREF
        if tie.kind == "weld":
            equality.data[10] = 1.0  # torque scale

    def _set_options(self, softness: float) -> None:
        option = self.model.opt
        option.gravity[:] = self.mechanism.gravity
        option.integrator, option.solver = mj.mjtIntegrator.mjINT_RK4, mj.mjtSolver.mjSOL_NEWTON
        option.tolerance, option.iterations = TOLERANCE, ITERATIONS
        for feature in UNUSED:
            option.disableflags |= getattr(mj.mjtDisableBit, f"mjDSBL_{feature}")
        self.model.body_invweight0[:] *= softness

    def _set_state(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> None:
        positions, rates = checked(self.mechanism, positions, rates)
        mj.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = positions[self.columns], rates[self.columns]
        self.data.qfrc_applied[self.drives] = checked_forces(self.mechanism, forces)

    def evaluation(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> Callable[[], object]:
        """Return MuJoCo's own forward dynamics at a state as a call without arguments or wrapping, for timing."""
        self._set_state(positions, rates, forces)
        return partial(mj.mj_forward, self.model, self.data)

    def accelerations(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the accelerations of the actuated joints, shape (n,); see `Engine.accelerations`."""
        self.evaluation(positions, rates, forces)()
        return self.data.qacc[self.drives]

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by MuJoCo's Runge-Kutta method of order 4; see `Engine.simulate`.

        The forces are asked for in every stage, through MuJoCo's control callback: one process-wide slot, so that two
        simulations cannot run at once in two threads.
        """
        time = instants(duration, step)
        self.model.opt.timestep = time[1]
        self._set_state(positions, rates, forces(0.0))
        model, data = self.model, self.data
        table = np.zeros((2, len(time), len(coordinates(self.mechanism))))
        table[0][:] = positions
        states, accelerations = np.empty((2, len(time), model.nv)), np.empty((len(time), len(self.drives)))

        def drive(_model: Any, stage: Any) -> None:
            stage.qfrc_applied[self.drives] = forces(stage.time)

        mj.set_mjcb_control(drive)
        try:
            start = perf_counter()
            states[:, 0] = data.qpos, data.qvel
            for k in range(1, len(time)):
                mj.mj_step(model, data)
                states[:, k] = data.qpos, data.qvel
            seconds = perf_counter() - start
            for k, t in enumerate(time):
                (data.qpos[:], data.qvel[:]), data.time = states[:, k], t
                mj.mj_forward(model, data)
                accelerations[k] = data.qacc[self.drives]
        finally:
            mj.set_mjcb_control(None)
        table[:, :, self.columns] = states
        return run_on_tree(self.mechanism, self.tree, time, (table[0], table[1]), accelerations, seconds)


def quaternion(pose: np.ndarray) -> np.ndarray:
    """Return the orientation of a pose as a unit quaternion (w, x, y, z)."""
    return Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)
