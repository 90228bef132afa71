"""Mass of bodies by the density of their shapes:  m = sum rho_i V_i,  c and I alike.

A mesh weighs what it encloses, exactly where it is closed; one that is not is refused, for it
encloses nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.errors import LinkworkError
from linkwork.mechanism.record import MechanismError
from linkwork.mechanism.shapes import Shape, SimpleShape
from linkwork.solids.mesh_files import read_mesh
from linkwork.solids.solid import Solid, together
from linkwork.solids.triangles import hull_of, weighed
from linkwork.solids.uniform import principal, volume


def mass_fields(shapes: Iterable[Shape]) -> dict[str, Any] | None:
    """Return mass, mass centre and inertia of shapes with a density as fields of a body; None where
    no shape has one.

    Raises:
        MechanismError: a mesh that cannot be read or weighed; `where` names the shape.
    """
    solids = []
    for number, shape in enumerate(shapes):
        if shape.density is not None:
            try:
                solid = unit_solid(shape).scaled(shape.density)
            except LinkworkError as error:
                raise MechanismError(str(error), ("shapes", str(number))) from None
            X = np.eye(4)
            X[:3, :3] = Rotation.from_rotvec(shape.frame.orientation).as_matrix()
            X[:3, 3] = shape.frame.position
            solids.append(solid.seen(X))
    return together(solids).fields() if solids else None


def unit_solid(shape: Shape) -> Solid:
    """Return mass, centre and inertia of a shape for a density of one, in the shape's axes."""
    if not isinstance(shape, SimpleShape):
        return _of_mesh(shape)
    size = np.array(shape.half_sizes)
    if len(size):
        mass = volume(shape.type, size)
        return Solid(mass, np.zeros(3), np.diag(principal(shape.type, size, mass)))
    points, scale, _ = shape.outline
    return weighed(hull_of(np.array([(*p, z) for p in points for z in (-0.5, 0.5)]) * scale))


def _of_mesh(shape: Any) -> Solid:
    """Return mass, centre and inertia of a mesh in a file, for a density of one."""
    name = f"the mesh {shape.file!r}"
    try:
        mesh = read_mesh(Path(shape.file)).scaled(np.array(shape.scale))
    except LinkworkError as error:
        raise LinkworkError(f"{name} {error}") from None
    if shape.inertia == "exact" and (count := mesh.open_edges):
        raise LinkworkError(
            f"{name} is not closed: at {count} edges its triangles do not meet in pairs; repair "
            "it, give a mass, or weigh its hull (inertia: convex) or surface (inertia: shell)"
        )
    try:
        return weighed(mesh, shape.inertia)
    except LinkworkError as error:
        raise LinkworkError(
            f"{name} cannot be weighed: {error}; give a mass, or weigh its surface (inertia: shell)"
        ) from None
