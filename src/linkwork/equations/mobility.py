"""Mobility: what the closure rows leave free, counted, named, and compared with Gruebler's formula.

    n = nv - rank Phi                       computed, at closed configurations
    n_G = d r - sum of (d - f_i) - gears    Gruebler: d = 6 (3 in the plane), r bodies,
                                            f_i freedoms of joint i

Where the geometry makes rows redundant n exceeds n_G.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX
from linkwork.equations.joints import KINDS, rows_of
from linkwork.equations.reflections import reflect
from linkwork.equations.topology import Topology
from linkwork.equations.tree import Tree
from linkwork.mechanism import GROUND, Mechanism, MechanismError, PairJoint

RANK = 1e-9
TURNS_OUT = 1e-9
LARGE = 200  # rates that rows couple, in which what is held still is looked for


def free_motions(Phi: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (nv x n) of the rates that Phi allows."""
    return reflect(Phi).null_space


def held_still(mechanism: Mechanism, tree: Tree, samples: np.ndarray) -> str:
    """Return the actuators, as words, none of whose tree joints moves by any motion that Phi
    (samples x rows x nv) allows; nothing where all move something, or there is one sample, which
    may be a dead centre.

    Rates that rows couple, one part of the mechanism each, are looked at by themselves; those of
    parts beyond LARGE are not, nor those that a lock holds, which is meant: a row of one rate.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    lines, held = mechanism.transmissions, np.zeros(len(tree.rates), bool)
    acted = {
        name: getattr(lines[name], "ratios", ()) if name in lines else (name,)
        for name in mechanism.actuators
    }
    driven = {label for labels in acted.values() for label in labels}
    coupled = np.any(np.abs(samples) > RANK, axis=0)
    ties = csr_array(coupled.astype(int))
    count, part = connected_components(ties.T @ ties, directed=False)
    for k in range(count) if len(samples) > 1 else ():
        own = np.flatnonzero(part == k)
        rows = coupled[:, own].any(axis=1)
        if len(own) <= LARGE and rows.any() and driven & {tree.rates[i] for i in own}:
            moving = [free_motions(Phi[rows][:, own]) for Phi in samples]
            held[own] = np.all([np.linalg.norm(N, axis=1) < RANK for N in moving], axis=0)
    held[coupled[coupled.sum(axis=1) == 1].any(axis=0)] = False
    still = {label for label, own in zip(tree.rates, held, strict=True) if own}
    names = [name for name, labels in acted.items() if labels and still.issuperset(labels)]
    return ", ".join(map(repr, names))


def gruebler(mechanism: Mechanism, planar: bool) -> int:
    """Return the mobility that Gruebler's formula gives."""
    space = 3 if planar else 6
    taken = sum(space - freedoms(joint, planar) for joint in mechanism.pairs.values())
    return space * len(mechanism.bodies) - taken - len(mechanism.gears)


def freedoms(joint: PairJoint, planar: bool) -> int:
    """Return the freedoms that a joint leaves its two bodies, in space or in the plane."""
    return KINDS[joint.type].in_plane if planar else 6 - len(rows_of(joint))


def refuse_locked(topology: Topology, tree: Tree, rows: Sequence[str], Phi: np.ndarray) -> None:
    """Refuse a mechanism without motion; the loop named is the one that takes the last freedom."""
    count, width = Phi.shape
    if count < width or np.linalg.matrix_rank(Phi, RANK) < width:
        return
    joints = [row.partition(": ")[0] for row in rows]
    locking = (k for k in range(count) if np.linalg.matrix_rank(Phi[: k + 1], RANK) == width)
    last = next(locking, count - 1)
    loop = loop_of(topology, joints[last]) if joints else ()
    cause = (
        f"the loop of {', '.join(loop)} leaves it no motion"
        if loop
        else "no joint lets a body move"
    )
    raise MechanismError(
        f"the mechanism has mobility 0: {cause}; add a joint or free one", ("joints",)
    )


def loop_of(topology: Topology, cut: str) -> tuple[str, ...]:
    """Return the joints of the loop that a cut joint closes, that joint last."""
    by_body = topology.by_body

    def chain(body: str) -> list[str]:
        joints = []
        while body != GROUND:
            joints.append(by_body[body].joint)
            body = by_body[body].parent
        return joints

    if cut not in topology.closing:
        return (cut,)
    first, second = (chain(body) for body in topology.closing[cut].connects)
    return tuple(
        dict.fromkeys(
            [*(name for name in first + second if (name in first) != (name in second)), cut]
        )
    )


def refuse_out_of_plane(
    mechanism: Mechanism, tree: Tree, configurations: list[np.ndarray], samples: list[np.ndarray]
) -> None:
    """Refuse a body that gives its inertia `zz` alone and can turn about another axis than its own
    z."""
    rates = SX.sym("rates", len(tree.rates))
    omega = tree.angular_velocities(rates)
    for name, body in mechanism.bodies.items():
        if not body.inertia.planar:
            continue
        node = tree.node(name)
        local = ca.sparsify(ca.mtimes(node.R.near.T, omega[node.index])[:2])
        if not local.nnz():
            continue
        if ca.depends_on(local, tree.p):
            raise MechanismError(
                "gives only zz, but free turns of frames may turn the body about other axes than "
                "its z; give xx, yy and zz",
                ("bodies", name, "inertia"),
            )
        turning = tree.evaluated("turning", [local], inputs=[rates])
        for q, Phi in zip(configurations, samples, strict=True):
            motions = tree.rate_units[:, None] * free_motions(Phi)
            if np.abs(np.array(turning(q, motions)[0])).max(initial=0.0) > TURNS_OUT:
                raise MechanismError(
                    "gives only zz, but the mechanism can turn the body about other axes than "
                    "its z; give xx, yy and zz",
                    ("bodies", name, "inertia"),
                )
