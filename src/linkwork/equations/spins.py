"""Spins: freedoms that turn a member about the line through its two joints and move nothing else.

A member is a chain of bodies between joints to two others; its own joints stay still while it
spins. It has to spin at all closed configurations around the reference, for in a single one other
joints may happen to be in line, and the mechanism has to have other freedoms beside its spins. What
an actuator drives is no spin. A spin is idle where no friction, spring, rotor, limit or fluid acts
on it either: it may then be left to itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import casadi as ca
import numpy as np

from linkwork.equations import contact, effects, fluid
from linkwork.equations.algebra import SX, cross
from linkwork.equations.joint_map import JointMap
from linkwork.equations.lengths import slides
from linkwork.equations.mobility import free_motions
from linkwork.equations.rubbing import rubbing
from linkwork.equations.tree import Node, Tree
from linkwork.mechanism import GROUND, Mechanism

LONGEST = 3  # joints inside a member that is looked at
STILL = 1e-9  # motion that counts as none, relative to the largest
NEARLY = 1 - 1e-6  # share of a motion in some bodies that may be all of it

Member = tuple[str, ...]


def spins(
    joints: JointMap, configurations: Sequence[np.ndarray], samples: Sequence[np.ndarray]
) -> tuple[dict[str, Member], tuple[str, ...]]:
    """Return the spins by name, the bodies of each, and the names of those that are idle.

    Args:
        configurations: closed ones around the reference (nq each); samples: Phi at each, in own
            units.
    """
    named = members(joints.mechanism)
    if not named:
        return {}, ()
    found, motions = spinning(joints.mechanism, joints.tree, tuple(named), configurations, samples)
    driven = moves(joints.tree, rate_rows(joints, joints.mechanism.actuators), configurations)
    free = apart([member for member, rates in found.items() if not driven(rates)])
    if not free or len(free) == motions:
        return {}, ()
    held = moves(joints.tree, loaded_rows(joints), configurations)
    idle = tuple(named[member] for member in free if not held(found[member]))
    return {named[member]: member for member in free}, idle


def members(mechanism: Mechanism) -> dict[Member, str]:
    """Return the chains of bodies between joints to two others, short ones first, and the names of
    their spins.

    None is ground, a branching body, or a tool's.
    """
    import networkx as nx

    graph, order = mechanism.graph(), list(mechanism.bodies).index
    hubs = {GROUND, *(tool.body for tool in mechanism.tools.values())}
    hubs |= {body for body in mechanism.bodies if graph.degree[body] > 2}  # pyright: ignore
    inner = nx.Graph(graph)
    inner.remove_nodes_from(hubs)
    chains = {
        tuple(sorted(path, key=order))
        for ends in nx.all_pairs_shortest_path(inner, cutoff=LONGEST)
        for path in dict(ends[1]).values()
    }
    found, rank = {}, list(mechanism.pairs).index
    for chain in sorted(chains, key=lambda chain: (len(chain), [order(name) for name in chain])):
        edges = graph.edges(chain, keys=True)  # pyright: ignore[reportCallIssue]
        outer = {name: body for *bodies, name in edges for body in bodies if body not in chain}
        if len(set(outer.values())) == 2:
            ends = sorted(outer, key=rank)
            found[chain] = (
                f"{' and '.join(chain)}: spin about the line through {' and '.join(ends)}"
            )
    return found


def spinning(
    mechanism: Mechanism,
    tree: Tree,
    chains: Sequence[Member],
    configurations: Sequence[np.ndarray],
    samples: Sequence[np.ndarray],
) -> tuple[dict[Member, list[np.ndarray]], int]:
    """Return the rates (nv) in which each chain spins alone at each configuration, and how many
    motions there are."""
    order, twists = list(mechanism.bodies).index, body_twists(mechanism, tree)
    found, motions = {chain: [] for chain in chains}, 0
    for q, Phi in zip(configurations, samples, strict=True):
        N = tree.rate_units[:, None] * free_motions(Phi)
        t, motions = np.array(twists(q, N)[0]).reshape(len(mechanism.bodies), 6, -1), N.shape[1]
        t[:, 3:] /= tree.length
        # Few chains can move while all else is still, and in few motions: those are looked at.
        basis, R = np.linalg.qr(t.reshape(-1, N.shape[1]))
        shares, back = basis.reshape(*t.shape[:2], -1), np.linalg.pinv(R)
        places = {chain: [order(body) for body in chain] for chain in found}
        turns = {chain: alone(t, own, within(shares[own], back)) for chain, own in places.items()}
        found = {
            chain: [*found[chain], N @ turn] for chain, turn in turns.items() if turn is not None
        }
        if not found:
            break
    return found, motions


def body_twists(mechanism: Mechanism, tree: Tree) -> Callable[..., Sequence[ca.DM]]:
    """Return the function (q, rates) -> [omega; v] (6r) of all bodies about the ground's origin, in
    the ground's axes."""
    rates = SX.sym("rates", len(tree.rates))
    omega = tree.angular_velocities(rates)
    v = tree.velocities(omega, rates)
    twists = [twist(tree.node(name), omega, v) for name in mechanism.bodies]
    return tree.evaluated("twists", [ca.vertcat(*twists)], inputs=[rates])


def twist(node: Node, omega: list[ca.SX], v: list[ca.SX]) -> ca.SX:
    """Return [omega; v] of a node's body about the ground's origin, in the ground's axes."""
    turn, slide = (ca.mtimes(node.axes.matrix, part[node.index]) for part in (omega, v))
    return ca.vertcat(turn, slide - cross(turn, node.O))


def within(shares: np.ndarray, back: np.ndarray) -> np.ndarray:
    """Return the motions (n x k) that are all but wholly in some bodies (b).

    Args:
        shares: the bodies' rows (b x 6 x n) of an orthonormal basis of all bodies' motions; back:
            combines the motions to that basis (n x n).
    """
    _, sizes, rows = np.linalg.svd(shares.reshape(-1, shares.shape[2]), full_matrices=False)
    return back @ rows[sizes > NEARLY].T


def alone(twists: np.ndarray, own: list[int], motions: np.ndarray) -> np.ndarray | None:
    """Return the motion (n) in which some bodies turn as one and all others stay still; None unless
    there is one alone.

    Args:
        twists: of all bodies (r x 6 x n) in n motions; own: places of the bodies that turn;
            motions: those of the n, combined (n x k), that may be it.
    """
    if not motions.size:
        return None
    told = twists @ motions
    still = np.concatenate([told[own] - told[own[0]], np.delete(told, own, axis=0)])
    _, sizes, rows = np.linalg.svd(still.reshape(-1, told.shape[2]), full_matrices=False)
    turn, least = motions @ rows[-1], STILL * np.linalg.norm(told)
    if np.sum(sizes <= least) != 1 or np.linalg.norm(told[own[0], :3] @ rows[-1]) <= least:
        return None
    return turn / np.linalg.norm(turn)


def moves(
    tree: Tree, rows: ca.SX, configurations: Sequence[np.ndarray]
) -> Callable[[list[np.ndarray]], bool]:
    """Return the test whether rates (nv) at the configurations, one for each, move any of the rows
    (rows x nv)."""
    read = tree.evaluated("rows", [rows])
    matrices = [np.array(read(q)[0]) for q in configurations]
    return lambda rates: any(
        not (np.abs(A @ w) <= STILL).all() for A, w in zip(matrices, rates, strict=True)
    )


def loaded_rows(joints: JointMap) -> ca.SX:
    """Return the rows (rows x nv) of what friction, springs, rotors, limits, bearings, contacts and
    a fluid act on.

    They are joint rates, relative rates of change of the lengths of springs between points, and
    velocities over the mechanism's own length where bodies may touch or a fluid acts, with the
    angular velocity there.
    """
    tree = joints.tree
    loaded = (*effects.freedoms(joints), *effects.lines(joints))
    labels = [rate for freedom in loaded for rate in freedom.rates]
    labels += [own.rate for own in rubbing(joints)]
    lengths = [ca.log(pull.length) for pull in effects.pulls(joints.mechanism, tree)]
    changes = ca.mtimes(ca.jacobian(ca.vertcat(SX(0, 1), *lengths), tree.q), tree.derivative_map)
    rates = SX.sym("rates", len(tree.rates))
    slides = [
        touch.apart(touch.touch.meeting.point) / tree.length
        for touch in contact.touching(joints.mechanism, tree, rates)
    ]
    for of in fluid.resisting(joints.mechanism, tree, rates):
        slides += of.motion[0], of.motion[1] / tree.length
    return ca.vertcat(
        rate_rows(joints, [*labels, *limited_rates(joints.mechanism)]),
        changes,
        ca.jacobian(ca.vertcat(SX(0, 1), *slides), rates),
    )


def rate_rows(joints: JointMap, labels: Sequence[str]) -> ca.SX:
    """Return the rows (rates x nv) of joint rates, those of slides over the mechanism's own
    length."""
    slide = slides(joints.mechanism)
    units = np.array([joints.tree.length if slide[label] else 1.0 for label in labels], float)
    return ca.mtimes(ca.diag(ca.DM(1 / units)), joints.rate_rows(labels))


def limited_rates(mechanism: Mechanism) -> Iterator[str]:
    """Yield the rates of joints' freedoms that have limits."""
    for name, joint in mechanism.joints.items():
        for part in joint.parts(name):
            yield from part.rates if part.effects.limits.bounded else ()


def apart(chains: Sequence[Member]) -> list[Member]:
    """Return the chains, in order, that share no body with one before them."""
    found: list[Member] = []
    for chain in chains:
        if not any(set(chain) & set(other) for other in found):
            found.append(chain)
    return found
