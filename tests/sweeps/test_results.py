"""What a chunk holds: motions known in closed form, runs by `Robot.simulate`, ways to end."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.sweeps import Study, StudyError
from linkwork.sweeps.chunk import digest
from linkwork.sweeps.preparation import REFUSED, UNREACHABLE, Bench
from linkwork.sweeps.starts import starts

from tests.sweeps.carts import study, whole


def test_a_cart_under_a_constant_force():
    T = 0.5
    found = whole(
        study(
            vary={
                "cart.mass": {"type": "uniform", "low": 1, "high": 3},
                "forces.rail": {"type": "normal", "mean": 2, "deviation": 1},
                "start.joints.rail": {"type": "uniform", "low": -1, "high": 1},
                "start.rates.rail": {"type": "triangular", "low": 0, "mode": 1, "high": 2},
            },
            forces={},
            outputs={
                "end": "final joint_position",
                "tool": "final tool_pose.x",
                "speed": "maximum joint_rate.rail",
                "acceleration": "mean joint_acceleration.rail",
                "force": "peak actuator_force.rail",
                "work": "integral actuator_power.rail",
                "energy": "final kinetic_energy",
                "impulse": "total actuator_force.rail",
            },
            trajectories=("joint_position",),
        )
    )
    m, F, x0, v0 = (
        found[name]
        for name in ("cart.mass", "forces.rail", "start.joints.rail", "start.rates.rail")
    )
    a, t = F / m, np.linspace(0, T, 101)
    end, v = x0 + v0 * T + a * T**2 / 2, v0 + a * T
    close = {"rtol": 1e-9, "atol": 1e-9}
    np.testing.assert_allclose(found["end"][:, 0], end, **close)
    np.testing.assert_allclose(found["tool"], end, **close)
    np.testing.assert_allclose(found["speed"], np.maximum(v0, v), **close)
    np.testing.assert_allclose(found["acceleration"], a, **close)
    np.testing.assert_allclose(found["force"], np.abs(F), **close)
    np.testing.assert_allclose(found["impulse"], np.abs(F) * T, **close)
    np.testing.assert_allclose(found["energy"], m * v**2 / 2, **close)
    np.testing.assert_allclose(
        found["work"], F * (end - x0), **close
    )  # of a linear power the trapezoidal rule is exact
    path = x0[:, None] + v0[:, None] * t + a[:, None] * t**2 / 2
    np.testing.assert_allclose(found["joint_position"][..., 0], path, **close)


def test_two_controllers_on_a_cart():
    goal = {"type": "pose", "joints": {"rail": 0.2}}
    found = whole(
        study(
            forces={},
            controllers={
                "soft": {"type": "pd", "kp": 40, "kd": 0, "goal": goal},
                "wrong": {
                    "type": "computed_torque",
                    "kp": 100,
                    "kd": 0,
                    "goal": goal,
                    "model": {"cart.mass": 4},
                },
            },
            vary={
                "cart.mass": {"type": "uniform", "low": 1, "high": 3},
                "controllers.soft.kp": {"type": "log_uniform", "low": 10, "high": 100},
            },
            outputs={
                "error": "final tracking_error.rail",
                "force": "peak actuator_force.rail",
                "off": "final tool_error.x",
            },
            rtol=1e-10,
        )
    )
    assert found["controller"].tolist() == [0, 1] * 40
    np.testing.assert_array_equal(found["cart.mass"][::2], found["cart.mass"][1::2])
    m, soft = found["cart.mass"], found["controller"] == 0
    stiffness = np.where(soft, found["controllers.soft.kp"], 4 * 100)
    error = 0.2 * np.cos(np.sqrt(stiffness / m) * 0.5)  # an undamped spring
    np.testing.assert_allclose(found["error"], error, atol=1e-8)
    np.testing.assert_allclose(found["off"], -error, atol=1e-8)
    np.testing.assert_allclose(found["force"], 0.2 * stiffness, rtol=1e-8)


def test_drives_have_numbers_that_vary():
    found = whole(
        study(
            drives={"rail": {"type": "lag", "time_constant": 0.1}},
            vary={"drives.rail.time_constant": {"type": "uniform", "low": 0.05, "high": 0.2}},
            outputs={"force": "final actuator_force.rail", "state": "final drive_state"},
        )
    )
    force = 3 * (1 - np.exp(-0.5 / found["drives.rail.time_constant"]))
    np.testing.assert_allclose(found["force"], force, rtol=1e-7)
    np.testing.assert_allclose(found["state"][:, 0], force, rtol=1e-7)


def test_methods_of_fixed_steps():
    """Euler's symplectic steps of a constant acceleration end at a h^2 N (N + 1) / 2, those of
    order 4 at a T^2 / 2."""
    outputs = {"end": "final joint_position.rail"}
    for method, exact in (("symplectic_euler", 0.01**2 * 50 * 51 / 2), ("rk4", 0.5**2 / 2)):
        found = whole(study(outputs=outputs, method=method, step=0.01))
        np.testing.assert_allclose(found["end"], 3 / found["cart.mass"] * exact, rtol=1e-12)


def test_members_are_the_runs_that_simulate_makes():
    given = Study(
        robot=lw.robots.prr3(),
        duration=0.2,
        samples=41,
        forces={"slide_1": 2.0},
        start={"tool": (0.5, 0.3, 0.5)},
        vary={
            "platform.mass": {"type": "uniform", "low": 1, "high": 2, "also": ("link_1.mass",)},
            "wrist_2.frames.0.position.x": {"type": "normal", "mean": 0.3, "deviation": 1e-3},
            "start.tool.x": {"type": "uniform", "low": 0.48, "high": 0.52},
        },
        design={"type": "sobol", "members": 8},
        outputs={
            "force": "peak actuator_force",
            "drop": "range energy",
            "speed": "rms joint_rate",
            "weakest": "minimum conditioning",
        },
        trajectories=("joint_position", "tool_pose", "actuator_power"),
    )
    found = whole(given)
    assert (found["status"] == 0).all()
    times = np.linspace(0, 0.2, 41)
    for i in (0, 5):
        values = {path: found[path][i] for path in given.paths}
        assert values["link_1.mass"] == values["platform.mass"]
        other = lw.Robot(lw.robots.prr3(), free=given.paths).with_parameters(values)
        start = other.assemble(tool=(found["start.tool.x"][i], 0.3, 0.5))
        run = other.simulate(start, {"slide_1": 2.0}, duration=0.2, save_at=times)
        for name in given.trajectories:
            np.testing.assert_allclose(found[name][i], run.variables[name].values, atol=1e-7)
        rate = run.variables["joint_rate"].values
        np.testing.assert_allclose(
            found["speed"][i] ** 2,
            np.trapezoid(rate**2, times, axis=0) / 0.2,
            rtol=1e-6,
            atol=1e-12,
        )
        energy = run.variables["kinetic_energy"].values + run.variables["potential_energy"].values
        np.testing.assert_allclose(found["drop"][i], np.ptp(energy), atol=1e-7)
        np.testing.assert_allclose(
            found["weakest"][i], run.variables["conditioning"].values.min(), rtol=1e-6
        )


def test_a_member_does_not_depend_on_the_chunk_it_is_in():
    vary = {"cart.mass": {"type": "uniform", "low": 1, "high": 3}}
    one, other = (whole(study(vary=vary, chunk=length)) for length in (7, 40))
    assert all(np.array_equal(one[name], other[name]) for name in one)
    assert digest(one) == digest(other) != digest(one | {"end": one["end"] + 1e-15})


def test_starts_out_of_reach_and_impossible_numbers_are_told():
    given = Study(
        robot=lw.robots.prr3(),
        duration=0.01,
        start={"tool": (0.5, 0.3, 0.5)},
        vary={"start.tool.x": {"type": "values", "values": (0.5, 30.0)}},
        outputs={"end": "final tool_pose.x"},
    )
    found = whole(given)
    assert found["status"].tolist() == [0, UNREACHABLE]
    assert np.isnan(found["end"]).tolist() == [False, True]
    body = {"mass": 1.0, "inertia": {"xx": 1.0, "yy": 1.0, "zz": 1.0}}
    ball = lw.Mechanism(
        bodies={"ball": body}, joints={"free": {"type": "free", "connects": ("ground", "ball")}}
    )
    vary = {
        f"ball.inertia.{axis}": {"type": "values", "values": (0.4, 1.9)} for axis in ("xx", "yy")
    }
    found = whole(
        Study(robot=ball, duration=0.01, vary=vary, outputs={"energy": "final kinetic_energy"})
    )
    assert found["status"].tolist() == [
        REFUSED,
        REFUSED,
        REFUSED,
        0,
    ]  # 0.4 + 0.4 < 1, and 0.4 + 1 < 1.9


def test_members_start_on_the_branch_of_the_study_s_start():
    """Poses behind the edge of the workspace, where Newton's method from the start alone ends with
    an elbow turned over."""
    robot = lw.Robot(lw.robots.five_bar())
    home = robot.tool_pose(robot.home)[:2]
    given = Study(
        robot=lw.robots.five_bar(),
        duration=0.1,
        start={"tool": tuple(home)},
        vary={f"start.tool.{axis}": {"type": "uniform", "low": -0.3, "high": 0.3} for axis in "xy"},
        design={"type": "sobol", "members": 4},
        outputs={"end": "final tool_pose"},
    )
    poses = np.array([home, (0.2236, -0.1075), (-0.0804, -0.0660)])
    made, status = starts(Bench.of(given), poses)
    assert (status == 0).all()
    elbows = [robot.coordinates.index(name) for name in ("elbow_1", "elbow_2")]
    np.testing.assert_array_equal(np.sign(np.sin(made.positions[:, elbows])), [[-1, 1]] * 3)
    np.testing.assert_allclose(
        robot.tool_pose(robot.state(made.positions))[:, :2], poses, atol=1e-9
    )


@pytest.mark.parametrize(("name", "away"), [("linear_delta", 0.4), ("four_bar", 14.0)])
def test_joints_far_from_where_a_study_starts_stay_on_its_branch_with_their_turns(name, away):
    """As the robot assembles them, from the same configuration."""
    robot = lw.Robot(name)
    vary = {
        f"start.joints.{each}": {
            "type": "uniform",
            "low": robot.home[each] - away,
            "high": robot.home[each] + away,
        }
        for each in robot.independent
    }
    given = study(
        robot=robot.mechanism,
        start={},
        forces={},
        vary=vary,
        design={"type": "random", "members": 60, "seed": 1},
        outputs={"energy": "final kinetic_energy"},
    )
    values = given.design.points(tuple(given.vary.values()), 0, 60)
    made, status = starts(Bench.of(given), values)
    assert not status.any()
    expected = robot.assemble(dict(zip(robot.independent, values.T, strict=True)))
    np.testing.assert_allclose(made.positions, expected.positions, rtol=0, atol=1e-8)
    np.testing.assert_allclose(made.q, expected.q, rtol=0, atol=1e-8)


@pytest.mark.parametrize(("name", "asked"), [("five_bar", "elbow_2"), ("rrr3", "motor_1")])
def test_fewer_joints_than_determine_the_start_are_where_the_robot_assembles_them(name, asked):
    """Many configurations have them: the study's members and `assemble` choose the same one."""
    robot = lw.Robot(name)
    values = robot.home[asked] + np.linspace(-0.4, 0.4, 5)
    given = study(
        robot=robot.mechanism,
        start={"joints": {asked: robot.home[asked] + 0.1}},
        forces={},
        vary={f"start.joints.{asked}": {"type": "values", "values": tuple(values)}},
        design={"type": "grid"},
        outputs={"energy": "final kinetic_energy"},
    )
    bench = Bench.of(given)
    made, status = starts(bench, values[:, None])
    assert not status.any()
    for i, value in enumerate(values):
        expected = robot.assemble({asked: value}, guess=bench.start)
        np.testing.assert_array_equal(made.positions[i], expected.positions)


def test_fewer_joints_are_led_to_from_where_the_member_s_own_loops_are_closed():
    """As the robot of these lengths assembles them, from its home."""
    name, asked, path = "delta", "motor_2", "motor_3.frames.0.position.x"
    robot = lw.Robot(name)
    values, places = robot.home[asked] + np.array([-0.2, 0.1, 0.2]), np.array([-0.02, 0.0, 0.03])
    places += robot.mechanism.joints["motor_3"].frames[0].position[0]
    vary = {f"start.joints.{asked}": values, path: places}
    given = study(
        robot=robot.mechanism,
        start={},
        forces={},
        vary={each: {"type": "values", "values": tuple(of)} for each, of in vary.items()},
        design={"type": "grid"},
        outputs={"energy": "final kinetic_energy"},
    )
    made, status = starts(Bench.of(given), np.column_stack([values, places]))
    assert not status.any()
    for i, (value, place) in enumerate(zip(values, places, strict=True)):
        own = lw.Robot(robot.mechanism, free=[path]).with_parameters({path: place})
        expected = own.assemble({asked: value}).positions
        np.testing.assert_allclose(made.positions[i], expected, rtol=0, atol=1e-9)


def test_fewer_joints_are_led_to_where_the_independent_ones_cannot_stay():
    """The distal links are too short for the motors' own angles: loops are closed by least
    movements first."""
    path, short = "tip.frames.0.position.x", 0.12
    robot = lw.Robot("five_bar")
    own = lw.Robot(robot.mechanism, free=[path]).with_parameters({path: short})
    home = robot.home
    near = lw.State.known(home.positions, home.rates, home.q, own.coordinates, own.independent)
    given = study(
        robot=robot.mechanism,
        start={"joints": {"elbow_2": float(robot.home["elbow_2"])}},
        forces={},
        vary={path: {"type": "values", "values": (short,)}},
        design={"type": "grid"},
        outputs={"energy": "final kinetic_energy"},
    )
    with pytest.raises(lw.LinkworkError, match="stays off"):
        own.assemble({name: float(home[name]) for name in robot.independent}, guess=near)
    made, status = starts(Bench.of(given), np.array([[short]]))
    closed = own.assemble({"elbow_2": float(home["elbow_2"])}, guess=own.assemble({}, guess=near))
    assert not status.any()
    np.testing.assert_allclose(made.positions[0], closed.positions, rtol=0, atol=1e-9)


def test_parts_of_quaternions_are_no_start_that_varies():
    vary = {"start.joints.ball_1.qx": {"type": "uniform", "low": 0, "high": 0.1}}
    given = study(
        robot=lw.robots.rrs3(),
        start={},
        forces={},
        vary=vary,
        outputs={"e": "final kinetic_energy"},
    )
    with pytest.raises(StudyError, match=r"ball_1.qx: is nothing that can vary; .*joints.knee_1"):
        Bench.of(given)


@pytest.mark.parametrize(
    "vary",
    [
        {"crank_pin.frames.0.position.x": (0.1, 0.13)},
        {"start.joints.crank_pivot": (1.0, 1.5)},
        {"start.rates.rocker_pin": (-1.0, 2.0)},
    ],
)
def test_rates_that_a_start_gives_of_other_joints_are_those_of_all_members(vary):
    (name, values), *_ = vary.items()
    given = study(
        robot=lw.robots.four_bar(),
        duration=0.01,
        samples=2,
        start={"rates": {"rocker_pin": 1.0}},
        forces={},
        vary={name: {"type": "values", "values": values}},
        design={"type": "grid"},
        outputs={"begin": "maximum joint_rate"},
        trajectories=("joint_rate",),
    )
    place = lw.Robot("four_bar").rates.index("rocker_pin")
    wanted = values if "rates" in name else (1.0, 1.0)
    np.testing.assert_allclose(whole(given)["joint_rate"][:, 0, place], wanted, rtol=1e-12)


def test_rates_that_determine_no_motion_of_a_member_are_out_of_its_reach():
    """Where the crank lies along the rod the slide rests."""
    given = study(
        robot=lw.robots.slider_crank(),
        duration=0.01,
        start={"joints": {"crank": 0.7}, "rates": {"slide": 0.1}},
        forces={},
        vary={"start.joints.crank": {"type": "values", "values": (0.0, 0.5)}},
        design={"type": "grid"},
        outputs={"begin": "maximum joint_rate"},
    )
    assert whole(given)["status"].tolist() == [UNREACHABLE, 0]
