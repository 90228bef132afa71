"""The pair 8(5,3) of Dormand & Prince, DOP853.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), sec.
II.10; its numbers from SciPy.
"""

from functools import cache

import numpy as np
from numpy.polynomial import polynomial

from linkwork.simulation.tableaus import Tableau, frozen


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
