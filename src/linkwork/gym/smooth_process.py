"""The same process as functions of CasADi, for gradients of what a policy is rewarded with.

    y_(k+1) = step(t, y_k, a_k, d),    (o, r, over) = read(t, y, a, d)

y = (q, v, z) in one chart, d the numbers that are drawn. A step is that of `Environments`, but that
the loops are closed by one step of Newton's method instead of as many as it takes, and that the
chart stays: derivatives are exact wherever the motion has some. Actions are cut to their bounds;
derivatives by what is beyond them are zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from linkwork.checks import needed
from linkwork.equations import functions
from linkwork.gym.environments import starts_of, steppers_of
from linkwork.gym.process import DecisionProcess


@dataclass(frozen=True, eq=False)
class SmoothProcess:
    """Hold a decision process as functions that CasADi differentiates.

    Attributes:
        starts: y where episodes begin (K, n), one of which is drawn.
        begin: (y, draws) -> y, with the initial values that are drawn.
        step: (t, y, action, draws) -> y after dt, of the state at t [s].
        read: (t, y, action, draws) -> observation, reward, terminated (not zero where the episode
            is over), of the state y that an action led to.
        draws: names of the numbers that are drawn, in their order; independent: names of the rates
            in y.
    """

    starts: np.ndarray
    begin: ca.Function
    step: ca.Function
    read: ca.Function
    draws: tuple[str, ...]
    independent: tuple[str, ...]


def smooth(process: DecisionProcess) -> SmoothProcess:
    """Return a process as functions of CasADi.

    Args:
        process: whose forces, rates, reward and observation are differentiable where gradients are
            asked for.

    Returns:
        The functions, in the chart of the first start; starts in other charts are left out.
    """
    needed(process, DecisionProcess, "linkwork.gym.DecisionProcess")
    # The symbols, and the parameters that the kernels of `Environments` take, in their order.
    robots = steppers_of(process, starts_of(process), 1)
    chart, system, told = robots.chart(0), robots.system, robots.independent(0)
    t, y = ca.MX.sym("t"), ca.MX.sym("y", robots.y.shape[1])
    action, draws = ca.MX.sym("action", process.size), ca.MX.sym("draws", len(process.draws))
    known = dict(zip(process.draws, ca.vertsplit(draws), strict=True))
    low, high = (ca.MX(ca.DM(np.asarray(bounds))) for bounds in (process.low, process.high))
    taken = ca.fmin(ca.fmax(action, low), high)
    known |= dict(zip(process.action_names, ca.vertsplit(taken), strict=True))
    acting = system.acting.parameters if system.acting else {}
    robot = process.robot.parameters
    own, others = ([known.get(name, value) for name, value in of.items()] for of in (robot, acting))
    p, p_robot = ca.vertcat(ca.MX(0, 1), *own, *others), ca.vertcat(ca.MX(0, 1), *own)
    # Steps of the method of order 4, each of which closes the loops at its end.
    joined, h, now, after = system.joined(chart), process.dt / process.substeps, t, y
    motion, closure = joined.motion(), functions.closure_step(chart.equations)
    parts = chart.equations.nq, chart.equations.mobility, robots.z.shape[1]
    ends = np.cumsum([0, *parts]).tolist()

    def split(y: ca.MX) -> list[ca.MX]:
        return ca.vertsplit(y, ends)

    def time(t: ca.MX) -> ca.MX:
        return t if system.acting and system.acting.timed else ca.MX(0, 1)

    def slope(t: ca.MX, y: ca.MX) -> ca.MX:
        return motion(*split(y), time(t), p)[0]

    for _ in range(process.substeps):
        first = slope(now, after)
        second = slope(now + h / 2, after + h / 2 * first)
        third = slope(now + h / 2, after + h / 2 * second)
        fourth = slope(now + h, after + h * third)
        q, v, z = split(after + h / 6 * (first + 2 * second + 2 * third + fourth))
        after, now = ca.vertcat(closure(q, p_robot)[0], v, z), now + h
    # Initial values that are drawn, and what is read.
    begun, states = ca.vertsplit(y), [each.name for each in process.read_extras]
    for name in {*process.draws} & {*states}:
        begun[ends[2] + states.index(name)] = known[name]
    read, count = joined.events()(*split(y), time(t), p), process.observed
    outputs = [read[:count], read[count], read[count + 1]]
    given, names = [t, y, action, draws], ["t", "y", "action", "draws"]
    alike = [i for i in range(len(robots)) if robots.chart(i) is chart]
    return SmoothProcess(
        robots.y[alike].copy(),
        ca.Function("begin", [y, draws], [ca.vertcat(*begun)], ["y", "draws"], ["y_0"]),
        ca.Function("step", given, [after], names, ["y_next"]),
        ca.Function("read", given, outputs, names, ["observation", "reward", "terminated"]),
        tuple(process.draws),
        told,
    )
