"""Measuring: the quantities of a study's members at the saved times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from linkwork.runs.ensemble import Ensemble
from linkwork.runs.quantities import QUANTITIES
from linkwork.sweeps.preparation import Bench


@dataclass(frozen=True, eq=False)
class StudyAim:
    """Tell where one of a study's controllers leads to."""

    bench: Bench
    law: int

    def joints(self, t: np.ndarray) -> np.ndarray:
        """Return x_d (K, actuators) at times [s]."""
        return self.bench.wanted_joints(self.law)(t)

    def tool_error(self, places: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Return the distances (K, pose) of tool poses from the goal's at the saved times."""
        return self.bench.tool_error(self.law, places, poses)


def measured(
    bench: Bench, law: int, ensemble: Ensemble, wanted: Iterable[str], threads: int | None
) -> dict[str, np.ndarray]:
    """Return the wanted quantities (members, times[, components]) of an ensemble; nan at times that
    a member did not reach.

    Angles are those of the joints, turn by turn; tool_error is the tool's distance from the goal's
    motion, in the coordinates of its pose, and tracking_error  x_d - x  of the actuated joints, as
    controllers see it.
    law: which of the study's controllers; threads: all processors if left out
    """
    quantities = [QUANTITIES[name] for name in wanted]
    found = ensemble.measured(quantities, StudyAim(bench, law), threads)
    if "drive_state" in found:  # those of controllers follow
        found["drive_state"] = found["drive_state"][..., : len(bench.extras)]
    return found
