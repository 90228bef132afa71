"""The map between joints and the motors that drive them through loops, as expressions.

J falls into blocks, such as a knee's and an ankle's, which share no joint and no motor: each is
inverted by its cofactors.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import networkx as nx
import numpy as np

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.equations.elimination import solve, weakest
from linkwork.equations.joint_map import derivative

OUTPUTS = (
    "jacobian",
    "jacobian_rate",
    "inverse",
    "motor_rates",
    "joint_rates",
    "joint_torques",
    "motor_torques",
    "joint_inertia",
    "joint_bias",
)
INVERTED = ("inverse", "joint_rates", "motor_torques")
"""Those that need J^-1."""
COFACTORS = 4
"""Largest block that is inverted by cofactors; larger ones are factorised."""


@dataclass(frozen=True, eq=False)
class LoopMap:
    """Hold J of motors by joints; equations: in a chart whose independent rates have the joints
    among them."""

    equations: Equations
    joints: tuple[str, ...]
    motors: tuple[str, ...]

    @cached_property
    def places(self) -> list[int]:
        """Where the joints are among the independent rates."""
        return [self.equations.independent.index(name) for name in self.joints]

    @cached_property
    def J(self) -> ca.SX:
        """The Jacobian (k x k)."""
        equations = self.equations
        rows = ca.mtimes(equations.joints.rate_rows(self.motors), equations.elimination.L)
        return ca.sparsify(rows[:, self.places])

    @cached_property
    def pivot(self) -> ca.SX:
        """The weakest relative pivot of those whose rates the joints move: another leg's do not
        count."""
        equations = self.equations
        moved = {*ca.sparsify(equations.elimination.L[:, self.places]).sparsity().row()}
        Phi_a = equations.rows.Phi[:, list(equations.chart.independent)]
        _, pivots = solve(equations.chart, equations.rows.Phi, -Phi_a)
        blocks = zip(equations.chart.blocks, pivots, strict=True)
        return weakest([pivot for block, pivot in blocks if moved & {*block.columns}])

    @cached_property
    def blocks(self) -> list[tuple[list[int], list[int]]]:
        """Rows and columns of the blocks of J; a block of other numbers of each is singular."""
        graph = nx.Graph()
        k = len(self.joints)
        graph.add_nodes_from([("row", i) for i in range(k)] + [("column", i) for i in range(k)])
        for i, j in zip(*self.J.sparsity().get_triplet(), strict=True):
            graph.add_edge(("row", i), ("column", j))
        return [
            tuple(sorted(i for kind, i in part if kind == side) for side in ("row", "column"))  # pyright: ignore
            for part in nx.connected_components(graph)
        ]

    @cached_property
    def inverse(self) -> tuple[ca.SX, ca.SX]:
        """J^-1, and the least determinant of a block in own units."""
        found, least = SX(len(self.joints), len(self.joints)), SX(np.inf)
        for rows, columns in self.blocks:
            if len(rows) != len(columns):
                return SX.zeros(*found.shape), SX(0)
            block = self.J[rows, columns]
            small = len(rows) <= COFACTORS
            found[columns, rows] = ca.inv_minor(block) if small else ca.inv(block)
            units = np.prod(self.units(self.joints)[columns]) / np.prod(
                self.units(self.motors)[rows]
            )
            least = ca.fmin(least, ca.fabs(ca.det(block)) * units)
        return found, least

    def units(self, names: tuple[str, ...]) -> np.ndarray:
        """Return the own units of joint rates: the mechanism's length of slides, 1 of turns."""
        mechanism = self.equations.mechanism
        angular = {
            label for name, joint in mechanism.joints.items() for label in joint.angles(name)
        }
        length = self.equations.tree.length
        return np.array([1.0 if name in angular else length for name in names])


def function(of: LoopMap, name: str) -> ca.Function:
    """Return a function of q, what else it takes, and p: what is asked for, the weakest relative
    pivot, and the least determinant of J where it is inverted, 1 elsewhere; matrices row by row.
    """
    equations, k = of.equations, len(of.joints)
    given = SX.sym("given", k)
    inputs: dict[str, ca.SX] = {}
    if name == "jacobian":
        result = of.J.T
    elif name == "jacobian_rate":
        inputs["given"] = given
        v = SX.zeros(equations.mobility)
        v[of.places] = given
        rates = ca.mtimes(equations.elimination.L, v)
        result = derivative(of.J, equations.tree, rates).T
    elif name == "inverse":
        result = of.inverse[0].T
    elif name in ("motor_rates", "joint_rates", "joint_torques", "motor_torques"):
        inputs["given"] = given
        matrix = of.inverse[0] if name in INVERTED else of.J
        result = ca.mtimes(matrix.T if name.endswith("torques") else matrix, given)
    elif name == "joint_inertia":
        result = equations.inertia[0][of.places, of.places]
    else:
        inputs["v"] = equations.v
        result = equations.bias_forces(equations.gravity)[of.places]
    outputs = {
        name: result,
        "pivot": equations.elimination.pivot if name == "joint_bias" else of.pivot,
        "determinant": of.inverse[1] if name in INVERTED else SX(1),
    }
    return functions.function(name, equations, outputs, **inputs)
