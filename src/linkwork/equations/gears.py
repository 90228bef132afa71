"""Gears: rows that couple joint coordinates and lengths,  phi = sum P_i(q_i) - offset.

    P_i(q) = ratio_i q + c_i2 q^2 + c_i3 q^3 + ...
    Phi = sum P_i'(q_i) J_i,  J_i the row that gives coordinate i's rate
    gamma = (d/dt Phi) w  at w' = 0

A coordinate of the tree is its own; that of a cut joint is read off the poses, the length of a
cable off its way (`joint_map`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any

import casadi as ca

from linkwork.equations.algebra import SX
from linkwork.equations.joint_map import JointMap
from linkwork.equations.lengths import slides
from linkwork.mechanism import GearJoint, Mechanism, MechanismError


def row(gear: GearJoint, joints: JointMap) -> tuple[ca.SX, ca.SX]:
    """Return phi (1) and Phi (1 x nv) of a gear."""
    phi, Phi = SX(-gear.offset), SX.zeros(1, len(joints.tree.rates))
    for label in gear.ratios:
        value, slope = polynomial(gear.polynomial(label), joints.position(label))
        phi += value
        Phi += slope * joints.rate_row(label)
    return phi, Phi


def polynomial(coefficients: Sequence[Any], q: Any) -> tuple[Any, Any]:
    """Return c_1 q + c_2 q^2 + ... and its derivative, by Horner's rule; q: a number, a symbol or
    an array."""
    value, slope = coefficients[-1], 0.0
    for c in coefficients[-2::-1]:
        slope = slope * q + value
        value = value * q + c
    return value * q, slope * q + value


def slopes(
    gear: GearJoint, position: Callable[[str], Any], coordinates: Collection[str]
) -> dict[str, Any]:
    """Return P_i'(q_i), the factor of each coordinate's rate in a gear, by name; refuse lengths,
    whose forces act on bodies."""
    if lines := [label for label in gear.ratios if label not in coordinates]:
        raise MechanismError(
            f"a gear holds the length {lines[0]!r}; what it brings to bodies is not told apart, so "
            "that wrenches in joints are not found, nor friction of bearings by them"
        )
    return {
        label: polynomial(gear.polynomial(label), position(label))[1] if gear.powers else ratio
        for label, ratio in gear.ratios.items()
    }


def units(mechanism: Mechanism, length: float) -> dict[str, float]:
    """Return the unit of each gear's phi, the largest of its terms': slides count in the
    mechanism's own length."""
    slide = slides(mechanism)
    return {
        name: max(
            abs(c) * (length**power if slide[label] else 1.0)
            for label in gear.ratios
            for power, c in enumerate(gear.polynomial(label), start=1)
        )
        for name, gear in mechanism.gears.items()
    }
