"""Regrouping of moments along a tree: what a parent's inertia cannot be told from is moved into it
once and for all.

A body that turns on its parent acts on it through its mass only as a point mass at the joint, and
through what is round about a hinge's axis as if this were the parent's own: with the axis z, a
first moment along z and an inertia c (1 - z z'). The recursions then carry the other first and
second moments alone. A body fixed to its parent is moved into it whole.
Source: Khalil & Dombre 2002, ch. 9 (regrouping).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linkwork.equations.algebra import SX, Vector, snap
from linkwork.equations.moments import Moments, steiner
from linkwork.equations.turned_inertia import all_differ


@dataclass(frozen=True)
class Hanging:
    """Hold a node's moments, and how it hangs on its parent.

    parent: its index, -1 for ground; arm: position in it where constant; weld: orientation where
        fixed; hinge: the axis of a turn alone, in the node and in the parent
    """

    moments: Moments
    parent: int
    arm: Vector | None
    weld: Vector | None
    hinge: tuple[Vector, Vector] | None


def regrouped(links: Sequence[Hanging]) -> list[Moments]:
    """Move masses into parents: a turning link's as a point at the joint, with what is round about
    a hinge's axis, a fixed link's moments whole."""
    moments = [link.moments for link in links]
    for index in reversed(range(len(links))):
        link, own = links[index], moments[index]
        if link.arm is None:
            continue
        into = moments[link.parent] if link.parent >= 0 else None
        if link.weld is not None:
            passed, moments[index] = own.moved(link.weld, link.arm), Moments.none()
        else:
            found = round_part(own, link.hinge, link.arm, into) if link.hinge else None
            passed, moments[index] = found or mass_part(own, link.arm)
        if into is not None:
            moments[link.parent] = into + passed
    return moments


def mass_part(own: Moments, arm: Vector) -> tuple[Moments, Moments]:
    """Return the mass as moments of the parent, and what is left."""
    point = Moments(own.m, np.zeros(3), np.zeros((3, 3)))
    return point.moved(np.eye(3), arm), Moments(0.0, own.h, own.I)


def round_part(
    own: Moments, hinge: tuple[Vector, Vector], arm: Vector, into: Moments | None
) -> tuple[Moments, Moments] | None:
    """Return mass, first moment along a hinge's axis z and the inertia c (1 - z z'), as moments of
    the parent, and what is left; None where numbers are free, where that costs more.

    c: half of both moments of inertia across the axis; into: the parent's moments, None of ground
    """
    (z, z_p), h, inertia = hinge, own.h, own.I
    numbers = (z, z_p, h, inertia, arm)
    if not all(isinstance(x, np.ndarray) for x in numbers) or isinstance(own.m, SX):
        return None
    if not all_differ(np.linalg.eigvalsh(inertia)):
        return None
    along, c = z @ h, (np.trace(inertia) - z @ inertia @ z) / 2
    part = Moments(own.m, along * z_p, c * steiner(z_p)).moved(np.eye(3), arm)
    if into is not None and not (full(into.h, part.h) and full(into.I, part.I)):
        return None
    h_left = snap(h - along * z, np.abs(h).max())
    return part, Moments(0.0, h_left, snap(inertia - c * steiner(z), np.abs(inertia).max()))


def full(values: Vector, added: Vector) -> bool:
    """Tell whether numbers are not zero wherever those that are added are not."""
    return isinstance(values, np.ndarray) and bool(values[added != 0].all())
