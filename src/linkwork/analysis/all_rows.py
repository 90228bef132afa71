"""Square systems by all rows, where rows of the loops depend on each other.

Of rows that depend on others some are kept (`square`). A kept row may vanish where no pose is
singular, and with it the determinant of the kept ones. By all rows of A = [Phi; J], in the
mechanism's own units,

    A w = [0; y']                   by least squares, which closed loops meet
    D = sqrt(det A' A)              the root of the sum of all choices' squares: 0 where w is open

The sign of D is told from one configuration to a near one: that of det A_1' A_2 (`modes.turned`);
so it is along a motion, and from where the system was chosen along configurations that close the
loops, whatever they do to the tool. At one configuration the signs of two systems are told by each
other, for what their rows of Phi let depend is the same: by det A' B.
Source: Horn & Johnson 2013, sec. 0.8.7 (Cauchy-Binet).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.analysis.actuated_coordinates import ActuatorsAsked
from linkwork.analysis.newton import solver
from linkwork.analysis.square import Square
from linkwork.equations.reference import unit
from linkwork.model.closing import closed
from linkwork.model.leading import Leader
from linkwork.model.turning import closing
from linkwork.robot import Robot

SHORT = 1e-5  # part of unit rates by which differences are taken
WEAK = 1e-6  # pivot over the determinant, below which much rounding is in what follows
EQUAL = 1e-12  # difference of two determinants over their sum that rounding may have made
STRIDE, SHORTEST = 0.2, 0.01  # steps to another configuration, in the mechanism's own units
ROUNDS, NEWTON = 200, 10  # such steps, and Newton's ones in each
TURNS = 6  # angles that may be gone to with other whole turns
NEARER = 0.3  # part of a step by which it has to come nearer

Turned = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""A (K, rows, nv) at some configurations and at near ones -> signs (K, k)."""


@dataclass(frozen=True, eq=False)
class AllRows:
    """Evaluate a square system by all rows."""

    square: Square

    @cached_property
    def leader(self) -> Leader:
        """Return what leads in what the system asks for."""
        robot, asked = self.square.robot, self.square.asked
        if asked is not None:
            return robot.leader_of_tool(asked, kept=True)
        if {*self.square.what} <= {*robot.coordinates}:
            return robot.leader_of_joints(robot.joints_asked(self.square.what))
        return robot.leader_of_joints(ActuatorsAsked.of(robot))

    @property
    def spared(self) -> bool:
        """Whether rows are left out that could stand for others."""
        equations = self.square.equations
        every = len(equations.chart.rows) == len(equations.rows.names)
        return not every and self.leader.modes.spared

    def matrix(self, q: np.ndarray) -> np.ndarray:
        """Return A (N, rows, nv) of configurations (N, nq), in the mechanism's own units."""
        return self.leader.in_own_units(q)

    def asked(self, q: np.ndarray) -> np.ndarray:
        """Return J (N, n, nv), in SI units."""
        return self.leader.matrix(self.leader.outputs(q))[:, -len(self.square.what) :]

    def rates(self, q: np.ndarray) -> np.ndarray:
        """Return W (N, nv, n) of the rates w = W y'."""
        n, tree = len(self.square.what), self.square.equations.tree
        W = np.linalg.pinv(self.matrix(q), rcond=0.0)[:, :, -n:]
        return tree.rate_units[:, None] * W / self.square.heights

    def sizes(self, q: np.ndarray) -> np.ndarray:
        """Return D of configurations (N, nq) over its value where the system was chosen (N)."""
        at = np.concatenate([self.square.base[None], q])
        D = np.linalg.svd(self.matrix(at), compute_uv=False).prod(axis=1)
        return D[1:] / D[0]

    def misled(self, q: np.ndarray, pivots: np.ndarray) -> np.ndarray:
        """Return at which configurations (N, nq) a pivot of the square system's elimination, of the
        weakest (N), vanishes while the system stays regular (N)."""
        weak = ~(pivots > WEAK) & np.isfinite(q).all(axis=1)
        if weak.any():
            weak[weak] = ~(pivots[weak] > WEAK * np.abs(self.determinants(q[weak])))
        return weak

    def determinants(self, q: np.ndarray) -> np.ndarray:
        """Return the square system's determinant at configurations (N, nq), in any order, over its
        value where it was chosen (N)."""
        stages = self.square.chart.stages
        rows = [r for stage in stages for r in stage.rows]
        columns = [c for stage in stages for c in stage.columns]
        A = self.matrix(np.concatenate([self.square.base[None], q]))
        D = np.linalg.det(A[:, rows][:, :, columns])
        return D[1:] / D[0]

    def signs(self, q: np.ndarray) -> np.ndarray:
        """Return the signs of D at any configurations (N, nq), by `led_signs`; NaN where these are
        not told."""
        signs = self.led_signs(q, whole)[:, 0]
        return np.where(signs == 0, np.nan, signs)

    def along(self, q: np.ndarray) -> np.ndarray:
        """Return the signs of D along a motion (N, nq), relative to the first one where that is not
        told."""
        regular = self.sizes(q) > EQUAL  # the others tell nothing, and are skipped
        regular[:1] = True
        A = self.matrix(q[regular])
        signs = np.cumprod(np.concatenate([[1.0], whole(A[:-1], A[1:])[:, 0]]))
        return np.nan_to_num(self.signs(q[:1]), nan=1.0) * signs[np.cumsum(regular) - 1]

    def led_signs(self, q: np.ndarray, turned: Turned) -> np.ndarray:
        """Return signs (N, k) at configurations (N, nq), relative to those where the system was
        chosen, from where steps towards each lead that close the loops; 0 where they do not."""
        robot, tree = self.square.robot, self.square.equations.tree
        step = robot.least(robot.joints_asked(())).step
        here, q = np.repeat(self.square.base[None], len(q), axis=0), q.copy()
        sign = turned(self.matrix(here), self.matrix(here))
        going, length = np.arange(len(q)), np.full(len(q), STRIDE)
        turns = np.full(len(q), TURNS)
        for _ in range(ROUNDS):
            if not going.size:
                break
            rest = q[going] - here[going]
            for places, _ in tree.quaternions:  # of both signs, the nearer one
                opposite = (q[going][:, places] * here[going][:, places]).sum(axis=1) < 0
                rest[np.ix_(opposite, places)] -= 2 * q[going[opposite]][:, places]
            far = np.abs(rest / tree.units).max(axis=1, initial=0.0)
            part = np.minimum(1.0, length[going] / np.maximum(far, 1e-300))
            ahead = unit(tree, here[going] + part[:, None] * rest)
            found = closed(step, ahead, (np.zeros((len(going), 0)),), NEWTON)
            # On: what is closed and comes nearer, as long as a step wants to.
            gone = np.abs((found.q - here[going]) / tree.units).max(axis=1, initial=0.0)
            left = np.abs((found.q - here[going] - rest) / tree.units).max(axis=1, initial=0.0)
            good = found.met & (found.told[0] >= 0) & (gone <= 2 * STRIDE)
            good &= left <= np.where(part == 1, SHORTEST, far * (1 - NEARER * part))
            on = going[good]
            sign[on] *= turned(self.matrix(here[on]), self.matrix(found.q[good]))
            here[on] = found.q[good]
            length[going] = np.minimum(STRIDE, length[going] * np.where(good, 2.0, 0.5))
            going = going[~(good & (part == 1))]
            # What gets stuck goes to the same place with other whole turns of an angle.
            for k in going[length[going] < SHORTEST]:
                q[k], length[k], turns[k] = self.rewound(here[k], q[k]), STRIDE, turns[k] - 1
            going = going[turns[going] > 0]
        sign[turns == 0] = sign[going] = 0.0
        return sign

    def rewound(self, here: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return a configuration (nq) with a whole turn more or less of the angle with which the
        straight way to it from another one opens the loops least."""
        tree, count = self.square.equations.tree, len(self.square.what)
        free = closing(self.square.robot.chart)
        places = [place for place, k in tree.single if free[place] and not tree.slides[k]]
        out = self.leader.outputs(here[None])
        Phi = self.matrix(here[None])[0, :-count]
        to_rates = np.linalg.pinv(out["derivatives"][0]) / tree.rate_units[:, None]
        others = q + 2 * np.pi * np.concatenate([np.eye(len(q))[places], -np.eye(len(q))[places]])
        gaps = np.linalg.norm((others - here) @ (Phi @ to_rates).T, axis=1)
        return others[np.argmin(gaps)]

    def slopes(self, moved: AllRows, q: np.ndarray, kept: bool = False) -> np.ndarray:
        """Return the derivatives of D, or of the kept rows' determinant, along what another system
        asks for (N, n), by central differences."""
        tree, found = self.square.equations.tree, []
        derivatives = self.leader.outputs(q)["derivatives"]
        for w in np.moveaxis(moved.rates(q), 2, 0):
            aside = SHORT * (derivatives @ w[..., None])[..., 0]
            size = self.determinants if kept else self.sizes
            ahead, behind = (size(unit(tree, q + way)) for way in (aside, -aside))
            level = np.abs(ahead - behind) <= EQUAL * np.abs(ahead + behind)
            found.append(np.where(level, 0.0, (ahead - behind) / (2 * SHORT)))
        return np.stack(found, axis=-1)


def whole(A: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the signs (K, 1) of det A' B."""
    return np.sign(np.linalg.det(A.swapaxes(1, 2) @ other))[:, None]


def together(inverse: AllRows, direct: AllRows, q: np.ndarray) -> np.ndarray:
    """Return the signs of det A times det B (N) at configurations (N, nq)."""
    base, other = inverse.square.base[None], direct.square.base[None]
    signs = whole(inverse.matrix(at := np.concatenate([base, q])), direct.matrix(at))[:, 0]
    return signs[1:] * signs[0] * whole(direct.matrix(base), direct.matrix(other))[0, 0]


def on_mode(
    square: Square, start: np.ndarray, y: np.ndarray, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return configurations (N, nq) at what a square system asks for (N, n), on the mode of a start
    (nq) to which Newton's steps lead, or straight ways by all rows; and which these are (N)."""
    if (rows := all_rows(square)).spared:
        q, there, _ = rows.leader.led(start, y)
        return q, there
    problem = solver(square)
    return problem.solve(start, y, steps, problem.signs(start))


def all_rows(square: Square) -> AllRows:
    """Return a square system by all rows, which its robot keeps."""
    return square.robot.once(_all_rows, square)


def _all_rows(_: Robot, square: Square) -> AllRows:
    return AllRows(square)
