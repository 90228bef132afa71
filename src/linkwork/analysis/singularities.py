"""Singularities: where a parallel robot loses or gains a freedom, and how far away that is.

    kind I      det B = 0   leg-singular: the joints move, the tool stands still (in what it is led
                            in); the edge of the workspace
    kind II     det A = 0   actuator-singular: the tool moves with the actuators locked, and bears
                            no force there
    kind III    both
    constraint  rank Phi < its rank elsewhere: the loops themselves let go of a freedom

At one state the kinds are told by singular values: of the rows of the tool and of the actuators on
the motions that the loops allow, and of Phi:

    index = sigma_n / sigma_1  min(1, s / SEEN)

The largest vanishes with the smallest where all legs are stretched at once, or where there is a
single freedom. It is therefore also compared with the joints' own rates: s is the largest singular
value where these, and what they move, are in the mechanism's own units.

Over a workspace or along a motion the signed determinants are smooth functions of q, whose zeros
are the loci. The way to a locus is |det| / |d det / ds|, to first order: kind II by the way s of
the tool (turns times the characteristic length), kind I by that of the actuators, in which the
determinants change regularly.

Source: Gosselin & Angeles, IEEE Trans. Robotics and Automation 6 (1990) 281-290; Zlatanov, Bonev &
Gosselin, ICRA 2002 (constraint singularities).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from linkwork.analysis._jacobians import Jacobians, jacobians, of_actuators, stacked_rows
from linkwork.analysis.all_rows import all_rows
from linkwork.analysis.mapped_extent import require_workspace
from linkwork.analysis.singular_values import singular_values
from linkwork.checks import among, needed
from linkwork.equations import functions
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function
from linkwork.mechanism.task import is_length, labels
from linkwork.model import checks, dexterity
from linkwork.model.asked import ToolAsked
from linkwork.model.asked_rows import task_rows
from linkwork.model.labels import POSE_ANGLES, POSES
from linkwork.model.spread import extent
from linkwork.model.task import Task, task_if_any
from linkwork.patience import announced
from linkwork.robot import Motion, Robot, State
from linkwork.runs.resuming import as_in, described
from linkwork.simulation import Run

if TYPE_CHECKING:
    import xarray

BOUND = 1e-6
SEEN = 0.1
"""Singular value in own units from which on rows see motions of the joints well: a tenth of one
joint's rate."""
SENTENCES = {
    "I": "leg-singular: joints can move with {held} held still",
    "II": "actuator-singular: the tool can move with the actuators locked",
    "III": (
        "leg-singular and actuator-singular at once: joints can move with {held} held still, and "
        "with the actuators locked"
    ),
    "constraint": "the loops let go of a freedom more than elsewhere",
}


@dataclass(frozen=True, eq=False)
class Singularity:
    """Hold what is singular at a state.

    kinds: of "I", "II", "III" and "constraint"; empty where the state is regular
    leg, actuator, constraint: smallest over largest singular value of the tool's rows and the
        actuators' rows on the motions that the loops allow, and of the loops' rows; free of units,
        0 singular. Where rows see less than a tenth of the joints' rates, in the mechanism's own
        units, in all of these motions (all legs nearly stretched at once), times that part of it
    tool: for kind II the tool's motion with the actuators locked, by coordinate [m/s, rad/s], its
        largest 1; else empty
    held: what of the tool kind I was judged by
    """

    kinds: tuple[str, ...]
    leg: float
    actuator: float
    constraint: float
    tool: dict[str, float]
    held: str = "the tool"

    @property
    def message(self) -> str:
        return "; ".join(SENTENCES[kind].format(held=self.held) for kind in self.kinds) or "regular"


def singularity(
    robot: Robot, state: State, *, what: tuple[str, ...] | None = None, bound: float = BOUND
) -> Singularity:
    """Tell of which kinds a state is singular.

    Args:
        robot: with as many actuators as freedoms, and a tool.
        state: one closed configuration.
        what: coordinates of the tool that count, by name; if left out those of its `task`, stated
            or plain, or the whole pose where none is.
        bound: ratio of singular values below which a matrix counts as singular.

    Raises:
        LinkworkError: a stack of states; no tool; other than as many actuators as freedoms.
    """
    needed(robot, Robot)
    # One state, and a bound that is one.
    asked, q = watched(robot, what), robot.own(state).q
    checks.positive(bound, "the bound")
    if q.ndim != 1:
        raise LinkworkError(
            "singularities are told of one state, not of a stack; take one by state.at(index)"
        )
    # Phi w = 0: do the loops still hold as at the reference? The rates that they allow follow.
    Phi, J_x, J_q = (np.array(part) for part in asked.rows(q, robot.p))
    ToolAsked(asked.task, robot.equations.tree.length, robot.planar).require_defined(J_x)
    columns, _ = robot.equations.sizes
    rank = len(robot.equations.chart.rows)
    sigma = np.linalg.svd(robot.equations.scaled(Phi), compute_uv=False)
    constraint = float(sigma[rank - 1] / sigma[0]) if rank else 1.0
    allowed = null_space(robot.equations.scaled(Phi), rank, bound) / columns[:, None]
    # x' = J_x w and q_a' = J_q w on these: what neither moves is singular.
    J_x, J_q = asked.x_scale[:, None] * J_x, asked.q_scale[:, None] * J_q
    X, Q = J_x @ allowed, J_q @ allowed
    own = dexterity.allowed(robot, q[None], asked.task, own=True)
    leg, actuator = (index(part, len(Q), in_own) for part, in_own in ((X, own.X[0]), (Q, own.Q[0])))
    # Kinds by Gosselin & Angeles (1990), and loops that let go.
    kinds = (
        ["III"]
        if max(leg, actuator) < bound
        else [k for k, r in (("I", leg), ("II", actuator)) if r < bound]
    )
    kinds += ["constraint"] * (constraint < bound)
    # The tool's motion with the actuators locked, its largest coordinate scaled to one.
    moving = X @ np.linalg.svd(Q)[2][-1]
    free = moving / asked.x_scale
    largest = free[np.argmax(np.abs(free))]
    loose = actuator < bound and float(np.abs(moving).max()) > bound * float(
        np.linalg.norm(J_x / columns)
    )
    tool = dict(zip(asked.what, (free / largest).tolist(), strict=True)) if loose else {}
    return Singularity(tuple(kinds), leg, actuator, constraint, tool, asked.held)


@dataclass(frozen=True, eq=False)
class Watched:
    """Hold what singular values are taken of: coordinates of the tool, and (q, p) -> Phi, J_x, J_q.

    x_scale, q_scale: what x' and q' are multiplied by to be lengths over time
    """

    robot: Robot
    task: Task
    rows: ca.Function
    x_scale: np.ndarray
    q_scale: np.ndarray

    @property
    def what(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return labels(self.task)

    @property
    def held(self) -> str:
        """What of the tool stands still in a leg-singular configuration."""
        whole = self.what == POSES[self.robot.planar]
        return "the tool" if whole else f"the tool's {', '.join(self.what)}"


def watched(robot: Robot, what: tuple[str, ...] | None) -> Watched:
    """Return what is watched of a robot: the coordinates asked for, or those that the tool is led
    in, or the whole pose."""
    robot.require_tool()
    stated = task_if_any(robot)
    if what is not None or stated is not None:
        made = jacobians(robot, labels(stated or ()) if what is None else what)
        return Watched(robot, made.task, made.rows, *made.lengths())
    whole, direct = POSES[robot.planar], of_actuators(robot)
    size = extent(robot.mechanism, robot.chart, robot.home.q)
    scale = np.where([name in POSE_ANGLES for name in whole], size, 1.0)
    return Watched(
        robot,
        whole,
        stacked_rows(robot, task_rows(robot.equations, whole), direct.J),
        scale,
        np.ones(len(direct.what)),
    )


def null_space(A: np.ndarray, rank: int, bound: float) -> np.ndarray:
    """Return an orthonormal basis of the null space of a matrix (by columns), of at most the given
    rank."""
    if not A.size:
        return np.eye(A.shape[1])
    _, sigma, V = np.linalg.svd(A)
    return V[min(rank, int(np.sum(sigma > bound * sigma[0]))) :].T


def index(A: np.ndarray, n: int, own: np.ndarray) -> float:
    """Return the singular value number n of a matrix over the largest, times the largest in own
    units where that is small."""
    sigma = np.linalg.svd(A, compute_uv=False)
    seen = min(1.0, float(np.linalg.norm(own, 2)) / SEEN)
    return float(sigma[n - 1] / max(sigma[0], 1e-300)) * seen


def determinant_slopes(robot: Robot, made: Jacobians) -> Kernel:
    """Return q -> d det A / d x (n) along the tool, d det B / d q (n) along the actuators."""
    tree = robot.equations.tree
    slopes = [
        ca.jtimes(vanishing.determinant, tree.q, tree.derivatives(moved.solution)).T
        for vanishing, moved in ((made.direct, made.inverse), (made.inverse, made.direct))
    ]
    outputs = {"slope_A": slopes[0], "slope_B": slopes[1]}
    function = functions.function("determinant_slopes", robot.equations, outputs)
    return compile_function(function).given(robot.p)


def distances(made: Jacobians, q: np.ndarray, length: float | None) -> dict[str, np.ndarray]:
    """Return det_A, det_B, conditioning, tool_distance and actuator_distance of configurations
    (N, nq)."""
    inverse, direct = all_rows(made.inverse), all_rows(made.direct)
    if made.spared:
        found = made(q, inverse.along(q))
        slope_A, slope_B = direct.slopes(inverse, q), inverse.slopes(direct, q)
    else:
        found, weak = made.in_any_order(q)
        slope_A, slope_B = (part.copy() for part in made.robot.once(determinant_slopes, made)(q))
        if weak.any():
            slope_A[weak] = direct.slopes(inverse, q[weak], kept=True)
            slope_B[weak] = inverse.slopes(direct, q[weak], kept=True)
    K, _, det_B, det_A = found
    sigma = singular_values(made.homogeneous(K, length))
    x_scale, q_scale = made.lengths(length)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "det_A": det_A,
            "det_B": det_B,
            "conditioning": sigma[:, -1] / sigma[:, 0],
            "tool_distance": np.abs(det_A) / np.linalg.norm(slope_A / x_scale, axis=1),
            "actuator_distance": np.abs(det_B) / np.linalg.norm(slope_B / q_scale, axis=1),
        }


def along(
    robot: Robot,
    motion: Motion | Run | State,
    *,
    what: tuple[str, ...] | None = None,
    length: float | None = None,
) -> xarray.Dataset:
    """Measure how near a motion comes to singularities.

    Args:
        robot: with a tool and actuators.
        motion: a `Motion`, a `Run`, or a stack of states.
        what: coordinates of the tool, as in `singularity`.
        length: characteristic length [m]; that of `Jacobians.characteristic_length` if left out.

    Returns:
        A dataset over time (or over `sample`): det_A and det_B over their values at the reference,
            conditioning,
        tool_distance [m] to an actuator-singular and actuator_distance [m] to a leg-singular
        configuration, to first order, in rad where all of these coordinates turn.
        `crossings` and `leg_crossings` are the times at which det A and det B are zero or change
        sign.
    """
    import xarray

    robot = as_in(robot, described(robot, motion)) if isinstance(motion, Run) else robot
    made, (axis, values, q) = jacobians(robot, what), samples(robot, motion)
    found = distances(made, q, length)
    turns = length is None and not any(map(is_length, made.task))
    slides = any(made.robot.unit(name) == "m" for name in made.direct.what)
    units = {
        "tool_distance": "rad" if turns else "m",
        "actuator_distance": "m" if slides else "rad",
    }
    variables = {
        name: ((axis,), part, {"units": units.get(name, "1")}) for name, part in found.items()
    }
    attrs = {
        "mechanism": robot.mechanism.name,
        "characteristic_length": made.characteristic_length if length is None else length,
    }
    at = {"units": "s"} if axis == "time" else {}
    for name, of in (("crossing", "det_A"), ("leg_crossing", "det_B")):
        variables[f"{name}s"] = ((name,), zeros(values, found[of]), at)
    return xarray.Dataset(variables, {axis: ((axis,), values, at)}, attrs)


def samples(robot: Robot, motion: Motion | Run | State) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the axis, its values and the configurations (N, nq) of a motion."""
    if isinstance(motion, Motion):
        return "time", motion.time, robot.own(motion.state).q
    if isinstance(motion, Run):
        states = robot.state(motion.variables["joint_position"].values)
        return "time", motion.coords["time"].values, states.q
    q = robot.own(motion).q
    if q.ndim != 2:
        raise LinkworkError(
            f"the states have the leading shape {q.shape[:-1]}; give a stack of one leading "
            "dimension"
        )
    return "sample", np.arange(len(q)), q


def zeros(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return where y (N) is zero over x, or changes sign between two samples, by linear
    interpolation."""
    k = np.flatnonzero(np.sign(y[1:]) * np.sign(y[:-1]) < 0)
    between = x[k] + (x[k + 1] - x[k]) * y[k] / (y[k] - y[k + 1])
    return np.sort(np.concatenate([x[y == 0], between]))


@announced("following the singular loci")
def loci(mapped: xarray.Dataset, name: str = "det_A", level: float = 0.0) -> list[np.ndarray]:
    """Return the lines on which a quantity of a workspace over two axes has a value: the
    singularity loci for det_A, 0.

    Args:
        mapped: a workspace over two axes.
        name: det_A for kind II; `reachable` at the level 0.5 for the edge of the workspace
            (kind I, or joint limits); or any quantity.

    Returns:
        lines (K, 2), in the order of the dataset's axes [m, rad].
    """
    from contourpy import contour_generator

    require_workspace(mapped)
    if not among(name, mapped) or mapped[name].ndim != 2:
        given = ", ".join(
            f"{key} over {', '.join(map(str, part.dims))}" for key, part in mapped.items()
        )
        raise LinkworkError(f"{name!r} is no quantity over two axes; there are {given}")
    first, second = (mapped[axis].values for axis in mapped[name].dims)
    values = np.ma.masked_invalid(mapped[name].values.astype(float))
    lines = contour_generator(second, first, values).lines(level)
    return [np.asarray(line)[:, ::-1] for line in lines]
