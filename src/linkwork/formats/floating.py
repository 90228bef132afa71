"""Roots that float: the body that a model fixes to ground moves freely instead."""

from __future__ import annotations

from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.mechanism import GROUND, FixedJoint, FreeJoint, Joint, Mechanism, MechanismError

FLOATING = "floating_base"  # the free joint of a root


def floated(mechanism: Mechanism, place: str, notes: Notes) -> Mechanism:
    """Return the mechanism with a free joint, `floating_base`, where one body is fixed to ground.

    A mechanism of which nothing is fixed to ground and something floats stays as it is.

    Args:
        place: the file, for refusals and notes.

    Raises:
        MechanismError: nothing is fixed to ground, or more than one body.
    """
    # What stands on ground: one body, or nothing where something floats already.
    fixed = {
        name: joint
        for name, joint in mechanism.joints.items()
        if isinstance(joint, FixedJoint) and GROUND in joint.connects
    }
    if not fixed and any(
        isinstance(joint, FreeJoint) and GROUND in joint.connects
        for joint in mechanism.joints.values()
    ):
        notes.say(f"{place}: the root floats already")
        return mechanism
    if len(fixed) != 1:
        roots = ", ".join(
            repr(body) for joint in fixed.values() for body in joint.connects if body != GROUND
        )
        what = f"the bodies {roots} are" if fixed else "no body is"
        raise MechanismError(
            f"{place}: {what} fixed to ground; a root floats where exactly one body is"
        )
    # Its joint is a free one from here on, with the same frames, ground first.
    ((old, joint),) = fixed.items()
    new = FreeNames(notes, tuple(mechanism.joints)).give(FLOATING)
    one, two = (0, 1) if joint.connects[0] == GROUND else (1, 0)
    free = FreeJoint(
        connects=(joint.connects[one], joint.connects[two]),
        frames=(joint.frames[one], joint.frames[two]),
    )
    joints: dict[str, Joint] = {
        (new if name == old else name): (free if name == old else each)
        for name, each in mechanism.joints.items()
    }
    return Mechanism(**{**dict(mechanism), "joints": joints})
