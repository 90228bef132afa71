"""A robot as a live model of MuJoCo, with the way from its states to qpos and qvel and back.

The model is the MJCF that `linkwork.formats` writes, with its loops closed at the robot's home;
MuJoCo's regularisation R of constraints, in proportion to its estimate of the inverse inertia that
they feel, is scaled down by `softness`; rods are links without weight (`rod_links`):

    M v' + h = S' u + J' f,   J v' + gamma + R f = -b r' - k r               (r: gaps of the loops)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.export.model_joints import ModelJoint, Moved, model_joints
from linkwork.export.rod_links import (
    LIGHT,
    RodLink,
    home_with_links,
    moved_with_links,
    with_links,
)
from linkwork.formats import poses
from linkwork.formats.mjcf.model_plan import Home, plan
from linkwork.formats.mjcf.writer import to_mjcf
from linkwork.mechanism import GROUND
from linkwork.model.checks import actuator_forces
from linkwork.model.state import State
from linkwork.robot import Robot

MISSING = "MuJoCo is not installed; pip install 'linkwork[engines]'"
SOFTNESS = 1e-3
"""Below it what MuJoCo's solver leaves is greater than what the softness does."""


@dataclass(frozen=True, eq=False)
class MujocoModel:
    """Hold a robot as a model of MuJoCo.

    robot: with its loops closed exactly; model: `mujoco.MjModel`; text: the MJCF that it is made of
    notes: what MuJoCo takes otherwise; accelerations agree but for what they say
    joints: where MuJoCo has the robot's joints, in the order of qpos; links: in place of its rods
    """

    robot: Robot
    model: Any
    text: str
    notes: tuple[str, ...]
    joints: tuple[ModelJoint, ...]
    links: tuple[RodLink, ...] = ()

    def data(
        self,
        state: State | None = None,
        forces: ArrayLike | Mapping[str, ArrayLike] | None = None,
    ) -> Any:
        """Return a `mujoco.MjData` at a state, after `mj_forward`.

        Args:
            state: one state of the robot; home if left out.
            forces: u of the actuators (actuators) [N, N m], or by name (others zero), as controls;
                all zero if left out.

        Raises:
            LinkworkError: a stack of states, a state of another robot, forces that do not fit.
        """
        engine = loaded()
        data = engine.MjData(self.model)
        data.qpos[:], data.qvel[:] = self.configuration(self.robot.home if state is None else state)
        if forces is not None:
            u = checks.finite(actuator_forces(forces, self.robot.actuators), "forces")
            if u.ndim != 1:
                raise LinkworkError("MuJoCo's data hold one state; give one force per actuator")
            data.ctrl[:] = u
        engine.mj_forward(self.model, data)
        return data

    def configuration(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return qpos and qvel at one state of the robot."""
        own = self.robot.own(state)
        if own.batch:
            raise LinkworkError("MuJoCo's data hold one state, not a stack; give state.at(index)")
        moved = moved_at(self.robot, own)
        moved = moved_with_links(self.robot.mechanism, moved, self.links)
        qpos, qvel = np.empty(self.model.nq), np.empty(self.model.nv)
        for joint in self.joints:
            qpos[joint.q], qvel[joint.v] = joint.into(moved)
        return qpos, qvel

    def positions(self, data: Any) -> dict[str, float]:
        """Return coordinates by name [m, rad; 1 of quaternions] of the joints that the model holds,
        as `Robot.assemble` and `Robot.state` take them. MuJoCo's loops are closed but softly.

        data: MuJoCo's MjData of the model.
        """
        return self._read(data, 0)

    def rates(self, data: Any) -> dict[str, float]:
        """Return rates by name [m/s, rad/s] of the joints that the model holds.

        data: MuJoCo's MjData of the model.
        """
        return self._read(data, 1)

    def accelerations(self, data: Any) -> dict[str, float]:
        """Return the accelerations of these rates by name [m/s^2, rad/s^2]: MuJoCo's qacc.

        data: MuJoCo's MjData of the model, after a forward pass.
        """
        return self._read(data, 2)

    def _read(self, data: Any, order: int) -> dict[str, float]:
        if not hasattr(data, "qacc"):
            raise LinkworkError(
                f"the data are {checks.shown(data)}; give the mujoco.MjData of this model"
            )
        found: dict[str, float] = {}
        of_links = {ball for link in self.links for ball in link.balls}
        for joint in self.joints:
            if joint.rates and joint.rates[0].rpartition(".")[0] in of_links:
                continue
            motion = data.qpos[joint.q], data.qvel[joint.v], data.qacc[joint.v]
            names = joint.rates if order else joint.coordinates
            found |= zip(names, map(float, joint.out_of(*motion)[order]), strict=True)
        return found

    def __repr__(self) -> str:
        return (
            f"MujocoModel({self.robot.mechanism.name}: {self.model.nq} coordinates, "
            f"{self.model.nv} rates, {self.model.neq} equalities, {self.model.nu} controls)"
        )


def mujoco(robot: Robot, softness: float = SOFTNESS) -> MujocoModel:
    """Return a robot as a live model of MuJoCo: `Robot.to_mujoco`.

    Args:
        robot: the robot, with the values that its free numbers have.
        softness: factor on MuJoCo's regularisation of constraints; 1: as MuJoCo takes the file.

    Raises:
        LinkworkError: MuJoCo is not installed, or refuses the model; MJCF cannot hold the robot, or
            a free joint leads to ground instead of from it.
    """
    checks.needed(robot, Robot)
    factor = checks.positive(softness, "softness")
    engine = loaded()
    mechanism, links = with_links(robot.mechanism)
    home = home_with_links(home_of(robot), links)
    held = plan(mechanism, home)
    text, notes = to_mjcf(mechanism, home, held)
    try:
        model = engine.MjModel.from_xml_string(text)
    except ValueError as error:
        why = " ".join(str(error).split())
        raise LinkworkError(f"MuJoCo refuses {mechanism.name!r}: {why}") from None
    for estimate in (model.body_invweight0, model.dof_invweight0, model.tendon_invweight0):
        estimate[:] *= factor
    give_way(engine, model, links)
    if links:
        named = ", ".join(name for name in robot.mechanism.joints if name not in mechanism.joints)
        notes += (f"{named}: rods are links of {LIGHT:g} of the robot's mass between ball joints",)
    if model.neq and factor != 1:
        notes += (f"what MuJoCo's constraints give way, as said above, is scaled by {factor:g}",)
    if mechanism.drives:
        driven = ", ".join(mechanism.drives)
        notes += (f"{driven}: drives act in MuJoCo; the controls are their commands, not forces",)
    joints = model_joints(mechanism, home, held, model)
    return MujocoModel(robot, model, text, notes, joints, links)


def give_way(engine: Any, model: Any, links: Sequence[RodLink]) -> None:
    """Let links give way as the bodies at their ends do, not as their own mass has it; as the body
    that does most where MuJoCo has neither."""

    def place(name: str) -> int:
        return engine.mj_name2id(model, engine.mjtObj.mjOBJ_BODY, name)

    estimate = model.body_invweight0
    own = [place(link.name) for link in links]
    most = np.delete(estimate, own, axis=0).max(axis=0)
    for link, at in zip(links, own, strict=True):
        ends = [place(body) for body in link.rod.connects if body != GROUND]
        known = estimate[[end for end in ends if end >= 0]]
        estimate[at] = known.max(axis=0) if known.any() else most


def home_of(robot: Robot) -> Home:
    """Return where bodies and joints are at a robot's home."""
    placed = {name: poses.pose(*at) for name, at in robot.body_poses(robot.home).items()}
    coordinates = dict(zip(robot.coordinates, robot.home.positions.tolist(), strict=True))
    return Home({GROUND: np.eye(4), **placed}, coordinates)


def moved_at(robot: Robot, state: State) -> Moved:
    """Return how a robot's joints and bodies move at one state."""
    placed = {name: poses.pose(*at) for name, at in robot.body_poses(state).items()}
    twists = dict(zip(robot.bodies, robot.twists(state), strict=True))
    twists[GROUND] = np.zeros(6)
    rates = np.asarray(robot.joint_rates(state)).tolist()
    return Moved(
        positions=dict(zip(robot.coordinates, state.positions.tolist(), strict=True)),
        rates=dict(zip(robot.rates, rates, strict=True)),
        poses={GROUND: np.eye(4), **placed},
        twists=twists,
    )


def loaded() -> Any:
    """Return MuJoCo's module.

    Raises:
        LinkworkError: it is not installed.
    """
    return checks.imported("mujoco", MISSING)
