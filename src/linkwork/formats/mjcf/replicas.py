"""Replicas: <replicate> written out, as MuJoCo's own compiler does it.

Copy i of what stands in a <replicate> is turned by i times its Euler angles, R_i, and stands at

    p_0 = 0,    p_(i+1) = p_i + R_i offset

Its names end with sep and i, in as many digits as their number has. What refers to a copied joint,
site, body or geom from outside (tendons, actuators, equalities) is copied with it, behind all that
stands before: what the document says itself, and what came with <attach> and <replicate> ahead of
it in the tree. An equality that refers to a copied element and to one outside is not there at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from linkwork.formats import poses, xml
from linkwork.formats.xml import Element

REPLICATE = "replicate"
KINDS = {"body": "body", "joint": "joint", "freejoint": "joint", "geom": "geom", "site": "site"}
"""What has a name that others refer to, by tag."""
REFERENCES = {
    **dict.fromkeys(("body", "body1", "body2"), "body"),
    **dict.fromkeys(("joint", "joint1", "joint2", "jointinparent"), "joint"),
    **dict.fromkeys(("site", "site1", "site2", "refsite", "slidersite"), "site"),
    **dict.fromkeys(("cranksite", "sidesite"), "site"),
    **dict.fromkeys(("geom", "geom1", "geom2"), "geom"),
    **dict.fromkeys(("tendon", "tendon1", "tendon2"), "tendon"),
}
"""What an attribute refers to, by its name."""
SECTIONS = ("tendon", "equality", "actuator")  # those of tendons before those that refer to them
ATTACHED = "attached"
"""The attribute by which frames of attached parts, and the sections that come with them, are told:
a number."""

MANY = f"makes more than {xml.MOST} elements, with the others; a mechanism has fewer"

Known = dict[str, set[str]]  # names by what has them


@dataclass
class ReplicaWriter:
    """Write out the replicas of one document.

    turned: gives R_i of a <replicate>
    happened: the numbers of attached parts, and names and suffixes of each <replicate>, in the
        order of the tree, inner ones first
    lost: equalities that are not there
    """

    turned: Callable[[Element, int], np.ndarray]
    happened: list[str | tuple[Known, list[str]]] = field(default_factory=list)
    lost: list[Element] = field(default_factory=list)
    count: int = 0

    def written(self, root: Element) -> Element:
        """Return the whole document without <replicate>."""
        children = [self.within(child) for child in root.children]
        if not self.happened:
            return replace(root, children=children)

        def those(tag: str, number: str) -> list[Element]:
            all_of = (child for child in children if child.tag == tag)
            own = (each for each in all_of if each.attributes.get(ATTACHED, "") == number)
            return [child for section in own for child in section.children]

        made = {tag: those(tag, "") for tag in SECTIONS}
        for event in self.happened:
            for tag in SECTIONS:
                if isinstance(event, str):
                    made[tag] += those(tag, event)
                else:
                    made[tag] = self.referring(tag, made[tag], *event)
        rest = [child for child in children if child.tag not in SECTIONS]
        sections = [replace(root, tag=tag, attributes={}, children=made[tag]) for tag in SECTIONS]
        return replace(root, children=[*rest, *sections])

    def within(self, element: Element) -> Element:
        """Return an element with the replicas in it written out."""
        children: list[Element] = []
        for child in element.children:
            inner = self.within(child)
            children += self.copies(inner) if child.tag == REPLICATE else [inner]
        own = dict(element.attributes)
        if element.tag == "frame" and ATTACHED in own:
            self.happened.append(own.pop(ATTACHED))
        return replace(element, attributes=own, children=children)

    def copies(self, element: Element) -> Iterator[Element]:
        """Yield the frames of all copies of a <replicate> whose own contents are written out."""
        suffixes = suffixes_of(element)
        self.count += len(suffixes) * sum(1 for _ in every(element))
        if self.count > xml.MOST:
            raise element.refusal(MANY)
        names: Known = {}
        for part in every(element):
            if part is not element and part.tag in KINDS and "name" in part.attributes:
                names.setdefault(KINDS[part.tag], set()).add(part.attributes["name"])
        self.happened.append((names, suffixes))
        offset, place = np.array(element.vector("offset", (0.0, 0.0, 0.0))), np.zeros(3)
        for i, suffix in enumerate(suffixes):
            R = self.turned(element, i)
            pose = {
                "pos": " ".join(map(repr, place.tolist())),
                "quat": " ".join(map(repr, map(float, poses.to_quaternion(R)))),
            }
            own = {key: value for key, value in element.attributes.items() if key == "childclass"}
            inside = [renamed(child, names, suffix) for child in element.children]
            yield replace(element, tag="frame", attributes=own | pose, children=inside)
            place = place + R @ offset

    def referring(
        self, tag: str, there: list[Element], names: Known, suffixes: list[str]
    ) -> list[Element]:
        """Return the elements of a section, of which those that refer to copied ones are copied."""
        alone: list[Element] = []
        copied: list[Element] = []
        for child in there:
            inside = [
                value in names.get(kind, ())
                for part in every(child)
                for kind, value in references(part)
            ]
            if not any(inside):
                alone.append(child)
            elif tag == "equality" and not all(inside):
                self.lost.append(child)
            else:
                copied.append(child)
        if tag == "tendon":
            called = {child.attributes["name"] for child in copied if "name" in child.attributes}
            names["tendon"] = names.get("tendon", set()) | called
        more = [
            renamed(child, names, suffix, whole=True) for suffix in suffixes for child in copied
        ]
        return [*alone, *more]


def suffixes_of(element: Element) -> list[str]:
    """Return what stands behind the names in each copy of a <replicate>."""
    count = element.number("count")
    if count < 0 or count % 1:
        raise element.refusal(f"count is {count:g}; give a whole number, zero or more")
    if count > xml.MOST:
        raise element.refusal(MANY)
    digits, sep = len(str(int(count))), element.attributes.get("sep", "")
    return [f"{sep}{i:0{digits}d}" for i in range(int(count))]


def every(element: Element) -> Iterator[Element]:
    """Yield an element and all in it."""
    yield element
    for child in element.children:
        yield from every(child)


def references(element: Element) -> Iterator[tuple[str, str]]:
    """Yield what an element refers to: what it is, and its name."""
    for key, value in element.attributes.items():
        if key in REFERENCES:
            yield REFERENCES[key], value


def renamed(element: Element, names: Known, suffix: str, whole: bool = False) -> Element:
    """Return an element with a suffix behind the names of what is copied, and behind its own.

    whole: of what refers to copied elements, which has a name of its own
    """
    attributes = {
        key: value + suffix
        if (key == "name" and (whole or element.tag in KINDS))
        or (key in REFERENCES and value in names.get(REFERENCES[key], ()))
        else value
        for key, value in element.attributes.items()
    }
    children = [renamed(child, names, suffix) for child in element.children]
    return replace(element, attributes=attributes, children=children)
