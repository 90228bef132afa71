"""Symbols of joints: they follow from what a joint's motions do, so that a kind of its own needs
none of its own.

turn            short pin about its axis; about two axes that cross, a pin on each of the two bodies
slide           box on its line; in a plane, a sheet across its normal
turn and slide  longer pin; one that slides as it turns has a thread around it
free turn       ball
nothing         cube
rod             a bar with a small ball at either end

What slides along a line has a rail on the ground, or a guide, or is a rod in a tube; the rest
stands on pads on the ground.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from linkwork.scene.colours import DRIVEN
from linkwork.scene.curves import helix
from linkwork.scene.meshes import BALL, BLOCK, PIN, Mesh, PlacedMesh, frame_along
from linkwork.scene.parts import Bar, ScenePart
from linkwork.scene.skeleton import JointPlace

# Lengths are relative to the mechanism
HINGE, SLEEVE, ARM = (0.018, 0.06), (0.016, 0.085), (0.010, 0.05)  # radius and length of pins
# Radii of balls, alone, on what slides, and at the ends of rods.
KNOB, SEATED, TIP = 0.018, 0.03, 0.010
# Sides of boxes.
SLIDER, SHEET, CUBE = (0.05, 0.05, 0.07), (0.065, 0.065, 0.012), (0.032, 0.032, 0.032)
THREAD, WIRE = 0.022, 0.0025  # radius of a thread, and its thickness
ROD, TUBE, GUIDE = 0.0065, 0.017, 0.004  # radii
TUBED = 0.55  # part of a telescope's length that is its tube
ALIGNED = 1 - 1e-9  # cosine of the angle between two directions that are one


def symbol(joint: JointPlace, size: float) -> Iterator[ScenePart]:
    """Yield all parts of a joint but what is fixed to the ground; size: largest extent of the
    mechanism [m]."""
    for k, (role, bodies, form) in enumerate(parts(joint, size)):
        own = DRIVEN if joint.driven and role in ("joint", "tube") else None
        yield ScenePart(joint.name, role, bodies, form, own, standing=k == 0)


def parts(
    joint: JointPlace, size: float
) -> Iterator[tuple[str, tuple[str, ...], PlacedMesh | Bar]]:
    """Yield the role, bodies and form of each part of a joint, the one that stands for it first."""
    ends = np.stack([joint.near, joint.far])
    if joint.tubed:
        yield "tube", joint.connects, Bar(ends, TUBE * size, until=TUBED)
        yield "rod", joint.connects, Bar(ends, ROD * size, hidden=TUBED)
    elif joint.rod:
        yield "rod", joint.connects, Bar(ends, ROD * size)
        for body, end in joint.ends:
            yield "tip", (body,), piece(BALL, end, np.eye(3), [TIP] * 3, size)
    else:
        for body, shown in pieces(joint, size):
            yield "joint", (body,), shown
        if joint.threaded:
            thread = helix(joint.far, joint.turns[0], THREAD * size, SLEEVE[1] * size)
            yield "thread", joint.connects[1:], Bar(thread, WIRE * size)
        if joint.rail is not None and not joint.grounded:
            yield "guide", joint.connects, Bar(ends, GUIDE * size)


def pieces(joint: JointPlace, size: float) -> Iterator[tuple[str, PlacedMesh]]:
    """Yield the solids of a joint, each with its body; what is about an axis of several stands on
    the body that bears it."""
    (first, second), place, turns, slides = joint.connects, joint.far, joint.turns, joint.slides
    slid, frame = len(slides), np.eye(3)
    if slid in (1, 2):
        frame = frame_along(slides[0] if slid == 1 else np.cross(*slides))
    about = [turn for turn in turns if slid not in (1, 2) or abs(turn @ frame[:, 2]) < ALIGNED]
    if slid == 1 and len(about) < len(turns):
        yield second, pin(place, slides[0], SLEEVE, size)
    elif slid:
        sides = SLIDER if slid == 1 else SHEET if slid == 2 else CUBE
        yield second, piece(BLOCK, place, frame, sides, size)
    if joint.ball:
        yield second, piece(BALL, place, np.eye(3), [SEATED if slid else KNOB] * 3, size)
    elif len(about) == 1:
        yield second, pin(place, about[0], HINGE, size)
    elif about:
        yield first, pin(place, about[0], ARM, size)
        yield second, pin(place, about[-1], ARM, size)
    elif not slid:
        yield second, piece(BLOCK, place, frame, CUBE, size)


def pin(place: np.ndarray, axis: np.ndarray, form: tuple[float, float], size: float) -> PlacedMesh:
    """Return a round pin about an axis, its middle at a place."""
    radius, length = form
    return piece(PIN, place, frame_along(axis), (radius, radius, length), size)


def piece(mesh: Mesh, place: np.ndarray, turn: np.ndarray, scale, size: float) -> PlacedMesh:
    return PlacedMesh(mesh, place, turn, size * np.array(scale))
