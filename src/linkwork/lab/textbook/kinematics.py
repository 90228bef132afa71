"""Poses of the bodies and unit twists of the joints, along the paths from ground.

A spanning tree of the mechanism's graph gives each body one path from ground. The path is a row of
signs s (length m): +1 for a joint passed from its first to its second body, -1 for one passed
backwards, 0 for one that is not on the path. The joints left out of the tree close the loops.

Joint j with the axis e_j through the point a_j has the unit twist, of its second body relative to
its first, at the base's origin o and at any point p

    S_j = [e_j; a_j x e_j]  (revolute),   [0; e_j]  (prismatic)
    S_j(p) = [omega_j; v_j + omega_j x p]

so a body with path s has at its point p the twist  sum_j s_j S_j(p) q'_j. S_j is fixed in the
joint's first body; when that has the twist [omega; v] at o,

    S_j' = [omega x omega_j; omega x v_j + v x omega_j].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import networkx as nx
import numpy as np

from linkwork.errors import LinkworkError
from linkwork.lab.textbook.geometry import (
    cross_matrix,
    frame_transform,
    inverse,
    point,
    shift,
    turn,
)
from linkwork.mechanism import (
    GROUND,
    FixedJoint,
    Mechanism,
    PairJoint,
    PrismaticJoint,
    RevoluteJoint,
)


@dataclass(frozen=True)
class SpanningTree:
    """Hold the paths from ground: `moving` names the m joints that have a coordinate, in order."""

    mechanism: Mechanism
    moving: tuple[str, ...]
    parent: Mapping[
        str, tuple[str, str]
    ]  # body -> the body before it and the joint between them, root first
    path: Mapping[str, np.ndarray]  # body -> signs s, shape (m,)
    closing: tuple[str, ...]
    frames: Mapping[str, tuple[np.ndarray, np.ndarray]]  # joint -> X_1F, X_2F


def spanning_tree(mechanism: Mechanism) -> SpanningTree:
    """Choose shortest paths from ground to every body.

    Raises:
        LinkworkError: a joint is neither revolute nor prismatic nor fixed.
    """
    for name, joint in mechanism.pairs.items():
        if not isinstance(joint, RevoluteJoint | PrismaticJoint | FixedJoint):
            raise LinkworkError(
                f"joints.{name}: the textbook formulation has no {joint.type} joint; "
                "build it from revolute, prismatic and fixed joints"
            )
    graph = mechanism.graph()
    moving = tuple(
        name for name, joint in mechanism.pairs.items() if not isinstance(joint, FixedJoint)
    )
    parent: dict[str, tuple[str, str]] = {}
    path = {GROUND: np.zeros(len(moving))}
    for body, nodes in nx.single_source_shortest_path(graph, GROUND).items():
        if body == GROUND:
            continue
        joint = next(iter(graph[nodes[-2]][body]))
        parent[body] = (nodes[-2], joint)
        path[body] = path[nodes[-2]] + crossing(
            moving, joint, forwards=mechanism.pairs[joint].connects[1] == body
        )
    tree_joints = {joint for _, joint in parent.values()}
    closing = tuple(name for name in mechanism.pairs if name not in tree_joints)
    frames = {
        name: (frame_transform(j.frames[0]), frame_transform(j.frames[1]))
        for name, j in mechanism.pairs.items()
    }
    return SpanningTree(mechanism, moving, parent, path, closing, frames)


def crossing(moving: tuple[str, ...], joint: str, forwards: bool = True) -> np.ndarray:
    """Return the signs of a path that consists of one joint, shape (m,)."""
    return np.array([float(name == joint) for name in moving]) * (1 if forwards else -1)


def joint_motion(joint: PairJoint, q: float) -> np.ndarray:
    """Return X_12 of the second joint frame in the first at the coordinate q [rad, m]."""
    match joint:
        case RevoluteJoint():
            return turn(q * np.array(joint.axis))
        case PrismaticJoint():
            return shift(q * np.array(joint.axis))
        case _:
            return np.eye(4)


def unit_twist(joint: PairJoint, X_F: np.ndarray) -> np.ndarray:
    """Return S of a joint (6,) whose first frame has the pose X_F."""
    match joint:
        case RevoluteJoint():
            e = X_F[:3, :3] @ np.array(joint.axis)
            return np.concatenate([e, cross_matrix(X_F[:3, 3]) @ e])
        case PrismaticJoint():
            return np.concatenate([np.zeros(3), X_F[:3, :3] @ np.array(joint.axis)])
        case _:
            raise TypeError(joint.type)


@dataclass(frozen=True)
class Configuration:
    """Hold a configuration: joint coordinates by name, poses X of the bodies, unit twists S (6 x m)
    at o."""

    tree: SpanningTree
    coordinates: Mapping[str, float]
    X: Mapping[str, np.ndarray]
    S: np.ndarray

    def mass_centre(self, body: str) -> np.ndarray:
        """Return c of a body [m]."""
        return point(self.X[body], self.tree.mechanism.bodies[body].centre_of_mass)

    def unit_twists(self, p: np.ndarray) -> np.ndarray:
        """Return the unit twists of all joints at the point p, 6 x m."""
        return np.vstack([self.S[:3], self.S[3:] - cross_matrix(p) @ self.S[:3]])


def configuration(tree: SpanningTree, q: np.ndarray) -> Configuration:
    """Place all bodies and joint axes at the joint coordinates q, by the tree."""
    joints = tree.mechanism.pairs
    coordinates = dict.fromkeys(joints, 0.0) | {
        name: float(x) for name, x in zip(tree.moving, q, strict=True)
    }
    X = {GROUND: np.eye(4)}
    for body, (before, name) in tree.parent.items():
        X_1F, X_2F = tree.frames[name]
        X_12 = X_1F @ joint_motion(joints[name], coordinates[name]) @ inverse(X_2F)
        X[body] = X[before] @ (X_12 if joints[name].connects[1] == body else inverse(X_12))
    S = [
        unit_twist(joints[name], X[joints[name].connects[0]] @ tree.frames[name][0])
        for name in tree.moving
    ]
    return Configuration(tree, coordinates, X, np.reshape(S, (-1, 6)).T)


@dataclass(frozen=True)
class MovingConfiguration:
    """Hold a configuration with joint rates q' (m,) that keep the loops closed, and the rates S' of
    the unit twists."""

    at: Configuration
    rates: np.ndarray
    S_rate: np.ndarray

    def twist(self, body: str, p: np.ndarray) -> np.ndarray:
        """Return [omega; v] of a body, v at its point p."""
        return self.at.unit_twists(p) @ (self.at.tree.path[body] * self.rates)

    def unit_twists_rate(self, p: np.ndarray, p_rate: np.ndarray) -> np.ndarray:
        """Return d/dt of the unit twists of all joints at the point p that moves at p', 6 x m."""
        W, W_rate = self.at.S[:3], self.S_rate[:3]
        return np.vstack(
            [W_rate, self.S_rate[3:] - cross_matrix(p) @ W_rate - cross_matrix(p_rate) @ W]
        )


def motion(at: Configuration, rates: np.ndarray) -> MovingConfiguration:
    """Let each joint's unit twist move with its first body."""
    S_rate = np.zeros_like(at.S)
    for j, name in enumerate(at.tree.moving):
        first = at.tree.path[at.tree.mechanism.pairs[name].connects[0]]
        omega, v = map(cross_matrix, np.split(at.S @ (first * rates), 2))
        omega_j, v_j = np.split(at.S[:, j], 2)
        S_rate[:, j] = np.concatenate([omega @ omega_j, omega @ v_j + v @ omega_j])
    return MovingConfiguration(at, rates, S_rate)
