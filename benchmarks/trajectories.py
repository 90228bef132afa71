"""Work, precision and closure on three robots: 3-PRR, Stewart platform and Andrews' squeezer,
beside SciPy, Exudyn and MuJoCo.

Everybody is called as a user calls it, on the same motion under constant forces. The references
share nothing with the library's integrators: for the 3-PRR equations by hand, for the Stewart
platform Pinocchio, for the squeezer the equations of the IVP test set.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.integrate import solve_ivp

import linkwork as lw
from linkwork.lab.engines.exudyn import ExudynEngine
from linkwork.lab.engines.mujoco import MujocoEngine
from linkwork.lab.precision import plot_work_precision
from linkwork.robots import andrews as squeezer
from linkwork.robots import prr3, stewart
from linkwork.robots._andrews import ANGLES
from linkwork.views import style

from benchmarks import by_hand, engines, runs, scipy_runs
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.tasks import second_of_pushing
from benchmarks.timing import Contender, interleaved
from benchmarks.work_precision import JOINTS, Curve
from tests.oracle import andrews

OURS = ("sharp_smart", "dormand_prince", "dop853", "rodas")
LINKWORK = "Linkwork, {}"
SCIPY = "SciPy, {}"
MUJOCO, EXUDYN = "MuJoCo, RK4", "Exudyn"
EQUAL_ERRORS = (1e-4, 1e-6, 1e-8)
STIFFEST = 1e-8  # tightest tolerance of the methods that need Jacobians
LEGS = (5600.0, 5200.0, 5500.0, 5300.0, 5450.0, 5350.0)  # of the Stewart platform [N]
COLUMNS = ("robot", "by", "setting", "error [m, rad]", "closure error [m]", "time [ms]")
METHOD = """
    Constant forces from rest: the pushed second of the 3-PRR; one second of the Stewart platform
    under 5.2 to 5.6 kN in its legs; 0.03 s of Andrews' squeezer under its drive. Error: largest of
    some joint coordinates at the end. Closure error: the largest gap of any loop over what was
    saved. Everybody is called from Python and saves the end alone or, where that cannot be chosen,
    every step: `robot.simulate`; SciPy's `solve_ivp` on Linkwork's compiled right-hand side, q not
    projected; MuJoCo (Runge-Kutta of order 4, soft constraints made stiff) and Exudyn
    (generalised-alpha), the time inside their solvers alone. Best of several runs in turn; Exudyn's
    and MuJoCo's best of two. Ratios are times at equal error, by interpolation of the logarithms.

    Where MuJoCo's and SciPy's curves end in a vertical line, soft constraints or drift bound the
    error from below.
    """


@dataclass(frozen=True)
class Grid:
    """Hold the tolerances and the numbers of steps to run, and how often to time each."""

    tolerances: tuple[float, ...] = tuple(10.0**-k for k in range(3, 13))
    scipy: tuple[float, ...] = (1e-4, 1e-6, 1e-8, 1e-10)
    steps: tuple[int, ...] = (50, 200, 800)
    rounds: int = 3


@dataclass(frozen=True)
class Problem:
    """Hold a run from a state under constant forces, and where some of its joints are at the end.

    joints: names; reference: their coordinates at the end, by others than the library [m, rad];
    finer: by how much the steps of engines are to be finer
    """

    name: str
    title: str
    robot: lw.Robot
    start: lw.State
    forces: np.ndarray
    duration: float
    joints: Sequence[str]
    reference: Callable[[], np.ndarray]
    finer: int = 1

    def error(self, positions: np.ndarray, exact: np.ndarray) -> float:
        """Return the largest error of these joints among all coordinates at the end, turns of
        angles left out."""
        columns = [self.robot.coordinates.index(name) for name in self.joints]
        gap = positions[columns] - exact
        angular = self.robot.labels.angular[columns]
        return float(np.abs(np.where(angular, 2 * np.sin(gap / 2), gap)).max())


@dataclass(frozen=True)
class Result:
    """Hold all joint coordinates at the end, the closure error, and the time inside a solver where
    it tells it."""

    positions: np.ndarray
    closure_error: float
    seconds: float | None = None


@dataclass(frozen=True)
class Measured:
    """Hold a contender's curve and its closure errors."""

    curve: Curve = field(default_factory=lambda: Curve([], [], []))
    gaps: list[float] = field(default_factory=list)


def planar() -> Problem:
    """Return the pushed second of the 3-PRR."""
    robot = lw.Robot(prr3())
    task = second_of_pushing(robot)
    u = task.signal(np.zeros(1))[0]

    def reference() -> np.ndarray:
        x = by_hand.from_joints(task.start.positions, robot.tool_pose(task.start))
        return by_hand.sliding_and_pivoting(
            exactly(
                lambda y: np.concatenate(by_hand.derivative(y[:9], y[9:], u)),
                np.concatenate([x, np.zeros(3)]),
                1.0,
            )
        )

    return Problem("prr3", "3-PRR", robot, task.start, u, 1.0, JOINTS, reference)


def hexapod() -> Problem:
    """Return a second of the Stewart platform from rest at home; the reference is Pinocchio's
    motion."""
    robot = lw.Robot(stewart())
    forces, start = np.array(LEGS), robot.home
    engine = engines.pinocchio(robot)
    columns = [robot.coordinates.index(name) for name in robot.actuators]

    def reference() -> np.ndarray:
        at_rest = robot.joint_rates(start)
        done = [
            engine.simulate(start.positions, at_rest, forces, 1.0, 1.0 / steps)
            for steps in (200, 400)
        ]
        coarse, fine = (run.positions[-1, columns] for run in done)
        return fine + (fine - coarse) / 15

    return Problem(
        "stewart", "Stewart platform", robot, start, forces, 1.0, robot.actuators, reference
    )


def linkage() -> Problem:
    """Return the published motion of Andrews' squeezer."""
    robot = lw.Robot(squeezer())
    reference = lambda: andrews.motion([0.0, 0.03])[0][-1]  # noqa: E731
    return Problem(
        "andrews",
        "Andrews' squeezer",
        robot,
        robot.home,
        np.array([andrews.torque]),
        0.03,
        ANGLES,
        reference,
        4,
    )


PROBLEMS = (planar, hexapod, linkage)


def exactly(f: Callable[[np.ndarray], np.ndarray], y: np.ndarray, duration: float) -> np.ndarray:
    """Return y at the end by SciPy's DOP853, to rounding."""
    return solve_ivp(
        lambda _, y: f(y), (0.0, duration), y, method="DOP853", rtol=1e-13, atol=1e-15
    ).y[:, -1]


def run(grid: Grid | None = None, problems: Sequence[Callable[[], Problem]] = PROBLEMS) -> Section:
    """Run all problems in all hands; form the ratios of times at equal error, and draw error and
    closure over time."""
    grid = grid or Grid()
    figures, rows, raw, pictures = [], [], {}, {}
    for problem in (make() for make in problems):
        found = measure(problem, grid)
        figures += ratios(problem.title, found)
        rows += listed(problem.title, found)
        raw[problem.title] = {
            name: vars(one.curve) | {"gaps": one.gaps} for name, one in found.items()
        }
        pictures[f"work_precision_{problem.name}.svg"] = picture(found)
    shown = "\n\n".join(f"![{name}]({name})" for name in pictures)
    return Section(
        "Work, precision and closure on three robots",
        f"{METHOD}\n\n{shown}",
        figures,
        raw,
        pictures,
        Listing(COLUMNS, rows),
    )


def measure(problem: Problem, grid: Grid) -> dict[str, Measured]:
    """Run every contender at all its settings."""
    exact = problem.reference()
    calls = called(problem, grid)
    seconds = interleaved({key: Contender(call) for key, call in calls.items()}, grid.rounds)
    found: dict[str, Measured] = {}
    for (name, setting), call in calls.items():
        add(found, name, setting, problem, exact, call(), float(seconds[name, setting].min()))
    for name, engine in (
        (MUJOCO, MujocoEngine(problem.robot.mechanism)),
        (EXUDYN, ExudynEngine(problem.robot.mechanism)),
    ):
        for steps in grid.steps:
            done = [simulated(problem, engine, problem.finer * steps) for _ in range(2)]
            add(
                found,
                name,
                problem.finer * steps,
                problem,
                exact,
                done[0],
                min(one.seconds or np.inf for one in done),
            )
    return found


def add(
    found: dict[str, Measured],
    name: str,
    setting: float,
    problem: Problem,
    exact: np.ndarray,
    done: Result,
    seconds: float,
) -> None:
    """Note what a contender reached at a setting."""
    one = found.setdefault(name, Measured())
    one.curve.settings.append(float(setting))
    one.curve.errors.append(max(problem.error(done.positions, exact), 2.0**-54))
    one.curve.seconds.append(seconds)
    one.gaps.append(done.closure_error)


def called(problem: Problem, grid: Grid) -> dict[tuple[str, float], Callable[[], Result]]:
    """Return the runs of Linkwork and of SciPy by name and tolerance."""
    found: dict[tuple[str, float], Callable[[], Result]] = {}
    for method in OURS:
        for rtol in grid.tolerances:
            if method != "rodas" or rtol >= STIFFEST:
                found[LINKWORK.format(method), rtol] = partial(ours, problem, method, rtol)
    for method in scipy_runs.METHODS:
        for rtol in grid.scipy:
            if method not in ("Radau", "LSODA") or rtol >= STIFFEST:
                found[SCIPY.format(method), rtol] = partial(scipys, problem, method, rtol)
    return found


def ours(problem: Problem, method: str, rtol: float) -> Result:
    """Run by Linkwork."""
    done = problem.robot.simulate(
        problem.start, problem.forces, duration=problem.duration, method=method,  # pyright: ignore
        rtol=rtol, atol=runs.ATOL * rtol, save_at=[problem.duration],
    )  # fmt: skip
    assert done.status is lw.Status.FINISHED, done.message
    return Result(runs.joints_at_end(problem.robot, done), done.closure_error)


def scipys(problem: Problem, method: str, rtol: float) -> Result:
    """Run by SciPy."""
    times = np.linspace(0.0, problem.duration, 2)
    done = scipy_runs.solved(
        problem.robot,
        problem.start,
        lambda _: problem.forces,
        times,
        rtol,
        runs.ATOL * rtol,
        method,
    )
    return Result(done.positions[-1], done.closure_error)


def simulated(problem: Problem, engine: MujocoEngine | ExudynEngine, steps: int) -> Result:
    """Run by another engine."""
    at_rest = problem.robot.joint_rates(problem.start)
    done = engine.simulate(
        problem.start.positions, at_rest, problem.forces, problem.duration, problem.duration / steps
    )
    return Result(done.positions[-1], done.closure_error, done.seconds)


def ratios(title: str, found: Mapping[str, Measured]) -> list[Figure]:
    """Return how many times longer others take for the same error."""
    figures, mine = [], found[LINKWORK.format("sharp_smart")].curve
    for theirs in (name for name in found if not name.startswith(LINKWORK.format(""))):
        for error in EQUAL_ERRORS:
            quick, slow = mine.time_at(error), found[theirs].curve.time_at(error)
            if quick and slow:
                note = f"{1e3 * slow:.3g} ms against {1e3 * quick:.3g} ms"
                figures.append(
                    Figure(
                        f"{title}: {theirs} / Linkwork, error {error:.0e}", slow / quick, note=note
                    )
                )
    return figures


def listed(title: str, found: Mapping[str, Measured]) -> list[tuple[str, ...]]:
    """Return the rows of the listing."""
    rows = []
    for name, one in found.items():
        numbers = zip(
            one.curve.settings, one.curve.errors, one.gaps, one.curve.seconds, strict=True
        )
        for setting, error, gap, seconds in numbers:
            shown = f"rtol {setting:.0e}" if setting < 1 else f"{setting:.0f} steps"
            rows.append(
                (title, name, shown, f"{error:.1e}", f"{gap:.0e}", quantity(1e3 * seconds, ""))
            )
    return rows


def picture(found: Mapping[str, Measured]) -> str:
    """Draw error and closure error over wall time as SVG."""
    curves = {name: (one.curve.seconds, one.curve.errors, one.gaps) for name, one in found.items()}
    return style.svg(plot_work_precision(curves))
