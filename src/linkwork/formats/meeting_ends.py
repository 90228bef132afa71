"""Springs and dampers between two points that meet where a file's motion begins: the force has no
direction there."""

from __future__ import annotations

import numpy as np

from linkwork.equations.reference import described
from linkwork.formats.instant import Instant
from linkwork.formats.notes import Notes
from linkwork.mechanism import Mechanism

MEET = 1e-12  # distance that is rounding [m]


def tell_of_ends(mechanism: Mechanism, place: str, notes: Notes) -> None:
    """Note the springs between points that meet in the reference, but those that then pull with
    nothing."""
    at = Instant.of(mechanism, described(mechanism)).at if mechanism.springs else {}
    for name, spring in mechanism.springs.items():
        pulls = spring.damping or (spring.stiffness and spring.rest_length)
        places = [
            at[body][0] + at[body][1] @ np.array(point, float)
            for body, point in zip(spring.connects, spring.points, strict=True)
        ]
        if pulls and np.linalg.norm(places[1] - places[0]) < MEET:
            notes.say(
                f"{place}: the ends of the spring {name!r} meet in the reference, where its force "
                "has no direction, so that no run begins there; start from another pose, or give "
                "another reference",
                alters=True,
            )
