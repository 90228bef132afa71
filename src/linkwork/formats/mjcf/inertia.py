"""The generalised inertia of an MJCF tree at qpos0, by which MuJoCo's compiler makes springs,
dampers and gains: `springdamper` of joints (`spring_dampers`), `dampratio` of servos."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from linkwork.equations.cables import way
from linkwork.equations.displacements import measured
from linkwork.formats import poses
from linkwork.formats.mjcf.tree import FREEDOMS, ModelTree
from linkwork.mechanism import GROUND, Cable, Displacement, SliderCrank, Thrust


def inertia(tree: ModelTree) -> tuple[np.ndarray, list[range]]:
    """Return the generalised inertia of all bodies at qpos0, loops left open, and the places of
    the rates of each joint in the file's order.

    M = sum_i J_i' diag(I_i, m_i 1) J_i + armatures,    J_i: rates -> [omega; v of the mass centre]
    """
    rotors: list[float] = []
    places: list[range] = []
    for _, piece in tree.pieces():
        count = FREEDOMS[piece.kind]
        places.append(range(len(rotors), len(rotors) + count))
        rotors += [piece.rotor] * count
    at, M = tree.poses(), np.diag(np.array(rotors, float))
    for name, J in jacobians(tree).items():
        solid = tree.nodes[name].solid.seen(at[name])
        M = M + J[:3].T @ solid.inertia @ J[:3] + solid.mass * J[3:].T @ J[3:]
    return M, places


def first_rates(tree: ModelTree, places: Sequence[range]) -> dict[str | None, int]:
    """Return the place of each joint's first rate, by its name; places: of all of its rates, in the
    file's order."""
    return {piece.name: own.start for (_, piece), own in zip(tree.pieces(), places, strict=True)}


def with_lines(
    M: np.ndarray, tree: ModelTree, lines: Sequence[tuple[float, np.ndarray]]
) -> np.ndarray:
    """Return M (nv, nv) with what is inert along lines, each with its inertia and J (nv) of
    l' = J w: of J' J only what stands in MuJoCo's inertia matrix."""
    if lines:
        kept = coupled(tree)
        for armature, J in lines:
            M = M + armature * kept * np.outer(J, J)
    return M


def coupled(tree: ModelTree) -> np.ndarray:
    """Tell of each pair of rates whether the one moves the other's body, so that MuJoCo's inertia
    matrix has an entry for it (nv, nv)."""
    owners = [node.name for node, piece in tree.pieces() for _ in range(FREEDOMS[piece.kind])]
    above = {name: {node.name for node in tree.chain(name)} for name in {*owners}}
    return np.array([[i in above[j] or j in above[i] for i in owners] for j in owners], dtype=bool)


def jacobians(tree: ModelTree, origins: bool = False) -> dict[str, np.ndarray]:
    """Return J_i (6, nv): rates -> [omega; v of the mass centre] of all bodies at qpos0; origins: v
    of the frame's origin instead."""
    # What each rate moves: everything on its body, about an axis through a point or along one.
    at, columns, count = tree.poses(), {name: [] for name in tree.nodes}, 0
    for node, piece in tree.pieces():
        R = at[node.name][:3, :3]
        point = poses.point(at[node.name], piece.anchor)
        slides = {"slide": [R @ piece.axis], "free": list(np.eye(3))}.get(piece.kind, [])
        turns = {"slide": [], "hinge": [R @ piece.axis]}.get(piece.kind, list(R.T))
        for axis, turning in [*((s, False) for s in slides), *((t, True) for t in turns)]:
            columns[node.name].append((count, axis, turning, point))
            count += 1
    # Each body by the rates of all that it hangs on.
    found = {}
    for name, node in tree.nodes.items():
        centre = at[name][:3, 3] if origins else poses.point(at[name], node.solid.centre)
        found[name] = J = np.zeros((6, count))
        for other in tree.chain(name):
            for place, axis, turning, point in columns[other.name]:
                moved = np.cross(axis, centre - point) if turning else axis
                J[:, place] = [*(axis if turning else np.zeros(3)), *moved]
    return found


def along(line: Cable | SliderCrank | Displacement | Thrust, tree: ModelTree) -> np.ndarray:
    """Return J (nv) of l' = J w of a thrust, or of what is measured between bodies, at qpos0."""
    at, moving = tree.poses(), jacobians(tree, origins=True)
    if isinstance(line, Thrust):
        point, force = np.array(line.point), np.array(line.force)
        wrench = np.array([line.moment + np.cross(point, force), force])
        return (wrench @ at[line.body][:3, :3].T).ravel() @ moving[line.body]

    def place(body: str) -> tuple[ca.SX, ca.SX]:
        X = np.eye(4) if body == GROUND else at[body]
        return ca.SX(X[:3, :3]), ca.SX(X[:3, 3])

    # Forces on bodies, about the origins of their frames.
    found = way(line, place) if isinstance(line, Cable) else measured(line, place)
    parts = (
        np.array(ca.DM(wrench)).ravel() @ moving[body]
        for body, wrench in found.wrenches(place)
        if body != GROUND
    )
    return sum(parts, np.zeros(sum(FREEDOMS[piece.kind] for _, piece in tree.pieces())))


def moved_by(M: np.ndarray, J: np.ndarray) -> np.ndarray | None:
    """Return the accelerations M^-1 J' (nv) by a unit force along J (nv), or None where J moves
    what has no mass."""
    try:
        return np.linalg.solve(M, J)
    except np.linalg.LinAlgError:
        moved, *_ = np.linalg.lstsq(M, J)
        return moved if np.allclose(M @ moved, J) else None


def mobility(M: np.ndarray, J: np.ndarray) -> float:
    """Return J M^-1 J', infinite where J moves what has no mass."""
    moved = moved_by(M, J)
    return float("inf") if moved is None else float(J @ moved)
