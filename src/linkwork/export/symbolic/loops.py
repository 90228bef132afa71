"""The loop equations phi(q) = 0 of the paper's Eq. (1), in closed form.

In the plane both ways to a point of a body that a joint closes a loop at give the same place and
the same angle, and the joint's own coordinate is one of q:

    phi = [x* - x; y* - y; angle* - angle]

The point is the joint's, or the mass centre of a body of three joints and more, a platform. In
space a joint that closes a loop has no coordinate of its own; its rows are those of its type
(`linkwork.equations.joints`), of which the dependent ones are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from linkwork.equations import Equations
from linkwork.equations.closure import Cut
from linkwork.equations.joints import complete, pattern
from linkwork.errors import LinkworkError
from linkwork.export.symbolic.chain import Chain, SymbolicFrame
from linkwork.export.symbolic.dimensions import MASS_CENTRE, BodyPoint
from linkwork.export.symbolic.exact import exact_angle, exact_vector
from linkwork.export.symbolic.trig import (
    Trig,
    Vector,
    applied,
    dot,
    plus,
    rational,
    symbol,
    times,
    transposed,
)
from linkwork.mechanism import GROUND, PairJoint

PLATFORM = 3  # joints of a body that is compared at its mass centre


@dataclass(frozen=True)
class LoopRow:
    """Hold a loop equation: what it is of, and phi."""

    name: str
    phi: Trig


def walked(joint: PairJoint) -> bool:
    """Tell whether a joint of a planar mechanism has its motions in the plane, each with a
    coordinate."""
    return complete(joint) and pattern(joint) in ((), ("turn",), ("slide",))


def own_coordinates(equations: Equations, flat: bool) -> list[str]:
    """Return the coordinates in which the equations are written, in the order of the joints."""
    topology = equations.topology
    closing = topology.closing if flat else {}
    found = dict(topology.joints) | {
        name: joint for name, joint in closing.items() if walked(joint)
    }
    order = [name for name in equations.mechanism.pairs if name in found]
    return [label for name in order for label in found[name].coordinates(name)]


def loop_rows(chain: Chain, equations: Equations, home: Mapping[str, float]) -> list[LoopRow]:
    """Return the loop equations; home: coordinates that close them, by which whole turns are
    taken off."""
    rows: list[LoopRow] = []
    kept = {equations.rows.names[index] for index in equations.chart.rows}
    for cut in equations.cuts:
        joint = equations.topology.closing[cut.joint]
        if chain.flat and walked(joint):
            rows += planar_rows(chain, cut.joint, joint, home)
        else:
            rows += [row for row in spatial_rows(chain, cut, joint) if row.name in kept]
    for name, gear in chain.mechanism.gears.items():
        number = chain.dimensions.number
        known = own_coordinates(equations, chain.flat)
        if missing := [label for label in gear.ratios if label not in known]:
            raise LinkworkError(
                f"the gear {name!r} couples {missing[0]!r}, which closes a loop or is a length and "
                "has no coordinate of its own here; its equations are not printed"
            )
        offset = number(("joints", name, "offset"), gear.offset)
        phi = -offset
        for label, ratio in gear.ratios.items():
            q = power = symbol(f"q:{label}")
            phi += power * number(("joints", name, "ratios", label), ratio)
            for place, c in enumerate(gear.powers.get(label, ())):
                power = power * q
                phi += power * number(("joints", name, "powers", label, str(place)), c)
        rows.append(LoopRow(f"{name}: ratio", phi))
    return [LoopRow(row.name, upright(row.phi)) for row in rows]


def upright(phi: Trig) -> Trig:
    """Return phi or -phi, that of fewer negative terms."""
    negative = sum(c < 0 for c in phi.terms.values())
    return -phi if 2 * negative > len(phi.terms) else phi


def planar_rows(
    chain: Chain, name: str, joint: PairJoint, home: Mapping[str, float]
) -> list[LoopRow]:
    """Return the rows of a joint that closes a loop in the plane."""
    # From the body without many joints across the joint to the other; there to one point by both.
    counts = {body: len(chain.dimensions.joints_of(body)) for body in joint.connects}
    first, second = joint.connects
    backwards = counts[first] >= PLATFORM > counts[second] and first != GROUND
    near, far = (1, 0) if backwards else (0, 1)
    start, end = joint.connects[near], joint.connects[far]
    by_leg = chain.to(start, chain.bodies[start], BodyPoint(name, near))
    by_leg = chain.across(by_leg, name, joint, far)
    platform = end != GROUND and counts[end] >= PLATFORM
    target = MASS_CENTRE if platform else BodyPoint(name, far)
    by_leg = chain.to(end, (by_leg, BodyPoint(name, far)), target)
    by_tree = chain.to(end, chain.bodies[end], target)
    gap = plus(by_tree.p, times(by_leg.p, rational(-1)))
    return [
        LoopRow(f"{name}: x", gap[0]),
        LoopRow(f"{name}: y", gap[1]),
        LoopRow(f"{name}: angle", angle_between(by_tree, by_leg, home)),
    ]


def angle_between(one: SymbolicFrame, two: SymbolicFrame, home: Mapping[str, float]) -> Trig:
    """Return the difference of the angles of two frames in the plane, zero at home."""
    signs = dict(one.angle[0])
    for label, sign in two.angle[0].items():
        signs[label] = signs.get(label, 0) - sign
    turn = one.waiting @ two.waiting.T
    constant = one.angle[1] - two.angle[1] + float(np.arctan2(turn[1, 0], turn[0, 0]))
    near = (constant + np.pi) % (2 * np.pi) - np.pi
    phi = exact_angle(near)
    for label, sign in signs.items():
        phi += symbol(f"q:{label}") * sign
    at_home = sum(sign * home[label] for label, sign in signs.items()) + near
    return phi - symbol("pi") * (2 * round(at_home / (2 * np.pi)))


def spatial_rows(chain: Chain, cut: Cut, joint: PairJoint) -> list[LoopRow]:
    """Return the rows of a joint that closes a loop in space, those of its type."""
    sides = [
        chain.to(body, chain.bodies[body], BodyPoint(cut.joint, side))
        for side, body in enumerate(joint.connects)
    ]
    this, that = sides[::-1] if cut.swapped else sides
    gap = plus(that.p, times(this.p, rational(-1)))
    rows = []
    for row in cut.rows:
        if row.length is not None:
            length = chain.dimensions.rod(cut.joint)
            phi = (dot(gap, gap) - length * length) * Fraction(1, 2)
        elif row.pitch is not None:
            raise LinkworkError(
                f"joint {cut.joint!r}, a screw, closes a loop, whose equation is not algebraic; "
                "its equations are not printed"
            )
        elif row.f is not None:
            phi = dot(direction(this, row.e), seen_in(this, that, row.f))
        else:
            phi = dot(direction(this, row.e), applied(transposed(this.R), gap))
        rows.append(LoopRow(f"{cut.joint}: {row.name}", phi))
    return rows


def direction(frame: SymbolicFrame, e: np.ndarray) -> Vector:
    """Return a direction of a frame in the axes of its R."""
    return exact_vector(frame.waiting @ e)


def seen_in(this: SymbolicFrame, that: SymbolicFrame, f: np.ndarray) -> Vector:
    """Return a direction of one frame in the axes of another one's R."""
    return applied(transposed(this.R), applied(that.R, exact_vector(that.waiting @ f)))
