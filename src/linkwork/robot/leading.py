"""Leading: bring the tool from a closed configuration to poses, many at a time, without leaving the
branch.

Each pose has a straight way from where the tool is. It is walked in steps as long as Newton's
method

    [Phi; J] s = -[phi; x - x_d],    q <- q + N s

contracts from the last configuration at once and the signs of the working mode stay (`modes`).
Poses whose straight way is barred, by the edge of the workspace, are solved from the guess and from
random configurations (fixed seed); of the solutions on the same mode the nearest is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.checks import at
from linkwork.equations.algebra import wrapped
from linkwork.equations.reference import CLOSED, unit
from linkwork.equations.tree import Tree
from linkwork.kernels import Kernel
from linkwork.mechanism import Mechanism
from linkwork.robot.approach import Approach
from linkwork.robot.assembly import (
    CONTRACTS,
    LONGEST,
    MATRICES,
    MET,
    NEWTON,
    Assembler,
    UnreachableError,
)
from linkwork.robot.modes import ModeStages, same

ROUNDS, FINEST = 200, 1 / 64  # steps of a way at most, and the part of it that the shortest one is
STARTS, ITERATIONS = 48, 40  # random configurations, and Newton's steps from each
DAMPING = 1e-12  # of the normal equations, relative to their trace


@dataclass(frozen=True, eq=False)
class Way:
    """Hold the straight ways (N) of a tool from one pose to others.

    position, turn: where they begin: (3), angle (1) in the plane or R (3, 3), empty where no turn
        is asked for
    shift, turning: what leads to their ends (N, axes), (N, 1) in the plane, rotation vectors (N, 3)
        in space
    """

    planar: bool
    position: np.ndarray
    turn: np.ndarray
    shift: np.ndarray
    turning: np.ndarray

    @classmethod
    def of(cls, planar: bool, out: dict[str, np.ndarray], poses: np.ndarray) -> Way:
        """Return the ways from one configuration's outputs (1, ...) to poses (N, size)."""
        axes = 2 if planar else 3
        position, goal = out["position"][0, :axes], poses[:, axes:]
        shift = poses[:, :axes] - position
        if not goal.shape[1]:
            return cls(planar, position, np.empty(0), shift, goal)
        if planar:
            return cls(planar, position, out["angle"][0], shift, wrapped(goal - out["angle"][0]))
        from scipy.spatial.transform import Rotation

        R = out["orientation"][0].reshape(3, 3)
        turning = (Rotation.from_rotvec(goal) * Rotation.from_matrix(R).inv()).as_rotvec()
        return cls(planar, position, R, shift, turning)

    def error(self, out: dict[str, np.ndarray], which: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Return how far the tools are (K, size) from where the ways `which` (K) are at a part (K)
        from 0 to 1."""
        goal = self.poses(which, part)
        axes = self.shift.shape[1]
        aside = out["position"][:, :axes] - goal[:, :axes]
        if not self.turning.shape[1]:
            return aside
        if self.planar:
            return np.concatenate([aside, wrapped(out["angle"] - goal[:, axes:])], axis=1)
        from scipy.spatial.transform import Rotation

        turn = (
            Rotation.from_matrix(out["orientation"].reshape(-1, 3, 3))
            * Rotation.from_rotvec(goal[:, axes:]).inv()
        )
        return np.concatenate([aside, turn.as_rotvec()], axis=1)

    def poses(self, which: np.ndarray, part: np.ndarray) -> np.ndarray:
        """Return the poses (K, size) at parts (K) from 0 to 1 of the ways `which` (K)."""
        aside, turned = (
            self.position + part[:, None] * self.shift[which],
            part[:, None] * self.turning[which],
        )
        if self.planar or not self.turning.shape[1]:
            return (
                np.concatenate([aside, self.turn + turned], axis=1)
                if self.turning.shape[1]
                else aside
            )
        from scipy.spatial.transform import Rotation

        goal = Rotation.from_rotvec(turned) * Rotation.from_matrix(self.turn)
        return np.concatenate([aside, goal.as_rotvec()], axis=1)


Nearby = Callable[
    [np.ndarray, Way, np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]
]


@dataclass(frozen=True, eq=False)
class Leader:
    """Lead the tool of one robot.

    kernel: of `functions.assembly`, with the robot's own numbers; assembler: solves for single
        poses
    home: coordinates of all joints at home (m); modes: what has to keep its signs
    twist: rows of the tool's twist that poses name; approach: compiled steps, where closure and
        pose determine the motion
    """

    kernel: Kernel
    assembler: Assembler
    mechanism: Mechanism
    home: np.ndarray
    modes: ModeStages
    twist: list[int]
    approach: Approach | None = None

    def lead(self, start: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return q (N, nq) with the tool at poses (N, size), from a closed configuration (nq).

        Raises:
            UnreachableError: a pose that is not reached, by its number where there are several.
        """
        q, there = self.approached(np.repeat(start[None], len(poses), axis=0), poses)
        if there.all():
            return q
        left = np.flatnonzero(~there)
        out, aims = self.outputs(start[None]), poses[left]
        way, mode = Way.of(self.assembler.planar, out, aims), self.modes.signs(self.matrix(out))[0]
        every, part = np.arange(left.size), np.zeros(left.size)
        for nearby in (self.compiled, self.squared):
            short = every[part < 1]
            q[left[short]], part[short] = self.walked(start, way, short, mode, nearby)
        for k in every[part < 1]:
            with at(f"pose {left[k]}: ") if len(poses) > 1 else nullcontext():
                q[left[k]] = self.otherwise(start, q[left[k]], aims[k], mode)
        return q

    def approached(
        self, q: np.ndarray, poses: np.ndarray, mode: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q (K, nq) at the poses (K, size) to which compiled steps contract from q (K, nq),
        and which these are (K).

        mode: signs to be kept; those of the first q if left out
        """
        alive = np.ones(len(poses), bool)
        if self.approach is None:
            return q, ~alive
        last, seen = LONGEST / CONTRACTS, list[np.ndarray]()
        for left in reversed(range(NEWTON + 1)):
            after, residual, length, alignment, parts = self.approach.step(q, poses)
            seen.append(parts)
            closed = residual <= CLOSED
            alive &= length <= np.where(closed, MET, CONTRACTS * last)
            going = alive & ~closed
            last_step = not (left and going.any())
            q = np.where((closed if last_step else going)[:, None], after, q)
            if last_step:
                break
            last = length
        mode = self.modes.told(seen[0][:1]) if mode is None else mode
        fits = same(self.modes.told(seen[-1]), mode) & (alignment >= 0)
        return q, alive & closed & fits & np.isfinite(q).all(axis=1)

    def walked(
        self, start: np.ndarray, way: Way, which: np.ndarray, mode: np.ndarray, nearby: Nearby
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return how far the straight ways `which` (K) lead by some steps: q (K, nq), and the part
        of each way (K)."""
        count = which.size
        q, part, step, going = (
            np.tile(start, (count, 1)),
            np.zeros(count),
            np.ones(count),
            np.arange(count),
        )
        for _ in range(ROUNDS):
            if not going.size:
                break
            aim = np.minimum(1.0, part[going] + step[going])
            reached, good = nearby(q[going], way, which[going], aim, mode)
            q[going[good]], part[going[good]] = reached[good], aim[good]
            step[going] *= np.where(good, 2.0, 0.25)
            going = going[(part[going] < 1) & (step[going] > FINEST)]
        return q, part

    def compiled(
        self, q: np.ndarray, way: Way, which: np.ndarray, part: np.ndarray, mode: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q (K, nq) at parts of ways, and where Newton's method contracted to there without
        a change of sign (K)."""
        return self.approached(q, way.poses(which, part), mode)

    def squared(
        self, q: np.ndarray, way: Way, which: np.ndarray, part: np.ndarray, mode: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the same as `compiled` by steps of least squares.

        What is closed to `CLOSED` takes one step more in the end: then it is closed to rounding.
        """
        alive, last = np.ones(len(q), bool), np.full(len(q), LONGEST / CONTRACTS)
        for left in reversed(range(NEWTON + 1)):
            residual, A, out = self.rows(q, way, which, part)
            closed = np.abs(residual).max(axis=1) <= CLOSED
            s = least_step(A, np.where(alive[:, None], residual, 0.0))
            length = np.abs(s).max(axis=1)
            alive &= closed | (length <= CONTRACTS * last)
            going = alive & ~closed
            last_step = not (left and going.any())
            q = self.moved(q, out, np.where((closed if last_step else going)[:, None], s, 0.0))
            if last_step:
                break
            last = length
        fits = same(self.modes.signs(self.matrix(out)), mode) & (out["alignment"][:, 0] >= 0)
        return q, alive & closed & fits

    def moved(self, q: np.ndarray, out: dict[str, np.ndarray], s: np.ndarray) -> np.ndarray:
        """Return q (K, nq) after steps s (K, nv) in the mechanism's own units."""
        return unit(
            self.tree, q + (out["derivatives"] @ (self.tree.rate_units * s)[:, :, None])[:, :, 0]
        )

    def otherwise(
        self, start: np.ndarray, near: np.ndarray, pose: np.ndarray, mode: np.ndarray
    ) -> np.ndarray:
        """Return q (nq) at a pose to which no straight way leads on the mode; near: how far it
        led."""
        refusal, elsewhere = None, False
        for begin in self.begins(start, near, pose):
            try:
                q = self.assembler.at_pose(pose, begin)
            except UnreachableError as error:
                refusal = refusal or error
                continue
            if self.fits(q, mode):
                return q
            elsewhere = True
        if refusal and not elsewhere:
            raise refusal
        raise UnreachableError(
            f"the tool is at {np.round(pose, 6).tolist()} only on another branch than the guess: "
            "joints would have to pass "
            'a stretched or folded pose; give a guess on that branch, or take any by branch="any"'
        )

    def begins(self, start: np.ndarray, near: np.ndarray, pose: np.ndarray) -> Iterator[np.ndarray]:
        """Yield configurations (nq) from which a pose may be reached."""
        yield near
        yield start
        yield from self.scattered(start, pose)

    def scattered(self, start: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Return configurations (K, nq) with the tool at a pose, from random ones, nearest to a
        start first."""
        tree, random = self.tree, np.random.default_rng(1990)
        q = np.tile(start, (STARTS, 1))
        for place, rate in tree.single:
            q[:, place] += random.uniform(-1, 1, STARTS) * (
                self.length if self.slides[rate] else np.pi
            )
        for places, _ in tree.quaternions:
            q[:, list(places)] = random.standard_normal((STARTS, 4))
        q, every, end = unit(tree, q), np.arange(STARTS), np.ones(STARTS)
        way = Way.of(self.assembler.planar, self.outputs(start[None]), np.tile(pose, (STARTS, 1)))
        for _ in range(ITERATIONS):
            residual, A, out = self.rows(q, way, every, end)
            s = np.nan_to_num(least_step(A, residual))
            s *= np.minimum(1.0, LONGEST / np.maximum(np.abs(s).max(axis=1, keepdims=True), 1e-300))
            q = unit(tree, q + np.einsum("kij,kj->ki", out["derivatives"], tree.rate_units * s))
        residual, A, out = self.rows(q, way, every, end)
        q = q[(np.abs(residual).max(axis=1) <= MET) & (out["alignment"][:, 0] >= 0)]
        for place, rate in tree.single if not self.mechanism.gears else ():
            q[:, place] -= (
                0
                if self.slides[rate]
                else 2 * np.pi * np.round((q[:, place] - start[place]) / (2 * np.pi))
            )
        return q[np.argsort(np.linalg.norm((q - start) / tree.units, axis=1))]

    def keeps(self, q: np.ndarray) -> np.ndarray:
        """Tell which configurations (N, nq) of a motion are on the mode of the first one (N)."""
        signs = self.signs(q)
        return same(signs, signs[0])

    def fits(self, q: np.ndarray, mode: np.ndarray) -> bool:
        """Tell whether a configuration (nq) is on a mode."""
        return bool(same(self.signs(q[None]), mode)[0])

    def signs(self, q: np.ndarray, p: np.ndarray | None = None) -> np.ndarray:
        """Return the signs that tell modes apart (K, stages) at configurations (K, nq); p: as in
        `outputs`."""
        return self.modes.signs(self.matrix(self.outputs(q, p)))

    def outputs(self, q: np.ndarray, p: np.ndarray | None = None) -> dict[str, np.ndarray]:
        """Return the outputs of `functions.assembly` at rest for configurations (K, nq), by name;
        matrices as such.

        p: free parameters (K, np); the robot's own if left out
        """
        kernel, still = self.kernel, self.still
        if len(q) == 1 and p is None:  # one state takes the shortest way
            values = [value[None] for value in kernel(q[0], still)]
        else:
            values = kernel(q, still, *(() if p is None else (p,)))
        out = {name: value for (name, _), value in zip(kernel.outputs, values, strict=True)}
        for name in MATRICES:
            out[name] = out[name].reshape(len(q), still.size, -1).swapaxes(1, 2)
        return out

    @cached_property
    def still(self) -> np.ndarray:
        """Rates w (nv) at rest."""
        return np.zeros(len(self.tree.rates))

    def rows(
        self, q: np.ndarray, way: Way, which: np.ndarray, part: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Return [phi; x - x_d] (K, rows), its Jacobian (K, rows, nv) and the outputs at
        configurations (K, nq).

        Residual and Jacobian are in the mechanism's own units.
        """
        out = self.outputs(q)
        residual = np.concatenate([out["phi"], way.error(out, which, part)], axis=1)
        return residual / self.heights, self.matrix(out) * self.factors, out

    def matrix(self, out: dict[str, np.ndarray]) -> np.ndarray:
        """Return [Phi; J] (K, rows, nv)."""
        return np.concatenate([out["Phi"], out["J_tool"][:, self.twist]], axis=1)

    @property
    def tree(self) -> Tree:
        return self.assembler.tree

    @cached_property
    def heights(self) -> np.ndarray:
        """The mechanism's own units of the closure rows and of the tool's coordinates (rows)."""
        return np.concatenate(
            [self.assembler.units, np.where(np.array(self.twist) < 3, 1.0, self.tree.length)]
        )

    @cached_property
    def factors(self) -> np.ndarray:
        """What brings [Phi; J] to the mechanism's own units (rows x nv)."""
        return self.tree.rate_units / self.heights[:, None]

    @cached_property
    def length(self) -> float:
        """How far slides may be from the guess [m]: the largest distance that joints' frames and
        slides have at home."""
        frames = [
            frame.position for joint in self.mechanism.pairs.values() for frame in joint.frames
        ]
        lengths = [float(np.linalg.norm(position)) for position in frames]
        return max(
            [self.tree.length, *lengths, *np.abs(self.home[~self.assembler.angular]).tolist()]
        )

    @cached_property
    def slides(self) -> np.ndarray:
        """Which of the tree's rates are slides (nv)."""
        found = np.zeros(len(self.tree.rates), bool)
        for node in self.tree.nodes:
            for column in node.columns:
                found[column.rate] = not node.turns
        return found


def least_step(A: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the shortest steps s (K, nv) of least |A s + residual|."""
    turned = A.swapaxes(1, 2)
    square, right = turned @ A, turned @ residual[..., None]
    diagonal = np.einsum("kii->ki", square)
    diagonal += np.maximum(DAMPING * diagonal.sum(axis=1, keepdims=True), 1e-300)
    return -np.linalg.solve(square, right)[..., 0]
