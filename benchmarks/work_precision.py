"""Work and precision: what an error at the end of one simulated second costs in wall time, for
every contender.

All start from the same state under the same piecewise cubic forces. The error is the largest over
slide_1..3 and pivot_1..3 [m, rad], the coordinates that all of them integrate, against the
extrapolated reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

import linkwork as lw
from linkwork.lab.engines.exudyn import ExudynEngine
from linkwork.robots import prr3
from linkwork.views import style

from benchmarks import by_hand, engines, runs
from benchmarks.reference import Reference, reference
from benchmarks.table import Figure, Section
from benchmarks.tasks import Task, second_of_motion
from benchmarks.timing import Contender, interleaved

EQUAL_ERRORS = (1e-4, 1e-6, 1e-8, 1e-10)
PROMISED_FROM = 1e-6
LOOP, LINKWORK, RECORDED = (
    "Linkwork, compiled loop",
    "Linkwork, integrate",
    "Linkwork, simulate and measure",
)
PINOCCHIO_BARE, PINOCCHIO = "Pinocchio RK4, evaluations alone", "Pinocchio RK4"
NUMPY, MUJOCO, EXUDYN = "NumPy, SciPy's RK45", "MuJoCo RK4", "Exudyn"
PAIRS = (
    (LOOP, PINOCCHIO_BARE, 60),
    (LINKWORK, PINOCCHIO, 60),
    (LOOP, NUMPY, 300),
    (LINKWORK, NUMPY, 300),
    (RECORDED, NUMPY, None),
    (LINKWORK, MUJOCO, None),
    (LINKWORK, EXUDYN, None),
)
"""Ours, theirs, and how many times faster ours was promised to be, from errors of PROMISED_FROM
downwards."""
JOINTS = tuple(f"{kind}_{i}" for kind in ("slide", "pivot") for i in (1, 2, 3))
LOOKS = {
    LOOP: (style.BLUE, style.DASHES[0], "o"),
    LINKWORK: (style.BLUE, style.DASHES[1], "s"),
    RECORDED: (style.BLUE, style.DASHES[2], "D"),
    PINOCCHIO_BARE: (style.VERMILION, style.DASHES[0], "^"),
    PINOCCHIO: (style.VERMILION, style.DASHES[1], "v"),
    MUJOCO: (style.ORANGE, style.DASHES[1], "P"),
    NUMPY: (style.GREEN, style.DASHES[0], "X"),
    EXUDYN: (style.PINK, style.DASHES[0], "d"),
}
"""Colour, dashes and marker of each curve."""
Runner = Callable[[], np.ndarray]


@dataclass(frozen=True)
class Grid:
    """Hold the tolerances and numbers of steps to run, and how often to time each."""

    tolerances: tuple[float, ...] = tuple(10 ** (-k / 2) for k in range(6, 25))
    steps: tuple[int, ...] = (25, 50, 100, 200, 400, 800, 1600)
    exudyn_steps: tuple[int, ...] = (100, 400, 1600)
    rounds: int = 9


@dataclass(frozen=True)
class Curve:
    """Hold what a contender reached: its settings, errors [m, rad] and wall times [s], one each."""

    settings: list[float]
    errors: list[float]
    seconds: list[float]

    def time_at(self, error: float) -> float | None:
        """Return the time for an error, by interpolation of the logarithms; None outside what was
        reached.

        Between several settings of the same error the quickest counts.
        """
        pairs = list(zip(np.log(self.errors), np.log(self.seconds), strict=True))
        wanted, found = np.log(error), []
        for (e_1, t_1), (e_2, t_2) in pairwise(pairs):
            if min(e_1, e_2) <= wanted <= max(e_1, e_2) and e_1 != e_2:
                found.append(t_1 + (t_2 - t_1) * (wanted - e_1) / (e_2 - e_1))
        return float(np.exp(min(found))) if found else None


def run(grid: Grid | None = None) -> Section:
    """Measure all curves against the reference, and form the ratios of times at equal errors."""
    grid = grid or Grid()
    robot = lw.Robot(prr3())
    task = second_of_motion(robot)
    exact = reference(robot, task)
    curves = measure(robot, task, exact, grid)
    raw = {
        "reference": {
            "end": exact.end.tolist(),
            "order": exact.order,
            "integrator": exact.integrator,
        },
        "curves": {name: vars(curve) for name, curve in curves.items()},
    }
    return Section(
        "Work and precision",
        method(grid),
        figures(curves, exact),
        raw,
        {"work_precision.svg": plot(curves)},
    )


def method(grid: Grid) -> str:
    return f"""
        One second of the 3-PRR: the forces of a circle of 50 mm with a swing of 0.2 rad around 1.2
        rad, rest to rest, given as a cubic spline of 1001 samples. Error at the end over slide_1..3
        and pivot_1..3 [m, rad]; wall times are the best of {grid.rounds} turns, each the mean of a
        block of about 1 ms. Linkwork: the compiled loop alone; `integrate()` called from Python;
        `robot.simulate` with all that follows from the states measured. Pinocchio and MuJoCo: fixed
        steps of the classical Runge-Kutta method in a lean Python loop, the forces evaluated
        beforehand; "evaluations alone" counts nothing but the calls of `constraintDynamics`, as if
        the rest of the integrator cost nothing, to set beside the compiled loop. NumPy: the
        equations by hand, `solve_ivp` with RK45. Exudyn: generalised-alpha, once. Ratios are times
        at equal error, by interpolation of the logarithms; the promises count from errors of
        {PROMISED_FROM:.0e} downwards.

        ![error against wall time](work_precision.svg)
        """


def figures(curves: Mapping[str, Curve], exact: Reference) -> list[Figure]:
    """Return the ratios of times at equal errors, and what the reference is worth."""
    rows = [
        Figure("reference: change with the order of extrapolation", exact.order, "rad", 1e-14),
        Figure("reference: distance of DOP853 in doubles on the kernel", exact.integrator, "rad"),
        Figure(
            "reference: distance of DOP853 in doubles on the equations by hand",
            exact.formulation,
            "rad",
        ),
    ]
    for ours, theirs, promised in PAIRS:
        for error in EQUAL_ERRORS:
            quick, slow = curves[ours].time_at(error), curves[theirs].time_at(error)
            if quick and slow:
                bound = promised if error <= PROMISED_FROM else None
                note = f"{1e3 * slow:.3g} ms against {1e3 * quick:.3g} ms"
                rows.append(
                    Figure(
                        f"{theirs} / {ours}, error {error:.0e}",
                        slow / quick,
                        "",
                        bound,
                        "at least",
                        note,
                    )
                )
    return rows


def measure(robot: lw.Robot, task: Task, exact: Reference, grid: Grid) -> dict[str, Curve]:
    """Run every contender at all its settings, in turn."""
    rows = contenders(robot, task, grid)
    runners = {
        f"{name}: {setting:g}": run for name, pairs in rows.items() for setting, run in pairs
    }
    timed = {key: Contender(run) for key, run in runners.items()}
    standing = robot.state(task.start.positions[None])
    timed[PINOCCHIO_BARE] = engines.pinocchio_evaluations(
        robot, standing, np.zeros((1, robot.mobility))
    )
    seconds = interleaved(timed, grid.rounds, block=1e-3)
    curves = {}
    for name, pairs in rows.items():
        settings = [float(setting) for setting, _ in pairs]
        errors = [distance(run(), exact) for _, run in pairs]
        curves[name] = Curve(
            settings, errors, [float(seconds[f"{name}: {x:g}"].min()) for x in settings]
        )
    each, whole = float(seconds[PINOCCHIO_BARE].min()), curves[PINOCCHIO]
    curves[PINOCCHIO_BARE] = Curve(
        whole.settings, whole.errors, [4 * each * steps for steps in whole.settings]
    )
    curves[EXUDYN] = exudyn(robot, task, exact, grid)
    return curves


def distance(end: np.ndarray, exact: Reference) -> float:
    """Return the largest error of slide_1..3 and pivot_1..3; one of zero counts as half a unit in
    the last place of 1."""
    return max(float(np.abs(end - exact.end).max()), 2.0**-54)


def contenders(robot: lw.Robot, task: Task, grid: Grid) -> dict[str, list[tuple[float, Runner]]]:
    """Return for each contender its settings, and runs that return slide_1..3 and pivot_1..3 at the
    end (6,)."""
    pinocchio, mujoco = engines.pinocchio(robot), engines.MujocoEngine(robot.mechanism)
    q, v = task.start.positions, robot.joint_rates(task.start)
    tree = [robot.equations.tree.coordinates.index(name) for name in JOINTS]
    columns = [robot.coordinates.index(name) for name in JOINTS]

    def loop(tolerance: float) -> Runner:
        call = runs.compiled_loop(robot, task, tolerance)
        return lambda: call()[tree]

    def integrated(tolerance: float) -> np.ndarray:
        return runs.integrated(robot, task, tolerance).q_end[tree]

    def recorded(tolerance: float) -> np.ndarray:
        return runs.recorded(robot, task, tolerance).variables["joint_position"].values[-1, columns]

    def stepping(
        engine: engines.TreeEngine, acceleration: engines.Acceleration
    ) -> Callable[[int], Runner]:
        places = [list(engine.columns).index(column) for column in columns]
        start = engine.plan.state(q, v)

        def prepared(steps: int) -> Runner:
            forces = list(task.signal(np.linspace(0.0, task.duration, 2 * steps + 1)))
            return lambda: engines.runge_kutta(acceleration, *start, forces, task.duration / steps)[
                0
            ][places]

        return prepared

    def numpy_and_scipy(tolerance: float) -> np.ndarray:
        return by_hand.simulate(task, robot.tool_pose(task.start), tolerance, runs.ATOL * tolerance)

    by_pinocchio = stepping(pinocchio, engines.pinocchio_acceleration(pinocchio))
    by_mujoco = stepping(mujoco, engines.mujoco_acceleration(mujoco))
    return {
        LOOP: [(x, loop(x)) for x in grid.tolerances],
        LINKWORK: [(x, partial(integrated, x)) for x in grid.tolerances],
        RECORDED: [(x, partial(recorded, x)) for x in grid.tolerances],
        PINOCCHIO: [(x, by_pinocchio(x)) for x in grid.steps],
        MUJOCO: [(x, by_mujoco(x)) for x in grid.steps],
        NUMPY: [(x, partial(numpy_and_scipy, x)) for x in grid.tolerances],
    }


def exudyn(robot: lw.Robot, task: Task, exact: Reference, grid: Grid) -> Curve:
    """Return Exudyn's curve; the time is that of its solver, once for each number of steps."""
    engine, forces = ExudynEngine(robot.mechanism), by_hand.Lookup(task.signal)
    columns = [robot.coordinates.index(name) for name in JOINTS]
    done = [
        engine.simulate(
            task.start.positions,
            robot.joint_rates(task.start),
            forces,
            task.duration,
            task.duration / steps,
        )
        for steps in grid.exudyn_steps
    ]
    errors = [distance(run.positions[-1, columns], exact) for run in done]
    return Curve(
        [float(steps) for steps in grid.exudyn_steps], errors, [run.seconds for run in done]
    )


def plot(curves: Mapping[str, Curve]) -> str:
    """Draw error against wall time, both in powers of ten, as SVG."""
    with style.styled():
        figure = style.new_figure(7.2, 5.4)
        axes = figure.add_subplot()
        for name, (colour, dashes, marker) in LOOKS.items():
            curve = curves[name]
            axes.loglog(
                *(curve.seconds, curve.errors),
                label=name,
                color=colour,
                linestyle=dashes,
                marker=marker,
                markersize=4.5,
                markeredgewidth=0,
            )
        axes.set_xlabel("wall time for 1 s of motion [s]")
        axes.set_ylabel("error at the end [m, rad]")
        axes.set_title("3-PRR, 1 s of motion: error against wall time")
        figure.legend(loc="outside lower center", ncols=3)
        return style.svg(figure)
