"""Whole turns: which of them the tree's coordinates leave open, and how states hold them.

The coordinates of a joint that closes a loop are read off the tree's, and these leave its whole
turns open: what was read may be any number of turns behind, a quaternion p may be -p. Where nothing
acts on these turns a state holds its own (`windings`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations import cut_coordinates
from linkwork.equations.topology import counting
from linkwork.kernels import Kernel
from linkwork.model.labels import Labels


@dataclass(frozen=True, eq=False)
class TurnedLabels(Labels):
    """Tell which coordinates may jump over time, and how many whole turns they are ahead of what is
    read off the tree's."""

    @cached_property
    def quaternions(self) -> list[list[int]]:
        """Places among the coordinates of the quaternions of joints that close loops."""
        names, tree = self.equations.mechanism.coordinates, self.equations.tree.coordinates
        return [places for places in self.all_quaternions.values() if names[places[0]] not in tree]

    @cached_property
    def jumping(self) -> list[str]:
        """Angles of loop-closing joints that are read by the arc tangent."""
        return [
            label
            for cut in self.equations.cuts
            if cut_coordinates.jump(cut)
            for label in self._angles(cut.joint)
        ]

    @cached_property
    def counted(self) -> np.ndarray:
        """Which coordinates (m) are angles of loop-closing joints whose turns act, on a spring, a
        gear or a thread."""
        names = counting(self.equations.mechanism)
        return self._among(
            [
                x
                for cut in self.equations.cuts
                if cut.joint in names
                for x in self._angles(cut.joint)
            ]
        )

    @cached_property
    def wound(self) -> np.ndarray:
        """Which coordinates (m) are angles of loop-closing joints whose turns act on nothing: they
        are the state's own."""
        every = self._among([x for cut in self.equations.cuts for x in self._angles(cut.joint)])
        return np.logical_and(every, ~self.counted)

    @cached_property
    def jumps(self) -> np.ndarray:
        """Which coordinates (m) may jump over time: angles read by the arc tangent, and
        quaternions."""
        return np.logical_or(self._among(self.jumping), self.signed)

    @cached_property
    def signed(self) -> np.ndarray:
        """Which coordinates (m) belong to the quaternions of loop-closing joints."""
        return np.array(
            [any(i in places for places in self.quaternions) for i in range(self.angular.size)],
            bool,
        )

    @cached_property
    def free(self) -> np.ndarray:
        """Which coordinates (m) are angles whose whole turns act on nothing."""
        return np.logical_and(self.angular, ~self.counted)

    @cached_property
    def may_wind(self) -> bool:
        """Whether the tree's coordinates leave whole turns of any coordinate open."""
        return bool(self.wound.any() or self.quaternions)

    @property
    def may_jump(self) -> bool:
        """Whether any coordinate may jump over time."""
        return bool(self.jumping or self.quaternions)

    def _angles(self, joint: str) -> list[str]:
        """Return the angles of a loop-closing joint that the tree does not hold."""
        joints, tree = self.equations.mechanism.joints, self.equations.tree.coordinates
        return (
            [label for label in joints[joint].angles(joint) if label not in tree]
            if joint in joints
            else []
        )

    def _among(self, labels: list[str]) -> np.ndarray:
        """Tell of each coordinate (m) whether it is among some labels."""
        return np.array([label in labels for label in self.equations.mechanism.coordinates], bool)

    def compared(self, given: np.ndarray, read: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `windings` and by how much coordinates contradict those that are read off the
        tree's (..., m each).

        The latter is positive, in the mechanism's own units, and leaves out whole turns that act on
        nothing. A quaternion may have any length and either sign.
        """
        windings, mismatch = self.comparing(given, read)
        return windings, mismatch

    @cached_property
    def comparing(self) -> Kernel:
        """The kernel of `comparison`."""
        return self.chart.compiled("compared", lambda _: self.comparison)

    @property
    def comparison(self) -> ca.Function:
        """The function (given, read) -> windings, mismatch of `compared`."""
        given, read = (ca.SX.sym(name, self.angular.size) for name in ("given", "read"))
        meant, windings = ca.SX(given), ca.SX.zeros(self.angular.size)
        for places in self.all_quaternions.values():
            other = ca.dot(given[places], read[places]) < 0
            meant[places] = given[places] * ca.if_else(other, -1, 1) / ca.norm_2(given[places])
            if self.signed[places[0]]:
                windings[places] = other
        error = meant - read
        turns = error / (2 * np.pi)
        turns = ca.copysign(ca.ceil(ca.fabs(turns) - 0.5), turns)
        windings += turns * ca.DM(self.wound)
        error -= 2 * np.pi * turns * ca.DM(self.free)
        mismatch = ca.fabs(error) * ca.DM(1 / self.sizes)
        return ca.Function("compared", [given, read], [ca.densify(windings), ca.densify(mismatch)])

    def windings(self, positions: np.ndarray, read: np.ndarray) -> np.ndarray:
        """Return the whole turns (..., m) by which coordinates are ahead of those that are read off
        the tree's.

        They are those of loop-closing joints; a quaternion of the other sign is one turn ahead.
        """
        return self.compared(positions, read)[0]

    def turned(self, read: np.ndarray, windings: np.ndarray) -> np.ndarray:
        """Return coordinates (..., m) that are read off the tree's with whole turns added."""
        if not self.may_wind or not np.count_nonzero(windings):
            return read
        ahead = read + 2 * np.pi * windings
        return (
            np.where(self.signed, read * (-1.0) ** windings, ahead) if self.quaternions else ahead
        )

    def nearest(self, read: np.ndarray, positions: np.ndarray) -> np.ndarray:
        """Return coordinates (..., m) that are read off the tree's with the whole turns of
        others."""
        if not self.may_wind:
            return read
        if not self.quaternions:
            away = np.abs(positions - read)
            if np.count_nonzero(away < np.pi) == away.size:
                return read
        return self.turned(read, self.windings(positions, read))

    def unwrapped(self, time: np.ndarray, positions: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return coordinates of all joints over time (..., K, m) without the jumps that
        loop-closing joints may have.

        Angles that are read by the arc tangent jump by 2 pi, quaternions between p and -p. The
        rates of all joints (..., K, m) [rad/s] tell how far an angle has turned from one sample to
        the next; where they change so much that they do not, it is taken to have turned by less
        than half a turn.
        """
        mechanism, positions = self.equations.mechanism, positions.copy()
        h = np.diff(time, axis=-1)
        for label in self.jumping:
            q = positions[..., mechanism.coordinates.index(label)]
            w = rates[..., mechanism.rates.index(label)]
            told = h * np.abs(np.diff(w, axis=-1)) / 2 < np.pi
            ahead = np.where(told, h * (w[..., 1:] + w[..., :-1]) / 2, 0.0)
            q[..., 1:] += (
                2
                * np.pi
                * np.cumsum(np.round((ahead - np.diff(q, axis=-1)) / (2 * np.pi)), axis=-1)
            )
        for places in self.quaternions:
            p = positions[..., places]
            flips = np.sign(np.sum(p[..., 1:, :] * p[..., :-1, :], axis=-1))
            positions[..., 1:, places] *= np.cumprod(np.where(flips == 0, 1, flips), axis=-1)[
                ..., None
            ]
        return positions
