"""Names beside joints, where they hide least of the picture.

A name is a box that touches a circle about its joint. Of some directions from the joint the one is
taken whose box is farthest from all that is drawn, beginning with the direction that leads out of
the middle of the picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from linkwork.scene.skeleton import Skeleton
from linkwork.views.canvas import Canvas

ASIDE = 0.055  # distance of a name from its joint, relative to the mechanism
CLOSE = 0.045  # distance of joints in the picture below which their names stand together
LETTER, LINE = 0.019, 0.036  # width of a letter and height of a line
SMALLER = 1.5  # how much smaller mechanisms are drawn in space, where axes take much of the picture
# Places in a box, in its half size.
COVERED = np.array(list(product(np.linspace(-1, 1, 7), (-1, 0, 1))))
DIRECTIONS = 16
FREE = 1.6  # distance to all that is drawn, in sizes of the box, that is as good as any larger one


def write_names(canvas: Canvas, pose: Skeleton, shown: Sequence[str]) -> None:
    """Write joints' names beside them; names at nearly the same place stand one below the other."""
    drawn = pose.outline @ canvas.screen.T / canvas.size
    for point, names in grouped(canvas, pose, shown):
        place = canvas.screen @ point / canvas.size
        half = (
            np.array([LETTER * max(map(len, names)), LINE * len(names)])
            / 2
            * (1.0 if canvas.flat else SMALLER)
        )
        box = placed(place, half, drawn)
        drawn = np.concatenate([drawn, box + half * COVERED])
        canvas.text(point, (box - place) * canvas.size, half * canvas.size, "\n".join(names))


def grouped(
    canvas: Canvas, pose: Skeleton, shown: Sequence[str]
) -> list[tuple[np.ndarray, list[str]]]:
    """Return places (3) and the names of the joints there."""
    groups: list[tuple[np.ndarray, list[str]]] = []
    for joint in pose.joints:
        if joint.name not in shown:
            continue
        place = (joint.near + joint.far) / 2 if joint.rod or joint.tubed else joint.far
        for other, names in groups:
            if np.linalg.norm(canvas.screen @ (place - other)) < CLOSE * canvas.size:
                names.append(joint.name)
                break
        else:
            groups.append((place, [joint.name]))
    return groups


def placed(place: np.ndarray, half: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the middle (2) of a box of half a size (2) beside a place, away from what is drawn
    (k, 2)."""
    outwards = np.arctan2(*(place - drawn.mean(axis=0))[::-1])
    turns = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
    angles = outwards + turns[np.argsort(np.minimum(turns, 2 * np.pi - turns), kind="stable")]
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    boxes = place + ASIDE * directions + half * np.clip(1.5 * directions, -1, 1)
    gaps = [np.abs((drawn - box) / half).max(axis=1).min() for box in boxes]
    return boxes[int(np.argmax(np.minimum(gaps, FREE)))]
