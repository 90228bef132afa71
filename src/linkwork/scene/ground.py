"""What is fixed to the ground: rails of what slides on it, pads of what stands on it, and the base
between pads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from linkwork.mechanism import GROUND, Limits
from linkwork.scene.curves import hull
from linkwork.scene.meshes import BLOCK, PlacedMesh
from linkwork.scene.parts import Bar, Hull, Moves, ScenePart, moved
from linkwork.scene.skeleton import JointPlace, Skeleton
from linkwork.scene.symbols import HINGE, KNOB, SLIDER

# Lengths are relative to the mechanism
PAD = np.array([0.09, 0.09, 0.008])  # sides of a pad
RAIL = 0.006  # radius of a rail
# What rails are longer at either end than the slider needs, and where nothing limits it.
NEEDED, FREE = 0.1, 0.3
UPRIGHT = 0.9  # cosine of the angle to z of a hinge's axis, above which it stands on its end
LEVEL = 1e-6  # difference of heights that is none


def ground(
    pose: Skeleton, moves: Moves, limits: Mapping[str, Limits] | None, size: float, planar: bool
) -> Iterator[ScenePart]:
    """Yield what is fixed to the ground; rails are as long as the moves need, or where limits are
    given, as these allow."""
    standing = []
    for joint in (joint for joint in pose.joints if joint.grounded):
        anchor = joint.near if joint.connects[0] == GROUND else joint.far
        if joint.rail is not None:
            ends = anchor + np.outer(travel(joint, moves, limits, size), joint.rail)
            yield ScenePart(joint.name, "rail", (GROUND,), Bar(ends, RAIL * size))
        elif not len(joint.slides):
            upright = len(joint.turns) == 1 and abs(joint.turns[0][2]) > UPRIGHT
            standing.append(pad(joint.name, anchor, HINGE[1] / 2 if upright else KNOB, size))
    yield from standing
    places = np.array([part.form.position for part in standing]).reshape(-1, 3)  # pyright: ignore
    level = not planar and len(places) > 2 and np.ptp(places[:, 2]) < LEVEL * size
    if level and len(hull(places)[0]) > 2:
        yield ScenePart("base", "base", (GROUND,), Hull.of(hull(places)))
    for anchor in pose.anchors:
        yield pad("", anchor, KNOB, size)


def pad(name: str, place: np.ndarray, below: float, size: float) -> ScenePart:
    """Return a level pad below a place."""
    down = (below + PAD[2] / 2) * size * np.eye(3)[2]
    return ScenePart(
        name, "stand", (GROUND,), PlacedMesh(BLOCK, place - down, np.eye(3), PAD * size)
    )


def travel(
    joint: JointPlace, moves: Moves, limits: Mapping[str, Limits] | None, size: float
) -> tuple[float, float]:
    """Return from where to where on its axis a slider goes, and some more."""
    (anchor, _), (slider, body) = sorted(
        ((p, of) for of, p in joint.ends), key=lambda end: end[1] != GROUND
    )
    way = (moved(slider[None], (body,), moves) - anchor) @ joint.rail
    low, high, half = float(way.min()), float(way.max()), SLIDER[2] / 2 * size
    room = (NEEDED if limits is None else FREE) * size
    own = (limits or {}).get(joint.slide, Limits())
    ends = (
        (own.lower, own.upper)
        if joint.connects[0] == GROUND
        else (minus(own.upper), minus(own.lower))
    )
    return (
        min(low, 0.0) - room if ends[0] is None else min(low, ends[0]) - half,
        max(high, 0.0) + room if ends[1] is None else max(high, ends[1]) + half,
    )


def minus(bound: float | None) -> float | None:
    return None if bound is None else -bound
