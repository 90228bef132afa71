"""The map between joints and the motors that drive them through loops, as expressions.

J falls into blocks, such as a knee's and an ankle's, which share no joint and no motor: each is
inverted by its cofactors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import networkx as nx
import numpy as np

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.equations.elimination import solve, weakest
from linkwork.equations.joint_map import derivative
from linkwork.equations.uncharted import uncharted
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.model.checks import PIVOT_BOUND

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
    "motor_inertia",
    "motor_bias",
)
MATRICES = ("jacobian", "jacobian_rate", "inverse", "joint_inertia", "motor_inertia")
INVERTED = ("inverse", "joint_rates", "motor_torques", "motor_inertia", "motor_bias")
"""Those that need J^-1."""
BY_VECTOR = ("jacobian_rate", "motor_rates", "joint_rates", "joint_torques", "motor_torques")
"""Those of k numbers of joints or motors, beside q."""
BY_RATES = ("joint_bias", "motor_bias")
"""Those of all independent rates, beside q."""
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
    def felt(self) -> list[int]:
        """The tree's rates that the torques h follow from: those that the joints move, and those
        whose rates or accelerations act on these, or on the motors' rates."""
        equations, free = self.equations, uncharted(self.equations)
        moved = {*ca.sparsify(equations.elimination.L[:, self.places]).sparsity().row()}
        w_dot = SX.sym("w_dot", equations.nv)
        forces = free.tree_forces(w_dot, equations.gravity)[sorted(moved)]
        acting = ca.jacobian_sparsity(forces, ca.vertcat(free.v, w_dot)).get_col()
        rows = ca.sparsify(equations.joints.rate_rows(self.motors)).sparsity()
        return sorted(moved | {column % equations.nv for column in acting} | {*rows.get_col()})

    @cached_property
    def inverse(self) -> tuple[ca.SX, ca.SX]:
        """J^-1, and the least determinant of a block in own units."""
        found, least = SX(len(self.joints), len(self.joints)), SX(np.inf)
        for rows, columns in blocks(self.J):
            if len(rows) != len(columns):
                return SX.zeros(*found.shape), SX(0)
            block = self.J[rows, columns]
            small = len(rows) <= COFACTORS
            found[columns, rows] = ca.inv_minor(block) if small else ca.inv(block)
            names = [self.joints[k] for k in columns], [self.motors[k] for k in rows]
            least = ca.fmin(least, ca.fabs(ca.det(block)) * self.unit(*names))
        return found, least

    def unit(self, columns: Sequence[str], rows: Sequence[str]) -> float:
        """Return the own unit of a determinant of rates by others."""
        return float(np.prod(self.units(columns)) / np.prod(self.units(rows)))

    def units(self, names: Sequence[str]) -> np.ndarray:
        """Return the own units of joint rates: the mechanism's length of slides, 1 of turns."""
        mechanism = self.equations.mechanism
        angular = {
            label for name, joint in mechanism.joints.items() for label in joint.angles(name)
        }
        length = self.equations.tree.length
        return np.array([1.0 if name in angular else length for name in names])

    @cached_property
    def turning(self) -> tuple[ca.SX, ca.SX]:
        """Rates w of the joints (k), as symbols, and J' for them. With rows R of the motors' rates,
        J = R L and Phi L = 0 give

            J' = R' L + R L',    Phi L' = -Phi' L
        """
        equations, w = self.equations, SX.sym("given", len(self.joints))
        L, Phi = ca.sparsify(equations.elimination.L[:, self.places]), equations.rows.Phi
        R, rates = equations.joints.rate_rows(self.motors), ca.densify(ca.mtimes(L, w))
        turned, bent = (ca.sparsify(derivative(A, equations.tree, rates)) for A in (R, Phi))
        X, _ = solve(equations.chart, Phi, -ca.densify(ca.mtimes(bent, L)))
        bending = equations.scatter(X, SX.zeros(equations.mobility, len(self.joints)))
        return w, ca.mtimes(turned, L) + ca.mtimes(R, bending)

    @cached_property
    def M(self) -> ca.SX:
        """The inertia at the joints (k x k), the other independent rates held."""
        return self.equations.inertia[0][self.places, self.places]

    @cached_property
    def h(self) -> ca.SX:
        """The torques at the joints (k) that rates v, weight, springs and friction need."""
        return self.needed(SX.zeros(self.equations.mobility))

    def needed(self, accelerations: ca.SX) -> ca.SX:
        """Return the torques at the joints (k) that accelerations of the independent rates v take,
        by one pass through the tree."""
        require_no_bearings(
            self.equations.mechanism.joints,
            "a bias without accelerations has not",
            "take the map of the mechanism without bearings",
        )
        L, b, _ = self.equations.elimination
        w_dot = ca.mtimes(L, accelerations) + b
        return ca.mtimes(
            L[:, self.places].T, self.equations.tree_forces(w_dot, self.equations.gravity)
        )

    @property
    def drift(self) -> ca.SX:
        """J' w (k): the motors' accelerations at rates v without accelerations of these."""
        equations = self.equations
        rows, rates = equations.joints.rate_rows(self.motors), equations.rates
        turning = ca.mtimes(derivative(rows, equations.tree, rates), rates)
        return ca.mtimes(rows, equations.elimination.b) + turning

    def result(self, name: str) -> tuple[ca.SX, ca.SX | None]:
        """Return what OUTPUTS name, matrices transposed, and the symbols that it is of beside q."""
        if name in BY_RATES:
            return self._bias(name), self.equations.v
        if name not in BY_VECTOR:
            return self._matrix(name).T, None
        given, rate = self.turning
        if name == "jacobian_rate":
            return rate.T, given
        matrix = self.inverse[0] if name in INVERTED else self.J
        return ca.mtimes(matrix.T if name.endswith("torques") else matrix, given), given

    def _matrix(self, name: str) -> ca.SX:
        if name == "jacobian":
            return self.J
        inverse = self.inverse[0]
        if name == "inverse":
            return inverse
        return self.M if name == "joint_inertia" else ca.mtimes([inverse.T, self.M, inverse])

    def _bias(self, name: str) -> ca.SX:
        if name == "joint_bias":
            return self.h
        accelerations = SX.zeros(self.equations.mobility)
        accelerations[self.places] = -ca.mtimes(self.inverse[0], self.drift)
        return ca.mtimes(self.inverse[0].T, self.needed(accelerations))


def function(of: LoopMap, name: str) -> ca.Function:
    """Return a function of q, what else it takes, and p: what is asked for, the weakest relative
    pivot, and the least determinant of J where it is inverted, 1 elsewhere; matrices row by row.
    """
    equations, (result, given) = of.equations, of.result(name)
    outputs = {
        name: result,
        "pivot": weakest_of(equations, of.felt) if name in BY_RATES else of.pivot,
        "determinant": of.inverse[1] if name in INVERTED else SX(1),
    }
    inputs = {} if given is None else {"v" if name in BY_RATES else "given": given}
    return functions.function(name, equations, outputs, **inputs)


def blocks(matrix: ca.SX) -> list[tuple[list[int], list[int]]]:
    """Return rows and columns of the blocks of a matrix; a block of other numbers of each is
    singular."""
    graph = nx.Graph()
    for side, count in zip(("row", "column"), matrix.shape, strict=True):
        graph.add_nodes_from((side, i) for i in range(count))
    for i, j in zip(*ca.sparsify(matrix).sparsity().get_triplet(), strict=True):
        graph.add_edge(("row", i), ("column", j))
    found = []
    for part in nx.connected_components(graph):
        rows, columns = (
            sorted(i for kind, i in part if kind == side) for side in ("row", "column")
        )
        found.append((rows, columns))
    return found


def reread(
    of: LoopMap, rates: Equations, needed: set[int], asked: list[int]
) -> tuple[ca.SX, ca.SX]:
    """Return the map's rates v that are needed, by those of other equations of the same tree, and
    what vanishes where these do not determine them.

    Rows of L give those by these, in small blocks as J has: solved for v, they spare the
    elimination of the loops that move the tree's rates `asked` in the other order.
    """
    own, v = of.equations, SX.zeros(of.equations.mobility)
    S = own.elimination.L[list(rates.chart.independent), :]
    read = [(rows, columns) for rows, columns in blocks(S) if needed & {*columns}]
    if any(len(rows) != len(columns) or len(rows) > COFACTORS for rows, columns in read):
        v = tree_rates(rates)[list(own.chart.independent)]
        return v, ca.fabs(weakest_of(rates, asked))
    loops = {rates.chart.independent[row] for rows, _ in read for row in rows} - {*asked}
    least = ca.fabs(weakest_of(own, sorted(loops)))
    for rows, columns in read:
        determinant = ca.det(S[rows, columns])
        v[columns] = ca.mtimes(ca.adj(S[rows, columns]), rates.v[rows]) / determinant
        if not determinant.is_constant():
            names = (own.independent[k] for k in columns), (rates.independent[k] for k in rows)
            least = ca.fmin(least, ca.fabs(determinant) * of.unit(*map(tuple, names)))
    return v, least


def tree_rates(equations: Equations) -> ca.SX:
    """Return w = L v (nv), the loops solved for this one right side instead of for L."""
    Phi_a = equations.rows.Phi[:, list(equations.chart.independent)]
    X, _ = solve(equations.chart, equations.rows.Phi, -ca.mtimes(Phi_a, equations.v))
    return equations.scatter(X, equations.v)


def weakest_of(equations: Equations, asked: list[int]) -> ca.SX:
    """Return the weakest relative pivot of the loops that some of the tree's rates depend on."""
    chart, Phi = equations.chart, equations.rows.Phi
    _, pivots = solve(chart, Phi, SX(Phi.shape[0], 1))
    graph, held = nx.Graph(), {row for block in chart.blocks for row in block.rows}
    for row, column in zip(*ca.sparsify(Phi).sparsity().get_triplet(), strict=True):
        if row in held and column in chart.dependent:
            graph.add_edge(("row", row), ("column", column))
    ends = [("column", rate) for rate in asked if rate in chart.dependent]
    reached = set().union(*(nx.node_connected_component(graph, end) for end in ends))
    blocks = zip(chart.blocks, pivots, strict=True)
    return weakest([pivot for block, pivot in blocks if ("column", block.columns[0]) in reached])


def watched(of: LoopMap, name: str, rates: Equations | None = None) -> ca.Function:
    """Return a function of q, what else it takes, the least determinant and p: what is asked for,
    and whether it is sound: apart from singular poses, and finite.

    rates: where the result is to be of all independent rates, in equations of the same tree
    """
    equations, (result, given) = of.equations, of.result(name)
    asked = of.felt if name in BY_RATES else [equations.chart.independent[k] for k in of.places]
    pivot = ca.fabs(weakest_of(equations, of.felt) if name in BY_RATES else of.pivot)
    inputs = {} if given is None else {"given": given}
    if rates is not None and given is not None:
        v = rates.v
        if rates.independent != equations.independent:
            places = [*range(v.numel())] if name in BY_RATES else of.places
            needed = {places[k] for k in ca.jacobian_sparsity(result, given).get_col()}
            v, other = reread(of, rates, needed, asked)
            pivot = ca.fmin(pivot, other)
        result = ca.substitute(result, given, v if name in BY_RATES else v[of.places])
        inputs = {"v": rates.v}
    least, total = SX.sym("least"), ca.sum1(ca.vec(ca.densify(result)))
    sound = ca.logic_and(pivot > PIVOT_BOUND, ca.fabs(total) < np.inf)
    if name in INVERTED:
        sound = ca.logic_and(sound, of.inverse[1] > least)
    outputs = {name: result, "sound": sound}
    return functions.function(name, equations, outputs, **inputs, least=least)
