"""Posing by hand: lead a robot from one closed configuration towards a goal, without opening a loop
or changing branch.

The way is walked in short pieces. In each, Gauss-Newton steps s of the tree's rates solve

    minimise |e + J s|^2 + mu^2 |s|^2   subject to   phi + Phi s = 0,

and limits that would be passed are kept as further rows  q_i = bound.  A goal out of reach is thus
approached as nearly as the loops and the limits allow (a tool slides along the edge of the
workspace), and what stands in the way is said.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.equations.reference import unit
from linkwork.mechanism.task import is_length
from linkwork.model.asked import ToolAsked
from linkwork.model.assembly import Assembler
from linkwork.model.closing import settled_alone
from linkwork.model.labels import POSES
from linkwork.model.task import freedoms, stated, task_if_any
from linkwork.robot import Robot, State
from linkwork.viewer.bounds import Bound, bounds_of
from linkwork.viewer.crossings import Crossings
from linkwork.viewer.hand_goals import HandGoal, JointGoal, Outputs, ToolGoal

CLOSED = 1e-13  # of the rows in the mechanism's own units, relative to the robot's size
CLOSING = 12  # steps that close the loops
RANK = 1e-9  # singular value of rows, relative to the largest, that counts as none
ARRIVED = 1e-9  # distance from a goal that counts as none, relative to the mechanism
# Of the way walked at a time, relative to the mechanism; walked in one step, at most.
PIECE, PIECES = 0.05, 2
FINEST = 1e-5  # piece of the way to a strict goal, relative to the mechanism
STUCK = 0.02  # part of a piece by which the goal's rows have to move
TURN_LENGTH = 0.25  # what a turn of 1 rad counts as, relative to the mechanism
LARGEST = 0.3  # part of a step, relative to the mechanism
ITERATIONS = 8
FIRST_DAMPING, LEAST_DAMPING, LAST_DAMPING = 1e-4, 1e-7, 10.0
SLOW = 1e-3  # gain of an iteration, relative to what is left, that ends them
MOVING = 0.2  # rate, relative to the largest, of a joint that counts as moving
ASIDE = (
    0.02  # displacement, relative to the mechanism, that leads away from an accidental singularity
)
FEW = 3  # names that are listed


@dataclass(frozen=True)
class HandReached:
    """Tell where a pursuit stands: the state, whether the goal is reached, and if it cannot be, why
    (else empty); passed: the singular pose that was passed on the way (else empty)."""

    state: State
    arrived: bool
    obstacle: str = ""
    passed: str = ""


@dataclass(frozen=True, eq=False)
class Held:
    """Hold the limits that are kept as rows, and the values [m, rad] at which they are."""

    bounds: tuple[Bound, ...] = ()
    values: tuple[float, ...] = ()

    def with_more(self, passed: Iterable[tuple[Bound, float]]) -> Held:
        bounds, values = zip(*passed, strict=True)
        return Held((*self.bounds, *bounds), (*self.values, *values))


@dataclass(frozen=True, eq=False)
class Pursuit:
    """Lead one robot towards goals; size: largest extent of the mechanism [m]."""

    robot: Robot
    size: float

    # Goals

    def tool_goal(self, position: np.ndarray, orientation: np.ndarray) -> ToolGoal:
        """Want the tool at a position (3) [m] in an orientation (3, 3), as far as its freedoms go,
        in its task where that is neither the pose nor a whole part of it."""
        given = self.length, self.turns, self.robot.planar, self.task
        return ToolGoal(position, orientation, *given)

    @cached_property
    def task(self) -> ToolAsked | None:
        """Return the task of a spatial tool of mixed freedoms, or the one that a planar tool
        states, if it has rates at home."""
        robot, names = self.robot, POSES[self.robot.planar]
        told = robot.mechanism.tools and (stated(robot) or not robot.planar)
        found = task_if_any(robot) if told else None
        parts = (names, names[:2]) if robot.planar else (names, names[:3], names[3:])
        if found is None or found in parts:
            return None
        asked = ToolAsked(found, robot.equations.tree.length, robot.planar)
        out = {name: part[None] for name, part in self.assembler.still(robot.home.q).items()}
        regular = len(found) == freedoms(robot) and np.isfinite(asked.jacobian(out)).all()
        return asked if regular and asked.rotation is None else None

    def joint_goal(self, targets: dict[str, float]) -> JointGoal:
        """Want joint coordinates, by name [m, rad]."""
        robot, names = self.robot, list(targets)
        coordinates = np.array([robot.coordinates.index(name) for name in names])
        rates = np.array([robot.rates.index(name) for name in names])
        values = np.array([targets[name] for name in names])
        return JointGoal(coordinates, rates, values, robot.labels.angular[coordinates], self.length)

    @property
    def length(self) -> float:
        return TURN_LENGTH * self.size

    @cached_property
    def turns(self) -> bool:
        """Tell whether the tool can be turned in a way that does not follow from its position, or
        is led in a turn.

        The first is asked a little beside the reference configuration, which may be a singular one.
        """
        if self.task and not all(map(is_length, self.task.held)):
            return True
        out = self.assembler.still(self.robot.home.q)
        H_inverse, N = inverse(self.jacobian(out, Held()))
        aside = ASIDE * self.size * N @ np.linspace(1, 2, N.shape[1])
        _, out = self.closed(self.moved(self.robot.home.q, out, aside), Held(), H_inverse)
        _, N = inverse(self.jacobian(out, Held()))
        J = out["J_tool"] * self.scale * np.array([self.length] * 3 + [1.0] * 3)[:, None]
        whole, linear = (np.linalg.matrix_rank(rows @ N, tol=1e-6) for rows in (J, J[3:]))
        return bool(whole > linear)

    @property
    def assembler(self) -> Assembler:
        return self.robot.assembler

    @cached_property
    def bounds(self) -> tuple[Bound, ...]:
        return bounds_of(self.robot)

    @cached_property
    def crossings(self) -> Crossings:
        return Crossings(self.robot, self.scale, self.assembler.units, self.between)

    def between(self, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, Outputs]:
        """Return the pose between two neighbouring ones, its loops closed, and its outputs."""
        q = unit(self.robot.equations.tree, (first + last) / 2)
        H_inverse, _ = inverse(self.jacobian(self.assembler.still(q), Held()))
        return self.closed(q, Held(), H_inverse)

    @cached_property
    def scale(self) -> np.ndarray:
        """Return what turns rates of the tree, as lengths, into rates: 1 of a slide, 1 / l of a
        turn (nv)."""
        return np.where(self.robot.equations.tree.slides, 1.0, 1 / self.length)

    # Pursuit

    def step(self, state: State, goal: HandGoal, pieces: int = PIECES) -> HandReached:
        """Walk some pieces of the way to a goal.

        Args:
            state: where to start; its rates are not kept.
            goal: what is wanted.
            pieces: most pieces to walk.

        Returns:
            The state reached, closed; whether that is the goal; where there is no way on, what
            stands in it.
        """
        q, out, crossed = state.q, self.assembler.still(state.q), ""
        for _ in range(pieces):
            left = off(out, goal)
            if left <= ARRIVED * self.size:
                break
            walk = min(left, PIECE * self.size)
            q_next, out_next, held = self.piece(q, out, goal, walk / left)
            moved = np.linalg.norm(goal.rows(out_next)[0] - goal.rows(out)[0])
            nearer = off(out_next, goal) < left
            if nearer:
                crossed = self.crossings.passed((q, out), (q_next, out_next), goal) or crossed
                q, out = q_next, out_next
            if not nearer or moved < STUCK * walk:
                return HandReached(self.at(q), False, self.obstacle(out, goal, held), crossed)
        return HandReached(self.at(q), off(out, goal) <= ARRIVED * self.size, passed=crossed)

    def lead(self, state: State, goal: HandGoal, steps: int = 200) -> HandReached:
        """Walk the whole way to a goal, as far as there is one."""
        reached = HandReached(state, False)
        for _ in range(steps):
            reached = self.step(reached.state, goal)
            if reached.arrived or reached.obstacle:
                break
        return reached

    def at(self, q: np.ndarray) -> State:
        return self.robot.make_state(q, np.zeros(self.robot.mobility))

    def piece(
        self, q: np.ndarray, out: Outputs, goal: HandGoal, part: float
    ) -> tuple[np.ndarray, Outputs, Held]:
        """Walk one piece; return q, the outputs there, and the limits that were kept."""
        aim, held = goal.towards(out, part), Held()
        for _ in range(1 + len(self.bounds)):
            q_next, out_next = self.nearest(q, out, aim, held)
            passed = self.passed(out, out_next, held)
            if not passed:
                break
            held = held.with_more(passed)
        else:
            return q, out, held
        if goal.strict and off(out_next, aim) > ARRIVED * self.size:
            return (
                (q, out, held)
                if part * off(out, goal) < FINEST * self.size
                else self.piece(q, out, goal, part / 4)
            )
        return q_next, out_next, held

    def passed(self, start: Outputs, out: Outputs, held: Held) -> list[tuple[Bound, float]]:
        """Return the limits that are passed, with the values to keep: the limits, or where these
        were passed before."""
        found = []
        for bound in self.bounds:
            kept = bound.side * max(bound.side * bound.bound, bound.side * bound.value(start))
            beyond = bound.side * (bound.value(out) - kept) / self.height(bound)
            if bound not in held.bounds and beyond > CLOSED * self.robot.size:
                found.append((bound, kept))
        return found

    def nearest(
        self, q: np.ndarray, out: Outputs, aim: HandGoal, held: Held
    ) -> tuple[np.ndarray, Outputs]:
        """Return q nearest to an aim with the loops closed and limits kept, and the outputs
        there."""
        e, J = aim.rows(out)
        damping, fresh, H_inverse, N = FIRST_DAMPING, True, np.empty(0), np.empty(0)
        for _ in range(ITERATIONS):
            H_inverse, N = inverse(self.jacobian(out, held)) if fresh else (H_inverse, N)
            closing = -H_inverse @ self.gaps(out, held)
            s = self.gauss_newton(closing, N, e, J * self.scale, damping)
            q_trial, out_trial = self.closed(self.moved(q, out, s), held, H_inverse)
            e_trial, J_trial = aim.rows(out_trial)
            gained = np.linalg.norm(e) - np.linalg.norm(e_trial)
            if gained <= 0 or not self.is_closed(out_trial, held):
                damping, fresh = damping * 30, False
                if damping > LAST_DAMPING:
                    break
                continue
            q, out, e, J, fresh = q_trial, out_trial, e_trial, J_trial, True
            damping = max(damping / 30, LEAST_DAMPING)
            if np.linalg.norm(e) <= 0.1 * ARRIVED * self.size or gained < SLOW * np.linalg.norm(e):
                break
        return q, out

    def gauss_newton(
        self, closing: np.ndarray, N: np.ndarray, e: np.ndarray, J: np.ndarray, damping: float
    ) -> np.ndarray:
        """Return the step s (nv) as lengths: the one that closes, and of those that keep closed (N)
        the best; none of them where none moves what is led."""
        JN = J @ N
        mu = damping * float(np.linalg.norm(JN))
        left = JN.T @ JN + mu**2 * np.eye(JN.shape[1])
        s = closing - N @ np.linalg.solve(left, JN.T @ (e + J @ closing)) if mu > 0 else closing
        return s * min(1.0, LARGEST * self.size / max(np.abs(s).max(initial=0.0), 1e-300))

    def closed(
        self, q: np.ndarray, held: Held, H_inverse: np.ndarray
    ) -> tuple[np.ndarray, Outputs]:
        """Close the loops from nearby, by Newton steps of least length with the rows of nearby;
        return q and the outputs."""

        def read(q: np.ndarray) -> tuple[float, tuple[np.ndarray, Outputs]]:
            out = self.assembler.still(q)
            h = self.gaps(out, held)
            return float(np.abs(h).max(initial=0.0)), (h, out)

        def move(q: np.ndarray, told: tuple[np.ndarray, Outputs]) -> np.ndarray:
            h, out = told
            return self.moved(q, out, -H_inverse @ h)

        q, _, (_, out) = settled_alone(read, move, q, CLOSED * self.robot.size, CLOSING)
        return q, out

    def close(self, q: np.ndarray) -> np.ndarray | None:
        """Return the configuration nearest to one that is slightly open; None where there is none
        nearby."""
        H_inverse, _ = inverse(self.jacobian(self.assembler.still(q), Held()))
        q, out = self.closed(unit(self.robot.equations.tree, q), Held(), H_inverse)
        return q if self.is_closed(out, Held()) else None

    def is_closed(self, out: Outputs, held: Held) -> bool:
        largest = np.abs(self.gaps(out, held)).max(initial=0.0)
        return bool(largest <= 1e2 * CLOSED * self.robot.size)

    def gaps(self, out: Outputs, held: Held) -> np.ndarray:
        """Return phi and  x - value  of the limits that are kept, in the mechanism's own units."""
        phi = out["phi"] / self.assembler.units
        if not held.bounds:
            return phi
        kept = zip(held.bounds, held.values, strict=True)
        return np.append(phi, [(b.value(out) - value) / self.height(b) for b, value in kept])

    def jacobian(self, out: Outputs, held: Held) -> np.ndarray:
        """Return the Jacobian of `gaps` for steps as lengths."""
        Phi = out["Phi"] / self.assembler.units[:, None]
        return np.vstack([Phi, *(b.row(out) / self.height(b) for b in held.bounds)]) * self.scale

    def height(self, bound: Bound) -> float:
        """Return the mechanism's own unit of a limit: its own length, or 1 rad."""
        return self.robot.equations.tree.length if bound.unit == "m" else 1.0

    def moved(self, q: np.ndarray, out: Outputs, s: np.ndarray) -> np.ndarray:
        return unit(self.robot.equations.tree, q + out["derivatives"] @ (self.scale * s))

    # Obstacles

    def obstacle(self, out: Outputs, goal: HandGoal, held: Held) -> str:
        """Say what keeps the robot from a goal: limits, joints that are stretched or folded, or too
        few freedoms.

        Where the goal has as many rows as there are freedoms, no way on means that J N is singular;
        its null space are motions of the joints alone.
        """
        if held.bounds:
            return "; ".join(map(str, held.bounds))
        if goal.strict:
            return (
                "the loops cannot be closed any further this way while the other actuators hold "
                "still"
            )
        _, J = goal.rows(out)
        _, N = inverse(self.jacobian(out, Held()))
        if N.size and not ((J * self.scale) @ N).any():
            return "the tool stands still: no motion of the mechanism moves it"
        if N.shape[1] < len(J):
            return (
                f"the tool comes no nearer: the mechanism has {N.shape[1]} of the {len(J)} "
                "freedoms that lead there"
            )
        _, _, Vt = np.linalg.svd((J * self.scale) @ N)
        own = [
            self.robot.equations.tree.length if self.robot.unit(rate) == "m" else 1.0
            for rate in self.robot.rates
        ]
        alone = np.abs(out["J_coordinates"] @ (self.scale * (N @ Vt[len(J) - 1]))) / own
        names = [
            label
            for label, rate in zip(self.robot.rates, alone, strict=True)
            if rate > MOVING * alone.max()
        ]
        return f"the edge of the workspace: stretched out or folded at {listed(names)}"


def off(out: Outputs, goal: HandGoal) -> float:
    """Return the distance from a goal [m]."""
    return float(np.linalg.norm(goal.rows(out)[0]))


def inverse(H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pseudoinverse of rows H, and an orthonormal basis of  H s = 0."""
    U, values, Vt = np.linalg.svd(H)
    rank = int((values > RANK * values.max(initial=0.0)).sum())
    return (Vt[:rank].T / values[:rank]) @ U[:, :rank].T, Vt[rank:].T


def listed(names: Sequence[str]) -> str:
    shown = [*names[:FEW], f"{len(names) - FEW} more"] if len(names) > FEW + 1 else list(names)
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)
