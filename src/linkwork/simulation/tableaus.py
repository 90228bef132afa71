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
(dense output), sec. II.10 (DOP853, its numbers from SciPy), and table II.1.2 (Kutta's method of
order 4); Bogacki & Shampine, Appl. Math. Lett. 2 (1989) 321-325. Symplectic Euler: Hairer, Lubich &
Wanner, Geometric Numerical Integration, 2nd ed. (2006), sec. I.1.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, cached_property
from typing import ClassVar

import numpy as np
from numpy.polynomial import polynomial

from linkwork.errors import LinkworkError

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


@dataclass(frozen=True)
class FixedStep:
    """Take steps of one length, for real time.

    `step`: s; steps end at its multiples, and also where the forces jump, a sampled controller
    acts, or the run ends. `name`, `order`, `plan`: as of a `Tableau`.  Raises `LinkworkError` for a
    step that is not positive and finite.
    """

    step: float
    name: ClassVar[str]
    order: ClassVar[int]
    plan: ClassVar[StepPlan]
    stiff: ClassVar[bool] = False
    in_lanes: ClassVar[bool] = False
    stability: ClassVar[float] = 0.0

    def __post_init__(self):
        if not 0 < self.step < np.inf:
            raise LinkworkError(
                f"the step of a method of fixed step must be positive and finite, not {self.step} s"
            )


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
    a = [_fractions(row, len(rows)) for row in rows]
    b = a[-1]
    e = [high - low for high, low in zip(b, _fractions(lower, len(rows)), strict=True)]
    d = _fractions(quartic, len(rows))
    a, c, e, dense = (frozen(x) for x in (a, [sum(row) for row in a], e, _hermite(b, d)))
    return Tableau(name, order, error_order, a, c, e, dense)


def _hermite(b: list[Fraction], d: list[Fraction]) -> list[list[Fraction]]:
    """Return P of Hermite's cubic with the quartic term d, of a method whose last stage is
    evaluated at the new state."""
    first = [Fraction(i == 0) for i in range(len(b))]
    return [
        [start, 3 * b_i - 2 * start - end + d_i, start + end - 2 * b_i - 2 * d_i, d_i]
        for b_i, d_i, start, end in zip(b, d, first, first[::-1], strict=True)
    ]


def _fractions(text: str, length: int) -> list[Fraction]:
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


@cache
def dop853() -> Tableau:
    """Return the pair 8(5,3) of Dormand & Prince, with dense output of order 7."""
    from scipy.integrate._ivp import dop853_coefficients as printed

    s = printed.N_STAGES + 1
    a = np.vstack([printed.A[: s - 1, :s], np.append(printed.B, 0)])
    a, c, e, dense = map(frozen, (a, printed.C[:s], printed.E5, _dop853_dense(printed)))
    more = frozen(printed.A[s:]), frozen(printed.C[s:])
    return Tableau("DOP853", 8, 7, a, c, e, dense, 100.0, frozen(printed.E3), *more)


def _dop853_dense(printed) -> np.ndarray:
    """Return P of  theta (F_0 + (1 - theta) (F_1 + theta (F_2 + (1 - theta) (F_3 + ... + theta
    F_6)))),  F = sum_i F_i k_i.

    F_0 = b, F_1 = delta_1 - b, F_2 = 2 b - delta_1 - delta_s, and the tabulated D
    (Hairer's CONTD8).
    """
    b, first, last = np.zeros((3, printed.N_STAGES_EXTENDED))
    b[: printed.N_STAGES], first[0], last[printed.N_STAGES] = printed.B, 1, 1
    F = [b, first - b, 2 * b - first - last, *printed.D]
    factors = [[0, 1], [1, -1]]  # theta, 1 - theta
    dense = np.zeros((printed.N_STAGES_EXTENDED, len(F)))
    product = np.array([1.0])
    for j, row in enumerate(F):
        product = polynomial.polymul(product, factors[j % 2])
        dense[:, : len(product) - 1] += np.outer(row, product[1:])
    return dense


_KUTTA_ROWS = [_fractions(row, 5) for row in ("", "1/2", "0 1/2", "0 0 1", "1/6 1/3 1/3 1/6")]
_KUTTA = StepPlan(
    a=frozen(_KUTTA_ROWS),
    c=frozen([sum(row) for row in _KUTTA_ROWS]),
    e=frozen(np.empty((0, 5))),
    dense=by_powers(_hermite(_KUTTA_ROWS[-1], _fractions("", 5))),
    solution=4,
    computed=4,
    exponent=0.0,
)
_EULER = StepPlan(
    a=frozen([[0, 0], [1, 0]]),
    c=frozen([0, 0]),
    e=frozen(np.empty((0, 2))),
    dense=by_powers([[1], [0]]),
    solution=1,
    computed=2,
    exponent=0.0,
)


class RK4(FixedStep):
    """Take steps of one length by Kutta's method of order 4: four evaluations each.

    Dense output: Hermite's cubic. step: s, as in `FixedStep`.
    """

    name = "Runge-Kutta 4"
    order = 4
    plan = _KUTTA


class SymplecticEuler(FixedStep):
    """Take steps of one length by the semi-implicit Euler method: the rates first, then q with the
    new rates.

        v_1 = v_0 + h v'(q_0, v_0),    q_1 = q_0 + h L(q_0) v_1

    Two evaluations a step, of order 1; its energy does not drift where M is constant. Extra states
    are stepped with the rates. Dense output: straight lines. step: s, as in `FixedStep`.
    """

    name = "symplectic Euler"
    order = 1
    plan = _EULER
