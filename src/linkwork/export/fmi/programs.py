"""What an FMU computes beside the functions of exported C: motions in the rates of the whole tree,
what it tells, and the directional derivatives of both.

An FMU's continuous states are the coordinates q and the rates w of all joints of the spanning tree.
Of these the independent ones of a chart count: the others follow from them by closing the loops,
and are integrated beside them as where that starts from,

    q_c = closed(q),    w_c = L(q_c) w_a,    q' = N w_c,    w' = L v' + b.

A change of a chart changes none of this but for what the integration has let come apart. Seeds are
named by s and the tangents that follow from them by t: tx = dx/dx_0 sx_0, exact, by CasADi's
forward derivatives of the same expressions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from linkwork.equations import body_motion, uncharted
from linkwork.equations.algebra import SX
from linkwork.equations.elimination import solve
from linkwork.equations.equations import Equations, conditions
from linkwork.equations.functions import function
from linkwork.equations.joint_map import derivative
from linkwork.equations.tree import Tree
from linkwork.export import expressions
from linkwork.export.calls import PartProgram
from linkwork.export.fmi.driven import Driven
from linkwork.robot import Robot


@dataclass(frozen=True)
class Seeds:
    """Hold symbols of seeds of q, w, u and p."""

    q: ca.SX
    w: ca.SX
    u: ca.SX
    p: ca.SX

    @classmethod
    def of(cls, equations: Equations, inputs: int = 0) -> Seeds:
        """Return seeds of all that an FMU is given; inputs: size of u, where it counts."""
        tree = equations.tree
        return cls(
            SX.sym("sq", tree.q.numel()),
            SX.sym("sw", len(tree.rates)),
            SX.sym("su", inputs),
            SX.sym("sp", equations.p.numel()),
        )


def along(found: ca.SX, pairs: Sequence[tuple[ca.SX, ca.SX]]) -> ca.SX:
    """Return the derivative of an expression along seeds; pairs: symbols and their seeds."""
    symbols, seeds = (ca.vertcat(SX(0, 1), *part) for part in zip(*pairs, strict=True))
    return ca.densify(ca.jtimes(ca.densify(found), symbols, seeds))


def rates_of(tree: Tree, sq: ca.SX) -> ca.SX:
    """Return the rates w with N w = sq, but for what changes the length of quaternions: N' sq, of
    quaternions, whose map is half an orthogonal one, 4 N' sq."""
    found = ca.mtimes(tree.derivative_map.T, sq)
    for _, ks in tree.quaternions:
        found[list(ks)] *= 4
    return ca.densify(found)


def motion(driven: Driven) -> ca.Function:
    """Return (q, v, u) -> q', v', z', pivot in the robot's own chart; z' where drives have
    states."""
    equations, u = driven.robot.equations, driven.symbol()
    forces, dz = driven.acting(equations, u)
    outputs = {
        "dq": equations.tree.derivatives(equations.rates),
        "dv": equations.accelerations(ca.mtimes(equations.actuation.T, forces)),
        **({"dz": dz} if driven.states else {}),
        "pivot": equations.elimination.pivot,
    }
    return function("motion", equations, outputs, v=equations.v, u=u)


def free_forces(driven: Driven) -> ca.Function:
    """Return what `expressions.free_forces` gives of (q, w, u), and z' where drives
    have states."""
    free, u = uncharted.uncharted(driven.robot.equations), driven.symbol()
    forces, dz = driven.acting(free, u)
    outputs = uncharted.balance(free, ca.mtimes(free.actuation.T, forces))
    outputs |= {"dz": dz} if driven.states else {}
    return function("free_forces", free, outputs, v=free.v, u=u)


def own_motion(driven: Driven) -> ca.Function:
    """Return (q, v, u) -> q', w, w', z', pivot in the robot's own chart; z' where drives have
    states."""
    equations, u = driven.robot.equations, driven.symbol()
    outputs = whole_motion(driven, u) | {"pivot": equations.elimination.pivot}
    return function("own_motion", equations, outputs, v=equations.v, u=u)


def whole_motion(driven: Driven, u: ca.SX) -> dict[str, ca.SX]:
    """Return q', w and w' of closed loops, and z' where drives have states."""
    equations = driven.robot.equations
    L, b, _ = equations.elimination
    forces, dz = driven.acting(equations, u)
    dv = equations.accelerations(ca.mtimes(equations.actuation.T, forces))
    found = {
        "dq": equations.tree.derivatives(equations.rates),
        "w": equations.rates,
        "dw": ca.mtimes(L, dv) + b,
    }
    return found | ({"dz": dz} if driven.states else {})


def own_tangent(driven: Driven) -> ca.Function:
    """Return (q, v, u, sq, sw, su, sp) -> tq, tq', tw, tw' of closed loops, in the own chart, and
    tz' where drives have states.

    The loops close with the independent coordinates:  Phi t + phi_p sp = 0,  tq = N t.
    """
    equations, u = driven.robot.equations, driven.symbol()
    tree, seeds = equations.tree, Seeds.of(equations, u.numel())
    independent = list(equations.chart.independent)
    opened = along(equations.rows.phi, [(equations.p, seeds.p)])
    step, _ = solve(equations.chart, equations.rows.Phi, -opened)
    still = SX.zeros(equations.mobility, 1)
    t = ca.mtimes(equations.elimination.L, rates_of(tree, seeds.q)[independent])
    tq = tree.derivatives(t + equations.scatter(step, still))
    pairs = [
        (tree.q, tq),
        (equations.v, seeds.w[independent]),
        (u, seeds.u),
        (equations.p, seeds.p),
    ]
    found = whole_motion(driven, u)
    outputs = {"tq": tq} | {f"t{name}": along(each, pairs) for name, each in found.items()}
    own = {"v": equations.v, "u": u}
    return function("own_tangent", equations, outputs, **own, **with_names(seeds))


def with_names(seeds: Seeds) -> dict[str, ca.SX]:
    """Return seeds as inputs of a function."""
    return {"sq": seeds.q, "sw": seeds.w, "su": seeds.u, "sp": seeds.p}


def free_opened(robot: Robot) -> ca.Function:
    """Return (q, sq, sp) -> the rates that belong to sq, and phi_p sp."""
    equations = robot.equations
    seeds = Seeds.of(equations)
    outputs = {
        "t": rates_of(equations.tree, seeds.q),
        "opened": along(equations.rows.phi, [(equations.p, seeds.p)]),
    }
    return function("free_opened", equations, outputs, sq=seeds.q, sp=seeds.p)


def free_turned(robot: Robot) -> ca.Function:
    """Return (q, w, t, sp) -> N t, and the change of Phi w along N t and sp with w as it is."""
    equations, w = robot.equations, robot.equations.rows.rates
    t, sp = SX.sym("t", equations.nv), Seeds.of(equations).p
    tq = equations.tree.derivatives(t)
    pairs = [(equations.tree.q, tq), (equations.p, sp)]
    outputs = {"tq": tq, "turned": along(ca.mtimes(equations.rows.Phi, w), pairs)}
    return function("free_turned", equations, outputs, w=w, t=t, sp=sp)


def free_tangent(driven: Driven) -> ca.Function:
    """Return (q, w, u, w', lambda, tq, tw, su, sp) -> tq', and how  H w' + Phi' lambda - f  and
    Phi w' + gamma  change with w' and lambda as they are, and tz' where drives have states."""
    free, u = uncharted.uncharted(driven.robot.equations), driven.symbol()
    tree, rows, seeds = free.tree, free.rows, Seeds.of(free, u.numel())
    dw, multipliers = SX.sym("dw", free.nv), SX.sym("lambda", len(rows.names))
    forces, dz = driven.acting(free, u)
    told = uncharted.balance(free, ca.mtimes(free.actuation.T, forces))
    unbalanced = ca.mtimes(told["H"], dw) + ca.mtimes(rows.Phi.T, multipliers) - told["forces"]
    turned = ca.mtimes(rows.Phi, dw) + told["gamma"]
    pairs = [(tree.q, seeds.q), (free.v, seeds.w), (u, seeds.u), (free.p, seeds.p)]
    outputs = {
        "tdq": along(told["derivatives"], pairs),
        "unbalanced": along(unbalanced, pairs),
        "turned": along(turned, pairs),
    } | ({"tdz": along(dz, pairs)} if driven.states else {})
    given = {"w": free.v, "u": u, "dw": dw, "lambda": multipliers}
    return function("free_tangent", free, outputs, **given, **with_names(seeds))


def telling(robot: Robot, kinds: Sequence[str]) -> ca.Function:
    """Return (q, w, w') -> what an FMU tells, kind after kind (`variables.KINDS`)."""
    free, dw = free_motion(robot)
    found = {"told": told(robot, free, dw, kinds)}
    return function("telling", free, found, w=free.v, dw=dw)


def telling_tangent(robot: Robot, kinds: Sequence[str]) -> ca.Function:
    """Return (q, w, w', tq, tw, tw', sp) -> the change of what an FMU tells."""
    free, dw = free_motion(robot)
    seeds, tdw = Seeds.of(free), SX.sym("tdw", free.nv)
    pairs = [(free.tree.q, seeds.q), (free.v, seeds.w), (dw, tdw), (free.p, seeds.p)]
    found = {"ttold": along(told(robot, free, dw, kinds), pairs)}
    given = {"w": free.v, "dw": dw, "tq": seeds.q, "tw": seeds.w, "tdw": tdw, "sp": seeds.p}
    return function("telling_tangent", free, found, **given)


def free_motion(robot: Robot) -> tuple[Equations, ca.SX]:
    """Return equations in which all rates of the tree are independent, and symbols of w'."""
    return uncharted.uncharted(robot.equations), SX.sym("dw", robot.equations.nv)


def told(robot: Robot, free: Equations, dw: ca.SX, kinds: Sequence[str]) -> ca.SX:
    """Return what an FMU tells of q, w and w'."""
    J, w = free.joints.rate_rows(), free.v
    found: dict[str, Callable[[], ca.SX]] = {
        "positions": free.joints.positions,
        "rates": lambda: ca.mtimes(J, w),
        "accelerations": lambda: ca.mtimes(J, dw) + ca.mtimes(derivative(J, free.tree, w), w),
        "tool": lambda: expressions.tool_coordinates(robot),
        "twist": lambda: ca.mtimes(
            body_motion.tool_twist(free.tree, robot.mechanism.first_tool, w)[0], w
        ),
        "apart": lambda: ca.vertcat(SX(0, 1), *free.gaps.values()),
    }
    return ca.vertcat(SX(0, 1), *(found[kind]() for kind in kinds if kind in found))


def gap(robot: Robot) -> ca.Function:
    """Return q -> the largest |phi| in the mechanism's own units."""
    return function("gap", robot.equations, {"gap": conditions(robot.equations)})


def gap_tangent(robot: Robot) -> ca.Function:
    """Return (q, sq, sp) -> the change of the largest |phi|."""
    equations = robot.equations
    seeds = Seeds.of(equations)
    pairs = [(equations.tree.q, seeds.q), (equations.p, seeds.p)]
    outputs = {"tgap": along(conditions(equations), pairs)}
    return function("gap_tangent", equations, outputs, sq=seeds.q, sp=seeds.p)


def stepping_programs(driven: Driven) -> Mapping[str, PartProgram]:
    """Return the programs of motions in which drives act, in place of those of exported C."""
    if not driven.drives:
        return {}
    dz = ("dz",) * bool(driven.states)
    found = {
        "motion": PartProgram(
            lambda _: motion(driven), ("q", "v", "u"), ("dq", "dv", *dz, "pivot")
        ),
        "free_forces": PartProgram(
            lambda _: free_forces(driven), ("q", "w", "u"), ("dq", "H", "forces", "gamma", *dz)
        ),
    }
    closed = driven.robot.mobility < driven.robot.equations.nv
    return found if closed else {"motion": found["motion"]}


def programs(driven: Driven, kinds: Sequence[str]) -> Mapping[str, PartProgram]:
    """Return the programs that an FMU has beside those of the functions it calls."""
    robot, seeds = driven.robot, ("sq", "sw", "su", "sp")
    dz, tdz = (("dz",), ("tdz",)) if driven.states else ((), ())
    found = {
        "own_motion": PartProgram(
            lambda _: own_motion(driven), ("q", "v", "u"), ("dq", "w", "dw", *dz, "pivot")
        ),
        "own_tangent": PartProgram(
            lambda _: own_tangent(driven),
            ("q", "v", "u", *seeds),
            ("tq", "tdq", "tw", "tdw", *tdz),
        ),
        "telling": PartProgram(lambda robot: telling(robot, kinds), ("q", "w", "dw"), ("told",)),
        "telling_tangent": PartProgram(
            lambda robot: telling_tangent(robot, kinds),
            ("q", "w", "dw", "tq", "tw", "tdw", "sp"),
            ("ttold",),
        ),
        "gap": PartProgram(gap, ("q",), ("gap",)),
        "gap_tangent": PartProgram(gap_tangent, ("q", "sq", "sp"), ("tgap",)),
    }
    if robot.mobility == robot.equations.nv:
        return found
    balanced = "q", "w", "u", "dw", "lambda", "tq", "tw", "su", "sp"
    return found | {
        "free_opened": PartProgram(free_opened, ("q", "sq", "sp"), ("t", "opened")),
        "free_turned": PartProgram(free_turned, ("q", "w", "t", "sp"), ("tq", "turned")),
        "free_tangent": PartProgram(
            lambda _: free_tangent(driven), balanced, ("tdq", "unbalanced", "turned", *tdz)
        ),
    }
