"""A film of a motion for a page: what is drawn as lists of points, and where the points are in every frame.

Points are integers, in parts of 1/10000 of the mechanism's size about its middle, so that a film is small and holds no
text. The page's script (`templates/film.js`) draws it on a canvas and needs nothing from elsewhere; a mechanism in space
may be turned.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from linkwork.robot import Robot, State
from linkwork.views import space
from linkwork.views.plane import fixed_side
from linkwork.views.shapes import hull
from linkwork.views.skeleton import SLIDING, Skeleton, skeleton
from linkwork.views.style import BLUE, EDGE, GREEN, GREY, INK, LINK, ORANGE, PLATE, VERMILION

FRAMES = 160  # at most
UNIT = 10_000  # parts of the mechanism's size
TRIAD = 0.08  # length of a tool's axes, relative to the mechanism
OVERHANG = 0.05  # of a rail beyond what its slider uses, relative to the mechanism
BASE = "#e3e8ec"
ALONG = 400  # points of the tool's path, at most
SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10)
SHORTEST = 3.0  # how long a film should last as it begins to play [s]


@dataclass(frozen=True)
class Part:
    """Hold what is drawn through some points: a face, solid, bar, line, spring, dot or box, its colour and width [px].

    points: places in a frame; or of what stands still, in space (k, 3) [m]
    corners: of a solid, in the frame that its four points span: its origin and the tips of its axes
    """

    kind: str
    points: Any
    colour: str
    width: float = 0.0
    corners: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Film:
    """Hold the frames of a motion.

    time: of the frames (F,) [s]; points: (F, N, 3) [m]; parts: what is drawn through them; fixed: what stands still
    """

    time: np.ndarray
    points: np.ndarray
    parts: tuple[Part, ...]
    fixed: tuple[Part, ...]
    planar: bool

    @cached_property
    def frame(self) -> tuple[np.ndarray, float]:
        """Return the middle and the size of all that is drawn [m]."""
        low, high = self.reach.min(axis=0), self.reach.max(axis=0)
        return (low + high) / 2, float((high - low).max()) or 1.0

    @property
    def speed(self) -> float:
        """Return the speed at which the film begins to play: real time, or slower where it would be too short."""
        length = float(np.ptp(self.time))
        return max((s for s in SPEEDS if s <= 1 and length >= s * SHORTEST), default=SPEEDS[0])

    @property
    def data(self) -> str:
        """Return the film as JSON, to stand in a page."""
        middle, size = self.frame
        columns = slice(0, 2 if self.planar else 3)

        def whole(points: np.ndarray) -> list[int]:
            return np.rint((points - middle)[..., columns] / size * UNIT).astype(int).ravel().tolist()

        low, high = (np.rint((f(self.reach, axis=0) - middle) / size * UNIT) for f in (np.min, np.max))
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
            "parts": [[part.kind, part.points, part.colour, part.width, part.corners] for part in self.parts],
            "fixed": [[part.kind, whole(part.points), part.colour, part.width] for part in self.fixed],
            "frames": [whole(points) for points in self.points],
        }
        return json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")

    @cached_property
    def reach(self) -> np.ndarray:
        """Return all points that are drawn (., 3) [m]."""
        moving = (self.drawn(part).reshape(-1, 3) for part in self.parts)
        return np.concatenate([*moving, *(part.points for part in self.fixed)])

    def drawn(self, part: Part) -> np.ndarray:
        """Return the points (F, k, 3) of what is drawn, of a solid its corners [m]."""
        points = self.points[:, list(part.points)]
        if not part.corners:
            return points
        origin, axes = points[:, :1], points[:, 1:] - points[:, :1]
        return origin + np.reshape(part.corners, (-1, 3)) @ axes


def film(robot: Robot, time: np.ndarray, states: State, frames: int = FRAMES) -> Film:
    """Make the film of a motion: all samples, or as many of them as there shall be frames, evenly in time.

    Args:
        robot: the robot; time: of the samples (K,) [s], increasing; states: at these times (K,).
    """
    shown = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], min(frames, len(time))) - 1e-12))
    poses = [skeleton(robot, states.at(int(k))) for k in shown]
    size = float(np.ptp(np.concatenate([pose.points for pose in poses]), axis=0).max()) or 1.0
    placed = robot.body_poses(states.at(shown))
    layouts = [
        layout(pose, size)
        | {("frame", name): tips(placed[name][0][k], placed[name][1][k], size) for name in pose.solids}
        for k, pose in enumerate(poses)
    ]
    points = np.stack([np.concatenate([*named.values()]) for named in layouts])
    return Film(
        time[shown],
        points,
        tuple(parts(poses[0], layouts[0], robot.planar)),
        tuple(fixed(robot, states, poses, size)),
        robot.planar,
    )


Layout = dict[tuple[str, str], np.ndarray]


def layout(pose: Skeleton, size: float) -> Layout:
    """Return the points (k, 3) [m] of a pose by what they belong to, in one order for all poses."""
    found: Layout = {("body", name): points for name, points in pose.bodies.items()}
    found |= {("arc", name): points for name, points in pose.arcs.items()}
    found |= {("joint", joint.name): np.stack([joint.near, joint.far]) for joint in pose.joints}
    found |= {("spring", name): points for name, points in pose.springs.items()}
    found |= {("mass", name): place[None] for name, place in pose.masses.items()}
    return found | {("tool", name): tips(origin, axes, TRIAD * size) for name, (origin, axes) in pose.tools.items()}


def tips(origin: np.ndarray, axes: np.ndarray, length: float) -> np.ndarray:
    """Return the origin of a frame and the tips of its axes (4, 3)."""
    return np.stack([origin, *(origin + length * axes.T)])


def parts(pose: Skeleton, named: Layout, planar: bool) -> Iterator[Part]:
    """Yield what is drawn, what lies below first."""
    from matplotlib.colors import to_hex

    starts = dict(zip(named, np.cumsum([0, *(len(points) for points in named.values())]).tolist(), strict=False))

    def at(kind: str, name: str, *indices: int) -> tuple[int, ...]:
        return tuple(starts[kind, name] + index for index in indices)

    for name, solids in pose.solids.items():
        frame = named["frame", name]
        axes = frame[1:] - frame[0]  # in rows, of one length
        for solid in solids:
            corners = (np.unique(solid.corners, axis=0) - frame[0]) @ axes.T / (axes[0] @ axes[0])
            yield Part(
                "solid",
                at("frame", name, 0, 1, 2, 3),
                to_hex(solid.colour),
                1.2,
                tuple(corners.round(5).ravel().tolist()),
            )
    for name, points in ((name, points) for name, points in pose.bodies.items() if name not in pose.solids):
        corners = points * (1, 1, 0) if planar else points
        for face in hull(corners):
            indices = [int(np.linalg.norm(corners - corner, axis=1).argmin()) for corner in face]
            if len(indices) > 1:
                kind, colour = ("face", PLATE) if len(indices) > 2 else ("bar", LINK)
                yield Part(kind, at("body", name, *indices), colour, 6.0)
    for name, points in pose.arcs.items():
        yield Part("bar", at("arc", name, *range(len(points))), LINK, 6.0)
    for joint in pose.joints:
        if joint.type == "rod":
            yield Part("bar", at("joint", joint.name, 0, 1), LINK, 2.5)
        elif joint.tubed:
            yield Part("bar", at("joint", joint.name, 0, 1), ORANGE if joint.driven else LINK, 7.0)
    for name in pose.springs:
        yield Part("spring", at("spring", name, 0, 1), INK, 1.4)
    for joints in pose.gears.values():
        yield Part("dashes", tuple(at("joint", joint.name, 1)[0] for joint in joints), GREY, 1.4)
    for name in pose.masses:
        yield Part("dot", at("mass", name, 0), EDGE, 8.0)
    for joint in pose.joints:
        if joint.type != "rod" and not joint.tubed:
            kind, width = ("box", 6.5) if joint.type in SLIDING else ("dot", 4.5)
            yield Part(kind, at("joint", joint.name, 1), ORANGE if joint.driven else "#ffffff", width)
    for name in pose.tools:
        for axis, colour in ((1, VERMILION), (2, GREEN)) if planar else ((1, VERMILION), (2, GREEN), (3, BLUE)):
            yield Part("line", at("tool", name, 0, axis), colour, 2.2)


def fixed(robot: Robot, states: State, poses: Sequence[Skeleton], size: float) -> Iterator[Part]:
    """Yield what stands still: the base, rails and bearings on the ground, the path of the tool."""
    grounded = [places for places in zip(*(pose.joints for pose in poses), strict=True) if places[-1].grounded]
    anchors = [fixed_side(places)[0][0] for places in grounded]
    if not robot.planar and len(anchors) > 2:
        for face in hull(np.array(anchors)):
            yield Part("ground", face, BASE)
    for places, anchor in zip(grounded, anchors, strict=True):
        if places[-1].type in SLIDING:
            travel = fixed_side(places)[1]
            ends = [min(0.0, *travel) - OVERHANG * size, max(0.0, *travel) + OVERHANG * size]
            yield Part("line", anchor + np.outer(ends, places[-1].axes[0]), GREY, 2.0)
        else:
            yield Part("pad", anchor[None], GREY, 7.0)
    for end in poses[0].anchors:
        yield Part("pad", end[None], GREY, 7.0)
    if robot.mechanism.tools:
        path = robot.tool_pose(states)[:: -(-len(states.q) // ALONG)]
        in_space = np.pad(path[:, :2], ((0, 0), (0, 1))) if robot.planar else path[:, :3]
        yield Part("line", in_space, BLUE, 1.5)
