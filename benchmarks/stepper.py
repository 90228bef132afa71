"""Step by step: a call of a stepper from Python, many robots together, and stacks of states."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import linkwork as lw
from linkwork.lab.engines.mujoco import MujocoEngine, mj
from linkwork.model.stacks import reading
from linkwork.robots import prr3

from benchmarks import ensemble
from benchmarks.native import STATES, in_batches
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.tasks import second_of_pushing
from benchmarks.timing import Contender, interleaved, ns, summary

DT = 1e-3
ROBOTS, ROLLED, STEPS, STACK = 1024, 16, 1000, 20_000
STEP, MANY, BEYOND = 3000.0, 100.0, 30.0  # promised [ns]
METHOD = f"""
    The 3-PRR, method rk4, steps of 1 ms, one thread. One: a call of `stepper.step` from Python
    under forces that change their sign and bring the robot back. Many: {ROBOTS:,} robots under
    forces of their own, `robots.step`, nanoseconds for each robot and step. `out`: no array is
    made. MuJoCo: `mj_step` with its Runge-Kutta method of order 4 of the same robot after its
    forces were written, whose loops are held by soft constraints; `mujoco.rollout` of {ROLLED}
    robots over {STEPS:,} steps. Stacks: {STACK:,} states, nanoseconds each; beyond the kernel: less
    what the kernel's own vector code takes for states that lie ready in the cache.
    """


def run(rounds: int = 60, robots: int = ROBOTS, stack: int = STACK) -> Section:
    """Time steps of one and of many, and stacks, all in turn."""
    robot = lw.Robot(prr3())
    steps, stacks = {**one(robot), **many(robot, robots)}, stacked(robot, stack)
    seconds = interleaved({**steps, **stacks}, rounds)
    figures = [
        Figure("a step from Python, out=", ns(seconds["one, out"]), "ns", STEP),
        Figure("a step from Python, a new array", ns(seconds["one"]), "ns", STEP),
        Figure("a step of one of many, out=", ns(seconds["many, out"]), "ns", MANY),
    ]
    for what in ("state", "forward dynamics", "inverse dynamics"):
        own = ns(seconds[f"{what}, kernel"])
        beyond, note = ns(seconds[what]) - own, f"the kernel takes {own:.3g} ns"
        figures.append(
            Figure(f"{what} of a stack beyond the kernel", beyond, "ns", BEYOND, note=note)
        )
    rows = [(name, quantity(ns(values), "")) for name, values in seconds.items()]
    raw = {name: summary(values) for name, values in seconds.items()}
    listing = Listing(("call", "a step, or a state [ns]"), rows)
    return Section("Step by step", METHOD, figures, {"seconds": raw}, listing=listing)


def to_and_fro(step: Callable[[np.ndarray], object], u: np.ndarray, each: int) -> Contender:
    """Return four steps, under forces and under the opposite ones, that come back to where they
    began."""
    back = -u

    def call() -> None:
        step(u)
        step(back)
        step(back)
        step(u)

    return Contender(call, 4 * each)


def one(robot: lw.Robot) -> dict[str, Contender]:
    """Return steps of one robot, of ours and of MuJoCo's."""
    u, engine = np.array([0.5, -0.2, 0.1]), MujocoEngine(robot.mechanism)
    plain, quick = (robot.stepper(robot.home, DT) for _ in range(2))
    engine.model.opt.timestep = DT
    engine.evaluation(robot.home.positions, robot.joint_rates(robot.home), u)()

    def mujoco(u: np.ndarray) -> None:
        engine.data.ctrl[:] = u
        mj.mj_step(engine.model, engine.data)

    return {
        "one, out": to_and_fro(lambda u: quick.step(u, out=quick.y), u, 1),
        "one": to_and_fro(plain.step, u, 1),
        "one, MuJoCo": to_and_fro(mujoco, u, 1),
    }


def many(robot: lw.Robot, count: int) -> dict[str, Contender]:
    """Return steps of many robots, of ours and of MuJoCo's."""
    u = np.random.default_rng(2).normal(size=(count, 3))
    states = robot.state(np.tile(robot.home.positions, (count, 1)))
    plain, quick = (robot.stepper(states, DT, threads=1) for _ in range(2))
    columns = [robot.coordinates.index(name) for name in robot.actuators]
    given = MujocoEngine(robot.mechanism), robot, second_of_pushing(robot), u[:ROLLED]
    rk4 = int(mj.mjtIntegrator.mjINT_RK4)
    rolled = ensemble.rolled(*given, rk4, STEPS, columns)
    return {
        "many, out": to_and_fro(lambda u: quick.step(u, out=quick.y), u, count),
        "many": to_and_fro(plain.step, u, count),
        "many, MuJoCo": Contender(rolled, STEPS * min(count, ROLLED)),
    }


def stacked(robot: lw.Robot, count: int) -> dict[str, Contender]:
    """Return states, forward and inverse dynamics of stacks, and their kernels alone."""
    draw = np.random.default_rng(3)
    positions = np.tile(robot.home.positions, (count, 1))
    rates, u = draw.normal(size=(2, count, 3))
    states = robot.state(positions, rates)
    v_dot = robot.forward_dynamics(states, u)
    kernels = {
        "state": (reading(robot), [positions]),
        "forward dynamics": (robot.kernel("motion"), [states.q, rates, u]),
        "inverse dynamics": (robot.kernel("inverse_dynamics"), [states.q, rates, v_dot]),
    }
    alone = {
        f"{name}, kernel": in_batches(kernel, np.hstack(parts)[:STATES])
        for name, (kernel, parts) in kernels.items()
    }
    calls = {
        "state": lambda: robot.state(positions, rates),
        "forward dynamics": lambda: robot.forward_dynamics(states, u),
        "inverse dynamics": lambda: robot.inverse_dynamics(states, v_dot),
    }
    return {name: Contender(call, count) for name, call in calls.items()} | alone
