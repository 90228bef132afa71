"""The mechanism in MuJoCo: the model file that `linkwork.formats` writes of it, with stiffer
constraints.

    M v' + h = S' u + J' f,  J v' + gamma + R f = -b r' - k r

r are the gaps, R is MuJoCo's regularisation. `linkwork.formats.mjcf.model_plan` says how MJCF holds
a mechanism. Two things are put in other words first: rods are links with borrowed mass (a tendon
between their ends would lack gamma), and Coulomb friction and the springs of balls, which MuJoCo
takes otherwise, are forces added from outside.

The constraints' impedance is 0.9999, MuJoCo's greatest, and R, which MuJoCo takes from its
estimates of inverse inertia, is scaled down by `softness`. As J v' + gamma is in the equation, the
restoring terms only have to undo drift: critical damping with a time constant far above the step.
(The shortest allowed, two steps, costs the Runge-Kutta method its order: accelerations are then off
by 1e-4.)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from linkwork.formats.mjcf.model_plan import plan
from linkwork.formats.mjcf.writer import to_mjcf
from linkwork.lab.engines.carried import carry, joints_of, run_of
from linkwork.lab.engines.exported import home_with_links, layout
from linkwork.lab.engines.interface import (
    EngineError,
    EngineRun,
    Forces,
    checked_forces,
    in_time,
    instants,
    load_engine,
)
from linkwork.lab.engines.rewrite import effects_apart
from linkwork.lab.engines.start import Guess
from linkwork.lab.engines.tree import has_forces
from linkwork.mechanism import Mechanism, MechanismError

mj = load_engine("mujoco", "MuJoCo")

SOLREF = (0.05, 1.0)  # time constant of the restoring terms [s] and their damping ratio
TOLERANCE, ITERATIONS = 1e-10, 50  # of MuJoCo's Newton solver
UNUSED = ("CONTACT", "LIMIT", "FRICTIONLOSS", "SENSOR", "WARMSTART", "ISLAND", "CLAMPCTRL")
"""Features switched off: none is in the model; without warm starts a result depends on its state
alone."""


class MujocoEngine:
    """Evaluate and simulate a mechanism with MuJoCo's `mj_forward` and `mj_step`.

    Args:
        mechanism: the description; every body that moves has mass and inertia.
        softness: factor on MuJoCo's estimate of the inverse inertia that a constraint feels, to
            which R is proportional; 1 is MuJoCo as it comes, smaller is stiffer until rounding wins
            (near 1e-4).
        guess: approximate poses (4, 4) of bodies that only rods reach; the ground's frame where
            left out.

    Attributes:
        plan: the joints of the model in the description's terms.
        text: the model as MJCF.
        model, data: MuJoCo's own objects.
        seats: for each body (and part of a body) its name in MuJoCo, and its pose in that body's
            frame.

    Raises:
        EngineError: MuJoCo is missing or refuses the model, or a body has no mass that its rods
            could borrow.
    """

    name = "mujoco"
    version = str(mj.__version__)

    def __init__(self, mechanism: Mechanism, softness: float = 1e-3, guess: Guess | None = None):
        self.mechanism = mechanism
        carried = carry(mechanism, guess or {})
        held, outside = effects_apart(carried.whole)
        pushed = [name for name, joint in outside.pairs.items() if has_forces(joint)]
        home = home_with_links(carried)
        try:
            tree = plan(held, home, pushed)
            for seat in tree.light:
                raise EngineError(
                    f"MuJoCo refuses {mechanism.name!r}: it wants mass and inertia of all that "
                    f"moves, as of 'body {seat}'"
                )
            self.text, _ = to_mjcf(held, home, tree)
            spec = mj.MjSpec.from_string(self.text)
            spec.compiler.discardvisual = True
            self.model = spec.compile()
        except (MechanismError, ValueError) as error:
            raise EngineError(
                f"MuJoCo refuses {mechanism.name!r}: {' '.join(str(error).split())}"
            ) from None
        self.data = mj.MjData(self.model)
        self.plan = layout(carried, outside, home, tree, self.model)
        self.seats = {seat: (seat, np.eye(4)) for seat in tree.seats}
        self._set_options(softness)

    @property
    def columns(self) -> np.ndarray:
        """Return for each of qpos its place among all joint coordinates; -1 for those of a floating
        body."""
        found = np.full(self.model.nq, -1)
        found[self.plan.q] = self.plan.vectors.columns
        return found

    @property
    def drives(self) -> np.ndarray:
        """Return for each actuator its place among the model's rates."""
        return self.plan.v[self.plan.vectors.drives(self.mechanism.actuators).places]

    def _set_options(self, softness: float) -> None:
        option = self.model.opt
        option.integrator, option.solver = mj.mjtIntegrator.mjINT_RK4, mj.mjtSolver.mjSOL_NEWTON
        option.tolerance, option.iterations = TOLERANCE, ITERATIONS
        for feature in UNUSED:
            option.disableflags |= getattr(mj.mjtDisableBit, f"mjDSBL_{feature}")
        self.model.eq_solref[:] = SOLREF
        for estimate in (
            self.model.body_invweight0,
            self.model.dof_invweight0,
            self.model.tendon_invweight0,
        ):
            estimate[:] *= softness

    def _set_state(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> None:
        q, v = self.plan.state(positions, rates)
        mj.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, v
        self.data.ctrl[:] = checked_forces(self.mechanism, forces)
        self.data.qfrc_applied[:] = self.plan.forces(q, v)

    def evaluation(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> Callable[[], object]:
        """Return MuJoCo's own forward dynamics at a state as a call without arguments or wrapping,
        for timing."""
        self._set_state(positions, rates, forces)
        return partial(mj.mj_forward, self.model, self.data)

    def accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of the actuated rates, shape (n,); see `Engine.accelerations`."""
        self.evaluation(positions, rates, forces)()
        return self.plan.actuated(self.data.qpos, self.data.qvel, self.data.qacc)

    def joint_accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of all joint rates, shape (nv,); see
        `Engine.joint_accelerations`."""
        self.evaluation(positions, rates, forces)()
        state = self.data.qpos[None], self.data.qvel[None], self.data.qacc[None]
        return joints_of(self.plan, *state, np.asarray(positions)).accelerations[0]

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by MuJoCo's Runge-Kutta method of order 4; see `Engine.simulate`.

        The forces are asked for in every stage, through MuJoCo's control callback: one process-wide
        slot, so that two simulations cannot run at once in two threads.
        """
        pushing, time = in_time(self.mechanism, forces), instants(duration, step)
        self.model.opt.timestep = time[1]
        self._set_state(positions, rates, pushing(0.0))
        model, data = self.model, self.data
        q, v, a = (np.empty((len(time), size)) for size in (model.nq, model.nv, model.nv))

        def drive(_model: Any, stage: Any) -> None:
            stage.ctrl[:] = pushing(stage.time)
            stage.qfrc_applied[:] = self.plan.forces(stage.qpos, stage.qvel)

        mj.set_mjcb_control(drive)
        try:
            start = perf_counter()
            q[0], v[0] = data.qpos, data.qvel
            for k in range(1, len(time)):
                mj.mj_step(model, data)
                q[k], v[k] = data.qpos, data.qvel
            seconds = perf_counter() - start
            for k, t in enumerate(time):
                data.qpos[:], data.qvel[:], data.time = q[k], v[k], t
                mj.mj_forward(model, data)
                a[k] = data.qacc
        finally:
            mj.set_mjcb_control(None)
        return run_of(self.plan, time, q, v, a, np.asarray(positions), seconds)
