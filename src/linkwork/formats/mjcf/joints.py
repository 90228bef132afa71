"""The joints of an MJCF body as joints of a mechanism.

A body of several hinges and slides hangs on a chain through massless bodies, so that every joint
keeps its name. Where nothing is lost by it the joints are one: without names, or with those that an
exported joint has ("wrist.angle_1", "wrist.angle_2"), two crossing perpendicular hinges are a
universal joint, a hinge and a slide of one axis a cylindrical one, two slides and a hinge across
them a planar one, three perpendicular slides and a ball a free one. A hinge and a slide of one axis
that a linear joint equality couples are a screw.

A joint whose pieces stand in reverse order was written from its second body: it leads from the body
to its parent. The rates of a ball are components in the axes of F1: these are the axes of its
actuators, if they are named "ball.wx".

With F1 the joint frame where the body stands at qpos0, and J the joint's motion, the second frame
is F2 = F1 J(ref): coordinates here are the file's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.tree import ModelBody, ModelTree, Piece
from linkwork.formats.names import FreeNames
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    Body,
    CylindricalJoint,
    FixedJoint,
    Frame,
    FreeJoint,
    PairJoint,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    ScrewJoint,
    SphericalJoint,
    UniversalJoint,
)
from linkwork.mechanism.joints import ManyFreedoms

MOST = 4  # pieces of one joint
NEAR = 1e-9  # directions [1] and, times the size of the numbers, places [m] that agree


@dataclass(frozen=True)
class Coupling:
    """Hold a joint equality: coordinate - ref = offset + ratio x + c_2 x^2 + ...,  x = other
    coordinate - other ref; powers: c_2, c_3 ..."""

    element: Element
    joint: str
    other: str
    offset: float
    ratio: float
    powers: tuple[float, ...] = ()


@dataclass(frozen=True)
class DrivenBall:
    """Hold the axes along which a ball is driven, in the body at qpos0, and whether they move with
    the body."""

    axes: np.ndarray
    from_body: bool = False


@dataclass
class Joints:
    """Gather joints, the massless bodies between them, and what became of the file's joints.

    Attributes:
        joints, bodies: by name.
        slots: the coordinates of each joint of the file, in the order of qpos; none for the slide
            of a screw.
        coordinates: by the name of a hinge or slide in the file.
        balls, floats: the joint by the name of a ball or a free joint in the file.
        last: by the name of a body, the joint that carries it.
        groups: by the name of a joint, the pieces that it was made of.
        screws: the slides that follow their hinge as parts of screws.
    """

    joints: dict[str, PairJoint] = field(default_factory=dict)
    bodies: dict[str, Body] = field(default_factory=dict)
    slots: list[tuple[str, ...]] = field(default_factory=list)
    coordinates: dict[str, str] = field(default_factory=dict)
    balls: dict[str, str] = field(default_factory=dict)
    floats: dict[str, str] = field(default_factory=dict)
    last: dict[str, str] = field(default_factory=dict)
    groups: dict[str, JointGroup] = field(default_factory=dict)
    screws: set[str] = field(default_factory=set)


@dataclass(frozen=True)
class JointGroup:
    """Hold one joint to be: its type, its pieces with the freedom that each brings, its frames at
    qpos0, its fields."""

    type: type[PairJoint]
    name: str | None
    pieces: tuple[Piece, ...]
    freedoms: tuple[str, ...]  # of the pieces in their order; none for the slide of a screw
    first: np.ndarray
    motion: np.ndarray
    fields: Mapping[str, Any] = field(default_factory=dict)
    advance: float = 0.0  # how far F1 stands along a screw's axis from where F2 starts [m]
    backwards: bool = False  # the first frame is in the body, the second in its parent

    @property
    def axes(self) -> np.ndarray:
        """Return the axes of F1 in the body at qpos0, (3, 3)."""
        return self.first[:3, :3]

    def reversed(self) -> JointGroup:
        """Return the joint from the body to its parent, made of pieces that were turned round."""
        pieces, freedoms = self.pieces[::-1], self.freedoms[::-1]
        return replace(
            self, pieces=tuple(map(Piece.reversed, pieces)), freedoms=freedoms, backwards=True
        )


def read_joints(
    tree: ModelTree,
    couplings: Mapping[str, Coupling],
    drives: Mapping[str, DrivenBall],
    names: FreeNames,
    body_names: FreeNames,
) -> Joints:
    """Return the joints of all bodies.

    Args:
        couplings: joint equalities by the name of the coupled joint that nothing else moves or
            uses.
        drives: how balls are driven, by name.
        names, body_names: give names to joints and to massless bodies.
    """
    # Joints of MJCF that together are one joint here form a group; a body with several is a chain.
    made = Joints()
    for node in tree.nodes.values():
        groups = _groups(node, couplings, drives, made.screws)
        before, place = node.parent, node.pose
        # A body without joints is welded to its parent.
        if not groups:
            name = names.give(node.name)
            made.joints[name] = FixedJoint(
                connects=(before, node.name), frames=(poses.frame_of(place), Frame())
            )
        for index, group in enumerate(groups):
            # Between two groups of one body stands a body without mass.
            last = index == len(groups) - 1
            body = (
                node.name
                if last
                else body_names.give(f"{node.name}_{group.pieces[-1].name or index + 1}")
            )
            if not last:
                made.bodies[body] = Body(mass=0.0)
            name = names.give(
                group.name or node.name, group.pieces[0].element if group.name else None
            )
            made.joints[name] = _joint(group, (before, body), place, name)
            made.last[body] = name
            made.groups[name] = group
            _record(made, group, name)
            before, place = body, np.eye(4)
    return made


def _joint(group: JointGroup, connects: tuple[str, str], place: np.ndarray, name: str) -> PairJoint:
    element = group.pieces[0].element
    free, frames = group.pieces[0].kind == "free", (Frame(), Frame())
    if free and any(group.pieces[0].spring.pulls):  # its turn is counted from where it rests
        frames = Frame(), poses.frame_of(poses.pose(rotation=place[:3, :3].T))
    elif not free:
        ahead = poses.shift(group.advance * np.asarray(group.fields.get("axis", np.zeros(3))))
        near, far = group.first @ ahead, group.first @ group.motion
        frames = (
            poses.frame_of(near if group.backwards else place @ near),
            poses.frame_of(place @ far if group.backwards else far),
        )
    ends = connects[::-1] if group.backwards else connects
    fields = {key: _plain(value) for key, value in group.fields.items()}
    return element.make(
        group.type, connects=ends, frames=frames, **fields, **_effects(group, place)
    )


def _effects(group: JointGroup, place: np.ndarray) -> dict[str, Any]:
    """Return friction, spring, limits and rotor inertia as the fields of the joint; a free joint
    has them in every freedom, and its spring rests where the body stands."""
    parts = list(zip(group.freedoms, group.pieces, strict=True))
    if group.pieces[0].kind == "free":
        (piece,), rests = group.pieces, (*map(float, place[:3, 3]), 0.0)
        springs = [
            piece.spring.model_copy(update={"rest": rest if any(piece.spring.pulls) else 0.0})
            for rest in rests
        ]
        freedoms = zip(FreeJoint.freedoms, springs, strict=True)
        parts = [(freedom, replace(piece, spring=spring)) for freedom, spring in freedoms]
    found: dict[str, dict[str, Any]] = {}
    for freedom, piece in parts:
        for key, value in piece.effects().items():
            found.setdefault(key, {})[freedom] = value
    if issubclass(group.type, ManyFreedoms):
        return found
    return {key: value for key, by_freedom in found.items() for value in by_freedom.values()}


def _plain(value: Any) -> Any:
    """Return an axis, or a pair of axes, as a record wants them."""
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return poses.triple(value) if isinstance(value, np.ndarray) else value


def _record(made: Joints, group: JointGroup, name: str) -> None:
    """Note the coordinates of the pieces by order and by name."""
    coordinates = made.joints[name].coordinates(name)
    for freedom, piece in zip(group.freedoms, group.pieces, strict=True):
        label = {piece.name: name} if piece.name else {}
        match piece.kind:
            case "free":
                made.slots.append(coordinates)
                made.floats |= label
            case "ball":
                made.slots.append(coordinates[-4:])
                made.balls |= label
            case _ if freedom:
                slot = name if coordinates == (name,) else f"{name}.{freedom}"
                made.slots.append((slot,))
                made.coordinates |= dict.fromkeys(label, slot)
            case _:
                made.slots.append(())


# ----------------------------------------------------------------------------------------- grouping


def _groups(
    node: ModelBody,
    couplings: Mapping[str, Coupling],
    drives: Mapping[str, DrivenBall],
    screws: set[str],
) -> list[JointGroup]:
    """Split a body's joints into groups, each one joint of the mechanism."""
    groups, start = [], 0
    while start < len(node.pieces):
        left = list(node.pieces[start : start + MOST])
        group = _screw(left[:2], couplings, screws) or _several(left) or _single(left[0], drives)
        groups.append(group)
        start += len(group.pieces)
    return groups


def _several(pieces: list[Piece]) -> JointGroup | None:
    """Return the joint that the first few pieces are together, as they stand or written from the
    second body."""
    group = _free(pieces[:4]) or _planar(pieces[:3]) or _pair(pieces[:2])
    if group is not None:
        return group
    for count, recognise in ((4, _free), (3, _planar), (2, _pair)):
        turned = [piece.reversed() for piece in reversed(pieces[:count])]
        group = recognise(turned) if all(piece.name for piece in turned) else None
        if group is not None:
            return group.reversed()
    return None


def _common_name(pieces: list[Piece], freedoms: tuple[str, ...]) -> tuple[bool, str | None]:
    """Tell whether pieces may be one joint: they have no names (None is returned) or those of one
    exported joint."""
    names = [piece.name for piece in pieces]
    if not any(names):
        return True, None
    base = (names[0] or "").rpartition(".")[0]
    return bool(base) and names == [f"{base}.{freedom}" for freedom in freedoms], base


def _single(piece: Piece, drives: Mapping[str, DrivenBall]) -> JointGroup:
    at = poses.shift(piece.anchor)
    match piece.kind:
        case "hinge":
            motion, fields = poses.turn(piece.axis, piece.ref), {"axis": piece.axis}
            return JointGroup(RevoluteJoint, piece.name, (piece,), ("angle",), at, motion, fields)
        case "slide":
            motion, fields = poses.shift(piece.ref * piece.axis), {"axis": piece.axis}
            return JointGroup(PrismaticJoint, piece.name, (piece,), ("slide",), at, motion, fields)
        case "ball":
            drive = drives.get(piece.name or "", DrivenBall(np.eye(3)))
            first = poses.pose(piece.anchor, drive.axes)
            return JointGroup(
                SphericalJoint,
                piece.name,
                (piece,),
                ("turn",),
                first,
                np.eye(4),
                backwards=drive.from_body,
            )
    return JointGroup(FreeJoint, piece.name, (piece,), ("turn",), np.eye(4), np.eye(4))


def _pair(pieces: list[Piece]) -> JointGroup | None:
    """Return a universal or cylindrical joint, if two pieces are one."""
    kinds = tuple(piece.kind for piece in pieces)
    if kinds == ("hinge", "hinge"):
        return _universal(*pieces)
    if set(kinds) != {"hinge", "slide"} or not _parallel(*(piece.axis for piece in pieces)):
        return None
    freedoms = tuple("angle" if kind == "hinge" else "slide" for kind in kinds)
    allowed, name = _common_name(pieces, freedoms)
    if not allowed:
        return None
    hinge, slide = pieces if kinds[0] == "hinge" else pieces[::-1]
    motion = poses.turn(hinge.axis, hinge.ref) @ poses.shift(slide.ref * hinge.axis)
    fields = {"axis": hinge.axis}
    return JointGroup(
        CylindricalJoint, name, tuple(pieces), freedoms, poses.shift(hinge.anchor), motion, fields
    )


def _universal(one: Piece, two: Piece) -> JointGroup | None:
    normal, apart = np.cross(one.axis, two.axis), two.anchor - one.anchor
    crossing = abs(one.axis @ two.axis) < NEAR and abs(apart @ normal) < NEAR * (
        1 + np.linalg.norm(apart)
    )
    freedoms = ("angle_1", "angle_2")
    allowed, name = _common_name([one, two], freedoms)
    if not (crossing and allowed):
        return None
    centre = one.anchor + (apart @ one.axis) * one.axis
    second = poses.turn(one.axis, -one.ref)[:3, :3] @ two.axis
    motion = poses.turn(one.axis, one.ref) @ poses.turn(second, two.ref)
    fields = {"axes": (one.axis, second)}
    return JointGroup(
        UniversalJoint, name, (one, two), freedoms, poses.shift(centre), motion, fields
    )


def _planar(pieces: list[Piece]) -> JointGroup | None:
    if [piece.kind for piece in pieces] != ["slide", "slide", "hinge"]:
        return None
    one, two, hinge = pieces
    allowed, name = _common_name(pieces, ("x", "y", "angle"))
    normal = np.cross(one.axis, two.axis)
    if not allowed or abs(one.axis @ two.axis) > NEAR or abs(abs(normal @ hinge.axis) - 1) > NEAR:
        return None
    left_handed = normal @ hinge.axis < 0
    x, y = (two, one) if left_handed else (one, two)
    freedoms = ("y", "x", "angle") if left_handed else ("x", "y", "angle")
    at_hinge = poses.pose(hinge.anchor, np.column_stack([x.axis, y.axis, hinge.axis]))
    slid = np.array([x.ref, y.ref, 0.0])
    first = at_hinge @ poses.shift(-slid)
    motion = poses.shift(slid) @ poses.turn((0.0, 0.0, 1.0), hinge.ref)
    return JointGroup(PlanarJoint, name, tuple(pieces), freedoms, first, motion)


def _free(pieces: list[Piece]) -> JointGroup | None:
    """Return a free joint, if three slides and a ball are one."""
    if [piece.kind for piece in pieces] != ["slide", "slide", "slide", "ball"]:
        return None
    freedoms = FreeJoint.freedoms
    allowed, name = _common_name(pieces, freedoms)
    E = np.column_stack([piece.axis for piece in pieces[:3]])
    if not allowed or np.linalg.norm(E.T @ E - np.eye(3)) > NEAR or np.linalg.det(E) < 0:
        return None
    slid = np.array([piece.ref for piece in pieces[:3]])
    first = poses.pose(pieces[3].anchor, E) @ poses.shift(-slid)
    return JointGroup(FreeJoint, name, tuple(pieces), freedoms, first, poses.shift(slid))


def _screw(
    pieces: list[Piece], couplings: Mapping[str, Coupling], screws: set[str]
) -> JointGroup | None:
    """Return a screw, if the slide of a hinge and a slide follows the hinge by a joint equality and
    has no effects."""
    if {piece.kind for piece in pieces} != {"hinge", "slide"} or not _parallel(
        *(piece.axis for piece in pieces)
    ):
        return None
    hinge, slide = sorted(pieces, key=lambda piece: piece.kind)
    coupling = couplings.get(slide.name or "")
    if coupling is None or coupling.other != hinge.name or slide.effects():
        return None
    screws.add(coupling.joint)
    motion = poses.turn(hinge.axis, hinge.ref) @ poses.shift(
        coupling.ratio * hinge.ref * hinge.axis
    )
    fields = {"axis": hinge.axis, "pitch": coupling.ratio}
    freedoms = tuple("angle" if piece is hinge else "" for piece in pieces)
    at = poses.shift(hinge.anchor)
    return JointGroup(
        ScrewJoint, hinge.name, tuple(pieces), freedoms, at, motion, fields, coupling.offset
    )


def _parallel(one: np.ndarray, two: np.ndarray) -> bool:
    """Tell whether two unit vectors point the same way."""
    return bool(np.linalg.norm(one - two) < NEAR)
