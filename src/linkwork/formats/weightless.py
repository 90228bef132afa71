"""Motions without mass: what a file lets move though nothing resists it, so that its acceleration
is not determined.

The generalised inertia at the reference, in the motions that loops and gears leave, is taken in
units in which that of each rate is 1; a motion for which it is rounding moves nothing. Joints that
only move so together are told together: of axes that coincide, or of one gear.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.sparse.csgraph import connected_components

from linkwork.equations.reference import described
from linkwork.formats.instant import Instant
from linkwork.formats.notes import Notes
from linkwork.mechanism import Cable, Mechanism
from linkwork.mechanism.joints import QUATERNION

NOISE = 1e-13  # least eigenvalue of M that is rounding, in units in which each rate's is 1
SURE = 1e-9  # least eigenvalue of M that no rounding of its sums makes up
DEPENDENT = 1e-9  # least singular value of rows of length 1 that is rounding
PART = 1e-6  # least part of a joint in a motion [1]
SHOWN = 4  # names in one sentence
AWAY = 0.3  # how far coordinates are moved to see whether no mass moves there, too [rad, m]


def tell(mechanism: Mechanism, place: str, notes: Notes) -> None:
    """Note the joints whose motion moves no mass."""
    groups = weightless(mechanism)
    alone = [names[0] for names in groups if len(names) == 1]
    if alone:
        notes.say(
            f"{place}: the motion of {_listed(alone)} moves no mass, and forces give it no "
            "acceleration; give what it moves mass and inertia, or the joint a rotor inertia",
            alters=True,
        )
    together = [names for names in groups if len(names) > 1]
    always = weightless(mechanism, AWAY) if together else []
    for names in together:
        where, more = "", ""
        if names not in always:
            where = " where the reference has them"
            more = ", or a reference in which their axes lie otherwise"
        notes.say(
            f"{place}: {_listed(names)} can move together{where} so that no mass moves, and forces "
            "give that motion no acceleration; give what they move mass and inertia, or the joints "
            f"rotor inertias{more}",
            alters=True,
        )


def _listed(names: list[str]) -> str:
    return ", ".join(map(repr, names[:SHOWN])) + (", ..." if len(names) > SHOWN else "")


def weightless(mechanism: Mechanism, away: float = 0.0) -> list[list[str]]:
    """Return the joints that let move what has no inertia, in groups that move together; away: how
    far each coordinate is from the reference."""
    instant = Instant.of(mechanism, _coordinates(mechanism, away))
    if not instant.rates:
        return []
    M, C = instant.inertia() + _unknown(mechanism, instant), instant.held()
    owners, owner = np.array(instant.joints), np.unique(instant.joints, return_inverse=True)[1]
    # Rates are coupled by M, by a row of C, and by being those of one joint.
    ties = vstack([csr_array(C != 0), csr_array(np.arange(owner.max() + 1)[:, None] == owner)])
    coupled = csr_array(M != 0) + ties.T @ ties
    order = {name: k for k, name in enumerate(mechanism.joints)}
    found = []
    for own in _parts(coupled):
        rows = C[:, own]
        Z = unresisted(M[np.ix_(own, own)], rows[rows.any(axis=1)])
        if not Z.size:
            continue
        # How much each joint has of such a motion, and each two of one.
        joints = np.unique(owners[own])
        sums = (joints[:, None] == owners[own]).astype(float)
        shares = sums @ (Z @ Z.T) ** 2 @ sums.T > PART**2
        moved = np.flatnonzero(shares.diagonal())
        for group in _parts(shares[np.ix_(moved, moved)]):
            told = [name for name in joints[moved[group]].tolist() if name in order]
            found += [sorted(told, key=order.__getitem__)] if told else []
    return sorted(found, key=lambda names: order[names[0]])


def unresisted(M: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return a basis of the motions  C w = 0,  w' M w = 0  in units in which M's diagonal is 1,
    orthonormal (n, k)."""
    size = np.sqrt(M.diagonal().clip(0))
    size[size == 0] = size[size > 0].min(initial=np.inf) if size.any() else 1.0
    M = M / size / size[:, None]
    if is_definite(M):
        return np.empty((len(M), 0))
    N = np.eye(len(M))
    if len(C):
        C = C / size
        _, s, Vt = np.linalg.svd(C / np.linalg.norm(C, axis=1, keepdims=True))
        N = Vt[int((s > DEPENDENT).sum()) :].T
    values, vectors = np.linalg.eigh(N.T @ M @ N)
    return N @ vectors[:, values < NOISE]


def is_definite(M: np.ndarray) -> bool:
    """Tell whether the least eigenvalue of M is surely no rounding: that of M in any motions of
    length 1 is no less (Cauchy's interlacing), so that those which loops leave need not be found.
    """
    try:
        np.linalg.cholesky(M - SURE * np.eye(len(M)))
    except np.linalg.LinAlgError:
        return False
    return True


def _parts(coupled: np.ndarray | csr_array) -> list[np.ndarray]:
    """Return the places of what is coupled, part by part."""
    count, part = connected_components(csr_array(coupled), directed=False)
    return [np.flatnonzero(part == k) for k in range(count)]


def _coordinates(mechanism: Mechanism, away: float) -> dict[str, float]:
    """Return the reference's joint coordinates, each but those of free turns moved so far by a step
    of its own."""
    values = described(mechanism)
    steps = away * np.random.default_rng(1).uniform(0.5, 1.5, len(values))
    for step, label in zip(steps, values, strict=True):
        values[label] += 0.0 if label.rpartition(".")[2] in QUATERNION else float(step)
    return values


def _unknown(mechanism: Mechanism, instant: Instant) -> np.ndarray:
    """Return an inertia of 1 for each body whose own a fluid or a cable adds to."""
    lines = mechanism.transmissions.values()
    bodies = {drag.body for drag in mechanism.drags.values()}
    bodies |= {
        body for line in lines if isinstance(line, Cable) and line.inertia for body in line.bodies
    }
    M = np.zeros((len(instant.rates),) * 2)
    for body in sorted(bodies & {*mechanism.bodies}):
        mover = instant.movers[body]
        J = mover.twists(instant.at[body][0])
        M[np.ix_(mover.places, mover.places)] += J @ J.T
    return M
