"""Conditioning: how well the actuators move the tool in a configuration, from 1 (alike in all
directions) to 0 (singular).

With an orthonormal basis N of the motions that the loops allow, the actuated rates are B z and the
tool's twist is A z. The conditioning is  1 / cond(A B^+),  turns counted times a length. Where
there is no tool, or a single freedom, it is the smallest singular value of B: the part of the worst
motion that the actuators see.
"""

from __future__ import annotations

import numpy as np

from linkwork.scene.colours import BLUE, VERMILION, YELLOW, rgb
from linkwork.viewer.hand_goals import Outputs
from linkwork.viewer.pursuit import Pursuit, inverse

WORST, BEST = 1e-3, 0.5  # that are told apart by colour
SMALL = 1e-12


def conditioning(pursuit: Pursuit, out: Outputs) -> float:
    """Return the conditioning (0 to 1) of a configuration by its outputs of
    `functions.assembly`."""
    robot, scale = pursuit.robot, pursuit.scale
    _, N = inverse(out["Phi"] * scale)
    names = robot.actuators if len(robot.actuators) >= robot.mobility else robot.independent
    rows = [robot.rates.index(name) for name in names if name in robot.rates]
    lengths = np.array(
        [1.0 if robot.unit(robot.rates[row]) == "m" else pursuit.length for row in rows]
    )
    B = lengths[:, None] * (out["J_coordinates"][rows] * scale) @ N
    seen = np.linalg.svd(B, compute_uv=False)
    if N.shape[1] == 0 or len(seen) < N.shape[1] or seen[-1] < SMALL:
        return 0.0
    if N.shape[1] == 1 or not robot.mechanism.tools:
        return float(min(1.0, seen[-1]))
    turns = pursuit.length if pursuit.turns else 0.0
    A = np.array([turns] * 3 + [1.0] * 3)[:, None] * (out["J_tool"] * scale) @ N
    values = np.linalg.svd(A @ np.linalg.pinv(B), compute_uv=False)[: N.shape[1]]
    return float(values[-1] / values[0]) if values[0] > 0 else 0.0


def colour(value: float) -> tuple[int, int, int]:
    """Return the colour of a conditioning: vermilion where nearly singular, yellow, blue where
    good; by its logarithm."""
    t = np.log(np.clip(value, WORST, BEST) / WORST) / np.log(BEST / WORST)
    stops = np.array([rgb(VERMILION), rgb(YELLOW), rgb(BLUE)], float)
    red, green, blue = (round(float(np.interp(t, (0, 0.5, 1), stops[:, k]))) for k in range(3))
    return red, green, blue
