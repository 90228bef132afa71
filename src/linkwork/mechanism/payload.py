"""Payloads: mass carried by a tool, as part of the body that the tool is on.

    m = m_1 + m_2,    m c = m_1 c_1 + m_2 c_2
    I = I_1 + I_2 + sum_i m_i (d_i . d_i 1 - d_i d_i'),    d_i = c_i - c

(parallel-axis theorem), all in the body's frame.
"""

from __future__ import annotations

import numpy as np

from linkwork.mechanism.body import Body, Inertia
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.record import MechanismError


def together(body: Body, payload: Body, frame: Frame) -> Body:
    """Return a body with a second one fixed in a frame of it; a body of `zz` alone stays one."""
    R = rotation(frame)
    masses = body.mass, payload.mass
    centres = (
        np.array(body.centre_of_mass),
        np.array(frame.position) + R @ np.array(payload.centre_of_mass),
    )
    total = sum(masses)
    centre = (masses[0] * centres[0] + masses[1] * centres[1]) / total if total else centres[0]
    if payload.inertia.planar and not body.inertia.planar:
        raise MechanismError("the payload's inertia needs xx and yy too; its body moves in space")
    tensor = body.inertia.tensor() + R @ payload.inertia.tensor() @ R.T
    for m, c in zip(masses, centres, strict=True):
        d = c - centre
        tensor += m * (d @ d * np.eye(3) - np.outer(d, d))
    names = ("zz",) if body.inertia.planar else ("xx", "yy", "zz", "xy", "xz", "yz")
    axes = {name: ("xyz".index(name[0]), "xyz".index(name[1])) for name in names}
    moments = "any" if "any" in (body.inertia.moments, payload.inertia.moments) else "rigid"
    inertia = Inertia(
        **{name: float(tensor[place]) for name, place in axes.items()}, moments=moments
    )
    x, y, z = map(float, centre)
    return Body(mass=float(total), centre_of_mass=(x, y, z), inertia=inertia, shapes=body.shapes)


def rotation(frame: Frame) -> np.ndarray:
    """Return R = exp([r x]) of a frame (Rodrigues)."""
    r = np.array(frame.orientation)
    angle = float(np.linalg.norm(r))
    x, y, z = r / angle if angle else r
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
