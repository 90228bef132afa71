"""Embedded Runge-Kutta pairs as data.

One step of size h from y(t), with s stages and the last stage evaluated at the new state (FSAL, first same as last):

    k_i = f(t + c_i h, y + h sum_j a_ij k_j),   i = 1 .. s,     y(t + h) = y + h sum_j a_sj k_j,
    error estimate  = h sum_i e_i k_i,
    dense output    y(t + theta h) = y + h sum_i b_i(theta) k_i,    b_i(theta) = sum_m P_im theta^(m+1).

The dense output is Hermite's cubic through both ends and both slopes, with the quartic term d_i that raises its order:

    b_i(theta) = theta b_i + theta (1 - theta) (delta_1i - b_i) + theta^2 (1 - theta) (2 b_i - delta_1i - delta_si)
               + theta^2 (1 - theta)^2 d_i.

Sources: Dormand & Prince, J. Comp. Appl. Math. 6 (1980) 19-26, and Hairer, Norsett & Wanner, Solving Ordinary Differential
Equations I, 2nd ed. (1993), table II.5.2 and sec. II.6 (dense output); Bogacki & Shampine, Appl. Math. Lett. 2 (1989) 321-325.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np


@dataclass(frozen=True, eq=False)
class Tableau:
    """Hold an explicit embedded pair whose last stage is the first of the next step.

    `name`: for people; `order`: of the solution that is carried on; `error_order`: of the one it is compared with;
    `a` (s, s): strictly lower triangular, its last row the weights b; `c` (s,): stage times; `e` (s,): error weights;
    `dense` (s, 4): P, the dense output's polynomials in theta, theta^2, theta^3, theta^4.
    """

    name: str
    order: int
    error_order: int
    a: np.ndarray
    c: np.ndarray
    e: np.ndarray
    dense: np.ndarray


def _tableau(name: str, order: int, error_order: int, rows: list[str], lower: str, quartic: str) -> Tableau:
    """Build a tableau from its printed fractions: the rows of a, the weights of the lower order, the dense output's d."""
    a = [_fractions(row, len(rows)) for row in rows]
    b = a[-1]
    e = [high - low for high, low in zip(b, _fractions(lower, len(rows)), strict=True)]
    d = _fractions(quartic, len(rows))
    first = [Fraction(i == 0) for i in range(len(b))]
    last = first[::-1]
    dense = [
        [start, 3 * b_i - 2 * start - end + d_i, start + end - 2 * b_i - 2 * d_i, d_i]
        for b_i, d_i, start, end in zip(b, d, first, last, strict=True)
    ]
    return Tableau(name, order, error_order, *(_frozen(x) for x in (a, [sum(row) for row in a], e, dense)))


def _fractions(text: str, length: int) -> list[Fraction]:
    printed = [Fraction(word) for word in text.split()]
    return printed + [Fraction(0)] * (length - len(printed))


def _frozen(values: list) -> np.ndarray:
    array = np.array(values, dtype=float)
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
