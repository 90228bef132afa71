"""The ways of MJCF's spatial tendons: points, pulleys, and the surfaces that they are led round."""

from __future__ import annotations

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.geoms import kind_of, measured
from linkwork.formats.mjcf.loops import LoopReader
from linkwork.formats.xml import Element
from linkwork.mechanism import CablePart, OverCylinder, OverSphere, PulleyBlock, ViaPoint


def cable_path(
    element: Element, document: Document, loops: LoopReader
) -> tuple[tuple[CablePart, ...], set[str]]:
    """Return the way of a cable, and the sites that say by which side it is led."""
    path: list[CablePart] = []
    sides: set[str] = set()
    for part in element.children:
        if part.tag == "site":
            body, X = loops.site(element, part.text("site"))
            path.append(ViaPoint(body=body, point=poses.triple(X[:3, 3])))
        elif part.tag == "pulley":
            path.append(part.make(PulleyBlock, divisor=part.number("divisor")))
        else:
            path.append(_surface(part, document, loops))
            sides |= {part.text("sidesite")} if "sidesite" in part.attributes else set()
    return tuple(path), sides


def _surface(part: Element, document: Document, loops: LoopReader) -> OverSphere | OverCylinder:
    """Return the surface of a geom that a cable is led round, by its sidesite, or through where
    that lies within."""
    name = part.text("geom")
    if name not in loops.tree.geoms:
        raise part.refusal(f"there is no geom {name!r}")
    body, X, geom = loops.tree.geoms[name]
    kind = {"sphere": OverSphere, "cylinder": OverCylinder}.get(kind_of(geom))
    if kind is None:
        raise part.refusal(f"{name!r} is no sphere and no cylinder; wrap round one of these")
    size, place = measured(document, geom)
    fields = {"body": body, "frame": poses.frame_of(X @ place), "radius": float(size[0])}
    if "sidesite" in part.attributes:
        owner, at = loops.site(part, part.text("sidesite"))
        away = np.linalg.norm(at[:3, 3] - (X @ place)[:3, 3])
        if owner == body and away < size[0]:
            fields["inside"] = True
        else:
            fields["side"] = ViaPoint(body=owner, point=poses.triple(at[:3, 3]))
    return part.make(kind, **fields)
