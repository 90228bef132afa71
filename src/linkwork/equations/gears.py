"""Gears: rows that couple joint coordinates linearly,  phi = sum ratio_i q_i - offset.

    Phi = sum ratio_i J_i,  J_i the row that gives coordinate i's rate
    gamma = (d/dt Phi) w  at w' = 0

A coordinate of the tree is its own; that of a cut joint is read off the poses (`joint_map`).
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations.algebra import SX
from linkwork.equations.joint_map import JointMap
from linkwork.equations.lengths import slides
from linkwork.mechanism import GearJoint, Mechanism


def row(gear: GearJoint, joints: JointMap) -> tuple[ca.SX, ca.SX]:
    """Return phi (1) and Phi (1 x nv) of a gear."""
    phi, Phi = SX(-gear.offset), SX.zeros(1, len(joints.tree.rates))
    for label, ratio in gear.ratios.items():
        phi += ratio * joints.position(label)
        Phi += ratio * joints.rate_row(label)
    return phi, Phi


def units(mechanism: Mechanism, length: float) -> dict[str, float]:
    """Return the unit of each gear's phi, the largest of its terms': slides count in the
    mechanism's own length."""
    slide = slides(mechanism)
    return {
        name: max(
            abs(ratio) * (length if slide[label] else 1.0) for label, ratio in gear.ratios.items()
        )
        for name, gear in mechanism.gears.items()
    }
