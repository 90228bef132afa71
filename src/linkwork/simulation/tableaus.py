"""Runge-Kutta methods as data.

One step of size h from y(t), by an embedded pair of s stages, the last one evaluated at the new
state (FSAL, first same as last), and by up to three more stages where the dense output is asked
for:

    k_i = f(t + c_i h, y + h sum_j a_ij k_j),   i = 1 .. s,     y(t + h) = y + h sum_j a_sj k_j,
    error estimate  = h sum_i e_i k_i,
    dense output    y(t + theta h) = y + h sum_i b_i(theta) k_i,
                    b_i(theta) = sum_m P_im theta^(m+1).

The dense output of pairs without further stages is Hermite's cubic through both ends and both
slopes, with the quartic term d_i that raises its order:

    b_i(theta) = theta b_i + theta (1 - theta) (delta_1i - b_i) + theta^2 (1 - theta)
    (2 b_i - delta_1i - delta_si)
               + theta^2 (1 - theta)^2 d_i.

Sources: Dormand & Prince, J. Comp. Appl. Math. 6 (1980) 19-26, and Hairer, Norsett & Wanner,
Solving Ordinary Differential Equations I, 2nd ed. (1993), table II.5.2 and sec. II.6
(dense output); Bogacki & Shampine, Appl. Math. Lett. 2 (1989) 321-325.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, cached_property
from typing import ClassVar

import numpy as np
from numpy.polynomial import polynomial

LANES = 4  # numbers of a vector in which weights are added up


@dataclass(frozen=True, eq=False)
class StepPlan:
    """Hold a method as the compiled loops need it.

    `a` (rows, rows): stage states, a row of weights each, and row `solution`, the new state; `c`
    (rows,): stage times; `e` (estimates, rows): error weights, none for a fixed step; `dense`
    (degree, rows): the transpose of P, its rows padded to whole vectors; `computed`: how many of
    the rows a step evaluates, the others are for the dense output only; `exponent`: 1 / (order of
    the error estimate + 1), 0 for a fixed step; `blur`: how many times the tolerance the defect of
    its dense output, h |f(t + theta h, Y(theta)) - dY/dt|, may be where the motion is smooth, at
    most.
    """

    a: np.ndarray
    c: np.ndarray
    e: np.ndarray
    dense: np.ndarray
    solution: int
    computed: int
    exponent: float
    blur: float = 1.0

    @cached_property
    def table(self) -> np.ndarray:
        """The plan as the compiled loops take it, in one list: how many rows a, dense and e have,
        the solution, how many are computed, the exponent and the blur; then a, c, e and dense.
        """
        head = len(self.a), len(self.dense), len(self.e), self.solution, self.computed
        numbers = [self.a.ravel(), self.c, self.e.ravel(), self.dense.ravel()]
        return frozen(np.concatenate([[*head, self.exponent, self.blur], *numbers]))


@dataclass(frozen=True, eq=False)
class Tableau:
    """Hold an explicit embedded pair whose stage s is the first of the next step.

    stiff, in_lanes: whether a method takes stiff systems, and whether members of ensembles do it
        side by side
    name: for people
    order: of the solution that is carried on; error_order: of the one it is compared with
    a (s, s): strictly lower triangular, its last row the weights b; c (s,): stage times
    e (s,): error weights; second (s,): those of another error estimate, as of DOP853
    dense (s + more, degree): P, the dense output's polynomials in theta, theta^2, ...
    more (more, s + more), more_c: stages that the dense output needs beside the others
    blur: as of a `StepPlan`
    """

    name: str
    order: int
    error_order: int
    a: np.ndarray
    c: np.ndarray
    e: np.ndarray
    dense: np.ndarray
    blur: float = 25.0
    second: np.ndarray | None = None
    more: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    more_c: np.ndarray = field(default_factory=lambda: np.empty(0))
    step: ClassVar[None] = None
    stiff: ClassVar[bool] = False
    in_lanes: ClassVar[bool] = True

    @property
    def plan(self) -> StepPlan:
        """The method as the compiled loops take it."""
        return _pair_plan(self)

    @cached_property
    def stability(self) -> float:
        """The largest x such that |R(-z)| <= 1 up to it, with the method's function of stability
        R(z) = 1 + z b' (1 - z A)^-1 1 = 1 + sum_i b' A^(i-1) 1 z^i, a polynomial.
        """
        power, R = np.ones(len(self.c) - 1), [1.0]
        for _ in power:
            R.append(float(self.a[-1, :-1] @ power))
            power = self.a[:-1, :-1] @ power
        ends = [polynomial.polysub(R, [bound]) for bound in (1.0, -1.0)]
        roots = np.concatenate([polynomial.polyroots(np.trim_zeros(end, "b")) for end in ends])
        return float((-roots.real[(abs(roots.imag) < 1e-6) & (roots.real < -1e-3)]).min())


@cache
def _pair_plan(tableau: Tableau) -> StepPlan:
    s, rows = len(tableau.c), len(tableau.dense)
    a = np.zeros((rows, rows))
    a[:s, :s] = tableau.a
    a[s:, : tableau.more.shape[1]] = tableau.more
    estimates = [tableau.e] if tableau.second is None else [tableau.e, tableau.second]
    e = np.pad(estimates, [(0, 0), (0, rows - s)])
    c = np.concatenate([tableau.c, tableau.more_c])
    return StepPlan(
        frozen(a),
        frozen(c),
        frozen(e),
        by_powers(tableau.dense),
        s - 1,
        s,
        1 / (tableau.error_order + 1),
        tableau.blur,
    )


def _tableau(
    name: str, order: int, error_order: int, rows: list[str], lower: str, quartic: str
) -> Tableau:
    """Build a tableau from its printed fractions: the rows of a, the weights of the lower order,
    the dense output's d."""
    a = [fractions(row, len(rows)) for row in rows]
    b = a[-1]
    e = [high - low for high, low in zip(b, fractions(lower, len(rows)), strict=True)]
    d = fractions(quartic, len(rows))
    a, c, e, dense = (frozen(x) for x in (a, [sum(row) for row in a], e, hermite(b, d)))
    return Tableau(name, order, error_order, a, c, e, dense)


def hermite(b: list[Fraction], d: list[Fraction]) -> list[list[Fraction]]:
    """Return P of Hermite's cubic with the quartic term d, of a method whose last stage is
    evaluated at the new state."""
    first = [Fraction(i == 0) for i in range(len(b))]
    return [
        [start, 3 * b_i - 2 * start - end + d_i, start + end - 2 * b_i - 2 * d_i, d_i]
        for b_i, d_i, start, end in zip(b, d, first, first[::-1], strict=True)
    ]


def fractions(text: str, length: int) -> list[Fraction]:
    printed = [Fraction(word) for word in text.split()]
    return printed + [Fraction(0)] * (length - len(printed))


def filled(rows: Sequence[Sequence[float]], columns: int) -> np.ndarray:
    """Return printed rows as a table: what is missing at their ends are zeros."""
    return np.array([[*row, *[0.0] * (columns - len(row))] for row in rows])


def by_powers(dense) -> np.ndarray:
    """Return P by powers of theta, a row for each, padded to whole vectors."""
    table = np.array(dense, float).T
    return frozen(np.pad(table, [(0, 0), (0, -table.shape[1] % LANES)]))


def frozen(values) -> np.ndarray:
    array = np.array(values, dtype=float, order="C")
    array.setflags(write=False)
    return array


DORMAND_PRINCE = _tableau(
    "Dormand-Prince 5(4)",
    order=5,
    error_order=4,
    rows=[
        "",
        "1/5",
        "3/40 9/40",
        "44/45 -56/15 32/9",
        "19372/6561 -25360/2187 64448/6561 -212/729",
        "9017/3168 -355/33 46732/5247 49/176 -5103/18656",
        "35/384 0 500/1113 125/192 -2187/6784 11/84",
    ],
    lower="5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40",
    quartic="-12715105075/11282082432 0 87487479700/32700410799 -10690763975/1880347072"
    " 701980252875/199316789632 -1453857185/822651844 69997945/29380423",
)

BOGACKI_SHAMPINE = _tableau(
    "Bogacki-Shampine 3(2)",
    order=3,
    error_order=2,
    rows=["", "1/2", "0 3/4", "2/9 1/3 4/9"],
    lower="7/24 1/4 1/3 1/8",
    quartic="",
)
