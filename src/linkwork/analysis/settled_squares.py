"""Whether a search for least squares has found them.

Steps that become tiny, as in the bend of a narrow valley or at the edge of where residuals can be
told, end a search, too. At least squares the slopes J promise nothing more: |r + J x|^2 is hardly
less than |r|^2 for any step x.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

PROMISED = 1e-2  # part of half the sum of squares


def settled(found: OptimizeResult, least: float, lower: np.ndarray | float = -np.inf) -> bool:
    """Tell whether least squares are found.

    least: half the sum of squares that is not told apart from none; lower: least values (size)
    """
    from scipy.optimize import lsq_linear

    step = lsq_linear(found.jac, -found.fun, (lower - found.x, np.inf))
    return bool(found.success and found.cost - step.cost <= PROMISED * max(found.cost, least))
