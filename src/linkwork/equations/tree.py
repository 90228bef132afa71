"""The spanning tree as a chain of elementary motions, and its kinematics.

Vectors of a node are written in the node's axes (`orientation`): the ground's in a planar
mechanism.

Every joint of the tree is a sequence of motions; each leads from a node to the next. A node has an
origin O (a point of the motion's axis), an orientation R and, if it is a body, the body's inertia.
Each rate w_k of a node turns it about z_k and slides it along s_k, both fixed in the parent; with r
= O - O_p:

    omega = omega_p + sum z_k w_k                       v = v_p + omega_p x r + sum s_k w_k
    alpha = alpha_p + sum z_k w_k' + omega_p x sum z_k w_k
    a = a_p + alpha_p x r + omega_p x (omega_p x r) + sum s_k w_k' + 2 omega_p x sum s_k w_k

A free turn has three rates, the angular velocity omega_12 in the axes of the joint's first frame,
and the unit quaternion p of R_12 for coordinates, with  p' = (0, omega_12) p / 2; all other
coordinates have their own rates.

Source: Featherstone 2008, ch. 4-6 (recursions).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations.algebra import (
    SX,
    Number,
    Vector,
    cross,
    point_acceleration,
    quaternion_map,
    total,
    zero,
)
from linkwork.equations.joints import ElementaryMotion
from linkwork.equations.moments import Moments
from linkwork.equations.orientation import GROUND_AXES, Axes, Orientation, convert
from linkwork.mechanism import GROUND

Rates = ca.SX | Mapping[int, ca.SX]  # of the tree, or of some of its joints, by their places


@dataclass(frozen=True)
class Column:
    """Say what one rate does to a node: it turns about z and slides along s, both fixed in the
    parent.

    z, s: in the node's `column_axes`; local_z, local_s: in the node's own frame where they are
    constant there, else None
    """

    rate: int
    z: ca.SX
    s: ca.SX
    local_z: Vector | None
    local_s: Vector | None


@dataclass(frozen=True)
class Node:
    """Hold one elementary motion and the frame behind it.

    index, parent: position in the tree's list, -1 for ground; joint, body: names (body None between
        the motions of a joint)
    motion: None if nothing moves; columns: one for each of its rates, in `column_axes`
    R: orientation; axes: in which its vectors are written; before: its parent's axes
    O: origin, in the ground's axes; r: O - O_parent in the parent's axes (`before`), near_r: in the
        parent's own frame
    arm: near_r where constant, else None; weld: R in the parent's frame where nothing moves, else
        None
    hinge: the axis of a turn alone, in the node's own frame and in the parent's, else None
    frame_origin: origin O in the body's own frame; moments: regrouped inertia in the node's frame
    """

    index: int
    parent: int
    joint: str
    body: str | None
    motion: ElementaryMotion | None
    columns: tuple[Column, ...]
    column_axes: Axes
    R: Orientation
    before: Axes
    O: ca.SX  # noqa: E741
    r: ca.SX
    near_r: ca.SX
    arm: Vector | None
    weld: Vector | None
    hinge: tuple[Vector, Vector] | None
    frame_origin: Vector
    moments: Moments

    @property
    def axes(self) -> Axes:
        return self.R.axes

    @cached_property
    def turns(self) -> bool:
        return self.motion is not None and self.motion.turns

    @cached_property
    def slides(self) -> bool:
        return self.motion is not None and self.motion.slides

    @cached_property
    def near_moments(self) -> tuple[Number, ca.SX, ca.SX]:
        """m, h, I in the node's axes."""
        return self.moments.turned(self.R)


GROUND_NODE = Node(
    index=-1,
    parent=-1,
    joint="",
    body=GROUND,
    motion=None,
    columns=(),
    column_axes=GROUND_AXES,
    R=Orientation.identity(),
    before=GROUND_AXES,
    O=zero(),
    r=zero(),
    near_r=zero(),
    arm=None,
    weld=None,
    hinge=None,
    frame_origin=np.zeros(3),
    moments=Moments.none(),
)


@dataclass(frozen=True)
class Tree:
    """Hold the nodes, parents before children, and the coordinates q (nq x 1) they are written in.

    coordinates, rates: names of q (nq) and of the rates w (nv); `start` gives each coordinate's
        place in q by name
    quaternions: the places in q and in w of each free turn
    parameters: values in the description of its free numbers p (np), by path; p: their symbols
    length: the mechanism's own (`lengths`) [m]
    """

    q: ca.SX
    coordinates: tuple[str, ...]
    rates: tuple[str, ...]
    quaternions: tuple[tuple[range, range], ...]
    nodes: tuple[Node, ...]
    parameters: Mapping[str, float]
    p: ca.SX
    length: float

    @cached_property
    def slides(self) -> np.ndarray:
        """Which rates are slides (nv), and no turns."""
        found = np.zeros(len(self.rates), bool)
        slides = [node for node in self.nodes if node.slides and not node.turns]
        found[[column.rate for node in slides for column in node.columns]] = True
        return found

    @cached_property
    def rate_units(self) -> np.ndarray:
        """Units of the rates (nv) but for the time: the own length of slides, 1 of turns."""
        return np.where(self.slides, self.length, 1.0)

    @cached_property
    def units(self) -> np.ndarray:
        """Units of the coordinates (nq): the own length of slides, 1 of turns and quaternions."""
        units = np.ones(len(self.coordinates))
        for place, k in self.single:
            units[place] = self.rate_units[k]
        return units

    def evaluated(
        self,
        name: str,
        outputs: Sequence[ca.SX],
        p: np.ndarray | None = None,
        inputs: Sequence[ca.SX] = (),
    ) -> Callable[..., Sequence[ca.DM]]:
        """Return the function of q, and of further inputs, that gives the values of expressions.

        p: values of the free numbers; the description's if left out
        """
        function = ca.Function(name, [self.q, self.p, *inputs], list(outputs))
        fixed = list(self.parameters.values()) if p is None else p
        return lambda q, *values: function.call([ca.DM(value) for value in (q, fixed, *values)])

    def number(self, constant: Vector) -> np.ndarray:
        """Return the value (k) of a constant vector at the description's numbers."""
        if not isinstance(constant, SX):
            return constant
        return np.array(
            self.evaluated("constant", [constant])(np.zeros(len(self.coordinates)))[0]
        ).ravel()

    @cached_property
    def of_bodies(self) -> dict[str, Node]:
        """Nodes by body."""
        return {GROUND: GROUND_NODE} | {
            node.body: node for node in self.nodes if node.body is not None
        }

    def node(self, body: str) -> Node:
        """Return the node of a body."""
        return self.of_bodies[body]

    @cached_property
    def places(self) -> dict[str, int]:
        """Places in q of the coordinates, by name."""
        return {label: place for place, label in enumerate(self.coordinates)}

    @cached_property
    def rate_places(self) -> dict[str, int]:
        """Places in w of the rates, by name."""
        return {label: place for place, label in enumerate(self.rates)}

    def path(self, node: Node) -> tuple[Node, ...]:
        """Return the nodes from ground to a node, in this order."""
        path = []
        while node.index >= 0:
            path.append(node)
            node = self.nodes[node.parent] if node.parent >= 0 else GROUND_NODE
        return tuple(reversed(path))

    def reaches(self, node: Node, d: ca.SX) -> Iterator[tuple[Node, ca.SX]]:
        """Yield the nodes from a node inward to ground, each with the vector from its origin to a
        point.

        d: the vector from the first node's origin to the point, in the node's axes; the yielded
        ones are in the nodes' `column_axes`. Lengths are added along the chain, so that what lies
        before an origin neither costs an operation nor adds rounding.
        """
        for inner in reversed(self.path(node)):
            yield inner, convert(d, inner.axes, inner.column_axes)
            d = convert(d, inner.axes, inner.before) + inner.r

    def point(self, node: Node, position: Vector) -> ca.SX:
        """Return the ground-frame position of a point given in a body's own frame."""
        return node.O + offset(node, position)

    @cached_property
    def pairs(self) -> int:
        """Number of pairs of rates of which one carries the other; grows faster than the tree."""
        carrying, found = [0] * (len(self.nodes) + 1), 0
        for node in self.nodes:
            for k, _ in enumerate(node.columns):
                found += carrying[node.parent] + k
            carrying[node.index] = carrying[node.parent] + len(node.columns)
        return found

    @property
    def single(self) -> list[tuple[int, int]]:
        """Return the places in q and in w of the coordinates that have a rate of their own."""
        of_balls, turns = ({k for own in self.quaternions for k in own[j]} for j in range(2))
        places = [i for i in range(len(self.coordinates)) if i not in of_balls]
        rates = [k for k in range(len(self.rates)) if k not in turns]
        return list(zip(places, rates, strict=True))

    @cached_property
    def derivative_map(self) -> ca.SX:
        """N (nq x nv, sparse) with q' = N w: unit rows, but p' = (0, omega) p / 2 of
        quaternions."""
        at, values = self.single.copy(), [SX.ones(len(self.single))]
        for places, ks in self.quaternions:
            at += [(place, k) for k in ks for place in places]
            values.append(ca.vec(quaternion_map(self.q[list(places)])))
        rows, columns = ([place[i] for place in at] for i in range(2))
        return SX.triplet(rows, columns, ca.vertcat(*values), self.q.numel(), len(self.rates))

    def derivatives(self, rates: ca.SX) -> ca.SX:
        """Return q' for the rates w."""
        return ca.mtimes(self.derivative_map, rates)

    def normed(self, found: ca.SX) -> ca.SX:
        """Return what depends on q for quaternions p scaled by (3 - p . p) / 2, a Newton step
        towards length 1."""
        q = SX(self.q)
        for places, _ in self.quaternions:
            q[list(places)] *= (3 - ca.sumsqr(self.q[list(places)])) / 2
        return ca.substitute(found, self.q, q) if self.quaternions else found

    def norms(self) -> list[ca.SX]:
        """Return (p . p - 1) / 2 of every quaternion, which stays zero."""
        return [(ca.sumsqr(self.q[list(places)]) - 1) / 2 for places, _ in self.quaternions]

    def angular_velocities(self, rates: Rates, nodes: Sequence[Node] | None = None) -> list[ca.SX]:
        """Return omega of every node for the rates w, in its axes; the last is ground's. Given
        nodes, the others rest."""
        omega = [zero()] * (len(self.nodes) + 1)
        for node in self.nodes if nodes is None else nodes:
            turn = (
                convert(turning(node, rates), node.column_axes, node.axes) if node.turns else zero()
            )
            omega[node.index] = convert(omega[node.parent], node.before, node.axes) + turn
        return omega

    def velocities(
        self, omega: list[ca.SX], rates: Rates, nodes: Sequence[Node] | None = None
    ) -> list[ca.SX]:
        """Return v_O of every node for the rates w, in its axes; the last is ground's. Given nodes,
        the others rest."""
        v = [zero()] * (len(self.nodes) + 1)
        for node in self.nodes if nodes is None else nodes:
            carried = v[node.parent] + cross(omega[node.parent], node.r)
            v[node.index] = convert(carried, node.before, node.axes)
            if node.slides:
                v[node.index] += convert(sliding(node, rates), node.column_axes, node.axes)
        return v

    def accelerations(
        self,
        omega: list[ca.SX],
        rates: Rates,
        accelerations: ca.SX | None,
        base: ca.SX,
        nodes: Sequence[Node] | None = None,
    ) -> tuple[list[ca.SX], list[ca.SX]]:
        """Return alpha and a_O of every node for w' (zero where None), in its axes, with the
        acceleration `base` of ground.

        The last elements are ground's. Given nodes, only those and the ones inward of them move.
        """
        alpha, a = [zero()] * (len(self.nodes) + 1), [base] * (len(self.nodes) + 1)
        for node in self.nodes if nodes is None else nodes:
            p, i = node.parent, node.index
            carried = point_acceleration(a[p], omega[p], alpha[p], node.r)
            alpha[i], a[i] = (convert(x, node.before, node.axes) for x in (alpha[p], carried))
            omega_p = convert(omega[p], node.before, node.column_axes)
            if node.turns:
                turn = cross(omega_p, turning(node, rates))
                if accelerations is not None:
                    turn = turning(node, accelerations) + turn
                alpha[i] += convert(turn, node.column_axes, node.axes)
            if node.slides:
                slide = 2 * cross(omega_p, sliding(node, rates))
                if accelerations is not None:
                    slide = sliding(node, accelerations) + slide
                a[i] += convert(slide, node.column_axes, node.axes)
        return alpha, a


def turning(node: Node, rates: Rates) -> ca.SX:
    return total([column.z * rates[column.rate] for column in node.columns])


def sliding(node: Node, rates: Rates) -> ca.SX:
    return total([column.s * rates[column.rate] for column in node.columns])


def offset(node: Node, position: Vector) -> ca.SX:
    """Return the vector from a node's origin to a point given in the body's own frame, in the
    ground's axes."""
    return in_base(node.R, position - node.frame_origin)


def near_offset(node: Node, position: Vector) -> ca.SX:
    """Return the vector from a node's origin to a point given in the body's own frame, in the
    node's axes."""
    return in_axes(node.R, position - node.frame_origin)


def in_axes(R: Orientation, local: Vector) -> ca.SX:
    """Return a constant local vector in the orientation's axes."""
    return R.turned(local)


def in_base(R: Orientation, local: Vector) -> ca.SX:
    """Return a constant local vector in the ground's axes."""
    return in_ground(R.axes, in_axes(R, local))


def in_ground(axes: Axes, x: ca.SX) -> ca.SX:
    """Return components of a vector in some axes in the ground's."""
    return x if axes.parent is None else ca.mtimes(axes.matrix, x)
