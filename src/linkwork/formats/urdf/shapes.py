"""What a URDF file shows of its links: the <visual> elements that are simple shapes.

A cylinder or capsule is along z, and its length is that of the cylinder. What links that are frames
show belongs to the bodies they are fixed to.

Source: the URDF specification, https://wiki.ros.org/urdf/XML/link.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from linkwork.formats import poses
from linkwork.formats.notes import Notes
from linkwork.formats.urdf.model import UrdfModel, origin
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import GROUND, Box, Capsule, Cylinder, Frame, Shape, Sphere

FEW = 4  # kinds of geometry in one sentence
SHAPES = ("box", "cylinder", "sphere", "capsule")


def shapes_of(model: UrdfModel, notes: Notes) -> dict[str, tuple[Shape, ...]]:
    """Return the shapes of all links by the body that they are on, in its frame."""
    colours = {
        name: colour
        for name, colour in map(_material, model.root.each("material"))
        if colour is not None
    }
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
            found[body] += poses.carried(_shapes(link, colours, notes), X)
    return found


def _shapes(link: Element, colours: dict[str, tuple[float, ...]], notes: Notes) -> Iterator[Shape]:
    for visual in link.each("visual"):
        geometry = visual.named("geometry")
        solid = next(geometry.each(*SHAPES), None)
        if solid is None:
            kinds = ", ".join(child.tag for child in geometry.children[:FEW]) or "nothing"
            notes.on(visual, f"is not shown: it is {kinds}, not one of {', '.join(SHAPES)}")
            continue
        sizes = _sizes(solid)
        if min(sizes) <= 0:
            notes.on(visual, f"is not shown: its {solid.tag} has no size")
            continue
        yield _shape(solid, sizes, poses.frame_of(origin(visual)), _colour(visual, colours))


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


def _colour(visual: Element, colours: dict[str, tuple[float, ...]]) -> tuple[float, ...] | None:
    """Return the colour of a <visual>, by its own <material> or by the name of one of the
    file's."""
    material = visual.first("material")
    if material is None:
        return None
    name, colour = _material(material)
    return colours.get(name) if colour is None else colour


def _material(element: Element) -> tuple[str, tuple[float, ...] | None]:
    """Return the name of a <material>, and red, green and blue if it gives them."""
    colour = element.first("color")
    rgb = (
        None if colour is None else tuple(np.clip(colour.numbers("rgba", (4,))[:3], 0, 1).tolist())
    )
    return element.attributes.get("name", ""), rgb
