"""Hinges and slides that follow others, or stay where they are: mimics of URDF and SDF, locks of
MJCF."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linkwork.formats import poses
from linkwork.formats.xml import Element
from linkwork.mechanism import FixedJoint, GearJoint, Joint
from linkwork.mechanism.joints import PairJoint


def follower(
    element: Element, joints: Mapping[str, Joint], labels: tuple[str, str], slope: float, at: float
) -> Joint:
    """Return what holds the first of two coordinates at slope times the second plus `at`: a gear,
    or, where the slope is zero, a fixed joint beside the hinge or slide."""
    label, other = labels
    joint = joints.get(label)
    if not slope and isinstance(joint, PairJoint):
        return held(joint, at)
    return element.make(GearJoint, ratios={label: 1.0, other: -slope}, offset=at)


def held(joint: PairJoint, value: float) -> FixedJoint:
    """Return a fixed joint beside a hinge or slide that holds it at a coordinate."""
    from linkwork.equations.reference import displacement

    motion = poses.pose(*displacement(joint, np.array([value])))
    first = poses.frame_of(poses.of_frame(joint.frames[0]) @ motion)
    return FixedJoint(connects=joint.connects, frames=(first, joint.frames[1]))
