"""Growing: the spanning tree of a mechanism, from its description and the symbols of its
coordinates.

From ground outwards, joint by joint: each motion of a joint adds a node to the tree, turned and
moved against the one before; the last one is the body. Masses that no motion of their own tells
apart are moved into parents (`regrouping`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import casadi as ca
import numpy as np

from linkwork.equations.algebra import (
    SX,
    Vector,
    constant,
    quaternion_matrix,
    snap,
    symbol,
    vector,
    zero,
)
from linkwork.equations.frames import frame_matrix, turned_back, turned_by
from linkwork.equations.joints import ElementaryMotion, motions_of
from linkwork.equations.moments import Moments
from linkwork.equations.orientation import Orientation
from linkwork.equations.regrouping import Hanging, regrouped
from linkwork.equations.topology import Branch, Topology
from linkwork.equations.tree import GROUND_NODE, Column, Node, Tree, in_axes, in_ground
from linkwork.mechanism import GROUND, Body, Mechanism, PairJoint

MASSLESS = Body(mass=0.0)


def grow(
    mechanism: Mechanism, topology: Topology, parameters: Mapping[str, float], length: float = 1.0
) -> Tree:
    """Build the tree's nodes from the mechanism's numbers and the symbols q, in the order of the
    joints.

    parameters: values of the mechanism's free numbers, by path; length: its own [m]
    """
    # Places of all coordinates and rates, and which of them are quaternions.
    coordinates, rates, quaternions, places = [], [], [], {}
    for name, joint in topology.joints.items():
        start, rate = places[name] = len(coordinates), len(rates)
        for motion, own, own_rates in placed(motions_of(joint), start, rate):
            quaternions += [(own, own_rates)] if motion.ball else []
        coordinates += joint.coordinates(name)
        rates += joint.rates(name)
    # Nodes from ground outwards: each joint's behind that of the body that it hangs on.
    q, names = SX.sym("q", len(coordinates)), (tuple(coordinates), tuple(rates))
    p = ca.vertcat(SX(0, 1), *[symbol(path) for path in parameters])
    nodes, of_bodies = [], {GROUND: GROUND_NODE}
    for branch in topology.branches:
        joint, body = topology.joints[branch.joint], mechanism.bodies.get(branch.body, MASSLESS)
        parent, start, rate = of_bodies[branch.parent], *places[branch.joint]
        nodes += branch_nodes(joint, body, q, parent, branch, len(nodes), start, rate, length)
        of_bodies[branch.body] = nodes[-1]
    return Tree(q, *names, tuple(quaternions), regroup(tuple(nodes)), parameters, p, length)


def branch_nodes(
    joint: PairJoint,
    body: Body,
    q: ca.SX,
    parent: Node,
    branch: Branch,
    first: int,
    start: int,
    rate: int,
    length: float,
) -> Iterator[Node]:
    """Yield the nodes that one joint adds, the last one being the body; a joint without motion adds
    one all the same.

    parent: that the joint hangs on; first: index of the first node; start, rate: places of the
    joint's first coordinate in q and first rate in w; length: the mechanism's own [m]
    """
    # The joint's steps from the parent outwards, whichever way it was described.
    inner, outer = reversed(joint.frames) if branch.reversed else joint.frames
    steps = list(placed(motions_of(joint), start, rate))
    if branch.reversed:
        steps = [(motion.reversed(), places, rates) for motion, places, rates in reversed(steps)]
    origin, own = vector(outer.position), frame_matrix(outer).T
    arm, turned = snap(vector(inner.position) - parent.frame_origin, length), frame_matrix(inner)
    before = turned_by(parent.R, inner)
    # A node for each step: turned and moved against the one before; the last one is the body.
    for index, (motion, places, rates) in enumerate(
        steps or [(None, range(0), range(0))], start=first
    ):
        last = index == first + max(len(steps), 1) - 1
        after = own if last else np.eye(3)
        coordinate = q[list(places)]
        R = moved(before, motion, coordinate, branch.reversed)
        near_r, r = constant(arm), parent.R.turned(arm)
        if motion and motion.slides:
            along = snap(turned @ motion.slide)
            near_r += constant(along) * coordinate
            r = r + parent.R.turned(along) * coordinate
        # As a node: the axes of its columns, its place and its mass.
        column_axes = parent.axes if motion and motion.ball and not branch.reversed else R.axes
        parent = Node(
            index=index,
            parent=parent.index,
            joint=branch.joint,
            body=branch.body if last else None,
            motion=motion,
            columns=columns(before, R, motion, rates, branch.reversed, after) if motion else (),
            column_axes=column_axes,
            R=turned_back(R, outer) if last else R.then_constant(after),
            before=parent.axes,
            O=parent.O + in_ground(parent.axes, r),
            r=r,
            near_r=near_r,
            arm=arm if motion is None or not motion.slides else None,
            weld=turned @ after if motion is None else None,
            hinge=hinge(motion, turned, after) if motion else None,
            frame_origin=origin if last else np.zeros(3),
            moments=Moments.of_body(body, origin) if last else Moments.none(),
        )
        yield parent
        arm, turned = np.zeros(3), np.eye(3)
        before = parent.R.then_constant(turned)


def hinge(motion: ElementaryMotion, before: Vector, own: Vector) -> tuple[Vector, Vector] | None:
    """Return the axis of a turn alone in the node's frame and in the parent's, else None.

    before: the frame before the turn in the parent's; own: the node's frame in that behind it
    """
    if motion.ball or motion.slides or not motion.turns:
        return None
    return snap(own.T @ motion.turn), snap(before @ motion.turn)


def placed(
    motions: tuple[ElementaryMotion, ...], start: int, rate: int
) -> Iterator[tuple[ElementaryMotion, range, range]]:
    """Yield a joint's motions with the places of their coordinates in q and of their rates in w."""
    for motion in motions:
        yield (motion, range(start, start + motion.coordinates), range(rate, rate + motion.rates))
        start, rate = start + motion.coordinates, rate + motion.rates


def moved(
    R: Orientation, motion: ElementaryMotion | None, q: ca.SX, backwards: bool
) -> Orientation:
    """Return the orientation behind a motion; a ball's quaternion may be read backwards."""
    if motion is not None and motion.ball:
        matrix = quaternion_matrix(q)
        return R.then_matrix(matrix.T if backwards else matrix)
    return R.then_turn(motion.turn, q) if motion is not None and motion.turns else R


def columns(
    inner: Orientation,
    outer: Orientation,
    motion: ElementaryMotion,
    rates: range,
    backwards: bool,
    own: Vector,
) -> tuple[Column, ...]:
    """Return what each rate of a motion does: a ball's are the angular velocity in the axes of the
    first frame.

    own: the body's frame in the frame behind the motion
    """
    if not motion.ball:
        local = snap(own.T @ motion.turn), snap(own.T @ motion.slide)
        # The axis is the same before and behind the motion.
        near = inner if inner.axes is outer.axes else outer
        return (Column(rates[0], in_axes(near, motion.turn), in_axes(near, motion.slide), *local),)
    if backwards:
        return tuple(
            Column(k, in_axes(outer, -e), zero(), snap(own.T @ -e), np.zeros(3))
            for k, e in zip(rates, np.eye(3), strict=True)
        )
    return tuple(
        Column(k, in_axes(inner, e), zero(), None, None)
        for k, e in zip(rates, np.eye(3), strict=True)
    )


def regroup(nodes: tuple[Node, ...]) -> tuple[Node, ...]:
    """Move masses into parents (`regrouping`)."""
    links = [Hanging(node.moments, node.parent, node.arm, node.weld, node.hinge) for node in nodes]
    return tuple(
        replace(node, moments=own) for node, own in zip(nodes, regrouped(links), strict=True)
    )
