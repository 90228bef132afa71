"""The paper equation by equation, for any mechanism of one-freedom joints.

"The paper" is Kordjazi, Akbarzadeh & Tahani, ICME 2010; the numbers in brackets are its equations'.

q (m,) holds the coordinates of all joints but the fixed ones, in the mechanism's order [rad, m];
q_a (n,) those of the actuated joints, in the actuators' order; q_u the rest. The r bodies come in
the mechanism's order; a twist is t_i = [omega_i; v_i], v_i of the mass centre, in base axes.
Nothing is fast here, and nothing is hidden.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from linkwork.checks import amount
from linkwork.errors import LinkworkError
from linkwork.lab.textbook.closure import (
    independent_rows,
    loop_errors,
    loop_jacobian,
    loop_jacobian_rate,
)
from linkwork.lab.textbook.geometry import cross_matrix
from linkwork.lab.textbook.kinematics import (
    Configuration,
    MovingConfiguration,
    SpanningTree,
    configuration,
    motion,
    spanning_tree,
)
from linkwork.mechanism import Mechanism

SINGULAR = 1e-10  # smallest over largest singular value of Phi_u below which it counts as singular
CLOSED = 1e-9  # largest closure error [m, rad] of a closed loop


@dataclass(frozen=True)
class Textbook:
    """Evaluate the paper's equations for a mechanism of revolute, prismatic and fixed joints.

    Every method takes joint coordinates q (m,) that close the loops, as `solve` returns them.

    Raises:
        LinkworkError: another type of joint; as many actuators as freedoms are not given; a vector
            of the wrong length; loops that do not close; a singular Phi_u.
    """

    mechanism: Mechanism

    @cached_property
    def tree(self) -> SpanningTree:
        """Return the spanning tree whose paths K and phi follow."""
        mechanism = self.mechanism
        if mechanism.transmissions or mechanism.lifts or mechanism.drags:
            raise LinkworkError(
                f"{mechanism.name} has transmissions, lifts or drags, which the paper's equations "
                "do not; take them out of the description"
            )
        return spanning_tree(mechanism)

    @property
    def m(self) -> int:
        """Return the number of one-freedom joints."""
        return len(self.tree.moving)

    @property
    def n(self) -> int:
        """Return the number of actuated joints."""
        return len(self.mechanism.actuators)

    @property
    def r(self) -> int:
        """Return the number of bodies."""
        return len(self.mechanism.bodies)

    @cached_property
    def a(self) -> np.ndarray:
        """Return the columns of the actuated joints in q, in the actuators' order, shape (n,)."""
        return np.array(
            [self.tree.moving.index(name) for name in self.mechanism.actuators], dtype=int
        )

    @cached_property
    def u(self) -> np.ndarray:
        """Return the columns of the other joints in q, shape (m - n,)."""
        return np.setdiff1d(np.arange(self.m), self.a)

    @cached_property
    def guess(self) -> np.ndarray:
        """Return the mechanism's reference coordinates as they are given, shape (m,)."""
        return np.array([self.mechanism.reference.get(name, 0.0) for name in self.tree.moving])

    @cached_property
    def rows(self) -> np.ndarray:
        """Return which m - n of the six equations per loop are kept: independent ones at the
        reference."""
        Phi = loop_jacobian(self.configuration(self.guess))
        rows = independent_rows(Phi, self.m - self.n)
        if rows is not None:
            Phi = loop_jacobian(self.configuration(self.close(self.guess, rows)))
        rank = int(np.linalg.matrix_rank(Phi, rtol=1e-9)) if Phi.size else 0
        if rank != self.m - self.n or rows is None:
            raise LinkworkError(
                f"{self.mechanism.name} has the mobility {self.m - rank} at its reference but "
                f"{amount(self.n, 'actuator')}; name as many independent joints as it has freedoms"
            )
        return rows

    @cached_property
    def reference(self) -> np.ndarray:
        """Return the reference coordinates with the loops closed and the actuated joints where they
        are, shape (m,)."""
        return self.close(self.guess, self.rows)

    # Kinematics

    def configuration(self, q: ArrayLike) -> Configuration:
        """Place the bodies and joint axes at q."""
        return configuration(self.tree, checked("q", q, self.m))

    def motion(self, q: ArrayLike, qa_dot: ArrayLike) -> MovingConfiguration:
        """Return the configuration with all rates, at the actuated joints' rates q_a' (n,)."""
        return motion(self.configuration(q), self.L(q) @ checked("qa_dot", qa_dot, self.n))

    def phi(self, q: ArrayLike) -> np.ndarray:
        """Return the loop equations phi(q) (m - n,) [m, rad], zero where the loops are closed: Eq.
        (1)."""
        return loop_errors(self.configuration(q))[self.rows]

    def Phi(self, q: ArrayLike) -> np.ndarray:
        """Return Phi = d phi / d q, (m - n) x m: Eq. (2)."""
        return loop_jacobian(self.configuration(q))[self.rows]

    def solve(self, q_guess: ArrayLike, q_a: ArrayLike) -> np.ndarray:
        """Solve phi(q_a, q_u) = 0 for q_u by Newton's method: the algorithm's first step.

        Args:
            q_guess: all joint coordinates near the solution (m,) [rad, m]; its q_a is not used.
            q_a: coordinates of the actuated joints (n,) [rad, m].

        Returns:
            q (m,) with the loops closed.

        Raises:
            LinkworkError: the steps do not settle, or a loop stays open.
        """
        q = checked("q_guess", q_guess, self.m).copy()
        q[self.a] = checked("q_a", q_a, self.n)
        return self.close(q, self.rows)

    def close(self, q: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return q with q_u moved until the given rows of phi vanish, and with them all others."""
        q = q.copy()
        for _ in range(50):
            at = self.configuration(q)
            step = self.solve_Phi_u(loop_jacobian(at)[rows], loop_errors(at)[rows])
            q[self.u] -= step
            if np.linalg.norm(step) <= 1e-11 * (1 + np.linalg.norm(q)):
                break
        error = np.max(abs(loop_errors(self.configuration(q))), initial=0.0)
        if not error < CLOSED:
            raise LinkworkError(
                f"the loops of {self.mechanism.name} do not close for q_a = "
                f"{q[self.a].round(6).tolist()}: an error of {error:.3g} remains; start nearer "
                "to a closed configuration or bring q_a within reach"
            )
        return q

    def solve_Phi_u(self, Phi: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Return Phi_u^-1 b; a singular Phi_u is refused."""
        Phi_u = Phi[:, self.u]
        if not Phi_u.size:
            return np.zeros(b.shape)
        s = np.linalg.svd(Phi_u, compute_uv=False)
        if not s[-1] > SINGULAR * s[0]:
            raise LinkworkError(
                f"Phi_u of {self.mechanism.name} is singular in this configuration (singular "
                f"values from {s[0]:.3g} to {s[-1]:.3g}): the actuated joints "
                f"{', '.join(self.mechanism.actuators)} do not determine the others' rates; move "
                "away from it or actuate other joints"
            )
        return np.linalg.solve(Phi_u, b)

    def K(self, q: ArrayLike) -> np.ndarray:
        """Return K, 6r x m, with t = K q': the unit twists of the joints on each body's path, Eq.
        (4)."""
        at = self.configuration(q)
        return np.vstack(
            [
                at.unit_twists(at.mass_centre(body)) * at.tree.path[body]
                for body in self.mechanism.bodies
            ]
        )

    def Kdot(self, q: ArrayLike, qa_dot: ArrayLike) -> np.ndarray:
        """Return d/dt K, 6r x m."""
        during = self.motion(q, qa_dot)
        blocks = []
        for body in self.mechanism.bodies:
            c = during.at.mass_centre(body)
            c_rate = during.twist(body, c)[3:]
            blocks.append(during.unit_twists_rate(c, c_rate) * self.tree.path[body])
        return np.vstack(blocks)

    def L(self, q: ArrayLike) -> np.ndarray:
        """Return L, m x n, with q' = L q_a': rows in the joints' order, Eq. (7)."""
        Phi = self.Phi(q)
        L = np.zeros((self.m, self.n))
        L[self.a] = np.eye(self.n)
        L[self.u] = -self.solve_Phi_u(Phi, Phi[:, self.a])  # L = [1; -Phi_u^-1 Phi_a]
        return L

    def Ldot(self, q: ArrayLike, qa_dot: ArrayLike) -> np.ndarray:
        """Return d/dt L, m x n, from Phi L' + Phi' L = 0."""
        Phidot = loop_jacobian_rate(self.motion(q, qa_dot))[self.rows]
        Ldot = np.zeros((self.m, self.n))
        Ldot[self.u] = -self.solve_Phi_u(self.Phi(q), Phidot @ self.L(q))
        return Ldot

    def T(self, q: ArrayLike) -> np.ndarray:
        """Return T = K L, 6r x n, the natural orthogonal complement: t = T q_a', Eqs. (6), (8)."""
        return self.K(q) @ self.L(q)  # (8)

    def Tdot(self, q: ArrayLike, qa_dot: ArrayLike) -> np.ndarray:
        """Return d/dt T = K' L + K L', 6r x n."""
        return self.Kdot(q, qa_dot) @ self.L(q) + self.K(q) @ self.Ldot(q, qa_dot)

    # Dynamics

    def Mtot(self, q: ArrayLike) -> np.ndarray:
        """Return the extended mass matrix, 6r x 6r, inertias about the mass centres in base axes:
        Eqs. (14), (16)."""
        at = self.configuration(q)
        blocks = []
        for name, body in self.mechanism.bodies.items():
            R = at.X[name][:3, :3]
            blocks += [
                R @ body.inertia.tensor() @ R.T,
                body.mass * np.eye(3),
            ]  # M_i = diag(I_i, m_i 1)
        return np.asarray(block_diag(*blocks))

    def Omega(self, q: ArrayLike, qa_dot: ArrayLike) -> np.ndarray:
        """Return the extended angular velocity matrix, 6r x 6r: Eqs. (15), (16)."""
        t = self.T(q) @ checked("qa_dot", qa_dot, self.n)  # (6)
        blocks = []
        for i in range(self.r):
            blocks += [
                cross_matrix(t[6 * i : 6 * i + 3]),
                np.zeros((3, 3)),
            ]  # Omega_i = diag([omega_i x], 0)
        return np.asarray(block_diag(*blocks))

    def w_g(self) -> np.ndarray:
        """Return the wrenches of gravity on all bodies (6r,), Eq. (17)."""
        gravity = np.array(self.mechanism.gravity)
        return np.concatenate(
            [np.append(np.zeros(3), body.mass * gravity) for body in self.mechanism.bodies.values()]
        )

    def M(self, q: ArrayLike) -> np.ndarray:
        """Return the generalised inertia matrix, n x n: Eq. (10)."""
        T = self.T(q)
        return T.T @ self.Mtot(q) @ T  # (10)

    def C(self, q: ArrayLike, qa_dot: ArrayLike) -> np.ndarray:
        """Return the matrix of Coriolis and centrifugal terms, n x n: Eq. (11)."""
        T, Mtot = self.T(q), self.Mtot(q)
        return T.T @ Mtot @ self.Tdot(q, qa_dot) + T.T @ self.Omega(q, qa_dot) @ Mtot @ T  # (11)

    def G(self, q: ArrayLike) -> np.ndarray:
        """Return the generalised forces that hold against gravity (n,): Eq. (12)."""
        return -self.T(q).T @ self.w_g()  # (12)

    def forward_dynamics(self, q: ArrayLike, qa_dot: ArrayLike, tau: ArrayLike) -> np.ndarray:
        """Return q_a'' = M^-1 (tau - C q_a' - G), (n,) [rad/s^2, m/s^2]: Eq. (9), with the sign
        that (12) asks for.

        Args:
            q: all joint coordinates, loops closed (m,) [rad, m].
            qa_dot: rates of the actuated joints (n,) [rad/s, m/s].
            tau: forces of the actuators (n,) [N m, N], Eq. (13).
        """
        qa_dot, tau = checked("qa_dot", qa_dot, self.n), checked("tau", tau, self.n)
        return np.linalg.solve(self.M(q), tau - self.C(q, qa_dot) @ qa_dot - self.G(q))  # (9)

    def inverse_dynamics(self, q: ArrayLike, qa_dot: ArrayLike, qa_ddot: ArrayLike) -> np.ndarray:
        """Return the actuators' forces tau = M q_a'' + C q_a' + G, (n,) [N m, N]: Eq. (9) solved
        for tau."""
        qa_dot, qa_ddot = checked("qa_dot", qa_dot, self.n), checked("qa_ddot", qa_ddot, self.n)
        return self.M(q) @ qa_ddot + self.C(q, qa_dot) @ qa_dot + self.G(q)


def checked(name: str, value: ArrayLike, length: int) -> np.ndarray:
    """Return a vector of floats; another shape and non-finite numbers are refused."""
    vector = np.asarray(value, dtype=float)
    if vector.shape != (length,):
        raise LinkworkError(
            f"{name} has the shape {vector.shape}; give {length} numbers, shape ({length},)"
        )
    if not np.isfinite(vector).all():
        raise LinkworkError(f"{name} = {vector.tolist()} is not finite; give finite numbers")
    return vector
