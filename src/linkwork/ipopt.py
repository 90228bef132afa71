"""IPOPT, which comes with CasADi: local optima of nonlinear programmes, verified.

    min f(x)  with  lower <= x <= upper,  g_lower <= g(x) <= g_upper

A point is given back only where it keeps the constraints and fulfils the conditions of Karush,
Kuhn and Tucker, which are computed anew from its multipliers:  grad f + g_x' lambda + mu = 0.

Source: Waechter & Biegler, Mathematical Programming 106 (2006) 25-57.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf
from time import thread_time
from typing import Any

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
    the largest multiplier (at least 1), that of the constraints, and whether it is settled: what is
    not keeps the constraints and was the best when time was up."""

    x: np.ndarray
    value: float
    steps: int
    stationarity: float
    violation: float
    settled: bool = True


class BestYet(ca.Callback):
    """Keep the best point that keeps the constraints, and stop when time is up."""

    def __init__(self, programme: Programme, seconds: float) -> None:
        ca.Callback.__init__(self)
        self.programme, self.until = programme, thread_time() + seconds
        self.found: LocalOptimum | None = None
        self.steps, self.over = 0, False
        self.construct("best_yet", {})

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        sizes = {"f": 1, "x": self.programme.x.numel(), "lam_x": self.programme.x.numel()}
        sizes |= dict.fromkeys(("g", "lam_g"), self.programme.g.numel())
        return ca.Sparsity.dense(sizes.get(ca.nlpsol_out(i), 0), 1)

    def eval(self, arg: Any) -> list[int]:
        given = dict(zip(ca.nlpsol_out(), arg, strict=True))
        x, value = given["x"].full().ravel(), float(given["f"])
        violation = self.programme.violation(x, given["g"].full().ravel())
        if violation < KEPT and (self.found is None or value < self.found.value):
            stationarity = self.programme.stationarity(x, given["lam_x"], given["lam_g"])
            self.found = LocalOptimum(x, value, self.steps, stationarity, violation, False)
        self.steps, self.over = self.steps + 1, thread_time() > self.until
        return [int(self.over)]


@dataclass(frozen=True, eq=False)
class Programme:
    """Hold a nonlinear programme: symbols x, f and g of them, bounds and a start, and how much the
    barrier weighs there.

    slopes: (x, p) -> g, g_x and (x, p, weight of f, weights of g) -> the upper triangle of the
        second derivative of what they weigh; differentiated if left out
    """

    x: ca.MX
    f: ca.MX
    g: ca.MX
    start: np.ndarray
    bounds: tuple[np.ndarray, np.ndarray]
    g_bounds: tuple[np.ndarray, np.ndarray]
    barrier: float = 0.1
    slopes: tuple[ca.Function, ca.Function] | None = None

    def unmoved(self, among: int) -> np.ndarray:
        """Return which of the first unknowns move neither f nor g at the start."""
        first = ca.vertcat(self.f, self.g)
        slopes = ca.Function("slopes", [self.x], [ca.jacobian(first, self.x)[:, :among]])
        return np.flatnonzero(~slopes(self.start).full().any(axis=0))

    def solve(self, what: str, steps: int, seconds: float = inf) -> LocalOptimum:
        """Return a local optimum.

        Args:
            what: is looked for, as refusals name it; steps: most of them; seconds: from which on
                the best point so far that keeps the constraints is returned as not settled.

        Raises:
            NoOptimumError: IPOPT ends elsewhere, with its own word why; conditions that are not
                fulfilled; time that is up before the constraints were kept.
        """
        # IPOPT from the start, under the clock where there is one.
        options = {**QUIET, "ipopt.tol": TOLERANCE, "ipopt.max_iter": steps}
        options["ipopt.mu_init"] = self.barrier
        if self.slopes is not None:
            options |= dict(zip(("jac_g", "hess_lag"), self.slopes, strict=True))
            options["no_nlp_grad"] = True
        best = BestYet(self, seconds) if seconds < inf else None
        if best is not None:
            options["iteration_callback"] = best
        solver = ca.nlpsol("local", "ipopt", {"x": self.x, "f": self.f, "g": self.g}, options)
        limits = dict(zip(("lbx", "ubx"), self.bounds, strict=True))
        limits |= dict(zip(("lbg", "ubg"), self.g_bounds, strict=True))
        found, told = solver(x0=self.start, **limits), solver.stats()
        word, count = str(told["return_status"]), int(told["iter_count"])
        # Where it ends: time is up, no optimum, or one that is verified.
        if best is not None and best.over:
            if best.found is not None:
                return best.found
            raise NoOptimumError(
                f"no {what} is found in {seconds:.3g} s ({count} steps): the constraints are not "
                "kept yet"
            )
        if not told["success"]:
            raise NoOptimumError(
                f"no {what} is found: {MEANING.get(word, f'IPOPT ends with {word}')} "
                f"({count} steps)"
            )
        x = found["x"].full().ravel()
        g = found["g"].full().ravel()
        residuals = self.stationarity(x, found["lam_x"], found["lam_g"]), self.violation(x, g)
        if not (residuals[0] < STATIONARY and residuals[1] < KEPT):
            raise NoOptimumError(
                f"no {what} is found: where IPOPT ends after {count} steps its conditions stay "
                f"open by {residuals[0]:.2g} (stationarity) and {residuals[1]:.2g} (constraints)"
            )
        return LocalOptimum(x, float(found["f"]), count, *residuals)

    @cached_property
    def _slope(self) -> ca.Function:
        """(x, multipliers of g) -> grad f + g_x' lambda."""
        weights = ca.MX.sym("weights", self.g.numel())
        if self.slopes is None:
            steep = ca.jtimes(self.g, self.x, weights, True)
        else:
            steep = ca.mtimes(self.slopes[0](self.x, ca.MX(0, 1))[1].T, weights)
        slope = ca.gradient(self.f, self.x) + steep
        return ca.Function("slope", [self.x, weights], [slope])

    def stationarity(self, x: np.ndarray, of_x: ca.DM, of_g: ca.DM) -> float:
        """Return how far a point is from stationary, over the largest multiplier, or 1."""
        steep = self._slope(x, of_g).full().ravel()
        own = max(1.0, *(float(np.abs(part.full()).max(initial=0.0)) for part in (of_x, of_g)))
        return float(np.abs(steep + of_x.full().ravel()).max() / own)

    def violation(self, x: np.ndarray, g: np.ndarray) -> float:
        """Return how far a point is off its constraints."""
        beyond = [low - y for low, y in ((self.bounds[0], x), (self.g_bounds[0], g))]
        beyond += [y - high for high, y in ((self.bounds[1], x), (self.g_bounds[1], g))]
        return max(float(part.max(initial=0.0)) for part in beyond)
