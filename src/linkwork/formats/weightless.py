"""Motions without mass: what a file lets move though nothing resists it, so that its acceleration
is not determined.

Bodies at the ends of open chains are looked at, one after the other towards the root. With the
motions S of the joint behind it, where that is at zero, and the inertia I of the body, both about
the joint, the motion that S' I S is singular for moves nothing. A body that is fixed to another one
is part of it; what carries mass behind further joints is taken to resist.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from linkwork.equations.algebra import skew
from linkwork.equations.joints import motions_of
from linkwork.formats import poses
from linkwork.formats.masses import solid_of
from linkwork.formats.notes import Notes
from linkwork.mechanism import GROUND, Cable, Combination, Mechanism
from linkwork.mechanism.joints import PairJoint
from linkwork.solids.solid import Solid, together

NOISE = 1e-13  # least eigenvalue of S' I S that is rounding, in units in which each motion's is 1
SHOWN = 4  # names in one sentence


def tell(mechanism: Mechanism, place: str, notes: Notes) -> None:
    """Note the joints whose motion moves no mass."""
    names = weightless(mechanism)
    if names:
        more = ", ..." if len(names) > SHOWN else ""
        notes.say(
            f"{place}: the motion of {', '.join(map(repr, names[:SHOWN]))}{more} moves no mass, "
            "and forces give it no acceleration; give what it moves mass and inertia, or the "
            "joint a rotor inertia",
            alters=True,
        )


def weightless(mechanism: Mechanism) -> list[str]:
    """Return the joints that end an open chain, or have nothing but massless bodies behind them,
    and let move what has no inertia."""
    # Joints by the body, and bodies that something beside them moves with.
    joints = dict(mechanism.pairs)
    uses = Counter(body for joint in joints.values() for body in joint.connects)
    lines = mechanism.transmissions.values()
    coupled = {label for gear in mechanism.gears.values() for label in gear.ratios}
    coupled |= {
        label
        for line in lines
        if isinstance(line, Combination) and line.inertia
        for label in line.ratios
    }
    heavy = {drag.body for drag in mechanism.drags.values()}
    heavy |= {
        body for line in lines if isinstance(line, Cable) and line.inertia for body in line.bodies
    }
    solids = {name: solid_of(body) for name, body in mechanism.bodies.items()}
    found: list[str] = []
    while joints:
        # Every joint that has an end of a chain behind it, once.
        ends = [
            (name, body)
            for name, joint in joints.items()
            for body in joint.connects
            if body != GROUND and uses[body] == 1
        ]
        if not ends:
            break
        for name, body in ends:
            joint = joints.pop(name, None)
            if joint is None:
                continue
            uses.subtract(joint.connects)
            near = next(other for other in joint.connects if other != body)
            solid = solids[body]
            free = not coupled & {*joint.rates(name), *joint.coordinates(name)}
            moves = joint.freedoms and not any(own.rotor for own in joint.effects().values())
            if free and moves and body not in heavy and _is_free(joint, body, solid):
                found.append(name)
            # What the next body towards the root carries of it.
            if not joint.freedoms and near != GROUND:
                X = _across(joint, near, body)
                solids[near] = together([solids[near], solid.seen(X)])
            elif solid.mass or solid.inertia.any():
                heavy.add(near)
            if body in heavy:
                heavy.add(near)
    return [name for name in mechanism.joints if name in found]


def _across(joint: PairJoint, near: str, body: str) -> np.ndarray:
    """Return the pose of a body in another one at zero of the joint between them."""
    frames = dict(zip(joint.connects, map(poses.of_frame, joint.frames), strict=True))
    return frames[near] @ poses.inverse(frames[body])


def _is_free(joint: PairJoint, body: str, solid: Solid) -> bool:
    """Tell whether a joint at zero lets a body move without inertia."""
    own = solid.seen(poses.inverse(poses.of_frame(joint.frames[joint.connects.index(body)])))
    c = skew(own.centre)
    about = own.inertia - own.mass * c @ c
    inertia = np.block([[about, own.mass * c], [-own.mass * c, own.mass * np.eye(3)]])
    columns = []
    for motion in motions_of(joint):
        turns = np.eye(3) if motion.ball else [motion.turn]
        columns += [np.concatenate([turn, motion.slide]) for turn in turns]
    S = np.array(columns).T
    M = S.T @ inertia @ S
    size = np.sqrt(np.diag(M).clip(0))
    if not size.all():
        return True
    return bool(np.linalg.eigvalsh(M / size / size[:, None])[0] < NOISE)
