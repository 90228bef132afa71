"""Runs that stability bounds go on by the stiff method only where its steps are as much longer as
they are dearer: a large mechanism that swings on was integrated fifty times slower by it."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw

SWINGS = 30


def clocks(damping: float) -> lw.Robot:
    """Return balances that swing at 1 rad/s, and one more that creeps, each by itself."""
    swing = {"spring": lw.Spring(stiffness=1.0)}
    creep = {"spring": lw.Spring(stiffness=1.0), "friction": lw.Friction(viscous=damping)}
    kinds = [*[swing] * SWINGS, creep]
    names = [f"balance_{k}" for k in range(len(kinds))]
    mechanism = lw.Mechanism(
        name="clocks",
        bodies={name: lw.Body(mass=1.0, inertia=lw.Inertia(zz=1.0)) for name in names},
        joints={
            f"hinge_{k}": lw.RevoluteJoint(connects=("ground", names[k]), **kinds[k])
            for k in range(len(kinds))
        },
    )
    return lw.Robot(mechanism)


@pytest.mark.parametrize(("damping", "last"), [(100.0, "Sharp-Smart 7(6)"), (20_000.0, "Rodas5P")])
def test_stiff_steps_are_kept_where_they_pay(damping, last):
    """The swings are sines, whichever steps lead them; explicit steps are a quarter as long as
    stiff ones at the smaller damping, a thousandth at the larger one."""
    robot, duration = clocks(damping), 500.0
    speeds = np.linspace(0.5, 1.0, SWINGS)
    run = robot.simulate(robot.home.with_rates([*speeds, 1.0]), duration=duration)
    assert run.success and run.attrs["method"].endswith(last)
    angles = run["joint_position"].values[-1][:SWINGS]
    assert angles == pytest.approx(speeds * np.sin(duration), abs=1e-6)
