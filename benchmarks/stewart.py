"""The Gough-Stewart platform with heavy legs: size and speed of its forward dynamics, beside
Pinocchio and MuJoCo.

Two charts are compiled: the one that runs start in (the shorter one) and the one of the six legs'
rates (the actuated ones).
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

import linkwork as lw
from linkwork.equations import functions
from linkwork.model.charts import CompiledChart
from linkwork.robots import stewart

from benchmarks import engines, native
from benchmarks.size import size
from benchmarks.table import Figure, Section
from benchmarks.timing import Contender, best, interleaved, ns, summary, us

STATES, POSES = 256, 32
SHIFT, TURN, SPEED, LIFT, PUSH = 0.4, 0.3, 0.5, 5400.0, 1000.0
AGREEMENT = 1e-8
BATCH, ONE, CALL = "Linkwork, batch", "Linkwork, one by one", "Linkwork, from Python"
INDEPENDENT = "Linkwork, one by one, all known in advance"
LEGS_BATCH, LEGS_ONE = "Linkwork, legs' rates, batch", "Linkwork, legs' rates, one by one"
PINOCCHIO, EMPTY, MUJOCO = "Pinocchio", "Pinocchio, empty call", "MuJoCo"


def run(rounds: int = 60) -> Section:
    """Measure size and times, all contenders in turn, after they agreed on the accelerations."""
    start = perf_counter()
    robot = lw.Robot(stewart())
    traced = functions.motion(robot.run_chart.equations)
    derived = perf_counter() - start
    _, compiled = native.compiled_anew(traced)
    states, forces = poses(robot, POSES)
    error = errors(robot, states, forces)
    assert error[PINOCCHIO].max() < AGREEMENT, (
        f"Pinocchio's accelerations differ by {error[PINOCCHIO].max():.1e}"
    )
    seconds = interleaved(contenders(robot, states, forces), rounds)
    code = size(robot.run_chart.equations)
    legs = functions.motion(robot.equations).n_instructions()
    figures = [
        *code.figures(6000),
        Figure("instructions of the traced function in the legs' rates", legs),
        Figure("deriving, choosing the chart and tracing", derived, "s"),
        *(
            Figure(f"compiling for {what}, cache empty", value, "s")
            for what, value in compiled.items()
        ),
        *times(seconds),
        *ratios({name: float(np.median(values)) for name, values in seconds.items()}),
        Figure(
            "Pinocchio's accelerations: largest relative difference",
            error[PINOCCHIO].max(),
            "",
            AGREEMENT,
        ),
        Figure(
            "MuJoCo's accelerations: median relative difference", float(np.median(error[MUJOCO]))
        ),
    ]
    raw = {"seconds": {name: summary(values) for name, values in seconds.items()}}
    return Section("Stewart platform", METHOD, figures, raw)


METHOD = f"""
    Forward dynamics of `lw.robots.stewart()`: 13 moving bodies, 18 joints. {POSES} random poses of
    the platform within {SHIFT} m and {TURN} rad of home in every direction, legs' rates normal with
    {SPEED} m/s, legs' forces normal with {1e-3 * PUSH:g} kN around {1e-3 * LIFT:g} kN; for batches
    {STATES} states at these poses, in the core's cache. The promise is about the chart that runs
    start in; the chart of the legs' rates, in which the actuated accelerations are, stands beside
    it. Medians of blocks of 2 ms in which the contenders take turns.

    Pinocchio (`constraintDynamics`, a tree of 21 freedoms, five points closed) is called from
    Python in a tight loop over {POSES} prepared states, with the quickest proximal settings that
    keep its accuracy; the empty call is an upper bound of what calling from Python costs. MuJoCo:
    `mj_forward` at one state. They are timed after their accelerations agreed with Linkwork's.
    Published times of C++ programs for such a platform, on another machine: Pinocchio 13.5 µs,
    MuJoCo 9.9 µs.
    """


def times(seconds: dict[str, np.ndarray]) -> list[Figure]:
    """Return the times per state."""
    others = (INDEPENDENT, LEGS_BATCH, LEGS_ONE, CALL, PINOCCHIO, EMPTY, MUJOCO)
    return [
        Figure(
            "batches, per state and core",
            ns(seconds[BATCH]),
            "ns",
            150.0,
            note=best(seconds[BATCH]),
        ),
        Figure(
            "one by one, each waiting for the last, per state",
            us(seconds[ONE]),
            "µs",
            0.85,
            note=best(seconds[ONE]),
        ),
        *(
            Figure(f"{name}, per state", us(seconds[name]), "µs", note=best(seconds[name]))
            for name in others
        ),
    ]


def poses(robot: lw.Robot, count: int) -> tuple[lw.State, np.ndarray]:
    """Return random states (count) around home, and forces (count, 6) [N]."""
    random = np.random.default_rng(2002)
    home = robot.tool_pose(robot.home)
    shifts = random.uniform(-1, 1, (count, 6)) * [SHIFT, SHIFT, SHIFT, TURN, TURN, TURN]
    states = robot.assemble(tool=home + shifts).with_rates(SPEED * random.normal(size=(count, 6)))
    return states, LIFT + PUSH * random.normal(size=(count, 6))


def errors(robot: lw.Robot, states: lw.State, forces: np.ndarray) -> dict[str, np.ndarray]:
    """Return how far the engines' accelerations of the chart's rates are from Linkwork's, relative
    (count,)."""
    ours = robot.in_chart(states, robot.run_chart.independent)
    found, joint_rates = robot.forward_dynamics(ours, forces), robot.joint_rates(states)
    columns = [robot.rates.index(name) for name in ours.independent]

    def error(engine: engines.TreeEngine) -> np.ndarray:
        rows = zip(states.positions, joint_rates, forces, strict=True)
        theirs = np.array([engine.joint_accelerations(*row)[columns] for row in rows])
        return np.abs(theirs - found).max(axis=1) / np.abs(found).max(axis=1)

    return {
        PINOCCHIO: error(engines.pinocchio(robot)),
        MUJOCO: error(engines.MujocoEngine(robot.mechanism)),
    }


def contenders(robot: lw.Robot, states: lw.State, forces: np.ndarray) -> dict[str, Contender]:
    """Return forward dynamics in every hand."""
    one, u = states.at(0), forces[0]
    ours, x = robot.run_chart.kernel("motion"), inputs(robot, robot.run_chart, states, forces)
    legs, x_legs = robot.kernel("motion"), inputs(robot, robot.chart, states, forces)
    rates = robot.equations.nq + robot.mobility
    return {
        BATCH: native.in_batches(ours, x),
        ONE: native.one_after_another(ours, x, rates),
        INDEPENDENT: native.one_by_one(ours, x),
        LEGS_BATCH: native.in_batches(legs, x_legs),
        LEGS_ONE: native.one_after_another(legs, x_legs, rates),
        CALL: Contender(lambda: robot.forward_dynamics(one, u)),
        PINOCCHIO: engines.pinocchio_evaluations(robot, states, forces),
        EMPTY: engines.pinocchio_call(),
        MUJOCO: engines.mujoco_evaluations(robot, states, forces),
    }


def inputs(
    robot: lw.Robot, chart: CompiledChart, states: lw.State, forces: np.ndarray
) -> np.ndarray:
    """Return the inputs (q, v, u) of a chart's kernel for STATES states: the given ones, faster and
    slower."""
    there = robot.in_chart(states, chart.independent)
    rows = np.arange(STATES) % len(forces)
    pace = np.random.default_rng(11).uniform(0.5, 1.5, (STATES, 1))
    return np.ascontiguousarray(np.hstack([there.q[rows], pace * there.rates[rows], forces[rows]]))


def ratios(median: dict[str, float]) -> list[Figure]:
    """Return the ratios of rates of states."""
    bare = median[PINOCCHIO] - median[EMPTY]
    return [
        Figure("batches on one core: times Pinocchio's rate of states",
               median[PINOCCHIO] / median[BATCH], "", 80, "at least"),
        Figure("one by one, native: times Pinocchio's rate", median[PINOCCHIO] / median[ONE], "",
               15, "at least"),
        Figure("batches: times Pinocchio's rate, its empty call subtracted", bare / median[BATCH]),
        Figure("one by one: times Pinocchio's rate, its empty call subtracted", bare / median[ONE]),
        Figure("batches: times MuJoCo's rate", median[MUJOCO] / median[BATCH]),
        Figure("one by one: times MuJoCo's rate", median[MUJOCO] / median[ONE]),
    ]  # fmt: skip
