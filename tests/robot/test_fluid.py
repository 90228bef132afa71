"""Motion in a fluid: closed solutions, the energy balance, and what is refused."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations.fluid import added
from linkwork.mechanism import BoxDrag, EllipsoidDrag, Fluid

G, M, R = 9.81, 2.0, 0.1
BALL = {
    "bodies": {"ball": {"mass": M, "inertia": {"xx": 0.01, "yy": 0.01, "zz": 0.01}}},
    "joints": {"drop": {"type": "prismatic", "connects": ["ground", "ball"], "axis": [0, 0, -1]}},
}
ROUND = EllipsoidDrag(body="ball", radii=(R, R, R))


def dropped(fluid, drag, **fields):
    return lw.Robot(lw.Mechanism(**BALL, fluid=fluid, drags={"skin": drag}, **fields))


def speed(robot, duration, **options):
    run = robot.simulate(robot.home, duration=duration, rtol=1e-11, atol=1e-13, **options)
    assert run.success
    return run, float(run["joint_rate"].isel(time=-1, rate=0))


def test_a_ball_falls_in_syrup_as_stokes_says():
    mu = 3.0
    _, v = speed(dropped(Fluid(viscosity=mu), ROUND), 0.7)
    c = 6 * np.pi * mu * R
    assert v == pytest.approx(M * G / c * (1 - np.exp(-c * 0.7 / M)), rel=1e-9)


@pytest.mark.parametrize(
    ("drag", "area"),
    [
        (ROUND, 0.5 * np.pi * R**2),
        (BoxDrag(body="ball", size=(0.3, 0.2, 0.5)), 0.5 * 0.3 * 0.2),
        (EllipsoidDrag(body="ball", radii=(0.2, 0.3, 0.5), blunt=0.7), 0.0),
    ],
)
def test_a_body_falls_in_air_as_the_square_of_its_speed_says(drag, area):
    """m v' = m g - rho A v^2; of an ellipsoid that falls along its long axis, the end of which
    is what it shows, A = c_b pi a b + c_s (pi b c - pi a b)."""
    rho = 40.0
    area = area or np.pi * (0.7 * 0.2 * 0.3 + 0.25 * (0.3 * 0.5 - 0.2 * 0.3))
    _, v = speed(dropped(Fluid(density=rho), drag), 0.9)
    k = rho * area
    terminal = np.sqrt(M * G / k)
    assert v == pytest.approx(terminal * np.tanh(G * 0.9 / terminal), rel=1e-9)


def test_wind_carries_and_brings_energy_in():
    """Without weight a ball takes on the wind's speed, 1/(U - v) growing with time."""
    robot = dropped(
        Fluid(density=5, wind=(0, 0, -3)), ROUND, gravity=(0, 0, 0), actuators=("drop",)
    )
    run, v = speed(robot, 2.0)
    k = 5 * 0.5 * np.pi * R**2 / M
    assert v == pytest.approx(3 - 1 / (1 / 3 + k * 2.0), rel=1e-9)
    assert run["fluid_power"].dims == ("time", "drag") and (run["fluid_power"] >= 0).all()
    assert np.abs(run["energy_balance"]).max() < 1e-9 * run["kinetic_energy"].max()


def test_the_fluid_that_a_body_carries_along_is_lambs():
    """A sphere carries half of what it displaces, a disc 8/3 a^3, a long rod all across itself; a
    thin disc that turns 16/45 a^5."""
    mass, inertia = added(np.array([R, R, R]))
    assert mass == pytest.approx(np.full(3, 2 / 3 * np.pi * R**3)) and not inertia.any()
    mass, inertia = added(np.array([1.0, 1.0, 1e-5]))
    assert mass[2] == pytest.approx(8 / 3, rel=1e-4)
    assert inertia == pytest.approx([16 / 45, 16 / 45, 0], rel=1e-4)
    mass, _ = added(np.array([1.0, 1.0, 1e4]))
    assert mass[:2] / (4 / 3 * np.pi * 1e4) == pytest.approx(np.ones(2), rel=1e-5)


LEAF = """
linkwork: 1
bodies:
  leaf: {mass: 0.3, centre_of_mass: [0.1, 0, 0], inertia: {xx: 0.01, yy: 0.02, zz: 0.03}}
joints:
  stalk: {type: spherical, connects: [ground, leaf]}
fluid: {density: 1.2, viscosity: 0.1, wind: [2, 0.5, 0]}
drags:
  blade: {type: ellipsoid, body: leaf, radii: [0.3, 0.2, 0.02],
          frame: {position: [0.2, 0, 0], rotation: [0.3, 0.2, 0.1]}}
  rib: {type: box, body: leaf, size: [0.3, 0.02, 0.02]}
"""


def moving(robot):
    """Return home, turning."""
    return robot.state(robot.home.positions, {"stalk.wx": 3.0, "stalk.wy": -1.0, "stalk.wz": 2.0})


def test_the_energy_balance_and_lanes_know_the_fluid(tmp_path):
    mechanism = lw.Mechanism.parse(LEAF)
    assert lw.Mechanism.parse(mechanism.text) == mechanism
    robot = lw.Robot(mechanism)
    start = moving(robot)
    run = robot.simulate(start, duration=1.0, rtol=1e-10, atol=1e-12)
    assert np.abs(run["energy_balance"]).max() < 1e-9 * np.abs(run["work"]).max()
    together = robot.state(np.tile(start.positions, (3, 1)), np.tile(start.rates, (3, 1)))
    runs = robot.ensemble(together, duration=1.0, save_at=[1.0], rtol=1e-10, atol=1e-12)
    ends = runs.dataset["joint_position"].isel(time=-1)
    assert np.abs(ends - run["joint_position"].isel(time=-1)).max() < 1e-8


def test_derivatives_at_rest_are_finite():
    still = lw.Mechanism.parse(LEAF.replace("[2, 0.5, 0]", "[0, 0, 0]"))
    linear = lw.Robot(still).linearise(lw.Robot(still).home)
    assert np.isfinite(linear.A).all() and np.abs(linear.A).max() > 0


def test_density_may_be_free_and_half_axes_may_not():
    mechanism = lw.Mechanism.parse(LEAF)
    free = lw.Robot(mechanism, free=["fluid.density", "rib.size.0", "drags.blade.blunt"])
    thick = lw.Robot(lw.Mechanism.parse(LEAF.replace("1.2", "9")))
    changed = free.with_parameters({"fluid.density": 9.0})
    expected = thick.forward_dynamics(moving(thick), [])
    assert changed.forward_dynamics(moving(changed), []) == pytest.approx(expected, rel=1e-12)
    with pytest.raises(lw.LinkworkError, match="decides how much fluid moves along"):
        lw.Robot(mechanism, free=["blade.radii.x"])


@pytest.mark.parametrize(
    ("wrong", "right", "sentence"),
    [
        ("body: leaf, radii", "body: lea, radii", "drags.blade.body: there is no body 'lea'"),
        ("density: 1.2", "density: -1", "fluid.density"),
        ("type: box", "type: sheet", "drags.rib"),
        ("0.02, 0.02]}", "0.02, 0]}", "drags.rib.size.2"),
    ],
)
def test_what_is_wrong_is_named(wrong, right, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        lw.Mechanism.parse(LEAF.replace(wrong, right))


def test_a_rod_in_a_stream_is_not_idle():
    """A coupler between two balls spins idly, but not in water."""
    coupled = """
linkwork: 1
bodies:
  crank: {mass: 1, centre_of_mass: [0.1, 0, 0], inertia: {xx: 0.01, yy: 0.01, zz: 0.01}}
  rod: {mass: 1, centre_of_mass: [0.3, 0, 0], inertia: {xx: 0.01, yy: 0.1, zz: 0.1}}
  rocker: {mass: 1, centre_of_mass: [0, 0.2, 0], inertia: {xx: 0.01, yy: 0.01, zz: 0.01}}
joints:
  a: {type: revolute, connects: [ground, crank], axis: [0, 0, 1]}
  b: {type: spherical, connects: [crank, rod], frames: [{position: [0.2, 0, 0]}, {}]}
  c: {type: spherical, connects: [rod, rocker],
      frames: [{position: [0.6, 0, 0]}, {position: [0, 0.5, 0]}]}
  d: {type: revolute, connects: [ground, rocker], axis: [0.2, 0, 1],
      frames: [{position: [0.7, 0, 0.1]}, {}]}
actuators: [a]
"""
    water = "fluid: {density: 1000}\ndrags: {r: {type: box, body: rod, size: [0.6, 0.1, 0.1]}}\n"
    assert lw.Robot(lw.Mechanism.parse(coupled)).equations.idle
    assert not lw.Robot(lw.Mechanism.parse(coupled + water)).equations.idle


@pytest.mark.long
def test_wind_has_no_natural_modes_where_it_has_no_potential():
    """Its forces follow how boxes lie: going round a small way in the pose they do work."""
    body = lw.Body(mass=1.0, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
    frame = lw.Frame(position=(0.5, 0, 0))
    drags = {name: BoxDrag(body=name, frame=frame, size=(1.0, 0.5, 0.5)) for name in "ab"}

    def hanging(wind: float) -> lw.Robot:
        joints = {
            "h": lw.RevoluteJoint(connects=("ground", "a")),
            "k": lw.RevoluteJoint(
                connects=("a", "b"), frames=(lw.Frame(position=(1.0, 0, 0)), lw.Frame())
            ),
        }
        return lw.Robot(
            lw.Mechanism(
                bodies={"a": body, "b": body},
                joints=joints,
                gravity=(0, -9.81, 0),
                fluid=Fluid(density=1.2, wind=(wind, 0, 0)),
                drags=drags,
            )
        )

    still, blown = hanging(0.0), hanging(6.0)
    assert lw.analysis.natural_modes(still, lw.analysis.equilibrium(still).state).stable
    held = lw.analysis.equilibrium(blown, guess=blown.state({"h": -1.0, "k": 0.1}), stable=False)
    assert abs(held.stiffness[0, 1] - held.stiffness[1, 0]) > 0.01 * abs(held.stiffness).max()
    with pytest.raises(lw.LinkworkError, match="which has no potential, take stable=False"):
        lw.analysis.equilibrium(blown)
    with pytest.raises(lw.LinkworkError, match="wind the stiffness is not symmetric"):
        lw.analysis.natural_modes(blown, held.state)
