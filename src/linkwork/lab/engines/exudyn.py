"""The mechanism in Exudyn: rigid bodies in space with Euler parameters, every joint a constraint.

    M q'' + Q(q, q') = S' u + Phi' lambda,   phi(q) = 0              (q: seven coordinates per body)

Loops are nothing special here, but dependent rows would make the system singular: of the rows of
the joints that close loops, and of the gears, those kept are the independent ones at the initial
state, chosen by a pivoted QR decomposition. The integrator is the generalised-alpha method of order
2; it satisfies phi = 0 to rounding.

A joint of many freedoms on which something acts is carried out as a chain of joints of one freedom
with massless bodies.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, cast

import numpy as np
from scipy.linalg import qr

from linkwork.lab.engines.exudyn_items import exu, recorded, scene, sensors
from linkwork.lab.engines.interface import (
    EngineError,
    EngineRun,
    Forces,
    checked,
    checked_forces,
    in_time,
    instants,
)
from linkwork.lab.engines.joints import held, held_rows
from linkwork.lab.engines.motion import (
    BodyMotion,
    JointMotion,
    along_tree,
    applied,
    places,
    read_joints,
)
from linkwork.lab.engines.rewrite import in_steps, with_free_joints
from linkwork.lab.engines.start import Guess, bodies_at
from linkwork.lab.engines.tree import coupled, loaded, spanning_tree
from linkwork.mechanism import Mechanism
from linkwork.mechanism.joints import TURN

TOLERANCE = 1e-12  # of Newton's method in every step, absolute and relative
SPECTRAL_RADIUS = 0.9
GLIMPSE = 1e-6  # the one step after which a state's initial accelerations can be read [s]
RANK_TOLERANCE = 1e-9


class ExudynEngine:
    """Evaluate and simulate a mechanism with Exudyn's implicit solver.

    Args:
        mechanism: the description. Gears have two coordinates; there are no rotors on free turns;
            no joint with a screw, a gear or a rotor closes a loop of such joints.
        guess: approximate poses (4, 4) of bodies that only rods reach; the ground's frame where
            left out.

    Attributes:
        carried: the mechanism with free joints for bodies that only rods reach and with chains for
            loaded joints.
        tree: a spanning tree of it, which sets the bodies' initial poses and twists and tells which
            joints close loops.

    Raises:
        EngineError: Exudyn is missing or cannot hold the mechanism.
    """

    name = "exudyn"
    version = str(exu.__version__)

    def __init__(self, mechanism: Mechanism, guess: Guess | None = None):
        self.mechanism, self.guess = mechanism, guess or {}
        hanging, self.hung = with_free_joints(mechanism)
        self.carried = in_steps(hanging, coupled(hanging) | loaded(hanging))
        self.tree = spanning_tree(self.carried)
        self._check()

    def accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of the actuated rates, shape (n,); see `joint_accelerations`."""
        return self._actuated(self.joint_accelerations(positions, rates, forces))

    def joint_accelerations(
        self, positions: np.ndarray, rates: np.ndarray, forces: np.ndarray
    ) -> np.ndarray:
        """Return the derivatives of all joint rates, shape (nv,); see `Engine.joint_accelerations`.

        They are the solver's initial accelerations, for which Exudyn differentiates the constraints
        by differences.
        """
        held = checked_forces(self.mechanism, forces)
        motion, _ = self._solve(positions, rates, held, np.array([0.0, GLIMPSE]))
        return self._read(motion, positions).accelerations[0]

    def simulate(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, duration: float, step: float
    ) -> EngineRun:
        """Return the motion by the generalised-alpha method; see `Engine.simulate`.

        Constant forces stay inside Exudyn; a function of time is called from it.
        """
        time = instants(duration, step)
        in_time(self.mechanism, forces)
        motion, seconds = self._solve(positions, rates, forces, time)
        joints = self._read(motion, positions)
        return EngineRun(
            time=time,
            positions=joints.positions,
            rates=joints.rates,
            joint_accelerations=joints.accelerations,
            accelerations=self._actuated(joints.accelerations),
            body_poses=motion.poses,
            closure_error=joints.closure_error,
            alignment_error=joints.alignment_error,
            seconds=seconds,
        )

    def _actuated(self, accelerations: np.ndarray) -> np.ndarray:
        place = places(self.mechanism.rates)
        return accelerations[..., [place[name] for name in self.mechanism.actuators]]

    def _read(self, motion: BodyMotion, start: np.ndarray) -> JointMotion:
        return read_joints(self.mechanism, motion, np.asarray(start, dtype=float))

    def _solve(
        self, positions: np.ndarray, rates: np.ndarray, forces: Forces, time: np.ndarray
    ) -> tuple[BodyMotion, float]:
        """Build the system at a state, run it through the instants, and return the bodies' motion
        and the wall time."""
        positions, rates = checked(self.mechanism, positions, rates)
        start = bodies_at(self.carried, self.tree, positions, rates, self.hung, self.guess)
        joints = read_joints(
            self.carried, start.at_one_instant(), np.append(positions, np.zeros(7 * len(self.hung)))
        )
        q, w = joints.positions[0], joints.rates[0]
        built = scene(self.carried, self.tree, start, q, w, self.independent_rows(q), forces)
        names = tuple(self.mechanism.bodies)
        numbers = sensors(built, names)
        built.system.Assemble()
        begin = perf_counter()
        if not built.system.SolveDynamic(
            solver_settings(time), solverType=exu.DynamicSolverType.GeneralizedAlpha
        ):
            raise EngineError(
                f"Exudyn's solver stopped in {self.mechanism.name!r}; try steps below "
                f"{time[1]:.6g} s"
            )
        seconds = perf_counter() - begin
        return recorded(built, names, numbers), seconds

    def _check(self) -> None:
        for name, gear in self.carried.gears.items():
            if len(gear.coupled) > 2 or gear.powers:
                raise EngineError(
                    f"joints.{name}: Exudyn couples two coordinates, not more, and by ratios; use "
                    "mujoco"
                )
        needed = coupled(self.carried)
        for cut in self.tree.cuts:
            if cut.joint in needed:
                raise EngineError(
                    f"joints.{cut.joint}: closes a loop of screws and of joints with gears and "
                    "rotors, which Exudyn cannot hold; use mujoco"
                )
        for name, joint in self.carried.pairs.items():
            if TURN in joint.freedoms and joint.effects()[TURN].rotor:
                raise EngineError(
                    f"joints.{name}: Exudyn has no rotor for a free turn; use pinocchio or mujoco"
                )

    def independent_rows(self, positions: np.ndarray) -> dict[str, tuple[int, ...]]:
        """Return for each joint which of what it holds Exudyn has to hold (indices of `held`) at a
        closed configuration.

        The tree's joints keep all their rows. Those of the cut joints and of the gears act on the
        tree's rates by a matrix; pivoted QR finds the independent ones among them.
        """
        kept = dict.fromkeys(self.carried.gears, (0,))
        kept |= {name: tuple(held(joint.type)) for name, joint in self.carried.pairs.items()}
        unit = np.eye(len(self.carried.rates))
        motion = along_tree(
            self.carried, self.tree, np.broadcast_to(positions, (len(unit), len(positions))), unit
        )
        candidates: list[tuple[str, int]] = []
        gradients = [np.zeros((0, len(unit)))]
        for cut in self.tree.cuts:
            pose, twist, _ = motion.across(cut)
            candidates += [(cut.joint, row) for row in kept[cut.joint]]
            gradients.append(applied(held_rows(cut, pose), twist).T)
        moving = read_joints(self.carried, motion, positions).rates.T
        for name, gear in self.carried.gears.items():
            candidates.append((name, 0))
            ratios = np.array([gear.ratios.get(label, 0.0) for label in self.carried.rates])
            gradients.append(ratios[None] @ moving)
        if candidates:
            dropped = dependent(np.concatenate(gradients))
            for name in {candidates[index][0] for index in dropped}:
                gone = {candidates[index][1] for index in dropped if candidates[index][0] == name}
                kept[name] = tuple(row for row in kept[name] if row not in gone)
        return kept


def dependent(rows: np.ndarray) -> np.ndarray:
    """Return the indices of rows that depend on the others, by pivoted QR."""
    triangle, order = cast(tuple[np.ndarray, np.ndarray], qr(rows.T, mode="r", pivoting=True))
    pivots = np.zeros(len(order))
    pivots[: min(triangle.shape)] = abs(np.diag(triangle))
    return order[pivots <= RANK_TOLERANCE * max(1.0, pivots[0])]


def solver_settings(time: np.ndarray) -> Any:
    """Return Exudyn's settings for equal steps, every one recorded."""
    settings = exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.numberOfSteps, integration.endTime = len(time) - 1, time[-1]
    integration.adaptiveStep, integration.verboseMode = False, 0
    integration.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    integration.newton.relativeTolerance = integration.newton.absoluteTolerance = TOLERANCE
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = time[1] / 2
    return settings
