"""The joints' graph, and the wrenches that balance every body on it.

A spanning tree of the joints reaches every body; the others close loops. A closing joint brings
[moment about the origin of F2; force] to its second body and takes it from its first,

    W = A lambda + P (f + G' mu)

A: wrenches that do no work in its motion, P: force on each of its rates, f: actuators, friction,
springs and rotors, G, mu: slopes and multipliers of the gears. What a body needs beyond that its
joint of the tree brings, from the ends of the tree inward; this joint's own motion S then gives the
conditions on lambda and mu,  S' W = f + G' mu. Where a gear holds a length, mu also pulls at
bodies, which need so much less of their joints.

Where constraints depend on each other the conditions leave some directions open. Of all
distributions the one is taken whose constraint wrenches W - P (f + G' mu), moments divided by a
length l, and whose mu have the least sum of squares: the least Lagrange multipliers. All is written
with lengths over l.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from linkwork.equations import mobility
from linkwork.equations.gears import pushed
from linkwork.equations.joints import held_length
from linkwork.equations.topology import Rim
from linkwork.mechanism import GROUND, Mechanism

DEPENDENT = 1e-9  # singular values below this part of the largest count as zero
CROSS = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2).reshape(3, 9)  # r -> r x, by rows


@dataclass(frozen=True)
class TreeJoint:
    """Hold a joint of the spanning tree: its place, and the places of the bodies behind and before
    it (-1: ground).

    forward: whether the body behind it is its second one
    """

    joint: int
    body: int
    parent: int
    forward: bool


@dataclass(frozen=True, eq=False)
class Network:
    """Hold the graph of the joints between bodies: branches outward from ground, and the places of
    closing joints.

    joints: names; pairs: places of each joint's first and second body (-1: ground); rates: of each
    joint; rods: places of rods; geared: gear and rate, pulled: gear and body, of all that gears
    push
    """

    joints: tuple[str, ...]
    pairs: tuple[tuple[int, int], ...]
    rates: tuple[slice, ...]
    rods: frozenset[int]
    branches: tuple[TreeJoint, ...]
    closing: tuple[int, ...]
    gears: int
    geared: tuple[tuple[int, int], ...]
    pulled: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, mechanism: Mechanism) -> Network:
        """Span the tree: joints of few freedoms first, near ground; those of many close the
        loops."""
        # Pairs of bodies by number, and where the rates of each joint stand.
        place = {name: index for index, name in enumerate(mechanism.bodies)} | {GROUND: -1}
        described = mechanism.pairs
        joints = list(described.values())
        pairs = tuple((place[joint.connects[0]], place[joint.connects[1]]) for joint in joints)
        freedoms = [mobility.freedoms(joint, planar=False) for joint in joints]
        counts = [len(joint.rates("")) for joint in joints]
        rates = tuple(
            slice(end - count, end)
            for end, count in zip(np.cumsum(counts).tolist(), counts, strict=True)
        )
        rods = frozenset(
            index for index, joint in enumerate(joints) if held_length(joint) is not None
        )
        # Prim's rule: few freedoms first, then near to ground.
        branches = []
        index = {name: k for k, name in enumerate(described)}

        def cost(name: str, near: int) -> tuple[int, int, int]:
            return (freedoms[index[name]], near, index[name])

        rim = Rim(described, {GROUND: 0}, cost)
        while (found := rim.entering()) is not None:
            ends = place[found.body], place[found.parent]
            branches.append(TreeJoint(index[found.joint], *ends, not found.reversed))
        # The others close loops; gears hold rates, G w = 0.
        in_tree = {branch.joint for branch in branches}
        closing = tuple(k for k in range(len(pairs)) if k not in in_tree)
        labels = mechanism.rates
        pushes = [pushed(gear, mechanism) for gear in mechanism.gears.values()]
        geared = tuple((k, labels.index(rate)) for k, own in enumerate(pushes) for rate in own[0])
        pulled = tuple((k, place[body]) for k, own in enumerate(pushes) for body in own[1])
        return cls(
            *(tuple(described), pairs, rates, rods, tuple(branches), closing),
            *(len(pushes), geared, pulled),
        )

    @cached_property
    def unknowns(self) -> dict[int, slice]:
        """Columns of lambda of each closing joint, behind the column of what is known."""
        slices, start = {}, 1
        for k in self.closing:
            count = 1 if k in self.rods else 6 - (self.rates[k].stop - self.rates[k].start)
            slices[k] = slice(start, start + count)
            start += count
        return slices

    @cached_property
    def columns(self) -> int:
        """Number of columns: the known part, lambda of the closing joints, mu of the gears."""
        return 1 + sum(part.stop - part.start for part in self.unknowns.values()) + self.gears

    @cached_property
    def pushed_columns(self) -> list[int]:
        """Columns of what pushes on the rates: the known part, mu of the gears."""
        return [0, *range(self.columns - self.gears, self.columns)]

    @cached_property
    def closing_kinds(self) -> list[list[int]]:
        """Closing joints by how many rates they have, rods apart."""
        kinds = dict[tuple[bool, int], list[int]]()
        for k in self.closing:
            own = self.rates[k]
            kinds.setdefault((k in self.rods, own.stop - own.start), []).append(k)
        return [*kinds.values()]

    @cached_property
    def moving(self) -> list[int]:
        """Joints that have rates."""
        return [k for k, own in enumerate(self.rates) if own.stop > own.start]

    @cached_property
    def first_rates(self) -> list[int]:
        """The first rate of each of these."""
        return [self.rates[k].start for k in self.moving]

    @cached_property
    def order(self) -> list[int]:
        """Joints of the tree, outward."""
        return [branch.joint for branch in self.branches]

    @cached_property
    def carried(self) -> list[int]:
        """The bodies behind these."""
        return [branch.body for branch in self.branches]

    @cached_property
    def signs(self) -> np.ndarray:
        """1 where that is the second body of such a joint, else -1."""
        return np.array([1.0 if branch.forward else -1.0 for branch in self.branches])

    @cached_property
    def tree_rods(self) -> list[int]:
        """Rods of the tree."""
        return [k for k in self.order if k in self.rods]

    @cached_property
    def tree_rates(self) -> list[int]:
        """Rates of the tree's joints."""
        return [i for k in self.order for i in range(self.rates[k].start, self.rates[k].stop)]

    @cached_property
    def moved_joints(self) -> list[int]:
        """The joint of each of these."""
        return [k for k in self.order for _ in range(self.rates[k].start, self.rates[k].stop)]

    def pushed(self, slopes: np.ndarray) -> np.ndarray:
        """Return G (K, gears, m) of the slopes (K, geared)."""
        G = np.zeros((len(slopes), self.gears, sum(own.stop - own.start for own in self.rates)))
        for (gear, rate), slope in zip(self.geared, slopes.T, strict=True):
            G[:, gear, rate] = slope
        return G

    @property
    def numbers(self) -> int:
        """Numbers that one sample takes."""
        return 12 * max(len(self.pairs), 1) * self.columns


@dataclass(frozen=True, eq=False)
class Loads:
    """Hold what bodies need and joints bring at K samples, in the ground's axes, lengths over l.

    needed: [moment about the centre; force] of each body (K, r, 6); centres: (K, r, 3); origins: of
        F1, F2 (K, J, 2, 3)
    twists: of each rate at the origin of F2 (K, m, 6); f: known forces on the rates (K, m); G:
        slopes of the gears (K, gears, m); pulls: [moment about the centre; force] on bodies of unit
        multipliers, in the order of `Network.pulled` (K, pulled, 6)
    """

    needed: np.ndarray
    centres: np.ndarray
    origins: np.ndarray
    twists: np.ndarray
    f: np.ndarray
    G: np.ndarray
    pulls: np.ndarray


@dataclass(frozen=True, eq=False)
class Balance:
    """Hold the joints' wrenches about the origins of F2 (K, J, 6), their constraint part, and mu
    (K, gears).

    free: orthonormal changes of the unknowns that no condition forbids, as wrenches of the joints
    (K, J, 6, s)
    """

    wrenches: np.ndarray
    constraint: np.ndarray
    mu: np.ndarray
    free: np.ndarray


def balanced(network: Network, loads: Loads) -> Balance:
    """Return the wrenches that balance every body, the least ones where they are open."""
    W, acting, conditions = columns_of(network, loads)
    y, N = least_norm(conditions[..., 1:], -conditions[..., 0])
    constraint = W.copy()
    constraint[..., network.pushed_columns] -= acting
    if N.shape[-1]:
        gears = np.zeros((len(W), network.gears, W.shape[-1]))
        gears[..., network.columns - network.gears :] = np.eye(network.gears)
        measured = np.concatenate([constraint.reshape(len(W), -1, W.shape[-1]), gears], axis=1)
        known, free = measured[..., 0] + times(measured[..., 1:], y), measured[..., 1:] @ N
        y = y - times(N @ np.linalg.pinv(free, rcond=DEPENDENT), known)
    wrenches, held = (part[..., 0] + times(part[..., 1:], y[:, None]) for part in (W, constraint))
    return Balance(
        wrenches, held, y[:, network.columns - 1 - network.gears :], W[..., 1:] @ N[:, None]
    )


def columns_of(network: Network, loads: Loads) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return every joint's W (K, J, 6, columns), P (f + G' mu) (K, J, 6, 1 + gears), and S' W - f -
    G' mu of the tree (K, e, columns).

    The columns: what is known, then the factors of lambda and of mu.
    """
    ends, pushed, order = loads.origins[:, :, 1], network.pushed_columns, network.order
    W = np.zeros((*ends.shape[:2], 6, network.columns))
    sums = np.zeros((len(ends), loads.needed.shape[1], 6, network.columns))
    # What pushes on the rates, as wrenches of the joints.
    pushes = np.concatenate([loads.f[..., None], np.swapaxes(loads.G, 1, 2)], axis=2)
    each = conjugate(loads.twists)[..., None] * pushes[:, :, None]
    acting = np.zeros((*W.shape[:3], len(pushed)))
    acting[:, network.moving] = np.add.reduceat(each, network.first_rates, axis=1)
    # Joints that close loops bring that, and lambda.
    W[..., pushed] = acting
    for kind in network.closing_kinds:
        A = constraints(network, loads, kind)
        for i, k in enumerate(kind):
            W[:, k, :, network.unknowns[k]] = A[:, i]
    # About the first body's centre, wrenches are summed from the ends of the tree inward.
    middle, closing = loads.centres[:, :1], network.closing
    sums[..., 0] = moved(loads.needed[..., None], loads.centres - middle)[..., 0]
    for (gear, body), pull in zip(network.pulled, np.swapaxes(loads.pulls, 0, 1), strict=True):
        lever = loads.centres[:, body] - middle[:, 0]
        sums[:, body, :, network.columns - network.gears + gear] -= moved(pull[..., None], lever)[
            ..., 0
        ]
    taken = moved(W[:, closing], ends[:, closing] - middle)
    for i, k in enumerate(closing):
        for body, sign in zip(network.pairs[k], (1, -1), strict=True):
            if body >= 0:
                sums[:, body] += sign * taken[:, i]
    for branch in reversed(network.branches):
        if branch.parent >= 0:
            sums[:, branch.parent] += sums[:, branch.body]
    # The joints of the tree bring these sums; in their own motions, what pushes them.
    brought = sums[:, network.carried] * network.signs[:, None, None]
    W[:, order] = moved(brought, middle - ends[:, order])
    S = loads.twists[:, network.tree_rates]
    work = (S[:, :, None] @ W[:, network.moved_joints])[:, :, 0]
    work[..., pushed] -= pushes[:, network.tree_rates]
    work /= lengths(S)
    if rods := network.tree_rods:
        free = complement(constraints(network, loads, rods)) @ W[:, rods]
        rows = len(ends), free.shape[1] * free.shape[2], network.columns
        work = np.concatenate([work, free.reshape(rows)], axis=1)
    return W, acting, work


def constraints(network: Network, loads: Loads, kind: list[int]) -> np.ndarray:
    """Return A (K, joints, 6, 6 - freedoms): orthonormal wrenches about the origins of F2 that do
    no work in the motions of joints of one kind: rods, or with equally many rates."""
    if kind[0] in network.rods:
        gap = loads.origins[:, kind, 1] - loads.origins[:, kind, 0]
        return np.concatenate([np.zeros_like(gap), gap / lengths(gap)], axis=2)[..., None]
    rates = [[*range(own.start, own.stop)] for own in map(network.rates.__getitem__, kind)]
    return np.swapaxes(complement(np.swapaxes(loads.twists[:, np.array(rates, int)], 2, 3)), 2, 3)


def complement(columns: np.ndarray) -> np.ndarray:
    """Return orthonormal rows (..., 6 - k, 6) that are orthogonal to given independent columns
    (..., 6, k)."""
    Q = np.linalg.qr(columns, mode="complete")[0]
    return np.swapaxes(Q[..., columns.shape[-1] :], -1, -2)


def conjugate(twists: np.ndarray) -> np.ndarray:
    """Return P' (K, rates, 6): the moment about the axis of a turn, the force along a slide, that
    do unit work on a rate."""
    along = twists.copy()
    along[..., 3:] *= ~twists[..., :3].any(axis=2, keepdims=True)
    return along / np.maximum((along * along) @ np.ones((6, 1)), np.finfo(float).tiny)


def lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the lengths (..., 1) of vectors (..., n)."""
    return np.sqrt((vectors * vectors) @ np.ones((vectors.shape[-1], 1)))


def moved(wrench: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return wrenches (..., 6, columns) about another point: moment + r x force, r (..., 3) to the
    old point from the new."""
    found = wrench.copy()
    found[..., :3, :] += (r @ CROSS).reshape(*r.shape, 3) @ wrench[..., 3:, :]
    return found


def least_norm(B: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least y (K, n) that meets B y = c best, and N (K, n, s): orthonormal directions
    with B N = 0.

    Where a sample has fewer than s of them the other columns of N are zero.
    """
    n = B.shape[2]
    left, values, right = np.linalg.svd(B, full_matrices=n > B.shape[1])
    largest = values.max(axis=1, initial=0.0, keepdims=True)
    kept = values > DEPENDENT * largest
    inverse = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
    used = values.shape[1]
    y = times(
        np.swapaxes(right[:, :used], 1, 2), inverse * times(np.swapaxes(left[..., :used], 1, 2), c)
    )
    open_rows = np.concatenate([~kept, np.ones((len(B), n - used), bool)], axis=1)
    nullity = int(open_rows.sum(axis=1).max(initial=0))
    N = np.swapaxes(right * open_rows[..., None], 1, 2)[..., n - nullity :]
    return y, N


def times(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return A x for stacks of matrices and vectors."""
    return (A @ x[..., None])[..., 0]
