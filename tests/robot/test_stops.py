"""Stops at the ends of joints against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import functions
from linkwork.mechanism.impact import loss_of
from linkwork.robots import four_bar

from tests.equations.evaluation import close, values

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
BODY = lw.Body(mass=0.3, inertia=lw.Inertia(xx=0.02, yy=0.02, zz=0.02))


def slide(stop: lw.Stop, gravity: float = 0.0, **fields) -> lw.Robot:
    joint = lw.PrismaticJoint(connects=("ground", "body"), stop=stop, **fields)
    down = (0.0, 0.0, -gravity)
    return lw.Robot(lw.Mechanism(bodies={"body": BODY}, joints={"z": joint}, gravity=down))


def ran(robot: lw.Robot, state: lw.State, duration: float, **options) -> lw.Run:
    run = robot.simulate(state, duration=duration, **TIGHT | options)
    assert run.status is lw.Status.FINISHED, run.message
    close(run["energy_balance"].values, np.zeros(len(run.time)), 1e-8)
    return run


@pytest.mark.sample(11)
@pytest.mark.parametrize("method", ["dormand_prince", "rodas"])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("restitution", [0.98, 0.5, 0.1])
def test_what_an_impact_leaves(exponent, restitution, method):
    """A free mass leaves with restitution times its rate, whatever the stiffness and exponent."""
    stop = lw.Stop(
        lower=-0.2, stiffness=3e4, exponent=exponent, restitution=restitution, impact_rate=2.0
    )
    robot = slide(stop)
    found = ran(robot, robot.state([0.1]).with_rates([-2.0]), 0.4 / restitution, method=method)
    close(found.dataset["joint_rate"].values[-1], [2.0 * restitution], 1e-6)


@pytest.mark.parametrize("restitution", [1 - 1e-9, 0.999, 0.9, 0.3, 0.05])
def test_the_dissipation_of_a_restitution(restitution):
    """a - ln(1 + a) = -b - ln(1 - b) in exact arithmetic, b = restitution a."""
    mp = pytest.importorskip("mpmath")
    with mp.workdps(60):
        a = mp.mpf(loss_of(restitution))

        def lost(a):
            b = restitution * a
            return a - mp.log(1 + a) + b + mp.log(1 - b)

        off = mp.mpf(1e-14 + 1e-15 / (1 - restitution))
        assert lost(a * (1 - off)) * lost(a * (1 + off)) < 0


def bounced(m: float, g: float, k: float, height: float) -> tuple[float, float, float]:
    """Return when a mass that falls from a height touches a spring without damping, when it leaves,
    and how deep it is at most."""
    w, v, touches = np.sqrt(k / m), np.sqrt(2 * g * height), np.sqrt(2 * height / g)
    sag, phase = m * g / k, np.arctan(g / (w * v))
    return touches, touches + (np.pi + 2 * phase) / w, sag + np.hypot(sag, v / w)


def test_a_ball_bounces_on_a_spring():
    """Free flight, half an oscillation about the sag, free flight again: event by event."""
    g, k, height = 9.81, 2e3, 0.2
    robot = slide(lw.Stop(lower=0.0, stiffness=k, exponent=1.0), gravity=g)
    run = ran(robot, robot.state([height]), 1.0)
    touches, leaves, depth = bounced(0.3, g, k, height)
    period = touches + leaves
    expected = [touches, leaves, touches + period, leaves + period]
    assert list(run.coords["event"].values) == 2 * ["z: lower stop begins", "z: lower stop ends"]
    close(run.coords["event_time"].values, expected, 1e-9)
    lowest = robot.simulate(
        robot.state([height]), duration=1.0, save_at=np.array([(touches + leaves) / 2]), **TIGHT
    )
    close(lowest["joint_position"].values[0], [-depth], 1e-8)


def test_a_slide_goes_to_and_fro_between_its_limits():
    """Between two springs at its limits: every half period the same way takes the same time."""
    k, v, m = 5e4, 1.5, 0.3
    robot = slide(lw.Stop(stiffness=k, exponent=1.0), limits=lw.Limits(lower=-0.05, upper=0.1))
    half = 0.15 / v + np.pi * np.sqrt(m / k)
    run = ran(robot, robot.state([0.0]).with_rates([v]), 3.9 * half)
    begins = run.coords["event_time"].values[::2]
    close(np.diff(begins), np.full(3, half), 1e-9)
    assert [name.split()[1] for name in run.coords["event"].values[::2]] == [
        "upper",
        "lower",
        "upper",
        "lower",
    ]


def test_a_free_turn_comes_back_from_its_stop():
    """Of a ball joint the stop bounds the angle between its frames: the rate is turned round."""
    stop = lw.Stop(upper=0.8, stiffness=500.0, restitution=0.6, impact_rate=3.0)
    ball = lw.SphericalJoint(connects=("ground", "body"), stop={"turn": stop})
    robot = lw.Robot(
        lw.Mechanism(bodies={"body": BODY}, joints={"ball": ball}, gravity=(0.0, 0.0, 0.0))
    )
    axis = np.array([2.0, -1.0, 2.0]) / 3
    run = ran(robot, robot.home.with_rates(3 * axis), 0.6)
    close(run["joint_rate"].values[-1], -1.8 * axis, 1e-6)
    assert run.coords["event"].values[0] == "ball.turn: upper stop begins"


def crank(joint: str, **stop) -> lw.Mechanism:
    mechanism = four_bar()
    changed = mechanism.joints[joint].model_copy(update={"stop": lw.Stop(**stop)})
    return mechanism.model_copy(update={"joints": {**mechanism.joints, joint: changed}})


def test_a_stop_in_a_closed_loop():
    """A four-bar that swings into a stop at its rocker keeps its energy and stays closed."""
    plain = lw.Robot(four_bar())
    name = [joint for joint in plain.coordinates if joint not in plain.actuators][-1]
    here = float(plain.home[name])
    robot = lw.Robot(crank(name, upper=here + 0.1, lower=here - 0.1, stiffness=2e4))
    run = ran(robot, robot.home.with_rates([4.0]), 1.0)
    assert {word for event in run.coords["event"].values for word in event.split()} >= {
        "begins",
        "ends",
    }
    assert run["closure_error"].values.max() < 1e-13 * robot.size
    q = run["joint_position"].sel(coordinate=name).values
    assert q.max() < here + 0.2 and q.min() > here - 0.2


def test_where_a_stop_begins_may_be_free():
    """Runs with another end and stiffness are those of a description with these numbers."""
    stop = lw.Stop(lower=-0.1, stiffness=1e4, restitution=0.7)
    robot = lw.Robot(slide(stop).mechanism, free=["z.stop.lower", "z.stop.stiffness"])
    other = slide(lw.Stop(lower=-0.05, stiffness=3e4, restitution=0.7))
    ends = [
        one.simulate(one.state([0.1]).with_rates([-1.0]), duration=0.5, parameters=values, **TIGHT)[
            "joint_position"
        ].values[-1]
        for one, values in (
            (robot, {"z.stop.lower": -0.05, "z.stop.stiffness": 3e4}),
            (other, {}),
        )
    ]
    close(ends[0], ends[1], 1e-9)


def test_members_of_an_ensemble_run_as_they_do_alone():
    robot = slide(lw.Stop(lower=0.0, stiffness=1e5, restitution=0.8), gravity=9.81)
    heights = np.array([[0.05], [0.1], [0.3]])
    times = np.linspace(0.1, 0.6, 6)
    together = robot.ensemble(robot.state(heights), duration=0.6, save_at=times)
    for member, height in enumerate(heights):
        alone = robot.simulate(robot.state(height), duration=0.6, save_at=times)
        found = together.dataset["joint_position"].values[member]
        close(found, alone["joint_position"].values, 1e-12)


def test_the_regressor_takes_a_pressed_stop_into_the_rest():
    """M v' + C v + G - f = Y pi + r where a stop is pressed."""
    robot = slide(lw.Stop(lower=0.0, stiffness=1e4, dissipation=0.2), gravity=9.81)
    of = robot.equations
    q, v, dv = [-0.01], [0.7], [1.3]
    forces = values(functions.inverse_dynamics(of), q, v, dv)["forces"]
    found = values(functions.regressor(of), q, v, dv)
    from linkwork.equations.regressor import values as parameters

    close(np.atleast_2d(found["Y"]) @ parameters(of.mechanism) + found["rest"], forces, 1e-12)


def test_gaps_are_read_by_name():
    robot = slide(lw.Stop(lower=-0.2, upper=0.5, stiffness=1.0))
    seen = robot.observe(robot.state([0.1]))
    assert np.isclose(seen.gap("z: lower stop"), 0.3) and np.isclose(seen.gap("z: upper stop"), 0.4)
    with pytest.raises(lw.LinkworkError, match="no stop or contact 'z: left'"):
        seen.gap("z: left")


def test_an_event_of_ones_own_may_cut_steps():
    """A wrench that sets in at a surface is the stop of the same law."""
    k, robot = 2e4, slide(lw.Stop(lower=-5.0, stiffness=1.0), gravity=9.81)
    stopped = slide(lw.Stop(lower=0.0, stiffness=k, exponent=1.0), gravity=9.81)

    def force(t, state):
        return [0.0, 0.0, k * lw.math.maximum(-state["z"], 0.0)]

    push = lw.control.Wrench("body", force=force)
    floor = lw.control.Event(lambda t, state: state["z"], name="floor", cuts=True)
    options = {"duration": 0.5, "save_at": np.linspace(0, 0.5, 11), **TIGHT}
    pushed = robot.simulate(robot.state([0.2]), wrenches=[push], events=[floor], **options)
    expected = stopped.simulate(stopped.state([0.2]), **options)
    close(pushed["joint_position"].values, expected["joint_position"].values, 1e-8)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"stiffness": 1.0}, "the stop begins nowhere; give it lower or upper"),
        ({"stiffness": 1.0, "lower": 1.0, "upper": 0.0}, "lower end 1 is not below its upper end"),
        ({"lower": 0.0}, "stiffness: is missing"),
        ({"stiffness": 1.0, "lower": 0.0, "exponent": 0.5}, "exponent"),
        ({"stiffness": 1.0, "lower": 0.0, "restitution": 1.1}, "restitution"),
        ({"stiffness": 1.0, "lower": 0.0, "restitution": 0.0}, "restitution"),
    ],
)
def test_stops_that_are_none(fields, said):
    with pytest.raises(lw.MechanismError, match=said):
        lw.PrismaticJoint(connects=("ground", "body"), stop=fields)


def test_a_free_turn_has_no_lower_stop():
    stop = {"turn": {"stiffness": 1.0, "lower": 0.1, "upper": 0.5}}
    with pytest.raises(lw.MechanismError, match="the stop of a free turn has no lower end"):
        lw.SphericalJoint(connects=("ground", "body"), stop=stop)


def test_what_decides_the_form_is_not_free():
    robot = slide(lw.Stop(lower=0.0, stiffness=1.0))
    with pytest.raises(lw.MechanismError, match="decides the form of a force"):
        lw.Robot(robot.mechanism, free=["z.stop.restitution"])


def test_files_hold_stops(tmp_path):
    mechanism = replace_stop(slide(lw.Stop(lower=0.0, stiffness=1e5, restitution=0.8)).mechanism)
    mechanism.save(tmp_path / "x.yaml")
    assert lw.Mechanism.load(tmp_path / "x.yaml") == mechanism


def replace_stop(mechanism: lw.Mechanism) -> lw.Mechanism:
    """Return it with a ball joint of which a turn is stopped as well."""
    ball = lw.SphericalJoint(
        connects=("ground", "top"), stop={"turn": lw.Stop(upper=0.4, stiffness=10.0)}
    )
    return lw.Mechanism(
        bodies={**mechanism.bodies, "top": BODY}, joints={**mechanism.joints, "ball": ball}
    )


def test_engines_of_other_laws_refuse_stops():
    mujoco = pytest.importorskip("linkwork.lab.engines.mujoco")
    with pytest.raises(lw.lab.engines.EngineError, match="z: lower stop"):
        mujoco.MujocoEngine(slide(lw.Stop(lower=0.0, stiffness=1.0)).mechanism)
