"""IPOPT, which comes with CasADi: local optima of nonlinear programmes, verified.

    min f(x)  with  lower <= x <= upper,  g_lower <= g(x) <= g_upper

A point is given back only where it keeps the constraints and fulfils the conditions of Karush,
Kuhn and Tucker, which are computed anew from its multipliers:  grad f + g_x' lambda + mu = 0.

Source: Waechter & Biegler, Mathematical Programming 106 (2006) 25-57.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.errors import LinkworkError

TOLERANCE = 1e-9  # of IPOPT, scaled
STATIONARY, KEPT = 1e-5, 1e-6  # residuals that are taken as none: over multipliers, and of g
MEANING = {
    "Infeasible_Problem_Detected": "from this start none keeps all constraints",
    "Maximum_Iterations_Exceeded": "IPOPT does not settle",
    "Invalid_Number_Detected": "the start, or what lies near it, is singular",
    "Restoration_Failed": "IPOPT gets stuck where constraints stay open",
}
QUIET = {
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
}


class NoOptimumError(LinkworkError):
    """Tell that no local optimum is found from a start."""


@dataclass(frozen=True, eq=False)
class LocalOptimum:
    """Hold a local optimum: x, f(x), the steps that led there, the residual of stationarity over
    the largest multiplier (at least 1), and that of the constraints."""

    x: np.ndarray
    value: float
    steps: int
    stationarity: float
    violation: float


@dataclass(frozen=True, eq=False)
class Programme:
    """Hold a nonlinear programme: symbols x, f and g of them, bounds and a start, and how much the
    barrier weighs there."""

    x: ca.MX
    f: ca.MX
    g: ca.MX
    start: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    g_bounds: tuple[np.ndarray, np.ndarray]
    barrier: float = 0.1

    def unmoved(self, among: int) -> np.ndarray:
        """Return which of the first unknowns move neither f nor g at the start."""
        first = ca.vertcat(self.f, self.g)
        slopes = ca.Function("slopes", [self.x], [ca.jacobian(first, self.x)[:, :among]])
        return np.flatnonzero(~slopes(self.start).full().any(axis=0))

    def solve(self, what: str, steps: int) -> LocalOptimum:
        """Return a local optimum.

        Args:
            what: is looked for, as refusals name it; steps: most of them.

        Raises:
            NoOptimumError: IPOPT ends elsewhere, with its own word why; conditions that are not
                fulfilled.
        """
        options = {**QUIET, "ipopt.tol": TOLERANCE, "ipopt.max_iter": steps}
        options["ipopt.mu_init"] = self.barrier
        solver = ca.nlpsol("local", "ipopt", {"x": self.x, "f": self.f, "g": self.g}, options)
        limits = dict(zip(("lbx", "ubx"), self.bounds, strict=True))
        limits |= dict(zip(("lbg", "ubg"), self.g_bounds, strict=True))
        found, told = solver(x0=self.start, **limits), solver.stats()
        word, count = str(told["return_status"]), int(told["iter_count"])
        if not told["success"]:
            raise NoOptimumError(
                f"no {what} is found: {MEANING.get(word, f'IPOPT ends with {word}')} "
                f"({count} steps)"
            )
        x = found["x"].full().ravel()
        residuals = self._residuals(x, found["lam_x"], found["lam_g"])
        if not (residuals[0] < STATIONARY and residuals[1] < KEPT):
            raise NoOptimumError(
                f"no {what} is found: where IPOPT ends after {count} steps its conditions stay "
                f"open by {residuals[0]:.2g} (stationarity) and {residuals[1]:.2g} (constraints)"
            )
        return LocalOptimum(x, float(found["f"]), count, *residuals)

    def _residuals(self, x: np.ndarray, of_x: ca.DM, of_g: ca.DM) -> tuple[float, float]:
        """Return how far a point is from stationary, over its multipliers, and off its
        constraints."""
        weights = ca.MX.sym("weights", self.g.numel())
        slope = ca.gradient(self.f, self.x) + ca.jtimes(self.g, self.x, weights, True)
        told = ca.Function("residuals", [self.x, weights], [slope, self.g])
        steep, g = (np.array(part).ravel() for part in told(x, of_g))
        own = max(1.0, *(float(np.abs(part.full()).max(initial=0.0)) for part in (of_x, of_g)))
        stationarity = np.abs(steep + of_x.full().ravel()).max() / own
        beyond = [low - y for low, y in ((self.bounds[0], x), (self.g_bounds[0], g))]
        beyond += [y - high for high, y in ((self.bounds[1], x), (self.g_bounds[1], g))]
        return float(stationarity), max(float(part.max(initial=0.0)) for part in beyond)
