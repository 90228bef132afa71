"""Limits: which joint coordinates of a mechanism have a range."""

from __future__ import annotations

from collections.abc import Iterator

from linkwork.mechanism.effects import Limits
from linkwork.mechanism.joints import TURN
from linkwork.mechanism.mechanism import Mechanism


def limited(mechanism: Mechanism) -> Iterator[tuple[str, Limits, str]]:
    """Yield what has limits: the coordinate (qw of a free turn), the limits, and the name to
    report."""
    for name, joint in mechanism.joints.items():
        for part in joint.parts(name):
            limits, first = part.effects.limits, part.coordinates[0]
            if limits.lower is not None or limits.upper is not None:
                yield first, limits, f"{name}.{TURN}" if part.name == TURN else first
