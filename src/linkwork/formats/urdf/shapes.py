"""What a URDF file shows of its links: the <visual> elements that are simple shapes or meshes, and
the <collision> elements of a link that shows nothing else.

A cylinder or capsule is along z, and its length is that of the cylinder. What links that are frames
show belongs to the bodies they are fixed to.

Source: the URDF specification, https://wiki.ros.org/urdf/XML/link.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from linkwork.formats import poses
from linkwork.formats.notes import Notes
from linkwork.formats.reading import Reading
from linkwork.formats.shown_meshes import can_be_shown
from linkwork.formats.urdf.model import UrdfModel, origin
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import (
    GROUND,
    Box,
    Capsule,
    Cylinder,
    Frame,
    MechanismError,
    MeshFile,
    Shape,
    Sphere,
)

FEW = 4  # kinds of geometry in one sentence
SHAPES = ("box", "cylinder", "sphere", "capsule")
ABSENT = (
    "is not shown: its mesh is not there, or lies outside the model's folder and the package path; "
    "state its folder (packages=, --package-path)"
)


def shapes_of(model: UrdfModel, reading: Reading, notes: Notes) -> dict[str, tuple[Shape, ...]]:
    """Return the shapes of all links by the body that they are on, in its frame."""
    materials = [_material(each, notes) for each in model.root.each("material")]
    colours = {name: colour for name, colour in materials if colour is not None}
    found: dict[str, tuple[Shape, ...]] = defaultdict(tuple)
    for name, link in model.links.items():
        body, X = model.seat(name)
        if body == GROUND:
            for visual in link.each("visual"):
                notes.on(
                    visual,
                    f"of {shortened(name)} is not shown: only bodies have shapes here, not ground",
                )
        else:
            shown = list(_shapes(link.each("visual"), colours, reading, notes))
            bare = shown or list(_shapes(link.each("collision"), colours, reading, Notes()))
            found[body] += poses.carried(bare, X)
    return found


def _shapes(
    parts: Iterable[Element],
    colours: dict[str, tuple[float, ...]],
    reading: Reading,
    notes: Notes,
) -> Iterator[Shape]:
    """Yield the shapes of <visual> or <collision> elements; what is none, or wrong, is noted."""
    for visual in parts:
        try:
            yield from list(_shape_of(visual, colours, reading, notes))
        except MechanismError as error:
            notes.on(visual, f"is not shown: {str(error).removeprefix(f'{visual.file}: ')}")


def _shape_of(
    visual: Element, colours: dict[str, tuple[float, ...]], reading: Reading, notes: Notes
) -> Iterator[Shape]:
    geometry = visual.named("geometry")
    mesh, solid = geometry.first("mesh"), next(geometry.each(*SHAPES), None)
    if mesh is not None:
        yield from _mesh(visual, mesh, _colour(visual, colours, notes), reading, notes)
    elif solid is None:
        kinds = ", ".join(child.tag for child in geometry.children[:FEW]) or "nothing"
        notes.on(visual, f"is not shown: it is {kinds}, not one of {', '.join(SHAPES)}")
    elif min(sizes := _sizes(solid)) <= 0:
        notes.on(visual, f"is not shown: its {solid.tag} has no size")
    else:
        yield _shape(solid, sizes, poses.frame_of(origin(visual)), _colour(visual, colours, notes))


def _mesh(
    visual: Element,
    mesh: Element,
    colour: tuple[float, ...] | None,
    reading: Reading,
    notes: Notes,
) -> Iterator[Shape]:
    """Yield the mesh of a <visual>, if its file is there and of a kind that is read."""
    sizes = mesh.numbers("scale", (1, 3), (1.0,))
    scale = sizes[0], sizes[-2 % len(sizes)], sizes[-1]
    try:
        path = reading.found(mesh.text("filename"), mesh)
    except MechanismError:
        notes.on(visual, ABSENT)
        return
    if can_be_shown(visual, path, scale, notes):
        frame = poses.frame_of(origin(visual))
        yield mesh.make(MeshFile, file=str(path), scale=scale, frame=frame, colour=colour)


def _sizes(solid: Element) -> tuple[float, ...]:
    """Return the lengths of a box, the radius of a sphere, or radius and length [m]."""
    if solid.tag == "box":
        return solid.vector("size")
    return tuple(
        solid.number(name)
        for name in (("radius",) if solid.tag == "sphere" else ("radius", "length"))
    )


def _shape(
    solid: Element, sizes: tuple[float, ...], frame: Frame, colour: tuple[float, ...] | None
) -> Shape:
    fields = {"frame": frame, "colour": colour}
    match solid.tag:
        case "box":
            return solid.make(Box, size=sizes, **fields)
        case "sphere":
            return solid.make(Sphere, radius=sizes[0], **fields)
    return solid.make(
        Cylinder if solid.tag == "cylinder" else Capsule, radius=sizes[0], length=sizes[1], **fields
    )


def _colour(
    visual: Element, colours: dict[str, tuple[float, ...]], notes: Notes
) -> tuple[float, ...] | None:
    """Return the colour of a <visual>, by its own <material> or by the name of one of the
    file's."""
    material = visual.first("material")
    if material is None:
        return None
    name, colour = _material(material, notes)
    return colours.get(name) if colour is None else colour


def _material(element: Element, notes: Notes) -> tuple[str, tuple[float, ...] | None]:
    """Return the name of a <material>, and red, green and blue if it gives them; wrong ones are
    noted."""
    name, colour = element.attributes.get("name", ""), element.first("color")
    if colour is None:
        return name, None
    try:
        return name, tuple(np.clip(colour.numbers("rgba", (4,))[:3], 0, 1).tolist())
    except MechanismError as error:
        notes.on(element, f"gives no colour: {str(error).removeprefix(f'{colour.file}: ')}")
        return name, None
