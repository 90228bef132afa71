"""The ladder of N four-bars: how the equations and the cost of getting them grow with N, and
problem A02 of the IFToMM library.

In A02 all cranks start upright, their tips move at 1 m/s, and gravity acts for 10 s: the cranks
turn over and over and pass the poses where all links lie on one line, in which the freedoms jump
from 1 to N + 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter

import casadi as ca
import numpy as np

import linkwork as lw
from linkwork.equations import Equations, derive, functions
from linkwork.mechanism import Mechanism
from linkwork.robots import n_four_bar
from linkwork.simulation import Run

from benchmarks import native
from benchmarks.table import Figure, Section
from benchmarks.timing import Contender, best, interleaved, summary, us
from tests.oracle import one_freedom
from tests.oracle.published import N_FOUR_BAR

LOOPS = (10, 20, 50, 100, 200)
A02, PUBLISHED, DURATION, RTOL = 40, 2, 10.0, 1e-8
STATES = 32


def run(loops: Sequence[int] = LOOPS, a02: int = A02, rounds: int = 15) -> Section:
    """Measure how the equations grow up to the largest number of loops, and the run of A02."""
    grown = [grow(N) for N in loops]
    last = grown[-1]
    kernel, compiled = native.compiled_anew(last.motion)
    seconds = {"deriving": last.deriving, "tracing": last.tracing}
    seconds |= {f"compiling for {what}": value for what, value in compiled.items()}
    speed = interleaved(native.evaluations(kernel, last.equations.reference, STATES), rounds)
    growth = [(b.instructions - a.instructions) / (b.loops - a.loops) for a, b in pairwise(grown)]
    figures = [
        *(Figure(f"N = {one.loops}: instructions per loop", one.instructions / one.loops, "", 150,
                 note=f"{one.instructions} in all") for one in grown),
        Figure("instructions per further loop, largest over smallest", max(growth) / min(growth)),
        *(Figure(f"N = {last.loops}: {what}", value, "s") for what, value in seconds.items()),
        Figure(f"N = {last.loops}: all of these", sum(seconds.values()), "s", 20.0),
        *(Figure(f"N = {last.loops}: {how}, per state", us(times), "µs", note=best(times))
          for how, times in speed.items()),
        *through_singular_poses(a02, rounds),
        Figure(f"A02, N = {PUBLISHED}: error of the first tip's place at the end",
               published_error(), "m"),
    ]  # fmt: skip
    raw = {
        "instructions": {one.loops: one.instructions for one in grown},
        "compiling": compiled,
        "deriving": {one.loops: one.deriving for one in grown},
        "tracing": {one.loops: one.tracing for one in grown},
        "evaluation": {how: summary(times) for how, times in speed.items()},
    }
    return Section("N-four-bar", method(loops[-1]), figures, raw)


def method(largest: int) -> str:
    return f"""
        `lw.robots.n_four_bar(N)`: 2 N + 1 rods, 3 N + 1 joints, N closed loops, one freedom.
        Instructions: of the traced forward dynamics, inputs and outputs included, over N. N =
        {largest} is compiled with an empty cache of kernels and evaluated at {STATES} states. A02:
        `robot.simulate` over {DURATION:g} s at rtol {RTOL:.0e} with on_singular="step_over", its
        end saved, after a first run that loads the kernels. Errors: the largest of the cranks'
        angles, against the equation of one freedom integrated to 1e-13, and for N = {PUBLISHED} the
        place of the first crank's tip, against the published one.
        """


@dataclass(frozen=True)
class Grown:
    """Hold the equations of a ladder, its traced forward dynamics, and the seconds that getting
    them took."""

    loops: int
    equations: Equations
    motion: ca.Function
    deriving: float
    tracing: float

    @property
    def instructions(self) -> int:
        """Return the instructions of the traced forward dynamics."""
        return self.motion.n_instructions()


def grow(loops: int) -> Grown:
    """Derive and trace a ladder."""
    mechanism = n_four_bar(loops)
    start = perf_counter()
    equations = derive(mechanism)
    middle = perf_counter()
    motion = functions.motion(equations)
    return Grown(loops, equations, motion, middle - start, perf_counter() - middle)


def through_singular_poses(loops: int, rounds: int) -> list[Figure]:
    """Return how long A02 takes and how well it ends."""
    robot = lw.Robot(without_tool(n_four_bar(loops)))
    run = swung(robot)
    times = interleaved(
        {
            "run": Contender(lambda: swung(robot)),
            "measured": Contender(lambda: swung(robot).variables["joint_position"]),
        },
        rounds,
    )
    (_, theta), _ = one_freedom.n_four_bar(loops).motion([0.0, DURATION], np.pi / 2, -1.0)
    title, took = f"A02, N = {loops}, {DURATION:g} s", f"{run.nfev} evaluations, {run.steps} steps"
    return [
        Figure(
            f"{title}: robot.simulate",
            1e-3 * us(times["run"]),
            "ms",
            50.0,
            note=f"{took}, {best(times['run'])}",
        ),
        Figure(
            f"{title}: the same, all joints measured at the end", 1e-3 * us(times["measured"]), "ms"
        ),
        Figure(
            f"{title}: largest error of a crank's angle at the end",
            float(abs(cranks(robot, run) - theta).max()),
            "rad",
        ),
        Figure(f"{title}: closure error", run.closure_error, "m"),
    ]


def published_error() -> float:
    """Return how far the first crank's tip is from its published place at the end of the small A02
    [m]."""
    robot = lw.Robot(without_tool(n_four_bar(PUBLISHED)))
    angle = cranks(robot, swung(robot))[0]
    return float(np.hypot(*(np.array([np.cos(angle), np.sin(angle)]) - N_FOUR_BAR[DURATION])))


def without_tool(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with no tool to follow: A02 asks for none."""
    return mechanism.model_copy(update={"tools": {}})


def swung(robot: lw.Robot) -> Run:
    """Return A02's run from upright cranks, its end saved."""
    start = robot.home.with_rates([-1.0])
    run = robot.simulate(
        start, duration=DURATION, rtol=RTOL, save_at=[DURATION], on_singular="step_over"
    )
    assert run.status is lw.Status.FINISHED, run.message
    return run


def cranks(robot: lw.Robot, run: Run) -> np.ndarray:
    """Return the angles of all cranks at the end of a run (N + 1,) [rad]."""
    columns = [i for i, name in enumerate(robot.coordinates) if name.startswith("pivot_")]
    return run.variables["joint_position"].values[-1, columns]
