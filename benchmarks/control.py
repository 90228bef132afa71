"""Computed torque at 1 kHz in closed loop on the 3-PRR: how many times faster than real time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

import linkwork as lw
from linkwork.control import ComputedTorque, Sampler
from linkwork.robots import prr3
from linkwork.simulation import Run

from benchmarks import runs
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, best, interleaved, summary

RATE = 1000.0
KP, KD = 400.0, 40.0  # critically damped
OFFSET = 2e-3  # of slide_1 at the start [m]
REAL_TIME = 1000.0
COLUMNS = (
    "control",
    "method",
    "evaluations",
    "loop [ms]",
    "real time / loop",
    "real time / simulate",
    "error [m]",
)
SAMPLED, STEPPED, TRACED, PYTHON = (
    "sampled, compiled",
    "sampled, compiled, 1 step",
    "continuous, traced",
    "sampled, Python",
)


@dataclass(frozen=True)
class Way:
    """Say how the controller is called (at RATE if sampled), and the options of `simulate`."""

    sampled: bool = True
    compiled: bool = True
    options: Mapping[str, Any] = field(default_factory=lambda: {"rtol": 1e-8, "atol": 1e-10})


WAYS = {
    STEPPED: Way(options={"method": "rk4", "step": 1 / RATE}),
    SAMPLED: Way(),
    TRACED: Way(sampled=False),
    PYTHON: Way(compiled=False),
}
METHOD = f"""
    The circle of 50 mm of the work-precision task, run through in so many seconds as the table's
    title says, by computed torque with kp = {KP:g} / s², kd = {KD:g} / s and the exact model, which
    is inverse dynamics of the whole robot at every call; the first slider starts {1e3 * OFFSET:g}
    mm beside. Sampled: called at {RATE:g} Hz, its forces held in between; every period is a step of
    its own, since the inputs jump. "1 step": one step of the classical Runge-Kutta method for each
    period, as in real time; the promise is about it. The loop is the compiled integrator alone with
    everything that happens in it: controller, motion, projection; simulate is the call of
    `robot.simulate`, which traces the controller first. Error: largest distance of the sliders from
    their goal in the second half. Medians of runs that take turns.
    """


def run(duration: float = 2.0, rounds: int = 15, ways: Mapping[str, Way] = WAYS) -> Section:
    """Time the closed loop in all ways, in turn."""
    robot = lw.Robot(prr3())
    motion = robot.follow(
        lw.paths.together(lw.paths.circle([0.5, 0.28], 0.05), lw.paths.swing(1.2, 0.2)),
        duration=duration,
    )
    law = ComputedTorque(motion, KP, KD, robot)
    start = beside(robot, motion.state.at(0))
    calls = {
        name: partial(simulated, robot, start, law, way, duration) for name, way in ways.items()
    }
    whole = {("simulate", name): Contender(call) for name, call in calls.items()}
    loops = {
        ("loop", name): Contender(runs.loop_of(calls[name])) for name in ways if ways[name].compiled
    }
    seconds = interleaved(whole | loops, rounds)
    figures, rows, errors = [], [], {}
    for name, call in calls.items():
        done = call()
        taken = seconds.get(("loop", name))
        pace = None if taken is None else duration / float(np.median(taken))
        errors[name] = tracking_error(robot, motion, done)
        called = duration / float(np.median(seconds["simulate", name]))
        rows.append((
            name, done.attrs["method"], str(done.statistics.nfev),
            "-" if taken is None else quantity(1e3 * float(np.median(taken)), ""),
            "-" if pace is None else quantity(pace, ""),
            quantity(called, ""), f"{errors[name]:.0e}",
        ))  # fmt: skip
        if taken is not None and pace is not None:
            bound = REAL_TIME if name == STEPPED else None
            figures.append(
                Figure(
                    f"computed torque, {name}: times real time",
                    pace,
                    "",
                    bound,
                    "at least",
                    best(taken),
                )
            )
    raw = {f"{what}: {name}": summary(values) for (what, name), values in seconds.items()}
    return Section(
        f"Computed torque at 1 kHz, {duration:g} s",
        METHOD,
        figures,
        {"seconds": raw, "errors": errors},
        listing=Listing(COLUMNS, rows),
    )


def beside(robot: lw.Robot, state: lw.State) -> lw.State:
    """Return the state at rest with the first slider a little off."""
    slides = {name: float(state[name]) for name in robot.actuators}
    first = robot.actuators[0]
    return robot.assemble(slides | {first: slides[first] + OFFSET}, guess=state)


def simulated(
    robot: lw.Robot, start: lw.State, law: ComputedTorque, way: Way, duration: float
) -> Run:
    """Return one run, its middle and its end and some instants between saved."""
    controller = Sampler(law, rate=RATE, compiled=way.compiled) if way.sampled else law
    save_at = np.linspace(duration / 2, duration, 11)
    done = robot.simulate(start, controller, duration=duration, save_at=save_at, **way.options)
    assert done.status is lw.Status.FINISHED, done.message
    return done


def tracking_error(robot: lw.Robot, motion: lw.Motion, done: Run) -> float:
    """Return the largest distance of the actuated joints from their goal at the saved instants
    [m]."""
    columns = [robot.coordinates.index(name) for name in robot.actuators]
    time = done.coords["time"].values
    wanted = [np.interp(time, motion.time, motion.positions[:, column]) for column in columns]
    return float(
        np.abs(done.variables["joint_position"].values[:, columns] - np.transpose(wanted)).max()
    )
