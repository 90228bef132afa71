"""Which functions of a robot are offered to frameworks of automatic differentiation: those that
CasADi gets, as far as they are expressions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.autodiff.array_function import ArrayFunction
from linkwork.checks import amount
from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.errors import LinkworkError
from linkwork.export import CasadiFunctions, casadi
from linkwork.model.charts import LARGE
from linkwork.model.state import State
from linkwork.robot import Robot

SOLVED = {
    "closed": "is found by Newton's method; its own function of that name closes loops",
    "tool_to_joints": "is found by Newton's method; robot.assemble does",
    "reactions": "solves equations that are no expressions; robot.reactions does",
}
"""What is no expression, why, and who does it instead."""


RANKS = {
    **dict.fromkeys(("kinetic", "potential", "residual"), 0),
    **dict.fromkeys(("M", "S", "L", "T", "J", "dJ", "Phi"), 2),
    **dict.fromkeys(("origins", "orientations", "twists"), 2),
}
"""Dimensions of the results that are not vectors, by name."""

ALIKE = 1e-9  # difference of two ways to the same number, over it


class Offered(Mapping[str, ArrayFunction]):
    """Hold a robot's functions of arrays in one choice of independent rates, by name; each is made
    when it is first asked for.

    functions: CasADi's, of the same names but for those that are no expressions;
        forward_dynamics gives v' alone
    equations: in these rates
    """

    def __init__(self, robot: Robot, functions: CasadiFunctions, equations: Equations):
        self.robot, self.functions, self.equations = robot, functions, equations
        self._made: dict[str, ArrayFunction] = {}

    def __getitem__(self, name: str) -> ArrayFunction:
        """Return a function by name.

        Raises:
            LinkworkError: there is none of that name; the robot cannot have it.
        """
        if name not in self._made:
            if name in SOLVED:
                raise LinkworkError(f"'{name}' {SOLVED[name]}")
            f = self.functions[name]
            forward = name == "forward_dynamics"
            self._made[name] = (
                ArrayFunction.of(part(f, ["dv", "pivot"]), self._residual)
                if forward
                else ArrayFunction.of(f)
            )
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return (name for name in self.functions if name not in SOLVED)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @cached_property
    def motion(self) -> ArrayFunction:
        """(q, v, u) -> v' and q' together."""
        return ArrayFunction.of(self.functions["forward_dynamics"])

    @cached_property
    def newton(self) -> ArrayFunction:
        """q -> q after a Newton step that closes loops."""
        return ArrayFunction.of(part(self.functions["closure_step"], ["q_next"]))

    @property
    def _residual(self) -> ca.Function | None:
        """(q, v, u, p), v' -> M v' + C v + G - f - S' u, and M; none where bearings rub by what
        they carry, whose friction is part of the accelerations, and where quaternions that are not
        of length 1 make it another function than these."""
        if self.robot.rubs:
            return None
        quick, equations = residual(self.equations), self.equations
        if not equations.tree.quaternions or alike(quick, residual(equations, by_inertia=True)):
            return quick
        return None if equations.recursive else residual(equations, by_inertia=True)


def functions_of(robot: Robot, chart: State | Sequence[str] | None = None) -> Offered:
    """Return what is offered of a robot in a choice of independent rates, as `export.casadi` takes
    it.

    robot: whose functions they are; chart: a state that is in it, or the names of its rates; the
    robot's own if left out.

    Raises:
        LinkworkError: what is no robot; rates that there are not, or that do not determine the
            motion; a mechanism whose kernels of its own take too long to compile.
    """
    found = casadi(robot, chart)
    if robot.chart.large:
        raise LinkworkError(
            f"the derivatives of {robot.mechanism.name} take too long to compile, for its "
            f"equations of motion, of {amount(len(robot.bodies), 'body')}, have more than "
            f"{LARGE:,} instructions; robot.forward_dynamics and robot.ensemble evaluate it"
        )
    state = robot.home if chart is None else chart
    if not isinstance(state, State):
        state = robot.in_chart(robot.home, state)
    return Offered(robot, found, robot.chart_of(state).equations)


def part(f: ca.Function, outputs: list[str]) -> ca.Function:
    """Return a function with some of the outputs."""
    symbols = f.sx_in()
    found = dict(zip(f.name_out(), f.call(symbols), strict=True))
    given = [found[name] for name in outputs]
    return ca.Function(f.name(), symbols, given, f.name_in(), outputs, {"cse": True})


def residual(equations: Equations, by_inertia: bool = False) -> ca.Function:
    """Return (q, v, u[, p], v') -> M v' + C v + G - f - S' u, and M.

    by_inertia: as most accelerations are found; else by inverse dynamics, in fewer operations
    """
    tree, v, p = equations.tree, equations.v, equations.p
    u, dv = SX.sym("u", len(equations.mechanism.actuators)), SX.sym("dv", equations.mobility)
    if by_inertia:
        forces = ca.mtimes(equations.inertia[0], dv) + equations.bias_forces(equations.gravity)
    else:
        forces = functions.inverse_dynamics(equations)(tree.q, v, dv, p)[0]
    R = forces - ca.mtimes(equations.actuation.T, u)
    free = [p] if p.numel() else []
    return ca.Function("residual", [tree.q, v, u, *free, dv], [R, equations.inertia[0]])


def alike(f: ca.Function, g: ca.Function) -> bool:
    """Tell whether two functions are the same one, by their first results at a random point."""
    random = np.random.default_rng(0)
    given = [random.uniform(0.5, 1.5, f.numel_in(i)) for i in range(f.n_in())]
    first, second = (np.array(each.call(given)[0]) for each in (f, g))
    return bool(np.abs(first - second).max() <= ALIKE * np.abs(first).max())
