"""Continued: coordinates of joints that close loops, as what acts on a robot sees them, without
jumps.

Their turns do not follow from the tree's coordinates (`linkwork.model.whole_turns`), so that where
they are read each joint has states of its own in the run, z, which its rates move. An angle q read
within half a turn, and a quaternion p read but for its sign, then are

    x = q + 2 pi floor((z - q) / 2 pi + 1/2),    z' = w + |w| (x - z)
    x = p sign(p . z),                           z' = (0, omega) x / 2 + |omega| (x - z)

exact to rounding, for z only tells which turn it is. It is drawn to x, so that its errors, which no
step is held to, do not grow however long a run lasts.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca
import numpy as np

from linkwork.equations import Equations
from linkwork.equations.algebra import dot, quaternion_map

Followed = tuple[
    tuple[str, ...], ...
]  # coordinates of each joint: an angle, or the four numbers of a quaternion


def continued(
    equations: Equations, followed: Followed, z: ca.SX
) -> Iterator[tuple[tuple[str, ...], ca.SX, ca.SX]]:
    """Yield the names, values and z' of coordinates that are followed, by their states z."""
    joints, begin = equations.joints, 0
    for labels in followed:
        own, begin = z[begin : begin + len(labels)], begin + len(labels)
        read = ca.vertcat(*[joints.position(label) for label in labels])
        if len(labels) == 1:
            value = read + 2 * np.pi * ca.floor((own - read) / (2 * np.pi) + 0.5)
            w = ca.mtimes(joints.rate_row(labels[0]), equations.rates)
            yield labels, value, w + ca.fabs(w) * (value - own)
        else:
            name = labels[0].rpartition(".")[0]
            value = ca.if_else(dot(read, own) < 0, -read, read)
            rows = joints.rate_rows(equations.mechanism.joints[name].rates(name)[-3:])
            omega = ca.mtimes(rows, equations.rates)
            yield (
                labels,
                value,
                ca.mtimes(quaternion_map(value), omega)
                + ca.sqrt(dot(omega, omega) + 1e-300) * (value - own),
            )
