"""Powers, work, energy balance and conditioning in every run, against closed forms and the energies
themselves."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw

from tests.catalogue import built
from tests.equations.evaluation import close
from tests.oracle.random_joints import random_loops

ARM = lw.Body(mass=2.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.3))


def arm(**effects) -> lw.Robot:
    """Return an arm on a hinge, with what acts there."""
    hinge = lw.RevoluteJoint(connects=("ground", "arm"), **effects)
    return lw.Robot(
        lw.Mechanism(
            bodies={"arm": ARM}, joints={"hinge": hinge}, actuators=("hinge",), gravity=(0, -9, 0)
        )
    )


def relative(data) -> float:
    """Return the largest energy balance over what the kinetic energy varies by."""
    return float(np.abs(data.energy_balance).max() / np.ptp(data.kinetic_energy.values))


def test_powers_are_force_times_rate():
    robot = built("stewart")
    data = robot.simulate(robot.home, np.arange(1.0, 7.0), duration=0.1).dataset
    rates = data.joint_rate.sel(rate=list(robot.actuators)).values
    close(data.actuator_power.values, np.arange(1.0, 7.0) * rates, 1e-12)
    assert data.actuator_power.dims == ("time", "actuator")
    assert data.actuator_power.attrs["units"] == "W"


def test_friction_takes_the_energy():
    """A joint's friction and damper take (d + viscous) w^2 + coulomb w^2 / sqrt(w^2 + r^2)."""
    friction = lw.Friction(viscous=0.2, coulomb=0.5, coulomb_rate=0.1)
    robot = arm(friction=friction, spring=lw.Spring(stiffness=2.0, damping=0.3))
    data = robot.simulate(robot.home, duration=2.0).dataset
    w = data.joint_rate.values
    close(data.friction_power.values, -(0.5 * w**2 + 0.5 * w**2 / np.sqrt(w**2 + 0.01)), 1e-12)
    assert float(data.work[-1]) < -1.0
    assert relative(data) < 1e-7


def test_work_without_forces_is_none_and_the_balance_is_the_drift():
    robot = arm()
    data = robot.simulate(robot.home, duration=3.0, rtol=1e-4, atol=1e-6).dataset
    energy = data.kinetic_energy + data.potential_energy
    assert not data.work.values.any()
    close(data.energy_balance.values, (energy - energy[0]).values, 1e-14)
    assert 1e-6 < np.abs(data.energy_balance).max() < 1e-2
    assert "friction_power" not in data
    assert "damper_power" not in data


def test_work_of_a_known_motion():
    """Under a constant torque u the work is u (q - q_0), however few times are saved."""
    robot = arm(friction=lw.Friction(viscous=0.0))
    for save_at in (None, [0.0, 1.0, 2.5], [0.7, 2.5]):
        data = robot.simulate(robot.home, [3.0], duration=2.5, save_at=save_at).dataset
        close(
            data.work.values,
            3.0 * (data.joint_position.values[:, 0] - robot.home.positions[0]),
            1e-7,
        )
        assert relative(data) < 1e-6


def test_forces_that_jump_between_saved_times():
    """Under a held torque the work is the sum of torque times turn over its pieces."""
    robot, torques = arm(), np.array([3.0, -2.0, 5.0, 1.0, 0.0])
    held = lw.Sampled(np.array([0.0, 0.3, 0.55, 0.8, 2.0]), torques, "hold")
    every = robot.simulate(
        robot.home, held, duration=1.0, save_at=[0.0, 0.3, 0.55, 0.8, 1.0]
    ).dataset
    turns = np.diff(every.joint_position.values[:, 0])
    close(every.work.values[1:], np.cumsum(torques[:-1] * turns), 1e-8)
    for save_at in ([0.0, 1.0], [0.1, 0.7, 0.9, 1.0], None):
        data = robot.simulate(robot.home, held, duration=1.0, save_at=save_at).dataset
        close(data.work.values[-1], every.work.values[-1], 1e-7)
        assert relative(data) < 1e-6


FORCES = {
    "constant": lambda n: np.ones(n),
    "smooth": lambda n: lw.Sampled(
        np.linspace(0, 0.3, 9), np.random.default_rng(1).normal(size=(9, n))
    ),
    "jumps": lambda n: lw.Sampled(
        np.linspace(0, 0.3, 9), np.random.default_rng(1).normal(size=(9, n)), "hold"
    ),
}


@pytest.mark.parametrize("forces", FORCES)
@pytest.mark.parametrize("name", ["prr3", "andrews"])
def test_balance_of_the_catalogue(name, forces):
    """The balance is as good as the run: a thousandth of the tolerance more changes it by orders of
    magnitude."""
    robot = built(name)
    scale, duration = (0.03, 0.01) if name == "andrews" else (1.0, 0.3)
    given = FORCES[forces](len(robot.actuators))
    given = (
        lw.Sampled(given.times, scale * given.values, given.kind)
        if forces != "constant"
        else scale * given
    )
    coarse, fine = (
        robot.simulate(robot.home, given, duration=duration, rtol=r).dataset for r in (1e-5, 1e-9)
    )
    assert relative(fine) < 1e-7
    assert relative(fine) < relative(coarse) < 1e-3


@pytest.mark.long
def test_balance_with_everything_that_acts():
    """Loops with springs, dampers, friction and rotors in joints, and springs between points."""
    robot = lw.Robot(random_loops(5, 2, effects=True))
    state = robot.home.with_rates(np.random.default_rng(2).normal(size=robot.mobility))
    data = robot.simulate(state, np.ones(len(robot.actuators)), duration=0.2).dataset
    assert data.damper_power.dims == ("time", "spring")
    assert {"friction_power", "damper_power"} <= set(data)
    assert relative(data) < 1e-6


def test_balance_through_singular_poses():
    """Charts change, and bifurcations are stepped over; times saved in between or not."""
    robot = built("prr3")
    for save_at in (None, [0.0, 0.31, 0.9, 1.0]):
        run = robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0, save_at=save_at)
        assert "; from " in run.attrs["charts"]
        assert relative(run.dataset) < 1e-6
    ladder = lw.Robot(lw.robots.n_four_bar(2))
    start = ladder.home.with_rates([-1.0])
    run = ladder.simulate(start, duration=3.0, on_singular="step_over", save_at=[0.0, 1.0, 3.0])
    assert run.success
    assert relative(run.dataset) < 1e-6
    assert run["conditioning"].dims == ("time",)


def test_stiff_runs_keep_their_balance():
    """The flyball governor's steps are as long as explicit ones can be; saved seldom, its work is
    still known."""
    robot = built("flyball_governor")
    forces = np.zeros(len(robot.actuators))
    data = robot.simulate(robot.home, forces, duration=0.1, save_at=np.linspace(0, 0.1, 21)).dataset
    assert data.damper_power.values.min() < 0
    assert relative(data) < 1e-6


def test_conditioning_without_a_task_is_what_the_actuators_see_of_the_worst_motion():
    """1 where every joint is driven; of one freedom the crank's part of the length of all rates."""
    robot = arm()
    assert (robot.simulate(robot.home, duration=0.5)["conditioning"] == 1).all()
    robot = built("four_bar")
    data = robot.simulate(robot.home.with_rates([3.0]), duration=1.0).dataset
    rates = data.joint_rate.sel(rate=list(robot.equations.tree.rates)).values
    crank = data.joint_rate.sel(rate="crank_pivot").values
    close(data.conditioning.values, np.abs(crank) / np.linalg.norm(rates, axis=1), 1e-9)
    assert data.conditioning.dims == ("time",)


def test_external_wrenches_do_work():
    """A constant force does the work F . dx at its point, beside weight and motor."""
    robot = arm()
    force = np.array([1.0, 4.0, 0.0])
    wrench = lw.control.Wrench("arm", force=force, point=(1.0, 0.2, 0.0))
    run = robot.simulate(robot.home, [0.5], duration=1.5, wrenches=[wrench])
    data = run.dataset
    q = data.joint_position.values[:, 0]
    x = np.stack([np.cos(q) - 0.2 * np.sin(q), np.sin(q) + 0.2 * np.cos(q)], axis=1)
    close(data.work.values, 0.5 * (q - q[0]) + (x - x[0]) @ force[:2], 1e-8)
    close(data.external_power.values[:, 0], data.joint_rate.values[:, 0] * (x @ [4.0, -1.0]), 1e-12)
    assert relative(data) < 1e-7
    e, w, a = (
        np.stack([np.cos(q), np.sin(q)], 1),
        data.joint_rate.values,
        data.joint_acceleration.values,
    )
    n = np.stack([-e[:, 1], e[:, 0]], axis=1)
    pin = 2.0 * (0.5 * a * n - 0.5 * w**2 * e) + [0, 18.0] - force[:2]
    close(run.reactions().sel(joint="hinge").values[:, 3:5], pin, 1e-10)


def test_a_traced_controller_does_work():
    """A damper made by a controller takes what a joint's own damper takes."""
    own = arm(friction=lw.Friction(viscous=0.7)).simulate(arm().home, duration=1.0).dataset
    traced = (
        arm()
        .simulate(arm().home, lambda t, state: [-0.7 * state.rate("hinge")], duration=1.0)
        .dataset
    )
    close(traced.actuator_power.values[-1, 0], own.friction_power.values[-1, 0], 1e-7)
    close(traced.work.values[-1], own.work.values[-1], 1e-7)
    assert relative(traced) < 1e-7


@pytest.mark.parametrize("compiled", [False, True])
def test_a_sampled_controller_s_work_is_known_however_seldom_it_is_saved(compiled):
    robot = arm()

    def law(t, state):
        return [lw.math.sin(20 * t) - state.rate("hinge")]

    sampler = lw.control.Sampler(law, rate=50, delay=0.04, compiled=compiled)
    every = robot.simulate(robot.home, sampler, duration=0.5)
    assert relative(every.dataset) < 1e-6
    assert float(np.abs(every["work"]).max()) > 1e-3
    times = [0.01, 0.3, 0.47]
    seldom = robot.simulate(robot.home, sampler, duration=0.5, save_at=times)
    assert seldom.coords["time"].values.tolist() == times
    assert relative(seldom.dataset) < 1e-6
    later = robot.resume(
        robot.simulate(robot.home, sampler, duration=0.31), sampler, duration=0.19, save_at=[0.5]
    )
    whole, part = (
        run["work"].values[-1]
        for run in (every, robot.simulate(robot.home, sampler, duration=0.31))
    )
    close(later["work"].values, np.array([whole - part]), 1e-7)


def test_a_sampled_controller_s_work_across_changes_of_chart():
    robot = built("prr3")
    law = lw.control.Sampler(lambda t, state: [5.0 + np.sin(9 * t), 0.0, 0.0], rate=20.0)
    run = robot.simulate(robot.home, law, duration=1.0, save_at=[0.0, 0.31, 0.9, 1.0])
    assert "; from " in run.attrs["charts"]
    assert relative(run.dataset) < 1e-6


def test_the_work_of_a_motor_whose_current_settles_between_saved_times():
    """Saved times and steps of a method of high order are several of its time constants L / R
    apart."""
    robot, motor = (
        arm(),
        lw.control.DCMotor(resistance=1.2, inductance=2e-3, torque_constant=0.05, gear=40.0),
    )
    run = robot.simulate(
        robot.home,
        [12.0],
        drives={"hinge": motor},
        duration=0.5,
        method="dop853",
        save_at=np.linspace(0, 0.5, 51),
    )
    assert relative(run.dataset) < 1e-6


def test_implicit_steps_longer_than_explicit_ones_could_be():
    """The stiff governor by the stiff method: its steps are not those of explicit methods, and the
    balance is kept."""
    robot = built("flyball_governor")
    run = robot.simulate(robot.home, np.zeros(len(robot.actuators)), duration=0.1, method="rodas")
    assert relative(run.dataset) < 1e-6


def test_the_balance_at_the_tightest_tolerance_is_the_run_s_own():
    """Under constant forces the work is u . (q - q_0) exactly."""
    robot, u = built("prr3"), np.array([0.3, 0.2, -0.1])
    for method, rtol in (("dop853", 1e-12), ("sharp_smart", 1e-12), ("rodas", 1e-8)):
        data = robot.simulate(
            robot.home, u, duration=0.5, method=method, rtol=rtol, atol=0.1 * rtol
        ).dataset
        energy = (data.kinetic_energy + data.potential_energy).values
        slides = data.joint_position.sel(coordinate=list(robot.actuators)).values
        close(
            data.energy_balance.values,
            energy - energy[0] - (slides - slides[0]) @ u,
            rtol * np.ptp(energy),
        )


@pytest.mark.parametrize("method", [None, "rodas"])
def test_a_stiff_run_has_a_balance_however_seldom_it_is_saved(method):
    """Dry friction has taken all of the energy m v^2 / 2 when a block has come to rest."""
    slide = lw.PrismaticJoint(
        connects=("ground", "block"), friction=lw.Friction(coulomb=3.0, coulomb_rate=1e-6)
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"block": lw.Body(mass=2.0)}, joints={"slide": slide}, gravity=(0, 0, 0)
        )
    )
    run = robot.simulate(
        robot.home.with_rates([1.5]), duration=50.0, method=method, save_at=[0.0, 50.0]
    )
    assert run["work"].values[-1] == pytest.approx(-2.25, abs=1e-7)
    assert np.isfinite(run["energy_balance"].values).all()
    assert relative(run.dataset) < 1e-7


def test_a_balance_that_is_not_known_is_told(monkeypatch):
    robot = arm()
    run = robot.simulate(robot.home, [1.0], duration=0.5)
    from linkwork.runs.saved_states import SavedStates

    nothing = property(lambda states: np.full(len(states.y), np.nan))
    monkeypatch.setattr(SavedStates, "power", nothing)
    with pytest.warns(UserWarning, match=r"energy balance, is not known \(nan\) from t = "):
        assert np.isnan(run["energy_balance"].values[-1])


def test_the_balance_is_known_where_a_step_ends_beyond_a_weak_place():
    """A segment ends where the pivot of its chart is weak; within its last step it may be weaker
    than at its end."""
    robot = lw.Robot(lw.robots.five_bar(gravity=(0, -9.81, 0)))
    angles = [
        -16.597514754977965,
        -11.445052946473476,
        -14.136891657137115,
        -11.118298650805993,
        8.171054814835607,
    ]
    start = robot.state(angles, [0.3189048, -0.2900349])
    times = np.linspace(0, 0.3, 21)
    run = robot.simulate(
        start, [1.8267566, -3.0783319], duration=0.3, method="rk4", step=0.3 / 400, save_at=times
    )
    assert "; from " in run.attrs["charts"]
    assert np.abs(run["energy_balance"].values).max() < 1e-3
