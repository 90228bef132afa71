"""Gears: rows that couple joint coordinates and lengths,  phi = sum P_i(q_i) - offset.

    P_i(q) = ratio_i q + c_i2 q^2 + c_i3 q^3 + ...
    Phi = sum P_i'(q_i) J_i,  J_i the row that gives coordinate i's rate
    gamma = (d/dt Phi) w  at w' = 0

A coordinate of the tree is its own; that of a cut joint is read off the poses, the length of a
cable off its way (`joint_map`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from linkwork.equations.algebra import SX
from linkwork.equations.joint_map import JointMap
from linkwork.equations.lengths import slides
from linkwork.equations.transmissions import Along
from linkwork.mechanism import GROUND, Combination, GearJoint, Mechanism, Thrust


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


def pushing(gear: GearJoint, joints: JointMap) -> Along:
    """Return what a unit multiplier of a gear does: P_i'(q_i) on each coordinate's rate, and as
    much along each length."""
    phi, ratios, wrenches = SX(-gear.offset), dict[str, Any](), list[tuple[str, ca.SX, ca.SX]]()
    for label in gear.ratios:
        value, slope = polynomial(gear.polynomial(label), joints.position(label))
        phi += value
        is_line = label in joints.mechanism.transmissions
        line = joints.along(label) if is_line else Along(value, {label: 1.0})
        for rate, ratio in line.ratios.items():
            ratios[rate] = ratios.get(rate, 0.0) + slope * ratio
        wrenches += [(body, arm, slope * wrench) for body, arm, wrench in line.wrenches]
    return Along(phi, ratios, tuple(wrenches))


def pushed(gear: GearJoint, mechanism: Mechanism) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the rates and the bodies that a gear pushes, by name, each once."""
    rates, bodies = list[str](), list[str]()
    for label in gear.ratios:
        line = mechanism.transmissions.get(label)
        if line is None:
            rates.append(label)
        elif isinstance(line, Combination):
            rates += line.ratios
        elif not isinstance(line, Thrust):  # that has no length
            bodies += [body for body in line.bodies if body != GROUND]
    return tuple(dict.fromkeys(rates)), tuple(dict.fromkeys(bodies))


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
