"""Accuracy: every term of the equations against 40 digits, and what runs conserve.

The reference is an independent formulation, Lagrange multipliers in maximal coordinates, in numbers
of 40 digits. It is given the same doubles: the actuated coordinates, all rates, forces and
accelerations; the dependent coordinates it closes to 40 digits by itself. An error is  max |x -
x_ref| / max |x_ref|  over the entries of one quantity in one state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np

import linkwork as lw
from linkwork.robots import prr3

from benchmarks.table import Figure, Section
from benchmarks.tasks import REGION, second_of_motion, workspace_states
from tests.oracle import LagrangeOracle

DIGITS = 40
UPRIGHT = (0.0, -9.81, 0.0)
TITLES = {
    "M": "M, generalised inertia",
    "Cv": "C v, Coriolis and centrifugal forces",
    "G": "G, gravity forces",
    "forces": "forces, inverse dynamics",
    "accelerations": "accelerations, forward dynamics",
}
Terms = dict[str, np.ndarray]
Map = Callable[..., Iterable]


def run(states: int = 200, free_runs: int = 20) -> Section:
    """Measure all accuracies; the reference is computed by as many processes as there are
    processors."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        found = against_oracle(states, partial(pool.map, chunksize=5))
    robot = lw.Robot(prr3())
    drift, gap = conservation(robot, free_runs)
    figures = [
        Figure(f"{title}: largest error", found[name].max(), "", 1e-12)
        for name, title in TITLES.items()
    ]
    figures += [
        Figure(f"{title}: median error", float(np.median(found[name])))
        for name, title in TITLES.items()
    ]
    figures += [
        Figure(
            f"forward after inverse dynamics, {states} states", round_trip(robot, states), "", 1e-11
        ),
        Figure(f"energy of {free_runs} force-free runs of 1 s, rtol 1e-10", drift.max(), "", 1e-10),
        Figure("closure error during these runs", gap.max(), "m", 1e-12),
        Figure("closure error during 1 s of prescribed motion", prescribed_gap(robot), "m", 1e-12),
    ]
    raw = {
        "errors": {name: values.tolist() for name, values in found.items()},
        "energy": drift.tolist(),
    }
    return Section("Accuracy", method(states), figures, raw)


def method(states: int) -> str:
    return f"""
        The robot stands upright (gravity {UPRIGHT[1]} m/s² along y), so that G is not zero.
        {states} random states: {REGION}. The reference has {DIGITS} digits and is another
        formulation, Lagrange multipliers in maximal coordinates; error = max abs(x - x_ref) / max
        abs(x_ref) per quantity and state. Force-free runs of the horizontal robot: from poses
        around 1.4 rad, rates normal with 0.03 m/s; energy relative to its initial value.
        """


def against_oracle(states: int, map_states: Map = map) -> dict[str, np.ndarray]:
    """Return the errors (states,) of each quantity; `map_states` may spread the reference over
    processes."""
    robot = lw.Robot(prr3(gravity=UPRIGHT))
    some = workspace_states(robot, states)
    forces, accelerations = np.random.default_rng(7).normal(size=(2, states, robot.mobility))
    found = {
        "M": robot.mass_matrix(some),
        "Cv": robot.coriolis(some),
        "G": robot.gravity(some),
        "forces": robot.inverse_dynamics(some, accelerations),
        "accelerations": robot.forward_dynamics(some, forces),
    }
    given = some.positions, some.rates, forces, accelerations
    rows = list(map_states(errors, *given, *found.values()))
    return {name: np.array([row[name] for row in rows]) for name in found}


def errors(
    positions: np.ndarray,
    rates: np.ndarray,
    forces: np.ndarray,
    accelerations: np.ndarray,
    *found: np.ndarray,
) -> dict[str, float]:
    """Return the errors of what was found in one state, in the order of `exact`."""
    reference = exact(positions, rates, forces, accelerations)
    return {
        name: relative(values, reference[name])
        for name, values in zip(reference, found, strict=True)
    }


def exact(
    positions: np.ndarray, rates: np.ndarray, forces: np.ndarray, accelerations: np.ndarray
) -> Terms:
    """Return all quantities in one state as numbers of 40 digits; u = M v' + C v + G."""
    oracle = LagrangeOracle(prr3(gravity=UPRIGHT), digits=DIGITS)
    actuated = positions[[oracle.moving.index(name) for name in oracle.mechanism.actuators]]
    q = oracle.assemble(positions, actuated)
    M, Cv, G = oracle.mass_matrix(q), oracle.coriolis(q, rates), oracle.gravity(q)
    return {
        "M": M,
        "Cv": Cv,
        "G": G,
        "forces": M @ oracle.numbers.array(accelerations) + Cv + G,
        "accelerations": oracle.forward_dynamics(q, rates, forces),
    }


def relative(found: np.ndarray, reference: np.ndarray) -> float:
    """Return max |x - x_ref| / max |x_ref|, subtracted in the reference's digits."""
    return float(abs(found - reference).max() / abs(reference).max())


def round_trip(robot: lw.Robot, states: int) -> float:
    """Return how well forward dynamics gives back the accelerations whose forces inverse dynamics
    computed."""
    some = workspace_states(robot, states)
    wanted = np.random.default_rng(9).normal(size=(states, robot.mobility))
    found = robot.forward_dynamics(some, robot.inverse_dynamics(some, wanted))
    return float((np.abs(found - wanted).max(axis=1) / np.abs(wanted).max(axis=1)).max())


def conservation(robot: lw.Robot, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative change of energy (runs,) and the closure error (runs,) [m] of force-free
    runs of 1 s."""
    random = np.random.default_rng(5)
    drift, gap = np.empty(runs), np.empty(runs)
    for i in range(runs):
        pose = [0.5, np.sqrt(3) / 6, 1.4] + random.uniform(-1, 1, 3) * [0.05, 0.05, 0.2]
        start = robot.assemble(tool=pose).with_rates(0.03 * random.normal(size=3))
        result = robot.simulate(start, duration=1.0, rtol=1e-10, atol=1e-12)
        assert result.status is lw.Status.FINISHED, result.message
        energy = (result.dataset["kinetic_energy"] + result.dataset["potential_energy"]).values
        drift[i], gap[i] = np.abs(energy / energy[0] - 1).max(), result.closure_error
    return drift, gap


def prescribed_gap(robot: lw.Robot) -> float:
    """Return the closure error [m] of the prescribed second of motion, saved at 1001 times."""
    task = second_of_motion(robot)
    times = np.linspace(0.0, task.duration, 1001)
    result = robot.simulate(task.start, task.signal, duration=task.duration, save_at=times)
    assert result.status is lw.Status.FINISHED, result.message
    return float(result.closure_error)
