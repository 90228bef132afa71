"""Attached models: <attach> written out, as MuJoCo's own compiler does it.

A body, a frame or all that is in the world of another model, an asset of this one, stands in the
place of <attach>, with the prefix before all its names. A body or frame keeps the class that its
own model gives to what is in it, not the frames around it. Tendons, equalities and actuators of
the other model come with it, behind those that are there, if all that they refer to is attached, or
stands before under the same name with the prefix. A tendon that has a part which is attached goes
on through what stands before without the prefix, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

from linkwork.formats import xml
from linkwork.formats.mjcf.options import taken_over
from linkwork.formats.mjcf.replicas import (
    ATTACHED,
    KINDS,
    MANY,
    REFERENCES,
    REPLICATE,
    SECTIONS,
    Known,
    every,
    references,
    suffixes_of,
)
from linkwork.formats.xml import Element

ATTACH = "attach"
WORLD = "world"
CARRIED = ("asset", "default", "contact", "sensor", "deformable", "extension")
"""Sections that come whole: their elements are used by name, or noted."""
NAMES = {"name", "mesh", "material", "hfield", "texture", *REFERENCES}
PATHS = ("fixed", "spatial")
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
    before: what stands before in the document
    """

    root: Element
    opened: Callable[[Element], Attachable | None]
    models: dict[str, Attachable | None] = field(default_factory=dict)
    sections: list[Element] = field(default_factory=list)
    remarks: list[Remark] = field(default_factory=list)
    before: Known = field(default_factory=dict)
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
        _called(element, self.before)
        copied = element.tag == REPLICATE
        around = {kind: {*names} for kind, names in self.before.items()} if copied else {}
        inside = [
            self.attached(child, depth) if child.tag == ATTACH else self.within(child, depth + 1)
            for child in element.children
        ]
        # What is copied has other names behind its <replicate>.
        if copied:
            suffixes = suffixes_of(element)
            inner, self.before = self.before, around
            for kind, names in inner.items():
                new = names - around.get(kind, set())
                around.setdefault(kind, set()).update(n + end for n in new for end in suffixes)
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
        # Its names.
        known: Known = {"body": {WORLD}}
        for part in (part for child in inside for part in every(child)):
            self.count += 1
            _called(part, known)
        if self.count > xml.MOST:
            raise element.refusal(MANY)
        # What comes with it.
        carried = [section for section in model.root.children if section.tag in CARRIED]
        number = {ATTACHED: str(len(self.sections))}
        self.sections += [prefixed(section, prefix, 1) for section in carried]
        for section in self.referring(model.root, known, prefix):
            self.sections.append(replace(section, attributes=number))
        so_far = replace(self.root, children=[*self.root.children, *self.sections])
        self.sections += taken_over(so_far, model.root)
        return replace(
            element,
            tag="frame",
            attributes={CHILDREN: childclass} | number,
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

    def referring(self, root: Element, known: Known, prefix: str) -> Iterator[Element]:
        """Yield the sections of a model with what refers only to what is there, the names with the
        prefix; known: what is attached, without it."""
        there = self.before
        for kind, names in known.items():
            there.setdefault(kind, set()).update(map(prefix.__add__, names))
        there["body"].add(WORLD)  # by its own name everywhere
        for tag in SECTIONS:
            for section in root.each(tag):
                kept = [(child, _carried(child, prefix, there)) for child in section.children]
                self.remarks += [(child, UNTIED, False) for child, made in kept if made is None]
                children = [made for _, made in kept if made is not None]
                if tag == "tendon":
                    names = (child.attributes.get("name", "") for child in children)
                    there.setdefault("tendon", set()).update(names)
                yield replace(section, children=children)


def _called(element: Element, names: Known) -> None:
    """Add the name of an element that others may refer to."""
    if element.tag in KINDS and "name" in element.attributes:
        names.setdefault(KINDS[element.tag], set()).add(element.attributes["name"])


def _carried(element: Element, prefix: str, there: Known) -> Element | None:
    """Return a tendon, equality or actuator that is attached, or None where it is left out."""
    made = prefixed(element, prefix, 2)
    if element.tag not in PATHS:
        return made if all(_stands(part, there) for part in every(made)) else None
    # Parts of a tendon are looked for with the prefix, then without it; one at least has it.
    both = zip(made.children, element.children, strict=True)
    parts = [part if _stands(part, there) else own for part, own in both]
    named = [
        part is not own
        for part, own in zip(parts, element.children, strict=True)
        if [*references(own)]
    ]
    if not any(named) or not all(_stands(part, there) for part in parts):
        return None
    return replace(made, children=parts)


def _stands(element: Element, there: Known) -> bool:
    return all(name in there.get(kind, ()) for kind, name in references(element))


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
