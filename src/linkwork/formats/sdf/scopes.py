"""Where the parts of an SDF file are: names, and the poses and bodies that they mean.

A model, or a world, is a scope: its links, joints, frames and nested models have names in it, and
`outer::inner` leads into nested ones. The pose of each is relative to another one of its scope,
X_M_name = X_M_relative X_relative_name  (M the model's own frame); that of a frame may be attached
to another one, with which it moves.

Source: the SDF specification, http://sdformat.org/spec, and "Pose frame semantics" beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import pi

import numpy as np

from linkwork.formats import poses
from linkwork.formats.versions import numbered
from linkwork.formats.xml import Element, shortened

MODEL = "__model__"
WORLD = "world"
BETWEEN = "::"
STILL = BETWEEN  # the body that stands still, which no link is called
PARTS = ("link", "frame", "joint")
LATEST = "1.12"
RELATIVE = (1, 7)  # the version from which on poses say `relative_to` and not `frame`


@dataclass
class Scope:
    """Hold the named parts of a model or of a world.

    Attributes:
        path: what stands before the names of its links here.
        named: its links, joints and frames, each by name.
        models: its nested models; merged: those whose parts count as its own.
        static: whether all of it stands still.
        place: the element that gives the model's pose, of the model or of what includes it.
        version: of the format, as the file says that it comes from.
    """

    element: Element
    place: Element
    parent: Scope | None = None
    path: str = ""
    static: bool = False
    version: tuple[int, int] = (1, 12)
    named: dict[str, Element] = field(default_factory=dict)
    models: dict[str, Scope] = field(default_factory=dict)
    merged: list[Scope] = field(default_factory=list)
    _known: dict[str, np.ndarray | None] = field(default_factory=dict)
    _asked: set[str] = field(default_factory=set)

    @property
    def world(self) -> bool:
        return self.element.tag == WORLD

    def all(self) -> Iterator[Scope]:
        """Yield this scope and all within it."""
        yield self
        for inner in (*self.models.values(), *self.merged):
            yield from inner.all()

    def links(self) -> Iterator[tuple[str, Element]]:
        """Yield its own links by name."""
        return ((name, part) for name, part in self.named.items() if part.tag == "link")

    # -------------------------------------------------------------------------------------- poses

    def pose(self, name: str, asking: Element) -> np.ndarray:
        """Return X_M_name of a part of this scope; `asking` is refused where there is none."""
        if name in ("", MODEL) or (self.world and name == WORLD):
            return np.eye(4)
        scope, rest = self._inside(name, asking)
        if scope is not self:
            return self._pose_of_model(scope, asking) @ scope.pose(rest, asking)
        if name in self.models:
            return self._pose_of_model(self.models[name], asking)
        # A part: its pose is known, or being found, which is a circle, or found now.
        if name not in self._known:
            self._known[name] = None
            part = self.named[name]
            base = {"joint": _text(part, "child"), "frame": part.attributes.get("attached_to", "")}
            self._known[name] = self._placed(part, base.get(part.tag, ""))
        found = self._known[name]
        if found is None:
            raise asking.refusal(f"the pose of {shortened(name)} is given by way of itself")
        return found

    def in_world(self, name: str, asking: Element) -> np.ndarray:
        """Return X_W_name."""
        own = np.eye(4) if self.parent is None else self.parent.origin(self, asking)
        return own @ self.pose(name, asking)

    def origin(self, model: Scope, asking: Element) -> np.ndarray:
        """Return X_W_M of a model of this scope."""
        own = np.eye(4) if self.parent is None else self.parent.origin(self, asking)
        return own @ self._pose_of_model(model, asking)

    def _pose_of_model(self, model: Scope, asking: Element) -> np.ndarray:
        """Return the pose of a nested model in this scope: of its `placement_frame`, or its own."""
        key = BETWEEN + str(id(model))
        if key not in self._known:
            self._known[key] = None
            X = self._placed(model.place, "")
            frame = _text(model.place, "placement_frame") or model.element.attributes.get(
                "placement_frame", ""
            )
            self._known[key] = X @ poses.inverse(model.pose(frame, model.place))
        found = self._known[key]
        if found is None:
            raise asking.refusal("the pose of a model is given by way of itself")
        return found

    def _placed(self, part: Element, base: str) -> np.ndarray:
        """Return X_M of a part by its <pose>, relative to `base` if that does not say to what."""
        pose = part.inner("pose")
        if pose is None:
            return self.pose(base, part)
        relative = self.relative(pose) or base
        return self.pose(relative, pose) @ read_pose(pose)

    def relative(self, pose: Element) -> str:
        """Return what a pose is relative to by its own word, or nothing."""
        old = pose.attributes.get("frame", "") if self.version < RELATIVE else ""
        return pose.attributes.get("relative_to", "") or old

    def _inside(self, name: str, asking: Element) -> tuple[Scope, str]:
        """Return the scope in which a name stands, and the name there."""
        if name in self.named or name in self.models:
            return self, name
        outer, _, rest = name.partition(BETWEEN)
        if rest and outer in self.models:
            return self.models[outer], rest
        for scope in self.merged:
            if name in scope.named or name in scope.models or outer in scope.models:
                return scope, name
        known = ", ".join([*self.named, *self.models][:8]) or "none"
        raise asking.refusal(f"there is no {shortened(name)}; the names here are {known}")

    # -------------------------------------------------------------------------------------- bodies

    def mount(self, name: str, asking: Element) -> tuple[str, np.ndarray]:
        """Return the body that a part of this scope moves with, and X_W_body; STILL for what
        stands still."""
        if name == WORLD and WORLD not in self.named:
            return STILL, np.eye(4)
        if name in ("", MODEL):
            stands = self.world or self.static or not self.moves()
            return (STILL, np.eye(4)) if stands else self.mount(self.canonical(), asking)
        scope, rest = self._inside(name, asking)
        if scope is not self:
            return scope.mount(rest, asking)
        if name in self.models:
            return self.models[name].mount(MODEL, asking)
        part = self.named[name]
        if part.tag == "link":
            return (
                (STILL, np.eye(4))
                if self.static
                else (self.path + name, self.in_world(name, asking))
            )
        if name in self._asked:
            raise part.refusal("is attached to itself, by way of others or not")
        self._asked.add(name)
        try:
            return self.mount(
                _text(part, "child") if part.tag == "joint" else _attached(part), part
            )
        finally:
            self._asked.discard(name)

    def moves(self) -> bool:
        """Tell whether a model is more than static models without a link of their own."""
        inner = [*self.models.values(), *self.merged]
        alone = not self.static and not inner
        return alone or any(True for _ in self.links()) or any(model.moves() for model in inner)

    def canonical(self) -> str:
        """Return the name of the link that the model's own frame is attached to."""
        stated = self.element.attributes.get("canonical_link", "")
        if stated:
            return stated
        for name, _ in self.links():
            return name
        for name, model in self.models.items():
            if model.moves():
                return f"{name}{BETWEEN}{model.canonical()}"
        for model in self.merged:
            if model.moves():
                return model.canonical()
        raise self.element.refusal("holds no link")


def version_of(root: Element) -> tuple[int, int]:
    """Return the version of the format that a document, or a name in a model.config, says."""
    root = root.with_attributes({"version": LATEST, **root.attributes})
    root.number("version")  # which refuses what is none
    return numbered(root.text("version")) or (1, 0)


def read_pose(pose: Element) -> np.ndarray:
    """Return the pose that the text of a <pose> gives: x y z and roll pitch yaw, or a quaternion
    x y z w."""
    turned = pose.choice("rotation_format", ("euler_rpy", "quat_xyzw"), "euler_rpy")
    if not pose.text("pose"):
        return np.eye(4)
    if turned == "quat_xyzw":
        x, y, z, i, j, k, w = pose.numbers("pose", (7,))
        return poses.pose((x, y, z), poses.from_quaternion(w, i, j, k))
    numbers = pose.numbers("pose", (6,))
    angles = np.array(numbers[3:])
    if pose.choice("degrees", ("true", "false", "1", "0"), "false") in ("true", "1"):
        angles = np.radians(angles)
    return poses.pose(numbers[:3], poses.from_rpy(*angles))


def thread_pitch(joint: Element) -> float:
    """Return the advance of a screw per radian [m/rad]."""
    if joint.first("screw_thread_pitch") is not None:
        return joint.inner_number("screw_thread_pitch", 0.0) / (2 * pi)
    pitch = joint.inner_number("thread_pitch", 1.0)
    if not pitch:
        raise joint.refusal("thread_pitch is 0; give radians per metre of a left-hand thread")
    return -1 / pitch


def _text(element: Element, tag: str) -> str:
    """Return the text of a child, or the attribute of that name."""
    child = element.first(tag)
    return element.attributes.get(tag, "") if child is None else child.content


def _attached(frame: Element) -> str:
    return frame.attributes.get("attached_to", "") or MODEL
