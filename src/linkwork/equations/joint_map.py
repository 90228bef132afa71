"""The joints' own coordinates and rates, as functions of the tree's.

Those of the tree are its symbols and unit rows; those of a joint that closes a loop are read off
the poses (`cut_coordinates`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from linkwork.equations import cut_coordinates
from linkwork.equations.algebra import SX
from linkwork.equations.closure import Cut
from linkwork.equations.transmissions import Along, along
from linkwork.equations.tree import Tree
from linkwork.mechanism import Mechanism


@dataclass(frozen=True)
class JointMap:
    """Give the coordinates of all joints and the lengths of transmissions, and the rows (1 x nv)
    that give their rates from the tree's, by name.

    What a cut joint needs is derived when it is first asked for.

    turns: whole turns [rad] to add to what the poses give of a cut joint's angle, by name
    """

    mechanism: Mechanism
    tree: Tree
    cuts: tuple[Cut, ...]
    turns: Mapping[str, float] = field(default_factory=dict)
    _cache: dict[str, dict[str, Any]] = field(default_factory=dict, repr=False, compare=False)

    def position(self, label: str) -> ca.SX:
        """Return a joint coordinate [rad, m; 1 of a quaternion], or a transmission's length."""
        if label in self.mechanism.transmissions:
            return self.along(label).x
        if label in self.tree.places:
            return self.tree.q[self.tree.places[label]]
        cut = self._cut(label)
        names = self.mechanism.joints[cut.joint].coordinates(cut.joint)
        return self.once(
            f"{cut.joint}: positions",
            lambda: zip(names, cut_coordinates.positions(cut), strict=True),
        )[label] + self.turns.get(label, 0.0)

    def rate_row(self, label: str) -> ca.SX:
        """Return the row (1 x nv) of a joint rate, or of that of a transmission's length."""
        if label in self.mechanism.transmissions:
            line = self.along(label)
            return self.once(
                f"{label}: row", lambda: [(label, line.row(self.tree, self.rate_row))]
            )[label]
        if label in self.tree.rate_places:
            row = SX(1, len(self.tree.rates))
            row[self.tree.rate_places[label]] = 1
            return row
        cut = self._cut(label)
        names = self.mechanism.joints[cut.joint].rates(cut.joint)
        rows = self.once(
            f"{cut.joint}: rates",
            lambda: zip(
                names, ca.vertsplit(cut_coordinates.rate_rows(self.tree, cut)), strict=True
            ),
        )
        return rows[label]

    def along(self, name: str) -> Along:
        """Return a transmission by name."""
        line = self.mechanism.transmissions[name]
        key = f"{name}: along, {tuple(self.turns.items())}"
        return self.once(key, lambda: [(name, along(line, self.tree, self.position))])[name]

    def positions(self) -> ca.SX:
        """Return the coordinates of all joints, in the order of `mechanism.coordinates`."""
        return ca.vertcat(
            SX.zeros(0, 1), *[self.position(label) for label in self.mechanism.coordinates]
        )

    def rate_rows(self, labels: Sequence[str] | None = None) -> ca.SX:
        """Return the matrix (m x nv) of joint rates: those named, or all in the order of
        `mechanism.rates`."""
        rows = [
            self.rate_row(label) for label in (self.mechanism.rates if labels is None else labels)
        ]
        return ca.vertcat(SX(0, len(self.tree.rates)), *rows)

    def _cut(self, label: str) -> Cut:
        joint = label if label in self.mechanism.joints else label.rpartition(".")[0]
        return self._by_joint[joint]

    @cached_property
    def _by_joint(self) -> dict[str, Cut]:
        return {cut.joint: cut for cut in self.cuts}

    def once(self, key: str, derive: Callable[[], Iterable[tuple[str, Any]]]) -> dict[str, Any]:
        """Return by name what is derived of these joints under a key, the first time only."""
        if key not in self._cache:
            self._cache[key] = dict(derive())
        return self._cache[key]


def counted(joints: JointMap, q: np.ndarray, values: Mapping[str, float]) -> JointMap:
    """Return the map with the whole turns of cut joints' angles counted so that they are nearest to
    given values at q."""
    described = joints.mechanism.joints
    labels = [label for cut in joints.cuts for label in described[cut.joint].angles(cut.joint)]
    labels = [label for label in labels if label not in joints.tree.coordinates]
    if not labels:
        return joints
    angles = ca.vertcat(*[joints.position(label) for label in labels])
    read = np.array(joints.tree.evaluated("angles", [angles])(q)[0]).ravel()
    turns = np.round((np.array([values[label] for label in labels]) - read) / (2 * np.pi))
    whole = {label: 2 * np.pi * turn for label, turn in zip(labels, turns, strict=True) if turn}
    return replace(joints, turns=whole)


def derivative(matrix: ca.SX, tree: Tree, rates: ca.SX) -> ca.SX:
    """Return the time derivative of a matrix of q for the rates w, entry by entry; w itself is
    held."""
    dq = SX.sym("dq", len(tree.coordinates))
    along = ca.reshape(ca.jtimes(ca.vec(ca.densify(matrix)), tree.q, dq), *matrix.shape)
    return ca.substitute(along, dq, tree.derivatives(rates))
