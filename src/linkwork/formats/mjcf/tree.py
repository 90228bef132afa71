"""The tree of an MJCF model: bodies inside one another, each with its mass, its shapes, its joints
and its sites.

At the reference configuration qpos0 (every hinge and slide at its `ref`, balls at no turn) a body
stands in its parent where pos and orientation say; its joints then move it one after the other,
each with the ones after it:

    X_parent_body = X_0 M_1(q_1) M_2(q_2) ...
    M = Trans(anchor) Rot(axis, q - ref) Trans(-anchor)  or  Trans((q - ref) axis)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, Literal

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.body_mass import BodyMass, Geoms
from linkwork.formats.mjcf.document import MAIN, OWN, Document
from linkwork.formats.mjcf.geoms import SHAPES, fromto, is_shown, kind_of, materials_of, shown
from linkwork.formats.mjcf.meshes import Meshes
from linkwork.formats.mjcf.principal import principal_axes
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import GROUND, Friction, Limits, Shape, Spring
from linkwork.solids.solid import Solid

WORLD = "world"
NEAR = 1e-9  # directions that agree [1]
UNLIMITED = 1e10  # beyond this a limit stands for none [m, rad]

Kind = Literal["hinge", "slide", "ball", "free"]
COORDINATES = {"hinge": 1, "slide": 1, "ball": 4, "free": 7}
TURNING = ("ball", "free")  # joints whose coordinates end with a quaternion
APART = (
    "has a stiffness that is not linear; its higher powers are those of each way by itself, where "
    "MuJoCo has them of the distance"
)
WHOLE = "; it is against the turn as a whole, where MuJoCo has it about each axis by itself"
FREEDOMS = {"hinge": 1, "slide": 1, "ball": 3, "free": 6}


@dataclass(frozen=True)
class Piece:
    """Hold one <joint> of a body: what it lets happen, about what, in the body's frame at qpos0,
    and its effects."""

    kind: Kind
    element: Element
    anchor: np.ndarray
    axis: np.ndarray
    ref: float = 0.0
    springref: float = 0.0
    friction: Friction = field(default_factory=Friction)
    spring: Spring = field(default_factory=Spring)
    limits: Limits = field(default_factory=Limits)
    rotor: float = 0.0

    @property
    def name(self) -> str | None:
        return self.element.attributes.get("name")

    def effects(self) -> dict[str, Any]:
        """Return those effects that do something, by the names of a joint's fields."""
        effects = {"friction": self.friction, "spring": self.spring, "limits": self.limits}
        found: dict[str, Any] = {
            name: value for name, value in effects.items() if value != type(value)()
        }
        return found | ({"rotor_inertia": self.rotor} if self.rotor else {})

    def reversed(self) -> Piece:
        """Return what moves the parent relative to the body by the same coordinate."""
        return replace(self, axis=-self.axis)

    def motion(self, q: np.ndarray) -> np.ndarray:
        """Return M(q), 4 x 4; a free joint's q is the pose itself and is not asked for here."""
        if self.kind == "slide":
            return poses.shift((q[0] - self.ref) * self.axis)
        if self.kind == "hinge":
            turn = poses.turn(self.axis, q[0] - self.ref)
        else:
            turn = poses.pose(rotation=poses.from_quaternion(*q))
        return poses.shift(self.anchor) @ turn @ poses.shift(-self.anchor)


@dataclass(frozen=True)
class ModelBody:
    """Hold a body: its parent, its pose X_parent_body at qpos0, its joints, its mass, its
    shapes.

    geoms: with their defaults, and the poses of the frames around them in the body; own_axes: those
        of its inertia that the file gives, if it does
    """

    name: str
    raw: str | None
    parent: str
    pose: np.ndarray
    element: Element
    pieces: tuple[Piece, ...]
    solid: Solid
    shapes: tuple[Shape, ...] = ()
    geoms: Geoms = ()
    own_axes: np.ndarray | None = None

    @property
    def axes(self) -> np.ndarray:
        """The principal axes of its inertia in its frame, by columns."""
        return principal_axes(self.solid.inertia) if self.own_axes is None else self.own_axes


@dataclass
class ModelTree:
    """Hold the bodies in MuJoCo's order, parents first, the named sites: body, pose X_body_site;
    and the named geoms: body, pose of what stands around them there, element; meshes: the
    document's."""

    nodes: dict[str, ModelBody] = field(default_factory=dict)
    sites: dict[str, tuple[str, np.ndarray]] = field(default_factory=dict)
    geoms: dict[str, tuple[str, np.ndarray, Element]] = field(default_factory=dict)
    meshes: Meshes = field(default_factory=Meshes)
    # Name in the file -> name here.
    bodies: dict[str, str] = field(default_factory=lambda: {WORLD: GROUND})

    def chain(self, body: str) -> list[ModelBody]:
        """Return the bodies from a body to the one that stands in ground."""
        chain = []
        while body != GROUND:
            chain.append(self.nodes[body])
            body = self.nodes[body].parent
        return chain

    def poses(self, positions: Mapping[int, np.ndarray] | None = None) -> dict[str, np.ndarray]:
        """Return X_ground_body of all bodies at qpos0, or with each joint (numbered in order) at
        its coordinates."""
        found, number = {GROUND: np.eye(4)}, 0
        for name, node in self.nodes.items():
            X = node.pose
            for piece in node.pieces:
                if positions is not None:
                    q = positions[number]
                    free = piece.kind == "free"
                    X = (
                        poses.pose(q[:3], poses.from_quaternion(*q[3:]))
                        if free
                        else X @ piece.motion(q)
                    )
                number += 1
            found[name] = found[node.parent] @ X
        return found

    def positions(self, springs: bool = False) -> dict[int, np.ndarray]:
        """Return qpos0 by the number of the joint; with `springs` MuJoCo's qpos_spring, where the
        joints' springs rest."""
        found = {}
        for number, (node, piece) in enumerate(self.pieces()):
            match piece.kind:
                case "ball":
                    found[number] = np.array([1.0, 0.0, 0.0, 0.0])
                case "free":
                    found[number] = np.concatenate(
                        [node.pose[:3, 3], poses.to_quaternion(node.pose[:3, :3])]
                    )
                case _:
                    found[number] = np.array([piece.springref if springs else piece.ref])
        return found

    def pieces(self) -> list[tuple[ModelBody, Piece]]:
        """Return all joints with their bodies, in the order of qpos."""
        return [(node, piece) for node in self.nodes.values() for piece in node.pieces]


def plane_normal(motions: Iterable[tuple[Kind, np.ndarray]]) -> np.ndarray | None:
    """Return the direction about which all hinges turn and across which all slides move; None where
    there is none.

    What lies between two bodies then moves the one in a plane of the other, wherever it stands.
    """
    turning: list[np.ndarray] = []
    sliding: list[np.ndarray] = []
    for kind, direction in motions:
        if kind not in ("hinge", "slide"):
            return None
        (turning if kind == "hinge" else sliding).append(direction)
    if not turning:
        return None
    z = turning[0]
    flat = all(abs(abs(other @ z) - 1) < NEAR for other in turning) and all(
        abs(other @ z) < NEAR for other in sliding
    )
    return z if flat else None


def coefficients(element: Element, name: str) -> tuple[float, tuple[float, ...]]:
    """Return a stiffness or damping of a joint, tendon or actuator, and the coefficients by which
    it grows with the displacement or the rate, up to the last that is not zero."""
    value, *powers = element.numbers(name, (1, 2, 3), (0.0,))
    while powers and not powers[-1]:
        powers.pop()
    return value, tuple(powers)


def read_tree(document: Document, notes: Notes) -> ModelTree:
    """Read all bodies of a document."""
    reader = TreeReader(document, notes)
    for world in document.root.each("worldbody"):
        reader.contents(world, GROUND, world.attributes.get("childclass", MAIN), np.eye(4))
    return reader.finished()


@dataclass
class _Parts:
    """Gather what a body holds."""

    pieces: list[Piece] = field(default_factory=list)
    geoms: list[tuple[Element, np.ndarray]] = field(default_factory=list)
    inertial: Element | None = None


class TreeReader:
    def __init__(self, document: Document, notes: Notes):
        self.document, self.notes, self.meshes = document, notes, Meshes.of(document)
        self.tree = ModelTree(meshes=self.meshes)
        self.names = FreeNames(notes, (GROUND,))
        self.joints: set[str] = set()
        self.materials = materials_of(document)

    def finished(self) -> ModelTree:
        total = self.document.compilers[OWN].total_mass
        mass = sum(node.solid.mass for node in self.tree.nodes.values() if not self.is_fused(node))
        if total > 0 and mass > 0:
            for name, node in self.tree.nodes.items():
                self.tree.nodes[name] = replace(node, solid=node.solid.scaled(total / mass))
        return self.tree

    def is_fused(self, node: ModelBody) -> bool:
        """Tell whether MuJoCo's compiler makes a body part of the world."""
        return self.document.compilers[OWN].fuses and all(
            not each.pieces
            and each.element.attributes.get("mocap") != "true"
            and each.raw not in self.document.named
            for each in self.tree.chain(node.name)
        )

    def body(self, element: Element, parent: str, childclass: str, X: np.ndarray) -> None:
        """Read a body and all inside it; X is the pose of the frames around it in its parent."""
        raw = element.attributes.get("name")
        name = self.names.give(raw or f"body_{len(self.tree.nodes) + 1}", element if raw else None)
        if raw in self.tree.bodies:
            raise element.refusal("has the name of another body; names are given once")
        if raw:
            self.tree.bodies[raw] = name
        parts, place = _Parts(), X @ self.document.pose(element)
        self.tree.nodes[name] = ModelBody(
            name, raw, parent, place, element, (), Solid(0.0, np.zeros(3), np.zeros((3, 3)))
        )
        self.contents(
            element, name, element.attributes.get("childclass", childclass), np.eye(4), parts
        )
        if any(piece.kind == "free" for piece in parts.pieces) and (
            parent != GROUND or len(parts.pieces) > 1
        ):
            raise element.refusal(
                "a free joint is the only joint of a body that stands directly in the world"
            )
        own = self.document, element, parts.inertial, tuple(parts.geoms)
        solid, own_axes = BodyMass(*own, self.meshes, self.notes).bounded()
        pieces = tuple(parts.pieces)
        self.tree.nodes[name] = ModelBody(
            *(name, raw, parent, place, element, pieces, solid, self.shapes(parts)),
            geoms=tuple(parts.geoms),
            own_axes=own_axes,
        )

    def contents(
        self,
        element: Element,
        body: str,
        childclass: str,
        X: np.ndarray,
        parts: _Parts | None = None,
    ) -> None:
        """Read what stands in a body or in a <frame> of it; X is that frame's pose in the body."""
        # A <frame> is not there in the model: what it holds stands in the body, moved and turned.
        document = self.document
        for child in element.children:
            match child.tag:
                case "body":
                    self.body(child, body, childclass, X)
                case "frame":
                    inner = child.attributes.get("childclass", childclass)
                    self.contents(child, body, inner, X @ document.pose(child), parts)
                case "site":
                    self.site(document.resolved(child, "site", childclass), body, X)
                # The world takes no joints; a body's go to its parts.
                case "joint" | "freejoint" if parts is None:
                    raise child.refusal(
                        "stands in the world itself, which does not move; put it into a body"
                    )
                case "joint" if parts is not None:
                    parts.pieces.append(
                        self.piece(document.resolved(self.once(child), "joint", childclass), X)
                    )
                case "freejoint" if parts is not None:
                    parts.pieces.append(Piece("free", self.once(child), np.zeros(3), np.zeros(3)))
                # Masses and shapes.
                case "geom":
                    geom = document.resolved(child, "geom", childclass)
                    if "name" in geom.attributes:
                        self.tree.geoms[geom.attributes["name"]] = body, X, geom
                    if parts is None:
                        self.scenery(geom)
                    else:
                        self.require_weight(geom)
                        parts.geoms.append((geom, X))
                case "inertial" if parts is not None:
                    parts.inertial = child

    def once(self, element: Element) -> Element:
        """Return a joint's element; a name that another joint has is refused."""
        name = element.attributes.get("name")
        if name in self.joints:
            raise element.refusal("has the name of another joint; names are given once")
        self.joints |= {name} if name else set()
        return element

    def require_weight(self, geom: Element) -> None:
        """Refuse a geom that weighs less than nothing."""
        for name in ("mass", "density"):
            if geom.number(name, 0.0) < 0:
                raise geom.refusal(
                    f"{name} '{geom.attributes[name]}' is below 0; give zero or more"
                )

    def site(self, element: Element, body: str, X: np.ndarray) -> None:
        name = element.attributes.get("name")
        if name is None:
            return
        if name in self.tree.sites:
            raise element.refusal("has the name of another site; names are given once")
        place = (
            fromto(element)[0] if "fromto" in element.attributes else self.document.pose(element)
        )
        self.tree.sites[name] = body, X @ place

    # --------------------------------------------------------------------------------------- joints

    def piece(self, element: Element, X: np.ndarray) -> Piece:
        """Read a joint; X is the pose of the <frame> around it in the body."""
        # What moves, and along which axis.
        kinds = ("hinge", "slide", "ball", "free")
        kind: Kind = element.choice("type", kinds, "hinge")  # pyright: ignore
        axis = np.array(element.vector("axis", (0.0, 0.0, 1.0)))
        if np.linalg.norm(axis) < 1e-12:
            raise element.refusal(
                f"axis '{element.attributes['axis']}' has no length; give a direction such as '0 "
                "0 1'"
            )
        # Its spring and its friction; what has no counterpart is told.
        springref = (
            self.scaled(kind, element, element.number("springref", 0.0))
            if kind in ("hinge", "slide")
            else 0.0
        )
        stiffness, hardening = coefficients(element, "stiffness")
        damping, thickening = coefficients(element, "damping")
        spring, coulomb = Spring(), element.number("frictionloss", 0.0)
        if stiffness or hardening:
            spring = element.make(Spring, stiffness=stiffness, powers=hardening, rest=springref)
        friction = element.make(Friction, viscous=damping, powers=thickening, coulomb=coulomb)
        if kind == "free" and hardening:
            self.notes.on(element, APART, alters=True)
        if kind in TURNING and thickening:
            remark = f"has a damping that is not linear{WHOLE}"
            self.notes.on(element, remark, alters=True)
        if friction.coulomb:
            remark = (
                "has dry friction, which is smoothed here: frictionloss is the Coulomb force, "
                f"reached at rates well above {friction.coulomb_rate:g} rad/s or m/s"
            )
            self.notes.on(element, remark + (WHOLE if kind in TURNING else ""), alters=True)
        return Piece(
            kind,
            element,
            anchor=poses.point(X, element.vector("pos", (0.0, 0.0, 0.0))),
            axis=poses.unit(X[:3, :3] @ axis),
            ref=self.scaled(kind, element, element.number("ref", 0.0))
            if kind in ("hinge", "slide")
            else 0.0,
            springref=springref,
            friction=friction,
            spring=spring,
            limits=self.limits(kind, element),
            rotor=element.number("armature", 0.0),
        )

    def scaled(self, kind: Kind, element: Element, value: float) -> float:
        return value if kind == "slide" else self.document.compiler_of(element).angle(value)

    def limits(self, kind: Kind, element: Element) -> Limits:
        if kind == "free" or not self.document.is_limited(element):
            return Limits()
        lower, upper = (
            self.scaled(kind, element, value) for value in element.numbers("range", (2,), most=inf)
        )
        return element.make(
            Limits,
            lower=None if kind == "ball" or lower <= -UNLIMITED else lower,
            upper=None if upper >= UNLIMITED else upper,
        )

    # --------------------------------------------------------------------------------------- shapes

    def shapes(self, parts: _Parts) -> tuple[Shape, ...]:
        """Return the shapes of a body."""
        found = (
            shown(self.document, geom, X, self.materials, self.meshes, self.notes)
            for geom, X in parts.geoms
        )
        return tuple(shape for shapes in found for shape in shapes)

    def scenery(self, element: Element) -> None:
        """Note a geom that stands in the world."""
        if is_shown(element) and kind_of(element) in SHAPES:
            self.notes.on(
                element, "stands in the world and is not shown: only bodies have shapes here"
            )
