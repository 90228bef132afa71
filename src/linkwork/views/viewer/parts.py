"""What is shown of a robot: solids, each fixed in a carrier, which is a body, the ground, or a span between two points.

All follow from the skeleton of the reference configuration: bodies are their shapes, or plates, bars or arcs between the
places of their joints; joints are drawn as their kind. As parts keep their shape, a pose moves only the carriers (`scene`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, assert_never

import numpy as np

from linkwork.equations.algebra import rotation_matrix
from linkwork.mechanism import GROUND, Box, Capsule, Cylinder, Mechanism, Polygon, Sphere
from linkwork.mechanism.limits import limited
from linkwork.mechanism.shapes import Shape
from linkwork.robot import Robot
from linkwork.views.shapes import hull
from linkwork.views.skeleton import SLIDING, JointPlace, Pose, Skeleton, skeleton
from linkwork.views.viewer.meshes import BALL, BLOCK, POST, Mesh, capsule, coil, frame_along, plate, slab, solid, tube

Role = Literal["member", "shell", "joint", "driven", "ground", "mass", "rod"]

BAR, ROD, PLATE = 0.011, 0.007, 0.012  # radii of bars and rods, thickness of plates, relative to the mechanism
EDGE, TIP = 0.0055, 0.010  # radii of a solid's edges, and of the balls at the ends of a rod
KNOB, MASS = 0.017, 0.035  # radii of spherical joints and of point masses
HINGE, SLEEVE, ARM = (
    (0.017, 0.05),
    (0.016, 0.085),
    (0.011, 0.055),
)  # radius, length of hinges, sleeves, universal joints
NUT, DISC = (0.028, 0.026), (0.034, 0.012)  # of a screw's nut, and of a planar joint
SLIDER, CUBE, PAD = (0.04, 0.04, 0.06), (0.035, 0.035, 0.035), (0.09, 0.09, 0.008)  # sides of boxes
RAIL, OVERHANG = 0.008, 0.3  # radius of a rail, and what it is longer at either end than the slider needs
TUBE, TUBE_PART = 0.013, 0.55  # radius of a telescope's tube, and its part of the length
COILS, COIL, WIRE = 8, 0.022, 0.004


@dataclass(frozen=True, eq=False)
class Part:
    """Hold a solid that is fixed in a carrier: a body, by name, or a span, by number; in the carrier's axes [m].

    mesh: its shape, scaled along its own axes by `scale` (3), turned by R (3, 3), and moved by `position` (3). In a span
    the scale along z is relative to the span's length. colour: red, green, blue from 0 to 1; of its role if left out
    """

    carrier: str | int
    role: Role
    mesh: Mesh
    position: np.ndarray
    turn: np.ndarray
    scale: np.ndarray
    colour: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Span:
    """Hold two points by their bodies' names and their places (3) in these bodies' axes [m]; z leads from one to the other."""

    bodies: tuple[str, str]
    points: tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class Parts:
    """Hold all that is shown of a robot; size, centre: largest extent and middle of the mechanism [m]."""

    parts: tuple[Part, ...]
    spans: tuple[Span, ...]
    size: float
    centre: np.ndarray


def parts_of(robot: Robot) -> Parts:
    """Return what is shown of a robot."""
    poses = {GROUND: (np.zeros(3), np.eye(3))} | robot.body_poses(robot.home)
    pose = skeleton(robot, robot.home)
    size = float(np.ptp(pose.points, axis=0).max()) or 1.0
    maker = Maker(robot.mechanism, poses, pose, size)
    spans, stretched = maker.spans()
    found = (*maker.members(), *maker.joints(), *maker.masses(), *maker.stands(), *stretched)
    return Parts(found, spans, size, (pose.points.min(axis=0) + pose.points.max(axis=0)) / 2)


@dataclass(frozen=True, eq=False)
class Maker:
    """Make parts of a skeleton, given in the ground's axes; lengths are relative to the mechanism's size [m]."""

    mechanism: Mechanism
    poses: dict[str, Pose]
    skeleton: Skeleton
    size: float

    # Solids in the ground's axes, fixed in a body

    def fixed(self, body: str, part: Part) -> Part:
        origin, turn = self.poses[body]
        return replace(part, carrier=body, position=(part.position - origin) @ turn, turn=turn.T @ part.turn)

    def mesh(self, body: str, role: Role, mesh: Mesh) -> Part:
        return self.fixed(body, Part(body, role, mesh, np.zeros(3), np.eye(3), np.ones(3)))

    def bar(self, body: str, role: Role, start: np.ndarray, end: np.ndarray, radius: float) -> Part:
        """Return a round bar between two points."""
        thick = radius * self.size
        scale = np.array([thick, thick, np.linalg.norm(end - start)])
        return self.fixed(body, Part(body, role, POST, start, frame_along(end - start), scale))

    def ball(self, body: str, role: Role, centre: np.ndarray, radius: float) -> Part:
        return self.fixed(body, Part(body, role, BALL, centre, np.eye(3), np.full(3, radius * self.size)))

    def box(self, body: str, role: Role, centre: np.ndarray, turn: np.ndarray, sides: tuple[float, ...]) -> Part:
        return self.fixed(body, Part(body, role, BLOCK, centre, turn, self.size * np.array(sides)))

    def pin(self, body: str, role: Role, place: np.ndarray, axis: np.ndarray, form: tuple[float, float]) -> Part:
        """Return a cylinder about an axis, its middle at a place; form: radius and length."""
        half = form[1] / 2 * self.size * axis
        return self.bar(body, role, place - half, place + half, form[0])

    # Bodies

    def members(self) -> Iterator[Part]:
        """Yield bodies as their shapes, or as plates, solids, bars or arcs; a single point is shown by its joint."""
        for name, body in self.mechanism.bodies.items():
            yield from (shaped(name, shape) for shape in body.shapes)
        bare = {name: points for name, points in self.skeleton.bodies.items() if name not in self.skeleton.solids}
        for name, points in bare.items():
            faces = hull(points)
            if len(faces) > 1:
                yield self.mesh(name, "shell", solid(points))
                for start, end in edges(faces):
                    yield self.bar(name, "member", start, end, EDGE)
            elif len(faces[0]) == 2:
                yield self.bar(name, "member", faces[0][0], faces[0][1], BAR)
            elif len(faces[0]) > 2:
                yield self.mesh(name, "member", plate(points, PLATE * self.size))
        for name, points in self.skeleton.arcs.items():
            yield self.mesh(name, "member", tube(points, BAR * self.size))

    def masses(self) -> Iterator[Part]:
        for name, place in self.skeleton.masses.items():
            yield self.ball(name, "mass", place, MASS)

    def stands(self) -> Iterator[Part]:
        """Yield pads under what stands on ground: springs' anchors, and joints that do not slide."""
        for joint in self.skeleton.joints:
            if joint.grounded and joint.type not in (*SLIDING, "planar"):
                upright = len(joint.axes) > 0 and abs(joint.axes[0][2]) > 0.9
                yield self.pad(joint.near, HINGE[1] / 2 if upright else KNOB)
        for anchor in self.skeleton.anchors:
            yield self.pad(anchor, KNOB)

    def pad(self, place: np.ndarray, below: float) -> Part:
        down = (below + PAD[2] / 2) * self.size * np.eye(3)[2]
        return self.box(GROUND, "ground", place - down, np.eye(3), PAD)

    # Joints

    def joints(self) -> Iterator[Part]:
        """Yield the joints as their kind, and the rails of those that slide on ground."""
        for joint in self.skeleton.joints:
            if not joint.tubed:
                yield from self.symbol(joint)
            if joint.grounded and joint.type in SLIDING:
                yield self.rail(joint)

    def symbol(self, joint: JointPlace) -> Iterator[Part]:
        """Yield the solids of a joint, each fixed in the body that it belongs to."""
        outer = joint.connects[1]
        role: Role = "driven" if joint.driven else "joint"
        place, axis = joint.far, joint.axes[0] if len(joint.axes) else np.eye(3)[2]
        if joint.type == "rod":
            for body, end in joint.ends:
                yield self.ball(body, "rod", end, TIP)
        elif joint.type == "universal":
            for body, arm in zip(joint.connects, joint.axes, strict=True):
                yield self.pin(body, role, place, arm, ARM)
        elif joint.type == "spherical":
            yield self.ball(outer, role, place, KNOB)
        elif joint.type == "prismatic":
            yield self.box(outer, role, place, frame_along(axis), SLIDER)
        elif joint.type == "fixed":
            yield self.box(outer, role, place, np.eye(3), CUBE)
        elif joint.type == "planar":
            yield self.pin(outer, role, place, axis, DISC)
        else:
            yield self.pin(outer, role, place, axis, HINGE if joint.type == "revolute" else SLEEVE)
            if joint.type == "screw":
                yield self.pin(outer, role, place, axis, NUT)

    def rail(self, joint: JointPlace) -> Part:
        """Return the rail of a joint that slides on ground: over its limits, or as far as the mechanism is large."""
        forwards = joint.connects[0] == GROUND
        anchor, slider = (joint.near, joint.far) if forwards else (joint.far, joint.near)
        axis = joint.axes[0] if forwards else -joint.axes[0]
        low, high = travel(self.mechanism, joint)
        here, half = float((slider - anchor) @ axis), SLIDER[2] / 2 * self.size
        low = min(here, 0.0) - OVERHANG * self.size if low is None else min(here, low) - half
        high = max(here, 0.0) + OVERHANG * self.size if high is None else max(here, high) + half
        return self.bar(GROUND, "ground", anchor + low * axis, anchor + high * axis, RAIL)

    # Spans

    def spans(self) -> tuple[tuple[Span, ...], list[Part]]:
        """Return rods, telescopes, the rods of sliders between moving bodies, and springs, as spans and their parts."""
        spans: list[Span] = []
        parts: list[Part] = []
        for joint in self.skeleton.joints:
            if joint.type == "rod" or (joint.type in SLIDING and not joint.grounded):
                spans.append(self.span(joint.connects, joint.near, joint.far))
                parts.append(self.stretched(len(spans) - 1, "rod", ROD))
            if joint.tubed:
                parts.append(self.stretched(len(spans) - 1, "driven" if joint.driven else "member", TUBE, TUBE_PART))
        for name, (start, end) in self.skeleton.springs.items():
            spans.append(self.span(self.mechanism.springs[name].connects, start, end))
            mesh = coil(COILS, COIL * self.size, WIRE * self.size)
            parts.append(Part(len(spans) - 1, "joint", mesh, np.zeros(3), np.eye(3), np.ones(3)))
        return tuple(spans), parts

    def stretched(self, span: int, role: Role, radius: float, part: float = 1.0) -> Part:
        scale = np.array([radius * self.size, radius * self.size, part])
        return Part(span, role, POST, np.zeros(3), np.eye(3), scale)

    def span(self, bodies: tuple[str, str], start: np.ndarray, end: np.ndarray) -> Span:
        (p, R), (o, Q) = (self.poses[body] for body in bodies)
        return Span(bodies, ((start - p) @ R, (end - o) @ Q))


def shaped(body: str, shape: Shape) -> Part:
    """Return a shape of a body."""
    match shape:
        case Box():
            mesh, scale, low = BLOCK, shape.size, 0.0
        case Cylinder():
            mesh, scale, low = POST, (shape.radius, shape.radius, shape.length), -shape.length / 2
        case Sphere():
            mesh, scale, low = BALL, (shape.radius,) * 3, 0.0
        case Capsule():
            mesh, scale, low = capsule(shape.length / shape.radius), (shape.radius,) * 3, 0.0
        case Polygon():
            mesh, scale, low = slab(counter_clockwise(np.array(shape.points)), shape.thickness), (1.0,) * 3, 0.0
        case _:
            assert_never(shape)
    turn = rotation_matrix(shape.frame.rotation)
    position = np.array(shape.frame.position) + low * turn[:, 2]
    return Part(body, "member", mesh, position, turn, np.array(scale), shape.colour)


def counter_clockwise(corners: np.ndarray) -> np.ndarray:
    """Return the corners (k, 2) of a convex polygon in counter-clockwise order."""
    (a, b), (c, d) = corners[1] - corners[0], corners[2] - corners[1]
    return corners if a * d > b * c else corners[::-1]


def edges(faces: list[np.ndarray]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the edges of a solid of triangles (3, 3) where two of them meet at an angle."""
    normals: dict[frozenset[bytes], list[np.ndarray]] = {}
    for a, b, c in faces:
        normal = np.cross(b - a, c - a)
        for start, end in ((a, b), (b, c), (c, a)):
            known = normals.setdefault(frozenset((start.tobytes(), end.tobytes())), [])
            known.append(normal / np.linalg.norm(normal))
    for ends, (first, second) in normals.items():
        if abs(first @ second) < 1 - 1e-6:
            start, end = (np.frombuffer(end) for end in ends)
            yield start, end


def travel(mechanism: Mechanism, joint: JointPlace) -> tuple[float | None, float | None]:
    """Return the limits [m] of the slide of a joint."""
    for label, limits, _ in limited(mechanism):
        if label in (joint.name, f"{joint.name}.slide") and joint.type != "screw":
            return limits.lower, limits.upper
    return None, None
