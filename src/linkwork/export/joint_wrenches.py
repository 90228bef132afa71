"""The wrenches in all joints as a CasADi function: one sparse system of linear equations.

Unknown are the wrench W_k = [moment about the origin of F2; force] of every joint, that of a rod a
tension along it, and the multiplier mu of every gear. With the loads of `equations.reactions`,

    sum of the wrenches on a body + B mu = what it needs              (6 for each body)
    S' W = f + G' mu along every joint rate but the independent ones

where B is what gears pull with at bodies whose lengths they hold. The motions that joints and gears
allow are the left null space of these equations, and the rates of a chart determine them: without
those along the independent rates the equations are independent wherever the chart is good. A body
that the tree hangs in the ground without a joint has rates that are no joint's: along these stands
its own balance, about the origin of its frame.

Where constraints depend on each other, of all solutions the one with the least constraint wrenches
W - P (f + G' mu), moments over a length, and multipliers is taken, as by `Robot.reactions`:

    x, nu:    M' M x + C' nu = M' k,    C x = d
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import Equations, bearings, gears
from linkwork.equations.algebra import SX
from linkwork.equations.joints import held_length
from linkwork.equations.reactions import joint_loads
from linkwork.equations.tree import offset
from linkwork.mechanism import GROUND, FreeJoint, Mechanism
from linkwork.model.reactions import spread
from linkwork.robot import Robot

MOMENT = ca.DM([1, 1, 1, 0, 0, 0])


class ScaledLoads(NamedTuple):
    """Hold what bodies need (6r), and what gears bring to them by unit multipliers (6r x gears),
    about points of theirs (3r), origins of F1 and F2 (6J), a twist of each rate (6m), forces on the
    rates (m), and those of gears (gears x m), with lengths over one length; forces on turns are
    divided by it, too.

    The points are mass centres, and the origins of bodies that float by no joint (`floating`).
    """

    needed: ca.SX
    pulls: ca.SX
    points: ca.SX
    origins: ca.SX
    twists: ca.SX
    f: ca.SX
    G: ca.SX


def reactions(robot: Robot, equations: Equations) -> ca.Function:
    """Return (q, v, u) -> the wrenches [moment; force] (6 x joints) that joints exert on their
    second bodies, about the origins of F1 in the ground's axes, and the weakest relative pivot."""
    q, v, p, u = equations.tree.q, equations.v, equations.p, SX.sym("u", len(robot.actuators))
    # The loads in the motion that the forces give.
    dv = bearings.accelerations(equations, ca.mtimes(equations.actuation.T, u), u)
    still = SX.zeros(6 * len(robot.bodies))
    *loads, pivot = joint_loads(equations)(q, v, dv, u, SX(0, 1), still, p)
    joints, origins = len(equations.mechanism.pairs), loads[2]
    length = spread(robot)
    scaled = scaled_loads(equations, loads, length)
    # The system, and its unknowns as wrenches about the origins of F1.
    E, K, right = system(equations, scaled, equations.independent)
    unit = units(length)
    inputs, names = [q, v, u, p], ["q", "v", "u", "p"]
    parts = ca.Function(
        "balance",
        inputs,
        [K, right, about_first(origins, joints) @ ca.diagcat(*[ca.diag(unit)] * joints) @ E, pivot],
        {"cse": True},
    )
    used = 4 if p.numel() else 3
    given = [ca.MX.sym(name, each.numel()) for name, each in zip(names, inputs, strict=True)]
    given[used:] = []
    K, right, shown, pivot = parts(*given, *[ca.MX(0, 1)] * (4 - used))
    x = ca.solve(K, right, "qr")
    wrenches = ca.reshape(shown @ x[: shown.shape[1]], 6, joints)
    outputs = [ca.densify(wrenches), pivot]
    return ca.Function("reactions", given, outputs, names[:used], ["wrenches", "pivot"])


def units(length: float) -> ca.DM:
    """Return what the parts of a wrench are multiplied with where lengths are over one length."""
    return ca.DM([length] * 3 + [1] * 3)


def scaled_loads(equations: Equations, loads: Sequence[ca.SX], length: float) -> ScaledLoads:
    """Return loads of `equations.reactions` with lengths over one length."""
    needed, centres, origins, twists, f, slopes, pulls = loads
    # Bodies that float by no joint are balanced about their origins.
    mechanism = equations.mechanism
    bodies, points = list(mechanism.bodies), [*ca.vertsplit(centres, 3)]
    needs = [*ca.vertsplit(ca.horzcat(needed, *pulling(mechanism, pulls)), 6)]
    for body in floating(equations):
        b, node = bodies.index(body), equations.tree.node(body)
        origin = node.O + offset(node, np.zeros(3))
        needs[b] = shift(points[b] - origin) @ needs[b]
        points[b] = origin
    # The scale.
    unit = units(length)
    along = ca.vertsplit(twists, 6) if f.numel() else []
    sizes = ca.DM([length if turns(twist) else 1.0 for twist in along])
    needs = ca.vertcat(*[each / ca.repmat(unit, 1, each.shape[1]) for each in needs])
    G, places = SX(len(mechanism.gears), len(along)), iter(range(slopes.numel()))
    for row, gear in enumerate(mechanism.gears.values()):
        for rate in gears.pushed(gear, mechanism)[0]:
            k = mechanism.rates.index(rate)
            G[row, k] = slopes[next(places)] / sizes[k]
    return ScaledLoads(
        needs[:, 0],
        needs[:, 1:],
        ca.vertcat(*points) / length,
        origins / length,
        twists * ca.repmat(unit, len(along), 1) / ca.kron(sizes, ca.DM.ones(6, 1)),
        f / sizes,
        G,
    )


def pulling(mechanism: Mechanism, pulls: ca.SX) -> list[ca.SX]:
    """Return what unit multipliers of gears are on all bodies (6r), gear by gear."""
    bodies, parts = list(mechanism.bodies), iter(ca.vertsplit(pulls, 6) if pulls.numel() else [])
    found = []
    for gear in mechanism.gears.values():
        found.append(SX(6 * len(bodies), 1))
        for body in gears.pushed(gear, mechanism)[1]:
            b = bodies.index(body)
            found[-1][6 * b : 6 * b + 6] = next(parts)
    return found


def floating(equations: Equations) -> dict[str, str]:
    """Return the bodies that the tree hangs in the ground by no joint of the mechanism, and what
    the tree calls what it hangs them by."""
    pairs, tree = equations.mechanism.pairs, equations.tree
    named = {body: tree.node(body).joint for body in equations.mechanism.bodies}
    return {body: name for body, name in named.items() if name not in pairs}


def rates_of_rows(equations: Equations) -> list[str]:
    """Return the rates that the equations stand along: those of the bodies' balances, "" where they
    stand along none, and those of the joints."""
    found, floats = [], floating(equations)
    for body in equations.mechanism.bodies:
        held = FreeJoint(connects=(GROUND, body)).rates(floats.get(body, ""))
        found += [*held[3:], *held[:3]] if body in floats else [""] * 6
    return [*found, *equations.mechanism.rates]


def system(
    equations: Equations, loads: ScaledLoads, without: Collection[str]
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return E (6J x unknowns) of the joints' wrenches E y, about the origins of F2, and the matrix
    and the right side of the equations in (y, mu, nu), but for those along some rates."""
    mechanism = equations.mechanism
    pairs, G = mechanism.pairs, loads.G
    origins = ca.vertsplit(loads.origins, 3) if pairs else []
    # What a joint can transmit, and what its rates take: a rod has a tension only.
    E = ca.diagcat(
        SX(0, 0),
        *(
            tension(origins[2 * k], origins[2 * k + 1])
            if held_length(joint) is not None
            else SX.eye(6)
            for k, joint in enumerate(pairs.values())
        ),
    )
    S, P = along_rates(equations, loads.twists)
    # The balance of bodies and along the joints' rates, but for those along independent rates.
    left = [k for k, label in enumerate(rates_of_rows(equations)) if label not in without]
    C = ca.vertcat(
        ca.horzcat(on_bodies(equations, loads.points, origins) @ E, loads.pulls),
        ca.horzcat(S @ E, -G.T),
    )[left, :]
    d = ca.vertcat(loads.needed, loads.f)[left, :]
    # Least constraint wrenches and multipliers.
    M = ca.vertcat(
        ca.horzcat(E, -P @ G.T), ca.horzcat(SX(G.shape[0], E.shape[1]), SX.eye(G.shape[0]))
    )
    known = ca.vertcat(P @ loads.f, SX(G.shape[0], 1))
    K = ca.vertcat(ca.horzcat(M.T @ M, C.T), ca.horzcat(C, SX(C.shape[0], C.shape[0])))
    return E, ca.sparsify(K), ca.densify(ca.vertcat(M.T @ known, d))


def tension(first: ca.SX, second: ca.SX) -> ca.SX:
    """Return the unit wrench (6) of a rod from one origin to the other."""
    return ca.vertcat(SX(3, 1), (second - first) / ca.norm_2(second - first))


def along_rates(equations: Equations, twists: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return S' (m x 6J), the twists of all joint rates, and P (6J x m), the moment about the axis
    of a turn, or the force along a slide, that does unit work on each."""
    found, place = ca.vertsplit(twists, 6) if twists.numel() else [], 0
    S, P = SX(0, 0), SX(0, 0)
    for name, joint in equations.mechanism.pairs.items():
        own = found[place : place + len(joint.rates(name))]
        place += len(own)
        acting = [twist * MOMENT if turns(twist) else twist for twist in own]
        S = ca.diagcat(S, ca.vertcat(SX(0, 6), *[twist.T for twist in own]))
        P = ca.diagcat(P, ca.horzcat(SX(6, 0), *[each / ca.sumsqr(each) for each in acting]))
    return S, P


def turns(twist: ca.SX) -> bool:
    """Tell whether a twist turns at all."""
    return any(not twist[k].is_zero() for k in range(3))


def on_bodies(equations: Equations, points: ca.SX, origins: list[ca.SX]) -> ca.SX:
    """Return what wrenches about the origins of F2 (6J) are on the bodies, about points of theirs
    (6r x 6J)."""
    bodies, pairs = list(equations.mechanism.bodies), equations.mechanism.pairs
    A = SX(6 * len(bodies), 6 * len(pairs))
    for k, joint in enumerate(pairs.values()):
        for body, sign in zip(joint.connects, (-1, 1), strict=True):
            if body != GROUND:
                b = bodies.index(body)
                arm = origins[2 * k + 1] - points[3 * b : 3 * b + 3]
                A[6 * b : 6 * b + 6, 6 * k : 6 * k + 6] = sign * shift(arm)
    return A


def about_first(origins: ca.SX, joints: int) -> ca.SX:
    """Return what wrenches about the origins of F2 (6J) are about those of F1."""
    ends = ca.vertsplit(origins, 3) if joints else []
    return ca.diagcat(SX(0, 0), *(shift(ends[2 * k + 1] - ends[2 * k]) for k in range(joints)))


def shift(arm: ca.SX) -> ca.SX:
    """Return what a wrench at the end of an arm is at its beginning: moment + arm x force."""
    return ca.vertcat(ca.horzcat(SX.eye(3), ca.skew(arm)), ca.horzcat(SX(3, 3), SX.eye(3)))
