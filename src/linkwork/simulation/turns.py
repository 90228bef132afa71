"""Turns: angles whose whole turns are counted apart, so that a crank that turns for days loses no
digit.

A double of 1e5 rad is known to 1e-11 rad only, and loops cannot be closed better than that. Where
the equations see an angle through its sine and cosine alone, whole turns change nothing: beyond its
span it is taken back to between -pi and pi,

    q = angle + 2 pi turns,    2 pi = HIGH + MIDDLE + LOW

with HIGH of so few digits that turns HIGH is exact.

Of any other coordinate that loops depend on the closure is asked for what doubles of its size can
hold: the tolerance grows with |q| / span.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

SPAN = 256.0
"""Angle [rad] beyond which whole turns are counted apart: doubles are 2.8e-14 apart up to there."""
HIGH = float.fromhex("0x1.921fb50000000p+2")
MIDDLE = float.fromhex("0x1.110b460000000p-24")
LOW = float.fromhex("0x1.1a62633145c07p-52")
TURN = HIGH + MIDDLE


@dataclass(frozen=True, eq=False)
class Turning:
    """Say of each coordinate how large it may grow, and whether its whole turns may be counted
    apart.

    spans (nq,): |q| beyond which a coordinate is large; wraps (nq,): whether it is then taken back
    by whole turns
    """

    spans: np.ndarray
    wraps: np.ndarray

    @cached_property
    def table(self) -> np.ndarray:
        """Spans, wraps, and no turns counted (3, nq)."""
        return np.array([self.spans, self.wraps, 0 * self.wraps])

    @staticmethod
    @cache
    def none(nq: int) -> Turning:
        """Return that of coordinates that may grow as they will."""
        return Turning(np.full(nq, np.inf), np.zeros(nq))

    def begun(self, q: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return q (..., nq) and its whole turns, with those of angles that may not be wrapped
        given back."""
        kept = self.wraps > 0
        return np.where(kept, q, whole(q, turns)), np.where(kept, turns, 0.0)

    def looser(self, q: np.ndarray) -> float:
        """Return the factor on the closure's tolerance at q (nq,)."""
        size = np.where(self.wraps > 0, 0.0, np.abs(q) / self.spans)
        return max(1.0, float(size.max(initial=0.0)))


def whole(q: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return angles (...) with their whole turns."""
    return turns * HIGH + (q + turns * MIDDLE + turns * LOW)
