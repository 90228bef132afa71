"""The scene as solids that browsers and files show, each fixed in a carrier: a body, the ground, or
a span between two points.

As they keep their shape, a pose moves only the carriers (`layout`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from linkwork.robot import Robot
from linkwork.scene import meshes
from linkwork.scene.colours import Colour
from linkwork.scene.meshes import POST, Mesh, PlacedMesh, frame_along
from linkwork.scene.parts import Bar, Coil, Hull, ScenePart
from linkwork.scene.scene import scene_of

# Thickness of plates, radius of the edges of hulls, relative to the mechanism.
PLATE, EDGE = 0.012, 0.0055
# Of springs: their number, and the radius of the wire relative to the mechanism.
COILS, WIRE = 8, 0.004
# By role, of what would hide joints and ground.
OPACITY = {"shell": 0.55, "base": 0.5, "floor": 0.5}
SHARP = 1e-6  # one less the cosine of the angle between two faces with an edge between them


@dataclass(frozen=True, eq=False)
class Fixture:
    """Hold a solid that is fixed in a carrier: a body, by name, or a span, by number; in the
    carrier's axes [m].

    mesh: its shape, scaled along its own axes by `scale` (3), turned by R (3, 3), and moved by
    `position` (3). In a span the scale along z is relative to the span's length. role: that of a
    part of the scene; of a body's hull "shell"
    """

    carrier: str | int
    role: str
    colour: Colour
    mesh: Mesh
    position: np.ndarray
    turn: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True, eq=False)
class Stretch:
    """Hold two points by their bodies' names and their places (3) in these bodies' axes [m]; z
    leads from one to the other."""

    bodies: tuple[str, str]
    points: tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Fixtures:
    """Hold all that is shown of a robot, and the spans that some of it is in; size, centre: of the
    mechanism [m]."""

    parts: tuple[Fixture, ...]
    spans: tuple[Stretch, ...]
    size: float
    centre: np.ndarray


def fixtures_of(robot: Robot) -> Fixtures:
    """Return what is shown of a robot."""
    scene = scene_of(robot, robot.home)
    maker = Maker(scene.pose.poses, scene.size)
    found = tuple(fixture for part in scene.parts for fixture in maker.fixtures(part))
    points = scene.pose.points
    return Fixtures(
        found,
        tuple(maker.spans.values()),
        scene.size,
        (points.min(axis=0) + points.max(axis=0)) / 2,
    )


class Maker:
    """Make solids of parts that are given in the ground's axes, the bodies in these poses; `spans`
    by name and number."""

    def __init__(self, poses: dict[str, tuple[np.ndarray, np.ndarray]], size: float):
        self.poses, self.size = poses, size
        self.spans: dict[tuple[str, int], Stretch] = {}

    def fixtures(self, part: ScenePart) -> Iterator[Fixture]:
        """Yield the solids of a part."""
        match part.form:
            case PlacedMesh() as piece:
                yield self.fixed(part, piece)
            case Coil() as coil:
                mesh = meshes.coil(COILS, coil.radius, WIRE * self.size)
                yield self.between(part, 0, PlacedMesh(mesh))
            case Bar() as line if len(part.bodies) > 1:
                scale = np.array([line.radius, line.radius, line.until])
                for k in range(len(part.bodies) - 1):
                    yield self.between(part, k, PlacedMesh(POST, scale=scale))
            case Bar() as line:
                yield self.fixed(part, bar(line.points, line.radius))
            case Hull() as hull if len(hull.around) > 1:
                yield self.fixed(part, PlacedMesh(meshes.solid(hull.points)), "shell")
                for ends in edges(hull.faces):
                    yield self.fixed(replace(part, role="member"), bar(ends, EDGE * self.size))
            case Hull() as hull:
                yield self.fixed(part, PlacedMesh(meshes.plate(hull.points, PLATE * self.size)))

    def fixed(self, part: ScenePart, piece: PlacedMesh, role: str = "") -> Fixture:
        """Fix a solid in the one body that its part moves with."""
        (body,) = part.bodies
        origin, turn = self.poses[body]
        own = piece.moved(-origin @ turn, turn.T)
        return Fixture(
            body, role or part.role, part.colour, own.mesh, own.position, own.turn, own.scale
        )

    def between(self, part: ScenePart, k: int, piece: PlacedMesh) -> Fixture:
        """Fix a solid in the span between a point of a part and the next one, which move with two
        bodies."""
        bodies = part.bodies[k], part.bodies[k + 1]
        points = part.form.points[k : k + 2]  # pyright: ignore
        start, end = (
            (p - self.poses[of][0]) @ self.poses[of][1]
            for of, p in zip(bodies, points, strict=True)
        )
        self.spans.setdefault((part.name, k), Stretch(bodies, (start, end)))
        number = list(self.spans).index((part.name, k))
        return Fixture(
            number, part.role, part.colour, piece.mesh, piece.position, piece.turn, piece.scale
        )


def bar(line: np.ndarray, radius: float) -> PlacedMesh:
    """Return a round bar along a polyline (k, 3)."""
    if len(line) > 2:
        return PlacedMesh(meshes.tube(line, radius))
    way = line[1] - line[0]
    return PlacedMesh(
        POST, line[0], frame_along(way), np.array([radius, radius, np.linalg.norm(way)])
    )


def edges(faces: list[np.ndarray]) -> Iterator[np.ndarray]:
    """Yield the edges (2, 3) of a solid of triangles (3, 3) where two of them meet at an angle."""
    normals: dict[frozenset[bytes], list[np.ndarray]] = {}
    for a, b, c in faces:
        normal = np.cross(b - a, c - a)
        for start, end in ((a, b), (b, c), (c, a)):
            known = normals.setdefault(frozenset((start.tobytes(), end.tobytes())), [])
            known.append(normal / np.linalg.norm(normal))
    for ends, (first, second) in normals.items():
        if abs(first @ second) < 1 - SHARP:
            yield np.stack([np.frombuffer(end) for end in ends])
