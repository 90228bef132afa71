"""Public calls at one state, from Python, as a loop that controls a robot makes them; and assembly
of stacks of poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

import linkwork as lw

from benchmarks.table import Figure, Listing, Section, quantity
from benchmarks.timing import Contender, best, interleaved, summary, us

ONE, EACH = 100.0, 20.0  # promised [us]: of a call at one state, of a pose of a stack
STATES, STACK = 32, 10_000
TOOL, JOINTS = "assemble(tool=)", "assemble(joints=)"
SPREADS = {
    "prr3": ("3-PRR", np.array([0.03, 0.03, 0.1])),
    "stewart": ("Stewart platform", np.repeat([0.4, 0.3], 3)),
}
"""Robots by their names in the catalogue: their titles, and how far poses are from home [m,
rad]."""
METHOD = f"""
    {STATES} random poses within 30 mm and 0.1 rad (3-PRR), 0.4 m and 0.3 rad (Stewart platform) of
    home in every direction, rates normal with 1 m/s or 1 rad/s, unit forces. Each call is made at
    all of them in turn, with its checks, and the time is that of one call; arrays and joints by
    name are made before. `assemble` begins at home each time. Every second set of the 3-PRR's
    slides, which a singular pose is near, is led to in three steps or more, all else in one. All
    code is compiled before. Stacks: {STACK:,} such poses in one call, on one core, per pose.
    Medians of blocks of 2 ms in which the calls of both robots take turns.
    """


def run(rounds: int = 60, states: int = STATES, stack: int = STACK) -> Section:
    """Time the calls of both robots, all in turn."""
    contenders = {
        (title, call): contender
        for name, (title, spread) in SPREADS.items()
        for call, contender in calls_of(lw.Robot(name), spread, states, stack).items()
    }
    seconds = interleaved(contenders, rounds)
    titles = [title for title, _ in SPREADS.values()]
    figures = [
        Figure(
            f"{title}: {call}",
            us(seconds[title, call]),
            "µs",
            ONE if call in (TOOL, JOINTS) else EACH,
            note=best(seconds[title, call]),
        )
        for title in titles
        for call in (TOOL, JOINTS, of_stack(TOOL, stack), of_stack(JOINTS, stack))
    ]
    others = [call for title, call in contenders if title == titles[0]]
    rows = [
        (call, *(quantity(us(seconds[title, call]), "") for title in titles)) for call in others
    ]
    raw = {f"{title}: {call}": summary(values) for (title, call), values in seconds.items()}
    columns = ("call", *(f"{title} [µs]" for title in titles))
    listing = Listing(columns, [row for row in rows if " of " not in row[0]])
    return Section("Calls at one state", METHOD, figures, {"seconds": raw}, listing=listing)


def of_stack(call: str, stack: int) -> str:
    """Name a call with a stack."""
    return f"{call} of {stack:,} poses, per pose"


def calls_of(robot: lw.Robot, spread: np.ndarray, states: int, stack: int) -> dict[str, Contender]:
    """Return the calls of a robot by name, their code compiled."""
    random, n = np.random.default_rng(2026), robot.mobility
    home = robot.tool_pose(robot.home)
    poses = home + spread * random.uniform(-1, 1, (max(states, stack), home.size))
    found = robot.assemble(tool=poses)
    moving = [found.at(k).with_rates(random.normal(size=n)) for k in range(states)]
    joints = [{name: float(state[name]) for name in robot.independent} for state in moving]
    unit, assemble = np.ones(n), robot.assemble
    calls = {
        TOOL: each(lambda pose: assemble(tool=pose), [*poses[:states]]),
        JOINTS: each(assemble, joints),
        of_stack(TOOL, stack): Contender(lambda: assemble(tool=poses[:stack]), stack),
        of_stack(JOINTS, stack): Contender(
            partial(assemble, {name: found[name][:stack] for name in robot.independent}), stack
        ),
        "state": each(lambda state: robot.state(state.positions, unit), moving),
        "with_rates": each(lambda state: state.with_rates(unit), moving),
        "forward_dynamics": each(lambda state: robot.forward_dynamics(state, unit), moving),
        "inverse_dynamics": each(lambda state: robot.inverse_dynamics(state, unit), moving),
        "reactions": each(lambda state: robot.reactions(state, unit), moving),
        "linearise": each(lambda state: robot.linearise(state, unit), moving),
    }
    plain = (robot.tool_pose, robot.tool_twist, robot.jacobian, robot.body_poses)
    plain += (robot.conditioning, robot.closure_error, robot.limits_passed)
    plain += (robot.holding_forces, robot.internal_forces)
    calls |= {call.__name__: each(call, moving) for call in plain}
    for contender in calls.values():
        contender.call()
    robot.chart.settle(1)
    return calls


def each(call: Callable[..., object], given: Sequence[object]) -> Contender:
    """Return calls with one thing given after the other."""

    def all_of_them() -> None:
        for one in given:
            call(one)

    return Contender(all_of_them, len(given))
