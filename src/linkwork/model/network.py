"""The joints' graph, and the wrenches that balance every body on it.

A spanning tree of the joints reaches every body; the others close loops. A closing joint brings
[moment about the origin of F2; force] to its second body and takes it from its first,

    W = A lambda + P (f + G' mu)

A: wrenches that do no work in its motion, P: force on each of its rates, f: actuators, friction,
springs and rotors, G, mu: slopes and multipliers of the gears. What a body needs beyond that its
joint of the tree brings, from the ends of the tree inward; this joint's own motion S then gives the
conditions on lambda and mu,  S' W = f + G' mu.

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
from linkwork.equations.joints import held_length
from linkwork.equations.topology import Rim
from linkwork.mechanism import GROUND, Mechanism

DEPENDENT = 1e-9  # singular values below this part of the largest count as zero


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
    joint; rods: places of rods; geared: gear and rate of each coordinate of each gear
    """

    joints: tuple[str, ...]
    pairs: tuple[tuple[int, int], ...]
    rates: tuple[slice, ...]
    rods: frozenset[int]
    branches: tuple[TreeJoint, ...]
    closing: tuple[int, ...]
    gears: int
    geared: tuple[tuple[int, int], ...]

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
        labels, gears = mechanism.rates, mechanism.gears.values()
        geared = tuple(
            (k, labels.index(label)) for k, gear in enumerate(gears) for label in gear.ratios
        )
        names = tuple(mechanism.pairs)
        return cls(names, pairs, rates, rods, tuple(branches), closing, len(gears), geared)

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
        slopes of the gears (K, gears, m)
    """

    needed: np.ndarray
    centres: np.ndarray
    origins: np.ndarray
    twists: np.ndarray
    f: np.ndarray
    G: np.ndarray


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
    constraint = W - acting
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
    """Return every joint's W (K, J, 6, columns), P (f + G' mu) likewise, and S' W - f - G' mu of
    the tree (K, e, columns).

    The columns: what is known, then the factors of lambda and of mu.
    """
    count, columns = len(loads.f), network.columns
    W = np.zeros((count, len(network.pairs), 6, columns))
    acting, conditions = np.zeros_like(W), [np.zeros((count, 0, columns))]
    needed = np.zeros((count, loads.needed.shape[1], 6, columns))
    needed[..., 0] = loads.needed
    pushes = np.zeros((*loads.f.shape, columns))  # f + G' mu
    pushes[..., 0], pushes[..., columns - network.gears :] = loads.f, np.swapaxes(loads.G, 1, 2)
    for k, rates in enumerate(network.rates):
        acting[:, k] = np.swapaxes(conjugate(loads.twists[:, rates]), 1, 2) @ pushes[:, rates]

    def add(body: int, wrench: np.ndarray, point: np.ndarray, sign: int) -> None:
        if body >= 0:
            needed[:, body] += sign * moved(wrench, point - loads.centres[:, body])

    for k in network.closing:
        W[:, k] = acting[:, k]
        W[:, k, :, network.unknowns[k]] += constraints(network, loads, k)
        for body, sign in zip(network.pairs[k], (1, -1), strict=True):
            add(body, W[:, k], loads.origins[:, k, 1], sign)
    for branch in reversed(network.branches):
        k, brought = branch.joint, needed[:, branch.body]
        centre = loads.centres[:, branch.body]
        W[:, k] = (1 if branch.forward else -1) * moved(brought, centre - loads.origins[:, k, 1])
        add(branch.parent, brought, centre, 1)
        S, given = motions(network, loads, k), pushes[:, network.rates[k]]
        work = S @ W[:, k]
        work[:, : given.shape[1]] -= given
        conditions.append(work / np.linalg.norm(S, axis=2, keepdims=True))
    return W, acting, np.concatenate(conditions, axis=1)


def motions(network: Network, loads: Loads, k: int) -> np.ndarray:
    """Return S' (K, freedoms, 6): the twists of F2 in F1 that a joint allows; a rod's have no
    rates."""
    if k not in network.rods:
        return loads.twists[:, network.rates[k]]
    return complement(constraints(network, loads, k))


def constraints(network: Network, loads: Loads, k: int) -> np.ndarray:
    """Return A (K, 6, 6 - freedoms): orthonormal wrenches about the origin of F2 that do no work in
    a joint's motion."""
    if k in network.rods:
        gap = loads.origins[:, k, 1] - loads.origins[:, k, 0]
        direction = gap / np.linalg.norm(gap, axis=1, keepdims=True)
        return np.concatenate([np.zeros_like(gap), direction], axis=1)[..., None]
    return np.swapaxes(complement(np.swapaxes(motions(network, loads, k), 1, 2)), 1, 2)


def complement(columns: np.ndarray) -> np.ndarray:
    """Return orthonormal rows (K, 6 - k, 6) that are orthogonal to given independent columns
    (K, 6, k)."""
    Q = np.linalg.qr(columns, mode="complete")[0]
    return np.swapaxes(Q[..., columns.shape[2] :], 1, 2)


def conjugate(twists: np.ndarray) -> np.ndarray:
    """Return P' (K, rates, 6): the moment about the axis of a turn, the force along a slide, that
    do unit work on a rate."""
    turns = np.linalg.norm(twists[..., :3], axis=2, keepdims=True) > 0
    along = np.where(turns, twists * np.repeat([1.0, 0.0], 3), twists)
    return along / np.maximum(np.sum(along**2, axis=2, keepdims=True), np.finfo(float).tiny)


def moved(wrench: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return wrenches (K, 6, columns) about another point: moment + r x force, r (K, 3) to the old
    point from the new."""
    moment, force = wrench[:, :3], wrench[:, 3:]
    x, y, z = (r[:, i, None] for i in range(3))
    turned = [
        y * force[:, 2] - z * force[:, 1],
        z * force[:, 0] - x * force[:, 2],
        x * force[:, 1] - y * force[:, 0],
    ]
    return np.concatenate([moment + np.stack(turned, axis=1), force], axis=1)


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
