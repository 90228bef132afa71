"""Square systems: what is asked of a mechanism, together with its loops, as one elimination.

    [Phi; J] w = [0; y']        J: rows of what is asked: joint rates, or the tool's twist

Such a system decides the direct (J: the actuators' rates) and the inverse kinematics (J: the
tool's). It is solved as the equations of motion are: an order of elimination chosen once, traced as
straight-line code, evaluated many states at a time. Rates that the rows leave undetermined (spins)
are held. The determinant of each stage of the block triangular form vanishes where the system is
singular and nowhere else: between its zeros its sign tells working modes and assembly modes apart.
Source: Gosselin & Angeles, IEEE Trans. Robotics and Automation 6 (1990) 281-290 (the two
Jacobians); Chablat & Wenger, ICRA 1998 (working modes by the signs of the inverse problem's
determinant).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from linkwork.equations import Equations, body_motion
from linkwork.equations.algebra import SX
from linkwork.equations.chart import Chart, choose_chart
from linkwork.equations.elimination import solve
from linkwork.equations.independence import choose_independent
from linkwork.errors import LinkworkError
from linkwork.model import checks
from linkwork.model.asked import TWIST_ROWS, Rows, joint_rows, tool_rows
from linkwork.model.labels import POSE_ANGLES, POSES
from linkwork.robot import Robot

SAMPLES = 4
DEPENDENT = 1e-6
SPREAD = 0.02


@dataclass(frozen=True, eq=False)
class Square:
    """Hold the rows of what is asked of a robot, and the elimination that solves them together with
    the loops.

    what: names of the rows; J: rows x nv; target: y (rows); error: value - target (rows), angles
        the short way round
    heights: units of the rows: the mechanism's own length of lengths, 1 of angles
    """

    robot: Robot
    what: tuple[str, ...]
    J: ca.SX
    target: ca.SX
    error: ca.SX
    heights: np.ndarray

    @property
    def equations(self) -> Equations:
        return self.robot.equations

    @property
    def chart(self) -> Chart:
        """Order of elimination of [Phi; J], the loops' rows first."""
        return self._chosen[0]

    @property
    def base(self) -> np.ndarray:
        """Configuration (nq) at which it was chosen: the reference, or one near it where that
        itself is singular."""
        return self._chosen[1]

    @cached_property
    def _chosen(self) -> tuple[Chart, np.ndarray]:
        equations, rows = self.equations, self.equations.rows
        A = ca.vertcat(rows.Phi, self.J)
        read = ca.Function("A", [equations.tree.q, equations.p], [ca.densify(A)])
        kept = (*equations.chart.rows, *range(len(rows.names), A.shape[0]))
        heights, widths = np.concatenate([rows.units, self.heights]), equations.tree.rate_units
        values = [
            (q, np.array(read(q, self.robot.p)) * widths / heights[:, None])
            for q in around(self.robot)
        ]
        regular = [(q, value) for q, value in values if full_rank(scaled(value)[list(kept)])]
        if not regular:
            raise LinkworkError(
                f"{', '.join(self.what)} do not determine the configuration near the reference of "
                f"{self.robot.mechanism.name!r}; choose others, or another reference"
            )
        samples = [value for _, value in regular]
        held = choose_independent(scaled(samples[0])[list(kept)], ())
        return choose_chart(A, samples, kept, held, (heights, widths)), regular[0][0]

    @cached_property
    def solution(self) -> ca.SX:
        """W (nv x rows): the rates w = W y' for which the loops stay closed, at closed
        configurations."""
        count = self.J.shape[0]
        return self._solve(
            self.equations.rows.Phi, SX.zeros(len(self.equations.rows.names), count), SX.eye(count)
        )[0]

    @cached_property
    def determinant(self) -> ca.SX:
        """Determinant of [Phi; J] over its value at `base`."""
        return product(ca.vertsplit(self.determinants))

    @cached_property
    def determinants(self) -> ca.SX:
        """Determinant of each stage over its value at `base`."""
        _, pivots = self._solve(
            self.equations.rows.Phi, SX(len(self.equations.rows.names), 0), SX(self.J.shape[0], 0)
        )
        ends = np.cumsum([len(stage.blocks) for stage in self.chart.stages])
        parts = [
            pivots[end - len(stage.blocks) : end]
            for end, stage in zip(ends, self.chart.stages, strict=True)
        ]
        return ca.vertcat(SX(0, 1), *[product(part) for part in parts])

    @cached_property
    def newton(self) -> ca.SX:
        """The rates' Newton step for phi = 0 and error = 0, from open configurations, too."""
        return self._solve(self.equations.rows.open_Phi, -self.equations.rows.phi, -self.error)[0]

    def _solve(self, Phi: ca.SX, loops: ca.SX, asked: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
        X, pivots = solve(self.chart, ca.vertcat(Phi, self.J), ca.vertcat(loops, asked))
        held = SX.zeros(1, asked.shape[1])
        return ca.densify(ca.vertcat(*[X.get(k, held) for k in range(self.equations.nv)])), pivots


def product(factors: Sequence[ca.SX]) -> ca.SX:
    """Return the product of expressions."""
    result = SX(1)
    for factor in factors:
        result = result * factor
    return result


def of_joints(robot: Robot, names: Sequence[str]) -> Square:
    """Return the system that asks for joint coordinates: the direct kinematics where they are the
    actuated ones.

    Args:
        names: joint coordinates that have a rate of their own.

    Raises:
        LinkworkError: names that are unknown or part of a quaternion; coordinates that do not
            determine the motion.
    """
    checks.known(names, robot.coordinates, "joint")
    for name in names:
        if name not in robot.rates:
            raise LinkworkError(
                f"{name!r} is part of a quaternion and cannot be asked for; name angles and slides"
            )
    places = [robot.coordinates.index(name) for name in names]
    rows = joint_rows(robot.equations, names, robot.labels.angular[places].tolist())
    return square(robot, tuple(names), rows, robot.labels.sizes[places])


def of_tool(robot: Robot, what: Sequence[str] | None = None) -> Square:
    """Return the system that asks for coordinates of the tool's pose: the inverse kinematics.

    Args:
        what: some of x, y, angle in the plane; of x, y, z, rx, ry, rz (rotation vector, all three
            or none) in space; as many as the tool can follow if left out.

    Raises:
        LinkworkError: no tool; unknown names; coordinates that do not determine the motion.
    """
    robot.require_tool()
    what = tool_coordinates(robot) if what is None else tuple(what)
    checks.known(what, pose_names(robot), "coordinate of the tool")
    turns = [name for name in what if name in ("rx", "ry", "rz")]
    if turns and len(turns) < 3:
        raise LinkworkError(
            f"{', '.join(turns)} are parts of a rotation vector; ask for rx, ry and rz, or for none"
        )
    heights = np.where([name in POSE_ANGLES for name in what], 1.0, robot.equations.tree.length)
    return square(robot, what, tool_rows(robot.equations, what), heights)


def pose_names(robot: Robot) -> tuple[str, ...]:
    """Return the names of the numbers of a tool pose."""
    return POSES[robot.planar]


def tool_coordinates(robot: Robot, near: bool = True) -> tuple[str, ...]:
    """Return the coordinates of the tool's pose that the robot can lead (`led_coordinates`); refuse
    where there are none."""
    led = led_coordinates(robot, near)
    if led is None:
        names = pose_names(robot)
        raise LinkworkError(
            f"the tool's pose has {len(names)} coordinates and the robot "
            f"{robot.mobility - len(robot.spins)} freedoms; name the coordinates that the tool "
            f"is led in, of {', '.join(names)}"
        )
    return led


def led_coordinates(robot: Robot, near: bool) -> tuple[str, ...] | None:
    """Return the coordinates of the tool's pose that the robot can lead: all, the position, or the
    orientation.

    They have to be independent at the reference or near it.

    near: whether that is enough. If not, a part of the pose may lack one direction at the
    reference, where a leg or an arm
        is stretched, but not more: a tool that shifts only as it tilts lacks two when it is level,
        and is not led in them.
    """
    names, freedoms = pose_names(robot), robot.mobility - len(robot.spins)
    maps = np.array(twist_maps(robot)) / np.repeat([1.0, robot.equations.tree.length], 3)[:, None]
    maps = maps * robot.equations.tree.rate_units[list(robot.equations.chart.independent)]
    for chosen in (names, names[: 2 if robot.planar else 3], names[3:]):
        if not chosen or len(chosen) != freedoms:
            continue
        sigma = np.linalg.svd(maps[:, [TWIST_ROWS[name] for name in chosen]], compute_uv=False)
        here, *aside = np.sum(sigma > DEPENDENT * sigma.max(), axis=1)
        if max(here, *aside) == freedoms and (near or chosen == names or here >= freedoms - 1):
            return chosen
    return None


def twist_maps(robot: Robot) -> list[np.ndarray]:
    """Return the tool's twist (6 x n) for the independent rates, at the reference and near it."""
    tree, tool = robot.equations.tree, next(iter(robot.mechanism.tools.values()))
    J, _ = body_motion.tool_twist(tree, tool, SX.zeros(robot.equations.nv))
    read = ca.Function(
        "twist", [tree.q, robot.equations.p], [ca.mtimes(J, robot.equations.elimination.L)]
    )
    return [np.array(read(q, robot.p)) for q in around(robot)]


def full_rank(rows: np.ndarray) -> bool:
    """Tell whether the rows are independent."""
    return bool(np.linalg.matrix_rank(rows, rtol=DEPENDENT) == len(rows))


def square(robot: Robot, what: tuple[str, ...], rows: Rows, heights: np.ndarray) -> Square:
    """Return the system; refuse another number of rows than freedoms."""
    freedoms = robot.mobility - len(robot.spins)
    if len(what) != freedoms:
        besides = " besides spins of members about themselves" if robot.spins else ""
        raise LinkworkError(
            f"{', '.join(what) or 'nothing'}: {len(what)} coordinates are given, but the "
            f"mobility is {freedoms}{besides}; give as many"
        )
    return Square(robot, what, *rows, heights)


def around(robot: Robot) -> list[np.ndarray]:
    """Return the reference and configurations near it (fixed seed), whose loops are open by a
    little."""
    random = np.random.default_rng(1990)
    q = robot.equations.reference
    return [
        q,
        *(
            q + SPREAD * robot.equations.tree.units * random.standard_normal(q.size)
            for _ in range(SAMPLES)
        ),
    ]


def scaled(A: np.ndarray) -> np.ndarray:
    """Return A with its columns, then its rows, brought to length 1: free of units."""
    A = A / np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    return A / np.maximum(np.linalg.norm(A, axis=1), 1e-300)[:, None]
