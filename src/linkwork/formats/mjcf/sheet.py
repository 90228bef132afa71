"""The MJCF file that is being written: its elements, and what they are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.laws import number, numbers
from linkwork.formats.mjcf.model_plan import Home, ModelPlan, Move
from linkwork.formats.notes import Notes
from linkwork.mechanism import GROUND, Mechanism

GRADES = 3  # coefficients of a stiffness or damping in MJCF
SECTIONS = ("asset", "tendon", "equality", "actuator", "keyframe")


@dataclass
class Sheet:
    """Hold a file in the making.

    home: where the loops are closed; plan: how MJCF holds the mechanism
    elements: the bodies, by seat; sections: those behind the bodies, but for assets
    unshown: bodies with shapes that are left out
    folder: of the file, for meshes, or None for a text without them
    """

    mechanism: Mechanism
    home: Home
    plan: ModelPlan
    notes: Notes
    folder: Path | None = None
    elements: dict[str, ET.Element] = field(default_factory=dict)
    unshown: dict[str, None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.root = ET.Element("mujoco", model=self.mechanism.name)
        self.sections = {name: ET.Element(name) for name in SECTIONS}
        self.moves: dict[str, Move] = {
            move.name: move for seat in self.plan.seats.values() for move in seat.moves
        }

    @cached_property
    def size(self) -> float:
        """The mechanism's size [m]."""
        return self.home.size(self.mechanism)

    @cached_property
    def total(self) -> float:
        """The mass of all bodies [kg]."""
        return sum(body.mass for body in self.mechanism.bodies.values())

    def add(self, section: str, tag: str, **attributes: str) -> ET.Element:
        """Add an element to a section."""
        return ET.SubElement(self.sections[section], tag, attributes)

    def site(self, name: str, seat: str, X: np.ndarray) -> None:
        """Add a site to a body, by its pose in ground at home."""
        body = self.plan.seats[seat].body if seat != GROUND else GROUND
        ET.SubElement(
            self.elements[seat],
            "site",
            attrib={"name": name} | placed(poses.inverse(self.home.poses[body]) @ X),
        )

    def is_hinge_or_slide(self, label: str) -> bool:
        """Tell whether a coordinate is that of a hinge or slide of the file."""
        return label in self.moves and self.moves[label].kind in ("hinge", "slide")


def put_graded(element: ET.Element, name: str, coefficients: Sequence[float]) -> None:
    """Write a stiffness or damping with the powers that MJCF has of it, where it is not zero."""
    if any(coefficients[:GRADES]):
        element.set(name, numbers(coefficients[: GRADES if any(coefficients[1:]) else 1]))


def put(element: ET.Element, name: str, value: float) -> None:
    """Write an attribute that is not zero."""
    if value:
        element.set(name, number(value))


def placed(X: np.ndarray) -> dict[str, str]:
    """Return the attributes pos and quat of a pose, without those that say nothing."""
    found = {}
    if np.max(abs(X[:3, 3])) > poses.TINY:
        found["pos"] = numbers(X[:3, 3])
    if np.max(abs(X[:3, :3] - np.eye(3))) > poses.TINY:
        found["quat"] = numbers(poses.to_quaternion(X[:3, :3]))
    return found
