"""Derivatives with respect to motions that a run does not make, which its steps may be too long
for, beside closed solutions."""

import warnings

import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import ModelWarning

from tests.gradients.test_runs import TIGHT

END = 2.0


def carts(stiffness, damping=0.0):
    """Return two carts side by side, the second one on a spring."""
    spring = lw.Spring(stiffness=stiffness, damping=damping)
    joints = {
        "free": lw.PrismaticJoint(connects=("ground", "one"), axis=(1, 0, 0)),
        "held": lw.PrismaticJoint(connects=("ground", "other"), axis=(1, 0, 0), spring=spring),
    }
    bodies = {"one": lw.Body(mass=1.0), "other": lw.Body(mass=1.0)}
    described = lw.Mechanism(
        bodies=bodies, joints=joints, actuators=("free", "held"), gravity=(0, 0, 0)
    )
    return lw.Robot(described)


def pushed(robot, **options):
    """Return a run in which the second cart stands."""
    return robot.simulate(robot.home, [1.0, 0.0], duration=END, **options)


def slope(run):
    """Return how the second cart's last rate changes with its first one."""
    return run.sensitivity("joint_rate", to="rates.held").joint_rate.values[-1, 1, 0]


def last_rate(t, state):
    return state.rate("held")


@pytest.mark.parametrize("stiffness", [400.0, 1e4])
@pytest.mark.parametrize("method", ["sharp_smart", "dormand_prince", "dop853"])
def test_steps_that_let_motions_beside_a_run_grow_are_refused(stiffness, method):
    """Its derivative is cos(w t), and was told as 1e12 and more."""
    robot = carts(stiffness)
    run = pushed(robot, method=method)
    for ask in (
        lambda: slope(run),
        lambda: run.gradient({"joint_rate": np.ones_like(run["joint_rate"].values)}),
        lambda: robot.gradient(last_rate, robot.home, [1.0, 0.0], duration=END, method=method),
    ):
        with pytest.raises(lw.LinkworkError, match=r"let grow by 1e.*max_step=") as refusal:
            ask()
        assert "\n" not in str(refusal.value)
    told = float(str(refusal.value).partition("max_step=")[2].partition(",")[0])
    fine = slope(pushed(robot, method=method, max_step=told / 4, **TIGHT))
    assert fine == pytest.approx(np.cos(np.sqrt(stiffness) * END), abs=1e-3)


def test_steps_that_lead_motions_beside_a_run_astray_are_warned_of():
    """At rest a run takes steps of any length."""
    robot = carts(8.0)
    exact = np.cos(np.sqrt(8.0) * END)
    with pytest.warns(ModelWarning, match=r"may be off by .* max_step=") as told:
        found = slope(pushed(robot))
    assert told[0].filename == __file__ and abs(found - exact) > 0.01
    with pytest.warns(ModelWarning, match="may be off by"):
        robot.gradient(last_rate, robot.home, [1.0, 0.0], duration=END)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert slope(pushed(robot, max_step=0.05)) == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("name", ["joint_rate", "work"])
def test_an_adjoint_warns_once_where_it_is_asked(name):
    run = pushed(carts(8.0))
    weights = {name: np.ones(run[name].shape)}
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        run.gradient(weights)
    assert [each.filename for each in told] == [__file__]


def test_what_dies_out_has_its_derivative_by_stiff_steps():
    robot = carts(1e4, damping=1e5)
    with pytest.raises(lw.LinkworkError, match="method='rodas' if these die out"):
        slope(pushed(robot))
    assert slope(pushed(robot, method="rodas")) == pytest.approx(0.0, abs=1e-6)
