"""Assembly: find closed configurations from tool poses or joint coordinates, and follow tool paths.

Unknowns are the tree's coordinates q. Gauss-Newton steps of least length in the rates solve  phi(q)
= 0  together with what is asked: q_i = given for joints, p(q) = p_0 and R(q) = R_0 for a tool. They
start from a guess and stay on its branch when it is near. Along a path, the tree's rates w and
accelerations follow from the same rows:

    [Phi; J] w = [0; x'],    [Phi; J] w' = [-gamma; x'' - J' w].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linkwork.equations.algebra import skew, wrapped
from linkwork.equations.reference import CLOSED, OpenLoopsError, close, unit
from linkwork.equations.tree import Tree
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel

OPEN_LOOPS = 1e-6  # gaps of loops, in the mechanism's own units, that no state of a robot has
LEG_SINGULAR = 1e-9
NEWTON, CONTRACTS = (
    6,
    0.3,
)  # steps of Newton's method, and the part of the last one that the next one may have
LONGEST = 0.5  # Newton's step, in the mechanism's own units
MET = 1e-6
"""Distance from a solution, in the same units, from which Newton's method is sure to reach it."""
EPS = np.finfo(float).eps
MATRICES = ("Phi", "derivatives", "J_coordinates", "J_tool")


class UnreachableError(LinkworkError):
    """Refuse a pose or joint coordinates at which the loops cannot be closed."""


@dataclass(frozen=True, eq=False)
class AssemblyKernel:
    """Evaluate the kernel of `functions.assembly`; planar: whether poses are (x, y, angle)."""

    kernel: Kernel
    planar: bool

    def evaluate(self, q: np.ndarray, rates: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs by name for one configuration q (nq) and rates w (nv); matrices as
        such."""
        named = zip(self.kernel.outputs, self.kernel(q, rates), strict=True)
        rows = len(rates), -1
        return {
            name: value.reshape(rows).T if name in MATRICES else value for (name, _), value in named
        }

    def tool_poses(self, q: np.ndarray) -> np.ndarray:
        """Return the tool's poses (..., 3) in the plane, (..., 6) with a rotation vector in space,
        for q (..., nq)."""
        values = self.kernel(q, np.zeros(dict(self.kernel.inputs)["rates"]))
        out = {name: value for (name, _), value in zip(self.kernel.outputs, values, strict=True)}
        if self.planar:
            return np.concatenate([out["position"][..., :2], out["angle"]], axis=-1)
        from scipy.spatial.transform import Rotation

        turns = Rotation.from_matrix(out["orientation"].reshape(-1, 3, 3)).as_rotvec()
        return np.concatenate([out["position"], turns.reshape(out["position"].shape)], axis=-1)


@dataclass(frozen=True)
class Assembler:
    """Solve for configurations of one mechanism with one tool.

    evaluate: maps (q, w) to the outputs of `functions.assembly` by name
    coordinates, rate_names: names of all joints' coordinates and rates; angular: which coordinates
        are angles
    sizes: units of the coordinates, the mechanism's own length of lengths; units: those of the
        closure rows
    rows, unheld: names of the closure rows, and of those that are not held; planar: whether poses
        are (x, y, angle)
    """

    evaluate: Callable[[np.ndarray, np.ndarray], dict[str, np.ndarray]]
    tree: Tree
    coordinates: tuple[str, ...]
    rate_names: tuple[str, ...]
    angular: np.ndarray
    sizes: np.ndarray
    rows: tuple[str, ...]
    unheld: tuple[str, ...]
    units: np.ndarray
    planar: bool

    def at_joints(
        self, targets: dict[str, float], guess: np.ndarray, wraps: np.ndarray
    ) -> np.ndarray:
        """Return q with the given joint coordinates [m, rad], from a guess of q; wraps: which of
        them but for whole turns."""
        indices = [self.coordinates.index(name) for name in targets]
        rates = [self._rate_index(name) for name in targets]
        values = np.array(list(targets.values()))
        names = (*self.rows, *(f"{name}: coordinate" for name in targets))

        def system(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            out = self.still(q)
            error = out["coordinates"][indices] - values
            error = np.where(wraps, wrapped(error), error)
            J = np.vstack([out["Phi"], out["J_coordinates"][rates]])
            return np.concatenate([out["phi"], error]), J, out["derivatives"]

        def asked() -> str:
            return "with " + ", ".join(f"{name} = {value:g}" for name, value in targets.items())

        return self._solve(system, self.sizes[indices], guess, names, asked)

    def proper(self, q: np.ndarray) -> bool:
        """Tell whether closed loops are closed in the rows that are not held, too, with frames that
        face each other."""
        out = self.still(q)
        return not out.get("excess", 0.0) > 0 and bool(out["alignment"][0] >= 0)

    def at_pose(self, pose: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return q with the tool at a pose: (x, y[, angle]) in the plane, (x, y, z[, rotation
        vector]) in space."""
        names = (*self.rows, *self.pose_names(pose.size))

        def system(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            out = self.still(q)
            error, J = self._pose_rows(out, pose)
            return (
                np.concatenate([out["phi"], error]),
                np.vstack([out["Phi"], J]),
                out["derivatives"],
            )

        return self._solve(
            system,
            self._pose_units(pose.size),
            guess,
            names,
            lambda: f"with the tool at {np.round(pose, 6).tolist()}",
        )

    def rates(
        self, q: np.ndarray, pose: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return w, w' for a pose and its first and second time derivatives, in the coordinates of
        the pose.

        Where more rows or fewer than rates hold these are of least squares and least length, in the
        mechanism's own units.
        """
        if pose.size == 6:
            omega, alpha = turning(pose[3:], velocity[3:], acceleration[3:])
            velocity = np.append(velocity[:3], omega)
            acceleration = np.append(acceleration[:3], alpha)
        out = self.still(q)
        rows = self.pose_indices(velocity.size)
        widths, heights = (
            self.tree.rate_units,
            np.concatenate([self.units, self._pose_units(velocity.size)]),
        )
        A = np.concatenate([out["Phi"], out["J_tool"][rows]]) * (widths / heights[:, None])
        U, values, V = np.linalg.svd(A, full_matrices=False)
        self._refuse_leg_singular(A.shape, values, velocity.size)
        inverse = np.divide(
            1.0, values, out=np.zeros_like(values), where=values > max(A.shape) * EPS * values[0]
        )

        def least(right: np.ndarray) -> np.ndarray:
            return widths * (V.T @ (inverse * (U.T @ (right / heights))))

        w = least(np.concatenate([0 * out["phi"], velocity]))
        out = self.evaluate(q, w)
        return w, least(np.concatenate([-out["gamma"], acceleration - out["bias_tool"][rows]]))

    def _pose_units(self, size: int) -> np.ndarray:
        """Return the mechanism's own units of a pose's coordinates."""
        return np.where(np.array(self.pose_indices(size)) < 3, 1.0, self.tree.length)

    def _rate_index(self, coordinate: str) -> int:
        if coordinate not in self.rate_names:
            raise LinkworkError(
                f"{coordinate!r} is part of a quaternion and cannot be asked for alone; give "
                "angles and slides, or the tool's pose"
            )
        return self.rate_names.index(coordinate)

    def still(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs of `evaluate` at rest."""
        return self.evaluate(q, np.zeros(len(self.tree.rates)))

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return q after a step of the tree's rates times a time, its quaternions at length 1."""
        return unit(self.tree, q + self.still(q)["derivatives"] @ step) if step.any() else q

    def pose_names(self, size: int) -> tuple[str, ...]:
        names = (
            ("x", "y", "angle")
            if self.planar
            else ("x", "y", "z", "rotation x", "rotation y", "rotation z")
        )
        allowed = (2, 3) if self.planar else (3, 6)
        if size not in allowed:
            raise LinkworkError(
                f"a tool pose of {size} numbers is not understood; give "
                f"{' or '.join(', '.join(names[:k]) for k in allowed)}"
            )
        return tuple(f"tool: {name}" for name in names[:size])

    def pose_indices(self, size: int) -> list[int]:
        self.pose_names(size)
        return [3, 4, 2][:size] if self.planar else [3, 4, 5, 0, 1, 2][:size]

    def _pose_rows(
        self, out: dict[str, np.ndarray], pose: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the pose's error and Jacobian; turns are measured the short way round."""
        if self.planar:
            error = np.append(out["position"][:2] - pose[:2], wrapped(out["angle"] - pose[2:]))
        else:
            from scipy.spatial.transform import Rotation

            turn = np.empty(0)
            if pose.size == 6:
                R = out["orientation"].reshape(3, 3)
                turn = Rotation.from_matrix(
                    R @ Rotation.from_rotvec(pose[3:]).as_matrix().T
                ).as_rotvec()
            error = np.append(out["position"] - pose[:3], turn)
        return error, out["J_tool"][self.pose_indices(pose.size)]

    def _solve(
        self,
        system,
        sizes: np.ndarray,
        guess: np.ndarray,
        names: tuple[str, ...],
        asked: Callable[[], str],
    ) -> np.ndarray:
        """Return q that solves a system.

        sizes: the mechanism's own units of what is asked for beside closed loops; asked: what says
        that in a sentence.
        """
        # In the mechanism's own units residuals compare, and the least step means something.
        rows, rates = np.concatenate([self.units, sizes]), self.tree.rate_units
        factors = rates / rows[:, None]

        def natural(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            residual, J, N = system(q)
            return residual / rows, J * factors, N * rates

        try:
            q = close(natural, self.tree, guess)
        except OpenLoopsError as error:
            element, _, what = names[error.worst].partition(": ")
            raise UnreachableError(
                f"the mechanism cannot be assembled {asked()} from this guess: {element} "
                f"({what}) stays off by {error.gap * rows[error.worst]:.3g}; choose a pose "
                "within reach or a nearer guess"
            ) from None
        # Closed, but not as described: rows left open, frames the wrong way round.
        out = self.still(q)
        if out.get("excess", 0.0) > 0:
            raise UnreachableError(
                f"the mechanism closes {asked()} only in the rows that are held, and not in "
                f"{', '.join(self.unheld)}, which rounded numbers leave open; start from a "
                "nearer guess, or give the numbers of its frames in full"
            )
        if out["alignment"][0] < 0:
            raise UnreachableError(
                f"the mechanism closes {asked()} only with a joint's frames facing opposite "
                "ways; start from a nearer guess"
            )
        return q

    def _refuse_leg_singular(self, shape: tuple[int, ...], values: np.ndarray, size: int) -> None:
        rows, width = shape
        if rows >= width and values[width - 1] < LEG_SINGULAR * values[0]:
            held = ", ".join(name.removeprefix("tool: ") for name in self.pose_names(size))
            raise LinkworkError(
                "the configuration is leg-singular: the mechanism can move with the tool's "
                f"{held} held still, so these do not determine the joints' motion; lead the path "
                "around it"
            )


def contracted(closure_step: Kernel, tree: Tree, q: np.ndarray) -> np.ndarray | None:
    """Return q (nq) with closed loops where Newton's steps of the dependent coordinates contract at
    once, else None.

    closure_step: the kernel of that name of a chart, whose independent coordinates stay.
    """
    last = LONGEST / CONTRACTS
    for _ in range(NEWTON + 1):
        after, (gap,) = closure_step(q)
        length = np.abs((after - q) / tree.units).max(initial=0.0)
        closed = gap <= CLOSED
        if not length <= (MET if closed else CONTRACTS * last):
            return None
        if closed:
            return after
        q, last = after, length
    return None


def turning(r: np.ndarray, dr: np.ndarray, ddr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return omega = J r' and alpha = J r'' + J' r' for a rotation vector r and its time
    derivatives.

    J = 1 + a [r x] + b [r x]^2,  a = (1 - cos t) / t^2,  b = (t - sin t) / t^3,  t = |r|, by series
    near t = 0.
    """
    t = float(np.linalg.norm(r))
    if t < 1e-2:
        a, b = 1 / 2 - t**2 / 24 + t**4 / 720, 1 / 6 - t**2 / 120 + t**4 / 5040
        a_t, b_t = -1 / 12 + t**2 / 180 - t**4 / 6720, -1 / 60 + t**2 / 1260 - t**4 / 60480
    else:
        a, b = (1 - np.cos(t)) / t**2, (t - np.sin(t)) / t**3
        a_t, b_t = (np.sin(t) / t - 2 * a) / t**2, (a - 3 * b) / t**2  # da/dt / t, db/dt / t
    K, dK = skew(r), skew(dr)
    J = np.eye(3) + a * K + b * K @ K
    dJ = (a_t * K + b_t * K @ K) * (r @ dr) + a * dK + b * (dK @ K + K @ dK)
    return J @ dr, J @ ddr + dJ @ dr
