"""What is asked of a mechanism beside closed loops: values y of joint coordinates, or of the
coordinates of the tool's pose.

    x(q) - y = 0,    x' = J w        turns the short way round

It is told twice: in expressions (`asked_rows`), which are compiled, and in the numbers that the
kernel of `functions.assembly` gives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import casadi as ca
import numpy as np

from linkwork.checks import amount
from linkwork.equations import Equations, body_motion, functions
from linkwork.equations.algebra import SX, matrix_quaternion, wrapped
from linkwork.equations.effects import rotation_vector
from linkwork.equations.task import (
    held_task,
    mapped_rows,
    pointing_of,
    task_map,
    told,
    whole_rotation,
)
from linkwork.equations.tree import Tree
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel, compile_function
from linkwork.mechanism import DistanceTo, TurnAbout
from linkwork.mechanism.task import ROTATION, TaskCoordinate, is_angle, is_length, labels
from linkwork.model.asked_rows import (
    Rows,
    joint_rows,
    quaternion_product,
    straight_part,
    tool_rows,
    vector_quaternion,
)
from linkwork.model.charts import CompiledChart
from linkwork.model.labels import POSES

TWIST_ROWS = {"x": 3, "y": 4, "z": 5, "rx": 0, "ry": 1, "rz": 2, "angle": 2}
LONG_NAMES = {"rx": "rotation x", "ry": "rotation y", "rz": "rotation z"}
KNOWN = {"x": 0, "y": 1, "z": 2, "angle": 3}  # places of coordinates in position and angle
UPRIGHT = "where the tool is upright lead it in tilt_x, tilt_y, or in azimuth and tilt together"
CURES = {"azimuth": UPRIGHT, "tilt": UPRIGHT}
Outputs = Mapping[str, np.ndarray]


Way = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Straight ways (N): which of them (K), parts of them from 0 to 1 (K) -> values there (K, rows)."""


class Asked(Protocol):
    """Name what is asked, and say how far configurations are from it."""

    @property
    def noun(self) -> str:
        """Return what one of many is called that are asked for."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Return what each row is, for sentences: an element, a colon, and what of it."""
        ...

    @property
    def units(self) -> np.ndarray:
        """Return the mechanism's own units of the rows: its own length of lengths, 1 of angles."""
        ...

    @property
    def lengths(self) -> np.ndarray:
        """Return which rows are lengths; the others are angles."""
        ...

    @property
    def wraps(self) -> np.ndarray:
        """Return which rows are angles that come back after a turn."""
        ...

    def said(self, y: np.ndarray) -> str:
        """Say in a sentence what values (rows) ask for."""
        ...

    def expressed(self, equations: Equations) -> Rows:
        """Return the rows in expressions."""
        ...

    def along(self, equations: Equations, part: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Return values y (rows) as symbols, and what is asked at a part of the straight way to
        them, in expressions."""
        ...

    def error(self, out: Outputs, y: np.ndarray) -> np.ndarray:
        """Return x - y (K, rows) at K configurations, by the outputs of `functions.assembly`."""
        ...

    def jacobian(self, out: Outputs) -> np.ndarray:
        """Return J (K, rows, nv)."""
        ...

    def put(self, tree: Tree, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return q (..., nq) with those of the tree's coordinates that are asked for at their
        values (..., rows)."""
        ...

    def way(self, out: Outputs, y: np.ndarray) -> Way:
        """Return the straight ways to values (N, rows) from one configuration, or from one each, by
        their outputs (1, ...) or (N, ...)."""
        ...


@dataclass(frozen=True)
class ToolAsked:
    """Ask for coordinates of the tool's pose.

    what: task coordinates; length: the mechanism's own [m]; planar: whether it moves in the plane

    An azimuth together with a tilt is held by  tilt (cos azimuth, sin azimuth),  which is regular
    where the tool is upright, too (`held`): values are `given` so.
    """

    what: tuple[TaskCoordinate, ...]
    length: float
    planar: bool
    noun: str = "pose"

    @classmethod
    def of(cls, size: int, length: float, planar: bool) -> ToolAsked:
        """Return what a pose of so many numbers asks for."""
        poses = POSES[planar]
        allowed = (2, 3) if planar else (3, 6)
        if size not in allowed:
            understood = (", ".join(map(long_name, poses[:count])) for count in allowed)
            raise LinkworkError(
                f"a tool pose of {amount(size, 'number')} is not understood; give "
                f"{' or '.join(understood)}"
            )
        return cls(poses[:size], length, planar)

    def said(self, y: np.ndarray) -> str:
        return f"with the tool at {np.round(self.told(y), 6).tolist()}"

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the names of the coordinates."""
        return labels(self.what)

    @cached_property
    def held(self) -> tuple[TaskCoordinate, ...]:
        """Return the coordinates whose values are held."""
        return held_task(self.what)

    @cached_property
    def pointing(self) -> tuple[int, int] | None:
        """Return the places of an azimuth and a tilt that are both asked for."""
        return pointing_of(self.what)

    def given(self, y: np.ndarray) -> np.ndarray:
        """Return the values that are held (..., k) of values as a user gives them (..., k)."""
        return self.given_motion(y, 0 * y, 0 * y)[0] if self.pointing else y

    def given_motion(
        self, y: np.ndarray, dy: np.ndarray, ddy: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return held values and their time derivatives (..., k) of those that a user gives."""
        if self.pointing is None:
            return y, dy, ddy
        a, t = self.pointing
        turn, rate = np.exp(1j * y[..., a]), dy[..., t] + 1j * y[..., t] * dy[..., a]
        bend = ddy[..., t] - y[..., t] * dy[..., a] ** 2
        swing = 2 * dy[..., t] * dy[..., a] + y[..., t] * ddy[..., a]
        found = []
        for values, z in ((y, y[..., t]), (dy, rate), (ddy, bend + 1j * swing)):
            own = np.array(values, float)
            own[..., a], own[..., t] = np.real(z * turn), np.imag(z * turn)
            found.append(own)
        return found[0], found[1], found[2]

    def told(self, y: np.ndarray) -> np.ndarray:
        """Return values as a user gives them of held ones (..., k)."""
        if self.pointing is None:
            return y
        a, t = self.pointing
        own = np.array(y, float)
        own[..., a] = np.arctan2(y[..., t], y[..., a])
        own[..., t] = np.hypot(y[..., a], y[..., t])
        return own

    @property
    def axes(self) -> int:
        return 2 if self.planar else 3

    @property
    def names(self) -> tuple[str, ...]:
        return self._names

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(f"tool: {sentence_name(item)}" for item in self.held)

    @property
    def units(self) -> np.ndarray:
        return self._units

    @cached_property
    def _units(self) -> np.ndarray:
        return np.where(self.lengths, self.length, 1.0)

    @property
    def lengths(self) -> np.ndarray:
        return np.array([is_length(item) for item in self.held], bool)

    @property
    def wraps(self) -> np.ndarray:
        return self._wraps

    @cached_property
    def _wraps(self) -> np.ndarray:
        return np.array([is_angle(item) for item in self.held], bool)

    @cached_property
    def rotation(self) -> list[int] | None:
        """Return the places of rx, ry, rz where all of these are asked for."""
        return [self.what.index(n) for n in ROTATION] if whole_rotation(self.what) else None

    @cached_property
    def twist(self) -> list[int]:
        """Return the rows of the tool's twist [omega; v] that lead its coordinates, where each is
        led by one."""
        return [TWIST_ROWS[str(item)] for item in self.held]

    @cached_property
    def plain(self) -> bool:
        """Tell whether each coordinate is led by one row of the twist."""
        alone = [item in ROTATION for item in self.held]
        known = all(isinstance(item, str) and item in TWIST_ROWS for item in self.held)
        return known and (self.rotation is not None or not any(alone))

    def expressed(self, equations: Equations) -> Rows:
        return tool_rows(equations, self.held)

    def along(self, equations: Equations, part: ca.SX) -> tuple[ca.SX, ca.SX]:
        tool, y = equations.mechanism.first_tool, SX.sym("y", len(self.held))
        x, _ = mapped_rows(equations.tree, tool, self.held)
        there = straight_part(x, y, part, self.wraps)
        if self.rotation:
            R = ca.reshape(body_motion.tool_pose(equations.tree, tool).orientation, 3, 3).T
            begin, end = matrix_quaternion(R), vector_quaternion(y[self.rotation])
            turn = rotation_vector(quaternion_product(end, begin * ca.DM([1, -1, -1, -1])))
            there[self.rotation] = rotation_vector(
                quaternion_product(vector_quaternion(part * turn), begin)
            )
        return y, there

    def values(self, out: Outputs) -> np.ndarray:
        """Return the held coordinates x (K, k); of a whole rotation vector they are not told."""
        if not self.plain:
            return self.mapped(out)[0]
        known = np.concatenate([out["position"], out["angle"]], axis=1)
        return known[:, [KNOWN.get(str(item), 0) for item in self.held]]

    def mapped(self, out: Outputs, twist: np.ndarray | None = None) -> list[np.ndarray]:
        """Return x (K, k), E (K, k, 6) and E' [omega; v] (K, k); twist: (K, 6), at rest if left
        out."""
        sizes = {"position": 3, "orientation": 9, "angle": 1}
        pose = np.concatenate([np.reshape(out[n], (-1, size)) for n, size in sizes.items()], axis=1)
        count, k = len(pose), len(self.held)
        x, E, bias = task_kernel(self.held)(pose, np.zeros((count, 6)) if twist is None else twist)
        return [x, E.reshape(count, 6, k).swapaxes(1, 2), bias]

    def error(self, out: Outputs, y: np.ndarray) -> np.ndarray:
        error = self.values(out) - y
        error[:, self.wraps] = wrapped(error[:, self.wraps])
        if self.rotation:
            from scipy.spatial.transform import Rotation

            R = Rotation.from_matrix(out["orientation"].reshape(-1, 3, 3))
            turn = R * Rotation.from_rotvec(y[:, self.rotation]).inv()
            error[:, self.rotation] = turn.as_rotvec()
        return error

    def jacobian(self, out: Outputs) -> np.ndarray:
        if self.plain:
            return out["J_tool"][:, self.twist]
        return self.mapped(out)[1] @ out["J_tool"]

    def put(self, tree: Tree, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        return q

    def bias(self, out: Outputs, w: np.ndarray) -> np.ndarray:
        """Return J' w (K, k), by outputs for the rates w (nv), or (K, nv), of each."""
        if self.plain:
            return out["bias_tool"][:, self.twist]
        _, E, bias = self.mapped(out, (out["J_tool"] @ w[..., None])[..., 0])
        return (E @ out["bias_tool"][..., None])[..., 0] + bias

    def require_defined(self, J: np.ndarray) -> None:
        """Refuse coordinates that are not defined at a pose, by their rows (k, nv)."""
        if np.isfinite(J).all():
            return
        wrong = [item for item, row in zip(self.held, J, strict=True) if not np.isfinite(row).all()]
        if wrong:
            raise LinkworkError(
                f"the tool's {sentence_name(wrong[0])} has no rate at this pose; "
                f"{CURES.get(str(wrong[0]), 'lead the tool around it')}"
            )

    def way(self, out: Outputs, y: np.ndarray) -> Way:
        self.require_defined(self.jacobian(out)[0])
        begin, shift = self.values(out), -self.error(out, y)
        if self.rotation is None:
            return straight(begin, shift)
        from scipy.spatial.transform import Rotation

        R, rotation = out["orientation"].reshape(-1, 3, 3), self.rotation

        def at(which: np.ndarray, part: np.ndarray) -> np.ndarray:
            moved = part[:, None] * shift[which]
            placed = of_each(begin, which) + moved
            turn = Rotation.from_matrix(of_each(R, which))
            placed[:, rotation] = (Rotation.from_rotvec(moved[:, rotation]) * turn).as_rotvec()
            return placed

        return at


@dataclass(frozen=True, eq=False)
class JointsAsked:
    """Ask for joint coordinates.

    what: their names; places, rates: their numbers among the coordinates and the rates of all
        joints
    angular: which are angles; wraps: which of these are asked for but for whole turns; units: the
        mechanism's own
    """

    what: tuple[str, ...]
    places: list[int]
    rates: list[int]
    angular: np.ndarray
    wraps: np.ndarray
    units: np.ndarray
    noun: str = "state"

    @property
    def lengths(self) -> np.ndarray:
        return ~self.angular

    @cached_property
    def turns(self) -> list[int]:
        """Return the places of those that are angles."""
        return [place for place, angle in zip(self.places, self.angular, strict=True) if angle]

    def said(self, y: np.ndarray) -> str:
        return "with " + ", ".join(map("{} = {:g}".format, self.what, y))

    @property
    def names(self) -> tuple[str, ...]:
        return self._names

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(f"{name}: coordinate" for name in self.what)

    def expressed(self, equations: Equations) -> Rows:
        return joint_rows(equations, self.what, self.wraps.tolist())

    def along(self, equations: Equations, part: ca.SX) -> tuple[ca.SX, ca.SX]:
        x = ca.vertcat(*[equations.joints.position(name) for name in self.what])
        y = SX.sym("y", len(self.what))
        return y, straight_part(x, y, part, self.wraps)

    def error(self, out: Outputs, y: np.ndarray) -> np.ndarray:
        error = out["coordinates"][:, self.places] - y
        return np.where(self.wraps, wrapped(error), error)

    def jacobian(self, out: Outputs) -> np.ndarray:
        return out["J_coordinates"][:, self.rates]

    def put(self, tree: Tree, q: np.ndarray, y: np.ndarray) -> np.ndarray:
        q, own = np.array(q), [k for k, name in enumerate(self.what) if name in tree.places]
        q[..., [tree.places[self.what[k]] for k in own]] = y[..., own]
        return q

    def way(self, out: Outputs, y: np.ndarray) -> Way:
        return straight(out["coordinates"][:, self.places], -self.error(out, y))


def straight(begin: np.ndarray, shift: np.ndarray) -> Way:
    """Return the ways from values (1, rows) or (N, rows) along shifts (N, rows)."""
    return lambda which, part: of_each(begin, which) + part[:, None] * shift[which]


def of_each(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return those values (K, ...) of (N, ...) that are named, or the one (1, ...) that all
    share."""
    return values if len(values) == 1 else values[which]


@lru_cache(maxsize=64)
def task_kernel(task: tuple[TaskCoordinate, ...]) -> Kernel:
    """Return the compiled (pose, twist) -> x, E, E' [omega; v] of task coordinates."""
    return compile_function(task_map(task))


@lru_cache(maxsize=256)
def values_kernel(chart: CompiledChart, task: tuple[TaskCoordinate, ...]) -> Kernel:
    """Return the kernel of q -> the task coordinates (k), and 1."""

    def made(equations: Equations) -> ca.Function:
        pose = ca.vertcat(*body_motion.tool_pose(equations.tree, equations.mechanism.first_tool))
        outputs = {"x": told(task, pose), "one": ca.SX(1)}
        return functions.function("task_values", equations, outputs)

    return chart.compiled(f"values of {task}", made).given(chart.p)


def sentence_name(item: TaskCoordinate) -> str:
    """Return the name of a task coordinate as sentences give it, with what it is about."""
    if isinstance(item, TurnAbout):
        return f"{item.name} about {list(item.axis)}"
    if isinstance(item, DistanceTo):
        return f"{item.name} to {list(item.point)}"
    return long_name(item)


def long_name(name: str) -> str:
    """Return the name of a pose's coordinate as sentences give it."""
    return LONG_NAMES.get(name, name)
