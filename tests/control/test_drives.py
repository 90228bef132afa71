"""Drives against closed forms and steady states by hand."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import DCMotor, HydraulicCylinder, Ideal, Lag, PneumaticCylinder, Saturated

from tests.control.plants import cart

TIMES = np.linspace(0, 1, 41)


@pytest.fixture(scope="module")
def plant():
    return cart(mass=2.0)


def test_a_first_order_lag(plant):
    run = plant.simulate(
        plant.home, [6.0], duration=1.0, drives={"slide": Lag(0.2)}, save_at=TIMES, rtol=1e-10
    )
    force = 6 * (1 - np.exp(-TIMES / 0.2))
    assert np.allclose(run["actuator_force"].values[:, 0], force, 0, 1e-7)
    assert np.allclose(
        run["joint_rate"].values[:, 0], 3 * (TIMES - 0.2 * (1 - np.exp(-TIMES / 0.2))), 0, 1e-8
    )
    assert np.allclose(run["command"], 6.0)
    assert (
        run["drive_state"].sel(extra="slide.force").values[-1]
        == run["actuator_force"].values[-1, 0]
    )


def test_a_saturated_drive(plant):
    law = lambda t, state: [20 * lw.math.sin(6 * t)]  # noqa: E731
    hard = plant.simulate(
        plant.home, law, duration=1.0, drives={"slide": Saturated(5.0)}, save_at=TIMES
    )
    soft = plant.simulate(
        plant.home, law, duration=1.0, drives={"slide": Saturated(5.0, smooth=True)}, save_at=TIMES
    )
    command = 20 * np.sin(6 * TIMES)
    assert np.allclose(hard["command"].values[:, 0], command, 0, 1e-12)
    assert np.allclose(hard["actuator_force"].values[:, 0], np.clip(command, -5, 5), 0, 1e-12)
    assert np.allclose(soft["actuator_force"].values[:, 0], 5 * np.tanh(command / 5), 0, 1e-12)


def test_a_dc_motor_follows_its_linear_equations(plant):
    """(i, w)' = [[-R/L, -K N/L], [K N/m, 0]] (i, w) + (V/L, 0): the matrix exponential gives the
    response."""
    from scipy.linalg import expm

    R, L, K, N, V = 2.0, 0.05, 0.3, 4.0, 10.0
    run = plant.simulate(
        plant.home,
        [V],
        duration=1.0,
        drives={"slide": DCMotor(R, L, K, N)},
        save_at=TIMES,
        rtol=1e-10,
    )
    A = np.array([[-R / L, -K * N / L, V / L], [K * N / 2.0, 0, 0], [0, 0, 0]])
    expected = np.array([expm(A * t) @ [0, 0, 1] for t in TIMES])
    assert np.allclose(run["drive_state"].values[:, 0], expected[:, 0], 0, 1e-7)
    assert np.allclose(run["joint_rate"].values[:, 0], expected[:, 1], 0, 1e-7)
    assert np.allclose(run["actuator_force"].values[:, 0], K * N * expected[:, 0], 0, 1e-7)
    assert run["drive_state"].attrs["units"] == "A" and run["command"].attrs["units"] == "V"
    assert list(run.dataset.extra.values) == ["slide.current"]


def test_a_drives_numbers_are_parameters(plant):
    motor = DCMotor(2.0, 0.05, 0.3, 4.0)
    stronger = plant.simulate(
        plant.home,
        [10.0],
        duration=1.0,
        drives={"slide": motor},
        save_at=TIMES,
        parameters={"slide.gear": 6.0},
    )
    other = plant.simulate(
        plant.home,
        [10.0],
        duration=1.0,
        drives={"slide": DCMotor(2.0, 0.05, 0.3, 6.0)},
        save_at=TIMES,
    )
    assert np.allclose(stronger["joint_position"], other["joint_position"], 0, 1e-12)


def test_an_ideal_drive_changes_nothing(plant):
    bare = plant.simulate(plant.home, [3.0], duration=1.0, save_at=TIMES)
    ideal = plant.simulate(
        plant.home, [3.0], duration=1.0, save_at=TIMES, drives={"slide": Ideal()}
    )
    assert np.allclose(bare["joint_position"], ideal["joint_position"], 0, 1e-13)


def damped(viscous: float) -> lw.Robot:
    body = lw.Body(mass=5.0, inertia=lw.Inertia(zz=1.0))
    slide = lw.PrismaticJoint(
        connects=("ground", "cart"), axis=(1, 0, 0), friction=lw.Friction(viscous=viscous)
    )
    return lw.Robot(
        lw.Mechanism(bodies={"cart": body}, joints={"slide": slide}, actuators=("slide",))
    )


AIR = dict(
    area_a=1.2e-3, area_b=1.0e-3, stroke=0.5, supply=7e5, exhaust=1.01325e5, initial_a=3e5,
    initial_b=3e5, dead_volume=2e-5
)  # fmt: skip


def test_pneumatic_flow_by_hand():
    """Choked: m' = C rho_0 p_1. Subsonic at r = 0.65, b = 0.3: psi = sqrt(1 - (0.35 / 0.7)^2) =
    sqrt(3) / 2."""
    drive = PneumaticCylinder(**AIR, conductance=2e-8, critical_ratio=0.3)
    assert np.isclose(drive.flow(7e5, 1e5), 2e-8 * 1.185 * 7e5, 1e-12)
    assert np.isclose(drive.flow(7e5, 0.65 * 7e5), 2e-8 * 1.185 * 7e5 * np.sqrt(3) / 2, 1e-12)
    assert np.isclose(drive.flow(1e5, 7e5), -drive.flow(7e5, 1e5), 1e-12)
    assert drive.flow(5e5, 5e5) == 0


def test_a_pneumatic_cylinder_with_closed_valve_is_a_spring():
    """A trapped gas p V^n = const: frequency^2 = n (p_a A_a^2 / V_a + p_b A_b^2 / V_b) / m about
    equilibrium."""
    p_b = 4e5
    p_a = (p_b * 1e-3 + 101325 * 0.2e-3) / 1.2e-3  # forces in balance
    drive = PneumaticCylinder(**(AIR | {"initial_a": p_a, "initial_b": p_b}), retracted=-0.25)
    robot = damped(0.0)
    V_a, V_b = 2e-5 + 1.2e-3 * 0.25, 2e-5 + 1e-3 * 0.25
    stiffness = 1.2 * (p_a * 1.2e-3**2 / V_a + p_b * 1e-3**2 / V_b)
    omega = np.sqrt(stiffness / 5.0)
    times = np.linspace(0, 2 * np.pi / omega, 33)
    run = robot.simulate(
        robot.state([0.0], [1e-4]),
        [0.0],
        duration=times[-1],
        drives={"slide": drive},
        save_at=times,
    )
    assert np.allclose(
        run["joint_position"].values[:, 0],
        1e-4 / omega * np.sin(omega * times),
        0,
        1e-3 * 1e-4 / omega,
    )


def test_a_pneumatic_cylinder_fills_to_the_supply(plant):
    """Held in place by a stiff spring, an open valve brings A to the supply's pressure and B to the
    exhaust's."""
    slide = lw.PrismaticJoint(
        connects=("ground", "cart"), axis=(1, 0, 0), spring=lw.Spring(stiffness=1e5, damping=3e3)
    )
    body = lw.Body(mass=5.0, inertia=lw.Inertia(zz=1.0))
    robot = lw.Robot(
        lw.Mechanism(bodies={"cart": body}, joints={"slide": slide}, actuators=("slide",))
    )
    drive = PneumaticCylinder(**AIR, retracted=-0.25)
    run = robot.simulate(
        robot.home,
        [1.0],
        duration=3.0,
        drives={"slide": drive},
        method="rodas",
        rtol=1e-6,
        save_at=[0, 3.0],
    )
    assert run.success
    assert np.allclose(run["drive_state"].values[-1], [7e5, 1.01325e5], 2e-3)
    force = 7e5 * 1.2e-3 - 1.01325e5 * 1e-3 - 101325 * 0.2e-3
    assert np.isclose(run["actuator_force"].values[-1, 0], force, 2e-3)
    assert np.isclose(run["joint_position"].values[-1, 0], force / 1e5, 2e-3)


def test_flow_of_warm_air():
    """ISO 6358: the mass flow falls with the square root of the temperature upstream: 0.938 at 60
    C."""
    cold, warm = (PneumaticCylinder(**AIR, temperature=T).flow(7e5, 1e5) for T in (293.15, 333.15))
    assert np.isclose(warm / cold, np.sqrt(293.15 / 333.15), 1e-14)


@pytest.mark.parametrize("command", [1.0, -1.0])
def test_a_pneumatic_piston_stops_at_both_ends_of_its_stroke(command):
    """There the chambers come to the supply's and the exhaust's pressure, and the stop gives way by
    F / k."""
    drive, robot = PneumaticCylinder(**AIR, retracted=-0.2), damped(20.0)
    law = lw.Sampled([0.0, 4.0, 8.0], [[command], [-command], [0.0]], "hold")
    run = robot.simulate(
        robot.home, law, duration=8.0, drives={"slide": drive}, save_at=np.linspace(0, 8, 161)
    )
    assert run.success
    x, p = run["joint_position"].values[:, 0], run["drive_state"].values
    assert x.min() > -0.2 - 5e-3
    assert x.max() < 0.3 + 5e-3
    assert p.min() > 1.01325e5 / 2
    assert p.max() < 2 * 7e5
    out = 7e5 * 1.2e-3 - 1.01325e5 * 1e-3 - 101325 * 0.2e-3
    back = 1.01325e5 * 1.2e-3 - 7e5 * 1e-3 - 101325 * 0.2e-3
    stiffness = 7e5 * 1.2e-3 / (1e-3 * 0.5)
    ends = [0.3 + out / stiffness, -0.2 + back / stiffness][:: int(command)]
    assert np.allclose(x[[80, 160]], ends, 0, 1e-7)


def test_a_piston_outside_of_its_stroke_is_refused(plant):
    drive = PneumaticCylinder(**AIR, retracted=0.1)
    sentence = (
        "drive of 'slide': the joint coordinate 0 m lies outside of the stroke .* from "
        "retracted = 0.1 m to 0.6 m"
    )
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, [1.0], duration=1.0, drives={"slide": drive})
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.ensemble(plant.home, [1.0], duration=1.0, drives={"slide": drive})
    moved = plant.simulate(
        plant.home,
        [0.0],
        duration=0.01,
        drives={"slide": drive},
        parameters={"slide.retracted": -0.1},
    )
    assert moved.success


OIL = dict(
    area_a=1e-3, area_b=1e-3, stroke=0.8, supply=14e6, exhaust=1e5, initial_a=7e6, initial_b=7e6,
    dead_volume=1e-4, flow=2e-4, drop=3.5e6, bulk_modulus=1.4e9, retracted=-0.1,
)  # fmt: skip


def test_a_hydraulic_cylinder_reaches_its_steady_rate():
    """Symmetric: w = Q / A with Q = flow s sqrt((p_s - p_t - p_L) / 2 drop), load pressure p_L = d
    w / A (Merritt, sec. 6)."""
    robot = damped(2e4)
    run = robot.simulate(
        robot.home,
        [0.5],
        duration=1.0,
        drives={"slide": HydraulicCylinder(**OIL)},
        method="rodas",
        rtol=1e-8,
        save_at=[0, 1.0],
    )
    assert run.success
    rate = run["joint_rate"].values[-1, 0]
    p_a, p_b = run["drive_state"].values[-1]
    assert np.isclose(p_a - p_b, 2e4 * rate / 1e-3, 1e-3)
    assert np.isclose(
        rate, 0.5 * 2e-4 / 1e-3 * np.sqrt((14e6 - 1e5 - (p_a - p_b)) / (2 * 3.5e6)), 1e-3
    )
    assert np.isclose(p_a + p_b, 14e6 + 1e5, 1e-3)


def test_a_hydraulic_piston_stops_at_the_end_of_its_stroke():
    drive, robot = HydraulicCylinder(**OIL), damped(2e4)
    run = robot.simulate(
        robot.home, [1.0], duration=6.0, drives={"slide": drive}, save_at=np.linspace(0, 6, 121)
    )
    assert run.success
    x, p = run["joint_position"].values[:, 0], run["drive_state"].values
    assert np.isclose(x[-1], 0.7 + (14e6 - 1e5) * 1e-3 / (14e6 * 1e-3 / (1e-3 * 0.8)), 0, 1e-6)
    assert x.max() < 0.7 + 2e-3
    assert np.allclose(p[-1], [14e6, 1e5], 1e-3)


def test_oil_that_is_drawn_apart_keeps_a_pressure_above_zero():
    """A closed valve, and a load that pulls: chamber B bears it, p_b A_b = load + p_a A_a; in A,
    which grows, the oil's air

    takes up the volume that the oil leaves, air V_0 p_0 / p_a + V_0 (1 - p / beta ...): the
    balances of both chambers.
    """
    robot, load = damped(2e4), 1.2e4
    drive = HydraulicCylinder(**(OIL | {"initial_a": 2e5, "initial_b": 2e5}), air=1e-3)
    wrench = lw.control.Wrench("cart", force=(load, 0.0, 0.0))
    run = robot.simulate(
        robot.home,
        [0.0],
        duration=3.0,
        drives={"slide": drive},
        wrenches=[wrench],
        save_at=np.linspace(0, 3, 61),
    )
    assert run.success
    x, (p_a, p_b) = run["joint_position"].values[-1, 0], run["drive_state"].values[-1]
    assert run["drive_state"].values.min() > 0
    assert p_a < 1.5e5
    assert np.isclose(p_b * 1e-3, load + p_a * 1e-3, 1e-4)
    for start, area, p in ((1e-4 + 1e-3 * 0.1, 1e-3, p_a), (1e-4 + 1e-3 * 0.7, -1e-3, p_b)):
        grown = np.log((start + area * x) / start)
        assert np.isclose(grown, -(p - 2e5) / 1.4e9 + 1e-3 * 1e5 * (1 / p - 1 / 2e5), 1e-4)


def test_leakage_bleeds_a_pressure_difference():
    """Valve closed, piston held by a stiff spring: (p_a - p_b)' = -c beta (1/V_a + 1/V_b)
    (p_a - p_b)."""
    slide = lw.PrismaticJoint(
        connects=("ground", "cart"), axis=(1, 0, 0), spring=lw.Spring(stiffness=1e12)
    )
    body = lw.Body(mass=1e6, inertia=lw.Inertia(zz=1.0))
    robot = lw.Robot(
        lw.Mechanism(bodies={"cart": body}, joints={"slide": slide}, actuators=("slide",))
    )
    drive = HydraulicCylinder(**(OIL | {"initial_a": 9e6, "leakage": 1e-12}))
    V_a, V_b = 1e-4 + 1e-3 * 0.1, 1e-4 + 1e-3 * 0.7
    rate = 1e-12 * 1.4e9 * (1 / V_a + 1 / V_b)
    run = robot.simulate(
        robot.home, [0.0], duration=0.05, drives={"slide": drive}, save_at=[0, 0.05], rtol=1e-6
    )
    p_a, p_b = run["drive_state"].values[-1]
    assert np.isclose(p_a - p_b, 2e6 * np.exp(-rate * 0.05), 1e-3)


@pytest.mark.parametrize(
    ("drives", "sentence"),
    [
        ({"slid": Ideal()}, "there is no actuator 'slid' for a drive; there are slide"),
        ({"slide": 3.0}, "the drive of 'slide' is 3.0"),
        ([Lag(0.1)], r"drives are \[Lag.*; give them by name"),
    ],
)
def test_refusals(plant, drives, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, [1.0], duration=1.0, drives=drives)


def test_numbers_that_no_drive_has_are_refused():
    for make, sentence in {
        lambda: Lag("a"): "time_constant of Lag is 'a'; give numbers",
        lambda: DCMotor(
            1.0, 1e-3, 0.05, gear=np.nan
        ): "gear of DCMotor is nan; give finite numbers",
        lambda: Lag(0.1, initial_force=np.inf): "initial_force of Lag is inf",
    }.items():
        with pytest.raises(lw.LinkworkError, match=sentence):
            make()
    with pytest.raises(lw.LinkworkError, match="time_constant of Lag is 0; give a positive number"):
        Lag(0)


def test_parameters_that_no_drive_has_are_refused(plant):
    sentence = "the drive of 'slide': resistance of DCMotor is -1.0; give a positive number"
    given = {"duration": 0.1, "drives": {"slide": DCMotor(1.0, 1e-3, 0.05)}}
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.simulate(plant.home, [1.0], parameters={"slide.resistance": -1.0}, **given)
    with pytest.raises(lw.LinkworkError, match=sentence):
        plant.ensemble(plant.home, [1.0], {"slide.resistance": [1.0, -1.0]}, **given)


@pytest.mark.parametrize("drive", [Saturated(5.0), Saturated(5.0, smooth=True), Lag(0.1)])
def test_no_drive_hides_an_undefined_command(plant, drive):
    run = plant.simulate(
        plant.home, lambda t, s: [lw.math.log(0.2 - t)], duration=0.4, drives={"slide": drive}
    )
    assert run.status is lw.Status.NON_FINITE and np.isclose(run.attrs["final_time"], 0.2, 1e-6)
    assert "the controller's force on slide is infinite or undefined" in run.message
    members = plant.ensemble(
        plant.home, lambda t, s: [lw.math.log(0.2 - t)], duration=0.4, drives={"slide": drive}
    )
    assert members.status[
        0
    ] == lw.Status.NON_FINITE and "the controller's force on slide" in members.message(0)


def test_numbers_of_a_drive_are_judged_with_those_that_they_are_given_with():
    """Both bounds of an excitation below the drive's own lower one, or one above the other."""
    robot = cart()
    muscle = lw.control.Muscle(10.0, 0.5, least_excitation=0.5)
    least, largest = "slide.least_excitation", "slide.largest_excitation"
    sentence = r"the drive of 'slide': .* give them so that 0 <= least"

    def single(**given):
        return robot.simulate(
            robot.home, [0.3], drives={"slide": muscle}, parameters=given, duration=1e-3
        )

    assert single(**{least: 0.1, largest: 0.4}).status is lw.Status.FINISHED
    with pytest.raises(lw.LinkworkError, match=sentence):
        single(**{largest: 0.4})
    many = {"drives": {"slide": muscle}, "duration": 1e-3}
    members = robot.ensemble(robot.home, [0.3], {least: [0.1, 0.6], largest: [0.4, 0.9]}, **many)
    assert len(members.failed) == 0
    with pytest.raises(lw.LinkworkError, match=sentence):
        robot.ensemble(robot.home, [0.3], {least: [0.1, 0.9], largest: [0.4, 0.6]}, **many)


@pytest.mark.parametrize(
    ("drives", "sentence"),
    [
        ({"slide_2": Lag(0.05)}, r"'slide_1.force', where .* have 'slide_2.force'"),
        ({"slide_1": DCMotor(2.0, 0.05, 0.3)}, r"'slide_1.force', where .* have 'slide_1.current'"),
    ],
)
def test_states_of_other_drives_are_not_gone_on_with(drives, sentence, tmp_path):
    """A lag's force [N] was taken for a motor's current [A], or for that of another slide."""
    robot = lw.Robot("prr3")
    run = robot.simulate(robot.home, [1, 0, 0], duration=0.1, drives={"slide_1": Lag(0.05)})
    loaded = lw.Run.load(run.save(tmp_path / "run.nc"))
    for one in (run, loaded, robot.stepper(run, 1e-3, drives={"slide_1": Lag(0.05)}).run):
        with pytest.raises(lw.LinkworkError, match=sentence):
            robot.resume(one, [1, 0, 0], duration=0.1, drives=drives)
        with pytest.raises(lw.LinkworkError, match=sentence):
            robot.stepper(one, 1e-3, drives=drives)
        slower = robot.resume(one, [1, 0, 0], duration=0.1, drives={"slide_1": Lag(0.5)})
        begun = slower["drive_state"].values[0, 0]
        assert begun == one["drive_state"].values[-1, 0] > 0.8
