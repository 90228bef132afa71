"""The textbook formulation against identities, closed forms, finite differences and the paper's own
loop equations."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from linkwork.errors import LinkworkError
from linkwork.lab.textbook import Textbook
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint, SphericalJoint
from linkwork.mechanism.record import swapped
from linkwork.robots._prr3 import prr3

from tests.oracle import LagrangeOracle, open_tree, planar_loops, random_state, spatial_loops
from tests.oracle.closed_forms import DoublePendulum, Pendulum, SliderCrank

MECHANISMS = {
    "3-PRR": lambda: prr3(gravity=(0.5, -9.0, 0.0)),
    "planar loops": lambda: planar_loops(11, loops=2),
    "spatial loop": lambda: spatial_loops(12),
    "two spatial loops": lambda: spatial_loops(13, loops=2),
    "open tree": lambda: open_tree(14),
}


def state(mechanism: Mechanism, seed: int = 0) -> tuple[Textbook, np.ndarray, np.ndarray]:
    q, rates = random_state(mechanism, np.random.default_rng(seed), 0.03)
    return Textbook(mechanism), q, rates


@pytest.fixture(params=MECHANISMS, scope="module")
def at(request) -> tuple[Textbook, np.ndarray, np.ndarray]:
    """Give a mechanism, an assembled configuration and actuated rates."""
    return state(MECHANISMS[request.param]())


def along(book: Textbook, q: np.ndarray, rates: np.ndarray, h: float) -> np.ndarray:
    """Return the configuration at q_a + h q_a'."""
    return book.solve(q, q[book.a] + h * rates)


def difference(
    function, book: Textbook, q: np.ndarray, rates: np.ndarray, h: float = 1e-4
) -> np.ndarray:
    """Return d/dt of a function of q along q_a' = const, by central differences of fourth order."""
    f = {k: function(along(book, q, rates, k * h)) for k in (-2, -1, 1, 2)}
    return (8 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12 * h)


def near(actual, expected, tolerance: float) -> None:
    assert np.max(abs(np.asarray(actual) - expected), initial=0) <= tolerance * (
        1 + np.max(abs(np.asarray(expected)), initial=0)
    )


# The paper's robot


def paper_phi(q: np.ndarray, l1: float = 0.3, l2: float = 0.15, l3: float = 1.0) -> np.ndarray:
    """Return the paper's six loop equations of the 3-PRR, with phi_2 and phi_4 put right."""
    q1, q2, q3, q4, q5, q6, q7, q8, q9 = q
    s = sqrt(3) / 2
    c4, c47, s4, s47 = np.cos(q4), np.cos(q4 + q7), np.sin(q4), np.sin(q4 + q7)
    c5, c58, s5, s58 = np.cos(q5), np.cos(q5 + q8), np.sin(q5), np.sin(q5 + q8)
    c6, c69, s6, s69 = np.cos(q6), np.cos(q6 + q9), np.sin(q6), np.sin(q6 + q9)
    return np.array(
        [
            q1
            + l1 * c4
            + l2 * c47
            - l3
            + q2 / 2
            + l1 / 2 * c5
            + s * l1 * s5
            + l2 / 2 * c58
            + s * l2 * s58,
            l1 * s4 + l2 * s47 - s * q2 - s * l1 * c5 + l1 / 2 * s5 - s * l2 * c58 + l2 / 2 * s58,
            q1
            + l1 * c4
            + l2 * c47
            - l3 / 2
            + q3 / 2
            + l1 / 2 * c6
            - s * l1 * s6
            + l2 / 2 * c69
            - s * l2 * s69,
            l1 * s4
            + l2 * s47
            - s * l3
            + s * q3
            + s * l1 * c6
            + l1 / 2 * s6
            + s * l2 * c69
            + l2 / 2 * s69,
            q7 + q4 - q8 - q5,
            q8 + q5 - q9 - q6,
        ]
    )


def paper_Phi(q: np.ndarray) -> np.ndarray:
    """Differentiate the paper's equations by complex steps, exact to rounding."""
    return np.array([np.imag(paper_phi(q + 1e-30j * e)) / 1e-30 for e in np.eye(9)]).T


def test_shapes_of_the_paper():
    book, q, rates = state(prr3())
    assert (book.r, book.m, book.n) == (7, 9, 3)
    assert book.phi(q).shape == (6,) and book.Phi(q).shape == (6, 9)
    assert book.K(q).shape == (42, 9) and book.L(q).shape == (9, 3) and book.T(q).shape == (42, 3)
    assert book.Tdot(q, rates).shape == (42, 3) and book.C(q, rates).shape == (3, 3)
    assert book.Mtot(q).shape == book.Omega(q, rates).shape == (42, 42) and book.w_g().shape == (
        42,
    )


def test_loop_equations_are_the_papers():
    for seed in range(5):
        book, q, _ = state(prr3(), seed)
        near(paper_phi(q), np.zeros(6), 1e-13)
        Phi, expected = book.Phi(q), paper_Phi(q)
        assert (
            np.linalg.matrix_rank(np.vstack([Phi, expected]), 1e-10)
            == np.linalg.matrix_rank(Phi, 1e-10)
            == 6
        )


def test_the_papers_solution_closes_our_loops():
    book, start, _ = state(prr3(), 3)
    q_a = start[:3] + 0.01
    q = np.append(q_a, root(lambda u: paper_phi(np.append(q_a, u)), start[3:], tol=1e-14).x)
    near(book.phi(q), np.zeros(6), 1e-12)
    near(book.solve(start, q_a), q, 1e-12)


# Identities


def test_Phi_is_the_derivative_of_phi_off_closure_too(at):
    book, q, _ = at
    q, h = q + np.random.default_rng(1).normal(scale=0.3, size=book.m), 1e-6
    columns = [(book.phi(q + h * e) - book.phi(q - h * e)) / (2 * h) for e in np.eye(book.m)]
    near(book.Phi(q), np.reshape(columns, (book.m, -1)).T, 1e-8)


def test_rates_stay_on_the_constraints(at):
    book, q, rates = at
    near(book.Phi(q) @ book.L(q), np.zeros((book.m - book.n, book.n)), 1e-12)
    near(book.L(q)[book.a], np.eye(book.n), 0)
    near(difference(lambda q: q, book, q, rates), book.L(q) @ rates, 1e-8)


def test_twists_are_those_of_the_moving_bodies(at):
    book, q, rates = at
    h, expected = 1e-4, []
    before, behind, ahead = (book.configuration(along(book, q, rates, k * h)) for k in (0, -1, 1))
    for body in book.mechanism.bodies:
        turned = Rotation.from_matrix(
            ahead.X[body][:3, :3] @ behind.X[body][:3, :3].T
        ).as_rotvec() / (2 * h)
        expected += [*turned, *((ahead.mass_centre(body) - behind.mass_centre(body)) / (2 * h))]
    near(book.T(q) @ rates, np.array(expected), 1e-5)
    inertia = book.Mtot(q)
    near(rates @ book.M(q) @ rates / 2, np.array(expected) @ inertia @ np.array(expected) / 2, 1e-5)
    assert before.X.keys() == {"ground", *book.mechanism.bodies}


def test_T_annihilates_the_constraint_wrenches(at):
    """The oracle's constraint rows act on the bodies' twists: A T = 0, so wrenches A' lambda do no
    work on T."""
    book, q, _ = at
    oracle = LagrangeOracle(book.mechanism)
    placed = oracle._placed(q)
    A = np.delete(placed.J, placed.free, axis=0)
    T = book.T(q)[placed.columns]
    near(A @ T, np.zeros((len(A), book.n)), 1e-11)
    assert np.linalg.matrix_rank(T) == book.n == T.shape[0] - np.linalg.matrix_rank(A, 1e-9)


def test_Tdot_is_the_derivative_of_T(at):
    book, q, rates = at
    near(book.Tdot(q, rates), difference(book.T, book, q, rates), 1e-7)


def test_M_is_symmetric_and_positive(at):
    book, q, _ = at
    M = book.M(q)
    near(M, M.T, 1e-15)
    assert np.linalg.eigvalsh(M)[0] > 0


def test_Mdot_minus_2C_does_no_work(at):
    book, q, rates = at
    Mdot = difference(book.M, book, q, rates)
    near(rates @ Mdot @ rates, 2 * rates @ book.C(q, rates) @ rates, 1e-7)


def test_G_is_the_gradient_of_potential_energy(at):
    book, q, rates = at
    near(difference(lambda q: potential(book, q), book, q, rates), book.G(q) @ rates, 1e-8)


def test_forward_undoes_inverse(at):
    book, q, rates = at
    acceleration = np.random.default_rng(2).normal(size=book.n)
    tau = book.inverse_dynamics(q, rates, acceleration)
    near(book.forward_dynamics(q, rates, tau), acceleration, 1e-11)


def potential(book: Textbook, q: np.ndarray) -> np.ndarray:
    configuration, gravity = book.configuration(q), np.array(book.mechanism.gravity)
    bodies = book.mechanism.bodies.items()
    return -sum(
        (b.mass * gravity @ configuration.mass_centre(name) for name, b in bodies),
        start=np.zeros(()),
    )


@pytest.mark.long
def test_energy_changes_by_the_actuators_work():
    book, q, rates = state(prr3(gravity=(0.0, -9.81, 0.0)), 4)
    near_q = [q]

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q = near_q[0] = book.solve(near_q[0], y[:3])
        tau = np.array([2.0, -1.0, 3.0]) * cos(20 * t)
        return np.concatenate([y[3:6], book.forward_dynamics(q, y[3:6], tau), [tau @ y[3:6]]])

    def energy(y: np.ndarray) -> float:
        q = book.solve(near_q[0], y[:3])
        return float(y[3:6] @ book.M(q) @ y[3:6] / 2 + potential(book, q))

    rates = 0.1 * rates
    y = solve_ivp(rate, (0, 0.05), [*q[:3], *rates, 0.0], method="DOP853", rtol=1e-10, atol=1e-12).y
    work = energy(y[:, -1]) - energy(y[:, 0])
    assert abs(y[-1, -1]) > 1e-3
    near(work, y[-1, -1], 1e-9)


# Closed forms


def test_double_pendulum():
    pendulum = DoublePendulum()
    book = Textbook(pendulum.mechanism())
    for q, rates, accelerations in np.random.default_rng(5).normal(size=(20, 3, 2)):
        near(
            book.inverse_dynamics(q, rates, accelerations),
            pendulum.force(q, rates, accelerations),
            1e-13,
        )


def test_pendulum_in_a_tilted_plane():
    pendulum = Pendulum()
    near(
        Textbook(pendulum.mechanism()).inverse_dynamics([0.8], [1.7], [-2.3]),
        [pendulum.force(0.8, 1.7, -2.3)],
        1e-13,
    )


def test_slider_crank_through_the_whole_turn():
    crank = SliderCrank()
    book = Textbook(crank.mechanism())
    q = book.reference
    for theta in np.arange(0.5, 2 * pi + 0.5, 0.25):
        q = book.solve(q, [theta])
        near(q, np.array(crank.coordinates(theta)), 1e-12)
        near(book.inverse_dynamics(q, [3.0], [-5.0]), [crank.force(theta, 3.0, -5.0)], 1e-12)


def bennett(a: float = 0.5, alpha: float = 0.7, beta: float = 1.2, theta: float = 1.0) -> Mechanism:
    """Describe a Bennett linkage: opposite links alike, sin(alpha) / a = sin(beta) / b, four
    revolutes, one freedom."""
    b = a * sin(beta) / sin(alpha)
    far = {
        1: Frame(position=(a, 0, 0), rotation=(alpha, 0, 0)),
        2: Frame(position=(b, 0, 0), rotation=(beta, 0, 0)),
    }
    back = Frame(position=(-b, 0, 0), rotation=(-beta, 0, 0))
    body = Body(
        mass=1.2,
        centre_of_mass=(0.2, 0.05, 0.01),
        inertia=Inertia(xx=0.02, yy=0.03, zz=0.04, xy=0.003),
    )
    other = bennett_angle(alpha, beta, theta)
    return Mechanism(
        name="Bennett linkage",
        bodies={f"link_{i}": body for i in (1, 2, 3)},
        joints={
            "joint_1": RevoluteJoint(connects=("ground", "link_1")),
            "joint_2": RevoluteJoint(connects=("link_1", "link_2"), frames=(far[1], Frame())),
            "joint_3": RevoluteJoint(connects=("link_2", "link_3"), frames=(far[2], Frame())),
            "joint_4": RevoluteJoint(connects=("link_3", "ground"), frames=(far[1], back)),
        },
        actuators=("joint_1",),
        reference={"joint_1": theta, "joint_2": other, "joint_3": -theta, "joint_4": -other},
    )


def bennett_angle(alpha: float, beta: float, theta: float) -> float:
    """Return theta_2: tan(theta_1 / 2) tan(theta_2 / 2) = sin((beta + alpha) / 2) / sin((beta -
    alpha) / 2)."""
    return 2 * np.arctan(sin((beta + alpha) / 2) / sin((beta - alpha) / 2) / np.tan(theta / 2))


def test_bennett_linkage_moves_with_three_redundant_rows():
    """Four revolutes close a spatial loop of one freedom (Bennett 1903): three of six rows are
    independent."""
    book = Textbook(bennett())
    q, oracle = book.reference, LagrangeOracle(book.mechanism)
    assert len(book.rows) == 3
    for theta in np.arange(1.0, 2.5, 0.1):
        q = book.solve(q, [theta])
        other = bennett_angle(0.7, 1.2, theta)
        near(q, np.array([theta, other, -theta, -other]), 1e-10)
        tau = oracle.inverse_dynamics(q, [2.0], [-3.0])
        near(book.inverse_dynamics(q, [2.0], [-3.0]), tau, 1e-10)


def test_bennett_linkage_is_assembled_from_a_rough_reference():
    exact = bennett()
    rough = {name: q + 0.02 * (-1) ** i for i, (name, q) in enumerate(exact.reference.items())}
    q = Textbook(exact.model_copy(update={"reference": rough})).reference
    other = bennett_angle(0.7, 1.2, q[0])
    near(q, np.array([1.02, other, -1.02, -other]), 1e-10)


# Refusals


def test_a_singular_Phi_u_is_named():
    crank = SliderCrank()
    mechanism = crank.mechanism().model_copy(update={"actuators": ("guide",)})
    with pytest.raises(LinkworkError, match=r"Phi_u .* singular .* guide"):
        Textbook(mechanism).L(crank.coordinates(0.0))


def test_a_wrong_number_of_actuators_is_refused():
    for actuators in (("slide_1", "slide_2"), ("slide_1", "slide_2", "slide_3", "pivot_1")):
        mechanism = prr3().model_copy(update={"actuators": actuators})
        with pytest.raises(
            LinkworkError, match=rf"3-PRR has the mobility 3 .* but {len(actuators)} actuators"
        ):
            Textbook(mechanism).reference  # noqa: B018


def test_loops_out_of_reach_are_refused():
    book = Textbook(prr3())
    with pytest.raises(LinkworkError, match=r"loops of 3-PRR .*(do not close|singular)"):
        book.solve(book.reference, [-1.0, 0.1, 0.1])


def test_wrong_vectors_are_refused():
    book = Textbook(prr3())
    with pytest.raises(LinkworkError, match=r"q has the shape \(3,\); give 9 numbers"):
        book.phi([0.0, 0.0, 0.0])
    with pytest.raises(LinkworkError, match=r"tau = .* is not finite"):
        book.forward_dynamics(book.reference, np.zeros(3), [0.0, np.nan, 0.0])


def test_other_joints_are_refused():
    pendulum = Pendulum().mechanism()
    hinge = SphericalJoint(connects=("ground", "bob"))
    mechanism = swapped(pendulum, joints={"hinge": hinge})
    with pytest.raises(
        LinkworkError, match=r"joints\.hinge: the textbook formulation has no spherical joint"
    ):
        Textbook(mechanism).m  # noqa: B018
