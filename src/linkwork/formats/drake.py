"""Drake's own elements between two bodies, as URDF and SDF files have them.

    drake:ball_constraint         P of A and Q of B stay together
    drake:distance_constraint     |PQ| = d;  of a stiffness  f = k (|PQ| - d) + c d|PQ|/dt
    drake:linear_spring_damper    f = k (|PQ| - l) + c d|PQ|/dt,  which pulls P and Q together

A bushing (drake:linear_bushing_rpy) is soft in all six directions and no part of a mechanism here.

Source: https://drake.mit.edu (multibody, parsing).
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite

import numpy as np

from linkwork.formats import poses
from linkwork.formats.names import FreeNames
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import Frame, Joint, PointSpring, RodJoint, SphericalJoint

JOINT = "drake:joint"
BALL = "drake:ball_constraint"
DISTANCE = "drake:distance_constraint"
SPRING = "drake:linear_spring_damper"
BETWEEN = (BALL, DISTANCE, SPRING)
BUSHING = "drake:linear_bushing_rpy"
SOFT = (
    "is left out: a bushing, soft in all six directions, is no part of a mechanism here; tie what "
    "it holds by a joint"
)

Mount = Callable[[str, Element], tuple[str, np.ndarray]]
"""Returns the body that a part of the file moves with, and the pose of the part in it."""


def read_between(
    root: Element, mount: Mount, names: FreeNames
) -> tuple[dict[str, Joint], dict[str, PointSpring]]:
    """Return the joints and the springs that a robot or model has by such elements."""
    joints: dict[str, Joint] = {}
    springs: dict[str, PointSpring] = {}
    for element in root.each(*BETWEEN):
        # The points P and Q, in the bodies that the two links move with.
        ends = [mount(_part(element, f"body_{end}").text(NAME), element) for end in "AB"]
        connects = tuple(body for body, _ in ends)
        if connects[0] == connects[1]:
            raise element.refusal(f"connects {shortened(connects[0])} to itself")
        given = [_part(element, key).vector(VALUE) for key in ("p_AP", "p_BQ")]
        points = tuple(
            poses.triple(X[:3, :3] @ p + X[:3, 3]) for (_, X), p in zip(ends, given, strict=True)
        )
        # What is between them.
        name = names.give(element.tag.partition(":")[2])
        frames = tuple(Frame(position=point) for point in points)
        if element.tag == BALL:
            joints[name] = element.make(SphericalJoint, connects=connects, frames=frames)
            continue
        stiffness, damping = _number(element, "stiffness", inf), _number(element, "damping", 0.0)
        length = _number(element, "distance" if element.tag == DISTANCE else "free_length")
        if isfinite(stiffness):
            laws = {"stiffness": stiffness, "rest_length": length, "damping": damping}
            springs[name] = element.make(PointSpring, connects=connects, points=points, **laws)
        else:
            joints[name] = element.make(RodJoint, connects=connects, frames=frames, length=length)
    return joints, springs


NAME, VALUE = "name", "value"  # attributes of URDF; in SDF the same is what the elements hold


def _part(element: Element, what: str) -> Element:
    """Return an inner element as URDF has it."""
    inner = element.named(f"{element.tag}_{what}")
    said = dict.fromkeys((NAME, VALUE), inner.content)
    return inner.with_attributes({**said, **inner.attributes})


def _number(element: Element, what: str, default: float | None = None) -> float:
    if default is not None and element.first(f"{element.tag}_{what}") is None:
        return default
    return _part(element, what).number(VALUE, most=inf)
