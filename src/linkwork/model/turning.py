"""Turning: which angles of a robot the equations of a run see through sines and cosines alone.

Whole turns of such an angle change nothing, and the integrators count them apart
(`simulation.turns`). Which they are is read off the graphs: each value of a program is followed as

    value = sum_i a_i q_i + what does not change when an angle q_i grows by 2 pi,

through sums and products with constants; a sine or cosine of it forgets q_i where a_i is whole, and
any other operation does not. Springs, gears and controllers that read an angle so keep it as it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from linkwork.control.acting import OUTPUTS, Acting
from linkwork.control.observation import expression
from linkwork.equations import Equations
from linkwork.equations.joints import pattern
from linkwork.equations.reference import OPEN, unit
from linkwork.kernels.program import Program, trace
from linkwork.mechanism.joints import SLIDES, TURN
from linkwork.model.charts import CompiledChart
from linkwork.model.closing import settled
from linkwork.simulation.turns import SPAN, Turning

NEAR, SPREAD = 4, 0.02  # configurations near home, and how far they are from it
ALIKE = 1e-7  # part of a rate by which two may differ that are one
ACTS = ("command", "force", "extra_rates", "wrenches")
Shares = dict[int, float]  # a_i by i


def turning(own: Turning, chart: CompiledChart, acting: Acting | None) -> Turning:
    """Return how large the coordinates of a run may grow, and which angles may be wrapped.

    own: the same where nothing but forces over time acts; acting: what acts on the robot in this
    run, traced
    """
    if acting is None:
        return own
    free = chart.kept(f"{acting.key} wraps", lambda: unread(acting, chart.equations))
    return _bounded(own.spans, own.wraps * free, chart)


def own_turning(chart: CompiledChart, length: float) -> Turning:
    """Return the same where nothing but forces over time acts; length: the robot's size [m]."""
    wraps = chart.kept("wraps", lambda: wrapping(chart))
    return _bounded(SPAN * sizes(chart.equations, length), wraps, chart)


def _bounded(spans: np.ndarray, wraps: np.ndarray, chart: CompiledChart) -> Turning:
    """Return which coordinates are bounded: no loop opens by how large others are, such as where a
    body is that floats."""
    entering = chart.kept("entering", lambda: entering_closure(chart))
    return Turning(np.where((wraps > 0) | (entering > 0), spans, np.inf), wraps)


def entering_closure(chart: CompiledChart) -> np.ndarray:
    """Return which coordinates (nq) the residual of the closure depends on, 1 or 0."""
    nq, program = chart.equations.nq, chart.kernel("closure_step").traced()
    needed, found = needed_for(program, [program.results[nq]]), np.zeros(nq)
    places = [
        int(n.value)
        for n, asked in zip(program.nodes, needed, strict=True)
        if asked and n.op == "input"
    ]
    found[[place for place in places if place < nq]] = 1
    return found


def sizes(equations: Equations, length: float) -> np.ndarray:
    """Return the size of each coordinate (nq): 1 of angles, a length [m] of slides, infinite of
    quaternions."""
    joints = equations.topology.joints.values()
    parts = [
        part for joint in joints for part in joint.freedoms for _ in range(4 if part == TURN else 1)
    ]
    return np.array(
        [np.inf if part == TURN else length if part in SLIDES else 1.0 for part in parts]
    )


def wrapping(chart: CompiledChart) -> np.ndarray:
    """Return which coordinates (nq) enter the motion and the closure of a chart by sines and
    cosines alone, 1 or 0."""
    return closing(chart) * periodic(chart, "motion", 0)


def closing(chart: CompiledChart) -> np.ndarray:
    """Return which coordinates (nq) enter the closure of a chart by sines and cosines alone, 1 or
    0."""
    return chart.kept("closing", lambda: periodic(chart, "closure_step", chart.equations.nq))


def periodic(chart: CompiledChart, name: str, kept: int) -> np.ndarray:
    """Return which coordinates (nq) a kernel sees by sines and cosines alone, but for its first
    results that are q itself."""
    free = np.ones(chart.equations.nq)
    found, forgotten = shares(chart.kernel(name).traced(), [{i: 1.0} for i in range(free.size)])
    free[list(forgotten)] = 0
    for k, share in enumerate(found):
        own = {k: 1.0} if k < kept else {}
        free[[i for i in share.keys() | own.keys() if share.get(i) != own.get(i)]] = 0
    return free


def readings(chart: CompiledChart) -> np.ndarray:
    """Return what each joint coordinate grows by with whole turns of each of q (m, nq)."""

    def found() -> np.ndarray:
        given: list[Shares] = [{i: 1.0} for i in range(chart.equations.nq)]
        parts, _ = shares(chart.kernel("positions").traced(), given)
        return np.array([[part.get(i, 0.0) for i in range(len(given))] for part in parts]).reshape(
            -1, len(given)
        )

    return chart.kept("readings", found)


def turnable(chart: CompiledChart, places: Sequence[int]) -> np.ndarray:
    """Return which joint coordinates can be given whole turns without opening a loop or a thread
    that advances, or have lost count of theirs."""
    told, advancing = readings(chart), {int(place) for place, *_ in threaded(chart)}
    return np.array(
        [
            not told[place].any() or (place not in advancing and bool(carriers(chart, place, ())))
            for place in places
        ],
        bool,
    )


def threaded(chart: CompiledChart) -> np.ndarray:
    """Return the angles (k) that turn as a thread does, wherever the joints stand: places of both
    among the coordinates, and the ratio of their rates (k, 3).

    Loops may see such an angle by sines and cosines alone, and yet its whole turns advance the
    thread.
    """
    return chart.kept("threaded", lambda: with_threads(chart))


def with_threads(chart: CompiledChart) -> np.ndarray:
    """Return what `threaded` keeps."""
    mechanism, equations = chart.equations.mechanism, chart.equations
    pairs = [(name, joint) for name, joint in mechanism.pairs.items() if "screw" in pattern(joint)]
    threads = [joint.rates(name)[pattern(joint).index("screw")] for name, joint in pairs]
    if not threads or not chart.independent:
        return np.empty((0, 3))
    # Rates of all joints, at closed configurations near each other.
    aside = np.random.default_rng(1841).standard_normal((NEAR, equations.nq))
    q = equations.reference + SPREAD * equations.tree.units * aside
    q, gap = settled(chart.kernel("closure_step"), unit(equations.tree, q), chart.p)
    if not (gap <= OPEN).any():
        return np.empty((0, 3))
    L = chart.kernel("maps")(q[gap <= OPEN], chart.p)[0].reshape(-1, len(mechanism.rates)).T
    # Those that are the same part of a thread's everywhere.
    pairs = mechanism.pairs.items()
    labels = {label for name, joint in pairs for label in joint.angles(name)} - {*threads}
    found = []
    for thread in threads:
        own = L[mechanism.rates.index(thread)]
        for label in sorted(labels):
            rate = L[mechanism.rates.index(label)]
            ratio = rate @ own / max(own @ own, 1e-300)
            if np.linalg.norm(rate - ratio * own) <= ALIKE * abs(ratio) * np.linalg.norm(own) > 0:
                place, advance = (mechanism.coordinates.index(x) for x in (label, thread))
                found.append((place, advance, ratio))
    return np.array(found).reshape(-1, 3)


def as_threads(chart: CompiledChart, begun: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return the values of the angles of `threaded` (..., k) that have turned as their threads have
    at joint coordinates (..., m) since others (m)."""
    label, thread = threaded(chart)[:, :2].T.astype(int)
    return begun[label] + threaded(chart)[:, 2] * (positions - begun)[..., thread]


def behind_threads(chart: CompiledChart, start: np.ndarray, q: np.ndarray) -> dict[int, np.ndarray]:
    """Return by how many turns (K) angles of the tree are behind their threads at closed
    configurations (K, nq), by what both were at one (nq); by their places in q."""
    ties, tree = threaded(chart), chart.equations.tree
    (positions,), (begun,) = (chart.kernel("positions")(each) for each in (q, start))
    names = [chart.equations.mechanism.coordinates[int(label)] for label, *_ in ties]
    meant = as_threads(chart, begun, positions)
    return {
        place: np.round((meant[:, k] - q[:, place]) / (2 * np.pi))
        for k, name in enumerate(names)
        if (place := tree.places.get(name)) is not None
    }


def by_threads(
    chart: CompiledChart, names: Sequence[str], values: np.ndarray, begun: np.ndarray
) -> tuple[str, ...]:
    """Return names with threads instead of angles that turn as these do and have lost count of
    their turns; sets their values (..., names) to those of the threads.

    begun: joint coordinates (m) at which both count from
    """
    coordinates, found = chart.equations.mechanism.coordinates, list(names)
    for label, thread, ratio in threaded(chart):
        i, k = int(label), int(thread)
        if coordinates[i] in found and not readings(chart)[i].any() and coordinates[k] not in found:
            at = found.index(coordinates[i])
            values[..., at] = begun[k] + (values[..., at] - begun[i]) / ratio
            found[at] = coordinates[k]
    return tuple(found)


def turned(
    chart: CompiledChart, q: np.ndarray, places: Sequence[int], values: np.ndarray
) -> np.ndarray:
    """Return q (..., nq) with the whole turns with which joint coordinates come nearest to given
    values (..., places).

    Loops stay closed. An angle of the tree turns itself; that of a joint that closes a loop takes
    an angle of the tree with it that is not asked for.
    """
    (positions,) = chart.kernel("positions")(q)
    if np.abs(values - positions[..., places]).max(initial=0.0) < np.pi:
        return q
    q, grown = q.copy(), readings(chart)
    asked = [
        int(np.argmax(np.abs(grown[place]))) for place in places if np.abs(grown[place]).sum() == 1
    ]
    for place, value in zip(places, np.moveaxis(values, -1, 0), strict=True):
        (positions,) = chart.kernel("positions")(q)
        for i in carriers(chart, place, asked)[-1:]:
            turns = np.round((value - positions[..., place]) / (2 * np.pi))
            q[..., i] += grown[place, i] * 2 * np.pi * turns
    return q


def carriers(chart: CompiledChart, place: int, asked: Sequence[int]) -> list[int]:
    """Return the angles of the tree whose whole turns are those of a joint coordinate, up to their
    sign."""
    row = np.abs(readings(chart)[place])
    found = np.flatnonzero((closing(chart) > 0) & (row == 1)).tolist()
    return found if row.sum() == 1 else [i for i in found if i not in asked]


def unread(acting: Acting, equations: Equations) -> np.ndarray:
    """Return which coordinates (nq) what acts on the robot reads by sines and cosines alone, 1 or
    0."""
    nq, function = equations.nq, acting.function
    free, given = np.ones(nq), []
    for quantity in acting.quantities:
        value = ca.densify(expression(equations, quantity))
        read = ca.Function("read", [equations.tree.q, equations.v, equations.p], [value])
        found, forgotten = shares(trace(read), [{i: 1.0} for i in range(nq)])
        free[list(forgotten)] = 0
        given += found
    program = trace(function)
    before: list[Shares] = [{}] * (program.n_in - len(given))
    ends = np.cumsum([0, *(size for _, size in program.outputs)])
    wanted = [place for name in ACTS for place in range(*ends[OUTPUTS.index(name) :][:2])]
    found, forgotten = shares(program, before + given, wanted)
    free[list(forgotten | {i for share in found for i in share})] = 0
    return free


def shares(
    program: Program, given: Sequence[Shares], wanted: Sequence[int] | None = None
) -> tuple[list[Shares], set[int]]:
    """Return the shares a_i that a program's results have of angles, and the angles that it sees in
    another way.

    given: the shares of its first inputs; wanted: the places of the results that count, all if left
    out
    """
    nodes = program.nodes
    results = (
        list(program.results) if wanted is None else [program.results[place] for place in wanted]
    )
    needed = needed_for(program, results)
    # Forwards: a sum of a_i angle_i keeps its shares; a sine forgives whole ones; all else sees the
    # angle.
    none: Shares = {}
    values, seen = [none] * len(nodes), set()
    for place, (op, args, number) in enumerate(nodes):
        if not needed[place]:
            continue
        if op == "input":
            values[place] = given[int(number)] if number < len(given) else none
            continue
        own = [values[arg] for arg in args]
        if not any(own):
            continue
        # Sums and multiples keep shares; sines see what is no whole number of turns, all else sees
        # each.
        factors = factors_of(
            op, [nodes[arg].value if nodes[arg].op == "const" else None for arg in args]
        )
        if factors is not None:
            values[place] = added(own, factors)
        elif op in ("sin", "cos", "tan"):
            seen |= {i for i, a in own[0].items() if a != round(a)}
        else:
            seen |= {i for share in own for i in share}
    return [values[place] for place in results], seen


def needed_for(program: Program, results: Sequence[int]) -> bytearray:
    """Return which nodes of a program some of them depend on."""
    needed = bytearray(len(program.nodes))
    for place in results:
        needed[place] = 1
    for place in range(len(program.nodes) - 1, -1, -1):
        if needed[place]:
            for arg in program.nodes[place].args:
                needed[arg] = 1
    return needed


def factors_of(op: str, constants: Sequence[float | None]) -> tuple[float, ...] | None:
    """Return by what an operation multiplies its arguments before it adds them; None where it does
    something else."""
    match op, constants:
        case "add", _:
            return 1.0, 1.0
        case "sub", _:
            return 1.0, -1.0
        case "neg", _:
            return (-1.0,)
        case "mul", [float(factor), _]:
            return 0.0, factor
        case "mul", [_, float(factor)]:
            return factor, 0.0
        case "div", [_, float(divisor)]:
            return 1 / divisor, 0.0
    return None


def added(parts: Sequence[Shares], factors: Sequence[float]) -> Shares:
    """Return the shares of a sum of multiples."""
    total: Shares = {}
    for share, factor in zip(parts, factors, strict=True):
        for i, a in share.items():
            total[i] = total.get(i, 0.0) + factor * a
    return {i: a for i, a in total.items() if a}
