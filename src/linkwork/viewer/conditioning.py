"""The colour of a configuration: how well the actuators move the tool there (`named_dexterity`)."""

from __future__ import annotations

import numpy as np

from linkwork.scene.colours import BLUE, VERMILION, YELLOW, rgb

WORST, BEST = 1e-3, 0.5  # that are told apart by colour


def colour(value: float) -> tuple[int, int, int]:
    """Return the colour of a conditioning, or of another measure's share: vermilion where nearly
    singular, yellow, blue where good; by its logarithm."""
    t = np.log(np.clip(value, WORST, BEST) / WORST) / np.log(BEST / WORST)
    stops = np.array([rgb(VERMILION), rgb(YELLOW), rgb(BLUE)], float)
    red, green, blue = (round(float(np.interp(t, (0, 0.5, 1), stops[:, k]))) for k in range(3))
    return red, green, blue
