"""COLLADA files (.dae): the triangles of a file's scene, in metres.

A node moves what is in it by its transformations in their order, X = T_1 T_2 ... ; geometries stand
in nodes, by themselves or through a skin, and nodes of a library in others. Polygons are fans of
triangles, which weigh what the polygons weigh where these are flat.

The unit of length of the file counts; its upward axis does not, as it does not where robots are
shown from such files (RViz, Gazebo). A document type is refused, and nothing else is opened.

Source: COLLADA 1.4.1, https://www.khronos.org/collada.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator, MutableMapping
from dataclasses import dataclass
from math import radians
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.errors import LinkworkError

NODES = 20_000  # that stand in a scene, at most
MOST = 20_000_000  # triangles of a scene
PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")

Pieces = Iterator[tuple[np.ndarray, np.ndarray]]
"""Vertices (V, 3) and triangles on them (F, 3)."""


def read_collada(content: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices [m] and the triangles of a COLLADA file.

    Raises:
        LinkworkError: half a sentence on what is wrong with it.
    """
    parser = XMLParser(target=_ColladaBuilder())
    try:
        parser.feed(content)
        root = parser.close()
        pieces = list(_ColladaScene(root, _by_id(root)).pieces())
    except ParseError as error:
        raise LinkworkError(f"is not a COLLADA file that can be read: {error}") from None
    except (ValueError, IndexError) as error:
        reason = " ".join(str(error).split())[:100]
        raise LinkworkError(f"is not a COLLADA file that can be read: {reason}") from None
    if not pieces:
        raise LinkworkError("holds no triangles")
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    faces = [triangles + start for (_, triangles), start in zip(pieces, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in pieces]), np.concatenate(faces)


class _ColladaBuilder(TreeBuilder):
    """Build elements whose tags have no name space."""

    def start(self, tag: str, attrs: dict[str, str]) -> Element:  # pyright: ignore
        return super().start(tag.rpartition("}")[2], attrs)

    def end(self, tag: str) -> Element:
        return super().end(tag.rpartition("}")[2])

    def doctype(self, *_: object) -> None:
        raise LinkworkError("has a document type, which is refused: delete <!DOCTYPE ...>")


@dataclass(frozen=True)
class _ColladaScene:
    """Read what stands in the scene of a document; known: its elements by id."""

    root: Element
    known: MutableMapping[str, Element]

    def pieces(self) -> Pieces:
        """Yield the geometries of the scene; those of the libraries where there is no scene."""
        unit = self.root.find("asset/unit")
        metre = float(unit.get("meter", 1.0)) if unit is not None else 1.0
        place = np.diag([metre, metre, metre, 1.0])
        shown = self.root.find("scene/instance_visual_scene")
        scene = (
            self.root.find("library_visual_scenes/visual_scene")
            if shown is None
            else self._named(shown.get("url"))
        )
        standing = (
            [(mesh, place) for mesh in self.root.iterfind("library_geometries/geometry")]
            if scene is None
            else self._inside(scene, place)
        )
        count = 0
        for geometry, X in standing:
            for vertices, triangles in self._triangles(geometry):
                count += len(triangles)
                if count > MOST:
                    raise ValueError(f"more than {MOST} triangles stand in its scene")
                if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(vertices):
                    raise ValueError("triangles on points that it does not hold")
                turned = triangles[:, ::-1] if np.linalg.det(X[:3, :3]) < 0 else triangles
                yield vertices @ X[:3, :3].T + X[:3, 3], turned

    def _named(self, url: str | None) -> Element | None:
        """Return the element that an address in the file leads to, or None."""
        return self.known.get((url or "").removeprefix("#"))

    def _inside(self, scene: Element, place: np.ndarray) -> Iterator[tuple[Element, np.ndarray]]:
        """Yield the geometries in a scene, each with its pose and scale."""
        nodes, count = [(scene, place)], 0
        while nodes:
            node, X = nodes.pop()
            count += 1
            if count > NODES:
                raise ValueError(f"more than {NODES} nodes stand in its scene, or one in itself")
            # Transformations come first, then what they move.
            for child in node:
                X = X @ _transformation(child)
                if child.tag == "node":
                    nodes.append((child, X))
                    continue
                shown = child.tag.startswith("instance_")
                target = self._named(child.get("url")) if shown else None
                if target is None:
                    continue
                if child.tag == "instance_node":
                    nodes.append((target, X))
                elif child.tag == "instance_geometry":
                    yield target, X
                elif child.tag == "instance_controller":
                    yield from self._skinned(target, X)

    def _skinned(self, controller: Element, X: np.ndarray) -> Iterator[tuple[Element, np.ndarray]]:
        """Yield the geometry under a skin, where its bones have not moved it."""
        skin = controller.find("skin")
        geometry = None if skin is None else self._named(skin.get("source"))
        if skin is not None and geometry is not None:
            bind = skin.find("bind_shape_matrix")
            yield geometry, X if bind is None else X @ _numbers(bind).reshape(4, 4)

    def _triangles(self, geometry: Element) -> Pieces:
        """Yield the triangles of a geometry; names inside it come before others."""
        inner = _ColladaScene(geometry, ChainMap(_by_id(geometry), self.known))
        for part in geometry.iterfind("mesh/*"):
            if part.tag not in PRIMITIVES:
                continue
            inputs = list(part.iterfind("input"))
            width = 1 + max((int(each.get("offset", 0)) for each in inputs), default=0)
            corner = next((each for each in inputs if each.get("semantic") == "VERTEX"), None)
            if corner is None:
                continue
            place = int(corner.get("offset", 0))
            faces = [
                _fans(part.tag, row.reshape(-1, width)[:, place], counts)
                for row, counts in _rows(part, width)
            ]
            yield inner._points(corner), np.concatenate([np.empty((0, 3), np.int64), *faces])

    def _points(self, corner: Element) -> np.ndarray:
        """Return the points (V, 3) that corners name, through <vertices>."""
        vertices = self._named(corner.get("source"))
        held = [] if vertices is None else vertices.iterfind("input")
        place = next((each for each in held if each.get("semantic") == "POSITION"), None)
        source = None if place is None else self._named(place.get("source"))
        values = None if source is None else source.find("float_array")
        if source is None or values is None:
            raise ValueError("a mesh whose points are not there")
        accessor = source.find("technique_common/accessor")
        step = 3 if accessor is None else int(accessor.get("stride", 3))
        start = 0 if accessor is None else int(accessor.get("offset", 0))
        numbers = _numbers(values)[start:]
        return numbers[: len(numbers) // step * step].reshape(-1, step)[:, :3]


def _by_id(root: Element) -> dict[str, Element]:
    return {element.attrib["id"]: element for element in root.iter() if "id" in element.attrib}


def _numbers(element: Element, kind: type = float) -> np.ndarray:
    """Return the numbers that are an element's text."""
    return np.array((element.text or "").split(), dtype=kind)


def _rows(part: Element, width: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the numbers of a primitive, with how many corners each of its polygons has."""
    rows = [_numbers(row, np.int64) for row in (*part.iterfind("p"), *part.iterfind("ph/p"))]
    said = part.find("vcount")
    for row in rows:
        corners = len(row) // width
        if part.tag == "polylist" and said is not None:
            yield row, _numbers(said, np.int64)
        elif part.tag == "triangles":
            yield row, np.full(corners // 3, 3)
        else:
            yield row, np.array([corners])


def _fans(kind: str, corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Return triangles (F, 3) of polygons with so many corners each, one after the other, or of one
    strip."""
    if kind == "tristrips":
        strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
        strip[1::2] = strip[1::2, [1, 0, 2]]
        return strip
    inner = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, inner)
    along = np.arange(inner.sum()) - np.repeat(np.cumsum(inner) - inner, inner)
    return np.stack(
        [corners[first], corners[first + along + 1], corners[first + along + 2]], axis=1
    )


def _transformation(element: Element) -> np.ndarray:
    """Return the matrix (4, 4) that an element of a node is; one for others."""
    X = np.eye(4)
    match element.tag:
        case "matrix":
            return _numbers(element).reshape(4, 4)
        case "translate":
            X[:3, 3] = _numbers(element)
        case "scale":
            X[:3, :3] = np.diag(_numbers(element))
        case "rotate":
            *axis, angle = _numbers(element)
            size = np.linalg.norm(axis) or 1.0
            turn = radians(angle) * np.array(axis) / size
            X[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
        case "lookat" | "skew":
            raise ValueError(f"a node has a <{element.tag}>, which is not read")
    return X
