"""How bearings rub: the part m of what they carry, for the rate u at which their surfaces slide.

    u = r w of a journal of radius r, w of a slide, r w of teeth at a coordinate of the ratio r
    m = m(|u|) u / sqrt(u^2 + rate^2)         or of a bristle, in runs,  s + damping z'

What they carry follows from the accelerations: `bearings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from linkwork.equations.algebra import SX, Number
from linkwork.equations.contact import bending, coefficient, rubs
from linkwork.equations.joint_map import JointMap
from linkwork.mechanism import GearJoint, GearTeeth, JournalBearing
from linkwork.mechanism.bearing import Bearing, bearing_name, bearings


@dataclass(frozen=True)
class Rubbing:
    """Hold a joint's bearing, or a gear's teeth: joint and rate by name, the row J (1 x nv) of
    that, the lever at which it rubs (the radius of a journal, 1 of a slide, the ratio of a gear),
    and the force of its bristle over what it carries, where a run has it."""

    joint: str
    rate: str
    J: ca.SX
    bearing: Bearing
    radius: Number
    strain: ca.SX | None

    @property
    def teeth(self) -> bool:
        """Whether it is a gear's teeth."""
        return isinstance(self.bearing, GearTeeth)

    def sliding(self, w: ca.SX) -> ca.SX:
        """Return the rate u at which the surfaces slide, for the tree's rates."""
        return self.radius * ca.mtimes(self.J, w)

    def part(self, w: ca.SX) -> ca.SX:
        """Return m, with the sign of the rate that it acts against, for the tree's rates."""
        law, u = self.bearing.friction, self.sliding(w)
        if self.strain is not None and law.bristle:
            return self.strain + law.bristle.damping * self.bending(u)
        return coefficient(law, u**2) * u / ca.sqrt(u**2 + law.rate**2)

    def bending(self, u: ca.SX) -> ca.SX:
        """Return the rate z' at which the bristle bends."""
        return bending(u, self.strain, coefficient(self.bearing.friction, u**2))

    def strain_rate(self, w: ca.SX) -> ca.SX:
        """Return the rate of the bristle's force over what the bearing carries."""
        bristle = self.bearing.friction.bristle
        assert bristle is not None
        return bristle.stiffness * self.bending(self.sliding(w))


def rubbing(joints: JointMap, strains: Mapping[str, ca.SX] | None = None) -> tuple[Rubbing, ...]:
    """Return the bearings that rub; strains: forces of bristles over what bearings carry, by
    `bearing_name`."""
    strains, described = strains or {}, joints.mechanism.joints
    found = []
    for name, bearing in bearings(described).items():
        if rubs(bearing.friction):
            joint = described[name]
            if isinstance(joint, GearJoint) and isinstance(bearing, GearTeeth):
                rate, radius = bearing.at, abs(joint.ratios[bearing.at])
            else:
                (rate,) = joint.rates(name)
                radius = bearing.radius if isinstance(bearing, JournalBearing) else 1.0
            strain = strains.get(bearing_name(name))
            found.append(Rubbing(name, rate, SX(joints.rate_row(rate)), bearing, radius, strain))
    return tuple(found)
