"""Teeth of gears that rub by what they transmit: two inertias by hand, powers, worms, trains."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkwork as lw

from tests.equations.evaluation import close

J_MOTOR, J_DRUM, N, M = 2e-3, 0.4, 30.0, 0.15
SHARP = 1e-9  # rate of smoothing, far below the rates here


def hoist(at: str = "drum", part: float = M, **more) -> lw.Robot:
    """Return a motor that turns a drum by a gear, motor = 30 drum, whose teeth rub."""
    law = lw.Sliding(coefficient=part, **{"rate": SHARP} | more)
    turning = {"motor": lw.Body(mass=1.0, inertia=lw.Inertia(zz=J_MOTOR))}
    turning["drum"] = lw.Body(mass=5.0, inertia=lw.Inertia(zz=J_DRUM))
    joints: dict = {name: lw.RevoluteJoint(connects=("ground", name)) for name in turning}
    joints["mesh"] = lw.GearJoint(
        ratios={"motor": 1.0, "drum": -N}, teeth=lw.GearTeeth(friction=law, at=at)
    )
    return lw.Robot(
        lw.Mechanism(bodies=turning, joints=joints, actuators=("motor", "drum"), gravity=(0, 0, 0))
    )


def acceleration(tau: float, load: float, way: float, at: str) -> float:
    """Return that of the drum by Newton and Euler, with L what the mesh takes from the motor:
    J_m N a = tau - L - m |L| way at the motor, J_d a = -load + N (L - m |L| way) at the drum."""

    def both(m: float) -> tuple[float, float]:
        motor, drum = (m, 0.0) if at == "motor" else (0.0, m)
        A = np.array([[J_MOTOR * N, 1 + motor], [J_DRUM, -N * (1 - drum)]])
        a, L = np.linalg.solve(A, [tau, -load])
        return float(a), float(L)

    ahead, L = both(M * way)
    return ahead if L > 0 else both(-M * way)[0]


@pytest.mark.parametrize("at", ["drum", "motor"])
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("tau", "load"), [(1.0, 20.0), (0.1, 30.0), (-0.5, 2.0)])
def test_a_hoist_is_driven_and_drives_back_as_newton_and_euler_say(at, way, tau, load):
    robot = hoist(at)
    state = robot.home.with_rates({robot.independent[0]: way})
    u = {"motor": tau, "drum": -load}
    v_dot = robot.forward_dynamics(state, u)
    a = dict(zip(robot.rates, robot.joint_accelerations(state, v_dot), strict=True))
    wanted = acceleration(tau, load, way, at)
    assert a["drum"] == pytest.approx(wanted, rel=1e-12)
    assert a["motor"] == pytest.approx(N * wanted, rel=1e-12)
    one = lw.Robot(robot.mechanism.model_copy(update={"actuators": ("motor",)}))
    still = one.home.with_rates({one.independent[0]: way})
    (needed,) = one.inverse_dynamics(still, one.forward_dynamics(still, [tau]))
    assert needed == pytest.approx(tau, rel=1e-10)


@pytest.mark.parametrize(
    ("at", "forth", "back"),
    [("drum", 1 - M, 1 / (1 + M)), ("motor", 1 / (1 + M), 1 - M)],
)
def test_steadily_it_has_its_efficiency(at, forth, back):
    """Torques that keep the rate: of the motor's power the drum's load gets a part, and back."""
    robot = hoist(at)
    for load, way, part in ((20.0, 1.0, forth), (20.0, -1.0, 1 / back)):
        state = robot.home.with_rates({robot.independent[0]: way})
        tau = load / N / part

        u = {"motor": tau, "drum": -load}
        assert robot.forward_dynamics(state, u) == pytest.approx([0.0], abs=1e-10)


def test_what_the_gear_takes_is_in_runs_and_their_balance():
    robot = hoist(rate=1e-2)
    start = robot.home.with_rates(
        {robot.independent[0]: N if robot.independent == ("motor",) else 1}
    )
    u = {"motor": 0.1, "drum": -10.0}
    run = robot.simulate(start, u, duration=1.5, rtol=1e-10, atol=1e-12)
    drum = run["joint_rate"].sel(rate="drum").values
    assert drum[0] > 0.9 and drum[-1] < -0.9  # up, and back
    close(run["energy_balance"].values, np.zeros(len(run.time)), 1e-8)
    lost = run["friction_power"].sel(rate="drum").values
    assert lost.min() < -1.0 and lost.max() <= 0.0
    states = robot.state(np.tile(robot.home.positions, (9, 1)))
    fixed = {"motor": 0.2, "drum": -10.0}
    many = robot.ensemble(states, fixed, duration=0.5, samples=3)
    alone = robot.simulate(robot.home, fixed, duration=0.5, samples=3)
    found = many.dataset["joint_position"].values[4]
    close(found, alone["joint_position"].values, 1e-9)


def test_steps_end_where_the_load_turns_round():
    """There friction has a kink: with it in a step a run of this tolerance is 1e-5 off. Members of
    ensembles find the same."""
    robot, rate, lasts = hoist(rate=1e-3), 1e-3, 1.2

    def torques(t, state):
        return {"motor": 0.3 * lw.math.sin(7 * t), "drum": -2.0 * lw.math.cos(3 * t)}

    def by_hand(t, y):
        m = M * N * y[1] / np.hypot(N * y[1], rate)
        tau, load = 0.3 * np.sin(7 * t), 2.0 * np.cos(3 * t)
        for part in (m, -m):
            # J_m N a = tau - L, J_d a = -load + N (L - m |L|)
            a = (N * (1 - part) * tau - load) / (J_DRUM + N**2 * (1 - part) * J_MOTOR)
            if (tau - J_MOTOR * N * a) * (1 if part == m else -1) > 0:
                break
        return [y[1], a]

    start = robot.home.with_rates(
        {robot.independent[0]: 5.0 * (N if robot.independent == ("motor",) else 1)}
    )
    run = robot.simulate(start, torques, duration=lasts, rtol=1e-8, atol=1e-8)
    found = run.dataset["joint_position"].sel(coordinate="drum").values[-1]
    exact = solve_ivp(by_hand, (0, lasts), [0, 5.0], method="DOP853", rtol=1e-12, atol=1e-12)
    close(found, exact.y[0, -1], 1e-7)
    times, names = run.coords["event_time"].values, run.coords["event"].values
    assert len(times) > 1 and {*names} == {"mesh: load turns round"}
    transmitted = [0.3 * np.sin(7 * t) - J_MOTOR * N * by_hand(t, [0, 1e9])[1] for t in times]
    close(transmitted, np.zeros(len(times)), 1e-9)
    states = robot.state(np.tile(start.positions, (3, 1)))
    states = states.with_rates(np.tile(start.rates, (3, 1)))
    given = {"duration": lasts, "rtol": 1e-8, "atol": 1e-8, "save_at": [lasts]}
    many, alone = robot.ensemble(states, torques, **given), robot.simulate(start, torques, **given)
    both = many.dataset["joint_position"].values[1], alone.dataset["joint_position"].values
    assert both[0].size and (both[0] == both[1]).all()


def test_a_worm_holds_its_load_and_is_driven_down():
    """With m > 1 at the motor a load does not drive it, whatever it is; a motor does."""
    bristle = lw.Bristle(stiffness=1e5, damping=30.0)
    robot = hoist("motor", 1.3, rate=1e-3, bristle=bristle)
    options = {"method": "rodas", "rtol": 1e-11, "atol": 1e-13}
    held = robot.simulate(robot.home, {"drum": -20.0}, duration=0.5, **options)
    assert abs(held["joint_rate"].values[-1]).max() < 1e-6
    down = robot.simulate(robot.home, {"drum": -20.0, "motor": -1.0}, duration=0.5, **options)
    assert down["joint_rate"].sel(rate="drum").values[-1] < -0.1
    close(down["energy_balance"].values, np.zeros(len(down.time)), 1e-8)


def test_reactions_have_the_friction_of_teeth_and_journals_in_one_joint():
    """What holds bodies in a run's reactions balances them, with both kinds of friction in one
    joint."""
    robot = hoist()
    pin = lw.JournalBearing(friction=lw.Sliding(coefficient=0.2, rate=SHARP), radius=0.05)
    drum = robot.mechanism.joints["drum"].model_copy(update={"bearing": pin})
    joints = {**robot.mechanism.joints, "drum": drum}
    both = lw.Robot(
        robot.mechanism.model_copy(update={"joints": joints, "gravity": (0.0, -9.81, 0.0)})
    )
    state = both.home.with_rates({both.independent[0]: 5.0})
    gear = both.reactions(state, {"motor": 1.0}).gears["mesh"]
    a = both.joint_accelerations(state, both.forward_dynamics(state, {"motor": 1.0}))
    a = dict(zip(both.rates, a, strict=True))["drum"]
    # The drum: what the gear gives it, less the teeth's share, less the journal's moment.
    rub = 0.2 * 0.05 * 5.0 * 9.81
    assert abs(N * gear) > 5
    assert J_DRUM * a == pytest.approx(abs(N * gear) * (1 - M) - rub, rel=1e-10)


def test_what_does_not_fit_is_refused():
    law = lw.Sliding(coefficient=0.1)
    with pytest.raises(lw.MechanismError, match=r"'hip', which the gear does not couple.*motor"):
        lw.GearJoint(ratios={"motor": 1, "drum": -2}, teeth=lw.GearTeeth(friction=law, at="hip"))
    twice = hoist().mechanism
    second = lw.GearJoint(ratios={"motor": 1.0, "drum": -N})
    with pytest.raises(lw.MechanismError, match=r"mesh\.teeth: .*open what this gear transmits"):
        lw.Robot(twice.model_copy(update={"joints": {**twice.joints, "second": second}}))
    with pytest.raises(
        lw.MechanismError, match=r"steps in C leave out the friction of teeth.*mesh"
    ):
        lw.export.c(hoist(), ["step"])


def test_files_keep_teeth(tmp_path):
    robot = hoist()
    robot.mechanism.save(tmp_path / "hoist.yml")
    assert lw.Mechanism.load(tmp_path / "hoist.yml") == robot.mechanism
    driven = robot.mechanism.model_copy(update={"actuators": ("motor",)})
    for name in ("hoist.urdf", "hoist.sdf", "hoist.xml"):
        notes = lw.formats.save(driven, tmp_path / name)
        assert any("mesh: " in note for note in notes), name
    freed = robot.free("mesh.teeth.friction.coefficient")
    state = freed.home.with_rates({freed.independent[0]: 1.0})
    given = freed.with_parameters({"mesh.teeth.friction.coefficient": 0.0})
    (free,), (own,) = (of.forward_dynamics(state, [1.0, 0.0]) for of in (given, freed))
    assert abs(own) < abs(free)
