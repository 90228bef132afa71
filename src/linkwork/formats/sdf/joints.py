"""The joints of an SDF file: between any two links or frames, so that they may close loops.

All joints are at zero where the file's poses put the links; a joint's own pose is in the child's
frame, if it is relative to nothing else. A screw's `screw_thread_pitch` is its advance [m] per turn
of a right-handed thread; the older `thread_pitch` counts radians per metre of a left-handed one.
A gearbox keeps theta_2 = -gearbox_ratio theta_1, the turns of its child and its parent relative to
the reference body about its two axes, which hinges measure.

Source: the SDF specification, http://sdformat.org/spec (joint).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

import numpy as np

from linkwork.formats import drake, poses
from linkwork.formats.followers import follower
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.sdf.scopes import MODEL, STILL, Scope, thread_pitch
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import (
    GROUND,
    Body,
    FixedJoint,
    Friction,
    GearJoint,
    Joint,
    Limits,
    MechanismError,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    ScrewJoint,
    SphericalJoint,
    Spring,
    UniversalJoint,
)

HINGES = ("revolute", "continuous")
TYPES = (
    *HINGES,
    "prismatic",
    "screw",
    "ball",
    "universal",
    "revolute2",
    "fixed",
    "gearbox",
)
NO_LIMIT = 1e16  # the specification's limit of a joint that has none
OLD_AXES = (1, 5)  # the version from which on axes are in the joint's own frame
AXES = ("axis", "axis2")


@dataclass
class SdfJoint:
    """Hold a joint of the file with what it is here.

    labels: the coordinates that its axes are, by `axis` and `axis2`
    driven: whether the file lets an actuator act; None where it does not say
    efforts: the greatest force about or along an axis, where the file bounds it
    """

    scope: Scope
    element: Element
    name: str
    labels: dict[str, str] = field(default_factory=dict)
    driven: dict[str, bool | None] = field(default_factory=dict)
    efforts: dict[str, float] = field(default_factory=dict)


@dataclass
class JointReader:
    """Read joints, those between the bodies that others are made of, and gears."""

    bodies: dict[str, str]  # what links are called here, by their names with those of the models
    notes: Notes
    names: FreeNames
    body_names: FreeNames
    joints: dict[str, Joint] = field(default_factory=dict)
    between: dict[str, Body] = field(default_factory=dict)
    read: list[SdfJoint] = field(default_factory=list)

    def scope(self, scope: Scope) -> None:
        """Read the joints of a scope."""
        for name, element in scope.named.items():
            if element.tag == "joint":
                kind = element.choice("type", TYPES, "")
                joint = SdfJoint(scope, element, self.names.give(scope.path + name, element))
                self.read.append(joint)
                if kind != "gearbox":
                    self._pair(joint, kind)
        for element in scope.element.each(drake.JOINT):
            self._planar(scope, element)

    def couplings(self) -> None:
        """Read the gears: gearboxes, and axes that mimic others."""
        for joint in self.read:
            if joint.element.attributes["type"] == "gearbox":
                self._gearbox(joint)
            for axis in AXES:
                self._mimic(joint, axis)
            self._mimic_of_drake(joint)

    # -------------------------------------------------------------------------------------- pairs

    def _pair(self, joint: SdfJoint, kind: str) -> None:
        scope, element = joint.scope, joint.element
        # What it connects, and where it stands on both.
        ends = [scope.mount(self._end(element, end), element) for end in ("parent", "child")]
        if ends[0][0] == ends[1][0]:
            if ends[0][0] == STILL:
                self.notes.on(element, "is left out: it connects what stands still anyway")
                return
            raise element.refusal(f"connects {shortened(ends[0][0])} to itself")
        X = scope.in_world(element.text("name"), element)
        connects = [self.bodies.get(body, GROUND) for body, _ in ends]
        frames = [poses.frame_of(poses.inverse(B) @ X) for _, B in ends]
        fields = {"connects": tuple(connects), "frames": tuple(frames)}
        # Those without axes, with one, with two.
        if kind == "fixed":
            self.joints[joint.name] = element.make(FixedJoint, **fields)
        elif kind == "ball":
            fields["friction"] = self._of_ball(element)
            self.joints[joint.name] = element.make(SphericalJoint, **fields)
        elif kind in ("universal", "revolute2"):
            self._two_axes(joint, fields)
        else:
            self._one_axis(joint, kind, fields)

    def _of_ball(self, element: Element) -> dict[str, Friction]:
        """Return what damps a ball: that of its first axis acts against all turns, as in Drake."""
        axis = element.first("axis")
        dynamics = None if axis is None else axis.first("dynamics")
        if dynamics is None:
            return {}
        for name in ("friction", "spring_stiffness"):
            if dynamics.inner_number(name, 0.0):
                self.notes.on(dynamics, f"says {name}, which a ball has not here", alters=True)
        viscous = dynamics.inner_number("damping", 0.0)
        made = dynamics.make(Friction, viscous=viscous)
        return {freedom: made for freedom in SphericalJoint.freedoms} if viscous else {}

    def _planar(self, scope: Scope, element: Element) -> None:
        """Read a joint of Drake's in the plane of x and y of its parent."""
        if element.text("type") != "planar":
            self.notes.on(element, "is left out: only planar ones are known here", alters=True)
            return
        ends = [element.named(f"drake:{end}") for end in ("parent", "child")]
        mounts = [scope.mount(end.content, end) for end in ends]
        if mounts[0][0] == mounts[1][0]:
            raise element.refusal(f"connects {shortened(mounts[0][0])} to itself")
        damping = element.inner("drake:damping")
        given = damping.vector(damping.tag) if damping else (0.0, 0.0, 0.0)
        self.joints[self.names.give(scope.path + element.text("name"), element)] = element.make(
            PlanarJoint,
            connects=tuple(self.bodies.get(body, GROUND) for body, _ in mounts),
            frames=tuple(
                poses.frame_of(poses.inverse(B) @ scope.in_world(end.content, end))
                for end, (_, B) in zip(ends, mounts, strict=True)
            ),
            friction={
                freedom: Friction(viscous=value)
                for freedom, value in zip(PlanarJoint.freedoms, given, strict=True)
                if value
            },
        )

    def _one_axis(self, joint: SdfJoint, kind: str, fields: dict) -> None:
        # Drake's elements of a rotor behind a gear, beside the axis.
        ratio, rotor = (
            joint.element.inner_number(f"drake:{name}", default)
            for name, default in (("gear_ratio", 1.0), ("rotor_inertia", 0.0))
        )
        acting = self._acting(joint, "axis", kind != "continuous")
        acting["rotor_inertia"] = ratio**2 * rotor
        fields |= {"axis": self._axis(joint, "axis"), **acting}
        made = RevoluteJoint if kind in HINGES else PrismaticJoint
        if kind == "screw":
            made, fields["pitch"] = ScrewJoint, thread_pitch(joint.element)
        self.joints[joint.name] = joint.element.make(made, **fields)
        joint.labels["axis"] = joint.name

    def _two_axes(self, joint: SdfJoint, fields: dict) -> None:
        axes = [self._axis(joint, axis) for axis in AXES]
        acting = [self._acting(joint, axis) for axis in AXES]
        if abs(float(np.dot(np.array(axes[0]), np.array(axes[1])))) < 1e-9:
            freedoms = UniversalJoint.freedoms
            by_freedom = {
                kind: {
                    name: each[kind]
                    for name, each in zip(freedoms, acting, strict=True)
                    if kind in each
                }
                for kind in {**acting[0], **acting[1]}
            }
            made = joint.element.make(UniversalJoint, axes=tuple(axes), **fields, **by_freedom)
            self.joints[joint.name] = made
            joint.labels |= dict(zip(AXES, made.coordinates(joint.name), strict=True))
            return
        # Axes that are not square to each other: two hinges about a body without mass.
        (first, second), (one, two) = fields["connects"], fields["frames"]
        middle = self.body_names.give(joint.name)
        self.between[middle] = Body(mass=0.0)
        names = joint.name, self.names.give(f"{joint.name}_2")
        ends = (
            ((first, middle), (one, poses.frame_of(np.eye(4)))),
            (
                (middle, second),
                (poses.frame_of(np.eye(4)), two),
            ),
        )
        for name, axis, (connects, frames), more in zip(names, axes, ends, acting, strict=True):
            self.joints[name] = joint.element.make(
                RevoluteJoint, connects=connects, frames=frames, axis=axis, **more
            )
        joint.labels |= dict(zip(AXES, names, strict=True))

    def _end(self, element: Element, end: str) -> str:
        inner = element.first(end)
        name = "" if inner is None else inner.content
        if not name:
            raise element.refusal(f"holds no <{end}>; name a link, a frame or world")
        return name

    def _axis(self, joint: SdfJoint, tag: str) -> tuple[float, float, float]:
        """Return the unit components of an axis in the joint's frame."""
        element = joint.element.first(tag)
        if element is None:
            return 0.0, 0.0, 1.0
        inner = element.inner("xyz")
        given = np.array((0.0, 0.0, 1.0) if inner is None else inner.vector("xyz"))
        if np.linalg.norm(given) < 1e-12:
            raise element.refusal("xyz has no length; give a direction such as '0 0 1'")
        # The frame that it is given in, if not the joint's own.
        frame = "" if inner is None else inner.attributes.get("expressed_in", "")
        if element.inner_flag("use_parent_model_frame", joint.scope.version < OLD_AXES):
            frame = MODEL
        if frame:
            own = joint.scope.pose(joint.element.text("name"), element)[:3, :3]
            given = own.T @ joint.scope.pose(frame, element)[:3, :3] @ given
        return poses.triple(poses.unit(given))

    def _acting(self, joint: SdfJoint, tag: str, bounded: bool = True) -> dict:
        """Return friction, spring and limits about an axis, and note whether it is driven."""
        axis = joint.element.first(tag)
        joint.driven[tag] = None
        if axis is None:
            return {}
        # What resists and pulls.
        dynamics, limit, found = axis.first("dynamics"), axis.first("limit"), {}
        if dynamics is not None:
            viscous, coulomb, stiffness, rest = (
                dynamics.inner_number(name, 0.0)
                for name in ("damping", "friction", "spring_stiffness", "spring_reference")
            )
            if coulomb:
                self.notes.on(
                    joint.element,
                    "has dry friction, which is smoothed here about rate zero",
                    alters=True,
                )
            found["friction"] = dynamics.make(Friction, viscous=viscous, coulomb=coulomb)
            found["spring"] = dynamics.make(Spring, stiffness=stiffness, rest=rest)
        # What bounds the coordinate, and the force of an actuator.
        if limit is not None:
            lower, upper = (
                limit.inner_number(name, default, most=inf)
                for name, default in (("lower", -NO_LIMIT), ("upper", NO_LIMIT))
            )
            ends = {"lower": lower, "upper": upper}
            known = {name: value for name, value in ends.items() if abs(value) < NO_LIMIT}
            try:
                speed = limit.inner_number("velocity", -1.0, most=inf)
            except MechanismError as error:  # which is no dynamics
                speed = -1.0
                self.notes.on(limit, f"bounds no speed: {error}")
            known = known if bounded and lower < upper else {}
            known |= {"speed": speed} if 0 < speed < NO_LIMIT else {}
            found["limits"] = limit.make(Limits, **known)
            # A joint that can give no effort is not driven.
            if limit.first("effort") is not None:
                effort = limit.inner_number("effort", -1.0, most=inf)
                joint.driven[tag] = effort != 0
                if 0 < effort < NO_LIMIT:
                    joint.efforts[tag] = effort
        return found

    # -------------------------------------------------------------------------------------- gears

    def _gearbox(self, joint: SdfJoint) -> None:
        """Add a gear between the hinges that lead from the reference body to parent and child."""
        scope, element = joint.scope, joint.element
        inner = element.first("gearbox_reference_body")
        if inner is None:
            raise element.refusal("holds no <gearbox_reference_body>; name a link")
        base = scope.mount(inner.content, element)[0]
        turns = []
        for end, tag in zip(("parent", "child"), AXES, strict=True):
            body = scope.mount(self._end(element, end), element)[0]
            axis = scope.in_world(element.text("name"), element)[:3, :3] @ self._axis(joint, tag)
            turns.append(self._turn(base, body, axis, element))
        (one, first), (two, second) = turns
        ratio = element.inner_number("gearbox_ratio", 1.0)
        gear = element.make(GearJoint, ratios={two: second, one: ratio * first})
        self.joints[joint.name] = gear

    def _turn(self, base: str, body: str, axis: np.ndarray, element: Element) -> tuple[str, float]:
        """Return the hinge between two bodies and whether it counts turns of the second relative to
        the first about an axis as positive, 1 or -1."""
        for other in self.read:
            hinge = self.joints.get(other.name)
            if not isinstance(hinge, RevoluteJoint):
                continue
            ends = [
                other.scope.mount(self._end(other.element, end), other.element)[0]
                for end in ("parent", "child")
            ]
            if set(ends) != {base, body}:
                continue
            turn = other.scope.in_world(other.element.text("name"), other.element)[:3, :3]
            along = float(turn @ np.array(hinge.axis) @ poses.unit(axis))
            if abs(along) > 1 - 1e-6:
                return other.name, float(np.sign(along)) * (1.0 if ends[0] == base else -1.0)
        raise element.refusal(
            f"no hinge about its axis leads from {shortened(base)} to {shortened(body)}; add one"
        )

    def _mimic(self, joint: SdfJoint, tag: str) -> None:
        """Add a gear where an axis mimics another: q = multiplier (q_of - reference) + offset."""
        axis = joint.element.first(tag)
        mimic = None if axis is None else axis.first("mimic")
        if mimic is None or tag not in joint.labels:
            return
        wanted, of = mimic.text("joint"), mimic.attributes.get("axis", "axis")
        element = joint.scope.named.get(wanted)
        other = next((each for each in self.read if each.element is element), None)
        if other is None or of not in other.labels:
            raise mimic.refusal(f"there is no {of} of a joint {shortened(wanted)} to mimic")
        multiplier, offset, reference = (
            mimic.inner_number(name, default)
            for name, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        )
        joint.driven[tag] = False
        labels = joint.labels[tag], other.labels[of]
        tied = follower(mimic, self.joints, labels, multiplier, offset - multiplier * reference)
        self.joints[self.names.give(f"{labels[0]}_mimic")] = tied

    def _mimic_of_drake(self, joint: SdfJoint) -> None:
        """Add a gear where a joint has Drake's mimic: q = multiplier q_of + offset."""
        mimic = joint.element.first("drake:mimic")
        if mimic is None or "axis" not in joint.labels:
            return
        wanted = mimic.text("joint")
        element = joint.scope.named.get(wanted)
        other = next((each for each in self.read if each.element is element), None)
        if other is None or "axis" not in other.labels:
            raise mimic.refusal(f"there is no joint {shortened(wanted)} of one axis to mimic")
        multiplier, offset = mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)
        joint.driven["axis"] = False
        labels = joint.labels["axis"], other.labels["axis"]
        tied = follower(mimic, self.joints, labels, multiplier, offset)
        self.joints[self.names.give(f"{labels[0]}_mimic")] = tied
