"""A hundred thousand runs of the 3-PRR at a time, beside MuJoCo's threaded rollout and a loop of
Pinocchio calls."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from unittest.mock import patch

import numpy as np
from mujoco import rollout

import linkwork as lw
from linkwork.lab.engines.mujoco import MujocoEngine, mj
from linkwork.lab.engines.pinocchio import PinocchioEngine
from linkwork.robots import prr3
from linkwork.runs import side_by_side
from linkwork.runs.ensemble import Ensemble
from linkwork.threads import usable_processors

from benchmarks import engines, runs
from benchmarks.table import Figure, Listing, Section
from benchmarks.tasks import Task, second_of_pushing
from benchmarks.timing import Contender, interleaved, summary
from benchmarks.work_precision import JOINTS, Curve

RTOL = 1e-8
PER_RUN, SCALING = 2.0, 1.9
BLOCK, CALLS = 4096, 1200  # states in a call, and calls, of each share of the kernel alone
PUSH, ASIDE = 0.1, 0.01  # spread of the first slider's force, relative; forces on the others [N]
HARD = 3.0, 5.0, 6.0, 10.0  # forces on the first slider [N] that lead through ever more charts
FIRST = 0.5  # force on the first slider of the pushed second [N]
SHORT, CHANGING = 0.5, 10.0  # duration of those runs [s], and what one of them may take [us]
EQUAL_ERRORS = (1e-4, 1e-6, 1e-8)
LINKWORK, ROLLOUT, PINOCCHIO = "Linkwork, ensemble", "MuJoCo RK4, rollout", "Pinocchio RK4, loop"
EULER = "MuJoCo implicitfast, rollout"
COLUMNS = ("by", "setting", "runs/s", "steps/s", "error [m, rad]")


@dataclass(frozen=True)
class Sizes:
    """Say how much is run: members, of Linkwork's and of the others' (few enough to end soon),
    rounds, settings."""

    members: int = 100_000
    changing: int = 8_000
    rollouts: int = 64
    loops: int = 2
    rounds: int = 5
    tolerances: tuple[float, ...] = (1e-4, 1e-6, 1e-8, 1e-10)
    steps: tuple[int, ...] = (25, 50, 100, 200, 400, 800)


METHOD = f"""
    The pushed second of the section before, for members that differ in their forces: the first
    slider's by up to {100 * PUSH:g} %, and up to {ASIDE} N on the others; rtol {RTOL:.0e}, atol a
    hundredth of it. The time is that of `robot.ensemble`, called and returned, with the last states
    kept. Threads take turns in the same rounds; scaling is the ratio of the medians.

    Runs of {SHORT} s under larger forces, {min(HARD)} to {max(HARD)} N on the first slider, come
    near singular poses of their charts' rates and change these.

    The table is of one thread. MuJoCo: `mujoco.rollout`, whose threads run the compiled engine
    without Python, on the tree with soft constraints that are made stiff, by its Runge-Kutta method
    and, with 1 ms, by its default kind of implicit steps. Pinocchio: `constraintDynamics` in a
    Python loop of Runge-Kutta steps. Error: largest of slide_1..3 and pivot_1..3 at the end over
    some members, against Linkwork's DOP853 at rtol 1e-13. Ratios are runs per second at equal
    error, by interpolation of the logarithms.
    """


def run(sizes: Sizes | None = None) -> Section:
    """Time the ensemble on one thread and on all, and the others' runs at all settings."""
    sizes = sizes or Sizes()
    robot = lw.Robot(prr3())
    task, cores = second_of_pushing(robot), usable_processors()
    forces = spread(task, sizes.members)
    whole = {
        n: Contender(partial(simulated, robot, task, forces, RTOL, n), sizes.members)
        for n in {1, cores}
    }
    plain = {
        f"kernel, {n}": Contender(partial(evaluated, robot, task, cores, n)) for n in {1, cores}
    }
    seconds = interleaved(whole | plain, sizes.rounds)
    done = simulated(robot, task, forces, RTOL, cores)
    alone, together = (float(np.median(seconds[n])) for n in (1, cores))
    machine = float(np.median(seconds["kernel, 1"]) / np.median(seconds[f"kernel, {cores}"]))
    curves, charts = throughput(robot, task, sizes), changing(robot, task, sizes)
    figures = [
        Figure(f"{sizes.members} runs of 1 s, rtol 1e-8, one thread: per run", 1e6 * alone, "µs",
               PER_RUN, note=(
                   f"1.5 µs is the aim; best {1e6 * seconds[1].min():.3g} µs, "
                   f"{done.nfev.mean():.0f} evaluations each"
               )),
        Figure(f"the same on {cores} threads: per run and core", 1e6 * together * cores, "µs",
               PER_RUN),
        Figure(f"one thread's time over that of {cores}", alone / together if cores > 1 else None,
               "", SCALING if cores <= 2 else None, "at least", "" if cores > 1 else "one core"),
        Figure(f"the same of evaluations of the kernel alone, a tenth of a second on {cores} "
               "threads", machine, ""),
        Figure("members that did not reach their ends", float(len(done.failed)), "", 0.0),
        Figure("largest closure error", float(done.closure_error.max()), "m"),
        *charts,
        *ratios(curves),
    ]  # fmt: skip
    raw = {
        "seconds": {f"{n} threads": summary(values) for n, values in seconds.items()},
        "curves": {name: vars(curve) for name, (curve, _) in curves.items()},
    }
    return Section("Ensembles", METHOD, figures, raw, listing=Listing(COLUMNS, rows(curves)))


def changing(robot: lw.Robot, task: Task, sizes: Sizes) -> list[Figure]:
    """Time runs that change their charts on the way, on one thread, beside some that do not."""
    pushes = {push: spread(task, sizes.changing) * (push / FIRST) for push in HARD}
    calls = {
        push: partial(
            robot.ensemble, task.start, forces, duration=SHORT, rtol=RTOL, atol=runs.ATOL * RTOL,
            threads=1,
        )
        for push, forces in pushes.items()
    }  # fmt: skip
    seconds = interleaved(
        {push: Contender(call, sizes.changing) for push, call in calls.items()}, sizes.rounds
    )
    figures = []
    for push, call in calls.items():
        with patch.object(side_by_side, "integrated", wraps=side_by_side.integrated) as legs:
            done = call()
        changes = sum(leg.args[2].members.size for leg in legs.mock_calls) / sizes.changing - 1
        figures.append(Figure(
            f"{sizes.changing} runs of {SHORT} s, {push} N, {changes:.2f} changes of chart each, "
            "one thread: per run", 1e6 * float(np.median(seconds[push])), "µs", CHANGING,
            note=f"{done.nfev.mean():.0f} evaluations each",
        ))  # fmt: skip
    return figures


def evaluated(robot: lw.Robot, task: Task, shares: int, threads: int) -> None:
    """Evaluate the motion kernel in equal shares, dealt to threads: what the machine gives where
    nothing else happens."""
    motion = robot.kernel("motion")
    states = [
        np.repeat(part[None], BLOCK, axis=0)
        for part in (task.start.q, task.start.rates, task.signal(np.zeros(1))[0])
    ]

    def share(_: int) -> None:
        for _ in range(CALLS):
            motion(*states)

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(share, range(shares)))


def spread(task: Task, members: int) -> np.ndarray:
    """Return the forces of all members (members, 3) [N]."""
    random = np.random.default_rng(4)
    base = task.signal(np.zeros(1))[0]
    return base * (1 + PUSH * random.uniform(-1, 1, (members, 1))) + ASIDE * random.uniform(
        -1, 1, (members, base.size)
    )


def simulated(
    robot: lw.Robot, task: Task, forces: np.ndarray, rtol: float, threads: int
) -> Ensemble:
    """Return the ensemble of the members with these forces."""
    return robot.ensemble(
        task.start,
        forces,
        duration=task.duration,
        rtol=rtol,
        atol=runs.ATOL * rtol,
        threads=threads,
    )


def throughput(robot: lw.Robot, task: Task, sizes: Sizes) -> dict[str, tuple[Curve, list[float]]]:
    """Return for each contender its errors and seconds per run on one thread, by setting, and its
    steps per run."""
    many, some = (spread(task, count) for count in (sizes.members // 10, sizes.rollouts))
    columns = [robot.coordinates.index(name) for name in JOINTS]
    exact = np.array([ended(robot, task, u)[columns] for u in some])
    mujoco, pinocchio = MujocoEngine(robot.mechanism), engines.pinocchio(robot)
    calls: dict[tuple[str, float], Contender] = {}
    ends: dict[tuple[str, float], Callable[[], np.ndarray]] = {}
    for rtol in sizes.tolerances:
        calls[LINKWORK, rtol] = Contender(partial(simulated, robot, task, many, rtol, 1), len(many))
        ends[LINKWORK, rtol] = lambda rtol=rtol: simulated(
            robot, task, some, rtol, 1
        ).final.positions[:, columns]
    kinds = [(ROLLOUT, mj.mjtIntegrator.mjINT_RK4, steps) for steps in sizes.steps]
    for name, integrator, steps in [*kinds, (EULER, mj.mjtIntegrator.mjINT_IMPLICITFAST, 1000)]:
        roll = rolled(mujoco, robot, task, some, integrator, steps, columns)
        calls[name, steps], ends[name, steps] = Contender(roll, len(some)), roll
    for steps in sizes.steps:
        loop = looped(pinocchio, robot, task, some[: sizes.loops], steps, columns)
        calls[PINOCCHIO, steps], ends[PINOCCHIO, steps] = Contender(loop, sizes.loops), loop
    seconds = interleaved(calls, sizes.rounds)
    found: dict[str, tuple[Curve, list[float]]] = {}
    for (name, setting), end in ends.items():
        curve, steps = found.setdefault(name, (Curve([], [], []), []))
        reached = end()
        curve.settings.append(float(setting))
        curve.errors.append(float(np.abs(reached - exact[: len(reached)]).max()))
        curve.seconds.append(float(np.median(seconds[name, setting])))
        steps.append(
            float(simulated(robot, task, some, setting, 1).steps.mean())
            if name == LINKWORK
            else setting
        )
    return found


def ended(robot: lw.Robot, task: Task, forces: np.ndarray) -> np.ndarray:
    """Return all joint coordinates at the end of one member's run, to rounding."""
    options = {"rtol": 1e-13, "atol": 1e-15, "save_at": [task.duration]}
    return runs.joints_at_end(
        robot,
        robot.simulate(task.start, forces, duration=task.duration, method="dop853", **options),
    )


def rolled(
    engine: MujocoEngine,
    robot: lw.Robot,
    task: Task,
    forces: np.ndarray,
    integrator: int,
    steps: int,
    columns: list[int],
) -> Callable[[], np.ndarray]:
    """Return MuJoCo's rollout of all members on one thread as a call that returns the joints at
    their ends (members, 6)."""
    q, v = engine.plan.state(task.start.positions, robot.joint_rates(task.start))
    places = [1 + list(engine.columns).index(column) for column in columns]
    applied = np.zeros((len(forces), 1, engine.model.nv))
    applied[:, 0, engine.drives] = forces
    start = np.tile(np.concatenate([[0.0], q, v]), (len(forces), 1))
    pool, data = rollout.Rollout(nthread=0), mj.MjData(engine.model)

    def call() -> np.ndarray:
        engine.model.opt.integrator, engine.model.opt.timestep = integrator, task.duration / steps
        states, _ = pool.rollout(
            engine.model,
            data,
            start,
            applied,
            control_spec=mj.mjtState.mjSTATE_QFRC_APPLIED.value,
            nstep=steps,
        )
        return np.asarray(states)[:, -1, places]

    return call


def looped(
    engine: PinocchioEngine,
    robot: lw.Robot,
    task: Task,
    forces: np.ndarray,
    steps: int,
    columns: list[int],
) -> Callable[[], np.ndarray]:
    """Return runs of all members, one after the other, as a call that returns the joints at their
    ends (members, 6)."""
    q, v = engine.plan.state(task.start.positions, robot.joint_rates(task.start))
    places = [list(engine.columns).index(column) for column in columns]
    acceleration, h = engines.pinocchio_acceleration(engine), task.duration / steps

    def call() -> np.ndarray:
        return np.array(
            [
                engines.runge_kutta(acceleration, q, v, [u] * (2 * steps + 1), h)[0][places]
                for u in forces
            ]
        )

    return call


def rows(curves: dict[str, tuple[Curve, list[float]]]) -> list[tuple[str, ...]]:
    """Return the rows of the listing."""
    found = []
    for name, (curve, steps) in curves.items():
        for setting, error, seconds, count in zip(
            curve.settings, curve.errors, curve.seconds, steps, strict=True
        ):
            title = f"rtol {setting:.0e}" if name == LINKWORK else f"{setting:.0f} steps"
            found.append(
                (name, title, f"{1 / seconds:,.0f}", f"{count / seconds:,.0f}", f"{error:.0e}")
            )
    return found


def ratios(curves: dict[str, tuple[Curve, list[float]]]) -> list[Figure]:
    """Return how many more runs a second Linkwork makes on one thread, at equal errors."""
    found = []
    for theirs in (ROLLOUT, PINOCCHIO):
        for error in EQUAL_ERRORS:
            quick, slow = curves[LINKWORK][0].time_at(error), curves[theirs][0].time_at(error)
            if quick and slow:
                note = f"{1 / quick:,.0f} against {1 / slow:,.0f} runs/s"
                found.append(
                    Figure(
                        f"{LINKWORK} / {theirs}, error {error:.0e}: runs a second",
                        slow / quick,
                        note=note,
                    )
                )
    return found
