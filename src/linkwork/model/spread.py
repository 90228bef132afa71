"""Spread: how large a mechanism is as it stands, whichever frames its description is told in."""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import GROUND, Mechanism
from linkwork.model.charts import CompiledChart

ALL = 6  # rates of a joint that ties nothing


def extent(mechanism: Mechanism, chart: CompiledChart, q: np.ndarray) -> float:
    """Return how far apart joints' frames are at a configuration (nq) [m], or the mechanism's own
    length where that is more: wherever the robot stands, and the origins of its bodies are."""
    names, shape = list(mechanism.bodies), (len(mechanism.bodies) + 1, 3)
    p, R, *_ = chart.kernel("bodies_motion")(q, np.zeros(len(chart.independent)))
    p, R = np.append(p, np.zeros(3)).reshape(shape), np.append(R, np.eye(3)).reshape(*shape, 3)
    points = [
        p[k] + R[k] @ frame.position
        for label, joint in mechanism.pairs.items()
        if len(joint.rates(label)) < ALL
        for name, frame in zip(joint.connects, joint.frames, strict=True)
        for k in [-1 if name == GROUND else names.index(name)]
    ]
    spread = np.ptp(points or np.zeros((1, 3)), axis=0)
    return max(float(np.linalg.norm(spread)), chart.equations.tree.length)
