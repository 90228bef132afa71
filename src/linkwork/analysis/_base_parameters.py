"""Base parameters: the combinations of masses, moments, friction and rotors that a robot's motions
can tell.

    M v' + C v + G - f = Y(q, v, v') pi + r = Y_b beta + known,   beta = pi_b + B pi_d,  Y_d = Y_b B

Y is the regressor of the equations of motion (`linkwork.equations.regressor`). On random motions
its columns are taken in order: each that is no combination of the columns before it belongs to a
base parameter, and the others are added to those that they cannot be told from. Parameters that are
not asked for are known, as are springs (r).
Source: Khalil & Dombre 2002, Modeling, Identification and Control of Robots, ch. 12; Gautier, J.
Robotic Systems 8 (1991) 485-506 (base parameters by QR).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linkwork.checks import MOST, amount, count, needed, random_numbers
from linkwork.equations import regressor
from linkwork.equations.reference import unit
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.model import checks
from linkwork.model.closing import closed, of_any_length
from linkwork.model.linear import own_rates
from linkwork.patience import announced
from linkwork.robot import Robot, State

DEPENDENT = 1e-8  # singular value over the largest, above which none is rounding
FLOOR, GAP = 1e-15, 100.0  # rounding itself; least fall of singular values at the rank
NEGLIGIBLE = 1e-9
ROUNDING = 1e-6  # coefficients of columns of length 1 that are taken for zero
SPREAD = 1.0  # of random configurations, in own units: nearer, small parts are rounding
ROUNDS = 30
HALVINGS = 20  # of the spread, where loops do not close from it
STEPS = 20  # in which the reference is led to a configuration
LEAP, NEAR = 0.25, 1e-6  # in the mechanism's own units: too long a step, and where it has come to
TURN = 2 * np.pi
SHOWN, WIDE = 12, 76  # lines, and characters of a line, in a repr


@dataclass(frozen=True, eq=False)
class Regressor:
    """Evaluate Y for the parameters that are asked for, and what is known besides.

    names: of pi (k): "link.mass" [kg], "link.first_moment.x" .. [kg m] and
    "link.inertia_at_origin.xx" .. [kg m^2] about
        the origin of the body's frame, "joint.friction.viscous" [N s/m, N m s/rad],
        "joint.friction.coulomb" [N, N m], "joint.rotor_inertia" [kg, kg m^2]
    described: values in the description (k); places: among all parameters of the robot (k)
    """

    robot: Robot
    names: tuple[str, ...]
    described: np.ndarray
    places: np.ndarray

    def __call__(self, states: State, accelerations: np.ndarray) -> np.ndarray:
        """Return Y (..., n, k) at states in the home chart and accelerations (..., n)."""
        return self.with_known(states, accelerations)[0]

    def units(self, pace: float) -> np.ndarray:
        """Return the sizes (k) of the columns of Y in own units, for motions of a pace [1/s]."""
        return regressor.sizes(self.robot.mechanism, self.robot.equations.tree.length, pace)[
            self.places
        ]

    def with_known(self, states: State, accelerations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return Y (..., n, k), and what the motion needs besides Y pi (..., n) [N, N m]."""
        Y, rest, _ = self.robot.kernel("regressor")(states.q, states.rates, accelerations)
        values = regressor.values(self.robot.mechanism)
        Y = np.swapaxes(Y.reshape(*rest.shape[:-1], values.size, rest.shape[-1]), -1, -2)
        values[self.places] = 0.0
        return Y[..., self.places], rest + Y @ values


def regressor_of(robot: Robot, effects: Sequence[str] = ()) -> Regressor:
    """Return the regressor for the masses and moments of all bodies, and for named effects of
    joints.

    Args:
        robot: whose bodies and joints are meant.
        effects: friction and rotors to identify, named as in the description:
            "slide_1.friction.viscous", "slide_1.friction.coulomb", "slide_1.rotor_inertia".

    Raises:
        LinkworkError: unknown names, or one that is given twice.
    """
    require_no_bearings(
        robot.mechanism.joints,
        "what is linear in the parameters has not",
        "identify the robot without bearings",
    )
    names = regressor.names(robot.mechanism)
    bodies = names[: len(robot.bodies) * len(regressor.OF_BODIES)]
    effects = checks.names(effects, "effects")
    checks.known(effects, names[len(bodies) :], "effect")
    if again := [name for place, name in enumerate(effects) if name in effects[:place]]:
        raise LinkworkError(f"effects names {again[0]!r} twice; give it once")
    places = np.array([*range(len(bodies)), *(names.index(name) for name in effects)], int)
    return Regressor(robot, (*bodies, *effects), regressor.values(robot.mechanism)[places], places)


@dataclass(frozen=True, eq=False)
class Base:
    """Hold the base parameters beta = combination pi (r x k).

    columns: the places of pi_b in pi (r); names: the combinations, written out; described: beta of
    the description (r)
    """

    regressor: Regressor
    columns: np.ndarray
    combination: np.ndarray
    names: tuple[str, ...]

    def __repr__(self) -> str:
        pairs = zip(self.described, self.names, strict=True)
        lines = [f"{value:.6g}  {name}" for value, name in pairs]
        rest = [f"... and {len(lines) - SHOWN} more"] if len(lines) > SHOWN else []
        head = f"Base({amount(len(lines), 'base parameter')}, as described)"
        return "\n  ".join([head, *(line[:WIDE] for line in lines[:SHOWN]), *rest])

    def __len__(self) -> int:
        return len(self.names)

    @property
    def described(self) -> np.ndarray:
        return self.combination @ self.regressor.described

    @property
    def units(self) -> tuple[str, ...]:
        """Units of beta (r): of the first parameter in each."""
        of_all = np.array(regressor.units(self.regressor.robot.mechanism))
        return tuple(of_all[self.regressor.places][self.columns].tolist())


@announced("finding the base parameters")
def base_parameters(
    robot: Robot, effects: Sequence[str] = (), *, samples: int = 200, seed: int = 0
) -> Base:
    """Find the combinations of parameters that motions can tell: by the rank of Y on random
    motions.

    Their number is where singular values fall to rounding. Of a mechanism of a single freedom that
    many bodies share the last ones are small, 1e-8 of the forces near the reference, and take fast
    and wide motions to be identified.

    Args:
        robot: whose motions tell them.
        effects: as in `regressor_of`.
        samples: number of random closed configurations near the reference, on its assembly mode,
            rates and accelerations; seed: of these.

    Raises:
        LinkworkError: unknown names; a mechanism that nothing moves in; samples too few to tell how
            many base parameters there are.

    Warns:
        ModelWarning: singular values without a gap, so that rounding decides on the number.
    """
    needed(robot, Robot)
    made = regressor_of(robot, effects)
    states, accelerations = random_motions(robot, count(samples, "samples", MOST), seed)
    units = made.units(pace(robot))
    Y = alike(made(states, accelerations) * own_rates(robot, states)[:, None], units)
    size = np.linalg.norm(Y, axis=0)
    own = size / units
    seen = np.flatnonzero(own > NEGLIGIBLE * own.max(initial=0.0))
    if not seen.size:
        raise LinkworkError("no parameter can be seen: the motions need no forces")
    columns = Y[:, seen] / size[seen]
    kept = independent(columns)
    if len(kept) == len(columns):
        raise LinkworkError(
            f"samples is {samples}: these motions give {len(columns)} equations, not more than "
            "there are base parameters; give more samples"
        )
    found = np.linalg.lstsq(columns[:, kept], columns, rcond=None)[0]
    found = np.where(np.abs(found) < ROUNDING, 0.0, found) * size[seen] / size[seen][kept][:, None]
    combination = np.zeros((len(kept), len(made.names)))
    combination[:, seen] = found
    return Base(
        made, seen[kept], combination, tuple(written(row, made.names) for row in combination)
    )


def alike(Y: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Return the rows of Y (N, n, k), with as much weight for each motion: those near singular
    configurations, which need large forces, would hide the others."""
    sizes = np.linalg.norm(Y / units, axis=(1, 2))[:, None, None]
    return (Y / np.where(sizes > 0, sizes, 1.0)).reshape(-1, Y.shape[-1])


def independent(columns: np.ndarray) -> list[int]:
    """Return the columns of length 1, in order, that are no combination of the columns before them
    (Gram-Schmidt, twice): as many as singular values lie above their widest gap near rounding."""
    values = np.linalg.svd(columns, compute_uv=False)
    values = np.append(np.maximum(values / values[0], FLOOR), FLOOR)
    small = np.flatnonzero(values < DEPENDENT)
    rank = int(small[np.argmax(values[small - 1] / values[small])])
    above, below = values[rank - 1 : rank + 1]
    kept, rests = [], columns.copy()
    for k in range(columns.shape[1]):
        length = np.linalg.norm(rests[:, k])
        if length > np.sqrt(above * below):
            kept.append(k)
            own, others = rests[:, k] / length, rests[:, k + 1 :]
            for _ in range(2):
                others -= np.outer(own, own @ others)
    if above < GAP * below or len(kept) != rank:
        warnings.warn(
            f"how many base parameters there are is near rounding: {len(kept)} are told, but of "
            f"the singular values the last one that counts is {above:.1g}, the next one "
            f"{below:.1g}; give more samples",
            ModelWarning,
            stacklevel=4,
        )
    return kept


def random_motions(robot: Robot, samples: int, seed: int) -> tuple[State, np.ndarray]:
    """Return random closed states near the reference (N) with random rates, and accelerations
    (N, n)."""
    random = random_numbers(seed)
    q = random_configurations(robot, samples, random)
    sizes = (pace(robot) ** order * own_rates(robot, robot.home) for order in (1, 2))
    v, dv = (size * random.standard_normal((samples, robot.mobility)) for size in sizes)
    return robot.make_state(q, v), dv


def random_configurations(robot: Robot, samples: int, random: np.random.Generator) -> np.ndarray:
    """Return random closed configurations (N, nq): each as far from the reference, which is closed,
    as its loops close from there on its assembly mode."""
    tree, step = robot.equations.tree, of_any_length(robot.kernel("closure_step"))
    q = np.tile(robot.equations.reference, (samples, 1))
    away = SPREAD * tree.units * random.standard_normal(q.shape)
    open_ = np.arange(samples)
    for _ in range(HALVINGS):
        tried, good, *_ = closed(step, unit(tree, q + away)[open_], (), ROUNDS, contracting=False)
        good[good] = firm(robot, tried[good])
        good[good] = led_from_home(robot, tried[good])
        q[open_[good]], open_ = tried[good], open_[~good]
        away /= 2
    return q


def firm(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Tell at which configurations (N, nq) loops are far from letting go of a freedom: nearer, gaps
    that rounding leaves are motions that no loop allows, and branches are hard to tell apart."""
    return ~robot.equations.lost(robot.chart.constraint_jacobian(q))


def led_from_home(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Tell which closed configurations (N, nq) are on the assembly mode of the reference (N): those
    that it comes to where its independent coordinates are led there, straight and in small steps.
    """
    equations, step = robot.equations, of_any_length(robot.kernel("closure_step"))
    tree, home, free = equations.tree, equations.reference, {*equations.chart.independent}
    led = [place for place, k in tree.single if k in free]
    led += [place for places, ks in tree.quaternions if free & {*ks} for place in places]
    # A quaternion and its opposite are one orientation.
    goal, q = q.copy(), np.tile(home, (len(q), 1))
    for places, _ in tree.quaternions:
        goal[:, places] *= np.where(goal[:, places] @ home[places] < 0, -1.0, 1.0)[:, None]
    good = np.ones(len(q), bool)
    for left in range(STEPS, 0, -1):
        guess = q.copy()
        guess[:, led] += (goal[:, led] - q[:, led]) / left
        guess, closes, *_ = closed(step, unit(tree, guess), (), ROUNDS, contracting=False)
        good &= closes & (np.abs((guess - q) / tree.units).max(axis=1, initial=0.0) < LEAP)
        q = guess
    # Whole turns do not matter.
    apart, turning = (q - goal) / tree.units, [i for i, k in tree.single if not tree.slides[k]]
    apart[:, turning] -= TURN * np.round(apart[:, turning] / TURN)
    return good & (np.abs(apart).max(axis=1, initial=0.0) < NEAR)


def pace(robot: Robot) -> float:
    """Return the rate [1/s] of motions in which weight and inertia count alike; 1 where there is no
    weight."""
    return (
        float(np.linalg.norm(robot.mechanism.gravity) / robot.equations.tree.length) ** 0.5 or 1.0
    )


def written(row: np.ndarray, names: Sequence[str]) -> str:
    """Return a combination in words: "a.mass + 0.25 b.mass - 3 c.rotor_inertia"."""
    parts = []
    for k in np.flatnonzero(row).tolist():
        size = "" if abs(abs(row[k]) - 1) < 1e-9 else f"{abs(row[k]):.4g} "
        parts.append(f"{'-' if row[k] < 0 else '+'} {size}{names[k]}")
    return " ".join(parts).removeprefix("+ ")
