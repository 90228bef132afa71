"""One second of the 3-PRR by every method: the compiled loop alone, and `robot.simulate` as a user
calls it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

import linkwork as lw
from linkwork.robots import prr3
from linkwork.simulation import Run, native, native_rosenbrock

from benchmarks import runs
from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.tasks import Task, second_of_motion, second_of_pushing
from benchmarks.timing import Contender, best, interleaved, summary, us

RTOL = 1e-8
PROMISED = 15.0  # [us]
FEW, MANY = 11, 101  # instants saved by dense output
ABOVE = 50.0  # [us] that a plain call takes above its compiled loop, promised
CHANGE, HARD = 50.0, 5.0  # [us] promised of a change of chart; force that leads to some [N]
END, PLAIN = "end saved", f"{FEW} instants saved"
COLUMNS = (
    "motion",
    "method",
    "evaluations",
    "steps",
    "error [m, rad]",
    "loop [µs]",
    "simulate [µs]",
)
METHOD = f"""
    One second at rtol {RTOL:.0e}, atol {runs.ATOL * RTOL:.0e}, on one core; methods of a fixed step
    with 1 ms. Where no method is named it is the one that is taken if it is left out: sharp_smart,
    of order 7, for constant forces ("pushed"), and dormand_prince, of order 5, for sampled ones
    ("moving"). {FEW} instants are saved where nothing else is said. "pushed": from rest in the
    middle of the workspace with 0.5 N on the first slider; "moving": the task of the work-precision
    plot. After every step the loops are closed by projection; saved instants come from the dense
    output and are projected, too. Loop: the compiled loop alone, with the arguments that
    `robot.simulate` hands it. Simulate: `robot.simulate` as a user calls it, without what a run
    measures when it is asked for. Error: largest of all joint coordinates at the end, against the
    method of order 8 at rtol 1e-13. Medians of blocks of 2 ms in which all take turns.
    """
PLAINLY = """
    "pushed" of the section before by `robot.simulate(state, forces, duration=1.0)`, with nothing
    else asked for, beside its compiled loop alone, with the arguments that it hands this. Medians
    of blocks of 2 ms that take turns.
    """

CHANGING = f"""
    One second under {HARD} N on the first slider, from home, on the way of which the run changes
    its chart, beside its compiled loops alone; and "pushed" of the sections before, which changes
    none. A change takes what the one run takes above its loops more than the other, over the number
    of changes; the charts are known from the run before. Medians of blocks of 2 ms that take turns.
    """


@dataclass(frozen=True)
class Way:
    """Name a way to run: the options of `simulate`, how many instants are saved."""

    options: Mapping[str, Any] = field(default_factory=dict)
    instants: int = 2

    @property
    def module(self):
        """Where the compiled loop is."""
        return native_rosenbrock if self.options.get("method") == "rodas" else native


WAYS = {
    END: Way(),
    PLAIN: Way(instants=FEW),
    f"{MANY} instants saved": Way(instants=MANY),
    "dormand_prince": Way({"method": "dormand_prince"}, FEW),
    "sharp_smart": Way({"method": "sharp_smart"}, FEW),
    "dop853": Way({"method": "dop853"}, FEW),
    "rodas": Way({"method": "rodas"}, FEW),
    "rk4, 1 ms": Way({"method": "rk4", "step": 1e-3}, FEW),
    "symplectic_euler, 1 ms": Way({"method": "symplectic_euler", "step": 1e-3}, FEW),
}


def run(rounds: int = 40, ways: Mapping[str, Way] = WAYS) -> Section:
    """Time both motions in all ways, all in turn."""
    robot = lw.Robot(prr3())
    tasks = {"pushed": second_of_pushing(robot), "moving": second_of_motion(robot)}
    calls = {
        (title, name): partial(simulated, robot, task, way)
        for title, task in tasks.items()
        for name, way in ways.items()
    }
    loops = {key: runs.loop_of(call, ways[key[1]].module) for key, call in calls.items()}
    seconds = interleaved(timed("loop", loops) | timed("simulate", calls), rounds)
    exact = {
        title: runs.joints_at_end(robot, simulated(robot, task, EXACT))
        for title, task in tasks.items()
    }
    figures, rows = [], []
    for (title, name), call in calls.items():
        done = call()
        loop, whole = seconds["loop", (title, name)], seconds["simulate", (title, name)]
        error = float(np.abs(runs.joints_at_end(robot, done) - exact[title]).max())
        steps = done.statistics.steps
        rows.append(
            (
                title,
                name,
                str(done.statistics.nfev),
                str(steps),
                f"{error:.0e}",
                quantity(us(loop), ""),
                quantity(us(whole), ""),
            )
        )
        if title == "pushed" and name in (END, PLAIN):
            note = f"12 µs is the aim; {done.statistics.nfev} evaluations, {best(loop)}"
            figures.append(
                Figure(
                    f"1 s, rtol 1e-8, {name}: compiled loop", us(loop), "µs", PROMISED, note=note
                )
            )
    raw = {
        f"{what}: {title}, {name}": summary(values)
        for (what, (title, name)), values in seconds.items()
    }
    return Section(
        "One second alone", METHOD, figures, {"seconds": raw}, listing=Listing(COLUMNS, rows)
    )


def plain(rounds: int = 200) -> Section:
    """Time a call that asks for nothing but a run, and its compiled loop, in turn."""
    robot = lw.Robot(prr3())
    task = second_of_pushing(robot)
    call = partial(robot.simulate, task.start, task.signal, duration=task.duration)
    calls = {"robot.simulate": call, "compiled loop": runs.loop_of(call, native)}
    seconds = interleaved({name: Contender(each) for name, each in calls.items()}, rounds)
    whole, loop = (us(values) for values in seconds.values())
    figures = [Figure("robot.simulate, above its compiled loop", whole - loop, "µs", ABOVE)]
    rows = [(name, quantity(us(values), "")) for name, values in seconds.items()]
    raw = {name: summary(values) for name, values in seconds.items()}
    listing = Listing(("call", "a run [µs]"), rows)
    return Section("A plain run", PLAINLY, figures, {"seconds": raw}, listing=listing)


def changing(rounds: int = 200) -> Section:
    """Time runs that change charts and one that does not, and their compiled loops, in turn."""
    robot = lw.Robot(prr3())
    task, forces = second_of_pushing(robot), [HARD, 0.0, 0.0]
    calls: dict[str, Callable[[], Run]] = {
        "no change": partial(robot.simulate, task.start, task.signal, duration=task.duration),
        "changes": partial(robot.simulate, robot.home, forces, duration=task.duration),
    }
    changes = calls["changes"]().attrs["charts"].count(";")
    loops = {f"{name}, loops": runs.loop_of(call, native) for name, call in calls.items()}
    seconds = interleaved({name: Contender(each) for name, each in (calls | loops).items()}, rounds)
    above = {name: us(seconds[name]) - us(seconds[f"{name}, loops"]) for name in calls}
    change = (above["changes"] - above["no change"]) / changes
    figures = [Figure(f"a change of chart, one of {changes} on the way", change, "µs", CHANGE)]
    rows = [(name, quantity(us(values), "")) for name, values in seconds.items()]
    raw = {name: summary(values) for name, values in seconds.items()}
    listing = Listing(("call", "a run [µs]"), rows)
    return Section("Changes of chart", CHANGING, figures, {"seconds": raw}, listing=listing)


EXACT = Way({"method": "dop853", "rtol": 1e-13, "atol": 1e-15})


def simulated(robot: lw.Robot, task: Task, way: Way) -> Run:
    """Return a run that saves so many instants, the start and the end among them; of two the end
    alone."""
    save_at = np.linspace(0.0, task.duration, way.instants)[1 if way.instants == 2 else 0 :]
    options = {"rtol": RTOL, "atol": runs.ATOL * RTOL, **way.options}
    done = robot.simulate(
        task.start, task.signal, duration=task.duration, save_at=save_at, **options
    )
    assert done.status is lw.Status.FINISHED, done.message
    return done


def timed(what: str, calls: Mapping[tuple[str, str], Callable[[], object]]) -> dict:
    """Return the contenders of one kind."""
    return {(what, key): Contender(call) for key, call in calls.items()}
