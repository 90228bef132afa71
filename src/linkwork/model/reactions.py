"""Reactions: the wrench that every joint transmits, balanced with the inertia and the loads of the
bodies (`network`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import prod
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork.equations import Equations
from linkwork.equations.reactions import joint_axes, joint_loads, strained_loads
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.model import checks, evaluation, not_finite
from linkwork.model.charts import CompiledChart
from linkwork.model.network import Loads, Network, balanced, moved
from linkwork.model.reordering import evaluated
from linkwork.model.state import State

if TYPE_CHECKING:
    from linkwork.model.model import Model

FRAMES = ("ground", "first", "second")
COMPONENTS = ("moment_x", "moment_y", "moment_z", "force_x", "force_y", "force_z")
APART = 1e4  # lengths over the robot's own, up to which sums of moments and forces keep digits
OPEN = 1e-6  # part of a direction without conditions from which a component counts as open
MEMORY = 4_000_000  # numbers to hold at a time


@dataclass(frozen=True, eq=False)
class Reactions:
    """Hold the wrenches [moment; force] that joints exert on their second bodies; the first bodies
    get the opposite.

    joints: names; `reactions[name]` is the wrench (..., 6) [N m, N] of one
    wrenches: (..., joints, 6), all that the joint transmits: actuator, spring, friction and gear
        forces included
    constraint: (..., joints, 6), the part that does no work in the joint's motion: without those
        forces
    gears: multiplier of each gear (...) by name; it pushes every geared rate, and pulls along every
        length, by the gear's slope there, which is the ratio where it has no powers, times that
    frame: "ground": about the origin of F1 in the ground's axes; "first": the same in F1's axes;
        "second": about the origin of F2 in F2's axes
    indeterminate: components in that frame, by joint, that rigid bodies leave open, for constraints
        depend on each other: of all distributions that one is given whose constraint wrenches about
        the origins of F2, moments over `length` [m], have the least sum of squares (the least
        Lagrange multipliers)
    """

    joints: tuple[str, ...]
    wrenches: np.ndarray
    constraint: np.ndarray
    gears: Mapping[str, np.ndarray]
    frame: str
    indeterminate: Mapping[str, tuple[str, ...]]
    length: float
    components: ClassVar = COMPONENTS

    def __getitem__(self, joint: str) -> np.ndarray:
        """Return the wrench (..., 6) [N m, N] of one joint."""
        checks.known((joint,), self.joints, "joint between two bodies")
        return self.wrenches[..., self.joints.index(joint), :]

    def __repr__(self) -> str:
        return (
            f"Reactions({', '.join(self.joints)}; frame {self.frame!r}, shape "
            f"{self.wrenches.shape})"
        )


@dataclass(frozen=True, eq=False)
class Samples:
    """Hold K samples of a motion in one chart: q (K, nq), v and v' (K, n), actuator forces u
    (K, actuators).

    applied: external wrenches [moment about the mass centre; force] on the bodies (K, r, 6), in the
    ground's axes, or None; strains: forces of bristles (K, ns), None where friction is that of
    steady sliding
    """

    chart: CompiledChart
    q: np.ndarray
    v: np.ndarray
    v_dot: np.ndarray
    u: np.ndarray
    applied: np.ndarray | None = None
    strains: np.ndarray | None = None

    def __getitem__(self, rows: slice) -> Samples:
        chart, p = self.chart, self.chart.p
        if p.ndim > 1 and len(p) > 1:  # of each sample its own
            chart = chart.with_parameters(p[rows])
        q, v, v_dot, u = (part[rows] for part in (self.q, self.v, self.v_dot, self.u))
        applied, strains = (
            None if part is None else part[rows] for part in (self.applied, self.strains)
        )
        return Samples(chart, q, v, v_dot, u, applied, strains)


def reactions(
    robot: Model,
    state: State,
    forces: ArrayLike | Mapping[str, ArrayLike],
    frame: str,
    length: float | None,
) -> Reactions:
    """Return the reactions in states under actuator forces: `Robot.reactions`."""
    u = checks.actuator_forces(forces, robot.actuators)
    v_dot = evaluation.dynamics(robot, "motion", state, u, "forces")
    batch = v_dot.shape[:-1]
    rows = [
        np.broadcast_to(x, (*batch, x.shape[-1])).reshape(prod(batch), x.shape[-1])
        for x in (state.q, state.rates, v_dot, u)
    ]
    found = transmitted(robot, [Samples(robot.chart_of(state), *rows)], batch, frame, length)
    if not np.isfinite(found.wrenches).all():
        raise not_finite.refusal(robot.chart_of(state), state.q)
    return found


def transmitted(
    robot: Model,
    samples: list[Samples],
    batch: tuple[int, ...],
    frame: str = "ground",
    length: float | None = None,
) -> Reactions:
    """Return the reactions over samples of a motion, chart after chart; `batch` are the leading
    dimensions of the result."""
    if not isinstance(frame, str) or frame not in FRAMES:
        raise LinkworkError(f"frame is {frame!r}; give {' or '.join(map(repr, FRAMES))}")
    own = float(robot.once(spread))
    length = checks.positive(own if length is None else length, "length", "m")
    if not own / APART <= length <= own * APART:
        raise LinkworkError(
            f"length is {length:g} m, and the robot's own is {own:.3g} m; give one within "
            f"{1 / APART:g} and {APART:g} times that, for beyond rounding decides what is told"
        )
    network = robot.once(network_of)
    size = max(1, MEMORY // network.numbers)
    pieces = [part[k : k + size] for part in samples for k in range(0, max(len(part.q), 1), size)]
    parts = [balanced_part(robot, network, piece, frame, length) for piece in pieces]
    wrenches = np.concatenate([part.wrenches for part in parts])
    constraint = np.concatenate([part.constraint for part in parts])
    mu = np.concatenate([part.mu for part in parts])
    is_open = np.any([part.is_open for part in parts], axis=0)
    return Reactions(
        joints=network.joints,
        wrenches=wrenches.reshape(*batch, *wrenches.shape[1:]),
        constraint=constraint.reshape(*batch, *constraint.shape[1:]),
        gears={name: mu[:, k].reshape(batch) for k, name in enumerate(robot.mechanism.gears)},
        frame=frame,
        indeterminate={
            network.joints[k]: tuple(np.array(COMPONENTS)[is_open[k]].tolist())
            for k in np.flatnonzero(np.count_nonzero(is_open, axis=1))
        },
        length=length,
    )


class BalancedSamples(NamedTuple):
    """Hold wrenches and their constraint part (K, J, 6), multipliers of gears mu (K, gears), and
    which components are open (J, 6)."""

    wrenches: np.ndarray
    constraint: np.ndarray
    mu: np.ndarray
    is_open: np.ndarray


def balanced_part(
    robot: Model, network: Network, samples: Samples, frame: str, length: float
) -> BalancedSamples:
    """Return what is transmitted at samples, in the axes of a frame."""
    unit, outside = np.repeat([length, 1.0], 3), samples.applied
    if outside is None:
        outside = np.zeros((len(samples.q), len(robot.bodies), 6))
    needed, centres, origins, twists, f, slopes, pulls, _ = loads(robot, samples, outside)
    count, bodies, joints = len(f), len(robot.bodies), len(network.joints)
    needed, origins = needed.reshape(count, bodies, 6), origins.reshape(count, joints, 2, 3)
    needed = needed - outside
    centres, twists = centres.reshape(count, bodies, 3) / length, twists.reshape(*f.shape, 6) * unit
    G = network.pushed(slopes)
    pulls = pulls.reshape(count, len(network.pulled), 6) / unit
    balance = balanced(
        network, Loads(needed / unit, centres, origins / length, twists, f, G, pulls)
    )
    parts = np.concatenate(
        [balance.wrenches[..., None], balance.constraint[..., None], balance.free], axis=3
    )
    parts = shown(parts, origins / length, seen_from(samples, joints, frame), frame)
    is_open = np.asarray((np.abs(parts[..., 2:]) > OPEN).any(axis=(0, 3)))
    return BalancedSamples(parts[..., 0] * unit, parts[..., 1] * unit, balance.mu, is_open)


def loads(robot: Model, samples: Samples, outside: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return what `joint_loads` gives at samples under wrenches from outside (K, r, 6).

    That of large mechanisms is found in the rates of the whole tree, by code that all charts share,
    where a chart's own order of elimination is good.
    """
    chart, q, strains = samples.chart, samples.q, samples.strains
    make = joint_loads if strains is None else strained_loads
    strains = np.empty((len(q), 0)) if strains is None else strains
    given = samples.u, strains, outside.reshape(len(q), 6 * len(robot.bodies))
    if chart.shared.large:
        pivots = chart.by_table("tree_rates").rows(q, samples.v, chart.p)[:, -1]
        if checks.weakest(pivots) > checks.sure(chart.key):
            w, w_dot = chart.in_tree(q, samples.v, chart.p, samples.v_dot)
            return kernel(chart.free, make)(q, w, w_dot, *given, chart.p)
    parts = q, samples.v, samples.v_dot, *given
    if len(q) != 1:
        return evaluated(robot, chart, lambda other: kernel(other, make), *parts)
    one = (part[0] for part in parts)  # one state takes the shortest way
    found = evaluated(robot, chart, lambda other: kernel(other, make), *one)
    return tuple(part.reshape(1, -1) for part in found)


@lru_cache(maxsize=32)
def kernel(chart: CompiledChart, function: Callable[[Equations], ca.Function]) -> Kernel:
    """Return a function of `equations.reactions`, compiled in a chart."""
    return chart.compiled(function.__name__, function).given(chart.p)


def seen_from(samples: Samples, joints: int, frame: str) -> np.ndarray | None:
    """Return the axes (K, J, 3, 3) of each joint in which wrenches are shown; None for the
    ground's."""
    if frame == "ground":
        return None
    (axes,) = kernel(samples.chart.shared, joint_axes)(samples.q, samples.chart.p)
    return axes.reshape(len(axes), joints, 2, 3, 3)[:, :, FRAMES.index(frame) - 1]


def shown(
    wrenches: np.ndarray, origins: np.ndarray, axes: np.ndarray | None, frame: str
) -> np.ndarray:
    """Return wrenches (K, J, 6, columns), given about the origins of F2 in the ground's axes, in
    another frame of each joint."""
    if frame != "second":
        wrenches = moved(wrenches, origins[:, :, 1] - origins[:, :, 0])
    if axes is None:
        return wrenches
    turned, (count, joints, _, columns) = np.swapaxes(axes, 2, 3)[:, :, None], wrenches.shape
    return (turned @ wrenches.reshape(count, joints, 2, 3, columns)).reshape(wrenches.shape)


def network_of(robot: Model) -> Network:
    """Return the graph of a robot's joints."""
    return Network.of(robot.mechanism)


def spread(robot: Model) -> float:
    """Return the root mean square distance of the joints from their middle at home [m], or 1 m if
    that is zero: of the description's own numbers, whatever values its free ones have."""
    robot = robot.origin or robot
    q, still = robot.home.q[None], np.zeros((1, robot.mobility))
    unforced, nothing = np.zeros((1, len(robot.actuators))), np.zeros((1, len(robot.bodies), 6))
    found = loads(robot, Samples(robot.chart, q, still, still, unforced), nothing)
    origins = found[2].reshape(-1, 3)
    if not len(origins):
        return 1.0
    return float(np.sqrt(np.mean(np.sum((origins - origins.mean(axis=0)) ** 2, axis=1)))) or 1.0
