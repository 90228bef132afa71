"""Screw joint: F2 turns about the axis a and advances along it by the pitch h [m/rad].

R_12 = Rot(a, q),  p_12 = h q a       motion subspace  S = [a; h a]
closure rows, e_1, e_2 transversal to a:  e_1 . p_12 = 0,    e_2 . p_12 = 0    (two positions)
                                          e_1 . R_12 a = 0,  e_2 . R_12 a = 0  (two directions)
                                          a . p_12 - h q = 0                   (the thread)

The thread's row is written as h sin(a . p_12 / h - q): the advance counts the turns, the
orientation cannot.
"""

from __future__ import annotations

import numpy as np

from linkwork.equations.algebra import present
from linkwork.equations.joints.kind import ElementaryMotion, Kind, Row, coaxial, screw
from linkwork.mechanism import ScrewJoint


def motions(joint: ScrewJoint) -> tuple[ElementaryMotion, ...]:
    return (screw(joint.axis, joint.pitch),)


def rows(joint: ScrewJoint, preferred: np.ndarray) -> tuple[Row, ...]:
    a = np.array(joint.axis)
    positions, directions = coaxial(a, preferred)
    thread = Row("thread", a, pitch=joint.pitch if present(joint.pitch) else None)
    return (*positions, thread, *directions)


KIND = Kind(motions, rows)
