"""Fewer, as many and more actuators than freedoms; idle freedoms."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import double_pendulum, five_bar, rrr3

from tests.equations.evaluation import close
from tests.robot.oracle_state import Seen


def actuated(mechanism: lw.Mechanism, *actuators: str) -> lw.Robot:
    return lw.Robot(mechanism.model_copy(update={"actuators": actuators}))


# Fewer than freedoms


@pytest.mark.parametrize("actuators", [("hinge_2",), ()], ids=["elbow driven", "nothing driven"])
def test_underactuated_forward_dynamics_and_runs(actuators):
    robot = actuated(double_pendulum(), *actuators)
    assert (robot.mobility, robot.actuators) == (2, actuators)
    state = robot.state({"hinge_1": -1.0, "hinge_2": 0.3}, {"hinge_1": 0.5, "hinge_2": -0.2})
    forces = [0.7] * len(actuators)
    Seen.of(robot, state).agree(forces, 1e-12)
    run = robot.simulate(state, forces, duration=0.5, rtol=1e-10, atol=1e-12)
    turned = run["joint_position"].values[:, 1] - 0.3
    energy = run["kinetic_energy"].values + run["potential_energy"].values
    close(energy - energy[0], 0.7 * len(actuators) * turned, 1e-8)


@pytest.mark.parametrize(
    ("actuators", "undriven"),
    [(("hinge_2",), "hinge_1"), (("hinge_1",), "hinge_2"), ((), "hinge_1, hinge_2")],
)
def test_underactuated_inverse_dynamics_is_refused_and_names_what_is_not_driven(
    actuators, undriven
):
    robot = actuated(double_pendulum(), *actuators)
    with pytest.raises(
        lw.LinkworkError, match=f"the actuators do not drive {undriven}; add actuators"
    ):
        robot.inverse_dynamics(robot.home, [0.0, 0.0])
    assert robot.internal_forces(robot.home).shape == (len(actuators), 0)


def test_an_actuator_in_a_locked_part_drives_nothing():
    """A triangle of bars is rigid; a pendulum hangs on it. An actuator at the triangle's foot moves
    nothing."""
    bar = lw.Body(mass=1, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))
    joints = {
        "foot": lw.RevoluteJoint(connects=("ground", "left")),
        "top": lw.RevoluteJoint(
            connects=("left", "right"), frames=(lw.Frame.planar(1), lw.Frame())
        ),
        "pin": lw.RevoluteJoint(
            connects=("right", "ground"), frames=(lw.Frame.planar(1), lw.Frame.planar(1))
        ),
        "hinge": lw.RevoluteJoint(
            connects=("right", "bob"), frames=(lw.Frame.planar(0.5), lw.Frame())
        ),
    }
    mechanism = lw.Mechanism(
        gravity=(0, -9.81, 0),
        bodies=dict.fromkeys(("left", "right", "bob"), bar),
        joints=joints,
        reference={"foot": 1.0, "top": -2.0, "pin": 1.0},
    )
    robot = actuated(mechanism, "foot")
    assert (robot.mobility, robot.independent) == (1, ("hinge",))
    state = robot.home.with_rates([1.3])
    assert not robot.actuation(state).any()
    Seen.of(robot, state).agree([5.0], 1e-12)
    angle = robot.home["foot"] + robot.home["top"] + robot.home["hinge"]
    close(robot.forward_dynamics(state, [5.0]), [-9.81 * 0.5 * np.cos(angle) / 0.35], 1e-12)
    with pytest.raises(lw.LinkworkError, match="the actuators do not drive hinge"):
        robot.inverse_dynamics(state, [0.0])


# More than freedoms


@pytest.fixture(scope="module")
def redundant():
    """Return redundantly actuated robots, each with a moving state and accelerations."""
    five = actuated(five_bar(), "motor_1", "motor_2", "elbow_1")
    rrr = actuated(rrr3(), "motor_1", "motor_2", "motor_3", "elbow_2")
    every = actuated(five_bar(), *five_bar().joints)
    return {
        "five-bar": (five, five.home.with_rates([0.5, -0.3]), np.array([1.0, -2.0])),
        "five-bar, every joint": (every, every.home.with_rates([0.5, -0.3]), np.array([1.0, -2.0])),
        "3-RRR": (rrr, rrr.home.with_rates([0.4, 0.2, -0.3]), np.array([3.0, -1.0, 2.0])),
    }


@pytest.fixture(params=["five-bar", "five-bar, every joint", "3-RRR"])
def overdriven(request, redundant):
    return redundant[request.param]


def test_forces_of_more_actuators_than_freedoms_are_the_least_ones(overdriven):
    robot, state, a = overdriven
    u = robot.inverse_dynamics(state, a)
    assert u.size == len(robot.actuators) > robot.mobility
    close(
        u,
        Seen.of(robot, state).inverse_dynamics(dict(zip(robot.independent, a, strict=True))),
        1e-10,
    )
    close(robot.forward_dynamics(state, u), a, 1e-10)


def test_weights_shift_the_load(overdriven):
    """u minimises sum weight_i u_i^2: with u = W^-1/2 y, least y, by NumPy's least squares on the
    oracle's forces."""
    robot, state, a = overdriven
    weights = np.arange(1.0, len(robot.actuators) + 1) ** 2
    u = robot.inverse_dynamics(state, a, weights=weights)
    least = Seen.of(robot, state).inverse_dynamics(dict(zip(robot.independent, a, strict=True)))
    S = robot.actuation(state)
    y = np.linalg.lstsq(S.T / np.sqrt(weights), S.T @ least)[0]
    close(u, y / np.sqrt(weights), 1e-10)
    close(robot.forward_dynamics(state, u), a, 1e-10)
    assert weights @ u**2 < weights @ least**2 * (1 - 1e-6)
    close(
        robot.inverse_dynamics(state, a, weights=dict(zip(robot.actuators, weights, strict=True))),
        u,
        1e-14,
    )


def test_internal_forces_move_nothing(overdriven):
    robot, state, a = overdriven
    internal, u = robot.internal_forces(state), robot.inverse_dynamics(state, a)
    k = len(robot.actuators) - robot.mobility
    close(internal.T @ internal, np.eye(k), 1e-13)
    close(internal.T @ u, np.zeros(k), 1e-12)  # the least forces hold none of them
    found = Seen.of(robot, state).joint_accelerations(u + 7 * internal.sum(axis=1))
    close(found, robot.joint_accelerations(state, a), 1e-9)


def test_stacks_of_overdriven_states(overdriven):
    robot, state, a = overdriven
    stack = robot.state(
        np.stack([state.positions, robot.home.positions]), np.stack([state.rates, 0 * state.rates])
    )
    both = robot.inverse_dynamics(stack, np.stack([a, -a]))
    close(both[0], robot.inverse_dynamics(state, a), 1e-12)
    close(both[1], robot.inverse_dynamics(robot.home, -a), 1e-12)


@pytest.mark.parametrize(
    ("weights", "sentence"),
    [
        ([1, 2], "weights has shape (2,); give 3 numbers"),
        ([1, 2, 0], "weights [1.0, 2.0, 0.0] do not fit"),
        ([1, 2, np.nan], "weights[2] is nan"),
        ([[1, 2, 3]], "weights"),
        ("abc", "weights is 'abc'; give numbers"),
        ({"motor_1": 1}, "weights lack motor_2, elbow_1"),
    ],
)
def test_weights_that_are_none(redundant, weights, sentence):
    robot, state, a = redundant["five-bar"]
    with pytest.raises(lw.LinkworkError) as refusal:
        robot.inverse_dynamics(state, a, weights=weights)
    assert sentence in str(refusal.value)


# Idle freedoms


def spinning_rod() -> lw.Mechanism:
    """Return a spatial slider-crank whose rod has a ball joint at both ends: it may spin about
    itself."""

    def body(mass, centre, *moments):
        inertia = lw.Inertia(**dict(zip(("xx", "yy", "zz"), moments, strict=True)))
        return lw.Body(mass=mass, centre_of_mass=centre, inertia=inertia)

    on_crank, at_end = lw.Frame(position=(0.1, 0, 0)), lw.Frame(position=(0.4, 0, 0))
    pivot = lw.Frame(position=(0, 0.1, 0.12), rotation=(1.2, 0, 0))
    return lw.Mechanism(
        bodies={
            "crank": body(1.0, (0.05, 0, 0), 1e-3, 2e-3, 2e-3),
            "rod": body(0.6, (0.2, 0, 0), 5e-4, 1e-2, 1e-2),
            "slider": body(2.0, (0, 0, 0), 1e-2, 1e-2, 1e-2),
        },
        joints={
            "motor": lw.RevoluteJoint(connects=("ground", "crank"), frames=(pivot, lw.Frame())),
            "knuckle": lw.SphericalJoint(connects=("crank", "rod"), frames=(on_crank, lw.Frame())),
            "ball": lw.SphericalJoint(connects=("rod", "slider"), frames=(at_end, lw.Frame())),
            "guide": lw.PrismaticJoint(connects=("ground", "slider"), axis=(1, 0, 0)),
        },
        actuators=("motor",),
        reference={"motor": 0.6, "guide": 0.4},
    )


@pytest.fixture(scope="module")
def spinning():
    return lw.Robot(spinning_rod())


def test_an_idle_freedom_is_counted_and_named(spinning):
    assert (spinning.mobility, spinning.gruebler) == (2, 2)
    assert spinning.idle == ("rod: spin about the line through knuckle and ball",)
    Seen.of(spinning, spinning.home.with_rates([2.0, 3.0])).agree([0.3], 1e-10)


def test_idle_freedoms_are_left_to_themselves(spinning):
    """The motor is asked for an acceleration; whatever is said of the spin, the motor's forces
    bring about its own part."""
    state = spinning.home.with_rates([2.0, 3.0])
    motor = spinning.independent.index("motor")
    free = spinning.forward_dynamics(state, [0.3])
    close(spinning.inverse_dynamics(state, free), [0.3], 1e-10)
    for spin in (0.0, 5.0):
        asked = np.full(2, spin)
        asked[motor] = 1.5
        found = spinning.forward_dynamics(state, spinning.inverse_dynamics(state, asked))
        assert np.isclose(found[motor], 1.5, atol=1e-9)


def test_a_rod_keeps_its_spin(spinning):
    """Nothing turns an axisymmetric rod about its own axis: its angular velocity along it stays as
    it is."""
    state = spinning.home.with_rates([2.0, 3.0])
    times = np.linspace(0, 0.5, 11)
    run = spinning.simulate(state, [0.1], duration=0.5, rtol=1e-10, atol=1e-12, save_at=times)
    spins = []
    for positions, rates in zip(
        run["joint_position"].values, run["joint_rate"].values, strict=True
    ):
        named = dict(zip(spinning.rates, rates, strict=True))
        there = spinning.state(positions, {name: named[name] for name in spinning.independent})
        along = spinning.body_poses(there)["rod"][1][:, 0]
        spins.append(along @ spinning.twists(there)[1, :3])
    close(spins, np.full(11, spins[0]), 1e-8)
    assert abs(spins[0]) > 1


def test_forces_and_weights_by_name(overdriven):
    """Forces by name act as in a run: what is left out is zero."""
    robot, state, a = overdriven
    one = robot.actuators[1]
    u = np.array([2.5 if name == one else 0.0 for name in robot.actuators])
    expected = robot.forward_dynamics(state, u)
    np.testing.assert_array_equal(robot.forward_dynamics(state, {one: 2.5}), expected)
    np.testing.assert_array_equal(robot.forward_dynamics(state, {one: [2.5, 2.5]}), [expected] * 2)
    np.testing.assert_array_equal(
        robot.reactions(state, {one: 2.5}).wrenches, robot.reactions(state, u).wrenches
    )
    weights = np.arange(1.0, len(u) + 1)
    named = dict(zip(robot.actuators, weights, strict=True))
    np.testing.assert_array_equal(
        robot.inverse_dynamics(state, a, weights=named),
        robot.inverse_dynamics(state, a, weights=weights),
    )
    with pytest.raises(lw.LinkworkError, match=f"weights lack {robot.actuators[0]}"):
        robot.inverse_dynamics(state, a, weights={name: 1.0 for name in robot.actuators[1:]})
    with pytest.raises(lw.LinkworkError, match="there is no actuator 'motr_1'"):
        robot.inverse_dynamics(state, a, weights={"motr_1": 1.0})
    with pytest.raises(lw.LinkworkError, match="there is no actuator 'motr_1'"):
        robot.forward_dynamics(state, {"motr_1": 1.0})
    with pytest.raises(lw.LinkworkError, match="there is no independent rate 'motr_1'"):
        robot.inverse_dynamics(state, {"motr_1": 1.0})


def test_what_holds_a_pose_balances_weight_and_springs(overdriven):
    robot, state, _ = overdriven
    u = robot.holding_forces(state)
    still = state.with_rates(0 * state.rates)
    np.testing.assert_allclose(robot.forward_dynamics(still, u), 0, atol=1e-9)
    np.testing.assert_allclose(u, robot.inverse_dynamics(still, 0 * state.rates), atol=1e-10)
