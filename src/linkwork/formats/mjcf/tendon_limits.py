"""Limits of tendons as stops, which rest where MuJoCo's limits do.

Past an end by the depth r MuJoCo gives the length l the acceleration

    l'' = (1 - d) l''_free - d (b l' + k d r),    k = 1 / (d T z)^2,  b = 2 / (d T)

with the time constant T and the damping ratio z of solreflimit and the impedance d of solimplimit
(which it reaches at the depth `width`). So a load F rests at the depth r, with m = 1 / (J M^-1 J')
at qpos0, where

    F = m k d^2 / (1 - d) r

That is the stiffness of the stop. Its damping, which grows with the depth, is MuJoCo's there,
m b d / (1 - d), at the depth `width`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linkwork.formats.mjcf.inertia import along, inertia, mobility
from linkwork.formats.mjcf.joints import Joints
from linkwork.formats.mjcf.tree import ModelTree
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import Cable, Combination, Stop

REFERENCE = (0.02, 1.0)
IMPEDANCE = (0.9, 0.95, 0.001, 0.5, 2.0)
IMPEDANCES = (1e-4, 0.9999)  # the least and the greatest that MuJoCo takes
THINNEST = 1e-6  # least width [m, rad]
LEAST = 1e-12  # J M^-1 J' of what a tendon moves [1/kg]
STOPPED = (
    "has a range, whose ends are stops here: loads rest on them as in MuJoCo, but its limits also "
    "weaken what acts against them, so that impacts take another course"
)
UNMOVED = (
    "has a range, which is left out: at qpos0 the tendon moves nothing, or something without mass"
)
NARROW = "has a range, which is left out: its margin leaves no room between the ends"


def stop_of(
    element: Element, line: Combination | Cable, tree: ModelTree, joints: Joints, notes: Notes
) -> Stop | None:
    """Return the stop that the range of a tendon is, or None with a note."""
    reference = element.numbers("solreflimit", (1, 2), REFERENCE)
    given = element.numbers("solimplimit", (1, 2, 3, 4, 5), IMPEDANCE)
    impedance = (*given, *IMPEDANCE[len(given) :])
    d, width = float(np.clip(impedance[1], *IMPEDANCES)), impedance[2]
    first, second = (*reference, *REFERENCE[len(reference) :])
    if first > 0:
        k, b = 1 / (d * first * second) ** 2, 2 / (d * first)
    else:
        k, b = -first / d**2, -second / d
    margin, (lower, upper) = element.number("margin", 0.0), element.numbers("range", (2,))
    below = lower > 0 or isinstance(line, Combination)  # no way is shorter than nothing
    if below and lower + margin >= upper - margin:
        notes.on(element, NARROW, alters=True)
        return None
    mobility = _mobility(line, tree, joints)
    if mobility < LEAST or not k:
        notes.on(element, UNMOVED, alters=True)
        return None
    notes.on(element, STOPPED, alters=True)
    return element.make(
        Stop,
        lower=lower + margin if below else None,
        upper=upper - margin,
        stiffness=k * d**2 / (1 - d) / mobility,
        exponent=1.0,
        dissipation=b / (k * d * max(width, THINNEST)),
    )


def _mobility(line: Combination | Cable, tree: ModelTree, joints: Joints) -> float:
    """Return J M^-1 J' of a tendon at qpos0."""
    tree = _moved_by(line, tree, joints)
    M, places = inertia(tree)
    J = np.zeros(len(M))
    if isinstance(line, Combination):
        at = {
            joints.coordinates[piece.name]: place.start
            for (_, piece), place in zip(tree.pieces(), places, strict=True)
            if piece.name in joints.coordinates
        }
        for label, ratio in line.ratios.items():
            J[at[label]] += ratio
    else:
        J = along(line, tree)
    M = M + line.inertia * np.outer(J, J)
    found = mobility(M, J)
    return found if found < np.inf else 0.0


def _moved_by(line: Combination | Cable, tree: ModelTree, joints: Joints) -> ModelTree:
    """Return the trees, of those that stand in the world, that a tendon moves: all others are apart
    in M."""
    roots: dict[str, str] = {}
    for name, node in tree.nodes.items():
        roots[name] = roots.get(node.parent, name)
    if isinstance(line, Combination):
        bodies = {
            node.name
            for node, piece in tree.pieces()
            if joints.coordinates.get(piece.name or "") in line.ratios
        }
    else:
        bodies = {*line.bodies} & tree.nodes.keys()
    own = {roots[name] for name in bodies}
    return replace(tree, nodes={n: node for n, node in tree.nodes.items() if roots[n] in own})
