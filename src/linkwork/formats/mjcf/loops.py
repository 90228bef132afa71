"""The equality constraints of an MJCF model as joints; those of tendons: `mjcf.tendons`.

    connect, alone                   a spherical joint; a revolute one where the tree between the
                                     two bodies moves in a plane anyway (hinges of one direction,
                                     slides across it): the motion is the same
    connects of the same two bodies  on one line: a revolute joint about it; else a fixed joint
    weld                             a fixed joint; without torque (torquescale 0) a connect
    joint                            a gear, a locked joint where only one is named

Where body names and an anchor are given, the two bodies fit together at qpos0; sites fit where they
are.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.polynomial import Polynomial

from linkwork.formats import poses
from linkwork.formats.followers import held
from linkwork.formats.mjcf.document import Document, flag
from linkwork.formats.mjcf.joints import Coupling, Joints
from linkwork.formats.mjcf.tree import ModelTree, plane_normal
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    FixedJoint,
    Frame,
    GearJoint,
    Joint,
    PairJoint,
    RevoluteJoint,
    SphericalJoint,
)

CONNECTS = 100  # of two bodies
APART, PART = 1e-6, 1e-4
"""What points are apart that are one, and distances that are equal [m]; as part of the mechanism's
size, where that is less."""
PLANAR = "closes a loop that moves in a plane and is taken as a revolute joint across it"
LOST = "; nothing is lost"  # by PLANAR, where the points meet
OFF = ", on one axis with both points, which stay apart along it"
TURNED = "; MuJoCo's forces, equal at points that are apart, turn what carries the loop"
POLYNOMIAL = (0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Equality:
    """Hold a connect or weld: the two bodies, and the frames in them that meet (of a connect only
    the origins count)."""

    element: Element
    bodies: tuple[str, str]
    frames: tuple[np.ndarray, np.ndarray]
    sites: tuple[str, ...] = ()

    @property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        return self.frames[0][:3, 3], self.frames[1][:3, 3]

    def between(self, bodies: tuple[str, str]) -> Equality:
        """Return the same tie with the bodies in a given order."""
        return (
            self
            if self.bodies == bodies
            else Equality(self.element, bodies, (self.frames[1], self.frames[0]), self.sites)
        )


@dataclass
class Ties:
    """Hold what closes loops or pulls, as far as it was understood."""

    points: list[Equality] = field(default_factory=list)
    welds: list[Equality] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    tendons: list[Element] = field(default_factory=list)
    sites: set[str] = field(default_factory=set)


class LoopReader:
    """Read the section <equality> of a document whose tree is known; standing: the tree with mocap
    bodies where a keyframe puts them."""

    def __init__(self, document: Document, tree: ModelTree, standing: ModelTree, notes: Notes):
        self.document, self.tree, self.notes = document, tree, notes
        self.standing = standing.poses()
        self.turns = {body: X[:3, :3] for body, X in self.standing.items()}
        self.at_zero, self.at_rest = tree.poses(), tree.poses(tree.positions(springs=True))
        self.pieces = {piece.name: piece for _, piece in tree.pieces() if piece.name}
        self.apart = APART

    def ties(self) -> Ties:
        """Return the active equality constraints by what they hold together."""
        found = Ties()
        for raw in self.document.each("equality"):
            element = self.document.resolved(raw, "equality")
            if "equality" in self.document.off:
                self.notes.on(element, "is left out: the options switch equalities off")
                continue
            if not flag(element, "active", True):
                self.notes.on(element, "is left out: it is not active")
                continue
            match element.tag:
                case "connect":
                    found.points.append(self._tie(element))
                case "weld" if element.number("torquescale", 1.0) == 0:
                    found.points.append(self._tie(element))
                case "weld":
                    found.welds.append(self._tie(element))
                case "joint":
                    found.couplings += self._coupling(element)
                case "tendon":
                    found.tendons.append(element)
                case _:
                    self.notes.on(
                        element,
                        "is left out: only connect, weld, joint and tendon are joints",
                        alters=True,
                    )
        found.sites = {site for tie in (*found.points, *found.welds) for site in tie.sites}
        return found

    # -------------------------------------------------------------------------------- connect, weld

    def _tie(self, element: Element) -> Equality:
        if "site1" in element.attributes:
            names = element.text("site1"), element.text("site2")
            ends = [self.site(element, name) for name in names]
            return self._checked(
                Equality(element, (ends[0][0], ends[1][0]), (ends[0][1], ends[1][1]), names)
            )
        one = self.body(element, element.text("body1"))
        two = self.body(element, element.attributes.get("body2", "world"))
        across = poses.inverse(self.at_zero[one]) @ self.at_zero[two]
        if element.tag == "connect":
            near = poses.shift(element.vector("anchor"))
            return self._checked(
                Equality(element, (one, two), (near, poses.inverse(across) @ near))
            )
        far = poses.shift(element.vector("anchor", (0.0, 0.0, 0.0)))
        relative = element.numbers("relpose", (7,), (0.0,) * 7)
        given = np.linalg.norm(relative[3:]) > 0
        near = (
            poses.pose(relative[:3], poses.from_quaternion(*relative[3:]))
            if given
            else across @ far
        )
        return self._checked(Equality(element, (one, two), (near, far)))

    def _checked(self, tie: Equality) -> Equality:
        if tie.bodies[0] == tie.bodies[1]:
            raise tie.element.refusal(f"holds {tie.bodies[0]!r} to itself; name two bodies")
        return tie

    def body(self, element: Element, name: str) -> str:
        if name not in self.tree.bodies:
            raise element.refusal(f"there is no body {name!r}")
        return self.tree.bodies[name]

    def site(self, element: Element, name: str) -> tuple[str, np.ndarray]:
        if name not in self.tree.sites:
            raise element.refusal(f"there is no site {name!r}")
        return self.tree.sites[name]

    def closing(self, ties: Ties, names: FreeNames) -> dict[str, PairJoint]:
        """Return the joints that connects and welds are."""
        made: dict[str, PairJoint] = {}
        self.apart = min(APART, PART * self._size(ties)) or APART
        pairs: dict[frozenset[str], list[Equality]] = {}
        for tie in ties.points:
            pairs.setdefault(frozenset(tie.bodies), []).append(tie)
        for group in pairs.values():
            for name, joint in self._connected([tie.between(group[0].bodies) for tie in group]):
                made[names.give(name)] = joint
        for tie in ties.welds:
            frames = poses.frame_of(tie.frames[0]), poses.frame_of(tie.frames[1])
            made[names.give(tie_name(tie))] = FixedJoint(connects=tie.bodies, frames=frames)
        return made

    def _size(self, ties: Ties) -> float:
        """Return the largest extent of all bodies' origins and of the points that are held."""
        places = [X[:3, 3] for X in self.standing.values()]
        places += [
            (self.standing[body] @ [*point, 1.0])[:3]
            for tie in ties.points
            for body, point in zip(tie.bodies, tie.points, strict=True)
        ]
        return float(np.ptp(places, axis=0).max())

    def _connected(self, ties: list[Equality]) -> list[tuple[str, PairJoint]]:
        """Return the one joint that several connects of the same two bodies are, or one spherical
        joint for each."""
        # How far apart the points lie, in either body.
        connects, name = ties[0].bodies, tie_name(ties[0])
        if len(ties) > CONNECTS:
            raise ties[0].element.refusal(
                f"and {len(ties) - 1} more hold the same two bodies together; three fix them"
            )
        points = np.array([tie.points for tie in ties])  # (ties, 2, 3)
        apart = {(i, j): points[j] - points[i] for i, j in combinations(range(len(ties)), 2)}
        lengths = {pair: np.linalg.norm(gap, axis=1) for pair, gap in apart.items()}
        longest = max(lengths, key=lambda pair: lengths[pair][0], default=None)
        # Points that coincide are one ball.
        if longest is None or lengths[longest][0] < self.apart:
            return [(name, self._ball(ties[0]))]
        # Differently far apart they fit no rigid joint: each stays a ball of its own.
        if any(abs(near - far) > self.apart for near, far in lengths.values()):
            self.notes.on(
                ties[0].element,
                "and others hold points together that lie differently far apart in the two bodies",
            )
            return [(tie_name(tie), self._ball(tie)) for tie in ties]
        # Two points, or three in line, are a hinge about that line.
        centre = points[list(longest)].mean(axis=0)
        axes = [poses.unit(gap) for gap in apart[longest]]
        away = points[:, 0] - centre[0]
        away = away - np.outer(away @ axes[0], axes[0])
        corner = int(np.argmax(np.linalg.norm(away, axis=1)))
        if np.linalg.norm(away[corner]) < self.apart:
            return [(name, self._hinge(connects, centre, axes))]
        # A third point off their line fixes all: both frames have the line and that point in
        # common.
        arms = points[corner] - centre
        near, far = (
            poses.pose(p, poses.across(z, arm))
            for p, z, arm in zip(centre, axes, arms, strict=True)
        )
        frames = poses.frame_of(near), poses.frame_of(far)
        return [(name, FixedJoint(connects=connects, frames=frames))]

    def _hinge(
        self, connects: tuple[str, str], centre: np.ndarray, axes: list[np.ndarray]
    ) -> RevoluteJoint:
        """Return a revolute joint about z of its frames, at zero where the bodies stand at
        qpos0."""
        one, two = (self.turns[body] for body in connects)
        first = poses.across(axes[0], np.eye(3)[np.argmin(abs(axes[0]))])
        second = poses.across(axes[1], two.T @ one @ first[:, 0])
        frames = (
            poses.frame_of(poses.pose(centre[0], first)),
            poses.frame_of(poses.pose(centre[1], second)),
        )
        return RevoluteJoint(connects=connects, frames=frames)

    def _ball(self, tie: Equality) -> PairJoint:
        """Return a spherical joint, at rest where the bodies stand at qpos0; a revolute one in a
        planar loop."""
        normal, carried = self._plane(tie.bodies)
        if normal is not None:
            axes = [self.turns[body].T @ normal for body in tie.bodies]
            # What the points are apart across the plane no motion changes: one axis has both.
            places = zip(tie.bodies, tie.points, strict=True)
            near, far = (normal @ (self.standing[body] @ [*p, 1.0])[:3] for body, p in places)
            centre = np.array([tie.points[0], tie.points[1] + (near - far) * axes[1]])
            off = float(abs(near - far)) > self.apart
            remark = f"{PLANAR}{OFF if off else LOST}" + (TURNED if off and carried else "")
            self.notes.on(tie.element, remark, alters=off and carried)
            return self._hinge(tie.bodies, centre, axes)
        turn = self.turns[tie.bodies[1]].T @ self.turns[tie.bodies[0]]
        frames = (
            Frame(position=poses.triple(tie.points[0])),
            poses.frame_of(poses.pose(tie.points[1], turn)),
        )
        return SphericalJoint(connects=tie.bodies, frames=frames)

    def _plane(self, bodies: tuple[str, str]) -> tuple[np.ndarray | None, bool]:
        """Return the normal of the plane in which the tree moves one body relative to another, if
        it is a plane, and whether joints of both carry it."""
        chains = [self.tree.chain(body) for body in bodies]
        common = {node.name for node in chains[0]} & {node.name for node in chains[1]}
        between = [node for chain in chains for node in chain if node.name not in common]
        normal = plane_normal(
            (piece.kind, self.turns[node.name] @ piece.axis)
            for node in between
            for piece in node.pieces
        )
        return normal, any(node.pieces for node in chains[0] if node.name in common)

    # -------------------------------------------------------------------------------- joint, tendon

    def _coupling(self, element: Element) -> list[Coupling]:
        offset, ratio, *higher = polynomial(element)
        powers = tuple(higher) if any(higher) else ()
        names = element.text("joint1"), element.attributes.get("joint2", "")
        for name in (names[0], *filter(None, names[1:])):
            if name not in self.pieces:
                raise element.refusal(f"there is no joint {name!r}")
            if self.pieces[name].kind not in ("hinge", "slide"):
                raise element.refusal(
                    f"{name!r} is a {self.pieces[name].kind} joint; only hinges and slides are "
                    "coupled"
                )
        other = names[1] if ratio or powers else ""
        return [Coupling(element, names[0], other, offset, ratio, powers)]

    def gears(self, ties: Ties, joints: Joints, names: FreeNames) -> dict[str, Joint]:
        """Return the gears and locks that joint equalities are, but those that became parts of
        screws.

        q1 - ref1 = a0 + a1 (q2 - ref2) + ... = b0 + b1 q2 + ...:  a gear of the ratios 1 and -b1,
        the powers -b2 ... of q2 and the offset b0 + ref1.
        """
        made: dict[str, Joint] = {}
        for number, coupling in enumerate(ties.couplings, start=1):
            if coupling.joint in joints.screws and coupling.other:
                continue
            element = coupling.element
            name = names.give(element.attributes.get("name", f"coupling_{number}"))
            value = coupling.offset + self.pieces[coupling.joint].ref
            if not coupling.other:
                made[name] = self._lock(coupling, value, joints)
                continue
            own, other = (joints.coordinates[of] for of in (coupling.joint, coupling.other))
            about = value, coupling.ratio, *coupling.powers
            made[name] = following(
                element, {own: 1.0}, other, about, self.pieces[coupling.other].ref
            )
        return made

    def _lock(self, coupling: Coupling, value: float, joints: Joints) -> FixedJoint:
        """Return a fixed joint beside a hinge or slide that holds it at a coordinate."""
        label = joints.coordinates[coupling.joint]
        if label not in joints.joints:
            raise coupling.element.refusal(
                f"holds {label!r} alone, which is part of a joint of several freedoms"
            )
        return held(joints.joints[label], value)


def polynomial(element: Element) -> tuple[float, ...]:
    """Return the coefficients of an equality; those that are left out are MuJoCo's own."""
    given = element.numbers("polycoef", (1, 2, 3, 4, 5), POLYNOMIAL)
    return (*given, *POLYNOMIAL[len(given) :])


def following(
    element: Element,
    ratios: Mapping[str, float],
    other: str,
    about: Iterable[float],
    ref: float,
    factor: float = 1.0,
) -> GearJoint:
    """Return the gear by which a sum of coordinates follows another one's polynomial, whose
    coefficients are given in powers of factor times coordinate - ref."""
    b0, b1, *higher = Polynomial([*about])(Polynomial([-ref, factor])).coef
    ratios = {**ratios, other: ratios.get(other, 0.0) - b1}
    powers = {other: tuple(-b for b in higher)} if any(higher) else {}
    return element.make(GearJoint, ratios=ratios, powers=powers, offset=b0)


def tie_name(tie: Equality) -> str:
    """Return the name of a joint from its equality; the connects of an exported joint share what
    stands before the dot."""
    name = tie.element.attributes.get("name")
    if name is None:
        return "_".join(("loop", *(body for body in tie.bodies if body != GROUND)))
    return name.removesuffix(".near").removesuffix(".far")
