"""A film of a motion for a page: what is drawn as lists of points, and where the points are in
every frame.

Points are integers, in parts of 1/10000 of the mechanism's size about its middle, so that a film is
small and holds no text. The page's script (`templates/film.js`) draws it on a canvas and needs
nothing from elsewhere; a mechanism in space may be turned.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from linkwork.robot import Robot, State
from linkwork.scene.colours import BLUE, GREY, PINK, rgb
from linkwork.scene.meshes import PlacedMesh
from linkwork.scene.parts import Bar, Coil, Hull, ScenePart, moved
from linkwork.scene.scene import Scene, scene_of
from linkwork.views import plane, space
from linkwork.views.motion import nearest_samples, tool_places

FRAMES = 160  # at most
UNIT = 10_000  # parts of the mechanism's size
WIDE = 545  # width of a bar as thick as the mechanism is large [px]
LINES = {"member": "bar", "rod": "bar", "tube": "bar", "gear": "dashes"}  # what other lines are not
OUTLINE, WIRE = 1.2, 1.4  # widths of the edges of solids, and of springs [px]
TRIANGLES = 250  # of a mesh, at most
CUBE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1.0)])
ALONG = 400  # points of the tool's path, at most
SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10)
SHORTEST = 3.0  # how long a film should last as it begins to play [s]


@dataclass(frozen=True)
class Stroke:
    """Hold what is drawn through some points: a face, solid, bar, line, spring, dot or box, its
    colour and width [px].

    points: places in a frame; or of what stands still, in space (k, 3) [m]
    corners: of a solid, box or mesh, in the frame that its four points span: its origin and the
    tips of its axes; faces: of a mesh, three numbers of corners for each triangle
    faint: whether it belongs to what is laid over
    """

    kind: str
    points: Any
    colour: str
    width: float = 0.0
    corners: tuple[float, ...] = ()
    faces: tuple[int, ...] = ()
    faint: bool = False


@dataclass(frozen=True, eq=False)
class Film:
    """Hold the frames of a motion.

    time: of the frames (F,) [s]; points: (F, N, 3) [m]; parts: what is drawn through them; fixed:
    what stands still
    """

    time: np.ndarray
    points: np.ndarray
    parts: tuple[Stroke, ...]
    fixed: tuple[Stroke, ...]
    planar: bool

    @cached_property
    def frame(self) -> tuple[np.ndarray, float]:
        """Return the middle and the size of all that is drawn [m]."""
        low, high = self.reach.min(axis=0), self.reach.max(axis=0)
        return (low + high) / 2, float((high - low).max()) or 1.0

    @property
    def speed(self) -> float:
        """Return the speed at which the film begins to play: real time, or slower where it would be
        too short."""
        length = float(np.ptp(self.time))
        return max((s for s in SPEEDS if s <= 1 and length >= s * SHORTEST), default=SPEEDS[0])

    @property
    def data(self) -> str:
        """Return the film as JSON, to stand in a page."""
        middle, size = self.frame
        columns = slice(0, 2 if self.planar else 3)

        def whole(points: np.ndarray) -> list[int]:
            return (
                np.rint((points - middle)[..., columns] / size * UNIT).astype(int).ravel().tolist()
            )

        low, high = (
            np.rint((f(self.reach, axis=0) - middle) / size * UNIT) for f in (np.min, np.max)
        )
        elevation, azimuth = (90.0, -90.0) if self.planar else space.viewpoint(self.points[-1])
        content = {
            "planar": self.planar,
            "view": [elevation, azimuth],
            "low": low.tolist(),
            "high": high.tolist(),
            "speeds": SPEEDS,
            "speed": self.speed,
            "time": np.round(self.time - self.time[0], 9).tolist(),
            "start": float(self.time[0]),
            "parts": [
                [p.kind, p.points, p.colour, p.width, p.corners, p.faces, int(p.faint)]
                for p in self.parts
            ],
            "fixed": [
                [part.kind, whole(part.points), part.colour, part.width] for part in self.fixed
            ],
            "frames": [whole(points) for points in self.points],
        }
        return json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")

    @cached_property
    def reach(self) -> np.ndarray:
        """Return all points that are drawn (., 3) [m]."""
        moving = (self.drawn(part).reshape(-1, 3) for part in self.parts)
        return np.concatenate([*moving, *(part.points for part in self.fixed)])

    def drawn(self, part: Stroke) -> np.ndarray:
        """Return the points (F, k, 3) of what is drawn, of a solid its corners [m]."""
        points = self.points[:, list(part.points)]
        if not part.corners:
            return points
        origin, axes = points[:, :1], points[:, 1:] - points[:, :1]
        return origin + np.reshape(part.corners, (-1, 3)) @ axes


def film(
    robot: Robot,
    time: np.ndarray,
    states: State,
    frames: int = FRAMES,
    over: tuple[np.ndarray, State] | None = None,
) -> Film:
    """Make the film of a motion: all samples, or as many of them as there shall be frames, evenly
    in time.

    Args:
        robot: the robot; time: of the samples (K,) [s], increasing; states: at these times (K,).
        frames: at most.
        over: times and states of another motion of the robot, which is shown faintly at the same
            times, and stands still before and after it.
    """
    shown = np.unique(
        np.searchsorted(time, np.linspace(time[0], time[-1], min(frames, len(time))) - 1e-12)
    )
    both, strokes, points, still = [states.at(shown)], [], [], []
    if over is not None:
        both.insert(0, over[1].at(nearest_samples(over[0], time[shown])))
    # What is laid over first, so that it lies below.
    for number, seen in enumerate(both):
        scene = scene_of(robot, seen.at(0), seen)
        parts = sorted(scene.parts, key=lambda part: part.look.level)
        shelf = Shelf(scene, sum(own.shape[1] for own in points))
        moving = (
            stroke for part in parts if not still_drawn(part) for stroke in shelf.strokes(part)
        )
        strokes += [replace(stroke, faint=number < len(both) - 1) for stroke in moving]
        points.append(shelf.all)
        last = number == len(both) - 1
        ground = (part for part in parts if still_drawn(part))
        still += [stroke_of_ground(scene, p) for p in ground if last or p.role == "rail"]
    still += [] if over is None else path(robot, over[1], PINK)
    still += path(robot, states)
    return Film(
        time[shown], np.concatenate(points, axis=1), tuple(strokes), tuple(still), robot.planar
    )


class Shelf:
    """Put away the points (F, k, 3) [m] of a scene's parts in all frames, one after the other; each
    body's frame once. before: how many points others have put away."""

    def __init__(self, scene: Scene, before: int = 0):
        self.scene, self.count = scene, before
        self.points: list[np.ndarray] = []
        self.frames: dict[str, range] = {}

    @property
    def all(self) -> np.ndarray:
        """Return all of its points (F, N, 3)."""
        return np.concatenate(self.points, axis=1)

    def add(self, points: np.ndarray) -> range:
        """Put points (F, k, 3) away and return their places."""
        self.points.append(points)
        self.count += points.shape[1]
        return range(self.count - points.shape[1], self.count)

    def frame(self, body: str) -> range:
        """Return the places of a corner and its neighbours of a cube that moves with a body from
        the ground's axes."""
        if body not in self.frames:
            self.frames[body] = self.add(moved(self.scene.size * CUBE, (body,), self.scene.moves))
        return self.frames[body]

    def strokes(self, part: ScenePart) -> Iterator[Stroke]:
        """Yield what draws a part."""
        scene, form, colour = self.scene, part.form, "#{:02x}{:02x}{:02x}".format(*rgb(part.colour))
        if isinstance(form, PlacedMesh) and part.role != "member" and form.is_disc(scene.flat):
            at = self.add(moved(form.position[None], part.bodies, scene.moves))
            yield Stroke("dot", tuple(at), colour, WIDE / 2 * form.scale[0] / scene.size)
        # Meshes by faces or outlines; then what is made of points.
        elif isinstance(form, PlacedMesh) and not form.mesh.convex:
            piece = form.coarser(TRIANGLES)
            corners = (piece.corners / scene.size).round(5).ravel().tolist()
            faces = piece.mesh.faces
            if scene.flat:
                # Seen along z, whatever the body does: the higher on top.
                faces = faces[np.argsort(piece.corners[faces].mean(axis=1)[:, 2])]
            numbers = tuple(faces.ravel().tolist())
            at = tuple(self.frame(part.bodies[0]))
            yield Stroke("mesh", at, colour, 0.0, tuple(corners), numbers)
        elif isinstance(form, PlacedMesh):
            corners = np.unique((form.corners / scene.size).round(5), axis=0)
            kind = "solid" if part.role == "member" else "box"
            yield Stroke(
                kind,
                tuple(self.frame(part.bodies[0])),
                colour,
                OUTLINE,
                tuple(corners.ravel().tolist()),
            )
        else:
            points = moved(form.points, part.bodies, scene.moves)
            at = self.add(replace(form, points=points).shown if isinstance(form, Bar) else points)
            if isinstance(form, Hull):
                yield from (
                    Stroke("face", tuple(at[k] for k in face), colour) for face in form.around
                )
            elif isinstance(form, Coil):
                yield Stroke("spring", tuple(at), colour, WIRE)
            else:
                yield Stroke(
                    LINES.get(part.role, "line"), tuple(at), colour, WIDE * form.radius / scene.size
                )


def still_drawn(part: ScenePart) -> bool:
    """Tell whether a part is drawn once below all frames: of what stands still all but meshes,
    which are seen from all sides."""
    mesh = isinstance(part.form, PlacedMesh) and not part.form.mesh.convex
    return part.look.grounded and not mesh


def stroke_of_ground(scene: Scene, part: ScenePart) -> Stroke:
    """Return what draws a rail, a floor, a stand or the base."""
    match part.form:
        case Bar() as rail:
            below = scene.flat and part.role == "rail"
            ends = plane.floor_of(rail.points, scene.size) if below else rail.points
            return Stroke("line", ends, GREY, 2.0)
        case PlacedMesh() as pad if scene.flat:
            return Stroke("line", plane.bearing(pad.position, scene.size), GREY, 1.5)
        case PlacedMesh() as pad:
            return Stroke("ground", pad.corners, str(part.colour))
        case form:
            return Stroke("ground", form.points, str(part.colour))


def path(robot: Robot, states: State, colour: str = BLUE) -> Iterator[Stroke]:
    """Yield the path of the tool."""
    if robot.mechanism.tools:
        path = tool_places(robot, states)[:: -(-len(states.q) // ALONG)]
        yield Stroke("line", path * [1, 1, 0] if robot.planar else path, colour, 1.5)
