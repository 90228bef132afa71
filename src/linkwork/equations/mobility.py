"""Mobility: what the closure rows leave free, counted, named, and compared with Gruebler's formula.

    n = nv - rank Phi                          computed, at closed configurations
    n_G = d r - sum of (d - f_i) - gears       Gruebler: d = 6 (3 in the plane), r bodies, f_i freedoms of joint i

Where the geometry makes rows redundant n exceeds n_G. An idle freedom turns a member about the line through its two
joints and moves nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
import numpy as np

from linkwork.equations.reflections import reflect
from linkwork.equations.topology import Topology
from linkwork.equations.tree import Tree
from linkwork.mechanism import GROUND, Mechanism, MechanismError, PairJoint, RodJoint

RANK = 1e-9
LONGEST = 3  # joints inside a member that is looked at for idle freedoms
IN_PLANE = {"fixed": 0, "planar": 3, "free": 3, "rod": 2}


def free_motions(Phi: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (nv x n) of the rates that Phi allows."""
    return reflect(Phi).null_space


def gruebler(mechanism: Mechanism, planar: bool) -> int:
    """Return the mobility that Gruebler's formula gives."""
    space = 3 if planar else 6
    taken = sum(space - freedoms(name, joint, planar) for name, joint in mechanism.pairs.items())
    return space * len(mechanism.bodies) - taken - len(mechanism.gears)


def freedoms(name: str, joint: PairJoint, planar: bool) -> int:
    """Return the freedoms that a joint leaves its two bodies, in space or in the plane."""
    if planar:
        return IN_PLANE.get(joint.type, 1)
    return 5 if isinstance(joint, RodJoint) else len(joint.rates(name))


def refuse_locked(topology: Topology, tree: Tree, rows: Sequence[str], Phi: np.ndarray) -> None:
    """Refuse a mechanism without motion; the loop named is the one that takes the last freedom."""
    if len(Phi) < Phi.shape[1] or np.linalg.matrix_rank(Phi, RANK) < Phi.shape[1]:
        return
    joints = [row.partition(": ")[0] for row in rows]
    last = next(
        (k for k in range(len(joints)) if np.linalg.matrix_rank(Phi[: k + 1], RANK) == Phi.shape[1]), len(joints) - 1
    )
    loop = loop_of(topology, joints[last]) if joints else ()
    cause = f"the loop of {', '.join(loop)} leaves it no motion" if loop else "no joint lets a body move"
    raise MechanismError(f"the mechanism has mobility 0: {cause}; add a joint or free one", ("joints",))


def loop_of(topology: Topology, cut: str) -> tuple[str, ...]:
    """Return the joints of the loop that a cut joint closes, that joint last."""
    by_body = {branch.body: branch for branch in topology.branches}

    def chain(body: str) -> list[str]:
        joints = []
        while body != GROUND:
            joints.append(by_body[body].joint)
            body = by_body[body].parent
        return joints

    if cut not in topology.closing:
        return (cut,)
    first, second = (chain(body) for body in topology.closing[cut].connects)
    return tuple(dict.fromkeys([*(name for name in first + second if (name in first) != (name in second)), cut]))


def idle_freedoms(mechanism: Mechanism, twists: np.ndarray) -> tuple[str, ...]:
    """Name the freedoms that turn a member about the line through its two joints and move nothing else.

    A member is a chain of bodies between two joints to others; its own joints stay still.

    Args:
        twists: of all bodies about the ground's origin in motions that span those the loops allow (r x 6 x n).
    """
    index = {name: i for i, name in enumerate(mechanism.bodies)}
    graph, order = mechanism.graph(), list(mechanism.pairs).index
    found: dict[tuple[str, ...], str] = {}
    for member in members(mechanism):
        edges = graph.edges(member, keys=True)  # pyright: ignore[reportCallIssue]
        ends = sorted((name for *bodies, name in edges if not set(bodies) <= set(member)), key=order)
        if len(ends) < 2 or any(set(other) & set(member) for other in found):
            continue
        own = [index[name] for name in member]
        first, together, others = twists[own[0]], twists[own[1:]] - twists[own[0]], np.delete(twists, own, axis=0)
        still = np.concatenate([np.zeros((1, *first.shape)), others, together]).reshape(-1, first.shape[1])
        if np.linalg.matrix_rank(np.vstack([still, first]), RANK) == np.linalg.matrix_rank(still, RANK) + 1:
            found[member] = f"{' and '.join(member)}: spin about the line through {' and '.join(ends)}"
    return tuple(found.values())


def members(mechanism: Mechanism) -> list[tuple[str, ...]]:
    """Return the chains of bodies, short ones first, between ground, branching bodies and the tools' bodies."""
    graph = nx.Graph(mechanism.graph())
    degree = mechanism.graph().degree
    hubs = {GROUND, *(tool.body for tool in mechanism.tools.values())}
    hubs |= {body for body in mechanism.bodies if degree[body] > 2}  # pyright: ignore[reportArgumentType]
    graph.remove_nodes_from(hubs)
    order = list(mechanism.bodies).index
    chains = {
        tuple(sorted(path, key=order))
        for ends in nx.all_pairs_shortest_path(graph, cutoff=LONGEST)
        for path in dict(ends[1]).values()
    }
    return sorted(chains, key=lambda chain: (len(chain), [order(name) for name in chain]))
