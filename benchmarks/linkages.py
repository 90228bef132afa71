"""Work and precision on two published linkages beside Exudyn: Andrews' squeezer and Bricard's
linkage.

Both motions are known from other equations: Andrews' squeezer from those of the IVP test set,
Bricard's linkage from its reduction to one coordinate, both integrated to 1e-13.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import linkwork as lw
from linkwork.lab.engines.exudyn import ExudynEngine
from linkwork.robots import andrews as squeezer
from linkwork.robots import bricard
from linkwork.robots._andrews import ANGLES
from linkwork.simulation import Run

from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, interleaved
from benchmarks.work_precision import Curve
from tests.oracle import andrews, one_freedom

ATOL = 1e-2  # absolute tolerances, relative to the relative ones
EQUAL_ERRORS = (1e-2, 1e-3)
COLUMNS = ("linkage", "by", "setting", "error [rad]", "time [ms]", "closure error [m]")
METHOD = """
    Andrews' squeezer: 0.03 s from rest under its drive of 0.033 N m; Bricard's linkage: 9 s from
    rest under gravity (after 10 s it stands where it began). Error: the largest of the joint angles
    at the end (seven of Andrews' squeezer, all six of Bricard's linkage), against independent
    equations integrated to 1e-13. Linkwork: `robot.simulate`, its end saved, at relative
    tolerances, absolute ones a hundredth of them; the best of several runs in turn. Exudyn: its
    generalised-alpha integrator with constant steps on rigid bodies in space, the time inside its
    solver alone, the best of two. Closure error: the largest gap of any joint over the run. Ratios
    are times at equal error, by interpolation of the logarithms.
    """


@dataclass(frozen=True)
class Problem:
    """Hold a run from a robot's home, at rest, under constant forces, and the angles at its end
    (n,) [rad].

    joints: names of these angles; tolerances, steps: of Linkwork's and of Exudyn's runs
    """

    title: str
    robot: lw.Robot
    forces: Sequence[float]
    duration: float
    joints: Sequence[str]
    end: np.ndarray
    tolerances: Sequence[float]
    steps: Sequence[int]

    def error(self, positions: np.ndarray) -> float:
        """Return the largest error of the angles among all coordinates at the end, turns left
        out."""
        columns = [self.robot.coordinates.index(name) for name in self.joints]
        return float(np.abs(2 * np.sin((positions[columns] - self.end) / 2)).max())


def andrews_squeezer() -> Problem:
    """Return the published motion of Andrews' squeezer."""
    angles, _ = andrews.motion([0.0, 0.03])
    tolerances = [10.0**-k for k in range(3, 13)]
    return Problem(
        "Andrews",
        lw.Robot(squeezer()),
        [andrews.torque],
        0.03,
        ANGLES,
        angles[-1],
        tolerances,
        (300, 1200, 4800),
    )


def bricard_linkage() -> Problem:
    """Return nine seconds of Bricard's linkage."""
    robot = lw.Robot(bricard())
    (_, psi), _ = one_freedom.bricard().motion([0.0, 9.0], one_freedom.RIGHT_ANGLES, 0.0)
    end = np.array([*one_freedom.bricard_turns(psi)] * 3) - np.pi / 2
    tolerances = [10.0**-k for k in range(4, 13)]
    return Problem(
        "Bricard", robot, [0.0], 9.0, robot.coordinates, end, tolerances, (500, 2000, 8000)
    )


PROBLEMS = (andrews_squeezer, bricard_linkage)


def run(problems: Sequence[Callable[[], Problem]] = PROBLEMS, rounds: int = 7) -> Section:
    """Run all problems in both hands at all settings, and form the ratios of times at equal
    errors."""
    figures, rows, raw = [], [], {}
    for problem in (make() for make in problems):
        ours, theirs = linkwork(problem, rounds), exudyn(problem)
        for error in EQUAL_ERRORS:
            quick, slow = ours.curve.time_at(error), theirs.curve.time_at(error)
            if quick and slow:
                note = f"{1e3 * slow:.3g} ms against {1e3 * quick:.3g} ms"
                figures.append(
                    Figure(
                        f"{problem.title}: Exudyn / Linkwork, error {error:.0e} rad",
                        slow / quick,
                        note=note,
                    )
                )
        for hands in (ours, theirs):
            rows += [(problem.title, *row) for row in hands.rows]
        raw[problem.title] = {
            hands.name: vars(hands.curve) | {"gaps": hands.gaps} for hands in (ours, theirs)
        }
    return Section(
        "Andrews' squeezer and Bricard's linkage beside Exudyn",
        METHOD,
        figures,
        raw,
        listing=Listing(COLUMNS, rows),
    )


@dataclass(frozen=True)
class Hands:
    """Hold what somebody reached in a problem: errors and times by setting, and closure errors
    [m]."""

    name: str
    settings: Sequence[str]
    curve: Curve
    gaps: Sequence[float]

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Return the rows of the listing."""
        numbers = zip(self.settings, self.curve.errors, self.curve.seconds, self.gaps, strict=True)
        return [
            (self.name, setting, f"{e:.1e}", quantity(1e3 * t, ""), f"{gap:.0e}")
            for setting, e, t, gap in numbers
        ]


def linkwork(problem: Problem, rounds: int) -> Hands:
    """Return Linkwork's runs at all tolerances."""
    calls = {tolerance: partial(simulated, problem, tolerance) for tolerance in problem.tolerances}
    runs = [call() for call in calls.values()]
    seconds = interleaved({tolerance: Contender(call) for tolerance, call in calls.items()}, rounds)
    errors = [problem.error(run.variables["joint_position"].values[-1]) for run in runs]
    curve = Curve(list(calls), errors, [float(times.min()) for times in seconds.values()])
    return Hands(
        "Linkwork", [f"rtol {x:.0e}" for x in calls], curve, [run.closure_error for run in runs]
    )


def simulated(problem: Problem, tolerance: float) -> Run:
    """Return one run of Linkwork, its end saved."""
    run = problem.robot.simulate(
        problem.robot.home,
        problem.forces,
        duration=problem.duration,
        rtol=tolerance,
        atol=ATOL * tolerance,
        save_at=[problem.duration],
    )
    assert run.status is lw.Status.FINISHED, run.message
    return run


def exudyn(problem: Problem, repeats: int = 2) -> Hands:
    """Return Exudyn's runs at all numbers of steps."""
    engine, start, forces = (
        ExudynEngine(problem.robot.mechanism),
        problem.robot.home,
        np.array(problem.forces),
    )
    at_rest = problem.robot.joint_rates(start)
    errors, seconds, gaps = [], [], []
    for steps in problem.steps:
        step = problem.duration / steps
        done = [
            engine.simulate(start.positions, at_rest, forces, problem.duration, step)
            for _ in range(repeats)
        ]
        errors.append(problem.error(done[0].positions[-1]))
        seconds.append(min(run.seconds for run in done))
        gaps.append(done[0].closure_error)
    settings = [float(steps) for steps in problem.steps]
    return Hands(
        "Exudyn",
        [f"{steps} steps" for steps in problem.steps],
        Curve(settings, errors, seconds),
        gaps,
    )
