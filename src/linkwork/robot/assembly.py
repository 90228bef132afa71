"""Assembly: find closed configurations from tool poses or joint coordinates, and follow tool paths.

Unknowns are the tree's coordinates q. Gauss-Newton steps of least length solve  phi(q) = 0  together with what is
asked: q_i = given for joints, p(q) = p_0 and R(q) = R_0 for a tool. They start from a guess and stay on its branch
when it is near. Along a path, rates and accelerations follow from the same rows:

    [Phi; J] q' = [0; x'],    [Phi; J] q'' = [-gamma; x'' - J' q'].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linkwork.equations.algebra import skew
from linkwork.equations.reference import OpenLoopsError, close
from linkwork.errors import LinkworkError

LEG_SINGULAR = 1e-9


class UnreachableError(LinkworkError):
    """Refuse a pose or joint coordinates at which the loops cannot be closed."""


@dataclass(frozen=True)
class Assembler:
    """Solve for configurations of one mechanism with one tool.

    evaluate: maps (q, q') to the outputs of `functions.assembly` by name
    joints: names of all joints' coordinates; angular: which are angles
    rows: names of the closure rows; planar: whether poses are (x, y, angle)
    """

    evaluate: Callable[[np.ndarray, np.ndarray], dict[str, np.ndarray]]
    joints: tuple[str, ...]
    angular: np.ndarray
    rows: tuple[str, ...]
    planar: bool

    def at_joints(self, targets: dict[str, float], guess: np.ndarray) -> np.ndarray:
        """Return q with the given joint coordinates [m, rad], from a guess of q."""
        indices = [self.joints.index(name) for name in targets]
        values = np.array(list(targets.values()))
        names = (*self.rows, *(f"{name}: coordinate" for name in targets))

        def system(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            out = self.evaluate(q, 0 * q)
            error = out["coordinates"][indices] - values
            error = np.where(self.angular[indices], wrapped(error), error)
            return np.concatenate([out["phi"], error]), np.vstack([out["Phi"], out["J_coordinates"][indices]])

        asked = ", ".join(f"{name} = {value:g}" for name, value in targets.items())
        return self._solve(system, guess, names, f"with {asked}")

    def at_pose(self, pose: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return q with the tool at a pose: (x, y[, angle]) in the plane, (x, y, z[, rotation vector]) in space."""
        names = (*self.rows, *self.pose_names(pose.size))

        def system(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            out = self.evaluate(q, 0 * q)
            error, J = self._pose_rows(out, pose)
            return np.concatenate([out["phi"], error]), np.vstack([out["Phi"], J])

        return self._solve(system, guess, names, f"with the tool at {np.round(pose, 6).tolist()}")

    def rates(
        self, q: np.ndarray, pose: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return q', q'' for a pose and its first and second time derivatives, in the coordinates of the pose."""
        if pose.size == 6:
            omega, alpha = turning(pose[3:], velocity[3:], acceleration[3:])
            velocity = np.append(velocity[:3], omega)
            acceleration = np.append(acceleration[:3], alpha)
        out = self.evaluate(q, 0 * q)
        rows = self._pose_indices(velocity.size)
        A = np.vstack([out["Phi"], out["J_tool"][rows]])
        self._refuse_leg_singular(A)
        dq = np.linalg.lstsq(A, np.concatenate([0 * out["phi"], velocity]), rcond=None)[0]
        out = self.evaluate(q, dq)
        right = np.concatenate([-out["gamma"], acceleration - out["bias_tool"][rows]])
        return dq, np.linalg.lstsq(A, right, rcond=None)[0]

    def pose_names(self, size: int) -> tuple[str, ...]:
        names = ("x", "y", "angle") if self.planar else ("x", "y", "z", "rotation x", "rotation y", "rotation z")
        allowed = (2, 3) if self.planar else (3, 6)
        if size not in allowed:
            raise LinkworkError(
                f"a tool pose of {size} numbers is not understood; give {' or '.join(', '.join(names[:k]) for k in allowed)}"
            )
        return tuple(f"tool: {name}" for name in names[:size])

    def _pose_indices(self, size: int) -> list[int]:
        self.pose_names(size)
        return [3, 4, 2][:size] if self.planar else [3, 4, 5, 0, 1, 2][:size]

    def _pose_rows(self, out: dict[str, np.ndarray], pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the pose's error and Jacobian; turns are measured the short way round."""
        if self.planar:
            error = np.append(out["position"][:2] - pose[:2], wrapped(out["angle"] - pose[2:]))
        else:
            from scipy.spatial.transform import Rotation

            turn = np.empty(0)
            if pose.size == 6:
                R = out["orientation"].reshape(3, 3)
                turn = Rotation.from_matrix(R @ Rotation.from_rotvec(pose[3:]).as_matrix().T).as_rotvec()
            error = np.append(out["position"] - pose[:3], turn)
        return error, out["J_tool"][self._pose_indices(pose.size)]

    def _solve(self, system, guess: np.ndarray, names: tuple[str, ...], asked: str) -> np.ndarray:
        try:
            q = close(system, guess)
        except OpenLoopsError as error:
            element, _, what = names[error.worst].partition(": ")
            raise UnreachableError(
                f"the mechanism cannot be assembled {asked} from this guess: {element} ({what}) stays off by "
                f"{error.gap:.3g}; choose a pose within reach or a nearer guess"
            ) from None
        if self.evaluate(q, 0 * q)["alignment"][0] < 0:
            raise UnreachableError(
                f"the mechanism closes {asked} only with a joint's frames facing opposite ways; start from a nearer guess"
            )
        return q

    def _refuse_leg_singular(self, A: np.ndarray) -> None:
        values = np.linalg.svd(A, compute_uv=False)
        if A.shape[0] >= A.shape[1] and values[A.shape[1] - 1] < LEG_SINGULAR * values[0]:
            raise LinkworkError(
                "the configuration is leg-singular: the mechanism can move with the tool held still, so the tool's motion "
                "does not determine the joints'; lead the path around it"
            )


def turning(r: np.ndarray, dr: np.ndarray, ddr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return omega = J r' and alpha = J r'' + J' r' for a rotation vector r and its time derivatives.

    J = 1 + a [r x] + b [r x]^2,  a = (1 - cos t) / t^2,  b = (t - sin t) / t^3,  t = |r|, by series near t = 0.
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


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Return an angle [rad] between -pi and pi."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
