"""Possible inertia: masses and moments that a body can have, found from measured motions.

A body of mass m, mass centre c and second moments Sigma = int (r - c)(r - c)' dm is possible where
m > 0 and Sigma is positive definite (then its pseudo-inertia is, and its principal moments keep the
triangle inequality). About a possible body

    m = m_0 e^a,    c = c_0 + g b,    Sigma = S_0 T T' S_0',    I_c = tr(Sigma) 1 - Sigma

with T upper triangular, its diagonal e^d, and g the radius of gyration: all 10 numbers are free,
and zero at that body. Of a body that moves in its plane there are 4: I_zz = I_0 e^d.

    min |root (beta - C pi(theta))|^2 + |theta / spread|^2

The second part decides what the motions do not tell, as near to what was described as can be.
Source: Rucker & Wensing, IEEE Robotics and Automation Letters 7 (2022) 2756-2763 (log-Cholesky
coordinates); Wensing, Kim & Slotine, ibid. 3 (2018) 60-67 (pseudo-inertia).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from linkwork.analysis._base_parameters import regressor_of
from linkwork.analysis.identification import (
    Identification,
    Measured,
    as_measured,
    left_over,
    motion_of,
)
from linkwork.analysis.outliers import warned_by_rates
from linkwork.analysis.settled_squares import settled
from linkwork.checks import among, positive, shown
from linkwork.equations.regressor import OF_BODIES
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.mechanism import Body, Inertia, Mechanism
from linkwork.mechanism.numbers import edited, located
from linkwork.mechanism.payload import rotation
from linkwork.model.linear import own_rates
from linkwork.patience import announced
from linkwork.robot import Robot
from linkwork.simulation import Run

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

STEP = 1e-30  # of the complex step
TOLERANCE = 1e-14
MOST, PATIENT = 300, 3000  # evaluations, at once and along a valley
GRADUATED = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)  # weights of residuals along a valley
WIDE = 10.0  # spread of friction and rotors, over what is described
SPATIAL, FLAT = 10, 4
UNTOLD = 1e-3  # part of a direction that is not told, from which on a number is not
SMALL = 1e-3  # of the robot's mass and length: what stands for a mass or a size that is zero
NAMES = ("xx", "yy", "zz", "xy", "xz", "yz")
UPPER, DIAGONAL = np.triu_indices(3), np.diag_indices(3)
"""T's numbers: its diagonal's are logarithms."""


@dataclass(frozen=True, eq=False)
class PossibleBody:
    """Hold a body about which others are told by free numbers theta (10; 4 where flat).

    mass [kg]; centre: c_0 (3) [m]; root: S_0 (3 x 3) [sqrt(kg) m], Sigma_0 = S_0 S_0'; its element
        0, 0 is sqrt(I_0) where flat
    """

    mass: float
    centre: np.ndarray
    root: np.ndarray
    flat: bool

    @classmethod
    def of(cls, body: Body, mass: float, length: float) -> PossibleBody:
        """Return it about a body of a description; what that lacks is small, but above zero.

        mass, length: sizes of the robot [kg, m], of which a part stands for what is zero
        """
        tensor, c = body.inertia.tensor(), np.array(body.centre_of_mass)
        own = body.mass or SMALL * mass
        least = own * (SMALL * length) ** 2
        if body.inertia.planar:
            return cls(own, c, np.diag([max(body.inertia.zz, least) ** 0.5, 0.0, 0.0]), True)
        values, axes = np.linalg.eigh(np.trace(tensor) / 2 * np.eye(3) - tensor)
        return cls(own, c, axes * np.sqrt(np.maximum(values, least)), False)

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return FLAT if self.flat else SPATIAL

    def parts(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return mass (...), mass centre (..., 3) and inertia about it (..., 3, 3) of bodies that
        numbers (..., size) tell."""
        gyration, stack = np.sqrt(np.sum(self.root**2) / self.mass), theta.shape[:-1]
        m = self.mass * np.exp(theta[..., 0])
        if self.flat:
            c = np.zeros((*stack, 3), theta.dtype)
            c[...] = self.centre
            c[..., :2] += gyration * theta[..., 1:3]
            I = np.zeros((*stack, 3, 3), theta.dtype)  # noqa: E741
            I[..., 2, 2] = self.root[0, 0] ** 2 * np.exp(theta[..., 3])
            return m, c, I
        T = np.zeros((*stack, 3, 3), theta.dtype)
        T[..., *UPPER] = theta[..., 4:]
        T[..., *DIAGONAL] = np.exp(T[..., *DIAGONAL])
        S = self.root @ T
        Sigma = S @ np.swapaxes(S, -1, -2)
        trace = np.trace(Sigma, axis1=-2, axis2=-1)[..., None, None]
        return m, self.centre + gyration * theta[..., 1:4], trace * np.eye(3) - Sigma

    def moments(self, theta: np.ndarray) -> np.ndarray:
        """Return mass, first moments and inertia about the frame's origin (..., 10), as the
        regressor has them, of bodies that numbers (..., size) tell."""
        m, c, I = self.parts(theta)  # noqa: E741
        m, square = m[..., None], np.sum(c * c, -1)[..., None, None]
        I_O = I + m[..., None] * (square * np.eye(3) - c[..., None] * c[..., None, :])
        if self.flat:
            I_O = I_O * np.diag([0.0, 0.0, 1.0])
        rows, columns = np.array([["xyz".index(axis) for axis in name] for name in NAMES]).T
        return np.concatenate([m, m * c, I_O[..., rows, columns]], -1)

    def body(self, theta: np.ndarray, like: Body) -> Body:
        """Return the body that numbers tell, with the shapes of another."""
        m, c, I = self.parts(np.asarray(theta, float))  # noqa: E741
        x, y, z = map(float, c)
        return Body(
            mass=float(m),
            centre_of_mass=(x, y, z),
            inertia=inertia_of(I, self.flat),
            shapes=like.shapes,
        )


def inertia_of(tensor: np.ndarray, flat: bool) -> Inertia:
    """Return an inertia (3 x 3) as a description holds it."""
    names = ("zz",) if flat else NAMES
    own = {name: float(tensor["xyz".index(name[0]), "xyz".index(name[1])]) for name in names}
    return Inertia(**own)  # pyright: ignore[reportArgumentType]


def fitted(
    residual: Callable[[np.ndarray], np.ndarray], spread: float, lower: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return theta of the least squares of residuals and of theta / spread, its covariance, and the
    slopes of the residuals there (rows, size); derivatives by complex steps.

    Small noise makes a narrow, bent valley of them: where its floor is not found at once, it is
    followed from wide to narrow, the residuals weighing more and more.

    residual: of one theta (size) or a stack of them, (..., size) -> (..., rows); lower: least
        values of theta (size)

    Warns:
        ModelWarning: least squares that are not found.
    """
    found = least(residual, spread, lower, np.zeros(lower.size), MOST)
    if not settled(found, 1.0, lower):
        theta = np.zeros(lower.size)
        for weight in GRADUATED:
            found = least(lambda x, w=weight: w * residual(x), spread, lower, theta, PATIENT)
            theta = found.x
    if not settled(found, 1.0, lower):
        warnings.warn(
            f"the masses that fit best are not found in {PATIENT} steps, and these only come near "
            "them; measure a motion that tells more, or give another spread",
            ModelWarning,
            stacklevel=5,
        )
    J = found.jac
    _, values, Vt = np.linalg.svd(J, full_matrices=False)
    W = Vt.T / np.maximum(values, 1 / spread)  # rounding of large ones hides the small ones
    return found.x, W @ W.T, J[: -lower.size]


def least(
    residual: Callable[[np.ndarray], np.ndarray],
    spread: float,
    lower: np.ndarray,
    start: np.ndarray,
    most: int,
) -> OptimizeResult:
    """Return the least squares of residuals and of theta / spread that are found from a start, with
    so many evaluations at most."""
    from scipy.optimize import least_squares

    def every(theta: np.ndarray) -> np.ndarray:
        return np.concatenate([residual(theta), theta / spread], -1)

    def slopes(theta: np.ndarray) -> np.ndarray:
        steps = theta + 1j * STEP * np.eye(theta.size)
        return np.imag(every(steps)).T / STEP

    return least_squares(
        every,
        start,
        jac=slopes,  # pyright: ignore[reportArgumentType]
        bounds=(lower, np.inf),
        x_scale=1.0,
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=TOLERANCE,
        max_nfev=most,
    )


@announced("finding possible masses")
def possible(identification: Identification, *, spread: float = 1.0) -> Mechanism:
    """Return the description with masses and moments that bodies can have, as near as these come to
    identified base parameters.

    Args:
        identification: of `identify`, of masses alone or with friction and rotors, which are not
            below zero.
        spread: how far what the motions do not tell may lie from what is described: standard
            deviation of logarithms of masses and moments, and of mass centres over radii of
            gyration.

    Returns:
        A `Mechanism` in which every body has a mass above zero and an inertia that is positive
        definite and keeps the triangle inequality.

    Raises:
        LinkworkError: what is no identification; a spread that is not above zero.
    """
    if not isinstance(identification, Identification):
        raise LinkworkError(f"this is {shown(identification)}; give what analysis.identify returns")
    positive(spread, "spread")
    base = identification.base
    robot, names = base.regressor.robot, base.regressor.names
    mechanism = robot.mechanism
    # Bodies about which others are sought, and effects of joints beside them.
    whole = sum(body.mass for body in mechanism.bodies.values())
    length = robot.equations.tree.length
    bodies = {
        name: PossibleBody.of(body, whole or 1.0, length) for name, body in mechanism.bodies.items()
    }
    ends = np.cumsum([each.size for each in bodies.values()])
    effects = base.regressor.described[len(bodies) * len(OF_BODIES) :]
    size = int(ends[-1])

    def pi(theta: np.ndarray) -> np.ndarray:
        parts = zip(bodies.values(), np.split(theta[..., :size], ends[:-1], -1), strict=True)
        own = [each.moments(part) for each, part in parts]
        return np.concatenate([*own, effects + scales * theta[..., size:]], -1)

    # Effects over what is described, or over what alone would make the forces, where one is told.
    columns = np.linalg.norm(
        identification.root @ base.combination[:, len(bodies) * len(OF_BODIES) :], axis=0
    )
    every = np.linalg.norm(identification.root @ identification.values)
    scales = np.maximum(WIDE * effects, every / np.where(columns > 0, columns, np.inf))
    scales[scales == 0] = 1.0
    found, *_ = fitted(
        lambda theta: (
            (identification.values - pi(theta) @ base.combination.T) @ identification.root.T
        ),
        spread,
        np.concatenate([np.full(size, -np.inf), -effects / scales - 1e-300]),
    )
    # Back into the description.
    parts = np.split(found[:size], ends[:-1])
    made = {
        name: each.body(part, mechanism.bodies[name])
        for (name, each), part in zip(bodies.items(), parts, strict=True)
    }
    kept = {path: text for path, text in mechanism.formulas.items() if path[:7] != "bodies."}
    other = mechanism.model_copy(update={"bodies": made, "formulas": kept})
    of_joints = names[len(bodies) * len(OF_BODIES) :]
    change = dict(zip(of_joints, (scales * found[size:]).tolist(), strict=True))
    return edited(other, effects_after(other, change))


def effects_after(mechanism: Mechanism, change: Mapping[str, float]) -> dict[str, float]:
    """Return the effects of joints after changes, by path, none below zero: viscous friction is
    told with the damper beside it, which gives what that lacks."""
    found = {}
    for path, x in change.items():
        value = located(mechanism, path)[1] + x
        found[path] = max(value, 0.0)
        joint, _, freedom = path.rpartition(".viscous")[0].rpartition(".friction")
        if joint and value < 0:
            damper = f"{joint}.spring{freedom}.damping"
            found[damper] = max(located(mechanism, damper)[1] + value, 0.0)
    return found


@dataclass(frozen=True, eq=False)
class EstimatedPayload:
    """Hold a payload that was told by forces.

    robot: that carries it, without it; tool: name
    mass [kg]; centre_of_mass: in the tool's frame [m]; inertia: about it, in the tool's axes
    deviation: standard deviation of the mass [kg]; centre_deviations: of the mass centre (3), in
        the body's axes [m]; infinite where the forces do not tell it, and the guess decides
    """

    robot: Robot
    tool: str
    mass: float
    centre_of_mass: tuple[float, float, float]
    inertia: Inertia
    deviation: float
    centre_deviations: np.ndarray

    @property
    def mechanism(self) -> Mechanism:
        """The description with the payload."""
        return self.robot.mechanism.with_payload(
            self.mass, self.centre_of_mass, self.inertia, self.tool
        )

    def __repr__(self) -> str:
        x, y, z = self.centre_of_mass
        untold = "" if np.isfinite(self.centre_deviations).all() else ", a guess in part"
        return (
            f"EstimatedPayload({self.mass:.6g} +- {self.deviation:.2g} kg at ({x:.4g}, {y:.4g}, "
            f"{z:.4g}) m of tool {self.tool!r}{untold})"
        )


@announced("estimating the payload")
def payload(
    robot: Robot, measured: Measured | Run, *, tool: str | None = None, spread: float = 3.0
) -> EstimatedPayload:
    """Estimate what a tool carries from a measured motion and its forces.

        S' u - (what the robot needs without it) = Y_tool pi + noise

    Mass, mass centre and inertia are possible ones (`possible_inertia`).

    Args:
        robot: without the payload, its masses and friction as they are; of a run, with the values
            that free numbers which are none of bodies had in it.
        measured: a motion with its forces, or a run.
        tool: name of the tool; the first if left out.
        spread: how far what the motion does not tell may lie from a guess (a small solid at the
            tool, of the mass that the forces tell).

    Raises:
        LinkworkError: no tool, or one on the ground; forces that tell no mass above zero; a run
            with other values of numbers that are not free, and none of bodies.

    Warns:
        ModelWarning: a sample does not fit in with the others.
    """
    # The forces that are left, row by row in the rates' own units.
    robot = as_measured(robot, measured)
    data = motion_of(robot, measured)
    robot.require_tool()
    positive(spread, "spread")
    name = next(iter(robot.mechanism.tools)) if tool is None else tool
    if not among(name, robot.mechanism.tools):
        known = ", ".join(robot.mechanism.tools)
        raise LinkworkError(f"there is no tool {shown(name)}; the tools are {known}")
    held = robot.mechanism.tools[name]
    if held.body not in robot.mechanism.bodies:
        raise LinkworkError(f"the tool is on {held.body!r}, which does not move; choose another")
    # What is left when the described robot is taken off, by the numbers of the tool's body.
    regressor = regressor_of(robot)
    states, n = data.states, robot.mobility
    Y, known_part = regressor.with_known(states, data.accelerations)
    applied = np.einsum("kan,ka->kn", robot.actuation(states), data.forces)
    own = own_rates(robot, states)
    left = own * (applied - known_part - Y @ regressor.described)
    place = robot.bodies.index(held.body) * len(OF_BODIES)
    Y = own[..., None] * Y[..., place : place + len(OF_BODIES)]
    right, rows = left.T.ravel(), np.swapaxes(Y, 0, 1).reshape(left.size, -1)
    if right.size <= len(OF_BODIES):
        raise LinkworkError(
            f"{right.size} measured forces do not tell a payload; measure more samples"
        )
    # Noise of each rate, and a guess: the mass that a point at the tool has to have. Of numbers in
    # the mechanism's own length some may be told by none.
    own_rows = rows * robot.equations.tree.length ** np.repeat([0, 1, 2], [1, 3, 6])
    best, _, rank, _ = np.linalg.lstsq(own_rows, right, rcond=1e-10)
    across = np.linalg.svd(own_rows, full_matrices=False)[2][rank:]
    freedom = right.size / (right.size - rank)
    remains = (right - own_rows @ best).reshape(n, -1)
    noise = np.sqrt(freedom * np.mean(remains**2, axis=1))
    noise = np.maximum(noise, 1e-9 * max(float(np.abs(right).max()), 1e-300))
    weights = np.repeat(1 / noise, len(right) // n)
    if left_over(remains, right):
        U = np.linalg.svd(weights[:, None] * own_rows, full_matrices=False)[0][:, :rank]
        even = weights * right
        warned_by_rates((even - U @ (U.T @ even)).reshape(n, -1), U, stacklevel=3)
    # A point at the tool with a small radius of gyration, as heavy as fits best.
    flat = robot.mechanism.bodies[held.body].inertia.planar
    at, gyration = np.array(held.frame.position), 0.05 * robot.equations.tree.length
    root = np.diag([gyration, 0.0, 0.0]) if flat else gyration / np.sqrt(3) * np.eye(3)
    unit = rows @ PossibleBody(1.0, at, root, flat).moments(np.zeros(FLAT if flat else SPATIAL))
    weighed = weights * unit
    mass = float(weighed @ (weights * right) / max(float(weighed @ weighed), 1e-300))
    if not mass > 0 and np.linalg.norm(across[:, 0]) < UNTOLD:  # far away, and told by itself
        mass = float(best[0])
    if not mass > 0:
        raise LinkworkError(
            "the forces tell no mass above zero at the tool; check the signs of the forces, and "
            "the robot without payload"
        )
    guess = PossibleBody(mass, at, np.sqrt(mass) * root, flat)
    theta, covariance, slopes = fitted(
        lambda theta: weights * (right - guess.moments(theta) @ rows.T),
        spread,
        np.full(guess.size, -np.inf),
    )
    # In the tool's frame.
    m, c, tensor = guess.parts(theta)
    R = rotation(held.frame)
    x, y, z = map(float, R.T @ (c - at))
    turned = R.T @ tensor @ R
    inertia = inertia_of(turned, flat)
    size = np.sqrt(np.sum(guess.root**2) / guess.mass)
    spreads = np.where(told(slopes, spread), np.sqrt(np.diagonal(covariance)), np.inf)
    centre = size * np.append(spreads[1:3], 0.0) if flat else size * spreads[1:4]
    return EstimatedPayload(
        robot, name, float(m), (x, y, z), inertia, float(m * spreads[0]), centre
    )


def told(slopes: np.ndarray, spread: float) -> np.ndarray:
    """Return which numbers (size) residuals of these slopes (rows, size) tell by themselves: those
    that are in no direction which the spread holds more firmly."""
    _, values, directions = np.linalg.svd(np.linalg.qr(slopes, mode="r"))
    found = np.zeros(len(directions))
    found[: values.size] = values
    left = directions[found * spread < 1]
    return np.linalg.norm(left, axis=0) < UNTOLD
