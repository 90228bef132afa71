"""The mechanism in MuJoCo: a spanning tree whose loops are closed by soft equality constraints.

    M v' + h = S' u + J' f,   J v' + gamma + R f = -b r' - k r          (r: the gaps, R: MuJoCo's regularisation)

A cut spherical joint becomes a `connect` between sites, a cut revolute joint one (planar loop) or two on its axis; other
cut joints stay in the tree and lead to one part of their body, and a `weld` joins the parts. A screw is a hinge and a
slide, which a tendon of fixed length couples; so is a gear. Rods are links with borrowed mass (a tendon between their ends
would lack gamma). Springs between points are tendons; springs and friction in joints are forces added from outside,
rotors are armature.

The constraints' impedance is 0.9999, MuJoCo's greatest, and R, which MuJoCo takes from its estimates of inverse inertia,
is scaled down by `softness`. As J v' + gamma is in the equation, the restoring terms only have to undo drift: critical
damping with a time constant far above the step. (The shortest allowed, two steps, costs the Runge-Kutta method its
order: accelerations are then off by 1e-4.)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.engines.interface import EngineError, EngineRun, Forces, checked_forces, in_time, instants, load_engine
from linkwork.engines.plan import plan, split
from linkwork.engines.rewrite import inertia_tensor
from linkwork.engines.start import Guess
from linkwork.engines.tree import Branch, Tie
from linkwork.mechanism import GROUND, Mechanism, PointSpring

mj = load_engine("mujoco", "MuJoCo")

IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
SOLREF = (0.05, 1.0)  # time constant of the restoring terms [s] and their damping ratio
TOLERANCE, ITERATIONS = 1e-10, 50  # of MuJoCo's Newton solver
UNUSED = ("CONTACT", "LIMIT", "FRICTIONLOSS", "SENSOR", "WARMSTART", "ISLAND", "CLAMPCTRL")
"""Features switched off: none is in the model; without warm starts a result depends on its state alone."""
QUATERNION = (0, 1, 2, 3)  # places of w, x, y, z
NEARLY_NOTHING = 1e-12  # mass [kg] and inertia [kg m^2] of a body between the ball and the slides of a free joint
KINDS = {"turn": mj.mjtJoint.mjJNT_HINGE, "slide": mj.mjtJoint.mjJNT_SLIDE, "ball": mj.mjtJoint.mjJNT_BALL}
Seat = tuple[Any, np.ndarray]  # MuJoCo's body, and the pose of ours in it


class MujocoEngine:
    """Evaluate and simulate a mechanism with MuJoCo's `mj_forward` and `mj_step`.

    Args:
        mechanism: the description; every body that moves has mass and inertia.
        softness: factor on MuJoCo's estimate of the inverse inertia that a constraint feels, to which R is
            proportional; 1 is MuJoCo as it comes, smaller is stiffer until rounding wins (near 1e-4).
        guess: approximate poses (4, 4) of bodies that only rods reach; the ground's frame where left out.

    Attributes:
        plan: the spanning tree chosen in the description, and the translation of its coordinates.
        model, data: MuJoCo's own objects.
        seats: for each body (and part of a body) its name in MuJoCo, and its pose in that body's frame.

    Raises:
        EngineError: MuJoCo is missing or refuses the model, or a body has no mass that its rods could borrow.
    """

    name = "mujoco"
    version = str(mj.__version__)

    def __init__(self, mechanism: Mechanism, softness: float = 1e-3, guess: Guess | None = None):
        self.mechanism = mechanism
        self.plan = plan(mechanism, QUATERNION, guess or {}, split_screws=True)
        self.spec = mj.MjSpec()
        self._seats: dict[str, Seat] = {GROUND: (self.spec.worldbody, np.eye(4))}
        for branch in self.plan.branches:
            self._grow(branch)
        for number, tie in enumerate(self.plan.ties):
            self._close(tie, f"tie {number}")
        lengths = self._couple()
        for name, spring in mechanism.springs.items():
            self._stretch(name, spring)
        try:
            self.model = self.spec.compile()
        except ValueError as error:
            raise EngineError(f"MuJoCo refuses {mechanism.name!r}: {' '.join(str(error).split())}") from None
        for name, length in lengths.items():
            tendon = self.model.tendon(name).id
            self.model.equality(name).data[0] = length - self.model.tendon_length0[tendon]
        self.model.dof_armature[:] = self.plan.joint_forces.rotors
        self._set_options(softness)
        self.data = mj.MjData(self.model)

    @property
    def columns(self) -> np.ndarray:
        """Return for each of the model's coordinates its place among all joint coordinates."""
        return self.plan.vectors.columns

    @property
    def drives(self) -> np.ndarray:
        """Return for each actuator its place among the model's rates."""
        return self.plan.drives.places

    @property
    def seats(self) -> dict[str, tuple[str, np.ndarray]]:
        """Return for each body (and part of a body) its name in MuJoCo, and its pose in that body's frame."""
        return {part: (body.name, pose) for part, (body, pose) in self._seats.items()}

    def _grow(self, branch: Branch) -> None:
        """Add a joint and the part of a body that it carries; MuJoCo's body has the axes of the joint's far frame."""
        item, described = branch.edge, self.plan.carried.bodies[branch.edge.bodies[1]]
        parent, seat = self._seats[item.bodies[0]]
        near, far = seat @ item.frames[0], np.linalg.inv(item.frames[1])
        body = parent.add_body(name=f"body {branch.part}", pos=near[:3, 3], quat=quaternion(near))
        for step in split(item.steps):
            if body.joints and body.joints[-1].type == KINDS["ball"]:
                body = after_a_ball(body)
            title = advance(step.rates[0]) if step.follows else step.rates[0]
            body.add_joint(name=title, type=KINDS[step.motion], axis=step.axis)
        moments, turn = principal(far[:3, :3] @ inertia_tensor(described) @ far[:3, :3].T)
        body.mass, body.explicitinertial = branch.share * described.mass, True
        body.ipos = far[:3, :3] @ described.centre_of_mass + far[:3, 3]
        body.inertia, body.iquat = branch.share * moments, quaternion(turn)
        self._seats[branch.part] = body, far

    def _close(self, tie: Tie, name: str) -> None:
        sites = [
            self._mark(part, frame, f"{name} {i}")
            for i, (part, frame) in enumerate(zip(tie.parts, tie.frames, strict=True))
        ]
        kind = {"point": mj.mjtEq.mjEQ_CONNECT, "weld": mj.mjtEq.mjEQ_WELD}[tie.kind]
        equality = self.spec.add_equality(type=kind, objtype=mj.mjtObj.mjOBJ_SITE, name1=sites[0], name2=sites[1])
        equality.solimp, equality.solref = IMPEDANCE, SOLREF
        if tie.kind == "weld":
            equality.data[10] = 1.0  # torque scale

    def _mark(self, part: str, frame: np.ndarray, name: str) -> str:
        """Put a site at a frame of a part of a body and return its name."""
        body, seat = self._seats[part]
        pose = seat @ frame
        body.add_site(name=name, pos=pose[:3, 3], quat=quaternion(pose))
        return name

    def _couple(self) -> dict[str, float]:
        """Add tendons along joint coordinates, kept at constant lengths, for screws and gears; return the lengths."""
        screws = {
            step.rates[0]: step.pitch
            for branch in self.plan.branches
            for step in branch.edge.steps
            if step.motion == "screw"
        }
        couplings = {f"screw {name}": ({name: pitch, advance(name): -1.0}, 0.0) for name, pitch in screws.items()}
        couplings |= {f"gear {name}": (gear.ratios, gear.offset) for name, gear in self.mechanism.gears.items()}
        for name, (ratios, _) in couplings.items():
            tendon = self.spec.add_tendon(name=name)
            for joint, ratio in ratios.items():
                tendon.wrap_joint(joint, ratio)
            equality = self.spec.add_equality(
                name=name, type=mj.mjtEq.mjEQ_TENDON, objtype=mj.mjtObj.mjOBJ_TENDON, name1=name
            )
            equality.solimp, equality.solref = IMPEDANCE, SOLREF
        return {name: length for name, (_, length) in couplings.items()}

    def _stretch(self, name: str, spring: PointSpring) -> None:
        """Add a spring and damper between two points as a tendon."""
        tendon = self.spec.add_tendon(name=f"spring {name}")
        tendon.stiffness, tendon.damping = (spring.stiffness, 0, 0), (spring.damping, 0, 0)
        tendon.springlength = spring.rest_length, spring.rest_length
        for end, (body, point) in enumerate(zip(spring.connects, spring.points, strict=True)):
            frame = np.eye(4)
            frame[:3, 3] = point
            tendon.wrap_site(self._mark(body, frame, f"spring {name} {end}"))

    def _set_options(self, softness: float) -> None:
        option = self.model.opt
        option.gravity[:] = self.mechanism.gravity
        option.integrator, option.solver = mj.mjtIntegrator.mjINT_RK4, mj.mjtSolver.mjSOL_NEWTON
        option.tolerance, option.iterations = TOLERANCE, ITERATIONS
        for feature in UNUSED:
            option.disableflags |= getattr(mj.mjtDisableBit, f"mjDSBL_{feature}")
        for estimate in (self.model.body_invweight0, self.model.tendon_invweight0):
            estimate[:] *= softness

    def _set_state(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> None:
        q, v = self.plan.state(positions, rates)
        mj.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = q, v
        self.data.qfrc_applied[:] = self.plan.forces(q, v, checked_forces(self.mechanism, forces))

    def evaluation(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> Callable[[], object]:
        """Return MuJoCo's own forward dynamics at a state as a call without arguments or wrapping, for timing."""
        self._set_state(positions, rates, forces)
        return partial(mj.mj_forward, self.model, self.data)

    def accelerations(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the derivatives of the actuated rates, shape (n,); see `Engine.accelerations`."""
        self.evaluation(positions, rates, forces)()
        return self.plan.actuated(self.data.qpos, self.data.qvel, self.data.qacc)

    def joint_accelerations(self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return the derivatives of all joint rates, shape (nv,); see `Engine.joint_accelerations`."""
        self.evaluation(positions, rates, forces)()
        state = self.data.qpos[None], self.data.qvel[None], self.data.qacc[None]
        return self.plan.joints(*state, np.asarray(positions)).accelerations[0]

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by MuJoCo's Runge-Kutta method of order 4; see `Engine.simulate`.

        The forces are asked for in every stage, through MuJoCo's control callback: one process-wide slot, so that two
        simulations cannot run at once in two threads.
        """
        pushing, time = in_time(self.mechanism, forces), instants(duration, step)
        self.model.opt.timestep = time[1]
        self._set_state(positions, rates, pushing(0.0))
        model, data = self.model, self.data
        q, v, a = (np.empty((len(time), size)) for size in (model.nq, model.nv, model.nv))

        def drive(_model: Any, stage: Any) -> None:
            stage.qfrc_applied[:] = self.plan.forces(stage.qpos, stage.qvel, pushing(stage.time))

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
        return self.plan.run(time, q, v, a, np.asarray(positions), seconds)


def after_a_ball(body: Any) -> Any:
    """Return a body for the joints that follow a ball, and leave nearly nothing in its place.

    MuJoCo's gamma is wrong for joints that follow a ball in the same body.
    """
    name, body.name = body.name, f"ball of {body.name}"
    body.mass, body.inertia, body.explicitinertial = NEARLY_NOTHING, [NEARLY_NOTHING] * 3, True
    return body.add_body(name=name)


def advance(screw: str) -> str:
    """Name the slide of a screw; no joint's name holds a space before a dot."""
    return f"{screw} .advance"


def principal(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the principal moments and their axes; MuJoCo wants A + B >= C to the last digit."""
    moments, axes = np.linalg.eigh(tensor)
    moments[2] = min(moments[2], moments[0] + moments[1])
    return moments, axes * np.linalg.det(axes)


def quaternion(pose: np.ndarray) -> np.ndarray:
    """Return the orientation of a pose as a unit quaternion (w, x, y, z)."""
    return Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)
