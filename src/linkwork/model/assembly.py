"""Assembly: find one closed configuration from a rough guess, and the rates that lead a tool along
a path.

Unknowns are the tree's coordinates q. Gauss-Newton steps of least length in the rates solve  phi(q)
= 0  together with what is asked (`asked`), shortened until they lead nearer
(`equations.reference`). Along a path, the tree's rates w and accelerations follow from the same
rows:

    [Phi; J] w = [0; x'],    [Phi; J] w' = [-gamma; x'' - J' w].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linkwork.equations.reference import OpenLoopsError, close, unit
from linkwork.equations.tree import Tree
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.model.asked import Asked, ToolAsked
from linkwork.model.closing import MATRICES, Least

LEG_SINGULAR = 1e-9
FAR, TURNS = 100.0, 4 * np.pi  # own lengths and angles from which on a unit may be another
TOOL = ("position", "orientation", "angle", "J_tool", "bias_tool")
EPS = np.finfo(float).eps


class UnreachableError(LinkworkError):
    """Refuse a pose or joint coordinates at which the loops cannot be closed."""


def evaluate(kernel: Kernel, q: np.ndarray, rates: np.ndarray) -> dict[str, np.ndarray]:
    """Return the outputs of `functions.assembly` by name for one configuration q (nq) and rates w
    (nv); matrices as such."""
    named, rows = zip(kernel.outputs, kernel(q, rates), strict=True), (len(rates), -1)
    return {
        name: value.reshape(rows).T if name in MATRICES else value for (name, _), value in named
    }


@dataclass(frozen=True)
class Assembler:
    """Solve for configurations of one mechanism with one tool.

    evaluate: maps (q, w) to the outputs of `functions.assembly` by name
    rows, unheld: names of the closure rows, and of those that are not held; units: of the closure
        rows; planar: whether poses are (x, y, angle)
    """

    evaluate: Callable[[np.ndarray, np.ndarray], dict[str, np.ndarray]]
    tree: Tree
    rows: tuple[str, ...]
    unheld: tuple[str, ...]
    units: np.ndarray
    planar: bool

    def at(self, least: Least, y: np.ndarray, guess: np.ndarray) -> np.ndarray:
        """Return q (nq) at what is asked (rows), from a guess of q."""
        try:
            q = close(lambda q: least.system(q, y), self.tree, guess)
        except OpenLoopsError as error:
            names = (*self.rows, *least.asked.names)
            element, _, what = names[error.worst].partition(": ")
            raise UnreachableError(
                f"the mechanism cannot be assembled {least.asked.said(y)} from this guess: "
                f"{element} ({what}) stays off by {error.gap * least.heights[error.worst]:.3g}; "
                + remedy(least.asked, y)
            ) from None
        # Closed, but not as described: rows left open, frames the wrong way round.
        out = self.still(q)
        if out.get("excess", 0.0) > 0:
            raise UnreachableError(
                f"the mechanism closes {least.asked.said(y)} only in the rows that are held, and "
                f"not in {', '.join(self.unheld)}, which rounded numbers leave open; start from "
                "a nearer guess, or give the numbers of its frames in full"
            )
        if out["alignment"][0] < 0:
            raise UnreachableError(
                f"the mechanism closes {least.asked.said(y)} only with a joint's frames facing "
                "opposite ways; start from a nearer guess"
            )
        return q

    def rates(
        self, q: np.ndarray, asked: ToolAsked, y: np.ndarray, dy: np.ndarray, ddy: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return w, w' for held values (k) and their first and second time derivatives.

        Where more rows or fewer than rates hold these are of least squares and least length, in the
        mechanism's own units.
        """
        if asked.rotation:
            turn, dy, ddy = asked.rotation, np.array(dy), np.array(ddy)
            dy[turn], ddy[turn] = turning(y[turn], dy[turn], ddy[turn])
        out = self.still(q)
        J, widths = asked.jacobian(stacked(out))[0], self.tree.rate_units
        asked.require_defined(J)
        heights = np.concatenate([self.units, asked.units])
        A = np.concatenate([out["Phi"], J]) * (widths / heights[:, None])
        U, values, V = np.linalg.svd(A, full_matrices=False)
        refuse_leg_singular(A.shape, values, asked)
        inverse = np.divide(
            1.0, values, out=np.zeros_like(values), where=values > max(A.shape) * EPS * values[0]
        )

        def least(right: np.ndarray) -> np.ndarray:
            return widths * (V.T @ (inverse * (U.T @ (right / heights))))

        w = least(np.concatenate([0 * out["phi"], dy]))
        out = self.evaluate(q, w)
        bias = asked.bias(stacked(out), w)[0]
        return w, least(np.concatenate([-out["gamma"], ddy - bias]))

    def still(self, q: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs of `evaluate` at rest."""
        return self.evaluate(q, np.zeros(len(self.tree.rates)))

    def moved(self, q: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return q after a step of the tree's rates times a time, its quaternions at length 1."""
        return unit(self.tree, q + self.still(q)["derivatives"] @ step) if step.any() else q


def remedy(asked: Asked, y: np.ndarray) -> str:
    """Return what would be right where values (rows) are not met: other units, where these can
    hardly be metres and radians."""
    own = np.abs(y) / asked.units
    for k in np.flatnonzero(asked.lengths & (own > FAR))[:1]:
        return (
            f"{y[k]:g} m is {own[k]:.3g} times the mechanism's own length of {asked.units[k]:.3g} "
            "m; is it in millimetres? give metres"
        )
    for k in np.flatnonzero(~asked.lengths & (own > TURNS))[:1]:
        return f"{y[k]:g} rad is {own[k] / (2 * np.pi):.3g} turns; is it in degrees? give radians"
    return "choose a pose within reach or a nearer guess"


def stacked(out: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return what outputs of one configuration tell of the tool as those of a stack of one."""
    return {name: out[name][None] for name in TOOL}


def refuse_leg_singular(shape: tuple[int, ...], values: np.ndarray, asked: ToolAsked) -> None:
    """Refuse singular values of rows (rows x width) that do not determine the rates."""
    rows, width = shape
    if rows >= width and values[width - 1] < LEG_SINGULAR * values[0]:
        held = ", ".join(name.removeprefix("tool: ") for name in asked.names)
        raise LinkworkError(
            f"the configuration is leg-singular: the mechanism can move with the tool's {held} "
            "held still, so these do not determine the joints' motion; lead the path around it"
        )


def turning(r: np.ndarray, dr: np.ndarray, ddr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return omega = J r' and alpha = J r'' + J' r' (..., 3) for rotation vectors r and their time
    derivatives.

    J = 1 + a [r x] + b [r x]^2,  a = (1 - cos t) / t^2,  b = (t - sin t) / t^3,  t = |r|, by series
    near t = 0.
    """
    angle = np.linalg.norm(r, axis=-1, keepdims=True)
    near, s = angle < 1e-2, np.minimum(angle, 1e-2) ** 2
    t = np.where(near, 1.0, angle)
    a = np.where(near, 1 / 2 - s / 24 + s**2 / 720, (1 - np.cos(t)) / t**2)
    b = np.where(near, 1 / 6 - s / 120 + s**2 / 5040, (t - np.sin(t)) / t**3)
    # da/dt / t, db/dt / t
    a_t = np.where(near, -1 / 12 + s / 180 - s**2 / 6720, (np.sin(t) / t - 2 * a) / t**2)
    b_t = np.where(near, -1 / 60 + s / 1260 - s**2 / 60480, (a - 3 * b) / t**2)
    across, again = np.cross(r, dr), np.cross(r, ddr)
    twice = np.cross(r, across)
    change = np.sum(r * dr, axis=-1, keepdims=True) * (a_t * across + b_t * twice)
    alpha = ddr + a * again + b * (np.cross(r, again) + np.cross(dr, across)) + change
    return dr + a * across + b * twice, alpha
