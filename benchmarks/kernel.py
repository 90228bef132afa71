"""The 3-PRR's forward-dynamics kernel: its size, its speed in every way it is called, and what
compiling it costs."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from time import perf_counter

import numpy as np

import linkwork as lw
from linkwork.robots import prr3

from benchmarks import native, runs
from benchmarks.machine import Machine
from benchmarks.size import size
from benchmarks.table import Figure, Section
from benchmarks.tasks import second_of_motion, second_of_pushing, workspace_states
from benchmarks.timing import Contender, best, interleaved, ns, summary, us

PROCESSES = 3
RTOL = 1e-8
COMPILE = """
from linkwork.equations import derive, functions
from linkwork.kernels import compile_function
from linkwork.robots import prr3
from time import perf_counter
motion = functions.motion(derive(prr3()))
start = perf_counter()
kernel = compile_function(motion)
kernel.address, kernel.batch_address
print(perf_counter() - start, kernel.from_cache)
"""


def run(machine: Machine, rounds: int = 100) -> Section:
    """Measure the kernel's size, speed and cost of compiling, and one simulated second."""
    robot = lw.Robot(prr3())
    times = interleaved(contenders(robot), rounds)
    cold, warm = compile_times(PROCESSES)
    info = info_times(PROCESSES)
    tasks = {"moving": second_of_motion(robot), "pushed": second_of_pushing(robot)}
    nfev = {name: runs.integrated(robot, task, RTOL).nfev for name, task in tasks.items()}
    code = size(robot.equations)
    figures = [
        *code.figures(520),
        *speed(machine, times, code.flops),
        Figure("one Python call of robot.forward_dynamics", us(times["Python"]), "µs", 5.0),
        Figure("one Python call of the kernel on arrays", us(times["kernel call"]), "µs"),
        Figure("compiling the kernel, cache empty", float(np.median(cold)), "s", 0.5),
        Figure("getting the kernel from the cache", 1e3 * float(np.median(warm)), "ms", 50.0),
        Figure("linkwork info prr3, warm, whole process", float(np.median(info)), "s", 2.0),
        Figure("1 s under a constant force, rtol 1e-8: compiled loop", us(times["pushed"]), "µs",
               100.0, note=f"{nfev['pushed']} evaluations"),
        Figure("1 s of prescribed motion, rtol 1e-8: compiled loop", us(times["moving"]), "µs",
               100.0, note=f"{nfev['moving']} evaluations"),
        Figure("the same, integrate() called from Python", us(times["integrate"]), "µs"),
        Figure("the same, robot.simulate", us(times["simulate"]), "µs"),
    ]  # fmt: skip
    raw = {
        "seconds": {name: summary(values) for name, values in times.items()},
        "compile": {"cold": cold, "cached": warm},
        "info": info,
        "flops": code.flops,
    }
    return Section("Kernel", METHOD, figures, raw)


METHOD = f"""
    One core. Batches: {native.STATES} states over the workspace in the kernel's own layout, in the
    core's cache, evaluated by its native loop over blocks. One by one: a native loop calls the
    one-lane code for state after state, either each waiting for the derivatives of the one before,
    as in an integrator, or all known in advance. Medians of blocks of 2 ms in which the contenders
    take turns. Fraction of peak: additions, multiplications, divisions and roots of the vector
    code, an FMA counting two, against the measured peak of independent FMAs. Compiling: fresh
    processes, the time to get the code for one state and that for batches. Simulated seconds: 0.5 N
    on the first slider from rest, and the task of the work-precision plot; the compiled loop is all
    of a run but the checks of its arguments.
    """


def speed(machine: Machine, times: dict[str, np.ndarray], flops: int) -> list[Figure]:
    """Return the times per state, and what they are of the machine's peak."""
    batch = ns(times["batch"])
    unmeasured = (
        f"this processor has no AVX-512; {machine.lanes} lanes take what the next line says"
    )
    return [
        Figure("batches with AVX-512, per state and core", batch if machine.has_avx512 else None,
               "ns", 17.0, note="" if machine.has_avx512 else unmeasured),
        Figure(f"batches of {machine.lanes} lanes, per state and core", batch, "ns",
               note=best(times["batch"])),
        Figure("batches: floating-point operations per state", float(flops)),
        Figure("batches: fraction of the arithmetic peak", 100 * flops / (batch * machine.peak),
               "%"),
        Figure("one by one, each waiting for the last, per state", ns(times["chained"]), "ns",
               120.0, note=best(times["chained"])),
        Figure("one by one, all known in advance, per state", ns(times["independent"]), "ns",
               note=best(times["independent"])),
    ]  # fmt: skip


def contenders(robot: lw.Robot) -> dict[str, Contender]:
    """Return the ways to evaluate the kernel and to run a second of motion."""
    kernel = robot.kernel("motion")
    states, x = inputs(robot, native.STATES)
    one, u = states.at(0), x[0, -robot.mobility :].copy()
    rates = robot.equations.nq + robot.mobility
    moving, pushed = second_of_motion(robot), second_of_pushing(robot)
    return {
        "batch": native.in_batches(kernel, x),
        "chained": native.one_after_another(kernel, x, rates),
        "independent": native.one_by_one(kernel, x),
        "Python": Contender(lambda: robot.forward_dynamics(one, u)),
        "kernel call": Contender(lambda: kernel(one.q, one.rates, u)),
        "pushed": Contender(runs.compiled_loop(robot, pushed, RTOL)),
        "moving": Contender(runs.compiled_loop(robot, moving, RTOL)),
        "integrate": Contender(lambda: runs.integrated(robot, moving, RTOL)),
        "simulate": Contender(lambda: runs.recorded(robot, moving, RTOL)),
    }


def inputs(robot: lw.Robot, count: int) -> tuple[lw.State, np.ndarray]:
    """Return random states over the workspace and the kernel's inputs (q, v, u) for them
    (count, n_in).

    A hundred poses are assembled; the rates and forces of all states are their own.
    """
    poses = workspace_states(robot, 100)
    random = np.random.default_rng(11)
    states = poses.at(np.arange(count) % 100).with_rates(
        random.normal(size=(count, robot.mobility))
    )
    forces = random.normal(size=(count, robot.mobility))
    return states, np.ascontiguousarray(np.hstack([states.q, states.rates, forces]))


def compile_times(processes: int) -> tuple[list[float], list[float]]:
    """Return the seconds to get the kernel in fresh processes: with an empty cache, and from the
    cache."""
    cold, warm = [], []
    for _ in range(processes):
        with tempfile.TemporaryDirectory() as folder:
            for seconds, cached in ((cold, "False"), (warm, "True")):
                output = python("-c", COMPILE, LINKWORK_CACHE_DIR=folder).split()
                assert output[1] == cached
                seconds.append(float(output[0]))
    return cold, warm


def info_times(processes: int) -> list[float]:
    """Return the wall times of `linkwork info prr3` after a first call [s]."""
    seconds = []
    for _ in range(processes + 1):
        start = perf_counter()
        python("-m", "linkwork", "info", "prr3")
        seconds.append(perf_counter() - start)
    return seconds[1:]


def python(*arguments: str, **environment: str) -> str:
    """Run this Python with arguments and further environment variables; return what it prints."""
    result = subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | environment,
        check=True,
        capture_output=True,
        text=True,
    )
    return result.stdout
