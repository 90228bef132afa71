"""The stiff flyball governor (IFToMM A05) by the stiff method, beside SciPy's stiff methods on the
same kernel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

import linkwork as lw
from linkwork.robots import flyball_governor
from linkwork.simulation import Run, native_rosenbrock

from benchmarks import runs
from benchmarks.scipy_runs import Solved, solved
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, interleaved, summary
from tests.oracle import governor

SPIN = 2 * np.pi  # [rad/s]
JOINTS = ("spindle", "slide", "hinge_1", "hinge_2")
WANTED = 1e-5  # error of s over the run [m]
CHOSEN = 1e-6
COLUMNS = ("by", "rtol", "evaluations", "error of s [m]", "all joints", "time [ms]")
METHOD = f"""
    The benchmark's motion: 10 s from the reference with the spindle at 2 pi rad/s; springs of 8e5
    N/m with dampers of 4e4 N s/m stand where Watt's governor has links. The library compares the
    slider's height s over time. Error: largest of s, and of all joints [m, rad], at 101 instants
    against Lagrange's equations in closed form (`tests/oracle/governor.py`) by SciPy's Radau at
    rtol 1e-12. The library publishes its reference as a curve; the {WANTED:.0e} m promised here are
    far below what can be read off it. Linkwork: `robot.simulate` with method="rodas"; evaluations
    are those of the right-hand side, a Jacobian comes to each step. "Loop": the compiled integrator
    alone. SciPy: Radau and LSODA on the compiled right-hand side and Jacobian. Times: the best of
    several runs in turn.
    """


@dataclass(frozen=True)
class Sizes:
    """Say how long, at which tolerances and how often to run, and how exactly to know the
    motion."""

    duration: float = 10.0
    tolerances: tuple[float, ...] = (1e-4, 1e-6, 1e-8)
    rounds: int = 5
    exact: float = 1e-12


def run(sizes: Sizes | None = None) -> Section:
    """Run the governor at all tolerances in all hands, in turn."""
    sizes = sizes or Sizes()
    robot = lw.Robot(flyball_governor())
    start = robot.home.with_rates(dict.fromkeys(JOINTS, 0.0) | {"spindle": SPIN})
    times = np.linspace(0.0, sizes.duration, 101)
    exact = governor.motion(times, SPIN, sizes.exact)[:4].T
    calls: dict[tuple[str, float], Callable[[], Run | Solved]] = {}
    for rtol in sizes.tolerances:
        calls["Linkwork, RODAS", rtol] = partial(stiffly, robot, start, times, rtol)
        for method in ("Radau", "LSODA"):
            calls[f"SciPy, {method}", rtol] = partial(by_scipy, robot, start, times, rtol, method)
    loop = runs.loop_of(calls["Linkwork, RODAS", CHOSEN], native_rosenbrock)
    seconds = interleaved(
        {key: Contender(call) for key, call in calls.items()} | {("loop", CHOSEN): Contender(loop)},
        sizes.rounds,
    )
    found = {key: call() for key, call in calls.items()}
    columns = [robot.coordinates.index(name) for name in JOINTS]
    errors = {
        key: np.abs(positions(one)[:, columns] - exact).max(axis=0) for key, one in found.items()
    }
    least = {key: float(values.min()) for key, values in seconds.items()}
    chosen = ("Linkwork, RODAS", CHOSEN)
    pace = f"{sizes.duration / least['loop', CHOSEN]:,.0f} times real time"
    figures = [
        Figure(f"error of the slider's height over {sizes.duration:g} s, RODAS at rtol "
               f"{CHOSEN:.0e}",
               float(errors[chosen][1]), "m", WANTED),
        Figure("the same: time of robot.simulate", 1e3 * least[chosen], "ms"),
        Figure("the same: compiled loop", 1e3 * least["loop", CHOSEN], "ms", note=pace),
        Figure("the same: evaluations", float(found[chosen].nfev)),
    ]  # fmt: skip
    rows = [
        (by, f"{rtol:.0e}", str(one.nfev), f"{errors[by, rtol][1]:.0e}",
         f"{errors[by, rtol].max():.0e}", quantity(1e3 * least[by, rtol], ""))
        for (by, rtol), one in found.items()
    ]  # fmt: skip
    raw = {f"{by}, {rtol:.0e}": summary(values) for (by, rtol), values in seconds.items()}
    return Section(
        "Stiff flyball governor", METHOD, figures, {"seconds": raw}, listing=Listing(COLUMNS, rows)
    )


def stiffly(robot: lw.Robot, start: lw.State, times: np.ndarray, rtol: float) -> Run:
    """Run by the stiff method."""
    done = robot.simulate(
        start, duration=times[-1], method="rodas", rtol=rtol, atol=runs.ATOL * rtol, save_at=times
    )
    assert done.status is lw.Status.FINISHED, done.message
    return done


def by_scipy(
    robot: lw.Robot, start: lw.State, times: np.ndarray, rtol: float, method: str
) -> Solved:
    """Run by a method of SciPy."""
    return solved(robot, start, lambda _: np.zeros(1), times, rtol, runs.ATOL * rtol, method)


def positions(done: Run | Solved) -> np.ndarray:
    """Return all joint coordinates at the saved instants (K, m)."""
    return done.positions if isinstance(done, Solved) else done.variables["joint_position"].values
