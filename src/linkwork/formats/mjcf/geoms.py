"""Geoms of an MJCF model: what they weigh, and what they show.

A geom is measured by `size`: the radius of a sphere, radius and half length of a capsule or
cylinder along z, the half axes of an ellipsoid or box. It is shown where MuJoCo shows it when it
opens a model: in one of the groups 0 to 2, not transparent.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.formats import poses
from linkwork.formats.mjcf.document import Document, flag
from linkwork.formats.mjcf.meshes import Meshes
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import Box, Capsule, Cylinder, Ellipsoid, MeshFile, Shape, Sphere
from linkwork.solids.mesh_files import read_mesh
from linkwork.solids.solid import Solid
from linkwork.solids.uniform import principal, shell, surface, volume

SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
SHAPES = ("box", "cylinder", "sphere", "capsule", "ellipsoid", "mesh")
NEAR = 1e-12  # turns and scales that are none
MESHES = (".stl", ".obj", ".msh")  # files that MuJoCo reads
FEWEST, MOST = 4, 200_000  # vertices at least and triangles at most of a mesh in MuJoCo
TERRAIN = ("plane", "hfield")
DENSITY = 1000.0  # of geoms that say nothing [kg/m^3]
HIDDEN = 3  # first group of geoms that MuJoCo does not show
BETWEEN = "between_joints"  # class of what an export draws of a body without shapes


def weighed(
    document: Document, element: Element, X: np.ndarray, meshes: Meshes, notes: Notes
) -> list[Solid]:
    """Return the geom's mass in the body's frame; nothing for shapes without mass or not known
    here.

    Args:
        element: with its defaults.
        X: pose of the <frame> around it in the body.
    """
    kind = element.attributes.get("type", "sphere")
    if not is_heavy(document, element):
        return []
    if kind in ("mesh", "sdf") and "mesh" in element.attributes:
        found = meshes.solid(element, notes)
        if found is None:
            return []
        mass = element.number("mass", element.number("density", DENSITY) * found.mass)
        return [found.scaled(mass / found.mass).seen(X @ document.pose(element))]
    if kind not in SIZES:
        notes.on(element, f"is a {kind}, whose mass is left out", alters=True)
        return []
    fitted = meshes.fitted(element, notes) if "mesh" in element.attributes else None
    if fitted is None and "mesh" in element.attributes:
        return []
    size, place = fitted or measured(document, element)
    hollow = flag(element, "shellinertia", False)
    extent, moments = (surface, shell) if hollow else (volume, principal)
    mass = element.number("mass", element.number("density", DENSITY) * extent(kind, size))
    return [Solid(mass, np.zeros(3), np.diag(moments(kind, size, mass))).seen(X @ place)]


def is_heavy(document: Document, element: Element) -> bool:
    """Tell whether a geom, with its defaults, has mass in MuJoCo."""
    low, high = document.compiler_of(element).groups
    if kind_of(element) in TERRAIN or not low <= element.number("group", 0.0) <= high:
        return False
    return element.number("mass", element.number("density", 1.0)) != 0


def shown(
    document: Document,
    element: Element,
    X: np.ndarray,
    materials: Mapping[str, Element],
    meshes: Meshes,
    notes: Notes,
) -> list[Shape]:
    """Return the geom's shape in the body's frame; nothing for what MuJoCo hides or is no shape
    here."""
    # What MuJoCo draws, and what it does not.
    if not is_shown(element):
        return []
    colour = rgba(element, materials)
    if colour is not None and colour[3] == 0:
        return []
    # What has no shape here is told, not guessed.
    kind = kind_of(element)
    if kind not in SHAPES:
        notes.on(
            element,
            (
                f"is no shape here and is not shown: its type is {kind}, not one of "
                f"{', '.join(SHAPES)}"
            ),
        )
        return []
    if colour is not None and colour[3] < 1:
        notes.on(element, "is half transparent; shapes are opaque here")
    look = {"colour": None if colour is None else tuple(np.clip(colour[:3], 0, 1).tolist())}
    if kind == "mesh":
        return mesh_shown(document, element, X, meshes, notes, look)
    # MuJoCo gives half sizes, and the middle of what is symmetric.
    size, place = measured(document, element)
    fields = look | {"frame": poses.frame_of(X @ place)}
    match kind:
        case "ellipsoid":
            return [element.make(Ellipsoid, radii=tuple(size.tolist()), **fields)]
        case "box":
            return [element.make(Box, size=tuple((2 * size).tolist()), **fields)]
        case "sphere":
            return [element.make(Sphere, radius=float(size[0]), **fields)]
    record = Cylinder if kind == "cylinder" else Capsule
    return [element.make(record, radius=float(size[0]), length=float(2 * size[1]), **fields)]


def mesh_shown(
    document: Document,
    element: Element,
    X: np.ndarray,
    meshes: Meshes,
    notes: Notes,
    look: Mapping[str, Any],
) -> list[Shape]:
    """Return the mesh of a geom as a shape in the body's frame; nothing with a note where it is in
    no file of its own, or the geom is a simple shape that is fitted to it."""
    if element.attributes.get("type", "sphere") not in ("mesh", "sdf"):
        notes.on(element, "is not shown: it is fitted to a mesh")
        return []
    try:
        asset = meshes.asset(element)
        if plate := asset.plate:
            frame = poses.frame_of(X @ document.pose(element))
            return [plate.model_copy(update={"frame": frame, **look})]
        if asset.path is None:
            raise LinkworkError("it has no file of its own")
        turned = not np.allclose(asset.reference[:3, :3], np.eye(3), rtol=0, atol=NEAR)
        if turned and np.ptp(asset.scale) > NEAR * abs(asset.scale).max():
            raise LinkworkError("it is turned, and scaled by different factors")
    except LinkworkError as error:
        remark = f"is a mesh that is not shown: {error}"
        notes.on(element, remark, words=getattr(error, "file", ""))
        return []
    # S R' (p - p_ref) is the pose S R' (-p_ref), R' of the scaled mesh, where S and R' commute.
    R = asset.reference[:3, :3].T
    place = poses.pose(asset.scale * (R @ -asset.reference[:3, 3]), R)
    frame = poses.frame_of(X @ document.pose(element) @ place)
    scale = tuple(asset.scale.tolist())
    return [element.make(MeshFile, file=str(asset.path), scale=scale, frame=frame, **look)]


def size_of(shape: Shape) -> tuple[float, ...] | None:
    """Return the size of a shape as a geom; None for one that is none, such as a polygon."""
    return getattr(shape, "half_sizes", ()) or None


def corners_of(shape: Shape) -> tuple[tuple[float, float, float], ...]:
    """Return the corners of a shape that is the hull of them, such as a polygon; none of others."""
    return getattr(shape, "corners", ())


def mesh_file(shape: Shape) -> tuple[Path, tuple[float, ...]] | None:
    """Return path and scale of a file that MuJoCo reads; None for other shapes and files."""
    if not isinstance(shape, MeshFile) or Path(shape.file).suffix.lower() not in MESHES:
        return None
    try:
        triangles = read_mesh(Path(shape.file), first_group=True)
    except LinkworkError:
        return None
    fits = len(triangles.vertices) >= FEWEST and 0 < len(triangles.faces) <= MOST
    return (Path(shape.file), shape.scale) if fits else None


def is_shown(element: Element) -> bool:
    """Tell whether MuJoCo shows a geom when it opens a model, and an export did not draw it for
    want of shapes."""
    return element.number("group", 0.0) < HIDDEN and element.attributes.get("class") != BETWEEN


def kind_of(element: Element) -> str:
    """Return the type of a geom; one that is fitted to a mesh counts as a mesh."""
    return "mesh" if "mesh" in element.attributes else element.attributes.get("type", "sphere")


def measured(document: Document, element: Element) -> tuple[np.ndarray, np.ndarray]:
    """Return the size [m] of a geom of a kind in SIZES, and its pose."""
    kind = kind_of(element)
    count = SIZES[kind]
    if "fromto" in element.attributes and kind != "sphere":
        place, half = fromto(element)
        radius = element.numbers("size", (1, 2, 3))[0]
        size = np.array([radius, half] if count == 2 else [radius, radius, half])
    else:
        place = document.pose(element)
        size = np.array(element.numbers("size", (count, 2, 3))[:count])
    if np.any(size <= 0):
        raise element.refusal(f"size '{element.text('size')}' is not positive")
    if len(size) < count:
        raise element.refusal(f"size holds {len(size)} numbers; a {kind} has {count}")
    return size, place


def fromto(element: Element) -> tuple[np.ndarray, float]:
    """Return the pose in the middle between two points, z along their line, and half their
    distance."""
    ends = np.array(element.numbers("fromto", (6,))).reshape(2, 3)
    along = ends[0] - ends[1]
    half = np.linalg.norm(along) / 2
    if half < 1e-12:
        raise element.refusal("fromto gives one point twice; give two points")
    return poses.pose(ends.mean(axis=0), poses.from_z(along)), float(half)


def materials_of(document: Document) -> dict[str, Element]:
    """Return the materials by name, with their defaults."""
    found = (
        document.resolved(element, "material") for element in document.each("asset", "material")
    )
    return {
        element.attributes["name"]: element for element in found if "name" in element.attributes
    }


def rgba(element: Element, materials: Mapping[str, Element]) -> tuple[float, ...] | None:
    """Return red, green, blue and opacity of a geom, or of its material where that has no texture;
    None if not given."""
    if element.attributes.get("rgba", "").strip():
        return element.numbers("rgba", (4,))
    material = materials.get(element.attributes.get("material", ""))
    if material is None or "texture" in material.attributes or material.first("layer"):
        return None
    return material.numbers("rgba", (4,), (1.0, 1.0, 1.0, 1.0))
