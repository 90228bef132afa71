"""Every joint kind on random frames: its rows, their derivatives, and its coordinates and rates, as
cut joint and in the tree.

A joint is put between bodies that move freely in space, by parallel hinges and a slide at the end;
poses come from the oracle's own words for each joint type, derivatives from CasADi's
differentiation of the rows along q' = N(q) w.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from linkwork.equations import body_motion, closure, cut_coordinates
from linkwork.equations.algebra import SX
from linkwork.equations.closure import Cut
from linkwork.equations.growing import grow
from linkwork.equations.reference import unit
from linkwork.equations.topology import span
from linkwork.equations.tree import Tree
from linkwork.mechanism import (
    Body,
    Frame,
    FreeJoint,
    Mechanism,
    PairJoint,
    PrismaticJoint,
    RevoluteJoint,
)

from tests.equations.evaluation import close
from tests.oracle import pairs
from tests.oracle.random_joints import FREEDOMS, random_joint, random_pose

SIDES = [
    ("a", "b"),
    ("b", "a"),
    ("ground", "a"),
    ("a", "ground"),
    ("ground", "b"),
]  # b hangs deeper than a
CHAINS = {"a": ("slide", "hinge"), "b": ("hinge", "slide", "hinge")}  # from the body inward
IN_TREE = [kind for kind in FREEDOMS[False] if kind != "rod"]
WITH_DIRECTIONS = ("fixed", "revolute", "prismatic", "screw", "cylindrical", "planar")

few = settings(max_examples=3, deadline=None, derandomize=True, phases=[Phase.generate])
seeds = st.integers(0, 99)
every_kind = pytest.mark.parametrize("kind", FREEDOMS[False])
random_frames = given(connects=st.sampled_from(SIDES), seed=seeds)


@dataclass(frozen=True)
class Closed:
    """Hold a cut joint, closed at q, where its coordinates are `coordinates`."""

    joint: PairJoint
    tree: Tree
    cut: Cut
    q: np.ndarray
    coordinates: np.ndarray

    def at(self, *expressions: ca.SX, q: np.ndarray | None = None) -> list[np.ndarray]:
        """Evaluate expressions of q."""
        return [
            np.array(value)
            for value in ca.Function("at", [self.tree.q], expressions).call(
                [self.q if q is None else q]
            )
        ]

    def along(self, expression: ca.SX, w: np.ndarray) -> ca.SX:
        """Return the time derivative of an expression of q for constant rates w."""
        return ca.jtimes(expression, self.tree.q, self.tree.derivatives(SX(w)))

    def phi(self) -> ca.SX:
        return column(closure.residuals(self.cut))

    def closed_rates(self, seed: int) -> np.ndarray:
        """Return random rates w with Phi w = 0."""
        (Phi,) = self.at(closure.jacobian(self.tree, self.cut))
        w = np.random.default_rng(seed).normal(size=Phi.shape[1])
        return w - np.linalg.lstsq(Phi, Phi @ w)[0] if len(Phi) else w


def column(values: list[ca.SX]) -> ca.SX:
    return ca.vertcat(SX.zeros(0, 1), *values)


@cache
def between_free_bodies(kind: str, connects: tuple[str, str], seed: int) -> Closed:
    """Put a joint between two bodies, or one and ground; both hang on hinges and slides, and these
    on a free joint."""
    rng = np.random.default_rng(seed)
    poses = {body: random_pose(rng, planar=False) for body in CHAINS}
    joint, coordinates = random_joint(
        rng, False, connects, kind, poses | {"ground": (np.zeros(3), np.eye(3))}
    )
    joints, values = {}, {}
    for body in CHAINS:
        for name, part, own in hung(rng, body, *poses[body]):
            joints[name] = part
            values |= dict(zip(part.coordinates(name), own, strict=True))
    mechanism = Mechanism(
        bodies={part.connects[1]: Body(mass=1) for part in joints.values()},
        joints=joints | {"cut": joint},
        actuators=tuple(
            part.rates(name)[0] for name, part in joints.items()
        ),  # which puts these into the tree
    )
    topology = span(mechanism)
    assert topology.cuts == ("cut",)
    tree = grow(mechanism, topology, {})
    q = np.array([values[label] for label in tree.coordinates])
    return Closed(joint, tree, closure.cut(tree, "cut", joint), q, coordinates)


def hung(rng: np.random.Generator, body: str, p: np.ndarray, R: np.ndarray):
    """Yield the joints that lead inward from a placed body to ground, each with its name and
    coordinates."""
    outer = body
    for k, kind in enumerate(CHAINS[body], start=1):
        inner, turn, along = f"{body}{k}", rng.uniform(-1, 1, 3), rng.uniform(-1, 1)
        frame = Frame(
            position=tuple(rng.uniform(-1, 1, 3)),
            rotation=(0, 0, turn[2]) if kind == "hinge" else tuple(turn),
        )
        part = (
            RevoluteJoint(
                connects=(inner, outer),
                frames=(frame, Frame()),
                axis=(0, 0, float(rng.choice([-1, 1]))),
            )
            if kind == "hinge"
            else PrismaticJoint(connects=(inner, outer), frames=(frame, Frame()), axis=(1, 0, 0))
        )
        R_12, p_12 = pairs.motion(part, [along])
        R_F = pairs.exponential(frame.rotation)
        R = R @ (R_F @ R_12).T
        p = p - R @ (frame.position + R_F @ p_12)
        yield f"{kind} {inner}", part, [along]
        outer = inner
    yield f"free {body}", FreeJoint(connects=("ground", outer)), [*p, *pairs.quaternion(R)]


@pytest.mark.long
@every_kind
@few
@random_frames
def test_rows_vanish_on_the_joints_own_motions_and_are_as_many_as_it_takes_freedoms(
    kind, connects, seed
):
    case = between_free_bodies(kind, connects, seed)
    phi, Phi, alignment = case.at(
        case.phi(), closure.jacobian(case.tree, case.cut), closure.alignment(case.cut)
    )
    assert len(case.cut.rows) == len(phi) == 6 - FREEDOMS[False][kind]
    assert len({row.name for row in case.cut.rows}) == len(phi)
    assert case.cut.swapped == (connects in (("b", "a"), ("a", "ground")))
    close(phi, np.zeros_like(phi), 1e-13)
    assert np.linalg.matrix_rank(Phi, tol=1e-6) == len(phi)
    assert alignment > 0


@every_kind
@few
@random_frames
def test_rows_do_not_vanish_elsewhere(kind, connects, seed):
    case = between_free_bodies(kind, connects, seed)
    rng = np.random.default_rng(seed)
    q = case.q.copy()
    first = case.tree.coordinates.index("free a.x" if "a" in connects else "free b.x")
    q[first : first + 3] += rng.uniform(0.1, 1, 3)
    q[first + 3 : first + 7] = pairs.quaternion(pairs.exponential(rng.normal(size=3)))
    (phi,) = case.at(case.phi(), q=q)
    assert (np.abs(phi) > 1e-6).all()


@every_kind
@few
@random_frames
def test_jacobian_is_the_derivative_of_the_rows(kind, connects, seed):
    case = between_free_bodies(kind, connects, seed)
    w = np.random.default_rng(seed).normal(size=len(case.tree.rates))
    Phi = closure.jacobian(case.tree, case.cut)
    rate, exact = case.at(ca.mtimes(Phi, w), case.along(case.phi(), w))
    close(rate, exact, 1e-12)
    h = 1e-5
    dq = np.array(ca.Function("dq", [case.tree.q], [case.tree.derivatives(SX(w))])(case.q)).ravel()
    (ahead,), (behind,) = (case.at(case.phi(), q=case.q + sign * h * dq) for sign in (1, -1))
    close(rate, (ahead - behind) / (2 * h), 1e-7)


@every_kind
@few
@random_frames
def test_open_jacobian_is_the_derivative_where_the_joint_is_open(kind, connects, seed):
    case = between_free_bodies(kind, connects, seed)
    random = np.random.default_rng(seed)
    w = random.normal(size=len(case.tree.rates))
    q = unit(case.tree, case.q + 0.1 * random.normal(size=case.q.size))
    found, exact = case.at(
        ca.mtimes(closure.open_jacobian(case.tree, case.cut), w), case.along(case.phi(), w), q=q
    )
    rows = [
        k for k, row in enumerate(case.cut.rows) if row.pitch is None
    ]  # a thread's: to first order only
    close(found[rows], exact[rows], 1e-12)


@every_kind
@few
@random_frames
def test_gamma_is_the_second_derivative_of_the_rows(kind, connects, seed):
    case = between_free_bodies(kind, connects, seed)
    w = case.closed_rates(seed)
    gamma = column(closure.biases(case.tree, case.cut, SX(w)))
    found, expected = case.at(gamma, case.along(case.along(case.phi(), w), w))
    close(found, expected, 1e-11)


@every_kind
@few
@random_frames
def test_coordinates_of_a_cut_joint_are_those_of_its_motion(kind, connects, seed):
    case = between_free_bodies(kind, connects, seed)
    (found,) = case.at(column(cut_coordinates.positions(case.cut)))
    close(found.ravel(), case.coordinates, 1e-12)  # within half a turn, quaternions with w > 0


@every_kind
@few
@random_frames
def test_rates_of_a_cut_joint_are_the_derivatives_of_its_coordinates(kind, connects, seed):
    case = between_free_bodies(kind, connects, seed)
    w = case.closed_rates(seed)
    positions, rows = (
        column(cut_coordinates.positions(case.cut)),
        cut_coordinates.rate_rows(case.tree, case.cut),
    )
    derivative, rates = (
        value.ravel() for value in case.at(case.along(positions, w), ca.mtimes(rows, w))
    )
    assert rates.size == len(case.joint.rates("cut"))
    close(derivative, coordinate_derivatives(case.joint, case.coordinates, rates), 1e-12)


def coordinate_derivatives(joint: PairJoint, q: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Return q' from a joint's rates: themselves, but p' = (0, omega) p / 2 of the unit quaternion
    p = (w, u) of R_12."""
    if "turn" not in joint.freedoms:
        return rates
    (w, *u), omega = q[-4:], rates[-3:]
    return np.concatenate([rates[:-3], [-omega @ u / 2], (w * omega + np.cross(omega, u)) / 2])


@pytest.mark.parametrize("kind", WITH_DIRECTIONS)
@few
@random_frames
def test_a_flipped_frame_is_told_from_one_that_agrees(kind, connects, seed):
    """Turn the second frame by pi about an axis across the joint's: all rows of a joint with a
    direction may vanish again."""
    case = between_free_bodies(kind, connects, seed)
    axis = np.array(getattr(case.joint, "axis", (0, 0, 1)))
    across = pairs.across(axis)[0]
    first, second = case.joint.frames
    R = pairs.exponential(second.rotation) @ pairs.turned(across, np.pi)
    flipped = case.joint.model_copy(
        update={
            "frames": (first, second.model_copy(update={"rotation": tuple(pairs.logarithm(R))}))
        }
    )
    (alignment,) = case.at(closure.alignment(closure.cut(case.tree, "cut", flipped)))
    assert alignment < -0.9


@pytest.mark.sample(10)
@pytest.mark.parametrize("kind", IN_TREE)
@pytest.mark.parametrize("backwards", [False, True], ids=["forwards", "backwards"])
@few
@given(seed=seeds)
def test_a_joint_of_the_tree_moves_its_body_as_the_oracle_says(kind, backwards, seed):
    """Pose from the coordinates; twist from the rates, by the derivative of the pose; p' =
    (0, omega) p / 2."""
    rng = np.random.default_rng(seed)
    connects = ("b", "a") if backwards else ("a", "b")
    poses = {body: random_pose(rng, planar=False) for body in ("a", "b")}
    joint, coordinates = random_joint(rng, False, connects, kind, poses)
    bodies = {"a": Body(mass=1), "b": Body(mass=1, centre_of_mass=tuple(rng.normal(size=3)))}
    mechanism = Mechanism(
        bodies=bodies, joints={"free": FreeJoint(connects=("ground", "a")), "joint": joint}
    )
    tree = grow(mechanism, span(mechanism), {})
    (p_a, R_a), (p, R) = poses["a"], poses["b"]
    q = np.concatenate([p_a, pairs.quaternion(R_a), coordinates])
    w, omega, v = SX.sym("w", len(tree.rates)), slice(6, 9), slice(9, 12)
    origins, orientations = body_motion.body_poses(mechanism, tree)
    twists = ca.mtimes(body_motion.body_jacobians(mechanism, tree), w)
    centre = tree.point(tree.node("b"), np.array(bodies["b"].centre_of_mass))
    dq = tree.derivatives(w)
    turning = ca.jtimes(ca.reshape(orientations[9:], 3, 3).T, tree.q, dq)
    evaluate = ca.Function(
        "b",
        [tree.q, w],
        [origins[3:], orientations[9:], twists, ca.jtimes(centre, tree.q, dq), turning, dq],
    )
    rates = rng.normal(size=len(tree.rates))
    found, R_found, t, moving, turning, dq = (np.array(value) for value in evaluate(q, rates))
    close(found.ravel(), p, 1e-13)
    close(R_found.reshape(3, 3), R, 1e-13)
    close(t[v], moving, 1e-12)
    close(turning @ R.T, np.cross(np.eye(3), t[omega].ravel()), 1e-12)
    close(dq[7:].ravel(), coordinate_derivatives(joint, coordinates, rates[6:]), 1e-14)
