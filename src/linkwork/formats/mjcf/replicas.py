"""Replicas: <replicate> written out, as MuJoCo's own compiler does it.

Copy i of what stands in a <replicate> is turned by i times its Euler angles, R_i, and stands at

    p_0 = 0,    p_(i+1) = p_i + R_i offset

Its names end with sep and i, in as many digits as their number has. What refers to a copied joint,
site, body or geom from outside (tendons, actuators, equalities) is copied with it, behind all that
does not; an equality that refers to a copied element and to one outside is not there at all.
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

Known = dict[str, set[str]]  # names by what has them


@dataclass
class ReplicaWriter:
    """Write out the replicas of one document.

    turned: gives R_i of a <replicate>
    copied: names and suffixes of each <replicate>, inner ones first
    lost: equalities that are not there
    """

    turned: Callable[[Element, int], np.ndarray]
    copied: list[tuple[Known, list[str]]] = field(default_factory=list)
    lost: list[Element] = field(default_factory=list)
    count: int = 0

    def written(self, root: Element) -> Element:
        """Return the whole document without <replicate>."""
        world = [self.within(child) for child in root.children]
        for names, suffixes in self.copied:
            for section in SECTIONS:
                world = [
                    self.referring(child, names, suffixes) if child.tag == section else child
                    for child in world
                ]
        return replace(root, children=world)

    def within(self, element: Element) -> Element:
        """Return an element with the replicas in it written out."""
        children: list[Element] = []
        for child in element.children:
            inner = self.within(child)
            children += self.copies(inner) if child.tag == REPLICATE else [inner]
        return replace(element, children=children)

    def copies(self, element: Element) -> Iterator[Element]:
        """Yield the frames of all copies of a <replicate> whose own contents are written out."""
        count = element.number("count")
        if count < 0 or count % 1:
            raise element.refusal(f"count is {count:g}; give a whole number, zero or more")
        self.count += int(count) * sum(1 for _ in every(element))
        if self.count > xml.MOST:
            raise element.refusal(
                f"makes more than {xml.MOST} elements, with the others; a mechanism has fewer"
            )
        digits, sep = len(str(int(count))), element.attributes.get("sep", "")
        suffixes = [f"{sep}{i:0{digits}d}" for i in range(int(count))]
        names: Known = {}
        for part in every(element):
            if part is not element and part.tag in KINDS and "name" in part.attributes:
                names.setdefault(KINDS[part.tag], set()).add(part.attributes["name"])
        self.copied.append((names, suffixes))
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

    def referring(self, section: Element, names: Known, suffixes: list[str]) -> Element:
        """Return a section whose elements that refer to copied ones are copied, too."""
        alone: list[Element] = []
        copied: list[Element] = []
        for child in section.children:
            inside = [
                value in names.get(kind, ())
                for part in every(child)
                for kind, value in references(part)
            ]
            if not any(inside):
                alone.append(child)
            elif section.tag == "equality" and not all(inside):
                self.lost.append(child)
            else:
                copied.append(child)
        if section.tag == "tendon":
            called = {child.attributes["name"] for child in copied if "name" in child.attributes}
            names["tendon"] = names.get("tendon", set()) | called
        more = [
            renamed(child, names, suffix, whole=True) for suffix in suffixes for child in copied
        ]
        return replace(section, children=[*alone, *more])


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
