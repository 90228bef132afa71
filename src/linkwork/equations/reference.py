"""The reference configuration: close the loops from the description's rough guess, and look around
it.

Choices that need numbers (which rows are redundant, in which order to eliminate) are made at the
closed reference configuration and at a few closed configurations near it, so that an accident of
one configuration decides nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, quaternion_matrix, rotation_matrix, turn_matrix
from linkwork.equations.joints import complete, motions_of
from linkwork.equations.lengths import held_lengths
from linkwork.equations.topology import Topology
from linkwork.equations.tree import Tree
from linkwork.mechanism import GROUND, Mechanism, MechanismError, PairJoint
from linkwork.mechanism.joints import TURN

CLOSED = 1e-12
NEIGHBOURS = 4
STARTS = 30
SPREAD = 0.05
# How far coordinates are moved out of a singular start, each several times.
BENDS = (
    0.1,
    0.2,
    0.4,
    0.8,
    1.6,
)
OPEN = 1e-9  # gap that rounding of large coordinates never excuses
DAMPING = 1e-6
"""Over the largest number of Phi: far above the rounding of inconsistent rows, far below what
matters."""
SINGULAR = (
    "the loops' equations are singular to working precision: their largest derivative is {:.3g} in "
    "the mechanism's own lengths; check for numbers that are far too large or too small, such as "
    "an inertia, a mass or a length in another unit"
)
ROUNDED_DAMPING = 1e-3  # the same where rounded numbers of the description make rows inconsistent

Matrix = np.ndarray | ca.DM
System = Callable[[np.ndarray], tuple[np.ndarray, Matrix, Matrix]]
Pose = tuple[np.ndarray, np.ndarray]


class OpenLoopsError(ArithmeticError):
    """Report that Newton's method does not close the loops; `worst` is the index of the row that
    stays most open."""

    def __init__(self, residual: np.ndarray):
        self.worst = int(np.argmax(np.abs(residual)))
        self.gap = float(np.abs(residual).max())
        super().__init__(f"row {self.worst} stays open by {self.gap:.3g}")


def close(
    system: System,
    tree: Tree,
    q: np.ndarray,
    steps: int = 100,
    gap: float = 0.0,
    damping: float = DAMPING,
) -> np.ndarray:
    """Solve phi(q) = 0 by damped Gauss-Newton steps of least length in the rates.

    Args:
        system: returns phi (rows), its derivative along the rates (rows x nv), and the map from
            rates to q' (nq x nv), the matrices dense or sparse; phi and the rates are in the
            mechanism's own units, lengths over its own.
        tree: says where unit quaternions are.
        q: start.
        steps: most steps to take.
        gap: that is small enough; no step is taken from there.
        damping: over the largest number of Phi; above the singular values that inconsistent rows
            have beyond their rank.

    Returns:
        q with max |phi| <= 1e-12 in the mechanism's own units, or gap; more only as far as the
        rounding of large q asks.

    Raises:
        OpenLoopsError: where no step reduces the residual further.
    """
    q, phi = led(system, tree, q, steps, gap, damping)
    # Large coordinates are rounded, and their gaps with them.
    rounding = 0.01 * np.abs(q / tree.units).max(initial=0.0)
    if not np.abs(phi).max(initial=0.0) <= max(gap, min(CLOSED * max(1.0, rounding), OPEN)):
        raise OpenLoopsError(phi)
    return q


def led(
    system: System,
    tree: Tree,
    q: np.ndarray,
    steps: int = 100,
    gap: float = 0.0,
    damping: float = DAMPING,
) -> tuple[np.ndarray, np.ndarray]:
    """Return q, and phi there, to which damped Gauss-Newton steps lead: closed, or where none
    reduces |phi| further. Arguments as of `close`."""
    # Newton's step of least length, not more than half a unit.
    q = unit(tree, q)
    phi, Phi, N = system(q)
    for _ in range(steps):
        size = np.abs(phi).max(initial=0.0)
        if gap and size <= gap:
            break
        step = least_step(Phi, phi, damping)
        step *= min(1.0, 0.5 / max(np.abs(step).max(initial=0.0), 1e-300))
        # Halved until the residual falls; where it does not the end is reached.
        for _ in range(12):
            trial = unit(tree, q + np.array(N @ step).ravel())
            phi_trial, Phi_trial, N_trial = system(trial)
            if np.linalg.norm(phi_trial) <= np.linalg.norm(phi) * (1 - 1e-4):
                break
            step = step / 2
        else:
            break
        q, phi, Phi, N = trial, phi_trial, Phi_trial, N_trial
        if size <= CLOSED:
            break
    return q, phi


def least_step(Phi: Matrix, phi: np.ndarray, damping: float = DAMPING) -> np.ndarray:
    """Return the shortest s (nv) of least |Phi s + phi|.

    For a sparse Phi by one sparse factorisation:  d s + Phi' r = 0,  Phi s - d r = -phi,  with a
    small damping d.

    Raises:
        MechanismError: it is singular to working precision, as where a description's numbers are
            many powers of ten apart.
    """
    if isinstance(Phi, np.ndarray):
        return -np.linalg.lstsq(Phi, phi, rcond=1e-9)[0]
    rows, nv = Phi.shape
    if not nv:
        return np.empty(0)
    largest = np.abs(Phi.nonzeros()).max(initial=0.0)
    d = damping * (largest or 1.0)
    A = ca.blockcat([[d * ca.DM.eye(nv), Phi.T], [Phi, -d * ca.DM.eye(rows)]])
    try:
        found = ca.solve(A, ca.vertcat(ca.DM.zeros(nv), -phi), "qr")
    except RuntimeError:
        raise MechanismError(SINGULAR.format(largest)) from None
    return np.array(found[:nv]).ravel()


def unit(tree: Tree, q: np.ndarray) -> np.ndarray:
    """Return a copy of q (..., nq) with its quaternions at length 1."""
    q = np.array(q, float)
    for places, _ in tree.quaternions:
        q[..., list(places)] /= np.linalg.norm(q[..., list(places)], axis=-1, keepdims=True)
    return q


def neighbours(
    system: System, tree: Tree, q: np.ndarray, gap: float = 0.0, damping: float = DAMPING
) -> list[np.ndarray]:
    """Return configurations near q (fixed seed), closed but for a gap, as many of the attempts as
    close."""
    random = np.random.default_rng(20100)
    found = []
    for _ in range(NEIGHBOURS):
        try:
            start = q + SPREAD * tree.units * random.standard_normal(q.size)
            found.append(close(system, tree, start, gap=gap, damping=damping))
        except OpenLoopsError:
            continue
    return found


def bends(tree: Tree, q: np.ndarray) -> Iterator[np.ndarray]:
    """Yield starts farther and farther from a singular one, such as a linkage that lies in a line
    (fixed seed)."""
    random = np.random.default_rng(1687)
    for spread in BENDS:
        for _ in range(NEIGHBOURS):
            yield q + spread * tree.units * random.standard_normal(q.size)


def guess(mechanism: Mechanism, topology: Topology, tree: Tree) -> np.ndarray:
    """Return q (nq) of the description's reference."""
    return tree_coordinates(mechanism, topology, tree, described(mechanism))


def starts(
    mechanism: Mechanism, topology: Topology, tree: Tree, first: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield starts q (nq) for closing the loops: the guess, then others in the poses of bodies that
    only rods reach.

    Nothing in the description says where these are; positions and orientations are tried at random
    (fixed seed).
    """
    yield first
    reached = body_poses(mechanism, described(mechanism))
    lost = [name for name in topology.added if topology.joints[name].connects[1] not in reached]
    random = np.random.default_rng(1998)
    size = max(held_lengths(mechanism.pairs.values()), default=tree.length)
    for _ in range(STARTS if lost else 0):
        q = first.copy()
        for name in lost:
            place = tree.places[f"{name}.x"]
            q[place : place + 7] = np.append(
                size * random.standard_normal(3), random.standard_normal(4)
            )
        yield q


def tree_coordinates(
    mechanism: Mechanism, topology: Topology, tree: Tree, values: Mapping[str, float]
) -> np.ndarray:
    """Return q (nq) from the coordinates of all joints; free joints that the description lacks
    follow from the others."""
    values = dict(values)
    if topology.added:
        from scipy.spatial.transform import Rotation

        poses = body_poses(mechanism, values)
        for name in topology.added:
            joint = topology.joints[name]
            p, R = poses.get(joint.connects[1], (np.zeros(3), np.eye(3)))
            x, y, z, w = Rotation.from_matrix(R).as_quat(canonical=True)
            values |= dict(zip(joint.coordinates(name), (*p, w, x, y, z), strict=True))
    return np.array([values[label] for label in tree.coordinates])


def described(mechanism: Mechanism) -> dict[str, float]:
    """Return all joint coordinates of the reference, by name: zero where left out, quaternions at
    length 1."""
    values = {label: mechanism.reference.get(label, 0.0) for label in mechanism.coordinates}
    parts = ((name, part) for name, joint in mechanism.pairs.items() for part in joint.parts(name))
    for name, labels in ((name, part.coordinates) for name, part in parts if part.name == TURN):
        p = np.array([values[label] for label in labels])
        if not any(label in mechanism.reference for label in labels):
            p = np.array([1.0, 0.0, 0.0, 0.0])
        length = float(np.linalg.norm(p))
        if length < 1e-12:
            raise MechanismError(
                f"the quaternion of joint {name!r} has no length; give qw, qx, qy, qz of length 1",
                ("reference",),
            )
        values |= dict(zip(labels, p / length, strict=True))
    return values


def body_poses(mechanism: Mechanism, values: dict[str, float]) -> dict[str, Pose]:
    """Return p_0B, R_0B of the bodies that joints other than rods reach from ground, for joint
    coordinates by name."""
    import networkx as nx

    graph, joints = mechanism.graph(), mechanism.pairs
    for name, joint in joints.items():
        if not complete(joint):
            graph.remove_edge(*joint.connects, key=name)
    poses: dict[str, Pose] = {GROUND: (np.zeros(3), np.eye(3))}
    for parent, body in nx.bfs_edges(graph, GROUND):
        name = next(iter(graph[parent][body]))
        joint = joints[name]
        own = np.array([values[label] for label in joint.coordinates(name)])
        poses[body] = across(joint, own, poses[parent], backwards=joint.connects[0] != parent)
    return poses


def across(joint: PairJoint, q: np.ndarray, pose: Pose, backwards: bool) -> Pose:
    """Return the pose of a joint's outer body from that of its inner one."""
    p_12, R_12 = displacement(joint, q)
    inner, outer = joint.frames
    if backwards:
        inner, outer, p_12, R_12 = outer, inner, -R_12.T @ p_12, R_12.T
    p, R = pose
    R_inner, R_outer = rotation_matrix(inner.orientation), rotation_matrix(outer.orientation)
    R_body = R @ R_inner @ R_12 @ R_outer.T
    origin = p + R @ (np.array(inner.position) + R_inner @ p_12)
    return origin - R_body @ np.array(outer.position), R_body


def displacement(joint: PairJoint, q: np.ndarray) -> Pose:
    """Return p_12, R_12 of a joint for its coordinates."""
    p, R, numbers = np.zeros(3), np.eye(3), list(q)
    for motion in motions_of(joint):
        own, numbers = numbers[: motion.coordinates], numbers[motion.coordinates :]
        if motion.ball:
            R = R @ np.array(ca.DM(quaternion_matrix(SX(np.array(own)))))
        else:
            p = p + R @ (motion.slide * own[0])
            R = R @ turn_matrix(motion.turn, own[0]) if motion.turns else R
    return p, R
