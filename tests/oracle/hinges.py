"""Open trees of any number of hinges in general positions, with fixed seeds."""

from __future__ import annotations

import numpy as np

import linkwork as lw


def hinges(count: int, limbs: int = 1) -> lw.Mechanism:
    """Return bodies on hinges in general positions: a chain, or limbs that begin on the first."""
    rng, bodies, joints = np.random.default_rng(count), {}, {}
    for k in range(count):
        frame = lw.Frame(position=0.2 * rng.normal(size=3), rotation=rng.normal(size=3))
        below = "ground" if k == 0 else f"body_{max(k - limbs, 0)}"
        bodies[f"body_{k}"] = lw.Body(
            mass=1 + rng.random(),
            centre_of_mass=0.1 * rng.normal(size=3),
            inertia=lw.Inertia(xx=0.02, yy=0.03, zz=0.04),
        )
        joints[f"hinge_{k}"] = lw.RevoluteJoint(
            connects=(below, f"body_{k}"), frames=(frame, lw.Frame())
        )
    return lw.Mechanism(bodies=bodies, joints=joints, actuators=tuple(joints))
