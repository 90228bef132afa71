"""The fluid of an MJCF model, and what of the bodies it acts on.

MuJoCo lets it act on each geom with fluidshape="ellipsoid" as on the ellipsoid of its size, which
carries along what MuJoCo sums of it, and on all other bodies as on the box that has their inertia:

    edge_i = sqrt(6 (I_j + I_k - I_i) / m)

Source: the documentation of MuJoCo 4, Computation/Fluid forces.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.body_mass import LEAST
from linkwork.formats.mjcf.carried_fluid import as_summed, gap
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.geoms import SIZES, kind_of, measured
from linkwork.formats.mjcf.tree import ModelBody, ModelTree
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import BoxDrag, EllipsoidDrag, Fluid
from linkwork.mechanism.fluid import Drag

COEFFICIENTS = {"blunt": 0.5, "slender": 0.25, "angular": 1.5, "lift": 1.0, "magnus": 1.0}
"""The numbers of fluidcoef in their order."""
FLAT = 1e-15  # least of I_j + I_k - I_i [kg m^2], as in MuJoCo
ALIKE = 1e-9  # moments that differ by less have no axes of their own, relative to the greatest
ROUGH = 1e-3  # part of the fluid that is carried along
UNTURNED = (
    "has equal moments of inertia, and no axes of its own for the box on which the fluid acts; "
    "those chosen here may not be MuJoCo's"
)


def fluid_of(document: Document) -> Fluid:
    """Return the fluid; the last option of a name holds."""
    found = {}
    for option in document.root.each("option"):
        for name in ("density", "viscosity"):
            if name in option.attributes:
                found[name] = option.number(name)
        if "wind" in option.attributes:
            found["wind"] = option.vector("wind")
        fluid = option.make(Fluid, **found)
    return fluid if found else Fluid()


def drags_of(document: Document, tree: ModelTree, notes: Notes) -> dict[str, Drag]:
    """Return what of the bodies that move and have mass the fluid acts on, by name."""
    names = FreeNames(notes)
    return {
        names.give(name): drag
        for node in tree.nodes.values()
        if node.solid.mass >= LEAST and any(each.pieces for each in tree.chain(node.name))
        for name, drag in _of_body(document, tree, node, notes)
    }


def _of_body(
    document: Document, tree: ModelTree, node: ModelBody, notes: Notes
) -> Iterator[tuple[str, Drag]]:
    immersed = [
        (geom, X) for geom, X in node.geoms if geom.attributes.get("fluidshape") == "ellipsoid"
    ]
    if not immersed:
        yield node.name, _box(node, notes)
    for number, (geom, X) in enumerate(immersed, start=1):
        found = _half_axes(document, tree, geom, notes)
        if found is not None:
            radii, place = found
            given = geom.numbers("fluidcoef", (1, 2, 3, 4, 5), ())
            named = dict(zip(COEFFICIENTS, given, strict=False))
            drag = geom.make(
                EllipsoidDrag,
                body=node.name,
                frame=poses.frame_of(X @ place),
                radii=poses.triple(radii),
                **{**COEFFICIENTS, **named},
            )
            off = gap(drag)
            if off > ROUGH:
                notes.on(geom, f"carries along fluid as MuJoCo sums it, {off:.1g} off the integral")
            yield geom.attributes.get("name") or f"{node.name}_{number}", as_summed(drag)


def _half_axes(
    document: Document, tree: ModelTree, geom: Element, notes: Notes
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the half axes of a geom's ellipsoid, and its pose; None with a note for what has
    none."""
    kind = geom.attributes.get("type", "sphere")
    if kind in ("mesh", "sdf"):
        return tree.meshes.reach(geom, notes)
    if kind not in SIZES:
        notes.on(geom, f"is a {kind}, on which no fluid acts here", alters=True)
        return None
    fitted = kind_of(geom) == "mesh"
    found = tree.meshes.fitted(geom, notes) if fitted else measured(document, geom)
    if found is None:
        return None
    size, place = found
    match kind:
        case "sphere":
            return np.repeat(size, 3), place
        case "capsule":
            return np.array([size[0], size[0], size[1] + size[0]]), place
        case "cylinder":
            return np.array([size[0], size[0], size[1]]), place
    return size, place


def _box(node: ModelBody, notes: Notes) -> BoxDrag:
    """Return the box that has a body's inertia, along its principal axes."""
    R = node.axes
    moments = np.diag(R.T @ node.solid.inertia @ R)
    if node.own_axes is None and _is_open(moments, R):
        notes.on(node.element, UNTURNED, alters=True)
    sides = sides_of(moments, node.solid.mass)
    frame = poses.frame_of(poses.pose(node.solid.centre, R))
    return BoxDrag(body=node.name, frame=frame, size=poses.triple(sides))


def _is_open(moments: np.ndarray, R: np.ndarray) -> bool:
    """Tell whether moments are equal, so that rounding decides on axes that are turned."""
    upright = (np.abs(R).max(axis=0) == 1).all()
    return not upright and np.abs(np.diff(moments)).min() <= ALIKE * moments[0]


def sides_of(moments: np.ndarray, mass: float) -> np.ndarray:
    """Return the edges of the box of some principal moments and mass."""
    return np.sqrt(6 * np.maximum(moments.sum() - 2 * moments, FLAT) / mass)
