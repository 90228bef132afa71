"""The orthogonal Bricard linkage of the IFToMM benchmark library: six revolute joints, one freedom,
one row too many."""

from __future__ import annotations

import numpy as np

from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint
from linkwork.robots.uniform import require_kinds

# A closed hexagon along edges of a cube that hangs below the ground's first corner, y being up; the
# edge from the last corner to the first is ground.
CORNERS = ((0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1))


def bricard(length: float = 1.0, mass: float = 1.0, section: float = 0.1) -> Mechanism:
    """Describe the Bricard linkage: five rods and ground, joined by revolute joints across both
    neighbouring rods.

    Gruebler's formula counts no freedom; the linkage has one, because one of the closure rows
    depends on the others.

    Args:
        length: of each rod [m].
        mass: of each rod [kg].
        section: side of the rods' square section [m].

    Source: IFToMM library of computational benchmark problems, A04, Bricard's mechanism; its
    corners as in the models of it for OpenSim (Tagliapietra, Vivian & Reggiani) and Exudyn
    (Gerstmayr), which agree.
    """
    require_kinds(bricard, locals())
    corners = length * np.array(CORNERS, float)
    names = ["ground", *(f"rod_{i}" for i in range(1, 6))]
    along, across = mass * section**2 / 6, mass * (length**2 + section**2) / 12
    bodies, joints = {}, {}
    for i in range(1, 6):
        direction = np.abs(corners[i] - corners[i - 1]) / length
        xx, yy, zz = across + (along - across) * direction
        middle = (corners[i] + corners[i - 1]) / 2
        bodies[names[i]] = Body(
            mass=mass, centre_of_mass=tuple(middle), inertia=Inertia(xx=xx, yy=yy, zz=zz)
        )
    for i in range(6):
        axis = np.cross(corners[i] - corners[i - 1], corners[(i + 1) % 6] - corners[i]) / length**2
        corner = Frame(position=tuple(corners[i]))
        joints[f"hinge_{i + 1}"] = RevoluteJoint(
            connects=(names[i], names[(i + 1) % 6]), frames=(corner, corner), axis=tuple(axis)
        )
    return Mechanism(
        name="Bricard linkage",
        gravity=(0.0, -9.81, 0.0),
        bodies=bodies,
        joints=joints,
        actuators=("hinge_1",),
    )
