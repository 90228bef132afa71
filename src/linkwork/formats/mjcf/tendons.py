"""The tendons of an MJCF model, and the equality constraints that hold them.

tendon of two sites    held: a rod; with stiffness or damping: a spring between two points
tendon of joints       held: a gear; a combination of coordinates with what acts along it, or
                       that an actuator pulls
other spatial tendons  cables: with pulleys, and round spheres and cylinders; held, or following
                       another tendon by a polynomial: a gear of lengths
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import casadi as ca
import numpy as np

from linkwork.equations.cables import way
from linkwork.formats import poses
from linkwork.formats.mjcf.branches import movers, on_one_branch
from linkwork.formats.mjcf.cable_paths import cable_path
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.joints import Joints
from linkwork.formats.mjcf.loops import LoopReader, following, polynomial
from linkwork.formats.mjcf.reflected import Added
from linkwork.formats.mjcf.tendon_limits import stop_of
from linkwork.formats.mjcf.tree import coefficients
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    Cable,
    Combination,
    Frame,
    Friction,
    GearJoint,
    Joint,
    PointSpring,
    RodJoint,
    SlackSpring,
)

Loaded = TypeVar("Loaded", Combination, Cable)
OFF_TREE = (
    "has an armature that couples joints on different branches of the tree: MuJoCo leaves this out "
    "of its inertia matrix, and here it is whole"
)
STILL = "is left out: no joint changes its length"
Held = tuple[Element, float]  # the equality, and by how much it differs from the length at qpos0


@dataclass
class Tendons:
    """Gather what tendons are.

    joints: rods and gears of joints; lines: combinations of all tendons of joints, and cables, by
        name in the file; ties: gears of such lines, by these names
    used: the sites that they use; elements: all tendons, by name in the file
    """

    joints: dict[str, Joint] = field(default_factory=dict)
    springs: dict[str, PointSpring] = field(default_factory=dict)
    lines: dict[str, Combination | Cable] = field(default_factory=dict)
    ties: dict[str, GearJoint] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    elements: dict[str, Element] = field(default_factory=dict)


@dataclass
class TendonReader:
    """Read the section <tendon> of a document; names: give names to joints; added: what actuators
    add to tendons."""

    document: Document
    loops: LoopReader
    joints: Joints
    names: FreeNames
    notes: Notes
    added: Mapping[str, Added]

    def __post_init__(self) -> None:
        self.found, self.spring_names = Tendons(), FreeNames(self.notes)
        given = (element.attributes.get("name", "") for element in self.document.each("tendon"))
        self.own_names = FreeNames(self.notes, tuple(given))
        self.driven = {
            element.attributes.get("tendon") for element in self.document.each("actuator")
        }

    def read(self, equalities: Iterable[Element]) -> Tendons:
        """Return what all tendons are, those held by some equalities included."""
        held, following = self._held(equalities)
        self.following = {
            element.text(end) for element in following for end in ("tendon1", "tendon2")
        }
        for raw in self.document.each("tendon"):
            element = self.document.resolved(raw, "tendon")
            holds = held.pop(element.attributes.get("name", ""), None)
            self.found.elements[element.attributes.get("name", "")] = element
            if element.tag == "fixed":
                self._fixed(element, holds)
            elif element.tag == "spatial":
                self._spatial(element, holds)
            else:
                self.notes.on(element, "is left out: it is not known here", alters=True)
        for element in (equality for equality, _ in held.values()):
            self.notes.on(element, "is left out: there is no tendon of that name", alters=True)
        for element in following:
            self._follow(element)
        return self.found

    def _held(self, equalities: Iterable[Element]) -> tuple[dict[str, Held], list[Element]]:
        """Return the tendons that are held at a length, and the equalities by which one follows
        another."""
        held, following = {}, []
        for element in equalities:
            offset, *slopes = polynomial(element)
            if "tendon2" in element.attributes and any(slopes):
                following.append(element)
            else:
                held[element.text("tendon1")] = element, offset
        return held, following

    def _follow(self, element: Element) -> None:
        """Add the gear by which a tendon follows another one:
        l1 - l1_0 = a0 + a1 (l2 - l2_0) + ..."""
        # Both tendons.
        offset, ratio, *higher = polynomial(element)
        names = element.text("tendon1"), element.text("tendon2")
        if missing := [name for name in names if name not in self.found.lines]:
            remark = f"is left out: there is no tendon {missing[0]!r} that is read"
            self.notes.on(element, remark, alters=True)
            return
        lines = [self.found.lines[name] for name in names]
        ratios_of = [line.ratios for line in lines if isinstance(line, Combination)]
        label = self.names.give(element.attributes.get("name", "_".join(names)))
        # Lengths of cables, of one joint alone, and powers of a sum are those of transmissions.
        alone = len({label for ratios in ratios_of for label in ratios}) < 2
        if len(ratios_of) < 2 or alone or (any(higher) and len(ratios_of[1]) > 1):
            start, end = (self._length_at_zero(line) for line in lines)
            about = offset + start, ratio, *higher
            self.found.ties[label] = following(element, {names[0]: 1.0}, names[1], about, end, 1.0)
            return
        # Sums of joint coordinates are coupled as such.
        one, two = ratios_of
        at_zero = [self._at(line, springs=False) for line in (one, two)]
        if any(higher):
            ((other, factor),) = two.items()
            about = offset + at_zero[0], ratio, *higher
            gear = following(element, one, other, about, at_zero[1], factor)
            self.found.joints[label] = gear
            return
        ratios = {
            label: one.get(label, 0.0) - ratio * two.get(label, 0.0)
            for label in dict.fromkeys((*one, *two))
        }
        self.found.joints[label] = element.make(
            GearJoint, ratios=ratios, offset=offset + at_zero[0] - ratio * at_zero[1]
        )

    # ------------------------------------------------------------------------------------- spatial

    def _spatial(self, element: Element, holds: Held | None) -> None:
        """Read a tendon as a rod or a spring between two points, or as a cable."""
        # Two points, between which nothing acts but a linear spring and damper.
        parts = element.children
        straight = [part.tag for part in parts] == ["site", "site"]
        self.found.used |= {part.text("site") for part in parts if part.tag == "site"}
        name = self._name(element)
        driven, follows = name in self.driven, name in self.following
        rest = rest_of(element)
        more = any(element.number(key, 0.0) for key in ("frictionloss", "armature"))
        graded = not holds and any(
            coefficients(element, key)[1] for key in ("stiffness", "damping")
        )
        slack = self.document.is_limited(element) or (rest and (rest[0] < 0 or rest[0] != rest[1]))
        if straight and not (driven or follows or more or graded) and (holds or not slack):
            self._straight(element, holds)
            return
        # A cable, if something needs one that moves.
        tied = holds is not None or follows
        if not (tied or driven or _acts(element) or self.document.is_limited(element)):
            self.notes.on(element, "is left out: it neither holds nor pulls")
            return
        path, sides = cable_path(element, self.document, self.loops)
        self.found.used |= sides
        cable = element.make(Cable, path=path)
        if not movers(cable, self._chain) and (tied or not self.document.is_limited(element)):
            self.notes.on(element, STILL)
            return
        # What acts along it, and what holds it at a length.
        at_rest = self._way(cable, self.loops.at_rest)
        line = self._loaded(element, cable, at_rest, held=holds is not None)
        self.found.lines[name] = line
        if holds:
            equality, offset = holds
            label = self.names.give(equality.attributes.get("name", name))
            self.found.ties[label] = equality.make(
                GearJoint, ratios={name: 1.0}, offset=offset + self._length_at_zero(line)
            )

    def _name(self, element: Element) -> str:
        """Return a tendon's name, or one that no other has."""
        own = f"tendon_{len(self.found.lines) + 1}"
        return element.attributes.get("name") or self.own_names.give(own)

    def _length_at_zero(self, line: Combination | Cable) -> float:
        """Return the length of a line at qpos0."""
        if isinstance(line, Combination):
            return self._at(line.ratios, springs=False)
        return self._way(line, self.loops.at_zero)

    def _way(self, cable: Cable, at: Mapping[str, np.ndarray]) -> float:
        """Return the length of a cable where bodies are at given places."""

        def place(body: str) -> tuple[ca.SX, ca.SX]:
            return ca.SX(at[body][:3, :3]), ca.SX(at[body][:3, 3])

        return float(way(cable, place).length)

    def _straight(self, element: Element, holds: Held | None) -> None:
        # Its two ends, and what it does between them.
        ends = [self.loops.site(element, part.text("site")) for part in element.children]
        bodies, points = (ends[0][0], ends[1][0]), (ends[0][1][:3, 3], ends[1][1][:3, 3])
        if self._chain(bodies[0]) == self._chain(bodies[1]):
            one = "is left out: both of its ends are on one body"
            self.notes.on(element, one if bodies[0] == bodies[1] else STILL)
            return
        stiffness, damping = (coefficients(element, key)[0] for key in ("stiffness", "damping"))
        name = element.attributes.get("name", "tendon")
        # Held at a length it is a rod.
        if holds:
            frames = tuple(Frame(position=poses.triple(point)) for point in points)
            fields = {
                "connects": bodies,
                "frames": frames,
                "length": self._length(bodies, points, self.loops.at_zero) + holds[1],
            }
            self.found.joints[self.names.give(holds[0].attributes.get("name", name))] = (
                element.make(RodJoint, **fields)
            )
        # Pulling it is a spring between two points.
        if stiffness or damping:
            given = rest_of(element)
            if given and (given[0] < 0 or given[0] != given[1]):
                remark = (
                    "has a spring without force over a range of lengths; it is taken to rest at "
                    "the lower end"
                )
                self.notes.on(element, remark, alters=True)
            self.found.springs[self.spring_names.give(name)] = element.make(
                PointSpring,
                connects=bodies,
                points=tuple(map(poses.triple, points)),
                stiffness=stiffness,
                rest_length=max(given[0], 0.0)
                if given
                else self._length(bodies, points, self.loops.at_rest),
                damping=damping,
            )
        if not holds and not stiffness and not damping:
            self.notes.on(element, "is left out: it neither holds nor pulls")

    def _length(
        self,
        bodies: tuple[str, str],
        points: tuple[np.ndarray, np.ndarray],
        placed: dict[str, np.ndarray],
    ) -> float:
        ends = [poses.point(placed[body], p) for body, p in zip(bodies, points, strict=True)]
        return float(np.linalg.norm(ends[1] - ends[0]))

    # ----------------------------------------------------------------------------------- of joints

    def _fixed(self, element: Element, holds: Held | None) -> None:
        ratios: dict[str, float] = {}
        for part in element.each("joint"):
            name, factor = part.text("joint"), part.number("coef")
            if name not in self.joints.coordinates:
                raise part.refusal(f"there is no hinge or slide {name!r} that can be geared")
            label = self.joints.coordinates[name]
            ratios[label] = ratios.get(label, 0.0) + factor
        ratios = {label: ratio for label, ratio in ratios.items() if ratio}
        if not ratios:
            self.notes.on(element, "is left out: it moves with no joint")
            return
        name = self._name(element)
        # Held at a length it is a gear; that of one joint holds the tendon itself.
        if holds:
            label = self.names.give(holds[0].attributes.get("name", name))
            offset, alone = holds[1] + self._at(ratios, springs=False), len(ratios) == 1
            gear = element.make(GearJoint, ratios={name: 1.0} if alone else ratios, offset=offset)
            (self.found.ties if alone else self.found.joints)[label] = gear
        # What acts along it.
        line = element.make(Combination, ratios=ratios)
        at_rest = self._at(ratios, springs=True)
        self.found.lines[name] = self._loaded(element, line, at_rest, held=holds is not None)

    def _loaded(self, element: Element, line: Loaded, at_rest: float, held: bool = False) -> Loaded:
        """Return a transmission with what acts along its tendon, whose length where joints' springs
        rest is given; one that is held at a length never comes to an end of its range."""
        friction = element.number("frictionloss", 0.0)
        if friction:
            self.notes.on(
                element,
                "has dry friction, which is smoothed here: frictionloss is the Coulomb force, "
                f"reached at rates well above {Friction().coulomb_rate:g} rad/s or m/s",
                alters=True,
            )
        limited, tree = self.document.is_limited(element) and not held, self.loops.tree
        added = self.added.get(element.attributes.get("name", ""), Added())
        resisting = added.resisting(Friction(powers=coefficients(element, "damping")[1]))
        inertia = added.inertia + element.number("armature", 0.0)
        line = line.model_copy(update={"inertia": inertia})
        if inertia and not self._on_one_branch(line):
            self.notes.on(element, OFF_TREE, alters=True)
        return line.model_copy(
            update={
                "stop": stop_of(element, line, tree, self.joints, self.notes) if limited else None,
                "spring": self._spring(element, at_rest),
                "friction": element.make(Friction, coulomb=friction, **resisting),
            }
        )

    def _on_one_branch(self, line: Combination | Cable) -> bool:
        """Tell whether no joint that changes a length stands beside another one in the tree."""
        tree = self.loops.tree
        owners = {
            self.joints.coordinates[piece.name]: node.name
            for node, piece in tree.pieces()
            if piece.name in self.joints.coordinates
        }

        return on_one_branch(line, owners, self._chain)

    def _chain(self, body: str) -> list[str]:
        """Return the bodies with joints from a body to ground."""
        return [node.name for node in self.loops.tree.chain(body) if node.pieces]

    def _spring(self, element: Element, at_rest: float) -> SlackSpring:
        """Return the spring and damper along a tendon whose length where joints' springs rest is
        given."""
        stiffness, powers = coefficients(element, "stiffness")
        damping, _ = coefficients(element, "damping")
        if not (stiffness or powers or damping):
            return SlackSpring()
        low, high = rest_of(element) or (at_rest, at_rest)
        pull = {"stiffness": stiffness, "powers": powers, "damping": damping}
        return element.make(SlackSpring, **pull, rest=low, slack=high - low)

    def _at(self, ratios: Mapping[str, float], springs: bool) -> float:
        """Return a combination at qpos0, or where the joints' springs rest."""
        pieces = {
            self.joints.coordinates[name]: piece
            for name, piece in self.loops.pieces.items()
            if name in self.joints.coordinates
        }
        own = (
            ratio * (pieces[label].springref if springs else pieces[label].ref)
            for label, ratio in ratios.items()
        )
        return sum(own)


def rest_of(tendon: Element) -> tuple[float, float] | None:
    """Return the lengths between which a tendon's spring rests; None where it does as the joints'
    springs do (-1)."""
    low, *high = tendon.numbers("springlength", (1, 2), (-1.0,))
    found = low, (high or [low])[0]
    return None if found == (-1.0, -1.0) else found


def _acts(tendon: Element) -> bool:
    """Tell whether something acts along a tendon beside actuators."""
    keys = ("stiffness", "damping", "frictionloss", "armature")
    return any(any(tendon.numbers(key, (1, 2, 3), (0.0,))) for key in keys)
