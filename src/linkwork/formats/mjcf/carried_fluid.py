"""The fluid that an ellipsoid carries along, as MuJoCo sums it.

MuJoCo sums Lamb's integrals (`linkwork.equations.fluid`) by the rule of Gauss and Kronrod with 15
points on x in [0, 1], in eight digits,

    k_i = int_0^inf f_i(l) dl = sum_n w_n f_i(s l(x_n)) s l'(x_n),   l = x^3 / (1 - x)^2
    f_i(l) = a_1 a_2 a_3 / ((a_i^2 + l) sqrt(prod_j (a_j^2 + l))),   s = (a_i^2 a_1 a_2 a_3)^(2/5)

which is 6e-7 of them off for a sphere, and 4e-3 for a plate of half axes as 250 to 1.

Source: the rule is QUADPACK's (Piessens et al. 1983); the substitution and the numbers of digits
are those of MuJoCo 4's compiler of geoms.
"""

from __future__ import annotations

from math import pi

import numpy as np

from linkwork.equations.fluid import AddedMass, added
from linkwork.mechanism import EllipsoidDrag

FIRST = np.array(
    [0.00427231, 0.02544604, 0.06756779, 0.12923441, 0.20695638, 0.29707742, 0.39610752, 0.5]
)
NODES = np.concatenate((FIRST, 1 - FIRST[-2::-1]))
SOME = np.array(
    [0.01146766, 0.03154605, 0.05239501, 0.07032663, 0.08450236, 0.09517529, 0.10221647, 0.10474107]
)
WEIGHTS = np.concatenate((SOME, SOME[-2::-1]))
LAMBDA = NODES**3 / (1 - NODES) ** 2
SLOPE = NODES**2 * (3 - NODES) / (1 - NODES) ** 3
LEAST = 1e-14  # denominator [1, m^2]


def carried(radii: tuple[float, float, float]) -> AddedMass:
    """Return the mass and the inertia that MuJoCo has an ellipsoid carry along, over the density.

    radii: its half axes [m]
    """
    a = np.array(radii)
    square, volume = a**2, 4 / 3 * pi * a.prod()
    k = np.array([_integral(square, i) for i in range(3)])
    near, far = np.roll(square, -1), np.roll(square, -2)
    gap, apart = near - far, np.roll(k, -1) - np.roll(k, -2)
    below = np.maximum(LEAST, abs(2 * gap + (near + far) * apart))
    return AddedMass(
        volume * k / np.maximum(LEAST, 2 - k), volume / 5 * gap**2 * abs(apart) / below
    )


def _integral(square: np.ndarray, i: int) -> float:
    """Return k_i by the sum, from a^2."""
    scale = (square[i] * np.sqrt(square.prod())) ** 0.4
    rows = 1 + scale * LAMBDA / square[:, None]
    terms = scale * SLOPE / (rows[i] * np.sqrt(rows.prod(axis=0))) * WEIGHTS
    return float(terms.sum() / square[i])


def gap(drag: EllipsoidDrag) -> float:
    """Return by how much the fluid that an ellipsoid carries along is another than MuJoCo's sum,
    relative to its greatest mass."""
    a, theirs = np.array(drag.radii), carried(drag.radii)
    given = (drag.added_mass, drag.added_inertia)
    own = AddedMass(
        *(x if y is None else np.array(y) for x, y in zip(added(a), given, strict=True))
    )
    masses = np.abs(own.mass - theirs.mass).max()
    inertias = np.abs(own.inertia - theirs.inertia).max() / (a.max() ** 2 / 5)
    return float(max(masses, inertias) / theirs.mass.max())


def as_summed(drag: EllipsoidDrag) -> EllipsoidDrag:
    """Return the drag of an ellipsoid that carries along what MuJoCo sums."""
    mass, inertia = (tuple(part.tolist()) for part in carried(drag.radii))
    return drag.model_copy(update={"added_mass": mass, "added_inertia": inertia})
