"""Labels: what each joint coordinate and rate of a robot is (length, angle, part of a quaternion), and its unit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.equations import Equations, readings
from linkwork.mechanism import Mechanism
from linkwork.mechanism.joints import SLIDES, TURN
from linkwork.robot import checks

POSES = {True: ("x", "y", "angle"), False: ("x", "y", "z", "rx", "ry", "rz")}  # of a tool, by planar
POSE_ANGLES = ("angle", "rx", "ry", "rz")
UNITS = {slide: "m" for slide in SLIDES} | {TURN: "1"}


@dataclass(frozen=True, eq=False)
class Labels:
    """Tell the unit of every coordinate and rate of a mechanism's joints, and which coordinates may jump over time."""

    equations: Equations

    @cached_property
    def units(self) -> dict[str, str]:
        """Unit by label, those of joints that were added to the tree included: m, rad, or 1 for a part of a quaternion."""
        units: dict[str, str] = {}
        for name, joint in {**self.equations.topology.joints, **self.equations.mechanism.joints}.items():
            parts = [freedom for freedom in joint.freedoms for _ in range(4 if freedom == TURN else 1)]
            units |= {label: UNITS.get(part, "rad") for label, part in zip(joint.coordinates(name), parts, strict=True)}
            units |= {label: "rad" for label in joint.rates(name) if label not in units}
        return units

    def unit(self, label: str) -> str:
        """Return the unit of a coordinate or rate (of a rate: per second)."""
        checks.known((label,), tuple(self.units), "coordinate or rate")
        return self.units[label]

    @cached_property
    def angular(self) -> np.ndarray:
        """Which coordinates are angles (m)."""
        return np.array([self.units[label] == "rad" for label in self.equations.mechanism.coordinates], bool)

    @cached_property
    def sizes(self) -> np.ndarray:
        """The mechanism's own units of the coordinates (m): its own length of lengths, 1 of others."""
        lengths = [self.units[label] == "m" for label in self.equations.mechanism.coordinates]
        return np.where(lengths, self.equations.tree.length, 1.0)

    @cached_property
    def quaternions(self) -> list[list[int]]:
        """Places of the quaternions among the coordinates."""
        parts = [i for i, label in enumerate(self.equations.mechanism.coordinates) if self.units[label] == "1"]
        return [parts[k : k + 4] for k in range(0, len(parts), 4)]

    @cached_property
    def jumping(self) -> list[str]:
        """Angles of loop-closing joints that are read by the arc tangent."""
        tree, joints = self.equations.tree, self.equations.mechanism.joints
        cuts = [cut.joint for cut in self.equations.cuts if readings.jump(cut)]
        return [label for name in cuts for label in joints[name].angles(name) if label not in tree.coordinates]

    def unwrapped(self, time: np.ndarray, positions: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return coordinates of all joints over time (K, m) without the jumps that those of loop-closing joints may have.

        Such angles in space jump by 2 pi, quaternions between p and -p. The rates (K, all joints' rates) [rad/s] tell how
        far an angle has turned from one sample to the next; where they change so much that they do not, nothing is counted.
        """
        mechanism, positions = self.equations.mechanism, positions.copy()
        for label in self.jumping:
            q, w = positions[:, mechanism.coordinates.index(label)], rates[:, mechanism.rates.index(label)]
            h = np.diff(time)
            turns = np.round((h * (w[1:] + w[:-1]) / 2 - np.diff(q)) / (2 * np.pi))
            q[1:] += 2 * np.pi * np.cumsum(np.where(h * np.abs(np.diff(w)) / 2 < np.pi, turns, 0))
        for places in self.quaternions:
            p = positions[:, places]
            flips = np.sign(np.einsum("ki,ki->k", p[1:], p[:-1]))
            positions[1:, places] *= np.cumprod(np.where(flips == 0, 1, flips))[:, None]
        return positions

    @property
    def may_jump(self) -> bool:
        """Whether any coordinate may jump over time."""
        return bool(self.jumping or self.quaternions)

    def unwrap_runs(self, time: np.ndarray, positions: np.ndarray, rates: np.ndarray) -> None:
        """Rid coordinates (N, K, m) of N runs of their jumps, each run's as `unwrapped`; nan is where a run did not get."""
        for own, rate in zip(positions, rates, strict=True) if self.may_jump else ():
            kept = ~np.isnan(rate).any(axis=-1)
            own[kept] = self.unwrapped(time[kept], own[kept], rate[kept])

    def size(self, mechanism: Mechanism, q: np.ndarray, positions: np.ndarray) -> float:
        """Return what rounding in the closure rows grows with: lengths over the mechanism's own, and angles.

        Args:
            mechanism: the description with all numbers.
            q: the tree's coordinates (nq); positions: coordinates of all joints (m), at the reference.
        """
        tree = self.equations.tree
        frames = [frame for joint in mechanism.pairs.values() for frame in joint.frames]
        lengths = [abs(x) for frame in frames for x in frame.position]
        lengths += [
            abs(x) for x, label in zip(positions, mechanism.coordinates, strict=True) if self.unit(label) == "m"
        ]
        return max(1.0, max(lengths) / tree.length) * max(1.0, float(np.abs(q / tree.units).max()))
