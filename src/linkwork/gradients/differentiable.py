"""Values in (q, v, given, p) with their derivatives along steps and their gradients, and the three
functions that are made of each: Jacobian, derivative along a step (jvp), gradient (vjp).

    jacobian   (q, v, [given,] p)  ->  value, by_q, by_v, [by_given,] by_p, pivot
    jvp        (q, v, [given,] step_q, step_v, [step_given,] step_p, p)  ->  value, moved, pivot
    vjp        (q, v, [given,] weights, p)  ->  value, by_q, by_v, [by_given,] by_p, pivot

q are the tree's coordinates; steps and gradients with respect to q are in the tangent coordinates
of the independent rates (`tangent`). The pivot is the weakest relative one.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import casadi as ca

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.gradients.tangent import Shift, Tangent


class Slopes(NamedTuple):
    """Hold steps, derivatives or gradients with respect to (q, v, p), and to what is given beside
    these."""

    by: Shift
    given: ca.SX


class Differentiable(Protocol):
    """Give a value (rows), and its derivatives.

    given: symbols of what it depends on beside (q, v, p), none where there is nothing
    rows: how many numbers its derivative has
    """

    equations: Equations
    given: ca.SX
    value: ca.SX
    rows: int

    def forward(self, step: Slopes) -> ca.SX:
        """Return the derivatives (rows x k) along steps (each x k)."""
        ...

    def backward(self, weights: ca.SX) -> Slopes:
        """Return the gradients (each x k) of weights (rows x k) times the value."""
        ...


class Throughout:
    """A value in the tree's q and rates w, in v, in p and in what is given, differentiated as it
    stands.

    left: (rows x values) what its derivative is multiplied by; the unit matrix if left out
    """

    def __init__(
        self, tangent: Tangent, value: ca.SX, given: ca.SX | None = None, left: ca.SX | None = None
    ):
        self.tangent, self._value, self._left = tangent, ca.densify(value), left
        self.equations = tangent.equations
        self.given = SX(0, 1) if given is None else given
        [self.value] = tangent.at_rates([value])
        self.rows = self._value.numel() if left is None else left.shape[0]

    def forward(self, step: Slopes) -> ca.SX:
        found = self.tangent.forward(self._value, step.by)
        found += ca.mtimes(ca.jacobian(self._value, self.given), step.given)
        if self._left is not None:
            found = ca.mtimes(self._left, found)
        return self.tangent.at_rates([found])[0]

    def backward(self, weights: ca.SX) -> Slopes:
        weights = weights if self._left is None else ca.mtimes(self._left.T, weights)
        given = ca.mtimes(ca.jacobian(self._value, self.given).T, weights)
        *by, given = self.tangent.at_rates([*self.tangent.backward(self._value, weights), given])
        return Slopes(Shift(*by), given)


def jacobian(name: str, of: Differentiable) -> ca.Function:
    """Return the function of a value and its Jacobian: along all steps, or of all rows, whichever
    are fewer."""
    count, given = of.equations.p.numel(), of.given.numel()
    n = of.equations.mobility
    if of.rows <= 2 * n + given + count:
        by, along = of.backward(SX.eye(of.rows))
        found = Slopes(Shift(*(part.T for part in by)), along.T)
    else:
        places = [0, n, 2 * n, 2 * n + count, 2 * n + count + given]
        q, v, p, own = ca.vertsplit(SX.eye(places[-1]), places)
        moved = of.forward(Slopes(Shift(q, v, p), own))
        q, v, p, own = ca.horzsplit(moved, places)
        found = Slopes(Shift(q, v, p), own)
    return made(name, of, slopes(of, found))


def jvp(name: str, of: Differentiable) -> ca.Function:
    """Return the function of a value and its derivative along a step."""
    n = of.equations.mobility
    sizes = {"q": n, "v": n, "given": of.given.numel(), "p": of.equations.p.numel()}
    steps = {key: SX.sym(f"step_{key}", size) for key, size in sizes.items()}
    moved = of.forward(Slopes(Shift(steps["q"], steps["v"], steps["p"]), steps["given"]))
    if not of.given.numel():
        del steps["given"]
    return made(name, of, {"moved": moved}, **{f"step_{key}": step for key, step in steps.items()})


def vjp(name: str, of: Differentiable) -> ca.Function:
    """Return the function of a value and the gradient of weights times it."""
    weights = SX.sym("weights", of.rows)
    return made(name, of, slopes(of, of.backward(weights)), weights=weights)


def slopes(of: Differentiable, found: Slopes) -> dict[str, ca.SX]:
    """Return derivatives by the names of outputs."""
    given = {"by_given": found.given} if of.given.numel() else {}
    return {"by_q": found.by.q, "by_v": found.by.v} | given | {"by_p": found.by.p}


def made(name: str, of: Differentiable, outputs: dict[str, ca.SX], **inputs: ca.SX) -> ca.Function:
    """Return the function of what a value depends on and of further inputs."""
    equations = of.equations
    given = {"given": of.given} if of.given.numel() else {}
    every = {"value": of.value} | outputs | {"pivot": equations.elimination.pivot}
    return functions.function(name, equations, every, v=equations.v, **given, **inputs)
