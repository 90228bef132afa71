"""The functions of an export: what each takes, gives and means, and the programs that it needs.

A program is written as a static function "NAME_code". A `Call` without a body of its own calls the
program of its name and judges what that gave; the others are pieces of C (`templates`) that call
programs, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca
import numpy as np

from linkwork.equations import uncharted
from linkwork.export import expressions
from linkwork.kernels.program import Operation, Program, trace
from linkwork.kernels.simplify import simplify
from linkwork.robot import Robot


@dataclass(frozen=True)
class PartProgram:
    """Describe a program: its CasADi function, whose last input is p, and the names of its inputs
    and outputs in C."""

    make: Callable[[Robot], ca.Function]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def program(self, robot: Robot, free: bool) -> Program:
        """Return what it computes, with the free numbers as an input or as constants."""
        return program_of(self.make(robot), self.inputs, self.outputs, robot.p, free)


@dataclass(frozen=True)
class Argument:
    """Name what a function takes or gives: an array, a number alone, or the state of a motion.

    sizes: of what its dimensions are, by the symbols of `layout`; none for a number
    """

    name: str
    sizes: tuple[str, ...]
    role: Literal["in", "inout", "out"]
    meaning: str
    kind: Literal["real", "state"] = "real"


@dataclass(frozen=True)
class Call:
    """Describe a function of the header.

    says: what it does; body: its piece of C; pieces: the programs that it needs; refuse: raises
    where a robot cannot have it
    """

    name: str
    says: str
    arguments: tuple[Argument, ...]
    body: str | None = None
    pieces: tuple[str, ...] = ()
    refuse: Callable[[Robot], object] = lambda robot: None

    @property
    def needs(self) -> tuple[str, ...]:
        """The names of its programs."""
        return self.pieces or (self.name,)


PROGRAMS: Mapping[str, PartProgram] = {
    "motion": PartProgram(expressions.motion, ("q", "v", "u"), ("dq", "dv", "pivot")),
    "inverse_dynamics": PartProgram(expressions.inverse_dynamics, ("q", "v", "dv"), ("u", "pivot")),
    "mass_matrix": PartProgram(expressions.mass_matrix, ("q",), ("M", "pivot")),
    "jacobian": PartProgram(expressions.jacobian, ("q",), ("J", "pivot")),
    "closure": PartProgram(expressions.closure, ("q",), ("phi", "gap")),
    "closing": PartProgram(expressions.closing, ("q",), ("next", "gap", "length", "pivot")),
    "approaching": PartProgram(
        expressions.approaching, ("q", "x", "left"), ("next", "gap", "length", "pivot", "error")
    ),
    "positions": PartProgram(expressions.positions, ("q",), ("positions",)),
    "pose": PartProgram(expressions.pose, ("q",), ("pose",)),
    "rates": PartProgram(expressions.rates, ("q", "v"), ("w", "pivot")),
    "free_closure": PartProgram(
        lambda robot: uncharted.closure(robot.equations), ("q",), ("phi", "Phi", "gap")
    ),
    "free_forces": PartProgram(
        expressions.free_forces,
        ("q", "w", "u"),
        ("dq", "H", "forces", "gamma"),
    ),
    "meeting": PartProgram(expressions.meeting, ("q",), ("apart",)),
    "free_moved": PartProgram(
        lambda robot: uncharted.moved(robot.equations), ("q", "s"), ("next",)
    ),
}

Q = Argument("q", ("Q",), "in", "configuration, with its loops closed")
V = Argument("v", ("V",), "in", "independent rates")
DV = Argument("dv", ("V",), "in", "independent accelerations")
U = Argument("u", ("U",), "in", "forces of the actuators")
GUESS = Argument("q", ("Q",), "inout", "a configuration nearby; becomes the one that is found")
POSITIONS = Argument("positions", ("JOINTS",), "out", "coordinates of all joints")
DT = Argument("dt", (), "in", "length of the step [s]")
STATE = Argument("state", (), "inout", "state of the motion", "state")
STEPS = "motion", "closing", "rates"
MEETING = "meeting"
OTHER_CHARTS = "free_closure", "free_forces", "free_moved"

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
        ),
        Call(
            "inverse_dynamics",
            "Inverse dynamics: the forces of the actuators that give the accelerations dv; with "
            "more actuators than freedoms those of least sum of squares.",
            (*(Q, V, DV), Argument("u", ("U",), "out", "forces of the actuators")),
        ),
        Call(
            "mass_matrix",
            "Generalised inertia M in the independent rates.",
            (Q, Argument("M", ("V", "V"), "out", "inertia, row by row")),
        ),
        Call(
            "jacobian",
            "Task Jacobian J of the tool: x' = J v; of rx, ry, rz together the rows are those of "
            "the angular velocity.",
            (Q, Argument("J", ("X", "V"), "out", "Jacobian, row by row")),
        ),
        Call(
            "closure",
            "Closure of the loops: phi, zero where they are closed.",
            (
                replace(Q, meaning="configuration"),
                Argument("phi", ("PHI",), "out", "closure rows"),
                Argument("gap", (), "out", "largest |phi|, lengths over the mechanism's own"),
            ),
        ),
        Call(
            "project",
            "Close the loops by Newton's method, with the independent coordinates as they are.",
            (GUESS, Argument("gap", (), "out", "largest |phi| that is left")),
            "project.c",
            ("closing",),
        ),
        Call(
            "kinematics",
            "Direct kinematics: all joints and the tool from the independent coordinates, on the "
            "branch of a configuration nearby: by Newton's method, in shorter steps where it has "
            "to be; q stays as it is where no way leads there.",
            (
                Argument("a", ("A",), "in", "independent coordinates"),
                *(GUESS, POSITIONS),
                Argument("pose", ("POSE",), "out", "pose of the tool"),
            ),
            "kinematics.c",
            ("closing", "positions", "pose"),
            expressions.require_single,
        ),
        Call(
            "tool_to_joints",
            "Inverse kinematics: all joints from the tool's task coordinates, on the working mode "
            "of a configuration nearby: as in kinematics, with the tool led straight.",
            (Argument("x", ("X",), "in", "task coordinates of the tool"), GUESS, POSITIONS),
            "tool_to_joints.c",
            ("approaching", "positions"),
        ),
        Call(
            "start",
            "Begin a motion at a configuration, whose loops are closed, with independent rates.",
            (Q, V, replace(STATE, role="out")),
            "start.c",
            STEPS,
            expressions.require_steps,
        ),
        Call(
            "step_rk4",
            "One step of the classical Runge-Kutta method of order 4 with constant forces, after "
            "which the loops are closed. Where the independent rates hardly determine the motion "
            "the step is made in others; the state stays as it is where none do.",
            (U, DT, STATE),
            "step_rk4.c",
            (*STEPS, *OTHER_CHARTS),
            expressions.require_steps,
        ),
        Call(
            "step",
            "The same by as many steps of the method of Dormand and Prince as the tolerances need, "
            "at most LW_MOST_STEPS; where it fails the state is where it came to. Steps end where "
            "stops and contacts begin and cease to press.",
            (
                *(U, DT),
                Argument("rtol", (), "in", "error of a step, relative to each number"),
                Argument(
                    "atol",
                    (),
                    "in",
                    "the same, absolute [rad, rad/s]; of lengths over the mechanism's own",
                ),
                STATE,
            ),
            "step.c",
            (*STEPS, *OTHER_CHARTS, MEETING),
            expressions.require_steps,
        ),
    )
}


def needed_programs(
    robot: Robot, call: Call, free: bool, known: Mapping[str, Program]
) -> dict[str, Program]:
    """Return the programs that a function needs and that are not known yet; refuse what the robot
    cannot have. Other charts are there where there are loops, gaps where something may meet."""
    call.refuse(robot)
    closed = robot.mobility < robot.equations.nv
    missing = {*(() if closed else OTHER_CHARTS), *(() if robot.equations.gaps else (MEETING,))}
    needed = [each for each in call.needs if each not in missing]
    return {each: PROGRAMS[each].program(robot, free) for each in needed if each not in known}


def program_of(
    f: ca.Function, inputs: tuple[str, ...], outputs: tuple[str, ...], p: np.ndarray, free: bool
) -> Program:
    """Return the program of a function whose last input is p, with other names; constants in place
    of p, but where it is free."""
    traced = trace(f)
    own = [(name, size) for name, (_, size) in zip(inputs, traced.inputs[:-1], strict=True)]
    gives = [(name, size) for name, (_, size) in zip(outputs, traced.outputs, strict=True)]
    first = sum(size for _, size in own)
    nodes = traced.nodes
    if not free:
        nodes = tuple(
            Operation("const", (), float(p[int(node.value) - first]))
            if node.op == "input" and node.value >= first
            else node
            for node in nodes
        )
    given = [*own, *(traced.inputs[-1:] if free else ())]
    return simplify(replace(traced, inputs=tuple(given), outputs=tuple(gives), nodes=nodes))
