"""What a run is made with: its method by name, and what the package offers by name."""

from typing import get_args

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import LQR
from linkwork.model import linear
from linkwork.simulation import RK4, RODAS, SymplecticEuler, methods

from tests.catalogue import built


@pytest.fixture(scope="module")
def robot():
    return lw.Robot(lw.robots.pendulum())


def test_every_method_has_its_name_once(robot):
    assert get_args(methods.MethodName) == tuple(methods.METHODS)
    made = {
        name: methods.integrator(name, 0.01 if name in methods.FIXED else None)
        for name in methods.METHODS
    }
    assert len({method.name for method in made.values()}) == len(made)
    assert (made["rk4"], made["symplectic_euler"], made["rodas"]) == (
        RK4(0.01),
        SymplecticEuler(0.01),
        RODAS,
    )


@pytest.mark.parametrize("method", methods.METHODS)
def test_a_pendulum_swings_alike_by_all_methods(robot, method):
    step = 2e-4 if method in methods.FIXED else None
    run = robot.simulate(robot.home, duration=0.5, save_at=[0.0, 0.5], method=method, step=step)
    best = robot.simulate(
        robot.home, duration=0.5, save_at=[0.0, 0.5], method="dop853", rtol=1e-12, atol=1e-13
    )
    bound = 2e-3 if method == "symplectic_euler" else 1e-6
    np.testing.assert_allclose(run["joint_position"][-1], best["joint_position"][-1], atol=bound)


@pytest.mark.parametrize(
    ("method", "step", "told"),
    [
        (
            "euler",
            None,
            (
                "there is no method 'euler'; there are sharp_smart, dormand_prince, dop853, "
                "rodas, rk4, "
            ),
        ),
        ("rk4", None, "rk4 needs a step"),
        ("rodas", 0.1, "rodas chooses its own steps"),
    ],
)
def test_methods_that_do_not_fit_are_refused(robot, method, step, told):
    with pytest.raises(lw.LinkworkError, match=told):
        robot.simulate(robot.home, duration=0.1, method=method, step=step)


def test_what_methods_return_can_be_named(robot):
    assert isinstance(robot.reactions(robot.home, np.zeros(len(robot.actuators))), lw.Reactions)
    assert isinstance(robot.ensemble(robot.home, duration=0.01), lw.Ensemble)
    assert {"Ensemble", "Reactions"} <= set(lw.__all__)


def test_the_linear_model_of_a_regulator_is_that_of_the_study():
    """LQR.about and analysis.linearise stand on one derivation: K is the Riccati gain of its A and
    B."""
    from scipy.linalg import solve_continuous_are

    robot = lw.Robot(lw.robots.prr3())
    model = lw.analysis.linearise(robot, robot.home, robot.holding_forces(robot.home))
    Q, R = np.diag([100.0] * 3 + [1.0] * 3) + 0.1, np.eye(3)  # no gain is zero but for rounding
    gains = model.B.T @ solve_continuous_are(model.A, model.B, Q, R)
    np.testing.assert_allclose(LQR.about(robot, robot.home, Q, R).gains, gains, rtol=1e-9)
    own = robot.linearise(robot.home, robot.holding_forces(robot.home))
    np.testing.assert_array_equal(own.A, model.A)
    np.testing.assert_array_equal(own.C, model.C)
    with pytest.warns(DeprecationWarning, match=r"Robot\.linearised is Robot\.linearise") as told:
        A, B = robot.linearised(robot.home, robot.holding_forces(robot.home))
    np.testing.assert_array_equal(A, model.A)
    np.testing.assert_array_equal(B, model.B)
    assert told[0].filename == __file__ and "linearised" not in dir(robot)
    with pytest.warns(DeprecationWarning, match=r"analysis\.holding is Robot\.holding_forces now"):
        assert lw.analysis.holding is linear.holding_forces
    with pytest.raises(AttributeError, match=r"'linkwork\.analysis' has no attribute 'nothing'"):
        _ = lw.analysis.nothing


@pytest.fixture(scope="module")
def parallel():
    return lw.Robot(lw.robots.prr3())


def test_charts_are_told_with_the_times_at_which_they_were_taken(parallel):
    """Saved seldom, as when every step is saved."""
    every = parallel.simulate(parallel.home, [5.0, 0.0, 0.0], duration=1.0)
    seldom = parallel.simulate(parallel.home, [5.0, 0.0, 0.0], duration=1.0, save_at=[0.0, 1.0])
    assert "; from " in every.attrs["charts"]
    assert seldom.attrs["charts"] == every.attrs["charts"]


def test_the_steps_allowed_are_told_as_they_were_given(parallel):
    whole = parallel.simulate(parallel.home, [5.0, 0.0, 0.0], duration=1.0)
    allowed = whole.steps + whole.rejected - 2
    run = parallel.simulate(parallel.home, [5.0, 0.0, 0.0], duration=1.0, max_steps=allowed)
    assert "; from " in run.attrs["charts"] and run.status is lw.Status.TOO_MANY_STEPS
    assert f"max_steps = {allowed} steps" in run.message


def test_the_first_terminal_event_of_an_instant_is_named(robot):
    """Three zeros at one instant: of the two that end the run the first one is named, as it is
    listed."""

    def zero(t, state):
        return t - 0.2

    names = {"seen": False, "first": True, "second": True}
    events = [
        lw.control.Event(zero, terminal=terminal, name=name) for name, terminal in names.items()
    ]
    for order, named in (
        (events, "first"),
        (events[::-1], "second"),
        ([events[1], events[0]], "first"),
    ):
        run = robot.simulate(robot.home, duration=1.0, events=order)
        assert (
            run.status is lw.Status.EVENT
            and f"ended by the event '{named}' at t = 0.2 s" in run.message
        )


def test_a_resumed_run_keeps_the_parameters_of_the_robot(tmp_path):
    """What the run's file tells is taken again, unless values are given."""
    robot = lw.Robot(lw.robots.pendulum())
    (body,) = robot.mechanism.bodies
    mass = f"{body}.mass"
    robot = robot.free(mass)
    heavy = 1 / 3 + robot.parameters[mass]
    run = robot.simulate(robot.home, duration=0.2, parameters={mass: heavy})
    whole = robot.simulate(robot.home, duration=0.4, parameters={mass: heavy})[
        "kinetic_energy"
    ].values[-1]
    loaded = lw.simulation.Run.load(run.save(tmp_path / "run.nc"))
    for before in (run, loaded):
        rest = robot.resume(before, duration=0.2)
        assert rest.attrs["parameters"] == run.attrs["parameters"]
        np.testing.assert_allclose(rest["kinetic_energy"].values[-1], whole, rtol=1e-6)
        light = robot.resume(before, duration=0.2, parameters={mass: 0.5 * heavy})
        np.testing.assert_allclose(light["kinetic_energy"].values[-1], 0.5 * whole, rtol=1e-6)


def test_names_with_commas_and_equals_signs_are_read_off_runs(tmp_path):
    body, joint, mass = "block, left = 2", "slide, x", "block, left = 2.mass"
    block = lw.Mechanism(
        bodies={body: lw.Body(mass=2.0)},
        joints={joint: lw.PrismaticJoint(connects=("ground", body))},
        actuators=(joint,),
        gravity=(0, 0, 0),
    )
    robot = lw.Robot(block).free(mass)
    run = robot.simulate(robot.home, [1.0], duration=1.0, parameters={mass: 4.0})
    run.save(tmp_path / "run.nc")
    for one in (run, lw.Run.load(tmp_path / "run.nc")):
        assert one.final.independent == (joint,)
        rest = robot.resume(one, [1.0], duration=1.0)
        assert rest.final[joint] == pytest.approx(0.5)
    with pytest.raises(lw.LinkworkError, match="= 4, which is 2 here and not free; resume it by"):
        lw.Robot(block).resume(run, [1.0], duration=1.0)


def test_events_that_never_happen_stay_coordinates_in_files(tmp_path):
    robot = built("double_pendulum")
    run = robot.simulate(robot.home, duration=0.2, events=[lambda t, state: 1.0 + t])
    loaded = lw.Run.load(run.save(tmp_path / "run.nc"))
    assert set(loaded.dataset.coords) == set(run.dataset.coords) >= {"event_time"}
    assert loaded.coords["event_time"].attrs == run.coords["event_time"].attrs


def test_a_run_without_actuators_is_saved_loaded_and_resumed(tmp_path):
    """NetCDF 3 reads a dimension of length zero as one without end."""
    mechanism = lw.robots.double_pendulum().model_copy(update={"actuators": ()})
    robot = lw.Robot(mechanism)
    run = robot.simulate(robot.home, duration=0.2)
    run.save(tmp_path / "run.nc")
    loaded = lw.Run.load(tmp_path / "run.nc")
    assert loaded.dataset["actuator_force"].shape == run["actuator_force"].shape
    assert loaded.dataset.sizes == run.dataset.sizes
    assert "without_elements" not in loaded.dataset.attrs
    whole = robot.simulate(robot.home, duration=0.4, rtol=1e-10)
    resumed = robot.resume(loaded, duration=0.2, rtol=1e-10)
    last = [one["joint_position"].values[-1] for one in (resumed, whole)]
    np.testing.assert_allclose(*last, atol=1e-5)
