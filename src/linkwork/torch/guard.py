"""What becomes of states for which a function is not defined: an error that names them, or NaN."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.model.checks import PIVOT_BOUND


@dataclass(frozen=True)
class Guard:
    """Look at the results of a function.

    what: the function, in sentences; independent: names of the rates
    raises: whether a state for which it is not defined is an error; else its results are NaN
    """

    what: str
    independent: tuple[str, ...]
    raises: bool

    def sound(self, y: np.ndarray, pivot: np.ndarray | None = None) -> np.ndarray:
        """Return results y (..., m); pivot: weakest relative pivots (..., 1).

        Raises:
            LinkworkError: some are not finite, or the rates do not determine the motion.
        """
        if pivot is not None:
            weak = np.abs(pivot[..., 0]) <= PIVOT_BOUND
            y = self.kept(
                y, weak, f"the rates {', '.join(self.independent)} do not determine the motion; "
                "take other independent rates by linkwork.torch.model(robot, chart)",
            )  # fmt: skip
        unsound = np.asarray(~np.isfinite(y).all(axis=-1))
        why = "the result is not finite, for numbers given are not or the configuration is singular"
        return self.kept(y, unsound, f"{why}; give others")

    def closed(self, q: np.ndarray, gap: np.ndarray, enough: float) -> np.ndarray:
        """Return configurations q (..., nq); gap: residuals of their loops (...).

        Raises:
            LinkworkError: some are above what is enough.
        """
        return self.kept(
            q, ~(gap <= enough), "the loops are left open; give q nearer to a closed configuration"
        )

    def stepped(self, y: np.ndarray, wrong: np.ndarray) -> np.ndarray:
        """Return states y (..., nq + n) after a step, which is wrong (...) where loops are open or
        the rates have ceased to determine the motion on the way.

        Raises:
            LinkworkError: it is wrong somewhere.
        """
        return self.kept(
            y, wrong, f"on the way the rates {', '.join(self.independent)} cease to determine the "
            "motion, or the loops are left open; take shorter steps, or other independent rates by "
            "linkwork.torch.model(robot, chart)",
        )  # fmt: skip

    def kept(self, y: np.ndarray, wrong: np.ndarray, why: str) -> np.ndarray:
        """Return results (..., m), NaN where they are wrong (...), which is an error where that is
        asked for."""
        if not wrong.any():
            return y
        if self.raises:
            index = tuple(int(i) for i in np.argwhere(wrong)[0])
            place = f", state {index[0] if len(index) == 1 else index}" if index else ""
            raise LinkworkError(f"{self.what}{place}: {why}, or take singular='nan'")
        return np.where(wrong[..., None], np.nan, y)
