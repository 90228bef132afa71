"""Closing: the one solver of closed loops, at joint coordinates or poses of the tool, from many
guesses at a time.

    [Phi; J] w = -[phi; x - y],    q <- q + N s w          s = min(1, longest / largest of |w|)

Newton's steps are compiled where closure and what is asked (`asked`) determine the motion: an
elimination in the order of the block triangular form (`equations.chart`), without independent
rates, the products of whose pivots are the determinants whose signs tell modes apart (`modes`).
Elsewhere they are the shortest ones of least squares. Either way each guess goes on until it is
closed, on its own: what comes of it does not depend on the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, prod
from typing import Any, NamedTuple, TypeVar

import casadi as ca
import numpy as np

from linkwork.equations import Equations
from linkwork.equations.algebra import SX
from linkwork.equations.chart import Chart
from linkwork.equations.elimination import solve
from linkwork.equations.reference import CLOSED, unit
from linkwork.equations.tree import Tree
from linkwork.kernels import Kernel
from linkwork.kernels.bound import BoundFunction
from linkwork.model.asked import Asked
from linkwork.model.charts import CompiledChart
from linkwork.model.modes import ModeStages

CONTRACTS = 0.3  # part of the last of Newton's steps that the next one may have
LONGEST = 0.5  # Newton's step, in the mechanism's own units
MET = 1e-6
"""Distance from a solution, in the same units, from which Newton's method is sure to reach it."""
SETTLING = 12  # of Newton's steps that bring dependent coordinates from nearby
CONDITIONS = 3  # residual, length of the step, alignment; then the determinants
DAMPING = 1e-12  # of the normal equations, relative to their trace
CROWDED = 0.9  # part of the guesses that have to go on, or those that do are gathered
MATRICES = ("Phi", "derivatives", "J_coordinates", "J_actuated", "J_tool")

Step = Callable[..., tuple[Any, ...]]
Read = TypeVar("Read")


class Closed(NamedTuple):
    """Hold where Newton's method has led.

    q: configurations (K, nq), the guess's own where they are not met
    met: which are closed at what is asked (K)
    begun, told: what else was said of each before its first step, and before its last one (K, ...)
    """

    q: np.ndarray
    met: np.ndarray
    begun: list[np.ndarray]
    told: list[np.ndarray]


def closed(
    step: Step,
    q: np.ndarray,
    given: Sequence[np.ndarray],
    rounds: int,
    enough: float = CLOSED,
    contracting: bool = True,
) -> Closed:
    """Take Newton's steps from guesses until loops are closed and what is asked is met, each guess
    on its own.

    Args:
        step: of q (K, nq) and what is given; returns q after it, the largest residual before it (K)
            and its length (K) or None, in the mechanism's own units, and what else is to be told of
            each (K, ...).
        q: guesses (K, nq).
        given: what is asked, and parameters: (K, ...), or one of each for all guesses.
        rounds: most steps to take.
        enough: residual from which one step more, which may not be long, is the last.
        contracting: give up where a step is longer than a part of the one before it, or the first
            one long.
    """
    if len(q) == 1:
        return closed_alone(step, q, given, rounds, enough, contracting)
    found, met = q.copy(), np.zeros(len(q), bool)
    begun, told = list[np.ndarray](), list[np.ndarray]()
    index, going = np.arange(len(q)), np.ones(len(q), bool)
    longest, ones = np.full(len(q), LONGEST), np.ones(q.shape[1])
    for _ in range(rounds):
        q, residual, length, *others = step(q, *given)
        begun = begun or others
        told = told or [np.zeros(part.shape) for part in others]
        # The largest of some numbers, as residuals and lengths are, passes over those that are
        # none.
        going &= np.isfinite(q @ ones)
        near = residual <= enough
        if contracting:
            going &= length <= np.where(near, MET, longest)
            longest = CONTRACTS * length
        elif length is not None:
            near &= length <= MET
        # What is closed keeps this step, the last one.
        done = going & near
        if np.count_nonzero(done):
            for kept, part in ((found, q), *zip(told, others, strict=True)):
                kept[index[done]] = part[done]
            met[index[done]] = True
            going ^= done
        count = np.count_nonzero(going)
        if not count:
            break
        # Those that go on are gathered where they have become few.
        if count < CROWDED * len(going):
            q, index, longest = q[going], index[going], longest[going]
            given = [part[going] if part.ndim == 2 else part for part in given]
            going = np.ones(count, bool)
    return Closed(found, met, begun, told)


def closed_alone(
    step: Step,
    q: np.ndarray,
    given: Sequence[np.ndarray],
    rounds: int,
    enough: float,
    contracting: bool,
) -> Closed:
    """Return the same as `closed` for one guess (1, nq), the shortest way."""
    guess, longest, begun, others = q, LONGEST, list[np.ndarray](), list[np.ndarray]()
    for _ in range(rounds):
        q, residual, length, *others = step(q, *given)
        begun, near = begun or others, residual.item() <= enough
        size = 0.0 if length is None else length.item()
        if not isfinite(q[0] @ q[0]) or (contracting and not size <= (MET if near else longest)):
            break
        if near and size <= MET:
            return Closed(q, np.ones(1, bool), begun, others)
        longest = CONTRACTS * size
    return Closed(guess, np.zeros(1, bool), begun, others)


def of_any_length(kernel: Kernel) -> Step:
    """Return the steps of a kernel: (q, ...) -> q after one, the residual before it. How long they
    are is not told, for none is too long."""

    def step(q: np.ndarray, *given: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
        after, residual = kernel(q, *given)
        return after, residual[:, 0], None

    return step


def settled(
    kernel: Kernel, q: np.ndarray, p: np.ndarray, enough: float = CLOSED, rounds: int = SETTLING
) -> tuple[np.ndarray, np.ndarray]:
    """Return q (..., nq) as nearly closed as Newton's steps of the dependent coordinates bring it,
    and the gap (...).

    Args:
        kernel: `closure_step` of the chart whose independent coordinates stay.
        q, p: configurations and free parameters (..., np).
        enough: largest |phi|, in own units, from which no step is taken.
        rounds: most steps to take.
    """
    if q.ndim == 1:
        q, gap = settled_one(kernel, q, p, enough, rounds)
        return q, np.array(gap)
    best, least, ones = q, np.full(q.shape[:-1], np.inf), np.ones(q.shape[-1])
    for _ in range(rounds):
        after, gap = kernel(q, p)
        nearer = (gap[..., 0] < least) & np.isfinite(q @ ones)
        best, least = np.where(nearer[..., None], q, best), np.where(nearer, gap[..., 0], least)
        going = nearer & (least > enough)
        if not going.any():
            break
        q = np.where(going[..., None], after, q)
    return best, least


def settled_one(
    kernel: Kernel | BoundFunction, q: np.ndarray, p: np.ndarray, enough: float, rounds: int
) -> tuple[np.ndarray, float]:
    """Return what `settled` does of one configuration q (nq)."""
    q, gap, _ = settled_alone(
        lambda q: ((out := kernel.flat(q, p)).item(-1), out),
        lambda _, out: out[:-1],
        q,
        enough,
        rounds,
    )
    return q, gap


def settled_alone(
    read: Callable[[np.ndarray], tuple[float, Read]],
    move: Callable[[np.ndarray, Read], np.ndarray],
    q: np.ndarray,
    enough: float,
    rounds: int,
) -> tuple[np.ndarray, float, Read]:
    """Return the q (nq) of least gap to which steps lead that each bring it nearer, the gap, and
    what else is read there; read: q -> both; move: q and that -> q after a step."""
    least, told = read(q)
    least = least if isfinite(q @ q) else inf
    for _ in range(rounds - 1):
        if least <= enough:
            break
        after = move(q, told)
        gap, found = read(after)
        if not (gap < least and isfinite(after @ after)):
            break
        q, least, told = after, gap, found
    return q, least, told


@dataclass(frozen=True, eq=False)
class Approach:
    """Take compiled steps towards what is asked.

    kernel: of `step`; sizes: of the determinants, with their signs; p: free parameters (np)
    """

    kernel: Kernel
    sizes: np.ndarray
    p: np.ndarray

    def step(self, q: np.ndarray, y: np.ndarray, p: np.ndarray | None = None) -> tuple[Any, ...]:
        """Return q (K, nq) after a step, and of before it the largest residual (K), the step's
        length (K), the alignment (K), and the determinants relative to their sizes (K, stages).

        p: free parameters, or those of each (K, np); the robot's own if left out
        """
        p = self.p if p is None else p
        if len(q) == 1:  # one state takes the shortest way
            out, nq = self.kernel.flat(q[0], y.reshape(-1), p.reshape(-1)), q.shape[1]
            after, found = out[None, :nq], out[None, nq:]
            return after, out[nq], out[nq + 1], found[:, 2], found[:, CONDITIONS:] / self.sizes
        after, found = self.kernel(q, y, p)
        return after, found[:, 0], found[:, 1], found[:, 2], found[:, CONDITIONS:] / self.sizes


@dataclass(frozen=True, eq=False)
class Least:
    """Take the shortest steps of least squares towards what is asked.

    kernel: of `functions.assembly`, with the robot's own numbers
    units: the mechanism's own of the closure rows; modes: whose determinants are told
    """

    kernel: Kernel
    tree: Tree
    units: np.ndarray
    asked: Asked
    modes: ModeStages

    def step(self, q: np.ndarray, y: np.ndarray, *p: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the same as `Approach.step`."""
        out = self.outputs(q, *p)
        residual = np.concatenate([out["phi"], self.asked.error(out, y)], axis=1) / self.heights
        A = self.matrix(out)
        s = least_step(A * self.factors, residual)
        length = np.abs(s).max(axis=1, initial=0.0)
        w = self.tree.rate_units * s * (LONGEST / np.maximum(length, LONGEST))[:, None]
        after = unit(self.tree, q + (out["derivatives"] @ w[..., None])[..., 0])
        largest = np.abs(residual).max(axis=1, initial=0.0)
        if "excess" in out:
            largest = np.maximum(largest, out["excess"][:, 0])
        return after, largest, length, out["alignment"][:, 0], self.modes.parts(A)

    def system(self, q: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return residual, Jacobian and derivatives of one q (nq) in the mechanism's own units, as
        `reference.close` asks."""
        out = self.outputs(q[None])
        residual = np.append(out["phi"][0], self.asked.error(out, y[None])[0]) / self.heights
        A = self.matrix(out)[0] * self.factors
        return residual, A, out["derivatives"][0] * self.tree.rate_units

    def outputs(self, q: np.ndarray, *p: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs of `functions.assembly` at rest for configurations (K, nq), by name;
        matrices as such."""
        return self.moving(q, self.still, *p)

    def moving(self, q: np.ndarray, w: np.ndarray, *p: np.ndarray) -> dict[str, np.ndarray]:
        """Return the same at rates w (nv), or (K, nv)."""
        if len(q) == 1:  # one state takes the shortest way
            values = [value.reshape(1, -1) for value in self.kernel(q[0], w.reshape(-1), *p)]
        else:
            values = self.kernel(q, w, *p)
        count, nv = len(q), self.still.size
        return {
            name: value.reshape(count, nv, size // max(nv, 1)).swapaxes(1, 2)
            if name in MATRICES
            else value
            for (name, size), value in zip(self.kernel.outputs, values, strict=True)
        }

    def matrix(self, out: dict[str, np.ndarray]) -> np.ndarray:
        """Return [Phi; J] (K, rows, nv)."""
        return np.concatenate([out["Phi"], self.asked.jacobian(out)], axis=1)

    @cached_property
    def still(self) -> np.ndarray:
        """Rates w (nv) at rest."""
        return np.zeros(len(self.tree.rates))

    @cached_property
    def heights(self) -> np.ndarray:
        """The mechanism's own units of the closure rows and of what is asked (rows)."""
        return np.concatenate([self.units, self.asked.units])

    @cached_property
    def factors(self) -> np.ndarray:
        """What brings [Phi; J] to the mechanism's own units (rows x nv)."""
        return self.tree.rate_units / self.heights[:, None]


def least_step(A: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the shortest steps s (K, nv) of least |A s + residual|."""
    turned = A.swapaxes(1, 2)
    square, right = turned @ A, turned @ residual[..., None]
    diagonal = np.einsum("kii->ki", square)
    diagonal += np.maximum(DAMPING * diagonal.sum(axis=1, keepdims=True), 1e-300)
    return -np.linalg.solve(square, right)[..., 0]


def approach(chart: CompiledChart, modes: ModeStages, asked: Asked) -> Approach | None:
    """Return compiled steps to what is asked, None where it does not determine the motion together
    with the loops."""
    order = modes.chart
    if order is None:
        return None
    stages = [frozenset(stage.rows) for stage in modes.stages]
    key = f"approach {asked.names} {order.rows} {order.blocks} {stages}"
    kernel = chart.compiled(key, lambda equations: step(equations, asked, order, stages))
    own = {frozenset(stage.rows): stage for stage in order.stages}
    orders = [(stage, own[frozenset(stage.rows)]) for stage in modes.stages]
    parities = [
        parity(stage.rows, taken.rows) * parity(stage.columns, taken.columns)
        for stage, taken in orders
    ]
    sizes = np.array([stage.size for stage in modes.stages]) * parities
    return Approach(kernel, sizes, chart.p)


def bending(tree: Tree, A: ca.SX) -> np.ndarray:
    """Tell on which rates' coordinates [Phi; J] depends (nv); in the others what is asked is
    linear, and steps of any length are exact."""
    depends = ca.which_depends(ca.vec(ca.densify(A)), tree.q, 1, False)
    found = np.ones(len(tree.rates), bool)
    for place, rate in tree.single:
        found[rate] = depends[place]
    return found


def parity(numbers: Sequence[int], other: Sequence[int]) -> float:
    """Return 1 or -1, the determinant of the permutation that brings numbers into another order."""
    places = [numbers.index(k) for k in other]
    return float(np.round(np.linalg.det(np.eye(len(places))[places])))


def step(
    equations: Equations, asked: Asked, chart: Chart, stages: list[frozenset[int]]
) -> ca.Function:
    """Return (q, y) -> q after a step; residual and length of the step in own units, alignment,
    determinants.

    Args:
        asked: what y is.
        chart: order of elimination of [Phi; J].
        stages: rows of those stages whose determinants are told.
    """
    tree, rows = equations.tree, equations.rows
    J, y, error = asked.expressed(equations)
    residual, A = ca.vertcat(rows.phi, error), ca.vertcat(rows.Phi, J)
    found, pivots = solve(chart, A, -residual)
    w = ca.vertcat(*[found[k] for k in range(equations.nv)])
    length = ca.mmax(ca.fabs(w * ca.DM(np.where(bending(tree, A), 1 / tree.rate_units, 0.0))))
    q = tree.q + ca.mtimes(tree.derivative_map, w * (1 / ca.fmax(1, length / LONGEST)))
    for places, _ in tree.quaternions:
        q[list(places)] /= ca.norm_2(q[list(places)])
    heights = np.concatenate([rows.units, asked.units])
    left, told = iter(pivots), []
    for stage in chart.stages:
        determinant = prod([next(left) for _ in stage.blocks], start=SX(1))
        told += [determinant] if frozenset(stage.rows) in stages else []
    largest = ca.mmax(ca.fabs(ca.vertcat(residual * ca.DM(1 / heights), rows.excess)))
    conditions = ca.vertcat(largest, length, rows.alignment, *told)
    inputs = [tree.q, y, equations.p]
    return ca.Function("approach", inputs, [ca.densify(q), ca.densify(conditions)], {"cse": True})
