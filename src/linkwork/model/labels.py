"""Labels: what each joint coordinate and rate of a robot is (length, angle, part of a quaternion),
and its unit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.equations import Equations
from linkwork.equations.lengths import slides
from linkwork.mechanism import Mechanism
from linkwork.mechanism.joints import SLIDES, TURN
from linkwork.model import checks
from linkwork.model.charts import CompiledChart

POSES = {
    True: ("x", "y", "angle"),
    False: ("x", "y", "z", "rx", "ry", "rz"),
}  # of a tool, by planar
POSE_ANGLES = ("angle", "rx", "ry", "rz")
UNITS = {slide: "m" for slide in SLIDES} | {TURN: "1"}


@dataclass(frozen=True, eq=False)
class Labels:
    """Tell the unit of every coordinate and rate of a mechanism's joints."""

    chart: CompiledChart

    @property
    def equations(self) -> Equations:
        return self.chart.equations

    @cached_property
    def units(self) -> dict[str, str]:
        """Unit by label, those of joints that were added to the tree and of transmissions included:
        m, rad, or 1 for a part of a quaternion."""
        units: dict[str, str] = {}
        for name, joint in {
            **self.equations.topology.joints,
            **self.equations.mechanism.joints,
        }.items():
            parts = [
                freedom for freedom in joint.freedoms for _ in range(4 if freedom == TURN else 1)
            ]
            units |= {
                label: UNITS.get(part, "rad")
                for label, part in zip(joint.coordinates(name), parts, strict=True)
            }
            units |= {label: "rad" for label in joint.rates(name) if label not in units}
        slide = slides(self.equations.mechanism)
        return units | {
            name: "m" if slide[name] else "rad" for name in self.equations.mechanism.transmissions
        }

    def unit(self, label: str) -> str:
        """Return the unit of a coordinate or rate (of a rate: per second)."""
        checks.known((label,), tuple(self.units), "coordinate or rate")
        return self.units[label]

    @cached_property
    def angular(self) -> np.ndarray:
        """Which coordinates are angles (m)."""
        return np.array(
            [self.units[label] == "rad" for label in self.equations.mechanism.coordinates], bool
        )

    @cached_property
    def turning(self) -> np.ndarray:
        """Which rates are angular."""
        return np.array(
            [self.units[label] == "rad" for label in self.equations.mechanism.rates], bool
        )

    @cached_property
    def sizes(self) -> np.ndarray:
        """The mechanism's own units of the coordinates (m): its own length of lengths, 1 of
        others."""
        lengths = [self.units[label] == "m" for label in self.equations.mechanism.coordinates]
        return np.where(lengths, self.equations.tree.length, 1.0)

    @cached_property
    def all_quaternions(self) -> dict[str, list[int]]:
        """Places among the coordinates of the quaternions of all joints that turn freely, by
        joint."""
        mechanism = self.equations.mechanism
        places = {label: i for i, label in enumerate(mechanism.coordinates)}
        free = {name: joint for name, joint in mechanism.joints.items() if TURN in joint.freedoms}
        return {
            name: [places[x] for x in joint.coordinates(name)[-4:]] for name, joint in free.items()
        }

    @cached_property
    def of_tree(self) -> np.ndarray:
        """Places among the coordinates of those of the tree (nq), where no joints were added to
        it."""
        return np.array(
            [self.equations.mechanism.coordinates.index(x) for x in self.equations.tree.coordinates]
        )

    def size(self, mechanism: Mechanism, q: np.ndarray, positions: np.ndarray) -> float:
        """Return what rounding in the closure rows grows with: lengths over the mechanism's own,
        and angles.

        Args:
            mechanism: the description with all numbers.
            q: the tree's coordinates (nq); positions: coordinates of all joints (m), at the
                reference.
        """
        if not self.equations.rows.Phi.size1():
            return 1.0  # quaternions alone are held to their lengths
        tree, units = self.equations.tree, self.units
        frames = [frame for joint in mechanism.pairs.values() for frame in joint.frames]
        lengths = [abs(x) for frame in frames for x in frame.position]
        places = zip(mechanism.coordinates, positions, strict=True)
        lengths += [abs(x) for label, x in places if units[label] == "m"]
        turned = [units[label] != "m" for label in tree.coordinates]
        return max(1.0, max(lengths) / tree.length) * float(np.abs(q[turned]).max(initial=1.0))
