"""Derived: what goes in and out of a run as power, its energy balance, and how well its equations were conditioned.

    balance(t) = E(t) - E(0) - W(t),        W' = sum of the powers of actuators, friction, dampers, external wrenches

vanishes for the exact motion. From each saved state the motion is integrated again to the next saved time, and the power
with it, in steps that are halved until W hardly changes: the balance is the energy that the run's own
steps and projections have gained or lost. W is undefined (nan) from where steps would be by far more than saved times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from linkwork.equations.powers import powers
from linkwork.robot.charts import CompiledChart
from linkwork.robot.passage import Segment
from linkwork.robot.reactions import Reactions, Samples, transmitted
from linkwork.robot.system import System
from linkwork.simulation import DORMAND_PRINCE

if TYPE_CHECKING:
    from linkwork.robot.robot import Robot

MOST = 2400  # steps between two saved times beyond which W is left undefined
FINE = 1e-6  # change of the work between two saved times that is none, relative to what goes in and out
Quantity = tuple[tuple[str, ...], np.ndarray, str]  # axes beside time, values, unit
POWERS = ("actuator_power", "friction_power", "damper_power", "external_power", "conditioning")
BALANCE = ("work", "energy_balance")
Kept = Sequence[tuple[Segment, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Flow:
    """Evaluate a system in one chart at K samples: states y = (q, v, z), inputs r = (signals, held inputs)."""

    robot: Robot
    system: System
    chart: CompiledChart

    def split(self, y: np.ndarray) -> list[np.ndarray]:
        """Return q, v and z (K, ...)."""
        nq, n = self.chart.equations.nq, self.chart.equations.mobility
        return np.split(y, [nq, nq + n], axis=-1)

    def inputs(self, t: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the inputs at times t (K,), with what r holds."""
        signals = self.system.inputs(t)
        return np.concatenate([signals, r[:, signals.shape[1] :]], axis=1)

    def slope(self, y: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return y' (K, ...)."""
        q, v, z = self.split(y)
        if self.system.acting is None:
            return np.concatenate(self.chart.kernel("motion")(q, v, r)[:2], axis=-1)
        return self.system.kernel(self.chart, "motion")(q, v, z, r, self.system.p(self.chart))[0]

    def acting(self, y: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the actuators' forces (K, actuators) and external wrenches (K, 6 wrenches), if there are any."""
        if self.system.acting is None:
            return r, None
        p = self.system.p(self.chart)
        _, _, force, wrenches = self.system.kernel(self.chart, "recorded")(*self.split(y), r, p)
        return force, wrenches

    def power(self, y: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the whole power (K,) [W]."""
        q, v, _ = self.split(y)
        parts = power_parts(self.robot, self.system, self.chart, q, v, *self.acting(y, r))
        return sum((part.sum(axis=1) for part in parts.values()), np.zeros(len(y)))

    def energy(self, y: np.ndarray) -> np.ndarray:
        """Return kinetic and potential energy together (K,) [J]."""
        q, v, _ = self.split(y)
        kinetic, potential, _ = self.chart.kernel("energy")(q, v)
        return kinetic[:, 0] + potential[:, 0]


def power_parts(
    robot: Robot, system: System, chart: CompiledChart, q: np.ndarray, v: np.ndarray, force: np.ndarray, wrenches
) -> dict[str, np.ndarray]:
    """Return the powers [W] of actuators (K, actuators), of friction in the joint rates (K, m), of the dampers of springs
    between points (K, springs), and of external wrenches (K, wrenches).
    """
    actuated, friction, dampers, _ = chart.compiled("powers", powers).given(chart.p)(q, v)
    parts = {"actuator_power": force * actuated, "friction_power": friction, "damper_power": dampers}
    if wrenches is not None:
        twists = chart.kernel("bodies_motion")(q, v)[2].reshape(len(q), len(robot.bodies), 6)
        columns = [np.sum(w * twists[:, k], axis=1) for k, w in about_centres(robot, system, chart, q, v, wrenches)]
        parts["external_power"] = np.stack(columns, axis=1) if columns else np.zeros((len(q), 0))
    return parts


def about_centres(
    robot: Robot, system: System, chart: CompiledChart, q: np.ndarray, v: np.ndarray, wrenches: np.ndarray
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the body's place and [moment about the mass centre; force] (K, 6) of each external wrench, ground's axes."""
    acting = system.acting
    axes = chart.kernel("bodies_motion")(q, v)[1].reshape(len(q), len(robot.bodies), 3, 3)
    for k, wrench in enumerate(acting.wrenches if acting else ()):
        body = robot.bodies.index(wrench.body)
        arm = np.array(wrench.point) - np.array(robot.mechanism.bodies[wrench.body].centre_of_mass)
        moment, force = wrenches[:, 6 * k : 6 * k + 3], wrenches[:, 6 * k + 3 : 6 * k + 6]
        yield body, np.concatenate([moment + np.cross(axes[:, body] @ arm, force), force], axis=1)


def power_quantities(robot: Robot, system: System, kept: Kept, of: Mapping[str, np.ndarray]) -> dict[str, Quantity]:
    """Return powers and conditioning over time: axes, values and unit by name.

    of: what was measured at the saved times, by name (`recording.measured`)
    """
    parts, end = [], 0
    for segment, rows in kept:
        begin, end = end, end + len(segment.trajectory.t[rows])
        here = {name: of[name][begin:end] for name in ("q", "v", "force", "wrenches") if name in of}
        force, wrenches = here["force"], here.get("wrenches")
        parts.append(power_parts(robot, system, segment.chart, here["q"], here["v"], force, wrenches))
    power = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    (pivot,) = np.abs(robot.kernel("tree_rates")(of["q"], np.zeros((len(of["q"]), robot.mobility)))[1]).T
    found: dict[str, Quantity] = {"actuator_power": (("actuator",), power["actuator_power"], "W")}
    if power["friction_power"].any():
        found["friction_power"] = (("rate",), power["friction_power"], "W")
    if power["damper_power"].any():
        found["damper_power"] = (("spring",), power["damper_power"], "W")
    if system.acting and system.acting.wrenches:
        found["external_power"] = (("wrench",), power["external_power"], "W")
    return found | {"conditioning": ((), pivot, "1")}


def balance_quantities(robot: Robot, system: System, kept: Kept, of: Mapping[str, np.ndarray]) -> dict[str, Quantity]:
    """Return work and energy balance over time: axes, values and unit by name."""
    work, start = works(robot, system, kept)
    return {"work": ((), work, "J"), "energy_balance": ((), of["kinetic"] + of["potential"] - start - work, "J")}


def works(robot: Robot, system: System, kept: Kept) -> tuple[np.ndarray, float]:
    """Return W (K,) [J] at the saved times, and the energy at the start.

    Over a singular pose that was stepped over the balance is taken to be kept.
    """
    total, columns, begun, end = 0.0, [np.zeros(0)], 0.0, None
    held = np.zeros(system.acting.held if system.acting else 0)
    for segment, rows in kept:
        flow = Flow(robot, system, segment.chart)
        t, y, r = nodes(flow, segment, held)
        energy = flow.energy(y[[0, -1]])
        if end is None:
            begun = float(energy[0])
        elif t[0] > end[0]:
            total += energy[0] - end[1]
        W = total + np.cumsum(gained(flow, t, y, r, segment.trajectory.steps))
        columns.append(W[1:-1][rows])
        total, end = W[-1], (t[-1], energy[-1])
        if segment.trajectory.control:
            held = segment.trajectory.control.held
    return np.concatenate(columns), begun


def nodes(flow: Flow, segment: Segment, held: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return t, y and r at the start of a segment, where inputs are held, at its saved times and its end."""
    (start, q, v), part = segment.start, segment.trajectory
    t = np.concatenate([[start], part.t, [part.end_time]])
    y = np.block([[q, v], [part.q, part.v], [part.q_end, part.v_end]])
    u = part.u[:, part.u.shape[1] - held.size :]
    return t, y, np.hstack([flow.system.inputs(t), np.vstack([held, u, u[-1:] if len(u) else held])])


def gained(flow: Flow, t: np.ndarray, y: np.ndarray, r: np.ndarray, steps: int) -> np.ndarray:
    """Return the work (K,) done up to each node since the one before it; steps: the run's in this time.

    Steps are halved while that changes the work; it is left undefined (nan) where they become too many.
    """
    times = pieces(t, flow.system.inputs.breaks)
    parts, work = times.shape[1] - 1, np.zeros(len(t))
    left = np.flatnonzero(np.diff(t) > 0) + 1
    count, before = -(-max(steps, 1) // max(left.size * parts, 1)), np.full(len(t), np.nan)
    while left.size and count * parts <= MOST:
        with np.errstate(all="ignore"):
            work[left], size = along(flow, times[left - 1], y[left - 1], r[left - 1], count)
            changed = ~(np.abs(work - before)[left] <= FINE * size)
        before, left, count = work.copy(), left[changed], 2 * count
    work[left] = np.nan
    return work


def pieces(t: np.ndarray, breaks: np.ndarray) -> np.ndarray:
    """Return the times (K - 1, pieces + 1) from each node over the breaks in between to the next, which may be repeated."""
    first, last = np.searchsorted(breaks, t[:-1], side="right"), np.searchsorted(breaks, t[1:], side="left")
    places = first[:, None] + np.arange(max(int((last - first).max(initial=0)), 0))
    between = np.append(breaks, np.nan)[np.minimum(places, len(breaks))]
    return np.column_stack([t[:-1], np.where(places < last[:, None], between, t[1:, None]), t[1:]])


def along(flow: Flow, times: np.ndarray, y: np.ndarray, r: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the work from each of some states on, and the energy that went in and out together (K,) [J].

    Dormand and Prince's method takes `count` steps over each piece of the times (K, pieces + 1).
    """
    a, b, c = DORMAND_PRINCE.a[:-1, :-1], DORMAND_PRINCE.a[-1, :-1], DORMAND_PRINCE.c[:-1]
    work, size = np.zeros((2, len(y)))
    for start, end in zip(times.T[:-1], times.T[1:], strict=True):
        h, before = (end - start) / count, np.nextafter(end, start)  # forces that jump at the end do so behind it
        for step in range(count):
            slopes, powers = np.zeros((len(c), *y.shape)), np.zeros((len(c), len(y)))
            for i, c_i in enumerate(c):
                stage = y + h[:, None] * np.tensordot(a[i, :i], slopes[:i], axes=1)
                inputs = flow.inputs(np.minimum(start + (step + c_i) * h, before), r)
                slopes[i], powers[i] = flow.slope(stage, inputs), flow.power(stage, inputs)
            y = y + h[:, None] * np.tensordot(b, slopes, axes=1)
            work, size = work + h * (b @ powers), size + h * abs(b @ powers)
    return work, size


def run_reactions(robot: Robot, system: System, kept: Kept, frame: str, length: float | None) -> Reactions:
    """Return the reactions at a run's saved times."""
    samples = []
    for segment, rows in kept:
        flow, part = Flow(robot, system, segment.chart), segment.trajectory
        y, r = np.column_stack([part.q, part.v])[rows], part.u[rows]
        q, v, _ = flow.split(y)
        force, wrenches = flow.acting(y, r)
        nq, n = segment.chart.equations.nq, segment.chart.equations.mobility
        applied = None
        if wrenches is not None:
            applied = np.zeros((len(q), len(robot.bodies), 6))
            for body, wrench in about_centres(robot, system, segment.chart, q, v, wrenches):
                applied[:, body] += wrench
        samples.append(Samples(segment.chart, q, v, flow.slope(y, r)[:, nq : nq + n], force, applied))
    return transmitted(robot, samples, (sum(len(part.q) for part in samples),), frame, length)
