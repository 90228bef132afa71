"""The links of an SDF file: what they weigh, and what is shown of them.

A link without <inertial> weighs 1 kg and has unit moments of inertia; one that says auto="true" has
the mass of its collisions by their density: of a mesh, of what its triangles enclose.

Source: the SDF specification, http://sdformat.org/spec (link, inertial, geometry).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.formats import poses
from linkwork.formats.notes import Notes
from linkwork.formats.reading import Reading
from linkwork.formats.sdf.scopes import Scope, read_pose
from linkwork.formats.shown_meshes import can_be_shown
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    MechanismError,
    MeshFile,
    Shape,
    Sphere,
)
from linkwork.solids.mesh_files import read_mesh
from linkwork.solids.solid import Solid, together
from linkwork.solids.triangles import weighed
from linkwork.solids.uniform import principal, volume

ABSENT = (
    "its file is not there, or lies outside the model's folder and the package path; state its "
    "folder (packages=, --package-path)"
)
WATER = 1000.0  # density of what gives none [kg/m^3]
SILENT = (
    *("pose", "inertial", "collision", "visual", "sensor", "light", "self_collide", "projector"),
    *("battery", "audio_sink", "audio_source", "particle_emitter", "must_be_base_link"),
    *("enable_wind", "kinematic", "gravity", "velocity_decay"),
)


def survey_link(link: Element, notes: Notes) -> None:
    """Note what a link says that is not read."""
    for child in link.children:
        if child.tag not in SILENT:
            unfelt = child.tag == "contact"
            notes.on(child, "in a <link> is left out: it is not known here", alters=not unfelt)
    if link.inner_flag("kinematic"):
        notes.on(link, "is moved from outside in the file; here it moves freely", alters=True)
    decay = link.first("velocity_decay")
    if decay is not None and any(decay.inner_number(tag, 0.0) for tag in ("linear", "angular")):
        notes.on(link, "says velocity_decay, which is left out", alters=True)


def solid_of_link(scope: Scope, link: Element, reading: Reading, notes: Notes) -> Solid:
    """Return the mass of a link in its own axes."""
    inertial = link.first("inertial")
    if inertial is None:
        notes.on(link, "says nothing of its mass, which is 1 kg with unit moments of inertia then")
        return Solid(1.0, np.zeros(3), np.eye(3))
    if inertial.attributes.get("auto", "false") in ("true", "1"):
        return _weighed(scope, link, inertial.inner_number("density", WATER), reading, notes)
    if inertial.first("fluid_added_mass") is not None:
        notes.on(link, "says fluid_added_mass, which is left out", alters=True)
    mass, moments = inertial.inner_number("mass", 1.0), inertial.first("inertia")
    tensor = np.eye(3)
    if moments is not None:
        for i, row in enumerate("xyz"):
            for j, column in enumerate("xyz"):
                name = "i" + "".join(sorted(row + column))
                tensor[i, j] = moments.inner_number(name, float(i == j))
    pose = inertial.inner("pose")
    X = np.eye(4) if pose is None else read_pose(pose)
    return Solid(mass, np.zeros(3), tensor).seen(X)


def _weighed(scope: Scope, link: Element, density: float, reading: Reading, notes: Notes) -> Solid:
    """Return the mass of a link's collisions by their density."""
    parts = []
    for collision in link.each("collision"):
        rho = collision.inner_number("density", density)
        kind, size = _geometry(collision)
        if kind:
            mass = volume(kind, size) * rho
            solid = Solid(mass, np.zeros(3), np.diag(principal(kind, size, mass)))
        else:
            solid = _of_mesh(collision, rho, reading, notes)
        if solid is not None:
            parts.append(solid.seen(_pose_in_link(scope, link, collision)))
    return together(parts)


def _of_mesh(collision: Element, density: float, reading: Reading, notes: Notes) -> Solid | None:
    """Return the mass of a mesh; one that cannot be weighed, and what is no mesh, is noted."""
    mesh = _mesh(collision)
    if mesh is None:
        notes.on(collision, "is no simple shape and no mesh; its mass is left out", alters=True)
        return None
    # Its triangles, from its file.
    try:
        found = read_mesh(reading.found(*_uri(mesh)))
    except MechanismError:
        notes.on(collision, f"is a mesh whose mass is left out: {ABSENT}", alters=True)
        return None
    except LinkworkError as error:
        notes.on(collision, f"is a mesh whose mass is left out: its file {error}", alters=True)
        return None
    triangles = found.scaled(np.array(_scale(mesh)))
    # What they enclose.
    try:
        solid = weighed(triangles).scaled(density)
    except LinkworkError as error:
        notes.on(collision, f"is a mesh whose mass is left out: {error}", alters=True)
        return None
    if triangles.open_edges:
        notes.on(collision, "is a mesh that is not closed; its mass is a guess", alters=True)
    if mesh.first("submesh") is not None:
        notes.on(collision, "says submesh; the whole mesh is weighed", alters=True)
    return solid


def shapes_of_link(scope: Scope, link: Element, reading: Reading, notes: Notes) -> Iterator[Shape]:
    """Yield what is shown of a link, in its axes; a visual whose numbers are wrong, which is no
    dynamics, is noted."""
    for visual in link.each("visual"):
        try:
            yield from tuple(_shapes_of(scope, link, visual, reading, notes))
        except MechanismError as error:
            notes.on(visual, f"is not shown: {str(error).removeprefix(f'{visual.file}: ')}")


def _shapes_of(
    scope: Scope, link: Element, visual: Element, reading: Reading, notes: Notes
) -> Iterator[Shape]:
    """Yield the shape of a <visual>, if it has one."""
    # Where it is, and its colour.
    material = visual.first("material")
    colour = material and material.inner("diffuse")
    fields = {
        "frame": poses.frame_of(_pose_in_link(scope, link, visual)),
        "colour": None
        if colour is None
        else tuple(np.clip(colour.numbers("diffuse", (3, 4))[:3], 0, 1).tolist()),
    }
    # A mesh, or a simple shape.
    mesh = _mesh(visual)
    if mesh is not None:
        yield from _shown(visual, mesh, fields, reading, notes)
        return
    kind, size = _geometry(visual)
    if not kind or min(size) <= 0:
        notes.on(
            visual,
            "is not shown: it is no mesh, box, cylinder, sphere, capsule or ellipsoid with a size",
        )
    elif kind == "box":
        yield visual.make(Box, size=tuple((2 * size).tolist()), **fields)
    elif kind == "sphere":
        yield visual.make(Sphere, radius=float(size[0]), **fields)
    elif kind == "ellipsoid":
        yield visual.make(Ellipsoid, radii=tuple(size.tolist()), **fields)
    else:
        made = Cylinder if kind == "cylinder" else Capsule
        yield visual.make(made, radius=float(size[0]), length=float(2 * size[1]), **fields)


def _shown(
    visual: Element, mesh: Element, fields: dict[str, Any], reading: Reading, notes: Notes
) -> Iterator[Shape]:
    """Yield the mesh of a <visual>, if its file is there and of a kind that is read."""
    try:
        path = reading.found(*_uri(mesh))
    except MechanismError:
        notes.on(visual, f"is a mesh that is not shown: {ABSENT}")
        return
    if mesh.first("submesh") is not None:
        notes.on(visual, "says submesh; the whole mesh is shown")
    scale = _scale(mesh)
    if can_be_shown(visual, path, scale, notes):
        yield mesh.make(MeshFile, file=str(path), scale=scale, **fields)


def _mesh(part: Element) -> Element | None:
    """Return the <mesh> of a collision or visual, or None."""
    geometry = part.first("geometry")
    return geometry and geometry.first("mesh")


def _uri(mesh: Element) -> tuple[str, Element]:
    """Return the file that a mesh names, and the element that does."""
    uri = mesh.named("uri")
    return uri.content, uri


def _scale(mesh: Element) -> tuple[float, float, float]:
    scale = mesh.inner("scale")
    return scale.vector("scale") if scale else (1.0, 1.0, 1.0)


def _pose_in_link(scope: Scope, link: Element, part: Element) -> np.ndarray:
    """Return the pose in a link of a collision or visual, which may be relative to other parts."""
    pose = part.inner("pose")
    if pose is None:
        return np.eye(4)
    relative = scope.relative(pose)
    if not relative:
        return read_pose(pose)
    base = poses.inverse(scope.pose(link.text("name"), link))
    return base @ scope.pose(relative, pose) @ read_pose(pose)


def _geometry(part: Element) -> tuple[str, np.ndarray]:
    """Return the kind of a simple shape and its size: radius, radius and half length, or half axes;
    no kind for any other."""
    geometry = part.first("geometry")
    solid = geometry and next(
        geometry.each("box", "sphere", "cylinder", "capsule", "ellipsoid"), None
    )
    if solid is None:
        return "", np.zeros(0)
    match solid.tag:
        case "box":
            size = solid.inner("size")
            return "box", np.array(size.vector("size") if size else (1.0, 1.0, 1.0)) / 2
        case "ellipsoid":
            radii = solid.inner("radii")
            return "ellipsoid", np.array(radii.vector("radii") if radii else (1.0, 1.0, 1.0))
        case "sphere":
            return "sphere", np.array([solid.inner_number("radius", 1.0)])
    return solid.tag, np.array(
        [solid.inner_number("radius", 0.5), solid.inner_number("length", 1.0) / 2]
    )
