"""A Rosenbrock method as data, for stiff systems.

One step of size h from y(t), with J = df/dy and f_t = (df/du) u'(t) at its start, one LU
decomposition and s solutions:

    (1 / gamma - h J) k_i = f(t + c_i h, y + h sum_(j<i) a_ij k_j) + sum_(j<i) C_ij k_j + h d_i f_t,
    i = 1 .. s,
    y(t + h) = y + h sum_i m_i k_i,      error estimate  = h k_s,
    dense output  y(t + theta h) = (1 - theta) y(t) + theta y(t + h)
                                 + theta (1 - theta) h sum_i (H_1i + theta (H_2i + theta H_3i)) k_i.

This is Hairer & Wanner, Solving Ordinary Differential Equations II, 2nd ed. (1996), eq. (IV.7.25),
with u_i = h k_i.

Rodas5P: order 5 with an error estimate of order 4, dense output of order 4, stiffly accurate and
L-stable; Steinebach, BIT Numerical Mathematics 63 (2023) 27, table 3, in the form of eq. (IV.7.25).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from linkwork.simulation.tableaus import StepPlan, by_powers, filled, frozen

BLUR = 25.0  # as of a `StepPlan`


@dataclass(frozen=True, eq=False)
class Rosenbrock:
    """Hold a stiffly accurate Rosenbrock method of s stages, whose last stage is the error
    estimate.

    `name`, `order`, `error_order` as in `Tableau`; `gamma`; `a` (s, s), `C` (s, s): strictly lower
    triangular; `c` (s,), `d` (s,); `m` (s,): weights of the new state; `H` (3, s): of the dense
    output.
    """

    name: str
    order: int
    error_order: int
    gamma: float
    a: np.ndarray
    C: np.ndarray
    c: np.ndarray
    d: np.ndarray
    m: np.ndarray
    H: np.ndarray
    step: ClassVar[None] = None
    stiff: ClassVar[bool] = True
    in_lanes: ClassVar[bool] = False
    stability: ClassVar[float] = 0.0

    @cached_property
    def dense(self) -> np.ndarray:
        """P (s, 4), such that y(t + theta h) = y + h sum_i k_i sum_m P_im theta^(m+1)."""
        first, second, third = self.H
        return np.stack([self.m + first, second - first, third - second, -third], axis=1)

    @cached_property
    def plan(self) -> StepPlan:
        """The method as the compiled loops take it: the slopes at both ends are the first row of k
        and the last.

        Rows i of a and of e hold the weights a_ij and C_ij of stage i in columns j = 1 .. s, and
        row s + 1 of a the weights m; the last column of e holds gamma, d_1, ..., d_s.
        """
        s = len(self.c)
        a = np.zeros((s + 2, s + 2))
        e = np.zeros((s + 2, s + 2))
        dense = np.zeros((s + 2, self.dense.shape[1]))
        a[1:-1, 1:-1], a[-1, 1:-1] = self.a, self.m
        e[1:-1, 1:-1], e[1:-1, -1], e[0, -1] = self.C, self.d, self.gamma
        dense[1:-1] = self.dense
        c = np.concatenate([[0], self.c, [1]])
        return StepPlan(
            frozen(a),
            frozen(c),
            frozen(e),
            by_powers(dense),
            s + 1,
            s + 2,
            1 / (self.error_order + 1),
            BLUR,
        )


def _rows(*rows: list[float]) -> np.ndarray:
    return filled(rows, len(rows))


_LAST = [
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
]
RODAS = Rosenbrock(
    "Rodas5P",
    order=5,
    error_order=4,
    gamma=0.21193756319429014,
    a=_rows(
        [],
        [3.0],
        [2.849394379747939, 0.45842242204463923],
        [-6.954028509809101, 2.489845061869568, -10.358996098473584],
        [2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641],
        _LAST,
        [*_LAST, 1.0],
        [*_LAST, 1.0, 1.0],
    ),
    C=_rows(
        [],
        [-14.155112264123755],
        [-17.97296035885952, -2.859693295451294],
        [147.12150275711716, -1.41221402718213, 71.68940251302358],
        [165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306],
        [
            24.854864614690072,
            -3.0009227002832186,
            47.4931110020768,
            5.5814197821558125,
            -0.6610691825249471,
        ],
        [
            *(30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783),
            *(-19.097331116725623, -28.087943162872662),
        ],
        [
            *(37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047),
            *(-40.06618937091002, -54.66780262877968, -9.48861652309627),
        ],
    ),
    c=np.array(
        [0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1, 1, 1]
    ),
    d=np.array(
        [
            0.21193756319429014,
            -0.42387512638858027,
            -0.3384627126235924,
            1.8046452872882734,
            2.325825639765069,
            0,
            0,
            0,
        ]
    ),
    m=np.array([*_LAST, 1.0, 1.0, 1.0]),
    H=np.array(
        [
            [
                *(25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204),
                *(0.524948541321073, 1.1241088310450404, 0.4272876194431874, -0.17202221070155493),
            ],
            [
                *(-9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796),
                *(20.176138334709044, 15.98066361424651, -6.789040303419874, -6.710236069923372),
            ],
            [
                *(11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643),
                *(-52.072871366152654, -59.78993625266729, -0.15582684282751913, 4.883087185713722),
            ],
        ]
    ),
)
