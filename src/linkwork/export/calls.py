"""The functions of an export: what each takes, gives and means, and its program."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca
import numpy as np

from linkwork.export import expressions
from linkwork.kernels.program import Operation, Program, trace
from linkwork.kernels.simplify import simplify
from linkwork.robot import Robot


@dataclass(frozen=True)
class Argument:
    """Name an array that a function takes or gives.

    sizes: of what its dimensions are, by the symbols of `layout`; 1 for a number alone
    """

    name: str
    sizes: tuple[str, ...]
    role: Literal["in", "out"]
    meaning: str


@dataclass(frozen=True)
class Call:
    """Describe a function that is written straight from a program.

    says: what it does; make: its CasADi function; finite: the array that has to be finite; pivot:
    whether its last output is the weakest relative pivot
    """

    name: str
    says: str
    arguments: tuple[Argument, ...]
    make: Callable[[Robot], ca.Function]
    finite: str
    pivot: bool = True

    def program(self, robot: Robot, free: bool) -> Program:
        """Return what it computes, with the free numbers as an input or as constants."""
        return program_of(self.make(robot), self.arguments, robot.p, free)


Q = Argument("q", ("Q",), "in", "configuration, with its loops closed")
V = Argument("v", ("V",), "in", "independent rates")
DV = Argument("dv", ("V",), "in", "independent accelerations")
U = Argument("u", ("U",), "in", "forces of the actuators")

CALLS: Mapping[str, Call] = {
    call.name: call
    for call in (
        Call(
            "motion",
            "Direct dynamics: dq = q', dv = v' of M v' + C v + G = S' u + f.",
            (
                *(Q, V, U),
                Argument("dq", ("Q",), "out", "rates of change of q"),
                Argument("dv", ("V",), "out", "independent accelerations"),
            ),
            expressions.motion,
            "dv",
        ),
        Call(
            "inverse_dynamics",
            "Inverse dynamics: the forces of the actuators that give the accelerations dv; with "
            "more actuators than freedoms those of least sum of squares.",
            (*(Q, V, DV), Argument("u", ("U",), "out", "forces of the actuators")),
            expressions.inverse_dynamics,
            "u",
        ),
        Call(
            "mass_matrix",
            "Generalised inertia M in the independent rates.",
            (Q, Argument("M", ("V", "V"), "out", "inertia, row by row")),
            expressions.mass_matrix,
            "M",
        ),
        Call(
            "jacobian",
            "Task Jacobian J of the tool: x' = J v; of rx, ry, rz together the rows are those of "
            "the angular velocity.",
            (Q, Argument("J", ("X", "V"), "out", "Jacobian, row by row")),
            expressions.jacobian,
            "J",
        ),
        Call(
            "closure",
            "Closure of the loops: phi, zero where they are closed.",
            (
                replace(Q, meaning="configuration"),
                Argument("phi", ("PHI",), "out", "closure rows"),
                Argument("gap", (), "out", "largest |phi|, lengths over the mechanism's own"),
            ),
            expressions.closure,
            "gap",
            pivot=False,
        ),
    )
}


def program_of(
    f: ca.Function, arguments: tuple[Argument, ...], p: np.ndarray, free: bool
) -> Program:
    """Return the program of a function whose last input is p, with inputs and outputs named as the
    arguments are; constants in place of p, but where it is free."""
    traced = trace(f)
    inputs, outputs = traced.inputs[:-1], traced.outputs
    names = {role: [each.name for each in arguments if each.role == role] for role in ("in", "out")}
    names["out"] += ["pivot"] * (len(outputs) - len(names["out"]))
    size = sum(count for _, count in inputs)
    nodes = traced.nodes
    if not free:
        nodes = tuple(
            Operation("const", (), float(p[int(node.value) - size]))
            if node.op == "input" and node.value >= size
            else node
            for node in nodes
        )
    own = [(name, count) for name, (_, count) in zip(names["in"], inputs, strict=True)]
    given = [*own, *(traced.inputs[-1:] if free else ())]
    gives = [(name, count) for name, (_, count) in zip(names["out"], outputs, strict=True)]
    return simplify(replace(traced, inputs=tuple(given), outputs=tuple(gives), nodes=nodes))
