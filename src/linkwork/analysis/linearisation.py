"""Linearisation: how a robot moves near a state, exact along the constraint manifold
(`linkwork.equations.linear`).

    xi' = Gamma xi + dv,     dv' = f_q S xi + f_v dv + f_u du

xi are small shifts of the independent joints. At rest, with v' = 0, the same derivatives give
stiffness and natural modes:

    K = -d(S' u - G + f)/d xi        M phi omega^2 = K phi

Source: Meirovitch 2001, Fundamentals of Vibrations, ch. 7 (natural modes).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from linkwork.analysis.actuated_coordinates import with_coordinate
from linkwork.checks import amount, needed, shown
from linkwork.equations.fluid import in_wind
from linkwork.errors import LinkworkError
from linkwork.model import checks
from linkwork.model.linear import (
    actuator_forces,
    at_rest,
    evaluated,
    holding_forces,
    largest,
    own_rates,
)
from linkwork.robot import Robot, State

if TYPE_CHECKING:
    import xarray

SHOWN = 8  # names and numbers in a repr
AT_REST = 1e-9  # rate, relative to those of the motions that weight and stiffness cause
BALANCED = 1e-6  # acceleration, relative to those of weight and stiffness
INDIFFERENT = 1e-12  # square of a frequency, relative to the largest, and to that of weight


class NoEquilibriumError(LinkworkError):
    """Tell that forces do not hold a state."""


@dataclass(frozen=True, eq=False)
class NaturalModes:
    """Hold the small undamped vibrations about an equilibrium.

    frequencies: omega / 2 pi [Hz], lowest first; imaginary parts of unstable directions are given
        as negative numbers
    shapes: (n, modes) of the independent coordinates, of unit modal mass, phi' M phi = 1
    joints: (m, modes) the same in the rates of all joints, in the order of `rates`
    M, K: inertia and stiffness in the independent coordinates
    independent, rates: names
    """

    frequencies: np.ndarray
    shapes: np.ndarray
    joints: np.ndarray
    M: np.ndarray
    K: np.ndarray
    independent: tuple[str, ...]
    rates: tuple[str, ...]

    def __repr__(self) -> str:
        lowest = ", ".join(f"{value:.5g}" for value in self.frequencies[:SHOWN])
        more = " ..." * (len(self.frequencies) > SHOWN)
        return f"NaturalModes({amount(len(self.frequencies), 'mode')}: {lowest} Hz{more})"

    @property
    def stable(self) -> bool:
        """Tell whether the potential energy has a minimum there."""
        return bool((self.frequencies > 0).all())

    @property
    def dataset(self) -> xarray.Dataset:
        """Return frequencies and shapes by name."""
        import xarray

        return xarray.Dataset(
            {
                "frequency": (("mode",), self.frequencies, {"units": "Hz"}),
                "shape": (("rate", "mode"), self.joints, {"long_name": "shape of unit modal mass"}),
            },
            {"mode": np.arange(1, len(self.frequencies) + 1), "rate": list(self.rates)},
        )


def natural_modes(
    robot: Robot, state: State, forces: ArrayLike | Mapping[str, float] | None = None
) -> NaturalModes:
    """Return natural frequencies and mode shapes about an equilibrium: K phi = omega^2 M phi,
    dampers left out.

    Args:
        robot: at the present values of its free numbers.
        state: one state at rest; forces: the actuator forces that hold it; the least ones that do
            if left out, none without actuators.

    Raises:
        LinkworkError: a state that moves, or that the forces do not hold; wind, thrust or moments
            of ball joints that leave the stiffness without symmetry.
    """
    needed(robot, Robot)
    from scipy.linalg import eigh

    u = holding_forces(robot, state) if forces is None else actuator_forces(robot, forces)
    M, K = robot.mass_matrix(state), stiffness_matrix(robot, state, u)
    squares, shapes = eigh((K + K.T) / 2, M)
    units = own_rates(robot, state)
    parts = (
        np.linalg.solve(M, np.stack([robot.gravity(state), robot.passive_forces(state)], axis=1))
        / units[:, None]
    )
    usual = max(of_weight(robot), largest(parts), largest(squares))
    if largest(state.rates / units) > AT_REST * np.sqrt(usual):
        raise LinkworkError(
            "natural modes are those about an equilibrium, but the state moves; set its rates "
            "to zero"
        )
    residual = robot.forward_dynamics(state, u)
    if largest(residual / units) > BALANCED * usual:
        raise NoEquilibriumError(
            "the state is no equilibrium under these forces: it accelerates by "
            f"{largest(residual):.3g}; find one by analysis.equilibrium, or give the forces that "
            "hold it"
        )
    refuse_circulation(robot, state, M, K, usual)
    squares = without_rounding(robot, squares)
    frequencies = np.sign(squares) * np.sqrt(np.abs(squares)) / (2 * np.pi)
    joints = robot.rate_map(state) @ shapes
    return NaturalModes(frequencies, shapes, joints, M, K, state.independent, robot.rates)


def refuse_circulation(
    robot: Robot, state: State, M: np.ndarray, K: np.ndarray, usual: float
) -> None:
    """Refuse a stiffness without symmetry: wind, thrust, and moments about no fixed axis have no
    potential.

    usual: size of M^-1 K [1/s^2]
    """
    units = own_rates(robot, state)
    skew = np.linalg.solve(M, (K - K.T) / 2) * units / units[:, None]
    led = {*robot.actuators} - {*with_coordinate(robot)}
    windy = in_wind(robot.mechanism)
    if (windy or led) and largest(skew) > BALANCED * usual:
        where = "in the fluid's wind" if windy else f"under what {', '.join(sorted(led))} exert"
        raise LinkworkError(
            f"natural modes are those of forces with a potential, but {where} the stiffness is not "
            "symmetric here; take the poles of robot.linearise(state)"
        )


def of_weight(robot: Robot) -> float:
    """Return the square of the frequency [1/s^2] that weight gives over the own length."""
    return float(np.linalg.norm(robot.mechanism.gravity)) / robot.equations.tree.length


def without_rounding(robot: Robot, squares: np.ndarray) -> np.ndarray:
    """Return squares of frequencies with those at zero that rounding may have made of none."""
    none = np.abs(squares) < INDIFFERENT * max(of_weight(robot), largest(squares))
    return np.where(none, 0.0, squares)


def stiffness_matrix(
    robot: Robot, state: State, forces: ArrayLike | Mapping[str, float] | None = None
) -> np.ndarray:
    """Return K (n x n) = -d(S' u - G + f)/d xi of a state at rest: springs, weight and constant
    actuator forces.

    It is symmetric where the forces are in equilibrium.

    robot: at the present values of its free numbers; state: one at rest; forces: u of the actuators
    (actuators) [N, N m], or by name (others zero); zero if left out.
    """
    needed(robot, Robot)
    needed(state, State)
    return evaluated(robot, at_rest(state), actuator_forces(robot, forces))["K"]


def tool_stiffness(
    robot: Robot,
    state: State,
    stiffness: Mapping[str, float],
    *,
    forces: ArrayLike | Mapping[str, float] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the stiffness and the compliance at the tool that the stiffnesses of joints give.

        C_x = T (L' k L + K)^-1 T',   K_x = C_x^-1 where the tool can be moved in all its directions

    Args:
        state: one state; the tool is the robot's first.
        stiffness: k of joint rates by name [N/m, N m/rad], of actuators or any other joints; the
            others are rigid only where the loops make them so.
        forces: actuator forces, to add what weight, springs and these forces themselves do (K);
            left out: K = 0.

    Returns:
        K_x and C_x (6 x 6), for (rotation, translation) of the tool and wrenches (moment, force)
        about it, in the axes of the ground, or of the body that it is relative to [N m/rad, N, N/m
        and their inverses]. K_x is the pseudo-inverse of C_x in the mechanism's own length:
        stiffness in directions in which the tool cannot move is not told.

    Raises:
        LinkworkError: unknown joints, negative stiffness, joints that leave the robot loose.
    """
    needed(robot, Robot)
    needed(state, State)
    if not isinstance(stiffness, Mapping):
        raise LinkworkError(
            f"the stiffnesses are {shown(stiffness)}; give them by name, such as "
            f"{{'{robot.rates[0]}': 1e5}}"
        )
    checks.known(stiffness, robot.rates, "rate")
    for name, value in stiffness.items():
        if checks.number(value, f"the stiffness of {name!r}") < 0:
            raise LinkworkError(
                f"the stiffness of {name!r} is {value}; give a number not below zero"
            )
    robot.require_tool()
    values = evaluated(robot, at_rest(state), actuator_forces(robot, forces))
    rows = values["L"][[robot.rates.index(name) for name in stiffness]]
    K = rows.T @ (np.array([float(value) for value in stiffness.values()])[:, None] * rows)
    K = K + (values["K"] if forces is not None else 0)
    units = own_rates(robot, state)
    sigma = np.linalg.svd(K * units * units[:, None], compute_uv=False)
    if not sigma[-1] > 1e-12 * max(sigma[0], 1e-300):
        raise LinkworkError(
            f"the stiffnesses of {', '.join(stiffness) or 'no joint'} leave the robot loose; "
            "give more"
        )
    T = values["T_tool"]
    compliance = T @ np.linalg.solve(K, T.T)
    own = np.repeat([1.0, robot.equations.tree.length], 3)
    own = own * own[:, None]
    # Forces out of equilibrium, or in wind, leave both without symmetry.
    even = forces is None
    return np.linalg.pinv(compliance / own, rcond=1e-12, hermitian=even) / own, compliance
