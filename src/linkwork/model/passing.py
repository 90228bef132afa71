"""Whether a motion passes, between two samples, where its actuators do not hold it.

The tangent space of the closed configurations is as smooth as the motion. The actuated rates S v
are coordinates in it, and joints' rates are L v. Where

    det S_k det (L_k' L_{k+1}) det S_{k+1} < 0

of neighbours whose tangent spaces are alike, the actuated rates turn their orientation round, which
they do where det S is zero: forces grow there without bound, large at a sample or not.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from linkwork.errors import ModelWarning
from linkwork.model import evaluation

if TYPE_CHECKING:
    from linkwork.model.model import Model
    from linkwork.model.state import Motion

SHOWN = 3  # places that are named
ALIKE = 0.5  # cosine of the largest angle between tangent spaces that can be compared


def singularities_passed(robot: Model, motion: Motion) -> list[tuple[float, float]]:
    """Return the times [s] between which a motion passes actuator-singular configurations; none for
    other than as many actuators as freedoms, or where samples are too far apart to tell."""
    state = motion.state
    if len(robot.actuators) != robot.mobility or robot.mobility == 0:
        return []
    own = evaluation.own_units(robot, state)
    lengths = np.array([robot.unit(name) == "m" for name in robot.rates])
    units = np.where(lengths, robot.equations.tree.length, 1.0)
    L = evaluation.told(robot, "maps", state)[0] * own.rates / units[:, None]
    side = np.sign(np.linalg.det(own.map(evaluation.actuation_map(robot, state))))
    turned = side[:-1] * side[1:] * np.linalg.det(np.swapaxes(L[:-1], -1, -2) @ L[1:]) < 0
    places = [k for k in np.flatnonzero(turned) if alike(L[k], L[k + 1])]
    return [(float(motion.time[k]), float(motion.time[k + 1])) for k in places]


def alike(L: np.ndarray, after: np.ndarray) -> bool:
    """Tell whether two tangent spaces (m, n) are near enough for their orientations to be
    compared."""
    across = np.linalg.qr(L)[0].T @ np.linalg.qr(after)[0]
    return bool(np.linalg.svd(across, compute_uv=False)[-1] > ALIKE)


def warn_of_passing(robot: Model, motion: Motion) -> None:
    """Warn where the forces of a motion's samples do not tell that they grow without bound between
    them."""
    if passed := singularities_passed(robot, motion):
        times = ", ".join(f"{first:.6g} s and {last:.6g} s" for first, last in passed[:SHOWN])
        more = f" and {len(passed) - SHOWN} times more" if len(passed) > SHOWN else ""
        warnings.warn(
            f"between {times}{more} the motion passes where its actuators do not hold it "
            "(actuator-singular): forces grow without bound there, though its samples do not show "
            "it; choose another path, or another branch",
            ModelWarning,
            stacklevel=3,
        )
