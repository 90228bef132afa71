"""A process as functions of CasADi beside its environments, and its gradients beside
differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from linkwork.gym import Environments, smooth
from linkwork.gym.catalogue import balancing, reaching, swinging_up


@pytest.mark.parametrize("make", [reaching, balancing, swinging_up])
def test_functions_do_what_environments_do(make):
    """Over as long as these stay in a chart, with drawn numbers; actions within their bounds."""
    process, dt = make(), make().dt
    whole, envs = smooth(process), Environments(process, 1)
    assert len(whole.starts) == (1 if process.starts is None else len(process.starts))
    values = {name: 0.3 * low + 0.7 * high for name, (low, high) in process.draws.items()}
    seen, _ = envs.reset(seed=4, options={"draws": values})
    at = np.abs(whole.starts[:, : envs.states.q.size] - envs.states.q).max(axis=1).argmin()
    d = [values[name] for name in whole.draws]
    y = whole.begin(whole.starts[at], d)
    first = whole.read(0, y, np.zeros(process.size), d)[0].full().T
    np.testing.assert_allclose(first, seen, 1e-9, 1e-15)
    draw = np.random.default_rng(1)
    for k in range(25):
        action = draw.uniform(process.low, process.high)
        seen, reward, over, _, _ = envs.step([action])
        y = whole.step(k * dt, y, action, d)
        observation, r, ended = whole.read((k + 1) * dt, y, action, d)
        np.testing.assert_allclose(observation.full().ravel(), seen[0], 1e-9, 1e-10)
        assert float(r) == pytest.approx(reward[0], abs=1e-10)
        assert bool(ended) == over[0]
        if over[0]:
            break


def test_actions_are_cut_to_their_bounds_as_environments_do():
    """Beyond them nothing depends on them; at a bound the slope is that of inside."""
    process, d = reaching(), [0.01, -0.02, 0.0]
    whole, envs = smooth(process), Environments(process, 1)
    envs.reset(seed=4, options={"draws": dict(zip(whole.draws, d, strict=True))})
    a, y = ca.MX.sym("a", 3), whole.begin(whole.starts[0], d)
    after = whole.step(0, y, a, d)
    told = ca.Function("told", [a], [*whole.read(process.dt, after, a, d), ca.jacobian(after, a)])
    seen, reward, *_ = envs.step([[3.0, -1.5, 1.0]])
    observation, r, _, slope = told([3.0, -1.5, 1.0])
    np.testing.assert_allclose(observation.full().ravel(), seen[0], 1e-9, 1e-10)
    assert float(r) == pytest.approx(reward[0], abs=1e-10)
    slope, inside = slope.full(), told([1.0, -1.0, 1.0])[3].full()
    assert not slope[:, :2].any() and np.abs(inside).max(axis=0).min() > 1e-3
    np.testing.assert_array_equal(slope[:, 2], inside[:, 2])


@pytest.mark.parametrize("make", [reaching, balancing])
def test_gradients_of_returns_are_those_of_differences(make):
    process, steps = make(), 12
    whole = smooth(process)
    actions = ca.MX.sym("actions", process.size, steps)
    d = [0.6 * low + 0.4 * high for low, high in process.draws.values()]
    y, total = whole.begin(whole.starts[0], d), 0
    for k in range(steps):
        y = whole.step(k * process.dt, y, actions[:, k], d)
        total += whole.read((k + 1) * process.dt, y, actions[:, k], d)[1]
    gradient = ca.Function("gradient", [actions], [ca.gradient(total, actions)])
    returned = ca.Function("returned", [actions], [total])
    draw = np.random.default_rng(2)
    here, way = draw.uniform(-0.5, 0.5, (2, process.size, steps))
    h = 1e-4
    along = float(returned(here + h * way) - returned(here - h * way)) / (2 * h)
    found = float(np.sum(gradient(here).full() * way))
    assert found == pytest.approx(along, rel=1e-6, abs=1e-9)
    assert abs(found) > 1e-4
