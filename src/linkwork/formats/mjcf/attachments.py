"""Attached models: <attach> written out, as MuJoCo's own compiler does it.

A body, a frame or all that is in the world of another model, an asset of this one, stands in the
place of <attach>, with the prefix before all its names. A body or frame keeps the class that its
own model gives to what is in it, not the frames around it. Tendons, equalities and actuators of
the other model come with it, behind those that are there, if all that they refer to is attached.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

from linkwork.formats import xml
from linkwork.formats.mjcf.options import taken_over
from linkwork.formats.mjcf.replicas import KINDS, REFERENCES, Known, every, references
from linkwork.formats.xml import Element

ATTACH = "attach"
WORLD = "world"
SECTIONS = ("tendon", "equality", "actuator")  # those of tendons before those that refer to them
CARRIED = ("asset", "default", "contact", "sensor", "deformable", "extension")
"""Sections that come whole: their elements are used by name, or noted."""
NAMES = {"name", "mesh", "material", "hfield", "texture", *REFERENCES}
CHILDREN = "childclass"
UNTIED = "is left out, as MuJoCo does: not all that it refers to is attached"

Remark = tuple[Element, str, bool]


@dataclass(frozen=True)
class Attachable:
    """Hold a model that can be attached: its root, whose elements know their scope and classes, and
    the class of what has none."""

    root: Element
    main: str


@dataclass
class AttachmentWriter:
    """Write out what is attached to one document.

    root: the document's
    opened: reads the model that an asset names; None where its file is not to be opened
    models: by their names
    sections: what comes with the bodies
    remarks: on what is left out
    """

    root: Element
    opened: Callable[[Element], Attachable | None]
    models: dict[str, Attachable | None] = field(default_factory=dict)
    sections: list[Element] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    count: int = 0

    def written(self) -> Element:
        """Return the whole document without <attach>, but for what is not opened."""
        for asset in (
            model for section in self.root.each("asset") for model in section.each("model")
        ):
            model = self.opened(asset)
            own = model.root.attributes.get("model", "") if model else ""
            self.models[asset.attributes.get("name", own)] = model
        children = [
            self.within(child, 2) if child.tag == "worldbody" else child
            for child in self.root.children
        ]
        return replace(self.root, children=[*children, *self.sections])

    def within(self, element: Element, depth: int) -> Element:
        """Return an element with what is attached in it; depth: of elements around what it
        holds."""
        inside = [
            self.attached(child, depth) if child.tag == ATTACH else self.within(child, depth + 1)
            for child in element.children
        ]
        return replace(element, children=inside)

    def attached(self, element: Element, depth: int) -> Element:
        """Return the frame that stands in the place of an <attach>."""
        # Which part of which model.
        if "model" not in element.attributes:
            return element
        name, prefix = element.text("model"), element.text("prefix")
        if name not in self.models:
            raise element.refusal(
                f"there is no model {xml.shortened(name)} among the assets; give the name of one"
            )
        model = self.models[name]
        if model is None:
            return element
        if "body" in element.attributes and "frame" in element.attributes:
            raise element.refusal("names a body and a frame; keep one of them")
        inside, childclass = self.chosen(element, model)
        # Its names; MuJoCo knows the world by its own name everywhere.
        known: Known = {"body": {WORLD}}
        for part in (part for child in inside for part in every(child)):
            self.count += 1
            if part.tag in KINDS and "name" in part.attributes:
                known.setdefault(KINDS[part.tag], set()).add(part.attributes["name"])
        if self.count > xml.MOST:
            raise element.refusal(
                f"makes more than {xml.MOST} elements, with the others; a mechanism has fewer"
            )
        # What comes with it.
        carried = [section for section in model.root.children if section.tag in CARRIED]
        carried += self.referring(model.root, known)
        self.sections += [prefixed(section, prefix, 1) for section in carried]
        so_far = replace(self.root, children=[*self.root.children, *self.sections])
        self.sections += taken_over(so_far, model.root)
        return replace(
            element,
            tag="frame",
            attributes={CHILDREN: childclass},
            children=[prefixed(child, prefix, depth + 1) for child in inside],
        )

    def chosen(self, element: Element, model: Attachable) -> tuple[list[Element], str]:
        """Return what is to be attached, and the class of what is in it."""
        worlds = [*model.root.each("worldbody")]
        whole = [replace(world, tag="frame") for world in worlds]
        kind = next((kind for kind in ("body", "frame") if kind in element.attributes), None)
        if kind is None:
            return whole, model.main
        name = element.text(kind)
        if kind == "body" and name == WORLD:
            body = replace(model.root, tag="body", attributes={"name": WORLD}, children=whole)
            return [body], model.main
        for world in worlds:
            for part, childclass in inheriting(world, model.main):
                if part.tag == kind and part.attributes.get("name") == name:
                    return [part], childclass
        raise element.refusal(
            f"there is no {kind} {xml.shortened(name)} in that model; give the name of one"
        )

    def referring(self, root: Element, known: Known) -> Iterator[Element]:
        """Yield the sections of a model with what refers only to what is known."""
        known = {kind: {*names} for kind, names in known.items()}
        for tag in SECTIONS:
            for section in root.each(tag):
                kept: list[Element] = []
                for child in section.children:
                    ties = [pair for part in every(child) for pair in references(part)]
                    if all(name in known.get(kind, ()) for kind, name in ties):
                        kept.append(child)
                    else:
                        self.remarks.append((child, UNTIED, False))
                if tag == "tendon":
                    called = (child.attributes.get("name", "") for child in kept)
                    known.setdefault("tendon", set()).update(called)
                yield replace(section, children=kept)


def inheriting(element: Element, childclass: str) -> Iterator[tuple[Element, str]]:
    """Yield all in an element, with the class that those around give to what is in it."""
    inner = element.attributes.get(CHILDREN, childclass)
    for child in element.children:
        yield child, inner
        yield from inheriting(child, inner)


def mesh_name(element: Element) -> str:
    """Return the name of a mesh, which may be that of its file."""
    file = PurePosixPath(element.attributes.get("file", "").replace("\\", "/"))
    return element.attributes.get("name") or file.stem


def prefixed(element: Element, prefix: str, depth: int) -> Element:
    """Return an element with a prefix before all names in it, but the world's where it is referred
    to."""
    if depth > xml.DEEPEST:
        raise element.refusal(f"is nested deeper than {xml.DEEPEST} where it is attached")
    attributes = {
        key: value
        if key not in NAMES or (REFERENCES.get(key) == "body" and value == WORLD)
        else prefix + value
        for key, value in element.attributes.items()
    }
    if element.tag == "mesh" and "name" not in attributes:
        attributes["name"] = prefix + mesh_name(element)
    children = [prefixed(child, prefix, depth + 1) for child in element.children]
    return replace(element, attributes=attributes, children=children)
