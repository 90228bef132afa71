"""What an engine is to add to a tree whose loops were cut away, as expressions in its coordinates.

The engine's rates v_e give the independent ones, v = E v_e. E is the unit matrix but for free
bases, whose linear rates the engine tells of the body's origin, along the ground's axes, and whose
angular ones along the body's:

    M_app = E' M E,    h_app = E' (h + M E' v_e),    tendons: rates A v_e with A = J L E

M and h being those of the links that are cut away and of all that acts, and the tendons' rates
those of the motors.

Rods that turn about themselves have no angular momentum about their own line: rates s of spins
follow from M_ss s + M_se E v_e = 0, and their accelerations are eliminated. So it stays with rods
that are alike all round and turn without friction; with others this holds at each instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import casadi as ca
import networkx as nx
import numpy as np

from linkwork.analysis.kept_tree import KeptTree
from linkwork.equations import functions
from linkwork.equations.algebra import SX, cross, quaternion_matrix
from linkwork.equations.elimination import solve
from linkwork.equations.joint_map import derivative
from linkwork.equations.symmetric import solve_symmetric
from linkwork.formats import poses
from linkwork.mechanism import GROUND
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.model.asked_rows import quaternion_product

CLOSED = 1e-13  # gap of closed loops, in own units
STEPS = 12  # of Newton's method, before the way is halved
SHORTEST = 1 / 1024  # part of the way from one configuration to the next


class TreeMap:
    """Hold the expressions for a tree and the motors that drive it through the loops.

    Functions are of q, the coordinates of the closed robot's own tree, which follow from the
    engine's x (nx: its qpos of the tree's joints, one after the other) by `placed` and then by
    `closure_step` until the gap is closed.
    """

    def __init__(self, tree: KeptTree, motors: Sequence[str], p: np.ndarray):
        self.tree, self.motors, self.p = tree, tuple(motors), p
        self.equations = tree.equations
        self.rates = SX.sym("v_e", len(tree.names))

    @cached_property
    def functions(self) -> tuple[ca.Function, ...]:
        """Return placed: (q, x) -> q with the tree's coordinates those of the engine; closing: q ->
        q after a Newton step at these, before it the gap, and the least relative pivot, which is
        negative on another branch; added: (q, v_e) -> M_app (n x n), h_app (n), A (motors x n,
        column by column), coordinates and rates of the motors."""
        return tuple(map(self._settled, (self._placed, self._closing, self._added)))

    def _settled(self, function: ca.Function) -> ca.Function:
        """Return a function whose free numbers are those of the robot."""
        *inputs, _ = function.sx_in()
        outputs = function.call([*inputs, ca.SX(ca.DM(self.p))])
        names = function.name_in()[:-1], function.name_out()
        return ca.Function(function.name(), inputs, outputs, *names, {"cse": True})

    @property
    def _placed(self) -> ca.Function:
        tree = self.equations.tree
        q, x, at = ca.SX(tree.q), SX.sym("x", len(self.coordinates)), 0
        for move in self.tree.moves:
            if move.kind == "free":
                own = x[at : at + 7]
                start = tree.coordinates.index(f"{move.name}.x")
                q[start : start + 7] = self._pose(move.name, own)
                at += 7
            else:
                q[tree.coordinates.index(move.name)] = x[at]
                at += 1
        return functions.function("placed", self.equations, {"q_placed": q}, x=x)

    @cached_property
    def coordinates(self) -> tuple[str, ...]:
        """Names of x: of the joint, seven times of a free one."""
        return tuple(
            move.name for move in self.tree.moves for _ in range(7 if move.kind == "free" else 1)
        )

    @property
    def x_home(self) -> list[float]:
        """x where the tree stands at first."""
        x: list[float] = []
        for seat in self.tree.plan.seats.values():
            for move in seat.moves:
                X = self.tree.home.poses[seat.body]
                free = [*X[:3, 3].tolist(), *poses.to_quaternion(X[:3, :3]).tolist()]
                x += free if move.kind == "free" else [move.ref]
        return x

    def _pose(self, joint: str, own: ca.SX) -> ca.SX:
        """Return position and quaternion of a free joint for those of its body in the ground."""
        near, far = self._frames(joint)
        own = ca.vertcat(own[:3], own[3:] / ca.norm_2(own[3:]))
        turned = quaternion_matrix(own[3:])
        p = ca.mtimes(near[:3, :3].T, own[:3] + ca.mtimes(turned, far[:3, 3]) - near[:3, 3])
        q_1, q_2 = (poses.to_quaternion(X[:3, :3]) for X in (near, far))
        first = q_1 * np.array([1.0, -1.0, -1.0, -1.0])
        return ca.vertcat(p, quaternion_product(quaternion_product(SX(first), own[3:]), SX(q_2)))

    def _frames(self, joint: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the poses of a free joint's frames in ground and in the body."""
        free = self.tree.mechanism.pairs[joint]
        frames = [poses.of_frame(frame) for frame in free.frames]
        return (frames[0], frames[1]) if free.connects[0] == GROUND else (frames[1], frames[0])

    @property
    def _closing(self) -> ca.Function:
        equations = self.equations
        found = functions.closure_step(equations).call([equations.tree.q, equations.p])
        _, pivots = solve(equations.chart, equations.rows.Phi, SX(len(equations.rows.names), 0))
        outputs = {
            "q_next": found[0],
            "gap": found[1],
            "pivot": ca.mmin(ca.vertcat(SX(1), *pivots)),
        }
        return functions.function("closing", equations, outputs)

    @cached_property
    def E(self) -> ca.SX:
        """E: rows in the order of the independent rates, columns in the engine's; spins are at
        zero."""
        E = SX(self.equations.mobility, len(self.tree.names))
        for column, row in enumerate(self.tree.order):
            E[row, column] = 1
        tree = self.equations.tree
        for move in self.tree.moves:
            if move.kind != "free":
                continue
            near, far = self._frames(move.name)
            start = tree.coordinates.index(f"{move.name}.qw")
            R_12 = quaternion_matrix(tree.q[start : start + 4])
            turned = ca.mtimes(R_12, far[:3, :3].T)
            column = self.tree.names.index(f"{move.name}.x")
            rows = self.tree.order[column : column + 6]
            linear, angular = list(range(column, column + 3)), list(range(column + 3, column + 6))
            E[rows[:3], linear] = near[:3, :3].T
            arms = [cross(SX(axis), SX(far[:3, 3])) for axis in np.eye(3)]
            E[rows[:3], angular] = ca.mtimes(turned, ca.horzcat(*arms))
            E[rows[3:], angular] = turned
        return E

    @property
    def _added(self) -> ca.Function:
        M, h, A = self.terms
        lengths = [self.equations.joints.position(name) for name in self.motors]
        outputs = {
            "M": M,
            "h": h,
            "A": A,
            "lengths": ca.vertcat(SX(0, 1), *lengths),
            "rates": ca.mtimes(A, self.rates),
        }
        return functions.function("added", self.equations, outputs, v_e=self.rates)

    @cached_property
    def terms(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """M_app (n x n), h_app (n) and A (motors x n), with zeros where nothing is coupled."""
        require_no_bearings(
            self.equations.mechanism.joints,
            "a plug-in has not",
            "take the tree of the mechanism without bearings",
        )
        equations, rest, E, v_e = self.equations, self.tree.rest, self.E, self.rates
        M, B = rest.inertia[0], E + self.spun
        v = ca.mtimes(B, v_e)
        h = ca.substitute(rest.bias_forces(rest.gravity), rest.v, v)
        w = ca.mtimes(equations.elimination.L, v)
        h += ca.mtimes(M, ca.mtimes(derivative(E, equations.tree, w), v_e))
        A = ca.mtimes([equations.joints.rate_rows(self.motors), equations.elimination.L, E])
        return ca.sparsify(ca.mtimes([E.T, M, B])), ca.mtimes(B.T, h), ca.sparsify(A)

    @cached_property
    def spun(self) -> ca.SX:
        """The rates of spins by the engine's, in the rows of the independent rates."""
        found, M = SX(*self.E.shape), ca.sparsify(self.tree.rest.inertia[0])
        names = self.equations.independent
        coupled = nx.Graph((k, k) for k in map(names.index, self.tree.spins))
        coupled.add_edges_from(
            (i, j)
            for i, j in zip(*M.sparsity().get_triplet(), strict=True)
            if i in coupled and j in coupled
        )
        for rods in map(sorted, nx.connected_components(coupled)):
            driven = ca.sparsify(ca.mtimes(M[rods, :], self.E))
            for column in sorted({*driven.sparsity().get_triplet()[1]}):
                own, force = ca.densify(M[rods, rods]), ca.densify(driven[:, column])
                found[rods, column] = -solve_symmetric(own, force)
        return found
