"""Static equilibrium: where a robot stays at rest under constant actuator forces, and the forces
that hold it.

    S' u - G + f = 0,    f: springs

is solved for the configuration by Newton's method along the constraint manifold, with the exact
stiffness K (`linearisation`). Where K is not positive, the step goes downhill along -r of the
eigenvectors' stiffnesses |k_i|, so that from a rough guess the potential energy falls and a stable
equilibrium is found; unstable ones are found from near.

Redundant actuators share what is needed: of all u with S' u = f_needed within bounds, that of least
sum w_i u_i^2:

    u = u_0 + N z,    min |z|,    lower <= u_0 + N z <= upper

with u_0 the unbounded solution and N orthonormal internal forces (in sqrt(w) u): a least distance
problem, which a non-negative least-squares problem solves exactly, or shows to be without solution.
Source: Lawson & Hanson 1974, Solving Least Squares Problems, ch. 23.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from linkwork.analysis.actuated_coordinates import actuated_coordinates, with_coordinate
from linkwork.analysis.newton import random_configurations, solver
from linkwork.analysis.square import of_joints
from linkwork.checks import MOST, count, needed, random_numbers, reals, shown, switch
from linkwork.equations.fluid import in_wind
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.model import checks, closing
from linkwork.model.evaluation import internal_forces, of_actuators
from linkwork.model.linear import (
    actuator_forces,
    at_rest,
    evaluated,
    largest,
    one_state,
    own_rates,
    weight,
)
from linkwork.model.spread import extent
from linkwork.patience import announced
from linkwork.robot import Robot, State

ROUNDS, NEWTON = 200, 60  # steps to an equilibrium, and Newton's that close a random configuration
BALANCED = 1e-10  # energy of what stays unbalanced, relative to what balances each other
LONGEST = 0.3  # shift, in the mechanism's own units
WEAK = 0.03
CLOSED, OPEN = 1e-13, 1e-9  # gaps of loops, in own units, that are none, and that are not closed
SAME = 1e-6  # difference of poses that counts as none, lengths relative to the mechanism's own


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Hold an equilibrium.

    state: at rest; forces: u of the actuators [N, N m]
    stiffness: K (n x n) in the coordinates of the state's `independent`; symmetric, but in wind and
        under thrust or moments of ball joints
    residual: largest unbalanced force [N, N m]; stable: whether K is positive definite; where it is
        not symmetric, whether its symmetric part is: the poles of `robot.linearise(state, forces)`
        tell more there
    indifferent: whether K is zero along some direction, along which there may be a continuum of
        equilibria, of which this is one
    """

    state: State
    forces: np.ndarray
    stiffness: np.ndarray
    residual: float
    stable: bool
    indifferent: bool = False


def equilibrium(
    robot: Robot,
    forces: ArrayLike | Mapping[str, float] | None = None,
    *,
    guess: State | None = None,
    stable: bool = True,
) -> Equilibrium:
    """Find a configuration that stays at rest under constant actuator forces.

    Without forces this is a pose in which weight and springs balance each other.

    Args:
        robot: with actuators or without.
        forces: u (actuators) [N, N m], or by name (others zero); zero if left out.
        guess: where to start; `home` if left out.
        stable: look for a stable equilibrium, downhill from the guess; if not, for the nearest one
            of any kind. In the wind of a fluid, and under thrust or moments of ball joints, whose
            forces have no potential, downhill may lead nowhere.

    Raises:
        LinkworkError: no equilibrium is found from this guess.
    """
    needed(robot, Robot)
    switch(stable, "stable")
    u = actuator_forces(robot, forces)
    state = at_rest(robot.home if guess is None else robot.own(guess))
    one_state(robot, state)
    return balanced(robot, u, state, stable, [])


def balanced(
    robot: Robot, u: np.ndarray, state: State, stable: bool, known: list[tuple[str, ...]]
) -> Equilibrium:
    """Return the equilibrium that a search from a state at rest ends in.

    Args:
        robot, stable: as in `equilibrium`; u: of the actuators [N, N m].
        known: independent rates of charts that are derived, which are taken where they are good; to
            be added to.
    """
    last = np.inf
    for _ in range(ROUNDS):
        with checks.at("on the way to an equilibrium: "):
            state = in_good_rates(robot, state, known)
            force, K = unbalanced(robot, state, u)
            units = own_rates(robot, state)
            r, K_own = force * units, K * units * units[:, None]
            held = scale(robot, state, u)
            E = max(held, largest(K_own))
            # Beside stiff contacts the forces are balanced only by a step more.
            steady = largest(r) <= BALANCED * E and (not stable or settled(K_own, E))
            if steady and (largest(r) <= BALANCED * held or not largest(r) < last / 2):
                kinds = positive(K_own), indifferent(K_own, E)
                return Equilibrium(state, u, K, largest(force), *kinds)
            last = largest(r)
            free = [name not in robot.coordinates for name in state.independent]
            xi = step(r, K_own, E, stable, largest(r[free])) * units
            state = moved(robot, state, u, xi, E, stable)
    worst = int(np.argmax(np.abs(r)))
    other = "choose another guess, or other forces"
    if stable and in_wind(robot.mechanism):
        other = "in the fluid's wind, which has no potential, take stable=False"
    elif stable and (led := {*robot.actuators} - {*with_coordinate(robot)}):
        other = f"what {', '.join(sorted(led))} exert has no potential; take stable=False"
    raise LinkworkError(
        f"no {'stable ' if stable else ''}equilibrium is found from this guess: "
        f"{abs(force[worst]):.3g} stays unbalanced on {state.independent[worst]}; {other}"
    )


@announced("searching for equilibria")
def equilibria(
    robot: Robot,
    forces: ArrayLike | Mapping[str, float] | None = None,
    *,
    starts: int = 50,
    seed: int = 0,
) -> list[Equilibrium]:
    """Find equilibria under constant actuator forces from random configurations, stable ones first.

    There may be others, which more `starts` or another `seed` may lead to: nothing tells that all
    are found. Of a continuum of them some points are found, which is warned of.

    Args:
        robot: any; forces: u of the actuators [N, N m], or by name (others zero); zero if left out.
        starts: number of random configurations of the independent joints, each on the branch that
            is found first; closed the shortest way where these do not reach it.
        seed: of the random configurations.

    Warns:
        ModelWarning: some that are found may be points of a continuum.
    """
    needed(robot, Robot)
    u = actuator_forces(robot, forces)
    begun = closed_anywhere(robot, count(starts, "starts", MOST), random_numbers(seed))
    known, found = list[tuple[str, ...]](), list[Equilibrium]()
    for start in (robot.equations.reference, *begun):
        for stable in (True, False):
            try:
                state = robot.make_state(start, np.zeros(robot.mobility))
                one = balanced(robot, u, state, stable, known)
            except (LinkworkError, np.linalg.LinAlgError):
                continue
            if not any(alike(robot, one.state, other.state) for other in found):
                found.append(one)
    if (loose := sum(one.indifferent for one in found)) > 0:
        warnings.warn(
            f"{loose} of the {len(found)} equilibria that are found are indifferent: along some "
            "direction nothing holds them, so that each may be a point of a continuum",
            ModelWarning,
            stacklevel=3,
        )
    return sorted(found, key=lambda one: not one.stable)


def closed_anywhere(robot: Robot, starts: int, random: np.random.Generator) -> np.ndarray:
    """Return closed configurations (N, nq) from random ones, at most so many."""
    length = extent(robot.mechanism, robot.chart, robot.home.q)
    begun = random_configurations(robot, length, starts, random)
    names = tuple(name for name in robot.independent if name in robot.coordinates)
    q, good = begun.copy(), np.zeros(starts, bool)
    if len(names) == robot.mobility:  # else free turns are among them, which none asks for
        places = [robot.coordinates.index(name) for name in names]
        asked = robot.kernel("positions")(begun)[0][:, places]
        q, good = solver(of_joints(robot, names)).solve(begun, asked, NEWTON)
    # What these joints do not reach is closed the shortest way: arcs on which they hardly turn.
    left, none = begun[~good], np.zeros((np.count_nonzero(~good), 0))
    least = robot.least(robot.joints_asked(())).step
    closed = closing.closed(least, left, (none,), NEWTON, contracting=False)
    q[~good], good[~good] = closed.q, closed.met & (closed.told[0] >= 0)
    return q[good]


def in_good_rates(robot: Robot, state: State, known: list[tuple[str, ...]]) -> State:
    """Return the state in independent rates that determine the motion well there: in its own, in
    known ones, or in others, which are then known."""
    for independent in (state.independent, *known):
        if abs(robot.charts[independent].pivot(state.q)) > WEAK:
            own = independent == state.independent
            return state if own else robot.in_chart(state, independent)
    state = robot.in_chart(state, robot.chart.better(state.q, ()).independent)
    known.append(state.independent)
    return state


def alike(robot: Robot, one: State, other: State) -> bool:
    """Tell whether all bodies are in the same poses."""
    poses = (robot.body_poses(one), robot.body_poses(other))
    sizes = (robot.equations.tree.length, 1.0)
    return all(
        np.allclose(a / size, b / size, atol=SAME)
        for name in poses[0]
        for a, b, size in zip(poses[0][name], poses[1][name], sizes, strict=True)
    )


def unbalanced(robot: Robot, state: State, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unbalanced forces S' u - G + f (n), and the stiffness K (n x n)."""
    values = evaluated(robot, state, u)
    return values["force"][:, 0], values["K"]


def scale(robot: Robot, state: State, u: np.ndarray) -> float:
    """Return the size [J] of what balances each other in the mechanism's own units."""
    units = own_rates(robot, state)
    driven = u * [
        robot.equations.tree.length if robot.unit(name) == "m" else 1.0 for name in robot.actuators
    ]
    parts = (robot.gravity(state) * units, robot.passive_forces(state) * units, driven)
    return max(weight(robot), *map(largest, parts))


def step(r: np.ndarray, K: np.ndarray, E: float, downhill: bool, turned: float = 0.0) -> np.ndarray:
    """Return the shift xi that balances r: K xi = r; downhill with the absolute values of the
    eigenvalues of K.

    All are in the mechanism's own units; E is the size of what balances each other [J].
    Directions without stiffness are left alone where nothing pushes along them. turned: the largest
    unbalanced moment [J] on free turns, whose axes turn along: K has a part of that size which is
    no stiffness, and would lead about axes that nothing holds.
    """
    if not downhill:
        return np.linalg.lstsq(K, r, rcond=1e-12)[0]
    values, vectors = np.linalg.eigh((K + K.T) / 2)
    along = vectors.T @ r
    flat, level = 1e-6 * E, np.abs(values) <= 1e-9 * np.abs(values).max(initial=E)
    along = np.where(level & (np.abs(along) <= BALANCED * E), 0.0, along)
    hill = values < -np.maximum(1e-9 * np.abs(values).max(initial=0.0), turned)
    summit = hill & (np.abs(along) < flat)
    along = np.where(summit, np.abs(values) * LONGEST, along)  # at the top of a hill: leave it
    steepness = np.maximum(np.maximum(np.abs(values), turned), np.abs(along) / LONGEST)
    return vectors @ (along / np.where(steepness > 0, steepness, 1.0))


def moved(
    robot: Robot, state: State, u: np.ndarray, xi: np.ndarray, E: float, downhill: bool
) -> State:
    """Return the state after a shift, shortened until it closes and, downhill, the potential energy
    falls."""
    xi = xi * min(1.0, LONGEST / max(largest(xi / own_rates(robot, state)), 1e-300))
    before = potential(robot, state, u) if downhill else 0.0
    for _ in range(40):
        trial = shifted(robot, state, xi)
        if trial is not None and not downhill:
            return trial
        if trial is not None and potential(robot, trial, u) - before <= 1e-12 * max(E, abs(before)):
            return trial
        xi = xi / 2
    return state


def potential(robot: Robot, state: State, u: np.ndarray) -> float:
    """Return the potential energy of weight, springs and constant actuator forces [J]."""
    driven = [robot.actuators.index(name) for name in with_coordinate(robot)]
    return float(robot.energy(state)[1] - u[driven] @ actuated_coordinates(robot, state.q))


def shifted(robot: Robot, state: State, xi: np.ndarray) -> State | None:
    """Return the closed state at a shift of the independent joints; None where it does not close
    nearby."""
    chart = robot.chart_of(state)
    w = chart.tree_rates(state.q, xi)
    q = robot.assembler.moved(state.q, w)
    q, gap = closing.settled(chart.kernel("closure_step"), q, chart.p, CLOSED)
    tree = robot.equations.tree
    if gap > OPEN or largest((q - state.q) / tree.units) > 10 * max(
        largest(w / tree.rate_units), 1e-9
    ):
        return None
    (positions,) = robot.kernel("positions")(q)
    return State.known(positions, state.rates, q, state.coordinates, state.independent)


def settled(K: np.ndarray, E: float) -> bool:
    """Tell whether no direction is unstable; E: the size of what balances each other [J]."""
    values = np.linalg.eigvalsh((K + K.T) / 2)
    return bool(values.min(initial=0.0) >= -1e-9 * np.abs(values).max(initial=E))


def indifferent(K: np.ndarray, E: float) -> bool:
    """Tell whether some direction has no stiffness; E: the size of what balances each other [J]."""
    values = np.abs(np.linalg.eigvalsh((K + K.T) / 2))
    return bool((values <= 1e-9 * values.max(initial=E)).any())


def positive(K: np.ndarray) -> bool:
    values = np.linalg.eigvalsh((K + K.T) / 2)
    return bool(values.min(initial=np.inf) > 1e-9 * np.abs(values).max(initial=0.0))


def distributed_forces(
    robot: Robot,
    state: State,
    accelerations: ArrayLike,
    *,
    lower: ArrayLike | Mapping[str, float] = -np.inf,
    upper: ArrayLike | Mapping[str, float] = np.inf,
    weights: ArrayLike | Mapping[str, float] | None = None,
) -> np.ndarray:
    """Return actuator forces within bounds that give accelerations, of least weighted norm.

    Args:
        robot: with as many actuators as freedoms, or more.
        state: one state; accelerations: v' (n) [m/s^2, rad/s^2] in the order of its `independent`.
        lower, upper: bounds of the forces [N, N m]: one number, one each, or by name; cables pull
            only: lower=0.
        weights: of the actuators (positive), in their order or by name; all 1 if left out.

    Returns:
        u (actuators) [N, N m] with S' u = M v' + C v + G - f and lower <= u <= upper.

    Raises:
        LinkworkError: bounds within which no forces give these accelerations; directions that no
            actuator drives.
    """
    needed(robot, Robot)
    one_state(robot, state)
    # Bounds that leave room.
    low, high = bound(robot, lower, "the lower bounds"), bound(robot, upper, "the upper bounds")
    if not (low <= high).all():
        k = int(np.argmax(~(low <= high)))
        raise LinkworkError(
            f"the bounds of {robot.actuators[k]!r} are {low[k]:g} and {high[k]:g}; the lower one "
            "is not below"
        )
    # The least forces of all do where they lie within the bounds.
    u = np.asarray(robot.inverse_dynamics(state, accelerations, weights=weights))
    if ((u >= low) & (u <= high)).all():
        return u
    # Else the least change of them by internal forces, which do not act on the motion.
    W = None if weights is None else of_actuators(robot, weights)
    internal = internal_forces(robot, state, W)  # u = internal z, |z| = |root u|
    G = np.vstack([internal[np.isfinite(low)], -internal[np.isfinite(high)]])
    h = np.concatenate([(low - u)[np.isfinite(low)], (u - high)[np.isfinite(high)]])
    z = least_distance(G, h)
    # No internal forces lead into the bounds: tell by how much they are missed most.
    if z is None:
        worst = int(np.argmax(np.maximum(low - u, u - high)))
        raise LinkworkError(
            "no forces within the bounds give these accelerations: without bounds "
            f"{robot.actuators[worst]!r} needs {u[worst]:.6g}; ask for less, or widen the bounds"
        )
    return np.clip(u + internal @ z, low, high)


def least_distance(G: np.ndarray, h: np.ndarray) -> np.ndarray | None:
    """Return the shortest z with G z >= h, None where there is none (Lawson & Hanson 1974,
    algorithm LDP)."""
    from scipy.optimize import nnls

    if not G.size:
        return None
    E = np.vstack([G.T, h])
    f = np.append(np.zeros(G.shape[1]), 1.0)
    y, _ = nnls(E, f)
    r = E @ y - f
    return -r[:-1] / r[-1] if np.linalg.norm(r) > 1e-9 else None


def bound(robot: Robot, values: ArrayLike | Mapping[str, float], what: str) -> np.ndarray:
    """Return bounds of all actuators (actuators), which may be infinite."""
    if isinstance(values, Mapping):
        checks.known(values, robot.actuators, "actuator")
        missing = [name for name in robot.actuators if name not in values]
        if missing:
            raise LinkworkError(
                f"{what} lack {', '.join(missing)}; give all of {', '.join(robot.actuators)}"
            )
        values = [values[name] for name in robot.actuators]
    array = reals(values)
    fits = array is not None and array.shape in ((), (len(robot.actuators),))
    if array is None or not fits or np.isnan(array).any():
        given = shown(values) if array is None else array.tolist()
        raise LinkworkError(f"{what} {given} do not fit; give one number, or one per actuator")
    return np.broadcast_to(array, len(robot.actuators)).copy()
