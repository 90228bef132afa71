"""The spanning tree as a chain of elementary motions, and its kinematics in the ground's axes.

Every joint of the tree is a sequence of turns and slides; each leads from a node to the next. A node has an origin O
(a point of the motion's axis), an orientation R and, if it is a body, the body's inertia. With z the axis, r = O -
O_parent:

    turn     omega = omega_p + z q'        r constant in the parent
    slide    omega = omega_p               r = r_0 + z q
    alpha_O and a_O of a node follow from its parent's by the rigid-body formulas, with  a = a_p + alpha_p x r +
    omega_p x (omega_p x r)

Regrouping: a body that turns on its parent acts on it through its mass only as a point mass at the joint, so this mass
is moved into the parent once and for all (numbers), and the recursions carry first and second moments alone; a body
fixed to its parent is moved into it whole.
Source: Featherstone 2008, ch. 4-6 (recursions); Khalil & Dombre 2002, ch. 9 (regrouping).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, cross, rotation_matrix, snap, spin, zero
from linkwork.equations.joints import KINDS
from linkwork.equations.orientation import Orientation
from linkwork.equations.topology import Branch, Topology
from linkwork.mechanism import GROUND, Body, Mechanism


@dataclass(frozen=True)
class Moments:
    """Hold mass m, first moment h = m c and inertia I about a node's origin, constant in the node's axes."""

    m: float
    h: np.ndarray
    I: np.ndarray  # noqa: E741

    @classmethod
    def none(cls) -> Moments:
        return cls(0.0, np.zeros(3), np.zeros((3, 3)))

    @classmethod
    def of_body(cls, body: Body, origin: np.ndarray) -> Moments:
        """Refer a body's inertia to a point of it (body's frame and axes): I_O = I_C + m (c.c 1 - c c')."""
        c = np.array(body.centre_of_mass) - origin
        return cls(body.mass, body.mass * c, body.inertia.tensor() + body.mass * steiner(c))

    def __add__(self, other: Moments) -> Moments:
        return Moments(self.m + other.m, self.h + other.h, self.I + other.I)

    def moved(self, R: np.ndarray, r: np.ndarray) -> Moments:
        """Refer to a frame in which this one's axes are R and its origin is at r, both constant."""
        h, inertia = R @ self.h, R @ self.I @ R.T
        cross_terms = 2 * (r @ h) * np.eye(3) - np.outer(r, h) - np.outer(h, r)
        return Moments(self.m, h + self.m * r, inertia + cross_terms + self.m * steiner(r))


def steiner(c: np.ndarray) -> np.ndarray:
    return (c @ c) * np.eye(3) - np.outer(c, c)


@dataclass(frozen=True)
class Node:
    """Hold one elementary motion and the frame behind it, in the ground's axes.

    index, parent: position in the tree's list, -1 for ground; joint, body: names (body None between the motions of a
    joint)
    coordinate: index in q, None if nothing moves; turns: turn or slide; z: axis; local_z: axis in the node's own axes
    R: orientation; O: origin; r: O - O_parent; arm: r in the parent's axes where constant, else None
    weld: R in the parent's axes where nothing moves, else None
    frame_origin: origin O in the body's own frame; moments: regrouped inertia in the node's axes
    """

    index: int
    parent: int
    joint: str
    body: str | None
    coordinate: int | None
    turns: bool
    z: ca.SX
    local_z: np.ndarray
    R: Orientation
    O: ca.SX  # noqa: E741
    r: ca.SX
    arm: np.ndarray | None
    weld: np.ndarray | None
    frame_origin: np.ndarray
    moments: Moments


GROUND_NODE = Node(
    index=-1,
    parent=-1,
    joint="",
    body=GROUND,
    coordinate=None,
    turns=False,
    z=zero(),
    local_z=np.zeros(3),
    R=Orientation.identity(),
    O=zero(),
    r=zero(),
    arm=None,
    weld=None,
    frame_origin=np.zeros(3),
    moments=Moments.none(),
)


@dataclass(frozen=True)
class Tree:
    """Hold the nodes, parents before children, and the joint coordinates q (nq x 1) they are written in."""

    q: ca.SX
    coordinates: tuple[str, ...]
    nodes: tuple[Node, ...]

    def node(self, body: str) -> Node:
        """Return the node of a body."""
        return GROUND_NODE if body == GROUND else next(node for node in self.nodes if node.body == body)

    def path(self, node: Node) -> tuple[Node, ...]:
        """Return the nodes from ground to a node, in this order."""
        path = []
        while node.index >= 0:
            path.append(node)
            node = self.nodes[node.parent] if node.parent >= 0 else GROUND_NODE
        return tuple(reversed(path))

    def reaches(self, node: Node, d: ca.SX) -> Iterator[tuple[Node, ca.SX]]:
        """Yield the nodes from a node inward to ground, each with the vector from its origin to a point.

        d: the vector from the first node's origin to the point. Lengths are added along the chain, so that what lies before
        an origin neither costs an operation nor adds rounding.
        """
        for inner in reversed(self.path(node)):
            yield inner, d
            d = d + inner.r

    def point(self, node: Node, position: np.ndarray) -> ca.SX:
        """Return the ground-frame position of a point given in a body's own frame."""
        return node.O + offset(node, position)

    def angular_velocities(self, rates: ca.SX) -> list[ca.SX]:
        """Return omega of every node for the rates q'; the last element is ground's."""
        omega = [zero()] * (len(self.nodes) + 1)
        for node in self.nodes:
            turn = node.z * rates[node.coordinate] if node.turns and node.coordinate is not None else zero()
            omega[node.index] = omega[node.parent] + turn
        return omega

    def velocities(self, omega: list[ca.SX], rates: ca.SX) -> list[ca.SX]:
        """Return v_O of every node for the rates q'; the last element is ground's."""
        v = [zero()] * (len(self.nodes) + 1)
        for node in self.nodes:
            slide = node.z * rates[node.coordinate] if not node.turns and node.coordinate is not None else zero()
            v[node.index] = v[node.parent] + cross(omega[node.parent], node.r) + slide
        return v

    def accelerations(
        self, omega: list[ca.SX], rates: ca.SX, accelerations: ca.SX, base: ca.SX
    ) -> tuple[list[ca.SX], list[ca.SX]]:
        """Return alpha and a_O of every node for q'', with the acceleration `base` of ground; last elements are ground's."""
        alpha, a = [zero()] * (len(self.nodes) + 1), [base] * (len(self.nodes) + 1)
        for node in self.nodes:
            p, i = node.parent, node.index
            alpha[i] = alpha[p]
            a[i] = a[p] + cross(alpha[p], node.r) + spin(omega[p], node.r)
            if node.coordinate is None:
                continue
            rate, acceleration = rates[node.coordinate], accelerations[node.coordinate]
            if node.turns:
                alpha[i] = alpha[p] + node.z * acceleration + cross(omega[p], node.z * rate)
            else:
                a[i] += node.z * acceleration + 2 * cross(omega[p], node.z * rate)
        return alpha, a


def offset(node: Node, position: np.ndarray) -> ca.SX:
    """Return R (position - frame_origin): the vector from a node's origin to a point given in the body's own frame."""
    return in_base(node.R, position - node.frame_origin)


def grow(mechanism: Mechanism, topology: Topology) -> Tree:
    """Build the tree's nodes from the mechanism's numbers and the symbols q, in the joints' order."""
    in_tree = {branch.joint for branch in topology.branches}
    coordinates = tuple(
        name for name, joint in mechanism.joints.items() if name in in_tree for _ in KINDS[joint.type].motions(joint)
    )
    tree = Tree(SX.sym("q", len(coordinates)), coordinates, ())
    for branch in topology.branches:
        tree = replace(tree, nodes=tree.nodes + tuple(branch_nodes(mechanism, tree, branch)))
    return replace(tree, nodes=regroup(tree.nodes))


def branch_nodes(mechanism: Mechanism, tree: Tree, branch: Branch) -> Iterator[Node]:
    """Yield the nodes that one joint adds, the last one being the body; a joint without motion adds one all the same."""
    joint, body = mechanism.joints[branch.joint], mechanism.bodies[branch.body]
    inner, outer = reversed(joint.frames) if branch.reversed else joint.frames
    motions = KINDS[joint.type].motions(joint)
    if branch.reversed:
        motions = tuple(motion.reversed() for motion in reversed(motions))
    origin, R_outer = np.array(outer.position), rotation_matrix(outer.rotation)
    parent = tree.node(branch.parent)
    arm, turned = snap(np.array(inner.position) - parent.frame_origin), rotation_matrix(inner.rotation)
    first = len(tree.nodes)
    for index, motion in enumerate(motions or (None,), start=first):
        last = index == first + max(len(motions), 1) - 1
        R, z, r = parent.R.then_constant(turned), zero(), in_base(parent.R, arm)
        coordinate = tree.coordinates.index(branch.joint) + index - first if motion else None
        if motion and coordinate is not None:
            z = in_base(R, motion.axis)
            R = R.then_turn(motion.axis, tree.q[coordinate]) if motion.turns else R
            r = r if motion.turns else r + z * tree.q[coordinate]
        own = R_outer.T if last else np.eye(3)
        parent = Node(
            index=index,
            parent=parent.index,
            joint=branch.joint,
            body=branch.body if last else None,
            coordinate=coordinate,
            turns=bool(motion and motion.turns),
            z=z,
            local_z=snap(own.T @ motion.axis) if motion else np.zeros(3),
            R=R.then_constant(own),
            O=parent.O + r,
            r=r,
            arm=arm if motion is None or motion.turns else None,
            weld=turned @ own if motion is None else None,
            frame_origin=origin if last else np.zeros(3),
            moments=Moments.of_body(body, origin) if last else Moments.none(),
        )
        yield parent
        arm, turned = np.zeros(3), np.eye(3)


def in_base(R: Orientation, local: np.ndarray) -> ca.SX:
    """Return a constant local vector in the ground's axes."""
    local = snap(local)
    return ca.mtimes(R.matrix, SX(local)) if local.any() else zero()


def regroup(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
    """Move masses into parents: a turning node's as a point at the joint, a fixed node's moments whole."""
    moments = [node.moments for node in nodes]
    for node in reversed(nodes):
        if node.arm is None:
            continue
        own = moments[node.index]
        if node.weld is not None:
            passed, kept = own.moved(node.weld, node.arm), Moments.none()
        else:
            point = Moments(own.m, np.zeros(3), np.zeros((3, 3)))
            passed, kept = point.moved(np.eye(3), node.arm), Moments(0.0, own.h, own.I)
        moments[node.index] = kept
        if node.parent >= 0:
            moments[node.parent] = moments[node.parent] + passed
    return tuple(replace(node, moments=moments[node.index]) for node in nodes)
