"""What is asked of a mechanism beside closed loops: values y of joint coordinates, or of the
coordinates of the tool's pose.

    x(q) - y = 0,    x' = J w        turns the short way round

It is told twice: in expressions, which are compiled, and in the numbers that the kernel of
`functions.assembly` gives.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import casadi as ca
import numpy as np

from linkwork.equations import Equations, body_motion
from linkwork.equations.algebra import SX, matrix_quaternion, wrapped
from linkwork.equations.effects import rotation_vector
from linkwork.errors import LinkworkError
from linkwork.model.labels import POSES

TWIST_ROWS = {"x": 3, "y": 4, "z": 5, "rx": 0, "ry": 1, "rz": 2, "angle": 2}
LONG_NAMES = {"rx": "rotation x", "ry": "rotation y", "rz": "rotation z"}
Outputs = Mapping[str, np.ndarray]


class Rows(NamedTuple):
    """Hold rows of what is asked: J (rows x nv), the values y that are asked for, and how far x(q)
    is from them."""

    J: ca.SX
    target: ca.SX
    error: ca.SX


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

    def said(self, y: np.ndarray) -> str:
        """Say in a sentence what values (rows) ask for."""
        ...

    def expressed(self, equations: Equations) -> Rows:
        """Return the rows in expressions."""
        ...

    def error(self, out: Outputs, y: np.ndarray) -> np.ndarray:
        """Return x - y (K, rows) at K configurations, by the outputs of `functions.assembly`."""
        ...

    def jacobian(self, out: Outputs) -> np.ndarray:
        """Return J (K, rows, nv)."""
        ...

    def way(self, out: Outputs, y: np.ndarray) -> Way:
        """Return the straight ways from one configuration, by its outputs (1, ...), to values
        (N, rows)."""
        ...


@dataclass(frozen=True)
class ToolAsked:
    """Ask for the tool's pose: x, y[, angle] in the plane; x, y, z[, rotation vector] in space;
    length: the own one [m]."""

    what: tuple[str, ...]
    length: float
    planar: bool
    noun: str = "pose"

    def said(self, y: np.ndarray) -> str:
        return f"with the tool at {np.round(y, 6).tolist()}"

    @classmethod
    def of(cls, size: int, length: float, planar: bool) -> ToolAsked:
        """Return what a pose of so many numbers asks for."""
        poses = POSES[planar]
        allowed = (2, 3) if planar else (3, 6)
        if size not in allowed:
            understood = (", ".join(map(long_name, poses[:count])) for count in allowed)
            raise LinkworkError(
                f"a tool pose of {size} numbers is not understood; give {' or '.join(understood)}"
            )
        return cls(poses[:size], length, planar)

    @property
    def axes(self) -> int:
        return 2 if self.planar else 3

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"tool: {long_name(name)}" for name in self.what)

    @property
    def twist(self) -> list[int]:
        """Return the rows of the tool's twist [omega; v] that lead its coordinates."""
        return [TWIST_ROWS[name] for name in self.what]

    @property
    def units(self) -> np.ndarray:
        return np.where(np.array(self.twist) < 3, 1.0, self.length)

    def expressed(self, equations: Equations) -> Rows:
        return tool_rows(equations, self.what)

    def error(self, out: Outputs, y: np.ndarray) -> np.ndarray:
        aside = out["position"][:, : self.axes] - y[:, : self.axes]
        if len(self.what) == self.axes:
            return aside
        if self.planar:
            return np.concatenate([aside, wrapped(out["angle"] - y[:, self.axes :])], axis=1)
        from scipy.spatial.transform import Rotation

        R = Rotation.from_matrix(out["orientation"].reshape(-1, 3, 3))
        turn = R * Rotation.from_rotvec(y[:, self.axes :]).inv()
        return np.concatenate([aside, turn.as_rotvec()], axis=1)

    def jacobian(self, out: Outputs) -> np.ndarray:
        return out["J_tool"][:, self.twist]

    def way(self, out: Outputs, y: np.ndarray) -> Way:
        begin, shift = out["position"][0, : self.axes], -self.error(out, y)
        if self.planar or len(self.what) == self.axes:
            turn = out["angle"][0, : len(self.what) - self.axes]
            return straight(np.concatenate([begin, turn]), shift)
        from scipy.spatial.transform import Rotation

        R = Rotation.from_matrix(out["orientation"].reshape(3, 3))

        def at(which: np.ndarray, part: np.ndarray) -> np.ndarray:
            moved = part[:, None] * shift[which]
            turned = (Rotation.from_rotvec(moved[:, 3:]) * R).as_rotvec()
            return np.concatenate([begin + moved[:, :3], turned], axis=1)

        return at


@dataclass(frozen=True, eq=False)
class JointsAsked:
    """Ask for joint coordinates.

    what: their names; places, rates: their numbers among the coordinates and the rates of all
    joints angular: which are angles; wraps: which of these are asked for but for whole turns;
    units: the mechanism's own
    """

    what: tuple[str, ...]
    places: list[int]
    rates: list[int]
    angular: np.ndarray
    wraps: np.ndarray
    units: np.ndarray
    noun: str = "state"

    @cached_property
    def turns(self) -> list[int]:
        """Return the places of those that are angles."""
        return [place for place, angle in zip(self.places, self.angular, strict=True) if angle]

    def said(self, y: np.ndarray) -> str:
        return "with " + ", ".join(map("{} = {:g}".format, self.what, y))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{name}: coordinate" for name in self.what)

    def expressed(self, equations: Equations) -> Rows:
        return joint_rows(equations, self.what, self.angular.tolist())

    def error(self, out: Outputs, y: np.ndarray) -> np.ndarray:
        error = out["coordinates"][:, self.places] - y
        return np.where(self.wraps, wrapped(error), error)

    def jacobian(self, out: Outputs) -> np.ndarray:
        return out["J_coordinates"][:, self.rates]

    def way(self, out: Outputs, y: np.ndarray) -> Way:
        return straight(out["coordinates"][0, self.places], -self.error(out, y))


def straight(begin: np.ndarray, shift: np.ndarray) -> Way:
    """Return the ways from values (rows) along shifts (N, rows)."""
    return lambda which, part: begin + part[:, None] * shift[which]


def joint_rows(equations: Equations, names: Sequence[str], angular: Sequence[bool]) -> Rows:
    """Return the rows of joint coordinates that have a rate of their own; angular: which are
    angles."""
    joints, y = equations.joints, SX.sym("y", len(names))
    differences = [joints.position(name) - y[k] for k, name in enumerate(names)]
    errors = [
        short_way(difference) if turns and name not in equations.tree.coordinates else difference
        for name, turns, difference in zip(names, angular, differences, strict=True)
    ]
    return Rows(joints.rate_rows(names), y, ca.vertcat(SX(0, 1), *errors))


def tool_rows(equations: Equations, what: Sequence[str]) -> Rows:
    """Return the rows of coordinates of the tool's pose: of x, y, angle in the plane; of x, y, z,
    rx, ry, rz in space.

    Of the rotation vector all three are asked for, or none.
    """
    tool = next(iter(equations.mechanism.tools.values()))
    position, orientation, angle = body_motion.tool_pose(equations.tree, tool)
    y = SX.sym("y", len(what))
    wanted = dict(zip(what, ca.vertsplit(y), strict=True))
    errors = {name: position[k] - wanted[name] for k, name in enumerate("xyz") if name in wanted}
    if "angle" in wanted:
        errors["angle"] = short_way(angle - wanted["angle"])
    if "rx" in wanted:
        turn = exponential(ca.vertcat(*[wanted[name] for name in ("rx", "ry", "rz")]))
        R = ca.mtimes(ca.reshape(orientation, 3, 3).T, turn.T)
        error = rotation_vector(matrix_quaternion(R))
        errors |= dict(zip(("rx", "ry", "rz"), ca.vertsplit(error), strict=True))
    return Rows(twist_rows(equations, what), y, ca.vertcat(*[errors[name] for name in what]))


def twist_rows(equations: Equations, what: Sequence[str]) -> ca.SX:
    """Return the rows (rows x nv) of the tool's twist that belong to coordinates of its pose."""
    tool = next(iter(equations.mechanism.tools.values()))
    J, _ = body_motion.tool_twist(equations.tree, tool, SX.zeros(equations.nv))
    return J[[TWIST_ROWS[name] for name in what], :]


def long_name(name: str) -> str:
    """Return the name of a pose's coordinate as sentences give it."""
    return LONG_NAMES.get(name, name)


def short_way(angle: ca.SX) -> ca.SX:
    """Return an angle [rad] between -pi and pi."""
    return ca.atan2(ca.sin(angle), ca.cos(angle))


def exponential(r: ca.SX) -> ca.SX:
    """Return R = exp([r x]) of a rotation vector."""
    square_length = ca.sumsqr(r)
    t = ca.sqrt(square_length + 1e-300)
    K = ca.skew(r)
    return SX.eye(3) + ca.sin(t) / t * K + 2 * (ca.sin(t / 2) / t) ** 2 * ca.mtimes(K, K)
