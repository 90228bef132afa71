"""Derived: what goes in and out of a run as power, its energy balance, and how well its equations
were conditioned.

    balance(t) = E(t) - E(0) - W(t),  W' = sum of the powers of actuators, friction, dampers,
    external wrenches

vanishes for the exact motion. The run is gone through once more in its own steps, and the power is
integrated along their dense output, whose error is of the order that the tolerance bounds: the
balance is the energy that the run's own steps and projections have gained or lost. A sampled
controller is not called again: from each of its calls to the next the motion is integrated under
the inputs that it held.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from linkwork.equations.powers import powers
from linkwork.robot.charts import CompiledChart
from linkwork.robot.passage import Segment
from linkwork.robot.reactions import Reactions, Samples, transmitted
from linkwork.robot.system import System

if TYPE_CHECKING:
    from linkwork.robot.model import Model

NODES = 6  # of Gauss's quadrature in a step
NARROW = 1e-13  # pieces of steps, relative to the time, in which no work is counted
BLOCK = 20_000  # pieces of steps that are looked at together
Quantity = tuple[tuple[str, ...], np.ndarray, str]  # axes beside time, values, unit
POWERS = ("actuator_power", "friction_power", "damper_power", "external_power", "conditioning")
BALANCE = ("work", "energy_balance")
Kept = Sequence[tuple[Segment, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Flow:
    """Evaluate a system in one chart at K samples: states y = (q, v, z), inputs r = (signals, held
    inputs)."""

    robot: Model
    system: System
    chart: CompiledChart

    def split(self, y: np.ndarray) -> list[np.ndarray]:
        """Return q, v and z (K, ...)."""
        nq, n = self.chart.equations.nq, self.chart.equations.mobility
        return np.split(y, [nq, nq + n], axis=-1)

    def slope(self, y: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return y' (K, ...)."""
        q, v, z = self.split(y)
        if self.system.acting is None:
            return np.concatenate(self.chart.kernel("motion")(q, v, r)[:2], axis=-1)
        return self.system.kernel(self.chart, "motion")(q, v, z, r, self.system.p(self.chart))[0]

    def acting(self, y: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the actuators' forces (K, actuators) and external wrenches (K, 6 wrenches), if
        there are any."""
        if self.system.acting is None:
            return r, None
        p = self.system.p(self.chart)
        _, _, force, wrenches = self.system.kernel(self.chart, "recorded")(*self.split(y), r, p)
        return force, wrenches

    def powers(self, y: np.ndarray, r: np.ndarray) -> dict[str, np.ndarray]:
        """Return powers (K, ...) [W] by name (`power_parts`)."""
        q, v, _ = self.split(y)
        return power_parts(self.robot, self.system, self.chart, q, v, *self.acting(y, r))

    def power(self, y: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Return the whole power (K,) [W]."""
        return sum((part.sum(axis=1) for part in self.powers(y, r).values()), np.zeros(len(y)))

    def energy(self, y: np.ndarray) -> np.ndarray:
        """Return kinetic and potential energy together (K,) [J]."""
        q, v, _ = self.split(y)
        kinetic, potential, _ = self.chart.kernel("energy")(q, v)
        return kinetic[:, 0] + potential[:, 0]


def power_parts(
    robot: Model,
    system: System,
    chart: CompiledChart,
    q: np.ndarray,
    v: np.ndarray,
    force: np.ndarray,
    wrenches,
) -> dict[str, np.ndarray]:
    """Return the powers [W] of actuators (K, actuators), of friction in the joint rates (K, m), of
    the dampers of springs between points (K, springs), and of external wrenches (K, wrenches).
    """
    actuated, friction, dampers, _ = chart.compiled("powers", powers).given(chart.p)(q, v)
    parts = {
        "actuator_power": force * actuated,
        "friction_power": friction,
        "damper_power": dampers,
    }
    if wrenches is not None:
        twists = chart.kernel("bodies_motion")(q, v)[2].reshape(len(q), len(robot.bodies), 6)
        columns = [
            np.sum(w * twists[:, k], axis=1)
            for k, w in about_centres(robot, system, chart, q, v, wrenches)
        ]
        parts["external_power"] = np.stack(columns, axis=1) if columns else np.zeros((len(q), 0))
    return parts


def about_centres(
    robot: Model,
    system: System,
    chart: CompiledChart,
    q: np.ndarray,
    v: np.ndarray,
    wrenches: np.ndarray,
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the body's place and [moment about the mass centre; force] (K, 6) of each external
    wrench, ground's axes."""
    acting = system.acting
    axes = chart.kernel("bodies_motion")(q, v)[1].reshape(len(q), len(robot.bodies), 3, 3)
    for k, wrench in enumerate(acting.wrenches if acting else ()):
        body = robot.bodies.index(wrench.body)
        arm = np.array(wrench.point) - np.array(robot.mechanism.bodies[wrench.body].centre_of_mass)
        moment, force = wrenches[:, 6 * k : 6 * k + 3], wrenches[:, 6 * k + 3 : 6 * k + 6]
        yield body, np.concatenate([moment + np.cross(axes[:, body] @ arm, force), force], axis=1)


def power_quantities(
    robot: Model, system: System, kept: Kept, of: Mapping[str, np.ndarray]
) -> dict[str, Quantity]:
    """Return powers and conditioning over time: axes, values and unit by name.

    of: what was measured at the saved times, by name (`recording.measured`)
    """
    parts = [
        segment.measured(Flow(robot, system, segment.chart).powers, rows) for segment, rows in kept
    ]
    power = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    (pivot,) = np.abs(
        robot.kernel("tree_rates")(of["q"], np.zeros((len(of["q"]), robot.mobility)))[1]
    ).T
    found: dict[str, Quantity] = {"actuator_power": (("actuator",), power["actuator_power"], "W")}
    if power["friction_power"].any():
        found["friction_power"] = (("rate",), power["friction_power"], "W")
    if power["damper_power"].any():
        found["damper_power"] = (("spring",), power["damper_power"], "W")
    if system.acting and system.acting.wrenches:
        found["external_power"] = (("wrench",), power["external_power"], "W")
    return found | {"conditioning": ((), pivot, "1")}


def balance_quantities(
    robot: Model, system: System, kept: Kept, of: Mapping[str, np.ndarray]
) -> dict[str, Quantity]:
    """Return work and energy balance over time: axes, values and unit by name."""
    work, start = works(robot, system, kept)
    return {
        "work": ((), work, "J"),
        "energy_balance": ((), of["kinetic"] + of["potential"] - start - work, "J"),
    }


def works(robot: Model, system: System, kept: Kept) -> tuple[np.ndarray, float]:
    """Return W (K,) [J] at the saved times, and the energy at the start.

    Over a singular pose that was stepped over the balance is taken to be kept.
    """
    total, columns, begun, end = 0.0, [np.zeros(0)], 0.0, None
    for segment, rows in kept:
        flow, part, (start, q, v) = (
            Flow(robot, system, segment.chart),
            segment.trajectory,
            segment.start,
        )
        if segment.crossed is not None and end is not None:
            energies = segment.measured(lambda y, _, flow=flow: {"energy": flow.energy(y)}, rows)[
                "energy"
            ]
            columns.append(total + energies - end[1])
            continue
        energy = flow.energy(np.block([[q, v], [part.q_end, part.v_end]]))
        if end is None:
            begun = float(energy[0])
        elif start > end[0]:
            total += energy[0] - end[1]
        W = total + np.cumsum(
            gained(flow, segment, np.concatenate([[start], part.t, [part.end_time]]))
        )
        columns.append(W[1:-1][rows])
        total, end = W[-1], (part.end_time, energy[-1])
    work = np.concatenate(columns)
    lost = np.flatnonzero(~np.isfinite(work))
    if lost.size:
        t = np.concatenate([segment.trajectory.t[rows] for segment, rows in kept])[lost[0]]
        warnings.warn(
            f"the work, and with it the energy balance, is not known (nan) from t = {t:.9g} s "
            "on: the powers are not finite there, or the run could not be gone through again",
            stacklevel=2,
        )
    return work, begun


def gained(flow: Flow, segment: Segment, t: np.ndarray) -> np.ndarray:
    """Return the work (K,) done up to each of the times since the one before it.

    Gauss's quadrature of the power over the segment's steps, cut at the times, on their dense
    output.
    """
    work = np.zeros(len(t))
    if segment.trajectory.control is None:
        ends = np.unique(t)
        work[1:] = np.diff(
            np.interp(
                t, ends, np.concatenate([[0.0], np.cumsum(quadrature(flow, segment, ends, 0))])
            )
        )
        return work
    for i in np.flatnonzero(np.diff(t) > 0).tolist():
        work[i + 1] = quadrature(flow, segment, t[i : i + 2], i - 1).sum()
    return work


def quadrature(flow: Flow, segment: Segment, t: np.ndarray, row: int) -> np.ndarray:
    """Return the work (K - 1,) between increasing times."""
    assert segment.again is not None
    x, weights = np.polynomial.legendre.leggauss(NODES)
    steps = segment.again(None, row).t
    edges = np.union1d(steps[(steps > t[0]) & (steps < t[-1])], t)
    widths, work = np.diff(edges), np.zeros(len(edges) - 1)
    wide = np.flatnonzero(widths > NARROW * edges[-1])
    for block in np.array_split(wide, -(-wide.size // BLOCK) or 1):
        nodes = (edges[block, None] + widths[block, None] * (1 + x) / 2).ravel()
        done = segment.again(nodes, row)
        power = np.full(len(nodes), np.nan)
        power[: len(done.t)] = flow.power(np.column_stack([done.q, done.v]), done.u)
        work[block] = power.reshape(-1, NODES) @ weights / 2 * widths[block]
    return np.add.reduceat(work, np.searchsorted(edges, t[:-1])) if work.size else work


def run_reactions(
    robot: Model, system: System, kept: Kept, frame: str, length: float | None
) -> Reactions:
    """Return the reactions at a run's saved times."""
    samples = []
    for segment, rows in kept:
        flow, part, crossed = (
            Flow(robot, system, segment.chart),
            segment.trajectory,
            segment.crossed,
        )
        y, r = (
            (crossed.y, crossed.u)
            if crossed
            else (np.column_stack([part.q, part.v])[rows], part.u[rows])
        )
        q, v, _ = flow.split(y)
        force, wrenches = flow.acting(y, r)
        nq, n = segment.chart.equations.nq, segment.chart.equations.mobility
        applied = None
        if wrenches is not None:
            applied = np.zeros((len(q), len(robot.bodies), 6))
            for body, wrench in about_centres(robot, system, segment.chart, q, v, wrenches):
                applied[:, body] += wrench
        samples.append(
            Samples(segment.chart, q, v, flow.slope(y, r)[:, nq : nq + n], force, applied)
        )
    ends = np.cumsum([len(part.q) for part in samples])
    found = transmitted(robot, samples, (ends[-1],), frame, length)

    def saved(values: np.ndarray) -> np.ndarray:
        parts = zip(kept, np.split(values, ends[:-1]), strict=True)
        return np.concatenate([one.interpolated(part, rows) for (one, rows), part in parts])

    gears = {name: saved(values) for name, values in found.gears.items()}
    return replace(
        found, wrenches=saved(found.wrenches), constraint=saved(found.constraint), gears=gears
    )
