"""Controllers of studies: linear-quadratic ones with weights that vary, sampled ones; closed forms
on a cart."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import linkwork as lw
from linkwork.control import LQR, ComputedTorque
from linkwork.mechanism import MechanismError
from linkwork.sweeps import Study, StudyError
from linkwork.sweeps.chunk import bench_of
from linkwork.sweeps.preparation import REFUSED

from tests.sweeps.carts import CART, study, whole

POSE = {"type": "pose", "joints": {"rail": 0.2}}
LINE = {"type": "line", "start": [0.0, 0, 0, 0, 0, 0], "end": [0.1, 0, 0, 0, 0, 0]}
T = 0.5


def held(m: float, k: float, d: float, x0: float, v0: float) -> np.ndarray:
    """Return x and v at the end of a cart of mass m that a spring k and a damper d pull to 0."""
    return expm(T * np.array([[0, 1], [-k / m, -d / m]])) @ [x0, v0]


def test_weights_of_lqr_vary_and_its_model_may_be_wrong():
    """For a mass m on a rail K = sqrt(q_1 / r), sqrt((q_2 + 2 m sqrt(q_1 r)) / r)."""
    lqr = {"type": "lqr", "position": 50, "rate": {"rail": 1}, "force": 0.1, "goal": POSE}
    given = study(
        forces={},
        start={"joints": {"rail": 0.3}, "rates": {"rail": -0.1}},
        controllers={
            "right": lqr,
            "wrong": lqr | {"model": {"cart.mass": 5}},
            "still": {"type": "lqr", "position": 20, "force": 1},
        },
        vary={
            "cart.mass": {"type": "uniform", "low": 1, "high": 3},
            "controllers.right.position": {"type": "log_uniform", "low": 10, "high": 100},
            "controllers.wrong.rate.rail": {"type": "uniform", "low": 0, "high": 2},
            "controllers.right.force": {"type": "log_uniform", "low": 0.01, "high": 1},
        },
        outputs={
            "x": "final joint_position.rail",
            "v": "final joint_rate.rail",
            "error": "final tracking_error.rail",
        },
        rtol=1e-10,
    )
    found = whole(given)
    assert (found["status"] == 0).all()
    for i, case in enumerate(found["controller"]):
        q1 = (found["controllers.right.position"][i], 50, 20)[case]
        q2 = (1, found["controllers.wrong.rate.rail"][i], 0)[case]
        r = (found["controllers.right.force"][i], 0.1, 1)[case]
        k, d = np.sqrt(q1 / r), np.sqrt((q2 + 2 * (2, 5, 2)[case] * np.sqrt(q1 * r)) / r)
        goal = (0.2, 0.2, 0.3)[case]  # the last holds where runs start
        x, v = held(found["cart.mass"][i], k, d, 0.3 - goal, -0.1)
        np.testing.assert_allclose((found["x"][i], found["v"][i]), (goal + x, v), atol=1e-8)
        np.testing.assert_allclose(found["error"][i], -x, atol=1e-8)


def test_lqr_of_a_parallel_robot_is_that_of_the_library():
    robot, tool = lw.robots.prr3(), (0.52, 0.288, 0.5)
    lqr = {
        "type": "lqr",
        "position": {"slide_1": 300, "slide_2": 400, "slide_3": 500},
        "rate": 2,
        "force": 0.01,
    }
    found = whole(
        Study(
            robot=robot,
            duration=0.3,
            samples=11,
            start={"tool": (0.5, 0.288, 0.5)},
            controllers={"lqr": lqr | {"goal": {"type": "pose", "tool": tool}}},
            vary={"controllers.lqr.position.slide_2": {"type": "values", "values": (100, 400)}},
            outputs={"end": "final tool_pose"},
            trajectories=("joint_position",),
        )
    )
    plant = lw.Robot(robot)
    start = plant.assemble(tool=(0.5, 0.288, 0.5))
    for i, weight in enumerate((100, 400)):
        law = LQR.about(
            plant, plant.assemble(tool=tool, guess=start), [300, weight, 500, 2, 2, 2], [0.01] * 3
        )
        run = plant.simulate(start, law, duration=0.3, save_at=np.linspace(0, 0.3, 11))
        np.testing.assert_allclose(
            found["joint_position"][i], run.variables["joint_position"].values, atol=1e-8
        )


@pytest.mark.sample(1)
@pytest.mark.parametrize(("samples", "turns"), [(2, 1), (3, 2), (101, 20)])
def test_paths_are_followed_whatever_times_are_looked_at(samples, turns):
    """The run is that of the library along samples that lie close, and so is the tool's error."""
    robot, path = lw.robots.prr3(), {"centre": (0.5, 0.29), "radius": 0.03, "orientation": 1.2}
    plant, times, masses = lw.Robot(robot), np.linspace(0, 5, samples), (1.2, 2)
    fine = plant.follow(lw.paths.circle(**path, turns=turns), 5.0, samples=3001)
    goal = {"type": "circle", "turns": turns, **path}
    found = whole(
        Study(
            robot=robot,
            duration=5,
            samples=samples,
            controllers={"led": {"type": "computed_torque", "kp": 400, "kd": 40, "goal": goal}},
            vary={"platform.mass": {"type": "values", "values": masses}},
            outputs={"end": "final tool_pose"},
            trajectories=("tool_pose", "tool_error"),
            rtol=1e-9,
        )
    )
    law, heavier = ComputedTorque(fine, 400.0, 40.0, plant), plant.free("platform.mass")
    for i, mass in enumerate(masses):
        given = {"parameters": {"platform.mass": mass}, "rtol": 1e-9, "save_at": times}
        run = heavier.simulate(fine.state.at(0), law, duration=5.0, **given)
        poses = plant.tool_pose(plant.state(run["joint_position"].values))
        np.testing.assert_allclose(found["tool_pose"][i], poses, atol=5e-6)
        wanted = fine.tool[:: 3000 // (samples - 1)]
        np.testing.assert_allclose(found["tool_error"][i], poses - wanted, atol=5e-6)


def test_weights_that_make_no_controller_are_told(monkeypatch):
    about = LQR.about

    def only_some(robot, state, Q, R):
        if Q[0] < 1:
            raise lw.LinkworkError("the pose cannot be stabilised with these weights")
        return about(robot, state, Q, R)

    monkeypatch.setattr(LQR, "about", only_some)
    vary = {"controllers.lqr.position": {"type": "values", "values": (0.5, 1, 2)}}
    grid = {
        "forces": {},
        "design": {"type": "grid"},
        "vary": vary,
        "name": "some weights make no controller",
    }
    lqr = {"type": "lqr", "position": 1, "force": 1}
    found = whole(study(controllers={"lqr": lqr}, **grid))
    assert found["status"].tolist() == [REFUSED, 0, 0]
    assert np.isnan(found["end"]).tolist() == [True, False, False]
    with pytest.raises(
        StudyError, match=r"controllers\.lqr: the pose cannot be stabilised with these weights"
    ):
        bench_of(study(controllers={"lqr": lqr | {"position": 0.5}}, **grid))


def ready(**controller) -> None:
    bench_of(study(forces={}, controllers={"one": controller}))


@pytest.mark.parametrize(
    ("controller", "sentence"),
    [
        ({"position": -1}, "one.position: -1 is below 0"),
        (
            {"position": {"rail": 1, "slide": 1}},
            "one.position: has 'slide'; give one number, or one for each of rail",
        ),
        (
            {"rate": {"slide": 1}},
            "one.rate: (has 'slide'|lacks 'rail'); give one number, or one for each of rail",
        ),
        ({"force": 0}, "one.force: 0 is not above 0"),
        (
            {"goal": LINE},
            "one.goal.start: is not a known field; the fields here are type, tool, joints",
        ),
        ({"goal": {"type": "line"}}, "one.goal.type: 'line' is not accepted"),
        ({"model": {"cart.mas": 1}}, "one.model: 'cart.mas' leads to no number"),
        ({"model": {"cart.mass": -1}}, "one.model: .*-1"),
        ({"sampled": {"rate": 0}}, "one.sampled.rate: 0 is not above 0"),
        (
            {"sampled": {"rate": 10, "delay": 0.05}},
            "one.sampled: the delay of a sampler is 0.05 s, 0.5 periods; give",
        ),
        (
            {"type": "pid", "kp": 1, "ki": 1, "kd": 1, "goal": POSE, "sampled": {}},
            "one.sampled: is not a known field",
        ),
    ],
)
def test_controllers_that_do_not_fit(controller, sentence):
    base = {} if "type" in controller else {"type": "lqr", "position": 1, "force": 1}
    with pytest.raises((MechanismError, StudyError), match=sentence):
        ready(**base | controller)


def test_weights_may_not_reach_what_no_controller_has():
    lqr = {"type": "lqr", "position": 1, "force": 1}
    vary = {"controllers.one.force": {"type": "normal", "mean": 1, "deviation": 1}}
    with pytest.raises(
        MechanismError,
        match=r"vary.controllers.one.force: reaches -4.9\d*, which the controller may not",
    ):
        study(forces={}, controllers={"one": lqr}, vary=vary)
    vary = {"controllers.one.force.rail": {"type": "uniform", "low": 1, "high": 2}}
    with pytest.raises(
        StudyError,
        match=r"is nothing that can vary; there are controllers.one.position, .*\.K\.rail\.rail",
    ):
        bench_of(study(forces={}, controllers={"one": lqr}, vary=vary))


def test_a_robot_without_a_tool_holds_where_it_starts():
    rail = lw.Mechanism(**CART.model_dump(exclude={"tools"}))
    pd = {"type": "pd", "kp": 8, "kd": 0, "goal": {"type": "pose"}}
    found = whole(
        study(robot=rail, forces={}, start={"joints": {"rail": 0.4}}, controllers={"pd": pd})
    )
    np.testing.assert_allclose(found["end"], 0.4, atol=1e-12)


def test_gains_are_given_by_freedom_of_a_joint_that_has_several():
    """A body that slides along an axis and turns about it: m x'' = u, J q'' = u, each with its own
    gains."""
    given = study(
        robot=lw.Mechanism(
            name="rod",
            gravity=(0, 0, 0),
            bodies={"rod": {"mass": 2.0, "inertia": {"zz": 0.5}}},
            joints={"guide": {"type": "cylindrical", "connects": ("ground", "rod")}},
            actuators=("guide.slide", "guide.angle"),
        ),
        forces={},
        start={"joints": {"guide.slide": 0.3, "guide.angle": 0.5}},
        controllers={
            "pd": {
                "type": "pd",
                "kp": {"guide.slide": 50, "guide.angle": 20},
                "kd": {"guide.slide": 4, "guide.angle": 1},
                "goal": {"type": "pose", "joints": {"guide.slide": 0.0, "guide.angle": 0.0}},
            }
        },
        vary={"controllers.pd.kp.guide.slide": {"type": "values", "values": (50, 80)}},
        design={"type": "grid"},
        outputs={
            "x": "final joint_position.guide.slide",
            "angle": "final joint_position.guide.angle",
        },
        rtol=1e-10,
    )
    found = whole(given)
    np.testing.assert_allclose(
        found["x"], [held(2.0, k, 4, 0.3, 0)[0] for k in (50, 80)], atol=1e-8
    )
    np.testing.assert_allclose(found["angle"], held(0.5, 20, 1, 0.5, 0)[0], atol=1e-8)


@pytest.mark.parametrize(("delay", "quantise"), [(0.0, None), (0.02, None), (0.01, 0.001)])
def test_a_sampled_controller_acts_in_steps(delay, quantise):
    """Between two calls of a sampled controller the force on the cart is constant, and its motion
    known."""
    period, kp, kd = 0.01, 60.0, 4.0
    sampled = {"rate": 100, "delay": delay, "quantise": quantise}
    found = whole(
        study(
            forces={},
            start={"joints": {"rail": -0.1}},
            controllers={"pd": {"type": "pd", "kp": 1, "kd": kd, "goal": POSE, "sampled": sampled}},
            vary={
                "cart.mass": {"type": "uniform", "low": 1, "high": 3},
                "controllers.pd.kp": {"type": "uniform", "low": 0.5 * kp, "high": kp},
            },
            outputs={
                "x": "final joint_position.rail",
                "v": "final joint_rate.rail",
                "e": "final tracking_error.rail",
            },
            trajectories=("actuator_force", "reaction_force", "joint_acceleration"),
            samples=51 * 2 - 1,
            rtol=1e-10,
        )
    )
    m, kp = found["cart.mass"], found["controllers.pd.kp"]
    x, v, forces = np.full(40, -0.1), np.zeros(40), [np.zeros(40)] * round(delay / period)
    for k in range(round(T / period)):
        step = quantise or 1e-300
        seen = x if quantise is None else step * np.floor(x / step + 0.5)
        speed = v if quantise is None else step / period * np.floor(v / step * period + 0.5)
        forces.append(kp * (0.2 - seen) - kd * speed)
        a = forces.pop(0) / m
        between = 2 * k + 1  # the saved time amid this call and the next
        np.testing.assert_allclose(
            found["joint_acceleration"][:, between, 0], a, rtol=1e-6, atol=1e-8
        )
        np.testing.assert_allclose(
            found["actuator_force"][:, between, 0], m * a, rtol=1e-6, atol=1e-8
        )
        np.testing.assert_allclose(
            found["reaction_force"][:, between, 0], np.abs(m * a), rtol=1e-6, atol=1e-8
        )
        x, v = x + v * period + a * period**2 / 2, v + a * period
    np.testing.assert_allclose(found["x"], x, atol=1e-8)
    np.testing.assert_allclose(found["v"], v, atol=1e-8)
    np.testing.assert_allclose(found["e"], 0.2 - x, atol=1e-8)
