"""The oracle of all joint types against closed forms and the older oracle; what it refuses."""

from __future__ import annotations

from functools import partial
from math import atan2, cos, sin, sqrt, tan

import numpy as np
import pytest

from linkwork.mechanism import (
    Body,
    Frame,
    FreeJoint,
    Friction,
    GearJoint,
    Inertia,
    Mechanism,
    PlanarJoint,
    PointSpring,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    SphericalJoint,
    Spring,
    UniversalJoint,
)

from tests.oracle import LagrangeOracle, OracleError, pairs, random_mechanisms
from tests.oracle.closed_forms import DOWN, DoublePendulum, Pendulum, SliderCrank
from tests.oracle.maximal import MaximalOracle
from tests.oracle.test_pairs import close

g = 9.81


def body(mass: float, *moments: float, at=(0.0, 0.0, 0.0)) -> Body:
    return Body(
        mass=mass,
        centre_of_mass=at,
        inertia=Inertia(**dict(zip(("xx", "yy", "zz"), moments, strict=True))),
    )


def state(mechanism: Mechanism, coordinates, rates):
    """Return the oracle, poses and twists of a mechanism at joint coordinates and rates in their
    order."""
    shown = dict(zip(mechanism.coordinates, coordinates, strict=True))
    oracle = MaximalOracle(mechanism, {name: float(value) for name, value in shown.items()})
    poses = oracle.assemble(oracle.poses(shown))
    return oracle, poses, oracle.twists(poses, dict(zip(mechanism.rates, rates, strict=True)))


def accelerations(mechanism: Mechanism, coordinates, rates, forces=()) -> np.ndarray:
    """Return the joint accelerations there, the forces those of the actuators."""
    oracle, poses, twists = state(mechanism, coordinates, rates)
    return oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, forces))


def test_pendulum_in_a_tilted_plane():
    pendulum = Pendulum()
    tau = pendulum.force(0.8, 1.7, -2.3)
    close(accelerations(pendulum.mechanism(), [0.8], [1.7], [tau]), [-2.3], 1e-13)


def test_double_pendulum():
    pendulum = DoublePendulum()
    for q, rates, wanted in np.random.default_rng(3).normal(size=(5, 3, 2)):
        tau = pendulum.force(q, rates, wanted)
        close(accelerations(pendulum.mechanism(), q, rates, tau), wanted, 1e-12)


def test_slider_crank():
    crank = SliderCrank()
    mechanism = crank.mechanism()
    for theta, rate, wanted in np.random.default_rng(4).normal(scale=2, size=(5, 3)):
        oracle = MaximalOracle(mechanism)
        poses = oracle.poses(
            dict(zip(mechanism.coordinates, crank.coordinates(theta), strict=True))
        )
        assert oracle.mobility(poses) == 1
        twists = oracle.twists(poses, {"main": rate})
        tau = crank.force(theta, rate, wanted)
        found = oracle.accelerations(poses, twists, [tau])
        close(oracle.joint_accelerations(poses, twists, found)[0], wanted, 1e-11)
        close(
            oracle.inverse_dynamics(
                poses, twists, oracle.accelerations_of(poses, twists, {"main": wanted})
            ),
            [tau],
            1e-11,
        )


def test_bead_on_a_turning_rod():
    """(J + I + m r^2) theta'' + 2 m r r' theta' = tau and m (r'' - r theta'^2) = F."""
    J, m, I = 0.4, 1.3, 0.05  # noqa: E741
    mechanism = Mechanism(
        gravity=(0, 0, -g),
        bodies={"rod": body(2, J, J, J), "bead": body(m, I, I, I)},
        joints={
            "pivot": RevoluteJoint(connects=("rod", "ground"), axis=(0, 0, -1)),  # backwards
            "bead": PrismaticJoint(connects=("rod", "bead"), axis=(1, 0, 0)),
        },
        actuators=("pivot", "bead"),
    )
    theta, r, omega, v, tau, F = 0.7, 0.6, 1.9, -0.8, 0.3, 0.5
    expected = [(tau - 2 * m * r * v * omega) / (J + I + m * r**2), F / m + r * omega**2]
    close(accelerations(mechanism, [theta, r], [omega, v], [tau, F]), expected, 1e-13)


def test_screw_with_every_effect_of_a_joint():
    """(I + m h^2 + J) q'' = tau - m g h - k (q - rest) - (c + d + F / sqrt(q'^2 + r^2)) q'."""
    m, I, h, J = 1.2, 0.3, 0.2, 0.15  # noqa: E741
    k, rest, c, d, F, r = 4.0, 0.5, 0.7, 0.4, 0.6, 0.1
    nut = ScrewJoint(
        connects=("ground", "nut"),
        pitch=h,
        friction=Friction(viscous=c, coulomb=F, coulomb_rate=r),
        spring=Spring(stiffness=k, rest=rest, damping=d),
        rotor_inertia=J,
    )
    mechanism = Mechanism(bodies={"nut": body(m, I, I, I)}, joints={"nut": nut}, actuators=("nut",))
    q, w, tau = 9.5, 1.1, 0.9  # more than one turn
    push = tau - m * g * h - k * (q - rest) - (c + d + F / sqrt(w**2 + r**2)) * w
    close(accelerations(mechanism, [q], [w], [tau]), [push / (I + m * h**2 + J)], 1e-13)
    oracle, poses, twists = state(mechanism, [q], [w])
    close(oracle.coordinates(poses), [q], 1e-14)
    close(
        oracle.energy(poses, twists),
        [(I + m * h**2 + J) * w**2 / 2, m * g * h * q + k * (q - rest) ** 2 / 2],
        1e-14,
    )
    close(
        oracle.power(poses, twists, [tau]), tau * w - (c + d + F / sqrt(w**2 + r**2)) * w**2, 1e-14
    )


def test_rotor_between_two_turning_bodies():
    """With w_2 relative: d/dt of the gradients of I_1 w_1^2/2 + I_2 (w_1 + w_2)^2/2 + J w_2^2/2 are
    the torques."""
    I_1, I_2, J, torques = 0.5, 0.3, 0.8, np.array([0.4, -0.9])
    mechanism = Mechanism(
        bodies={"one": body(1, 1, 1, I_1), "two": body(1, 1, 1, I_2)},
        joints={
            "a": RevoluteJoint(connects=("ground", "one")),
            "b": RevoluteJoint(connects=("one", "two"), rotor_inertia=J),
        },
        actuators=("a", "b"),
    )
    M = np.array([[I_1 + I_2, I_2], [I_2, I_2 + J]])
    close(accelerations(mechanism, [0.3, 0.4], [1, 2], torques), np.linalg.solve(M, torques), 1e-13)


def test_spinning_top_precesses_steadily():
    """I_1 Omega^2 cos(theta) - I_3 omega_3 Omega + m g l = 0 keeps theta: then omega' = Omega z x
    (spin e)."""
    m, l, I_c, I_3, theta, Omega = 0.8, 0.25, 0.02, 0.01, 0.6, 1.4  # noqa: E741
    I_1 = I_c + m * l**2
    omega_3 = (m * g * l + I_1 * Omega**2 * cos(theta)) / (I_3 * Omega)
    z, e = np.array([0, 0, 1]), np.array([0, -sin(theta), cos(theta)])
    top = Mechanism(
        bodies={"top": body(m, I_c, I_c, I_3, at=(0, 0, l))},
        joints={"tip": SphericalJoint(connects=("ground", "top"))},
    )
    q = (cos(theta / 2), sin(theta / 2), 0, 0)
    omega, spin = Omega * z + (omega_3 - Omega * cos(theta)) * e, omega_3 - Omega * cos(theta)
    close(accelerations(top, q, omega), Omega * spin * np.cross(z, e), 1e-12)
    backwards = top.model_copy(
        update={"joints": {"tip": SphericalJoint(connects=("top", "ground"))}}
    )
    R = pairs.from_quaternion(
        q
    )  # -R' omega: the ground's angular velocity relative to the top, in the top's axes
    found = accelerations(backwards, (q[0], -q[1], 0, 0), -R.T @ omega)
    close(found, -R.T @ (Omega * spin * np.cross(z, e)), 1e-12)


def test_free_body_obeys_euler():
    I, omega = np.array([0.2, 0.5, 0.6]), np.array([1.0, -2.0, 3.0])  # noqa: E741
    v = np.array([0.3, 0.1, -0.2])
    mechanism = Mechanism(
        gravity=(1.0, 2.0, -3.0),
        bodies={"b": body(2, *I)},
        joints={"f": FreeJoint(connects=("ground", "b"))},
    )
    found = accelerations(mechanism, [1, 2, 3, 1, 0, 0, 0], [*v, *omega])
    close(
        found,
        [
            1,
            2,
            -3,
            *((np.roll(I, -1) - np.roll(I, 1)) * np.roll(omega, -1) * np.roll(omega, 1) / I),
        ],
        1e-13,
    )


def test_planar_joint_slides_and_resists():
    m, c, slope = 1.5, 0.8, 0.3
    plane = Frame(rotation=(slope, 0, 0))
    joint = PlanarJoint(
        connects=("ground", "b"), frames=(plane, Frame()), friction={"y": Friction(viscous=c)}
    )
    mechanism = Mechanism(
        bodies={"b": body(m, 0.1, 0.1, 0.1)}, joints={"p": joint}, actuators=("p.angle", "p.x")
    )
    found = accelerations(mechanism, [0.3, -0.4, 2.0], [0.5, 0.7, 0.9], [0.2, 0.3])
    close(found, [0.3 / m, -g * sin(slope) - c * 0.7 / m, 0.2 / 0.1], 1e-13)
    force = reaction(mechanism, [0.3, -0.4, 2.0], [0.5, 0.7, 0.9], "p")
    close(force[3:], m * g * cos(slope) * np.array([0, -sin(slope), cos(slope)]), 1e-13)


def reaction(mechanism, coordinates, rates, name):
    oracle, poses, twists = state(mechanism, coordinates, rates)
    return oracle.reactions(poses, twists, np.zeros(len(mechanism.actuators)))[name]


def test_free_turn_with_every_effect():
    """A ball's inertia I about its centre: (I + J) w' = -k phi - (c + d + F / sqrt(|w|^2 + r^2))
    w."""
    I, J, k, c, d, F, r = 0.3, 0.2, 5.0, 0.7, 0.4, 0.6, 0.1  # noqa: E741
    joint = SphericalJoint(
        connects=("ground", "b"),
        friction={"turn": Friction(viscous=c, coulomb=F, coulomb_rate=r)},
        spring={"turn": Spring(stiffness=k, damping=d)},
        rotor_inertia={"turn": J},
    )
    mechanism = Mechanism(bodies={"b": body(1, I, I, I)}, joints={"s": joint})
    phi, w = np.array([0.4, -0.8, 1.1]), np.array([1.0, 2.0, -0.5])
    q = pairs.quaternion(pairs.exponential(phi))
    wanted = -(k * phi + (c + d + F / sqrt(w @ w + r**2)) * w) / (I + J)
    close(accelerations(mechanism, q, w), wanted, 1e-13)
    oracle, poses, twists = state(mechanism, q, w)
    close(oracle.energy(poses, twists), [(I + J) * w @ w / 2, k * phi @ phi / 2], 1e-13)


def test_rod_carries_weight_and_centripetal_force():
    """A body hung by its mass centre: a = G + T n / m, T = m (|v|^2 / l - G . n), n from the body
    to the anchor."""
    m, length, G = 1.7, 0.8, np.array(DOWN)
    mechanism = Mechanism(
        gravity=DOWN,
        bodies={"b": body(m, 0.1, 0.2, 0.25)},
        joints={"rod": RodJoint(connects=("ground", "b"), length=length)},
    )
    oracle, n = MaximalOracle(mechanism), np.array([0.6, 0.64, 0.48])
    poses = {"b": (-length * n, np.eye(3))}
    v = np.cross(n, [0.3, 1.1, -0.7])
    twists = {"b": (np.array([0.1, 0.2, 0.3]), v)}
    T = m * (v @ v / length - G @ n)
    close(oracle.accelerations(poses, twists)["b"][1], G + T * n / m, 1e-13)
    close(oracle.reactions(poses, twists)["rod"], [*np.zeros(3), *(T * n)], 1e-13)
    assert oracle.mobility(poses) == 5 and oracle.independent_rates(poses) == ()


def test_wheels_in_mesh():
    """r_1 q_1 + r_2 q_2 = 0: (J_1 + (r_1 / r_2)^2 J_2) q_1'' = tau; the teeth push q_2 by r_2
    lambda."""
    J, r, tau = (0.5, 0.2), (0.3, 0.1), 0.9
    mechanism = Mechanism(
        bodies={"one": body(1, 1, 1, J[0]), "two": body(1, 1, 1, J[1])},
        joints={
            "a": RevoluteJoint(connects=("ground", "one")),
            "mesh": GearJoint(ratios={"a": r[0], "b": r[1]}, offset=0.02),
            "b": RevoluteJoint(connects=("ground", "two")),
        },
        actuators=("a",),
    )
    rates = np.array([1, -r[0] / r[1]])
    first = tau / (J[0] + (r[0] / r[1]) ** 2 * J[1])
    q = [5.0, (0.02 - 5.0 * r[0]) / r[1]]  # more than two turns
    close(accelerations(mechanism, q, rates, [tau]), first * rates, 1e-13)
    oracle, poses, twists = state(mechanism, q, rates)
    close(oracle.coordinates(poses), q, 1e-13)
    close(oracle.reactions(poses, twists, [tau])["mesh"], [J[1] * first * rates[1] / r[1]], 1e-12)


def test_hooke_joint_between_shafts():
    """tan(q_2) = tan(q_1) / cos(beta) and w_2 = k w_1, k = cos(beta) / (1 - sin^2(beta)
    cos^2(q_1)); two dependent rows.

    (J_1 + k^2 J_2) q_1'' + J_2 k k_q q_1'^2 = tau.
    """
    beta, J_1, J_2, q, w, tau = 0.6, 0.4, 0.9, 0.7, 2.3, 1.1
    mechanism = Mechanism(
        bodies={"in": body(1, 1, 1, J_1), "out": body(1, 1, 1, J_2)},
        joints={
            "in": RevoluteJoint(connects=("ground", "in")),
            "cross": UniversalJoint(connects=("in", "out")),
            "out": RevoluteJoint(
                connects=("out", "ground"),
                frames=(Frame(), Frame(rotation=(0, beta, 0))),
                axis=(0, 0, -1),
            ),
        },
        actuators=("in",),
    )
    oracle = MaximalOracle(mechanism)
    poses = oracle.assemble(oracle.poses({"in": q, "cross.angle_2": beta}), {"in": q})
    k = cos(beta) / (1 - (sin(beta) * cos(q)) ** 2)
    k_q = -(k**2) / cos(beta) * sin(beta) ** 2 * sin(2 * q)
    assert (
        oracle.mobility(poses) == 1
        and len(oracle.rows(poses, oracle.by_body(np.zeros(12))).A) == 14
    )
    close(oracle.coordinates(poses)[[0, 3]], [q, atan2(tan(q), cos(beta))], 1e-12)
    twists = oracle.twists(poses, {"in": w})
    close(oracle.rates(poses, twists)[[0, 3]], [w, k * w], 1e-12)
    found = oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, [tau]))
    first = (tau - J_2 * k * k_q * w**2) / (J_1 + k**2 * J_2)
    close(found[[0, 3]], [first, k * first + k_q * w**2], 1e-12)


def test_point_spring_between_free_bodies():
    """Two bodies pulled at their mass centres: m_i a_i = +-(k (l - l_0) + d l') n; at other points,
    moments too."""
    mechanism = Mechanism(
        gravity=(0, 0, 0),
        bodies={"a": body(2, 1, 1, 1), "b": body(3, 1, 1, 1)},
        joints={"a": FreeJoint(connects=("ground", "a")), "b": FreeJoint(connects=("a", "b"))},
        springs={
            "s": PointSpring(
                connects=("a", "b"),
                points=((0, 0, 0), (0, 0.5, 0)),
                stiffness=7,
                rest_length=0.4,
                damping=0.3,
            )
        },
    )
    oracle = MaximalOracle(mechanism)
    poses = {"a": (np.zeros(3), np.eye(3)), "b": (np.array([1.0, -0.5, 0]), np.eye(3))}
    twists = {"a": (np.zeros(3), np.zeros(3)), "b": (np.zeros(3), np.array([0.6, 0.2, 0]))}
    tension, found = 7 * (1 - 0.4) + 0.3 * 0.6, oracle.accelerations(poses, twists)
    close(np.concatenate(found["a"]), [0, 0, 0, tension / 2, 0, 0], 1e-13)
    close(np.concatenate(found["b"]), [0, 0, 0.5 * tension, -tension / 3, 0, 0], 1e-13)
    close(oracle.energy(poses, twists), [3 * 0.4 / 2, 7 * 0.6**2 / 2], 1e-13)


@pytest.mark.parametrize(
    "make",
    [
        partial(random_mechanisms.open_tree, 0),
        partial(random_mechanisms.planar_loops, 1, 3),
        partial(random_mechanisms.spatial_loops, 0, 2),
    ],
)
def test_agrees_with_the_older_oracle(make):
    mechanism, rng = make(), np.random.default_rng(41)
    older, oracle = LagrangeOracle(mechanism), MaximalOracle(mechanism)
    q, rates = random_mechanisms.random_state(mechanism, rng)
    forces = rng.normal(size=len(rates))
    poses = oracle.poses(dict(zip(mechanism.coordinates, q, strict=True)))
    assert max(np.max(abs(r), initial=0) for r in oracle.residuals(poses).values()) < 1e-9
    twists = oracle.twists(poses, dict(zip(mechanism.actuators, rates, strict=True)))
    close(oracle.rates(poses, twists), older.all_rates(q, rates), 1e-9)
    found = oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists, forces))
    close(found, older.all_accelerations(q, rates, older.forward_dynamics(q, rates, forces)), 1e-9)
    if len(oracle.rows(poses, twists).A) + oracle.mobility(poses) > 6 * len(mechanism.bodies):
        return  # dependent rows leave reactions open
    wanted, reactions = (
        older.joint_reactions(q, rates, forces),
        oracle.reactions(poses, twists, forces),
    )
    for name, joint in mechanism.pairs.items():
        (p_1, R_1), (p_2, R_2) = (poses.get(b, (np.zeros(3), np.eye(3))) for b in joint.connects)
        r = p_2 + R_2 @ joint.frames[1].position - p_1 - R_1 @ joint.frames[0].position
        moment, force = wanted[name][:3], wanted[name][3:]
        close(reactions[name], [*(moment + np.cross(r, force)), *force], 1e-8)


def test_what_has_no_answer_is_refused():
    crank = SliderCrank().mechanism()
    oracle = MaximalOracle(crank)
    with pytest.raises(OracleError, match="do not close"):
        oracle.assemble(oracle.reference_poses(), {"guide": 2.0})
    poses = oracle.reference_poses()
    with pytest.raises(OracleError, match="do not go together"):
        oracle.twists(poses, {"main": 1.0, "guide": 3.0})
    nothing = Mechanism(
        bodies={"b": body(0, 0, 0, 0)},
        joints={"r": RevoluteJoint(connects=("ground", "b"))},
        actuators=("r",),
    )
    oracle = MaximalOracle(nothing)
    with pytest.raises(OracleError, match="without inertia"):
        oracle.accelerations(oracle.reference_poses(), {"b": (np.zeros(3), np.zeros(3))}, [1.0])
