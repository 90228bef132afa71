"""A simulation that goes on as one watches, and a hand that pulls at a body by a spring.

The hand h holds the body's point p by  F = k (h - p) - d v,  v the point's velocity. With m the
inertia that the point has in the starting pose (3 over the trace of J M^-1 J', J its Jacobian),
k = m (2 pi f)^2 and d = 2 D m 2 pi f. The hand stands still for the length of a picture, so that
the whole can be run once more as one run, which tells of the force as of any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from linkwork import math
from linkwork.control import Wrench
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.simulation import Run, Sampled
from linkwork.viewer.simulating import MOST_SAMPLES, SAMPLES_PER_SECOND

FREQUENCY, DAMPING = 1.5, 0.4  # f [Hz] and D of a body that hangs on the hand alone
HAND = ("hand.holds", "hand.x", "hand.y", "hand.z")  # parameters of a picture's run
FIRST = 1e-3  # length of the runs that compile what follows [s]
PARTED = 1e-3  # distance between what was seen and what is kept that is told, relative to the robot


@dataclass(frozen=True, eq=False)
class HandPull:
    """Hold a point (3) of a body, in its axes [m], by a spring k [N/m] and a damper d [N s/m]."""

    body: str
    point: np.ndarray
    stiffness: float
    damping: float

    @classmethod
    def at(cls, robot: Robot, state: State, body: str) -> HandPull:
        """Hold at a body: at its tool, if it bears one, else at its mass centre."""
        tool = next((t for t in robot.mechanism.tools.values() if t.body == body), None)
        centre = np.array(robot.mechanism.bodies[body].centre_of_mass, float)
        point = centre if tool is None else np.array(tool.frame.position, float)
        T = robot.twist_map(state).reshape(len(robot.bodies), 6, -1)[robot.bodies.index(body)]
        r = robot.body_poses(state)[body][1] @ (point - centre)
        J = T[3:] + np.cross(T[:3], r, axisa=0, axisc=0)
        M = robot.mass_matrix(state)
        mobility = float(np.trace(J @ np.linalg.lstsq(M, J.T, rcond=None)[0]))
        whole = sum(each.mass for each in robot.mechanism.bodies.values())
        m = min(3 / mobility, whole or 1.0) if mobility > 0 else whole or 1.0
        omega = 2 * np.pi * FREQUENCY
        return cls(body, point, m * omega**2, 2 * DAMPING * m * omega)

    def force(self, seen: Any, holds: Any, hand: Any) -> np.ndarray:
        """Return F (3) [N] at what is seen: numbers or symbols; holds: 1, or 0 where no hand
        does."""
        frame = seen.body(self.body)
        arm = frame.rotation @ self.point
        velocity = frame.velocity + math.cross(frame.angular_velocity, arm)
        way = hand - frame.position - arm
        return holds * (self.stiffness * way - self.damping * velocity)

    def place(self, robot: Robot, state: State) -> np.ndarray:
        """Return where the point is (3) [m]."""
        origin, R = robot.body_poses(state)[self.body]
        return origin + R @ self.point


@dataclass(eq=False)
class Live:
    """Hold a simulation that goes on, and where the hand was in each picture.

    start, drive: where it began, and what drives the actuators; pull: by which a hand holds
    run: the last picture's; starts, hands: of all pictures, the hand as (holds, x, y, z)
    """

    robot: Robot
    start: State
    drive: Any
    pull: HandPull
    run: Run | None = None
    starts: list[float] = field(default_factory=list)
    hands: list[np.ndarray] = field(default_factory=list)

    @property
    def time(self) -> float:
        """Return how far it is [s]."""
        return 0.0 if self.run is None else float(self.run.attrs["final_time"])

    @property
    def state(self) -> State:
        return self.start if self.run is None else self.run.final

    @property
    def forces(self) -> np.ndarray:
        """Return the actuators' forces at the end of the last picture [N, N m]."""
        if self.run is None or not len(self.run.time):
            return np.zeros(len(self.robot.actuators))
        return np.asarray(self.run.variables["actuator_force"].values[-1], float)

    def force(self, hand: np.ndarray | None) -> np.ndarray:
        """Return the hand's force (3) [N] at the end of the last picture."""
        if hand is None or self.run is None or not len(self.run.time):
            return np.zeros(3)
        return np.asarray(self.run.variables["external_wrench"].values[-1, 0, 3:], float)

    def prepare(self) -> None:
        """Compile what starts and what goes on."""
        self._of_picture(FIRST, np.zeros(4), self._of_picture(FIRST, np.zeros(4), None))

    def advance(self, seconds: float, hand: np.ndarray | None) -> None:
        """Go on for some seconds, a hand at a place (3) [m], or none.

        Raises:
            LinkworkError: the motion ends here, for a reason that is told.
        """
        held = np.zeros(4) if hand is None else np.array([1.0, *hand])
        begun, run = self.time, self._of_picture(seconds, held, self.run)
        if not run.success:
            raise LinkworkError(run.message)
        self.run = run
        self.starts.append(begun)
        self.hands.append(held)

    def _of_picture(self, seconds: float, held: np.ndarray, last: Run | None) -> Run:
        def force(t: Any, seen: Any) -> Any:
            holds, *hand = (seen.parameter(name, 0.0) for name in HAND)
            return self.pull.force(seen, holds, math.array(hand))

        options: dict[str, Any] = {
            "duration": seconds,
            "wrenches": self._wrenches(force),
            "parameters": dict(zip(HAND, held.tolist(), strict=True)),
            "on_singular": "step_over",
        }
        if last is None:
            return self.robot.simulate(self.start, self.drive, **options)
        return self.robot.resume(last, self.drive, **options)

    def kept(self) -> tuple[Run, str]:
        """Return all of it as one run, and a sentence where that does not end where what was seen
        did.

        Raises:
            LinkworkError: nothing has moved yet.
        """
        if not self.starts:
            raise LinkworkError("the simulation ended before it began; there is nothing to play")
        times = np.array([*self.starts, self.time])
        hand = Sampled(times, np.array([*self.hands, self.hands[-1]]), "hold")

        def force(t: Any, seen: Any) -> Any:
            holds, *place = hand(t)
            return self.pull.force(seen, holds, math.array(place))

        samples = int(np.clip(self.time * SAMPLES_PER_SECOND + 1, 2, MOST_SAMPLES))
        run = self.robot.simulate(
            self.start,
            self.drive,
            duration=self.time,
            wrenches=self._wrenches(force),
            samples=samples,
            on_singular="step_over",
        )
        places = (self.pull.place(self.robot, state) for state in (run.final, self.state))
        gap = float(np.linalg.norm(np.subtract(*places)))
        length = self.robot.equations.tree.length
        parted = (
            f"the motion is sensitive: the run that is kept ends {gap:.2g} m from what was seen"
        )
        return run, parted if gap > PARTED * length else ""

    def _wrenches(self, force: Callable[[Any, Any], Any]) -> list[Wrench]:
        return [Wrench(self.pull.body, force=force, point=self.pull.point.tolist())]
