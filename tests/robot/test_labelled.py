"""Tables and series that bring names: numbers are taken by their order only where that is the
names', else the names are told; by name they may come in any order."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import linkwork as lw


@pytest.fixture(scope="module")
def robot():
    return lw.Robot("puma560")


def table(names, rows):
    return pd.DataFrame(rows, columns=[*names])


def test_labels_in_the_order_of_the_names_are_taken(robot):
    names, u = robot.actuators, np.arange(1.0, 7.0)
    told = robot.forward_dynamics(robot.home, u)
    series = pd.Series(u, index=names)
    array = xr.DataArray(u, dims="actuator", coords={"actuator": [*names]})
    for given in (series, dict(series[::-1]), array, pd.Series(u), xr.DataArray(u)):
        assert np.array_equal(robot.forward_dynamics(robot.home, given), told)
    positions = table(robot.coordinates, [robot.home.positions])
    assert np.array_equal(robot.state(positions).at(0).q, robot.home.q)
    assert np.array_equal(robot.state(dict(positions.iloc[:, ::-1])).at(0).q, robot.home.q)
    signal = lw.Sampled([0.0, 1.0], table(names, [u, u]))
    assert robot.simulate(robot.home, signal, duration=1e-3).success
    run = robot.simulate(robot.home, u, duration=1e-3, samples=3)
    assert robot.state(run["joint_position"], run["joint_rate"]).batch == (3,)
    assert robot.assemble(tool=run["tool_pose"][0]).batch == ()


def test_labels_in_another_order_are_refused(robot):
    home, names, u = robot.home, robot.actuators, np.arange(1.0, 7.0)
    turned = names[::-1]
    series, rows = pd.Series(u, index=turned), table(turned, [u, u])
    array = xr.DataArray(u, dims="actuator", coords={"actuator": [*turned]})
    pose = table(["y", "x", "z", "rx", "ry", "rz"], [robot.tool_pose(home)])
    goal = lw.control.PD(lw.Sampled([0.0, 1.0], rows), kp=1.0, kd=1.0)
    calls = (
        lambda: robot.forward_dynamics(home, series),
        lambda: robot.forward_dynamics(home, array),
        lambda: robot.forward_dynamics(robot.state([home.positions] * 2), rows),
        lambda: robot.inverse_dynamics(home, series),
        lambda: robot.state(rows),
        lambda: robot.state(home.positions, series),
        lambda: home.with_rates(series),
        lambda: robot.assemble(tool=pose),
        lambda: robot.simulate(home, series, duration=1e-3),
        lambda: robot.simulate(home, lw.Sampled([0.0, 1.0], rows), duration=1e-3),
        lambda: robot.simulate(home, goal, duration=1e-3),
        lambda: robot.ensemble(home, rows, duration=1e-3),
    )
    for call in calls:
        with pytest.raises(lw.LinkworkError, match=r"come labelled .*; give .*, in this order"):
            call()
