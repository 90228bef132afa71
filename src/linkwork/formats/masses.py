"""Mass and inertia of bodies as files hold them."""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import Body, Mechanism
from linkwork.solids.solid import Solid

NOISE = 1e-12  # of a moment of inertia, relative to the greatest
ROUNDING = 1e-15  # of a moment of inertia, relative to mass times squared size


def solid_of(body: Body) -> Solid:
    """Return mass, mass centre and inertia of a body in its own axes."""
    return Solid(body.mass, np.array(body.centre_of_mass), body.inertia.tensor())


def without_noise(inertia: np.ndarray, mass: float, square: float) -> np.ndarray:
    """Return an inertia tensor whose moments below zero are zero where they are rounding.

    square: of the length [m] that mass may have been about, before the tensor was its own
    """
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] >= 0 or moments[0] < -max(ROUNDING * abs(mass) * square, NOISE * moments[-1]):
        return inertia
    tensor = axes @ np.diag(np.maximum(moments, 0.0)) @ axes.T
    np.fill_diagonal(tensor, np.maximum(np.diag(tensor), 0.0))
    return tensor


def whole_weights(mechanism: Mechanism) -> dict[str, str]:
    """Return the bodies whose whole weight is carried by one lift each, by the lifts' names."""
    found: dict[str, str] = {}
    for name, lift in mechanism.lifts.items():
        body = mechanism.bodies.get(lift.body)
        whole = body and (lift.point, lift.mass) == (body.centre_of_mass, body.mass)
        if whole and lift.body not in found.values():
            found[name] = lift.body
    return found


def unheld(mechanism: Mechanism) -> tuple[str, str] | None:
    """Return the kind and the name of something that acts on the motion and has no place in SDF and
    URDF, where links without weight have one; None where there is nothing."""
    weights = whole_weights(mechanism)
    for kind in ("transmissions", "springs", "lifts", "drags", "contacts"):
        held = weights if kind == "lifts" else {}
        own = next((name for name in getattr(mechanism, kind) if name not in held), None)
        if own is not None:
            return kind, own
    return None
