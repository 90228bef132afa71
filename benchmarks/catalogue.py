"""Every robot of the catalogue: how large its forward dynamics is, how quick, and what it takes to
get it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import linkwork as lw
from linkwork import robots
from linkwork.equations import functions
from linkwork.kernels import Kernel

from benchmarks import native
from benchmarks.table import Listing, Section, quantity
from benchmarks.timing import empty_cache, interleaved, ns, summary, us

STATES = 128
COLUMNS = (
    "robot",
    "freedoms",
    "instructions",
    "batch [ns]",
    "one [µs]",
    "derived [s]",
    "compiled [s]",
)
METHOD = f"""
    Forward dynamics of all robots in `lw.robots`, with their default data, in the chart that runs
    start in. Instructions: of the traced function, inputs and outputs included. Batch: time per
    state in batches on one core; one: state by state, each waiting for the one before. Both over
    {STATES} states at the reference configuration with random rates and forces, medians of blocks
    of 2 ms in which all robots take turns. Derived: from the description to the traced function;
    compiled: for one state and for batches, with an empty cache of kernels.
    """


@dataclass(frozen=True)
class Entry:
    """Hold a robot, the instructions of its traced forward dynamics, its kernel, and the seconds
    that these took."""

    robot: lw.Robot
    instructions: int
    kernel: Kernel
    derived: float
    compiled: float


def entry(name: str) -> Entry:
    """Derive, trace and compile a robot of the catalogue."""
    with empty_cache():
        start = perf_counter()
        robot = lw.Robot(getattr(robots, name)())
        motion = functions.motion(robot.run_chart.equations)
        derived = perf_counter() - start
    kernel, compiled = native.compiled_anew(motion)
    return Entry(robot, motion.n_instructions(), kernel, derived, sum(compiled.values()))


def run(names: Sequence[str] = tuple(robots.__all__), rounds: int = 30) -> Section:
    """Derive and compile all robots, then time all kernels in turn."""
    entries = {name: entry(name) for name in names}
    contenders = {
        (name, how): contender
        for name, one in entries.items()
        for how, contender in native.evaluations(one.kernel, one.robot.home.q, STATES).items()
    }
    seconds = interleaved(contenders, rounds)
    rows = [
        (
            name,
            str(one.robot.mobility),
            str(one.instructions),
            quantity(ns(seconds[name, "batches"]), ""),
            quantity(us(seconds[name, "one by one"]), ""),
            quantity(one.derived, "", 2),
            quantity(one.compiled, "", 2),
        )
        for name, one in entries.items()
    ]
    raw = {
        name: {
            "freedoms": one.robot.mobility,
            "instructions": one.instructions,
            "derived": one.derived,
            "compiled": one.compiled,
            "batches": summary(seconds[name, "batches"]),
            "one by one": summary(seconds[name, "one by one"]),
        }
        for name, one in entries.items()
    }
    return Section("Catalogue", METHOD, raw=raw, listing=Listing(COLUMNS, rows))
