"""Spins: freedoms that turn a member about the line through its two joints and move nothing else.

A member is a chain of bodies between joints to two others; its own joints stay still while it
spins. It has to spin at all closed configurations around the reference, for in a single one other
joints may happen to be in line, and the mechanism has to have other freedoms beside its spins. What
an actuator drives is no spin. A spin is idle where no friction, spring, rotor, limit or fluid acts
on it either: it may then be left to itself.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from linkwork.equations import contact, effects, fluid
from linkwork.equations.algebra import SX, cross
from linkwork.equations.joint_map import JointMap
from linkwork.equations.lengths import slides
from linkwork.equations.reflections import reflect
from linkwork.equations.rubbing import rubbing
from linkwork.equations.tree import GROUND_NODE, Node, Tree
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
    places = {name: k for k, name in enumerate(mechanism.bodies)}
    twists = body_twists(mechanism, tree)
    found, count = {chain: [] for chain in chains}, 0
    for q, Phi in zip(configurations, samples, strict=True):
        free = motions(tree, Phi, places)
        t = np.array(twists(q, free.rates)[0]).reshape(len(places), 6, -1)
        t[:, 3:] /= tree.length
        turns: dict[Member, np.ndarray] = {}
        for part, (bodies, own) in looked_at(found, free).items():
            told = t[[places[name] for name in bodies], :, : free.counts[part]]
            N = np.where(free.of_rates == part, free.rates.T, 0.0).T[:, : free.counts[part]]
            turns |= {chain: N @ turn for chain, turn in turning_alone(told, bodies, own).items()}
        count = int(free.counts.sum())
        found = {chain: [*found[chain], turn] for chain, turn in turns.items()}
        if not found:
            break
    return found, count


class Motions(NamedTuple):
    """Hold a basis of the rates that Phi allows, part by part: of parts of the mechanism that no
    body and no row ties, so that each moves by itself.

    rates (nv x k): the k-th motions of all parts in one column, each in its own rates
    counts: motions of each part; of_rates (nv), of_bodies: whose rate it is, and who moves a body,
        None for one that stands still
    """

    rates: np.ndarray
    counts: np.ndarray
    of_rates: np.ndarray
    of_bodies: dict[str, int | None]


def motions(tree: Tree, Phi: np.ndarray, bodies: Iterable[str]) -> Motions:
    """Return what Phi (rows x nv) leaves free, and who moves the bodies; slides in m."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    # Rates are tied by rows that hold both, and those of a node to those of the node before it.
    last: dict[int, int | None] = {GROUND_NODE.index: None}
    ties = [(int(k[0]), int(other)) for k in map(np.flatnonzero, Phi) for other in k[1:]]
    for node in tree.nodes:
        before, own = last[node.parent], [column.rate for column in node.columns]
        ties += [] if before is None else [(before, k) for k in own]
        ties += [(own[0], k) for k in own[1:]]
        last[node.index] = own[-1] if own else before
    ends = np.array(ties, int).reshape(-1, 2).T
    links = csr_array((np.ones(len(ties)), ends), shape=(len(tree.rates),) * 2)
    parts, of_rates = connected_components(links, directed=False)
    # Reflections stay in a part, so that those of one motion of each are those of their sum.
    found, counts = reflect(Phi), np.zeros(parts, int)
    units = []
    for k in np.delete(np.arange(len(tree.rates)), found.pivots):
        units.append((k, counts[of_rates[k]]))
        counts[of_rates[k]] += 1
    basis = np.zeros((len(tree.rates), counts.max(initial=0)))
    basis[tuple(np.array(units, int).reshape(-1, 2).T)] = 1.0
    moving = {name: last[tree.node(name).index] for name in bodies}
    of_bodies = {name: None if k is None else int(of_rates[k]) for name, k in moving.items()}
    return Motions(tree.rate_units[:, None] * found.mirrored(basis), counts, of_rates, of_bodies)


def looked_at(chains: Iterable[Member], free: Motions) -> dict[int, tuple[list[str], list[Member]]]:
    """Return the bodies, and those of the chains that move with them, of each part that moves."""
    bodies: dict[int, list[str]] = defaultdict(list)
    for name, part in free.of_bodies.items():
        if part is not None:
            bodies[part].append(name)
    found: dict[int, tuple[list[str], list[Member]]] = {}
    for chain in chains:
        part, *others = {free.of_bodies[body] for body in chain}
        if part is not None and not others and free.counts[part]:
            found.setdefault(part, (bodies[part], []))[1].append(chain)
    return found


def turning_alone(
    t: np.ndarray, bodies: Sequence[str], chains: Sequence[Member]
) -> dict[Member, np.ndarray]:
    """Return the motion (n) in which each chain turns while all else is still, of those that do.

    Args:
        t: twists of the bodies (r x 6 x n) in n motions.
    """
    # Few chains can move while all else is still, and in few motions: those are looked at.
    basis, R = np.linalg.qr(t.reshape(-1, t.shape[2]))
    shares, back = basis.reshape(*t.shape[:2], -1), np.linalg.pinv(R)
    places = {name: k for k, name in enumerate(bodies)}
    own = {chain: [places[body] for body in chain] for chain in chains}
    turns = {chain: alone(t, at, within(shares[at], back)) for chain, at in own.items()}
    return {chain: turn for chain, turn in turns.items() if turn is not None}


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
